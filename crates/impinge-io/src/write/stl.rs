//! Writing STL.

use std::path::Path;

use super::AtomicFile;
use crate::error::{Error, Name, Place};
use crate::mesh::Positions;

/// Writes triangles as an STL file: binary if all positions are `f32` numbers, else as text, with
/// as many digits as needed to read the same `f64` back. Vertices are repeated per triangle, in the
/// order of the faces; normals are zero, which readers take as "to be computed from the vertices".
///
/// # Errors
/// [`Error::Io`]; more triangles than the format can count.
pub fn write_stl(path: &Path, positions: &Positions, triangles: &[[u32; 3]]) -> Result<(), Error> {
    let mut file = AtomicFile::create(path)?;
    // Files of text hold f64, which most often are f32 as well.
    let mut positions = positions.clone();
    positions.narrow_if_exact();
    match &positions {
        Positions::F32(positions) => {
            let n = u32::try_from(triangles.len()).map_err(|_| {
                let (most, found) = (u64::from(u32::MAX), triangles.len() as u64);
                Name(&path.display().to_string()).too_large(
                    Place::File,
                    "triangles of a binary STL file",
                    most,
                    found,
                )
            })?;
            let mut header = [0; 80];
            header[..7].copy_from_slice(b"impinge");
            file.put(&header)?;
            file.put(&n.to_le_bytes())?;
            for corners in triangles {
                let mut record = [0; 50];
                let points = corners
                    .iter()
                    .flat_map(|&corner| positions[corner as usize]);
                for (bytes, x) in record[12..48].chunks_exact_mut(4).zip(points) {
                    bytes.copy_from_slice(&x.to_le_bytes());
                }
                file.put(&record)?;
            }
        }
        Positions::F64(positions) => {
            file.put(b"solid impinge\n")?;
            for corners in triangles {
                file.put(b"facet normal 0 0 0\nouter loop\n")?;
                for &corner in corners {
                    let [x, y, z] = positions[corner as usize];
                    file.put(format!("vertex {x} {y} {z}\n").as_bytes())?;
                }
                file.put(b"endloop\nendfacet\n")?;
            }
            file.put(b"endsolid impinge\n")?;
        }
    }
    file.finish()
}
