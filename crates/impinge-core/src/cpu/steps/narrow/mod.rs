//! Stage `narrow` of steps: answers what is asked about the candidates of work items, many at a
//! time.
//!
//! One file per test. Each gives the answers of a [`Test`](crate::search::narrow::Test), with which
//! the oracle decides pairs one by one:
//!
//! ```text
//! touching   FirstContact: whether two elements touch during the step, and when first (search: the
//!            times)
//! kept       the same where elements keep a separation, or each pair a clearance of its own
//! overlaps   BoxOverlap: whether the boxes over the whole step overlap
//! near       Within: whether two elements are within a distance at the start
//! listing    none: candidates that may come within a distance soon, kept for later questions
//! ```

mod batch;
mod contacts;
mod kept;
mod listing;
mod near;
mod overlaps;
mod search;
mod touching;

use crate::plan::{Plan, Question};
use crate::search::found::StepAnswer;
use crate::simd::Isa;
use crate::workers::tuning::Tuning;

use super::world::StepWorld;

pub(super) use batch::{Batch, Between, Narrow, NarrowCounts, key_in};
pub(super) use contacts::FirstContacts;
pub(super) use listing::Listing;
use near::NearElements;
use overlaps::Overlaps;

/// One worker's tests, of which each step needs one.
#[derive(Debug, Default)]
pub(super) struct StepDecider {
    question: Question,
    contacts: FirstContacts,
    overlaps: Overlaps,
    near: NearElements,
    pub listing: Listing,
    pub n_candidates: u64,
}

impl StepDecider {
    /// Prepares for a step of `n_clusters` clusters.
    pub fn begin(&mut self, n_clusters: u64, plan: &Plan, tuning: &Tuning) {
        self.question = plan.question;
        self.n_candidates = 0;
        self.listing.begin();
        // `unsure::decide` ends every question, and those that have no contacts too.
        self.contacts.forget();
        match self.question {
            Question::Contact => self.contacts.begin(n_clusters, plan, tuning),
            Question::Overlap => self.overlaps.begin(),
            Question::Nearness | Question::Intersection => self.near.begin(),
        }
    }

    fn test(&mut self) -> &mut dyn Narrow {
        match self.question {
            Question::Contact => &mut self.contacts,
            Question::Overlap => &mut self.overlaps,
            Question::Nearness | Question::Intersection => &mut self.near,
        }
    }

    /// The contacts of the step.
    pub fn contacts(&mut self) -> &mut FirstContacts {
        &mut self.contacts
    }

    /// Contacts after this time cannot change the answer.
    pub fn until(&self, world: StepWorld<'_>) -> f64 {
        match self.question {
            Question::Contact => self.contacts.until(world),
            _ => world.sweep.until,
        }
    }

    /// Takes the candidates of a work item.
    #[inline(always)]
    pub fn take(&mut self, isa: Isa, world: StepWorld<'_>, batch: Batch<'_>) {
        self.n_candidates += batch.lane_pairs.len() as u64;
        match world.answer {
            StepAnswer::Listed { .. } => self.listing.take(isa, world, batch),
            _ => self.test().take(isa, world, batch),
        }
    }

    /// Decides the candidates that wait.
    pub fn decide(&mut self, isa: Isa, world: StepWorld<'_>) {
        self.test().decide(isa, world);
    }

    /// Ends a step: hands over what is left of the answer.
    pub fn end(&mut self, answer: StepAnswer<'_>) {
        self.test().end(answer);
    }

    pub fn counts(&self) -> NarrowCounts {
        match self.question {
            Question::Contact => self.contacts.counts(),
            Question::Overlap => self.overlaps.counts(),
            Question::Nearness | Question::Intersection => self.near.counts(),
        }
    }

    pub fn bytes(&self) -> usize {
        let listing = self.listing.bytes();
        self.contacts.bytes() + self.overlaps.bytes() + self.near.bytes() + listing
    }
}
