//! The smallest distance of two bodies, beside parry's `query::distance` of two `TriMesh`es.
//! (`bench/near.py` has the peers with Python modules.)
//!
//! Two scans, with their boxes three gaps apart. *Moved*: positions alternate between a pose and
//! its mirror image, whose distance is the same, and are handed over on the clock; parry builds its
//! meshes anew, for it cannot change the vertices of one. *Still*: the same question again. All
//! distances must agree to single precision.

use std::time::Instant;

use impinge::{Detector, Scene, Settings};
use serde_json::json;

use crate::report::{Report, figures};
use crate::{Failure, Options, surfaces};

/// A scan: positions of unit size, and faces.
type Scan = (Vec<[f32; 3]>, Vec<[u32; 3]>);

const PAIRS: [[&str; 2]; 2] = [["dragon", "dragon"], ["bunny", "buddha"]];
const GAPS: [f32; 3] = [0.3, 0.03, 0.0];

/// Answers the question about two bodies.
trait Contestant {
    fn name(&self) -> &'static str;
    /// Takes over the positions of both bodies.
    fn take(&mut self, positions: [&[[f32; 3]]; 2]) -> Result<(), Failure>;
    fn distance(&mut self) -> Result<f64, Failure>;
}

struct Ours {
    scene: Scene,
    bodies: Vec<impinge::BodyId>,
    detector: Detector,
}

impl Ours {
    fn new(scans: [&Scan; 2], options: &Options) -> Result<Self, Failure> {
        let mut scene = Scene::new();
        let add = |(positions, faces): &Scan| scene.add((faces.clone(), positions.clone()));
        Ok(Ours {
            bodies: scans.into_iter().map(add).collect::<Result<_, _>>()?,
            scene,
            detector: Detector::new(
                Settings::new()
                    .threads(options.threads)
                    .instruction_set(options.instruction_set),
            )?,
        })
    }
}

impl Contestant for Ours {
    fn name(&self) -> &'static str {
        "impinge"
    }

    fn take(&mut self, positions: [&[[f32; 3]]; 2]) -> Result<(), Failure> {
        for (&body, positions) in self.bodies.iter().zip(positions) {
            self.scene.set_positions(body, positions)?;
        }
        Ok(())
    }

    fn distance(&mut self) -> Result<f64, Failure> {
        let nearest = (self.detector).distance(&self.scene, self.bodies[0], self.bodies[1])?;
        Ok(nearest.ok_or("a body without faces")?.distance)
    }
}

#[cfg(feature = "parry")]
struct Parry {
    faces: [Vec<[u32; 3]>; 2],
    meshes: Vec<parry3d::shape::TriMesh>,
}

#[cfg(feature = "parry")]
impl Contestant for Parry {
    fn name(&self) -> &'static str {
        "parry3d"
    }

    fn take(&mut self, positions: [&[[f32; 3]]; 2]) -> Result<(), Failure> {
        use parry3d::math::Vector;
        use parry3d::shape::TriMesh;
        self.meshes.clear();
        for (positions, faces) in positions.into_iter().zip(&self.faces) {
            let points = positions.iter().map(|&point| Vector::from(point)).collect();
            self.meshes.push(TriMesh::new(points, faces.clone())?);
        }
        Ok(())
    }

    fn distance(&mut self) -> Result<f64, Failure> {
        let here = parry3d::math::Pose::IDENTITY;
        let [a, b] = [&self.meshes[0], &self.meshes[1]];
        let found = parry3d::query::distance(&here, a, &here, b);
        Ok(found
            .map_err(|_| "parry has no such query")?
            .distance
            .into())
    }
}

fn contestants(scans: [&Scan; 2], options: &Options) -> Result<Vec<Box<dyn Contestant>>, Failure> {
    #[cfg_attr(not(feature = "parry"), allow(unused_mut, reason = "no peers"))]
    let mut all: Vec<Box<dyn Contestant>> = vec![Box::new(Ours::new(scans, options)?)];
    #[cfg(feature = "parry")]
    if options.peers {
        all.push(Box::new(Parry {
            faces: scans.map(|(_, faces)| faces.clone()),
            meshes: Vec::new(),
        }));
    }
    Ok(all)
}

