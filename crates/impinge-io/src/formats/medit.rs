//! Medit `.mesh`, ascii: vertices, triangles, quadrilaterals (cut into triangles), tetrahedra.
//!
//! Source: P. Frey, "MEDIT: An interactive mesh visualization software", INRIA RT-0253, 2001,
//! section 7.2. Edges and corners are counted; hexahedra, prisms and pyramids are refused; other
//! sections (normals, tangents, required vertices, …) are skipped up to the next keyword.

use crate::collect::{Collector, check_n_vertices, finite};
use crate::error::{Error, Name, shown};
use crate::mesh::Positions;
use crate::text::Text;

pub(crate) fn read<'a>(bytes: &[u8], name: Name<'a>) -> Result<Collector<'a>, Error> {
    let mut text = Text::new(name, bytes).with_comments(b'#');
    let mut parts = Collector::new(name);
    let mut has_vertices = false;
    let first = text.need_word("'MeshVersionFormatted'")?;
    if first != b"MeshVersionFormatted" {
        return Err(name.syntax(text.place(), "'MeshVersionFormatted'", shown(first)));
    }
    text.number::<u32>("a version")?;
    // Many programs write no 'End'.
    while let Some(keyword) = text.word() {
        let place = text.place();
        match keyword {
            b"End" => break,
            b"Dimension" => {
                let dimension: u32 = text.number("the dimension, 3")?;
                if dimension != 3 {
                    return Err(name.unsupported(
                        text.place(),
                        format!("dimension {dimension} (supported: 3)"),
                    ));
                }
            }
            b"Vertices" if has_vertices => {
                return Err(name.syntax(place, "one section 'Vertices'", "a second one"));
            }
            b"Vertices" => {
                has_vertices = true;
                vertices(&mut text, &mut parts)?;
            }
            b"Triangles" | b"Quadrilaterals" | b"Tetrahedra" if !has_vertices => {
                return Err(name.syntax(place, "'Vertices' first", shown(keyword)));
            }
            b"Triangles" => polygons(&mut text, &mut parts, 3)?,
            b"Quadrilaterals" => polygons(&mut text, &mut parts, 4)?,
            b"Tetrahedra" => tetrahedra(&mut text, &mut parts)?,
            b"Edges" => parts.n_lines += skip_section(&mut text)?,
            b"Corners" => parts.n_points += skip_section(&mut text)?,
            b"Hexahedra" | b"Hexaedra" | b"Prisms" | b"Pyramids" | b"Pentahedra" => {
                let n = skip_section(&mut text)?;
                if n > 0 {
                    let keyword = String::from_utf8_lossy(keyword);
                    return Err(name.unsupported(place, format!("the section '{keyword}' of {n} cells (supported: triangles, quadrilaterals and tetrahedra)")));
                }
            }
            other if other[0].is_ascii_alphabetic() => {
                skip_section(&mut text)?;
            }
            other => return Err(name.syntax(place, "a keyword", shown(other))),
        }
    }
    Ok(parts)
}

fn vertices(text: &mut Text, parts: &mut Collector) -> Result<(), Error> {
    let n: u64 = text.number("the number of vertices")?;
    check_n_vertices(parts.name, text.place(), n)?;
    let mut positions = Vec::with_capacity(n.min(text.room(8)) as usize);
    for _ in 0..n {
        let position = [text.number("x")?, text.number("y")?, text.number("z")?];
        positions.push(finite(parts.name, text.place(), positions.len(), position)?);
        text.need_word("a reference")?;
    }
    parts.positions = Positions::F64(positions);
    Ok(())
}

/// Reads one cell: corners, counted from 1, and a reference.
fn corners<const N: usize>(text: &mut Text, parts: &Collector) -> Result<[u32; N], Error> {
    let mut corners = [0; N];
    for corner in &mut corners {
        *corner = parts.vertex(text.number("a vertex index")?, 1, text.place())?;
    }
    text.need_word("a reference")?;
    Ok(corners)
}

fn polygons(text: &mut Text, parts: &mut Collector, n_corners: usize) -> Result<(), Error> {
    let n: u64 = text.number("the number of cells")?;
    parts
        .triangles
        .reserve(n.min(text.room(2 * (n_corners + 1))) as usize);
    for _ in 0..n {
        if n_corners == 3 {
            let triangle = corners(text, parts)?;
            parts.triangles.push(triangle);
        } else {
            parts.corners = corners::<4>(text, parts)?.to_vec();
            parts.polygon(text.place())?;
        }
    }
    Ok(())
}

fn tetrahedra(text: &mut Text, parts: &mut Collector) -> Result<(), Error> {
    let n: u64 = text.number("the number of cells")?;
    parts.tetrahedra.reserve(n.min(text.room(10)) as usize);
    for _ in 0..n {
        let tetrahedron = corners(text, parts)?;
        parts.tetrahedra.push(tetrahedron);
    }
    Ok(())
}

/// Skips a section up to the next keyword and returns the count at its start (0 if there is none).
fn skip_section(text: &mut Text) -> Result<u64, Error> {
    let mut n = None;
    while let Some(word) = text.peek_word() {
        if word[0].is_ascii_alphabetic() {
            break;
        }
        let word = text.need_word("a number")?;
        n = n.or(Some(
            std::str::from_utf8(word)
                .ok()
                .and_then(|word| word.parse().ok())
                .unwrap_or(0),
        ));
    }
    Ok(n.unwrap_or(0))
}
