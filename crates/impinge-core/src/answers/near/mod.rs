//! The answer about pairs within a distance.

mod labels;
mod stencils;

use std::iter;

use crate::answers::changes::Changes;
use crate::answers::home::{Home, gives_back};
use crate::answers::numbering::{Numbering, row};
use crate::answers::pairs::{Element, hash_row, mix};
use crate::plan::Plan;
use crate::query::pair_kind::PairKind;
use crate::query::pair_set::PairSet;
use crate::query::{Exclusion, Query};
use crate::scene::error::Error;
use crate::search::found::KeysByKind;
use crate::search::pair_reader::{PairReader, Side};
use crate::search::sink::reserve;
use crate::search::stats::Stats;
use crate::simd::{Isa, closest_of_pairs};
use impinge_exact::internal::{
    NearestOfElements, PairAtPart, closest_of_elements, nearest_of_elements,
};
use impinge_exact::{ElementPair, Feature};

pub(crate) use labels::Labels;

/// Two elements that are near each other.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NearPair {
    /// What they are.
    pub kind: PairKind,
    /// The element that the kind names first, numbered as in [`Impact::a`](crate::Impact::a).
    pub a: Element,
    /// The other element. Where both are of the same kind, it is of a body with a higher id, or the
    /// higher element.
    pub b: Element,
    /// The features of `a` and of `b` that are nearest to each other, decided exactly: those with
    /// the nearest points in their inside. Of several at the same distance, the first of the
    /// smallest.
    pub features: [Feature; 2],
    /// Whether nearest points may not be the only ones: edges are parallel, or an element is
    /// degenerate, or faces are parallel.
    pub is_parallel: bool,
    /// The distance, where [`Query::distances`](crate::Query::distances) or
    /// [`Query::closest_points`](crate::Query::closest_points) asks for it: rounded down, see
    /// [`ClosestPoints::distance`].
    pub distance: Option<f64>,
    /// Distance and nearest points, where [`Query::closest_points`](crate::Query::closest_points)
    /// asks for them.
    pub closest: Option<ClosestPoints>,
}

/// Nearest points of two elements and their distance.
///
/// The points are computed from exact quotients in one order of operations, so they have the same
/// bits on every machine, but they are rounded. The distance is exact but for being rounded down.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ClosestPoints {
    /// The distance, rounded down: the largest `f64` that is not above the true one. 0 if and only
    /// if the elements touch, or are nearer than the smallest `f64`.
    pub distance: f64,
    /// A point of `a` and one of `b`, x, y, z each.
    pub points: [[f64; 3]; 2],
}

impl NearPair {
    /// The row `[body_a, element_a, body_b, element_b]`, with bodies by their
    /// [`index`](crate::BodyId::index).
    pub fn row(&self) -> [u32; 4] {
        row(self.a, self.b)
    }

    /// Its word in [`NearPairs::hash`], if it had this row.
    #[doc(hidden)]
    pub fn hash_as(&self, row: [u32; 4]) -> u64 {
        let [a, b] = self.features.map(|feature| match feature {
            Feature::Vertex(ix) => u64::from(ix),
            Feature::Edge(ix) => 8 + u64::from(ix),
            Feature::Face => 16,
        });
        let word = self.kind as u64 | a << 8 | b << 16 | u64::from(self.is_parallel) << 24;
        mix(hash_row(row) ^ mix(word))
    }

    /// What makes it the same pair in another answer, in the order of answers.
    fn key(self) -> (PairKind, Element, Element) {
        (self.kind, self.a, self.b)
    }

    /// ipc-toolkit's name of the distance type: `P_T`, `P_E0`, `P_T0` of a vertex and a face;
    /// `EA_EB`, `EA_EB0`, `EA0_EB1` of edges; `P_E`, `P_E0`, `P_E1` of an edge and a vertex; `P_P`
    /// of vertices. Of an edge and a face, or of faces, the kinds of the features: `P_P`, `P_E`,
    /// `P_T`, `E_E`, and `E_T` where an edge passes through a face.
    pub fn name(&self) -> &'static str {
        self.kind.named(self.features)
    }
}

/// All pairs of elements that are near, sorted by `(kind, body_a, element_a, body_b, element_b)`.
///
/// The same input gives the same bytes on every method, backend, thread count and budget. A pair
/// takes nine bytes, 8 more with its distance, and 56 more with its nearest points.
#[derive(Clone, Default)]
pub struct NearPairs {
    numbering: Numbering,
    keys: KeysByKind,
    /// The features of each key, packed.
    nearest: [Vec<u8>; PairKind::ALL.len()],
    /// Of all pairs, kind after kind, if they were asked for.
    distances: Vec<f64>,
    points: Vec<[[f64; 3]; 2]>,
    stats: Stats,
    /// How many threads computed it.
    threads: usize,
    /// Where its buffers go when it is dropped.
    home: Home<NearPairs>,
}

