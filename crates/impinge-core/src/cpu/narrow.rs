//! Stage `narrow`: the exact test of candidates.
//!
//! In: candidates. Out: keys of pairs that intersect. Triangle pairs go through two floating-point
//! filters, eight pairs at a time (`impinge_exact::filter`, bounds derived in `docs/exactness.md`):
//! most are rejected because one triangle lies on one side of the other's plane; the rest is
//! classified. Tetrahedron pairs are classified by their faces, then the open ones by faces and
//! edges. Pairs of which the filters are unsure go to exact arithmetic, and so do pairs of a
//! triangle and a tetrahedron; that code filters too.

use crate::workers::clock::Instant;
use std::sync::Arc;
use std::time::Duration;

use crate::bvh::GROUP;
use crate::plan::pair_key;
use crate::scene::elements::Elements;
use crate::scene::index::{Number, PartIx, Slot};
use crate::scene::positions::Positions;
use crate::search::narrow::{intersect, intersect_shared};
use crate::search::sink::{Answer, BLOCK};
use crate::workers::tuning::Tuning;
use impinge_exact::internal::filter::{
    self, BATCH, LANES, TetrahedronPairs8, TrianglePairs8, Verdict, Verdict16,
};

use super::group_cache::Group;
use super::lane_pairs::{LanePairs, RowSide, WorkItem};
use super::world::{BodyRef, World};
use crate::simd::{Isa, Lanes, Simd, with_isa};

/// Two elements whose boxes overlap: parts, and slots in their clusters' orders.
#[derive(Debug, Clone, Copy)]
pub struct Candidate {
    /// The first part.
    pub a: PartIx,
    /// The second part.
    pub b: PartIx,
    /// Slot of the element of `a`.
    pub slot_a: Slot,
    /// Slot of the element of `b`.
    pub slot_b: Slot,
}

/// How many candidates may wait: the last work item may add a full group product to those that are
/// not enough yet.
pub(super) fn waiting_capacity(tuning: &Tuning) -> usize {
    // A test may ask for more than memory holds.
    tuning.decide_from.min(1 << 16) + GROUP * GROUP
}

/// One worker's candidates, pairs and counts.
#[derive(Debug, Default)]
#[repr(align(128))]
pub struct Decider {
    /// Keys of pairs that intersect, handed over in blocks.
    pub keys: Vec<u64>,
    answer: Option<Arc<Answer>>,
    /// Keys per block.
    block: usize,
    /// Whether only the lowest pair is wanted, and then whether by its second element.
    seeks_lowest: Option<bool>,
    /// Candidates that were decided.
    pub n_candidates: u64,
    /// Candidates left to exact arithmetic.
    pub n_unsure: u64,
    /// How often a full batch of candidates was decided.
    pub n_full: u64,
    /// Number of waiting candidates that triggers a batch.
    full: usize,
    /// Time spent here, for the statistics.
    pub busy: Duration,
    candidates: Vec<Candidate>,
    /// Triangle pairs that no plane separates.
    survivors: Vec<Candidate>,
    /// Tetrahedron pairs that are open after the test of faces.
    open: Vec<Candidate>,
}

impl Decider {
    /// Prepares for a frame. Candidates and keys get all the room that they may ever need.
    pub fn begin(&mut self, answer: &Arc<Answer>, tuning: &Tuning) {
        self.full = tuning.decide_from;
        self.n_full = 0;
        self.answer = Some(Arc::clone(answer));
        self.block = answer.block();
        self.seeks_lowest = answer.seeks_lowest();
        self.keys.clear();
        let most = waiting_capacity(tuning);
        // A block less one, plus the keys of a work item, plus those of the waiting candidates.
        self.keys.reserve_exact(BLOCK + GROUP * GROUP + most);
        self.candidates.clear();
        self.candidates.reserve_exact(most);
        self.survivors.reserve_exact(most);
        self.open.reserve_exact(most);
        self.n_candidates = 0;
        self.n_unsure = 0;
        self.busy = Duration::ZERO;
    }

    /// Ends a frame: hands over the remaining keys.
    pub fn end(&mut self) {
        if let Some(answer) = self.answer.take() {
            answer.take(&mut self.keys);
        }
    }

    /// Hands over the keys once there is a block of them.
    #[inline(always)]
    fn hand_over(&mut self) {
        if self.keys.len() >= self.block {
            self.hand_over_block();
        }
    }

