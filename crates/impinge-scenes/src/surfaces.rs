//! Surfaces of triangles. Closed ones face outward.

use std::collections::HashMap;
use std::f64::consts::TAU;

use crate::model::{MAX_ELEMENTS, Mesh, Model, count, cross, index, normalised, real, to_f32};

/// A sphere of radius 0.5 about the origin: the icosahedron, every triangle split in four
/// `subdivisions` times (at most 12). It has `20 * 4^subdivisions` triangles.
pub fn icosphere(subdivisions: u32) -> Model {
    geodesic(1 << subdivisions.min(12)).model()
}

/// A sphere of radius 0.5 about the origin with `n_triangles` triangles of about the same size:
/// exactly this many for an even number from 20 on, one less for an odd number (a closed surface
/// has an even number of triangles).
pub fn ball(n_triangles: usize) -> Model {
    ball_mesh(n_triangles).model()
}

/// A [`ball`] with smooth bumps: the radius is `0.5 (1 + height sin 9x sin 9y sin 9z)` in the
/// direction `(x, y, z)` of length 1. A height below 0.5 keeps it free of self-intersections.
pub fn bumpy_ball(n_triangles: usize, height: f32) -> Model {
    ball_mesh(n_triangles).model().mapped(|p| {
        let bump = p.iter().map(|&x| (18.0 * x).sin()).product::<f32>();
        p.map(|x| x * (1.0 + height * bump))
    })
}

fn ball_mesh(n_triangles: usize) -> Mesh {
    let n_triangles = n_triangles.clamp(20, MAX_ELEMENTS);
    let mut mesh = geodesic((n_triangles / 20).isqrt());
    mesh.split_to(n_triangles, |p| on_sphere(p.map(f64::from)));
    mesh
}

fn on_sphere(p: [f64; 3]) -> [f32; 3] {
    to_f32(normalised(p).map(|x| 0.5 * x))
}

