//! The cache of a part: its clusters, and their boxes at the start and at the end of a step.

use std::sync::Arc;

use crate::boxes::{BoxSource, Sweep};
use crate::bvh::bounds::{Aabb, BoundsArray, RawBoundsArray};
use crate::bvh::clusters::Clustering;
use crate::clusterings::{BodyPart, Clustered, Clusterings, Fit, Store, spread};
use crate::cpu::bounds::TreeBounds;
use crate::cpu::traversal::BodyTree;
use crate::plan::{OwnRule, Plan};
use crate::query::settings::Settings;
use crate::scene::Body;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::index::{ClusterIx, PartIx};
use crate::search::runner::Job;
use crate::search::stats::Stats;
use crate::search::work::Work;
use crate::simd::{Isa, Simd, with_isa};

use super::excluded::ExcludedLanes;

/// Clusters per task.
const CLUSTERS: usize = 128;

/// By slot of the body, then by part: vertices, edges and faces.
pub(super) type StepCaches = Store<PartCache, 3>;

/// What boxes belong to: the stamp of the step, their sweep, and the stamp of the thickness of
/// elements that have their own.
type BoxesOf = (u64, Sweep, Option<u64>);

fn boxes_of(plan: &Plan, body: &Body, sweep: Sweep, part: PartIx) -> BoxesOf {
    let each = plan.thickness_of_each(part).map(|(_, stamp)| stamp);
    (body.step_stamp(), plan.sweep_of(sweep, part), each)
}

/// The data kept per part from step to step.
#[derive(Debug)]
pub(super) struct PartCache {
    /// The stamp of the topology that was clustered.
    pub topology_stamp: u64,
    /// What the boxes belong to.
    of: Option<BoxesOf>,
    pub clustering: Arc<Clustering>,
    /// Boxes that hold the start and the end.
    bounds: TreeBounds,
    /// The clusters' boxes at the start, and at the end.
    ends: [BoundsArray; 2],
    /// How well the clusters have fitted the part, by boxes of the start and by those of the whole
    /// path, which are larger: questions with either take turns.
    fits: [Fit; 2],
    /// The pairs with the body's vertices, edges and faces that the question excludes.
    excluded: [Option<Arc<ExcludedLanes>>; 3],
    /// Those of the last questions, the latest last.
    kept: Vec<Exclusions>,
}

/// The excluded pairs of a part with another of its body, and what they depend on.
#[derive(Debug)]
struct Exclusions {
    other: Arc<Clustering>,
    rule: OwnRule,
    /// `None` if there are too many.
    lanes: Option<Arc<ExcludedLanes>>,
}

/// For how many parts and rules a part keeps its excluded pairs.
const MOST_KEPT: usize = 6;

impl PartCache {
    /// What is kept beside the clusters of a part of a body; no boxes yet.
    pub fn new(body: &Body, clustering: Arc<Clustering>) -> Self {
        let mut bounds = TreeBounds::default();
        bounds.resize(&clustering.shape);
        let mut ends = [BoundsArray::default(), BoundsArray::default()];
        for end in &mut ends {
            end.resize(clustering.n_clusters());
        }
        PartCache {
            topology_stamp: body.topology_stamp(),
            of: None,
            clustering,
            bounds,
            ends,
            fits: [Fit::UNKNOWN; 2],
            excluded: [const { None }; 3],
            kept: Vec::new(),
        }
    }

    /// The pairs with another part of the body that the question excludes, if they are known.
    #[inline(always)]
    pub fn excluded_with(&self, other: Part) -> Option<&ExcludedLanes> {
        self.excluded[StepCaches::ix(other)].as_deref()
    }

    #[inline(always)]
    pub fn tree(&self) -> BodyTree<'_> {
        BodyTree {
            shape: &self.clustering.shape,
            bounds: &self.bounds,
        }
    }

    /// The boxes of a cluster at the start and at the end.
    #[inline(always)]
    pub fn ends(&self, cluster: ClusterIx) -> [Aabb; 2] {
        self.ends.each_ref().map(|end| end.at(cluster.index()))
    }

    /// How well the clusters fit the current pose: the clusters' summed surface divided by the
    /// part's. Of boxes at the start without their inflation: where bodies move to, and how far
    /// boxes reach, differs from question to question.
    fn spread(&self, inflation: f64) -> f64 {
        let (mut surface, mut whole) = (0.0, Aabb::EMPTY);
        for ix in 0..self.clustering.n_clusters() {
            let bounds = self.ends[0].at(ix);
            surface += bounds.half_area_within(inflation);
            whole.join(&bounds);
        }
        spread(surface, whole.half_area_within(inflation))
    }
}

