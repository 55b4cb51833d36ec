//! A detector's answers about distances of bodies, and whether two bodies touch whose distance is
//! asked for.
//!
//! Where boxes of clusters overlap, whether the bodies touch is asked first, with the clusters,
//! filters and threads of intersections. Boxes of very many long triangles overlap: a search by
//! distances would compare most of these one by one.

use std::sync::Arc;

use super::Detector;
use crate::answers::pairs::Pairs;
use crate::cpu::Cpu;
use crate::cpu::clusters::Clusters;
use crate::plan::Plan;
use crate::proximity::{Distances, Nearest};
use crate::query::Query;
use crate::query::goal::{Goal, Limits};
use crate::query::progress::Control;
use crate::query::settings::{Method, Settings};
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::search::runner::{Finder, Job, Runner, ready};
use crate::search::sink::Answer;
use crate::search::stats::Stats;
use crate::search::work::Work;

impl Detector {
    /// The two bodies that are nearest to each other of all that the query lets meet, and the pair
    /// of elements that has their [`distance`](Detector::distance); `None` if there are no two that
    /// have elements. Of several pairs at the same distance, rounded down, the lowest, which is not
    /// always the nearest of them. Pairs of bodies whose boxes are farther apart than the nearest
    /// two are never looked at.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let points = [0.0f32, 5.0, 7.0].map(|x| scene.add_points(&[[x, 0.0, 0.0]]));
    /// let [_, b, c] = points.map(|body| body.expect("finite"));
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let nearest = detector.nearest(&scene, &Query::between_all())?.expect("there are three");
    /// assert_eq!((nearest.distance, nearest.a.body, nearest.b.body), (2.0, b, c));
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, bad positions that were written in place, a query for self-collision or for the
    /// pairs of a cell, a memory budget too small for the trees of the bodies.
    pub fn nearest(&mut self, scene: &Scene, query: &Query) -> Result<Option<Nearest>, Error> {
        let control = &self.control.clone();
        let plan = self.plan_of_nearest(scene, query)?;
        control.step(0, 1)?;
        let nearest = self.measure_distance(scene, control, |distances, work, touching| {
            distances.nearest(scene, &plan, work, touching)
        })?;
        self.keep(scene, query, plan);
        Ok(nearest)
    }

    /// The smallest distance of two bodies at the positions that they have, and the pair of
    /// elements that has it; `None` if one body has no elements. The distance is rounded down: the
    /// largest `f64` that is not above the true one. It is 0 if and only if they share a point,
    /// which is decided exactly, or are nearer than the smallest `f64`. Tetrahedra are solid: a
    /// body inside one has distance 0. Of several pairs at the same distance, rounded down, the
    /// lowest, which is not always the nearest of them.
    ///
    /// The detector keeps a tree per body and the nearest pair of each call. So repeated calls for
    /// bodies that move cost little more than to read their positions. The answer does not depend
    /// on earlier calls.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let triangle = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// let a = scene.add_triangles(&[[0, 1, 2]], &triangle)?;
    /// let b = scene.add_triangles(&[[0, 1, 2]], &triangle.map(|[x, y, z]| [x, y, z + 3.0]))?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let nearest = detector.distance(&scene, a, b)?.expect("both have elements");
    /// assert_eq!((nearest.distance, nearest.a.element, nearest.b.element), (3.0, 0, 0));
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// A stale id, the same body twice, bad positions that were written in place, a memory budget
    /// too small for the trees of both bodies.
    pub fn distance(
        &mut self,
        scene: &Scene,
        a: BodyId,
        b: BodyId,
    ) -> Result<Option<Nearest>, Error> {
        let control = &self.control.clone();
        self.measure_distance(scene, control, |distances, work, touching| {
            distances.between(scene, [a, b], work, || touching([a, b]))
        })
    }

    /// What is asked about the nearest bodies.
    fn plan_of_nearest(&mut self, scene: &Scene, query: &Query) -> Result<Plan, Error> {
        let refused = |setting, given: &str| {
            Err(Error::Setting {
                setting,
                given: given.to_owned(),
                allowed: "pairs of different bodies, and all of space",
            })
        };
        if query.cell.is_some() {
            return refused("owned_by", "a cell");
        }
        if let Some(given) = query.leaves_out_elements() {
            return refused("exclude", given);
        }
        let plan = self.plan_of_any(scene, query)?;
        match plan.parts.iter().any(|part| part.within) {
            true => refused("query", "self-collision"),
            false => Ok(plan),
        }
    }

    /// Asks about distances. `find` may ask which pair of two bodies that touch is the lowest.
    fn measure_distance(
        &mut self,
        scene: &Scene,
        control: &Control,
        find: impl FnOnce(
            &mut Distances,
            Work<'_>,
            &mut AskTouching<'_>,
        ) -> Result<Option<Nearest>, Error>,
    ) -> Result<Option<Nearest>, Error> {
        let Detector {
            touching,
            distances,
            runner,
            cpu,
            settings,
            stats: measured,
            ..
        } = self;
        runner.measure(measured, settings.limits(), |workers, stats| {
            let nearest = find(distances, Work { workers, control }, &mut |ids| {
                touching.lowest(scene, ids, control, (runner, cpu, settings))
            })?;
            distances.report(stats);
            Ok(nearest)
        })
    }
}

/// Asks for the lowest pair of elements of two bodies that touch.
type AskTouching<'a> = dyn FnMut([BodyId; 2]) -> Result<Option<[u32; 2]>, Error> + 'a;

/// Memory kept from call to call.
#[derive(Debug, Default)]
pub(super) struct Touching {
    pairs: Pairs,
}

impl Touching {
    /// The lowest pair of elements of two bodies that intersects.
    ///
    /// # Errors
    /// Bad positions that were written in place, a memory budget that is too small, cancellation.
    fn lowest(
        &mut self,
        scene: &Scene,
        [a, b]: [BodyId; 2],
        control: &Control,
        (runner, cpu, settings): (&Runner, &mut Cpu, &Settings),
    ) -> Result<Option<[u32; 2]>, Error> {
        let limits = Limits {
            max_pairs: None,
            ..settings.limits()
        };
        // Parts are in the order of the bodies.
        let by_second = b < a;
        let goal = Goal::Lowest { by_second };
        let plan = Plan::intersections(scene, &Query::between(a, b), goal, limits)?;
        let mut finder = LowestPair {
            clusters: cpu.clusters(),
            settings,
            key: None,
        };
        ready(runner.run(scene, &plan, control, &mut finder, &mut self.pairs))?;
        Ok(finder.key.map(|key| {
            let mut elements = plan.located(key).map(|(_, element)| element.raw());
            if by_second {
                elements.reverse();
            }
            elements
        }))
    }
}

/// Finds the lowest pair by clusters, whatever the method is.
struct LowestPair<'a> {
    clusters: &'a mut Clusters,
    settings: &'a Settings,
    key: Option<u64>,
}

impl Finder for LowestPair<'_> {
    fn method(&self) -> &'static str {
        Method::Clusters.name()
    }

    fn checks_positions(&self) -> bool {
        true
    }

    async fn find(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        self.clusters.run(job, answer, self.settings, stats)?;
        self.key = answer.lowest();
        Ok(())
    }
}
