//! Stage `narrow` of steps: which candidates touch, and when first.
//!
//! In: candidates. Out: keys and times. Vertices with faces and edges with edges go through a filter, eight pairs at a time
//! (`exact::filter`): most are certainly apart; for most others the filter knows the time to all bits of an `f32`. What it
//! leaves open goes to exact arithmetic, and so do pairs of bare edges and points, and all times in double precision.

use crate::cpu::pairing::{Met, WorkItem};
use crate::cpu::simd::{Isa, Lanes, Simd, dispatch};
use crate::exact::filter::{self, LANES, Steps8};
use crate::exact::{Contact, ElementPair, Point, first_contact};
use crate::frame::pair_key;
use crate::grouping::GROUP;
use crate::impacts::Found;
use crate::narrow::{Extent, are_near};
use crate::pair_kind::PairKind;
use crate::positions::Positions;
use crate::step::{Start, Toi};

use super::world::{FoundByKind, Sought, World};

/// Pairs that the filter's first step leaves open are searched once there are this many.
const FULL: usize = 1024;

/// Two layers, and the kind of their pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Between {
    pub a: u32,
    pub b: u32,
    pub kind: PairKind,
}

/// Places of two elements in their clusters' orders.
type Places = [u32; 2];

/// One worker's pairs and counts.
#[derive(Debug, Default)]
pub(super) struct Settler {
    pub found: FoundByKind,
    pub n_candidates: u64,
    pub n_unsure: u64,
    /// What the filter's first step has left of the layers at hand.
    open: Vec<Places>,
    between: Option<Between>,
}

impl Settler {
    pub fn clear(&mut self) {
        self.found.iter_mut().for_each(Vec::clear);
        (self.n_candidates, self.n_unsure) = (0, 0);
        self.open.clear();
        self.open.reserve_exact(FULL + GROUP * GROUP);
        self.between = None;
    }

    pub fn bytes(&self) -> usize {
        size_of::<Places>() * self.open.capacity()
    }