/// Finds the excluded pairs of each body of which some are left out, unless they are known. With a
/// memory budget none are: candidates are compared one by one.
///
/// # Errors
/// There is no memory; cancellation.
pub(super) fn exclude(
    job: Job<'_>,
    settings: &Settings,
    caches: &mut StepCaches,
) -> Result<(), Error> {
    let Job {
        plan,
        workers,
        control,
        ..
    } = job;
    let work = Work { workers, control };
    for part in &plan.parts {
        caches.at_mut(part).excluded = [const { None }; 3];
    }
    if !plan.leaves_out() || settings.memory_budget.is_some() {
        return Ok(());
    }
    // By slot of the body, in the order of the plan.
    let mut of_bodies: Vec<[Option<PartIx>; 3]> = Vec::new();
    for (ix, part) in plan.numbered_parts() {
        let slot = part.id.index();
        of_bodies.resize(of_bodies.len().max(slot + 1), [None; 3]);
        of_bodies[slot][StepCaches::ix(part.part)] = Some(ix);
    }
    for parts in &of_bodies {
        // The parts of a body have the same.
        let rule = parts.iter().flatten().next().map(|&of| plan.own_rule(of));
        let Some(rule) = rule.filter(|rule| !rule.is_empty()) else {
            continue;
        };
        for (n_before, &a) in parts.iter().enumerate() {
            for &b in &parts[n_before..] {
                if let (Some(a), Some(b)) = (a, b)
                    && plan.test(a, b).is_some()
                {
                    let other = plan.part(b);
                    let of_other = Arc::clone(&caches.at(other).clustering);
                    let cache = caches.at_mut(plan.part(a));
                    let found = cache.find_excluded(plan, [a, b], of_other, &rule, work)?;
                    cache.excluded[StepCaches::ix(other.part)] = found;
                }
            }
        }
    }
    Ok(())
}

impl PartCache {
    /// The pairs with a part of the same body that a rule excludes; `None` if there are too many.
    fn find_excluded(
        &mut self,
        plan: &Plan,
        parts: [PartIx; 2],
        other: Arc<Clustering>,
        rule: &OwnRule,
        work: Work<'_>,
    ) -> Result<Option<Arc<ExcludedLanes>>, Error> {
        let is_same = |kept: &Exclusions| Arc::ptr_eq(&kept.other, &other) && kept.rule.is(rule);
        let kept = match self.kept.iter().position(is_same) {
            Some(known) => self.kept.remove(known),
            None => Exclusions {
                lanes: ExcludedLanes::new(plan, parts, [&self.clustering, &other], rule, work)?,
                rule: rule.clone(),
                other,
            },
        };
        let lanes = kept.lanes.clone();
        if self.kept.len() == MOST_KEPT {
            self.kept.remove(0);
        }
        self.kept.push(kept);
        Ok(lanes)
    }
}

impl Clustered for PartCache {
    fn topology_stamp(&self) -> u64 {
        self.topology_stamp
    }

    fn clustering(&self) -> &Arc<Clustering> {
        &self.clustering
    }

    fn bytes(&self) -> usize {
        let ends: usize = self.ends.iter().map(BoundsArray::bytes).sum();
        let kept = self.kept.iter().filter_map(|kept| kept.lanes.as_ref());
        let kept: usize = kept.map(|lanes| lanes.bytes()).sum();
        size_of::<PartCache>() + self.bounds.bytes() + ends + kept
    }
}

/// Some clusters of a part.
#[derive(Debug, Clone, Copy)]
struct BoxTask {
    part: PartIx,
    first: usize,
    end: usize,
    /// Where boxes are written.
    leaves: RawBoundsArray,
    ends: [RawBoundsArray; 2],
}

