//! Geomview OFF, text and binary: `OFF`, `COFF`, `NOFF`, `STOFF` and mixtures; normals, colours and
//! texture coordinates are skipped. Numbers of a binary file have 32 bits, the most significant
//! byte first.
//!
//! Source: Geomview manual, "OFF Files". The keyword and the number of edges may be missing. Faces
//! of one or two corners, which OFF uses for points and segments, are counted and skipped.

use crate::binary::{Cursor, Endian, Scalar};
use crate::collect::{Collector, check_n_vertices, finite};
use crate::error::{Error, Name, Place, shown};
use crate::mesh::Positions;
use crate::text::{Line, Text, number};

pub(crate) fn read<'a>(bytes: &[u8], name: Name<'a>) -> Result<Collector<'a>, Error> {
    const COUNTS: &str = "the numbers of vertices and faces";
    let mut parts = Collector::new(name);
    let mut text = Text::new(name, bytes);
    let mut header = text.need_content_line(b'#', "'OFF'")?;
    let first = header.words().next().unwrap_or_default();
    if first.ends_with(b"OFF") {
        check_keyword(name, header, first)?;
        if header.words().nth(1) == Some(b"BINARY") {
            return read_binary(bytes, text.offset(), name, first);
        }
        let start = header
            .bytes
            .windows(3)
            .position(|w| w == b"OFF")
            .map_or(0, |ix| ix + 3);
        header.bytes = &header.bytes[start..];
        if header.is_blank() {
            header = text.need_content_line(b'#', COUNTS)?;
        }
    }
    let mut counts = [0u64; 2];
    let mut words = header.words();
    for count in &mut counts {
        let word = words
            .next()
            .ok_or_else(|| name.syntax(header.place(), COUNTS, "the end of the line"))?;
        *count = number(name, header.place(), word, COUNTS)?;
    }
    let [n_vertices, n_faces] = counts;
    check_n_vertices(name, header.place(), n_vertices)?;

    let mut positions = Vec::with_capacity(n_vertices.min(text.room(6)) as usize);
    for _ in 0..n_vertices {
        let Some(line) = text.content_line(b'#') else {
            return Err(name.count(text.place(), "vertices", n_vertices, positions.len() as u64));
        };
        let mut words = line.words();
        let mut position = [0.0; 3];
        for (axis, c) in ["x", "y", "z"].into_iter().zip(&mut position) {
            let word = words
                .next()
                .ok_or_else(|| name.syntax(line.place(), axis, "the end of the line"))?;
            *c = number(name, line.place(), word, axis)?;
        }
        positions.push(finite(name, line.place(), positions.len(), position)?);
    }
    parts.positions = Positions::F64(positions);

    parts.triangles.reserve(n_faces.min(text.room(8)) as usize);
    for n_read in 0..n_faces {
        let Some(line) = text.content_line(b'#') else {
            return Err(name.count(text.place(), "faces", n_faces, n_read));
        };
        face(&mut parts, line)?;
    }
    let mut rest = text.rest();
    while text.line().is_some_and(|line| line.before(b'#').is_blank()) {
        rest = text.rest();
    }
    parts.beyond(rest);
    Ok(parts)
}

/// Refuses the variants whose vertex lines do not start with `x y z`.
fn check_keyword(name: Name, header: Line, keyword: &[u8]) -> Result<(), Error> {
    let prefix = &keyword[..keyword.len() - 3];
    if prefix.iter().any(|b| matches!(b, b'4' | b'n')) {
        return Err(name.unsupported(
            header.place(),
            format!(
                "the keyword {} (vertices have three coordinates here)",
                shown(keyword)
            ),
        ));
    }
    if !matches!(
        prefix,
        b"" | b"C" | b"N" | b"CN" | b"ST" | b"STC" | b"STN" | b"STCN"
    ) {
        return Err(name.syntax(
            header.place(),
            "'OFF', 'COFF', 'NOFF', 'STOFF' or a mixture",
            shown(keyword),
        ));
    }
    Ok(())
}

/// Reads binary data that starts at `offset`, after a line with this keyword.
fn read_binary<'a>(
    bytes: &[u8],
    offset: usize,
    name: Name<'a>,
    keyword: &[u8],
) -> Result<Collector<'a>, Error> {
    let mut parts = Collector::new(name);
    let mut from = Cursor::new(name, bytes, offset, Endian::Big);
    let place = from.place();
    let n_vertices = from.count(Scalar::I32, "the number of vertices")?;
    let n_faces = from.count(Scalar::I32, "the number of faces")?;
    from.count(Scalar::I32, "the number of edges")?;
    check_n_vertices(name, place, n_vertices)?;

    // A vertex is its position, then a normal, a colour and texture coordinates where the keyword
    // says so.
    let has = |letter| keyword.contains(&letter);
    let n_floats =
        3 + 3 * usize::from(has(b'N')) + 4 * usize::from(has(b'C')) + 2 * usize::from(has(b'S'));
    let start = from.offset();
    let table = from.take(n_vertices, 4 * n_floats, "vertices")?;
    let mut positions = Vec::with_capacity(table.len() / (4 * n_floats));
    for (ix, vertex) in table.chunks_exact(4 * n_floats).enumerate() {
        let position = [0, 4, 8].map(|at| Scalar::F32.narrow(&vertex[at..], Endian::Big));
        let place = Place::Byte((start + 4 * n_floats * ix) as u64);
        finite(name, place, ix, position.map(f64::from))?;
        positions.push(position);
    }
    parts.positions = Positions::F32(positions);

    parts
        .triangles
        .reserve(n_faces.min(from.left() as u64 / 16) as usize);
    for _ in 0..n_faces {
        let place = from.place();
        let n_corners = from.count(Scalar::I32, "the number of corners")?;
        let corners = from.take(n_corners, 4, "corners")?;
        parts.corners.clear();
        for corner in corners.chunks_exact(4) {
            let index = Scalar::I32.integer(corner, Endian::Big);
            let corner = parts.vertex(index, 0, place)?;
            parts.corners.push(corner);
        }
        parts.face(place)?;
        let n_colors = from.count(Scalar::I32, "the number of colour components")?;
        from.take(n_colors, 4, "a colour")?;
    }
    parts.beyond(&bytes[from.offset()..]);
    Ok(parts)
}

/// A line `n i_1 … i_n`, perhaps with a colour after it.
fn face(parts: &mut Collector, line: Line) -> Result<(), Error> {
    let (name, place) = (parts.name, line.place());
    let mut words = line.words();
    let n_corners: u64 = number(
        name,
        place,
        words.next().unwrap_or_default(),
        "the number of corners",
    )?;
    parts.corners.clear();
    for n_read in 0..n_corners {
        let word = words
            .next()
            .ok_or_else(|| name.count(place, "corners", n_corners, n_read))?;
        let corner = parts.vertex(number(name, place, word, "a vertex index")?, 0, place)?;
        parts.corners.push(corner);
    }
    parts.face(place)
}
