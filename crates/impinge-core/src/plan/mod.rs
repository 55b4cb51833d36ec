//! What a question asks, resolved for one scene: which parts take part, in what order, which of
//! them meet and under which test, how elements move, what of the pairs is wanted, and within which
//! limits.
//!
//! A plan is made from a scene and a query, by one function per question, and never changes.
//!
//! A *part* is a part of a body whose elements are of one kind. For intersections each body has one
//! part: the elements that it was given as. For steps it has up to three: its edges, its vertices
//! and its faces.
//!
//! The elements of all parts are numbered consecutively, part after part and body after body in
//! slot order: element `i` of part `l` has the global number `first(l) + i`. A pair is then one
//! 64-bit key, `lower << 32 | higher`, and sorting the keys of one test sorts rows
//! `(body_a, element_a, body_b, element_b)`.
//!
//! ```text
//!  63            32 31             0
//! +----------------+----------------+
//! | global number  | global number  |   key of a pair, lower number first
//! +----------------+----------------+
//! ```

mod counted;
mod distances;
mod left_out;
mod parts;
mod question;

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use crate::boxes::Sweep;
use crate::query::goal::{Goal, Limits};
use crate::query::pair_kind::{PairKind, PairKinds};
use crate::query::step::{PairFilter, Precision, Start, check_distance};
use crate::query::{Cell, Query, Scope, SharedVertex};
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
pub use crate::scene::index::pair_key;
use crate::scene::index::{ElementIx, Number, PartIx, pair_numbers};
use crate::scene::{Body, Each, Filter, Scene};
use crate::workers::clock::Instant;
use impinge_exact::internal::Keep;
#[cfg(feature = "gpu")]
pub(crate) use left_out::LeftOut;
pub(crate) use left_out::{Gaps, OwnRule};
pub use question::{QueryPart, Question, TestId};

/// What a question asks. See the [module](self).
#[derive(Debug, Clone)]
pub struct Plan {
    /// Part after part, in slot order.
    pub parts: Vec<QueryPart>,
    /// Of the [scene](Scene::family).
    pub(crate) family: u64,
    /// The question about pairs.
    pub question: Question,
    /// The kinds of pairs, if the query names them.
    kinds: Option<PairKinds>,
    /// Of those that are asked for, the ones to look for now.
    only: PairKinds,
    /// The adjacency rule of self-collision.
    pub shared_vertex: SharedVertex,
    between: bool,
    excluded: BTreeSet<(BodyId, BodyId)>,
    cell: Option<Cell>,
    /// What of a step is examined. Boxes are inflated besides, see [`sweep`](Plan::sweep).
    sweep: Sweep,
    /// The distance within which elements are near, besides what their bodies add.
    distance: f64,
    /// What the elements of a step keep at most, besides their thickness.
    bound: f64,
    keep: Keep,
    /// How thick the elements of each part are, where they differ; empty where none do.
    thickness: Vec<Option<Arc<Each>>>,
    /// Which pairs of a step count.
    filter: Option<PairFilter>,
    /// Which pairs are left out because of their elements.
    left_out: Option<Arc<left_out::LeftOut>>,
    /// What happens to pairs that touch at the start of a step.
    pub(crate) start: Start,
    /// The precision of times.
    pub(crate) precision: Precision,
    /// Whether it is asked when pairs touch, or only which do.
    asks_when: bool,
    /// What of the pairs is wanted.
    pub goal: Goal,
    /// What the answer may be.
    pub limits: Limits,
    /// When the question was asked.
    pub since: Instant,
}

/// The least share that is not 0.
const LEAST_SHARE: f64 = f64::from_bits(1);

impl Plan {
    /// The question which elements intersect. Positions that were written in place are not checked
    /// yet.
    ///
    /// # Errors
    /// A stale id, one body twice, a cell without room, too many elements.
    pub fn intersections(
        scene: &Scene,
        query: &Query,
        goal: Goal,
        limits: Limits,
    ) -> Result<Self, Error> {
        let limits = match goal {
            // Any number of pairs is allowed.
            Goal::Any => Limits {
                max_pairs: None,
                ..limits
            },
            _ => limits,
        };
        query.check_without_kinds()?;
        query.check_without_filter()?;
        Plan::of(scene, query, Question::Intersection, goal, limits)
    }

