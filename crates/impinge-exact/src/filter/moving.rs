//! Batches of moving elements: eight pairs in `f64`, or sixteen in `f32` from tables of two groups.

use super::motion::PolygonMotion;
use super::number::{Lookup, Vector, load_vertex};
use super::{BATCH, LANES, TABLE};
use crate::rounding::round_down;
use crate::{ElementPair, Point};

/// The points of eight pairs of moving elements, one pair per lane:
/// `[start or end][point][axis][lane]`, points in the order of the [`ElementPair`].
#[derive(Clone, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct Steps8(pub [[[[f64; LANES]; 3]; 4]; 2]);

/// The moving elements of a group: `[start or end][corner][axis][slot]`.
pub type Moving64 = [[[[f32; TABLE]; 3]; 3]; 2];

/// An interval of time for each of eight pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub struct Spans8 {
    /// Where it starts.
    pub low: [f64; LANES],
    /// Where it ends.
    pub high: [f64; LANES],
}

/// The result of [`look`] for the intervals of eight pairs: bit k stands for lane k.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Look8 {
    /// Certainly no contact in the interval.
    pub no: u8,
    /// Else: there is one candidate for a contact in it, for [`enclose`].
    pub single: u8,
    /// Nothing is certain, and nothing will be in shorter intervals.
    pub hopeless: u8,
}

/// The result of [`enclose`]: bit k stands for lane k.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Enclosed8 {
    /// Certainly one contact in the interval.
    pub inside: u8,
    /// Certainly none.
    pub outside: u8,
    /// Halving the interval does not help.
    pub is_short: u8,
    /// Where the contact is.
    pub span: Spans8,
}

/// The search for the first contact of a pair: which interval is next.
///
/// ```text
/// look at [low, high] ── none in it ──> go on behind it, with twice the length, to the end: apart
///        │      └──────── unclear ──────> half the length, down to 2^-12 of the whole: unsure
///  one candidate
///        v
///     enclose ──────────────────────────> contact, or none in it, or unclear
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// Certainly no contact before this time.
    low: f64,
    high: f64,
    n_steps: u32,
}

/// The next step of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// [`look`] at the interval.
    Look,
    /// [`enclose`] the candidate in it.
    Enclose,
    /// There is certainly no contact.
    Apart,
    /// There is certainly contact.
    Contact,
    /// Exact arithmetic is needed.
    Unsure,
}

/// The shortest interval that is examined, as a share of the whole.
const SHORTEST: f64 = 1.0 / 4096.0;
/// The most steps of a search; then a pair is unsure.
const N_STEPS: u32 = 48;

impl Search {
    /// From t = 0 to `until`.
    #[inline]
    #[must_use]
    pub fn new(until: f64) -> Self {
        Search::within([0.0, until])
    }

    /// In an interval before which there is certainly no contact.
    #[inline]
    #[must_use]
    pub fn within([low, high]: [f64; 2]) -> Self {
        Search {
            low,
            high,
            n_steps: 0,
        }
    }

    /// The current interval.
    #[inline]
    #[must_use]
    pub fn span(&self) -> [f64; 2] {
        [self.low, self.high]
    }

    /// Goes on after a look at the interval, with one lane of the result. `until` may be less than
    /// before: later contacts are no longer of interest.
    #[inline]
    pub fn after_look(&mut self, seen: &Look8, lane: usize, until: f64) -> Next {
        let is = |mask: u8| mask >> lane & 1 == 1;
        if is(seen.no) {
            self.go_on(until)
        } else if is(seen.single) {
            Next::Enclose
        } else {
            self.halve(is(seen.hopeless), until)
        }
    }

    /// Goes on after the candidate was enclosed.
    #[inline]
    pub fn after_enclosing(&mut self, found: &Enclosed8, lane: usize, until: f64) -> Next {
        let is = |mask: u8| mask >> lane & 1 == 1;
        if is(found.inside) {
            Next::Contact
        } else if is(found.outside) {
            self.go_on(until)
        } else {
            // As short as rounding allows, and still unsure: a tie.
            self.halve(is(found.is_short), until)
        }
    }

    #[inline]
    fn go_on(&mut self, until: f64) -> Next {
        if self.high >= until {
            return Next::Apart;
        }
        let end = self.high + 2.0 * (self.high - self.low);
        self.low = self.high;
        self.high = if end < until { end } else { until };
        self.count()
    }

    #[inline]
    fn halve(&mut self, is_hopeless: bool, until: f64) -> Next {
        let length = self.high - self.low;
        if is_hopeless || length <= SHORTEST * until {
            return Next::Unsure;
        }
        self.high = self.low + 0.5 * length;
        self.count()
    }

    #[inline]
    fn count(&mut self) -> Next {
        self.n_steps += 1;
        if self.n_steps < N_STEPS {
            Next::Look
        } else {
            Next::Unsure
        }
    }
}

