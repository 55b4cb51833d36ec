//! `impinge sequence`: every frame of a sequence.

use std::io::{Write, stderr};
use std::path::Path;

use impinge::{BodyId, CancelToken, Control, Pairs, Scene, Step};
use impinge_io::{Sequence, Weld, printable};
use serde_json::{Map, Value};

use super::step::{self, Frames as _, steps_of_sequence};
use crate::apart::Inputs;
use crate::args::{BodiesArg, SequenceArgs};
use crate::detection::{Times, asked, detect, detector, hit, query, set_positions, settings};
use crate::error::Error;
use crate::load::{Bodies, Loading, to_positions};
use crate::output::out;
use crate::picture::Drawer;
use crate::rows::FrameRows;
use crate::text::{counted, grouped, hash};
use crate::values::RowsFile;
use crate::watch::{Watch, go_on};
use crate::{json, meshes, regions};

/// `impinge sequence`.
pub fn sequence(args: &SequenceArgs, cancel: &CancelToken) -> Result<(), Error> {
    let rows_on_stdout = args.pairs.as_ref().is_some_and(RowsFile::is_stdout);
    if args.ask.json && rows_on_stdout {
        let text = "--json and --pairs - both write to standard output: give one of them a file";
        return Err(Error::Usage(text.to_owned()));
    }
    if args
        .ask
        .read
        .bodies
        .is_some_and(|bodies| bodies != BodiesArg::File)
    {
        let text = "--bodies: the frames of a sequence are those of one body, which is a file";
        return Err(Error::Usage(text.to_owned()));
    }
    let is_alone = args.others.is_empty();
    let asked = asked((!is_alone, args.within || is_alone), &args.ask);
    // Where nothing depends on welding, frames may come apart.
    let weld = args.ask.read.weld().or((!asked.within).then_some(false));
    let loading = Loading::new(&args.ask, asked.within, cancel);
    let loading = loading.asked(weld, asked.within, args.ask.read.format);
    let mut bodies = Bodies::default();
    let (moving, weld) = bodies.add(&args.mesh, loading)?;
    let frames = Frames::open(&args.sequence, weld)?;
    for other in &args.others {
        bodies.add(other, loading)?;
    }
    let Bodies {
        mut scene,
        ids,
        names,
        vertices,
        nouns,
        ..
    } = bodies;
    let query = query(asked, &args.ask, &ids)?;
    let bodies: Vec<(BodyId, &str)> = ids
        .into_iter()
        .zip(names.iter().map(String::as_str))
        .collect();

    let range = args.frames.within(frames.n_frames()).ok_or_else(|| {
        Error::Usage(format!(
            "--frames reaches beyond the {} of {}",
            counted(frames.n_frames() as u64, "frame"),
            printable(&frames.name)
        ))
    })?;
    let mut detector = detector(&args.detector)?;
    let mut outputs = Outputs::new(args, &frames)?;
    let prints = !args.ask.json && !rows_on_stdout;
    let watch = Watch::frames(!args.detector.no_progress, range.len(), true);
    if args.ccd {
        let step = Step::new(query)
            .start(args.step.start.into())
            .toi(args.step.toi.into())
            .separation(args.step.separation)
            .clearance(args.step.clearance);
        let steps = steps_of_sequence(
            (&mut detector, &mut scene, moving),
            &step,
            &frames,
            range,
            args.ask.json,
            &Control::new().cancel(cancel),
            || watch.frame_done(),
        )?;
        if !args.ask.json {
            writeln!(out(), "{}", asked.line(&vertices, &nouns))?;
        }
        return steps.end(args.ask.fail_on_hit);
    }
    let still = Watch::detection(false, "");
    let mut lines = Lines::default();
    if prints {
        Lines::begin()?;
    }
    let mut n_pairs = 0;
    for frame_ix in range {
        go_on(cancel)?;
        let positions = frames.read(frame_ix)?;
        set_positions(&mut scene, moving, &positions)
            .map_err(|source| frames.refused(frame_ix, source))?;
        let pairs = detect(&mut detector, &scene, &query, cancel, &still)?;
        n_pairs += pairs.len();
        outputs.frame(frame_ix, &scene, &bodies, pairs)?;
        if args.ask.json {
            let mut times = Times::default();
            times.add(pairs.stats());
            let regions = regions::regions(&scene, &bodies, pairs)?;
            let regions = regions.as_deref();
            let mut line = Map::new();
            line.insert("frame".into(), frame_ix.into());
            let answer = json::answer((asked, &scene), &bodies, &vertices, pairs, regions, &times)?;
            line.extend(answer);
            let mut to = out();
            writeln!(to, "{}", Value::Object(line))?;
            to.flush()?;
        } else if prints {
            lines.frame(frame_ix, &bodies, pairs)?;
        }
        watch.frame_done();
    }
    drop(watch);
    outputs.finish()?;
    if prints {
        lines.end()?;
        writeln!(out(), "{}", asked.line(&vertices, &nouns))?;
    }
    hit(args.ask.fail_on_hit, n_pairs > 0)
}

/// The output files of each frame.
struct Outputs<'a> {
    args: &'a SequenceArgs,
    inputs: Inputs,
    rows: Option<FrameRows>,
    drawer: Option<Drawer<'a>>,
}

