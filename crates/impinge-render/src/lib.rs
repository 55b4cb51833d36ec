//! Pictures of meshes and their colliding elements, drawn off screen: on the CPU, or with `wgpu`
//! on any GPU.
//!
//! A [`Picture`] is plain data: [`Surface`]s with one colour per face, a [`Camera`] and a size.
//! [`Picture::draw`] turns it into an [`Image`] on the CPU; with the feature `gpu` a `Renderer`
//! does so on a GPU, with the same light. Unless the picture has a [`Focus`], the camera distance
//! is chosen so that everything is visible.
//!
//! ```no_run
//! use impinge::{Backend, Detector, Query, Scene};
//! use impinge_render::{Colors, Picture, Renderer, Surface};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let (faces, positions) = ([[0u32, 1, 2]], [[0.0f32; 3]; 3]);
//! let mut scene = Scene::new();
//! let a = scene.add_triangles(&faces, &positions)?;
//! let b = scene.add_triangles(&faces, &positions)?;
//! let mut detector = Detector::new(Backend::Auto)?;
//! let pairs = detector.detect(&scene, &Query::between(a, b))?;
//!
//! let mut picture = Picture::default();
//! for (body, red_or_blue) in [(a, [215, 38, 61]), (b, [27, 95, 217])] {
//!     let colors = Colors { colliding: red_or_blue, other: [200; 3] };
//!     let colliding = pairs.colliding(body);
//!     picture.surfaces.push(Surface::of_body(scene.body(body)?, &colliding, colors)?);
//! }
//! picture.draw()?.write_png("collision.png")?; // or Renderer::new()?.render(&picture)?
//! # Ok(()) }
//! ```
//!
//! # What is drawn
//! Both sides of every face, with soft light and darkened hollows, four samples per pixel. Faces
//! that [show through](Face::shows_through) are faintly visible where other faces hide them, so
//! that a band of contact can be followed around a body. For tetrahedra, the boundary is drawn, and
//! all faces of colliding tetrahedra.
//!
//! # Live
//! `Live` (feature `gpu`) draws bodies that move into a texture of the caller's, such as a
//! window's, many times per second. It is simpler (flat faces, no darkened hollows) and never waits
//! for the device.
//!
//! # What it costs
//! A picture is drawn in tiles, and faces are uploaded in chunks. So memory beyond the faces
//! themselves (72 bytes each) is bounded, whatever the size of the picture. The same picture on the
//! same device gives the same bytes; different devices may differ in the last bits.

mod body;
mod camera;
mod corners;
#[cfg(feature = "gpu")]
mod device;
mod error;
mod faces;
mod image;
#[cfg(feature = "gpu")]
mod live;
mod orbit;
mod picture;
#[cfg(feature = "gpu")]
mod pipelines;
mod ramp;
#[cfg(feature = "gpu")]
mod renderer;
mod software;
#[cfg(feature = "gpu")]
mod targets;
mod tubes;
mod view;

pub use body::Colors;
pub use camera::{Camera, Focus, Projection, UpAxis};
pub use error::Error;
pub use faces::Faces;
pub use image::Image;
/// The GPU interface of [`Renderer::with_device`] and [`Live`].
#[cfg(feature = "gpu")]
pub use impinge::wgpu;
#[cfg(feature = "gpu")]
pub use live::{Live, Look};
pub use orbit::Orbit;
pub use picture::{Face, Normals, Picture, Surface};
#[doc(hidden)]
#[cfg(feature = "gpu")]
pub use pipelines::shaders;
pub use ramp::{Least, ramp};
#[cfg(feature = "gpu")]
pub use renderer::Renderer;
