//! Every question of the detector: on one thread, in a forked process, stopped by a token, with too
//! little memory; and its statistics. A public method of the detector that is neither asked here
//! nor named as no question fails the test.
//!
//! The threads of this process are counted, so this file holds one test alone.

#![cfg(target_os = "linux")]

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, exit};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use impinge_core::contact::Contacts;
use impinge_core::{
    Backend, BodyId, CancelToken, Control, Detector, Error, Pairs, Query, Scene, Settings,
};
use impinge_scenes::{solids, surfaces};

/// Two balls that overlap, a third one beside them, and where they are at the end of a step.
struct World {
    scene: Scene,
    bodies: [BodyId; 3],
    pairs: Pairs,
    contacts: Contacts,
    /// A scene of its own.
    block: (Scene, BodyId),
}

fn detector(threads: usize) -> Detector {
    budgeted(threads, None)
}

fn budgeted(threads: usize, memory_budget: Option<u64>) -> Detector {
    Detector::new(
        Settings::new()
            .backend(Backend::Cpu)
            .threads(threads)
            .memory_budget(memory_budget),
    )
    .unwrap()
}

impl World {
    fn new() -> Self {
        let ball = surfaces::bumpy_ball(20_000, 0.2);
        let mut scene = Scene::new();
        let bodies = [0.0, 0.4, 4.0].map(|x| {
            let at = ball.translated([x, 0.05, 0.0]);
            let body = at.add_to(&mut scene).unwrap();
            let end = at.translated([0.02, 0.0, 0.01]);
            scene.set_end_positions(body, &end.positions).unwrap();
            body
        });
        // One thread: the process has no others yet.
        let mut detector = detector(1);
        let pairs = detector.detect(&scene, &Query::between_all()).unwrap();
        let contacts = detector.contacts(&scene, &pairs).unwrap();
        let mut apart = Scene::new();
        let block = solids::block(20, 20, 20, 0.1).add_to(&mut apart).unwrap();
        let block = (apart, block);
        World {
            scene,
            bodies,
            pairs,
            contacts,
            block,
        }
    }
}

/// A question, and a number that stands for its answer.
type Ask = fn(&mut Detector, &World) -> Result<u64, Error>;

fn bits(points: &[[f64; 3]]) -> u64 {
    let bits = points.as_flattened().iter().map(|x| x.to_bits());
    bits.fold(0, |sum, x| sum.rotate_left(5) ^ x)
}

/// The vertices of the first body.
fn points(world: &World) -> Vec<[f64; 3]> {
    let body = world.scene.body(world.bodies[0]).unwrap();
    let positions = body.positions();
    (0..body.n_vertices())
        .map(|ix| positions.point(ix))
        .collect()
}

