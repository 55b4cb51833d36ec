//! Legacy VTK, ascii and binary (big endian): unstructured grids and polygonal data, versions 1 to
//! 5.1.
//!
//! Source: VTK File Formats (Kitware), "Simple legacy formats"; for the split cell arrays of
//! version 5.1, the VTK 9 release notes. Reading stops at point or cell data; fields and metadata
//! before them are skipped.

use super::cells;
use crate::binary::{Cursor, Endian, Scalar};
use crate::collect::{Collector, check_n_vertices, finite};
use crate::error::{Error, Name, Place, shown};
use crate::mesh::Positions;
use crate::text::Text;

pub(crate) fn read<'a>(bytes: &[u8], name: Name<'a>) -> Result<Collector<'a>, Error> {
    let mut file = File::open(bytes, name)?;
    let mut parts = Collector::new(name);
    let mut has_points = false;
    let mut grid: Option<Cells> = None;
    while let Some(keyword) = file.text.word() {
        let keyword = keyword.to_ascii_uppercase();
        let place = file.text.place();
        match keyword.as_slice() {
            b"POINTS" if has_points => {
                return Err(name.syntax(place, "one section POINTS", "a second one"));
            }
            b"POINTS" => {
                has_points = true;
                parts.positions = file.points()?;
            }
            b"CELLS" if file.is_grid => grid = Some(file.cells()?),
            b"CELL_TYPES" if file.is_grid => {
                let cells = grid
                    .take()
                    .ok_or_else(|| name.syntax(place, "CELLS before CELL_TYPES", "none"))?;
                file.typed_cells(&cells, &mut parts)?;
            }
            b"VERTICES" | b"LINES" | b"POLYGONS" | b"TRIANGLE_STRIPS" if !file.is_grid => {
                let kind = match keyword.as_slice() {
                    b"VERTICES" => 2,
                    b"LINES" => 4,
                    b"POLYGONS" => 7,
                    _ => 6,
                };
                let section = file.cells()?;
                for cell in 0..section.n_cells {
                    let (indices, at) = section.cell(&file, cell)?;
                    // Finding the place takes time, so it is done for errors only.
                    cells::put(&mut parts, kind, indices, Place::File).or_else(|_| {
                        cells::put(&mut parts, kind, indices, section.connectivity.place(at))
                    })?;
                }
            }
            b"FIELD" => file.skip_field()?,
            b"METADATA" => file.skip_metadata(),
            b"POINT_DATA" | b"CELL_DATA" => break,
            other => return Err(name.syntax(place, "a section of the dataset", shown(other))),
        }
    }
    if grid.is_some() {
        return Err(name.syntax(file.text.place(), "CELL_TYPES", "none"));
    }
    Ok(parts)
}

/// A position in the file after its header.
struct File<'a> {
    name: Name<'a>,
    bytes: &'a [u8],
    text: Text<'a>,
    is_binary: bool,
    /// Version 5: offsets and connectivity of cells are separate arrays.
    is_split: bool,
    /// Whether the dataset is an unstructured grid, else polygonal data.
    is_grid: bool,
}

/// Integers of the file, with enough information to find the place of each.
struct Integers<'a> {
    values: Vec<i64>,
    start: Start<'a>,
}

enum Start<'a> {
    Text(Text<'a>),
    Binary { offset: usize, size: usize },
}

impl Integers<'_> {
    /// The place of value `ix`. It reads the text again up to there, so use it for errors only.
    fn place(&self, ix: usize) -> Place {
        match &self.start {
            Start::Text(text) => {
                let mut text = text.clone();
                for _ in 0..=ix {
                    text.word();
                }
                text.place()
            }
            Start::Binary { offset, size } => Place::Byte((offset + ix * size) as u64),
        }
    }
}

/// A section of cells.
struct Cells<'a> {
    n_cells: u64,
    connectivity: Integers<'a>,
    /// Where each cell starts in the connectivity, and the end of the last.
    starts: Vec<usize>,
    /// Numbers before the point indices of each cell: 1 for the count, 0 if offsets are separate.
    n_before: usize,
}

impl Cells<'_> {
    /// The point indices of a cell, and where in the connectivity they start.
    fn cell(&self, file: &File, cell: u64) -> Result<(&[i64], usize), Error> {
        let cell = cell as usize;
        let (start, end) = (self.starts[cell] + self.n_before, self.starts[cell + 1]);
        let indices = self.connectivity.values.get(start..end);
        Ok((
            indices.ok_or_else(|| {
                file.name.syntax(
                    file.text.place(),
                    "cells within their section",
                    format!("cell {cell} beyond it"),
                )
            })?,
            start,
        ))
    }
}

