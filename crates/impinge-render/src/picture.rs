//! The content of a picture, as plain data.

use crate::camera::{Camera, Focus};
use crate::error::Error;

/// One triangle of a [`Surface`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Face {
    /// Indices of its vertices.
    pub corners: [u32; 3],
    /// sRGB.
    pub color: [u8; 3],
    /// Whether it is faintly visible where other faces hide it: see [`Picture::see_through`].
    pub shows_through: bool,
}

/// How a surface is shaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Normals {
    /// Every face is flat.
    #[default]
    Flat,
    /// Faces that share vertices look like one curved surface, except at edges sharper than 50
    /// degrees.
    Smooth,
}

/// Triangles with one colour each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Surface {
    /// One position per vertex, all finite, in any unit.
    pub positions: Vec<[f64; 3]>,
    /// The triangles. Degenerate ones are invisible.
    pub faces: Vec<Face>,
    /// How it is shaded.
    pub normals: Normals,
}

/// A picture: its content, viewpoint and size.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// The content.
    pub surfaces: Vec<Surface>,
    /// The viewpoint.
    pub camera: Camera,
    /// What it looks at; `None`: everything.
    pub focus: Option<Focus>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// How visible hidden faces that [show through](Face::shows_through) are, from 0 (not at all)
    /// to 1 (as if nothing hid them).
    pub see_through: f32,
    /// How dark hollows are, from 0 (as bright as the rest) to 1.
    pub occlusion: f32,
    /// sRGB colours of the background's upper and lower edge.
    pub background: [[u8; 3]; 2],
}

impl Default for Picture {
    fn default() -> Self {
        Picture {
            surfaces: Vec::new(),
            camera: Camera::default(),
            focus: None,
            size: [1280, 960],
            see_through: 0.5,
            occlusion: 0.7,
            background: [[255, 255, 255], [236, 239, 243]],
        }
    }
}

impl Picture {
    /// Returns the first error in the picture, if any.
    pub(crate) fn check(&self) -> Result<(), Error> {
        for (setting, given) in [
            ("see_through", self.see_through),
            ("occlusion", self.occlusion),
        ] {
            if !(0.0..=1.0).contains(&given) {
                return Err(Error::Setting {
                    setting,
                    given: given.into(),
                    allowed: "0 to 1",
                });
            }
        }
        self.camera.check()?;
        if let Some(focus) = &self.focus {
            focus.check()?;
        }
        for (surface_ix, surface) in self.surfaces.iter().enumerate() {
            surface.check(surface_ix)?;
        }
        Ok(())
    }
}

impl Surface {
    fn check(&self, surface: usize) -> Result<(), Error> {
        let is_finite = |point: &[f64; 3]| point.iter().all(|x| x.is_finite());
        if let Some(vertex) = self.positions.iter().position(|point| !is_finite(point)) {
            return Err(Error::NonFinitePosition {
                surface,
                vertex,
                value: self.positions[vertex],
            });
        }
        let n_vertices = self.positions.len();
        for (face, Face { corners, .. }) in self.faces.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&ix| ix as usize >= n_vertices) {
                return Err(Error::VertexIndexOutOfRange {
                    surface,
                    face,
                    index,
                    n_vertices,
                });
            }
        }
        Ok(())
    }

    /// The corners' positions.
    pub(crate) fn points(&self, face: &Face) -> [[f64; 3]; 3] {
        face.corners.map(|ix| self.positions[ix as usize])
    }
}
