//! The plan: files, cells and units of work. Every other file in the folder names the plan that it
//! belongs to.

use std::fs;
use std::path::{Path, PathBuf};

use impinge::CancelToken;
use serde_json::{Map, Value, json};

use crate::cells::{Bounds, Cells, HalfOpen, Rule};
use crate::chunk::Shape;
use crate::cuts;
use crate::disk;
use crate::error::Error;
use crate::hash::checksum;
use crate::source::{self, Source};

/// The version of all files of a folder.
const VERSION: u64 = 2;

/// The approximate number of boxes in the sample for cuts.
const SAMPLE: u64 = 500_000;

/// The keys of the length and the checksum of a body's files: the start, and the end of a step.
const FINGERPRINTS: [[&str; 2]; 2] = [["bytes", "checksum"], ["end_bytes", "end_checksum"]];

/// The length of a file and its checksum.
type Fingerprint = (u64, u64);

/// How a plan is made.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanOptions {
    /// About how many elements a tile may hold; one tile is in memory at a time. 2 million by
    /// default: about 600 MB.
    pub cap: u64,
    /// Elements per unit of scattering; a thread reads, sorts and writes one unit at a time.
    /// 500,000 by default.
    pub chunk: u64,
    /// Whether vertices of one file at exactly the same position are welded, as the program does.
    /// On by default. In a step, vertices must be at one position both at the start and at the end.
    /// Scattering such a body holds all its vertices, up to 90 bytes each in f32 and 140 in f64.
    pub weld: bool,
    /// Whether the scene moves: a body is then two files with the same elements, its start and its
    /// end, and tiles find the first contacts between them.
    pub step: bool,
    /// In a step: the distance that elements must keep, as [`impinge::Query::separation`].
    pub separation: f64,
    /// Cells to use instead of those that the plan would choose.
    pub cells: Option<Cells>,
    /// Whether to remove an existing plan in the folder, and all files made by it.
    pub replace: bool,
}

impl Default for PlanOptions {
    fn default() -> Self {
        PlanOptions {
            cap: 2_000_000,
            chunk: 500_000,
            weld: true,
            step: false,
            separation: 0.0,
            cells: None,
            replace: false,
        }
    }
}

/// A mesh file of a plan: one body, numbered by its place in [`Plan::files`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct File {
    /// Its path, absolute; in a step, that of the body's start.
    pub path: PathBuf,
    /// In a step, the path of the body's end.
    pub end: Option<PathBuf>,
    /// How many elements it has.
    pub n_elements: u64,
    /// How many vertices.
    pub n_vertices: u64,
    pub(crate) reader: String,
    pub(crate) shape: Shape,
    fingerprints: Vec<Fingerprint>,
}

/// A plan in its folder.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    folder: PathBuf,
    id: u64,
    pub(crate) cap: u64,
    pub(crate) chunk: u64,
    pub(crate) weld: bool,
    pub(crate) separation: f64,
    pub(crate) files: Vec<File>,
    pub(crate) cells: Cells,
}

/// A run of elements of one file: the content of one part file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Unit {
    pub file: usize,
    pub first: u64,
    pub n: usize,
}

impl Plan {
    /// Reads every element of `files` once (coordinates must be finite), takes a sample, cuts
    /// space and writes `plan.json`. With [`step`](PlanOptions::step), files are start, end, start,
    /// end and so on. A folder with exactly the same plan is left as it is. `progress` gets the
    /// number of elements done and the total.
    ///
    /// # Errors
    /// Files that can't be read, refused coordinates, another plan in the folder, cancellation.
    pub fn make(
        folder: &Path,
        files: &[PathBuf],
        options: &PlanOptions,
        cancel: &CancelToken,
        progress: &mut dyn FnMut(u64, u64),
    ) -> Result<Self, Error> {
        let at_least_one = |what, given: u64| match given {
            0 => Err(Error::Argument {
                what,
                given: "0".to_owned(),
                allowed: "1 or more".to_owned(),
            }),
            _ => Ok(given),
        };
        at_least_one("files", files.len() as u64)?;
        at_least_one("cap", options.cap)?;
        let allowed = match options.step {
            true => (options.separation < 0.0 || !options.separation.is_finite())
                .then_some("a finite number that is not below 0"),
            false => (options.separation != 0.0).then_some("only 0 without a step"),
        };
        if let Some(allowed) = allowed {
            return Err(Error::Argument {
                what: "separation",
                given: options.separation.to_string(),
                allowed: allowed.to_owned(),
            });
        }
        let chunk = at_least_one("chunk", options.chunk)?;
        let bodies = bodies(files, options.step)?;
        let mut sources = bodies
            .iter()
            .map(|body| body.open(source::open))
            .collect::<Result<Vec<_>, _>>()?;
        let total: u64 = sources.iter().map(|source| source.n_elements()).sum();
        let step = (total / SAMPLE).max(1);
        let mut sample = Vec::new();
        let mut done = 0;
        for (body, source) in bodies.iter().zip(&mut sources) {
            look_at(body, source, chunk, step, cancel, &mut sample, &mut |n| {
                done += n;
                progress(done.min(total), total);
            })?;
        }
        for (_, high) in &mut sample {
            *high = high.map(|x| HalfOpen::reach(x, options.separation));
        }
        let cells = match &options.cells {
            Some(cells) => cells.clone(),
            None => cuts::cells(&sample, step as f64, options.cap),
        };
        let files = bodies
            .iter()
            .zip(&sources)
            .map(|(body, source)| file(body, source.as_ref()));
        let mut plan = Plan {
            folder: folder.to_owned(),
            id: 0,
            cap: options.cap,
            chunk,
            weld: options.weld,
            separation: options.separation,
            files: files.collect::<Result<_, _>>()?,
            cells,
        };
        plan.id = checksum(plan.text().as_bytes());
        plan.write(options.replace)?;
        Ok(plan)
    }

