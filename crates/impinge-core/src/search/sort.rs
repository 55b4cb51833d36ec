//! Sorts the keys of a large answer on all threads.
//!
//! A key is a pair of numbers, lower number first, and few numbers have many partners. So keys are
//! counted by their lower number, the partners of each number are put together, and these short
//! runs are sorted:
//!
//! ```text
//! keys       | 5 9 | 2 7 | 5 6 | 2 3 |   as they were found; each thread counts and places a part
//! partners   | 7 3 | 9 6 |               of 2, of 5
//! keys       | 2 3 | 2 7 | 5 6 | 5 9 |   each run sorted, and written back
//! ```
//!
//! Short runs are sorted sixteen at a time, one per lane of a register, by a network of exchanges.
//!
//! Memory, kept from answer to answer: four bytes per key, and per number and part.

use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use crate::plan::{Plan, Question};
use crate::query::pair_kind::PairKind;
use crate::query::settings::Settings;
use crate::scene::error::Error;
use crate::scene::index::{Number, lower_number, pair_numbers};
use crate::search::found::Found;
use crate::search::sink;
use crate::simd::{Isa, Simd, with_isa};
use crate::workers::Workers;
use crate::workers::alone::is_alone;

/// Keys per task.
const TASK: usize = 1 << 14;
/// Each part has counts of its own, so there are few.
const MOST_PARTS: usize = 4;
/// Runs that are sorted at the same time.
const LANES: usize = 16;
/// Longer runs are sorted one by one.
const LONGEST: usize = 256;
/// Runs of a batch have about the same length: up to 32, 64, 128 and 256 keys.
const N_BATCHES: usize = 4;

/// What an answer is made of: the key of a pair, and maybe more.
pub trait Keyed: Copy {
    /// The key.
    fn key(&self) -> u64;

    /// Sorts a list by the keys. Returns whether they were counted.
    fn sort(
        list: &mut [Self],
        sorter: &mut Sorter,
        lower_numbers: impl FnOnce() -> Range<Number>,
        workers: &Workers,
    ) -> bool;
}

impl Keyed for u64 {
    fn key(&self) -> u64 {
        *self
    }

    fn sort(
        list: &mut [u64],
        sorter: &mut Sorter,
        lower_numbers: impl FnOnce() -> Range<Number>,
        workers: &Workers,
    ) -> bool {
        sorter.sort_keys(list, lower_numbers(), workers)
    }
}

impl<V: Copy + Send> Keyed for Found<V> {
    fn key(&self) -> u64 {
        self.key
    }

    /// In place: contacts are far fewer than the keys of candidates.
    fn sort(
        list: &mut [Found<V>],
        sorter: &mut Sorter,
        _: impl FnOnce() -> Range<Number>,
        workers: &Workers,
    ) -> bool {
        let by_one = |list: &mut [Found<V>]| list.sort_unstable_by_key(|found| found.key);
        if is_alone() || list.len() < sorter.from {
            by_one(list);
            return false;
        }
        let sorted = workers.install(list.len(), || match is_alone() {
            true => by_one(list),
            false => list.par_sort_unstable_by_key(|found| found.key),
        });
        if sorted.is_err() {
            by_one(list);
        }
        false
    }
}

/// The memory to sort in.
#[derive(Debug)]
pub struct Sorter {
    /// Under a memory budget.
    in_place: bool,
    /// With fewer keys, one thread sorts them in place.
    from: usize,
    isa: Isa,
    /// Of each part and number: how many partners, then where the next one goes.
    parts: Vec<Vec<u32>>,
    partners: Vec<AtomicU32>,
}

/// The runs of consecutive lower numbers, from `first` on.
struct SortTask<'a> {
    keys: &'a mut [u64],
    partners: &'a [AtomicU32],
    first: usize,
    ends: &'a [u32],
}

impl Sorter {
    /// For detectors with these settings: a memory budget has no room to sort in.
    pub fn new(settings: &Settings) -> Self {
        Sorter {
            in_place: settings.memory_budget.is_some(),
            from: settings.tuning.sort_from.max(1),
            isa: Isa::detect(settings.instruction_set),
            parts: Vec::new(),
            partners: Vec::new(),
        }
    }

    /// Sorts each list of pairs: those of a question about intersections, or of each kind. Returns
    /// how many lists were counted.
    pub fn sort<T: Keyed>(&mut self, lists: &mut [Vec<T>], plan: &Plan, workers: &Workers) -> u64 {
        let kinds = PairKind::ALL.into_iter().map(Some);
        let counted = lists.iter_mut().zip(kinds).map(|(list, kind)| {
            let kind = kind.filter(|_| plan.question != Question::Intersection);
            u64::from(T::sort(list, self, || plan.lower_numbers(kind), workers))
        });
        counted.sum()
    }