impl<'a> Outputs<'a> {
    fn new(args: &'a SequenceArgs, frames: &Frames) -> Result<Self, Error> {
        let meshes = std::iter::once(&args.mesh).chain(&args.others);
        let inputs = Inputs::new(meshes.chain(frames.sequence.files()));
        if let Some(file) = args.pairs.as_ref().filter(|file| !file.is_stdout()) {
            inputs.check("--pairs", &file.path)?;
        }
        Ok(Outputs {
            args,
            inputs,
            rows: args.pairs.as_ref().map(FrameRows::create).transpose()?,
            drawer: match args.png {
                Some(_) => {
                    let device = args.detector.device.as_deref();
                    let threads = settings(&args.detector).threads;
                    Some(Drawer::new(&args.picture, device, threads)?)
                }
                None => None,
            },
        })
    }

    fn frame(
        &mut self,
        frame_ix: usize,
        scene: &Scene,
        bodies: &[(BodyId, &str)],
        pairs: &Pairs,
    ) -> Result<(), Error> {
        if let Some(rows) = &mut self.rows {
            rows.frame(frame_ix, pairs)?;
        }
        if let Some(files) = &self.args.out {
            let file = files.frame(frame_ix).map_err(Error::Usage)?;
            self.inputs.check("--out", &file.path)?;
            meshes::write(&file, scene, bodies, pairs)?;
        }
        if let (Some(files), Some(drawer)) = (&self.args.png, &mut self.drawer) {
            let file = files.frame(frame_ix).map_err(Error::Usage)?;
            self.inputs.check("--png", &file.0)?;
            drawer.write(&file.0, scene, bodies, pairs)?;
        }
        Ok(())
    }

    fn finish(self) -> Result<(), Error> {
        self.rows.map_or(Ok(()), FrameRows::finish)
    }
}

/// The frames of the sequence, welded like the mesh.
pub(super) struct Frames {
    sequence: Sequence,
    weld: Option<Weld>,
    name: String,
}

impl Frames {
    pub(super) fn open(path: &Path, weld: Option<Weld>) -> Result<Self, Error> {
        let sequence = Sequence::open(path)?;
        for [before, after] in sequence.gaps() {
            // A note that nobody can read does no harm.
            let _ = writeln!(
                stderr(),
                "note: no frame between {} and {}",
                printable(before),
                printable(after)
            );
        }
        Ok(Frames {
            sequence,
            weld,
            name: path.display().to_string(),
        })
    }
}

impl Frames {
    pub(super) fn n_frames(&self) -> usize {
        self.sequence.n_frames()
    }
}

/// Welds the positions of a frame like the mesh.
pub(super) fn welded(
    positions: impinge_io::Positions,
    weld: Option<&Weld>,
    name: &str,
    frame_ix: usize,
) -> Result<impinge::Positions, Error> {
    let positions = match weld {
        None => positions,
        Some(weld) => {
            if let Some([a, b]) = weld.torn(&positions) {
                return Err(Error::Usage(format!(
                    "{}: frame {frame_ix}: vertices {a} and {b} are apart, but welded since they are at one position in the \
                     mesh: use --no-weld",
                    printable(name)
                )));
            }
            weld.positions(&positions)
                .ok_or_else(|| impinge_io::Error::Mismatch {
                    file: name.to_owned(),
                    what: "positions per frame (the mesh has as many vertices before welding)"
                        .to_owned(),
                    expected: weld.map().len() as u64,
                    found: positions.len() as u64,
                })?
        }
    };
    Ok(to_positions(positions))
}

impl step::Frames for Frames {
    fn read(&self, frame_ix: usize) -> Result<impinge::Positions, Error> {
        let positions = self.sequence.frame(frame_ix)?;
        welded(positions, self.weld.as_ref(), &self.name, frame_ix)
    }

    fn refused(&self, frame_ix: usize, source: impinge::Error) -> Error {
        Error::Refused {
            what: format!("{}: frame {frame_ix}", self.name),
            source,
        }
    }
}

/// The text output: one line per frame, and one summary line.
#[derive(Default)]
struct Lines {
    times: Times,
    /// The smallest and the largest number of pairs in a frame.
    extremes: Option<(usize, usize)>,
}

impl Lines {
    fn begin() -> Result<(), Error> {
        let mut to = out();
        writeln!(
            to,
            "{:>7} {:>11} {:>11} {:>11}  hash",
            "frame", "pairs", "colliding", "ms"
        )?;
        Ok(to.flush()?)
    }

    fn frame(
        &mut self,
        frame_ix: usize,
        bodies: &[(BodyId, &str)],
        pairs: &Pairs,
    ) -> Result<(), Error> {
        let colliding: usize = bodies
            .iter()
            .map(|&(id, _)| pairs.colliding(id).len())
            .sum();
        let mut to = out();
        writeln!(
            to,
            "{frame_ix:>7} {:>11} {:>11} {:>11.3}  {}",
            grouped(pairs.len() as u64),
            grouped(colliding as u64),
            pairs.stats().total_ms,
            match pairs.is_empty() {
                true => "-".to_owned(),
                false => hash(pairs),
            }
        )?;
        to.flush()?;
        self.times.add(pairs.stats());
        let (least, most) = self.extremes.unwrap_or((pairs.len(), pairs.len()));
        self.extremes = Some((least.min(pairs.len()), most.max(pairs.len())));
        Ok(())
    }

    fn end(&self) -> Result<(), Error> {
        let Some((least, most)) = self.extremes else {
            return Ok(());
        };
        writeln!(
            out(),
            "{}, {} to {} pairs; median {:.3} ms, 95 % within {:.3} ms",
            counted(self.times.n_frames() as u64, "frame"),
            grouped(least as u64),
            grouped(most as u64),
            self.times.total_ms(50),
            self.times.total_ms(95)
        )?;
        Ok(())
    }
}
