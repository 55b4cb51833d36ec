//! Errors of a run.

use std::path::PathBuf;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Options that do not fit together.
    #[error("{0}")]
    Options(String),
    /// A mesh file that cannot be read.
    #[error(transparent)]
    File(#[from] impinge_io::Error),
    /// A mesh of the wrong kind for its scene.
    #[error("{}: {scene} needs {needed}, but the file holds {found}", path.display())]
    WrongKind {
        /// The file.
        path: PathBuf,
        /// The scene for which it was given.
        scene: &'static str,
        /// The needed kind of elements.
        needed: &'static str,
        /// The kind of elements in the file.
        found: &'static str,
    },
    /// A detection failed, or was cancelled.
    #[error(transparent)]
    Detection(#[from] impinge::Error),
    /// A simulation failed, or was cancelled.
    #[error(transparent)]
    Simulation(#[from] impinge_fem::Error),
    /// A picture could not be drawn.
    #[cfg(feature = "gpu")]
    #[error("picture: {0}")]
    Picture(#[from] impinge_render::Error),
    /// A plot could not be drawn.
    #[error("plot: {0}")]
    Plot(String),
    /// A file of the report could not be written.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
}

impl Error {
    /// Whether the run was cancelled.
    pub fn is_cancelled(&self) -> bool {
        matches!(
            self,
            Error::Detection(impinge::Error::Cancelled)
                | Error::Simulation(impinge_fem::Error::Detection(impinge::Error::Cancelled))
        )
    }
}
