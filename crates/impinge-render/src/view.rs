//! Fits a camera to the content of a picture.

use crate::camera::{Axes, Focus, Projection};
use crate::orbit::Orbit;
use crate::picture::Picture;

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The coordinate system for drawing: the middle of the scene is at 0 and its longest half extent
/// is 1. Converted in f64, so that a scene far from the origin keeps its shape in f32.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    middle: [f64; 3],
    half: f64,
}

impl Frame {
    /// The frame of all vertices that faces use.
    pub fn of(picture: &Picture) -> Frame {
        let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for surface in &picture.surfaces {
            for face in &surface.faces {
                for point in surface.points(face) {
                    for k in 0..3 {
                        min[k] = min[k].min(point[k]);
                        max[k] = max[k].max(point[k]);
                    }
                }
            }
        }
        if min[0] > max[0] {
            return Frame {
                middle: [0.0; 3],
                half: 1.0,
            };
        }
        // Halve before adding: the sum of two coordinates may overflow.
        let middle = std::array::from_fn(|k| 0.5 * min[k] + 0.5 * max[k]);
        let half = (0..3)
            .map(|k| 0.5 * max[k] - 0.5 * min[k])
            .fold(0.0, f64::max);
        Frame {
            middle,
            half: if half > 0.0 { half } else { 1.0 },
        }
    }

    /// A point in these coordinates.
    pub fn place(&self, point: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|k| (point[k] - self.middle[k]) / self.half)
    }
}

/// A fitted camera, in the coordinates of a [`Frame`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct View {
    /// Axes to the right, up and towards the viewer; `w` moves the eye to 0.
    pub axes: [[f64; 4]; 3],
    /// The scene's up axis as seen by the viewer.
    pub sky: [f64; 3],
    /// Factors of x and y, and `a`, `b` of depth `a z + b` (before division by `-z` in
    /// perspective).
    pub projection: [f64; 4],
    pub is_perspective: bool,
}

/// The share of the picture's half width and half height that the content fills.
const FILLED: f64 = 0.93;

/// The nearest visible point, as a share of the distance of what the picture looks at.
const NEAREST: f64 = 2e-3;

impl View {
    /// The view that a picture asks for.
    pub fn of(picture: &Picture, frame: &Frame) -> View {
        match picture.focus {
            Some(focus) => View::at(picture, frame, focus),
            None => View::fit(picture, frame),
        }
    }

    /// Looks at a point, whatever else the picture contains.
    fn at(picture: &Picture, frame: &Frame, focus: Focus) -> View {
        let camera = picture.camera;
        let axes = camera.axes();
        let orbit = Orbit::at(camera, focus);
        let Focus { target, distance } = focus;
        let aspect = f64::from(picture.size[0]) / f64::from(picture.size[1]);
        let [wide, high] = orbit.visible(aspect).map(|x| x / distance);
        let (target, distance) = (frame.place(target), distance / frame.half);
        let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
        for surface in &picture.surfaces {
            for face in &surface.faces {
                for point in surface.points(face).map(|point| frame.place(point)) {
                    let z = dot(axes.back, point);
                    (near, far) = (near.max(z), far.min(z));
                }
            }
        }
        if near < far {
            (near, far) = (1.0, -1.0);
        }
        let room = 1e-3 + 0.01 * (near - far);
        let middle = [axes.right, axes.up, axes.back].map(|axis| dot(axis, target));
        match camera.projection {
            Projection::Perspective { .. } => {
                let eye = [middle[0], middle[1], middle[2] + distance];
                let near = (eye[2] - near - room).max(NEAREST * distance);
                let far = (eye[2] - far + room).max(2.0 * near);
                View::new(&axes, eye, [wide, high], [near, far], true)
            }
            Projection::Orthographic => {
                let eye = [middle[0], middle[1], near + room];
                let (near, far) = (0.0, near - far + 2.0 * room);
                let size = [wide * distance, high * distance];
                View::new(&axes, eye, size, [near, far], false)
            }
        }
    }

    /// Fits a camera to the picture's faces, so that the outermost points touch the filled part on
    /// each side.
    fn fit(picture: &Picture, frame: &Frame) -> View {
        let camera = &picture.camera;
        let axes = camera.axes();
        let aspect = f64::from(picture.size[0]) / f64::from(picture.size[1]);
        // Half width and half height of the visible region: of the scene, or at distance 1.
        let (wide, high) = match camera.projection {
            Projection::Perspective { degrees } => {
                let high = (0.5 * degrees.to_radians()).tan();
                (high * aspect, high)
            }
            Projection::Orthographic => (aspect, 1.0),
        };
        let slope = match camera.projection {
            Projection::Perspective { .. } => [FILLED * wide, FILLED * high],
            Projection::Orthographic => [f64::INFINITY; 2],
        };
        // In perspective, x stays within the right edge if x / slope + z is at most the eye's
        // distance (for an eye at x = 0). So the outermost point of each edge is the point with the
        // largest sum; in orthographic projection, the point with the largest x.
        let mut outermost = [[f64::NEG_INFINITY; 2]; 2];
        let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
        for surface in &picture.surfaces {
            for face in &surface.faces {
                for point in surface.points(face).map(|point| frame.place(point)) {
                    let z = dot(axes.back, point);
                    (near, far) = (near.max(z), far.min(z));
                    for (k, axis) in [axes.right, axes.up].into_iter().enumerate() {
                        let x = dot(axis, point);
                        let [low, high] = &mut outermost[k];
                        let (left, right) = if slope[k].is_finite() {
                            (z - x / slope[k], z + x / slope[k])
                        } else {
                            (-x, x)
                        };
                        (*low, *high) = (low.max(left), high.max(right));
                    }
                }
            }
        }
        if near < far {
            (near, far) = (1.0, -1.0);
            outermost = [[1.0; 2]; 2];
        }
        let half = outermost.map(|[low, high]| 0.5 * (low + high));
        let offset = outermost.map(|[low, high]| 0.5 * (high - low));
        let room = 1e-3 + 0.01 * (near - far);
        match camera.projection {
            Projection::Perspective { .. } => {
                let distance = half[0].max(half[1]).max(near + 2.0 * room);
                let eye = [offset[0] * slope[0], offset[1] * slope[1], distance];
                let (near, far) = (distance - near - room, distance - far + room);
                View::new(&axes, eye, [wide, high], [near, far], true)
            }
            Projection::Orthographic => {
                let high = (half[1].max(half[0] / aspect) / FILLED).max(1e-3);
                let eye = [offset[0], offset[1], near + room];
                let (near, far) = (0.0, near - far + 2.0 * room);
                View::new(&axes, eye, [high * aspect, high], [near, far], false)
            }
        }
    }

    /// `eye` is given in the coordinates of `axes`. The view reaches so far to each side (half the
    /// width, half the height), in perspective at the distance 1, and from one distance from the
    /// eye to another.
    fn new(
        axes: &Axes,
        eye: [f64; 3],
        [wide, high]: [f64; 2],
        [near, far]: [f64; 2],
        is_perspective: bool,
    ) -> View {
        let range = near - far;
        let depth = match is_perspective {
            true => [far / range, near * far / range],
            false => [1.0 / range, near / range],
        };
        let all = [axes.right, axes.up, axes.back];
        View {
            axes: std::array::from_fn(|k| {
                let [x, y, z] = all[k];
                [x, y, z, -eye[k]]
            }),
            sky: all.map(|axis| dot(axis, axes.sky)),
            projection: [1.0 / wide, 1.0 / high, depth[0], depth[1]],
            is_perspective,
        }
    }
}
