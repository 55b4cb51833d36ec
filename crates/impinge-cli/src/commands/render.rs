//! `impinge render`: a picture of one set of meshes.

use std::io::Write;

use impinge::{BodyId, CancelToken, Query};
use serde_json::Value;

use crate::args::RenderArgs;
use crate::detection::{detector, query, repeat};
use crate::error::Error;
use crate::load::{Bodies, Loading};
use crate::output::{body_table, counted, out};
use crate::watch::Watch;
use crate::{apart, json, picture};

/// Draws meshes, and says what collides in them.
pub fn render(args: &RenderArgs, cancel: &CancelToken) -> Result<(), Error> {
    let how = &args.detector;
    apart::check([("--png", args.png.0.as_path())], &args.meshes)?;
    let mut detector = detector(how)?;
    let loading = Loading {
        weld: args.ask.weld,
        notes: !args.ask.json,
        cancel,
    };
    let Bodies {
        mut scene,
        ids,
        names,
    } = Bodies::read(&args.meshes, loading)?;
    let asked = if args.within {
        Query::everything()
    } else {
        Query::all()
    };
    let query = query(asked, &args.ask, &ids)?;
    let watch = Watch::detection(!how.no_progress, "detecting");
    let (pairs, times) = repeat(&mut detector, &mut scene, &query, 1, cancel, &watch)?;
    drop(watch);

    let bodies: Vec<(BodyId, &str)> = ids
        .into_iter()
        .zip(names.iter().map(String::as_str))
        .collect();
    let path = &args.png.0;
    let device = how.device.as_deref();
    picture::write(path, &args.picture, device, &scene, &bodies, pairs)?;
    if args.ask.json {
        let object = Value::Object(json::answer(&scene, &bodies, pairs, &times)?);
        writeln!(out(), "{object}")?;
    } else {
        let mut to = out();
        writeln!(to, "{}\n", body_table(&scene, &bodies, pairs)?)?;
        let n_pairs = counted(pairs.len() as u64, "pair");
        writeln!(to, "wrote {}: {n_pairs}", path.display())?;
    }
    Ok(())
}
