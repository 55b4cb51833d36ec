//! What a window shows.

use std::sync::Arc;

use impinge::{BodyId, Positions, Scene};
use impinge_render::Colors;

/// A body of the scene, with its name and colours.
#[derive(Debug, Clone)]
pub struct Shown {
    /// The body's id in the scene.
    pub id: BodyId,
    /// Its name for the user, such as the name of its file.
    pub name: String,
    /// Its colours.
    pub colors: Colors,
    /// One number per vertex, for the user, such as that in the file of a mesh that was
    /// welded; `None` if it is that in the scene.
    pub vertices: Option<Arc<[u32]>>,
}

impl Shown {
    /// The number of a vertex for the user.
    pub(crate) fn vertex(&self, vertex: u32) -> u32 {
        let all = self.vertices.as_ref();
        let number = all.and_then(|all| all.get(vertex as usize).copied());
        number.unwrap_or(vertex)
    }
}

/// Bodies, and where they are in each frame.
#[derive(Clone)]
pub struct Content {
    /// The bodies. Those that no frame moves stay where they are here.
    pub scene: Scene,
    /// All bodies of the scene, in its order.
    pub bodies: Vec<Shown>,
    /// The frames; `None` if nothing moves by itself.
    pub frames: Option<Arc<dyn Frames>>,
    /// What could not be loaded: a message for the user, who sees the rest.
    pub missing: Option<String>,
}

/// Where bodies are in each frame. Two threads read frames at the same time, in any order.
pub trait Frames: Send + Sync {
    /// The number of frames.
    fn n_frames(&self) -> usize;

    /// The positions of the bodies that move, in a frame counted from 0.
    ///
    /// # Errors
    /// A message for the user: the frame cannot be read.
    fn read(&self, frame_ix: usize) -> Result<Vec<(BodyId, Positions)>, String>;
}

impl Content {
    /// The number of frames, at least 1.
    pub(crate) fn n_frames(&self) -> usize {
        self.frames
            .as_ref()
            .map_or(1, |frames| frames.n_frames().max(1))
    }
}
