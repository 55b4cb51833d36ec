//! `impinge sequence --ccd`: one line per step from a frame to the next.

use std::io::Write;
use std::ops::Range;

use impinge::{BodyId, Control, Detector, Positions, Scene, Step};
use serde_json::{Map, Value};

use crate::detection::{Times, set_positions};
use crate::error::Error;
use crate::output::out;
use crate::text::{counted, grouped};

use super::answer::Found;
use super::load::set_end_positions;

/// A source of frames.
pub trait Frames {
    /// The positions of a frame.
    fn read(&self, frame_ix: usize) -> Result<Positions, Error>;
    /// The error for a frame that the library refuses.
    fn refused(&self, frame_ix: usize, source: impinge::Error) -> Error;
}

/// Steps from each frame of a range to the next, the body `moving` in motion and all others at rest. Returns whether all
/// steps are free.
pub fn steps_of_sequence(
    (detector, scene, moving): (&mut Detector, &mut Scene, BodyId),
    step: &Step,
    frames: &impl Frames,
    range: Range<usize>,
    is_json: bool,
    control: &Control<'_>,
    frame_done: impl Fn(),
) -> Result<bool, Error> {
    if !is_json {
        writeln!(
            out(),
            "{:>13} {:>11} {:>23} {:>11}  hash",
            "step",
            "impacts",
            "earliest",
            "ms"
        )?;
    }
    let (mut n_steps, mut n_free) = (0u64, 0u64);
    let mut start = match range.is_empty() {
        true => return Ok(true),
        false => frames.read(range.start)?,
    };
    for frame_ix in range.start..range.end - 1 {
        let end = frames.read(frame_ix + 1)?;
        set_positions(scene, moving, &start).map_err(|source| frames.refused(frame_ix, source))?;
        set_end_positions(scene, moving, &end)
            .map_err(|source| frames.refused(frame_ix + 1, source))?;
        let impacts = detector.impacts_with(scene, step, control)?;
        n_steps += 1;
        n_free += u64::from(impacts.is_empty());
        let found = Found::all(impacts, Times::default());
        if is_json {
            let mut line = Map::new();
            line.insert("frame".into(), frame_ix.into());
            line.extend(found.numbers());
            line.insert("ms".into(), found.ms());
            writeln!(out(), "{}", Value::Object(line))?;
        } else {
            let first = impacts.earliest();
            writeln!(
                out(),
                "{:>13} {:>11} {:>23} {:>11.3}  {:016x}",
                format!("{frame_ix} to {}", frame_ix + 1),
                grouped(impacts.len() as u64),
                first.map_or("free".to_owned(), |first| format!("{:?}", first.toi)),
                impacts.stats().total_ms,
                impacts.hash()
            )?;
        }
        out().flush()?;
        frame_done();
        start = end;
    }
    if !is_json {
        writeln!(
            out(),
            "{}, {} free of contact",
            counted(n_steps, "step"),
            grouped(n_free)
        )?;
    }
    Ok(n_free == n_steps)
}
