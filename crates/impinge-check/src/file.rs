//! The check of one file.

use std::path::Path;

use impinge_io::{Error as FileError, ReadOptions, read, read_with_summary, weld};

use crate::analysis::{Checked, Options, check_mesh};
use crate::marks::MarkRuns;
use crate::row::{ErrorKind, Failure, Row};

/// Checks the mesh of one file. Errors are in the row.
pub fn check_file(path: &Path, options: &Options) -> Row {
    let mut notes = Vec::new();
    let (result, places, marks) = match checked(path, options, &mut notes) {
        Ok(checked) => {
            let marks = options.marks.then(|| MarkRuns::new(&checked.marks));
            (Ok(checked.counts), checked.places, marks)
        }
        Err(failure) => (Err(failure), Vec::new(), None),
    };
    Row {
        path: path.display().to_string(),
        is_welded: options.weld,
        result,
        places,
        marks,
        notes,
    }
}

impl Checked {
    /// The mesh of a row with [marks](Row::marks), which is read once more and not checked once
    /// more. `None` without marks, and if the file has no longer the mesh that was checked.
    pub fn of_row(row: &Row) -> Option<Self> {
        let (counts, runs) = (*row.result.as_ref().ok()?, row.marks.as_ref()?);
        let mut mesh = read(row.path.as_ref(), &ReadOptions::as_they_are()).ok()?;
        let n_vertices = mesh.n_vertices();
        let n_welded = if counts.n_welded > 0 {
            weld(&mut mesh)
        } else {
            0
        };
        let n_elements = (counts.n_triangles + counts.n_tetrahedra) as usize;
        let is_same = [n_vertices, n_welded]
            == [counts.n_vertices, counts.n_welded].map(|n| n as usize)
            && mesh.n_elements() == n_elements;
        if !is_same {
            return None;
        }
        Some(Checked {
            counts,
            marks: runs.marks(n_elements)?,
            places: row.places.clone(),
            mesh,
        })
    }
}

fn checked(path: &Path, options: &Options, notes: &mut Vec<String>) -> Result<Checked, Failure> {
    let read = read_with_summary(path, &ReadOptions::as_they_are());
    let (mesh, mut summary) = read.map_err(|error| Failure {
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
    // The unit of one file is as good as others.
    summary.unit = None;
    let n_polygons = std::mem::take(&mut summary.n_polygons_fanned);
    *notes = summary.notes();
    let checked = check_mesh(mesh, options).map_err(|error| Failure {
        kind: match error {
            impinge::Error::NonFinitePosition { .. } => ErrorKind::NotFinite,
            // Threads fail to start if there is no memory for their stacks.
            impinge::Error::MemoryBudget { .. } | impinge::Error::Threads(_) => ErrorKind::Memory,
            _ => ErrorKind::Refused,
        },
        message: one_line(&error.to_string()),
    })?;
    // Polygons are as good as triangles, but numbers of elements are those of triangles.
    if !checked.places.is_empty() {
        summary.n_polygons_fanned = n_polygons;
        *notes = summary.notes();
    }
    Ok(checked)
}

fn one_line(text: &str) -> String {
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    lines.collect::<Vec<_>>().join("; ")
}
