//! Read-only view shared by all stages of a step: the layers, and what is known of the answer so far.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::cpu::directions::Placed;
use crate::cpu::simd::Isa;
use crate::found::StepAnswer;
use crate::grouping::bounds::Bounds;
use crate::grouping::clusters::Clustering;
use crate::hull::{Hull, Pose};
use crate::index::{ClusterIx, LayerIx};
use crate::plan::Plan;
use crate::positions::Positions;
use crate::progress::{CancelToken, Control};
use crate::scene::Scene;
use crate::sink::Goal;

use super::cache::{Caches, LayerCache};

/// What is known of the answer while workers look for it.
#[derive(Debug)]
pub(crate) struct Known {
    /// The earliest time found, as the bits of a nonnegative number.
    earliest: AtomicU64,
    is_over: AtomicBool,
    cancel: Option<CancelToken>,
}

impl Known {
    pub fn new(control: &Control<'_>) -> Self {
        Known {
            earliest: AtomicU64::new(f64::INFINITY.to_bits()),
            is_over: AtomicBool::new(false),
            cancel: control.token().cloned(),
        }
    }

    /// Whether the search was cancelled. The candidates of a work item may take long, and a task has many items.
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

/// Read-only view shared by all stages of a step.
#[derive(Clone, Copy)]
pub(crate) struct World<'a> {
    pub isa: Isa,
    pub scene: &'a Scene,
    pub frame: &'a Plan,
    /// The part of the step that is examined. Never longer than the part that the clusters' boxes cover.
    pub pose: Pose,
    /// The part of the step that the clusters' boxes cover.
    pub(super) boxes: Pose,
    pub(super) answer: StepAnswer<'a>,
    pub(super) known: &'a Known,
    pub(super) caches: &'a Caches,
}

impl Placed for World<'_> {
    #[inline(always)]
    fn placed(&self, layer: LayerIx) -> (&Clustering, &Positions) {
        let body = self.frame.body(self.scene, layer);
        (&self.cache(layer).clustering, body.positions())
    }
}

impl<'a> World<'a> {
    /// What makes the boxes of a layer.
    #[inline(always)]
    pub(super) fn hull(&self, layer: LayerIx) -> Hull<'a> {
        let body = self.frame.body(self.scene, layer);
        Hull::new(body, self.frame.pose(self.pose, layer))
    }

    /// The boxes of a cluster at the start and at the end.
    #[inline(always)]
    pub(super) fn ends(&self, layer: LayerIx, cluster: ClusterIx) -> [Bounds; 2] {
        let ends = self.cache(layer).ends(cluster);
        if self.pose == self.boxes {
            return ends;
        }
        // They are inflated already.
        let pose = Pose {
            inflation: 0.0,
            ..self.pose
        };
        pose.close(ends)
    }

    /// The cache of a layer.
    #[inline(always)]
    pub(super) fn cache(&self, layer: LayerIx) -> &'a LayerCache {
        self.caches.at(self.frame.layer(layer))
    }
}
