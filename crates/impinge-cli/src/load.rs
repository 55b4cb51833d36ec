//! Reads mesh files into bodies of a scene.

use std::io::{Read, Write, stderr, stdin};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use impinge::{BodyId, CancelToken, Scene};
use impinge_io::{
    Format, Mesh, NamedMesh, ReadOptions, Summary, Weld, printable, read_bodies, read_bodies_bytes,
    read_bytes_with_summary, read_with_summary,
};

use crate::args::{AskArgs, BodiesArg};
use crate::error::Error;
use crate::origins::{Origin, Origins};
use crate::text::grouped;
use crate::watch::go_on;

/// The path that stands for standard input.
pub const STDIN: &str = "-";

/// A scene and the names of its bodies.
#[derive(Debug, Default)]
pub struct Bodies {
    pub scene: Scene,
    pub ids: Vec<BodyId>,
    pub names: Vec<String>,
    pub vertices: Vec<Vertices>,
    pub origins: Origins,
    pub nouns: Nouns,
    /// Files that could not be read: the number of the body, and why. Such a body has no
    /// elements.
    pub unread: Vec<(usize, String)>,
}

/// What bodies are called.
#[derive(Debug, Clone)]
pub struct Nouns {
    pub one: &'static str,
    pub many: &'static str,
    /// The file whose parts they are, if they are of one.
    pub file: Option<String>,
}

impl Default for Nouns {
    fn default() -> Self {
        Nouns {
            one: "mesh",
            many: "meshes",
            file: None,
        }
    }
}

/// Counts of a file's vertices that share their position.
#[derive(Debug, Clone, Copy, Default)]
pub struct Vertices {
    /// Whether vertices at one position were welded.
    pub welds: bool,
    /// How many were welded to another one.
    pub n_welded: usize,
    /// How many are at the position of another one, but not welded to it; `None` if this was not
    /// counted.
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
    /// What becomes a body of its own, if the user says so.
    bodies: Option<BodiesArg>,
    /// Whether the parts of a file are bodies if it is the only one.
    splits_one: bool,
    /// Whether to print on standard error what the object of `--json` says, too: which vertices
    /// coincide, and which files were not read.
    notes: bool,
    cancel: &'a CancelToken,
}

impl<'a> Loading<'a> {
    pub fn new(ask: &AskArgs, is_self: bool, cancel: &'a CancelToken) -> Self {
        Loading {
            weld: ask.read.weld(),
            is_self,
            format: ask.read.format,
            bodies: ask.read.bodies,
            splits_one: false,
            notes: !ask.json,
            cancel,
        }
    }

    /// The parts of a file are bodies if it is the only one.
    pub fn splitting_one(self) -> Self {
        Loading {
            splits_one: true,
            ..self
        }
    }

    /// With what becomes a body of its own, if the user says so.
    pub fn with_bodies(self, bodies: Option<BodiesArg>) -> Self {
        Loading { bodies, ..self }
    }

    /// Fails if parts of files were to be bodies, and no file has such parts.
    pub fn check(&self, has_parts: bool) -> Result<(), Error> {
        match self.bodies {
            Some(wanted) if wanted != BodiesArg::File && !has_parts => {
                Err(Error::Usage(wanted.misfit()))
            }
            _ => Ok(()),
        }
    }

    /// What the parts of a file of this format are called, if they are to be bodies. There are `n`
    /// files.
    fn parts(&self, format: Format, n: usize) -> Option<[&'static str; 2]> {
        let (kind, nouns) = match format {
            Format::Gltf => (BodiesArg::Nodes, ["node", "nodes"]),
            Format::ThreeMf => (BodiesArg::Nodes, ["item", "items"]),
            Format::Obj => (BodiesArg::Groups, ["group", "groups"]),
            _ => return None,
        };
        let splits = match self.bodies {
            Some(wanted) => wanted == kind,
            None => self.splits_one && n == 1,
        };
        splits.then_some(nouns)
    }

    /// Files without welding, for answers that name no vertices.
    pub fn as_they_are(notes: bool, cancel: &'a CancelToken) -> Self {
        Loading {
            weld: Some(false),
            is_self: false,
            format: None,
            bodies: None,
            splits_one: false,
            notes,
            cancel,
        }
    }

