//! Writing OBJ.

use std::path::Path;

use super::atomic::AtomicFile;
use crate::error::Error;
use crate::mesh::Positions;

/// Writes triangles as a Wavefront OBJ file: a `v` per vertex and an `f` per triangle, in their
/// order, without colours. Coordinates have as many digits as needed to read the same `f64` back,
/// so those of an `f32` are exact too.
///
/// # Errors
/// [`Error::Io`].
pub fn write_obj(path: &Path, positions: &Positions, triangles: &[[u32; 3]]) -> Result<(), Error> {
    let mut file = AtomicFile::create(path)?;
    let mut vertex = |[x, y, z]: [f64; 3]| file.put(format!("v {x} {y} {z}\n").as_bytes());
    match positions {
        Positions::F32(positions) => positions
            .iter()
            .try_for_each(|at| vertex(at.map(f64::from)))?,
        Positions::F64(positions) => positions.iter().try_for_each(|at| vertex(*at))?,
    }
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| u64::from(corner) + 1);
        file.put(format!("f {a} {b} {c}\n").as_bytes())?;
    }
    file.finish()
}
