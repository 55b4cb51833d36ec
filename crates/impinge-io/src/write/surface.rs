//! The surface of a body, for formats that draw triangles only.

use crate::mesh::{Elements, Positions};

/// Triangles to draw, each with its element: the triangles themselves, or the outward-oriented
/// faces of tetrahedra that no other tetrahedron shares.
pub(super) fn surface(positions: &Positions, elements: &Elements) -> Vec<([u32; 3], usize)> {
    match elements {
        Elements::Triangles(triangles) => triangles.iter().copied().zip(0..).collect(),
        Elements::Tetrahedra(tetrahedra) => {
            let mut faces: Vec<([u32; 3], [u32; 3], usize)> =
                Vec::with_capacity(4 * tetrahedra.len());
            for (tetrahedron_ix, &[a, b, c, d]) in tetrahedra.iter().enumerate() {
                let turned = is_turned(positions, [a, b, c, d]);
                for [p, q, r] in [[a, c, b], [a, b, d], [b, c, d], [a, d, c]] {
                    let face = if turned { [p, r, q] } else { [p, q, r] };
                    let mut key = face;
                    key.sort_unstable();
                    faces.push((key, face, tetrahedron_ix));
                }
            }
            faces.sort_unstable_by_key(|&(key, _, tetrahedron_ix)| (key, tetrahedron_ix));
            let mut surface: Vec<([u32; 3], usize)> = faces
                .chunk_by(|one, other| one.0 == other.0)
                .filter(|same| same.len() == 1)
                .map(|same| (same[0].1, same[0].2))
                .collect();
            surface.sort_unstable_by_key(|&(face, tetrahedron_ix)| (tetrahedron_ix, face));
            surface
        }
    }
}

/// Whether the volume is negative. Rounding may give the wrong sign for flat tetrahedra; only the
/// orientation of drawn faces depends on it.
fn is_turned(positions: &Positions, [a, b, c, d]: [u32; 4]) -> bool {
    let at = |ix: u32| positions.get(ix as usize).unwrap_or_default();
    let origin = at(a);
    let [u, v, w] = [b, c, d].map(|ix| {
        let p = at(ix);
        [p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]]
    });
    let cross = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    cross[0] * w[0] + cross[1] * w[1] + cross[2] * w[2] < 0.0
}