/// A time that is certainly in an interval, rounded down to `f32`; `None` if the interval leaves it
/// open.
#[inline]
#[must_use]
pub fn time_between([low, high]: [f64; 2]) -> Option<f32> {
    let [low, high] = [low, high].map(round_down);
    (low == high).then_some(low)
}

/// Which of eight pairs are certainly apart from t = 0 to `until`: the cheap first step. For pairs
/// of a vertex and a face, or of two edges. With a margin, they are apart even if at any time
/// coordinates of the difference polygon's corners and edges differ by up to that much.
#[inline(always)]
#[must_use]
pub fn are_apart<V: Vector>(pair: ElementPair, steps: &Steps8, until: f64, margin: f64) -> u8 {
    let mut no = 0;
    for first in (0..LANES).step_by(V::N) {
        let motion = load::<V>(pair, steps, first).with_margin(margin);
        no |= V::bits(motion.are_apart(until)) << first;
    }
    no
}

/// Tests one interval of each of eight pairs, with a margin as in [`are_apart`].
#[inline(always)]
#[must_use]
pub fn look<V: Vector>(pair: ElementPair, steps: &Steps8, spans: &Spans8, margin: f64) -> Look8 {
    let mut seen = Look8::default();
    for first in (0..LANES).step_by(V::N) {
        let (low, high) = (V::load(&spans.low, first), V::load(&spans.high, first));
        let motion = load::<V>(pair, steps, first).with_margin(margin);
        let look = motion.look(low, high);
        seen.no |= V::bits(look.no) << first;
        seen.single |= V::bits(look.single) << first;
        seen.hopeless |= V::bits(look.hopeless) << first;
    }
    seen
}

/// If [`look`] has found one candidate for a contact: when it is, and whether it is one.
#[inline(always)]
#[must_use]
pub fn enclose<V: Vector>(pair: ElementPair, steps: &Steps8, spans: &Spans8) -> Enclosed8 {
    let mut found = Enclosed8::default();
    for first in (0..LANES).step_by(V::N) {
        let (low, high) = (V::load(&spans.low, first), V::load(&spans.high, first));
        let enclosed = load::<V>(pair, steps, first).enclose(low, high);
        found.inside |= V::bits(enclosed.inside) << first;
        found.outside |= V::bits(enclosed.outside) << first;
        found.is_short |= V::bits(enclosed.is_short) << first;
        enclosed.first.store(&mut found.span.low, first);
        enclosed.last.store(&mut found.span.high, first);
    }
    found
}

#[inline(always)]
fn load<V: Vector>(pair: ElementPair, Steps8(steps): &Steps8, first: usize) -> PolygonMotion<V> {
    let [start, end] = steps;
    PolygonMotion::new(
        are_edges(pair),
        &load_end(start, first),
        &load_end(end, first),
    )
}

#[inline(always)]
fn load_end<V: Vector>([p, q, r, s]: &[[[f64; LANES]; 3]; 4], first: usize) -> [[V; 3]; 4] {
    [
        load_vertex(p, first),
        load_vertex(q, first),
        load_vertex(r, first),
        load_vertex(s, first),
    ]
}

#[inline(always)]
pub(super) fn are_edges(pair: ElementPair) -> bool {
    debug_assert!(matches!(
        pair,
        ElementPair::VertexFace | ElementPair::EdgeEdge
    ));
    matches!(pair, ElementPair::EdgeEdge)
}

/// Which of sixteen pairs are certainly apart from t = 0 to `until`, by the cheapest test. The
/// elements are those of two groups, named by their slots, with a margin as in [`are_apart`]. In
/// `f32`: for coordinates of any size, but differences above 2^16 are never certain.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
#[must_use]
pub fn are_far_in_tables<V: Lookup>(
    pair: ElementPair,
    groups: [&Moving64; 2],
    slots: [&[u8; BATCH]; 2],
    (until, margin): (f32, f64),
) -> u16 {
    let mut no = 0;
    for first in (0..BATCH).step_by(V::N) {
        let motion = look_up_motion::<V>(pair, groups, slots, first).with_margin(margin);
        no |= V::bits(motion.are_far(f64::from(until))) << first;
    }
    no
}

/// The same by normals, for pairs that [`are_far_in_tables`] leaves.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
#[must_use]
pub fn are_across_in_tables<V: Lookup>(
    pair: ElementPair,
    groups: [&Moving64; 2],
    slots: [&[u8; BATCH]; 2],
    (until, margin): (f32, f64),
) -> u16 {
    let mut no = 0;
    for first in (0..BATCH).step_by(V::N) {
        let motion = look_up_motion::<V>(pair, groups, slots, first).with_margin(margin);
        no |= V::bits(motion.are_across(f64::from(until))) << first;
    }
    no
}

