//! Answers about distances: of two bodies, and the smallest of all pairs of bodies of a frame.

use super::best_first::{FoundNearest, ROUNDING_TURNED, limit};
use super::many::{Allowance, Bodies, are_apart, meet};
use super::nearest::Nearest;
use super::of_two::OfTwo;
use super::tree::{Node, Tree};
use crate::boxes::scale::Scale;
use crate::clusterings::Clusterings;
use crate::plan::Plan;
use crate::query::settings::Settings;
use crate::scene::Scene;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::PartIx;
use crate::search::stats::Stats;
use crate::search::work::Work;

/// Answers about distances, and what is kept from call to call.
pub(crate) struct Distances {
    of_two: OfTwo,
    /// A tree over the bodies of the last question about many.
    many: Bodies,
    /// The bodies that were nearest to each other in it.
    nearest: Option<[BodyId; 2]>,
    /// Two bodies that met when it was last asked whether any do.
    met: Option<[BodyId; 2]>,
    stack: Vec<[Node; 2]>,
}

impl Distances {
    /// Nothing is known yet but the clusterings that other questions share.
    pub fn new(settings: &Settings, clusterings: Clusterings) -> Self {
        Distances {
            of_two: OfTwo::new(clusterings),
            many: Bodies::new(settings),
            nearest: None,
            met: None,
            stack: Vec::new(),
        }
    }

    /// Forgets removed bodies: to be called first in each question about trees.
    pub fn begin(&mut self, scene: &Scene) {
        self.of_two.begin(scene);
    }

    /// The smallest distance of two bodies and the pair of elements that has it; `None` if one
    /// body has no elements.
    ///
    /// # Errors
    /// A body that is not in the scene, the same body twice, bad positions that were written in
    /// place; cancellation; errors of `touching`, which is asked for the lowest pair that touches
    /// where boxes of many clusters overlap: it may decide by pairs of clusters what this search
    /// would decide one by one.
    pub fn between(
        &mut self,
        scene: &Scene,
        [a, b]: [BodyId; 2],
        work: Work<'_>,
        touching: impl FnOnce() -> Result<Option<[u32; 2]>, Error>,
    ) -> Result<Option<Nearest>, Error> {
        if a == b {
            return Err(Error::SameBody { body: a });
        }
        let of_two = &mut self.of_two;
        of_two.begin(scene);
        for id in [a, b] {
            work.step()?;
            of_two.know(scene, id, Part::Given, work)?;
        }
        let bodies = [scene.body(a)?, scene.body(b)?];
        let boxed = [a, b].into_iter().map(|id| {
            let tree = of_two.tree(id, Part::Given);
            tree.root()
                .map_or(0.0, |root| tree.bounds(root).magnitude())
        });
        let exact = || {
            let of_bodies = bodies.map(|body| body.positions().magnitude());
            of_bodies[0].max(of_bodies[1])
        };
        let scale = Scale::of(boxed.fold(0.0, f64::max), exact);
        let most = (scale, f64::INFINITY);
        let found = of_two.search_or_ask(scene, [a, b], most, work.control, touching)?;
        Ok(found.map(|(_, nearest)| nearest))
    }

    /// The two nearest of the bodies of a frame that may meet, and their nearest elements. Of
    /// several pairs at the same distance, rounded down, the lowest.
    ///
    /// # Errors
    /// Cancellation; errors of `touching`, which is asked as in [`between`](Distances::between).
    pub fn nearest(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        work: Work<'_>,
        mut touching: impl FnMut([BodyId; 2]) -> Result<Option<[u32; 2]>, Error>,
    ) -> Result<Option<Nearest>, Error> {
        let Distances { of_two, many, .. } = self;
        of_two.begin(scene);
        many.update(scene, plan)?;
        // The bodies that were nearest last are a good bound.
        let likely = self.nearest.map(|ids| ids.map(|id| plan.part_of(id)));
        let scale = Scale::of(many.magnitude(), || {
            let bodies = plan
                .parts
                .iter()
                .filter_map(|part| scene.body(part.id).ok());
            bodies.fold(0.0, |most, body| body.positions().magnitude().max(most))
        });
        let mut nearest = NearestTwo {
            scene,
            plan,
            work,
            scale,
            error: ROUNDING_TURNED * many.magnitude(),
            best: None,
            n_asked: 0,
        };
        let mut ask = |nearest: &mut NearestTwo<'_>, boxes: &Bodies, pair: [PartIx; 2]| {
            nearest.ask(of_two, boxes, pair, &mut touching)
        };
        if let Some([Some(a), Some(b)]) = likely {
            ask(&mut nearest, many, [a, b])?;
        }
        let mut overlapping = Vec::new();
        // If two touch, only lower ones that touch are left to be found.
        let least = nearest.touching_ones();
        let last = least.and_then(|[a, _]| plan.part_of(a));
        let few = many.few(plan, last);
        many.overlapping(few.as_deref(), &mut |pair| {
            let is_lower = |least: [BodyId; 2]| pair.map(|part| plan.part(part).id) < least;
            if least.is_none_or(is_lower) {
                overlapping.push(pair);
            }
            Ok(false)
        })?;
        overlapping.sort_unstable();
        for pair in overlapping {
            ask(&mut nearest, many, pair)?;
        }
        // Bodies whose boxes are apart do not touch.
        if nearest.touching_ones().is_none() {
            let mut apart = many.apart(few.as_deref());
            while let Some(pair) = apart.next(nearest.most()) {
                ask(&mut nearest, many, pair)?;
            }
        }
        let found = nearest.best.map(|(_, nearest)| nearest);
        self.nearest = found.map(|nearest| nearest.bodies());
        Ok(found)
    }

    /// Whether any elements of bodies of a frame meet, if that is soon known. The frame must be
    /// about pairs of different bodies.
    ///
    /// # Errors
    /// Cancellation.
    pub fn any(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        work: Work<'_>,
    ) -> Result<Option<bool>, Error> {
        let Distances {
            of_two,
            many,
            met,
            stack,
            ..
        } = self;
        of_two.begin(scene);
        many.update(scene, plan)?;
        let mut allowance = Allowance(ALLOWANCE);
        let mut any = Some(false);
        // Bodies that met last may still do so.
        let likely = met.map(|ids| ids.map(|id| plan.part_of(id)));
        let mut ask = |pair: [PartIx; 2]| {
            let [a, b] = pair;
            if plan.test(a, b).is_none() {
                return Ok(false);
            }
            work.step()?;
            let ids = pair.map(|part| plan.part(part).id);
            for id in ids {
                of_two.know(scene, id, Part::Given, work)?;
            }
            let bodies = pair.map(|part| plan.body(scene, part));
            let trees = ids.map(|id| of_two.tree(id, Part::Given));
            any = meet(bodies, trees, &mut allowance, stack);
            if any == Some(true) {
                *met = Some(ids);
            }
            Ok(any != Some(false))
        };
        let is_over = match likely {
            Some([Some(a), Some(b)]) => ask([a, b])?,
            _ => false,
        };
        if !is_over {
            let few = many.few(plan, None);
            many.overlapping(few.as_deref(), &mut ask)?;
        }
        Ok(any)
    }

    /// Says what the last question clustered, and the bytes of the trees.
    pub fn report(&self, stats: &mut Stats) {
        self.of_two.report(stats);
    }

    /// The tree of a part of a body in its current pose.
    ///
    /// # Errors
    /// A stale id, bad positions that were written in place.
    pub fn tree(
        &mut self,
        scene: &Scene,
        (id, part): (BodyId, Part),
        work: Work<'_>,
    ) -> Result<&Tree, Error> {
        let part = scene.body(id)?.canonical(part);
        self.of_two.know(scene, id, part, work)?;
        Ok(self.of_two.tree(id, part))
    }
}

