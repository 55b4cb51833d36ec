//! `impinge step`: finds what touches while bodies move from one pose to another, and when.

mod answer;
mod candidates;
mod colors;
mod frames;
mod load;
mod rows;

use std::io::{Write, stderr};

use impinge::{CancelToken, CandidateQuery, Control, Query, Step};
use serde_json::Value;

use crate::apart::Inputs;
use crate::args::StepArgs;
use crate::detection::{Times, detector, without};
use crate::error::Error;
use crate::output::out;
use crate::picture::Drawer;
use crate::values::RowsFile;
use crate::watch::Watch;

use answer::Found;
pub use answer::impact_row;
pub use frames::{Frames, steps_of_sequence};
use load::Moving;

/// `impinge step`.
pub fn step(args: &StepArgs, cancel: &CancelToken) -> Result<(), Error> {
    let inputs = Inputs::new(&args.meshes);
    for (option, path) in args.outputs() {
        inputs.check(option, path)?;
    }
    let rows_on_stdout = args.impacts.as_ref().is_some_and(RowsFile::is_stdout);
    if args.json && rows_on_stdout {
        let text = "--json and --impacts - both write to standard output: give one of them a file";
        return Err(Error::Usage(text.to_owned()));
    }
    if args.json && args.candidates.as_ref().is_some_and(RowsFile::is_stdout) {
        let text =
            "--json and --candidates - both write to standard output: give one of them a file";
        return Err(Error::Usage(text.to_owned()));
    }
    let mut detector = detector(&args.detector)?;
    let mut bodies = Moving::read(args, cancel)?;
    let step = Step::new(query(args, &bodies)?)
        .start(args.how.start.into())
        .toi(args.how.toi.into())
        .separation(args.how.separation)
        .clearance(args.how.clearance);

    let watch = Watch::detection(!args.detector.no_progress, "detecting");
    let report = |progress| watch.report(progress);
    let mut control = Control::new().cancel(cancel);
    if watch.is_shown() {
        control = control.progress(&report);
    }
    if let Some(file) = &args.candidates {
        let query = candidate_query(args, &bodies)?;
        let asked = (&mut detector, &bodies, &query);
        let written = candidates::write(file, asked, &control)?;
        drop(watch);
        if args.json {
            writeln!(out(), "{}", written.json(&bodies, args.distance)?)?;
        } else if file.is_stdout() {
            // If standard error is closed, nobody reads the summary.
            let _ = written.print(&mut stderr());
        } else {
            written.print(&mut out())?;
        }
        return Ok(());
    }
    let mut times = Times::default();
    for _ in 1..args.repeat.get() {
        if args.earliest {
            detector.earliest_with(&bodies.scene, &step, &control)?;
        } else {
            detector.impacts_with(&bodies.scene, &step, &control)?;
        }
        times.add(detector.step_stats());
        bodies.rewrite()?;
    }
    if args.earliest {
        let earliest = detector.earliest_with(&bodies.scene, &step, &control)?;
        let start_intersects = detector.start_intersects();
        drop(watch);
        let found = Found::first(earliest, start_intersects, detector.step_stats(), times);
        print(args, &bodies, &found)?;
        return found.end(args.fail_on_hit);
    }
    let impacts = detector.impacts_with(&bodies.scene, &step, &control)?;
    drop(watch);
    // Files are written first: if one can't be written, no answer is printed that looks like success.
    if let Some(file) = &args.impacts {
        rows::write(file, args.how.toi, impacts)?;
    }
    if let Some(file) = &args.out {
        colors::write(file, &bodies, impacts)?;
    }
    let found = Found::all(impacts, times);
    if rows_on_stdout {
        // If standard error is closed, nobody reads the summary.
        let _ = found.print(&mut stderr(), &bodies, &args.how);
    } else {
        print(args, &bodies, &found)?;
    }
    if let Some(png) = &args.png {
        let surfaces = colors::surfaces(&bodies, impacts)?;
        let device = args.detector.device.as_deref();
        Drawer::new(&args.picture, device, 1)?.draw(&png.0, surfaces)?;
    }
    found.end(args.fail_on_hit)
}

fn query(args: &StepArgs, bodies: &Moving) -> Result<Query, Error> {
    if args.no_self && bodies.ids.len() < 2 {
        return Err(Error::Usage(
            "--no-self leaves nothing to test if there is only one body".to_owned(),
        ));
    }
    let asked = match args.no_self {
        true => Query::all(),
        false => Query::everything(),
    };
    without(asked, &args.ignore, &bodies.ids)
}

fn candidate_query(args: &StepArgs, bodies: &Moving) -> Result<CandidateQuery, Error> {
    let asked = CandidateQuery::new(query(args, bodies)?).distance(args.distance);
    Ok(match args.kinds.is_empty() {
        true => asked,
        false => asked.kinds(args.kinds.iter().map(|&kind| kind.into())),
    })
}

fn print(args: &StepArgs, bodies: &Moving, found: &Found<'_>) -> Result<(), Error> {
    if args.json {
        let object = Value::Object(found.json(bodies, &args.how)?);
        writeln!(out(), "{object}")?;
        return Ok(());
    }
    Ok(found.print(&mut out(), bodies, &args.how)?)
}
