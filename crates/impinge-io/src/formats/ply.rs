//! PLY: ascii and binary of either byte order; faces (polygons cut into triangles), triangle
//! strips, tetrahedra.
//!
//! Source: G. Turk, "The PLY Polygon File Format", 1994. The reader takes the elements `vertex` (x,
//! y, z), `face` and `tristrips` (a list `vertex_indices` or `vertex_index`; -1 starts a new
//! strip), and `tetra`, `tetrahedra`, `tet` or `tets` (such a list of four). `edge` is counted;
//! other elements and properties are skipped.

mod header;

pub use self::header::PlyLayout;
use self::header::{Element, Header, Kind, Property, Storage};
use crate::binary::{Cursor, Endian, Scalar};
use crate::collect::{Collector, finite, vertex_ix};
use crate::error::{Error, Name, Place, shown};
use crate::mesh::Positions;
use crate::text::{Line, Text, number};

pub(crate) fn read<'a>(bytes: &[u8], name: Name<'a>) -> Result<Collector<'a>, Error> {
    let mut text = Text::new(name, bytes);
    let header = Header::read(name, &mut text)?;
    let mut parts = Collector::new(name);
    match header.storage {
        Storage::Ascii => {
            for element in &header.elements {
                read_ascii(&mut parts, &header, element, &mut text)?;
            }
            parts.beyond(text.rest());
        }
        Storage::Binary(endian) => {
            let mut cursor = Cursor::new(name, bytes, text.offset(), endian);
            for element in &header.elements {
                read_binary(&mut parts, &header, element, &mut cursor)?;
            }
            parts.beyond(&bytes[cursor.offset()..]);
        }
    }
    Ok(parts)
}

/// Adds the primitives of one record, whose vertex list `corners` holds as in the file.
fn put(
    parts: &mut Collector,
    header: &Header,
    kind: Kind,
    indices: &[i64],
    place: Place,
) -> Result<(), Error> {
    let (name, n_vertices) = (parts.name, header.n_vertices);
    parts.corners.clear();
    match kind {
        Kind::Tristrips => {
            for &index in indices {
                if index == -1 {
                    parts.strip();
                    parts.corners.clear();
                } else {
                    parts
                        .corners
                        .push(vertex_ix(name, index, 0, n_vertices, place)?);
                }
            }
            parts.strip();
        }
        Kind::Tetrahedra => {
            let &[a, b, c, d] = indices else {
                return Err(name.count(place, "corners of a tetrahedron", 4, indices.len() as u64));
            };
            let corner = |index| vertex_ix(name, index, 0, n_vertices, place);
            parts
                .tetrahedra
                .push([corner(a)?, corner(b)?, corner(c)?, corner(d)?]);
        }
        Kind::Faces | Kind::Vertices | Kind::Edges | Kind::Other => {
            for &index in indices {
                parts
                    .corners
                    .push(vertex_ix(name, index, 0, n_vertices, place)?);
            }
            parts.polygon(place)?;
        }
    }
    Ok(())
}

/// Reserves room for as many primitives as an element announces, but for at most `room`.
fn reserve(parts: &mut Collector, element: &Element, room: u64) {
    let n = element.count.min(room) as usize;
    match element.kind {
        Kind::Faces => parts.triangles.reserve(n),
        Kind::Tetrahedra => parts.tetrahedra.reserve(n),
        _ => {}
    }
}

fn read_binary(
    parts: &mut Collector,
    header: &Header,
    element: &Element,
    cursor: &mut Cursor,
) -> Result<(), Error> {
    let endian = cursor.endian;
    if element.properties.is_empty() {
        return Ok(());
    }
    let chosen = element.vertex_list(parts.name)?;
    match (element.kind, element.stride()) {
        (Kind::Vertices, Some(stride)) => {
            let start = cursor.offset();
            let records = fixed_records(parts.name, element, stride, cursor)?;
            let place = |vertex| Place::Byte((start + vertex * stride) as u64);
            parts.positions = vertices(
                parts.name,
                records.chunks_exact(stride),
                element.xyz(parts.name)?,
                endian,
                place,
            )?;
            return Ok(());
        }
        (Kind::Vertices, None) => {
            let name = parts.name;
            return Err(name.unsupported(
                Place::Line(element.line),
                "a list property of the element 'vertex' in a binary file",
            ));
        }
        (kind, Some(stride)) => {
            fixed_records(parts.name, element, stride, cursor)?;
            parts.n_lines += if kind == Kind::Edges {
                element.count
            } else {
                0
            };
            return Ok(());
        }
        _ => {}
    }
    reserve(
        parts,
        element,
        (cursor.left() / element.least_size()) as u64 + 1,
    );
    let mut indices = Vec::new();
    for n_read in 0..element.count {
        let place = cursor.place();
        if cursor.left() < element.least_size() {
            return Err(fewer(parts.name, element, n_read, place));
        }
        for (ix, property) in element.properties.iter().enumerate() {
            match *property {
                Property::Scalar { scalar, .. } => {
                    cursor.take(1, scalar.size(), "a property")?;
                }
                Property::List { count, item, .. } => {
                    let n = cursor.count(count, "a list's length")?;
                    let items = cursor.take(n, item.size(), "a list")?;
                    if chosen == Some(ix) {
                        indices.clear();
                        indices.extend(
                            items
                                .chunks_exact(item.size())
                                .map(|bytes| item.integer(bytes, endian)),
                        );
                    }
                }
            }
        }
        if chosen.is_some() {
            put(parts, header, element.kind, &indices, place)?;
        }
        parts.n_lines += u64::from(element.kind == Kind::Edges);
    }
    Ok(())
}

