//! The answer about candidates.

use crate::answers::home::{Home, gives_back};
use crate::answers::numbering::{Numbering, row};
use crate::answers::pairs::{Element, hash_row, mix};
use crate::plan::Plan;
use crate::query::pair_kind::PairKind;
use crate::scene::error::Error;
#[cfg(doc)]
use crate::scene::ids::BodyId;
use crate::search::found::{KeysByKind, PairList};
use crate::search::runner::{Job, Outcome};
use crate::search::stats::Stats;

/// Pairs of elements whose boxes overlap during a step, sorted by
/// `(kind, body_a, element_a, body_b, element_b)`.
#[derive(Clone, Default)]
pub struct Candidates {
    numbering: Numbering,
    keys: KeysByKind,
    stats: Stats,
    /// Where its buffers go when it is dropped.
    home: Home<Candidates>,
}

gives_back!(Candidates);

impl std::fmt::Debug for Candidates {
    /// Their number and the first of them, however many there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Candidates");
        short.field("len", &self.len());
        short.field("first", &self.iter().next());
        short.finish_non_exhaustive()
    }
}

impl Candidates {
    /// Gives it memory for the keys of the next answer.
    pub(crate) fn put_buffers(&mut self, rooms: KeysByKind) {
        self.keys = rooms;
    }

    /// Pairs in any order, each once or more often.
    pub(crate) fn of_pairs(numbering: Numbering, pairs: &PairList) -> Self {
        let mut keys = KeysByKind::default();
        for &(kind, key) in pairs {
            keys[kind as usize].push(key);
        }
        for keys in &mut keys {
            keys.sort_unstable();
            keys.dedup();
        }
        let mut candidates = Candidates::default();
        (candidates.numbering, candidates.keys) = (numbering, keys);
        candidates
    }

    /// The keys of each kind, sorted.
    pub(crate) fn keys(&self) -> impl Iterator<Item = (PairKind, &[u64])> {
        let keys = self.keys.iter().map(Vec::as_slice);
        PairKind::ALL.into_iter().zip(keys)
    }

    /// The number of candidates of all kinds.
    pub fn len(&self) -> usize {
        self.keys.iter().map(Vec::len).sum()
    }

    /// Whether there are no candidates.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The candidates of one kind: `(a, b)`, where `a` is the element that the kind names first.
    pub fn of(&self, kind: PairKind) -> impl ExactSizeIterator<Item = (Element, Element)> + '_ {
        let keys = self.keys[kind as usize].iter();
        keys.map(|&key| self.numbering.pair(key))
    }

    /// Rows `[body_a, element_a, body_b, element_b]`, with bodies by their
    /// [`index`](BodyId::index).
    pub fn rows(&self) -> impl Iterator<Item = [u32; 4]> + '_ {
        self.iter().map(|(_, a, b)| row(a, b))
    }

    /// The rows of one kind.
    pub fn rows_of(&self, kind: PairKind) -> impl ExactSizeIterator<Item = [u32; 4]> + '_ {
        self.of(kind).map(|(a, b)| row(a, b))
    }

    /// All candidates.
    pub fn iter(&self) -> impl Iterator<Item = (PairKind, Element, Element)> + '_ {
        let kinds = PairKind::ALL.into_iter();
        kinds.flat_map(|kind| self.of(kind).map(move |(a, b)| (kind, a, b)))
    }

    /// A hash of the set that does not depend on its order.
    pub fn hash(&self) -> u64 {
        let kinds = PairKind::ALL.into_iter();
        kinds.fold(0, |sum: u64, kind| sum.wrapping_add(self.hash_of(kind)))
    }

    /// The hash of the candidates of one kind; [`hash`](Candidates::hash) is the sum of these.
    pub fn hash_of(&self, kind: PairKind) -> u64 {
        Self::hash_rows(kind, self.rows_of(kind))
    }

    /// The hash of candidates of one kind that have these rows.
    #[doc(hidden)]
    pub fn hash_rows(kind: PairKind, rows: impl IntoIterator<Item = [u32; 4]>) -> u64 {
        rows.into_iter().fold(0, |sum: u64, row| {
            sum.wrapping_add(mix(hash_row(row) ^ kind as u64))
        })
    }

    /// How the answer was found.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }
}

impl Outcome<u64, { PairKind::ALL.len() }> for Candidates {
    fn begin(&mut self, plan: &Plan) {
        self.numbering.begin(plan);
        self.keys.iter_mut().for_each(Vec::clear);
        self.stats.clear();
    }

    fn stats_mut(&mut self) -> &mut Stats {
        &mut self.stats
    }

    fn take_buffers(&mut self) -> KeysByKind {
        std::mem::take(&mut self.keys)
    }

    fn fill(&mut self, _: Job<'_>, keys: KeysByKind) -> Result<(), Error> {
        self.keys = keys;
        Ok(())
    }

    fn bytes(&self) -> u64 {
        let n: usize = self.keys.iter().map(Vec::capacity).sum();
        (size_of::<u64>() * n) as u64
    }
}
