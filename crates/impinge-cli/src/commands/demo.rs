//! `impinge demo`: a built-in scene, what is found in it, and how fast.

use std::fs::create_dir_all;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

use impinge::{BodyId, CancelToken, Detector, Method, Pairs, Query, Scene, Settings};

use crate::args::DemoArgs;
use crate::commands::demo_scene::DemoScene;
use crate::detection::{Times, detect, detector, settings};
use crate::error::Error;
use crate::meshes;
use crate::output::{body_table, counted, grouped, out, stage_table, table};
use crate::watch::{Watch, go_on};

/// The most triangles for which the oracle, quadratic in them, is asked; the grid beyond that.
const ORACLE_LIMIT: usize = 150_000;

/// `impinge demo`.
pub fn demo(args: &DemoArgs, cancel: &CancelToken) -> Result<(), Error> {
    let mut detector = detector(&args.detector)?;
    let mut demo = DemoScene::new(args.triangles as usize)?;
    let query = Query::everything();
    writeln!(
        out(),
        "{} deforming bodies, {} triangles, {}: pairs between bodies and within each",
        demo.bodies().len(),
        grouped(demo.n_triangles() as u64),
        counted(u64::from(args.frames), "frame")
    )?;

    let mut found = Found::default();
    let started = Instant::now();
    let watch = Watch::frames(!args.detector.no_progress, args.frames as usize, false);
    let still = Watch::detection(false, "");
    for frame in 0..args.frames {
        go_on(cancel)?;
        demo.pose(frame, args.frames)?;
        let bodies: Vec<BodyId> = demo.bodies().into_iter().map(|(id, _)| id).collect();
        found.add(frame, &bodies, detect(&mut detector, demo.scene(), &query, cancel, &still)?);
        watch.frame_done();
    }
    drop(watch);
    let seconds = started.elapsed().as_secs_f64();
    found.print(&demo.bodies(), seconds)?;

    demo.pose(found.fullest, args.frames)?;
    let bodies = demo.bodies();
    let pairs = detect(&mut detector, demo.scene(), &query, cancel, &still)?;
    writeln!(
        out(),
        "\nframe {} has the most pairs:\n{}\n",
        found.fullest,
        body_table(demo.scene(), &bodies, pairs)?
    )?;
    let reference = if demo.n_triangles() <= ORACLE_LIMIT {
        Method::Naive
    } else {
        Method::Cells
    };
    let told = Settings {
        method: reference,
        ..settings(&args.detector)
    };
    let watch = Watch::detection(!args.detector.no_progress, "checking");
    let seconds = check(told, demo.scene(), &query, found.fullest, pairs, cancel, &watch)?;
    drop(watch);
    writeln!(
        out(),
        "checked: the same {} by {} ({}), found in {seconds:.1} s",
        counted(pairs.len() as u64, "pair"),
        reference.name(),
        match reference {
            Method::Naive => "every box against every box, then the exact test",
            _ => "the two-level grid",
        }
    )?;

    if let Some(folder) = args.out.path.parent() {
        make_folder(folder)?;
    }
    meshes::write(&args.out, demo.scene(), &bodies, pairs)?;
    writeln!(
        out(),
        "wrote {}: colliding triangles red (worm), blue (knot), green (ball)",
        args.out.path.display()
    )?;
    Ok(())
}

/// Finds the same frame by another method and compares the sets; tells how many seconds it took.
fn check(
    reference: Settings,
    scene: &Scene,
    query: &Query,
    frame: u32,
    pairs: &Pairs,
    cancel: &CancelToken,
    watch: &Watch,
) -> Result<f64, Error> {
    let mut detector = Detector::with_settings(reference)?;
    let expected = detect(&mut detector, scene, query, cancel, watch)?;
    if !pairs.same_as(expected) {
        return Err(Error::Disagreement {
            frame,
            method: pairs.stats().method,
            n_found: pairs.len(),
            reference: expected.stats().method,
            n_expected: expected.len(),
        });
    }
    Ok(expected.stats().total_ms / 1e3)
}

fn make_folder(folder: &Path) -> Result<(), Error> {
    create_dir_all(folder).map_err(|source| Error::Write {
        path: folder.to_owned(),
        source,
    })
}

/// What the frames held.
#[derive(Default)]
struct Found {
    times: Times,
    /// Pairs of each two bodies and of each one, by their index among the bodies: fewest, most.
    kinds: Vec<(usize, usize, usize, usize)>,
    n_pairs_in_all: u64,
    /// The first frame with the most pairs, and their number.
    fullest: u32,
    most: usize,
}

impl Found {
    fn add(&mut self, frame: u32, bodies: &[BodyId], pairs: &Pairs) {
        self.times.add(pairs);
        self.n_pairs_in_all += pairs.len() as u64;
        if pairs.len() > self.most {
            (self.fullest, self.most) = (frame, pairs.len());
        }
        if self.kinds.is_empty() {
            self.kinds = (0..bodies.len())
                .flat_map(|a| (a..bodies.len()).map(move |b| (a, b, usize::MAX, 0)))
                .collect();
        }
        for (a, b, least, most) in &mut self.kinds {
            let n = match (bodies[*a], bodies[*b]) {
                (a, b) if a == b => pairs.within(a).count(),
                (a, b) => pairs.between(a, b).count(),
            };
            *least = n.min(*least);
            *most = n.max(*most);
        }
    }

    fn print(&self, bodies: &[(BodyId, &str)], seconds: f64) -> Result<(), Error> {
        let mut to = out();
        let rows = self.kinds.iter().map(|&(a, b, least, most)| {
            let what = if a == b {
                format!("{} with itself", bodies[a].1)
            } else {
                format!("{} and {}", bodies[a].1, bodies[b].1)
            };
            vec![what, grouped(least as u64), grouped(most as u64)]
        });
        writeln!(to, "\n{}", table(&["pairs", "fewest", "most"], &[0], rows))?;
        writeln!(to, "{} found in all\n", counted(self.n_pairs_in_all, "pair"))?;
        writeln!(to, "{}\n", stage_table(&self.times))?;
        let median = self.times.total_ms(50);
        writeln!(
            to,
            "a frame: median {median:.3} ms, 95 % within {:.3} ms, longest {:.3} ms: {:.0} frames a second",
            self.times.total_ms(95),
            self.times.total_ms(100),
            1e3 / median.max(1e-6)
        )?;
        writeln!(
            to,
            "({seconds:.1} s in all, most of them to move the vertices)"
        )?;
        Ok(())
    }
}
