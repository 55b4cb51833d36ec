//! The answers of the filter for moving elements compared with those of exact roots. The roots
//! themselves are compared with an independent oracle in `tests/sweep`.

use super::{Contact, ElementPair, first_contact, first_contact_by_roots};
use crate::Point;
use crate::filter::{
    self, BATCH, LANES, Moving64, Next, Search, Spans8, Steps8, TABLE, contact_answer, number,
    time_between,
};
use crate::tests::on_all;
use impinge_testing::random::Random;

pub(crate) const PAIRS: [ElementPair; 2] = [ElementPair::VertexFace, ElementPair::EdgeEdge];

/// The corners of both elements at the start and at the end.
pub(crate) type Step = [[Point; 4]; 2];

/// How a step is made.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    /// Anywhere in a cube.
    Plain,
    /// On a small lattice: ties.
    Lattice,
    /// As `Lattice`, rotated and moved by about a last bit.
    NearlyTied,
    /// Elements next to each other, moving little.
    Close,
    /// All in one plane at all times.
    Flat,
    /// As `Plain`, but so small or large that numbers underflow or are beyond the filter's range.
    Extreme,
}

pub(crate) const KINDS: [Kind; 6] = [
    Kind::Plain,
    Kind::Lattice,
    Kind::NearlyTied,
    Kind::Close,
    Kind::Flat,
    Kind::Extreme,
];

fn narrow(x: f64) -> f64 {
    f64::from(x as f32)
}

/// A step whose coordinates are `f32`.
pub(crate) fn step(kind: Kind, random: &mut Random) -> Step {
    let mut points = [[[0.0; 3]; 4]; 2];
    let axes = [[(); 3]; 3].map(|axis| axis.map(|()| f64::from(random.range(-1.0, 1.0))));
    let scale = 2.0_f64.powi(random.below(160) as i32 - 120);
    #[allow(clippy::needless_range_loop)] // `points[0]` is read while `points[1]` is written.
    for end in 0..2 {
        for ix in 0..4 {
            let lattice = [(); 3].map(|()| f64::from(random.below(4)));
            let plain = [(); 3].map(|()| f64::from(random.range(-1.0, 1.0)));
            points[end][ix] = match kind {
                Kind::Plain => plain,
                Kind::Lattice => lattice,
                Kind::NearlyTied => std::array::from_fn(|k| {
                    let x: f64 = (0..3).map(|axis| lattice[axis] * axes[axis][k]).sum();
                    let x = x as f32;
                    f64::from(match random.below(4) {
                        0 => x.next_up(),
                        1 => x.next_down(),
                        _ => x,
                    })
                }),
                Kind::Close if end == 0 => plain.map(|x| narrow(100.0 + x)),
                Kind::Close => std::array::from_fn(|k| narrow(points[0][ix][k] + 0.2 * plain[k])),
                Kind::Flat => std::array::from_fn(|k| {
                    narrow(lattice[0] * axes[0][k].round() + lattice[1] * axes[1][k].round())
                }),
                Kind::Extreme => plain.map(|x| x * scale),
            };
        }
    }
    points
}

impl Steps8 {
    fn set(&mut self, lane: usize, step: &Step) {
        let lists = self.0.as_flattened_mut().as_flattened_mut();
        for (list, x) in lists.iter_mut().zip(step.as_flattened().as_flattened()) {
            list[lane] = *x;
        }
    }
}

/// How the search of one lane ended, and with which interval: that of the contact, or what was not
/// searched any more.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Outcome {
    next: Next,
    span: [f64; 2],
}

/// The answer of an instruction set: pairs that are apart, and how searches end.
type Answer = (u8, [Outcome; LANES]);

/// The end of the time of interest, and the margin.
type Within = (f64, f64);

