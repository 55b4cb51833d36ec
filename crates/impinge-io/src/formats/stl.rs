//! STL, ascii and binary; each triangle has three vertices of its own; normals and attributes are
//! skipped.
//!
//! Source: 3D Systems, "StereoLithography Interface Specification", 1989. Several solids of an
//! ascii file become one body. Neighbours share no vertices here: weld to get a connected surface.

use crate::binary::{Cursor, Endian, Scalar};
use crate::collect::{Collector, check_n_vertices, finite};
use crate::error::{Error, Name, Place, shown};
use crate::mesh::Positions;
use crate::text::Text;

/// Bytes before the number of triangles.
const TITLE: usize = 80;
/// Bytes before the first triangle.
const START: usize = TITLE + 4;
/// Bytes per triangle: normal, three corners, attributes.
const RECORD: usize = 12 + 36 + 2;

pub(crate) fn read<'a>(bytes: &[u8], name: Name<'a>) -> Result<Collector<'a>, Error> {
    if is_binary(bytes) {
        return read_binary(bytes, name);
    }
    if bytes
        .strip_prefix(b"\xef\xbb\xbf")
        .unwrap_or(bytes)
        .trim_ascii_start()
        .get(..5)
        .is_some_and(|start| start.eq_ignore_ascii_case(b"solid"))
        && !bytes.contains(&0)
    {
        return read_ascii(bytes, name);
    }
    // Numbers of triangles have zeros; other text is no binary file that was cut.
    if !bytes.contains(&0) {
        let found = if bytes.is_empty() {
            "an empty file"
        } else {
            "other text"
        };
        let expected = "an STL file: text that begins with 'solid', or a binary file";
        return Err(name.syntax(Place::File, expected, found));
    }
    read_binary(bytes, name)
}

/// Whether this is a whole binary file. Titles may start with 'solid' too; only binary files have
/// exactly the length that they announce.
pub(crate) fn is_binary(bytes: &[u8]) -> bool {
    announced(bytes).is_some_and(|length| length == bytes.len() as u64)
}

/// The length of a binary file with this start.
fn announced(bytes: &[u8]) -> Option<u64> {
    let n = Scalar::U32.integer(bytes.get(TITLE..START)?, Endian::Little);
    Some(START as u64 + n.unsigned_abs() * RECORD as u64)
}

fn read_binary<'a>(bytes: &[u8], name: Name<'a>) -> Result<Collector<'a>, Error> {
    let mut cursor = Cursor::new(name, bytes, 0, Endian::Little);
    cursor.take(1, TITLE, "the title")?;
    let n = cursor.count(Scalar::U32, "the number of triangles")?;
    let records = cursor.take(n, RECORD, "the triangles")?;
    check_n_vertices(name, Place::Byte(TITLE as u64), 3 * n)?;
    let mut positions = Vec::with_capacity(records.len() / RECORD * 3);
    for (ix, record) in records.chunks_exact(RECORD).enumerate() {
        for corner in record[12..48].chunks_exact(12) {
            let position = [0, 4, 8].map(|at| Scalar::F32.narrow(&corner[at..], Endian::Little));
            let place = Place::Byte((START + ix * RECORD) as u64);
            finite(name, place, positions.len(), position.map(f64::from))?;
            positions.push(position);
        }
    }
    let mut parts = Collector::new(name);
    parts.beyond(&bytes[cursor.offset()..]);
    parts.triangles = soup(positions.len());
    parts.positions = Positions::F32(positions);
    Ok(parts)
}

fn read_ascii<'a>(bytes: &[u8], name: Name<'a>) -> Result<Collector<'a>, Error> {
    let mut text = Text::new(name, bytes);
    let mut positions: Vec<[f64; 3]> = Vec::new();
    let mut is_open = false;
    while let Some(word) = text.word() {
        let place = text.place();
        let is = |expected: &[u8]| word.eq_ignore_ascii_case(expected);
        if !is_open && is(b"solid") {
            is_open = true;
            text.line();
        } else if is_open && is(b"endsolid") {
            is_open = false;
            text.line();
        } else if is_open && is(b"facet") {
            expect(&mut text, name, &[b"normal"])?;
            for _ in 0..3 {
                // Normals are often nonsense, so they are not parsed as numbers.
                text.need_word("a normal")?;
            }
            expect(&mut text, name, &[b"outer", b"loop"])?;
            for _ in 0..3 {
                expect(&mut text, name, &[b"vertex"])?;
                let position = [text.number("x")?, text.number("y")?, text.number("z")?];
                positions.push(finite(name, text.place(), positions.len(), position)?);
            }
            expect(&mut text, name, &[b"endloop", b"endfacet"])?;
        } else {
            return Err(name.syntax(
                place,
                if is_open {
                    "'facet' or 'endsolid'"
                } else {
                    "'solid'"
                },
                shown(word),
            ));
        }
    }
    if is_open {
        return Err(name.syntax(text.place(), "'endsolid'", "the end of the file"));
    }
    check_n_vertices(name, Place::File, positions.len() as u64)?;
    let mut parts = Collector::new(name);
    parts.triangles = soup(positions.len());
    parts.positions = Positions::F64(positions);
    Ok(parts)
}

fn expect(text: &mut Text, name: Name, words: &[&[u8]]) -> Result<(), Error> {
    for expected in words {
        let word = text.need_word(&shown(expected))?;
        if !word.eq_ignore_ascii_case(expected) {
            return Err(name.syntax(text.place(), shown(expected), shown(word)));
        }
    }
    Ok(())
}

/// Triangles of three vertices each, in order; the number of vertices fits in u32.
fn soup(n_vertices: usize) -> Vec<[u32; 3]> {
    (0..n_vertices as u32 / 3)
        .map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2])
        .collect()
}
