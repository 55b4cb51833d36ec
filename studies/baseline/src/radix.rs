//! A radix sort of cell-element pairs: least significant digit first, stable, on all threads.
//!
//! In: entries `cell << 32 | element`. Out: the same entries, sorted by cell, and within a cell
//! in the original order. The sort uses only as many bits as cells have, in as few digits as
//! possible:
//!
//! ```text
//!  63        48 47    41 40    32 31                0
//! +------------+--------+--------+-------------------+
//! |     0      | digit 1| digit 0|     element     |     2^16 … 2^18 cells: two digits of 8 or 9 bits
//! +------------+--------+--------+-------------------+
//! ```
//!
//! A round counts the digits of each task's run of entries, sums up the counts (digit by digit, and
//! within a digit task by task), and scatters. After the sums every task knows where its entries
//! go, and no two tasks write to the same slot. Cost: per round each entry is read twice and
//! written once.

use std::sync::Mutex;

use impinge_core::workers::Workers;

/// The most bits of a digit: a round writes to up to 2,048 slots.
const MOST_BITS: u32 = 11;
/// The fewest entries of a task.
const TASK: usize = 1 << 14;
/// The lowest bit of an entry's cell.
const CELL: u32 = 32;

/// The memory of a sort, reused from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Radix {
    sorted: Vec<u64>,
    /// For each task its counts; after the sums, its places.
    counts: Vec<Mutex<Vec<u32>>>,
}

/// The destination of entries; each task writes to slots of its own.
#[derive(Clone, Copy)]
struct Slots(*mut u64);

// SAFETY: a pointer does nothing by itself; `put` states the duties of its callers.
unsafe impl Send for Slots {}
// SAFETY: as above.
unsafe impl Sync for Slots {}

impl Slots {
    /// # Safety
    /// `at` must lie within the memory pointed to, and no other task may write to it in the same
    /// round.
    #[inline(always)]
    unsafe fn put(self, at: usize, entry: u64) {
        // SAFETY: the caller guarantees it.
        unsafe { self.0.add(at).write(entry) }
    }
}

impl Radix {
    /// Sorts by cells, of which there are `n_cells`. `scratches` has one element per worker; only
    /// its length is used.
    pub fn sort<S: Send>(
        &mut self,
        entries: &mut Vec<u64>,
        n_cells: u64,
        workers: &Workers,
        scratches: &mut [S],
    ) {
        let bits = u64::BITS - n_cells.saturating_sub(1).leading_zeros();
        let n_rounds = bits.div_ceil(MOST_BITS);
        if entries.len() < 2 || n_rounds == 0 {
            return;
        }
        let digit = bits.div_ceil(n_rounds);
        self.sorted.clear();
        self.sorted.resize(entries.len(), 0);
        for round in 0..n_rounds {
            self.round(entries, CELL + round * digit, digit, workers, scratches);
            std::mem::swap(entries, &mut self.sorted);
        }
    }

    pub fn bytes(&self) -> usize {
        size_of::<u64>() * self.sorted.capacity()
            + size_of::<u32>() * (self.counts.len() << MOST_BITS)
    }

    fn round<S: Send>(
        &mut self,
        entries: &[u64],
        shift: u32,
        bits: u32,
        workers: &Workers,
        scratches: &mut [S],
    ) {
        // Several tasks per worker, so that no worker waits long for the last one.
        let task = entries.len().div_ceil(4 * workers.n()).max(TASK);
        let n_tasks = entries.len().div_ceil(task);
        let n_digits = 1usize << bits;
        let digit = |entry: u64| (entry >> shift) as usize & (n_digits - 1);
        if self.counts.len() < n_tasks {
            self.counts.resize_with(n_tasks, Mutex::default);
        }
        let run = |ix: usize| &entries[ix * task..entries.len().min((ix + 1) * task)];
        let counts = &self.counts;
        workers.for_each(scratches, n_tasks, |_, ix| {
            let mut counts = counts[ix].lock().expect("no task panics");
            counts.clear();
            counts.resize(n_digits, 0);
            for &entry in run(ix) {
                counts[digit(entry)] += 1;
            }
        });
        // Entries are fewer than 2^32, see `UniformGrid`.
        let mut slot = 0u32;
        for digit in 0..n_digits {
            for counts in &mut self.counts[..n_tasks] {
                let count = &mut counts.get_mut().expect("no task panics")[digit];
                slot += std::mem::replace(count, slot);
            }
        }
        let counts = &self.counts;
        let sorted = Slots(self.sorted.as_mut_ptr());
        let n = self.sorted.len();
        assert_eq!(n, entries.len());
        workers.for_each(scratches, n_tasks, |_, ix| {
            let mut slots = counts[ix].lock().expect("no task panics");
            for &entry in run(ix) {
                let slot = &mut slots[digit(entry)];
                debug_assert!((*slot as usize) < n);
                // SAFETY: the counts of all tasks and digits add up to `n`, and each task takes as
                // many slots of a digit as it has counted, starting where the task before it ends.
                unsafe { sorted.put(*slot as usize, entry) };
                *slot += 1;
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge_scenes::Random;

    #[test]
    fn sorts_as_the_standard_library_does() {
        let mut random = Random::new(7);
        let mut radix = Radix::default();
        for threads in [1, 2, 3] {
            let workers = Workers::new(threads);
            let mut scratches = vec![(); workers.n()];
            for n_cells in [1, 2, 3, 256, 257, 5000, 1 << 22, (1 << 25) - 3] {
                for n in [0u64, 1, 2, 1000, 100_000] {
                    let mut entries: Vec<u64> = (0..n)
                        .map(|ix| (random.bits() % n_cells) << 32 | ix)
                        .collect();
                    let mut expected = entries.clone();
                    expected.sort_unstable();
                    radix.sort(&mut entries, n_cells, &workers, &mut scratches);
                    assert!(entries == expected, "{n} entries of {n_cells} cells");
                }
            }
        }
    }
}
