//! Room for what a pass finds: queues, work items, candidates, pairs, unsure pairs.
//!
//! How much a frame finds is not known before. Kernels count what they need, whether it fits or not; what
//! did not fit makes its buffer grow and the pass run again. Where the device or the memory budget
//! allows no more, the engine splits the pass instead.

use super::buffers::Storage;
use super::device::Gpu;
use super::layout::{
    Arguments, Candidate, Counter, N_CANDIDATES, N_COUNTERS, N_ITEMS, N_PAIRS, N_UNSURE, NodePair,
    PairKey, ROUNDS, UnsureKey, WRAPPED, WorkItem,
};

/// Elements that each buffer has room for. The answer never depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Capacities {
    /// Pairs of tree nodes waiting in one round.
    pub queue: u64,
    /// Work items.
    pub items: u64,
    /// Candidates.
    pub candidates: u64,
    /// Pairs that certainly intersect.
    pub pairs: u64,
    /// Pairs left to exact arithmetic.
    pub unsure: u64,
}

impl Default for Capacities {
    fn default() -> Self {
        Capacities {
            queue: 1 << 15,
            items: 1 << 15,
            candidates: 1 << 18,
            pairs: 1 << 16,
            unsure: 1 << 14,
        }
    }
}

/// Candidates of two full clusters: the least that a pass must be able to hold.
const ONE_ITEM: u64 = 64 * 64;

impl Capacities {
    /// With these a pass of one pair of clusters always fits.
    pub(crate) const LEAST: Capacities = Capacities {
        queue: 64,
        items: 64,
        candidates: ONE_ITEM,
        pairs: ONE_ITEM,
        unsure: ONE_ITEM,
    };

    /// Bytes on the device, read-back included.
    pub(crate) fn bytes(&self) -> u64 {
        2 * self.queue * size_of::<NodePair>() as u64
            + self.items * size_of::<WorkItem>() as u64
            + self.candidates * size_of::<Candidate>() as u64
            + 2 * self.pairs * size_of::<PairKey>() as u64
            + 2 * self.unsure * size_of::<UnsureKey>() as u64
    }

    fn zip(self, other: Self, pick: impl Fn(u64, u64) -> u64) -> Self {
        Capacities {
            queue: pick(self.queue, other.queue),
            items: pick(self.items, other.items),
            candidates: pick(self.candidates, other.candidates),
            pairs: pick(self.pairs, other.pairs),
            unsure: pick(self.unsure, other.unsure),
        }
    }

    pub(crate) fn max(self, other: Self) -> Self {
        self.zip(other, u64::max)
    }

    fn fits(self, room: Self) -> bool {
        self.max(room) == room
    }

    /// What one binding of the device may hold.
    fn limit(gpu: &Gpu) -> Self {
        Capacities {
            queue: Storage::<NodePair>::limit(gpu),
            items: Storage::<WorkItem>::limit(gpu),
            candidates: Storage::<Candidate>::limit(gpu),
            pairs: Storage::<PairKey>::limit(gpu),
            unsure: Storage::<UnsureKey>::limit(gpu),
        }
    }
}

/// The buffers.
#[derive(Debug)]
pub(crate) struct Room {
    pub queues: [Storage<NodePair>; 2],
    pub items: Storage<WorkItem>,
    pub candidates: Storage<Candidate>,
    pub pairs: Storage<PairKey>,
    pub unsure: Storage<UnsureKey>,
    pub counters: Storage<Counter>,
    pub arguments: Storage<Arguments>,
}

impl Room {
    pub fn new() -> Self {
        let copied = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let indirect = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT;
        Room {
            queues: ["queue a", "queue b"].map(Storage::plain),
            items: Storage::plain("work items"),
            candidates: Storage::plain("candidates"),
            pairs: Storage::new("pairs", copied),
            unsure: Storage::new("unsure", copied),
            counters: Storage::new("counters", copied),
            arguments: Storage::new("arguments", indirect),
        }
    }

    /// Makes exactly this much room. Returns whether any buffer is a new one.
    pub fn resize(&mut self, gpu: &Gpu, capacities: &Capacities) -> bool {
        let before = self.capacities();
        let [a, b] = &mut self.queues;
        a.resize_exactly(gpu, capacities.queue);
        b.resize_exactly(gpu, capacities.queue);
        self.items.resize_exactly(gpu, capacities.items);
        self.candidates.resize_exactly(gpu, capacities.candidates);
        self.pairs.resize_exactly(gpu, capacities.pairs);
        self.unsure.resize_exactly(gpu, capacities.unsure);
        self.counters.resize_exactly(gpu, u64::from(N_COUNTERS));
        self.arguments.resize_exactly(gpu, u64::from(ROUNDS) + 2);
        before != self.capacities()
    }

    pub fn capacities(&self) -> Capacities {
        Capacities {
            queue: self.queues[0].len(),
            items: self.items.len(),
            candidates: self.candidates.len(),
            pairs: self.pairs.len(),
            unsure: self.unsure.len(),
        }
    }
}

/// What a pass counted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Counts {
    /// What would have held everything; of later stages a lower bound when an earlier one overflowed.
    pub needed: Capacities,
    wrapped: bool,
}

/// What is to be done about the counts of a pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// All of it fitted.
    Complete,
    /// Run again with this much room.
    Grow(Capacities),
    /// There is no more room to be had.
    Split,
}

impl Counts {
    pub fn new(counters: &[Counter]) -> Self {
        let at = |ix: u32| u64::from(counters[ix as usize].n);
        Counts {
            needed: Capacities {
                queue: (0..ROUNDS).map(at).max().unwrap_or(0),
                items: at(N_ITEMS),
                candidates: at(N_CANDIDATES),
                pairs: at(N_PAIRS),
                unsure: at(N_UNSURE),
            },
            wrapped: at(WRAPPED) != 0,
        }
    }

    /// Compares with the room there was. `bytes` may be held in all by these buffers.
    pub fn judge(&self, gpu: &Gpu, room: Capacities, bytes: Option<u64>) -> Verdict {
        if self.wrapped {
            return Verdict::Split;
        }
        if self.needed.fits(room) {
            return Verdict::Complete;
        }
        let limit = Capacities::limit(gpu);
        // A quarter more than needed, where it is needed; the next frame needs a little more.
        let larger = self.needed.zip(room, |needed, room| {
            if needed > room {
                needed + needed / 4
            } else {
                room
            }
        });
        let larger = larger.zip(limit, u64::min);
        let is_allowed = bytes.is_none_or(|bytes| larger.bytes() <= bytes);
        if self.needed.fits(larger) && is_allowed {
            Verdict::Grow(larger)
        } else {
            Verdict::Split
        }
    }
}
