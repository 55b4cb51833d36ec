//! Elements within a distance of each other, of one mesh with itself.
//!
//! Positions alternate between a pose and its mirror image, and are written before each frame.
//! Every answer of the library is held against the known number of pairs and their hash, names of
//! nearest features included. Then every vertex trembles about the pose, so little that lists with a
//! margin hold: near pairs from such a list beside those without one, on the same frames.
//!
//! Peers answer a part of the question in floating point. Their rows are compared with those of the
//! library, off the clock, and the numbers of rows that only one of them has are printed.

#[cfg(feature = "embree")]
mod embree;
#[cfg(feature = "parry")]
mod parry;

use std::time::Instant;

use impinge::{BodyId, Detector, NearPairs, PairKind, Query, Scene, Settings};
use serde_json::json;

use crate::report::{Report, figures, grouped};
use crate::{Failure, Options, surfaces};

/// A mesh and a distance from the shared data, and what is known of them.
struct Known {
    name: &'static str,
    /// The distance as a part of the diagonal of the mesh's box.
    part: f64,
    n_pairs: usize,
    /// Of [`impinge::NearPairs::hash`].
    hash: u64,
}

const KNOWN: [Known; 4] = [
    Known {
        name: "cloth-ball",
        part: 1e-3,
        n_pairs: 419_335,
        hash: 0xe530_46df_979c_f46d,
    },
    Known {
        name: "cloth-ball",
        part: 2e-3,
        n_pairs: 1_337_292,
        hash: 0x9591_3068_41e9_9768,
    },
    Known {
        name: "rumba",
        part: 1e-3,
        n_pairs: 109_609,
        hash: 0x1861_05ac_eaf7_dff7,
    },
    Known {
        name: "rumba",
        part: 2e-3,
        n_pairs: 470_647,
        hash: 0xa00f_d756_1328_0441,
    },
];

/// Frames before the clock counts.
const N_WARM: usize = 2;

/// A vertex and a face, or two edges by the order of their numbers.
type Row = [u32; 2];

/// A peer, set up for a mesh.
trait Peer {
    fn name(&self) -> String;
    /// Writes positions into the memory that it reads; off the clock.
    fn write(&mut self, positions: &[[f32; 3]]);
    /// Pairs of one kind within a distance, in any order.
    fn find(&mut self, distance: f64) -> Result<&[Row], Failure>;
}

/// Peers, each with the kind of pairs that it finds.
type Peers = Vec<(PairKind, Box<dyn Peer>)>;

/// A mesh, as peers get it.
#[cfg_attr(
    not(any(feature = "embree", feature = "parry")),
    allow(dead_code, reason = "for peers")
)]
struct Mesh<'a> {
    positions: &'a [[f32; 3]],
    faces: &'a [[u32; 3]],
    edges: &'a [[u32; 2]],
}

#[cfg_attr(
    not(all(feature = "embree", feature = "parry")),
    allow(unused, reason = "for peers")
)]
fn peers(mesh: &Mesh<'_>, n_threads: usize) -> Result<Peers, Failure> {
    let mut peers = Peers::new();
    #[cfg(feature = "embree")]
    for is_refitted in [false, true] {
        let peer = embree::Points::new(mesh, is_refitted, n_threads)?;
        peers.push((PairKind::VertexFace, Box::new(peer)));
    }
    #[cfg(feature = "parry")]
    {
        peers.push((PairKind::VertexFace, Box::new(parry::Points::new(mesh))));
        peers.push((PairKind::EdgeEdge, Box::new(parry::Edges::new(mesh))));
    }
    Ok(peers)
}

/// The scenes that the options name.
pub fn run(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let name = |known: &Known| known.name;
    surfaces::measure_each(&KNOWN, name, options, |known| {
        measure(known, options, report)
    })
}

/// Faces, and the positions of the pose and of its mirror image.
type Poses = (Vec<[u32; 3]>, [Vec<[f32; 3]>; 2]);

fn load(known: &Known) -> Result<Poses, Failure> {
    let file = match known.name {
        "rumba" => "sequences/rumba.ply",
        _ => "ccd/cloth-ball/frames/cloth_ball92.ply",
    };
    let (faces, rest) = surfaces::read(file)?;
    let positions = if known.name == "rumba" {
        let frames = impinge_io::Sequence::open(&surfaces::file("sequences/rumba.pc2")?)?;
        frames.frame(60)?
    } else {
        rest
    };
    let positions: Vec<[f32; 3]> = match positions {
        impinge_io::Positions::F32(positions) => positions,
        impinge_io::Positions::F64(positions) => {
            positions.iter().map(|p| p.map(|x| x as f32)).collect()
        }
    };
    let mirrored = positions.iter().map(|&[x, y, z]| [-x, y, z]).collect();
    Ok((faces, [positions, mirrored]))
}