fn scan(name: &str) -> Result<Scan, Failure> {
    let file = format!("meshes/{name}.ply");
    let (faces, impinge_io::Positions::F32(mut positions)) = surfaces::read(&file)? else {
        return Err(format!("{file}: not in single precision").into());
    };
    let longest = (0..3)
        .map(|axis| length(&positions, axis))
        .fold(0.0, f32::max);
    for x in positions.as_flattened_mut() {
        *x /= longest;
    }
    Ok((positions, faces))
}

fn ends(positions: &[[f32; 3]], axis: usize) -> [f32; 2] {
    let along = || positions.iter().map(|point| point[axis]);
    [
        along().fold(f32::MAX, f32::min),
        along().fold(f32::MIN, f32::max),
    ]
}

fn length(positions: &[[f32; 3]], axis: usize) -> f32 {
    let [low, high] = ends(positions, axis);
    high - low
}

/// All pairs of scans at all gaps.
pub fn run(options: &Options, report: &mut Report) -> Result<(), Failure> {
    report.say("| scene | gap between boxes | distance | | moved, ms | still, ms | times impinge | times impinge, still |");
    report.say("|---|---:|---:|---|---:|---:|---:|---:|");
    let wanted = |names: &&[&str; 2]| options.scene.as_deref().is_none_or(|name| name == names[0]);
    for names in PAIRS.iter().filter(wanted) {
        let (a, rest) = (scan(names[0])?, scan(names[1])?);
        for gap in GAPS {
            let mut b = rest.clone();
            let shift = ends(&a.0, 0)[1] - ends(&b.0, 0)[0] + gap * length(&a.0, 0);
            b.0.iter_mut().for_each(|point| point[0] += shift);
            measure(names, gap, [&a, &b], options, report)?;
        }
    }
    report.say("");
    Ok(())
}

fn measure(
    names: &[&str; 2],
    gap: f32,
    scans: [&Scan; 2],
    options: &Options,
    report: &mut Report,
) -> Result<(), Failure> {
    let mirrored = scans.map(|(positions, _)| -> Vec<_> {
        positions.iter().map(|&[x, y, z]| [-x, y, z]).collect()
    });
    let poses = [
        [&scans[0].0[..], &scans[1].0[..]],
        [&mirrored[0][..], &mirrored[1][..]],
    ];
    let mut contestants = contestants(scans, options)?;
    let mut times = vec![[Vec::new(), Vec::new()]; contestants.len()];
    let mut expected = None;
    // The first round warms up.
    for round in 0..=options.frames.unwrap_or(5).max(1) {
        for (contestant, times) in contestants.iter_mut().zip(&mut times) {
            let start = Instant::now();
            contestant.take(poses[round % 2])?;
            let found = contestant.distance()?;
            let moved = start.elapsed();
            let start = Instant::now();
            let again = contestant.distance()?;
            let still = start.elapsed();
            let expected = *expected.get_or_insert(found);
            for distance in [found, again] {
                if (distance - expected).abs() > 1e-5 {
                    let name = contestant.name();
                    return Err(format!("{name}: {distance} instead of {expected}").into());
                }
            }
            if round > 0 {
                for (times, time) in times.iter_mut().zip([moved, still]) {
                    times.push(time.as_secs_f64() * 1e3);
                }
            }
        }
    }
    let mut own = None;
    for (contestant, times) in contestants.iter().zip(&mut times) {
        let [moved, still] = times.each_mut().map(|times| {
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        });
        let [own_moved, own_still] = *own.get_or_insert([moved, still]);
        let (name, distance) = (contestant.name(), expected.unwrap_or_default());
        report.say(&format!(
            "| {} and {} | {gap} | {distance:.6} | {name} | {} | {} | {:.1} | {:.1} |",
            names[0],
            names[1],
            figures(moved),
            figures(still),
            moved / own_moved,
            still / own_still,
        ));
        report.keep_json(json!({
            "scene": names.join(" and "),
            "gap": gap,
            "distance": distance,
            "contestant": name,
            "moved_ms": moved,
            "still_ms": still,
        }));
    }
    Ok(())
}