impl<'a> File<'a> {
    fn open(bytes: &'a [u8], name: Name<'a>) -> Result<Self, Error> {
        const MAGIC: &[u8] = b"# vtk DataFile Version";
        let mut text = Text::new(name, bytes);
        let magic = text.line().map_or(&[][..], |line| line.bytes);
        let Some(version) = magic.strip_prefix(MAGIC) else {
            return Err(name.syntax(Place::Line(1), shown(MAGIC), shown(magic)));
        };
        let is_split = version
            .trim_ascii()
            .first()
            .is_some_and(|digit| (b'5'..=b'9').contains(digit));
        text.line();
        let is_binary = match text
            .need_word("'ASCII' or 'BINARY'")?
            .to_ascii_uppercase()
            .as_slice()
        {
            b"ASCII" => false,
            b"BINARY" => true,
            other => return Err(name.syntax(text.place(), "'ASCII' or 'BINARY'", shown(other))),
        };
        let dataset = text.need_word("'DATASET'")?;
        if !dataset.eq_ignore_ascii_case(b"DATASET") {
            return Err(name.syntax(text.place(), "'DATASET'", shown(dataset)));
        }
        let is_grid = match text
            .need_word("a kind of dataset")?
            .to_ascii_uppercase()
            .as_slice()
        {
            b"UNSTRUCTURED_GRID" => true,
            b"POLYDATA" => false,
            other => {
                return Err(name.unsupported(
                    text.place(),
                    format!(
                        "the dataset {} (supported: UNSTRUCTURED_GRID and POLYDATA)",
                        shown(other)
                    ),
                ));
            }
        };
        if is_binary {
            text = text.in_bytes(0);
        }
        Ok(File {
            name,
            bytes,
            text,
            is_binary,
            is_split,
            is_grid,
        })
    }

    /// The next word as the name of a type of number.
    fn scalar(&mut self) -> Result<Scalar, Error> {
        let word = self
            .text
            .need_word("a type of number")?
            .to_ascii_lowercase();
        Ok(match word.as_slice() {
            b"char" | b"signed_char" | b"vtktypeint8" => Scalar::I8,
            b"unsigned_char" | b"vtktypeuint8" => Scalar::U8,
            b"short" | b"vtktypeint16" => Scalar::I16,
            b"unsigned_short" | b"vtktypeuint16" => Scalar::U16,
            b"int" | b"vtkidtype" | b"vtktypeint32" => Scalar::I32,
            b"unsigned_int" | b"vtktypeuint32" => Scalar::U32,
            b"long" | b"vtktypeint64" => Scalar::I64,
            b"unsigned_long" | b"vtktypeuint64" => Scalar::U64,
            b"float" => Scalar::F32,
            b"double" => Scalar::F64,
            other => {
                return Err(self.name.unsupported(
                    self.text.place(),
                    format!("the type of numbers {}", shown(other)),
                ));
            }
        })
    }

    /// The next `n` binary numbers, which start on a new line, and their offset.
    fn take(&mut self, n: u64, scalar: Scalar, what: &str) -> Result<(&'a [u8], usize), Error> {
        self.text.line();
        let mut cursor = Cursor::new(self.name, self.bytes, self.text.offset(), Endian::Big);
        let start = cursor.offset();
        let bytes = cursor.take(n, scalar.size(), what)?;
        self.text.skip(bytes.len());
        Ok((bytes, start))
    }

    fn points(&mut self) -> Result<Positions, Error> {
        let n: u64 = self.text.number("the number of points")?;
        check_n_vertices(self.name, self.text.place(), n)?;
        let scalar = self.scalar()?;
        let name = self.name;
        if !self.is_binary {
            let mut positions = Vec::with_capacity(n.min(self.text.room(6)) as usize);
            for _ in 0..n {
                let position = [
                    self.text.number("x")?,
                    self.text.number("y")?,
                    self.text.number("z")?,
                ];
                positions.push(finite(name, self.text.place(), positions.len(), position)?);
            }
            return Ok(Positions::F64(positions));
        }
        let (bytes, start) = self.take(3 * n, scalar, "the points")?;
        super::positions(name, bytes, scalar, Endian::Big, |vertex| {
            Place::Byte((start + vertex * 3 * scalar.size()) as u64)
        })
    }

