//! One file per format; each reads bytes into a [`Collector`](crate::collect::Collector).

use crate::binary::{Endian, Scalar};
use crate::budget::reserve;
use crate::collect::finite;
use crate::error::{Error, Name, Place};
use crate::mesh::Positions;

mod cells;
pub(crate) mod gltf;
pub(crate) mod medit;
pub(crate) mod msh;
pub(crate) mod obj;
pub(crate) mod off;
pub(crate) mod ply;
pub(crate) mod stl;
pub(crate) mod tetgen;
pub(crate) mod threemf;
pub(crate) mod vtk;
pub(crate) mod vtu;

/// Positions from an array of numbers: f32 where the type fits, else f64. `place` gives the place
/// of a vertex in the file.
fn positions(
    name: Name,
    bytes: &[u8],
    scalar: Scalar,
    endian: Endian,
    place: impl Fn(usize) -> Place,
) -> Result<Positions, Error> {
    let size = scalar.size();
    let n = (bytes.len() / (3 * size)) as u64;
    let records = bytes.chunks_exact(3 * size).enumerate();
    if scalar.fits_f32() {
        let mut positions = Vec::new();
        reserve(name, Place::File, &mut positions, n)?;
        for (vertex, record) in records {
            let position = [0, 1, 2].map(|axis| scalar.narrow(&record[axis * size..], endian));
            finite(name, place(vertex), vertex, position.map(f64::from))?;
            positions.push(position);
        }
        return Ok(Positions::F32(positions));
    }
    let mut positions = Vec::new();
    reserve(name, Place::File, &mut positions, n)?;
    for (vertex, record) in records {
        let position = [0, 1, 2].map(|axis| scalar.float(&record[axis * size..], endian));
        positions.push(finite(name, place(vertex), vertex, position)?);
    }
    Ok(Positions::F64(positions))
}