    /// Sorts keys whose lower numbers are in a range. Returns whether they were counted: few keys,
    /// and keys without memory for that, are sorted in place.
    fn sort_keys(&mut self, keys: &mut [u64], numbers: Range<Number>, workers: &Workers) -> bool {
        let first = numbers.start.index();
        let n_numbers = numbers.end.index() - first;
        let is_worth =
            keys.len() >= self.from.max(n_numbers / 2) && u32::try_from(keys.len()).is_ok();
        let n_parts = workers.n().min(MOST_PARTS);
        if self.in_place || !is_worth || self.reserve(keys.len(), n_numbers, n_parts).is_err() {
            keys.sort_unstable();
            return false;
        }
        let Sorter {
            parts, partners, ..
        } = self;
        let partners = &partners[..];
        let n_each = keys.len().div_ceil(n_parts);
        for_each_part(workers, parts, keys, n_each, |counts, keys| {
            for key in keys {
                counts[lower_number(*key).index() - first] += 1;
            }
        });
        let mut next = 0;
        for number in 0..n_numbers {
            for part in &mut *parts {
                next += std::mem::replace(&mut part[number], next);
            }
        }
        for_each_part(workers, parts, keys, n_each, |slots, keys| {
            for key in keys {
                let [lower, partner] = pair_numbers(*key);
                let slot = &mut slots[lower.index() - first];
                partners[*slot as usize].store(partner.raw(), Ordering::Relaxed);
                *slot += 1;
            }
        });
        // The slots of the last part are where runs end now.
        let ends = &parts[n_parts - 1];
        let tasks = tasks(keys, partners, (first, ends), workers.task(TASK));
        let tasks: Vec<_> = tasks.map(Mutex::new).collect();
        let isa = self.isa;
        workers.for_each(&mut vec![(); workers.n()], tasks.len(), |(), ix| {
            if let Ok(mut task) = tasks[ix].lock() {
                let task = &mut *task;
                with_isa!(isa, sort_runs, (task: &mut SortTask<'_> = task));
            }
        });
        true
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let counts: usize = self.parts.iter().map(Vec::capacity).sum();
        (size_of::<u32>() * (counts + self.partners.capacity())) as u64
    }

    fn reserve(&mut self, n_keys: usize, n_numbers: usize, n_parts: usize) -> Result<(), Error> {
        const WHAT: &str = "room to sort pairs";
        self.parts.resize_with(n_parts, Vec::new);
        for part in &mut self.parts {
            part.clear();
            sink::reserve(part, n_numbers, WHAT)?;
            part.resize(n_numbers, 0);
        }
        let more = n_keys.saturating_sub(self.partners.len());
        sink::reserve(&mut self.partners, more, WHAT)?;
        self.partners.resize_with(n_keys, AtomicU32::default);
        Ok(())
    }
}

/// Calls back for each part, with the keys that belong to it.
fn for_each_part(
    workers: &Workers,
    parts: &mut [Vec<u32>],
    keys: &[u64],
    n_each: usize,
    work: impl Fn(&mut [u32], &[u64]) + Sync,
) {
    let pairs = parts.iter_mut().zip(keys.chunks(n_each));
    let pairs: Vec<_> = pairs.map(Mutex::new).collect();
    workers.for_each(&mut vec![(); workers.n()], pairs.len(), |(), ix| {
        if let Ok(mut pair) = pairs[ix].lock() {
            let (part, keys) = &mut *pair;
            work(part, keys);
        }
    });
}

/// Runs of about `n_each` keys.
fn tasks<'a>(
    mut keys: &'a mut [u64],
    mut partners: &'a [AtomicU32],
    (mut first, mut ends): (usize, &'a [u32]),
    n_each: usize,
) -> impl Iterator<Item = SortTask<'a>> {
    let mut start = 0;
    std::iter::from_fn(move || {
        if ends.is_empty() {
            return None;
        }
        let full = ends.partition_point(|&end| (end as usize) < start + n_each);
        let own = ends.split_off(..ends.len().min(full + 1))?;
        let end = own[own.len() - 1] as usize;
        let task = SortTask {
            keys: keys.split_off_mut(..end - start)?,
            partners: partners.split_off(..end - start)?,
            first,
            ends: own,
        };
        (first, start) = (first + own.len(), end);
        Some(task)
    })
}

/// Sorts the runs of a task.
#[inline(always)]
fn sort_runs(_: impl Simd, task: &mut SortTask<'_>) {
    let SortTask {
        keys,
        partners,
        first,
        ends,
    } = task;
    // Of the keys before this task.
    let offset = ends[ends.len() - 1] as usize - keys.len();
    let mut batches = [const { SortBatch::new() }; N_BATCHES];
    let mut start = 0;
    for (lower, &end) in Number::each(*first..*first + ends.len()).zip(*ends) {
        let run = start..end as usize - offset;
        start = run.end;
        let partners = &partners[run.clone()];
        if partners.len() < 2 || partners.len() > LONGEST {
            let keys = &mut keys[run];
            for (key, partner) in keys.iter_mut().zip(partners) {
                *key = lower.key_with(Number::new(partner.load(Ordering::Relaxed)));
            }
            keys.sort_unstable();
            continue;
        }
        let more_than_32 = (partners.len() - 1) / 32;
        let batch = &mut batches[more_than_32
            .checked_ilog2()
            .map_or(0, |log| log as usize + 1)];
        batch.add(lower, run.start, partners);
        if batch.n == LANES {
            batch.write(keys);
        }
    }
    for batch in &mut batches {
        batch.write(keys);
    }
}

/// One partner of each run.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Row([u32; LANES]);

/// Behind the end of every run.
const END: Row = Row([u32::MAX; LANES]);

/// Short runs, one per lane.
struct SortBatch {
    rows: [Row; LONGEST],
    /// The lower number of each run, where its keys go, and how many.
    runs: [(Number, usize, usize); LANES],
    n: usize,
    /// The length of the longest run.
    n_rows: usize,
}

impl SortBatch {
    const fn new() -> Self {
        SortBatch {
            rows: [END; LONGEST],
            runs: [(Number::new(0), 0, 0); LANES],
            n: 0,
            n_rows: 0,
        }
    }

