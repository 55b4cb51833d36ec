//! Files of rows: one writer for all answers. A file exists whole or not at all; "-" is standard
//! output.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use impinge::exact::Feature;
use impinge::{Impact, NearPair, NearPairs};
use impinge_io::{AtomicFile, Cell, Column, ELEMENTS, Holds, KIND, Table, TableFormat};

use crate::error::Error;
use crate::origins::Origins;
use crate::output::out;
use crate::values::{RowsFile, RowsFormat};

#[cfg(feature = "parquet")]
mod parquet;

/// A file of rows that is being written.
pub struct Rows {
    path: PathBuf,
    format: Format,
}

/// How rows become bytes.
enum Format {
    Table {
        table: Table,
        /// `None` for standard output.
        file: Option<AtomicFile>,
        /// The rows written, if their number was not known before.
        n_late: Option<u64>,
    },
    #[cfg(feature = "parquet")]
    Parquet(parquet::Columns),
}

impl Rows {
    /// Starts a file. `n`: the number of rows, if it is known.
    pub fn create(file: &RowsFile, columns: Vec<Column>, n: Option<u64>) -> Result<Self, Error> {
        let format = match file.format {
            RowsFormat::Csv => TableFormat::Csv,
            RowsFormat::Jsonl => TableFormat::Jsonl,
            RowsFormat::Npy if file.is_stdout() && n.is_none() => {
                let text = "--rows-format npy: such a file begins with the number of its rows, which is not known yet: \
                            name a file instead of -";
                return Err(Error::Usage(text.to_owned()));
            }
            RowsFormat::Npy => TableFormat::Npy,
            #[cfg(feature = "parquet")]
            RowsFormat::Parquet => return Self::in_columns(file, &columns),
        };
        let path = file.path.clone();
        let table = Table::new(format, columns);
        let mut file = match file.is_stdout() {
            true => None,
            false => Some(AtomicFile::create(&path)?),
        };
        let header = table.header(n);
        write_to(&path, &mut file, |to| to.write_all(&header))?;
        let n_late = n.is_none().then_some(0);
        Ok(Rows {
            path,
            format: Format::Table {
                table,
                file,
                n_late,
            },
        })
    }

    #[cfg(feature = "parquet")]
    fn in_columns(file: &RowsFile, columns: &[Column]) -> Result<Self, Error> {
        if file.is_stdout() {
            let text = "--rows-format parquet: such a file is no text: name a file instead of -";
            return Err(Error::Usage(text.to_owned()));
        }
        let written = AtomicFile::create(&file.path)?;
        let columns = parquet::Columns::create(written, columns);
        Ok(Rows {
            path: file.path.clone(),
            format: Format::Parquet(columns.map_err(unwritten(&file.path))?),
        })
    }

    /// Adds rows.
    pub fn put<'a, R: AsRef<[Cell<'a>]>>(
        &mut self,
        rows: impl IntoIterator<Item = R>,
    ) -> Result<(), Error> {
        match &mut self.format {
            Format::Table {
                table,
                file,
                n_late,
            } => {
                let mut n = 0;
                write_to(&self.path, file, |to| {
                    rows.into_iter().try_for_each(|row| {
                        n += 1;
                        table.row(to, row.as_ref())
                    })
                })?;
                *n_late = n_late.map(|before| before + n);
                Ok(())
            }
            #[cfg(feature = "parquet")]
            Format::Parquet(columns) => {
                let put = rows
                    .into_iter()
                    .try_for_each(|row| columns.put(row.as_ref()));
                put.map_err(unwritten(&self.path))
            }
        }
    }

    /// Gives the file its name.
    pub fn finish(self) -> Result<(), Error> {
        match self.format {
            Format::Table { file: None, .. } => Ok(()),
            Format::Table {
                table,
                file: Some(mut file),
                n_late,
            } => {
                if let Some(header) = n_late.and_then(|n| table.late_header(n)) {
                    file.patch(0, &header)?;
                }
                Ok(file.finish()?)
            }
            #[cfg(feature = "parquet")]
            Format::Parquet(columns) => {
                let file = columns.finish().map_err(unwritten(&self.path))?;
                Ok(file.finish()?)
            }
        }
    }
}

