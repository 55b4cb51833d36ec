//! The viewpoint of a picture.

use crate::error::Error;

/// Which axis points up in a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UpAxis {
    /// As in glTF, and in most scanned meshes.
    #[default]
    Y,
    /// As in engineering and in Blender.
    Z,
}

/// How a picture shows depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Distant objects look smaller.
    Perspective {
        /// The angle between the picture's upper and lower edge, above 0, at most 120 degrees.
        degrees: f64,
    },
    /// Parallel lines stay parallel.
    Orthographic,
}

/// The viewpoint of a picture. Unless the picture has a [`Focus`], the distance is chosen so that
/// it contains everything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Degrees counter-clockwise around the up axis, seen from above. At 0 the viewer is on the
    /// side of +z if y is up, and of -y if z is up; in both cases +x is to the right.
    pub azimuth: f64,
    /// Degrees above the ground, -90 to 90.
    pub elevation: f64,
    /// The axis that points up.
    pub up: UpAxis,
    /// How the picture shows depth.
    pub projection: Projection,
}

/// What a picture looks at, and from how far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Focus {
    /// The point in the middle of the picture, in the unit of the scene.
    pub target: [f64; 3],
    /// The distance of the viewer from it, above 0, in the same unit. Without perspective, a
    /// quarter of it is half the height of what is seen.
    pub distance: f64,
}

impl Default for Camera {
    fn default() -> Self {
        Camera {
            azimuth: -25.0,
            elevation: 20.0,
            up: UpAxis::default(),
            projection: Projection::Perspective { degrees: 28.0 },
        }
    }
}

impl Camera {
    pub(crate) fn check(&self) -> Result<(), Error> {
        if !self.azimuth.is_finite() {
            return refused("azimuth", self.azimuth, "any finite angle");
        }
        if !(-90.0..=90.0).contains(&self.elevation) {
            return refused("elevation", self.elevation, "-90 to 90");
        }
        match self.projection {
            Projection::Perspective { degrees } if !(degrees > 0.0 && degrees <= 120.0) => {
                refused("angle of view", degrees, "above 0 to 120")
            }
            _ => Ok(()),
        }
    }

    /// Directions to the right, up and towards the viewer, and the up axis of the scene.
    pub(crate) fn axes(&self) -> Axes {
        let (sin_a, cos_a) = self.azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = self.elevation.to_radians().sin_cos();
        // Axes for y up; for z up, (x, y, z) then becomes (x, -z, y).
        let axes = Axes {
            right: [cos_a, 0.0, -sin_a],
            up: [-sin_a * sin_e, cos_e, -cos_a * sin_e],
            back: [sin_a * cos_e, sin_e, cos_a * cos_e],
            sky: [0.0, 1.0, 0.0],
        };
        let turn = |[x, y, z]: [f64; 3]| match self.up {
            UpAxis::Y => [x, y, z],
            UpAxis::Z => [x, -z, y],
        };
        Axes {
            right: turn(axes.right),
            up: turn(axes.up),
            back: turn(axes.back),
            sky: turn(axes.sky),
        }
    }
}

fn refused(setting: &'static str, given: f64, allowed: &'static str) -> Result<(), Error> {
    Err(Error::Setting {
        setting,
        given,
        allowed,
    })
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Axes {
    pub right: [f64; 3],
    pub up: [f64; 3],
    pub back: [f64; 3],
    pub sky: [f64; 3],
}

impl Focus {
    pub(crate) fn check(&self) -> Result<(), Error> {
        if let Some(&x) = self.target.iter().find(|x| !x.is_finite()) {
            return refused("target", x, "finite coordinates");
        }
        match self.distance > 0.0 && self.distance.is_finite() {
            true => Ok(()),
            false => refused("distance", self.distance, "any finite number above 0"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_focus_at_no_place_is_refused() {
        let focus = |x, distance| Focus {
            target: [0.0, x, 0.0],
            distance,
        };
        assert!(focus(1e300, 1e-300).check().is_ok());
        for (bad, setting) in [
            (focus(f64::NAN, 1.0), "target"),
            (focus(f64::INFINITY, 1.0), "target"),
            (focus(0.0, 0.0), "distance"),
            (focus(0.0, -1.0), "distance"),
            (focus(0.0, f64::NAN), "distance"),
            (focus(0.0, f64::INFINITY), "distance"),
        ] {
            let error = bad.check().expect_err("refused").to_string();
            assert!(error.contains(setting), "{error}");
        }
    }
}
