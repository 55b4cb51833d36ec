//! Wavefront OBJ: `v` and `f`, and the names of objects and groups; materials, normals and texture
//! coordinates are skipped.
//!
//! Source: Wavefront, "Advanced Visualizer" manual, appendix B1. A file is read as one body, its
//! groups in their order, or as a body per object; per group if there are no objects, which often
//! have groups of one material each. Faces before the first of these are a body, too. A face may
//! name vertices that come later (positive indices); negative ones count back from the last vertex
//! so far. Faces of one or two corners, which some programs write for points and segments, are
//! counted and skipped. So are lines whose first word is not known.

use std::borrow::Cow;

use crate::bodies::PartName;
use crate::collect::{Collector, check_n_vertices, finite, vertex_ix};
use crate::error::{Error, Name, Place};
use crate::mesh::Positions;
use crate::text::{Line, Text, number};

pub(crate) fn read<'a>(bytes: &[u8], name: Name<'a>) -> Result<Collector<'a>, Error> {
    let read = statements(bytes, name);
    let has_vertices = read.as_ref().is_ok_and(|parts| !parts.positions.is_empty());
    match !has_vertices && bytes.iter().take(HEAD).any(|&byte| byte == 0) {
        // Some lines of other data begin as statements do, and what is wrong with them is of no
        // use.
        true => Err(name.syntax(Place::File, "the text of an OBJ file", "other data")),
        false => read,
    }
}

/// The bytes in which a file that is no text has a zero: all but one of ten million.
const HEAD: usize = 4096;

fn statements<'a>(bytes: &[u8], name: Name<'a>) -> Result<Collector<'a>, Error> {
    let mut parts = Collector::new(name);
    let mut positions: Vec<[f64; 3]> = Vec::new();
    // The greatest index of all faces and its place: checked once all vertices are known.
    let mut greatest = (0, Place::File);
    let mut has_objects = false;
    let mut n_known = 0u64;
    let mut text = Text::new(name, bytes);
    while let Some(line) = text.line() {
        let place = line.place();
        let joined = joined(line, &mut text);
        let statement = Line {
            bytes: &joined,
            number: line.number,
        };
        let mut words = statement.before(b'#').words();
        let word = words.next();
        n_known += u64::from(word.is_some_and(|word| STATEMENTS.contains(&word)));
        match word {
            Some(b"v") => {
                let mut position = [0.0; 3];
                for (axis, c) in ["x", "y", "z"].into_iter().zip(&mut position) {
                    let word = words
                        .next()
                        .ok_or_else(|| name.syntax(place, axis, "the end of the line"))?;
                    *c = number(name, place, word, axis)?;
                }
                positions.push(finite(name, place, positions.len(), position)?);
            }
            // Many files have one for every `v`.
            Some(b"vn" | b"vt") => {}
            Some(b"f") => {
                parts.corners.clear();
                for word in words {
                    let index = corner(name, place, word)?;
                    let n_so_far = positions.len() as u64;
                    parts.corners.push(match index {
                        1.. => {
                            greatest = if index > greatest.0 {
                                (index, place)
                            } else {
                                greatest
                            };
                            // An index that does not fit exceeds the greatest possible number of
                            // vertices, so the check at the end refuses it.
                            u32::try_from(index - 1).unwrap_or(u32::MAX)
                        }
                        ..0 => vertex_ix(name, index, -(positions.len() as i64), n_so_far, place)?,
                        0 => {
                            return Err(Error::Index {
                                at: name.at(place),
                                index,
                                first: 1,
                                n_vertices: n_so_far,
                            });
                        }
                    });
                }
                parts.face(place)?;
            }
            Some(word @ (b"o" | b"g")) => {
                if word == b"o" && !has_objects {
                    has_objects = true;
                    parts.forget_parts();
                }
                if (word == b"o") == has_objects {
                    let names: Vec<_> = words.map(String::from_utf8_lossy).collect();
                    let name = names.join(" ");
                    let name = match name.is_empty() {
                        true => PartName::StandIn("default"),
                        false => PartName::Given(&name),
                    };
                    // A group may go on later; each `o` begins another object.
                    // All share one list of vertices.
                    parts.begin_part(name, has_objects, 0);
                }
            }
            Some(b"l") => parts.n_lines += 1,
            Some(b"p") => parts.n_points += 1,
            Some(word @ (b"curv" | b"curv2" | b"surf" | b"vp")) => {
                let word = String::from_utf8_lossy(word);
                return Err(name.unsupported(
                    place,
                    format!("free-form geometry ('{word}'; only polygons are read)"),
                ));
            }
            Some(word) if !SKIPPED.contains(&word) => parts.unknown(statement),
            _ => {}
        }
    }
    if n_known == 0 && !bytes.is_ascii() {
        return Err(name.syntax(Place::File, "the text of an OBJ file", "other data"));
    }
    check_n_vertices(name, Place::File, positions.len() as u64)?;
    parts.positions = Positions::F64(positions);
    if greatest.0 > 0 {
        parts.vertex(greatest.0, 1, greatest.1)?;
    }
    Ok(parts)
}

/// Words that begin the lines of a file; one without any of them is none.
const STATEMENTS: [&[u8]; 12] = [
    b"v", b"vn", b"vt", b"f", b"o", b"g", b"l", b"p", b"s", b"mtllib", b"usemtl", b"vp",
];

/// Words of the format that say nothing of polygons and their names.
const SKIPPED: [&[u8]; 26] = [
    b"s",
    b"mg",
    b"usemtl",
    b"mtllib",
    b"usemap",
    b"maplib",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"shadow_obj",
    b"trace_obj",
    b"ctech",
    b"stech",
    // Of free-form geometry, which its other words refuse.
    b"cstype",
    b"deg",
    b"bmat",
    b"step",
    b"parm",
    b"trim",
    b"hole",
    b"scrv",
    b"sp",
    b"end",
    b"con",
    b"res",
];

/// The vertex index of a corner: `7`, `7/1`, `7//3` or `7/1/3`.
fn corner(name: Name, place: Place, word: &[u8]) -> Result<i64, Error> {
    let end = word.iter().position(|&b| b == b'/').unwrap_or(word.len());
    number(name, place, &word[..end], "a vertex index")
}

/// A line joined with its continuation lines; a backslash at the end of a line continues it.
fn joined<'t>(line: Line<'t>, text: &mut Text<'t>) -> Cow<'t, [u8]> {
    let Some(start) = line.bytes.strip_suffix(b"\\") else {
        return Cow::Borrowed(line.bytes);
    };
    let mut joined = start.to_vec();
    while let Some(next) = text.line() {
        joined.push(b' ');
        match next.bytes.strip_suffix(b"\\") {
            Some(part) => joined.extend_from_slice(part),
            None => {
                joined.extend_from_slice(next.bytes);
                break;
            }
        }
    }
    Cow::Owned(joined)
}