    #[inline(never)]
    fn hand_over_block(&mut self) {
        if let Some(answer) = &self.answer {
            answer.take(&mut self.keys);
        }
    }

    /// Whether the answer takes no more.
    #[inline(always)]
    pub fn is_over(&self) -> bool {
        self.answer.as_ref().is_some_and(|answer| answer.is_over())
    }

    /// Where only the lowest pair is wanted: of which side's elements only those up to a number
    /// still matter.
    #[inline(always)]
    pub(super) fn up_to(&self) -> Option<(RowSide, Number)> {
        let side = match self.seeks_lowest? {
            false => RowSide::A,
            true => RowSide::B,
        };
        Some((side, self.answer.as_ref()?.up_to()))
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let lists = [&self.candidates, &self.survivors, &self.open];
        let room: usize = lists.iter().map(|list| list.capacity()).sum();
        size_of::<Candidate>() * room + size_of::<u64>() * self.keys.capacity()
    }

    /// Adds a candidate.
    #[inline(always)]
    pub fn push(&mut self, candidate: Candidate) {
        self.candidates.push(candidate);
    }

    /// Takes the candidates of a work item. The filter in f32 decides triangles in f32, except for
    /// a few of which it is unsure; these and all other candidates are [pushed](Self::push).
    #[inline(always)]
    pub(super) fn decide_item<S: Simd>(
        &mut self,
        _: S,
        world: World<'_>,
        item: &WorkItem,
        [group_a, group_b]: [&Group; 2],
        lane_pairs: &LanePairs,
    ) {
        let (cluster_a, cluster_b) = (item.cluster_a, item.cluster_b);
        let in_tables = group_a.in_tables && group_b.in_tables;
        let (body_a, body_b) = (world.body(item.a), world.body(item.b));
        for first in (0..lane_pairs.len()).step_by(BATCH) {
            let batch = lane_pairs.batch(first);
            let lanes = u64::MAX >> (64 - (lane_pairs.len() - first).min(BATCH));
            let verdict = if in_tables {
                let tables = [&group_a.corners, &group_b.corners];
                filter::classify_in_tables::<S::F32>(tables, batch, lanes as u16)
            } else {
                Verdict16::default()
            };
            let slots = |lane: usize| {
                let [lane_a, lane_b] = batch.map(|lanes| u32::from(lanes[lane]));
                (cluster_a.slot(lane_a), cluster_b.slot(lane_b))
            };
            for lane in Lanes(u64::from(verdict.yes) & lanes) {
                let (slot_a, slot_b) = slots(lane);
                self.keys
                    .push(pair_key(body_a.global(slot_a), body_b.global(slot_b)));
            }
            let open = u64::from(!(verdict.yes | verdict.no)) & lanes;
            self.n_candidates += u64::from((lanes & !open).count_ones());
            for lane in Lanes(open) {
                let (slot_a, slot_b) = slots(lane);
                self.push(Candidate {
                    a: item.a,
                    b: item.b,
                    slot_a,
                    slot_b,
                });
            }
        }
    }

    /// Decides the candidates once there are enough.
    #[inline(always)]
    pub fn decide_when_full(&mut self, isa: Isa, world: World<'_>) {
        if self.candidates.len() >= self.full {
            self.n_full += u64::from(!self.candidates.is_empty());
            self.decide(isa, world);
        }
        self.hand_over();
    }

    /// Decides a pair of one body that shares a vertex, under `SharedVertex::Resolve`.
    pub fn decide_shared(&mut self, body: &BodyRef<'_>, slot_a: Slot, slot_b: Slot) {
        self.decide_shared_by_all(body, &[slot_a], &[slot_b]);
    }

    /// Decides all pairs of an element of the one list with one of the other, under
    /// `SharedVertex::Resolve`. Elements of one list have the same vertices, and a vertex is in
    /// both.
    pub fn decide_shared_by_all(&mut self, body: &BodyRef<'_>, a: &[Slot], b: &[Slot]) {
        let n_pairs = a.len() as u64 * b.len() as u64;
        let pairs = a.iter().flat_map(|&a| b.iter().map(move |&b| (a, b)));
        self.decide_as_one(body, [a[0], b[0]], n_pairs, pairs);
    }