    /// The question about the contacts of a step.
    pub(crate) fn contacts(
        scene: &Scene,
        query: &Query,
        goal: Goal,
        limits: Limits,
    ) -> Result<Self, Error> {
        Plan::of_step(scene, query, query.keep(), goal, limits)
    }

    /// The question which elements touch during a step, whenever. Times are bounds.
    pub(crate) fn touching(scene: &Scene, query: &Query, limits: Limits) -> Result<Self, Error> {
        let plan = Plan::contacts(scene, query, Goal::All, limits)?;
        Ok(Plan {
            precision: Precision::F32,
            asks_when: false,
            ..plan
        })
    }

    /// The question how far a step can be taken: about its earliest contact, at a time in `f64`, or
    /// in `f32` if elements keep a clearance. With one, rounding is part of what they keep.
    /// Without, `with_close` makes it a question about all ways that end at rounded positions, at
    /// any time of the step.
    pub(crate) fn advance(
        scene: &Scene,
        query: &Query,
        with_close: bool,
        limits: Limits,
    ) -> Result<Self, Error> {
        let mut keep = query.keep();
        let has_clearance = keep.clearance > 0.0;
        if has_clearance {
            keep.is_rounded = true;
            // What rounding takes is kept with a share of 0, too.
            keep.share = keep.share.max(LEAST_SHARE);
        }
        let mut plan = Plan::of_step(scene, query, keep, Goal::Earliest, limits)?;
        // With a clearance, a time in single precision is as good, and decided by filters.
        plan.precision = if has_clearance {
            Precision::F32
        } else {
            Precision::F64
        };
        if !plan.keeps_distance() && with_close {
            plan.round(scene);
        }
        Ok(plan)
    }

    /// The question which elements touch on the way to the end positions of a scene, which are
    /// those at a fraction of a step. Times are not needed.
    pub(crate) fn trial(
        scene: &Scene,
        query: &Query,
        fraction: f64,
        limits: Limits,
    ) -> Result<Self, Error> {
        let plan = Plan::of_step(scene, query, query.keep(), Goal::All, limits)?;
        Ok(Plan {
            sweep: Sweep {
                is_swept: fraction <= Sweep::NEARLY_STILL,
                ..plan.sweep
            },
            precision: Precision::F32,
            ..plan
        })
    }

    fn of_step(
        scene: &Scene,
        query: &Query,
        keep: Keep,
        goal: Goal,
        limits: Limits,
    ) -> Result<Self, Error> {
        query.check_step()?;
        let mut plan = Plan::of(scene, query, Question::Contact, goal, limits)?;
        plan.filter.clone_from(&query.filter);
        (plan.start, plan.precision) = (query.start, query.precision);
        plan.keep(scene, keep);
        Ok(plan)
    }

    /// The question which elements are within a distance: the sum of `distance` and the thickness
    /// of both bodies.
    pub(crate) fn nearness(
        scene: &Scene,
        query: &Query,
        distance: f64,
        limits: Limits,
    ) -> Result<Self, Error> {
        check_distance("distance", distance)?;
        query.check_without_filter()?;
        let of_distance = size_of::<f64>() * usize::from(query.distances);
        let of_points = size_of::<[[f64; 3]; 2]>() * usize::from(query.closest);
        let limits = Limits {
            besides: (1 + of_distance + of_points) as u64,
            ..limits
        };
        let mut plan = Plan::of(scene, query, Question::Nearness, Goal::All, limits)?;
        (plan.distance, plan.bound) = (distance, distance);
        plan.thicken(scene);
        Ok(plan)
    }

    /// Which boxes overlap, each inflated by a distance and the thickness of its element.
    pub(crate) fn candidates(
        scene: &Scene,
        inflation: f64,
        query: &Query,
        limits: Limits,
    ) -> Result<Self, Error> {
        check_distance("inflation", inflation)?;
        query.check_without_filter()?;
        let mut plan = Plan::of(scene, query, Question::Overlap, Goal::All, limits)?;
        let separation = 2.0 * inflation;
        let keep = Keep {
            separation,
            ..Keep::default()
        };
        plan.keep(scene, keep);
        Ok(plan)
    }

