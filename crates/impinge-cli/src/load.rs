//! Reads mesh files into bodies of a scene.

use std::io::{Read, Write, stderr, stdin};
use std::path::{Path, PathBuf};

use impinge::{BodyId, CancelToken, Scene};
use impinge_io::{
    Format, Mesh, ReadOptions, Summary, Weld, read_bytes_with_summary, read_with_summary,
};

use crate::args::AskArgs;
use crate::error::Error;
use crate::text::grouped;
use crate::watch::go_on;

/// The path that stands for standard input.
const STDIN: &str = "-";

/// A scene and the names of its bodies.
#[derive(Debug, Default)]
pub struct Bodies {
    pub scene: Scene,
    pub ids: Vec<BodyId>,
    pub names: Vec<String>,
    pub vertices: Vec<Vertices>,
}

/// Counts of a file's vertices that share their position.
#[derive(Debug, Clone, Copy, Default)]
pub struct Vertices {
    /// How many were welded to another one.
    pub n_welded: usize,
    /// How many are at the position of another one, but not welded to it; `None` if this was not counted.
    pub n_coincident: Option<usize>,
}

/// Options of reading files.
#[derive(Debug, Clone, Copy)]
pub struct Loading<'a> {
    /// The user's choice whether to weld vertices at one position.
    weld: Option<bool>,
    /// Whether the query includes self-collision: then it matters which vertices are welded.
    is_self: bool,
    /// The format of standard input.
    format: Option<Format>,
    /// Whether to print on standard error what was fanned, skipped and welded.
    notes: bool,
    cancel: &'a CancelToken,
}

impl<'a> Loading<'a> {
    pub fn new(ask: &AskArgs, is_self: bool, cancel: &'a CancelToken) -> Self {
        Loading {
            weld: ask.read.weld(),
            is_self,
            format: ask.read.format,
            notes: !ask.json,
            cancel,
        }
    }

    /// Files without welding, for queries between bodies.
    pub fn as_they_are(notes: bool, cancel: &'a CancelToken) -> Self {
        Loading {
            weld: None,
            is_self: false,
            format: None,
            notes,
            cancel,
        }
    }

    /// Files of which it may be asked where a body meets itself, with what the user tells of vertices at one position and
    /// of standard input.
    pub fn asked(self, weld: Option<bool>, is_self: bool, format: Option<Format>) -> Self {
        Loading {
            weld,
            is_self,
            format,
            ..self
        }
    }

    /// Whether to weld vertices at one position. Triangles of an STL file share only positions.
    fn welds(&self, format: Format) -> bool {
        match self.weld {
            Some(true) => true,
            Some(false) => self.is_self && format == Format::Stl,
            None => self.is_self,
        }
    }
}

impl Bodies {
    /// Reads files, one per body.
    pub fn read(paths: &[PathBuf], loading: Loading<'_>) -> Result<Self, Error> {
        let mut bodies = Bodies::default();
        for path in paths {
            bodies.add(path, loading)?;
        }
        Ok(bodies)
    }

    /// Reads a file as one more body; returns the welding, if any.
    pub fn add(
        &mut self,
        path: &Path,
        loading: Loading<'_>,
    ) -> Result<(BodyId, Option<Weld>), Error> {
        go_on(loading.cancel)?;
        let (name, format, (mut mesh, summary)) = self.read_one(path, loading)?;
        let welds = loading.welds(format);
        let mut vertices = Vertices::default();
        let mut welding = None;
        if welds || loading.is_self {
            let weld = Weld::by_position(&mesh.positions);
            if welds {
                weld.apply(&mut mesh);
                vertices.n_welded = weld.n_welded();
                vertices.n_coincident = Some(0);
                welding = Some(weld);
            } else {
                vertices.n_coincident = Some(weld.n_welded());
            }
        }
        if loading.notes {
            note(&name, &summary, vertices);
        }
        // No coordinate changes its value; this halves the memory if all coordinates fit in f32.
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
        self.vertices.push(vertices);
        Ok((id, welding))
    }

    /// Reads a file, or standard input, without changes.
    fn read_one(
        &self,
        path: &Path,
        loading: Loading<'_>,
    ) -> Result<(String, Format, (Mesh, Summary)), Error> {
        let options = ReadOptions::default();
        if path != Path::new(STDIN) {
            let format = Format::from_path(path)?;
            let read = read_with_summary(path, &options)?;
            return Ok((path.display().to_string(), format, read));
        }
        let name = "standard input";
        let Some(format) = loading.format else {
            let text = "a mesh from standard input needs its format, such as --format ply";
            return Err(Error::Usage(text.to_owned()));
        };
        if self.names.iter().any(|other| other == name) {
            let text = "only one mesh can come from standard input";
            return Err(Error::Usage(text.to_owned()));
        }
        let mut bytes = Vec::new();
        let most = options.max_file_bytes;
        stdin()
            .lock()
            .take(most.saturating_add(1))
            .read_to_end(&mut bytes)
            .map_err(|source| Error::Read {
                path: name.into(),
                source,
            })?;
        if bytes.len() as u64 > most {
            return Err(Error::Usage(format!("{name}: more than {most} bytes")));
        }
        let read = read_bytes_with_summary(&bytes, format, name, &options)?;
        Ok((name.to_owned(), format, read))
    }
}

/// Notes on a file for users who look at primitive numbers, or wonder about pairs.
pub fn note(name: &str, summary: &Summary, vertices: Vertices) {
    for (n, what) in [
        (
            summary.n_polygons_fanned,
            "polygons split into triangles (primitive numbers count the triangles)",
        ),
        (
            summary.n_triangles_skipped,
            "triangles skipped, because the file has tetrahedra",
        ),
        (vertices.n_welded as u64, "vertices welded to others"),
        (
            vertices.n_coincident.unwrap_or(0) as u64,
            "vertices at the position of another, not welded to it",
        ),
    ] {
        if n > 0 {
            // A note that nobody can read does no harm.
            let _ = writeln!(stderr(), "note: {name}: {what}: {}", grouped(n));
        }
    }
}

/// Converts the positions of a file to those of the library.
pub fn to_positions(positions: impinge_io::Positions) -> impinge::Positions {
    match positions {
        impinge_io::Positions::F32(positions) => positions.into(),
        impinge_io::Positions::F64(positions) => positions.into(),
    }
}

pub fn to_elements(elements: impinge_io::Elements) -> impinge::Elements {
    match elements {
        impinge_io::Elements::Triangles(faces) => faces.into(),
        impinge_io::Elements::Tetrahedra(tets) => tets.into(),
    }
}
