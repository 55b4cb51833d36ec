//! `impinge step`: finds what touches while bodies move from one pose to another, and when.

mod answer;
mod candidates;
mod frames;
mod load;
mod reached;

use std::io::Write;

use impinge::{BodyId, CancelToken, Precision, SharedVertex};
use impinge_io::impact_columns;
use impinge_render::Least;

use crate::apart::Inputs;
use crate::args::StepArgs;
use crate::asked::{Asked, Question, thicken};
use crate::colors;
use crate::detection::{Times, detector, query};
use crate::error::Error;
use crate::load::Nouns;
use crate::output::say;
use crate::picture::Drawer;
use crate::values::RowsFile;
use crate::watch::Watch;
use crate::{report, rows};

use answer::Found;
pub use frames::{Frames, Shown, steps_of_sequence};
use load::Moving;

/// `impinge step`.
pub fn step(args: &StepArgs, cancel: &CancelToken) -> Result<(), Error> {
    let inputs = Inputs::new(&args.meshes);
    for (option, path) in args.outputs() {
        inputs.check(option, path)?;
    }
    let rows_file = args.rows.file(&inputs, args.json)?;
    let candidates = args.candidates.as_ref();
    let candidates = args
        .rows
        .checked("--candidates", candidates, &inputs, args.json)?;
    let mut detector = detector(&args.detector)?;
    let mut bodies = Moving::read(args, cancel)?;
    thicken(&mut bodies.scene, &bodies.ids, &args.how.thickness)?;
    let asked = asked(args, &bodies)?;
    let step = args.how.of(query(asked, &args.exclude, &bodies.ids)?);

    let watch = Watch::detection(!args.detector.no_progress, "detecting");
    detector.set_control(watch.control(cancel));
    let step = args.rest.leave_out(step, &mut detector, &bodies.scene)?;
    if let Some(file) = &candidates {
        let of_boxes = (args.inflation, &step);
        let written = candidates::write(file, (&mut detector, &bodies), of_boxes)?;
        drop(watch);
        if args.json {
            report::print(&written.report(&bodies, args.inflation, asked)?)?;
            return Ok(());
        }
        let mut text = Vec::new();
        written.print(&mut text)?;
        writeln!(
            text,
            "{}",
            asked.line_of_thick(&bodies.vertices, &Nouns::default(), &args.how.thickness)
        )?;
        return say(&text, Some(file));
    }
    if !args.reached().1.is_empty() {
        reached::check(args.reached(), &bodies)?;
    }
    if !args.truncate.is_empty() {
        // What touches first, and how far each vertex can go: two questions.
        let earliest = detector.earliest(&bodies.scene, &step)?;
        let truncation = detector
            .truncate(&bodies.scene, &step)
            .map_err(|error| bodies.named(error))?;
        drop(watch);
        reached::write(&args.truncate, &bodies, |id| truncation.positions(id))?;
        let found = Found::truncation(&bodies.origins, earliest, &truncation, detector.stats());
        print(args, asked, &bodies, &found, None)?;
        return found.end(args.fail_on_hit);
    }
    if !args.advance.is_empty() {
        let advance = detector
            .advance(&bodies.scene, &step)
            .map_err(|error| bodies.named(error))?;
        drop(watch);
        reached::write(&args.advance, &bodies, |id| advance.positions(id))?;
        let found = Found::advance(&bodies.origins, &advance, detector.stats());
        print(args, asked, &bodies, &found, None)?;
        return found.end(args.fail_on_hit);
    }
    let mut times = Times::default();
    for _ in 1..args.repeat.get() {
        if args.earliest {
            detector.earliest(&bodies.scene, &step)?;
        } else {
            detector.impacts(&bodies.scene, &step)?;
        }
        times.add(detector.stats());
        bodies.rewrite()?;
    }
    if args.earliest {
        let earliest = detector.earliest(&bodies.scene, &step)?;
        let start_intersects = detector.start_intersects();
        drop(watch);
        let found = Found::first(
            &bodies.origins,
            earliest,
            start_intersects,
            detector.stats(),
            times,
        );
        print(args, asked, &bodies, &found, None)?;
        return found.end(args.fail_on_hit);
    }
    let impacts = &detector.impacts(&bodies.scene, &step)?;
    drop(watch);
    // Files are written first: if one can't be written, no answer is printed that looks like
    // success.
    if let Some(file) = &rows_file {
        let columns = impact_columns(args.how.precision == Precision::F64);
        let rows = impacts.iter();
        let rows = rows.map(|impact| rows::impact(&bodies.origins, impact));
        rows::write(file, columns, impacts.len(), rows)?;
    }
    let named = bodies.names.iter().map(|[start, _]| start.as_str());
    let named: Vec<(BodyId, &str)> = bodies.ids.iter().copied().zip(named).collect();
    let shown = impacts.iter().take_while(|_| args.shown.any());
    let shown = shown.map(|impact| (impact.kind, [impact.a, impact.b], impact.toi));
    let firsts = Least::new(&bodies.scene, bodies.ids.iter().copied(), shown)?;
    let color = colors::by_number(&firsts);
    if let Some(file) = &args.shown.out {
        colors::write(file, &bodies.scene, &named, color)?;
    }
    let found = Found::all(&bodies.origins, impacts, times);
    print(args, asked, &bodies, &found, rows_file.as_ref())?;
    if let Some(png) = &args.shown.png {
        let surfaces = colors::surfaces(&bodies.scene, &named, color)?;
        let device = args.detector.device.as_deref();
        Drawer::new(&args.shown.picture, device, 1)?.draw(&png.path, surfaces)?;
    }
    found.end(args.fail_on_hit)
}

fn asked(args: &StepArgs, bodies: &Moving) -> Result<Asked, Error> {
    if args.no_self && bodies.ids.len() < 2 {
        return Err(Error::Usage(
            "--no-self leaves nothing to test if there is only one body".to_owned(),
        ));
    }
    Ok(Asked {
        between: bodies.ids.len() > 1,
        within: !args.no_self && args.between.is_none(),
        only: args.between,
        shared_vertex: SharedVertex::Resolve,
        question: match args.candidates {
            Some(_) => Question::Candidates,
            None => args.how.question(),
        },
        has_self: false,
        excludes: !args.exclude.bodies.is_empty(),
        rings: args.exclude.rings,
        rest: args.rest.distance,
        has_kinds: !args.how.kinds.is_empty(),
    })
}

fn print(
    args: &StepArgs,
    asked: Asked,
    bodies: &Moving,
    found: &Found<'_>,
    rows: Option<&RowsFile>,
) -> Result<(), Error> {
    if args.json {
        report::print(&found.report(bodies, &args.how, asked)?)?;
        return Ok(());
    }
    let mut text = Vec::new();
    found.print(&mut text, bodies, &args.how)?;
    writeln!(
        text,
        "{}",
        asked.line_of_thick(&bodies.vertices, &Nouns::default(), &args.how.thickness)
    )?;
    say(&text, rows)
}
