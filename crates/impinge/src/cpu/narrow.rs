//! Stage `narrow`: the exact test of candidates.
//!
//! In: candidates. Out: keys of pairs that intersect. Triangle pairs go through two floating-point
//! filters, eight pairs at a time (`exact::filter`, bounds derived in `docs/exactness.md`): most are
//! thrown out because one triangle lies on one side of the other's plane; the rest is classified; what
//! the filters leave open goes to exact arithmetic. Other kinds go there at once; that code filters too.

use std::time::{Duration, Instant};

use crate::exact::filter::{self, LANES, TrianglePairs8};
use crate::frame::pair_key;
use crate::grouping::GROUP;
use crate::narrow::{intersect, intersect_shared};
use crate::scene::{Kind, Positions};

use super::simd::Simd;
use super::world::{BodyRef, World};

/// Two primitives whose boxes overlap: participants, and places in their clusters' orders.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Candidate {
    pub a: u32,
    pub b: u32,
    pub place_a: u32,
    pub place_b: u32,
}

/// Candidates are settled once this many have gathered.
const FULL: usize = 1024;
/// The last work item before that may add this many.
const MOST: usize = FULL + GROUP * GROUP;

/// One worker's candidates, pairs and counts.
#[derive(Debug, Default)]
pub(crate) struct Settler {
    pub keys: Vec<u64>,
    pub n_candidates: u64,
    pub n_unsure: u64,
    /// Time spent here, for the statistics.
    pub busy: Duration,
    candidates: Vec<Candidate>,
    survivors: Vec<Candidate>,
}

impl Settler {
    /// Makes ready for a frame. Candidates get all the room that they may ever need.
    pub fn clear(&mut self) {
        self.keys.clear();
        self.candidates.clear();
        self.candidates.reserve_exact(MOST);
        self.survivors.reserve_exact(MOST);
        self.n_candidates = 0;
        self.n_unsure = 0;
        self.busy = Duration::ZERO;
    }

    /// Bytes held, the keys not counted: they are the answer.
    pub fn bytes(&self) -> usize {
        size_of::<Candidate>() * (self.candidates.capacity() + self.survivors.capacity())
    }

    #[inline(always)]
    pub fn push(&mut self, candidate: Candidate) {
        self.candidates.push(candidate);
    }

    #[inline(always)]
    pub fn settle_when_full<S: Simd>(&mut self, simd: S, world: World<'_>) {
        if self.candidates.len() >= FULL {
            self.settle(simd, world);
        }
    }

    /// A pair of one body that shares a vertex, under the rule that resolves it.
    pub fn settle_shared(&mut self, body: &BodyRef<'_>, place_a: u32, place_b: u32) {
        self.n_candidates += 1;
        let (a, b) = (body.points(place_a), body.points(place_b));
        let (ids_a, ids_b) = (body.corners(place_a), body.corners(place_b));
        let rule = crate::SharedVertex::Resolve;
        if intersect_shared(rule, body.participant.kind, (&a, ids_a), (&b, ids_b)) {
            self.keys
                .push(pair_key(body.global(place_a), body.global(place_b)));
        }
    }

    /// Settles what has gathered.
    #[inline(always)]
    pub fn settle<S: Simd>(&mut self, simd: S, world: World<'_>) {
        if self.candidates.is_empty() {
            return;
        }
        let start = Instant::now();
        self.n_candidates += self.candidates.len() as u64;
        self.reject(simd, world);
        self.classify(simd, world);
        self.candidates.clear();
        self.survivors.clear();
        self.busy += start.elapsed();
    }

    /// Moves what the planes do not separate to the survivors; kinds other than triangles are
    /// settled on the way.
    #[inline(always)]
    fn reject<S: Simd>(&mut self, _: S, world: World<'_>) {
        let mut lookup = Lookup::new(world);
        let mut batch = TrianglePairs8::default();
        let mut filled = [Candidate::NONE; LANES];
        let mut n_filled = 0;
        let candidates = std::mem::take(&mut self.candidates);
        for &candidate in &candidates {
            lookup.go_to(candidate);
            let (a, b) = (&lookup.a, &lookup.b);
            let kinds = (a.participant.kind, b.participant.kind);
            if kinds != (Kind::Triangles, Kind::Triangles) {
                self.settle_exactly(a, b, candidate);
                continue;
            }
            fill(&mut batch, n_filled, a, b, candidate);
            filled[n_filled] = candidate;
            n_filled += 1;
            if n_filled == LANES {
                self.keep(&filled, !filter::reject_by_planes::<S::F64x8>(&batch));
                n_filled = 0;
            }
        }
        if n_filled > 0 {
            let used = !(u8::MAX << n_filled);
            self.keep(
                &filled,
                !filter::reject_by_planes::<S::F64x8>(&batch) & used,
            );
        }
        self.candidates = candidates;
    }

