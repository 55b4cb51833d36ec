//! Figures 4 and 6: one frame of each benchmark with colliding elements in red and blue.

use crate::course::Course;
use crate::error::Error;

/// A file of the report.
#[derive(Debug, Clone, PartialEq)]
pub struct File {
    /// The file's name in the report's folder.
    pub name: String,
    /// The file's content.
    pub bytes: Vec<u8>,
}

/// Draws pictures, if there is a GPU or a software driver.
#[derive(Default)]
pub(crate) struct Painter {
    /// The pictures drawn so far.
    pub files: Vec<File>,
    #[cfg(feature = "gpu")]
    renderer: Option<impinge_render::Renderer>,
}

impl Painter {
    /// A painter; without an adapter, one that draws nothing, and the reason.
    #[cfg(feature = "gpu")]
    pub fn new(device: Option<&str>) -> (Self, Option<String>) {
        use impinge_render::Renderer;
        let renderer = match device {
            Some(name) => Renderer::on_device_named(name),
            None => Renderer::new(),
        };
        let (renderer, reason) = match renderer {
            Ok(renderer) => (Some(renderer), None),
            Err(error) => (None, Some(format!("There are no pictures: {error}."))),
        };
        let files = Vec::new();
        (Painter { files, renderer }, reason)
    }

    /// A painter that draws nothing, and the reason.
    #[cfg(not(feature = "gpu"))]
    pub fn new(_: Option<&str>) -> (Self, Option<String>) {
        let reason = "There are no pictures: the program was built without its feature `gpu`.";
        (Painter::default(), Some(reason.to_owned()))
    }

    /// Whether the painter draws pictures.
    pub fn is_there(&self) -> bool {
        #[cfg(feature = "gpu")]
        return self.renderer.is_some();
        #[cfg(not(feature = "gpu"))]
        false
    }

    /// Draws the bodies in their current pose, with the elements of these pairs coloured. Returns
    /// the file's name.
    #[cfg(not(feature = "gpu"))]
    pub fn paint(&mut self, _: &dyn Course, _: &[[u32; 4]]) -> Result<Option<String>, Error> {
        Ok(None)
    }

    /// Draws the bodies in their current pose, with the elements of these pairs coloured. Returns
    /// the file's name.
    #[cfg(feature = "gpu")]
    pub fn paint(
        &mut self,
        course: &dyn Course,
        rows: &[[u32; 4]],
    ) -> Result<Option<String>, Error> {
        use impinge_render::{Camera, Colors, Picture, Surface};
        /// The colours of the first and of the second body.
        const COLORS: [Colors; 2] = [
            Colors {
                colliding: [214, 32, 39],
                other: [222, 214, 204],
            },
            Colors {
                colliding: [24, 84, 214],
                other: [196, 206, 216],
            },
        ];
        let Some(renderer) = &mut self.renderer else {
            return Ok(None);
        };
        let mut picture = Picture {
            // Bodies lie beside each other along x, or one on the other.
            size: match course.name().is_volume() {
                true => [420, 490],
                false => [570, 380],
            },
            camera: Camera {
                azimuth: 20.0,
                elevation: 14.0,
                ..Camera::default()
            },
            background: [[255; 3]; 2],
            see_through: 0.55,
            ..Picture::default()
        };
        for (ix, (body, colors)) in course.bodies().into_iter().zip(COLORS).enumerate() {
            // Rows name the body with the lower id first, which is the first body.
            let mut colliding: Vec<u32> = rows.iter().map(|row| row[2 * ix + 1]).collect();
            colliding.sort_unstable();
            colliding.dedup();
            let body = course.scene().body(body)?;
            picture
                .surfaces
                .push(Surface::of_body(body, &colliding, colors)?);
        }
        let bytes = renderer
            .render(&picture)?
            .to_png()
            .map_err(|error| Error::Plot(error.to_string()))?;
        let name = format!("{}.png", course.name().name());
        self.files.push(File {
            name: name.clone(),
            bytes,
        });
        Ok(Some(name))
    }
}