    fn integers(&mut self, n: u64, scalar: Scalar, what: &str) -> Result<Integers<'a>, Error> {
        if !self.is_binary {
            let start = Start::Text(self.text.clone());
            let mut values = Vec::with_capacity(n.min(self.text.room(2)) as usize);
            for _ in 0..n {
                values.push(self.text.number(what)?);
            }
            return Ok(Integers { values, start });
        }
        let (bytes, offset) = self.take(n, scalar, what)?;
        let size = scalar.size();
        let values = bytes
            .chunks_exact(size)
            .map(|bytes| scalar.integer(bytes, Endian::Big))
            .collect();
        Ok(Integers {
            values,
            start: Start::Binary { offset, size },
        })
    }

    /// Reads a section of cells, after its keyword.
    fn cells(&mut self) -> Result<Cells<'a>, Error> {
        let n: u64 = self.text.number("a count")?;
        let size: u64 = self.text.number("a size")?;
        let place = self.text.place();
        let name = self.name;
        if !self.is_split {
            let connectivity = self.integers(size, Scalar::I32, "a cell's size or point index")?;
            let mut starts =
                Vec::with_capacity(n.min(size).min(connectivity.values.len() as u64) as usize + 1);
            let mut at = 0usize;
            for cell in 0..n {
                starts.push(at);
                let n_points = connectivity
                    .values
                    .get(at)
                    .ok_or_else(|| name.count(place, "cells", n, cell))?;
                let end = usize::try_from(*n_points)
                    .ok()
                    .and_then(|n_points| at.checked_add(1 + n_points))
                    .filter(|&end| end <= connectivity.values.len());
                at = end.ok_or_else(|| {
                    let left = connectivity.values.len() - at - 1;
                    name.syntax(
                        connectivity.place(at),
                        format!("the size of cell {cell}, 0 to {left}"),
                        n_points.to_string(),
                    )
                })?;
            }
            starts.push(at);
            return Ok(Cells {
                n_cells: n,
                connectivity,
                starts,
                n_before: 1,
            });
        }
        let mut array = |keyword: &[u8], n: u64, what: &str| {
            let word = self.text.need_word(&shown(keyword))?;
            if !word.eq_ignore_ascii_case(keyword) {
                return Err(name.syntax(self.text.place(), shown(keyword), shown(word)));
            }
            let scalar = self.scalar()?;
            self.integers(n, scalar, what)
        };
        let offsets = array(b"OFFSETS", n, "an offset")?;
        let connectivity = array(b"CONNECTIVITY", size, "a point index")?;
        let mut starts = Vec::with_capacity(offsets.values.len().max(1));
        for (ix, &offset) in offsets.values.iter().enumerate() {
            let least = starts.last().copied().unwrap_or(0);
            let most = connectivity.values.len();
            let start = usize::try_from(offset)
                .ok()
                .filter(|start| (least..=most).contains(start));
            starts.push(start.ok_or_else(|| {
                name.syntax(
                    offsets.place(ix),
                    format!("an offset, {least} to {most}"),
                    offset.to_string(),
                )
            })?);
        }
        Ok(Cells {
            n_cells: n.saturating_sub(1),
            connectivity,
            starts,
            n_before: 0,
        })
    }

    /// Reads the types of `cells`, after the keyword, and adds the cells to `parts`.
    fn typed_cells(&mut self, cells: &Cells, parts: &mut Collector) -> Result<(), Error> {
        let n: u64 = self.text.number("the number of types")?;
        let place = self.text.place();
        if n != cells.n_cells {
            return Err(self.name.count(place, "cell types", cells.n_cells, n));
        }
        let types = self.integers(n, Scalar::I32, "a cell type")?;
        for (cell, &kind) in (0u64..).zip(&types.values) {
            let (indices, at) = cells.cell(self, cell)?;
            cells::put(parts, kind, indices, Place::File).or_else(|error| {
                // Finding the place takes time, so it is done for errors only.
                let place = if matches!(error, Error::Index { .. }) {
                    cells.connectivity.place(at)
                } else {
                    types.place(cell as usize)
                };
                cells::put(parts, kind, indices, place)
            })?;
        }
        Ok(())
    }

    /// Skips a field, after its keyword.
    fn skip_field(&mut self) -> Result<(), Error> {
        self.text.need_word("the name of a field")?;
        let n_arrays: u64 = self.text.number("the number of arrays")?;
        for _ in 0..n_arrays {
            if self
                .text
                .peek_word()
                .is_some_and(|word| word == b"METADATA")
            {
                self.text.word();
                self.skip_metadata();
            }
            self.text.need_word("the name of an array")?;
            let n_components: u64 = self.text.number("the number of components")?;
            let n_tuples: u64 = self.text.number("the number of tuples")?;
            let n = n_components.saturating_mul(n_tuples);
            let scalar = self.scalar()?;
            if self.is_binary {
                self.take(n, scalar, "a field")?;
            } else {
                for _ in 0..n {
                    self.text.need_word("a value")?;
                }
            }
        }
        Ok(())
    }

    /// Skips metadata, after its keyword, up to an empty line.
    fn skip_metadata(&mut self) {
        self.text.line();
        while self.text.line().is_some_and(|line| !line.is_blank()) {}
    }
}
