//! The bytes of what is kept of many bodies, of which a question touches few.

/// What a slot counts while it is open.
const OPEN: usize = usize::MAX;

/// A sum over slots. Slots that a question touches are measured whenever the sum is asked for, all
/// others were measured when they were settled: so a question about two of many bodies costs no
/// more than one about two of two.
#[derive(Debug, Default)]
pub(super) struct BytesHeld {
    /// The bytes of each settled slot.
    bytes: Vec<usize>,
    /// Their sum.
    settled: usize,
    /// The slots that may have changed since.
    open: Vec<usize>,
}

impl BytesHeld {
    /// From now on, a slot may change.
    pub fn touch(&mut self, slot: usize) {
        if self.bytes.len() <= slot {
            self.bytes.resize(slot + 1, 0);
        }
        let bytes = std::mem::replace(&mut self.bytes[slot], OPEN);
        if bytes != OPEN {
            self.settled -= bytes;
            self.open.push(slot);
        }
    }

    /// Measures the open slots. None changes until it is touched.
    pub fn settle(&mut self, measure: impl Fn(usize) -> usize) {
        for slot in self.open.drain(..) {
            let bytes = measure(slot);
            self.bytes[slot] = bytes;
            self.settled += bytes;
        }
    }

    /// The sum over all slots.
    pub fn total(&self, measure: impl Fn(usize) -> usize) -> usize {
        let open = self.open.iter().map(|&slot| measure(slot));
        self.settled + open.sum::<usize>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn slots_that_are_not_touched_are_not_measured_again() {
        let mut held = vec![0; 1000];
        let n_measured = Cell::new(0);
        let mut bytes_held = BytesHeld::default();
        for round in 0..20 {
            for slot in [round, 3, 999 - round] {
                bytes_held.touch(slot);
                held[slot] += round + 1;
            }
            n_measured.set(0);
            let measure = |slot: usize| {
                n_measured.set(n_measured.get() + 1);
                held[slot]
            };
            assert_eq!(
                bytes_held.total(measure),
                held.iter().sum::<usize>(),
                "{round}"
            );
            assert_eq!(n_measured.get(), if round == 3 { 2 } else { 3 });
            // What was touched may grow until it is settled.
            held[3] += 5;
            let measure = |slot: usize| held[slot];
            assert_eq!(
                bytes_held.total(measure),
                held.iter().sum::<usize>(),
                "{round}"
            );
            bytes_held.settle(measure);
        }
    }
}
