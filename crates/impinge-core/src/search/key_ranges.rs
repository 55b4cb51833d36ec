//! Ranges of keys, and how many candidates are in each part of them: how a long answer is divided
//! into runs.
//!
//! Candidates are ordered by kind, then by key. Ranges name some of them, one range per kind. To
//! divide them, each range is cut into parts of equally many possible keys, and the candidates of
//! each part are counted. Consecutive parts that hold few enough candidates together make a run; a
//! part that alone holds too many is divided again.
//!
//! ```text
//! ranges   |     vertices and faces    |        edges and edges        |
//! parts    |   |   |   |   |   |   |   |   |   |   |   |   |   |   |   |   powers of two
//! counts     0   7   2   0   4   1   9   3   0   8   8   0   2   5   1     of at most 10 per run:
//! runs     |------ 1 -----|--- 2 --|------ 3 --|-- 4 --|------ 5 ------|
//! ```

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::plan::Plan;
use crate::query::pair_kind::{PairKind, PairKinds};
use crate::scene::error::Error;
use crate::scene::index::{Number, lower_number};
use crate::search::sink;

const KINDS: usize = PairKind::ALL.len();

/// Parts of all ranges together, at most.
const MOST_PARTS: usize = 1 << 12;

/// A range of keys per kind of pair.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct KeyRanges([Range<u64>; KINDS]);

impl KeyRanges {
    /// All keys that pairs of some kinds may have.
    pub fn new(plan: &Plan, kinds: PairKinds) -> Self {
        KeyRanges(PairKind::ALL.map(|kind| {
            // The element that a kind names first has the lower number.
            let Range { start, end } = plan.lower_numbers(Some(kind));
            match kinds.contains(kind) {
                true => start.first_key()..end.first_key(),
                false => 0..0,
            }
        }))
    }

    /// The kinds that have any keys.
    pub fn kinds(&self) -> PairKinds {
        let kinds = PairKind::ALL.into_iter();
        kinds.filter(|&kind| !self.of(kind).is_empty()).collect()
    }

    pub fn hold(&self, kind: PairKind, key: u64) -> bool {
        self.of(kind).contains(&key)
    }

    /// The lowest and the highest lower number that a key of a kind may have; `None` if the kind
    /// has no keys.
    #[inline]
    pub fn lower_numbers(&self, kind: PairKind) -> Option<[Number; 2]> {
        let Range { start, end } = *self.of(kind);
        (start < end).then(|| [start, end - 1].map(lower_number))
    }

    fn of(&self, kind: PairKind) -> &Range<u64> {
        &self.0[kind as usize]
    }
}

/// The parts of one kind's range.
#[derive(Debug, Clone, Default)]
struct RangeParts {
    /// The number of the first one.
    first: usize,
    n: usize,
    /// Keys per part: 2 to the power of this.
    shift: u32,
}

/// Counts the candidates in each part of some ranges.
#[derive(Debug)]
pub(crate) struct Tally {
    ranges: KeyRanges,
    parts: [RangeParts; KINDS],
    counts: Vec<AtomicU64>,
}

impl Tally {
    /// Bytes that a tally takes at most.
    pub const MOST_BYTES: u64 = (MOST_PARTS * size_of::<AtomicU64>()) as u64;
    /// How often ranges can be divided until parts have one key: 64 bits, at least 9 the first time
    /// and 12 each time after that.
    pub const MOST_DEPTH: u64 = 6;

    /// # Errors
    /// There is no memory.
    pub fn new(ranges: KeyRanges) -> Result<Self, Error> {
        let n_kinds = ranges.0.iter().filter(|range| !range.is_empty()).count();
        let most_each = (MOST_PARTS / n_kinds.max(1)) as u64;
        let mut n = 0;
        let parts = PairKind::ALL.map(|kind| {
            let width = ranges.of(kind).end - ranges.of(kind).start;
            let Some(last) = width.checked_sub(1) else {
                return RangeParts::default();
            };
            let shift = (0..).find(|shift| last >> shift < most_each).unwrap_or(0);
            let parts = RangeParts {
                first: n,
                n: (last >> shift) as usize + 1,
                shift,
            };
            n += parts.n;
            parts
        });
        let mut counts = Vec::new();
        sink::reserve(&mut counts, n, "room to count candidates")?;
        counts.resize_with(n, AtomicU64::default);
        Ok(Tally {
            ranges,
            parts,
            counts,
        })
    }

    /// Counts those of some keys that are in the ranges. Neighbours in the list are often in the
    /// same part.
    pub fn count(&self, kind: PairKind, keys: &[u64]) {
        let (range, parts) = (self.ranges.of(kind), &self.parts[kind as usize]);
        let add = |part: usize, n: u64| {
            if n > 0 {
                self.counts[part].fetch_add(n, Ordering::Relaxed);
            }
        };
        let (mut part, mut n) = (0, 0);
        for key in keys.iter().filter(|key| range.contains(key)) {
            let of_key = parts.first + ((key - range.start) >> parts.shift) as usize;
            if of_key != part {
                add(part, n);
                (part, n) = (of_key, 0);
            }
            n += 1;
        }
        add(part, n);
    }

    /// What is counted.
    pub fn ranges(&self) -> &KeyRanges {
        &self.ranges
    }

    /// All candidates counted.
    pub fn total(&self) -> u64 {
        self.counts.iter().map(read).sum()
    }

