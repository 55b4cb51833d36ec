//! `impinge near`: which elements of meshes are within a distance of each other.

use std::io::Write;

use impinge::{BodyId, CancelToken, Element, NearPair, NearPairs, PairKind};
use impinge_render::Least;

use crate::apart::Inputs;
use crate::args::NearArgs;
use crate::asked::{Asked, Question, kept, thicken};
use crate::colors;
use crate::detection::{Times, asked, detector, hit, of_kinds, query};
use crate::error::Error;
use crate::load::{Bodies, Loading};
use crate::output::{say, stage_table};
use crate::picture::Drawer;
use crate::text::{self, counted, hex};
use crate::watch::Watch;
use crate::{headline, output, report, rows};

/// `impinge near`.
pub fn near(args: &NearArgs, cancel: &CancelToken) -> Result<(), Error> {
    let ask = &args.ask;
    let inputs = Inputs::new(&args.meshes);
    for (option, path) in args.shown.outputs() {
        inputs.check(option, path)?;
    }
    let rows_file = args.rows.file(&inputs, ask.json)?;
    let is_self = args.within || args.meshes.len() == 1;
    let mut bodies = Bodies::read(&args.meshes, Loading::new(ask, is_self, cancel))?;
    thicken(&mut bodies.scene, &bodies.ids, &args.thickness)?;
    let mut detector = detector(&args.detector)?;
    let asked = Asked {
        only: args.between,
        question: Question::Near,
        has_kinds: !args.kinds.is_empty(),
        ..asked((true, args.within || bodies.ids.len() == 1), ask)
    };
    let intersect = query(asked, &ask.exclude, &bodies.ids)?;
    let mut query = of_kinds(intersect.clone(), &args.kinds);
    let is_shown = args.shown.any();
    if rows_file.is_some() {
        query = query.closest_points();
    } else if is_shown {
        query = query.distances();
    }

    let watch = Watch::detection(!args.detector.no_progress, "detecting");
    detector.set_control(watch.control(cancel));
    let near = &detector.near(&bodies.scene, args.distance, &query)?;
    // Faces with the same three vertices have no near pair, and neither has a body inside
    // tetrahedra.
    let meets = near.of(PairKind::EdgeFace).len() > 0;
    let intersects = meets || { detector.any(&bodies.scene, &intersect)? };
    drop(watch);
    // Files are written first: if one can't be written, no answer is printed that looks like
    // success.
    if let Some(file) = &rows_file {
        rows::write_near(file, &bodies.origins, near)?;
    }
    let named = bodies.names.iter().map(String::as_str);
    let named: Vec<(BodyId, &str)> = bodies.ids.iter().copied().zip(named).collect();
    let shown = near.iter().take_while(|_| is_shown);
    let shown = shown.map(|pair| numbered(&pair, args.distance));
    let shares = Least::new(&bodies.scene, bodies.ids.iter().copied(), shown)?;
    let color = colors::by_number(&shares);
    if let Some(file) = &args.shown.out {
        colors::write(file, &bodies.scene, &named, color)?;
    }
    if ask.json {
        report::print(&answer(args, asked, &bodies, near, intersects)?)?;
    } else {
        let mut text = Vec::new();
        print(&mut text, args, &bodies, near, intersects)?;
        writeln!(
            text,
            "{}",
            asked.line_of_thick(&bodies.vertices, &bodies.nouns, &args.thickness)
        )?;
        say(&text, rows_file.as_ref())?;
    }
    if let Some(png) = &args.shown.png {
        let surfaces = colors::surfaces(&bodies.scene, &named, color)?;
        let device = args.detector.device.as_deref();
        Drawer::new(&args.shown.picture, device, 1)?.draw(&png.path, surfaces)?;
    }
    hit(ask.fail_on_hit, !near.is_empty() || intersects)
}

/// A pair, and its share of the distance that was asked for. With thickness it may be farther.
fn numbered(pair: &NearPair, most: f64) -> (PairKind, [Element; 2], f64) {
    let distance = pair.distance.unwrap_or(0.0);
    let share = if distance > 0.0 {
        (distance / most).min(1.0)
    } else {
        0.0
    };
    (pair.kind, [pair.a, pair.b], share)
}

fn answer(
    args: &NearArgs,
    asked: Asked,
    bodies: &Bodies,
    near: &NearPairs,
    intersects: bool,
) -> Result<report::Near, Error> {
    let Bodies {
        scene,
        ids,
        names,
        vertices,
        ..
    } = bodies;
    let described =
        (0..ids.len()).map(|ix| report::ThickBody::new(scene, ids[ix], &names[ix], &vertices[ix]));
    let times = Times::default().and(near.stats());
    Ok(report::Near {
        distance: args.distance,
        asked: report::Asked::new(asked),
        pairs: near.len(),
        kinds: report::Kinds::new(|kind| near.of(kind).len() as u64),
        intersects,
        hash: hex(bodies.origins.hash_of_near(near)),
        bodies: described.collect::<Result<_, _>>()?,
        how: report::How::new(near.stats(), report::Stages::new(&times)),
    })
}

fn counts(near: &NearPairs) -> [(PairKind, u64); PairKind::ALL.len()] {
    PairKind::ALL.map(|kind| (kind, near.of(kind).len() as u64))
}

/// The answer in the first line, then counts.
fn print(
    to: &mut impl Write,
    args: &NearArgs,
    bodies: &Bodies,
    near: &NearPairs,
    intersects: bool,
) -> Result<(), Error> {
    let subject = headline::subject(&bodies.nouns, &bodies.names);
    let distance = kept(&bodies.scene, args.distance).unwrap_or_else(|| "0".to_owned());
    if near.is_empty() {
        writeln!(to, "{subject}: no pairs of elements within {distance}")?;
    } else {
        writeln!(
            to,
            "{subject}: {} of elements within {distance} ({}), hash {}",
            counted(near.len() as u64, "pair"),
            text::kinds(counts(near)),
            hex(bodies.origins.hash_of_near(near))
        )?;
    }
    let command = match (bodies.ids.len(), args.within) {
        (1, _) => "self",
        (_, true) => "pairs --self",
        (_, false) => "pairs",
    };
    match intersects {
        true => writeln!(to, "they intersect: `impinge {command}` shows where")?,
        false => writeln!(to, "nothing intersects")?,
    }
    let times = Times::default().and(near.stats());
    if args.ask.verbose {
        writeln!(to, "\n{}\n", stage_table(&times))?;
    }
    writeln!(to, "{}", output::how(near.stats(), &times))?;
    Ok(())
}
