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

/// The viewpoint of a picture. The distance is chosen so that the picture contains everything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Degrees counter-clockwise around the up axis, seen from above. At 0 the viewer is on the side of
    /// +z if y is up, and of -y if z is up; in both cases +x is to the right.
    pub azimuth: f64,
    /// Degrees above the ground, -90 to 90.
    pub elevation: f64,
    /// The axis that points up.
    pub up: UpAxis,
    /// How the picture shows depth.
    pub projection: Projection,
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
        let refused = |setting, given, allowed| {
            Err(Error::Setting {
                setting,
                given,
                allowed,
            })
        };
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

#[derive(Debug, Clone, Copy)]
pub(crate) struct Axes {
    pub right: [f64; 3],
    pub up: [f64; 3],
    pub back: [f64; 3],
    pub sky: [f64; 3],
}
