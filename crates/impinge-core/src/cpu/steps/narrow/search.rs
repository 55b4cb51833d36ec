//! First contacts of pairs whose times are not known yet: intervals of time, eight pairs at a time.
//!
//! ```text
//! look     eight intervals of time in f64: no contact in it, one candidate, or unclear
//! enclose  eight candidates: contact or none, and when, nearly always to all bits of an f32
//! ```
//!
//! The two alternate on lists of a thousand pairs, so that no lane waits for another pair's search.
//! If close pairs are wanted too, pairs that stay beyond the margin are dropped first.

use crate::scene::positions::Positions;
use crate::simd::{Lanes, Simd};
use impinge_exact::ElementPair;
use impinge_exact::internal::filter::{self, Enclosed8, LANES, Look8, Next, Spans8, Steps8};

use super::super::world::StepWorld;
use super::batch::{Between, Slots, exact_pair};
use super::contacts::{FirstContacts, Open};

/// What is done with all pairs of a list.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Pass {
    /// Those that are certainly apart are dropped.
    First,
    /// Those that are farther apart than the margin are dropped.
    Close,
    /// Intervals of the open pairs are looked at.
    Look,
    /// Candidates are enclosed.
    Enclose,
}

/// Decides the open pairs of the current parts. One loop for all passes, so that what fills the
/// lanes and looks at them, tens of kilobytes per instruction set, is compiled once.
#[inline(always)]
pub(super) fn search<S: Simd>(simd: S, contacts: &mut FirstContacts, world: StepWorld<'_>) {
    let Some(between) = contacts.between else {
        return;
    };
    let Some(pair) = exact_pair(between.kind) else {
        return;
    };
    let sides = PairSides::new(world, between);
    let mut steps = Steps8::default();
    let mut spans = Spans8::default();
    let mut lists = PassLists {
        open: std::mem::take(&mut contacts.open),
        later: std::mem::take(&mut contacts.later),
        single: std::mem::take(&mut contacts.single),
    };
    let margin = contacts.margin(world, between);
    let after_first = if margin > 0.0 {
        Pass::Close
    } else {
        Pass::Look
    };
    let mut pass = if contacts.is_first {
        Pass::First
    } else {
        after_first
    };
    loop {
        let mut waiting = lists.take(pass);
        for chunk in waiting.chunks(LANES) {
            sides.fill(simd, chunk, &mut steps, &mut spans);
            let among = u8::MAX >> (LANES - chunk.len());
            match pass {
                Pass::First => {
                    let until = contacts.until(world);
                    let no = filter::are_apart::<S::F64>(pair, &steps, until, margin);
                    for lane in Lanes(u64::from(!no & among)) {
                        lists.later.push(chunk[lane]);
                    }
                }
                Pass::Close | Pass::Look => {
                    let is_close = pass == Pass::Close;
                    let margin = if is_close { margin } else { 0.0 };
                    let seen = filter::look::<S::F64>(pair, &steps, &spans, margin);
                    let into = (&mut lists.later, &mut lists.single);
                    if is_close {
                        contacts.keep_close(world, between, chunk, &seen, into);
                    } else {
                        contacts.after_look(world, (between, pair), chunk, among, &seen, into);
                    }
                }
                Pass::Enclose => {
                    let found = filter::enclose::<S::F64>(pair, &steps, &spans);
                    let later = &mut lists.later;
                    contacts.after_enclosing(world, (between, pair), chunk, &found, later);
                }
            }
        }
        waiting.clear();
        match lists.after(pass, waiting, after_first) {
            Some(next) => pass = next,
            None => break,
        }
    }
    (contacts.open, contacts.later, contacts.single) = (lists.open, lists.later, lists.single);
}

/// The pairs that passes take, and leave to others.
struct PassLists {
    /// For the next pass, unless it encloses.
    open: Vec<Open>,
    /// What the current pass has left open.
    later: Vec<Open>,
    /// Candidates that are to be enclosed.
    single: Vec<Open>,
}

impl PassLists {
    /// Takes the pairs of a pass.
    #[inline(always)]
    fn take(&mut self, pass: Pass) -> Vec<Open> {
        std::mem::take(match pass {
            Pass::Enclose => &mut self.single,
            _ => &mut self.open,
        })
    }

    /// The pass after another one, whose list is handed back empty; `None` if nothing is open.
    #[inline(always)]
    fn after(&mut self, pass: Pass, empty: Vec<Open>, after_first: Pass) -> Option<Pass> {
        match pass {
            Pass::First | Pass::Close => {
                self.open = std::mem::replace(&mut self.later, empty);
                if pass == Pass::First {
                    return Some(after_first);
                }
                if !self.open.is_empty() {
                    return Some(Pass::Close);
                }
                std::mem::swap(&mut self.open, &mut self.single);
                Some(Pass::Look)
            }
            Pass::Look => {
                self.open = empty;
                Some(Pass::Enclose)
            }
            Pass::Enclose => {
                self.single = empty;
                std::mem::swap(&mut self.open, &mut self.later);
                (!self.open.is_empty()).then_some(Pass::Look)
            }
        }
    }
}

