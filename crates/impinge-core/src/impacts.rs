//! The answers about a step: impacts, with their times, and candidates.

use crate::error::Error;
use crate::exact::Contact;
use crate::frame::{Frame, owner_by_first};
use crate::ids::BodyId;
use crate::index::{Number, pair_numbers};
use crate::key_ranges::{KeyRanges, Tally};
use crate::pair_kind::PairKind;
use crate::pairs::{Primitive, hash_row, mix};
use crate::sink::{Answer, Ending, reserve};
use crate::stats::Statistics;
use crate::step::Toi;

/// A key and its value.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Found<V> {
    pub key: u64,
    pub value: V,
}

/// Which contacts to look for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Sought {
    /// Every contact.
    #[default]
    All,
    /// The earliest contact, and all whose times may round to the same time.
    Earliest,
    /// Any contact.
    Any,
}

/// A pair of a step that a device has not dropped.
#[cfg(feature = "gpu")]
#[derive(Debug, Clone, Copy)]
pub(crate) struct LeftPair {
    /// The places of its elements, those of all layers numbered consecutively.
    pub places: [u32; 2],
    /// Until this time it certainly does not touch.
    pub free_until: f32,
    /// By this time it certainly touches, at one time only.
    pub touches_by: Option<f32>,
}

/// What a device says about a step, or about a part of it.
#[cfg(feature = "gpu")]
#[derive(Debug)]
pub(crate) struct Left<'a> {
    /// Pairs that may touch, in any order. Where the earliest contact is sought, those that touch later than `touches_by` may be missing;
    /// where any is sought, all may be missing if one certainly touches.
    pub pairs: &'a mut [LeftPair],
    /// The least time by which some pair certainly touches, after the start; none where all are sought.
    pub touches_by: Option<f32>,
}

/// Contacts found, by kind of pair.
pub(crate) type FoundByKind<V = Contact> = [Vec<Found<V>>; PairKind::ALL.len()];

/// Keys found, by kind of pair.
pub(crate) type KeysByKind = [Vec<u64>; PairKind::ALL.len()];

/// Where contacts go while a step is being answered, by kind of pair.
pub(crate) type ContactAnswer = Answer<Found<Contact>, { PairKind::ALL.len() }>;
/// The same for keys alone.
pub(crate) type KeyAnswer = Answer<u64, { PairKind::ALL.len() }>;

/// Where what is found in a step goes.
#[derive(Debug, Clone, Copy)]
pub(crate) enum StepAnswer<'a> {
    Contacts(&'a ContactAnswer),
    Keys(&'a KeyAnswer),
    /// Only keys in some ranges.
    KeysIn(&'a KeyAnswer, &'a KeyRanges),
    /// Keys are counted and forgotten.
    Counts(&'a Tally),
}

impl<'a> StepAnswer<'a> {
    /// Takes contacts of one kind; the block is empty afterwards and keeps its memory.
    pub fn take(&self, kind: PairKind, block: &mut Vec<Found<Contact>>) {
        if let StepAnswer::Contacts(answer) = self {
            answer.extend(kind as usize, block.drain(..));
        }
    }

    /// The same for pairs without a time.
    pub fn take_keys(&self, kind: PairKind, block: &mut Vec<u64>) {
        match self {
            StepAnswer::Keys(answer) => answer.extend(kind as usize, block.drain(..)),
            StepAnswer::KeysIn(answer, ranges) => {
                block.retain(|&key| ranges.hold(kind, key));
                answer.extend(kind as usize, block.drain(..));
            }
            StepAnswer::Counts(tally) => {
                tally.count(kind, block);
                block.clear();
            }
            StepAnswer::Contacts(_) => {}
        }
    }

    /// The ranges that keys must be in, if not all keys are wanted.
    pub fn ranges(&self) -> Option<&'a KeyRanges> {
        match self {
            StepAnswer::KeysIn(_, ranges) => Some(ranges),
            StepAnswer::Counts(tally) => Some(tally.ranges()),
            StepAnswer::Contacts(_) | StepAnswer::Keys(_) => None,
        }
    }
}

impl Ending for StepAnswer<'_> {
    fn is_over(&self) -> bool {
        match self {
            StepAnswer::Contacts(answer) => answer.is_over(),
            StepAnswer::Keys(answer) | StepAnswer::KeysIn(answer, _) => answer.is_over(),
            StepAnswer::Counts(_) => false,
        }
    }

    fn check(&self) -> Result<(), Error> {
        match self {
            StepAnswer::Contacts(answer) => answer.check(),
            StepAnswer::Keys(answer) | StepAnswer::KeysIn(answer, _) => answer.check(),
            StepAnswer::Counts(_) => Ok(()),
        }
    }

    fn share(&self, held_by_finder: u64) {
        match self {
            StepAnswer::Contacts(answer) => answer.share(held_by_finder),
            StepAnswer::Keys(answer) | StepAnswer::KeysIn(answer, _) => {
                answer.share(held_by_finder)
            }
            StepAnswer::Counts(_) => {}
        }
    }

    fn most_items(&self, room: usize) -> usize {
        room
    }
}

