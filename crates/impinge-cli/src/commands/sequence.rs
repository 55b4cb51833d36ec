//! `impinge sequence`: every frame of a sequence.

use std::io::{Write, stderr};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use impinge::{BodyId, CancelToken, Control, Pairs, Precision, Scene};
use impinge_io::{Cell, ELEMENTS, Sequence, Weld, impact_columns, printable};

use super::step::{self, Frames as _, Shown, steps_of_sequence};
use crate::apart::Inputs;
use crate::args::{BodiesArg, SequenceArgs};
use crate::asked::{Asked, thicken};
use crate::detection::{Times, asked, detector, hit, query, settings};
use crate::error::Error;
use crate::files::{Files, FrameFiles};
use crate::load::{Bodies, Loading, tell, to_positions};
use crate::output::out;
use crate::picture::Drawer;
use crate::rows::{self, Rows};
use crate::text::{counted, grouped, hash};
use crate::values::RowsFile;
use crate::watch::{Watch, go_on};
use crate::{meshes, output, regions, report};

/// `impinge sequence`.
pub fn sequence(args: &SequenceArgs, cancel: &CancelToken) -> Result<(), Error> {
    if args
        .ask
        .read
        .bodies
        .is_some_and(|bodies| bodies != BodiesArg::File)
    {
        let text = "--bodies: the frames of a sequence are those of one body, which is a file";
        return Err(Error::Usage(text.to_owned()));
    }
    let is_alone = args.others.is_empty() && args.moving.is_empty();
    let asked = Asked {
        rest: args.rest.distance,
        ..asked((!is_alone, args.within || is_alone), &args.ask)
    };
    // Where nothing depends on welding, frames may come apart.
    let weld = args.ask.read.weld().or((!asked.within).then_some(false));
    let loading = Loading::new(&args.ask, asked.within, cancel);
    let loading = loading.asked(weld, asked.within, args.ask.read.format);
    let mut bodies = Bodies::default();
    let (moving, weld) = bodies.add(&args.mesh, loading)?;
    let all = std::iter::once(&args.mesh).chain(&args.sequence);
    let all: Vec<PathBuf> = all.cloned().collect();
    let (of_mesh, name) = opened(&all)?;
    let mut frames = Frames::of(of_mesh, name, &args.mesh, weld, args.ask.json)?;
    for other in &args.others {
        bodies.add(other, loading)?;
    }
    let mut others = Vec::new();
    for pair in args.moving.chunks(2) {
        let (body, weld) = bodies.add(&pair[0], loading)?;
        let (of_other, name) = opened(pair)?;
        let other = Frames::of(of_other, name, &pair[0], weld, args.ask.json)?;
        other.check_beside(&frames)?;
        others.push((body, other));
    }
    let Bodies {
        mut scene,
        ids,
        names,
        vertices,
        origins,
        nouns,
        ..
    } = bodies;
    thicken(&mut scene, &ids, &args.step.thickness)?;
    let query = query(asked, &args.ask.exclude, &ids)?;
    let query = match args.ccd {
        true => args.step.of(query),
        false => query,
    };
    let bodies: Vec<(BodyId, &str)> = ids
        .into_iter()
        .zip(names.iter().map(String::as_str))
        .collect();

    if frames.n_frames() == 0 {
        // A check of nothing would find nothing.
        let text = format!("{}: there are no frames", printable(&frames.name));
        return Err(Error::Usage(text));
    }
    let range = args.frames.within(frames.n_frames()).ok_or_else(|| {
        Error::Usage(format!(
            "--frames reaches beyond the {} of {}",
            counted(frames.n_frames() as u64, "frame"),
            printable(&frames.name)
        ))
    })?;
    let mut detector = detector(&args.detector)?;
    detector.set_control(Control::new().cancel(cancel));
    let query = args.rest.leave_out(query, &mut detector, &scene)?;
    let inputs = Inputs::new(
        std::iter::once(&args.mesh)
            .chain(&args.others)
            .chain(&args.moving)
            .chain(frames.sequence.files())
            .chain(others.iter().flat_map(|(_, other)| other.sequence.files())),
    );
    let file = args.rows.file(&inputs, args.ask.json)?;
    let prints = !args.ask.json && !file.as_ref().is_some_and(RowsFile::is_stdout);
    let watch = Watch::frames(!args.detector.no_progress, range.len(), true);
    if args.ccd {
        if range.len() < 2 {
            // As a check of nothing.
            let text = "--ccd: a step is from one frame to the next, and there is one frame";
            return Err(Error::Usage(text.to_owned()));
        }
        let in_f64 = args.step.precision == Precision::F64;
        let columns = rows::of_frames(&impact_columns(in_f64));
        let create = |file| Rows::create(file, columns, None);
        let shown = Shown {
            json: args.ask.json,
            text: prints,
            rows: file.as_ref().map(create).transpose()?,
        };
        let steps = steps_of_sequence(
            (&mut detector, &mut scene, moving, &origins),
            &query,
            (&mut frames, &mut others),
            range,
            shown,
            || watch.frame_done(),
        )?;
        drop(watch);
        if !args.ask.json {
            let asked = Asked {
                question: args.step.question(),
                has_kinds: !args.step.kinds.is_empty(),
                ..asked
            };
            let line = asked.line_of_thick(&vertices, &nouns, &args.step.thickness);
            let stages = stages(args, &steps.times);
            let text = format!("{}\n{stages}{line}\n", steps.total());
            output::say(text.as_bytes(), file.as_ref())?;
        }
        return end(steps.end(args.ask.fail_on_hit), &frames, &others);
    }
    let mut outputs = Outputs::new(args, inputs, file.as_ref())?;
    outputs.check(range.start)?;
    let mut lines = Lines::default();
    if prints {
        Lines::begin()?;
    }
    let mut n_pairs = 0;
    for frame_ix in range {
        go_on(cancel)?;
        let set = |positions: &impinge::Positions| scene.set_positions(moving, positions);
        if frames.take(frame_ix, set)?.is_none() {
            continue;
        }
        let mut are_set = true;
        for (body, other) in &mut others {
            let set = |at: &impinge::Positions| scene.set_positions(*body, at);
            are_set &= other.take(frame_ix, set)?.is_some();
        }
        if !are_set {
            continue;
        }
        let pairs = &detector.detect(&scene, &query)?;
        n_pairs += pairs.len();
        outputs.frame(frame_ix, &scene, &bodies, pairs)?;
        let named = frames.named(frame_ix);
        if args.ask.json {
            let mut times = Times::default();
            times.add(pairs.stats());
            let regions = regions::regions(&scene, &bodies, pairs)?;
            let regions = regions.as_deref();
            let asked = (asked, &scene);
            let found = report::Pairs::new(asked, &bodies, &vertices, pairs, regions, &times)?;
            report::print(&report::Pairs {
                frame: Some(named),
                ..found
            })?;
        } else {
            lines.add(pairs);
            if prints {
                Lines::frame(&named, &bodies, pairs)?;
            }
        }
        watch.frame_done();
    }
    drop(watch);
    outputs.finish()?;
    if !args.ask.json {
        let line = asked.line(&vertices, &nouns);
        let stages = stages(args, &lines.times);
        let text = format!("{}{stages}{line}\n", lines.total());
        output::say(text.as_bytes(), file.as_ref())?;
    }
    let asked = hit(args.ask.fail_on_hit, n_pairs > 0);
    end(asked, &frames, &others)
}

