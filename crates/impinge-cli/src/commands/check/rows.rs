//! `check --rows`: a table with a row per mesh, without places.

use impinge_check::{KeyKind, Row};
use impinge_io::{Cell, Column, Holds};
use serde_json::Value;

use crate::error::Error;
use crate::rows;
use crate::values::{RowsFile, RowsFormat};

/// Refuses a file that cannot hold text, and standard output, where the answer is.
pub fn refuse(file: &RowsFile) -> Result<(), Error> {
    let text = match file {
        file if file.is_stdout() => {
            "--rows -: the answer is on standard output: name a file, or use --json"
        }
        file if file.format == RowsFormat::Npy => {
            "--rows: rows of meshes hold text, which arrays do not: use .csv, .jsonl or .parquet"
        }
        _ => return Ok(()),
    };
    Err(Error::Usage(text.to_owned()))
}

/// Writes the rows.
pub fn write(file: &RowsFile, rows: &[Row]) -> Result<(), Error> {
    let columns = Row::KEYS.map(|(name, kind)| {
        let holds = match kind {
            KeyKind::Text => Holds::Line,
            KeyKind::Flag => Holds::Bool,
            KeyKind::Count => Holds::Count,
            KeyKind::Number => Holds::F64,
        };
        Column::new(name, holds).or_none()
    });
    let objects = rows.iter().map(Row::to_json).collect::<Vec<_>>();
    let cells = objects.iter().map(|object| {
        Row::KEYS.map(|(name, kind)| match &object[name] {
            Value::Bool(is_so) => Cell::Bool(*is_so),
            Value::Number(n) if kind == KeyKind::Count => {
                Cell::Count(n.as_i64().unwrap_or(i64::MAX))
            }
            Value::Number(x) => Cell::Float(x.as_f64().unwrap_or(f64::NAN)),
            Value::String(text) => Cell::Line(text),
            _ => Cell::None,
        })
    });
    rows::write(file, columns.to_vec(), rows.len(), cells)
}