#[inline(always)]
fn ask<V: number::Vector>(pair: ElementPair, steps: &Steps8, (until, margin): Within) -> Answer {
    let apart = filter::are_apart::<V>(pair, steps, until, margin);
    let mut searches = [Search::new(until); LANES];
    let mut outcomes = [Outcome {
        next: Next::Look,
        span: [0.0, until],
    }; LANES];
    // With a margin, a search ends where there is a candidate.
    let is_open = |outcome: &Outcome| match outcome.next {
        Next::Look => true,
        Next::Enclose => margin == 0.0,
        _ => false,
    };
    while outcomes.iter().any(is_open) {
        let mut spans = Spans8::default();
        for (lane, search) in searches.iter().enumerate() {
            [spans.low[lane], spans.high[lane]] = search.span();
        }
        let seen = filter::look::<V>(pair, steps, &spans, margin);
        let found = filter::enclose::<V>(pair, steps, &spans);
        for lane in 0..LANES {
            let (search, outcome) = (&mut searches[lane], &mut outcomes[lane]);
            if !is_open(outcome) {
                continue;
            }
            outcome.next = match outcome.next {
                Next::Look => search.after_look(&seen, lane, until),
                _ => search.after_enclosing(&found, lane, until),
            };
            outcome.span = match outcome.next {
                Next::Contact => [found.span.low[lane], found.span.high[lane]],
                _ => search.span(),
            };
        }
    }
    (apart, outcomes)
}

on_all!(f64: fn ask_all(pair: ElementPair, steps: &Steps8, within: Within) -> Answer = ask);

/// Pairs in tables, in `f32`, and their slots.
pub(crate) fn in_tables(pair: ElementPair, steps: &[Step]) -> ([Moving64; 2], [u8; BATCH]) {
    // Elements at odd slots, in reverse.
    let slots: [u8; BATCH] = std::array::from_fn(|lane| (2 * (BATCH - lane) - 1) as u8);
    let table = |points: std::ops::Range<usize>| {
        let mut table: Moving64 = [[[[0.0; TABLE]; 3]; 3]; 2];
        for (lane, step) in steps.iter().enumerate() {
            for (end, corners) in table.iter_mut().enumerate() {
                for (point, corner) in points.clone().zip(corners) {
                    for (axis, row) in corner.iter_mut().enumerate() {
                        row[slots[lane] as usize] = step[end][point][axis] as f32;
                    }
                }
            }
        }
        table
    };
    let n = pair.n_first();
    ([table(0..n), table(n..4)], slots)
}

/// The same pairs in tables: which are apart.
#[inline(always)]
fn ask_tables<V: number::Lookup>(pair: ElementPair, steps: &[Step], within: (f32, f64)) -> u16 {
    let ([a, b], slots) = in_tables(pair, steps);
    let (tables, slots) = ([&a, &b], [&slots, &slots]);
    filter::are_far_in_tables::<V>(pair, tables, slots, within)
        | filter::are_across_in_tables::<V>(pair, tables, slots, within)
        | filter::are_aside_in_tables::<V>(pair, tables, slots, within)
}

on_all!(
    f32: fn ask_all_tables(pair: ElementPair, steps: &[Step], within: (f32, f64)) -> u16
        = ask_tables
);

/// Whether a contact comes at `until` or earlier.
fn is_in_time(contact: Option<Contact>, until: f64) -> bool {
    contact.is_some_and(|contact| contact.is_within(until))
}

