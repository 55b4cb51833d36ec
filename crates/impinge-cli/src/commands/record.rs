//! The outputs of `impinge simulate`, which a later run can continue.
//!
//! ```text
//! FOLDER/bunny-7k.ply + bunny-7k.pc2   the bodies' mesh and its positions, one frame per step
//!        colliding.csv                 and the colliding primitives of each step (step, body, primitive)
//! FOLDER/bunny-7k_00000.vtu, …         or one coloured mesh per step (or .ply)
//! FOLDER/steps.csv                     one row per step: counts, hash, times
//! FOLDER/state.bin                     the last saved state
//! ```
//! The state after n steps is saved only after the first n frames and rows are on the disk. A run
//! that continues from it cuts off later frames and rows and writes them again.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use impinge::{BodyId, Pairs, Positions, Scene};
use impinge_fem::{Simulation, State, StepReport};
use impinge_io::{AtomicFile, GrowingPc2, printable};

use crate::args::{SequenceFormatArg, SimulateArgs};
use crate::error::Error;
use crate::meshes;
use crate::text::hash;
use crate::values::{MeshFile, MeshFormat};

const STATE: &str = "state.bin";

/// The files of a run.
pub struct Record {
    folder: PathBuf,
    stem: &'static str,
    frames: Frames,
    steps: Log,
}

enum Frames {
    /// One mesh, a cache of positions, and a table of colliding primitives.
    Cache { cache: GrowingPc2, colliding: Log },
    /// One mesh per frame.
    Numbered(MeshFormat),
}

/// The pairs of a frame in numbers.
pub struct Found {
    step: u64,
    n_pairs: usize,
    hash: String,
    n_colliding: Vec<usize>,
    detect_ms: f64,
}

impl Found {
    pub fn new(step: u64, bodies: &[(BodyId, &str)], pairs: &Pairs) -> Self {
        let colliding = |&(id, _): &(BodyId, &str)| pairs.colliding(id).len();
        Found {
            step,
            n_pairs: pairs.len(),
            hash: hash(pairs),
            n_colliding: bodies.iter().map(colliding).collect(),
            detect_ms: pairs.stats().total_ms,
        }
    }
}

impl Record {
    /// The saved state in a folder, if there is one, and its path.
    pub fn saved_state(folder: &Path) -> Result<Option<(PathBuf, Vec<u8>)>, Error> {
        let path = folder.join(STATE);
        match fs::read(&path) {
            Ok(bytes) => Ok(Some((path, bytes))),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(source) => Err(Error::Read { path, source }),
        }
    }

    /// Starts a new run; existing files of these names are replaced.
    pub fn create(args: &SimulateArgs, simulation: &Simulation) -> Result<Self, Error> {
        let stem = args.scene.name();
        let folder = args.out.clone();
        let n_bodies = simulation.bodies().len();
        Ok(Record {
            steps: Log::create(folder.join("steps.csv"), &steps_header(n_bodies))?,
            frames: match numbered(args.format) {
                Some(format) => Frames::Numbered(format),
                None => Frames::Cache {
                    cache: GrowingPc2::create(
                        &folder.join(stem).with_extension("pc2"),
                        n_vertices(simulation),
                        0.0,
                        1.0,
                    )?,
                    colliding: Log::create(folder.join("colliding.csv"), "step,body,primitive\n")?,
                },
            },
            folder,
            stem,
        })
    }

    /// Continues after the steps that the simulation has made.
    pub fn resume(args: &SimulateArgs, simulation: &Simulation) -> Result<Self, Error> {
        let stem = args.scene.name();
        let folder = args.out.clone();
        let n_done = simulation.n_steps();
        let frames = match numbered(args.format) {
            Some(format) => Frames::Numbered(format),
            None => Frames::Cache {
                cache: GrowingPc2::resume(
                    &folder.join(stem).with_extension("pc2"),
                    n_vertices(simulation),
                    usize::try_from(n_done).unwrap_or(usize::MAX),
                )?,
                colliding: Log::resume(folder.join("colliding.csv"), n_done)?.0,
            },
        };
        let (steps, n_rows) = Log::resume(folder.join("steps.csv"), n_done)?;
        let record = Record {
            folder,
            stem,
            frames,
            steps,
        };
        if n_rows != n_done {
            return Err(Error::Usage(format!(
                "{}: {n_rows} rows, but the saved state comes after {n_done} steps",
                printable(&record.steps.path)
            )));
        }
        if let (Frames::Numbered(format), Some(last)) = (&record.frames, n_done.checked_sub(1)) {
            let path = record.numbered_path(*format, last);
            if !path.is_file() {
                return Err(Error::Usage(format!(
                    "{} does not exist: continue with the --format of the first run",
                    printable(&path)
                )));
            }
        }
        Ok(record)
    }

    /// Writes the state of a simulation as its next frame.
    pub fn frame(
        &mut self,
        simulation: &Simulation,
        bodies: &[(BodyId, &str)],
        pairs: &Pairs,
    ) -> Result<(), Error> {
        let step = simulation.n_steps();
        let scene = simulation.scene();
        match &mut self.frames {
            &mut Frames::Numbered(format) => {
                let path = self.numbered_path(format, step);
                meshes::write(&MeshFile { path, format }, scene, bodies, pairs)
            }
            Frames::Cache { cache, colliding } => {
                if step == 0 {
                    let mesh = MeshFile {
                        path: self.folder.join(self.stem).with_extension("ply"),
                        format: MeshFormat::Ply,
                    };
                    meshes::write(&mesh, scene, bodies, pairs)?;
                }
                cache.append(positions(scene, bodies)?.iter())?;
                for (body_ix, &(id, _)) in bodies.iter().enumerate() {
                    for primitive in pairs.colliding(id) {
                        colliding.put(&format!("{step},{body_ix},{primitive}\n"))?;
                    }
                }
                Ok(())
            }
        }
    }