    /// Opens the plan of a folder.
    ///
    /// # Errors
    /// No plan, or a damaged one.
    pub fn open(folder: &Path) -> Result<Self, Error> {
        let path = folder.join("plan.json");
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(Error::Missing {
                    path,
                    step: "plan",
                    n_missing: 1,
                    n: 1,
                });
            }
            Err(source) => return Err(Error::io(&path, "read", source)),
        };
        let value: Option<Value> = serde_json::from_str(&text).ok();
        let plan = value
            .as_ref()
            .and_then(|value| Plan::from_json(folder, value));
        plan.ok_or_else(|| Error::damaged(&path, "not a plan of this version", "plan"))
    }

    fn write(&self, replace: bool) -> Result<(), Error> {
        disk::folder(&self.folder)?;
        let path = self.folder.join("plan.json");
        if path.exists() {
            match Plan::open(&self.folder) {
                Ok(held) if held.id == self.id => return Ok(()),
                _ if !replace => return Err(Error::OtherPlan { path }),
                _ => {}
            }
        }
        if replace {
            // The merged answer names no plan that a reader of `rows.npy` could compare. It goes
            // first: a process that is killed here leaves the old plan without an answer, never
            // the new plan with an old answer.
            for name in ["rows.npy", "answer.json"] {
                let old = self.folder.join(name);
                match fs::remove_file(&old) {
                    Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                        return Err(Error::io(&old, "remove", error));
                    }
                    _ => {}
                }
            }
        }
        let mut object = self.to_json();
        object.insert("id".to_owned(), json!(format!("{:016x}", self.id)));
        let text = serde_json::to_string_pretty(&object)
            .map_err(|error| Error::io(&path, "write", error.into()))?;
        disk::replace(&path, |to| writeln!(to, "{text}"))?;
        if replace {
            // Files of another plan would be found stale one by one; removing them frees disk
            // space.
            for name in ["parts", "results"] {
                let old = self.folder.join(name);
                if old.exists() {
                    fs::remove_dir_all(&old).map_err(|source| Error::io(&old, "remove", source))?;
                }
            }
        }
        Ok(())
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The number that identifies this plan in all its files: a checksum of files, cells and
    /// options.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// The mesh files, one per body.
    pub fn files(&self) -> &[File] {
        &self.files
    }

    /// The cells, one per tile.
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// Whether the scene moves, so that tiles find first contacts.
    pub fn is_step(&self) -> bool {
        self.files.iter().any(|file| file.end.is_some())
    }

    /// Whether vertices of one file at the same position are welded.
    pub fn welds(&self) -> bool {
        self.weld
    }

    /// The distance that elements must keep in a step.
    pub fn separation(&self) -> f64 {
        self.separation
    }

    /// How many tiles there are.
    pub fn n_tiles(&self) -> u32 {
        self.cells.n_tiles()
    }

    /// How many units of scattering there are.
    pub fn n_units(&self) -> usize {
        self.files.iter().map(|file| file.n_units(self.chunk)).sum()
    }

    pub(crate) fn units(&self) -> impl Iterator<Item = Unit> {
        let chunk = self.chunk;
        self.files.iter().enumerate().flat_map(move |(ix, file)| {
            (0..file.n_units(chunk) as u64).map(move |unit| Unit {
                file: ix,
                first: unit * chunk,
                n: chunk.min(file.n_elements - unit * chunk) as usize,
            })
        })
    }

    /// The text whose checksum is the id.
    fn text(&self) -> String {
        Value::Object(self.to_json()).to_string()
    }

    /// The plan as JSON, without the id.
    fn to_json(&self) -> Map<String, Value> {
        let file = |file: &File| {
            let mut object = json!({
                "path": file.path,
                "reader": file.reader,
                "corners": file.shape.corners,
                "coordinate_bytes": file.shape.width,
                "elements": file.n_elements,
                "vertices": file.n_vertices,
            });
            for (print, [bytes, checksum]) in file.fingerprints.iter().zip(FINGERPRINTS) {
                object[bytes] = json!(print.0);
                object[checksum] = json!(format!("{:016x}", print.1));
            }
            if let Some(end) = &file.end {
                object["end"] = json!(end);
            }
            object
        };
        let mut object = Map::new();
        object.insert("impinge_tiles".to_owned(), json!(VERSION));
        object.insert("cap".to_owned(), json!(self.cap));
        object.insert("chunk".to_owned(), json!(self.chunk));
        object.insert("weld".to_owned(), json!(self.weld));
        if self.separation != 0.0 {
            // The bits are what counts: reading decimal digits may round.
            let bits = format!("{:016x}", self.separation.to_bits());
            object.insert("separation".to_owned(), json!(self.separation));
            object.insert("separation_bits".to_owned(), json!(bits));
        }
        object.insert("tiles".to_owned(), json!(self.n_tiles()));
        object.insert("units".to_owned(), json!(self.n_units()));
        object.insert("files".to_owned(), self.files.iter().map(file).collect());
        object.insert("cells".to_owned(), self.cells.to_json());
        object
    }

    fn from_json(folder: &Path, value: &Value) -> Option<Self> {
        let hex =
            |value: &Value, key: &str| u64::from_str_radix(value.get(key)?.as_str()?, 16).ok();
        let number = |value: &Value, key: &str| value.get(key)?.as_u64();
        (number(value, "impinge_tiles")? == VERSION).then_some(())?;
        let file = |value: &Value| {
            let end = match value.get("end") {
                None => None,
                Some(end) => Some(PathBuf::from(end.as_str()?)),
            };
            let poses = 1 + usize::from(end.is_some());
            let fingerprint =
                |[bytes, checksum]: [&str; 2]| Some((number(value, bytes)?, hex(value, checksum)?));
            let fingerprints = FINGERPRINTS.into_iter().take(poses).map(fingerprint);
            let shape = Shape {
                poses,
                corners: number(value, "corners").filter(|n| [3, 4].contains(n))? as usize,
                width: number(value, "coordinate_bytes").filter(|n| [4, 8].contains(n))? as usize,
            };
            Some(File {
                path: value.get("path")?.as_str()?.into(),
                end,
                reader: value.get("reader")?.as_str()?.to_owned(),
                shape,
                n_elements: number(value, "elements")?,
                n_vertices: number(value, "vertices")?,
                fingerprints: fingerprints.collect::<Option<_>>()?,
            })
        };
        let plan = Plan {
            folder: folder.to_owned(),
            id: hex(value, "id")?,
            cap: number(value, "cap")?,
            chunk: number(value, "chunk").filter(|&n| n > 0)?,
            weld: value.get("weld")?.as_bool()?,
            separation: match value.get("separation_bits") {
                None => 0.0,
                Some(_) => f64::from_bits(hex(value, "separation_bits")?),
            },
            files: value
                .get("files")?
                .as_array()?
                .iter()
                .map(file)
                .collect::<Option<_>>()?,
            cells: Cells::from_json(value.get("cells")?)?,
        };
        // The other files do not belong to a plan that was changed by hand.
        (checksum(plan.text().as_bytes()) == plan.id).then_some(plan)
    }
}

