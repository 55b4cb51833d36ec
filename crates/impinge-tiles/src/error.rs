//! Errors of plans, their files and their meshes.

use std::path::{Path, PathBuf};

/// An error of a plan, its files or its meshes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system reported an error. Check the path, and the free space on its disk.
    #[error("{}: cannot {action}: {source}", impinge_io::printable(.path))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The failed action.
        action: &'static str,
        /// The system's error.
        source: std::io::Error,
    },
    /// A mesh file that can't be read, or a file that can't be written.
    #[error(transparent)]
    Mesh(#[from] impinge_io::Error),
    /// The detection in a tile failed or was cancelled.
    #[error("tile {tile}: {source}")]
    Detection {
        /// The tile.
        tile: u32,
        /// The library's error.
        source: impinge::Error,
    },
    /// The caller cancelled the step. Finished work is kept.
    #[error("cancelled")]
    Cancelled,
    /// A coordinate that is not finite. Its box would lie in no tile.
    #[error("{}: element {element} has the coordinate {value:e}: not a finite number", impinge_io::printable(.path))]
    Coordinate {
        /// The mesh file.
        path: PathBuf,
        /// The element, counted from 0.
        element: u64,
        /// The coordinate.
        value: f64,
    },
    /// An element names a vertex that the file does not have.
    #[error("{}: element {element} names vertex {index}, but there are {n_vertices} vertices", impinge_io::printable(.path))]
    VertexIndex {
        /// The mesh file.
        path: PathBuf,
        /// The element, counted from 0.
        element: u64,
        /// The vertex it names.
        index: i64,
        /// How many vertices there are.
        n_vertices: u64,
    },
    /// More elements than 32-bit numbers can name. Split the file.
    #[error("{}: {given} {what}, at most {limit} can be numbered", impinge_io::printable(.path))]
    TooMany {
        /// The mesh file.
        path: PathBuf,
        /// The kind of elements.
        what: &'static str,
        /// How many there are.
        given: u64,
        /// The most there may be.
        limit: u64,
    },
    /// The two files of a body in a step have different elements.
    #[error("{}: the end of the step must have the elements of {}: {what}", impinge_io::printable(.end), impinge_io::printable(.start))]
    Ends {
        /// The file of the start.
        start: PathBuf,
        /// The file of the end.
        end: PathBuf,
        /// In what they differ.
        what: String,
    },
    /// A mesh file has changed since the plan was made. Make a new plan.
    #[error("{}: changed since the plan was made", impinge_io::printable(.path))]
    Changed {
        /// The mesh file.
        path: PathBuf,
    },
    /// The folder holds another plan. Use a new folder, or replace the plan.
    #[error("{}: there is another plan in this folder", impinge_io::printable(.path))]
    OtherPlan {
        /// The plan's file.
        path: PathBuf,
    },
    /// A file of this folder is damaged. Remove it, and run the step that writes it again.
    #[error("{}: damaged ({what}); remove it and run `{step}` again", impinge_io::printable(.path))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
        /// The step that writes it.
        step: &'static str,
    },
    /// A file of this folder was made by another plan. Run the step that writes it again.
    #[error("{}: stale, made by another plan; run `{step}` again", impinge_io::printable(.path))]
    Stale {
        /// The file.
        path: PathBuf,
        /// The step that writes it.
        step: &'static str,
    },
    /// A step is not complete.
    #[error("{}: missing; run `{step}` first ({n_missing} of {n} are missing)", impinge_io::printable(.path))]
    Missing {
        /// The first file that is missing.
        path: PathBuf,
        /// The step that writes it.
        step: &'static str,
        /// How many are missing.
        n_missing: u64,
        /// How many there should be.
        n: u64,
    },
    /// Tiles have answered different queries. Run all of them with the same options.
    #[error(
        "tile {tile} has the answer for {found}, tile 0 for {expected}; run all tiles with the same options"
    )]
    MixedQuestions {
        /// The tile.
        tile: u32,
        /// Its query.
        found: String,
        /// The query of the first tile.
        expected: String,
    },
    /// An argument outside its range.
    #[error("{what}: {given} given, {allowed} allowed")]
    Argument {
        /// The argument.
        what: &'static str,
        /// Its value.
        given: String,
        /// The allowed range.
        allowed: String,
    },
}

impl Error {
    pub(crate) fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Error::Io {
            path: path.to_owned(),
            action,
            source,
        }
    }

    pub(crate) fn damaged(path: &Path, what: impl Into<String>, step: &'static str) -> Self {
        Error::Damaged {
            path: path.to_owned(),
            what: what.into(),
            step,
        }
    }
}
