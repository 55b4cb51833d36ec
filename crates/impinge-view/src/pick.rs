//! Which triangle is under the pointer.

use impinge_render::Faces;

use crate::stage::Stage;

/// An element that a ray meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hit {
    pub body: usize,
    pub element: u32,
    /// How far along the ray, in lengths of its direction.
    pub t: f64,
}

/// The first visible face that a ray meets. With `only`, faces of other elements are ignored.
pub(crate) fn pick<'a>(
    stage: &Stage,
    faces: impl Fn(usize) -> Option<&'a Faces>,
    [start, along]: [[f64; 3]; 2],
    only: Option<&[Vec<u32>]>,
) -> Option<Hit> {
    let mut nearest: Option<Hit> = None;
    for (ix, shown) in stage.content.bodies.iter().enumerate() {
        let (Ok(body), Some(faces)) = (stage.scene().body(shown.id), faces(ix)) else {
            continue;
        };
        let positions = body.positions();
        for face in 0..faces.len() {
            let (Some(corners), Some(element)) = (faces.corners(face), faces.element(face)) else {
                continue;
            };
            if faces.is_inner(face) {
                continue;
            }
            let is_shown = only.is_none_or(|only| {
                only.get(ix)
                    .is_some_and(|shown| shown.binary_search(&element).is_ok())
            });
            if !is_shown {
                continue;
            }
            let points = corners.map(|vertex| positions.point(vertex as usize));
            if let Some(t) = meets(start, along, points)
                && nearest.is_none_or(|held| t < held.t)
            {
                nearest = Some(Hit {
                    body: ix,
                    element,
                    t,
                });
            }
        }
    }
    nearest
}

/// Where a ray meets a triangle (Möller and Trumbore 1997). Rounded: it is for a pointer, not for
/// an answer.
fn meets(start: [f64; 3], along: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> Option<f64> {
    let (u, v) = (sub(b, a), sub(c, a));
    let p = cross(along, v);
    let determinant = dot(u, p);
    if determinant == 0.0 {
        return None;
    }
    let from_a = sub(start, a);
    let x = dot(from_a, p) / determinant;
    let q = cross(from_a, u);
    let y = dot(along, q) / determinant;
    let t = dot(v, q) / determinant;
    (x >= 0.0 && y >= 0.0 && x + y <= 1.0 && t > 0.0).then_some(t)
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_a_triangle_in_front_of_it_alone() {
        let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let down = [0.0, 0.0, -2.0];
        assert_eq!(meets([0.2, 0.2, 1.0], down, triangle), Some(0.5));
        assert_eq!(meets([0.8, 0.8, 1.0], down, triangle), None);
        assert_eq!(meets([0.2, 0.2, -1.0], down, triangle), None);
        assert_eq!(meets([0.2, 0.2, 1.0], [1.0, 0.0, 0.0], triangle), None);
    }
}