gives_back!(NearPairs);

/// Some pairs of one kind whose features are not all known.
pub(crate) struct Unnamed<'a> {
    pub kind: PairKind,
    keys: &'a mut [u64],
    nearest: &'a mut [u8],
    /// Empty, if they were not asked for.
    distances: &'a mut [f64],
    points: &'a mut [[[f64; 3]; 2]],
}

impl NearPairs {
    /// Takes over the frame's numbering.
    pub(crate) fn begin(&mut self, plan: &Plan) {
        self.numbering.begin(plan);
        self.keys.iter_mut().for_each(Vec::clear);
        self.nearest.iter_mut().for_each(Vec::clear);
        self.distances.clear();
        self.points.clear();
        self.stats.clear();
    }

    /// The room of the last answer's keys.
    pub(crate) fn take_buffers(&mut self) -> KeysByKind {
        std::mem::take(&mut self.keys)
    }

    pub(crate) fn stats_mut(&mut self) -> &mut Stats {
        &mut self.stats
    }

    /// Says how many threads computed it: no more compute with it later.
    pub(crate) fn set_threads(&mut self, threads: usize) {
        self.threads = threads;
    }

    /// Takes what was found: sorted keys with their [`Labels`]. Parts of about `n_each` pairs are
    /// to be [named](Unnamed::name) next.
    ///
    /// # Errors
    /// There is no memory for the features and nearest points.
    pub(crate) fn fill(
        &mut self,
        keys: KeysByKind,
        query: &Query,
        n_each: usize,
    ) -> Result<Vec<Unnamed<'_>>, Error> {
        const WHAT: &str = "nearest features";
        self.keys = keys;
        for (nearest, keys) in self.nearest.iter_mut().zip(&self.keys) {
            reserve(nearest, keys.len(), WHAT)?;
            nearest.resize(keys.len(), 0);
        }
        let n = self.keys.iter().map(Vec::len).sum();
        if query.distances {
            reserve(&mut self.distances, n, "distances")?;
            self.distances.resize(n, 0.0);
        }
        if query.closest {
            reserve(&mut self.points, n, "nearest points")?;
            self.points.resize(n, [[0.0; 3]; 2]);
        }
        let mut distances = &mut self.distances[..];
        let mut points = &mut self.points[..];
        let mut unnamed = Vec::new();
        let lists = self.keys.iter_mut().zip(&mut self.nearest);
        for (kind, (keys, nearest)) in PairKind::ALL.into_iter().zip(lists) {
            for (keys, nearest) in keys.chunks_mut(n_each).zip(nearest.chunks_mut(n_each)) {
                let n = keys.len();
                unnamed.push(Unnamed {
                    kind,
                    keys,
                    nearest,
                    distances: first(&mut distances, n),
                    points: first(&mut points, n),
                });
            }
        }
        Ok(unnamed)
    }

    /// Bytes of the answer.
    pub(crate) fn bytes(&self) -> u64 {
        let keys: usize = self.keys.iter().map(Vec::capacity).sum();
        let nearest: usize = self.nearest.iter().map(Vec::capacity).sum();
        let distances = size_of::<f64>() * self.distances.capacity();
        let points = size_of::<[[f64; 3]; 2]>() * self.points.capacity();
        (size_of::<u64>() * keys + nearest + distances + points) as u64
    }

    /// How many pairs are near.
    pub fn len(&self) -> usize {
        self.keys.iter().map(Vec::len).sum()
    }

    /// Whether no pair is.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All of them, sorted.
    pub fn iter(&self) -> NearIter<'_> {
        NearIter {
            pairs: self,
            kinds: &PairKind::ALL,
            ix: 0,
            n_before: 0,
            n_left: self.len(),
            parts: [0; 2],
        }
    }

    /// Rows `[body_a, element_a, body_b, element_b]`, with bodies by their
    /// [`index`](crate::BodyId::index).
    pub fn rows(&self) -> impl ExactSizeIterator<Item = [u32; 4]> + '_ {
        self.iter().map(|pair| pair.row())
    }

    /// Those of one kind.
    pub fn of(&self, kind: PairKind) -> NearIter<'_> {
        NearIter {
            pairs: self,
            kinds: &PairKind::ALL[kind as usize..=kind as usize],
            ix: 0,
            n_before: self.keys[..kind as usize].iter().map(Vec::len).sum(),
            n_left: self.keys[kind as usize].len(),
            parts: [0; 2],
        }
    }

    /// Which pairs an older answer also has, which are new, and which are gone: two pairs are the
    /// same if their kinds, bodies and elements are, whatever their features and distances. Pairs
    /// of a body that was removed and of one in its slot differ.
    ///
    /// # Errors
    /// The older answer is about another scene, which is no clone. Or both answers have pairs with
    /// elements of the same sort (vertices, edges or faces) of a body that was re-meshed between
    /// them, or with edges of it that were [set](crate::Scene::set_edges).
    pub fn changes(&self, old: &NearPairs) -> Result<Changes, Error> {
        self.check_comparable(old, None)?;
        let [old, new] = [old, self].map(|near| near.iter().map(NearPair::key));
        Ok(Changes::between(old, new))
    }

    /// Refuses what [`changes`](NearPairs::changes) refuses, of all pairs or of one kind.
    #[doc(hidden)]
    pub fn check_comparable(&self, old: &NearPairs, kind: Option<PairKind>) -> Result<(), Error> {
        let keys = [old, self].map(|near| {
            let of_kind = kind.map_or_else(|| near.iter(), |kind| near.of(kind));
            of_kind.map(NearPair::key)
        });
        self.numbering.check_comparable(&old.numbering, keys)
    }

    /// A hash of the set of pairs and their features that does not depend on their order: the
    /// wrapping sum of a mixed 64-bit word per pair. Distances and points are not part of it.
    pub fn hash(&self) -> u64 {
        self.iter().hash()
    }

    /// How the answer was found.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }
}

