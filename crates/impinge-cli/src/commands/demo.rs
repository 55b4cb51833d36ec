//! `impinge demo`: a built-in scene, its pairs and times.

use std::fs::create_dir_all;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use impinge::{BodyId, CancelToken, Control, Detector, Method, Pairs, Query, Scene};

use impinge_io::printable;

use crate::args::{DemoArgs, PictureArgs};
use crate::commands::demo_scene::DemoScene;
use crate::detection::{Times, detector, settings};
use crate::error::Error;
use crate::meshes;
use crate::output::{body_table, out, stage_table, table};
use crate::picture::Drawer;
use crate::text::{counted, grouped};
use crate::watch::{Watch, go_on};

/// The approximate number of triangles for the oracle, which is quadratic in them: it takes a
/// second at most.
const SAMPLE: usize = 16_000;

/// `impinge demo`.
pub fn demo(args: &DemoArgs, cancel: &CancelToken) -> Result<(), Error> {
    let mut detector = detector(&args.detector)?;
    let mut demo = DemoScene::new(args.triangles as usize)?;
    let query = Query::all();
    writeln!(
        out(),
        "{} deforming bodies, {} triangles, {}: pairs between bodies and within each",
        demo.bodies().len(),
        grouped(demo.n_triangles() as u64),
        counted(u64::from(args.frames), "frame")
    )?;

    let mut found = Found::new(demo.bodies().len());
    let mut moving = Duration::ZERO;
    let watch = Watch::frames(!args.detector.no_progress, args.frames as usize, false);
    detector.set_control(Control::new().cancel(cancel));
    for frame in 0..args.frames {
        go_on(cancel)?;
        let started = Instant::now();
        demo.pose(frame, args.frames)?;
        moving += started.elapsed();
        let pairs = detector.detect(demo.scene(), &query)?;
        found.add(&demo.bodies(), &pairs);
        watch.frame_done();
    }
    drop(watch);
    found.print(&demo.bodies(), moving)?;

    let fullest = found.fullest();
    demo.pose(fullest, args.frames)?;
    let bodies = demo.bodies();
    let pairs = detector.detect(demo.scene(), &query)?;
    writeln!(
        out(),
        "\nframe {fullest} has the most pairs:\n{}\n",
        body_table(demo.scene(), &bodies, &pairs)?
    )?;
    check(args, &demo, fullest, &pairs, cancel)?;

    let png = match &args.png {
        Some(file) => file.path.clone(),
        None => args.out.path.with_extension("png"),
    };
    for folder in [&args.out.path, &png]
        .into_iter()
        .filter_map(|file| file.parent())
    {
        make_folder(folder)?;
    }
    meshes::write(&args.out, demo.scene(), &bodies, &pairs)?;
    let picture = PictureArgs::default();
    let threads = args.detector.threads.map_or(0, Into::into);
    let mut drawer = Drawer::new(&picture, args.detector.device.as_deref(), threads)?;
    drawer.write(&png, demo.scene(), &bodies, &pairs)?;
    writeln!(
        out(),
        "wrote {}, a mesh, and {}, its picture: colliding triangles red (worm), blue (knot), green (ball)",
        printable(&args.out.path),
        printable(&png)
    )?;
    writeln!(
        out(),
        "Look at {}, then ask about meshes of your own: impinge pairs a.obj b.obj",
        printable(&png)
    )?;
    Ok(())
}

/// Finds the pairs of a sample of the triangles by another method, and compares the sets.
fn check(
    args: &DemoArgs,
    demo: &DemoScene,
    frame: u32,
    pairs: &Pairs,
    cancel: &CancelToken,
) -> Result<(), Error> {
    let told = settings(&args.detector);
    let reference = match told.method {
        Method::Naive => Method::Clusters,
        _ => Method::Naive,
    };
    let sample = Sample::new(demo, pairs)?;
    let mut detector = Detector::new(told.method(reference).memory_budget(None))?;
    let watch = Watch::detection(!args.detector.no_progress, "checking");
    let query = Query::all();
    detector.set_control(watch.control(cancel));
    let expected = detector.detect(&sample.scene, &query)?;
    drop(watch);
    let rows: Vec<[u32; 4]> = expected.rows().collect();
    if rows != sample.rows {
        return Err(Error::Disagreement {
            frame,
            method: pairs.stats().method,
            n_found: sample.rows.len(),
            reference: reference.name(),
            n_expected: rows.len(),
        });
    }
    let by = match reference {
        Method::Naive => "naive (every box against every box)",
        _ => reference.name(),
    };
    let n_pairs = counted(rows.len() as u64, "pair");
    let ms = expected.stats().total_ms;
    match sample.n_triangles == demo.n_triangles() {
        true => writeln!(
            out(),
            "checked: {by} finds the same {n_pairs} in {ms:.0} ms"
        )?,
        false => writeln!(
            out(),
            "checked on a sample: {} of the triangles have {n_pairs} among themselves, and {by} finds the same ones in \
             {ms:.0} ms",
            grouped(sample.n_triangles as u64)
        )?,
    }
    Ok(())
}

/// Some of the triangles as a scene of its own, and the pairs found among these triangles.
struct Sample {
    scene: Scene,
    n_triangles: usize,
    rows: Vec<[u32; 4]>,
}

