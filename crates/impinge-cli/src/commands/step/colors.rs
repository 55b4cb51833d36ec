//! Colliding primitives, coloured by their time of contact: red at the start of the step, yellow at
//! its end.

use std::collections::HashMap;

use impinge::{Body, BodyId, Impacts, Part};
use impinge_render::Surface;

use crate::error::Error;
use crate::meshes::{self, Colored};
use crate::values::MeshFile;
use crate::{palette, picture};

use super::load::Moving;

/// The first times of the elements of one body that touch anything.
#[derive(Default)]
struct Times {
    vertices: HashMap<u32, f64>,
    edges: HashMap<[u32; 2], f64>,
    faces: HashMap<[u32; 3], f64>,
}

impl Times {
    fn of(body: &Body, id: BodyId, impacts: &Impacts) -> Times {
        let (edges, faces) = (body.part(Part::Edges), body.part(Part::Faces));
        let mut times = Times::default();
        for impact in impacts {
            for (part, element) in impact.kind.parts().into_iter().zip([impact.a, impact.b]) {
                if element.body != id {
                    continue;
                }
                let toi = impact.toi;
                match part {
                    Part::Edges => put(
                        &mut times.edges,
                        sorted(edges.corners(element.element as usize)),
                        toi,
                    ),
                    Part::Faces => put(
                        &mut times.faces,
                        sorted(faces.corners(element.element as usize)),
                        toi,
                    ),
                    _ => put(&mut times.vertices, element.element, toi),
                }
            }
        }
        times
    }

    /// The first time at which a primitive, or an edge or a vertex of it, touches anything.
    fn first(&self, corners: &[u32]) -> Option<f64> {
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

fn put<K: Eq + std::hash::Hash>(times: &mut HashMap<K, f64>, key: K, toi: f64) {
    let first = times.entry(key).or_insert(toi);
    *first = first.min(toi);
}

/// Writes the bodies at the start of the step.
pub fn write(file: &MeshFile, bodies: &Moving, impacts: &Impacts) -> Result<(), Error> {
    let mut colored = Vec::new();
    for (ix, (&id, [name, _])) in bodies.ids.iter().zip(&bodies.names).enumerate() {
        let body = bodies.scene.body(id)?;
        let color = color(ix, body, id, impacts);
        colored.push(Colored::new(body, name, |_, corners| color(corners)));
    }
    meshes::write_all(file, &colored)
}

/// The bodies' surfaces at the start of the step.
pub fn surfaces(bodies: &Moving, impacts: &Impacts) -> Result<Vec<Surface>, Error> {
    let surface = |(ix, &id): (usize, &BodyId)| {
        let body = bodies.scene.body(id)?;
        let color = color(ix, body, id, impacts);
        Ok(picture::surface(body, |corners| color(corners)))
    };
    bodies.ids.iter().enumerate().map(surface).collect()
}

/// The colour of an element, by its corners: of when it is first touched, if it is.
fn color(
    ix: usize,
    body: &Body,
    id: BodyId,
    impacts: &Impacts,
) -> impl Fn(&[u32]) -> ([u8; 3], bool) {
    let times = Times::of(body, id, impacts);
    let other = palette::body(ix).other;
    move |corners| match times.first(corners) {
        Some(first) => (palette::time(first), true),
        None => (other, false),
    }
}
