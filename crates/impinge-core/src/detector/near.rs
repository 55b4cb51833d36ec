//! A detector's answers about elements within a distance of each other.

use super::Detector;
use super::in_step::{InStep, Keys, Seen};
use super::steps::NearList;
use crate::answers::near::{Labels, NearPairs};
use crate::cpu::steps::VerletList;
use crate::plan::{Plan, TestId};
use crate::query::pair_kind::PairKind;
use crate::query::settings::{Backend, Settings};
use crate::query::{Exclusion, Query};
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::search::found::KeysByKind;
use crate::search::narrow::exact_kind;
use crate::search::pair_reader::PairReader;
use crate::search::runner::{Job, Outcome, ready};
use crate::search::stats::Stats;
use crate::search::work::Work;
use crate::simd::Isa;
use crate::workers::clock::Instant;

/// Pairs whose features a task finds.
const TASK: usize = 1024;
/// Questions whose pairs are listed: a solver asks few different ones.
const MOST_LISTS: usize = 4;

impl Scene {
    /// The pairs of elements that are within a distance of each other now, to be left out of later
    /// questions by [`Query::exclude`]: in a pose at rest, what is near is meant to be. They are of
    /// the kinds that [`Detector::near`] has if none are named. Positions and thickness alone
    /// count: neither [pinned](Scene::set_pinned) vertices, nor [groups](Scene::set_groups), nor
    /// [`Filter`](crate::Filter)s. For pairs of other kinds, exclude those of an answer of `near`.
    ///
    /// Nothing is proven of pairs that are left out: they may pass through each other.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let strip: Vec<[f32; 3]> = (0..12).map(|i| [(i / 2) as f32, (i % 2) as f32, 0.0]).collect();
    /// let faces: Vec<[u32; 3]> = (0..10).map(|i| [i, i + 1, i + 2]).collect();
    /// scene.add_triangles(&faces, &strip)?;
    /// let query = Query::all().exclude(scene.rest_pairs(1.0)?);
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// assert!(detector.near(&scene, 1.0, &query)?.is_empty());
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// Refused positions, a distance that is negative or not finite, no memory.
    pub fn rest_pairs(&self, distance: f64) -> Result<Exclusion, Error> {
        let mut detector = Detector::new(Backend::Cpu)?;
        let near = detector.near(&self.at_rest(), distance, &Query::all())?;
        Ok(Exclusion::from(&near))
    }
}

impl Detector {
    /// All pairs of elements whose distance is at most `distance` plus the
    /// [thickness](Scene::set_thickness) of both, at the bodies' positions, in the unit of the
    /// scene; of two elements of one body that is equally thick, plus twice its thickness. End
    /// positions are ignored. Each pair comes with its nearest features and, on request, with its
    /// distance and nearest points.
    ///
    /// The answer is exact: a pair is reported if and only if the distance of the two closed
    /// elements, as a real number, is at most the distance asked for, which is a sum of real
    /// numbers: nothing is rounded. A body of tetrahedra takes part with its surface. Pairs of one
    /// body that share a vertex are left out.
    ///
    /// An edge and a face ([`PairKind::EdgeFace`]) are reported if and only if they meet, whatever
    /// the distance: their distance is 0. If they do not meet but are near, then so are the edge
    /// and an edge of the face, or an end of the edge and the face, and these pairs say it: with
    /// each of them repeated, answers would have three times as many pairs. Vertices of no element,
    /// such as those of no face of a body of triangles, take no part.
    ///
    /// ```
    /// use impinge::{Backend, Detector, PairKind, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])?;
    /// scene.add_points(&[[1.0f32, 1.0, 0.5], [5.0, 0.0, 0.0]])?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let near = detector.near(&scene, 0.5, &Query::between_all().closest_points())?;
    /// assert_eq!(near.len(), 1);
    /// let pair = near.iter().next().expect("one pair");
    /// assert_eq!((pair.kind, pair.name()), (PairKind::VertexFace, "P_T"));
    /// let closest = pair.closest.expect("it was asked for");
    /// assert_eq!((closest.distance, closest.points[1]), (0.5, [1.0, 1.0, 0.0]));
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, refused positions, a distance or thickness that is negative or not finite, a
    /// memory budget too small for even one batch.
    pub fn near(
        &mut self,
        scene: &Scene,
        distance: f64,
        query: &Query,
    ) -> Result<NearPairs, Error> {
        let mut near = self.homes.near.take();
        let mut outcome = WithFeatures {
            near: &mut near,
            query,
            isa: Isa::detect(self.settings.instruction_set),
        };
        let found = self.find_near(scene, distance, query, &mut outcome);
        self.stats.clone_from(near.stats());
        found.map(|_| near)
    }

