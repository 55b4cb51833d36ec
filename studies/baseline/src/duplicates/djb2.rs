//! A table of pairs that loses some of them.
//!
//! Section 4.2 of the paper says that possible pairs are handled "by a hashing function", that DJB2
//! was tested, and that pairs are lost to its conflicts, but nothing more. Here a slot holds one
//! pair. While cells are paired, every possible pair goes to its slot. A repetition of the same
//! pair changes nothing; of different pairs only the lowest stays. Afterwards the pair in each
//! occupied slot is tested once.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use impinge_core::cpu::cells::Rule;
use impinge_core::cpu::cull_map::InRegion;
use impinge_core::cpu::narrow::{Candidate, Decider};
use impinge_core::cpu::subcells::SubcellQuery;
use impinge_core::cpu::world::World;
use impinge_core::scene::index::{PartIx, Slot};
use impinge_core::search::runner::Job;
use impinge_core::search::sink::Answer;
use impinge_core::simd::Isa;
use impinge_core::{Error, Stats};

use super::Possible;

/// A free slot. No pair has this value, because there are fewer than 2^32 elements.
const FREE: u64 = u64::MAX;
/// Slots per task.
const TASK: usize = 4096;

/// The table, and scratch memory for its tests.
pub(super) struct Table {
    isa: Isa,
    /// `element of a << 32 | element of b`.
    slots: Vec<AtomicU64>,
    deciders: Vec<Decider>,
}

impl Table {
    pub fn new(isa: Isa) -> Self {
        Table {
            isa,
            slots: Vec::new(),
            deciders: Vec::new(),
        }
    }

    /// Empties the table and sets the number of slots.
    pub fn clear(&mut self, n_slots: usize) -> Result<(), Error> {
        if n_slots == 0 || n_slots as u64 > 1 << 32 {
            return Err(Error::Setting {
                setting: "table size",
                given: n_slots.to_string(),
                allowed: "1 to 2^32",
            });
        }
        self.slots.truncate(n_slots);
        self.slots
            .iter_mut()
            .for_each(|slot| *slot.get_mut() = FREE);
        self.slots.resize_with(n_slots, || AtomicU64::new(FREE));
        Ok(())
    }

    pub fn rule(&self, possible: Possible) -> Insert<'_> {
        Insert {
            possible,
            slots: &self.slots,
        }
    }

    /// Tests the pairs in the table.
    pub fn decide(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let Table {
            isa,
            slots,
            deciders,
        } = self;
        deciders.resize_with(job.workers.n(), Decider::default);
        for decider in deciders.iter_mut() {
            decider.begin(answer, &impinge_core::Tuning::default());
        }
        let world = World::new(job.scene, job.plan);
        let (isa, slots) = (*isa, &slots[..]);
        stats.time("narrow", |_| {
            let n_tasks = slots.len().div_ceil(TASK);
            job.workers.for_each(deciders, n_tasks, |decider, ix| {
                for slot in slots[ix * TASK..].iter().take(TASK) {
                    let pair = slot.load(Ordering::Relaxed);
                    if pair != FREE {
                        decider.push(Candidate {
                            a: PartIx::new(0),
                            b: PartIx::new(1),
                            slot_a: Slot::new((pair >> 32) as u32),
                            slot_b: Slot::new(pair as u32),
                        });
                    }
                    decider.decide_when_full(isa, world);
                }
                decider.decide(isa, world);
            });
        });
        for decider in deciders {
            decider.end();
            stats.n_candidates += decider.n_candidates;
            stats.n_unsure += decider.n_unsure;
        }
        stats.bytes_held += size_of_val(slots) as u64;
        answer.check()
    }
}

/// The rule that puts every possible pair into its slot, without testing it.
pub(super) struct Insert<'a> {
    possible: Possible,
    slots: &'a [AtomicU64],
}

impl Rule for Insert<'_> {
    fn query(&self) -> SubcellQuery {
        self.possible.query()
    }

    #[inline(always)]
    fn admits(&self, a: &InRegion, b: &InRegion, _: &mut Vec<u64>) -> bool {
        let (a, b) = (a.element.raw(), b.element.raw());
        let pair = u64::from(a) << 32 | u64::from(b);
        let slot = &self.slots[djb2(a, b) as usize % self.slots.len()];
        // Repetitions are frequent: most of them find their pair in the slot and write nothing.
        if slot.load(Ordering::Relaxed) > pair {
            slot.fetch_min(pair, Ordering::Relaxed);
        }
        false
    }
}

/// Bernstein's hash of the bytes of two numbers, low bytes first: `hash = 33 hash + byte`, from
/// 5381, in 32 bits.
#[inline(always)]
fn djb2(a: u32, b: u32) -> u32 {
    let bytes = [a.to_le_bytes(), b.to_le_bytes()];
    bytes.as_flattened().iter().fold(5381, |hash: u32, &byte| {
        hash.wrapping_mul(33).wrapping_add(u32::from(byte))
    })
}

#[cfg(test)]
mod tests {
    use super::djb2;

    #[test]
    fn hashes_bytes_as_bernstein_does() {
        // The string "abcdefgh".
        let text = b"abcdefgh";
        let mut expected = 5381u32;
        for &byte in text {
            expected = (expected << 5)
                .wrapping_add(expected)
                .wrapping_add(byte.into());
        }
        let [a, b] = [&text[..4], &text[4..]]
            .map(|four| u32::from_le_bytes(four.try_into().expect("four bytes")));
        assert_eq!(djb2(a, b), expected);
    }
}
