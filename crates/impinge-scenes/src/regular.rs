//! Flat and regular surfaces, like sheets at rest and machine parts: neighbours in one plane, edges
//! in one line.
//!
//! None of them meets itself except at shared vertices. They are hard for filters, because the
//! plane of a triangle contains its neighbours' vertices exactly, or nearly. [`rough`] is an easy
//! surface of the same size, for comparison.

use std::f64::consts::TAU;

use crate::model::{Mesh, Model, index, real, to_f32};
use crate::random::Random;
use crate::surfaces::cloth;

/// A regular surface: its name, a description, and a function that builds it.
#[derive(Debug, Clone, Copy)]
pub struct Regular {
    /// One word.
    pub name: &'static str,
    /// A description.
    pub what: &'static str,
    /// Builds it with about this many triangles.
    pub build: fn(usize) -> Model,
}

/// All regular surfaces, [`rough`] first.
pub const ALL: [Regular; 7] = [
    Regular {
        name: "rough",
        what: "a sheet with random heights",
        build: rough,
    },
    Regular {
        name: "flat",
        what: "a sheet in the plane z = 0",
        build: flat,
    },
    Regular {
        name: "tilted",
        what: "a flat sheet turned about all axes, rounded",
        build: tilted,
    },
    Regular {
        name: "sine",
        what: "a sheet whose height is a sine of x",
        build: sine,
    },
    Regular {
        name: "cylinder",
        what: "an open tube of rings",
        build: cylinder,
    },
    Regular {
        name: "box",
        what: "a cube with a square grid on each face",
        build: grid_box,
    },
    Regular {
        name: "bolts",
        what: "rows of prisms of 32 sides, their caps fans",
        build: bolts,
    },
];

fn side(n_triangles: usize) -> usize {
    (n_triangles / 2).isqrt().max(1)
}

/// A square sheet of spacing 1 whose points are mapped by `moved` and then rounded.
fn sheet(n_triangles: usize, mut moved: impl FnMut([f64; 3]) -> [f64; 3]) -> Model {
    let side = side(n_triangles);
    let mut model = cloth(side, side, 1.0);
    for position in &mut model.positions {
        *position = to_f32(moved(position.map(f64::from)));
    }
    model
}

/// A square sheet with random heights between 0 and half of its grid's spacing.
pub fn rough(n_triangles: usize) -> Model {
    let mut random = Random::new(1);
    sheet(n_triangles, |[x, y, _]| {
        [x, y, f64::from(random.range(0.0, 0.5))]
    })
}

/// A square sheet in the plane z = 0.
pub fn flat(n_triangles: usize) -> Model {
    sheet(n_triangles, |p| p)
}

/// [`flat`], turned about all axes and rounded: hardly any four of its points lie in one plane.
pub fn tilted(n_triangles: usize) -> Model {
    let (s, c) = (0.6, 0.8);
    sheet(n_triangles, |[x, y, _]| {
        let [x, y] = [c * x - s * y, s * x + c * y];
        let [y, z] = [c * y, s * y];
        [c * x + s * z, y, c * z - s * x]
    })
}

/// A square sheet with three periods of a sine along x: all rows along y are the same.
pub fn sine(n_triangles: usize) -> Model {
    let length = real(side(n_triangles));
    sheet(n_triangles, |[x, y, _]| {
        [x, y, 0.1 * length * (3.0 * TAU * x / length).sin()]
    })
}

/// An open tube about the z axis, of square-like faces.
pub fn cylinder(n_triangles: usize) -> Model {
    let side = side(n_triangles).max(3);
    let mut mesh = Mesh::default();
    for ring in 0..=side {
        mesh.positions.extend((0..side).map(|k| {
            let angle = TAU * real(k) / real(side);
            to_f32([angle.cos(), angle.sin(), TAU * real(ring) / real(side)])
        }));
    }
    for ring in 0..side {
        for k in 0..side {
            let vertex = |ring: usize, k: usize| index(ring * side + k % side);
            let (a, b) = (vertex(ring, k), vertex(ring, k + 1));
            let (c, d) = (vertex(ring + 1, k), vertex(ring + 1, k + 1));
            mesh.faces.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh.model()
}

/// The surface of a cube with a grid on each face; the faces share the vertices of their edges.
pub fn grid_box(n_triangles: usize) -> Model {
    let side = (n_triangles / 12).isqrt().max(1);
    let mut mesh = Mesh::default();
    let mut known = std::collections::HashMap::new();
    for face in 0..6 {
        let (axis, end) = (face / 2, face % 2 * side);
        let mut vertex = |u: usize, v: usize| {
            let mut at = [0; 3];
            (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (end, u, v);
            *known.entry(at).or_insert_with(|| {
                mesh.positions.push(to_f32(at.map(real)));
                index(mesh.positions.len() - 1)
            })
        };
        let mut faces = Vec::with_capacity(2 * side * side);
        for v in 0..side {
            for u in 0..side {
                let (a, b) = (vertex(u, v), vertex(u + 1, v));
                let (c, d) = (vertex(u, v + 1), vertex(u + 1, v + 1));
                faces.extend([[a, b, d], [a, d, c]]);
            }
        }
        if face % 2 == 0 {
            faces.iter_mut().for_each(|face| face.swap(1, 2));
        }
        mesh.faces.extend(faces);
    }
    mesh.model()
}

/// Bolts: rows of prisms of 32 sides, standing apart. Their walls are long and thin, their caps
/// fans.
pub fn bolts(n_triangles: usize) -> Model {
    const SIDES: usize = 32;
    let n_along = (n_triangles / (4 * SIDES)).isqrt().max(1);
    let mut mesh = Mesh::default();
    for bolt in 0..n_along * n_along {
        let [x, y] = [bolt % n_along, bolt / n_along].map(|k| 2.5 * real(k));
        let first = mesh.positions.len();
        for z in [0.0, 4.0] {
            mesh.positions.push(to_f32([x, y, z]));
            mesh.positions.extend((0..SIDES).map(|k| {
                let angle = TAU * real(k) / real(SIDES);
                to_f32([x + angle.cos(), y + angle.sin(), z])
            }));
        }
        let vertex = |k: usize| index(first + k);
        let above = SIDES + 1;
        for k in 0..SIDES {
            let (a, b) = (1 + k, 1 + (k + 1) % SIDES);
            let (c, d) = (a + above, b + above);
            let faces = [[0, b, a], [above, c, d], [a, b, d], [a, d, c]];
            mesh.faces.extend(faces.map(|face| face.map(vertex)));
        }
    }
    mesh.model()
}