/// The pairs of an answer, to be left out of others: those that are near in a pose at rest, for
/// one. Pairs of kinds that the answer was not asked about stay: ask with the same
/// [`kinds`](crate::Query::kinds).
impl From<&NearPairs> for Exclusion {
    fn from(near: &NearPairs) -> Self {
        let named = |of: Element| (of.body, of.element);
        let pairs = near.iter();
        PairSet::new(
            pairs.map(|pair| (pair.kind, [named(pair.a), named(pair.b)])),
            near.numbering.numbered(),
        )
        .into()
    }
}

impl std::fmt::Debug for NearPairs {
    /// Their number and the first of them, however many there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("NearPairs");
        short.field("len", &self.len());
        short.field("first", &self.iter().next());
        short.finish_non_exhaustive()
    }
}

impl<'a> IntoIterator for &'a NearPairs {
    type Item = NearPair;
    type IntoIter = NearIter<'a>;

    fn into_iter(self) -> NearIter<'a> {
        self.iter()
    }
}

/// Goes through pairs that are near, in order: [`NearPairs::iter`], [`NearPairs::of`].
#[derive(Debug, Clone)]
pub struct NearIter<'a> {
    pairs: &'a NearPairs,
    /// The kind at hand, and those after it.
    kinds: &'a [PairKind],
    /// The next pair of the kind at hand.
    ix: usize,
    /// How many pairs the answer has before it.
    n_before: usize,
    n_left: usize,
    /// The parts of the last pair.
    parts: [usize; 2],
}

impl<'a> NearIter<'a> {
    /// What the keys of the pairs mean.
    pub(crate) fn numbering(&self) -> &'a Numbering {
        &self.pairs.numbering
    }

    /// The keys of the pairs that are left and their packed features, kind after kind.
    pub(crate) fn runs(self) -> impl Iterator<Item = (PairKind, &'a [u64], &'a [u8])> {
        let starts = iter::once(self.ix).chain(iter::repeat(0));
        self.kinds.iter().zip(starts).map(move |(&kind, start)| {
            let (keys, nearest) = (&self.pairs.keys, &self.pairs.nearest);
            let ix = kind as usize;
            (kind, &keys[ix][start..], &nearest[ix][start..])
        })
    }

    /// How many threads computed the answer.
    pub(crate) fn threads(&self) -> usize {
        self.pairs.threads
    }

    /// Without the next `n`.
    pub(crate) fn after(mut self, n: usize) -> Self {
        self.ix += n;
        self.n_before += n;
        self.n_left -= n;
        while let Some((&kind, rest)) = self.kinds.split_first() {
            let n_of_kind = self.pairs.keys[kind as usize].len();
            if self.ix < n_of_kind {
                break;
            }
            (self.kinds, self.ix) = (rest, self.ix - n_of_kind);
        }
        self
    }

    /// [`NearPairs::hash`] of the pairs that are left.
    pub fn hash(self) -> u64 {
        self.fold(0, |sum, pair| sum.wrapping_add(pair.hash_as(pair.row())))
    }
}