impl Sample {
    fn new(demo: &DemoScene, pairs: &Pairs) -> Result<Self, Error> {
        let n_all = demo.n_triangles();
        let mut scene = Scene::new();
        let mut n_triangles = 0;
        // For each triangle of each body, its number in the sample, if it is in the sample.
        let mut numbers: Vec<Vec<Option<u32>>> = Vec::new();
        for (id, _) in demo.bodies() {
            let body = demo.scene().body(id)?;
            let n = body.n_elements();
            let mut is_in = vec![n_all <= SAMPLE; n];
            if n_all > SAMPLE {
                // Half of this body's share are colliding triangles, half are any triangles, both
                // spread evenly.
                let most = (SAMPLE as u128 * n as u128 / n_all as u128) as usize / 2;
                let colliding = pairs.colliding(id);
                for (most, candidates) in [(most, colliding), (most, (0..).take(n).collect())] {
                    let step = candidates.len().div_ceil(most.max(1)).max(1);
                    for &ix in candidates.iter().step_by(step) {
                        is_in[ix as usize] = true;
                    }
                }
            }
            let mut faces = Vec::new();
            let numbered = is_in.iter().enumerate().map(|(ix, &is_in)| {
                is_in.then(|| {
                    let corners = body.elements().corners(ix);
                    faces.push([corners[0], corners[1], corners[2]]);
                    faces.len() as u32 - 1
                })
            });
            numbers.push(numbered.collect());
            n_triangles += faces.len();
            scene.add((faces, body.positions().clone()))?;
        }
        let in_sample = |body: u32, element: u32| numbers[body as usize][element as usize];
        let rows = pairs.rows().filter_map(|[body_a, a, body_b, b]| {
            Some([body_a, in_sample(body_a, a)?, body_b, in_sample(body_b, b)?])
        });
        Ok(Sample {
            rows: rows.collect(),
            scene,
            n_triangles,
        })
    }
}

fn make_folder(folder: &Path) -> Result<(), Error> {
    create_dir_all(folder).map_err(|source| Error::Write {
        path: folder.to_owned(),
        source,
    })
}

/// Stats over the frames.
#[derive(Default)]
struct Found {
    times: Times,
    meetings: Vec<Meeting>,
    /// Pairs of each frame.
    n_pairs: Vec<usize>,
}

/// Pairs of two bodies, or of one body with itself, over all frames.
struct Meeting {
    a_ix: usize,
    b_ix: usize,
    /// Pairs in the frame with the most pairs.
    most: usize,
    /// Frames with any pairs.
    n_frames: usize,
}

impl Found {
    fn new(n_bodies: usize) -> Self {
        let meetings = (0..n_bodies)
            .flat_map(|a_ix| (a_ix..n_bodies).map(move |b_ix| (a_ix, b_ix)))
            .map(|(a_ix, b_ix)| Meeting {
                a_ix,
                b_ix,
                most: 0,
                n_frames: 0,
            })
            .collect();
        Found {
            meetings,
            ..Found::default()
        }
    }

    fn add(&mut self, bodies: &[(BodyId, &str)], pairs: &Pairs) {
        self.times.add(pairs.stats());
        self.n_pairs.push(pairs.len());
        for meeting in &mut self.meetings {
            let (a, b) = (bodies[meeting.a_ix].0, bodies[meeting.b_ix].0);
            let n = if a == b {
                pairs.self_of(a).count()
            } else {
                pairs.between(a, b).count()
            };
            meeting.most = meeting.most.max(n);
            meeting.n_frames += usize::from(n > 0);
        }
    }

    /// The first of the frames with the most pairs.
    fn fullest(&self) -> u32 {
        let most = self.n_pairs.iter().max();
        (0u32..)
            .zip(&self.n_pairs)
            .find(|&(_, n)| Some(n) == most)
            .map_or(0, |(frame, _)| frame)
    }

    fn print(&self, bodies: &[(BodyId, &str)], moving: Duration) -> Result<(), Error> {
        let rows = self.meetings.iter().map(|meeting| {
            let (a, b) = (bodies[meeting.a_ix].1, bodies[meeting.b_ix].1);
            let what = if a == b {
                format!("{a} with itself")
            } else {
                format!("{a} and {b}")
            };
            vec![
                what,
                grouped(meeting.n_frames as u64),
                grouped(meeting.most as u64),
            ]
        });
        let mut to = out();
        let header = ["bodies", "in frames", "most pairs"];
        writeln!(to, "\n{}\n", table(&header, &[0], rows))?;
        writeln!(to, "{}\n", stage_table(&self.times))?;
        let n_pairs = |n: Option<&usize>| grouped(n.map_or(0, |&n| n as u64));
        writeln!(
            to,
            "{} to {} pairs per frame, {} in all",
            n_pairs(self.n_pairs.iter().min()),
            n_pairs(self.n_pairs.iter().max()),
            grouped(self.n_pairs.iter().map(|&n| n as u64).sum())
        )?;
        let median = self.times.total_ms(50);
        writeln!(
            to,
            "{:.0} frames per second: median {median:.3} ms, 95 % within {:.3} ms, longest {:.3} ms",
            1e3 / median.max(f64::MIN_POSITIVE),
            self.times.total_ms(95),
            self.times.total_ms(100)
        )?;
        writeln!(
            to,
            "(moving the vertices takes another {:.3} ms per frame)",
            moving.as_secs_f64() * 1e3 / self.n_pairs.len().max(1) as f64
        )?;
        Ok(())
    }
}
