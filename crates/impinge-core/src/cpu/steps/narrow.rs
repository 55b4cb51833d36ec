//! Stage `narrow` of steps: answers what is asked about the candidates of work items, many at a time.
//!
//! One file per test. Each gives the answers of a [`Test`](crate::narrow::Test), with which the oracle settles pairs one by one:
//!
//! ```text
//! touching   FirstContact: whether two elements touch during the step, and when first (search: the times)
//! kept       the same where elements keep a separation, or each pair a clearance of its own
//! overlaps   BoxOverlap: whether the boxes over the whole step overlap
//! near       Within: whether two elements are within a distance at the start
//! ```

mod batch;
mod contacts;
mod kept;
mod near;
mod overlaps;
mod search;
mod touching;

use crate::cpu::simd::Isa;
use crate::impacts::StepAnswer;
use crate::tuning::Tuning;

use super::world::{StepTest, World};

pub(super) use batch::{Batch, Between, Narrow, NarrowCounts};
pub(super) use contacts::FirstContacts;
use near::NearElements;
use overlaps::Overlaps;

/// One worker's tests, of which each step needs one.
#[derive(Debug, Default)]
pub(super) struct Settler {
    asked: StepTest,
    contacts: FirstContacts,
    overlaps: Overlaps,
    near: NearElements,
    pub n_candidates: u64,
}

impl Settler {
    /// Prepares for a step of `n_clusters` clusters.
    pub fn begin(&mut self, n_clusters: u64, test: StepTest, tuning: &Tuning) {
        self.asked = test;
        self.n_candidates = 0;
        match test {
            StepTest::Contacts(asked) => self.contacts.begin(n_clusters, asked, tuning),
            StepTest::Overlap { distance } => self.overlaps.begin(distance),
            StepTest::Within => self.near.begin(),
        }
    }

    fn test(&mut self) -> &mut dyn Narrow {
        match self.asked {
            StepTest::Contacts(_) => &mut self.contacts,
            StepTest::Overlap { .. } => &mut self.overlaps,
            StepTest::Within => &mut self.near,
        }
    }

    /// The contacts of the step.
    pub fn contacts(&mut self) -> &mut FirstContacts {
        &mut self.contacts
    }

    /// Contacts after this time cannot change the answer.
    pub fn until(&self, world: World<'_>) -> f64 {
        match self.asked {
            StepTest::Contacts(_) => self.contacts.until(world),
            StepTest::Overlap { .. } | StepTest::Within => world.pose.until,
        }
    }

    /// Takes the candidates of a work item.
    #[inline(always)]
    pub fn take(&mut self, isa: Isa, world: World<'_>, batch: Batch<'_>) {
        self.n_candidates += batch.met.len() as u64;
        self.test().take(isa, world, batch);
    }

    /// Settles the candidates that wait.
    pub fn settle(&mut self, isa: Isa, world: World<'_>) {
        self.test().settle(isa, world);
    }

    /// Ends a step: hands over what is left of the answer.
    pub fn end(&mut self, answer: StepAnswer<'_>) {
        self.test().end(answer);
    }

    pub fn counts(&self) -> NarrowCounts {
        match self.asked {
            StepTest::Contacts(_) => self.contacts.counts(),
            StepTest::Overlap { .. } => self.overlaps.counts(),
            StepTest::Within => self.near.counts(),
        }
    }

    pub fn bytes(&self) -> usize {
        self.contacts.bytes() + self.overlaps.bytes() + self.near.bytes()
    }
}