    /// The question which boxes overlap during the same step, of elements that may come as near as
    /// those may: keys are the same.
    pub(crate) fn overlapping(&self, scene: &Scene, limits: Limits) -> Self {
        let mut plan = Plan {
            question: Question::Overlap,
            sweep: Question::Overlap.sweep(),
            limits,
            since: Instant::now(),
            ..self.clone()
        };
        let keep = Keep {
            separation: self.bound,
            ..Keep::default()
        };
        plan.keep(scene, keep);
        plan
    }

    /// The kinds of pairs, if the query names them.
    #[cfg(feature = "gpu")]
    pub(crate) fn kinds_named(&self) -> Option<PairKinds> {
        self.kinds
    }

    /// The kinds of pairs that are asked for, as far as some parts may have them.
    pub(crate) fn kinds_asked(&self) -> PairKinds {
        let are_bare = self.parts.iter().any(|part| part.is_bare);
        let are_points = self.parts.iter().any(|part| part.is_points);
        let is_asked = |kind: &PairKind| {
            let has = |part| self.parts.iter().any(|own| own.part == part);
            self.only.contains(*kind)
                && self.is_kind_asked(*kind, are_bare, are_points)
                && kind.parts().into_iter().all(has)
        };
        PairKind::ALL.into_iter().filter(is_asked).collect()
    }

    /// The same question about some kinds of pairs only, asked now, with an answer of any length.
    pub(crate) fn of_kinds(&self, kinds: PairKinds) -> Self {
        Plan {
            only: kinds,
            limits: Limits::default(),
            since: Instant::now(),
            ..self.clone()
        }
    }

    /// The same question, asked now.
    pub(crate) fn asked_now(self) -> Self {
        Plan {
            since: Instant::now(),
            ..self
        }
    }

    fn of(
        scene: &Scene,
        query: &Query,
        question: Question,
        goal: Goal,
        limits: Limits,
    ) -> Result<Self, Error> {
        let mut plan = Plan {
            family: scene.family(),
            parts: Vec::with_capacity({
                let n_bodies = match query.scope {
                    Scope::Between(..) | Scope::SelfOf(_) => 2,
                    Scope::Across { .. } | Scope::All { .. } => scene.n_bodies(),
                };
                n_bodies * question.parts().len()
            }),
            question,
            kinds: query.kinds,
            only: PairKinds::ALL,
            // Vertices, edges and faces that share a vertex never count.
            shared_vertex: match question {
                Question::Intersection => query.shared_vertex,
                Question::Contact | Question::Nearness | Question::Overlap => SharedVertex::Skip,
            },
            between: false,
            excluded: query.excluded.clone(),
            cell: query.cell,
            sweep: question.sweep(),
            distance: 0.0,
            bound: 0.0,
            keep: Keep::default(),
            thickness: Vec::new(),
            filter: None,
            left_out: None,
            start: Start::default(),
            precision: Precision::default(),
            asks_when: true,
            goal,
            limits,
            since: Instant::now(),
        };
        plan.check_cell()?;
        for &id in &query.across {
            scene.body(id)?;
        }
        for id in query.excluded_bodies() {
            scene.check_known(id)?;
        }
        if let Scope::Between(a, b) = query.scope {
            scene.body(a)?;
            scene.body(b)?;
            if a == b {
                return Err(Error::SameBody { body: a });
            }
        }
        for &part in question.parts() {
            plan.push_part(scene, query, part)?;
        }
        plan.leave_out(scene, query)?;
        Ok(plan)
    }

    /// What is to become of the pairs that are found: all are held where it is known in the end
    /// only which of them count, or which one is the earliest.
    pub(crate) fn held(&self) -> Goal {
        match self.question {
            Question::Intersection if !self.counts_late() => self.goal,
            _ => Goal::All,
        }
    }

    /// Whether the time of each pair is asked.
    pub(crate) fn asks_times(&self) -> bool {
        self.asks_when && self.goal != Goal::Any
    }

    /// What of a step is examined, with boxes as they are.
    pub(crate) fn sweep(&self) -> Sweep {
        self.sweep
    }

    /// Whether pairs of one body that share a vertex are asked for.
    pub fn resolves(&self) -> bool {
        self.shared_vertex == SharedVertex::Resolve && self.parts.iter().any(|part| part.within)
    }

