//! Bodies in the colours of an answer: as meshes for files, and as surfaces for pictures. And
//! colours for a number from 0 to 1, red to yellow: of a step it is the time of contact, of near
//! elements the share of the distance that was asked for.

use std::collections::HashMap;

use impinge::{Body, BodyId, Element, PairKind, Part, Scene};
use impinge_render::Surface;

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

/// Two elements, and their number.
pub type Found = (PairKind, [Element; 2], f64);

/// The colours of numbers; what has none is grey.
pub struct Ramp(Vec<Least>);

impl Ramp {
    pub fn new(
        scene: &Scene,
        bodies: &[(BodyId, &str)],
        found: impl IntoIterator<Item = Found>,
    ) -> Result<Self, Error> {
        let numbers: HashMap<BodyId, usize> =
            (0..).zip(bodies).map(|(ix, of)| (of.0, ix)).collect();
        let mut all: Vec<Least> = bodies.iter().map(|_| Least::default()).collect();
        for (kind, elements, number) in found {
            for (part, element) in kind.parts().into_iter().zip(elements) {
                if let Some(&ix) = numbers.get(&element.body) {
                    all[ix].add(scene.body(element.body)?, part, element.element, number);
                }
            }
        }
        Ok(Ramp(all))
    }

    /// The colour of an element, by its body and its corners.
    pub fn color(&self, body: usize, corners: &[u32]) -> ([u8; 3], bool) {
        match self.0[body].among(corners) {
            Some(number) => (palette::ramp(number), true),
            None => (palette::body(body).other, false),
        }
    }
}

/// The least numbers of the elements of one body.
#[derive(Default)]
struct Least {
    vertices: HashMap<u32, f64>,
    edges: HashMap<[u32; 2], f64>,
    faces: HashMap<[u32; 3], f64>,
}

impl Least {
    fn add(&mut self, body: &Body, part: Part, element: u32, number: f64) {
        let ix = element as usize;
        match part {
            Part::Edges => put(&mut self.edges, sorted(body.part(part).corners(ix)), number),
            Part::Faces => put(&mut self.faces, sorted(body.part(part).corners(ix)), number),
            _ => put(&mut self.vertices, element, number),
        }
    }

    /// The least number of an element and its edges and vertices, if any of them was found.
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
