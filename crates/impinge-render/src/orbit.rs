//! A viewpoint that turns around a point, as a mouse moves it.

use crate::camera::{Camera, Focus, Projection};

/// Half the height of what an orthographic camera sees, at a distance of 1: about that of the
/// default perspective.
const ORTHOGRAPHIC: f64 = 0.25;

/// A viewpoint at a distance from a point of the scene. Unlike the camera of a
/// [`Picture`](crate::Picture), it does not depend on the scene's content.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orbit {
    /// The direction from which the scene is seen, the axis that points up, and how depth is shown.
    pub camera: Camera,
    /// The point in the middle of the view, in the unit of the scene.
    pub target: [f64; 3],
    /// The distance from it, above 0.
    pub distance: f64,
}

impl Orbit {
    /// Sees what a picture with this focus sees.
    pub fn at(camera: Camera, Focus { target, distance }: Focus) -> Self {
        Orbit {
            camera,
            target,
            distance,
        }
    }

    /// Sees a box (its lowest and highest coordinates) completely, whatever the direction. `aspect`
    /// is width through height.
    pub fn around(camera: Camera, [low, high]: [[f64; 3]; 2], aspect: f64) -> Self {
        // Halve before adding: the sum of two coordinates may overflow.
        let target = std::array::from_fn(|k| 0.5 * low[k] + 0.5 * high[k]);
        let half = [0, 1, 2].map(|k| 0.5 * high[k] - 0.5 * low[k]);
        let longest = half.into_iter().fold(0.0, f64::max);
        // Scaled by the longest side, so that no square overflows.
        let radius = match longest > 0.0 {
            true => {
                longest
                    * half
                        .map(|x| (x / longest).powi(2))
                        .iter()
                        .sum::<f64>()
                        .sqrt()
            }
            false => 1.0,
        };
        let orbit = Orbit {
            camera,
            target,
            distance: 1.0,
        };
        let [wide, high] = orbit.half_size(aspect);
        let narrow = wide.min(high);
        // The sphere around the box touches the narrower edge of the view: at the sine of its
        // angle.
        let factor = match camera.projection {
            Projection::Perspective { .. } => narrow / (1.0 + narrow * narrow).sqrt(),
            Projection::Orthographic => narrow,
        };
        Orbit {
            distance: radius / factor.max(1e-3),
            ..orbit
        }
    }

    /// The directions to the right, up and towards the viewer.
    pub fn axes(&self) -> [[f64; 3]; 3] {
        let axes = self.camera.axes();
        [axes.right, axes.up, axes.back]
    }

    /// Half the width and half the height of the view, per unit of distance from the eye. (In an
    /// orthographic view they are scaled by the same distance.)
    fn half_size(&self, aspect: f64) -> [f64; 2] {
        let high = match self.camera.projection {
            Projection::Perspective { degrees } => (0.5 * degrees.to_radians()).tan(),
            Projection::Orthographic => ORTHOGRAPHIC,
        };
        [high * aspect, high]
    }

    /// Half the width and half the height of the part of the plane through the target that is
    /// visible, in the unit of the scene.
    pub fn visible(&self, aspect: f64) -> [f64; 2] {
        self.half_size(aspect).map(|x| x * self.distance)
    }

    /// The ray through a point of the view, whose left lower corner is (-1, -1) and whose right
    /// upper corner is (1, 1): where it starts, and its direction (not of length 1).
    pub fn ray(&self, aspect: f64, at: [f64; 2]) -> [[f64; 3]; 2] {
        let [right, up, back] = self.axes();
        let half = self.visible(aspect);
        let (x, y) = (at[0] * half[0], at[1] * half[1]);
        let on_plane: [f64; 3] = std::array::from_fn(|k| self.target[k] + x * right[k] + y * up[k]);
        let eye = |point: [f64; 3]| -> [f64; 3] {
            std::array::from_fn(|k| point[k] + self.distance * back[k])
        };
        let start = match self.camera.projection {
            Projection::Perspective { .. } => eye(self.target),
            Projection::Orthographic => eye(on_plane),
        };
        [start, std::array::from_fn(|k| on_plane[k] - start[k])]
    }

    /// Where a point of the scene is in the view, as in [`ray`](Orbit::ray), and how far it is from
    /// the viewer along the axis of view. `None` behind the viewer.
    pub fn project(&self, aspect: f64, point: [f64; 3]) -> Option<([f64; 2], f64)> {
        let from_target: [f64; 3] = std::array::from_fn(|k| point[k] - self.target[k]);
        let [x, y, z] = self.axes().map(|axis| dot(axis, from_target));
        let depth = self.distance - z;
        let half = self.half_size(aspect);
        match self.camera.projection {
            Projection::Perspective { .. } if depth <= 0.0 => None,
            Projection::Perspective { .. } => {
                Some(([x / (half[0] * depth), y / (half[1] * depth)], depth))
            }
            Projection::Orthographic => Some((
                [x / (half[0] * self.distance), y / (half[1] * self.distance)],
                depth,
            )),
        }
    }
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras() -> [Camera; 2] {
        [Camera::default().projection, Projection::Orthographic].map(|projection| Camera {
            projection,
            ..Camera::default()
        })
    }

    #[test]
    fn a_ray_goes_through_the_points_that_are_seen_there() {
        for camera in cameras() {
            let orbit = Orbit {
                camera,
                target: [1.0, 2.0, 3.0],
                distance: 5.0,
            };
            let [start, along] = orbit.ray(1.5, [0.3, -0.7]);
            for t in [0.5, 1.0, 2.5] {
                let point = std::array::from_fn(|k| start[k] + t * along[k]);
                let (at, depth) = orbit.project(1.5, point).expect("in front");
                assert!(
                    (at[0] - 0.3).abs() < 1e-9 && (at[1] + 0.7).abs() < 1e-9,
                    "{at:?}"
                );
                assert!(depth > 0.0);
            }
        }
    }

    #[test]
    fn a_box_is_seen_completely_in_a_view_of_any_shape() {
        for camera in cameras() {
            for aspect in [0.2, 1.0, 4.0] {
                let bounds = [[-1.0, 4.0, 0.0], [3.0, 5.0, 0.5]];
                let orbit = Orbit::around(camera, bounds, aspect);
                for corner in 0..8 {
                    let point = std::array::from_fn(|k| bounds[corner >> k & 1][k]);
                    let (at, _) = orbit.project(aspect, point).expect("in front");
                    assert!(at.iter().all(|x| x.abs() <= 1.0 + 1e-9), "{aspect} {at:?}");
                }
            }
        }
    }

    #[test]
    fn a_box_without_size_and_a_huge_one_have_a_finite_distance() {
        for bounds in [[[2.0; 3]; 2], [[-1e300; 3], [1e300; 3]]] {
            let orbit = Orbit::around(Camera::default(), bounds, 1.0);
            assert!(
                orbit.distance.is_finite() && orbit.distance > 0.0,
                "{orbit:?}"
            );
        }
    }
}