/// Maps global numbers to elements of bodies.
#[derive(Debug, Clone, Default)]
pub(crate) struct Numbering {
    /// Bodies, and the first number of each of their layers.
    layers: Vec<(BodyId, Number)>,
}

impl Numbering {
    pub fn begin(&mut self, frame: &Frame) {
        self.layers.clear();
        let layers = frame.layers.iter().map(|layer| (layer.id, layer.first));
        self.layers.extend(layers);
    }

    fn name(&self, number: Number) -> Primitive {
        let (body, first) = self.layers[owner_by_first(&self.layers, number, |layer| layer.1)];
        Primitive {
            body,
            primitive: number.minus(first).raw(),
        }
    }

    fn impact(&self, kind: PairKind, toi: Toi, found: &Found<Contact>) -> Impact {
        let (a, b) = self.pair(found.key);
        Impact {
            kind,
            a,
            b,
            toi: toi.round(&found.value),
            at_start: found.value.at_start,
        }
    }

    pub fn pair(&self, key: u64) -> (Primitive, Primitive) {
        let [a, b] = pair_numbers(key).map(|number| self.name(number));
        (a, b)
    }
}

/// Two elements that touch during a step, and when first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impact {
    /// The kinds of the two elements.
    pub kind: PairKind,
    /// The element that the kind names first: the vertex of a vertex and a face, the edge of an edge and a vertex.
    ///
    /// Vertices are numbered as positions are. Faces are numbered as they were given; those of tetrahedra by tetrahedron,
    /// then by the opposite corner. Edges are numbered as they were given; those of faces as unique pairs `(low, high)` in
    /// the order of `(high, low)`. [`Body::part`](crate::Body::part) lists them.
    pub a: Primitive,
    /// The other element. If both are of the same kind, it belongs to the body with the higher id, or is the higher element
    /// of the same body.
    pub b: Primitive,
    /// The first time in [0, 1] at which they touch, rounded down to `f32` or `f64`, as [`Step::toi`](crate::Step::toi) says.
    pub toi: f64,
    /// Whether they touch at the start, at time 0.
    pub at_start: bool,
}

impl Impact {
    /// The row `[body_a, element_a, body_b, element_b]`, with bodies by their [`index`](BodyId::index).
    pub fn row(&self) -> [u32; 4] {
        row(self.a, self.b)
    }

    /// The order of rows.
    fn order(&self) -> (PairKind, [u32; 4]) {
        (self.kind, self.row())
    }

    /// The earlier impact; of two at the same time, the one whose row comes first.
    pub(crate) fn earlier(self, other: Impact) -> Impact {
        let is_later = self.toi.total_cmp(&other.toi);
        match is_later.then_with(|| self.order().cmp(&other.order())) {
            std::cmp::Ordering::Greater => other,
            _ => self,
        }
    }
}

pub(crate) fn row(a: Primitive, b: Primitive) -> [u32; 4] {
    let index = |body: BodyId| body.index() as u32;
    [index(a.body), a.primitive, index(b.body), b.primitive]
}

/// [`Impacts::hash`] of impacts given as kind, `[body_a, element_a, body_b, element_b]` and time. The hash of several sets
/// with no impact in common is the wrapping sum of their hashes.
pub fn hash_impact_rows(rows: impl IntoIterator<Item = (PairKind, [u32; 4], f64)>) -> u64 {
    rows.into_iter().fold(0, |sum, (kind, row, toi)| {
        let time = mix(toi.to_bits() ^ kind as u64);
        sum.wrapping_add(mix(hash_row(row) ^ time))
    })
}

/// All pairs of elements that touch during a step, sorted by `(kind, body_a, element_a, body_b, element_b)`.
///
/// The same input gives the same bytes on every method, backend, thread count and budget.
#[derive(Clone, Default)]
pub struct Impacts {
    numbering: Numbering,
    impacts: Vec<Impact>,
    start_intersects: Option<bool>,
    stats: Statistics,
}

impl std::fmt::Debug for Impacts {
    /// Their number and the first of them, however many there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Impacts");
        short.field("len", &self.len());
        short.field("first", &self.iter().next());
        short.finish_non_exhaustive()
    }
}

impl Impacts {
    /// Takes over the frame's numbering.
    pub(crate) fn begin(&mut self, frame: &Frame) {
        self.numbering.begin(frame);
        self.impacts.clear();
        self.start_intersects = None;
        self.stats.clear();
    }

    pub(crate) fn set_start_intersects(&mut self, start_intersects: Option<bool>) {
        self.start_intersects = start_intersects;
    }

    pub(crate) fn stats_mut(&mut self) -> &mut Statistics {
        &mut self.stats
    }

