//! A detector's answers about elements within a distance of each other.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::clock::Instant;
use crate::cpu::steps::StepTest;
use crate::detector::Detector;
use crate::elements::Part;
use crate::error::Error;
use crate::exact::{NearestOfElements, closest_of_elements, nearest_of_elements};
use crate::frame::TestId;
use crate::hull::Pose;
use crate::impacts::StepAnswer;
use crate::index::ElementIx;
use crate::naive;
use crate::narrow::{Corners, Within, exact_kind};
use crate::near::{ClosestPoints, Labels, NearPairs, NearQuery, Unnamed};
use crate::pair_kind::PairKind;
use crate::pairs::Primitive;
use crate::progress::Control;
use crate::run::Job;
use crate::scene::Scene;
use crate::settings::Method;
use crate::sink::{Limits, Wanted};

use super::{StepMemory, begin};

/// Pairs whose features a task finds.
const TASK: usize = 1024;

impl Detector {
    /// All pairs of elements whose distance is at most that of the query, at the bodies' positions. End positions are ignored.
    /// Each pair comes with its nearest features and, on request, with its distance and nearest points.
    ///
    /// The answer is exact: a pair is reported if and only if the distance of the two closed elements, as a real number,
    /// is at most the distance asked for. A body of tetrahedra takes part with its surface.
    ///
    /// ```
    /// use impinge::{Backend, Detector, NearQuery, PairKind, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])?;
    /// scene.add_points(&[[1.0f32, 1.0, 0.5], [5.0, 0.0, 0.0]])?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let query = NearQuery::new(Query::all()).distance(0.5).closest_points();
    /// let near = detector.within_distance(&scene, &query)?;
    /// assert_eq!(near.len(), 1);
    /// let pair = near.iter().next().expect("one pair");
    /// assert_eq!((pair.kind, pair.name()), (PairKind::VertexFace, "P_T"));
    /// let closest = pair.closest.expect("it was asked for");
    /// assert_eq!((closest.distance, closest.points[1]), (0.5, [1.0, 1.0, 0.0]));
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, refused positions, a distance or thickness that is negative or not finite, a memory budget too small for
    /// even one slab.
    pub fn within_distance(
        &mut self,
        scene: &Scene,
        query: &NearQuery,
    ) -> Result<&NearPairs, Error> {
        self.within_distance_with(scene, query, &Control::new())
    }

    /// [`within_distance`](Detector::within_distance) with a token to stop it and a callback to watch it.
    ///
    /// # Errors
    /// As `within_distance`, and [`Error::Cancelled`].
    pub fn within_distance_with(
        &mut self,
        scene: &Scene,
        query: &NearQuery,
        control: &Control<'_>,
    ) -> Result<&NearPairs, Error> {
        let start = Instant::now();
        let StepMemory {
            frame,
            near,
            clusters,
            keys: answer,
            sorter,
            ..
        } = &mut self.steps;
        let workers = self.frames.workers();
        query.resolve(scene, frame)?;
        near.begin(frame);
        frame.check(scene)?;
        let rooms = near.take_room();
        let stats = near.stats_mut();
        begin(stats, &self.settings, workers.n());
        let _shift = workers.shift(frame.n_primitives());
        let labels = Labels::new(frame.n_primitives());
        let of_distance = size_of::<f64>() * usize::from(query.distances);
        let of_points = size_of::<[[f64; 3]; 2]>() * usize::from(query.closest);
        let limits = Limits {
            besides: (1 + of_distance + of_points) as u64,
            ..self.settings.limits()
        };
        answer.begin(limits, Wanted::Pairs, rooms);
        if self.settings.method == Method::Naive {
            stats.time("naive", |stats| {
                naive::run(&Within, scene, frame, control, stats, |test, key, ()| {
                    if let TestId::Elements(kind) = test
                        && frame.is_owned(scene, key)
                    {
                        answer.extend(
                            kind as usize,
                            [labels.put(key, Labels::UNKNOWN)].into_iter(),
                        );
                    }
                    answer.check()
                })
            })?;
        } else {
            let job = Job {
                scene,
                frame,
                workers,
                control,
            };
            let asked = (StepTest::Within, Pose::STILL);
            clusters.run(job, &self.settings, asked, StepAnswer::Keys(answer), stats)?;
        }
        let collect = Instant::now();
        let (mut keys, _) = answer.finish()?;
        let n_counted = sorter.sort_kinds(&mut keys, frame, workers);
        let stats = near.stats_mut();
        stats.add_ms("collect", collect.elapsed().as_secs_f64() * 1e3);
        stats.ways.n_counted = n_counted;
        let features = Instant::now();
        let (unnamed, numbering) = near.fill(keys, query, workers.task(TASK))?;
        let tasks: Vec<Mutex<Unnamed<'_>>> = unnamed.into_iter().map(Mutex::new).collect();
        let n_tasks = tasks.len();
        let is_stopped = AtomicBool::new(false);
        workers.for_each(&mut vec![(); workers.n()], n_tasks, |(), ix| {
            if is_stopped.load(Ordering::Relaxed)
                || control.step(ix as u64, n_tasks as u64).is_err()
            {
                is_stopped.store(true, Ordering::Relaxed);
                return;
            }
            if let Ok(mut unnamed) = tasks[ix].lock() {
                let kind = unnamed.kind;
                let find = |key| {
                    let (a, b) = numbering.pair(key);
                    find_features(scene, kind, [a, b], query.distances)
                };
                unnamed.name(labels, exact_kind(TestId::Elements(kind)), find);
            }
        });
        drop(tasks);
        control.step(n_tasks as u64, n_tasks as u64)?;
        let bytes = near.bytes() + sorter.bytes();
        let stats = near.stats_mut();
        stats.bytes_held += bytes;
        workers.report(&mut stats.ways);
        stats.add_ms("features", features.elapsed().as_secs_f64() * 1e3);
        stats.total_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(&self.steps.near)
    }

    /// Moves the near pairs that were found last out of the detector, without a copy. It holds none until the next question.
    pub fn take_near(&mut self) -> NearPairs {
        std::mem::take(&mut self.steps.near)
    }
}

/// The nearest features of a pair, and on request the nearest points.
fn find_features(
    scene: &Scene,
    kind: PairKind,
    pair: [Primitive; 2],
    closest: bool,
) -> (NearestOfElements, Option<ClosestPoints>) {
    let parts = kind.parts();
    let corners = |Primitive { body, primitive }: Primitive, part: Part| {
        let body = scene.body_in(body.slot());
        let element = ElementIx::new(primitive);
        Corners::new(body.positions(), body.corners(part, &element))
    };
    let (a, b) = (corners(pair[0], parts[0]), corners(pair[1], parts[1]));
    if closest {
        let (nearest, distance, points) = closest_of_elements(a.points(), b.points());
        (nearest, Some(ClosestPoints { distance, points }))
    } else {
        (nearest_of_elements(a.points(), b.points()), None)
    }
}