/// The binary records of an element, all of one size.
fn fixed_records<'b>(
    name: Name,
    element: &Element,
    stride: usize,
    cursor: &mut Cursor<'b>,
) -> Result<&'b [u8], Error> {
    let n_left = (cursor.left() / stride) as u64;
    if n_left < element.count {
        return Err(fewer(name, element, n_left, cursor.place()));
    }
    cursor.take(element.count, stride, "the records of an element")
}

/// The error about an element with fewer records than announced.
fn fewer(name: Name, element: &Element, n_read: u64, place: Place) -> Error {
    let what = format!("records of the element '{}'", element.name);
    name.count(place, what, element.count, n_read)
}

/// The positions in binary records; `xyz` are the offsets and types of the coordinates.
fn vertices<'b>(
    name: Name,
    records: impl Iterator<Item = &'b [u8]>,
    xyz: [(usize, Scalar); 3],
    endian: Endian,
    place: impl Fn(usize) -> Place,
) -> Result<Positions, Error> {
    let f64s = |record: &[u8]| xyz.map(|(offset, scalar)| scalar.float(&record[offset..], endian));
    if !xyz.iter().all(|(_, scalar)| scalar.fits_f32()) {
        let positions = records
            .enumerate()
            .map(|(vertex, record)| finite(name, place(vertex), vertex, f64s(record)));
        return Ok(Positions::F64(positions.collect::<Result<_, Error>>()?));
    }
    let positions = records.enumerate().map(|(vertex, record)| {
        let position = xyz.map(|(offset, scalar)| scalar.narrow(&record[offset..], endian));
        finite(name, place(vertex), vertex, position.map(f64::from))?;
        Ok(position)
    });
    Ok(Positions::F32(positions.collect::<Result<_, Error>>()?))
}

fn read_ascii(
    parts: &mut Collector,
    header: &Header,
    element: &Element,
    text: &mut Text,
) -> Result<(), Error> {
    if element.properties.is_empty() {
        return Ok(());
    }
    if element.kind == Kind::Vertices {
        return read_ascii_vertices(parts, element, text);
    }
    let chosen = element.vertex_list(parts.name)?;
    reserve(parts, element, text.room(2 * element.properties.len()));
    let mut indices = Vec::new();
    for n_read in 0..element.count {
        let line = record(parts.name, element, n_read, text)?;
        let mut words = Words {
            name: parts.name,
            line,
            words: line.words(),
        };
        for (ix, property) in element.properties.iter().enumerate() {
            match property {
                Property::Scalar { .. } => {
                    words.next("a property")?;
                }
                Property::List { .. } => {
                    let n: u64 = words.number("a list's length")?;
                    indices.clear();
                    for _ in 0..n {
                        let word = words.next("an item of a list")?;
                        if chosen == Some(ix) {
                            indices.push(number(parts.name, line.place(), word, "a vertex index")?);
                        }
                    }
                    if chosen == Some(ix) {
                        put(parts, header, element.kind, &indices, line.place())?;
                    }
                }
            }
        }
        words.end()?;
        parts.n_lines += u64::from(element.kind == Kind::Edges);
    }
    Ok(())
}

fn read_ascii_vertices(
    parts: &mut Collector,
    element: &Element,
    text: &mut Text,
) -> Result<(), Error> {
    let name = parts.name;
    let axes = element.axes(name)?;
    let mut positions = Vec::with_capacity(element.count.min(text.room(6)) as usize);
    for n_read in 0..element.count {
        let line = record(name, element, n_read, text)?;
        let mut words = Words {
            name,
            line,
            words: line.words(),
        };
        let mut position = [0.0; 3];
        for (ix, property) in element.properties.iter().enumerate() {
            if let Property::List { .. } = property {
                let n: u64 = words.number("a list's length")?;
                for _ in 0..n {
                    words.next("an item of a list")?;
                }
            } else if let Some(axis) = axes.iter().position(|&axis| axis == ix) {
                position[axis] = words.number("a coordinate")?;
            } else {
                words.next("a property")?;
            }
        }
        words.end()?;
        positions.push(finite(name, line.place(), positions.len(), position)?);
    }
    parts.positions = Positions::F64(positions);
    Ok(())
}

/// The line of the next record of an element.
fn record<'t>(
    name: Name,
    element: &Element,
    n_read: u64,
    text: &mut Text<'t>,
) -> Result<Line<'t>, Error> {
    // A line can't contain '\n', so no part of it is taken for a comment.
    let line = text.content_line(b'\n');
    line.ok_or_else(|| fewer(name, element, n_read, text.place()))
}

/// The words of one record.
struct Words<'n, 't, I> {
    name: Name<'n>,
    line: Line<'t>,
    words: I,
}

impl<'t, I: Iterator<Item = &'t [u8]>> Words<'_, 't, I> {
    fn next(&mut self, expected: &str) -> Result<&'t [u8], Error> {
        self.words.next().ok_or_else(|| {
            self.name
                .syntax(self.line.place(), expected, "the end of the line")
        })
    }

    fn number<T: std::str::FromStr>(&mut self, expected: &str) -> Result<T, Error> {
        let word = self.next(expected)?;
        number(self.name, self.line.place(), word, expected)
    }

    fn end(&mut self) -> Result<(), Error> {
        match self.words.next() {
            None => Ok(()),
            Some(word) => {
                Err(self
                    .name
                    .syntax(self.line.place(), "the end of the line", shown(word)))
            }
        }
    }
}