/// What the program ends with, frames of other meshes included.
fn end(
    asked: Result<(), Error>,
    frames: &Frames,
    others: &[(BodyId, Frames)],
) -> Result<(), Error> {
    let others = others.iter().map(|(_, other)| other);
    others.fold(frames.end(asked), |asked, other| other.end(asked))
}

/// With `-v`, the median time of each stage.
fn stages(args: &SequenceArgs, times: &Times) -> String {
    match args.ask.verbose {
        true => format!("\n{}\n\n", output::stage_table(times)),
        false => String::new(),
    }
}

/// The frames of a mesh, which is the first file, and the file that names them.
fn opened(all: &[PathBuf]) -> Result<(Sequence, &Path), Error> {
    if let [_, path] = all {
        return Ok((Sequence::open(path)?, path));
    }
    let refused = |path: &Path| {
        let path = printable(path);
        let needed = "a mesh and one file with frames, or a file for each frame";
        Err(Error::Usage(format!("{path}: {needed}")))
    };
    match Files::of(all, true, false)? {
        Files {
            mesh,
            frames: FrameFiles::Each(files),
            others: [],
        } => Ok((Sequence::of_files(files.to_vec())?, mesh)),
        Files {
            frames: FrameFiles::Sequence(path),
            ..
        } => refused(path),
        Files { mesh, .. } => refused(mesh),
    }
}