    /// Divides the ranges, in order, into runs of at most so many candidates, and into parts that
    /// alone hold more. Ranges without candidates are left out.
    pub fn divide(&self, most: u64) -> impl Iterator<Item = Run> + '_ {
        let mut next = 0;
        std::iter::from_fn(move || {
            let empty = self.counts[next..].iter().take_while(|n| read(n) == 0);
            let first = next + empty.count();
            let (mut end, mut n) = (first, 0u64);
            while let Some(count) = self.counts.get(end).map(read)
                && (end == first || n.saturating_add(count) <= most)
            {
                n += count;
                end += 1;
            }
            next = end;
            (first < end).then(|| self.run(first..end))
        })
    }

    fn run(&self, run: Range<usize>) -> Run {
        let mut found = Run {
            ranges: KeyRanges::default(),
            counts: [0; KINDS],
        };
        for kind in PairKind::ALL {
            let (range, parts) = (self.ranges.of(kind), &self.parts[kind as usize]);
            let low = run.start.max(parts.first);
            let high = run.end.min(parts.first + parts.n);
            if low >= high {
                continue;
            }
            let n = self.counts[low..high].iter().map(read).sum();
            if n > 0 {
                let start = |part: usize| match part - parts.first {
                    of_kind if of_kind == parts.n => range.end,
                    of_kind => range.start + ((of_kind as u64) << parts.shift),
                };
                found.ranges.0[kind as usize] = start(low)..start(high);
                found.counts[kind as usize] = n;
            }
        }
        found
    }
}

fn read(count: &AtomicU64) -> u64 {
    count.load(Ordering::Relaxed)
}

/// Consecutive candidates.
#[derive(Debug)]
pub(crate) struct Run {
    pub ranges: KeyRanges,
    /// How many there are, by kind.
    pub counts: [u64; KINDS],
}

impl Run {
    pub fn n(&self) -> u64 {
        self.counts.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use impinge_testing::random::Random;

    /// Divides until no run has too many.
    fn divide(ranges: KeyRanges, keys: &[(PairKind, u64)], most: u64, runs: &mut Vec<Run>) {
        let tally = Tally::new(ranges).expect("memory");
        for &(kind, key) in keys {
            tally.count(kind, &[key]);
        }
        for run in tally.divide(most) {
            match run.n() > most {
                true => divide(run.ranges, keys, most, runs),
                false => runs.push(run),
            }
        }
    }

    #[test]
    fn runs_hold_every_key_once_and_in_order() {
        let mut random = Random::new(1);
        let mut next = |below: u32| u64::from(random.below(below));
        let mut whole = KeyRanges::default();
        // Ranges that end where a part does, and ones that do not; one key; the highest number.
        whole.0[PairKind::VertexFace as usize] = 5 << 32..u64::from(u32::MAX) << 32;
        whole.0[PairKind::EdgeEdge as usize] = 7 << 32..(7 << 32) + (1 << 20);
        whole.0[PairKind::FaceFace as usize] = 3..4;
        let mut keys = vec![(PairKind::FaceFace, 3)];
        for _ in 0..3000 {
            let n_vertices = match next(2) {
                0 => 3,
                _ => u32::MAX - 5,
            };
            let vertex = 5 + next(n_vertices);
            keys.push((PairKind::VertexFace, vertex << 32 | next(1 << 31)));
            keys.push((PairKind::EdgeEdge, (7 << 32) + next(1 << 20)));
        }
        keys.sort_unstable();
        keys.dedup();
        for most in [1, 2, 100, 5000, u64::MAX] {
            let mut runs = Vec::new();
            divide(whole.clone(), &keys, most, &mut runs);
            let mut left = &keys[..];
            for run in &runs {
                assert!((1..=most).contains(&run.n()));
                let (own, others) = left.split_at(run.n() as usize);
                for kind in PairKind::ALL {
                    let n = own.iter().filter(|key| key.0 == kind).count();
                    assert_eq!(run.counts[kind as usize], n as u64);
                    assert!(n == 0 || run.ranges.kinds().contains(kind));
                }
                assert!(own.iter().all(|&(kind, key)| run.ranges.hold(kind, key)));
                assert!(!others.iter().any(|&(kind, key)| run.ranges.hold(kind, key)));
                left = others;
            }
            assert!(left.is_empty());
            if most > 1 {
                // Runs are nearly as long as they may be, but where a part had to be divided.
                assert!(runs.len() as u64 <= 4 * (1 + keys.len() as u64 / most));
            }
        }
    }

    #[test]
    fn keys_outside_the_ranges_do_not_count() {
        let mut ranges = KeyRanges::default();
        ranges.0[PairKind::EdgeEdge as usize] = 100..200;
        let tally = Tally::new(ranges).expect("memory");
        tally.count(PairKind::EdgeEdge, &[99, 100, 199, 200]);
        tally.count(PairKind::VertexFace, &[0, 150]);
        assert_eq!(tally.total(), 2);
        let runs: Vec<Run> = tally.divide(5).collect();
        assert_eq!(runs.len(), 1);
        assert_eq!(
            runs[0].ranges.lower_numbers(PairKind::EdgeEdge),
            Some([Number::new(0); 2])
        );
        assert_eq!(runs[0].ranges.lower_numbers(PairKind::VertexFace), None);
    }
}