    #[inline(always)]
    fn keep(&mut self, filled: &[Candidate; LANES], mut kept: u8) {
        while kept != 0 {
            self.survivors.push(filled[kept.trailing_zeros() as usize]);
            kept &= kept - 1;
        }
    }

    #[inline(always)]
    fn classify<S: Simd>(&mut self, _: S, world: World<'_>) {
        let mut lookup = Lookup::new(world);
        let mut batch = TrianglePairs8::default();
        let survivors = std::mem::take(&mut self.survivors);
        for chunk in survivors.chunks(LANES) {
            for (lane, &candidate) in chunk.iter().enumerate() {
                lookup.go_to(candidate);
                fill(&mut batch, lane, &lookup.a, &lookup.b, candidate);
            }
            let verdict = filter::classify::<S::F64x8>(&batch);
            for (lane, &candidate) in chunk.iter().enumerate() {
                if verdict.no >> lane & 1 == 1 {
                    continue;
                }
                lookup.go_to(candidate);
                let (a, b) = (&lookup.a, &lookup.b);
                if verdict.yes >> lane & 1 == 1 {
                    self.keys.push(pair_key(
                        a.global(candidate.place_a),
                        b.global(candidate.place_b),
                    ));
                } else {
                    self.n_unsure += 1;
                    self.settle_exactly(a, b, candidate);
                }
            }
        }
        self.survivors = survivors;
    }

    #[inline(never)]
    fn settle_exactly(&mut self, a: &BodyRef<'_>, b: &BodyRef<'_>, candidate: Candidate) {
        let points_a = a.points(candidate.place_a);
        let points_b = b.points(candidate.place_b);
        if intersect(a.participant.kind, &points_a, b.participant.kind, &points_b) {
            self.keys.push(pair_key(
                a.global(candidate.place_a),
                b.global(candidate.place_b),
            ));
        }
    }
}

impl Candidate {
    const NONE: Candidate = Candidate {
        a: 0,
        b: 0,
        place_a: 0,
        place_b: 0,
    };
}

/// The two bodies of the candidate at hand; candidates of the same bodies come in runs.
struct Lookup<'a> {
    world: World<'a>,
    a_ix: u32,
    b_ix: u32,
    a: BodyRef<'a>,
    b: BodyRef<'a>,
}

impl<'a> Lookup<'a> {
    fn new(world: World<'a>) -> Self {
        let first = world.body(0);
        Lookup {
            world,
            a_ix: 0,
            b_ix: 0,
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
}

#[inline(always)]
fn fill(
    batch: &mut TrianglePairs8,
    lane: usize,
    a: &BodyRef<'_>,
    b: &BodyRef<'_>,
    candidate: Candidate,
) {
    fill_side(&mut batch.a, lane, a, candidate.place_a);
    fill_side(&mut batch.b, lane, b, candidate.place_b);
}

#[inline(always)]
fn fill_side(side: &mut [[[f64; LANES]; 3]; 3], lane: usize, body: &BodyRef<'_>, place: u32) {
    let crate::Elements::Triangles(faces) = body.elements else {
        unreachable!("only triangles are batched");
    };
    let [p, q, r] = faces[place as usize];
    // The match is outside: one predictable branch a triangle, not one a vertex.
    match body.positions {
        Positions::F32(positions) => {
            fill_vertex(&mut side[0], lane, &positions[p as usize]);
            fill_vertex(&mut side[1], lane, &positions[q as usize]);
            fill_vertex(&mut side[2], lane, &positions[r as usize]);
        }
        Positions::F64(positions) => {
            fill_vertex(&mut side[0], lane, &positions[p as usize]);
            fill_vertex(&mut side[1], lane, &positions[q as usize]);
            fill_vertex(&mut side[2], lane, &positions[r as usize]);
        }
    }
}

#[inline(always)]
fn fill_vertex<R: Copy + Into<f64>>(vertex: &mut [[f64; LANES]; 3], lane: usize, point: &[R; 3]) {
    vertex[0][lane] = point[0].into();
    vertex[1][lane] = point[1].into();
    vertex[2][lane] = point[2].into();
}