impl File {
    /// The files of its start and its end; of a body that stands still, the same file twice.
    pub(crate) fn paths(&self) -> [&Path; 2] {
        [&self.path, self.end.as_ref().unwrap_or(&self.path)]
    }

    fn n_units(&self, chunk: u64) -> usize {
        self.n_elements.div_ceil(chunk) as usize
    }

    /// The first of its files that is there and has changed since the plan was made.
    pub(crate) fn changed(&self) -> Option<&Path> {
        let paths = std::iter::once(&self.path).chain(&self.end);
        let mut paths = paths.zip(&self.fingerprints);
        let (path, _) = paths.find(|(path, expected)| {
            source::fingerprint(path).is_ok_and(|found| found != **expected)
        })?;
        Some(path)
    }

    /// Opens the file, if it has not changed since the plan was made. `weld` welds the vertices of
    /// a body of a step.
    pub(crate) fn open(&self, weld: bool) -> Result<Box<dyn Source>, Error> {
        let changed = |path: &Path| Error::Changed {
            path: path.to_owned(),
        };
        let mut readers = self.reader.split(',');
        let mut opened = |path: &Path| source::open_as(path, readers.next().unwrap_or_default());
        let body = Paths {
            start: &self.path,
            end: self.end.as_deref(),
        };
        for (path, expected) in body.all().zip(&self.fingerprints) {
            if source::fingerprint(path)? != *expected {
                return Err(changed(path));
            }
        }
        let source = body.open(&mut opened)?;
        let is_same = (source.shape(), source.n_elements(), source.n_vertices())
            == (self.shape, self.n_elements, self.n_vertices);
        match is_same {
            false => Err(changed(&self.path)),
            true if weld && self.end.is_some() => source::weld(source),
            true => Ok(source),
        }
    }
}