/// By the names of the methods; where one is asked twice, with more after a space.
const ALL: [(&str, Ask); 25] = [
    ("detect", |d, w| {
        Ok(d.detect(&w.scene, &Query::all())?.hash())
    }),
    ("count", |d, w| d.count(&w.scene, &Query::between_all())),
    ("any", |d, w| Ok(d.any(&w.scene, &Query::all())?.into())),
    ("any of many", |d, w| {
        Ok(d.any(&w.scene, &Query::between_all())?.into())
    }),
    ("impacts", |d, w| {
        let step = Query::between(w.bodies[0], w.bodies[1]);
        Ok(d.impacts(&w.scene, &step)?.hash())
    }),
    ("earliest", |d, w| {
        let first = d.earliest(&w.scene, &Query::all())?;
        Ok(first.map_or(0, |first| first.toi.to_bits()))
    }),
    ("is_free", |d, w| {
        Ok(d.is_free(&w.scene, &Query::all())?.into())
    }),
    ("advance", |d, w| {
        let step = Query::between(w.bodies[0], w.bodies[2]);
        Ok(d.advance(&w.scene, &step)?.fraction.to_bits())
    }),
    ("truncate", |d, w| {
        let step = Query::between(w.bodies[0], w.bodies[2]);
        let truncation = d.truncate(&w.scene, &step)?;
        let at = truncation.positions(w.bodies[0]).expect("it moves");
        let points: Vec<[f64; 3]> = (0..at.len()).map(|v| at.point(v)).collect();
        Ok(bits(&points) ^ truncation.n_cut())
    }),
    ("candidates", |d, w| {
        let query = Query::between(w.bodies[0], w.bodies[1]);
        Ok(d.candidates(&w.scene, 0.0, &query)?.len() as u64)
    }),
    ("candidates_in_runs", |d, w| {
        let query = Query::between(w.bodies[0], w.bodies[1]);
        let each = |_| ControlFlow::<()>::Continue(());
        match d.candidates_in_runs(&w.scene, 0.0, &query, 100_000, each)? {
            ControlFlow::Continue(n) => Ok(n),
            ControlFlow::Break(()) => Ok(0),
        }
    }),
    ("near", |d, w| {
        let query = Query::between_all();
        Ok(d.near(&w.scene, 0.0, &query)?.hash())
    }),
    ("safe_distances", |d, w| {
        let safe = d.safe_distances(&w.scene, 0.05, &Query::between_all())?;
        let bounds = safe.of(w.bodies[0]).expect("a body");
        let sum = (0..bounds.len()).fold(0, |sum: u64, ix| {
            sum.rotate_left(5) ^ bounds.get(ix).to_bits()
        });
        Ok(sum ^ safe.touching().hash())
    }),
    ("neighbours", |d, w| {
        let lists = d.neighbours(&w.scene, 0.01, &Query::between_all())?;
        let columns = lists.vf().indices.iter().chain(&lists.ee().indices);
        Ok(columns.fold(lists.len() as u64, |sum, &ix| {
            sum.rotate_left(5) ^ u64::from(ix)
        }))
    }),
    ("closest", |d, w| {
        let points = points(w);
        let closest = d.closest(&w.scene, &points, f64::INFINITY, &Query::of(w.bodies[2]))?;
        Ok(closest.hash())
    }),
    ("closest of several", |d, w| {
        let query = Query::of(w.bodies[2]).n_nearest(4);
        let closest = d.closest(&w.scene, &points(w), f64::INFINITY, &query)?;
        Ok(closest.hash())
    }),
    ("cast", |d, w| {
        let points = points(w);
        let hits = d.cast(
            &w.scene,
            &points,
            &points,
            f64::INFINITY,
            &Query::of(w.bodies[2]),
        )?;
        Ok(hits.hash())
    }),
    ("contains", |d, w| {
        let places = d.contains(&w.scene, w.bodies[1], &points(w))?;
        Ok(places
            .iter()
            .fold(0, |sum, &place| 3 * (sum % (1 << 60)) + (place + 1) as u64))
    }),
    ("signed_distance", |d, w| {
        let signed = d.signed_distance(&w.scene, w.bodies[1], &points(w))?;
        Ok(bits(&signed.iter().map(|&x| [x; 3]).collect::<Vec<_>>()))
    }),
    ("winding_numbers", |d, w| {
        let windings = d.winding_numbers(&w.scene, w.bodies[1], &points(w))?;
        Ok(windings.iter().fold(0, |sum: u64, winding| {
            sum.rotate_left(5) ^ u64::from(winding.map_or(9, i32::unsigned_abs))
        }))
    }),
    ("locate", |d, w| {
        let (scene, block) = &w.block;
        let found = d.locate(scene, *block, &points(w))?;
        Ok(found.iter().fold(0, |sum, number| {
            sum.rotate_left(5) ^ u64::from(number.map_or(0, |number| number + 1))
        }))
    }),
    ("nearest", |d, w| {
        let [a, ..] = w.bodies;
        let nearest = d.nearest(&w.scene, &Query::across([a]))?;
        let nearest = nearest.expect("elements");
        Ok(nearest.distance.to_bits() ^ u64::from(nearest.a.element))
    }),
    ("distance", |d, w| {
        let [a, _, b] = w.bodies;
        let nearest = d.distance(&w.scene, a, b)?.expect("elements");
        Ok(nearest.distance.to_bits() ^ u64::from(nearest.a.element))
    }),
    ("contacts", |d, w| {
        Ok(bits(d.contacts(&w.scene, &w.pairs)?.points()))
    }),
    ("penetration", |d, w| {
        let [a, b, _] = w.bodies;
        let found = d.penetration(&w.scene, &w.contacts, a, b)?;
        Ok(found.inside[0].len() as u64 + bits(&[found.regions[0].position]))
    }),
];

