//! `impinge near`: which elements of meshes are within a distance of each other.

mod rows;

use std::io::{Write, stderr};

use impinge::{CancelToken, Control, NearPairs, NearQuery, PairKind, Query, SharedVertex};
use serde_json::{Map, Value, json};

use crate::apart::Inputs;
use crate::args::NearArgs;
use crate::asked::Asked;
use crate::detection::{detector, hit, without};
use crate::error::Error;
use crate::headline;
use crate::json::{counters, rounded};
use crate::load::{Bodies, Loading};
use crate::output::out;
use crate::text::{counted, grouped, hex};
use crate::values::RowsFile;
use crate::watch::Watch;

/// `impinge near`.
pub fn near(args: &NearArgs, cancel: &CancelToken) -> Result<(), Error> {
    let inputs = Inputs::new(&args.meshes);
    if let Some((option, path)) = args.output() {
        inputs.check(option, path)?;
    }
    let rows_file = args.rows();
    let rows_on_stdout = rows_file.as_ref().is_some_and(RowsFile::is_stdout);
    if args.json && rows_on_stdout {
        let text = "--json and --pairs - both write to standard output: give one of them a file";
        return Err(Error::Usage(text.to_owned()));
    }
    let is_self = args.within || args.meshes.len() == 1;
    let read = &args.read;
    let loading = Loading::as_they_are(!args.json, cancel).asked(read.weld(), is_self, read.format);
    let loading = loading.of_bodies(read.bodies);
    let bodies = Bodies::read(&args.meshes, loading)?;
    let mut detector = detector(&args.detector)?;
    let asked = query(args, &bodies)?;
    let mut query = NearQuery::new(asked.clone()).distance(args.distance);
    if !args.kinds.is_empty() {
        query = query.kinds(args.kinds.iter().copied().map(PairKind::from));
    }
    if rows_file.is_some() {
        query = query.closest_points();
    }

    let watch = Watch::detection(!args.detector.no_progress, "detecting");
    let report = |progress| watch.report(progress);
    let mut control = Control::new().cancel(cancel);
    if watch.is_shown() {
        control = control.progress(&report);
    }
    detector.within_distance_with(&bodies.scene, &query, &control)?;
    let near = &detector.take_near();
    // Faces with the same three vertices have no near pair, and neither has a body inside tetrahedra.
    let meets = near.of(PairKind::EdgeFace).len() > 0;
    let intersects = meets || {
        let resolved = asked.shared_vertex(SharedVertex::Resolve);
        detector.any_with(&bodies.scene, &resolved, &control)?
    };
    drop(watch);
    // Files are written first: if one can't be written, no answer is printed that looks like success.
    if let Some(file) = &rows_file {
        rows::write(file, near)?;
    }
    if args.json {
        let object = Value::Object(answer(args, &bodies, near, intersects)?);
        writeln!(out(), "{object}")?;
    } else if rows_on_stdout {
        print(&mut stderr(), args, &bodies, near, intersects)?;
    } else {
        print(&mut out(), args, &bodies, near, intersects)?;
    }
    hit(args.fail_on_hit, !near.is_empty() || intersects)
}

fn query(args: &NearArgs, bodies: &Bodies) -> Result<Query, Error> {
    let asked = match (bodies.ids.len(), args.within) {
        (1, _) => Query::all_within(),
        (_, true) => Query::everything(),
        (_, false) => Query::all(),
    };
    without(asked, &args.ignore, &bodies.ids)
}

/// The object that `docs/near.schema.json` describes.
fn answer(
    args: &NearArgs,
    bodies: &Bodies,
    near: &NearPairs,
    intersects: bool,
) -> Result<Map<String, Value>, Error> {
    let described: Vec<Value> = (0..bodies.ids.len())
        .map(|ix| {
            let body = bodies.scene.body(bodies.ids[ix])?;
            Ok(json!({
                "name": bodies.names[ix],
                "kind": body.kind().name(),
                "primitives": body.n_primitives(),
                "vertices": body.n_vertices(),
                "welded": bodies.vertices[ix].n_welded,
                "coincident": bodies.vertices[ix].n_coincident,
            }))
        })
        .collect::<Result<_, impinge::Error>>()?;
    let kinds: Map<String, Value> = PairKind::ALL
        .into_iter()
        .map(|kind| (kind.name().to_owned(), near.of(kind).len().into()))
        .collect();
    let stats = near.stats();
    let stages: Map<String, Value> = stats
        .stages
        .iter()
        .map(|stage| (stage.name.to_owned(), rounded(stage.ms).into()))
        .collect();
    let mut object = Map::new();
    object.insert("distance".into(), args.distance.into());
    object.insert("pairs".into(), near.len().into());
    object.insert("kinds".into(), kinds.into());
    object.insert("intersects".into(), intersects.into());
    object.insert("hash".into(), hex(near.hash()).into());
    object.insert("backend".into(), stats.backend.as_str().into());
    object.insert("method".into(), stats.method.into());
    object.insert("bodies".into(), described.into());
    object.insert(
        "ms".into(),
        json!({ "total": rounded(stats.total_ms), "stages": stages }),
    );
    object.insert("stats".into(), counters(stats));
    Ok(object)
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
    let distance = args.distance;
    if near.is_empty() {
        writeln!(to, "{subject}: no pairs of elements within {distance}")?;
    } else {
        let counts: Vec<String> = PairKind::ALL
            .into_iter()
            .map(|kind| (kind, near.of(kind).len()))
            .filter(|&(_, n)| n > 0)
            .map(|(kind, n)| format!("{} {}", grouped(n as u64), kind.name()))
            .collect();
        writeln!(
            to,
            "{subject}: {} of elements within {distance} ({}), hash {}",
            counted(near.len() as u64, "pair"),
            counts.join(", "),
            hex(near.hash())
        )?;
    }
    let command = match (bodies.ids.len(), args.within) {
        (1, _) => "self",
        (_, true) => "pairs --self",
        (_, false) => "pairs",
    };
    match intersects {
        true => writeln!(
            to,
            "they intersect, neighbours resolved: `impinge {command}` shows where"
        )?,
        false => writeln!(to, "nothing intersects, neighbours resolved")?,
    }
    let stats = near.stats();
    writeln!(
        to,
        "{} on {}, {}; {}, {} unsure; {:.3} ms",
        stats.method,
        stats.backend,
        counted(stats.n_threads as u64, "thread"),
        counted(stats.n_candidates, "candidate"),
        grouped(stats.n_unsure),
        stats.total_ms
    )?;
    let asked = Asked {
        between: true,
        within: args.within || bodies.ids.len() == 1,
        shared_vertex: SharedVertex::Skip,
        ignores: !args.ignore.is_empty(),
    };
    writeln!(to, "{}", asked.line(&bodies.vertices, &bodies.nouns))?;
    Ok(())
}
