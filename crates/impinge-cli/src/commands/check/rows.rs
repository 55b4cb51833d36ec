//! `check --rows`: a table with a row per mesh, without places.

use impinge_check::Row;

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
    let objects: Vec<_> = rows.iter().map(Row::to_json).collect();
    let cells = objects.iter().map(Row::cells);
    rows::write(file, Row::COLUMNS.to_vec(), rows.len(), cells)
}
