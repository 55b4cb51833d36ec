//! Segments as thin tubes.

use crate::picture::{Face, Normals, Surface};

/// Sides of a tube.
const N_SIDES: u32 = 6;

impl Surface {
    /// Tubes around segments, such as the curves in which surfaces cross; they show through.
    /// Segments without length have none. `radius` is in the unit of the scene.
    pub fn of_segments(segments: &[[[f64; 3]; 2]], radius: f64, color: [u8; 3]) -> Surface {
        let mut tubes = Surface {
            normals: Normals::Smooth,
            ..Surface::default()
        };
        for &[p, q] in segments {
            let Some([u, v]) = across([0, 1, 2].map(|k| q[k] - p[k])) else {
                continue;
            };
            // More vertices than 32 bits can number are far beyond what a picture can show.
            let Ok(first) = u32::try_from(tubes.positions.len()) else {
                return tubes;
            };
            if first > u32::MAX - 2 * N_SIDES {
                return tubes;
            }
            for side in 0..N_SIDES {
                let (sin, cos) =
                    (std::f64::consts::TAU * f64::from(side) / f64::from(N_SIDES)).sin_cos();
                for end in [p, q] {
                    let out = |k: usize| end[k] + radius * (cos * u[k] + sin * v[k]);
                    tubes.positions.push([0, 1, 2].map(out));
                }
                let [here, next] = [side, (side + 1) % N_SIDES].map(|side| first + 2 * side);
                for corners in [[here, next, here + 1], [here + 1, next, next + 1]] {
                    tubes.faces.push(Face {
                        corners,
                        color,
                        shows_through: true,
                    });
                }
            }
        }
        tubes
    }
}

/// Two unit vectors perpendicular to a direction and to each other; `None` for a zero vector.
fn across(d: [f64; 3]) -> Option<[[f64; 3]; 2]> {
    let unit = |v: [f64; 3]| {
        let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        (length > 0.0).then(|| v.map(|x| x / length))
    };
    let cross = |p: [f64; 3], q: [f64; 3]| {
        [
            p[1] * q[2] - p[2] * q[1],
            p[2] * q[0] - p[0] * q[2],
            p[0] * q[1] - p[1] * q[0],
        ]
    };
    let d = unit(d)?;
    // The axis that deviates most from the direction.
    let axis = (1..3).fold(
        0,
        |best, k| if d[k].abs() < d[best].abs() { k } else { best },
    );
    let mut base = [0.0; 3];
    base[axis] = 1.0;
    let u = unit(cross(d, base))?;
    Some([u, cross(d, u)])
}