#[test]
fn filter_never_contradicts_exact_roots() {
    let mut random = Random::new(21);
    for kind in KINDS {
        for pair in PAIRS {
            let (mut n_yes, mut n_no, mut n_unsure, mut n_rounded) = (0, 0, 0, 0);
            for round in 0..150 {
                let until = [1.0, 0.5, 0.328_125, 1e-3][round % 4];
                let steps = [(); BATCH].map(|()| step(kind, &mut random));
                let exact = steps.map(|[start, end]| first_contact_by_roots(pair, &start, &end));
                let apart = ask_all_tables(pair, &steps, (until as f32, 0.0));
                for (lane, contact) in exact.iter().enumerate() {
                    let until = f64::from(until as f32);
                    let is_right = apart >> lane & 1 == 0 || !is_in_time(*contact, until);
                    assert!(is_right, "{kind:?} {pair:?} {until} {:?}", steps[lane]);
                }
                for (steps, exact) in steps.chunks(LANES).zip(exact.chunks(LANES)) {
                    let mut batch = Steps8::default();
                    for (lane, step) in steps.iter().enumerate() {
                        batch.set(lane, step);
                    }
                    let (apart, found) = ask_all(pair, &batch, (until, 0.0));
                    for lane in 0..LANES {
                        let Outcome { next, span } = found[lane];
                        let case = || format!("{kind:?} {pair:?} {until} {:?}", steps[lane]);
                        let contact = exact[lane];
                        let is_right = apart >> lane & 1 == 0 || !is_in_time(contact, until);
                        assert!(is_right, "{}", case());
                        let is_early =
                            contact.is_some_and(|c| c.time < span[0]) && next != Next::Apart;
                        // A time that is below the interval only by its own rounding is not early.
                        let is_early = is_early && !is_floor_of(contact, span[0]);
                        assert!(!is_early, "{} {contact:?} {found:?}", case());
                        if next == Next::Apart {
                            n_no += 1;
                            assert!(!is_in_time(contact, until), "{}", case());
                        } else if next == Next::Contact {
                            n_yes += 1;
                            let contact = contact.unwrap_or_else(|| panic!("{}", case()));
                            assert!(!contact.at_start, "{}", case());
                            assert!(contact.is_within(span[1]), "{}", case());
                            assert!(span[1] <= until, "{}", case());
                            if let Some(time) = time_between(span) {
                                n_rounded += 1;
                                assert_eq!(time, contact.time_f32(), "{}", case());
                            }
                        } else {
                            assert_eq!(next, Next::Unsure);
                            n_unsure += 1;
                        }
                        let [start, end] = &steps[lane];
                        if let Some(answer) = contact_answer(pair, start, end) {
                            assert_eq!(answer, contact.is_some(), "{}", case());
                            // The fast path finds the same time.
                            assert_eq!(first_contact(pair, start, end), contact, "{}", case());
                        }
                    }
                }
            }
            match kind {
                Kind::Plain | Kind::Close => {
                    assert!(n_yes > 3 && n_no > 1000, "{kind:?} {n_yes} {n_no}");
                    assert!(n_unsure * 500 < n_yes + n_no, "{kind:?} unsure {n_unsure}");
                    assert!(n_rounded * 50 > n_yes * 49, "{kind:?} {n_rounded} {n_yes}");
                }
                Kind::Lattice | Kind::NearlyTied => assert!(n_yes > 0 && n_unsure > 0),
                Kind::Flat => assert!(n_yes == 0 && n_unsure > 0),
                Kind::Extreme => assert!(n_no > 0),
            }
        }
    }
}

/// What is apart with a margin is apart for all elements whose vertices are off their ways by half
/// of it; without the margin, some of those touch.
#[test]
fn a_margin_covers_elements_that_are_off_their_ways() {
    let mut random = Random::new(8);
    for kind in [Kind::Plain, Kind::Close, Kind::Lattice, Kind::NearlyTied] {
        for pair in PAIRS {
            // Pairs that touch when they are off their ways: apart without the margin, in tables
            // and not, and by looking.
            let mut n_missed = [0; 3];
            let mut n_apart = [0; 3];
            for round in 0..480 {
                let until = [1.0, 0.5, 0.328_125][round % 3];
                let off = 2f64.powi(-1 - (round % 20) as i32);
                let margins = [0.0, 2.0 * off];
                let steps = [(); BATCH].map(|()| step(kind, &mut random));
                // Off by no more than half of the margin, as computed.
                let moved = steps.map(|step| {
                    step.map(|points| {
                        points.map(|point| {
                            point.map(|x| match random.below(2) {
                                0 => (x - off).next_up(),
                                _ => (x + off).next_down(),
                            })
                        })
                    })
                });
                let touches = moved.map(|[start, end]| {
                    let contact = first_contact_by_roots(pair, &start, &end);
                    is_in_time(contact, f64::from(until as f32))
                });
                let mut seen = [[[false; BATCH]; 3]; 2];
                for (seen, margin) in seen.iter_mut().zip(margins) {
                    let apart = ask_all_tables(pair, &steps, (until as f32, margin));
                    seen[0] = std::array::from_fn(|lane| apart >> lane & 1 == 1);
                    for (n, steps) in steps.chunks(LANES).enumerate() {
                        let mut batch = Steps8::default();
                        for (lane, step) in steps.iter().enumerate() {
                            batch.set(lane, step);
                        }
                        let (apart, found) = ask_all(pair, &batch, (until, margin));
                        for lane in 0..LANES {
                            seen[1][n * LANES + lane] = apart >> lane & 1 == 1;
                            seen[2][n * LANES + lane] = found[lane].next == Next::Apart;
                        }
                    }
                }
                for test in 0..3 {
                    for lane in 0..BATCH {
                        let [without, with] = [0, 1].map(|which| seen[which][test][lane]);
                        n_apart[test] += usize::from(with);
                        n_missed[test] += usize::from(without && touches[lane]);
                        assert!(
                            !(with && touches[lane]),
                            "{kind:?} {pair:?} {test} {until} {off} {:?} {:?}",
                            steps[lane],
                            moved[lane]
                        );
                    }
                }
            }
            assert!(
                n_missed.iter().all(|&n| n > 0) && n_apart.iter().all(|&n| n > 1000),
                "{kind:?} {pair:?} {n_missed:?} {n_apart:?}"
            );
        }
    }
}

