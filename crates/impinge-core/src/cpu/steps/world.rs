//! Read-only view shared by all stages of a step: the parts, and what is known of the answer so
//! far.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::boxes::{BoxSource, Sweep};
use crate::bvh::bounds::Aabb;
use crate::bvh::clusters::Clustering;
use crate::cpu::directions::Placed;
use crate::cpu::lane_pairs::WorkItem;
use crate::plan::Plan;
use crate::query::goal::Goal;
use crate::query::progress::{CancelToken, Control};
use crate::scene::Scene;
use crate::scene::index::{ClusterIx, PartIx};
use crate::scene::positions::Positions;
use crate::search::found::StepAnswer;
use crate::search::runner::Job;
use crate::simd::Isa;

use super::cache::{PartCache, StepCaches};

/// What is known of the answer while workers look for it.
#[derive(Debug)]
pub(crate) struct SharedBound {
    /// The earliest time found, as the bits of a nonnegative number.
    earliest: AtomicU64,
    is_over: AtomicBool,
    cancel: Option<CancelToken>,
}

impl SharedBound {
    pub fn new(control: &Control) -> Self {
        SharedBound {
            earliest: AtomicU64::new(f64::INFINITY.to_bits()),
            is_over: AtomicBool::new(false),
            cancel: control.token().cloned(),
        }
    }

    /// Whether the search was cancelled. The candidates of a work item may take long, and a task
    /// has many items.
    pub fn is_cancelled(&self) -> bool {
        self.cancel.as_ref().is_some_and(CancelToken::is_cancelled)
    }

    /// Whether the answer is complete, so that the search can stop.
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    /// The earliest time found so far.
    pub fn earliest(&self) -> f64 {
        f64::from_bits(self.earliest.load(Ordering::Relaxed))
    }

    pub fn found(&self, goal: Goal, time: f64) {
        match goal {
            // The bits of nonnegative numbers are ordered as the numbers are.
            Goal::Earliest => {
                self.earliest.fetch_min(time.to_bits(), Ordering::Relaxed);
            }
            Goal::Any => self.is_over.store(true, Ordering::Relaxed),
            Goal::All | Goal::Count | Goal::Lowest { .. } => {}
        }
    }
}

/// For each part and cluster, the lanes of elements with a vertex that has moved: only pairs with
/// one of them are sought.
pub(super) type MovedLanes = Vec<Vec<u64>>;

/// Read-only view shared by all stages of a step.
#[derive(Clone, Copy)]
pub(crate) struct StepWorld<'a> {
    pub isa: Isa,
    pub scene: &'a Scene,
    pub plan: &'a Plan,
    /// The part of the step that is examined. Never longer than the part that the clusters' boxes
    /// cover.
    pub sweep: Sweep,
    /// The part of the step that the clusters' boxes cover.
    pub(super) boxes: Sweep,
    pub(super) answer: StepAnswer<'a>,
    pub(super) known: &'a SharedBound,
    pub(super) caches: &'a StepCaches,
    pub(super) moved: Option<&'a MovedLanes>,
}

impl Placed for StepWorld<'_> {
    #[inline(always)]
    fn placed(&self, part: PartIx) -> (&Clustering, &Positions) {
        let body = self.plan.body(self.scene, part);
        (&self.cache(part).clustering, body.positions())
    }
}

impl<'a> StepWorld<'a> {
    /// All of a step, with boxes that were made for it, whatever has moved.
    pub(super) fn new(
        isa: Isa,
        Job { scene, plan, .. }: Job<'a>,
        answer: StepAnswer<'a>,
        known: &'a SharedBound,
        caches: &'a StepCaches,
    ) -> Self {
        StepWorld {
            isa,
            scene,
            plan,
            sweep: plan.sweep(),
            boxes: plan.sweep(),
            answer,
            known,
            caches,
            moved: None,
        }
    }

    /// What makes the boxes of a part.
    #[inline(always)]
    pub(super) fn source(&self, part: PartIx) -> BoxSource<'a> {
        self.plan.boxes_of(self.scene, self.sweep, part)
    }

    /// The boxes of a cluster at the start and at the end.
    #[inline(always)]
    pub(super) fn ends(&self, part: PartIx, cluster: ClusterIx) -> [Aabb; 2] {
        let ends = self.cache(part).ends(cluster);
        if self.sweep == self.boxes {
            return ends;
        }
        // They are inflated already.
        let sweep = Sweep {
            inflation: 0.0,
            ..self.sweep
        };
        sweep.close(ends)
    }

    /// The lanes of two clusters' elements that have moved, if only pairs with one of them are
    /// sought.
    #[inline(always)]
    pub(super) fn moved(&self, item: &WorkItem) -> Option<[u64; 2]> {
        let sides = [(item.a, item.cluster_a), (item.b, item.cluster_b)];
        let moved = self.moved?;
        Some(sides.map(|(part, cluster)| moved[part.index()][cluster.index()]))
    }

    /// The cache of a part.
    #[inline(always)]
    pub(super) fn cache(&self, part: PartIx) -> &'a PartCache {
        self.caches.at(self.plan.part(part))
    }
}
