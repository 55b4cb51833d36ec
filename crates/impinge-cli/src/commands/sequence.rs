//! `impinge sequence`: a frame after the other.

use std::io::Write;

use impinge::{BodyId, CancelToken, Pairs, Query};
use impinge_io::{Sequence, Weld};
use serde_json::{Map, Value};

use crate::args::SequenceArgs;
use crate::detection::{Times, detect, detector, query, set_positions};
use crate::error::Error;
use crate::json;
use crate::load::{Bodies, Loading, to_positions};
use crate::output::{counted, grouped, out};
use crate::watch::{Watch, go_on};

/// `impinge sequence`.
pub fn sequence(args: &SequenceArgs, cancel: &CancelToken) -> Result<(), Error> {
    let mut detector = detector(&args.detector)?;
    let loading = Loading {
        weld: args.ask.weld,
        notes: !args.ask.json,
        cancel,
    };
    let mut bodies = Bodies::default();
    let (moving, weld) = bodies.add(&args.mesh, loading)?;
    let frames = Frames::open(args, weld)?;
    for other in &args.others {
        bodies.add(other, loading)?;
    }
    let Bodies {
        mut scene,
        ids,
        names,
    } = bodies;
    let asked = match (args.within, args.others.is_empty()) {
        (_, true) => Query::all_within(),
        (true, false) => Query::everything(),
        (false, false) => Query::all(),
    };
    let query = query(asked, &args.ask, &ids)?;
    let bodies: Vec<(BodyId, &str)> = ids
        .into_iter()
        .zip(names.iter().map(String::as_str))
        .collect();

    let range = args
        .frames
        .within(frames.sequence.n_frames())
        .ok_or_else(|| {
            Error::Usage(format!(
                "--frames reaches beyond the {} of {}",
                counted(frames.sequence.n_frames() as u64, "frame"),
                frames.name
            ))
        })?;
    let watch = Watch::frames(!args.detector.no_progress, range.len(), true);
    let still = Watch::detection(false, "");
    let mut lines = Lines::default();
    if !args.ask.json {
        Lines::begin()?;
    }
    for frame_ix in range {
        go_on(cancel)?;
        let positions = frames.read(frame_ix)?;
        set_positions(&mut scene, moving, &positions)
            .map_err(|source| frames.refused(frame_ix, source))?;
        let pairs = detect(&mut detector, &scene, &query, cancel, &still)?;
        if args.ask.json {
            let mut times = Times::default();
            times.add(pairs);
            let mut line = Map::new();
            line.insert("frame".into(), frame_ix.into());
            line.extend(json::answer(&scene, &bodies, pairs, &times)?);
            let mut to = out();
            writeln!(to, "{}", Value::Object(line))?;
            to.flush()?;
        } else {
            lines.frame(frame_ix, &bodies, pairs)?;
        }
        watch.frame_done();
    }
    drop(watch);
    if !args.ask.json {
        lines.end()?;
    }
    Ok(())
}

/// The frames of the sequence, welded as the mesh is.
struct Frames {
    sequence: Sequence,
    weld: Option<Weld>,
    name: String,
}

impl Frames {
    fn open(args: &SequenceArgs, weld: Option<Weld>) -> Result<Self, Error> {
        Ok(Frames {
            sequence: Sequence::open(&args.sequence)?,
            weld,
            name: args.sequence.display().to_string(),
        })
    }

    fn read(&self, frame_ix: usize) -> Result<impinge::Positions, Error> {
        let positions = self.sequence.frame(frame_ix)?;
        let positions = match &self.weld {
            None => positions,
            Some(weld) => {
                weld.positions(&positions)
                    .ok_or_else(|| impinge_io::Error::Mismatch {
                        file: self.name.clone(),
                        what: "positions a frame (the mesh, before welding, has as many vertices)"
                            .to_owned(),
                        expected: weld.map().len() as u64,
                        found: positions.len() as u64,
                    })?
            }
        };
        Ok(to_positions(positions))
    }

    fn refused(&self, frame_ix: usize, source: impinge::Error) -> Error {
        Error::Refused {
            what: format!("{}: frame {frame_ix}", self.name),
            source,
        }
    }
}

/// A line a frame for people, and one about all of them.
#[derive(Default)]
struct Lines {
    times: Times,
    /// Fewest and most pairs of a frame.
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
            json::hash(pairs)
        )?;
        to.flush()?;
        self.times.add(pairs);
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
