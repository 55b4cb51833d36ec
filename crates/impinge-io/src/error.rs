//! What can go wrong with a file, said in one line.

use std::fmt;
use std::path::{Path, PathBuf};

/// Where in a file something stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line of a text file, counted from 1.
    Line(u64),
    /// An offset in bytes from the start of a file, counted from 0.
    Byte(u64),
}

/// A file and a place in it; displays as `bunny.ply:12` or `bunny.ply: byte 345`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Location {
    /// The file, as it was named by the caller.
    pub file: String,
    /// The place in it.
    pub place: Place,
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.place {
            Place::File => write!(f, "{}", self.file),
            Place::Line(line) => write!(f, "{}:{line}", self.file),
            Place::Byte(offset) => write!(f, "{}: byte {offset}", self.file),
        }
    }
}

/// Everything that reading or writing can fail with. Each message is one line and names the file and the place.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused. Check that the file exists, that it may be read or written, and that the disk has room.
    #[error("{}: cannot {action}: {source}", .path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried: `open`, `read`, `write`, …
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// Something that is no regular file: a pipe, a device, a socket or a folder. Check the name, or copy its content to a file.
    #[error("{}: is {what}, not a regular file", .path.display())]
    NotAFile {
        /// The path.
        path: PathBuf,
        /// What it is.
        what: &'static str,
    },
    /// A mesh file or a pattern names a file elsewhere, perhaps by a link. Check that the mesh is what it seems to be, or put
    /// the file beside it.
    #[error("{}: is not in {}; only files in the folder of the mesh or below it are read", .path.display(), .folder.display())]
    Outside {
        /// The file that was named.
        path: PathBuf,
        /// The folder in which it should be.
        folder: PathBuf,
    },
    /// The format is chosen by the file's extension, and this one is not known. Check the name.
    #[error("{}: no mesh format has the extension '{extension}' (known: {known})", .path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// Its extension, empty where it has none.
        extension: String,
        /// The extensions that are known.
        known: &'static str,
    },
    /// The file does not follow its format. Check the place named.
    #[error("{at}: expected {expected}, found {found}")]
    Syntax {
        /// Where.
        at: Location,
        /// What should stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// The file ends before what its header announces. Check that it was written and copied whole.
    #[error("{at}: {what}: {expected} bytes are needed, but {found} are left")]
    Truncated {
        /// Where the data in question starts.
        at: Location,
        /// The data in question.
        what: String,
        /// Bytes needed.
        expected: u64,
        /// Bytes present.
        found: u64,
    },
    /// A number of things differs from what was announced. Check both numbers.
    #[error("{at}: expected {expected} {what}, found {found}")]
    Count {
        /// Where.
        at: Location,
        /// The things counted.
        what: String,
        /// How many there should be.
        expected: u64,
        /// How many there are.
        found: u64,
    },
    /// A primitive names a vertex that does not exist. Check the index; the message says how the format counts.
    #[error(
        "{at}: vertex index {index} is out of range: {n_vertices} vertices, numbered from {first}"
    )]
    Index {
        /// Where.
        at: Location,
        /// The index, as the file has it.
        index: i64,
        /// The number of the first vertex in this format.
        first: i64,
        /// How many vertices there are.
        n_vertices: u64,
    },
    /// A coordinate is NaN or infinite (a text number beyond the range of f64 counts as infinite). Check the vertex.
    #[error("{at}: vertex {vertex} has the coordinate {value}, which is not a finite number")]
    NotFinite {
        /// Where.
        at: Location,
        /// The vertex, counted from 0.
        vertex: u64,
        /// The coordinate.
        value: f64,
    },
    /// The file is right, but uses something that is not read. Convert it with another program.
    #[error("{at}: {what} is not supported")]
    Unsupported {
        /// Where.
        at: Location,
        /// What is not supported, and what is.
        what: String,
    },
    /// The file has no primitive of the wanted kind. Check that it is a surface or a volume, not points or curves.
    #[error(
        "{file}: no {wanted} in this file ({n_vertices} vertices, {n_triangles} triangles, {n_tetrahedra} tetrahedra, {n_lines} lines, {n_points} points)"
    )]
    NoPrimitives {
        /// The file.
        file: String,
        /// What was looked for.
        wanted: &'static str,
        /// Vertices in the file.
        n_vertices: u64,
        /// Triangles in the file, polygons fanned.
        n_triangles: u64,
        /// Tetrahedra in the file.
        n_tetrahedra: u64,
        /// Lines in the file.
        n_lines: u64,
        /// Point cells in the file.
        n_points: u64,
    },
    /// More than an index or the byte budget of [`ReadOptions`](crate::ReadOptions) can hold. Split the file, or raise the budget.
    #[error("{at}: {what}: {found} is more than the limit of {limit}")]
    TooLarge {
        /// Where.
        at: Location,
        /// What there is too much of.
        what: String,
        /// The most there may be.
        limit: u64,
        /// How much there is.
        found: u64,
    },
    /// There is no memory for what the file holds. Check that the file is what it seems to be, or give the process more memory.
    #[error("{at}: {needed} bytes of memory are needed, and cannot be had")]
    NoMemory {
        /// The file, and what in it.
        at: Location,
        /// Bytes that were asked for.
        needed: u64,
    },
    /// What was given to a writer, or asked of a sequence, does not fit together. Check the call.
    #[error("{file}: {what}: expected {expected}, found {found}")]
    Mismatch {
        /// The file written or read.
        file: String,
        /// What does not fit.
        what: String,
        /// The number that would fit.
        expected: u64,
        /// The number given.
        found: u64,
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
}

/// The name that errors carry, with shorthands for the errors that every parser raises.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Name<'a>(pub &'a str);

impl Name<'_> {
    pub(crate) fn at(self, place: Place) -> Location {
        Location {
            file: self.0.to_owned(),
            place,
        }
    }

    pub(crate) fn syntax(
        self,
        place: Place,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Error {
        Error::Syntax {
            at: self.at(place),
            expected: expected.into(),
            found: found.into(),
        }
    }

    pub(crate) fn unsupported(self, place: Place, what: impl Into<String>) -> Error {
        Error::Unsupported {
            at: self.at(place),
            what: what.into(),
        }
    }

    pub(crate) fn count(
        self,
        place: Place,
        what: impl Into<String>,
        expected: u64,
        found: u64,
    ) -> Error {
        Error::Count {
            at: self.at(place),
            what: what.into(),
            expected,
            found,
        }
    }

    pub(crate) fn truncated(
        self,
        place: Place,
        what: impl Into<String>,
        expected: u64,
        found: u64,
    ) -> Error {
        Error::Truncated {
            at: self.at(place),
            what: what.into(),
            expected,
            found,
        }
    }

    pub(crate) fn too_large(
        self,
        place: Place,
        what: impl Into<String>,
        limit: u64,
        found: u64,
    ) -> Error {
        Error::TooLarge {
            at: self.at(place),
            what: what.into(),
            limit,
            found,
        }
    }
}

/// Bytes of a file as they may be shown in a message: short, printable, in quotes.
pub(crate) fn shown(bytes: &[u8]) -> String {
    const MOST: usize = 24;
    let text: String = String::from_utf8_lossy(&bytes[..bytes.len().min(MOST)])
        .chars()
        .map(|c| {
            if c.is_control() || c == char::REPLACEMENT_CHARACTER {
                '?'
            } else {
                c
            }
        })
        .collect();
    format!("'{text}{}'", if bytes.len() > MOST { "…" } else { "" })
}
