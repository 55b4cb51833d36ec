//! Batches of moving elements: eight pairs in `f64`, or sixteen in `f32` from tables of two groups.

use super::motion::{Motion, Search};
use super::number::{Lookup, Vector, load_vertex};
use super::{BATCH, LANES, TABLE};
use crate::exact::rounding::round_down;
use crate::exact::{ElementPair, Point};

/// The points of eight pairs of moving elements, one pair per lane: `[start or end][point][axis][lane]`, points in the
/// order of the [`ElementPair`].
#[derive(Clone, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct Steps8(pub [[[[f64; LANES]; 3]; 4]; 2]);

/// Elements of a group that move, N points each: `[start or end][point][axis][place]`.
pub type Moving64<const N: usize> = [[[[f32; TABLE]; 3]; N]; 2];

/// What the filter found out about eight pairs: bit k stands for lane k. Lanes with neither bit are unsure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contacts8 {
    /// The pairs that certainly do not touch from t = 0 to the last time asked for.
    pub no: u8,
    /// The pairs that certainly touch, and not at the start.
    pub yes: u8,
    /// Before this time a pair does certainly not touch.
    pub low: [f64; LANES],
    /// Where `yes`: the first contact is at this time at the latest.
    pub high: [f64; LANES],
}

impl Contacts8 {
    /// The first contact of a pair that certainly touches, rounded down to `f32`; none where the bounds leave it open.
    #[inline]
    #[must_use]
    pub fn time_f32(&self, lane: usize) -> Option<f32> {
        let [low, high] = [self.low[lane], self.high[lane]].map(round_down);
        (low == high).then_some(low)
    }
}

/// Steps of a search before a pair is unsure.
const N_STEPS: usize = 48;

/// Which pairs of a vertex and a face are certainly apart from t = 0 to `until`: the cheap first step.
#[inline(always)]
#[must_use]
pub fn vertex_face_apart<V: Vector>(steps: &Steps8, until: f64) -> u8 {
    let mut no = 0;
    for first in (0..LANES).step_by(V::N) {
        let [start, end] = load::<V>(steps, first);
        no |= V::bits(Motion::vertex_face(&start, &end).are_apart(until)) << first;
    }
    no
}

/// Which pairs of edges are certainly apart from t = 0 to `until`: the cheap first step.
#[inline(always)]
#[must_use]
pub fn edge_edge_apart<V: Vector>(steps: &Steps8, until: f64) -> u8 {
    let mut no = 0;
    for first in (0..LANES).step_by(V::N) {
        let [start, end] = load::<V>(steps, first);
        no |= V::bits(Motion::edge_edge(&start, &end).are_apart(until)) << first;
    }
    no
}

/// Which pairs of a vertex and a face certainly touch or do not from t = 0 to `until`, and when. Only lanes of `among`
/// are needed; put only pairs in that [`vertex_face_apart`] leaves.
#[inline(always)]
#[must_use]
pub fn vertex_face_contacts<V: Vector>(steps: &Steps8, among: u8, until: f64) -> Contacts8 {
    let mut contacts = Contacts8 {
        high: [until; LANES],
        ..Contacts8::default()
    };
    for first in (0..LANES).step_by(V::N) {
        let [start, end] = load::<V>(steps, first);
        find(
            &Motion::vertex_face(&start, &end),
            &mut contacts,
            among,
            until,
            first,
        );
    }
    contacts
}

/// Which pairs of edges certainly touch or do not from t = 0 to `until`, and when. See [`vertex_face_contacts`].
#[inline(always)]
#[must_use]
pub fn edge_edge_contacts<V: Vector>(steps: &Steps8, among: u8, until: f64) -> Contacts8 {
    let mut contacts = Contacts8 {
        high: [until; LANES],
        ..Contacts8::default()
    };
    for first in (0..LANES).step_by(V::N) {
        let [start, end] = load::<V>(steps, first);
        find(
            &Motion::edge_edge(&start, &end),
            &mut contacts,
            among,
            until,
            first,
        );
    }
    contacts
}

#[inline(always)]
fn find<V: Vector, const K: usize>(
    motion: &Motion<V, K>,
    contacts: &mut Contacts8,
    among: u8,
    until: f64,
    first: usize,
) {
    let apart = motion.are_apart(until);
    let no = V::bits(apart) << first;
    contacts.no |= no;
    let lanes = (u8::MAX >> (LANES - V::N)) << first;
    if among & !no & lanes == 0 {
        return;
    }
    let found = motion.search(!apart, until, N_STEPS);
    contacts.no |= V::bits(found.no) << first;
    contacts.yes |= V::bits(found.yes) << first;
    found.low.store(&mut contacts.low, first);
    found.high.store(&mut contacts.high, first);
}