    #[inline(always)]
    fn add(&mut self, lower: Number, start: usize, partners: &[AtomicU32]) {
        let lane = self.n;
        for (row, partner) in self.rows.iter_mut().zip(partners) {
            row.0[lane] = partner.load(Ordering::Relaxed);
        }
        self.runs[lane] = (lower, start, partners.len());
        self.n += 1;
        self.n_rows = self.n_rows.max(partners.len());
    }

    /// Sorts the runs and writes their keys. The batch is empty afterwards.
    #[inline(always)]
    fn write(&mut self, keys: &mut [u64]) {
        let rows = &mut self.rows[..self.n_rows];
        sort_lanes(rows);
        for (lane, &(lower, start, n)) in self.runs[..self.n].iter().enumerate() {
            for (key, row) in keys[start..start + n].iter_mut().zip(&*rows) {
                *key = lower.key_with(Number::new(row.0[lane]));
            }
        }
        rows.fill(END);
        (self.n, self.n_rows) = (0, 0);
    }
}

/// Sorts each lane by Batcher's merge exchange: Knuth, The Art of Computer Programming, volume 3,
/// section 5.2.2, algorithm M. Which rows are compared depends on how many there are, and on
/// nothing else.
#[inline(always)]
fn sort_lanes(rows: &mut [Row]) {
    let half = rows.len().next_power_of_two() / 2;
    let mut p = half;
    while p > 0 {
        let (mut q, mut r, mut d) = (half, 0, p);
        loop {
            let mut block = r;
            while block + d < rows.len() {
                for low in block..(block + p).min(rows.len() - d) {
                    let (Row(a), Row(b)) = (rows[low], rows[low + d]);
                    for lane in 0..LANES {
                        rows[low].0[lane] = a[lane].min(b[lane]);
                        rows[low + d].0[lane] = a[lane].max(b[lane]);
                    }
                }
                block += 2 * p;
            }
            if q == p {
                break;
            }
            (d, r) = (q - p, p);
            q /= 2;
        }
        p /= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge_testing::random::Random;

    #[test]
    fn keys_are_sorted_as_in_place() {
        let from = Settings::default().tuning.sort_from;
        let mut sorter = Sorter::new(&Settings::default());
        let mut random = Random::new(1);
        let mut next = |below: u32| u64::from(random.below(below));
        for threads in [1, 3] {
            let workers = Workers::new(threads);
            // Few keys; many; many of few numbers; more numbers than keys.
            for (n_keys, n_numbers) in [
                (0, 0),
                (100, 7),
                (200_000, 50_000),
                (3 * TASK, 2),
                (from, 1),
                (from, 100_000),
            ] {
                let first = Number::new(7);
                let end = Number::new(7 + n_numbers);
                let keys = (0..n_keys).map(|_| (7 + next(n_numbers)) << 32 | next(1 << 30));
                let mut keys: Vec<u64> = keys.collect();
                let mut expected = keys.clone();
                expected.sort_unstable();
                sorter.sort_keys(&mut keys, first..end, &workers);
                assert_eq!(keys, expected, "{n_keys} keys of {n_numbers} numbers");
            }
        }
    }
}
