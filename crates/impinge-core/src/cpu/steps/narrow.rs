//! Stage `narrow` of steps: which candidates touch, and when first.
//!
//! In: candidates. Out: keys and times. Vertices with faces and edges with edges go through filters (`exact::filter`):
//!
//! ```text
//! far      sixteen pairs at a time in f32, from the tables of the two groups: apart along a few directions
//! across   those that are left, put side by side: apart along their normals, or never in one plane
//! aside    those that are left: one is always beside the other
//!          (if positions are f64: far and across, eight pairs at a time)
//! look     eight intervals of time in f64: no contact in it, one candidate, or unclear
//! enclose  eight candidates: contact or none, and when, nearly always to all bits of an f32
//! ```
//!
//! The last two alternate on lists of a thousand pairs, so that no lane waits for another pair's search. Unsure pairs
//! go to exact arithmetic, and so do pairs of bare edges and points, and all times in double precision.
//!
//! Where a distance is asked for (`exact::filter::nearness`):
//!
//! ```text
//! tables    sixteen pairs at a time in f32: certainly near at the start, or apart until the end
//! approach  one pair at a time in f64: when it comes near, nearly always to all bits of an f32
//! ```

use crate::cpu::met::{Met, WorkItem};
use crate::cpu::narrow::room_to_wait;
use crate::cpu::simd::{Isa, Lanes, Simd, dispatch};
use crate::exact::filter::{
    self, BATCH, Enclosed8, LANES, Look8, Moving64, Next, Search, Spans8, Steps8, time_between,
};
use crate::exact::{Approach, Contact, ElementPair, Point, approach, first_within};
use crate::frame::pair_key;
use crate::impacts::{Found, FoundByKind, KeysByKind, StepAnswer};
use crate::index::{LayerIx, Number, Place};
use crate::narrow::{Extent, are_near};
use crate::pair_kind::PairKind;
use crate::positions::Positions;
use crate::sink::BLOCK;
use crate::step::{Start, Toi};
use crate::tuning::Tuning;

use super::group::Group;
use super::near::Near;
use super::world::{Sought, World};

/// Two layers, and the kind of their pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Between {
    pub a: LayerIx,
    pub b: LayerIx,
    pub kind: PairKind,
}

/// Places of two elements in their clusters' orders.
type Places = [Place; 2];

/// A pair whose first contact is sought.
#[derive(Debug, Clone, Copy)]
struct Open {
    places: Places,
    search: Search,
}

/// One worker's pairs and counts.
#[derive(Debug, Default)]
pub(super) struct Settler {
    /// Contacts found, handed over in blocks.
    found: FoundByKind,
    /// The same for pairs without a time.
    keys: KeysByKind,
    pub n_candidates: u64,
    pub n_unsure: u64,
    /// Times that there were enough pairs to look at them.
    pub n_full: u64,
    /// That many are enough.
    full: usize,
    /// Pairs of the current layers that the filter's first step has left: to be looked at.
    open: Vec<Open>,
    /// Pairs to be looked at in the next round, and pairs with one candidate for a contact.
    later: Vec<Open>,
    single: Vec<Open>,
    between: Option<Between>,
    /// Whether the filter's first step is still to be taken, in `f64`.
    is_first: bool,
}

impl Settler {
    /// Prepares for a step.
    pub fn begin(&mut self, tuning: &Tuning) {
        (self.full, self.n_full) = (tuning.settle_from, 0);
        self.found.iter_mut().for_each(Vec::clear);
        self.keys.iter_mut().for_each(Vec::clear);
        (self.n_candidates, self.n_unsure) = (0, 0);
        for list in [&mut self.open, &mut self.later, &mut self.single] {
            list.clear();
            list.reserve_exact(room_to_wait(tuning));
        }
        self.between = None;
    }

    pub fn bytes(&self) -> usize {
        let found: usize = self.found.iter().map(Vec::capacity).sum();
        let keys: usize = self.keys.iter().map(Vec::capacity).sum();
        let lists = [&self.open, &self.later, &self.single];
        size_of::<Open>() * lists.iter().map(|list| list.capacity()).sum::<usize>()
            + size_of::<Found<Contact>>() * found
            + size_of::<u64>() * keys
    }

