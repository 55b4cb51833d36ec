//! The answer: sorted pairs, colliding elements, a hash, statistics.

use std::ops::Range;

use crate::answers::changes::{Changes, check_comparable};
use crate::answers::home::{Home, gives_back};
use crate::plan::{Gaps, Plan, owner_by_first};
use crate::query::Query;
use crate::scene::Scene;
use crate::scene::elements::{BodyKind, Part};
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{ElementIx, Number, lower_number, pair_numbers};
use crate::search::runner::{Job, Outcome};
use crate::search::sink::reserve;
use crate::search::stats::Stats;

/// One element of one body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Element {
    /// The body.
    pub body: BodyId,
    /// Index of the element within the body.
    pub element: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct PairBody {
    id: BodyId,
    /// The global number of its first element.
    first: Number,
    kind: BodyKind,
    numbers_stamp: u64,
    positions_stamp: u64,
}

/// The numbers of no elements.
const NONE: Range<Number> = Number::new(0)..Number::new(0);

/// Every pair that intersects, sorted by `(body_a, element_a, body_b, element_b)`, where
/// `body_a < body_b`, or within one body `element_a < element_b`.
///
/// The same input gives the same bytes on every method, backend, thread count and budget.
#[derive(Clone, Default)]
pub struct Pairs {
    keys: Vec<u64>,
    bodies: Vec<PairBody>,
    /// Of the scene.
    family: u64,
    gaps: Gaps,
    stats: Stats,
    /// Where its buffers go when it is dropped.
    home: Home<Pairs>,
}

gives_back!(Pairs);

impl Pairs {
    /// The number of pairs.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Whether there are no pairs.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// Pairs from [rows](Pairs::rows), sorted, that this query finds in this scene: for callers
    /// that keep rows alone.
    ///
    /// # Errors
    /// A row names a body or an element that is not there; rows are not sorted.
    #[doc(hidden)]
    pub fn of_rows(scene: &Scene, query: &Query, rows: &[[u32; 4]]) -> Result<Self, Error> {
        let mut pairs = Pairs::default();
        pairs.gaps = Gaps::new(scene, query)?;
        pairs.family = scene.family();
        let mut end: u32 = 0;
        for (id, body) in scene.bodies() {
            pairs.bodies.push(PairBody {
                id,
                first: Number::new(end),
                kind: body.kind(),
                numbers_stamp: body.numbers_stamp(Part::Given),
                positions_stamp: body.positions_stamp(),
            });
            end = end.saturating_add(body.elements().len() as u32);
        }
        let number = |body: u32, element: u32| {
            let ix = pairs.bodies.partition_point(|held| held.id.slot() < body);
            let held = pairs.bodies.get(ix).filter(|held| held.id.slot() == body)?;
            let n = scene.body(held.id).ok()?.elements().len();
            ((element as usize) < n).then(|| held.first.plus(ElementIx::new(element)))
        };
        let mut keys = Vec::new();
        reserve(&mut keys, rows.len(), "pairs")?;
        for &[body_a, a, body_b, b] in rows {
            let key = number(body_a, a).zip(number(body_b, b));
            let key = key.filter(|(low, high)| low < high);
            let key = key.map(|(low, high)| low.key_with(high));
            match key.filter(|key| keys.last().is_none_or(|last| last < key)) {
                Some(key) => keys.push(key),
                None => {
                    return Err(Error::Setting {
                        setting: "pairs",
                        given: format!("row {}: {body_a}, {a}, {body_b}, {b}", keys.len()),
                        allowed: "sorted rows of elements of the scene",
                    });
                }
            }
        }
        pairs.keys = keys;
        Ok(pairs)
    }

