//! A window that shows deforming meshes and what collides in them, live.
//!
//! ```no_run
//! use impinge::Scene;
//! use impinge_view::{Content, Options, Shown};
//! # fn main() -> Result<(), impinge_view::Error> {
//! # let (faces, positions) = ([[0u32, 1, 2]], [[0.0f32; 3]; 3]);
//! let load = move || {
//!     let mut scene = Scene::new();
//!     let id = scene.add_triangles(&faces, &positions).map_err(|error| error.to_string())?;
//!     let colors = impinge_render::Colors { colliding: [214, 39, 40], other: [200; 3] };
//!     let shown = vec![Shown { id, name: "cloth".to_owned(), colors, vertices: None }];
//!     Ok(Content { scene, bodies: shown, frames: None, missing: None })
//! };
//! impinge_view::show(load, Options::default())
//! # }
//! ```
//!
//! The window opens at once; `load` runs on a thread of its own, and its error is shown as a
//! message. Detection runs on the window's thread in each frame that is drawn. The pairs of all
//! frames are counted on another thread, for the timeline.

mod app;
mod content;
mod drag;
mod find;
mod flight;
mod input;
mod options;
mod panel;
mod pick;
mod picture;
mod places;
mod player;
mod screen;
mod session;
mod stage;
mod timeline;
mod view;
mod window;

pub use app::Viewer;
pub use content::{Content, Frames, Shown};
pub use options::{Backend, Command, Opener, Options, Shows};
pub use picture::{draw_png, write_png};
pub use timeline::Count;
pub use window::{Error, show};
