//! Errors of reading and writing; each message is one line.

use std::fmt;
use std::path::{Path, PathBuf};

/// The name of a file as text for a terminal or a log: control characters, such as line breaks and
/// the start of escape sequences, are escaped, and so are characters that change the direction of
/// text.
///
/// ```
/// assert_eq!(impinge_io::printable("a\n\u{1b}[2J.ply"), r"a\n\u{1b}[2J.ply");
/// assert_eq!(impinge_io::printable("ylp.\u{202e}"), r"ylp.\u{202e}");
/// ```
pub fn printable(name: impl AsRef<Path>) -> String {
    let mut text = String::new();
    for c in name.as_ref().to_string_lossy().chars() {
        match c.is_control() || changes_direction(c) {
            true => text.extend(c.escape_default()),
            false => text.push(c),
        }
    }
    text
}

/// Marks, embeddings, overrides and isolates of bidirectional text, and separators of lines and
/// paragraphs, which end them (Unicode Standard Annex 9).
fn changes_direction(c: char) -> bool {
    matches!(
        c,
        '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}'
    )
}

/// The extensions of files of rows of numbers, for messages.
pub(crate) const KNOWN_ROWS: &str = "csv, txt, xyz, npy";

/// A place in a file.
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
        let file = printable(&self.file);
        match self.place {
            Place::File => write!(f, "{file}"),
            Place::Line(line) => write!(f, "{file}:{line}"),
            Place::Byte(offset) => write!(f, "{file}: byte {offset}"),
        }
    }
}

/// An error of reading or writing. Each message is one line and names the file and the place.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system reported an error. Check that the file exists, that it may be read or
    /// written, and that the disk has room.
    #[error("{}: cannot {action}: {source}", crate::printable(.path))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The failed action: `open`, `read`, `write`, …
        action: &'static str,
        /// The system's error.
        source: std::io::Error,
    },
    /// The path is not a regular file but a pipe, a device, a socket or a folder. Check the name,
    /// or copy its content to a file.
    #[error("{}: is {what}, not a regular file{}", crate::printable(.path), files_of(.path, .what))]
    NotAFile {
        /// The path.
        path: PathBuf,
        /// What the path is instead.
        what: &'static str,
    },
    /// A mesh file or a pattern names a file in another folder, perhaps through a link. Check that
    /// you trust the mesh, or put the file beside it.
    #[error("{}: is not in {}; only files in the folder of the mesh or below it are read", crate::printable(.path), crate::printable(.folder))]
    Outside {
        /// The file that was named.
        path: PathBuf,
        /// The folder in which the file should be.
        folder: PathBuf,
    },
    /// The format is chosen by the file's extension, and this extension is not known. Check the
    /// name.
    #[error("{}: {} (known: {known})", crate::printable(.path), no_format(.extension))]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// Its extension, empty if it has none.
        extension: String,
        /// The known extensions.
        known: &'static str,
    },
    /// Rows of numbers are read by the file's extension, and this one is not known. Check the name.
    #[error("{}: no rows of numbers have the extension '{extension}' (known: {known})", crate::printable(.path))]
    UnknownRows {
        /// The file.
        path: PathBuf,
        /// Its extension, empty if it has none.
        extension: String,
        /// The known extensions.
        known: &'static str,
    },
    /// The file does not follow its format. Check the place named.
    #[error("{at}: expected {expected}, found {found}")]
    Syntax {
        /// Where.
        at: Location,
        /// What should be there.
        expected: String,
        /// What is there.
        found: String,
    },
    /// The file is shorter than its header says. Check that it was written and copied completely.
    #[error("{at}: {what}: {expected} bytes are needed, but {found} are left")]
    Truncated {
        /// Where the incomplete data starts.
        at: Location,
        /// The incomplete data.
        what: String,
        /// Bytes needed.
        expected: u64,
        /// Bytes present.
        found: u64,
    },
    /// A count differs from the number announced in the file. Check both numbers.
    #[error("{at}: expected {expected} {what}, found {found}")]
    Count {
        /// Where.
        at: Location,
        /// What was counted.
        what: String,
        /// How many there should be.
        expected: u64,
        /// How many there are.
        found: u64,
    },
    /// An element names a vertex that does not exist. Check the index; the message says how the
    /// format counts.
    #[error(
        "{at}: vertex index {index} is out of range; vertices: {n_vertices}, numbered from {first}"
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
    /// A coordinate is NaN or infinite (a text number beyond the range of f64 counts as infinite).
    /// Check the vertex.
    #[error("{at}: vertex {vertex} has the coordinate {value}, which is not a finite number")]
    NotFinite {
        /// Where.
        at: Location,
        /// The vertex, counted from 0.
        vertex: u64,
        /// The coordinate.
        value: f64,
    },
    /// The file is valid, but uses a feature that is not supported. Convert it with another
    /// program.
    #[error("{at}: {what} is not supported")]
    Unsupported {
        /// Where.
        at: Location,
        /// What is not supported, and the supported alternatives.
        what: String,
    },
    /// The file has no element of the wanted kind. Check that it is a surface or a volume, not
    /// points or curves.
    #[error(
        "{}: no {wanted} in this file (vertices: {n_vertices}, triangles: {n_triangles}, tetrahedra: {n_tetrahedra}, lines: {n_lines}, points: {n_points})",
        crate::printable(.file)
    )]
    NoElements {
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
    /// A number is too large for an index, or for a byte limit of
    /// [`ReadOptions`](crate::ReadOptions). Split the file, or raise the limit.
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
    /// There is not enough memory for the content of the file. Check that the file is valid, or
    /// give the process more memory.
    #[error("{at}: {needed} bytes of memory are needed, but there is not enough")]
    NoMemory {
        /// The place in the file.
        at: Location,
        /// Bytes that were requested.
        needed: u64,
    },
    /// The arguments of a call to a writer or a sequence do not fit together. Check the call.
    #[error("{}: {what}: expected {expected}, found {found}", crate::printable(.file))]
    Mismatch {
        /// The file written or read.
        file: String,
        /// The argument that does not fit.
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

/// How the files of a folder are named, for messages: the folder's name in front of a pattern.
pub(crate) fn in_folder(path: &Path) -> String {
    let folder = printable(path);
    let folder = folder.trim_end_matches(std::path::is_separator);
    format!("{folder}/*.obj")
}

/// What helps where a folder was given.
fn files_of(path: &Path, what: &str) -> String {
    match what {
        "a folder" => format!("; its files are named as in {}", in_folder(path)),
        _ => String::new(),
    }
}

/// Why an extension tells no mesh format.
fn no_format(extension: &str) -> String {
    match extension {
        "" => "its name has no extension, which tells the format".to_owned(),
        _ => format!("no mesh format has the extension '{extension}'"),
    }
}

/// Bytes of a file for a message: short, printable, in quotes.
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
