//! Read-only view shared by all stages of a step: the layers, and what is known of the answer so far.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::cpu::directions::Placed;
use crate::cpu::simd::Isa;
use crate::frame::Frame;
use crate::grouping::bounds::Bounds;
use crate::grouping::clusters::Clustering;
use crate::hull::{Hull, Pose};
use crate::impacts::{Sought, StepAnswer};
use crate::index::{ClusterIx, LayerIx};
use crate::positions::Positions;
use crate::scene::Scene;
use crate::step::{Start, Toi};

use super::cache::{Caches, LayerCache};

/// The test of the pairs of a step.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) enum StepTest {
    /// Whether boxes overlap when inflated by a distance.
    Overlap { distance: f64 },
    /// Whether elements are within the distance that the frame says, at the start.
    #[default]
    Within,
    /// When elements touch first, or come within the distance that the frame says.
    Contacts(Asked),
}

/// What is asked about contacts.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Asked {
    pub sought: Sought,
    pub start: Start,
    pub toi: Toi,
}

/// What is known of the answer while workers look for it.
#[derive(Debug)]
pub(crate) struct Known {
    /// The earliest time found, as the bits of a nonnegative number.
    earliest: AtomicU64,
    is_over: AtomicBool,
}

impl Known {
    pub fn new() -> Self {
        Known {
            earliest: AtomicU64::new(f64::INFINITY.to_bits()),
            is_over: AtomicBool::new(false),
        }
    }

    /// Whether the answer is complete, so that the search can stop.
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    /// The earliest time found so far.
    pub fn earliest(&self) -> f64 {
        f64::from_bits(self.earliest.load(Ordering::Relaxed))
    }

    pub fn found(&self, sought: Sought, time: f64) {
        match sought {
            // The bits of nonnegative numbers are ordered as the numbers are.
            Sought::Earliest => {
                self.earliest.fetch_min(time.to_bits(), Ordering::Relaxed);
            }
            Sought::Any => self.is_over.store(true, Ordering::Relaxed),
            Sought::All => {}
        }
    }
}

/// Read-only view shared by all stages of a step.
#[derive(Clone, Copy)]
pub(crate) struct World<'a> {
    pub isa: Isa,
    pub scene: &'a Scene,
    pub frame: &'a Frame,
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
            margin: 0.0,
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