#[inline(always)]
fn load<V: Vector>(Steps8([start, end]): &Steps8, first: usize) -> [[[V; 3]; 4]; 2] {
    let ([p, q, r, s], [t, u, v, w]) = (start, end);
    [
        [
            load_vertex(p, first),
            load_vertex(q, first),
            load_vertex(r, first),
            load_vertex(s, first),
        ],
        [
            load_vertex(t, first),
            load_vertex(u, first),
            load_vertex(v, first),
            load_vertex(w, first),
        ],
    ]
}

/// Which of sixteen pairs of a vertex and a face are certainly apart from t = 0 to `until`. The elements are those of two groups,
/// named by their places. In `f32`: for coordinates of any size, but differences above 2^16 are never certain.
#[inline(always)]
#[must_use]
pub fn vertex_face_apart_in_tables<V: Lookup>(
    (vertices, faces): (&Moving64<1>, &Moving64<3>),
    [places_a, places_b]: [&[u8; BATCH]; 2],
    until: f32,
) -> u16 {
    let mut no = 0;
    for first in (0..BATCH).step_by(V::N) {
        let (a, b) = (V::places(places_a, first), V::places(places_b, first));
        let motion = Motion::vertex_face(
            &vertex_and_face::<V>(&vertices[0], a, &faces[0], b),
            &vertex_and_face::<V>(&vertices[1], a, &faces[1], b),
        );
        no |= V::bits(motion.are_apart(f64::from(until))) << first;
    }
    no
}

/// Which of sixteen pairs of edges are certainly apart from t = 0 to `until`. See [`vertex_face_apart_in_tables`].
#[inline(always)]
#[must_use]
pub fn edge_edge_apart_in_tables<V: Lookup>(
    [edges_a, edges_b]: [&Moving64<2>; 2],
    [places_a, places_b]: [&[u8; BATCH]; 2],
    until: f32,
) -> u16 {
    let mut no = 0;
    for first in (0..BATCH).step_by(V::N) {
        let (a, b) = (V::places(places_a, first), V::places(places_b, first));
        let motion = Motion::edge_edge(
            &two_edges::<V>(&edges_a[0], a, &edges_b[0], b),
            &two_edges::<V>(&edges_a[1], a, &edges_b[1], b),
        );
        no |= V::bits(motion.are_apart(f64::from(until))) << first;
    }
    no
}

#[inline(always)]
fn vertex_and_face<V: Lookup>(
    [p]: &[[[f32; TABLE]; 3]; 1],
    a: V::Places,
    [q, r, s]: &[[[f32; TABLE]; 3]; 3],
    b: V::Places,
) -> [[V; 3]; 4] {
    [look_up(p, a), look_up(q, b), look_up(r, b), look_up(s, b)]
}

#[inline(always)]
fn two_edges<V: Lookup>(
    [p, q]: &[[[f32; TABLE]; 3]; 2],
    a: V::Places,
    [r, s]: &[[[f32; TABLE]; 3]; 2],
    b: V::Places,
) -> [[V; 3]; 4] {
    [look_up(p, a), look_up(q, a), look_up(r, b), look_up(s, b)]
}

#[inline(always)]
fn look_up<V: Lookup>([x, y, z]: &[[f32; TABLE]; 3], places: V::Places) -> [V; 3] {
    [
        V::look_up(x, places),
        V::look_up(y, places),
        V::look_up(z, places),
    ]
}

/// The same for one pair, in `f64`; none for pairs without a face of their difference polygon.
#[inline]
pub(in super::super) fn contact_search(
    pair: ElementPair,
    start: &[Point; 4],
    end: &[Point; 4],
) -> Option<Search<f64>> {
    match pair {
        ElementPair::VertexFace => Some(search_one(&Motion::vertex_face(start, end))),
        ElementPair::EdgeEdge => Some(search_one(&Motion::edge_edge(start, end))),
        ElementPair::VertexVertex | ElementPair::VertexEdge => None,
    }
}

/// Whether the elements touch; `None` when unsure.
#[inline]
pub(in super::super) fn contact_answer(
    pair: ElementPair,
    start: &[Point; 4],
    end: &[Point; 4],
) -> Option<bool> {
    match contact_search(pair, start, end)? {
        Search { yes: true, .. } => Some(true),
        Search { no: true, .. } => Some(false),
        _ => None,
    }
}

fn search_one<const K: usize>(motion: &Motion<f64, K>) -> Search<f64> {
    let apart = motion.are_apart(1.0);
    let mut found = motion.search(!apart, 1.0, N_STEPS);
    found.no |= apart;
    found
}