/// The same by where the elements meet each other's planes, for pairs that the other tests leave.
#[cfg_attr(target_family = "wasm", inline(never))]
#[cfg_attr(not(target_family = "wasm"), inline(always))]
#[must_use]
pub fn are_aside_in_tables<V: Lookup>(
    pair: ElementPair,
    groups: [&Moving64; 2],
    slots: [&[u8; BATCH]; 2],
    (until, margin): (f32, f64),
) -> u16 {
    let mut no = 0;
    for first in (0..BATCH).step_by(V::N) {
        let motion = look_up_motion::<V>(pair, groups, slots, first).with_margin(margin);
        no |= V::bits(motion.are_aside(f64::from(until))) << first;
    }
    no
}

#[inline(always)]
fn look_up_motion<V: Lookup>(
    pair: ElementPair,
    [group_a, group_b]: [&Moving64; 2],
    [slots_a, slots_b]: [&[u8; BATCH]; 2],
    first: usize,
) -> PolygonMotion<V> {
    let (a, b) = (V::slots(slots_a, first), V::slots(slots_b, first));
    if are_edges(pair) {
        PolygonMotion::new(
            true,
            &two_edges::<V>(&group_a[0], a, &group_b[0], b),
            &two_edges::<V>(&group_a[1], a, &group_b[1], b),
        )
    } else {
        PolygonMotion::new(
            false,
            &vertex_and_face::<V>(&group_a[0], a, &group_b[0], b),
            &vertex_and_face::<V>(&group_a[1], a, &group_b[1], b),
        )
    }
}

#[inline(always)]
pub(super) fn vertex_and_face<V: Lookup>(
    [p, ..]: &[[[f32; TABLE]; 3]; 3],
    a: V::Slots,
    [q, r, s]: &[[[f32; TABLE]; 3]; 3],
    b: V::Slots,
) -> [[V; 3]; 4] {
    [look_up(p, a), look_up(q, b), look_up(r, b), look_up(s, b)]
}

#[inline(always)]
pub(super) fn two_edges<V: Lookup>(
    [p, q, _]: &[[[f32; TABLE]; 3]; 3],
    a: V::Slots,
    [r, s, _]: &[[[f32; TABLE]; 3]; 3],
    b: V::Slots,
) -> [[V; 3]; 4] {
    [look_up(p, a), look_up(q, a), look_up(r, b), look_up(s, b)]
}

#[inline(always)]
pub(super) fn look_up<V: Lookup>([x, y, z]: &[[f32; TABLE]; 3], slots: V::Slots) -> [V; 3] {
    [
        V::look_up(x, slots),
        V::look_up(y, slots),
        V::look_up(z, slots),
    ]
}

/// Searches the whole step of one pair. Also returns the interval of the first contact, if there
/// certainly is one.
#[inline]
pub(crate) fn search_contact(
    pair: ElementPair,
    start: &[Point; 4],
    end: &[Point; 4],
) -> (Next, [f64; 2]) {
    match pair {
        ElementPair::VertexFace | ElementPair::EdgeEdge => search_one(are_edges(pair), start, end),
        // Their difference polygon has no face.
        ElementPair::VertexVertex | ElementPair::VertexEdge => (Next::Unsure, [0.0, 1.0]),
    }
}

#[inline(never)]
fn search_one(are_edges: bool, start: &[Point; 4], end: &[Point; 4]) -> (Next, [f64; 2]) {
    let motion = PolygonMotion::new(are_edges, start, end);
    let mut search = Search::new(1.0);
    if motion.are_apart(1.0) {
        return (Next::Apart, search.span());
    }
    let mut next = Next::Look;
    loop {
        let [low, high] = search.span();
        match next {
            Next::Look => {
                let look = motion.look(low, high);
                let seen = Look8 {
                    no: u8::from(look.no),
                    single: u8::from(look.single),
                    hopeless: u8::from(look.hopeless),
                };
                next = search.after_look(&seen, 0, 1.0);
            }
            Next::Enclose => {
                let enclosed = motion.enclose(low, high);
                let found = Enclosed8 {
                    inside: u8::from(enclosed.inside),
                    outside: u8::from(enclosed.outside),
                    is_short: u8::from(enclosed.is_short),
                    ..Enclosed8::default()
                };
                next = search.after_enclosing(&found, 0, 1.0);
                if next == Next::Contact {
                    return (next, [enclosed.first, enclosed.last]);
                }
            }
            Next::Apart | Next::Contact | Next::Unsure => return (next, [low, high]),
        }
    }
}

/// Whether the elements touch; `None` when unsure.
#[inline]
pub(crate) fn contact_answer(
    pair: ElementPair,
    start: &[Point; 4],
    end: &[Point; 4],
) -> Option<bool> {
    match search_contact(pair, start, end).0 {
        Next::Contact => Some(true),
        Next::Apart => Some(false),
        _ => None,
    }
}