    /// Decides all pairs of a list, under `SharedVertex::Resolve`. Its elements have the same
    /// vertices.
    pub fn decide_alike(&mut self, body: &BodyRef<'_>, list: &[Slot]) {
        let &[first, second, ..] = list else {
            return;
        };
        let n_pairs = list.len() as u64 * (list.len() as u64 - 1) / 2;
        let rest = |ix: usize| &list[ix + 1..];
        let pairs =
            (list.iter().enumerate()).flat_map(|(ix, &a)| rest(ix).iter().map(move |&b| (a, b)));
        self.decide_as_one(body, [first, second], n_pairs, pairs);
    }

    /// Decides pairs that share vertices and have one answer: that of the pair `example`.
    fn decide_as_one(
        &mut self,
        body: &BodyRef<'_>,
        example: [Slot; 2],
        n_pairs: u64,
        pairs: impl Iterator<Item = (Slot, Slot)>,
    ) {
        if self.is_over() {
            return;
        }
        self.n_candidates += n_pairs;
        let [a, b] = example.map(|slot| body.points(slot));
        let [ids_a, ids_b] = example.map(|slot| body.corners(slot));
        let rule = crate::SharedVertex::Resolve;
        if !intersect_shared(rule, body.part.kind, (&a, ids_a), (&b, ids_b)) {
            return;
        }
        // So many may be far more than memory holds.
        if n_pairs > BLOCK as u64
            && let Some(answer) = &self.answer
            && !answer.announce(n_pairs)
        {
            return;
        }
        for (a, b) in pairs {
            self.keys.push(pair_key(body.global(a), body.global(b)));
            self.hand_over();
        }
    }

