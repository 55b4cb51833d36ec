//! When the clusters of a body should be sorted, and how cautiously: what earlier frames suggest.
//! No answer depends on it.

use std::ops::RangeInclusive;

use crate::bvh::bounds::{Aabb, greater};
use crate::workers::tuning::Tuning;

use super::extents::FreeSides;

/// When a body's clusters should be sorted, and how cautiously.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outlook {
    /// Frames to wait before sorting.
    wait: u32,
    /// Frames to wait the next time that groups come back too often.
    next_wait: u32,
    /// Frames since all clusters were sorted.
    age: u32,
    /// Frames since each group was sorted.
    ages: [u32; 6],
    /// Grows by one per frame; sorting groups again costs `cost`.
    credit: u32,
    /// How far beside the other bodies a cluster must be to be in a group, as a share of the body's
    /// longest side.
    slack: [f32; 6],
    /// Sorting groups again costs as much as they save in this many frames.
    cost: u32,
    /// Frames after which all boxes are found again.
    lasts: u32,
}

/// Frames that a group should last.
const LASTS: u32 = 24;
const SLACK: RangeInclusive<f32> = 1.0 / 128.0..=0.25;

impl Outlook {
    pub fn new(tuning: &Tuning) -> Self {
        Outlook {
            // The second frame shows whether the body moves.
            wait: 2,
            next_wait: 1,
            age: 0,
            ages: [0; 6],
            credit: 0,
            slack: [*SLACK.start(); 6],
            cost: tuning.culled_cost,
            lasts: tuning.culled_lasts,
        }
    }

    /// Whether it is too early to sort clusters.
    pub fn waits(&self) -> bool {
        self.wait > 0
    }

    /// Whether all boxes are to be found again.
    pub fn is_old(&self) -> bool {
        self.age >= self.lasts
    }

    /// The slacks for a body of this size.
    pub fn slack(&self, whole: &Aabb) -> [f32; 6] {
        let sides = [0, 1, 2].map(|axis| whole.max[axis] - whole.min[axis]);
        let longest = greater(sides[0], greater(sides[1], sides[2]));
        self.slack.map(|slack| slack * longest)
    }

    pub fn grow_older(&mut self, is_sorted: bool) {
        self.wait = self.wait.saturating_sub(1);
        self.age += u32::from(is_sorted);
        self.ages = self.ages.map(|age| age.saturating_add(1));
        self.credit = self
            .credit
            .saturating_add(1)
            .min(self.cost.saturating_mul(4));
    }

    /// All clusters are sorted now.
    pub fn begin(&mut self) {
        if self.is_old() {
            self.next_wait = 1;
            self.slack = self.slack.map(|slack| slack_for(slack, self.lasts));
        }
        self.age = 0;
        self.ages = [0; 6];
        self.credit = self.cost;
    }

    /// Groups have come back: returns whether it pays to sort them again.
    pub fn affords(&mut self, groups: FreeSides) -> bool {
        for side in groups.sides() {
            let group = side.number();
            self.slack[group] = slack_for(self.slack[group], self.ages[group]);
            self.ages[group] = 0;
        }
        if self.credit >= self.cost {
            self.credit -= self.cost;
            return true;
        }
        self.pause();
        false
    }

    /// Makes the sorting wait, longer each time.
    pub fn pause(&mut self) {
        self.wait = self.next_wait;
        self.next_wait = self.next_wait.saturating_mul(2).min(self.lasts);
    }

    /// Too few clusters lie beside the other bodies: waits before they are sorted again.
    pub fn too_few(&mut self) {
        self.wait = self.lasts / 4;
    }
}

/// The slack with which a group would have lasted [`LASTS`] frames, given that it lasted `age`
/// frames with this one.
fn slack_for(slack: f32, age: u32) -> f32 {
    (slack * LASTS as f32 / (age as f32 + 1.0)).clamp(*SLACK.start(), *SLACK.end())
}
