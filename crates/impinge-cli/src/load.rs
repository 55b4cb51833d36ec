//! Mesh files to bodies of a scene.

use std::io::{Write, stderr};
use std::path::{Path, PathBuf};

use impinge::{BodyId, CancelToken, Scene};
use impinge_io::{Mesh, ReadOptions, Summary, Weld, read_with_summary, weld};

use crate::error::Error;
use crate::output::grouped;
use crate::watch::go_on;

/// A scene and what its bodies are called.
#[derive(Debug, Default)]
pub struct Bodies {
    pub scene: Scene,
    pub ids: Vec<BodyId>,
    pub names: Vec<String>,
}

/// How files are read.
#[derive(Debug, Clone, Copy)]
pub struct Loading<'a> {
    /// Make vertices at the same position one.
    pub weld: bool,
    /// Say on standard error what was fanned, left out and welded.
    pub notes: bool,
    pub cancel: &'a CancelToken,
}

impl Bodies {
    /// Reads files, a body each.
    pub fn read(paths: &[PathBuf], loading: Loading<'_>) -> Result<Self, Error> {
        let mut bodies = Bodies::default();
        for path in paths {
            bodies.add(path, loading)?;
        }
        Ok(bodies)
    }

    /// Reads a file as one more body; where it is welded, tells how.
    pub fn add(
        &mut self,
        path: &Path,
        loading: Loading<'_>,
    ) -> Result<(BodyId, Option<Weld>), Error> {
        go_on(loading.cancel)?;
        let name = path.display().to_string();
        let (mut mesh, summary) = read_with_summary(path, &ReadOptions::default())?;
        let mut n_welded = 0;
        let welding = loading.weld.then(|| {
            let welding = Weld::by_position(&mesh.positions);
            n_welded = weld(&mut mesh);
            welding
        });
        if loading.notes {
            note(&name, &summary, n_welded);
        }
        // No coordinate changes its value here; half the memory is saved where all of them allow it.
        mesh.positions.narrow_if_exact();
        let Mesh {
            positions,
            elements,
        } = mesh;
        let id = self
            .scene
            .add(to_elements(elements), to_positions(positions))
            .map_err(|source| Error::Refused {
                what: name.clone(),
                source,
            })?;
        self.ids.push(id);
        self.names.push(name);
        Ok((id, welding))
    }
}

/// What a user should know about a file who looks at primitive numbers.
fn note(name: &str, summary: &Summary, n_welded: usize) {
    for (n, what) in [
        (
            summary.n_polygons_fanned,
            "polygons fanned (primitives are numbered after that)",
        ),
        (
            summary.n_triangles_skipped,
            "triangles beside tetrahedra left out",
        ),
        (n_welded as u64, "vertices welded to others"),
    ] {
        if n > 0 {
            // A note that nobody can read does no harm.
            let _ = writeln!(stderr(), "note: {name}: {what}: {}", grouped(n));
        }
    }
}

/// The arrays of a file as the library takes them.
pub fn to_positions(positions: impinge_io::Positions) -> impinge::Positions {
    match positions {
        impinge_io::Positions::F32(positions) => positions.into(),
        impinge_io::Positions::F64(positions) => positions.into(),
    }
}

fn to_elements(elements: impinge_io::Elements) -> impinge::Elements {
    match elements {
        impinge_io::Elements::Triangles(faces) => faces.into(),
        impinge_io::Elements::Tetrahedra(tets) => tets.into(),
    }
}