    /// Ends a step: hands over the remaining contacts and keys.
    pub fn end(&mut self, answer: StepAnswer<'_>) {
        for (kind, found) in PairKind::ALL.into_iter().zip(&mut self.found) {
            answer.take(kind, found);
        }
        for (kind, keys) in PairKind::ALL.into_iter().zip(&mut self.keys) {
            answer.take_keys(kind, keys);
        }
    }

    /// Takes the candidates of a work item.
    #[inline(always)]
    pub fn settle_item(
        &mut self,
        isa: Isa,
        world: World<'_>,
        (item, between): (&WorkItem, Between),
        groups: [&Group; 2],
        met: &mut Met,
    ) {
        self.n_candidates += met.len() as u64;
        if self.between != Some(between) {
            self.search(isa, world);
            self.between = Some(between);
        }
        let place_of = |met: &Met, ix: usize| places_of(item, met, ix);
        let [group_a, group_b] = groups;
        match (world.asked.sought, between.kind) {
            (Sought::Boxes(distance), _) => {
                let keys = &mut self.keys[between.kind as usize];
                if group_a.in_tables && group_b.in_tables {
                    put_boxes(groups, met, distance, keys);
                } else {
                    for ix in 0..met.len() {
                        let [a, b] = place_of(met, ix);
                        let a = extent(world, between.a, a);
                        let b = extent(world, between.b, b);
                        if are_near(&a, &b, distance) {
                            keys.push(key_in(groups, met.lanes(ix)));
                        }
                    }
                }
                self.hand_over_keys(world, between.kind);
            }
            (sought, _) if is_near(sought) || world.frame.distance() > 0.0 => {
                dispatch!(isa, settle_all_near, (
                    settler: &mut Settler = self,
                    world: World<'_> = world,
                    item: (&WorkItem, Between) = (item, between),
                    groups: [&Group; 2] = groups,
                    met: &Met = met,
                ));
            }
            (_, PairKind::VertexFace | PairKind::EdgeEdge) => {
                let until = world.until();
                let new = |places: Places| Open {
                    places,
                    search: Search::new(until),
                };
                self.is_first = !(group_a.in_tables && group_b.in_tables);
                if !self.is_first {
                    let tables = [&group_a.points, &group_b.points];
                    let until = greater_f32(until);
                    match between.kind {
                        PairKind::VertexFace => dispatch!(isa, drop_vertices_and_faces, (
                            tables: [&Moving64; 2] = tables,
                            until: f32 = until,
                            met: &mut Met = met,
                        )),
                        _ => dispatch!(isa, drop_edges, (
                            tables: [&Moving64; 2] = tables,
                            until: f32 = until,
                            met: &mut Met = met,
                        )),
                    }
                    for ix in 0..met.len() {
                        self.open.push(new(place_of(met, ix)));
                    }
                } else {
                    for ix in 0..met.len() {
                        self.open.push(new(place_of(met, ix)));
                    }
                }
                if self.open.len() >= self.full {
                    self.n_full += u64::from(!self.open.is_empty());
                    self.search(isa, world);
                }
            }
            (_, kind) => {
                if let Some(pair) = exact_pair(kind) {
                    for ix in 0..met.len() {
                        self.settle_exactly(world, between, pair, place_of(met, ix));
                    }
                }
            }
        }
    }

    /// Takes pairs of two layers that a device has not dropped, by their places.
    #[cfg(feature = "gpu")]
    pub fn settle_left(
        &mut self,
        isa: Isa,
        world: World<'_>,
        between: Between,
        pairs: impl Iterator<Item = Places>,
    ) {
        if self.between != Some(between) {
            self.search(isa, world);
            self.between = Some(between);
        }
        if !matches!(between.kind, PairKind::VertexFace | PairKind::EdgeEdge) {
            if let Some(pair) = exact_pair(between.kind) {
                pairs.for_each(|places| self.settle_exactly(world, between, pair, places));
            }
            return;
        }
        let are_single = [between.a, between.b].iter().all(|&layer| {
            let body = world.frame.body(world.scene, layer);
            matches!(body.positions(), Positions::F32(_))
        });
        // Over the whole step, the device has taken the filter's first step for positions in single precision.
        self.is_first = !are_single || matches!(world.asked.sought, Sought::Earliest);
        for places in pairs {
            let search = Search::new(world.until());
            self.open.push(Open { places, search });
            if self.open.len() >= self.full {
                self.search(isa, world);
            }
        }
    }

