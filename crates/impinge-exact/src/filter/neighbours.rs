//! Triangles of one body that share a vertex or an edge (`SharedVertex::Resolve`).

use super::Point;
use super::determinant::{Determinant, Normal, difference};

/// Whether the triangles v, a and v, b certainly meet, and certainly miss, beyond v.
///
/// If one plane has the other triangle's two vertices strictly on one side, they miss. If each
/// plane has the other's vertices on different sides, each triangle contains the start of one ray
/// from v along the line where the planes meet. Let n_a, n_b be the normals of (v, vertex 0, vertex
/// 1). The ray of a has the direction n_a x n_b if vertex 0 of a is above b, else the opposite one;
/// the ray of b has it if vertex 0 of b is *below* a. So they meet if and only if exactly one of
/// the two is above.
#[inline(always)]
pub(crate) fn shared_vertex(v: &Point, a: [&Point; 2], b: [&Point; 2]) -> (bool, bool) {
    let (a, b) = (a.map(|p| difference(p, v)), b.map(|p| difference(p, v)));
    let (normal_a, normal_b) = (Normal::new(&a[0], &a[1]), Normal::new(&b[0], &b[1]));
    let [b0, b1] = b.map(|f| normal_a.dot(&f));
    let [a0, a1] = a.map(|f| normal_b.dot(&f));
    let part = a0.is_opposite(a1) & b0.is_opposite(b1);
    let opposite = a0.seems_positive() != b0.seems_positive();
    (
        part & opposite,
        a0.is_same(a1) | b0.is_same(b1) | (part & !opposite),
    )
}

/// Whether the triangles u, v, p and u, v, q are certainly not coplanar, so that they share the
/// edge uv and nothing else.
#[inline(always)]
pub(crate) fn shared_edge(u: &Point, v: &Point, p: &Point, q: &Point) -> bool {
    Determinant::new(&difference(v, u), &difference(p, u), &difference(q, u)).is_sure()
}
