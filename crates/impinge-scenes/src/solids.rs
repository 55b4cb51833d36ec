//! Solids of tetrahedra, all of positive volume.

use impinge::Elements;

use crate::model::{Model, count, index, real, to_f32};

/// A block of `n_x * n_y * n_z` cubes with edge `spacing` and one corner at the origin. Each cube
/// is cut into six tetrahedra along its main diagonal (Kuhn 1960), so that faces of neighbouring
/// cubes match.
pub fn block(n_x: usize, n_y: usize, n_z: usize, spacing: f32) -> Model {
    let [n_x, n_y, n_z] = [n_x, n_y, n_z].map(|n| n.clamp(1, 512));
    let vertex = |x: usize, y: usize, z: usize| index((z * (n_y + 1) + y) * (n_x + 1) + x);
    let mut positions = Vec::with_capacity((n_x + 1) * (n_y + 1) * (n_z + 1));
    for z in 0..=n_z {
        for y in 0..=n_y {
            positions.extend(
                (0..=n_x)
                    .map(|x| to_f32([real(x), real(y), real(z)].map(|k| k * f64::from(spacing)))),
            );
        }
    }
    // The order of axes in a path of unit steps from corner 0 to corner 7. Odd permutations swap
    // two corners to keep the volume positive.
    const PATHS: [([usize; 3], bool); 6] = [
        ([0, 1, 2], false),
        ([1, 2, 0], false),
        ([2, 0, 1], false),
        ([0, 2, 1], true),
        ([2, 1, 0], true),
        ([1, 0, 2], true),
    ];
    let mut tets = Vec::with_capacity(6 * n_x * n_y * n_z);
    for z in 0..n_z {
        for y in 0..n_y {
            for x in 0..n_x {
                for (path, odd) in PATHS {
                    let mut at = [x, y, z];
                    let mut tet = [vertex(x, y, z); 4];
                    for (step, axis) in path.into_iter().enumerate() {
                        at[axis] += 1;
                        tet[step + 1] = vertex(at[0], at[1], at[2]);
                    }
                    if odd {
                        tet.swap(1, 2);
                    }
                    tets.push(tet);
                }
            }
        }
    }
    Model {
        positions,
        elements: Elements::Tetrahedra(tets),
    }
}

/// How many cubes along an edge give about `n_tets` tetrahedra.
fn cubes_along(n_tets: usize) -> usize {
    count((real(n_tets) / 6.0).cbrt()).max(1)
}

/// A cube about the origin with edge 1 and about `n_tets` tetrahedra: six times a cube number.
pub fn solid_cube(n_tets: usize) -> Model {
    let n = cubes_along(n_tets).min(512);
    block(n, n, n, 1.0).mapped(|p| p.map(|x| (f64::from(x) / real(n) - 0.5) as f32))
}

/// A ball of radius 0.5 about the origin with about `n_tets` tetrahedra: a [`solid_cube`] whose
/// concentric cubes are mapped to spheres.
pub fn solid_ball(n_tets: usize) -> Model {
    solid_cube(n_tets).mapped(|p| {
        let p = p.map(f64::from);
        let largest = p.iter().fold(0f64, |m, x| m.max(x.abs()));
        let length = p.iter().map(|x| x * x).sum::<f64>().sqrt();
        if length == 0.0 {
            return [0.0; 3];
        }
        to_f32(p.map(|x| x * largest / length))
    })
}
