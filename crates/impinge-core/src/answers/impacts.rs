//! The answer about a step: impacts, with their times.

use crate::answers::changes::Changes;
use crate::answers::home::{Home, gives_back};
use crate::answers::numbering::{Numbering, row};
use crate::answers::pairs::{Element, hash_row, mix};
use crate::plan::Plan;
use crate::query::pair_kind::PairKind;
use crate::query::step::Precision;
use crate::scene::error::Error;
#[cfg(doc)]
use crate::scene::ids::BodyId;
use crate::search::found::{Found, FoundByKind};
use crate::search::runner::Job;
use crate::search::sink::reserve;
use crate::search::stats::Stats;
use crate::workers::alone::is_alone;
use impinge_exact::Contact;
use rayon::prelude::*;

/// Fewer impacts are named by one thread.
const NAMED_BY_A_TASK: usize = 1 << 12;

/// Two elements that touch during a step, and when first.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Impact {
    /// The kinds of the two elements.
    pub kind: PairKind,
    /// The element that the kind names first: the vertex of a vertex and a face, the edge of an
    /// edge and a vertex.
    ///
    /// Vertices are numbered as positions are. Faces are numbered as they were given; those of
    /// tetrahedra by tetrahedron, then by the opposite corner. Edges are numbered as they were
    /// given; those of faces as unique pairs `(low, high)` in the order of `(high, low)`.
    /// [`Body::part`](crate::Body::part) lists them.
    pub a: Element,
    /// The other element. If both are of the same kind, it belongs to the body with the higher id,
    /// or is the higher element of the same body.
    pub b: Element,
    /// The first time in [0, 1] at which they touch, rounded down to `f32` or `f64`, as
    /// [`Query::precision`](crate::Query::precision) says.
    pub toi: f64,
    /// Whether they touch at the start, at time 0.
    pub at_start: bool,
}

impl Impact {
    /// The row `[body_a, element_a, body_b, element_b]`, with bodies by their
    /// [`index`](BodyId::index).
    pub fn row(&self) -> [u32; 4] {
        row(self.a, self.b)
    }

    /// What makes it the same pair in another answer, in the order of answers.
    fn key(&self) -> (PairKind, Element, Element) {
        (self.kind, self.a, self.b)
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

fn name(
    numbering: &Numbering,
    kind: PairKind,
    precision: Precision,
    found: &Found<Contact>,
) -> Impact {
    let (a, b) = numbering.pair(found.key);
    Impact {
        kind,
        a,
        b,
        toi: precision.round(&found.value),
        at_start: found.value.at_start,
    }
}

/// [`Impacts::hash`] of impacts given as kind, `[body_a, element_a, body_b, element_b]` and time.
/// The hash of several sets with no impact in common is the wrapping sum of their hashes.
pub fn hash_impact_rows(rows: impl IntoIterator<Item = (PairKind, [u32; 4], f64)>) -> u64 {
    rows.into_iter().fold(0, |sum, (kind, row, toi)| {
        let time = mix(toi.to_bits() ^ kind as u64);
        sum.wrapping_add(mix(hash_row(row) ^ time))
    })
}

/// All pairs of elements that touch during a step, sorted by
/// `(kind, body_a, element_a, body_b, element_b)`.
///
/// The same input gives the same bytes on every method, backend, thread count and budget.
#[derive(Clone, Default)]
pub struct Impacts {
    numbering: Numbering,
    impacts: Vec<Impact>,
    start_intersects: Option<bool>,
    stats: Stats,
    /// Where its buffers go when it is dropped.
    home: Home<Impacts>,
}

gives_back!(Impacts);

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
    pub(crate) fn begin(&mut self, plan: &Plan) {
        self.numbering.begin(plan);
        self.impacts.clear();
        self.start_intersects = None;
        self.stats.clear();
    }

    pub(crate) fn set_start_intersects(&mut self, start_intersects: Option<bool>) {
        self.start_intersects = start_intersects;
    }

    pub(crate) fn stats_mut(&mut self) -> &mut Stats {
        &mut self.stats
    }

    /// All that was found, each kind in the order of the keys.
    ///
    /// # Errors
    /// There is no memory for them; the pool's threads do not start.
    pub(crate) fn fill(&mut self, job: Job<'_>, found: &FoundByKind) -> Result<(), Error> {
        let (precision, workers) = (job.plan.precision, job.workers);
        let n: usize = found.iter().map(Vec::len).sum();
        let Impacts {
            numbering, impacts, ..
        } = self;
        reserve(impacts, n, "impacts")?;
        for (kind, found) in PairKind::ALL.into_iter().zip(found) {
            let named = |found| name(numbering, kind, precision, found);
            if is_alone() || found.len() <= NAMED_BY_A_TASK {
                impacts.extend(found.iter().map(named));
                continue;
            }
            workers.install(found.len(), || match is_alone() {
                true => impacts.extend(found.iter().map(named)),
                false => {
                    let found = found.par_iter().with_min_len(NAMED_BY_A_TASK);
                    impacts.par_extend(found.map(named));
                }
            })?;
        }
        Ok(())
    }

    /// Bytes of the answer.
    pub(crate) fn bytes(&self) -> u64 {
        (size_of::<Impact>() * self.impacts.capacity()) as u64
    }

    /// What was found, by its names.
    pub(crate) fn impact(
        &self,
        kind: PairKind,
        precision: Precision,
        found: &Found<Contact>,
    ) -> Impact {
        name(&self.numbering, kind, precision, found)
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
    pub fn iter(&self) -> std::slice::Iter<'_, Impact> {
        self.impacts.iter()
    }

    /// Rows `[body_a, element_a, body_b, element_b]`, with bodies by their
    /// [`index`](BodyId::index).
    pub fn rows(&self) -> impl ExactSizeIterator<Item = [u32; 4]> + '_ {
        self.iter().map(Impact::row)
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

    /// Which pairs an older answer also has, which are new, and which are gone: two pairs are the
    /// same if their kinds, bodies and elements are, whatever their times. Pairs of a body that was
    /// removed and of one in its slot differ.
    ///
    /// # Errors
    /// The older answer is about another scene, which is no clone. Or both answers have pairs with
    /// elements of the same sort (vertices, edges or faces) of a body that was re-meshed between
    /// them, or with edges of it that were [set](crate::Scene::set_edges).
    pub fn changes(&self, old: &Impacts) -> Result<Changes, Error> {
        self.check_comparable(old, None)?;
        let [old, new] = [old, self].map(|impacts| impacts.iter().map(Impact::key));
        Ok(Changes::between(old, new))
    }

    /// Refuses what [`changes`](Impacts::changes) refuses, of all pairs or of one kind.
    #[doc(hidden)]
    pub fn check_comparable(&self, old: &Impacts, kind: Option<PairKind>) -> Result<(), Error> {
        let keys = [old, self].map(|impacts| {
            let of_kind = kind.map_or(&impacts.impacts[..], |kind| impacts.of(kind));
            of_kind.iter().map(Impact::key)
        });
        self.numbering.check_comparable(&old.numbering, keys)
    }

    /// A hash of the set of impacts, times included, that does not depend on their order: the
    /// wrapping sum of a mixed 64-bit word per impact.
    pub fn hash(&self) -> u64 {
        hash_impact_rows(
            self.impacts
                .iter()
                .map(|impact| (impact.kind, impact.row(), impact.toi)),
        )
    }

    /// How the answer was found.
    pub fn stats(&self) -> &Stats {
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