/// The diagonal of the box of some points.
fn diagonal(positions: &[[f32; 3]]) -> f64 {
    let squares = (0..3).map(|axis| {
        let along = || positions.iter().map(|p| p[axis]);
        let extent = along().fold(f32::MIN, f32::max) - along().fold(f32::MAX, f32::min);
        f64::from(extent).powi(2)
    });
    squares.sum::<f64>().sqrt()
}

fn settings(options: &Options, n_threads: usize) -> Settings {
    Settings::new()
        .threads(n_threads)
        .affinity(options.affinities[0])
        .instruction_set(options.instruction_set)
        .backend(options.backend)
}

fn measure(known: &Known, options: &Options, report: &mut Report) -> Result<(), Failure> {
    let (faces, poses) = load(known)?;
    let distance = known.part * diagonal(&poses[0]);
    let mut scene = Scene::new();
    let body = scene.add((faces.clone(), poses[0].clone()))?;
    report.say(&format!(
        "### {}, {} faces, distance {distance:.6}: {} pairs\n",
        known.name,
        grouped(faces.len() as u64),
        grouped(known.n_pairs as u64),
    ));
    report.say("| | kinds | threads | best ms | median ms | pairs | stages of the best, ms, or rows that only one has |");
    report.say("|---|---|---:|---:|---:|---:|---|");
    let n_frames = options.frames.unwrap_or(10).max(1);
    let threads = match options.threads {
        0 => vec![1, 0],
        n => vec![n],
    };
    for n_threads in threads {
        let mut detector = Detector::new(settings(options, n_threads))?;
        for kinds in [
            &[PairKind::VertexFace, PairKind::EdgeEdge][..],
            &[PairKind::VertexFace],
            &[PairKind::EdgeEdge],
        ] {
            let query = Query::all().kinds(kinds.iter().copied());
            let (mut times, mut best, mut n) = (Vec::new(), None, 0);
            for frame in 0..N_WARM + n_frames {
                scene.set_positions(body, &poses[frame % 2])?;
                let start = Instant::now();
                let near = detector.near(&scene, distance, &query)?;
                let ms = start.elapsed().as_secs_f64() * 1e3;
                if kinds.len() == 2 && (near.len(), near.hash()) != (known.n_pairs, known.hash) {
                    return Err(format!("{}: {} pairs are wrong", known.name, near.len()).into());
                }
                n = near.len();
                if frame >= N_WARM {
                    if times.iter().all(|&other| ms < other) {
                        best = Some(near.stats().clone());
                    }
                    times.push(ms);
                }
            }
            let best = best.ok_or("no frames")?;
            let stages = best.stages.iter().filter(|stage| stage.ms >= 0.01);
            let stages: Vec<_> = stages
                .map(|stage| format!("{} {}", stage.name, figures(stage.ms)))
                .collect();
            row(
                report,
                known,
                ("impinge", kinds),
                best.n_threads,
                &mut times,
                n,
                &stages.join(", "),
            );
        }
        for share in [0.125, 0.5] {
            let at = (&mut scene, body, &poses[0][..]);
            tremble(known, (at, distance, share), n_threads, options, report)?;
        }
    }
    if options.peers {
        against_peers(known, (&mut scene, body), &faces, &poses, options, report)?;
    }
    report.say("");
    Ok(())
}

/// A scene, its body, and the pose about which this trembles.
type Trembling<'a> = (&'a mut Scene, BodyId, &'a [[f32; 3]]);

