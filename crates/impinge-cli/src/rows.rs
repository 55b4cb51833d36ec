//! Files of rows: one writer for all answers. A file exists whole or not at all; "-" is standard
//! output.

use std::io::{BufWriter, Write};
use std::path::PathBuf;

use impinge::exact::Feature;
use impinge::{Impact, NearPair, NearPairs};
use impinge_io::{AtomicFile, Cell, Column, ELEMENTS, Holds, KIND, Table, TableFormat};

use crate::error::Error;
use crate::output::out;
use crate::values::RowsFile;

/// A file of rows that is being written.
pub struct Rows {
    table: Table,
    path: PathBuf,
    /// `None` for standard output.
    file: Option<AtomicFile>,
    /// The rows written, if their number was not known before.
    n_late: Option<u64>,
}

impl Rows {
    /// Starts a file. `n`: the number of rows, if it is known.
    pub fn create(file: &RowsFile, columns: Vec<Column>, n: Option<u64>) -> Result<Self, Error> {
        if file.is_stdout() && n.is_none() && file.format == TableFormat::Npy {
            let text = "--rows-format npy: such a file begins with the number of its rows, which is not known yet: \
                        name a file instead of -";
            return Err(Error::Usage(text.to_owned()));
        }
        let mut rows = Rows {
            table: Table::new(file.format, columns),
            path: file.path.clone(),
            file: match file.is_stdout() {
                true => None,
                false => Some(AtomicFile::create(&file.path)?),
            },
            n_late: n.is_none().then_some(0),
        };
        let header = rows.table.header(n);
        rows.act(|_, to| to.write_all(&header))?;
        Ok(rows)
    }

    /// Adds rows.
    pub fn put<'a, const N: usize>(
        &mut self,
        rows: impl IntoIterator<Item = [Cell<'a>; N]>,
    ) -> Result<(), Error> {
        let mut n = 0;
        self.act(|table, to| {
            rows.into_iter().try_for_each(|row| {
                n += 1;
                table.row(to, &row)
            })
        })?;
        self.n_late = self.n_late.map(|before| before + n);
        Ok(())
    }

    fn act(
        &mut self,
        act: impl FnOnce(&Table, &mut dyn Write) -> std::io::Result<()>,
    ) -> Result<(), Error> {
        match &mut self.file {
            Some(file) => act(&self.table, file).map_err(|source| Error::Write {
                path: self.path.clone(),
                source,
            }),
            None => {
                let mut to = BufWriter::new(out());
                act(&self.table, &mut to)?;
                Ok(to.flush()?)
            }
        }
    }

    /// Gives the file its name.
    pub fn finish(self) -> Result<(), Error> {
        let Some(mut file) = self.file else {
            return Ok(());
        };
        if let Some(header) = self.n_late.and_then(|n| self.table.late_header(n)) {
            file.patch(0, &header)?;
        }
        Ok(file.finish()?)
    }
}

/// Writes all rows of an answer.
pub fn write<'a, const N: usize>(
    file: &RowsFile,
    columns: Vec<Column>,
    n: usize,
    rows: impl IntoIterator<Item = [Cell<'a>; N]>,
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
pub fn impact(impact: &Impact) -> [Cell<'static>; 6] {
    Cell::impact(impact.kind.name(), impact.row(), impact.toi)
}

/// Writes near pairs; distances and nearest points were asked for.
pub fn write_near(file: &RowsFile, near: &NearPairs) -> Result<(), Error> {
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
        near.iter().map(|pair| of_near(&pair)),
    )
}

fn of_near(pair: &NearPair) -> [Cell<'static>; 12] {
    let [body_a, a, body_b, b] = pair.row().map(Cell::Number);
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
