//! The check of one file.

use std::path::Path;

use impinge_io::{Error as FileError, ReadOptions, read};

use crate::analysis::{Checked, Options, check_mesh};
use crate::row::{ErrorKind, Failure, Row};

/// Checks the mesh of one file. Errors are in the row.
pub fn check_file(path: &Path, options: &Options) -> Row {
    check_file_marked(path, options).0
}

/// Like [`check_file`], and also returns the mesh with the marks of its primitives if it could be
/// checked.
pub fn check_file_marked(path: &Path, options: &Options) -> (Row, Option<Checked>) {
    let (result, places, checked) = match checked(path, options) {
        Ok(checked) => (Ok(checked.counts), checked.places.clone(), Some(checked)),
        Err(failure) => (Err(failure), Vec::new(), None),
    };
    let row = Row {
        path: path.display().to_string(),
        is_welded: options.weld,
        result,
        places,
    };
    (row, checked)
}

fn checked(path: &Path, options: &Options) -> Result<Checked, Failure> {
    let mesh = read(path, &ReadOptions::as_they_are()).map_err(|error| Failure {
        kind: match error {
            FileError::NotFinite { .. } => ErrorKind::NotFinite,
            FileError::NoMemory { .. } => ErrorKind::Memory,
            FileError::Io { ref source, .. }
                if source.kind() == std::io::ErrorKind::OutOfMemory =>
            {
                ErrorKind::Memory
            }
            _ => ErrorKind::File,
        },
        message: one_line(&error.to_string()),
    })?;
    check_mesh(mesh, options).map_err(|error| Failure {
        kind: match error {
            impinge::Error::NonFinitePosition { .. } => ErrorKind::NotFinite,
            // Threads fail to start if there is no memory for their stacks.
            impinge::Error::MemoryBudget { .. } | impinge::Error::Threads(_) => ErrorKind::Memory,
            _ => ErrorKind::Refused,
        },
        message: one_line(&error.to_string()),
    })
}

fn one_line(text: &str) -> String {
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    lines.collect::<Vec<_>>().join("; ")
}
