//! Bodies in the colours of an answer: as meshes for files, and as surfaces for pictures.

use impinge::{BodyId, Scene};
use impinge_render::{Least, Surface, ramp};

use crate::error::Error;
use crate::meshes::{self, Colored};
use crate::values::MeshFile;
use crate::{palette, picture};

/// Writes bodies. `color`: of an element, by its body and its corners, and whether it shows through.
pub fn write(
    file: &MeshFile,
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    color: impl Fn(usize, &[u32]) -> ([u8; 3], bool),
) -> Result<(), Error> {
    let mut colored = Vec::new();
    for (ix, &(id, name)) in bodies.iter().enumerate() {
        let color = |_, corners: &[u32]| color(ix, corners);
        colored.push(Colored::new(scene.body(id)?, name, color));
    }
    meshes::write_all(file, &colored)
}

/// The bodies' surfaces, in colours as for [`write`].
pub fn surfaces(
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    color: impl Fn(usize, &[u32]) -> ([u8; 3], bool),
) -> Result<Vec<Surface>, Error> {
    let surface = |(ix, &(id, _)): (usize, &(BodyId, &str))| {
        let color = |corners: &[u32; 3]| color(ix, corners);
        Ok(picture::surface(scene.body(id)?, color))
    };
    bodies.iter().enumerate().map(surface).collect()
}

/// The colours of numbers; what has none is grey. By the body of an element and its corners.
pub fn by_number(numbers: &Least) -> impl Fn(usize, &[u32]) -> ([u8; 3], bool) + Copy + '_ {
    move |body, corners| match numbers.of(body, corners) {
        Some(number) => (ramp(number), true),
        None => (palette::body(body).other, false),
    }
}
