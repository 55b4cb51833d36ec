//! Writing coloured meshes and point caches. A file gets its name only when it is complete.

mod atomic;
mod glb;
mod obj;
mod pc2;
mod ply;
mod polylines;
mod stl;
mod surface;
mod vtu;

pub use atomic::{AtomicFile, remove_temporary_files};
pub use glb::write_glb;
pub use obj::write_obj;
pub use pc2::Pc2Writer;
pub use ply::{write_plain_ply, write_ply};
pub use polylines::{Polylines, write_polylines_obj, write_polylines_ply, write_polylines_vtu};
pub use stl::write_stl;
pub use vtu::write_vtu;

use std::path::Path;

use crate::error::{Error, Name, Place};
use crate::mesh::{Elements, Positions};

/// A body to be written.
#[derive(Debug, Clone, Copy)]
pub struct ColoredMesh<'a> {
    /// The positions of the vertices.
    pub positions: &'a Positions,
    /// The elements.
    pub elements: &'a Elements,
    /// Red, green and blue (sRGB, 0 to 255) of each element; `None` means light grey.
    pub element_colors: Option<&'a [[u8; 3]]>,
    /// Whether each element collides; only VTU stores this.
    pub colliding: Option<&'a [bool]>,
    /// The name of the body, for formats that have names.
    pub name: &'a str,
}

/// The colour of elements without a given colour.
const GREY: [u8; 3] = [200, 200, 200];

impl ColoredMesh<'_> {
    fn color(&self, element_ix: usize) -> [u8; 3] {
        self.element_colors
            .map_or(GREY, |colors| colors[element_ix])
    }

    /// Checks that numbers match and indices are in range, so that every written file can be read.
    fn check(&self, name: Name) -> Result<(), Error> {
        let n_elements = self.elements.len();
        for (what, given) in [
            ("colours of", self.element_colors.map(<[_]>::len)),
            ("colliding flags of", self.colliding.map(<[_]>::len)),
        ] {
            if let Some(found) = given.filter(|&n| n != n_elements) {
                let what = format!("{what} the elements of body '{}'", self.name);
                return Err(Error::Mismatch {
                    file: name.0.to_owned(),
                    what,
                    expected: n_elements as u64,
                    found: found as u64,
                });
            }
        }
        let n_vertices = self.positions.len() as u64;
        if let Some(&index) = self
            .elements
            .indices()
            .iter()
            .max()
            .filter(|&&ix| u64::from(ix) >= n_vertices)
        {
            return Err(Error::Index {
                at: name.at(Place::File),
                index: i64::from(index),
                first: 0,
                n_vertices,
            });
        }
        Ok(())
    }
}

/// Checks all bodies of a file.
fn check(path: &Path, meshes: &[ColoredMesh]) -> Result<(), Error> {
    let name = path.display().to_string();
    meshes.iter().try_for_each(|mesh| mesh.check(Name(&name)))
}

/// Whether any body has f64 positions. A file has only one type of number, so then all positions
/// are written as f64.
fn any_f64(meshes: &[ColoredMesh]) -> bool {
    meshes
        .iter()
        .any(|mesh| matches!(mesh.positions, Positions::F64(_)))
}