impl Iterator for NearIter<'_> {
    type Item = NearPair;

    #[inline]
    fn next(&mut self) -> Option<NearPair> {
        let pairs = self.pairs;
        let (kind, key) = loop {
            let (&kind, rest) = self.kinds.split_first()?;
            match pairs.keys[kind as usize].get(self.ix) {
                Some(&key) => break (kind, key),
                None => (self.kinds, self.ix) = (rest, 0),
            }
        };
        let (a, b) = pairs.numbering.pair_after(key, &mut self.parts);
        let nearest = NearestOfElements::unpacked(pairs.nearest[kind as usize][self.ix]);
        let distance = pairs.distances.get(self.n_before).copied();
        let points = pairs.points.get(self.n_before).copied();
        self.ix += 1;
        self.n_before += 1;
        self.n_left -= 1;
        Some(NearPair {
            kind,
            a,
            b,
            features: nearest.features,
            is_parallel: nearest.is_parallel,
            distance,
            closest: distance
                .zip(points)
                .map(|(distance, points)| ClosestPoints { distance, points }),
        })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        (self.n_left, Some(self.n_left))
    }
}

impl ExactSizeIterator for NearIter<'_> {}

/// The first `n` of a list, or all if there are fewer; the list loses them.
fn first<'a, T>(list: &mut &'a mut [T], n: usize) -> &'a mut [T] {
    let all = std::mem::take(list);
    let (own, rest) = all.split_at_mut(n.min(all.len()));
    *list = rest;
    own
}

/// Pairs whose nearest points are found at once.
const BATCH: usize = 64;

impl Unnamed<'_> {
    /// Names the features of all pairs, and finds distances and nearest points where they were
    /// asked for.
    pub fn name(
        &mut self,
        labels: Labels,
        pair: Option<ElementPair>,
        isa: Isa,
        reader: &mut PairReader<'_>,
    ) {
        if let Some(pair @ (ElementPair::VertexFace | ElementPair::EdgeEdge)) = pair
            && !self.distances.is_empty()
        {
            self.measure(labels, pair, isa, reader);
            return;
        }
        let of_parts: [Option<u8>; 1 + Labels::UNKNOWN as usize] = std::array::from_fn(|part| {
            NearestOfElements::of_part(pair?, part as u8).map(NearestOfElements::packed)
        });
        let has_distances = !self.distances.is_empty();
        for ix in 0..self.keys.len() {
            let (own, part) = labels.split(self.keys[ix]);
            self.keys[ix] = own;
            let known = of_parts[usize::from(part) % of_parts.len()];
            if let (Some(known), false) = (known, has_distances) {
                self.nearest[ix] = known;
                continue;
            }
            let located = reader.locate(own);
            let [a, b] = reader.sides(&located).map(Side::corners);
            if !has_distances {
                self.nearest[ix] = nearest_of_elements(a.points(), b.points()).packed();
                continue;
            }
            let (found, distance, points) = closest_of_elements(a.points(), b.points());
            self.nearest[ix] = found.packed();
            self.put(ix, distance, points);
        }
    }

    /// Takes the distance of a pair, and its nearest points if they were asked for.
    fn put(&mut self, ix: usize, distance: f64, points: [[f64; 3]; 2]) {
        self.distances[ix] = distance;
        if let Some(to) = self.points.get_mut(ix) {
            *to = points;
        }
    }

    /// Does so for vertices and faces, or edges and edges, some pairs at a time.
    fn measure(
        &mut self,
        labels: Labels,
        pair: ElementPair,
        isa: Isa,
        reader: &mut PairReader<'_>,
    ) {
        let (points, part) = ([[0.0; 3]; 4], Labels::UNKNOWN);
        let mut pairs = [PairAtPart { pair, points, part }; BATCH];
        let mut found = [None; BATCH];
        for first in (0..self.keys.len()).step_by(BATCH) {
            let keys = self.keys[first..].iter_mut().take(BATCH);
            let n = keys.len();
            for (key, at) in keys.zip(&mut pairs) {
                (*key, at.part) = labels.split(*key);
                let located = reader.locate(*key);
                let mut to = at.points.iter_mut();
                for side in reader.sides(&located) {
                    side.points().zip(&mut to).for_each(|(from, to)| *to = from);
                }
            }
            closest_of_pairs(isa, &pairs[..n], &mut found);
            for (ix, closest) in (first..self.keys.len()).zip(&found).take(n) {
                let Some(closest) = closest else {
                    continue;
                };
                self.nearest[ix] = NearestOfElements::from(closest.nearest).packed();
                self.put(ix, closest.distance, closest.points);
            }
        }
    }
}
