//! Writing polylines: curves without faces.

use std::fmt::Write as _;
use std::path::Path;

use super::atomic::AtomicFile;
use super::vtu::{Appended, document};
use crate::error::{Error, Name, Place};

/// Curves to be written.
#[derive(Debug, Clone, Copy)]
pub struct Polylines<'a> {
    /// The positions of the points.
    pub points: &'a [[f64; 3]],
    /// Each curve as point indices in order, and whether it is closed (leads back from its last
    /// point to its first).
    pub curves: &'a [(&'a [u32], bool)],
}

/// VTK's cell type for a polyline.
const POLY_LINE: u8 = 4;

impl Polylines<'_> {
    fn check(&self, path: &Path) -> Result<(), Error> {
        let name = path.display().to_string();
        let limit = u64::from(i32::MAX.unsigned_abs());
        let n_vertices = self.points.len() as u64;
        if n_vertices > limit {
            return Err(Name(&name).too_large(Place::File, "number of points", limit, n_vertices));
        }
        let indices = self.curves.iter().flat_map(|(points, _)| *points);
        match indices.max().filter(|&&ix| u64::from(ix) >= n_vertices) {
            Some(&index) => Err(Error::Index {
                at: Name(&name).at(Place::File),
                index: i64::from(index),
                first: 0,
                n_vertices,
            }),
            None => Ok(()),
        }
    }

    /// The points of a curve, a closed one with its first point again at the end.
    fn points(&self, curve: usize) -> impl Iterator<Item = u32> + '_ {
        let (points, is_closed) = self.curves[curve];
        let again = points.first().filter(|_| is_closed);
        points.iter().chain(again).copied()
    }
}

/// Writes curves as a Wavefront OBJ file: `v` for each point, `l` for each curve (a closed one ends
/// with its first point). Coordinates have as many digits as needed to read the same `f64` back.
///
/// # Errors
/// [`Error::Io`]; [`Error::Index`] if a curve names a point that does not exist.
pub fn write_polylines_obj(path: &Path, lines: &Polylines) -> Result<(), Error> {
    lines.check(path)?;
    let mut file = AtomicFile::create(path)?;
    for [x, y, z] in lines.points {
        file.put(format!("v {x} {y} {z}\n").as_bytes())?;
    }
    for curve in 0..lines.curves.len() {
        let mut text = String::from("l");
        for point in lines.points(curve) {
            // Writing to a string can't fail.
            let _ = write!(text, " {}", point + 1);
        }
        text.push('\n');
        file.put(text.as_bytes())?;
    }
    file.finish()
}

/// Writes curves as a binary PLY file: elements `vertex` (x, y, z as double) and `edge` (vertex1,
/// vertex2 as int, and `curve`, the number of its curve).
///
/// # Errors
/// As [`write_polylines_obj`].
pub fn write_polylines_ply(path: &Path, lines: &Polylines) -> Result<(), Error> {
    lines.check(path)?;
    let mut edges = Vec::new();
    let mut n_edges = 0;
    for (number, curve) in (0i32..).zip(0..lines.curves.len()) {
        let points: Vec<u32> = lines.points(curve).collect();
        for ends in points.windows(2) {
            for value in [ends[0].cast_signed(), ends[1].cast_signed(), number] {
                edges.extend(value.to_le_bytes());
            }
            n_edges += 1;
        }
    }
    let mut file = AtomicFile::create(path)?;
    file.put(
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\n\
             property double x\nproperty double y\nproperty double z\nelement edge {n_edges}\n\
             property int vertex1\nproperty int vertex2\nproperty int curve\nend_header\n",
            lines.points.len(),
        )
        .as_bytes(),
    )?;
    for x in lines.points.as_flattened() {
        file.put(&x.to_le_bytes())?;
    }
    file.put(&edges)?;
    file.finish()
}

/// Writes curves as a VTU file: one polyline cell per curve, with cell data `curve` (i32, its
/// number) and `closed` (u8, 0 or 1).
///
/// # Errors
/// As [`write_polylines_obj`].
pub fn write_polylines_vtu(path: &Path, lines: &Polylines) -> Result<(), Error> {
    lines.check(path)?;
    let n = lines.curves.len();
    let mut data = Appended::default();
    let coordinates = lines.points.as_flattened().iter();
    let points = data.array("Float64", "Points", 3, coordinates.map(|x| x.to_le_bytes()));
    let all = (0..n).flat_map(|curve| lines.points(curve));
    let mut cells = data.array(
        "Int64",
        "connectivity",
        1,
        all.map(|ix| i64::from(ix).to_le_bytes()),
    );
    let ends = (0..n).scan(0i64, |end, curve| {
        *end += i64::try_from(lines.points(curve).count()).unwrap_or(i64::MAX);
        Some(end.to_le_bytes())
    });
    cells += &data.array("Int64", "offsets", 1, ends);
    cells += &data.array("UInt8", "types", 1, (0..n).map(|_| [POLY_LINE]));
    let numbers = (0i32..).take(n).map(i32::to_le_bytes);
    let mut cell_data = data.array("Int32", "curve", 1, numbers);
    let closed = lines
        .curves
        .iter()
        .map(|(_, is_closed)| [u8::from(*is_closed)]);
    cell_data += &data.array("UInt8", "closed", 1, closed);
    document(
        path,
        &data,
        [lines.points.len(), n],
        [&points, &cells, &cell_data],
    )
}
