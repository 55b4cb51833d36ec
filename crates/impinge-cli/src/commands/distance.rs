//! `impinge distance`: the smallest distance between meshes.

use std::io::Write;
use std::time::Instant;

use impinge::{CancelToken, Control, Detector, Query};
use impinge_io::printable;

use crate::args::DistanceArgs;
use crate::detection::{hit, on_cpu, without};
use crate::error::Error;
use crate::load::{Bodies, Loading};
use crate::output::out;
use crate::report;
use crate::text::exactly;

/// `impinge distance`.
pub fn distance(args: &DistanceArgs, cancel: &CancelToken) -> Result<(), Error> {
    let loading = Loading::as_they_are(!args.json, cancel)
        .asked(Some(false), false, args.format)
        .with_bodies(args.bodies)
        .splitting_one();
    let Bodies {
        scene, ids, names, ..
    } = Bodies::read(&args.meshes, loading)?;
    if ids.len() < 2 {
        let text = format!(
            "{}: one body, which has a distance from others only",
            names[0]
        );
        return Err(Error::Usage(text));
    }
    let query = without(Query::between_all(), &args.exclude, &ids)?;
    let start = Instant::now();
    let mut detector = Detector::new(on_cpu(args.threads))?;
    detector.set_control(Control::new().cancel(cancel));
    let nearest = detector.nearest(&scene, &query)?;
    let ms = start.elapsed().as_secs_f64() * 1e3;
    let nearest = nearest.ok_or_else(|| {
        let text = match args.exclude.is_empty() {
            true => "a mesh without elements has no distance",
            false => "no two meshes that have elements and are not excluded, so no distance",
        };
        Error::Usage(text.to_owned())
    })?;
    let (distance, points) = (nearest.distance, nearest.points);
    let elements = [nearest.a.element, nearest.b.element];
    let bodies = [nearest.a.body, nearest.b.body].map(|body| body.index());
    // A distance that was rounded down is less than a number if and only if the true one is.
    let is_below = args.below.map(|limit| distance < limit);
    if args.json {
        report::print(&report::Distance {
            distance,
            below: is_below,
            bodies,
            names: bodies.map(|body| names[body].clone()),
            elements,
            points,
            ms,
        })?;
        return hit(true, is_below == Some(true));
    }
    let mut to = out();
    let than = match (args.below, is_below) {
        (Some(limit), Some(true)) => format!(", less than {}", exactly(limit)),
        (Some(limit), _) => format!(", not less than {}", exactly(limit)),
        _ => String::new(),
    };
    writeln!(to, "distance {}{than}", exactly(distance))?;
    for ((body, element), point) in bodies.into_iter().zip(elements).zip(points) {
        let [x, y, z] = point.map(exactly);
        let name = printable(&names[body]);
        writeln!(to, "element {element} of {name} at {x} {y} {z}")?;
    }
    hit(true, is_below == Some(true))
}