    /// The number of elements of all parts together.
    pub fn n_elements(&self) -> u64 {
        self.parts
            .last()
            .map_or(0, |last| u64::from(last.numbers().end.raw()))
    }

    /// The numbers that the lower number of a pair of some kind, or of an intersection, may be:
    /// those of the elements that the kind names first. Parts follow each other, so there are few
    /// others between them.
    pub(crate) fn lower_numbers(&self, kind: Option<PairKind>) -> Range<Number> {
        let of_part = |part: &&QueryPart| kind.is_none_or(|kind| part.part == kind.parts()[0]);
        let parts = self.parts.iter().filter(of_part);
        let ranges = parts.map(QueryPart::numbers);
        ranges
            .reduce(|all, own| all.start.min(own.start)..all.end.max(own.end))
            .unwrap_or(Number::new(0)..Number::new(0))
    }

    /// Whether any pairs of two different parts are wanted.
    pub fn between(&self) -> bool {
        self.parts.len() > 1 && (self.between || self.question != Question::Intersection)
    }

    /// The test for pairs of elements of two parts, or of one with itself; `None` if no pair of
    /// them is wanted.
    #[inline]
    pub fn test(&self, a: PartIx, b: PartIx) -> Option<TestId> {
        let (a, b) = (self.part(a), self.part(b));
        let is_asked = if a.id == b.id {
            a.within
        } else {
            self.meet(a, b)
        };
        if !is_asked {
            return None;
        }
        if self.question == Question::Intersection {
            return Some(TestId::Intersection);
        }
        let kind = PairKind::of(a.part, b.part)?;
        let is_asked = self.is_kind_asked(kind, a.is_bare && b.is_bare, a.is_points && b.is_points);
        (is_asked && self.only.contains(kind)).then_some(TestId::Elements(kind))
    }

    /// Whether pairs of a kind are asked for, of two bodies that have no faces, or no edges either.
    #[inline]
    fn is_kind_asked(&self, kind: PairKind, are_bare: bool, are_points: bool) -> bool {
        match self.kinds {
            Some(kinds) => kinds.contains(kind),
            // Vertices against faces and edges against edges cover every body with faces. Only
            // bodies without faces need edges against vertices, and only bodies of points need
            // vertices against vertices.
            None => match kind {
                PairKind::VertexFace | PairKind::EdgeEdge => true,
                PairKind::EdgeVertex => are_bare,
                PairKind::VertexVertex => are_points,
                PairKind::EdgeFace => self.question == Question::Nearness,
                PairKind::FaceFace => false,
            },
        }
    }

    #[inline]
    fn meet(&self, a: &QueryPart, b: &QueryPart) -> bool {
        self.between
            && a.filter.meets(b.filter)
            && (self.excluded.is_empty()
                || !self.excluded.contains(&(a.id.min(b.id), a.id.max(b.id))))
    }

    /// The filter of a part.
    #[cfg(feature = "gpu")]
    pub fn filter(&self, part: PartIx) -> Filter {
        self.part(part).filter
    }

    /// Whether pairs of different bodies are wanted.
    #[cfg(feature = "gpu")]
    pub(crate) fn meets_bodies(&self) -> bool {
        self.between
    }

