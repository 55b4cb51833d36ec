//! `impinge sequence --ccd`: one line per step from a frame to the next.

use std::io::Write;
use std::ops::Range;

use impinge::{BodyId, Detector, Positions, Query, Scene};

use crate::detection::{Times, hit};
use crate::error::Error;
use crate::origins::Origins;
use crate::output::out;
use crate::report;
use crate::rows::{self, Rows};
use crate::text::{counted, grouped};

use super::answer::Found;

/// How many steps there are, how many of them are free, and how many start with an intersection.
#[derive(Default)]
pub struct Steps {
    n: u64,
    n_free: u64,
    /// Those whose start was asked for intersections.
    n_asked: u64,
    n_intersecting: u64,
    pub times: Times,
}

impl Steps {
    /// The line about all steps.
    pub fn total(&self) -> String {
        let start = match self.n_intersecting {
            0 if self.n_asked < self.n => " if their starts are, which was not asked".to_owned(),
            0 => String::new(),
            n => format!(", {} intersecting at the start", grouped(n)),
        };
        format!(
            "{}, {} free of contact{start}",
            counted(self.n, "step"),
            grouped(self.n_free)
        )
    }

    /// What the program ends with.
    pub fn end(&self, fail_on_hit: bool) -> Result<(), Error> {
        match self.n_intersecting {
            0 => hit(fail_on_hit, self.n_free < self.n),
            _ => Err(Error::StartIntersects),
        }
    }
}

/// Where the steps of a sequence are shown.
pub struct Shown {
    pub json: bool,
    pub text: bool,
    pub rows: Option<Rows>,
}

/// A source of frames.
pub trait Frames {
    /// The positions of a frame.
    fn read(&self, frame_ix: usize) -> Result<Positions, Error>;
    /// The error for a frame that the library refuses.
    fn refused(&self, frame_ix: usize, source: impinge::Error) -> Error;
    /// Whether a frame is the one after the frame before it. If some are missing between, which it
    /// takes note of, there is no step: nobody knows how the mesh moved.
    fn follows(&mut self, frame_ix: usize) -> bool;
    /// Takes note of a frame that was not read or is refused.
    ///
    /// # Errors
    /// The same error, if it is about all frames.
    fn pass_over(&mut self, frame_ix: usize, error: Error) -> Result<(), Error>;
    /// Reads a frame and has `set` take its positions; `None` if that cannot be, and it is passed over.
    fn take(
        &mut self,
        frame_ix: usize,
        set: impl FnOnce(&Positions) -> Result<(), impinge::Error>,
    ) -> Result<Option<Positions>, Error> {
        let taken = self.read(frame_ix).and_then(|positions| {
            set(&positions).map_err(|source| self.refused(frame_ix, source))?;
            Ok(positions)
        });
        match taken {
            Ok(positions) => Ok(Some(positions)),
            Err(error) => self.pass_over(frame_ix, error).map(|()| None),
        }
    }

    /// Says in a line of JSON which frame it is about, and in which file that is, if each has one.
    fn named(&self, frame_ix: usize) -> report::Frame;
}

/// Steps from each frame of a range to the next: the body `moving` and `others` that have frames
/// are in motion, all other bodies at rest.
pub fn steps_of_sequence<F: Frames>(
    (detector, scene, moving, origins): (&mut Detector, &mut Scene, BodyId, &Origins),
    step: &Query,
    (frames, others): (&mut F, &mut [(BodyId, F)]),
    range: Range<usize>,
    mut shown: Shown,
    frame_done: impl Fn(),
) -> Result<Steps, Error> {
    if shown.text {
        writeln!(
            out(),
            "{:>13} {:>11} {:>23} {:>11}  hash",
            "step",
            "impacts",
            "earliest",
            "ms"
        )?;
    }
    let mut steps = Steps::default();
    let mut before = false;
    for end_ix in range {
        let has_before = std::mem::replace(&mut before, false);
        let is_first = !(has_before && frames.follows(end_ix));
        let end = frames.take(end_ix, |end| match is_first {
            true => scene.set_positions(moving, end),
            false => scene.set_end_positions(moving, end),
        })?;
        let Some(end) = end else {
            continue;
        };
        let mut ends = vec![(moving, end)];
        for (body, other) in others.iter_mut() {
            let end = other.take(end_ix, |end| match is_first {
                true => scene.set_positions(*body, end),
                false => scene.set_end_positions(*body, end),
            })?;
            ends.extend(end.map(|end| (*body, end)));
        }
        if ends.len() <= others.len() {
            continue;
        }
        before = true;
        if is_first {
            continue;
        }
        let frame_ix = end_ix - 1;
        let impacts = detector.impacts(scene, step)?;
        let found = Found::all(origins, &impacts, Times::default());
        steps.times.add(impacts.stats());
        steps.n += 1;
        steps.n_free += u64::from(found.is_free());
        let intersects = impacts.start_intersects() == Some(true);
        steps.n_asked += u64::from(impacts.start_intersects().is_some());
        steps.n_intersecting += u64::from(intersects);
        if let Some(rows) = &mut shown.rows {
            let frame = rows::frame(frame_ix);
            rows.put(impacts.iter().map(|found| {
                let [kind, body_a, a, body_b, b, toi] = rows::impact(origins, found);
                [frame, kind, body_a, a, body_b, b, toi]
            }))?;
        }
        if shown.json {
            report::print(&report::SequenceStep {
                frame: frames.named(frame_ix),
                found: found.found(),
                ms: found.ms(),
            })?;
        } else if shown.text {
            let first = impacts.earliest();
            writeln!(
                out(),
                "{:>13} {:>11} {:>23} {:>11.3}  {}",
                format!("{frame_ix} to {}", frame_ix + 1),
                grouped(impacts.len() as u64),
                match first {
                    _ if intersects => "start intersects".to_owned(),
                    None => "free".to_owned(),
                    Some(first) => format!("{:?}", first.toi),
                },
                impacts.stats().total_ms,
                match impacts.is_empty() {
                    true => "-".to_owned(),
                    false => found.hash().unwrap_or_default(),
                }
            )?;
        }
        out().flush()?;
        frame_done();
        for (body, end) in &ends {
            scene.set_positions(*body, end)?;
        }
    }
    if let Some(rows) = shown.rows {
        rows.finish()?;
    }
    Ok(steps)
}