    /// Finds the pairs within a distance, for whatever becomes of them.
    pub(super) fn find_near(
        &mut self,
        scene: &Scene,
        distance: f64,
        query: &Query,
        outcome: &mut impl Outcome<u64, { PairKind::ALL.len() }>,
    ) -> Result<u64, Error> {
        let plan = Plan::nearness(scene, query, distance, self.settings.limits())?;
        self.find_near_keys(scene, query, &plan, Keys::All, outcome)
    }

    /// The same by a plan; where they are listed, from the list.
    pub(super) fn find_near_keys(
        &mut self,
        scene: &Scene,
        query: &Query,
        plan: &Plan,
        keys: Keys<'_>,
        outcome: &mut impl Outcome<u64, { PairKind::ALL.len() }>,
    ) -> Result<u64, Error> {
        let control = &self.control.clone();
        let mut listed = self.listed(scene, query, plan);
        let others = self.steps.lists.iter().map(|other| other.list.bytes());
        let held_by_others = others.sum();
        let mut finder = InStep {
            clusters: &mut self.steps.clusters,
            settings: &self.settings,
            #[cfg(feature = "gpu")]
            gpu: &mut self.gpu,
            keys,
            list: (listed.as_mut()).map(|listed| (&mut listed.list, held_by_others)),
            seen: Seen::default(),
        };
        let found = ready(self.runner.run(scene, plan, control, &mut finder, outcome));
        self.steps.lists.extend(listed);
        found
    }

    /// Takes out the list of a question, or a new one, if near pairs are listed.
    fn listed(&mut self, scene: &Scene, query: &Query, plan: &Plan) -> Option<NearList> {
        let Settings {
            reuse_margin,
            memory_budget,
            ..
        } = self.settings;
        let distance = plan.distance();
        if reuse_margin == 0.0 || memory_budget.is_some() || !plan.farther(reuse_margin).is_finite()
        {
            return None;
        }
        let lists = &mut self.steps.lists;
        let is_same = |listed: &NearList| {
            let of = (listed.arrangement, listed.distance);
            of == (scene.arrangement(), distance) && listed.query == *query
        };
        if let Some(ix) = lists.iter().position(is_same) {
            return Some(lists.remove(ix));
        }
        if lists.len() == MOST_LISTS {
            lists.remove(0);
        }
        Some(NearList {
            arrangement: scene.arrangement(),
            query: query.clone(),
            distance,
            list: VerletList::default(),
        })
    }
}

/// Near pairs, whose features are found when the pairs are known.
struct WithFeatures<'a> {
    near: &'a mut NearPairs,
    query: &'a Query,
    isa: Isa,
}

impl Outcome<u64, { PairKind::ALL.len() }> for WithFeatures<'_> {
    fn begin(&mut self, plan: &Plan) {
        self.near.begin(plan);
    }

    fn stats_mut(&mut self) -> &mut Stats {
        self.near.stats_mut()
    }

    fn take_buffers(&mut self) -> KeysByKind {
        self.near.take_buffers()
    }

    fn fill(&mut self, job: Job<'_>, keys: KeysByKind) -> Result<(), Error> {
        name_features(self.near, job, keys, self.query, self.isa)
    }

    fn bytes(&self) -> u64 {
        self.near.bytes()
    }
}

/// Fills an answer with sorted keys, and finds their features.
///
/// # Errors
/// There is no memory, cancellation.
pub(super) fn name_features(
    near: &mut NearPairs,
    job: Job<'_>,
    keys: KeysByKind,
    query: &Query,
    isa: Isa,
) -> Result<(), Error> {
    let features = Instant::now();
    let Job {
        scene,
        plan,
        workers,
        control,
    } = job;
    let labels = Labels::new(plan.n_elements());
    near.set_threads(workers.n());
    let mut unnamed = near.fill(keys, query, workers.task(TASK))?;
    let n_tasks = unnamed.len() as u64;
    Work { workers, control }.each(&mut unnamed, |_, unnamed| {
        let kind = unnamed.kind;
        let mut reader = PairReader::new(scene, plan);
        unnamed.name(labels, exact_kind(TestId::Elements(kind)), isa, &mut reader);
        Ok(())
    })?;
    control.step(n_tasks, n_tasks)?;
    let ms = features.elapsed().as_secs_f64() * 1e3;
    near.stats_mut().add_ms("features", ms);
    Ok(())
}
