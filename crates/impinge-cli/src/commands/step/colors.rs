//! Colliding primitives, coloured by their time of contact: red at the start of the step, yellow at
//! its end.

use std::collections::HashMap;

use impinge::Elements;
use impinge::{Body, BodyId, Impacts, Part};
use impinge_io::ColoredMesh;
use impinge_render::{Face, Normals, Surface};

use crate::error::Error;
use crate::meshes;
use crate::palette;
use crate::values::MeshFile;

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
    struct Shown {
        positions: impinge_io::Positions,
        elements: impinge_io::Elements,
        colors: Vec<[u8; 3]>,
        colliding: Vec<bool>,
    }
    let mut shown = Vec::new();
    for (ix, &id) in bodies.ids.iter().enumerate() {
        let body = bodies.scene.body(id)?;
        let times = Times::of(body, id, impacts);
        let elements = body.elements();
        let first: Vec<Option<f64>> = (0..elements.len())
            .map(|primitive| times.first(elements.corners(primitive)))
            .collect();
        let other = palette::body(ix).other;
        shown.push(Shown {
            positions: meshes::from_positions(body.positions()),
            elements: meshes::from_elements(elements),
            colors: first
                .iter()
                .map(|first| first.map_or(other, palette::time))
                .collect(),
            colliding: first.iter().map(Option::is_some).collect(),
        });
    }
    let colored: Vec<ColoredMesh> = shown
        .iter()
        .zip(&bodies.names)
        .map(|(shown, [name, _])| ColoredMesh {
            positions: &shown.positions,
            elements: &shown.elements,
            primitive_colors: Some(&shown.colors),
            colliding: Some(&shown.colliding),
            name,
        })
        .collect();
    meshes::write_colored(file, &colored)
}

/// The bodies' surfaces at the start of the step.
pub fn surfaces(bodies: &Moving, impacts: &Impacts) -> Result<Vec<Surface>, Error> {
    let surface = |(ix, &id): (usize, &BodyId)| {
        let body = bodies.scene.body(id)?;
        let times = Times::of(body, id, impacts);
        let other = palette::body(ix).other;
        let faces = match body.part(Part::Faces) {
            Elements::Triangles(faces) => faces.as_slice(),
            _ => &[],
        };
        let positions = body.positions();
        Ok(Surface {
            positions: (0..body.n_vertices())
                .map(|vertex| positions.point(vertex))
                .collect(),
            faces: faces
                .iter()
                .map(|&corners| {
                    let first = times.first(&corners);
                    Face {
                        corners,
                        color: first.map_or(other, palette::time),
                        shows_through: first.is_some(),
                    }
                })
                .collect(),
            normals: match body.elements() {
                Elements::Tetrahedra(_) => Normals::Flat,
                _ => Normals::Smooth,
            },
        })
    };
    bodies.ids.iter().enumerate().map(surface).collect()
}