/// How much work [`Distances::any`] does before it leaves a scene to the whole machinery: some 50
/// microseconds.
const ALLOWANCE: u32 = 20_000;

/// The two nearest of the bodies of a frame, so far.
struct NearestTwo<'a> {
    scene: &'a Scene,
    plan: &'a Plan,
    work: Work<'a>,
    scale: Scale,
    /// What rounding may do to distances of boxes.
    error: f64,
    /// The square of the smallest distance, as computed and in the scale, and who has it.
    best: FoundNearest,
    /// How many pairs of bodies were searched.
    n_asked: u64,
}

impl NearestTwo<'_> {
    /// Takes a pair of bodies if it is nearer, or as near and lower.
    ///
    /// # Errors
    /// As [`Distances::nearest`].
    fn ask(
        &mut self,
        of_two: &mut OfTwo,
        boxes: &Bodies,
        pair: [PartIx; 2],
        touching: impl FnOnce([BodyId; 2]) -> Result<Option<[u32; 2]>, Error>,
    ) -> Result<(), Error> {
        let (scene, plan, scale) = (self.scene, self.plan, self.scale);
        if plan.test(pair[0], pair[1]).is_none() {
            return Ok(());
        }
        let ids = pair.map(|part| plan.part(part).id);
        let most = match self.best {
            None => f64::INFINITY,
            Some((0.0, _)) => 0.0,
            // Not by the distance that was computed: other bodies may have larger coordinates, and
            // larger errors.
            Some((_, best)) => {
                scale.length(best.distance.next_up()).powi(2) * (1.0 + 4.0 * f64::EPSILON)
            }
        };
        // Nothing is nearer than 0, and no lower pair of bodies is asked later.
        if most == 0.0 && self.best.is_some_and(|(_, best)| best.bodies() <= ids) {
            return Ok(());
        }
        let bodies = pair.map(|part| plan.body(scene, part));
        if scale.is_one() && are_apart(bodies, boxes.boxes(pair), most.sqrt(), self.error) {
            return Ok(());
        }
        self.n_asked += 1;
        let control = self.work.control;
        control.step(self.n_asked, self.n_asked + 1)?;
        for id in ids {
            of_two.know(scene, id, Part::Given, self.work)?;
        }
        let found = of_two.search_or_ask(scene, ids, (scale, most), control, || touching(ids))?;
        if let Some(found) = found
            && self.best.is_none_or(|(_, best)| {
                let distances = (found.1.distance, best.distance);
                distances.0 < distances.1 || (distances.0 == distances.1 && ids < best.bodies())
            })
        {
            self.best = Some(found);
        }
        Ok(())
    }

    /// The two nearest bodies, if they touch.
    fn touching_ones(&self) -> Option<[BodyId; 2]> {
        let touches = self.best.filter(|(squared, _)| *squared == 0.0);
        touches.map(|(_, nearest)| nearest.bodies())
    }

    /// The largest squared distance of boxes of bodies that may be nearer than the best two.
    fn most(&self) -> f64 {
        match self.best {
            None => f64::INFINITY,
            // A square that underflows is far below that of the error.
            Some((squared, _)) => limit(self.scale.length_back(squared.sqrt()).powi(2), self.error),
        }
    }
}