/// Elements that meet at the border of a face or at an end of an edge: the area to one side is
/// exactly zero at all times, and only its rounding error has a sign.
#[test]
fn filter_does_not_trust_the_rounding_error_of_an_area() {
    let mut random = Random::new(5);
    for pair in PAIRS {
        let mut n_unsure = 0;
        for _ in 0..200 {
            let mut batch = Steps8::default();
            for lane in 0..LANES {
                let step = meeting_at_a_border(pair, &mut random);
                let contact = first_contact_by_roots(pair, &step[0], &step[1]);
                assert_eq!(contact.map(|contact| contact.time), Some(0.5), "{step:?}");
                batch.set(lane, &step);
            }
            let (apart, found) = ask_all(pair, &batch, (1.0, 0.0));
            assert_eq!(apart, 0);
            for outcome in found {
                assert_ne!(outcome.next, Next::Apart, "{pair:?}");
                n_unsure += usize::from(outcome.next == Next::Unsure);
            }
        }
        assert!(n_unsure > 0);
    }
}

/// The first point, and of two edges the second with it, moves through the middle of the edge
/// between two others, at time 1/2, in the plane of that edge and the normal. Coordinates are whole
/// numbers below 2^53, and areas are not.
fn meeting_at_a_border(pair: ElementPair, random: &mut Random) -> Step {
    let mut corner = || [(); 3].map(|()| 2.0 * f64::from(random.below(1 << 13)));
    let (start, end, third) = (corner(), corner(), corner());
    let edge: Point = std::array::from_fn(|k| end[k] - start[k]);
    let other: Point = std::array::from_fn(|k| third[k] - start[k]);
    let normal: Point = std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        edge[i] * other[j] - edge[j] * other[i]
    });
    let along = f64::from(random.below(1 << 10));
    [-1.0, 1.0].map(|side| {
        let moving = std::array::from_fn(|k| {
            start[k] + 0.5 * edge[k] + side * (normal[k] + along * edge[k])
        });
        match pair {
            ElementPair::VertexFace => [moving, start, end, third],
            _ => [
                moving,
                std::array::from_fn(|k| moving[k] + other[k]),
                start,
                end,
            ],
        }
    })
}

/// Whether the first time lies in [low, next after its floor).
fn is_floor_of(contact: Option<Contact>, low: f64) -> bool {
    contact.is_some_and(|contact| !contact.is_exact && contact.time.next_up() >= low)
}

#[test]
fn numbers_that_are_none_are_unsure() {
    for x in [f64::NAN, f64::INFINITY, f64::MAX] {
        let mut steps = Steps8::default();
        for lane in 0..LANES {
            let mut points = [[[0.25; 3]; 4]; 2];
            points[lane % 2][lane / 2] = [x, -x, x];
            points[0][(lane / 2 + 1) % 4] = [1.0, 2.0, -0.5];
            steps.set(lane, &points);
        }
        for pair in PAIRS {
            let (apart, found) = ask::<number::Portable>(pair, &steps, (1.0, 0.0));
            assert_eq!(apart, 0, "{x} {pair:?}");
            for outcome in found {
                assert_eq!(outcome.next, Next::Unsure, "{x} {pair:?}");
            }
        }
    }
}
