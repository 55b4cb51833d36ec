//! What the mouse does to the view and to bodies.

use impinge_render::Orbit;

use crate::stage::Matrix;

/// What a drag does, decided where it began.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Drag {
    /// The view turns around its target.
    Turn,
    /// The view moves in its plane.
    Shift,
    /// A body moves in the plane of the view, at this distance from the viewer divided by that of
    /// the target.
    Move { body: usize, depth: f64 },
    /// A body turns around a point.
    Spin { body: usize, center: [f64; 3] },
}

/// Degrees of the view per point of the mouse.
const TURN: f64 = 0.35;
/// Radians of a body per point of the mouse.
const SPIN: f64 = 0.008;

/// Turns the view by a motion of the mouse in points, x to the right and y downwards.
pub(crate) fn turn(orbit: &mut Orbit, [x, y]: [f64; 2]) {
    let camera = &mut orbit.camera;
    camera.azimuth = (camera.azimuth - TURN * x) % 360.0;
    camera.elevation = (camera.elevation + TURN * y).clamp(-90.0, 90.0);
}

/// The motion of a point of the scene that follows the mouse, in the plane through the target, for
/// a view of `height` points.
pub(crate) fn along_view(orbit: &Orbit, height: f64, [x, y]: [f64; 2]) -> [f64; 3] {
    let [right, up, _] = orbit.axes();
    // The visible height through the height in points.
    let unit = 2.0 * orbit.visible(1.0)[1] / height.max(1.0);
    std::array::from_fn(|k| unit * (x * right[k] - y * up[k]))
}

/// A matrix followed by a motion.
pub(crate) fn moved(matrix: &Matrix, by: [f64; 3]) -> Matrix {
    let mut moved = *matrix;
    for (row, by) in moved.iter_mut().zip(by) {
        row[3] += by;
    }
    moved
}

/// A matrix followed by a rotation around a point, by a motion of the mouse.
pub(crate) fn spun(matrix: &Matrix, orbit: &Orbit, center: [f64; 3], [x, y]: [f64; 2]) -> Matrix {
    let [right, up, _] = orbit.axes();
    let rotation = product(&rotation(up, SPIN * x), &rotation(right, SPIN * y));
    let back = moved(matrix, center.map(|x| -x));
    moved(&product(&rotation, &back), center)
}

/// A rotation around a unit axis through the origin.
fn rotation([x, y, z]: [f64; 3], angle: f64) -> Matrix {
    let (sin, cos) = angle.sin_cos();
    let t = 1.0 - cos;
    [
        [
            t * x * x + cos,
            t * x * y - sin * z,
            t * x * z + sin * y,
            0.0,
        ],
        [
            t * x * y + sin * z,
            t * y * y + cos,
            t * y * z - sin * x,
            0.0,
        ],
        [
            t * x * z - sin * y,
            t * y * z + sin * x,
            t * z * z + cos,
            0.0,
        ],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let mut rows: Matrix =
        std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()));
    // Exactly, whatever the rounding.
    rows[3] = [0.0, 0.0, 0.0, 1.0];
    rows
}

#[cfg(test)]
mod tests {
    use impinge_render::Camera;

    use super::*;
    use crate::stage::IDENTITY;

    #[test]
    fn a_body_that_is_spun_keeps_its_center() {
        let orbit = Orbit {
            camera: Camera::default(),
            target: [0.0; 3],
            distance: 3.0,
        };
        let center = [1.0, 2.0, 3.0];
        let matrix = spun(&IDENTITY, &orbit, center, [40.0, -20.0]);
        assert_ne!(matrix, IDENTITY);
        for k in 0..3 {
            let at: f64 = (0..3).map(|j| matrix[k][j] * center[j]).sum::<f64>() + matrix[k][3];
            assert!((at - center[k]).abs() < 1e-12);
        }
    }
}