/// Computes the boxes of all parts that have moved, or whose boxes were made for another [`Sweep`];
/// parts that have flowed away from their clusters are clustered again.
pub(super) fn refit<S: Send>(
    isa: Isa,
    job: Job<'_>,
    settings: &Settings,
    sweep: Sweep,
    (clusterings, caches): (&Clusterings, &mut StepCaches),
    scratches: &mut [S],
    stats: &mut Stats,
) -> Result<(), Error> {
    find_boxes(isa, job, settings, sweep, caches, scratches);
    let Job {
        scene,
        plan,
        workers,
        control,
    } = job;
    let work = Work { workers, control };
    let mut is_stale = false;
    for (ix, part) in plan.numbered_parts() {
        let body = plan.body(scene, ix);
        let cache = caches.at_mut(part);
        let of = boxes_of(plan, body, sweep, ix);
        if cache.of == Some(of) {
            continue;
        }
        cache.bounds.refit_above(0, &cache.clustering.shape);
        cache.of = Some(of);
        let Sweep {
            inflation,
            is_swept,
            until,
        } = of.1;
        let spread = cache.spread(inflation);
        let is_of_path = is_swept && until > Sweep::NEARLY_STILL;
        let fit = &mut cache.fits[usize::from(is_of_path)];
        let body_part = BodyPart::new(part.id, body, part.part);
        let mut known = clusterings.lock();
        if let Some(clustering) = known.renew_if_stale(body_part, (fit, spread), work, stats)? {
            *cache = PartCache::new(body, clustering);
            is_stale = true;
        }
    }
    if is_stale {
        // New clusters have the best spread so far, so this recursion ends.
        let clustered = (clusterings, caches);
        refit(isa, job, settings, sweep, clustered, scratches, stats)?;
    }
    Ok(())
}

fn find_boxes<S: Send>(
    isa: Isa,
    job: Job<'_>,
    settings: &Settings,
    sweep: Sweep,
    caches: &mut StepCaches,
    scratches: &mut [S],
) {
    let Job {
        scene,
        plan,
        workers,
        ..
    } = job;
    let n_clusters = |part| caches.at(part).clustering.n_clusters();
    let n_each = workers.task(CLUSTERS);
    let n_tasks = plan
        .parts
        .iter()
        .map(|part| n_clusters(part).div_ceil(n_each));
    let mut tasks = Vec::with_capacity(n_tasks.sum());
    for (ix, part) in plan.numbered_parts() {
        let body = plan.body(scene, ix);
        let cache = caches.at_mut(part);
        if cache.of == Some(boxes_of(plan, body, sweep, ix)) {
            continue;
        }
        cache.of = None;
        let PartCache {
            clustering,
            bounds,
            ends: [start, end],
            ..
        } = cache;
        let Some(leaves) = bounds.levels.first_mut() else {
            continue;
        };
        let n = clustering.n_clusters();
        let task = BoxTask {
            part: ix,
            first: 0,
            end: 0,
            leaves: leaves.raw(),
            ends: [start.raw(), end.raw()],
        };
        tasks.extend((0..n).step_by(n_each).map(|first| BoxTask {
            first,
            end: n.min(first + n_each),
            ..task
        }));
    }
    let parallel = plan.n_elements() >= settings.tuning.step_bounds_parallel_from;
    let n_workers = if parallel { workers.n() } else { 1 };
    let caches = &*caches;
    workers.for_each(&mut scratches[..n_workers], tasks.len(), |_, ix| {
        let task = tasks[ix];
        let part = plan.part(task.part);
        let clustering = &caches.at(part).clustering;
        let source = plan.boxes_of(scene, sweep, task.part);
        with_isa!(isa, find, (
            clustering: &Clustering = clustering,
            source: BoxSource<'_> = source,
            task: BoxTask = task,
        ));
    });
}

#[inline(always)]
fn find<S: Simd>(simd: S, clustering: &Clustering, source: BoxSource<'_>, task: BoxTask) {
    for cluster in task.first..task.end {
        let ends = source.of_cluster(simd, clustering, ClusterIx::from_usize(cluster));
        let mut both = ends[0];
        both.join(&ends[1]);
        // SAFETY: no two tasks have the same cluster, and no thread reads boxes before all tasks
        // are done.
        unsafe {
            task.leaves.put(cluster, &both);
            task.ends[0].put(cluster, &ends[0]);
            task.ends[1].put(cluster, &ends[1]);
        }
    }
}