/// Times near pairs of a mesh that trembles: without a list, from one with a margin of a share of the
/// distance, and where that is made.
fn tremble(
    known: &Known,
    ((scene, body, pose), distance, share): (Trembling<'_>, f64, f64),
    n_threads: usize,
    options: &Options,
    report: &mut Report,
) -> Result<(), Failure> {
    let margin = share * distance;
    let settings = settings(options, n_threads);
    let query = Query::all().kinds([PairKind::VertexFace, PairKind::EdgeEdge]);
    let mut without = Detector::new(settings.clone())?;
    let mut listing = Detector::new(settings.reuse_margin(margin))?;
    let [mut alone, mut made, mut listed] = [const { Vec::new() }; 3];
    let mut n = 0;
    // Along each axis by less than a third of half of the margin: lists hold.
    let most = (margin / 8.0) as f32;
    for frame in 0..N_WARM + options.frames.unwrap_or(10).max(1) {
        let moved = pose.iter().enumerate().map(|(vertex, p)| {
            std::array::from_fn(|axis| {
                let turn = (vertex * 7 + frame * 5 + axis * 3) % 9;
                p[axis] + most * (turn as f32 / 4.0 - 1.0)
            })
        });
        scene.set_positions(body, moved.collect::<Vec<[f32; 3]>>())?;
        let start = Instant::now();
        let near = without.near(scene, distance, &query)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let same = listing.near(scene, distance, &query)?;
        let times = match frame {
            0 => &mut made,
            _ => &mut listed,
        };
        times.push(start.elapsed().as_secs_f64() * 1e3);
        if (near.len(), near.hash()) != (same.len(), same.hash()) {
            return Err(format!("{}: {} pairs from a list", known.name, same.len()).into());
        }
        n = near.len();
        if frame >= N_WARM {
            alone.push(ms);
        }
    }
    let said = format!("a margin of {share} distances");
    for (name, times) in [
        ("impinge, trembling", &mut alone),
        ("… from a list", &mut listed),
        ("… where it is made, the first frame", &mut made),
    ] {
        let kinds = &[PairKind::VertexFace, PairKind::EdgeEdge][..];
        row(report, known, (name, kinds), n_threads, times, n, &said);
    }
    Ok(())
}

/// Times the peers, and compares their rows.
fn against_peers(
    known: &Known,
    (scene, body): (&mut Scene, BodyId),
    faces: &[[u32; 3]],
    poses: &[Vec<[f32; 3]>; 2],
    options: &Options,
    report: &mut Report,
) -> Result<(), Failure> {
    let distance = known.part * diagonal(&poses[0]);
    scene.set_positions(body, &poses[0])?;
    let mut detector = Detector::new(Settings::default())?;
    let near = detector.near(scene, distance, &Query::all())?;
    let part = scene.body(body)?.part(impinge::Part::Edges);
    let edges: Vec<[u32; 2]> = (0..part.len())
        .map(|ix| part.corners(ix).try_into())
        .collect::<Result<_, _>>()?;
    let mesh = Mesh {
        positions: &poses[0],
        faces,
        edges: &edges,
    };
    let n_frames = options.frames.unwrap_or(10).clamp(1, 10);
    for (kind, mut peer) in peers(&mesh, options.threads)? {
        let mut times = Vec::new();
        let mut rows = Vec::new();
        for frame in (0..1 + n_frames).rev() {
            peer.write(&poses[frame % 2]);
            let start = Instant::now();
            let found = peer.find(distance)?;
            times.push(start.elapsed().as_secs_f64() * 1e3);
            rows = match frame {
                0 => found.to_vec(),
                _ => rows,
            };
        }
        // The first frame warms up.
        times.remove(0);
        let n = rows.len();
        let said = differences(&near, kind, rows);
        row(
            report,
            known,
            (&peer.name(), &[kind]),
            0,
            &mut times,
            n,
            &said,
        );
    }
    Ok(())
}

/// How many rows only the peer has, and only the library.
fn differences(near: &NearPairs, kind: PairKind, mut rows: Vec<Row>) -> String {
    rows.sort_unstable();
    let mut own: Vec<Row> = near
        .of(kind)
        .map(|pair| [pair.a.element, pair.b.element])
        .collect();
    own.sort_unstable();
    let only = |a: &[Row], b: &[Row]| a.iter().filter(|row| b.binary_search(row).is_err()).count();
    format!("{} more, {} missed", only(&rows, &own), only(&own, &rows))
}

fn row(
    report: &mut Report,
    known: &Known,
    (name, kinds): (&str, &[PairKind]),
    n_threads: usize,
    times: &mut [f64],
    n_pairs: usize,
    said: &str,
) {
    times.sort_by(f64::total_cmp);
    let (best, median) = (times[0], times[times.len() / 2]);
    let kinds: Vec<_> = kinds.iter().map(|kind| kind.name()).collect();
    let kinds = kinds.join(", ");
    let threads = match n_threads {
        0 => "all".to_owned(),
        n => n.to_string(),
    };
    report.say(&format!(
        "| {name} | {kinds} | {threads} | {} | {} | {} | {said} |",
        figures(best),
        figures(median),
        grouped(n_pairs as u64),
    ));
    report.keep_json(json!({
        "scene": known.name,
        "part": known.part,
        "contestant": name,
        "kinds": kinds,
        "threads": threads,
        "min_ms": best,
        "median_ms": median,
        "pairs": n_pairs,
        "said": said,
    }));
}