impl FirstContacts {
    /// Drops pairs that are farther apart than the margin at all times, and remembers all others,
    /// which are searched without it.
    #[inline(always)]
    fn keep_close(
        &mut self,
        world: StepWorld<'_>,
        between: Between,
        chunk: &[Open],
        seen: &Look8,
        (later, close): (&mut Vec<Open>, &mut Vec<Open>),
    ) {
        let until = self.until(world);
        for (lane, &open) in chunk.iter().enumerate() {
            let mut next = open;
            match next.search.after_look(seen, lane, until) {
                Next::Apart => {}
                Next::Look => later.push(next),
                Next::Enclose | Next::Contact | Next::Unsure => {
                    self.remember_close(world, between, open.slots);
                    close.push(open);
                }
            }
        }
    }

    /// Sorts pairs by the results of looking at their intervals.
    #[inline(always)]
    fn after_look(
        &mut self,
        world: StepWorld<'_>,
        (between, pair): (Between, ElementPair),
        chunk: &[Open],
        among: u8,
        seen: &Look8,
        (later, single): (&mut Vec<Open>, &mut Vec<Open>),
    ) {
        let until = self.until(world);
        for lane in Lanes(u64::from(among)) {
            let mut open = chunk[lane];
            match open.search.after_look(seen, lane, until) {
                Next::Apart => {}
                Next::Look => later.push(open),
                Next::Enclose => single.push(open),
                Next::Contact | Next::Unsure => {
                    self.leave(world, between, pair, open.slots);
                }
            }
        }
    }

    /// Reports contacts, and sorts other pairs.
    #[inline(always)]
    fn after_enclosing(
        &mut self,
        world: StepWorld<'_>,
        (between, pair): (Between, ElementPair),
        chunk: &[Open],
        found: &Enclosed8,
        later: &mut Vec<Open>,
    ) {
        let until = self.until(world);
        for (lane, &open) in chunk.iter().enumerate() {
            let mut open = open;
            match open.search.after_enclosing(found, lane, until) {
                Next::Apart => {}
                Next::Look => later.push(open),
                Next::Contact => {
                    let span = [found.span.low[lane], found.span.high[lane]];
                    self.report_within(world, (between, pair), open.slots, span);
                }
                Next::Enclose | Next::Unsure => {
                    self.leave(world, between, pair, open.slots);
                }
            }
        }
    }
}

/// The corners and positions of two parts' elements.
struct PairSides<'a> {
    /// The corners at each slot: of vertices and faces, or of edges.
    corners: PairCorners<'a>,
    /// The positions of each part, at the start and at the end.
    positions: [[&'a Positions; 2]; 2],
}

enum PairCorners<'a> {
    VertexFace(&'a [[u32; 1]], &'a [[u32; 3]]),
    EdgeEdge(&'a [[u32; 2]], &'a [[u32; 2]]),
    None,
}

impl<'a> PairSides<'a> {
    fn new(world: StepWorld<'a>, between: Between) -> Self {
        use crate::scene::elements::Elements::{Edges, Points, Triangles};
        let parts = [between.a, between.b];
        let elements = parts.map(|part| &world.cache(part).clustering.corners);
        PairSides {
            corners: match elements {
                [Points(vertices), Triangles(faces)] => PairCorners::VertexFace(vertices, faces),
                [Edges(a), Edges(b)] => PairCorners::EdgeEdge(a, b),
                _ => PairCorners::None,
            },
            positions: parts.map(|part| {
                let body = world.plan.body(world.scene, part);
                let start = body.positions();
                [start, body.end_positions().unwrap_or(start)]
            }),
        }
    }

    /// Loads the points and intervals of up to eight pairs; unused lanes get those of the first.
    #[inline(always)]
    fn fill<S: Simd>(&self, simd: S, chunk: &[Open], steps: &mut Steps8, spans: &mut Spans8) {
        let mut batch = [chunk[0].slots; LANES];
        for lane in 0..LANES {
            let open = chunk[if lane < chunk.len() { lane } else { 0 }];
            batch[lane] = open.slots;
            [spans.low[lane], spans.high[lane]] = open.search.span();
        }
        let batch = &batch;
        match self.corners {
            PairCorners::VertexFace(vertices, faces) => {
                fill(simd, (vertices, 0, 0), self.positions[0], batch, steps);
                fill(simd, (faces, 1, 1), self.positions[1], batch, steps);
            }
            PairCorners::EdgeEdge(a, b) => {
                fill(simd, (a, 0, 0), self.positions[0], batch, steps);
                fill(simd, (b, 1, 2), self.positions[1], batch, steps);
            }
            PairCorners::None => {}
        }
    }
}

/// Loads the points of one side, from a given point of the pair on.
#[inline(always)]
fn fill<S: Simd, const N: usize>(
    simd: S,
    (corners, side, first): (&[[u32; N]], usize, usize),
    ends: [&Positions; 2],
    batch: &[Slots; LANES],
    Steps8(steps): &mut Steps8,
) {
    let mut ids = [[0; LANES]; N];
    for (lane, slots) in batch.iter().enumerate() {
        let corners = &corners[slots[side].index()];
        for k in 0..N {
            ids[k][lane] = corners[k];
        }
    }
    for (end, positions) in ends.into_iter().enumerate() {
        for k in 0..N {
            let rows = &mut steps[end][first + k];
            match positions {
                Positions::F32(positions) => simd.put_vertices(positions, ids[k], rows),
                Positions::F64(positions) => {
                    let positions = &positions[..];
                    for (lane, &vertex) in ids[k].iter().enumerate() {
                        let point = &positions[vertex as usize];
                        for axis in 0..3 {
                            rows[axis][lane] = point[axis];
                        }
                    }
                }
            }
        }
    }
}