/// The output files of each frame.
struct Outputs<'a> {
    args: &'a SequenceArgs,
    inputs: Inputs,
    rows: Option<Rows>,
    drawer: Option<Drawer<'a>>,
}

impl<'a> Outputs<'a> {
    fn new(args: &'a SequenceArgs, inputs: Inputs, rows: Option<&RowsFile>) -> Result<Self, Error> {
        let create = |file| Rows::create(file, rows::of_frames(&ELEMENTS), None);
        Ok(Outputs {
            args,
            inputs,
            rows: rows.map(create).transpose()?,
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

    /// Fails if the files of a frame cannot be written there: of the first one before the work.
    fn check(&self, frame_ix: usize) -> Result<(), Error> {
        if let Some(files) = &self.args.out {
            let file = files.frame(frame_ix).map_err(Error::Usage)?;
            self.inputs.check_frame("--out", &file.path)?;
        }
        if let Some(files) = &self.args.png {
            let file = files.frame(frame_ix).map_err(Error::Usage)?;
            self.inputs.check_frame("--png", &file.path)?;
        }
        Ok(())
    }

    fn frame(
        &mut self,
        frame_ix: usize,
        scene: &Scene,
        bodies: &[(BodyId, &str)],
        pairs: &Pairs,
    ) -> Result<(), Error> {
        self.check(frame_ix)?;
        if let Some(rows) = &mut self.rows {
            let frame = rows::frame(frame_ix);
            rows.put(pairs.rows().map(|row| {
                let [body_a, a, body_b, b] = row.map(Cell::Number);
                [frame, body_a, a, body_b, b]
            }))?;
        }
        if let Some(files) = &self.args.out {
            let file = files.frame(frame_ix).map_err(Error::Usage)?;
            meshes::write(&file, scene, bodies, pairs)?;
        }
        if let (Some(files), Some(drawer)) = (&self.args.png, &mut self.drawer) {
            let file = files.frame(frame_ix).map_err(Error::Usage)?;
            drawer.write(&file.path, scene, bodies, pairs)?;
        }
        Ok(())
    }

    fn finish(self) -> Result<(), Error> {
        self.rows.map_or(Ok(()), Rows::finish)
    }
}

/// The frames of the sequence, welded like the mesh.
pub(super) struct Frames {
    sequence: Sequence,
    /// Frames before which others are missing.
    after_gaps: Vec<usize>,
    weld: Option<Arc<Weld>>,
    name: String,
    /// Whether frames that are passed over get a line of JSON.
    json: bool,
    n_passed_over: u64,
}

impl Frames {
    /// The frames of a mesh, which was welded so. Messages call them by the name.
    pub(super) fn of(
        sequence: Sequence,
        name: &Path,
        mesh: &Path,
        weld: Option<Arc<Weld>>,
        json: bool,
    ) -> Result<Self, Error> {
        sequence.check_faces(mesh)?;
        tell(&name.display().to_string(), sequence.notes());
        let mut after_gaps = Vec::new();
        for [before, after] in sequence.gaps() {
            after_gaps.extend(sequence.files().iter().position(|file| file == after));
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
            after_gaps,
            weld,
            name: name.display().to_string(),
            json,
            n_passed_over: 0,
        })
    }

    /// What the program ends with.
    ///
    /// # Errors
    /// That of the frames that were asked about; if there is none, that some were passed over.
    fn end(&self, asked: Result<(), Error>) -> Result<(), Error> {
        if self.n_passed_over == 0 {
            return asked;
        }
        let passed_over = format!(
            "{} of {} not asked about",
            counted(self.n_passed_over, "frame"),
            printable(&self.name)
        );
        if asked.is_err() {
            let _ = writeln!(stderr(), "note: {passed_over}");
        }
        asked.and(Err(Error::Unread(passed_over)))
    }
}

impl Frames {
    /// Refuses frames that do not belong to those of another mesh one by one.
    fn check_beside(&self, first: &Frames) -> Result<(), Error> {
        let said = match [first, self].map(Frames::n_frames) {
            [first, own] if first != own => format!("{own} frames given, {first} needed"),
            _ => match [first, self].map(|of| of.after_gaps.is_empty()) {
                [true, true] => return Ok(()),
                _ => "frames are missing between others".to_owned(),
            },
        };
        let name = printable(&self.name);
        let why = "the frames of meshes that move belong together one by one";
        Err(Error::Usage(format!("--moving: {name}: {said}: {why}")))
    }

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
        welded(positions, self.weld.as_deref(), &self.name, frame_ix)
    }

    fn refused(&self, frame_ix: usize, source: impinge::Error) -> Error {
        Error::Refused {
            what: format!("{}: frame {frame_ix}", self.name),
            source,
        }
    }

    fn follows(&mut self, frame_ix: usize) -> bool {
        let is_after_gap = self.after_gaps.contains(&frame_ix);
        self.n_passed_over += u64::from(is_after_gap);
        !is_after_gap
    }

    fn pass_over(&mut self, frame_ix: usize, error: Error) -> Result<(), Error> {
        // Welded vertices that come apart ask for another option, and one file has frames of one size.
        let is_of_all = match &error {
            Error::Usage(_) => true,
            Error::File(impinge_io::Error::Mismatch { .. })
            | Error::Refused {
                source: impinge::Error::WrongNumberOfPositions { .. },
                ..
            } => !self.sequence.has_numbered_files(),
            _ => false,
        };
        if is_of_all {
            return Err(error);
        }
        self.n_passed_over += 1;
        if self.json {
            report::print(&report::FrameError {
                frame: self.named(frame_ix),
                error: error.line(),
            })?;
        } else {
            // A line that nobody can read does no harm.
            let _ = writeln!(
                stderr(),
                "frame {frame_ix} is passed over: {}",
                error.line()
            );
        }
        Ok(())
    }

    fn named(&self, frame_ix: usize) -> report::Frame {
        let file = || self.sequence.files()[frame_ix].display().to_string();
        report::Frame {
            frame: frame_ix,
            file: self.sequence.has_numbered_files().then(file),
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

    fn add(&mut self, pairs: &Pairs) {
        self.times.add(pairs.stats());
        let (least, most) = self.extremes.unwrap_or((pairs.len(), pairs.len()));
        self.extremes = Some((least.min(pairs.len()), most.max(pairs.len())));
    }

    fn frame(named: &report::Frame, bodies: &[(BodyId, &str)], pairs: &Pairs) -> Result<(), Error> {
        let colliding: usize = bodies
            .iter()
            .map(|&(id, _)| pairs.colliding(id).len())
            .sum();
        let hash = match pairs.is_empty() {
            true => "-".to_owned(),
            false => hash(pairs),
        };
        let mut to = out();
        writeln!(
            to,
            "{:>7} {:>11} {:>11} {:>11.3}  {}",
            named.frame,
            grouped(pairs.len() as u64),
            grouped(colliding as u64),
            pairs.stats().total_ms,
            match &named.file {
                Some(file) => format!("{hash:16}  {}", printable(file)),
                None => hash,
            }
        )?;
        Ok(to.flush()?)
    }

    /// The line about all frames; nothing if there was none.
    fn total(&self) -> String {
        let Some((least, most)) = self.extremes else {
            return String::new();
        };
        format!(
            "{}, {} to {} pairs; median {:.3} ms, 95 % within {:.3} ms\n",
            counted(self.times.n_frames() as u64, "frame"),
            grouped(least as u64),
            grouped(most as u64),
            self.times.total_ms(50),
            self.times.total_ms(95)
        )
    }
}