/// The files of a body.
#[derive(Clone, Copy)]
struct Paths<'a> {
    start: &'a Path,
    end: Option<&'a Path>,
}

impl Paths<'_> {
    fn all(&self) -> impl Iterator<Item = &Path> {
        [Some(self.start), self.end].into_iter().flatten()
    }

    fn open(
        &self,
        mut open: impl FnMut(&Path) -> Result<Box<dyn Source>, Error>,
    ) -> Result<Box<dyn Source>, Error> {
        match self.end {
            None => open(self.start),
            Some(end) => source::open_step([self.start, end], open),
        }
    }
}

/// Files by body.
fn bodies(files: &[PathBuf], step: bool) -> Result<Vec<Paths<'_>>, Error> {
    if !step {
        let still = |start| Paths { start, end: None };
        return Ok(files.iter().map(PathBuf::as_path).map(still).collect());
    }
    let (pairs, rest) = files.as_chunks::<2>();
    if let [alone] = rest {
        return Err(Error::Argument {
            what: "files of a step",
            given: format!("{} without an end", alone.display()),
            allowed: "pairs of a start and an end".to_owned(),
        });
    }
    let mut bodies = Vec::with_capacity(pairs.len());
    for [start, end] in pairs {
        bodies.push(Paths {
            start,
            end: Some(end),
        });
    }
    Ok(bodies)
}

fn file(body: &Paths<'_>, source: &dyn Source) -> Result<File, Error> {
    let absolute = |path: &Path| {
        let absolute = fs::canonicalize(path).map_err(|error| Error::io(path, "open", error))?;
        if absolute.to_str().is_none() {
            return Err(Error::Argument {
                what: "path of a mesh",
                given: path.display().to_string(),
                allowed: "UTF-8".to_owned(),
            });
        }
        Ok(absolute)
    };
    Ok(File {
        path: absolute(body.start)?,
        end: body.end.map(absolute).transpose()?,
        reader: source.reader(),
        shape: source.shape(),
        n_elements: source.n_elements(),
        n_vertices: source.n_vertices(),
        fingerprints: body
            .all()
            .map(source::fingerprint)
            .collect::<Result<_, _>>()?,
    })
}

/// Checks all elements of a file and samples every `step`th of them. If the file turns out to
/// hold polygons other than triangles, its source is replaced by one that reads the whole file.
fn look_at(
    body: &Paths<'_>,
    source: &mut Box<dyn Source>,
    chunk: u64,
    step: u64,
    cancel: &CancelToken,
    sample: &mut Vec<Bounds>,
    done: &mut dyn FnMut(u64),
) -> Result<(), Error> {
    let n_before = sample.len();
    let mut first = 0;
    while first < source.n_elements() {
        if cancel.is_cancelled() {
            return Err(Error::Cancelled);
        }
        let n = chunk.min(source.n_elements() - first);
        let Some(held) = source.read(first, n as usize)? else {
            *source = body.open(source::open_whole)?;
            sample.truncate(n_before);
            first = 0;
            continue;
        };
        let shape = source.shape();
        held.check([body.start, body.end.unwrap_or(body.start)], shape)?;
        let wanted = (first..)
            .zip(held.bounds(shape))
            .filter(|(ix, _)| ix % step == 0);
        sample.extend(wanted.map(|(_, bounds)| bounds));
        first += n;
        done(n);
    }
    Ok(())
}