    /// Writes the row of a step; for the last frame, which has no step, `report` is `None`.
    pub fn row(&mut self, found: &Found, report: Option<&StepReport>) -> Result<(), Error> {
        let colliding: String = found
            .n_colliding
            .iter()
            .map(|count| format!(",{count}"))
            .collect();
        let made = report.map_or(",,".to_owned(), |report| {
            format!(
                "{},{},{:.3}",
                report.n_contacts, report.n_iterations, report.advance_ms
            )
        });
        self.steps.put(&format!(
            "{},{},{}{colliding},{:.3},{made}\n",
            found.step, found.n_pairs, found.hash, found.detect_ms
        ))
    }

    /// Makes sure that all frames and rows are on the disk, then saves the state.
    pub fn save(&mut self, state: &State) -> Result<(), Error> {
        if let Frames::Cache { cache, colliding } = &mut self.frames {
            cache.save()?;
            colliding.save()?;
        }
        self.steps.save()?;
        // A partly written state never replaces a complete one.
        let path = self.folder.join(STATE);
        let mut file = AtomicFile::create(&path)?;
        file.write_all(&state.to_bytes())
            .and_then(|()| file.sync())
            .map_err(|source| Error::Write { path, source })?;
        Ok(file.finish()?)
    }

    /// Describes the outputs for the user.
    pub fn describe(&self) -> String {
        let path = self.folder.join(self.stem);
        match self.frames {
            Frames::Cache { .. } => format!(
                "{}, its positions in {} and colliding primitives in {}",
                printable(path.with_extension("ply")),
                printable(path.with_extension("pc2")),
                printable(self.folder.join("colliding.csv"))
            ),
            Frames::Numbered(format) => {
                format!(
                    "{} and the following files",
                    printable(self.numbered_path(format, 0))
                )
            }
        }
    }

    fn numbered_path(&self, format: MeshFormat, step: u64) -> PathBuf {
        let extension = format.extension();
        self.folder
            .join(format!("{}_{step:05}.{extension}", self.stem))
    }
}

fn numbered(format: SequenceFormatArg) -> Option<MeshFormat> {
    match format {
        SequenceFormatArg::Pc2 => None,
        SequenceFormatArg::Vtu => Some(MeshFormat::Vtu),
        SequenceFormatArg::Ply => Some(MeshFormat::Ply),
    }
}

fn steps_header(n_bodies: usize) -> String {
    let colliding: String = (0..n_bodies).map(|ix| format!(",colliding_{ix}")).collect();
    format!("step,pairs,hash{colliding},detect_ms,contacts,iterations,advance_ms\n")
}

fn n_vertices(simulation: &Simulation) -> usize {
    simulation.masses().len()
}

/// The positions that the detector used, body by body.
fn positions(scene: &Scene, bodies: &[(BodyId, &str)]) -> Result<Vec<[f32; 3]>, Error> {
    let mut all = Vec::new();
    for &(id, _) in bodies {
        // A simulation's scene holds f32.
        if let Positions::F32(positions) = scene.body(id)?.positions() {
            all.extend_from_slice(positions);
        }
    }
    Ok(all)
}

/// A CSV file of rows that begin with a step, ascending.
struct Log {
    path: PathBuf,
    file: BufWriter<File>,
}

impl Log {
    fn create(path: PathBuf, header: &str) -> Result<Self, Error> {
        // An existing file is replaced once the new one has its header on the disk.
        let mut file = AtomicFile::create(&path)?;
        if let Err(source) = file.write_all(header.as_bytes()) {
            return Err(Error::Write { path, source });
        }
        file.finish()?;
        Log::open(path, |path| OpenOptions::new().append(true).open(path))
    }

    /// Keeps the rows of steps before `step`, and returns their number.
    fn resume(path: PathBuf, step: u64) -> Result<(Self, u64), Error> {
        let text = fs::read_to_string(&path).map_err(|source| Error::Read {
            path: path.clone(),
            source,
        })?;
        let mut lines = text.split_inclusive('\n');
        let mut length = lines.next().map_or(0, str::len);
        let mut n_rows = 0;
        for line in lines {
            let of = line.split(',').next().and_then(|field| field.parse().ok());
            // A row cut off by an interruption belongs to a later step.
            if !line.ends_with('\n') || of.is_none_or(|of: u64| of >= step) {
                break;
            }
            length += line.len();
            n_rows += 1;
        }
        let log = Log::open(path, |path| {
            let file = OpenOptions::new().append(true).open(path)?;
            file.set_len(length as u64)?;
            Ok(file)
        })?;
        Ok((log, n_rows))
    }

    fn open(path: PathBuf, open: impl Fn(&Path) -> io::Result<File>) -> Result<Self, Error> {
        match open(&path) {
            Ok(file) => Ok(Log {
                file: BufWriter::new(file),
                path,
            }),
            Err(source) => Err(Error::Write { path, source }),
        }
    }

    fn put(&mut self, row: &str) -> Result<(), Error> {
        let written = self.file.write_all(row.as_bytes());
        self.said(written)
    }

    fn save(&mut self) -> Result<(), Error> {
        let saved = self
            .file
            .flush()
            .and_then(|()| self.file.get_ref().sync_data());
        self.said(saved)
    }

    fn said(&self, result: io::Result<()>) -> Result<(), Error> {
        result.map_err(|source| Error::Write {
            path: self.path.clone(),
            source,
        })
    }
}