    /// All that was found, each kind in the order of the keys.
    ///
    /// # Errors
    /// There is no memory for them.
    pub(crate) fn fill(&mut self, toi: Toi, found: &FoundByKind) -> Result<(), Error> {
        let n: usize = found.iter().map(Vec::len).sum();
        let Impacts {
            numbering, impacts, ..
        } = self;
        reserve(impacts, n, "impacts")?;
        for (kind, found) in PairKind::ALL.into_iter().zip(found) {
            impacts.extend(found.iter().map(|found| numbering.impact(kind, toi, found)));
        }
        Ok(())
    }

    /// Bytes of the answer.
    pub(crate) fn bytes(&self) -> u64 {
        (size_of::<Impact>() * self.impacts.capacity()) as u64
    }

    /// What was found, by its names.
    pub(crate) fn impact(&self, kind: PairKind, toi: Toi, found: &Found<Contact>) -> Impact {
        self.numbering.impact(kind, toi, found)
    }

    /// The number of pairs that touch.
    pub fn len(&self) -> usize {
        self.impacts.len()
    }

    /// Whether nothing touches during the step.
    pub fn is_empty(&self) -> bool {
        self.impacts.is_empty()
    }

    /// Whether elements intersect at the start of the step. `None` if nobody asked: only
    /// [`Start::Verify`](crate::Start::Verify) does.
    pub fn start_intersects(&self) -> Option<bool> {
        self.start_intersects
    }

    /// All of them, sorted.
    pub fn as_slice(&self) -> &[Impact] {
        &self.impacts
    }

    /// All of them, sorted.
    pub fn iter(&self) -> std::slice::Iter<'_, Impact> {
        self.impacts.iter()
    }

    /// The impacts of one kind.
    pub fn of(&self, kind: PairKind) -> &[Impact] {
        let start = self.impacts.partition_point(|impact| impact.kind < kind);
        let end = self.impacts.partition_point(|impact| impact.kind <= kind);
        &self.impacts[start..end]
    }

    /// The earliest impact; of several at the same time, the one whose row comes first.
    pub fn earliest(&self) -> Option<Impact> {
        self.impacts.iter().copied().reduce(Impact::earlier)
    }

    /// The number of pairs that touch at the start.
    pub fn touching_at_start(&self) -> usize {
        let at_start = self.impacts.iter().filter(|impact| impact.at_start);
        at_start.count()
    }

    /// A hash of the set of impacts, times included, that does not depend on their order: the wrapping sum of a mixed
    /// 64-bit word per impact.
    pub fn hash(&self) -> u64 {
        hash_impact_rows(
            self.impacts
                .iter()
                .map(|impact| (impact.kind, impact.row(), impact.toi)),
        )
    }

    /// How the answer was found.
    pub fn stats(&self) -> &Statistics {
        &self.stats
    }
}

impl<'a> IntoIterator for &'a Impacts {
    type Item = &'a Impact;
    type IntoIter = std::slice::Iter<'a, Impact>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

/// Pairs of elements whose boxes overlap during a step, sorted by `(kind, body_a, element_a, body_b, element_b)`.
#[derive(Clone, Default)]
pub struct Candidates {
    numbering: Numbering,
    keys: KeysByKind,
    stats: Statistics,
}

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
    /// Takes over the frame's numbering.
    pub(crate) fn begin(&mut self, frame: &Frame) {
        self.numbering.begin(frame);
        self.keys.iter_mut().for_each(Vec::clear);
        self.stats.clear();
    }

    /// Its keys, sorted in the end, and its statistics.
    pub(crate) fn parts_mut(&mut self) -> (&mut KeysByKind, &mut Statistics) {
        (&mut self.keys, &mut self.stats)
    }

    /// Bytes of the answer.
    pub(crate) fn bytes(&self) -> u64 {
        let n: usize = self.keys.iter().map(Vec::capacity).sum();
        (size_of::<u64>() * n) as u64
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
    pub fn of(&self, kind: PairKind) -> impl ExactSizeIterator<Item = (Primitive, Primitive)> + '_ {
        let keys = self.keys[kind as usize].iter();
        keys.map(|&key| self.numbering.pair(key))
    }

    /// Rows `[body_a, element_a, body_b, element_b]` of one kind, with bodies by their [`index`](BodyId::index).
    pub fn rows(&self, kind: PairKind) -> impl ExactSizeIterator<Item = [u32; 4]> + '_ {
        self.of(kind).map(|(a, b)| row(a, b))
    }

    /// All candidates.
    pub fn iter(&self) -> impl Iterator<Item = (PairKind, Primitive, Primitive)> + '_ {
        let kinds = PairKind::ALL.into_iter();
        kinds.flat_map(|kind| self.of(kind).map(move |(a, b)| (kind, a, b)))
    }

    /// A hash of the set that does not depend on its order.
    pub fn hash(&self) -> u64 {
        PairKind::ALL.into_iter().fold(0, |sum, kind| {
            self.rows(kind).fold(sum, |sum: u64, row| {
                sum.wrapping_add(mix(hash_row(row) ^ kind as u64))
            })
        })
    }

    /// How the answer was found.
    pub fn stats(&self) -> &Statistics {
        &self.stats
    }
}
