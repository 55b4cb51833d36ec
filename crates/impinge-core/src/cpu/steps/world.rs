//! Read-only view shared by all stages of a step: the question, the layers, and what is known of the answer so far.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::frame::Frame;
use crate::impacts::StepAnswer;
use crate::index::LayerIx;
use crate::scene::Scene;
use crate::step::{Start, Toi};

use super::cache::{Caches, LayerCache};
use super::hull::Pose;

/// What to look for in a step.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Sought {
    /// Every contact.
    All,
    /// The earliest contact, and all whose times may round to the same time.
    Earliest,
    /// Any contact.
    Any,
    /// Boxes that overlap when inflated by this much.
    Boxes(f64),
    /// Elements within the distance that the frame says, at the start.
    Within,
}

/// The question about a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Asked {
    pub sought: Sought,
    pub start: Start,
    pub toi: Toi,
    pub pose: Pose,
    /// Contacts later than this are not wanted.
    pub latest: f64,
}

/// What is known of the answer while workers look for it.
#[derive(Debug)]
pub(crate) struct Known {
    /// The earliest time found, as the bits of a nonnegative number.
    earliest: AtomicU64,
    is_over: AtomicBool,
}

impl Known {
    pub fn new(latest: f64) -> Self {
        Known {
            earliest: AtomicU64::new(latest.to_bits()),
            is_over: AtomicBool::new(false),
        }
    }

    /// Whether the answer is complete, so that the search can stop.
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    /// The earliest time found so far.
    fn earliest(&self) -> f64 {
        f64::from_bits(self.earliest.load(Ordering::Relaxed))
    }

    pub fn found(&self, sought: Sought, time: f64) {
        match sought {
            // The bits of nonnegative numbers are ordered as the numbers are.
            Sought::Earliest => {
                self.earliest.fetch_min(time.to_bits(), Ordering::Relaxed);
            }
            Sought::Any => self.is_over.store(true, Ordering::Relaxed),
            Sought::All | Sought::Boxes(_) | Sought::Within => {}
        }
    }
}

/// Read-only view shared by all stages of a step.
#[derive(Clone, Copy)]
pub(crate) struct World<'a> {
    pub scene: &'a Scene,
    pub frame: &'a Frame,
    pub asked: Asked,
    pub(super) answer: StepAnswer<'a>,
    pub(super) known: &'a Known,
    pub(super) caches: &'a Caches,
}

impl<'a> World<'a> {
    /// Contacts later than this are not wanted.
    #[inline(always)]
    pub(super) fn until(&self) -> f64 {
        match self.asked.sought {
            // Contacts that are later by less than rounding are wanted, for their keys may be lower.
            Sought::Earliest => {
                let time = self.known.earliest();
                let later = (time * (1.0 + 2f64.powi(-22))).max(f64::from(f32::MIN_POSITIVE));
                later.min(1.0)
            }
            Sought::All | Sought::Any | Sought::Boxes(_) | Sought::Within => 1.0,
        }
    }

    /// How the boxes of a layer are made.
    #[inline(always)]
    pub(super) fn pose(&self, layer: LayerIx) -> Pose {
        self.asked.pose.of(self.frame, layer)
    }

    /// The cache of a layer.
    #[inline(always)]
    pub(super) fn cache(&self, layer: LayerIx) -> &'a LayerCache {
        self.caches.at(self.frame.layer(layer))
    }
}