    /// Decides all candidates. Compiled once per instruction set, not once per caller.
    pub fn decide(&mut self, isa: Isa, world: World<'_>) {
        if self.candidates.is_empty() {
            return;
        }
        let start = Instant::now();
        self.n_candidates += self.candidates.len() as u64;
        with_isa!(isa, reject, (decider: &mut Decider = self, world: World<'_> = world));
        with_isa!(isa, classify_triangles, (decider: &mut Decider = self, world: World<'_> = world));
        with_isa!(isa, classify_tetrahedra, (decider: &mut Decider = self, world: World<'_> = world));
        self.candidates.clear();
        self.survivors.clear();
        self.open.clear();
        self.hand_over();
        self.busy += start.elapsed();
    }

    /// Passes on triangle pairs that planes do not separate, and tetrahedron pairs that are open
    /// after the test of faces. Decides batches of mixed kinds right away.
    #[inline(always)]
    fn reject<S: Simd>(&mut self, simd: S, world: World<'_>) {
        let mut lookup = BodyLookup::new(world);
        let mut triangles = TrianglePairs8::default();
        let mut tetrahedra = TetrahedronPairs8::default();
        let candidates = std::mem::take(&mut self.candidates);
        for chunk in candidates.chunks(LANES) {
            if lookup.fill_triangles(simd, chunk, &mut triangles) {
                let kept = !filter::reject_by_planes::<S::F64>(&triangles);
                keep(&mut self.survivors, chunk, kept);
            } else if lookup.fill_tetrahedra(simd, chunk, &mut tetrahedra) {
                let verdict = filter::classify_by_faces::<S::F64>(&tetrahedra);
                self.take_pairs(&mut lookup, chunk, verdict.yes);
                keep(&mut self.open, chunk, !(verdict.yes | verdict.no));
            } else {
                for &candidate in chunk {
                    lookup.go_to(candidate);
                    self.decide_exactly(&lookup.a, &lookup.b, candidate);
                }
            }
        }
        self.candidates = candidates;
    }

    #[inline(always)]
    fn classify_triangles<S: Simd>(&mut self, simd: S, world: World<'_>) {
        if self.survivors.is_empty() {
            return;
        }
        let mut lookup = BodyLookup::new(world);
        let mut batch = TrianglePairs8::default();
        let survivors = std::mem::take(&mut self.survivors);
        for chunk in survivors.chunks(LANES) {
            let filled = lookup.fill_triangles(simd, chunk, &mut batch);
            debug_assert!(filled, "survivors are triangles");
            let verdict = filter::classify::<S::F64>(&batch);
            self.take(&mut lookup, chunk, verdict);
        }
        self.survivors = survivors;
    }

    #[inline(always)]
    fn classify_tetrahedra<S: Simd>(&mut self, simd: S, world: World<'_>) {
        if self.open.is_empty() {
            return;
        }
        let mut lookup = BodyLookup::new(world);
        let mut batch = TetrahedronPairs8::default();
        let open = std::mem::take(&mut self.open);
        for chunk in open.chunks(LANES) {
            let filled = lookup.fill_tetrahedra(simd, chunk, &mut batch);
            debug_assert!(filled, "they are tetrahedra");
            let verdict = filter::classify_tetrahedra::<S::F64>(&batch);
            self.take(&mut lookup, chunk, verdict);
        }
        self.open = open;
    }

    /// Records the verdict on a batch; decides its unsure pairs exactly.
    #[inline(always)]
    fn take(&mut self, lookup: &mut BodyLookup<'_>, chunk: &[Candidate], verdict: Verdict) {
        self.take_pairs(lookup, chunk, verdict.yes);
        for lane in lanes(chunk, !(verdict.yes | verdict.no)) {
            lookup.go_to(chunk[lane]);
            self.n_unsure += 1;
            self.decide_exactly(&lookup.a, &lookup.b, chunk[lane]);
        }
    }

    /// Records pairs that certainly intersect.
    #[inline(always)]
    fn take_pairs(&mut self, lookup: &mut BodyLookup<'_>, chunk: &[Candidate], yes: u8) {
        for lane in lanes(chunk, yes) {
            let candidate = chunk[lane];
            lookup.go_to(candidate);
            let key_a = lookup.a.global(candidate.slot_a);
            let key_b = lookup.b.global(candidate.slot_b);
            self.keys.push(pair_key(key_a, key_b));
        }
    }

    #[inline(never)]
    fn decide_exactly(&mut self, a: &BodyRef<'_>, b: &BodyRef<'_>, candidate: Candidate) {
        let points_a = a.points(candidate.slot_a);
        let points_b = b.points(candidate.slot_b);
        if intersect(a.part.kind, &points_a, b.part.kind, &points_b) {
            self.keys.push(pair_key(
                a.global(candidate.slot_a),
                b.global(candidate.slot_b),
            ));
        }
    }
}

/// The lanes of a mask, up to the size of the batch.
#[inline(always)]
fn lanes(chunk: &[Candidate], mask: u8) -> Lanes {
    Lanes(u64::from(mask & (u8::MAX >> (LANES - chunk.len()))))
}

#[inline(always)]
fn keep(list: &mut Vec<Candidate>, chunk: &[Candidate], mask: u8) {
    for lane in lanes(chunk, mask) {
        list.push(chunk[lane]);
    }
}

// Kernels of their own: without optimisation, one for all of them would need more stack than a
// thread has.

#[inline(always)]
fn reject<S: Simd>(simd: S, decider: &mut Decider, world: World<'_>) {
    decider.reject(simd, world);
}

#[inline(always)]
fn classify_triangles<S: Simd>(simd: S, decider: &mut Decider, world: World<'_>) {
    decider.classify_triangles(simd, world);
}

#[inline(always)]
fn classify_tetrahedra<S: Simd>(simd: S, decider: &mut Decider, world: World<'_>) {
    decider.classify_tetrahedra(simd, world);
}

/// The two bodies of the current candidate; candidates of the same bodies come in runs.
struct BodyLookup<'a> {
    world: World<'a>,
    a_ix: PartIx,
    b_ix: PartIx,
    a: BodyRef<'a>,
    b: BodyRef<'a>,
}

impl<'a> BodyLookup<'a> {
    fn new(world: World<'a>) -> Self {
        let ix = PartIx::new(0);
        let first = world.body(ix);
        BodyLookup {
            world,
            a_ix: ix,
            b_ix: ix,
            a: first,
            b: first,
        }
    }

    #[inline(always)]
    fn go_to(&mut self, candidate: Candidate) {
        if candidate.a != self.a_ix {
            self.a_ix = candidate.a;
            self.a = self.world.body(candidate.a);
        }
        if candidate.b != self.b_ix {
            self.b_ix = candidate.b;
            self.b = self.world.body(candidate.b);
        }
    }

    /// Gathers a batch of triangle pairs; false if any pair is of another kind.
    #[inline(always)]
    fn fill_triangles<S: Simd>(
        &mut self,
        simd: S,
        chunk: &[Candidate],
        batch: &mut TrianglePairs8,
    ) -> bool {
        let TrianglePairs8 { a, b } = batch;
        self.fill(simd, chunk, [a, b], |elements| match elements {
            Elements::Triangles(faces) => Some(faces),
            _ => None,
        })
    }

    /// Gathers a batch of tetrahedron pairs; false if any pair is of another kind.
    #[inline(always)]
    fn fill_tetrahedra<S: Simd>(
        &mut self,
        simd: S,
        chunk: &[Candidate],
        batch: &mut TetrahedronPairs8,
    ) -> bool {
        let TetrahedronPairs8 { a, b } = batch;
        self.fill(simd, chunk, [a, b], |elements| match elements {
            Elements::Tetrahedra(tets) => Some(tets),
            _ => None,
        })
    }

    /// Gathers a batch; false if any element does not have N corners.
    #[inline(always)]
    fn fill<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        chunk: &[Candidate],
        [side_a, side_b]: [&mut [[[f64; LANES]; 3]; N]; 2],
        corners_of: impl Fn(&'a Elements) -> Option<&'a [[u32; N]]>,
    ) -> bool {
        let common = slots_in_common(chunk);
        for (lane, &candidate) in chunk.iter().enumerate() {
            self.go_to(candidate);
            let (a, b) = (&self.a, &self.b);
            let (Some(corners_a), Some(corners_b)) =
                (corners_of(a.elements), corners_of(b.elements))
            else {
                return false;
            };
            if let Some((slots_a, slots_b)) = common {
                put_all(simd, side_a, a.positions, corners_a, slots_a);
                put_all(simd, side_b, b.positions, corners_b, slots_b);
                return true;
            }
            let (slot_a, slot_b) = (candidate.slot_a.index(), candidate.slot_b.index());
            put(side_a, lane, a.positions, &corners_a[slot_a]);
            put(side_b, lane, b.positions, &corners_b[slot_b]);
        }
        true
    }
}

/// The slots of candidates of the same two bodies; unused lanes repeat the first.
#[inline(always)]
fn slots_in_common(chunk: &[Candidate]) -> Option<([Slot; LANES], [Slot; LANES])> {
    let first = chunk[0];
    let mut slots = ([first.slot_a; LANES], [first.slot_b; LANES]);
    let mut same = true;
    for (lane, candidate) in chunk.iter().enumerate() {
        same &= (candidate.a == first.a) & (candidate.b == first.b);
        slots.0[lane] = candidate.slot_a;
        slots.1[lane] = candidate.slot_b;
    }
    same.then_some(slots)
}

/// Puts elements of one body into all lanes.
#[inline(always)]
fn put_all<S: Simd, const N: usize>(
    simd: S,
    side: &mut [[[f64; LANES]; 3]; N],
    positions: &Positions,
    corners: &[[u32; N]],
    slots: [Slot; LANES],
) {
    match positions {
        Positions::F32(positions) => {
            let mut ids = [[0; LANES]; N];
            for (lane, &slot) in slots.iter().enumerate() {
                let corners = &corners[slot.index()];
                for k in 0..N {
                    ids[k][lane] = corners[k];
                }
            }
            for k in 0..N {
                simd.put_vertices(positions, ids[k], &mut side[k]);
            }
        }
        Positions::F64(positions) => {
            let positions = &positions[..];
            for (lane, &slot) in slots.iter().enumerate() {
                let corners = &corners[slot.index()];
                for k in 0..N {
                    put_vertex(&mut side[k], lane, &positions[corners[k] as usize]);
                }
            }
        }
    }
}

/// Puts an element into a lane.
#[inline(always)]
fn put<const N: usize>(
    side: &mut [[[f64; LANES]; 3]; N],
    lane: usize,
    positions: &Positions,
    corners: &[u32; N],
) {
    // The match is outside the loop: one predictable branch per element, not one per vertex.
    match positions {
        Positions::F32(positions) => {
            let positions = &positions[..];
            for k in 0..N {
                put_vertex(&mut side[k], lane, &positions[corners[k] as usize]);
            }
        }
        Positions::F64(positions) => {
            let positions = &positions[..];
            for k in 0..N {
                put_vertex(&mut side[k], lane, &positions[corners[k] as usize]);
            }
        }
    }
}

#[inline(always)]
fn put_vertex<R: Copy + Into<f64>>(vertex: &mut [[f64; LANES]; 3], lane: usize, point: &[R; 3]) {
    vertex[0][lane] = point[0].into();
    vertex[1][lane] = point[1].into();
    vertex[2][lane] = point[2].into();
}