    /// Pairs of bodies, lower first and sorted, that do not meet whatever their filters say.
    #[cfg(feature = "gpu")]
    pub(crate) fn excluded_bodies(&self) -> impl Iterator<Item = (BodyId, BodyId)> + '_ {
        self.excluded.iter().copied().filter(|(a, b)| a != b)
    }

    /// Pairs of parts, lower first and sorted, that do not meet whatever their filters say.
    #[cfg(feature = "gpu")]
    pub fn excluded_pairs(&self) -> impl Iterator<Item = (PartIx, PartIx)> + '_ {
        self.excluded
            .iter()
            .filter(|(a, b)| a != b)
            .filter_map(move |&(a, b)| Some((self.part_of(a)?, self.part_of(b)?)))
    }

    /// The part of a body, where each body has at most one.
    pub(crate) fn part_of(&self, body: BodyId) -> Option<PartIx> {
        let found = self.parts.binary_search_by_key(&body, |part| part.id);
        found.ok().map(PartIx::from_usize)
    }

    /// The parts, in order, of which every wanted pair of two bodies has one, if they are at most
    /// so many: those with one filter, where no others meet.
    pub(crate) fn named_parts(&self, most: usize) -> Option<Vec<PartIx>> {
        // Scenes with more filters than this are not looked at.
        const MOST_FILTERS: usize = 8;
        let mut filters: Vec<(Filter, usize)> = Vec::new();
        for part in &self.parts {
            if let Some((_, n)) = filters.iter_mut().find(|(known, _)| *known == part.filter) {
                *n += 1;
            } else if filters.len() < MOST_FILTERS {
                filters.push((part.filter, 1));
            } else {
                return None;
            }
        }
        let others_meet = |named: Filter| {
            let others = || {
                filters
                    .iter()
                    .map(|&(other, _)| other)
                    .filter(|&x| x != named)
            };
            others().any(|x| others().any(|y| x.meets(y)))
        };
        let mut few = filters.iter().filter(|&&(_, n)| n <= most);
        let &(named, _) = few.find(|&&(named, _)| !others_meet(named))?;
        let parts = self.numbered_parts();
        Some(
            parts
                .filter_map(|(ix, part)| (part.filter == named).then_some(ix))
                .collect(),
        )
    }

    /// The elements of a part, and their numbers.
    pub(crate) fn elements<'a>(
        &self,
        scene: &'a Scene,
        part: PartIx,
    ) -> impl Iterator<Item = (Number, &'a [u32])> + use<'a> {
        let QueryPart {
            part: kind, first, ..
        } = *self.part(part);
        let elements = self.body(scene, part).part(kind);
        ElementIx::up_to(elements.len()).map(move |ix| {
            let corners = elements.corners(ix.index());
            let element = match kind {
                // Vertices are numbered as positions are.
                Part::Vertices => ElementIx::new(corners[0]),
                _ => ix,
            };
            (first.plus(element), corners)
        })
    }

    /// All parts, by their indices.
    pub fn part_ixs(&self) -> impl ExactSizeIterator<Item = PartIx> + Clone + use<> {
        PartIx::up_to(self.parts.len())
    }

    /// All parts, with their indices.
    pub fn numbered_parts(&self) -> impl ExactSizeIterator<Item = (PartIx, &QueryPart)> + Clone {
        self.part_ixs().zip(&self.parts)
    }

    /// A part.
    #[inline(always)]
    pub fn part(&self, part: PartIx) -> &QueryPart {
        &self.parts[part.index()]
    }

    /// The body of a part.
    #[inline]
    pub fn body<'a>(&self, scene: &'a Scene, part: PartIx) -> &'a Body {
        scene.body_in(self.part(part).id.slot())
    }

    /// For each part, how many vertices the bodies of the scene have before its body.
    pub(crate) fn first_vertices(&self, scene: &Scene) -> Vec<usize> {
        let mut of_slots = Vec::new();
        let mut n = 0;
        for (id, body) in scene.bodies() {
            of_slots.resize(id.index() + 1, 0);
            of_slots[id.index()] = n;
            n += body.n_vertices();
        }
        (self.parts.iter().map(|part| of_slots[part.id.index()])).collect()
    }

    /// The part and the element that a global number belongs to.
    #[inline]
    pub fn locate(&self, number: Number) -> (PartIx, ElementIx) {
        let ix = owner_by_first(&self.parts, number, |part| part.first);
        (PartIx::from_usize(ix), self.parts[ix].element(number))
    }

    /// The element with a number, which is often of the same part as the last one.
    #[inline]
    pub fn locate_after(&self, number: Number, last: &mut PartIx) -> (PartIx, ElementIx) {
        let part = self.part(*last);
        if part.numbers().contains(&number) {
            return (*last, part.element(number));
        }
        let located = self.locate(number);
        *last = located.0;
        located
    }

    /// The elements of a pair, in the order of its key.
    pub fn located(&self, key: u64) -> [(PartIx, ElementIx); 2] {
        pair_numbers(key).map(|number| self.locate(number))
    }
}

/// Index of the last entry whose `first` is at most `number`. Empty parts share the `first`
/// of their successor; the last one of the run is the one that holds the element.
#[inline]
pub(crate) fn owner_by_first<T, N: Ord>(
    entries: &[T],
    number: N,
    first: impl Fn(&T) -> N,
) -> usize {
    entries.partition_point(|entry| first(entry) <= number) - 1
}
