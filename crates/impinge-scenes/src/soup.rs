//! Unconnected elements: random ones, and ones on an integer lattice, where many vertices
//! coincide and many points are collinear or coplanar.

use impinge::Elements;

use crate::model::{MAX_ELEMENTS, Model, add, index};
use crate::random::Random;

/// `n` elements of `K` vertices each, none of them shared.
fn separate<const K: usize>(
    n: usize,
    mut corners: impl FnMut() -> [[f32; 3]; K],
) -> (Vec<[f32; 3]>, Vec<[u32; K]>) {
    let n = n.min(MAX_ELEMENTS);
    let mut positions = Vec::with_capacity(n * K);
    for _ in 0..n {
        positions.extend(corners());
    }
    let elements = (0..n)
        .map(|element| std::array::from_fn(|corner| index(element * K + corner)))
        .collect();
    (positions, elements)
}

fn around<const K: usize>(random: &mut Random, size: f32) -> [[f32; 3]; K] {
    let centre = random.point(0.0, 1.0);
    std::array::from_fn(|_| add(centre, random.point(-0.5 * size, 0.5 * size)))
}

fn on_lattice<const K: usize>(random: &mut Random, k: u32) -> [[f32; 3]; K] {
    std::array::from_fn(|_| std::array::from_fn(|_| lattice_coordinate(random.below(k + 1))))
}

/// Lattices are at most 65,536 wide: every coordinate is exact in f32.
fn lattice_coordinate(k: u32) -> f32 {
    f32::from(u16::try_from(k).unwrap_or(u16::MAX))
}

/// `n` random triangles: centres in the unit cube, corners within a cube of edge `size` about them.
pub fn triangles(n: usize, size: f32, seed: u64) -> Model {
    let mut random = Random::new(seed);
    let (positions, faces) = separate(n, || around(&mut random, size));
    Model {
        positions,
        elements: Elements::Triangles(faces),
    }
}

/// `n` random tetrahedra of either orientation, as [`triangles`].
pub fn tetrahedra(n: usize, size: f32, seed: u64) -> Model {
    let mut random = Random::new(seed);
    let (positions, tets) = separate(n, || around(&mut random, size));
    Model {
        positions,
        elements: Elements::Tetrahedra(tets),
    }
}

/// `n` triangles whose corners are random points of the lattice 0, 1, …, `k` (at most 65,535)
/// cubed: with a small `k` many are segments or points, and nearly all pairs only touch.
pub fn lattice_triangles(n: usize, k: u32, seed: u64) -> Model {
    let mut random = Random::new(seed);
    let (positions, faces) = separate(n, || on_lattice(&mut random, k.min(65_535)));
    Model {
        positions,
        elements: Elements::Triangles(faces),
    }
}

/// `n` tetrahedra as [`lattice_triangles`]: flat ones, segments and points among them.
pub fn lattice_tetrahedra(n: usize, k: u32, seed: u64) -> Model {
    let mut random = Random::new(seed);
    let (positions, tets) = separate(n, || on_lattice(&mut random, k.min(65_535)));
    Model {
        positions,
        elements: Elements::Tetrahedra(tets),
    }
}

/// The points of the lattice 0, 1, …, `k` (at most 255) cubed, once each.
fn lattice_points(k: u32) -> Vec<[f32; 3]> {
    let side = k.min(255) + 1;
    (0..side * side * side)
        .map(|v| [v % side, v / side % side, v / side / side].map(lattice_coordinate))
        .collect()
}

fn web<const K: usize>(n: usize, n_vertices: usize, seed: u64) -> Vec<[u32; K]> {
    let mut random = Random::new(seed);
    let n_vertices = index(n_vertices);
    (0..n.min(MAX_ELEMENTS))
        .map(|_| std::array::from_fn(|_| random.below(n_vertices)))
        .collect()
}

/// `n` triangles over shared vertices, the points of the lattice 0, 1, …, `k` (at most 255) cubed:
/// a hard case for adjacency rules. Triangles share one, two or three vertices, and a triangle may
/// name the same vertex twice.
pub fn lattice_web(n: usize, k: u32, seed: u64) -> Model {
    let positions = lattice_points(k);
    Model {
        elements: Elements::Triangles(web(n, positions.len(), seed)),
        positions,
    }
}

/// `n` tetrahedra over shared vertices, as [`lattice_web`].
pub fn lattice_web_tetrahedra(n: usize, k: u32, seed: u64) -> Model {
    let positions = lattice_points(k);
    Model {
        elements: Elements::Tetrahedra(web(n, positions.len(), seed)),
        positions,
    }
}
