//! A detector's answers about elements within a distance of each other.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use super::in_step::{InStep, Keys, Seen};
use super::{Detector, Last};
use crate::answers::near::{ClosestPoints, Labels, NearPairs, Unnamed};
use crate::answers::pairs::Primitive;
use crate::plan::{Plan, TestId};
use crate::query::near::NearQuery;
use crate::query::pair_kind::PairKind;
use crate::query::progress::Control;
use crate::scene::Scene;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::index::ElementIx;
use crate::search::found::KeysByKind;
use crate::search::narrow::{Corners, exact_kind};
use crate::search::runner::{Job, Outcome, ready};
use crate::search::stats::Statistics;
use crate::workers::clock::Instant;
use impinge_exact::internal::{NearestOfElements, closest_of_elements, nearest_of_elements};

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
    /// even one batch.
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
        let plan = Plan::of_near(query, scene, self.settings.limits())?;
        self.last = Last::Near;
        let mut finder = InStep {
            clusters: &mut self.steps.clusters,
            settings: &self.settings,
            #[cfg(feature = "gpu")]
            gpu: &mut self.gpu,
            keys: Keys::All,
            seen: Seen::default(),
        };
        let near = &mut self.steps.near;
        let mut outcome = WithFeatures { near, query };
        ready(
            self.runner
                .run(scene, &plan, control, &mut finder, &mut outcome),
        )?;
        Ok(&self.steps.near)
    }

    /// Moves the near pairs that were found last out of the detector, without a copy. It holds none until the next question.
    pub fn take_near(&mut self) -> NearPairs {
        std::mem::take(&mut self.steps.near)
    }
}

/// Near pairs, whose features are found when the pairs are known.
struct WithFeatures<'a> {
    near: &'a mut NearPairs,
    query: &'a NearQuery,
}

impl Outcome<u64, { PairKind::ALL.len() }> for WithFeatures<'_> {
    fn begin(&mut self, plan: &Plan) {
        self.near.begin(plan);
    }

    fn stats_mut(&mut self) -> &mut Statistics {
        self.near.stats_mut()
    }

    fn take_buffers(&mut self) -> KeysByKind {
        self.near.take_buffers()
    }

    fn fill(&mut self, job: Job<'_>, keys: KeysByKind) -> Result<(), Error> {
        let features = Instant::now();
        let Job {
            scene,
            plan,
            workers,
            control,
        } = job;
        let labels = Labels::new(plan.n_primitives());
        let query = self.query;
        let (unnamed, numbering) = self.near.fill(keys, query, workers.task(TASK))?;
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
        let ms = features.elapsed().as_secs_f64() * 1e3;
        self.near.stats_mut().add_ms("features", ms);
        Ok(())
    }

    fn bytes(&self) -> u64 {
        self.near.bytes()
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