    /// All pairs in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (Element, Element)> + '_ {
        self.keys.iter().map(|&key| self.pair(key))
    }

    /// One pair by its index in that order.
    pub fn get(&self, ix: usize) -> Option<(Element, Element)> {
        self.keys.get(ix).map(|&key| self.pair(key))
    }

    fn pair(&self, key: u64) -> (Element, Element) {
        let [a, b] = pair_numbers(key).map(|number| self.element(number));
        (a, b)
    }

    fn owner(&self, number: Number) -> &PairBody {
        &self.bodies[owner_by_first(&self.bodies, number, |body| body.first)]
    }

    fn element(&self, number: Number) -> Element {
        let body = self.owner(number);
        Element {
            body: body.id,
            element: number.minus(body.first).raw(),
        }
    }

    /// The range of global numbers of a body that took part.
    fn numbers(&self, body: BodyId) -> Option<Range<Number>> {
        let ix = self
            .bodies
            .binary_search_by_key(&body, |held| held.id)
            .ok()?;
        // No element has the highest number: there are fewer than 2^32.
        let end = self.bodies.get(ix + 1).map(|next| next.first);
        Some(self.bodies[ix].first..end.unwrap_or(Number::new(u32::MAX)))
    }

    /// The keys whose lower element belongs to the range.
    fn run(&self, numbers: &Range<Number>) -> &[u64] {
        let below = |end: Number| self.keys.partition_point(|&key| lower_number(key) < end);
        &self.keys[below(numbers.start)..below(numbers.end)]
    }

    /// Pairs `(i, j)` of element `i` of `a` and element `j` of `b`, in the order in which they
    /// are held. Empty when either did not take part.
    pub fn between(&self, a: BodyId, b: BodyId) -> impl Iterator<Item = [u32; 2]> + '_ {
        let swapped = b < a;
        let (low, high) = if swapped { (b, a) } else { (a, b) };
        let (low, high) = match (self.numbers(low), self.numbers(high)) {
            (Some(low), Some(high)) if a != b => (low, high),
            _ => (NONE, NONE),
        };
        self.run(&low).iter().filter_map(move |&key| {
            let [i, j] = pair_numbers(key);
            high.contains(&j).then(|| {
                let (i, j) = (i.minus(low.start).raw(), j.minus(high.start).raw());
                if swapped { [j, i] } else { [i, j] }
            })
        })
    }

    /// Pairs `(i, j)`, `i < j`, of elements of one body.
    pub fn self_of(&self, body: BodyId) -> impl Iterator<Item = [u32; 2]> + '_ {
        let numbers = self.numbers(body).unwrap_or(NONE);
        self.run(&numbers).iter().filter_map(move |&key| {
            let [i, j] = pair_numbers(key);
            let local = |number: Number| number.minus(numbers.start).raw();
            numbers.contains(&j).then(|| [local(i), local(j)])
        })
    }

    /// Rows `[body_a, element_a, body_b, element_b]` with bodies by their
    /// [`index`](BodyId::index), sorted.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = [u32; 4]> + '_ {
        self.keys.iter().map(|&key| self.row_of(key))
    }

    /// One row by its index.
    pub(crate) fn row(&self, ix: usize) -> [u32; 4] {
        self.row_of(self.keys[ix])
    }

    fn row_of(&self, key: u64) -> [u32; 4] {
        let (a, b) = self.pair(key);
        [
            a.body.index() as u32,
            a.element,
            b.body.index() as u32,
            b.element,
        ]
    }

    /// The elements of a body that take part in any pair: sorted, each once.
    pub fn colliding(&self, body: BodyId) -> Vec<u32> {
        let numbers = self.numbers(body).unwrap_or(NONE);
        let mut bits = Bits::default();
        for number in self.keys.iter().flat_map(|&key| pair_numbers(key)) {
            if numbers.contains(&number) {
                bits.put(number.minus(numbers.start).raw());
            }
        }
        bits.into_numbers()
    }

    /// The elements of each body that take part in any pair, found in one pass: sorted, each
    /// once. Bodies come in order; bodies without such an element are left out.
    pub fn all_colliding(&self) -> Vec<(BodyId, Vec<u32>)> {
        let mut bits = Bits::default();
        for number in self.keys.iter().flat_map(|&key| pair_numbers(key)) {
            bits.put(number.raw());
        }
        let colliding: Vec<Number> = bits.into_numbers().into_iter().map(Number::new).collect();
        colliding
            .chunk_by(|&a, &b| self.owner(a).id == self.owner(b).id)
            .map(|numbers| {
                let body = self.owner(numbers[0]);
                let local = numbers.iter().map(|number| number.minus(body.first));
                (body.id, local.map(ElementIx::raw).collect())
            })
            .collect()
    }

    /// Keeps only the pairs for which `keep` returns true: a filter of the caller's own, by body,
    /// by face or by vertex. `keep` is called once per pair, in order, after all pairs were found.
    /// So the answer is the same for every method, backend and thread count, provided that `keep`
    /// depends on the pair alone. The statistics do not change.
    /// [`Detector::penetration`](crate::Detector::penetration) refuses contacts of two bodies
    /// without some of their pairs.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let triangle = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    /// for _ in 0..3 {
    ///     scene.add_triangles(&[[0, 1, 2]], &triangle)?;
    /// }
    /// let mut pairs = Detector::new(Backend::Cpu)?.detect(&scene, &Query::between_all())?.clone();
    /// pairs.retain(|a, b| a.body.index() + b.body.index() != 1);
    /// assert_eq!(pairs.rows().collect::<Vec<_>>(), [[0, 0, 2, 0], [1, 0, 2, 0]]);
    /// # Ok(()) }
    /// ```
    pub fn retain(&mut self, mut keep: impl FnMut(Element, Element) -> bool) {
        let mut keys = std::mem::take(&mut self.keys);
        let mut last_dropped = None;
        keys.retain(|&key| {
            let (a, b) = self.pair(key);
            let is_kept = keep(a, b);
            let bodies = [a.body, b.body];
            if !is_kept && last_dropped.replace(bodies) != Some(bodies) {
                self.gaps.drop_pair(bodies);
            }
            is_kept
        });
        self.keys = keys;
    }

    /// The bodies that took part, in order, and the kind of their elements.
    pub fn bodies(&self) -> impl ExactSizeIterator<Item = (BodyId, BodyKind)> + '_ {
        self.bodies.iter().map(|body| (body.id, body.kind))
    }

    /// The same bodies, and the stamps of the numbers of their elements and of their positions.
    pub(crate) fn stamped(&self) -> impl Iterator<Item = (BodyId, [u64; 2])> + '_ {
        let bodies = self.bodies.iter();
        bodies.map(|body| (body.id, [body.numbers_stamp, body.positions_stamp]))
    }

    /// Why pairs of two bodies may not be here.
    pub(crate) fn gaps(&self) -> &Gaps {
        &self.gaps
    }

    /// Which pairs an older answer also has, which are new, and which are gone: two pairs are the
    /// same if their bodies and elements are. Pairs of a body that was removed and of one in its
    /// slot differ.
    ///
    /// # Errors
    /// The older answer is about another scene, which is no clone. Or a body was re-meshed since,
    /// and both answers have pairs of it.
    pub fn changes(&self, old: &Pairs) -> Result<Changes, Error> {
        self.check_comparable(old)?;
        Ok(Changes::between(old.iter(), self.iter()))
    }

    /// Refuses what [`changes`](Pairs::changes) refuses.
    #[doc(hidden)]
    pub fn check_comparable(&self, old: &Pairs) -> Result<(), Error> {
        let answers = [old, self].map(|pairs| {
            let bodies = pairs.bodies.iter();
            let parts = bodies.map(|body| (body.id, Part::Given, body.numbers_stamp));
            (pairs.family, parts)
        });
        let named = [old, self].map(|pairs| {
            let all = pairs.iter();
            all.map(|(a, b)| [a, b].map(|of| (of.body, Part::Given)))
        });
        check_comparable(answers, named)
    }

    /// A hash of the set of pairs that does not depend on their order: the wrapping sum of a
    /// mixed 64-bit word per pair (finaliser of SplitMix64, Steele et al. 2014).
    pub fn hash(&self) -> u64 {
        hash_rows(self.rows())
    }

    /// How the answer was found: stages, counts, bytes.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }
}