/// The icosahedron with every edge in `frequency` parts, on the sphere: `20 * frequency^2` faces
/// (Fuller's class I geodesic polyhedron).
fn geodesic(frequency: usize) -> Mesh {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let corners: [[f64; 3]; 12] = [
        [-1.0, golden, 0.0],
        [1.0, golden, 0.0],
        [-1.0, -golden, 0.0],
        [1.0, -golden, 0.0],
        [0.0, -1.0, golden],
        [0.0, 1.0, golden],
        [0.0, -1.0, -golden],
        [0.0, 1.0, -golden],
        [golden, 0.0, -1.0],
        [golden, 0.0, 1.0],
        [-golden, 0.0, -1.0],
        [-golden, 0.0, 1.0],
    ];
    #[rustfmt::skip]
    const FACES: [[u32; 3]; 20] = [
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11],
        [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
        [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9],
        [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ];
    let mut mesh = Mesh::default();
    mesh.positions.extend(corners.map(on_sphere));
    // Points inside an edge are created once, from its lower to its higher corner.
    let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
    for face in FACES {
        for (&from, &to) in face.iter().zip(face.iter().cycle().skip(1)) {
            let key = (from.min(to), from.max(to));
            if edges.contains_key(&key) {
                continue;
            }
            edges.insert(key, index(mesh.positions.len()));
            let (low, high) = (corners[key.0 as usize], corners[key.1 as usize]);
            mesh.positions.extend((1..frequency).map(|step| {
                let part = real(step) / real(frequency);
                on_sphere(std::array::from_fn(|k| {
                    low[k] * (1.0 - part) + high[k] * part
                }))
            }));
        }
    }
    let on_edge = |from: u32, to: u32, step: usize| {
        if step == 0 {
            return from;
        }
        if step == frequency {
            return to;
        }
        let first = edges[&(from.min(to), from.max(to))];
        first
            + index(if from < to {
                step - 1
            } else {
                frequency - 1 - step
            })
    };
    for [a, b, c] in FACES {
        // Row `i` of the face runs from edge ab to edge ac and holds i + 1 points.
        let mut rows: Vec<Vec<u32>> = Vec::with_capacity(frequency + 1);
        for i in 0..=frequency {
            let row = (0..=i)
                .map(|j| {
                    if j == 0 {
                        on_edge(a, b, i)
                    } else if j == i {
                        on_edge(a, c, i)
                    } else if i == frequency {
                        on_edge(b, c, j)
                    } else {
                        let weights = [frequency - i, i - j, j].map(real);
                        let corners = [a, b, c].map(|corner| corners[corner as usize]);
                        let p = std::array::from_fn(|axis| {
                            (0..3).map(|k| weights[k] * corners[k][axis]).sum()
                        });
                        mesh.positions.push(on_sphere(p));
                        index(mesh.positions.len() - 1)
                    }
                })
                .collect();
            rows.push(row);
        }
        for (above, below) in rows.iter().zip(rows.iter().skip(1)) {
            for (j, &top) in above.iter().enumerate() {
                mesh.faces.push([top, below[j], below[j + 1]]);
                if j + 1 < above.len() {
                    mesh.faces.push([top, below[j + 1], above[j + 1]]);
                }
            }
        }
    }
    mesh
}

/// A closed surface over a grid that wraps in both directions: `2 n_u n_v` triangles. `at` takes
/// angles from 0 to 2 pi.
fn wrapped(n_u: usize, n_v: usize, at: impl Fn(f64, f64) -> [f64; 3]) -> Mesh {
    let mut mesh = Mesh::default();
    for u in 0..n_u {
        let angle_u = TAU * real(u) / real(n_u);
        mesh.positions
            .extend((0..n_v).map(|v| to_f32(at(angle_u, TAU * real(v) / real(n_v)))));
    }
    let vertex = |u: usize, v: usize| index((u % n_u) * n_v + v % n_v);
    for u in 0..n_u {
        for v in 0..n_v {
            let (a, b) = (vertex(u, v), vertex(u + 1, v));
            let (c, d) = (vertex(u, v + 1), vertex(u + 1, v + 1));
            mesh.faces.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh
}

/// A torus about the z axis, tube radius `minor`, centre line radius `major`, with
/// `n_around * n_tube` quads (each at least 3), two triangles each.
pub fn torus(n_around: usize, n_tube: usize, major: f32, minor: f32) -> Model {
    let (major, minor) = (f64::from(major), f64::from(minor));
    wrapped(
        n_around.clamp(3, 1 << 14),
        n_tube.clamp(3, 1 << 14),
        |u, v| {
            let radius = major + minor * v.cos();
            [radius * u.cos(), radius * u.sin(), minor * v.sin()]
        },
    )
    .model()
}

/// How a [`torus_knot`] winds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knot {
    /// Turns about the z axis.
    pub p: u32,
    /// Turns about the torus's centre line; coprime to `p` for a single strand.
    pub q: u32,
    /// Radius of the torus on which the strand lies; its centre line has radius 1.
    pub winding_radius: f64,
    /// Radius of the strand.
    pub tube_radius: f64,
    /// How much the strand swells and thins, as a part of its radius, below 1.
    pub swelling: f64,
}

impl Default for Knot {
    /// A trefoil whose strands do not touch.
    fn default() -> Self {
        Knot {
            p: 2,
            q: 3,
            winding_radius: 0.45,
            tube_radius: 0.17,
            swelling: 0.3,
        }
    }
}

/// A tube along a torus knot, scaled to a box diagonal of 1 about the origin, with `n_triangles`
/// triangles: exactly this many for an even number from 96 on, one less for an odd number.
pub fn torus_knot(n_triangles: usize, knot: Knot) -> Model {
    let n_triangles = n_triangles.clamp(96, MAX_ELEMENTS);
    let (p, q) = (f64::from(knot.p), f64::from(knot.q));
    // Quads are about square if their numbers have the ratio of length to girth.
    let slenderness = p.hypot(q * knot.winding_radius) / knot.tube_radius;
    let n_quads = n_triangles / 2;
    let n_tube = count((real(n_quads) / slenderness).sqrt()).clamp(3, n_quads / 16);
    let mut mesh = wrapped(n_quads / n_tube, n_tube, |u, v| {
        let ((sin_p, cos_p), (sin_q, cos_q)) = ((p * u).sin_cos(), (q * u).sin_cos());
        let radius = 1.0 + knot.winding_radius * cos_q;
        let centre = [radius * cos_p, radius * sin_p, knot.winding_radius * sin_q];
        // The strand lies on a torus. The torus's normal stays perpendicular to the strand and
        // returns to itself after one round, unlike a Frenet frame.
        let normal = [cos_q * cos_p, cos_q * sin_p, sin_q];
        let radius_change = -knot.winding_radius * q * sin_q;
        let tangent = normalised([
            radius_change * cos_p - radius * p * sin_p,
            radius_change * sin_p + radius * p * cos_p,
            knot.winding_radius * q * cos_q,
        ]);
        let binormal = cross(normal, tangent);
        let swell = (5.0 * u).sin() * 0.7 + (11.0 * u + 2.0 * v).sin() * 0.3;
        let girth = knot.tube_radius * (1.0 + knot.swelling * swell);
        std::array::from_fn(|k| centre[k] + girth * (v.cos() * normal[k] + v.sin() * binormal[k]))
    });
    mesh.split_to(n_triangles, |p| p);
    unit_diagonal(mesh.model())
}

/// A stand-in for a scanned mesh of `n_triangles` triangles if its file is absent: a
/// swelling [`torus_knot`] with a box diagonal of 1, like the scans. Pair counts and times differ
/// from those of any scan.
pub fn stand_in(n_triangles: usize) -> Model {
    torus_knot(n_triangles, Knot::default())
}

/// The mesh with its box's middle moved to the origin and the box's diagonal scaled to 1.
pub fn unit_diagonal(model: Model) -> Model {
    let Some((min, max)) = model.bounds() else {
        return model;
    };
    let middle: [f32; 3] = std::array::from_fn(|axis| 0.5 * (min[axis] + max[axis]));
    let diagonal = (0..3)
        .map(|axis| (max[axis] - min[axis]).powi(2))
        .sum::<f32>()
        .sqrt();
    let scale = if diagonal > 0.0 {
        diagonal.recip()
    } else {
        1.0
    };
    model.mapped(|p| std::array::from_fn(|axis| (p[axis] - middle[axis]) * scale))
}

/// A flat sheet in the plane z = 0 from `(0, 0)` to `(n_x * spacing, n_y * spacing)`:
/// `2 n_x n_y` triangles, its diagonals alternating. With a power of two as the spacing all
/// coordinates are exact.
pub fn cloth(n_x: usize, n_y: usize, spacing: f32) -> Model {
    let (n_x, n_y) = (n_x.clamp(1, 1 << 14), n_y.clamp(1, 1 << 14));
    let mut mesh = Mesh::default();
    for y in 0..=n_y {
        mesh.positions.extend(
            (0..=n_x).map(|x| to_f32([real(x), real(y), 0.0].map(|k| k * f64::from(spacing)))),
        );
    }
    let vertex = |x: usize, y: usize| index(y * (n_x + 1) + x);
    for y in 0..n_y {
        for x in 0..n_x {
            let (a, b) = (vertex(x, y), vertex(x + 1, y));
            let (c, d) = (vertex(x, y + 1), vertex(x + 1, y + 1));
            if (x + y) % 2 == 0 {
                mesh.faces.extend([[a, b, d], [a, d, c]]);
            } else {
                mesh.faces.extend([[a, b, c], [b, d, c]]);
            }
        }
    }
    mesh.model()
}

/// The surface of a box from `min` to `max`: 12 triangles, 8 vertices.
pub fn cuboid(min: [f32; 3], max: [f32; 3]) -> Model {
    let mut mesh = Mesh::default();
    // Bit k of a vertex number says whether axis k is at its maximum.
    mesh.positions.extend(
        (0..8).map(|v| std::array::from_fn(|k| if v >> k & 1 == 1 { max[k] } else { min[k] })),
    );
    #[rustfmt::skip]
    mesh.faces.extend([
        [0, 2, 3], [0, 3, 1], // z at its minimum
        [4, 5, 7], [4, 7, 6],
        [0, 1, 5], [0, 5, 4], // y at its minimum
        [2, 6, 7], [2, 7, 3],
        [0, 4, 6], [0, 6, 2], // x at its minimum
        [1, 3, 7], [1, 7, 5],
    ]);
    mesh.model()
}

/// A cube of edge `size` about `centre`, as a [`cuboid`].
pub fn cube(centre: [f32; 3], size: f32) -> Model {
    let half = 0.5 * size;
    cuboid(centre.map(|x| x - half), centre.map(|x| x + half))
}