/// Methods of the detector that ask nothing, or what is asked above in another way.
const NO_QUESTIONS: [&str; 16] = [
    "new",
    "open",
    "with_damage",
    "with_capacities",
    "with_most_bound",
    "settings",
    "start_intersects",
    "stats",
    "set_control",
    // On a device.
    "gpu",
    "gpu_name",
    "waits_for_gpu",
    "bytes_on_device",
    "trace",
    "recording",
    "ran",
];

/// The public methods of the detector, as its source has them.
fn methods(folder: &Path, found: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            methods(&path, found);
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        let blocks = text.split("\nimpl Detector {\n").skip(1);
        for block in blocks.filter_map(|block| block.split("\n}\n").next()) {
            for line in block.lines() {
                let line = line.strip_prefix("    pub ").unwrap_or_default();
                let line = line.strip_prefix("async ").unwrap_or(line);
                let name = line.strip_prefix("fn ").unwrap_or_default();
                let is_name = |c: char| c.is_alphanumeric() || c == '_';
                let name = name.split(|c| !is_name(c)).next().unwrap_or_default();
                found.extend((!name.is_empty()).then(|| name.to_owned()));
            }
        }
    }
}

/// Every method is asked, or is no question.
fn assert_none_is_forgotten() {
    let mut all = BTreeSet::new();
    methods(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("../impinge-core/src"),
        &mut all,
    );
    assert!(all.len() > 25, "{all:?}");
    let mut known: BTreeSet<String> = NO_QUESTIONS.map(str::to_owned).into();
    for (name, _) in ALL {
        let method = name.split(' ').next().unwrap();
        assert!(all.contains(method), "there is no method {method}");
        known.insert(method.to_owned());
    }
    let forgotten: Vec<_> = all.difference(&known).collect();
    assert!(forgotten.is_empty(), "not asked here: {forgotten:?}");
}

/// How many threads this process has.
fn n_threads() -> usize {
    std::fs::read_dir("/proc/self/task").unwrap().count()
}

/// The answers of a new detector.
fn answers(world: &World, threads: usize) -> Vec<u64> {
    let mut detector = detector(threads);
    ALL.iter()
        .map(|(name, ask)| {
            let answer = ask(&mut detector, world);
            answer.unwrap_or_else(|error| panic!("{name}: {error}"))
        })
        .collect()
}

