//! TetGen: vertices in `.node`, tetrahedra in `.ele`, triangles in `.face`.
//!
//! Source: H. Si, "TetGen, A Quality Tetrahedral Mesh Generator", manual, section "File formats".
//! Vertices are numbered from 0 or 1; the first line of the `.node` file decides. Attributes and
//! markers are skipped; tetrahedra with mid-edge nodes are refused.

use std::path::{Path, PathBuf};

use crate::collect::{Collector, check_n_vertices, finite, vertex_ix};
use crate::encoding::check_encoding;
use crate::error::{Error, Name};
use crate::format::Format;
use crate::mesh::Positions;
use crate::text::{Line, Text, number};

/// The `.node` file and the file of cells that belong to `path`, which is one of them. The cells
/// are in `.ele` if it exists, else in `.face`.
pub(crate) fn paths(path: &Path) -> (PathBuf, PathBuf) {
    let is_face = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("face"));
    let cells = path.with_extension("ele");
    let face = path.with_extension("face");
    (
        path.with_extension("node"),
        if is_face || (!cells.exists() && face.exists()) {
            face
        } else {
            cells
        },
    )
}

pub(crate) fn read<'a>(
    nodes: &[u8],
    nodes_name: Name<'a>,
    cells: &[u8],
    cells_name: Name,
) -> Result<Collector<'a>, Error> {
    check_encoding(nodes, Format::Tetgen, nodes_name)?;
    check_encoding(cells, Format::Tetgen, cells_name)?;
    let mut parts = Collector::new(nodes_name);
    let first = read_nodes(nodes, &mut parts)?;
    let is_face = Path::new(cells_name.0)
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("face"));
    read_cells(cells, cells_name, first, is_face, &mut parts)?;
    Ok(parts)
}

/// The next `N` numbers of a line.
fn numbers<'t, T: std::str::FromStr + Copy + Default, const N: usize>(
    name: Name,
    line: Line,
    words: &mut impl Iterator<Item = &'t [u8]>,
    expected: &str,
) -> Result<[T; N], Error> {
    let mut numbers = [T::default(); N];
    for value in &mut numbers {
        let word = words
            .next()
            .ok_or_else(|| name.syntax(line.place(), expected, "the end of the line"))?;
        *value = number(name, line.place(), word, expected)?;
    }
    Ok(numbers)
}

/// Reads all vertices and returns the number of the first.
fn read_nodes(bytes: &[u8], parts: &mut Collector) -> Result<i64, Error> {
    let name = parts.name;
    let mut text = Text::new(name, bytes);
    let header = text.need_content_line(b'#', "the number of vertices")?;
    let [n, dimension]: [u64; 2] = numbers(
        name,
        header,
        &mut header.words(),
        "the numbers of vertices and dimensions",
    )?;
    check_n_vertices(name, header.place(), n)?;
    if dimension != 3 {
        return Err(name.unsupported(
            header.place(),
            format!("dimension {dimension} (supported: 3)"),
        ));
    }
    let mut positions = Vec::with_capacity(n.min(text.room(8)) as usize);
    let mut first = 0;
    for ix in 0..n {
        let Some(line) = text.content_line(b'#') else {
            return Err(name.count(text.place(), "vertices", n, ix));
        };
        let mut words = line.words();
        let [vertex]: [i64; 1] = numbers(name, line, &mut words, "the number of a vertex")?;
        if ix == 0 {
            if !(0..=1).contains(&vertex) {
                return Err(name.syntax(
                    line.place(),
                    "the number of the first vertex, 0 or 1",
                    vertex.to_string(),
                ));
            }
            first = vertex;
        }
        // At most 2^32 vertices: no overflow.
        let expected = first + ix as i64;
        if vertex != expected {
            return Err(name.syntax(
                line.place(),
                format!("vertex number {expected}"),
                vertex.to_string(),
            ));
        }
        let position = numbers(name, line, &mut words, "a coordinate")?;
        positions.push(finite(name, line.place(), positions.len(), position)?);
    }
    parts.positions = Positions::F64(positions);
    Ok(first)
}

/// Reads tetrahedra, or triangles where `is_face`.
fn read_cells(
    bytes: &[u8],
    name: Name,
    first: i64,
    is_face: bool,
    parts: &mut Collector,
) -> Result<(), Error> {
    const COUNT: &str = "the number of cells";
    let mut text = Text::new(name, bytes);
    let header = text.need_content_line(b'#', COUNT)?;
    let mut words = header.words();
    let [n]: [u64; 1] = numbers(name, header, &mut words, COUNT)?;
    if !is_face {
        let [n_corners]: [u64; 1] = numbers(name, header, &mut words, "the number of corners, 4")?;
        if n_corners != 4 {
            return Err(name.unsupported(
                header.place(),
                format!("a tetrahedron of {n_corners} nodes (supported: 4)"),
            ));
        }
    }
    let room = n.min(text.room(8)) as usize;
    if is_face {
        parts.triangles.reserve(room)
    } else {
        parts.tetrahedra.reserve(room)
    }
    let n_vertices = parts.n_vertices();
    for ix in 0..n {
        let Some(line) = text.content_line(b'#') else {
            return Err(name.count(text.place(), "cells", n, ix));
        };
        let mut words = line.words();
        let [_number]: [i64; 1] = numbers(name, line, &mut words, "the number of a cell")?;
        let corner = |index| vertex_ix(name, index, first, n_vertices, line.place());
        if is_face {
            let [a, b, c] = numbers(name, line, &mut words, "a vertex index")?;
            parts.triangles.push([corner(a)?, corner(b)?, corner(c)?]);
        } else {
            let [a, b, c, d] = numbers(name, line, &mut words, "a vertex index")?;
            parts
                .tetrahedra
                .push([corner(a)?, corner(b)?, corner(c)?, corner(d)?]);
        }
    }
    Ok(())
}
