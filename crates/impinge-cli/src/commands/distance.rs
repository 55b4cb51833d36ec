//! `impinge distance`: the smallest distance between two meshes.

use std::io::Write;
use std::time::Instant;

use impinge::{CancelToken, Control, Detector};
use impinge_io::printable;
use serde_json::json;

use crate::args::DistanceArgs;
use crate::detection::{hit, on_cpu};
use crate::error::Error;
use crate::load::{Bodies, Loading};
use crate::output::out;

/// `impinge distance`.
pub fn distance(args: &DistanceArgs, cancel: &CancelToken) -> Result<(), Error> {
    let loading = Loading::as_they_are(!args.json, cancel);
    let paths = [args.a.clone(), args.b.clone()];
    let Bodies {
        scene, ids, names, ..
    } = Bodies::read(&paths, loading)?;
    let start = Instant::now();
    let mut detector = Detector::new(on_cpu(args.threads))?;
    detector.set_control(Control::new().cancel(cancel));
    let nearest = detector.distance(&scene, ids[0], ids[1])?;
    let ms = start.elapsed().as_secs_f64() * 1e3;
    let nearest = nearest
        .ok_or_else(|| Error::Usage("a mesh without elements has no distance".to_owned()))?;
    let (distance, points) = (nearest.distance, nearest.points);
    let [a, b] = [nearest.a.element, nearest.b.element];
    // A distance that was rounded down is less than a number if and only if the true one is.
    let is_below = args.below.map(|limit| distance < limit);
    let mut to = out();
    if args.json {
        let object = json!({
            "distance": distance,
            "below": is_below,
            "elements": [a, b],
            "points": points,
            "ms": ms,
        });
        writeln!(to, "{object}")?;
        return hit(true, is_below == Some(true));
    }
    let than = match (args.below, is_below) {
        (Some(limit), Some(true)) => format!(", less than {limit}"),
        (Some(limit), _) => format!(", not less than {limit}"),
        _ => String::new(),
    };
    writeln!(to, "distance {distance}{than}")?;
    for (side, element) in [a, b].into_iter().enumerate() {
        let name = printable(&names[side]);
        let [x, y, z] = points[side];
        writeln!(to, "element {element} of {name} at {x} {y} {z}")?;
    }
    hit(true, is_below == Some(true))
}
