//! `impinge render`: a picture of one set of meshes.

use std::io::Write;

use impinge::{BodyId, CancelToken};
use impinge_io::printable;

use crate::apart::Inputs;
use crate::args::RenderArgs;
use crate::detection::{asked, detector, hit, query, repeat, settings};
use crate::error::Error;
use crate::load::{Bodies, Loading};
use crate::output::{out, print_details};
use crate::picture::Drawer;
use crate::watch::Watch;
use crate::{headline, regions, report};

/// Draws meshes, and prints what collides.
pub fn render(args: &RenderArgs, cancel: &CancelToken) -> Result<(), Error> {
    let how = &args.detector;
    let path = &args.png.path;
    let is_self = args.within || args.meshes.len() == 1;
    Inputs::new(&args.meshes).check("--png", path)?;
    let Bodies {
        mut scene,
        ids,
        names,
        vertices,
        nouns,
        ..
    } = Bodies::read(&args.meshes, Loading::new(&args.ask, is_self, cancel))?;
    // Of one body there is nothing else to ask.
    let asked = asked((true, args.within || ids.len() == 1), &args.ask);
    let query = query(asked, &args.ask.exclude, &ids)?;
    // The drawer comes before detection: without an adapter there is no picture.
    let threads = settings(how).threads;
    let mut drawer = Drawer::new(&args.picture, how.device.as_deref(), threads)?;
    let mut detector = detector(how)?;
    let watch = Watch::detection(!how.no_progress, "detecting");
    detector.set_control(watch.control(cancel));
    let (pairs, times) = repeat(&mut detector, &mut scene, &query, 1)?;
    let pairs = &pairs;
    drop(watch);

    let bodies: Vec<(BodyId, &str)> = ids
        .into_iter()
        .zip(names.iter().map(String::as_str))
        .collect();
    drawer.write(path, &scene, &bodies, pairs)?;
    let regions = regions::regions(&scene, &bodies, pairs)?;
    let regions = regions.as_deref();
    if args.ask.json {
        let asked = (asked, &scene);
        let found = report::Pairs::new(asked, &bodies, &vertices, pairs, regions, &times)?;
        report::print(&found)?;
    } else {
        let mut to = out();
        headline::write(&mut to, (&scene, &nouns), &bodies, pairs, regions)?;
        if args.ask.verbose {
            print_details(&mut to, &scene, &bodies, pairs, &times)?;
        }
        writeln!(to, "wrote {}", printable(path))?;
        writeln!(to, "{}", asked.line(&vertices, &nouns))?;
    }
    hit(args.ask.fail_on_hit, !pairs.is_empty())
}
