//! Sorts the keys of a large answer on all threads.
//!
//! A key is a pair of numbers, lower number first, and few numbers have many partners. So keys are counted by their lower
//! number, the partners of each number are put together in one pass, and threads sort these short runs:
//!
//! ```text
//! keys       | 5 9 | 2 7 | 5 6 | 2 3 |   as they were found
//! partners   | 7 3 | 9 6 |               of 2, of 5
//! keys       | 2 3 | 2 7 | 5 6 | 5 9 |   each run sorted, and written back
//! ```
//!
//! Memory, kept from answer to answer: four bytes per key and per number.

use std::sync::Mutex;

use crate::error::Error;
use crate::settings::Settings;
use crate::sink;
use crate::workers::Workers;

/// With fewer keys than this, or than half as many as numbers, one thread sorts them in place as fast.
const FROM: usize = 1 << 15;
/// Keys per task.
const TASK: usize = 1 << 14;

/// The memory to sort in.
#[derive(Debug)]
pub(crate) struct Sorter {
    /// Under a memory budget.
    in_place: bool,
    /// Where the partners of each number end.
    ends: Vec<u32>,
    partners: Vec<u32>,
}

/// Runs of consecutive lower numbers, from `first` on.
struct Task<'a> {
    keys: &'a mut [u64],
    partners: &'a mut [u32],
    first: usize,
    ends: &'a [u32],
}

impl Sorter {
    /// For detectors with these settings: a memory budget has no room to sort in.
    pub fn new(settings: &Settings) -> Self {
        Sorter {
            in_place: settings.memory_budget.is_some(),
            ends: Vec::new(),
            partners: Vec::new(),
        }
    }

    /// Sorts keys of numbers below `n_numbers`. Where there is no memory for that, sorts them in place.
    pub fn sort(&mut self, keys: &mut [u64], n_numbers: u64, workers: &Workers) {
        let n_numbers = n_numbers as usize;
        let is_worth = keys.len() >= FROM.max(n_numbers / 2) && u32::try_from(keys.len()).is_ok();
        if self.in_place || !is_worth || self.make_room(keys.len(), n_numbers).is_err() {
            keys.sort_unstable();
            return;
        }
        let Sorter { ends, partners, .. } = self;
        for key in &*keys {
            ends[(key >> 32) as usize] += 1;
        }
        let mut start = 0;
        for end in &mut *ends {
            start += std::mem::replace(end, start);
        }
        // Each end is a start until the partners are there.
        for key in &*keys {
            let end = &mut ends[(key >> 32) as usize];
            partners[*end as usize] = *key as u32;
            *end += 1;
        }
        let tasks: Vec<_> = tasks(keys, partners, ends).map(Mutex::new).collect();
        workers.for_each(&mut vec![(); workers.n()], tasks.len(), |(), ix| {
            if let Ok(mut task) = tasks[ix].lock() {
                task.run();
            }
        });
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (size_of::<u32>() * (self.ends.capacity() + self.partners.capacity())) as u64
    }

    fn make_room(&mut self, n_keys: usize, n_numbers: usize) -> Result<(), Error> {
        self.ends.clear();
        self.partners.clear();
        sink::reserve(&mut self.ends, n_numbers, "room to sort pairs")?;
        sink::reserve(&mut self.partners, n_keys, "room to sort pairs")?;
        self.ends.resize(n_numbers, 0);
        self.partners.resize(n_keys, 0);
        Ok(())
    }
}

/// Parts of about equally many keys.
fn tasks<'a>(
    mut keys: &'a mut [u64],
    mut partners: &'a mut [u32],
    ends: &'a [u32],
) -> impl Iterator<Item = Task<'a>> {
    let (mut first, mut start) = (0, 0);
    std::iter::from_fn(move || {
        if first == ends.len() {
            return None;
        }
        let full = ends[first..].partition_point(|&end| (end as usize) < start + TASK);
        let ends = &ends[first..ends.len().min(first + full + 1)];
        let end = ends[ends.len() - 1] as usize;
        let task = Task {
            keys: keys.split_off_mut(..end - start)?,
            partners: partners.split_off_mut(..end - start)?,
            first,
            ends,
        };
        (first, start) = (first + ends.len(), end);
        Some(task)
    })
}

impl Task<'_> {
    fn run(&mut self) {
        let n = self.keys.len();
        // Of the keys before this task.
        let offset = self.ends[self.ends.len() - 1] as usize - n;
        let mut start = 0;
        for (lower, &end) in (self.first as u64..).zip(self.ends) {
            let run = start..end as usize - offset;
            start = run.end;
            let partners = &mut self.partners[run.clone()];
            partners.sort_unstable();
            for (key, &partner) in self.keys[run].iter_mut().zip(&*partners) {
                *key = lower << 32 | u64::from(partner);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_sorted_as_in_place() {
        let mut sorter = Sorter::new(&Settings::default());
        let mut state = 1u64;
        let mut next = |below: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) % below
        };
        for threads in [1, 3] {
            let workers = Workers::new(threads);
            // Few keys; many; many of few numbers; more numbers than keys.
            for (n_keys, n_numbers) in [
                (0, 0),
                (100, 7),
                (200_000, 50_000),
                (3 * TASK, 2),
                (FROM, 1),
                (FROM, 100_000),
            ] {
                let keys = (0..n_keys).map(|_| next(n_numbers) << 32 | next(1 << 30));
                let mut keys: Vec<u64> = keys.collect();
                let mut expected = keys.clone();
                expected.sort_unstable();
                sorter.sort(&mut keys, n_numbers, &workers);
                assert_eq!(keys, expected, "{n_keys} keys of {n_numbers} numbers");
            }
        }
    }
}
