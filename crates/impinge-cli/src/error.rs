//! The error type of the program, and its exit codes.

use std::io;
use std::path::PathBuf;

use impinge_io::printable;

use crate::stop;

/// An error that ends the program.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Options that do not fit together or do not fit the input.
    #[error("{0}")]
    Usage(String),
    /// A picture could not be drawn or written.
    #[error(transparent)]
    Picture(#[from] impinge_render::Error),
    /// A window could not be opened.
    #[cfg(feature = "view")]
    #[error(transparent)]
    Window(#[from] impinge_view::Error),
    /// A picture of `impinge view --png` could not be made.
    #[cfg(feature = "view")]
    #[error("{0}")]
    View(String),
    /// A mesh file that can't be read or written.
    #[error(transparent)]
    File(#[from] impinge_io::Error),
    /// A file whose content the library refuses; `what` names it.
    #[error("{}: {source}", printable(.what))]
    Refused {
        what: String,
        source: impinge::Error,
    },
    /// The end of a step has other elements than its start.
    #[error("{0}")]
    Ends(String),
    /// A mesh with seams, which were not to be welded.
    #[error(
        "{}: vertices {} and {} are at one position but not shared, so what they belong to touches at the start, and no step can be \
         taken: leave out --no-weld ({n_coincident} vertices lie at positions of others), or ask with --start skip",
        printable(.name), .vertices[0], .vertices[1]
    )]
    Seam {
        name: String,
        vertices: [u32; 2],
        n_coincident: usize,
    },
    /// The detection failed, or was cancelled.
    #[error(transparent)]
    Detection(#[from] impinge::Error),
    /// A file of an earlier run could not be read.
    #[error("{}: cannot read: {source}", printable(.path))]
    Read { path: PathBuf, source: io::Error },
    /// Rows of pairs, or the folder of an output file, could not be written.
    #[error("{}: cannot write: {source}", printable(.path))]
    Write { path: PathBuf, source: io::Error },
    /// A mesh all of whose faces have zero area: mending leaves none.
    #[error("{}: no face is left, so nothing is written: {n_flat} of zero area", printable(.path))]
    NoFaceLeft { path: PathBuf, n_flat: String },
    /// Pairs were found, and `--fail-on-hit` was given.
    #[error("pairs were found")]
    Hit,
    /// The start of a step already intersects; the answer has said so.
    #[error("the start of the step already intersects")]
    StartIntersects,
    /// Standard output could not be written.
    #[error("standard output: {0}")]
    Output(#[from] io::Error),
    /// The handler for Ctrl-C could not be installed.
    #[error("cannot listen to Ctrl-C: {0}")]
    Signal(io::Error),
    /// Rows of checked meshes can't be kept on disk.
    #[error(transparent)]
    Rows(#[from] impinge_check::StoreError),
    /// Child processes that check meshes can't be run.
    #[error(transparent)]
    Pool(#[from] impinge_check::PoolError),
    /// A step of `impinge tiles` failed.
    #[error(transparent)]
    Tiles(#[from] impinge_tiles::Error),
    /// Meshes have what `--fail-on` names.
    #[error("{0}")]
    CheckFailed(String),
    /// Some files could not be read or checked. All others were.
    #[error("{0}")]
    Unread(String),
    /// A part that this program was built without: its name, its feature, and what else it needs.
    #[cfg(not(feature = "view"))]
    #[error(
        "this impinge was built without {0}: build it with --features {1}{2}, such as `cargo install --locked --path \
         crates/impinge-cli --features {1}` in a checkout of its repository"
    )]
    NotBuilt(&'static str, &'static str, &'static str),
    /// Two methods gave different answers: a defect of the library.
    #[error(
        "frame {frame}: {n_found} pairs by {method}, {n_expected} by {reference}, and the sets differ: please report this"
    )]
    Disagreement {
        frame: u32,
        method: &'static str,
        n_found: usize,
        reference: &'static str,
        n_expected: usize,
    },
}

impl Error {
    /// Whether the error is only a cancellation.
    fn is_cancelled(&self) -> bool {
        matches!(
            self,
            Error::Detection(impinge::Error::Cancelled)
                | Error::Tiles(impinge_tiles::Error::Cancelled)
        )
    }

    /// 128 plus the signal's number if a signal ended the program, 2 for bad usage, 3 for
    /// `--fail-on-hit` and `--fail-on`, 4 if the start of a step already intersects, else 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            error if error.is_cancelled() => stop::exit_code().unwrap_or(1),
            Error::Usage(_)
            | Error::Tiles(impinge_tiles::Error::Argument { .. })
            | Error::Detection(impinge::Error::Setting { .. }) => 2,
            Error::Hit | Error::CheckFailed(_) => 3,
            Error::StartIntersects => 4,
            _ => 1,
        }
    }

    /// Whether nothing is printed on standard error.
    pub fn is_silent(&self) -> bool {
        matches!(self, Error::Hit | Error::StartIntersects)
    }

    /// The message on one line. Names of files are escaped in it; what a driver says may have
    /// several lines.
    pub fn line(&self) -> String {
        let text = self.to_string();
        let lines: Vec<&str> = text
            .lines()
            .map(str::trim)
            .filter(|line| !line.is_empty())
            .collect();
        lines.join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_take_one_line() {
        let error = Error::Detection(impinge::Error::Gpu {
            what: "shader:\n  line 3\n\n".to_owned(),
        });
        assert_eq!(error.line(), "GPU: shader:; line 3");
    }

    #[test]
    fn codes() {
        assert_eq!(Error::Usage(String::new()).exit_code(), 2);
        assert_eq!(Error::Detection(impinge::Error::Cancelled).exit_code(), 1);
        assert_eq!(
            Error::Output(io::ErrorKind::StorageFull.into()).exit_code(),
            1
        );
    }
}