impl Outcome<u64, 1> for Pairs {
    fn begin(&mut self, plan: &Plan) {
        self.keys.clear();
        self.family = plan.family;
        self.gaps = plan.gaps();
        self.bodies.clear();
        self.bodies.extend(plan.parts.iter().map(|part| PairBody {
            id: part.id,
            first: part.first,
            kind: part.kind,
            numbers_stamp: part.numbers_stamp,
            positions_stamp: part.positions_stamp,
        }));
        self.stats.clear();
    }

    fn stats_mut(&mut self) -> &mut Stats {
        &mut self.stats
    }

    fn take_buffers(&mut self) -> [Vec<u64>; 1] {
        [std::mem::take(&mut self.keys)]
    }

    fn fill(&mut self, _: Job<'_>, [keys]: [Vec<u64>; 1]) -> Result<(), Error> {
        self.keys = keys;
        Ok(())
    }

    fn bytes(&self) -> u64 {
        (size_of::<u64>() * self.keys.capacity()) as u64
    }
}

impl std::fmt::Debug for Pairs {
    /// Their number and the first of them, however many there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Pairs");
        short.field("len", &self.len());
        short.field("first", &self.iter().next());
        short.finish_non_exhaustive()
    }
}

/// A set of numbers, one bit each: pairs may be many more than elements.
#[derive(Default)]
struct Bits(Vec<u64>);

impl Bits {
    fn put(&mut self, number: u32) {
        let word = number as usize / 64;
        if word >= self.0.len() {
            self.0.resize(word + 1, 0);
        }
        self.0[word] |= 1 << (number % 64);
    }

    /// The numbers, sorted.
    fn into_numbers(self) -> Vec<u32> {
        let n: u32 = self.0.iter().map(|word| word.count_ones()).sum();
        let mut numbers = Vec::with_capacity(n as usize);
        for (first, mut word) in (0u32..).step_by(64).zip(self.0) {
            while word != 0 {
                numbers.push(first + word.trailing_zeros());
                word &= word - 1;
            }
        }
        numbers
    }
}

/// [`Pairs::hash`] of rows `[body_a, element_a, body_b, element_b]` that come from elsewhere.
/// The order of rows does not matter. In each row the lower `(body, element)` comes first: the
/// other way round gives another hash.
pub fn hash_rows(rows: impl IntoIterator<Item = [u32; 4]>) -> u64 {
    let hashes = rows.into_iter().map(hash_row);
    hashes.fold(0, u64::wrapping_add)
}

pub(crate) fn hash_row([body_a, a, body_b, b]: [u32; 4]) -> u64 {
    let low = mix(u64::from(body_a) << 32 | u64::from(a));
    let high = mix(u64::from(body_b) << 32 | u64::from(b));
    mix(low.rotate_left(17) ^ high.wrapping_mul(3))
}

pub(crate) fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}