#[test]
fn every_question() {
    assert_none_is_forgotten();
    let before = n_threads();
    let world = World::new();
    let expected = answers(&world, 1);
    assert_eq!(n_threads(), before, "one thread is one thread");

    // Now this process has the threads of two pools, and a fork of it has none of them.
    assert_eq!(answers(&world, 0), expected);
    let mut kept = detector(2);
    for (name, ask) in ALL {
        let answer = ask(&mut kept, &world).unwrap();
        assert_eq!(Some(answer), at(name, &expected), "{name} on two threads");
    }
    in_fork(|| {
        // A new detector, one of the parent's, and again.
        let ask = |(_, ask): &(&str, Ask)| ask(&mut kept, &world).ok();
        answers(&world, 0) == expected
            && answers(&world, 2) == expected
            && ALL.iter().map(ask).eq(expected.iter().copied().map(Some))
    });

    for (name, ask) in ALL {
        // The statistics are those of this question.
        let mut new = detector(2);
        ask(&mut new, &world).unwrap();
        let stats = new.stats();
        assert!(stats.total_ms > 0.0, "{name}: {stats:?}");
        assert_eq!(
            (&stats.backend[..], stats.n_threads.min(2)),
            ("cpu", stats.n_threads),
            "{name}"
        );
        assert!(!stats.method.is_empty(), "{name}");

        // No question is answered without memory, and each is with enough.
        let refused = ask(&mut budgeted(1, Some(1)), &world);
        assert!(
            matches!(
                refused,
                Err(Error::MemoryBudget {
                    budget: 1,
                    needed: 2..,
                    ..
                })
            ),
            "{name}: {refused:?}"
        );
        let enough = ask(&mut budgeted(1, Some(1 << 30)), &world);
        assert_eq!(enough.ok(), at(name, &expected), "{name} within a budget");

        let token = CancelToken::new();
        token.cancel();
        kept.set_control(Control::new().cancel(&token));
        let cancelled = ask(&mut kept, &world);
        kept.set_control(Control::new());
        assert!(
            matches!(cancelled, Err(Error::Cancelled)),
            "{name}: {cancelled:?}"
        );
        // What is long looks often: stopped at its third look.
        let token = CancelToken::new();
        let n_looks = Arc::new(AtomicU64::new(0));
        let look = {
            let (token, n_looks) = (token.clone(), Arc::clone(&n_looks));
            move |_| {
                if n_looks.fetch_add(1, Ordering::Relaxed) == 2 {
                    token.cancel();
                }
            }
        };
        let mut watched = detector(1);
        watched.set_control(Control::new().cancel(&token).progress(look));
        let cancelled = ask(&mut watched, &world);
        let n_looks = n_looks.load(Ordering::Relaxed);
        if n_looks > 3 || cancelled.is_err() {
            assert!(matches!(cancelled, Err(Error::Cancelled)), "{name}");
            assert_eq!(n_looks, 3, "{name} went on");
        } else {
            assert!(name.starts_with("any"), "{name} looks {n_looks} times");
        }
        let after = ask(&mut kept, &world).ok();
        assert_eq!(after, at(name, &expected), "{name} after it was cancelled");
    }
}

fn at(name: &str, answers: &[u64]) -> Option<u64> {
    let ix = ALL.iter().position(|(own, _)| *own == name)?;
    answers.get(ix).copied()
}

/// Runs something in a fork of this process, and asserts that it returns true within a minute.
fn in_fork(mut work: impl FnMut() -> bool) {
    let code = || -> std::io::Result<()> {
        // The parent would wait for ever.
        std::thread::spawn(|| {
            std::thread::sleep(Duration::from_secs(60));
            exit(3);
        });
        exit(match work() {
            true => 0,
            false => 2,
        });
    };
    let mut command = Command::new("/bin/false");
    // SAFETY: not much: a fork of a process with threads may only call what is safe in a signal
    // handler, and this allocates and starts threads. That is what Python's multiprocessing does,
    // and what is tested.
    unsafe { command.pre_exec(erase(code)) };
    let status = command.spawn().and_then(|mut child| child.wait());
    assert_eq!(
        status.unwrap().code(),
        Some(0),
        "2: another answer, 3: it hangs"
    );
}

/// Lets a closure live as long as the command wishes. It is dropped before what it borrows:
/// `in_fork` ends after the child.
fn erase<'a>(
    code: impl FnMut() -> std::io::Result<()> + 'a,
) -> impl FnMut() -> std::io::Result<()> + Send + Sync + 'static {
    type Code<'a> = dyn FnMut() -> std::io::Result<()> + 'a;
    struct Shared(*mut Code<'static>);
    // SAFETY: it is called in the fork alone, by one thread.
    unsafe impl Send for Shared {}
    // SAFETY: as for `Send`.
    unsafe impl Sync for Shared {}
    let boxed: Box<Code<'a>> = Box::new(code);
    // SAFETY: only the lifetime changes.
    let pointer =
        unsafe { std::mem::transmute::<*mut Code<'a>, *mut Code<'static>>(Box::into_raw(boxed)) };
    let shared = Shared(pointer);
    move || {
        let shared = &shared;
        // SAFETY: the closure is never freed.
        unsafe { (*shared.0)() }
    }
}
