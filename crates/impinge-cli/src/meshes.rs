//! Bodies as coloured meshes for a viewer.

use std::path::Path;

use impinge::{Body, BodyId, Elements, Pairs, Positions, Scene};
use impinge_io::{ColoredMesh, write_glb, write_ply, write_vtu};

use crate::error::Error;
use crate::palette::{self, BodyColors};
use crate::values::{MeshFile, MeshFormat};

/// Writes bodies in their current pose; elements that take part in a pair are coloured.
pub fn write(
    file: &MeshFile,
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    pairs: &Pairs,
) -> Result<(), Error> {
    let mut colored = Vec::new();
    for (ix, &(id, name)) in bodies.iter().enumerate() {
        let body = scene.body(id)?;
        let BodyColors { colliding, other } = palette::body(ix);
        let mut collides = vec![false; body.n_elements()];
        for element in pairs.colliding(id) {
            collides[element as usize] = true;
        }
        let color = |element: usize, _: &[u32]| match collides[element] {
            true => (colliding, true),
            false => (other, false),
        };
        colored.push(Colored::new(body, name, color));
    }
    write_all(file, &colored)
}

/// Writes bodies with a colour per element.
pub fn write_all(file: &MeshFile, bodies: &[Colored<'_>]) -> Result<(), Error> {
    let meshes: Vec<ColoredMesh> = bodies.iter().map(Colored::mesh).collect();
    write_colored(file, &meshes)
}

/// Writes meshes in the format given by the file's name.
pub fn write_colored(file: &MeshFile, meshes: &[ColoredMesh<'_>]) -> Result<(), Error> {
    match file.format {
        MeshFormat::Ply => write_ply(&file.path, meshes)?,
        MeshFormat::Glb => write_glb(&file.path, meshes)?,
        MeshFormat::Vtu => write_vtu(&file.path, meshes)?,
    }
    Ok(())
}

/// The last part of a path.
fn file_name(path: &str) -> &str {
    let name = Path::new(path).file_name().and_then(|name| name.to_str());
    name.unwrap_or(path)
}

/// Converts positions of the library to those of mesh files.
pub fn from_positions(positions: &Positions) -> impinge_io::Positions {
    match positions {
        Positions::F32(positions) => impinge_io::Positions::F32(positions.to_vec()),
        Positions::F64(positions) => impinge_io::Positions::F64(positions.to_vec()),
    }
}

/// Converts elements of the library to those of mesh files. Mesh files hold only triangles and
/// tetrahedra, so an edge or a point becomes a degenerate triangle.
pub fn from_elements(elements: &Elements) -> impinge_io::Elements {
    match elements {
        Elements::Triangles(faces) => impinge_io::Elements::Triangles(faces.clone()),
        Elements::Tetrahedra(tets) => impinge_io::Elements::Tetrahedra(tets.clone()),
        Elements::Edges(edges) => {
            impinge_io::Elements::Triangles(edges.iter().map(|&[a, b]| [a, b, b]).collect())
        }
        Elements::Points(points) => {
            impinge_io::Elements::Triangles(points.iter().map(|&[a]| [a; 3]).collect())
        }
    }
}

/// A body with a colour per element.
pub struct Colored<'a> {
    positions: impinge_io::Positions,
    elements: impinge_io::Elements,
    colors: Vec<[u8; 3]>,
    colliding: Vec<bool>,
    name: &'a str,
}

impl<'a> Colored<'a> {
    /// A body in its current pose. `color`: of an element, by its number and corners, and whether
    /// it counts as colliding.
    pub fn new(
        body: &Body,
        name: &'a str,
        color: impl Fn(usize, &[u32]) -> ([u8; 3], bool),
    ) -> Self {
        let elements = body.elements();
        let each = 0..elements.len();
        let (colors, colliding) = each.map(|ix| color(ix, elements.corners(ix))).unzip();
        Colored {
            positions: from_positions(body.positions()),
            elements: from_elements(elements),
            colors,
            colliding,
            // The written mesh should not reveal folders of this machine.
            name: file_name(name),
        }
    }

    fn mesh(&self) -> ColoredMesh<'_> {
        ColoredMesh {
            positions: &self.positions,
            elements: &self.elements,
            element_colors: Some(&self.colors),
            colliding: Some(&self.colliding),
            name: self.name,
        }
    }
}