    /// Searches the open pairs for first contacts.
    #[inline(never)]
    pub fn search(&mut self, isa: Isa, world: World<'_>) {
        if self.open.is_empty() {
            return;
        }
        dispatch!(isa, search, (settler: &mut Settler = self, world: World<'_> = world));
        self.open.clear();
    }

    /// Takes a pair that is within the distance asked for at the start.
    #[inline(always)]
    fn put_near(&mut self, world: World<'_>, between: Between, places: Places) {
        if is_near(world.asked.sought) {
            self.keys[between.kind as usize].push(key(world, between, places));
            self.hand_over_keys(world, between.kind);
        } else {
            self.report(world, between, places, Contact::AT_START);
        }
    }

    /// Settles a pair where a distance is asked for, in `f64` or exactly.
    #[inline(never)]
    fn settle_near(&mut self, near: &Near<'_>, world: World<'_>, between: Between, places: Places) {
        if is_near(world.asked.sought) {
            let is_near = near.certainly(places).unwrap_or_else(|| {
                self.n_unsure += 1;
                near.exactly(places)
            });
            if is_near {
                self.put_near(world, between, places);
            }
            return;
        }
        let Some(pair) = exact_pair(between.kind) else {
            return;
        };
        let [start, end] = points(world, between, pair, places);
        match approach(pair, &start, &end, world.frame.distance(), world.until()) {
            Approach::Apart => {}
            Approach::AtStart => self.put_near(world, between, places),
            Approach::Between(span) => self.report_within(world, (between, pair), places, span),
            Approach::Unsure => self.settle_exactly(world, between, pair, places),
        }
    }

    /// Hands over the keys of a kind once they make a block.
    #[inline(always)]
    fn hand_over_keys(&mut self, world: World<'_>, kind: PairKind) {
        let keys = &mut self.keys[kind as usize];
        if keys.len() >= BLOCK {
            world.answer.take_keys(kind, keys);
        }
    }

    #[inline(never)]
    fn settle_exactly(
        &mut self,
        world: World<'_>,
        between: Between,
        pair: ElementPair,
        places: Places,
    ) {
        self.n_unsure += 1;
        let [start, end] = points(world, between, pair, places);
        if let Some(contact) = first_within(pair, &start, &end, world.frame.distance()) {
            self.report(world, between, places, contact);
        }
    }

    /// Records a contact, unless it is not wanted.
    #[inline(always)]
    fn report(&mut self, world: World<'_>, between: Between, places: Places, contact: Contact) {
        if world.asked.start == Start::Skip && contact.at_start {
            return;
        }
        if contact.time > world.until() {
            return;
        }
        world.known.found(world.asked.sought, contact.time);
        self.push(world, between, places, contact);
    }

    #[inline(always)]
    fn push(&mut self, world: World<'_>, between: Between, places: Places, contact: Contact) {
        let found = &mut self.found[between.kind as usize];
        found.push(Found {
            key: key(world, between, places),
            value: contact,
        });
        if found.len() >= BLOCK {
            world.answer.take(between.kind, found);
        }
    }
}

/// The places of a candidate of a work item.
#[inline(always)]
fn places_of(item: &WorkItem, met: &Met, ix: usize) -> Places {
    let [lane_a, lane_b] = met.lanes(ix).map(u32::from);
    [item.cluster_a.place(lane_a), item.cluster_b.place(lane_b)]
}

// Kernels of their own: without optimisation, one for all of them would need more stack than a thread has.

/// Settles the candidates of a work item where a distance is asked for.
#[inline(always)]
fn settle_all_near<S: Simd>(
    _: S,
    settler: &mut Settler,
    world: World<'_>,
    (item, between): (&WorkItem, Between),
    groups: [&Group; 2],
    met: &Met,
) {
    let sought = world.asked.sought;
    let near = Near::new(world, [between.a, between.b]);
    let pair = match between.kind {
        PairKind::VertexFace => Some(ElementPair::VertexFace),
        PairKind::EdgeEdge => Some(ElementPair::EdgeEdge),
        _ => None,
    };
    let in_tables = groups.iter().all(|group| group.in_tables);
    let pair = pair.filter(|_| in_tables);
    let tables = groups.map(|group| &group.points);
    let until = greater_f32(world.until());
    for first in (0..met.len()).step_by(BATCH) {
        let lanes = met.batch(first);
        let n = (met.len() - first).min(BATCH);
        let mut open = u16::MAX >> (BATCH - n);
        if let Some(pair) = pair {
            let reach = near.enclosing;
            let verdict = filter::are_within_in_tables::<S::F32>(pair, tables, lanes, reach);
            for lane in Lanes(u64::from(verdict.yes & open)) {
                settler.put_near(world, between, places_of(item, met, first + lane));
            }
            open &= !verdict.yes;
            if is_near(sought) {
                open &= !verdict.no;
            } else if open != 0 {
                open &=
                    !filter::stay_beyond_in_tables::<S::F32>(pair, tables, lanes, until, reach[1]);
            }
        }
        for lane in Lanes(u64::from(open)) {
            settler.settle_near(&near, world, between, places_of(item, met, first + lane));
        }
    }
}

#[inline(always)]
fn drop_vertices_and_faces<S: Simd>(simd: S, tables: [&Moving64; 2], until: f32, met: &mut Met) {
    drop_apart(simd, ElementPair::VertexFace, tables, until, met);
}

#[inline(always)]
fn drop_edges<S: Simd>(simd: S, tables: [&Moving64; 2], until: f32, met: &mut Met) {
    drop_apart(simd, ElementPair::EdgeEdge, tables, until, met);
}

/// Whether pairs within a distance at the start are sought, and no times.
#[inline(always)]
fn is_near(sought: Sought) -> bool {
    matches!(sought, Sought::Within)
}

/// The points of a pair at the start and at the end, in the order of the exact test.
fn points(
    world: World<'_>,
    between: Between,
    pair: ElementPair,
    places: Places,
) -> [[Point; 4]; 2] {
    let mut sides = [(between.a, places[0]), (between.b, places[1])];
    if pair == ElementPair::VertexEdge {
        // Such pairs are named edge first, but tested vertex first.
        sides.reverse();
    }
    let mut points: [[Point; 4]; 2] = Default::default();
    let mut n = 0;
    for (layer, place) in sides {
        let (corners, [start, end]) = element(world, layer, place);
        for &corner in corners {
            points[0][n] = start.point(corner as usize);
            points[1][n] = end.point(corner as usize);
            n += 1;
        }
    }
    points
}

/// Drops the candidates that are certainly apart from t = 0 to `until`.
#[inline(always)]
fn drop_apart<S: Simd>(
    simd: S,
    pair: ElementPair,
    tables: [&Moving64; 2],
    until: f32,
    met: &mut Met,
) {
    let mut n_kept = 0;
    for first in (0..met.len()).step_by(BATCH) {
        let no = filter::are_far_in_tables::<S::F32>(pair, tables, met.batch(first), until);
        n_kept = met.keep_batch(simd, first, !no, n_kept);
    }
    met.truncate(n_kept);
    let mut n_kept = 0;
    for first in (0..met.len()).step_by(BATCH) {
        let no = filter::are_across_in_tables::<S::F32>(pair, tables, met.batch(first), until);
        n_kept = met.keep_batch(simd, first, !no, n_kept);
    }
    met.truncate(n_kept);
    let mut n_kept = 0;
    for first in (0..met.len()).step_by(BATCH) {
        let no = filter::are_aside_in_tables::<S::F32>(pair, tables, met.batch(first), until);
        n_kept = met.keep_batch(simd, first, !no, n_kept);
    }
    met.truncate(n_kept);
}

/// Puts down the candidates whose boxes over the step, inflated, overlap. Boxes of groups in tables are not rounded unless
/// they are inflated.
#[inline(always)]
fn put_boxes(groups: [&Group; 2], met: &Met, distance: f64, keys: &mut Vec<u64>) {
    for ix in 0..met.len() {
        let lanes = met.lanes(ix);
        let is_near = distance == 0.0
            || are_near(
                &groups[0].extent(lanes[0].into()),
                &groups[1].extent(lanes[1].into()),
                distance,
            );
        if is_near {
            keys.push(key_in(groups, lanes));
        }
    }
}

/// The key of a pair.
#[inline(always)]
fn key(world: World<'_>, between: Between, places: Places) -> u64 {
    let [a, b] = [(between.a, places[0]), (between.b, places[1])].map(|(layer, place)| {
        let element = world.cache(layer).clustering.primitive(place);
        world.frame.layer(layer).number(element)
    });
    pair_key(a, b)
}

/// The key of a pair, by its lanes in two groups.
#[inline(always)]
fn key_in([a, b]: [&Group; 2], [lane_a, lane_b]: [u8; 2]) -> u64 {
    pair_key(
        Number::new(a.numbers.0[usize::from(lane_a)]),
        Number::new(b.numbers.0[usize::from(lane_b)]),
    )
}

/// An `f32` that is not below a time.
#[allow(clippy::cast_possible_truncation, reason = "rounded here")]
#[inline(always)]
fn greater_f32(time: f64) -> f32 {
    let nearest = time as f32;
    if f64::from(nearest) < time {
        nearest.next_up()
    } else {
        nearest
    }
}

#[inline(always)]
fn search<S: Simd>(simd: S, settler: &mut Settler, world: World<'_>) {
    let Some(between) = settler.between else {
        return;
    };
    let Some(pair) = exact_pair(between.kind) else {
        return;
    };
    let sides = Sides::new(world, between);
    let mut steps = Steps8::default();
    let mut spans = Spans8::default();
    let mut open = std::mem::take(&mut settler.open);
    let mut later = std::mem::take(&mut settler.later);
    let mut single = std::mem::take(&mut settler.single);
    if settler.is_first {
        let until = world.until();
        for chunk in open.chunks(LANES) {
            sides.fill(simd, chunk, &mut steps, &mut spans);
            let no = filter::are_apart::<S::F64>(pair, &steps, until);
            let among = u8::MAX >> (LANES - chunk.len());
            for lane in Lanes(u64::from(!no & among)) {
                later.push(chunk[lane]);
            }
        }
        open.clear();
        std::mem::swap(&mut open, &mut later);
    }
    while !open.is_empty() {
        for chunk in open.chunks(LANES) {
            sides.fill(simd, chunk, &mut steps, &mut spans);
            let seen = filter::look::<S::F64>(pair, &steps, &spans);
            let among = u8::MAX >> (LANES - chunk.len());
            settler.after_look(
                world,
                (between, pair),
                chunk,
                among,
                &seen,
                (&mut later, &mut single),
            );
        }
        open.clear();
        for chunk in single.chunks(LANES) {
            sides.fill(simd, chunk, &mut steps, &mut spans);
            let found = filter::enclose::<S::F64>(pair, &steps, &spans);
            settler.after_enclosing(world, (between, pair), chunk, &found, &mut later);
        }
        single.clear();
        std::mem::swap(&mut open, &mut later);
    }
    (settler.open, settler.later, settler.single) = (open, later, single);
}

impl Settler {
    /// Sorts pairs by the results of looking at their intervals.
    #[inline(always)]
    fn after_look(
        &mut self,
        world: World<'_>,
        (between, pair): (Between, ElementPair),
        chunk: &[Open],
        among: u8,
        seen: &Look8,
        (later, single): (&mut Vec<Open>, &mut Vec<Open>),
    ) {
        let until = world.until();
        for lane in Lanes(u64::from(among)) {
            let mut open = chunk[lane];
            match open.search.after_look(seen, lane, until) {
                Next::Apart => {}
                Next::Look => later.push(open),
                Next::Enclose => single.push(open),
                Next::Contact | Next::Unsure => {
                    self.settle_exactly(world, between, pair, open.places);
                }
            }
        }
    }

    /// Reports contacts, and sorts other pairs.
    #[inline(always)]
    fn after_enclosing(
        &mut self,
        world: World<'_>,
        (between, pair): (Between, ElementPair),
        chunk: &[Open],
        found: &Enclosed8,
        later: &mut Vec<Open>,
    ) {
        let until = world.until();
        for (lane, &open) in chunk.iter().enumerate() {
            let mut open = open;
            match open.search.after_enclosing(found, lane, until) {
                Next::Apart => {}
                Next::Look => later.push(open),
                Next::Contact => {
                    let span = [found.span.low[lane], found.span.high[lane]];
                    self.report_within(world, (between, pair), open.places, span);
                }
                Next::Enclose | Next::Unsure => {
                    self.settle_exactly(world, between, pair, open.places);
                }
            }
        }
    }

    /// Records a contact that is certainly in an interval of time.
    #[inline(always)]
    fn report_within(
        &mut self,
        world: World<'_>,
        (between, pair): (Between, ElementPair),
        places: Places,
        span: [f64; 2],
    ) {
        // Other pairs need not be searched beyond this time.
        world.known.found(world.asked.sought, span[1]);
        let time = match (world.asked.sought, world.asked.toi) {
            (Sought::Any, _) => Some(span[0]),
            // This contact is not wanted.
            (Sought::Earliest, _) if span[0] > world.until() => return,
            (_, Toi::F32) => time_between(span).map(f64::from),
            (_, Toi::F64) => None,
        };
        let Some(time) = time else {
            return self.settle_exactly(world, between, pair, places);
        };
        let contact = Contact {
            time,
            is_exact: false,
            at_start: false,
        };
        self.report(world, between, places, contact);
    }
}

/// The corners and positions of two layers' elements.
struct Sides<'a> {
    /// The corners at each place: of vertices and faces, or of edges.
    corners: Corners<'a>,
    /// The positions of each layer, at the start and at the end.
    positions: [[&'a Positions; 2]; 2],
}

enum Corners<'a> {
    VertexFace(&'a [[u32; 1]], &'a [[u32; 3]]),
    EdgeEdge(&'a [[u32; 2]], &'a [[u32; 2]]),
    None,
}

impl<'a> Sides<'a> {
    fn new(world: World<'a>, between: Between) -> Self {
        use crate::elements::Elements::{Edges, Points, Triangles};
        let layers = [between.a, between.b];
        let elements = layers.map(|layer| &world.cache(layer).clustering.corners);
        Sides {
            corners: match elements {
                [Points(vertices), Triangles(faces)] => Corners::VertexFace(vertices, faces),
                [Edges(a), Edges(b)] => Corners::EdgeEdge(a, b),
                _ => Corners::None,
            },
            positions: layers.map(|layer| {
                let body = world.frame.body(world.scene, layer);
                let start = body.positions();
                [start, body.end_positions().unwrap_or(start)]
            }),
        }
    }

    /// Loads the points and intervals of up to eight pairs; unused lanes get those of the first.
    #[inline(always)]
    fn fill<S: Simd>(&self, simd: S, chunk: &[Open], steps: &mut Steps8, spans: &mut Spans8) {
        let mut batch = [chunk[0].places; LANES];
        for lane in 0..LANES {
            let open = chunk[if lane < chunk.len() { lane } else { 0 }];
            batch[lane] = open.places;
            [spans.low[lane], spans.high[lane]] = open.search.span();
        }
        let batch = &batch;
        match self.corners {
            Corners::VertexFace(vertices, faces) => {
                fill(simd, (vertices, 0, 0), self.positions[0], batch, steps);
                fill(simd, (faces, 1, 1), self.positions[1], batch, steps);
            }
            Corners::EdgeEdge(a, b) => {
                fill(simd, (a, 0, 0), self.positions[0], batch, steps);
                fill(simd, (b, 1, 2), self.positions[1], batch, steps);
            }
            Corners::None => {}
        }
    }
}

/// Loads the points of one side, from a given point of the pair on.
#[inline(always)]
fn fill<S: Simd, const N: usize>(
    simd: S,
    (corners, side, first): (&[[u32; N]], usize, usize),
    ends: [&Positions; 2],
    batch: &[Places; LANES],
    Steps8(steps): &mut Steps8,
) {
    let mut ids = [[0; LANES]; N];
    for (lane, places) in batch.iter().enumerate() {
        let corners = &corners[places[side].index()];
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

/// The pair as the exact predicate names it.
fn exact_pair(kind: PairKind) -> Option<ElementPair> {
    crate::narrow::exact_kind(crate::frame::TestId::Elements(kind))
}

/// The corners of an element, and its body's positions at both ends.
fn element<'a>(world: World<'a>, layer: LayerIx, place: Place) -> (&'a [u32], [&'a Positions; 2]) {
    let body = world.frame.body(world.scene, layer);
    let corners = world.cache(layer).clustering.corners.corners(place.index());
    let start = body.positions();
    (corners, [start, body.end_positions().unwrap_or(start)])
}

/// The extent of an element over the whole step.
fn extent(world: World<'_>, layer: LayerIx, place: Place) -> Extent {
    let (corners, ends) = element(world, layer, place);
    let points = corners
        .iter()
        .flat_map(|&corner| ends.map(|positions| positions.point(corner as usize)));
    Extent::of(points)
}