fn unwritten(path: &Path) -> impl Fn(io::Error) -> Error {
    |source| Error::Write {
        path: path.to_owned(),
        source,
    }
}

/// Writes to a file, or to standard output.
fn write_to(
    path: &Path,
    file: &mut Option<AtomicFile>,
    act: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), Error> {
    match file {
        Some(file) => act(file).map_err(unwritten(path)),
        None => {
            let mut to = BufWriter::new(out());
            act(&mut to)?;
            Ok(to.flush()?)
        }
    }
}

/// Writes all rows of an answer.
pub fn write<'a, R: AsRef<[Cell<'a>]>>(
    file: &RowsFile,
    columns: Vec<Column>,
    n: usize,
    rows: impl IntoIterator<Item = R>,
) -> Result<(), Error> {
    let mut to = Rows::create(file, columns, Some(n as u64))?;
    to.put(rows)?;
    to.finish()
}

/// Some columns after the number of the frame.
pub fn of_frames(columns: &[Column]) -> Vec<Column> {
    [&[Column::new("frame", Holds::U32)], columns].concat()
}

/// The number of a frame.
pub fn frame(frame_ix: usize) -> Cell<'static> {
    number(frame_ix)
}

/// The number of a point or a ray.
pub fn number(ix: usize) -> Cell<'static> {
    Cell::Number(u32::try_from(ix).unwrap_or(u32::MAX))
}

/// The row of an impact.
pub fn impact(origins: &Origins, impact: &Impact) -> [Cell<'static>; 6] {
    let row = origins.row(impact.kind, impact.row());
    Cell::impact(impact.kind.name(), row, impact.toi)
}

/// Writes near pairs; distances and nearest points were asked for.
pub fn write_near(file: &RowsFile, origins: &Origins, near: &NearPairs) -> Result<(), Error> {
    let more = [
        // The longest is `EA0_EB1`.
        Column::new("type", Holds::Text(7)),
        Column::new("feature_a", Holds::Text(2)),
        Column::new("feature_b", Holds::Text(2)),
        Column::new("parallel", Holds::Bool),
        Column::new("distance", Holds::F64),
        Column::new("point_a", Holds::Point(["ax", "ay", "az"])),
        Column::new("point_b", Holds::Point(["bx", "by", "bz"])),
    ];
    let columns = [&[KIND][..], &ELEMENTS, &more].concat();
    write(
        file,
        columns,
        near.len(),
        near.iter().map(|pair| of_near(origins, &pair)),
    )
}

fn of_near(origins: &Origins, pair: &NearPair) -> [Cell<'static>; 12] {
    let row = origins.row(pair.kind, pair.row());
    let [body_a, a, body_b, b] = row.map(Cell::Number);
    let [feature_a, feature_b] = pair
        .features
        .map(|feature| Cell::Text(feature_name(feature)));
    let (distance, [point_a, point_b]) = pair
        .closest
        .map_or((f64::NAN, [[f64::NAN; 3]; 2]), |closest| {
            (closest.distance, closest.points)
        });
    [
        Cell::Text(pair.kind.name()),
        body_a,
        a,
        body_b,
        b,
        Cell::Text(pair.name()),
        feature_a,
        feature_b,
        Cell::Bool(pair.is_parallel),
        Cell::Float(distance),
        Cell::Point(point_a),
        Cell::Point(point_b),
    ]
}

/// The name of a feature of an element.
pub fn feature_name(feature: Feature) -> &'static str {
    match feature {
        Feature::Vertex(ix) => ["v0", "v1", "v2"][usize::from(ix)],
        Feature::Edge(ix) => ["e0", "e1", "e2"][usize::from(ix)],
        Feature::Face => "f",
    }
}
