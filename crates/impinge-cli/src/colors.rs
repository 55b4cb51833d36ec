//! What was found of bodies, coloured by a number from 0 to 1: red to yellow. Of a step it is the
//! time of contact, of near elements the share of the distance that was asked for.

use std::collections::HashMap;

use impinge::{Body, BodyId, Element, PairKind, Part, Scene};
use impinge_render::Surface;

use crate::error::Error;
use crate::meshes::{self, Colored};
use crate::values::MeshFile;
use crate::{palette, picture};

/// Two elements, and their number.
pub type Found = (PairKind, [Element; 2], f64);

/// The least numbers of the elements of one body.
#[derive(Default)]
struct Least {
    vertices: HashMap<u32, f64>,
    edges: HashMap<[u32; 2], f64>,
    faces: HashMap<[u32; 3], f64>,
}

impl Least {
    fn of(body: &Body, id: BodyId, found: &[Found]) -> Least {
        let (edges, faces) = (body.part(Part::Edges), body.part(Part::Faces));
        let mut least = Least::default();
        for &(kind, elements, number) in found {
            for (part, element) in kind.parts().into_iter().zip(elements) {
                if element.body != id {
                    continue;
                }
                let ix = element.element as usize;
                match part {
                    Part::Edges => put(&mut least.edges, sorted(edges.corners(ix)), number),
                    Part::Faces => put(&mut least.faces, sorted(faces.corners(ix)), number),
                    _ => put(&mut least.vertices, element.element, number),
                }
            }
        }
        least
    }

    /// The least number of a primitive and its edges and vertices, if any of them was found.
    fn among(&self, corners: &[u32]) -> Option<f64> {
        let vertices = corners
            .iter()
            .filter_map(|corner| self.vertices.get(corner));
        let n = corners.len();
        let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| [i, j]));
        let edges = pairs.filter_map(|pair| self.edges.get(&sorted(&pair.map(|k| corners[k]))));
        let triples =
            (0..n).flat_map(|i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |k| [i, j, k])));
        let faces =
            triples.filter_map(|triple| self.faces.get(&sorted(&triple.map(|k| corners[k]))));
        vertices.chain(edges).chain(faces).copied().reduce(f64::min)
    }
}

fn sorted<const N: usize>(corners: &[u32]) -> [u32; N] {
    let mut key: [u32; N] = std::array::from_fn(|k| corners[k]);
    key.sort_unstable();
    key
}

fn put<K: Eq + std::hash::Hash>(all: &mut HashMap<K, f64>, key: K, number: f64) {
    let least = all.entry(key).or_insert(number);
    *least = least.min(number);
}

/// Writes the bodies.
pub fn write(
    file: &MeshFile,
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    found: &[Found],
) -> Result<(), Error> {
    let mut colored = Vec::new();
    for (ix, &(id, name)) in bodies.iter().enumerate() {
        let body = scene.body(id)?;
        let color = color(ix, body, id, found);
        colored.push(Colored::new(body, name, |_, corners| color(corners)));
    }
    meshes::write_all(file, &colored)
}

/// The bodies' surfaces.
pub fn surfaces(
    scene: &Scene,
    bodies: &[(BodyId, &str)],
    found: &[Found],
) -> Result<Vec<Surface>, Error> {
    let surface = |(ix, &(id, _)): (usize, &(BodyId, &str))| {
        let body = scene.body(id)?;
        let color = color(ix, body, id, found);
        Ok(picture::surface(body, |corners| color(corners)))
    };
    bodies.iter().enumerate().map(surface).collect()
}

/// The colour of an element, by its corners.
fn color(
    ix: usize,
    body: &Body,
    id: BodyId,
    found: &[Found],
) -> impl Fn(&[u32]) -> ([u8; 3], bool) {
    let least = Least::of(body, id, found);
    let other = palette::body(ix).other;
    move |corners| match least.among(corners) {
        Some(number) => (palette::ramp(number), true),
        None => (other, false),
    }
}