    /// Takes the candidates of a work item.
    #[inline(always)]
    pub fn settle_item<S: Simd>(
        &mut self,
        simd: S,
        isa: Isa,
        world: World<'_>,
        (item, between): (&WorkItem, Between),
        met: &Met,
    ) {
        self.n_candidates += met.len() as u64;
        if self.between != Some(between) {
            self.search(isa, world);
            self.between = Some(between);
        }
        let places = |ix: usize| {
            let place = |cluster: u32, lane: u8| cluster * GROUP as u32 + u32::from(lane);
            let [lane_a, lane_b] = met.lanes(ix);
            [place(item.cluster_a, lane_a), place(item.cluster_b, lane_b)]
        };
        match (world.asked.sought, between.kind) {
            (Sought::Boxes(distance), _) => {
                for ix in 0..met.len() {
                    self.settle_boxes(world, between, places(ix), distance);
                }
            }
            (_, PairKind::VertexFace | PairKind::EdgeEdge) => {
                let sides = Sides::new(world, between);
                let mut steps = Steps8::default();
                for first in (0..met.len()).step_by(LANES) {
                    let n = (met.len() - first).min(LANES);
                    let mut batch = [places(first); LANES];
                    for (lane, batch) in batch.iter_mut().enumerate().take(n) {
                        *batch = places(first + lane);
                    }
                    sides.fill(simd, &batch, &mut steps);
                    let until = world.until();
                    let no = match between.kind {
                        PairKind::VertexFace => filter::vertex_face_apart::<S::F64>(&steps, until),
                        _ => filter::edge_edge_apart::<S::F64>(&steps, until),
                    };
                    for lane in Lanes(u64::from(!no & u8::MAX >> (LANES - n))) {
                        self.open.push(batch[lane]);
                    }
                }
                if self.open.len() >= FULL {
                    self.search(isa, world);
                }
            }
            (_, kind) => {
                if let Some(pair) = exact_pair(kind) {
                    for ix in 0..met.len() {
                        self.settle_exactly(world, between, pair, places(ix));
                    }
                }
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

    fn settle_boxes(&mut self, world: World<'_>, between: Between, places: Places, distance: f64) {
        let [a, b] = [(between.a, places[0]), (between.b, places[1])]
            .map(|(layer, place)| extent(world, layer, place));
        if are_near(&a, &b, distance) {
            const NONE: Contact = Contact {
                time: 0.0,
                is_exact: false,
                at_start: false,
            };
            self.push(world, between, places, NONE);
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
        if let Some(contact) = first_contact(pair, &points[0], &points[1]) {
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
        let [a, b] = [(between.a, places[0]), (between.b, places[1])].map(|(layer, place)| {
            let first = world.frame.layers[layer as usize].first;
            first + world.cache(layer).clustering.order[place as usize]
        });
        self.found[between.kind as usize].push(Found {
            key: pair_key(a, b),
            value: contact,
        });
    }
}

#[inline(always)]
fn search<S: Simd>(simd: S, settler: &mut Settler, world: World<'_>) {
    let Some(between) = settler.between else {
        return;
    };
    let sides = Sides::new(world, between);
    let mut steps = Steps8::default();
    let open = std::mem::take(&mut settler.open);
    for chunk in open.chunks(LANES) {
        let mut batch = [chunk[0]; LANES];
        batch[..chunk.len()].copy_from_slice(chunk);
        sides.fill(simd, &batch, &mut steps);
        let among = u8::MAX >> (LANES - chunk.len());
        let until = world.until();
        let (pair, contacts) = match between.kind {
            PairKind::VertexFace => (
                ElementPair::VertexFace,
                filter::vertex_face_contacts::<S::F64>(&steps, among, until),
            ),
            _ => (
                ElementPair::EdgeEdge,
                filter::edge_edge_contacts::<S::F64>(&steps, among, until),
            ),
        };
        for lane in Lanes(u64::from(!contacts.no & among)) {
            let is_certain = contacts.yes >> lane & 1 == 1;
            if is_certain {
                // Others need not be looked at beyond this.
                world.known.found(world.asked.sought, contacts.high[lane]);
            }
            let time = match (world.asked.sought, world.asked.toi) {
                _ if !is_certain => None,
                (Sought::Any, _) => Some(contacts.low[lane]),
                (_, Toi::F32) => contacts.time_f32(lane).map(f64::from),
                (_, Toi::F64) => None,
            };
            match time {
                Some(time) => {
                    let contact = Contact {
                        time,
                        is_exact: false,
                        at_start: false,
                    };
                    settler.report(world, between, batch[lane], contact);
                }
                None => settler.settle_exactly(world, between, pair, batch[lane]),
            }
        }
    }
    settler.open = open;
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
                let body = world.frame.body(world.scene, layer as usize);
                let start = body.positions();
                [start, body.end_positions().unwrap_or(start)]
            }),
        }
    }

    /// The points of eight pairs.
    #[inline(always)]
    fn fill<S: Simd>(&self, simd: S, batch: &[Places; LANES], steps: &mut Steps8) {
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
        let corners = &corners[places[side] as usize];
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
fn element<'a>(world: World<'a>, layer: u32, place: u32) -> (&'a [u32], [&'a Positions; 2]) {
    let body = world.frame.body(world.scene, layer as usize);
    let corners = world
        .cache(layer)
        .clustering
        .corners
        .corners(place as usize);
    let start = body.positions();
    (corners, [start, body.end_positions().unwrap_or(start)])
}

/// The extent of an element over the whole step.
fn extent(world: World<'_>, layer: u32, place: u32) -> Extent {
    let (corners, ends) = element(world, layer, place);
    let points = corners
        .iter()
        .flat_map(|&corner| ends.map(|positions| positions.point(corner as usize)));
    Extent::of(points)
}