    /// Files of which it may be asked where a body meets itself, with what the user tells of
    /// vertices at one position and of standard input.
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
            None | Some(true) => true,
            Some(false) => self.is_self && format == Format::Stl,
        }
    }
}

impl Bodies {
    /// Reads files, one per body, or one per node or group of a file.
    pub fn read(paths: &[PathBuf], loading: Loading<'_>) -> Result<Self, Error> {
        Bodies::read_all(paths, loading, false)
    }

    /// Like [`read`](Self::read), but a file that can't be read becomes a body without elements,
    /// so that all others keep their numbers. Fails if no file can be read.
    pub fn read_readable(paths: &[PathBuf], loading: Loading<'_>) -> Result<Self, Error> {
        Bodies::read_all(paths, loading, paths.len() > 1)
    }

    fn read_all(paths: &[PathBuf], loading: Loading<'_>, passes_over: bool) -> Result<Self, Error> {
        let mut bodies = Bodies::default();
        let mut has_parts = false;
        for path in paths {
            match bodies.add_file(path, loading, paths.len()) {
                Ok(is_cut) => has_parts |= is_cut,
                Err(error @ (Error::File(_) | Error::Refused { .. })) if passes_over => {
                    bodies.add_unread(path, &error, loading)?;
                }
                Err(error) => return Err(error),
            }
        }
        if passes_over && bodies.unread.len() == paths.len() {
            let text = format!("none of {} meshes could be read", paths.len());
            return Err(Error::Unread(text));
        }
        loading.check(has_parts)?;
        Ok(bodies)
    }

    /// Adds one of `n_files` files; returns whether its parts are the bodies.
    pub fn add_file(
        &mut self,
        path: &Path,
        loading: Loading<'_>,
        n_files: usize,
    ) -> Result<bool, Error> {
        let format = self.format(path, loading)?;
        let Some([one, many]) = loading.parts(format, n_files) else {
            self.add(path, loading)?;
            return Ok(false);
        };
        let file = self.add_parts(path, loading, n_files > 1)?;
        if n_files == 1 && self.ids.len() > 1 {
            let file = Some(file);
            self.nouns = Nouns { one, many, file };
        }
        Ok(true)
    }

    fn add_unread(
        &mut self,
        path: &Path,
        error: &Error,
        loading: Loading<'_>,
    ) -> Result<(), Error> {
        let why = error.line();
        if loading.notes {
            // A note that nobody can read does no harm.
            let _ = writeln!(stderr(), "not read: {why}");
        }
        let nothing = impinge::Elements::Triangles(Vec::new());
        let id = self.scene.add((nothing, Vec::<[f32; 3]>::new()))?;
        self.unread.push((self.ids.len(), why));
        self.ids.push(id);
        self.names.push(path.display().to_string());
        self.vertices.push(Vertices::default());
        self.origins.push(Origin::default());
        Ok(())
    }

    /// Reads a file as one more body; returns the welding, if any.
    pub fn add(
        &mut self,
        path: &Path,
        loading: Loading<'_>,
    ) -> Result<(BodyId, Option<Arc<Weld>>), Error> {
        let format = self.format(path, loading)?;
        let (name, (meshes, summary)) = self.read_one(path, format, false, loading)?;
        tell(&name, &summary.notes());
        let mut added = None;
        for mesh in meshes {
            added = Some(self.add_mesh(name.clone(), format, mesh, loading)?);
        }
        // A file is one mesh, unless its parts are asked for.
        added.ok_or_else(|| Error::Usage(format!("{name}: no mesh")))
    }

    /// Reads a file as one more body per part; returns the name of the file. The names of bodies
    /// begin with it if there are `several` files.
    fn add_parts(
        &mut self,
        path: &Path,
        loading: Loading<'_>,
        several: bool,
    ) -> Result<String, Error> {
        let format = self.format(path, loading)?;
        let (file, (meshes, summary)) = self.read_one(path, format, true, loading)?;
        // Notes on the file name it, not one of its parts.
        tell(&file, &summary.notes());
        for (name, mesh) in named_parts(&file, meshes, several) {
            self.add_mesh(name, format, mesh, loading)?;
        }
        Ok(file)
    }

    fn add_mesh(
        &mut self,
        name: String,
        format: Format,
        mesh: NamedMesh,
        loading: Loading<'_>,
    ) -> Result<(BodyId, Option<Arc<Weld>>), Error> {
        let (read, mut mesh) = (mesh.vertices, mesh.mesh);
        let welds = loading.welds(format);
        let mut vertices = Vertices::default();
        let mut welding = None;
        if welds || loading.is_self {
            let weld = Weld::by_position(&mesh.positions);
            if welds {
                weld.apply(&mut mesh);
                vertices = Vertices {
                    welds,
                    n_welded: weld.n_welded(),
                    n_coincident: Some(0),
                };
                welding = Some(Arc::new(weld));
            } else {
                vertices.n_coincident = Some(weld.n_welded());
            }
        }
        if loading.notes {
            tell_coincident(&name, vertices);
        }
        // No coordinate changes its value; this halves the memory if all coordinates fit in f32.
        mesh.positions.narrow_if_exact();
        let Mesh {
            positions,
            elements,
        } = mesh;
        let id = self
            .scene
            .add((to_elements(elements), to_positions(positions)))
            .map_err(|source| Error::Refused {
                what: name.clone(),
                source,
            })?;
        self.ids.push(id);
        self.names.push(name);
        self.vertices.push(vertices);
        self.origins.push(Origin::new(read, welding.as_ref()));
        Ok((id, welding))
    }

    /// The format of a file, or of standard input.
    fn format(&self, path: &Path, loading: Loading<'_>) -> Result<Format, Error> {
        if path != Path::new(STDIN) {
            return Ok(Format::from_path(path)?);
        }
        format_of_stdin(loading.format)
    }

    /// Reads a file, or standard input, without changes: in one piece, or in its parts.
    fn read_one(
        &self,
        path: &Path,
        format: Format,
        in_parts: bool,
        loading: Loading<'_>,
    ) -> Result<(String, (Vec<NamedMesh>, Summary)), Error> {
        go_on(loading.cancel)?;
        let options = ReadOptions::as_they_are();
        let whole = |(mesh, summary)| (vec![NamedMesh::whole(None, mesh)], summary);
        if path != Path::new(STDIN) {
            let read = match in_parts {
                true => read_bodies(path, &options)?,
                false => whole(read_with_summary(path, &options)?),
            };
            return Ok((path.display().to_string(), read));
        }
        let name = NAME_OF_STDIN;
        if self.names.iter().any(|other| other == name) {
            let text = "only one mesh can come from standard input";
            return Err(Error::Usage(text.to_owned()));
        }
        let bytes = stdin_bytes(&options)?;
        let read = match in_parts {
            true => read_bodies_bytes(&bytes, format, name, &options)?,
            false => whole(read_bytes_with_summary(&bytes, format, name, &options)?),
        };
        Ok((name.to_owned(), read))
    }
}

/// The parts of a file with their names, which begin with that of the file if there are `several`
/// files. A file of one part is called by its own name.
pub fn named_parts(
    file: &str,
    parts: Vec<NamedMesh>,
    several: bool,
) -> impl Iterator<Item = (String, NamedMesh)> {
    let has_parts = parts.len() > 1;
    parts.into_iter().map(move |part| {
        let name = match part.name.clone().filter(|_| has_parts) {
            None => file.to_owned(),
            Some(part) if several => format!("{file}#{part}"),
            Some(part) => part,
        };
        (name, part)
    })
}

/// What standard input is called in messages.
pub const NAME_OF_STDIN: &str = "standard input";

/// The format of standard input, which has no ending.
pub fn format_of_stdin(format: Option<Format>) -> Result<Format, Error> {
    format.ok_or_else(|| {
        let text = "a mesh from standard input needs its format, such as --format ply";
        Error::Usage(text.to_owned())
    })
}

/// All of standard input.
pub fn stdin_bytes(options: &ReadOptions) -> Result<Vec<u8>, Error> {
    let name = NAME_OF_STDIN;
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
    Ok(bytes)
}

/// A note on vertices that are not welded. The last line of the answer says how many are.
pub fn tell_coincident(name: &str, vertices: Vertices) {
    if let Some(n @ 1..) = vertices.n_coincident {
        let what = "vertices at the position of another, not welded to it";
        tell(name, &[format!("{what}: {}", grouped(n as u64))]);
    }
}

/// Prints notes on a file on standard error.
pub fn tell(name: &str, notes: &[String]) {
    for note in notes {
        // A note that nobody can read does no harm.
        let _ = writeln!(stderr(), "note: {}: {note}", printable(name));
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
