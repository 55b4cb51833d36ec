//! The filters for distances compared with integers and exact roots, on troublesome input and every
//! instruction set. Those are compared with an independent oracle in `tests/sweep`.

use super::features::PolygonPart;
use super::filter::{self, Approach};
use super::moving::first_within_by_roots;
use super::{Reach, closest_points, gap_below, nearest};
use crate::filter::{
    BATCH, Bounded16, Moving64, Near16, SWAPPED_PARTS, are_within_in_tables, bounded_in_tables,
    nearest_in_tables, number, stay_beyond_in_tables, time_between,
};
use crate::rounding::power_of_two;
use crate::sweep::tests::{KINDS, Kind, PAIRS, Step, in_tables, step};
use crate::tests::on_all;
use crate::{Contact, ElementPair, Point};
use impinge_testing::random::Random;

/// Sixteen pairs in tables, and what is asked of them.
struct Asked {
    pair: ElementPair,
    tables: [Moving64; 2],
    slots: [u8; BATCH],
    until: f32,
    reach: [f32; 2],
}

impl Asked {
    fn new(pair: ElementPair, steps: &[Step], until: f32, reach: [f32; 2]) -> Self {
        let (tables, slots) = in_tables(pair, steps);
        Asked {
            pair,
            tables,
            slots,
            until,
            reach,
        }
    }

    #[inline(always)]
    fn answer<V: number::Lookup>(&self) -> (Near16, u16, Bounded16) {
        let [a, b] = &self.tables;
        let (groups, slots) = ([a, b], [&self.slots; 2]);
        let within = are_within_in_tables::<V>(self.pair, groups, slots, self.reach);
        let high = self.reach[1];
        let stay = stay_beyond_in_tables::<V>(self.pair, groups, slots, self.until, high);
        let reach = self.reach.map(|of_all| [of_all; BATCH]);
        let mut near = nearest_in_tables::<V>(self.pair, groups, slots, &reach);
        assert_eq!(near.verdict, within);
        // Parts of pairs that are not certainly near depend on the length of registers.
        for bits in &mut near.parts {
            *bits &= within.yes;
        }
        let mut bounded = bounded_in_tables::<V>(self.pair, groups, slots, &reach);
        assert_eq!(bounded.verdict, within);
        for lane in 0..BATCH {
            if within.yes >> lane & 1 == 0 {
                (bounded.low[lane], bounded.high[lane]) = (0.0, f32::INFINITY);
            }
        }
        (near, stay, bounded)
    }
}

on_all!(f32: fn answer_of_all(asked: &Asked) -> (Near16, u16, Bounded16) = Asked::answer);

/// A distance that some of the elements have at the start or at the end, or one next to it, or
/// another one.
fn distance(pair: ElementPair, steps: &[Step], kind: Kind, random: &mut Random) -> f64 {
    let step = &steps[random.below(BATCH as u32) as usize];
    let found = closest_points(pair, &step[random.below(2) as usize]).distance;
    match random.below(6) {
        0 => found,
        1 => found.next_up(),
        2 => found.next_down().max(0.0),
        3 => f64::from(found as f32),
        4 => found * 0.75,
        _ if matches!(kind, Kind::Extreme) => found * 1.5,
        _ => 0.25 * f64::from(random.below(8)),
    }
}

fn is_in_time(contact: Option<Contact>, until: f64) -> bool {
    contact.is_some_and(|contact| contact.is_within(until))
}

#[test]
fn filters_never_contradict_integers_and_roots() {
    let mut random = Random::new(5);
    for kind in KINDS {
        for pair in PAIRS {
            let (mut n_sure, mut n_open, mut n_near, mut n_kept) = (0, 0, 0, 0);
            let (mut n_between, mut n_rounded, mut n_unsure) = (0, 0, 0);
            for round in 0..10 {
                let until = [1.0, 0.5, 0.328_125, 1.0][round % 4];
                let steps = [(); BATCH].map(|()| step(kind, &mut random));
                let d = distance(pair, &steps, kind, &mut random);
                let reach = Reach::from(d);
                let asked = Asked::new(pair, &steps, until as f32, reach.enclosing_f32());
                let (near, stay, bounded) = answer_of_all(&asked);
                let within = near.verdict;
                assert_eq!(within.yes & within.no, 0);
                for (lane, [start, end]) in steps.iter().enumerate() {
                    let case = || format!("{kind:?} {pair:?} {until} {d:?} {:?}", steps[lane]);
                    let is = |mask: u16| mask >> lane & 1 == 1;
                    let [low, high] = [bounded.low[lane], bounded.high[lane]].map(f64::from);
                    assert!(closest_points(pair, start).distance >= low * (1.0 - 1e-15));
                    assert!(
                        high.is_infinite() || nearest::are_within(pair, start, &Reach::from(high))
                    );
                    let is_near = nearest::are_within(pair, start, &reach);
                    assert!(!is(within.yes) || is_near, "{}", case());
                    assert!(!is(within.no) || !is_near, "{}", case());
                    if is(within.yes | within.no) {
                        n_sure += 1;
                    } else {
                        n_open += 1;
                    }
                    n_near += u32::from(is_near);
                    let answer = filter::answer(pair, start, &reach);
                    assert!(answer.is_none_or(|answer| answer == is_near), "{}", case());
                    if d == 0.0 {
                        continue;
                    }
                    let contact = if is_near {
                        Some(Contact::AT_START)
                    } else {
                        first_within_by_roots(pair, start, end, d)
                    };
                    assert!(!(is(stay) && is_in_time(contact, until)), "{}", case());
                    n_kept += u32::from(is(stay));
                    match filter::approach(pair, start, end, d, until) {
                        Approach::Apart => assert!(!is_in_time(contact, until), "{}", case()),
                        Approach::AtStart => assert!(is_near, "{}", case()),
                        Approach::Between([low, high]) => {
                            n_between += 1;
                            let contact = contact.unwrap_or_else(|| panic!("{}", case()));
                            assert!(!contact.at_start, "{}", case());
                            // After the first, and not after the second.
                            assert!(!contact.is_within(low), "{} {contact:?}", case());
                            assert!(contact.is_within(high), "{} {contact:?}", case());
                            if let Some(time) = time_between([low, high]) {
                                n_rounded += 1;
                                assert_eq!(time, contact.time_f32(), "{}", case());
                            }
                        }
                        Approach::Unsure => n_unsure += 1,
                    }
                }
            }
            let counts = format!(
                "{kind:?} {pair:?} sure {n_sure} open {n_open} near {n_near} kept {n_kept} \
                 between {n_between} rounded {n_rounded} unsure {n_unsure}"
            );
            match kind {
                Kind::Plain | Kind::Close => {
                    // One pair in sixteen is at the distance asked for, or next to it, at an end.
                    assert!(n_open * 10 < n_sure, "{counts}");
                    assert!(n_rounded > 0 && n_near > 10 && n_kept > 5, "{counts}");
                    // What goes to exact arithmetic: no interval, or one with ends that round
                    // apart.
                    let n_exact = n_unsure + n_between - n_rounded;
                    assert!(n_exact * 10 < n_sure + n_open, "{counts}");
                }
                Kind::Lattice | Kind::NearlyTied | Kind::Flat => {
                    assert!(n_near > 0 && n_sure > 0 && n_open > 0, "{counts}");
                }
                Kind::Extreme => assert!(n_sure > 0, "{counts}"),
            }
        }
    }
}

/// The nearest part in integers; none of flat polygons.
fn exact_part(pair: ElementPair, points: &[Point; 4]) -> Option<PolygonPart> {
    let polygon = nearest::ExactPolygon::of_any_size(pair, points, &Reach::from(0.0));
    (!polygon.is_flat()).then(|| polygon.nearest())
}

/// The points moved so that the first corner of the polygon is straight beside its first edge, but
/// for rounding to `f32`: the origin is between the regions of both.
fn beside_the_end(pair: ElementPair, mut points: [Point; 4]) -> [Point; 4] {
    let [from, to, moved] = match pair {
        ElementPair::EdgeEdge => [0, 1, 2],
        _ => [1, 2, 0],
    };
    let difference = |p: &Point, q: &Point| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let dot = |d: &Point, e: &Point| d[0] * e[0] + d[1] * e[1] + d[2] * e[2];
    let along = difference(&points[to], &points[from]);
    let corner = difference(&points[from], &points[moved]);
    let share = dot(&corner, &along) / dot(&along, &along);
    if share.is_finite() {
        for axis in 0..3 {
            let moved = &mut points[moved][axis];
            *moved = f64::from((*moved + share * along[axis]) as f32);
        }
    }
    points
}

#[test]
fn nearest_parts_by_certain_signs_are_those_of_integers() {
    let mut random = Random::new(7);
    for kind in KINDS {
        for pair in PAIRS {
            let (mut n_known, mut n_unknown, mut n_in_f64) = (0, 0, 0);
            let mut seen = [0; 9];
            for round in 0..90 {
                let mut steps = [(); BATCH].map(|()| step(kind, &mut random));
                let is_tied = round % 3 == 0;
                if is_tied {
                    for [start, _] in &mut steps {
                        *start = beside_the_end(pair, *start);
                    }
                }
                // All pairs in range are near.
                let asked = Asked::new(pair, &steps, 1.0, [1e4; 2]);
                let (near, _, _) = answer_of_all(&asked);
                for (lane, [start, _]) in steps.iter().enumerate() {
                    let case = || format!("{kind:?} {pair:?} {start:?}");
                    let expected = exact_part(pair, start);
                    if let Some(part) = filter::nearest_part(pair, start) {
                        n_in_f64 += 1;
                        assert_eq!(Some(part), expected, "{}", case());
                    }
                    if near.verdict.yes >> lane & 1 == 0 {
                        continue;
                    }
                    let number = near.part(lane);
                    let Some(part) = PolygonPart::numbered(number) else {
                        n_unknown += u32::from(!is_tied);
                        assert_eq!(number, 15, "{}", case());
                        continue;
                    };
                    n_known += u32::from(!is_tied);
                    seen[usize::from(number)] += 1;
                    assert_eq!(Some(part), expected, "{}", case());
                    if pair == ElementPair::EdgeEdge {
                        let [p, q, r, s] = *start;
                        let swapped = PolygonPart::numbered(SWAPPED_PARTS[usize::from(number)]);
                        assert_eq!(swapped, exact_part(pair, &[r, s, p, q]), "{}", case());
                    }
                }
            }
            let counts =
                format!("{kind:?} {pair:?} {n_known} {n_unknown} of f64 {n_in_f64} {seen:?}");
            match kind {
                Kind::Plain | Kind::Close => {
                    assert!(n_known > 50 * n_unknown, "{counts}");
                    let n = pair.corners().len();
                    let (corners, edges) = (&seen[..n], &seen[4..4 + n]);
                    assert!(corners.iter().chain(edges).all(|&n| n > 0), "{counts}");
                    assert!(seen[8] > 0, "{counts}");
                }
                Kind::Lattice | Kind::NearlyTied => {
                    assert!(n_known > 0 && n_unknown > 0, "{counts}");
                }
                Kind::Flat | Kind::Extreme => assert!(n_unknown > 0, "{counts}"),
            }
        }
    }
}

/// Numbers of up to 61 bits: all that fixed width takes.
fn long(bits: u32, random: &mut Random) -> f64 {
    let whole = (random.bits() % (1 << bits.min(53))) as f64;
    let sign = [1.0, -1.0][random.below(2) as usize];
    sign * whole * 2.0_f64.powi(random.below(bits - 52) as i32 - 40)
}

#[test]
fn integers_of_fixed_width_answer_as_those_of_any_size() {
    use super::rounded::closest_of;
    let mut random = Random::new(6);
    let (mut n_short, mut n_long) = (0, 0);
    let mut check = |pair: ElementPair, points: &[Point; 4], d: f64| {
        let case = || format!("{pair:?} {points:?} {d:?}");
        let reach = Reach::from(d);
        let long = nearest::ExactPolygon::of_any_size(pair, points, &reach);
        let Some(short) = nearest::ExactPolygon::short(pair, points, &reach) else {
            n_long += 1;
            return;
        };
        n_short += 1;
        assert_eq!(short.nearest(), long.nearest(), "{}", case());
        assert_eq!(short.is_flat(), long.is_flat(), "{}", case());
        assert_eq!(short.compare(), long.compare(), "{}", case());
        let (a, b) = (
            closest_of(&short, short.nearest(), pair, points),
            closest_of(&long, long.nearest(), pair, points),
        );
        assert_eq!(a, b, "{}", case());
        assert_eq!(a.distance.to_bits(), b.distance.to_bits(), "{}", case());
        let bits = |points: [Point; 2]| points.map(|point| point.map(f64::to_bits));
        assert_eq!(bits(a.points), bits(b.points), "{}", case());
    };
    for round in 0..400 {
        for kind in KINDS {
            for pair in [
                PAIRS[0],
                PAIRS[1],
                ElementPair::VertexEdge,
                ElementPair::VertexVertex,
            ] {
                let [start, _] = step(kind, &mut random);
                let found = closest_points(pair, &start).distance;
                let d = [found, found.next_up(), found.next_down().max(0.0), 0.5][round % 4];
                check(pair, &start, d);
                // As long as it goes, with corners that coincide on some axes.
                let mut points = [(); 4].map(|()| [(); 3].map(|()| long(61, &mut random)));
                for _ in 0..random.below(8) {
                    let [to, from] = [random.below(4), random.below(4)].map(|ix| ix as usize);
                    let axis = random.below(3) as usize;
                    points[to][axis] = points[from][axis];
                }
                let d = if round % 2 == 0 {
                    found
                } else {
                    long(61, &mut random).abs()
                };
                check(pair, &points, d);
            }
        }
    }
    assert!(n_short > 5000 && n_long > 500, "{n_short} {n_long}");
}

/// The largest numbers that fixed width takes do not overflow, and one bit more is refused.
#[test]
fn the_largest_short_numbers_fit() {
    let most = (1_u64 << 60) as f64;
    let almost = 2.0_f64.powi(61).next_down();
    let tiny = Reach::from(1.0);
    for signs in 0..1 << 12 {
        let points: [Point; 4] = std::array::from_fn(|ix| {
            std::array::from_fn(|axis| {
                let sign = if signs >> (3 * ix + axis) & 1 == 1 {
                    -1.0
                } else {
                    1.0
                };
                sign * if axis == 0 {
                    almost / 2.0
                } else {
                    most - 128.0
                }
            })
        });
        for pair in PAIRS {
            for reach in [tiny, Reach::from(almost)] {
                let long = nearest::ExactPolygon::of_any_size(pair, &points, &reach);
                let short = nearest::ExactPolygon::short(pair, &points, &reach);
                let Some(short) = short else {
                    panic!("{pair:?} {points:?} {reach:?}");
                };
                assert_eq!(short.nearest(), long.nearest(), "{pair:?} {points:?}");
                assert_eq!(short.compare(), long.compare(), "{pair:?} {points:?}");
            }
            let half = Reach::from(0.5);
            let far = points.map(|point| point.map(|x| 2.0 * x));
            let largest = nearest::ExactPolygon::of_any_size(pair, &far, &half);
            let differs = largest.corners().iter().flatten().any(|x| !x.is_zero());
            let refused = nearest::ExactPolygon::short(pair, &far, &half).is_none();
            assert_eq!(refused, differs, "{pair:?} {far:?}");
        }
    }
}

#[test]
fn numbers_that_are_none_are_unsure() {
    for x in [f64::NAN, f64::INFINITY, f64::MAX] {
        let steps = std::array::from_fn::<Step, BATCH, _>(|lane| {
            let mut points = [[[0.25; 3]; 4]; 2];
            points[lane % 2][lane / 2 % 4] = [x, -x, x];
            points[0][(lane / 2 + 1) % 4] = [1.0, 2.0, -0.5];
            points
        });
        for pair in PAIRS {
            let asked = Asked::new(pair, &steps, 1.0, [0.1, 0.1]);
            let (near, stay, _) = answer_of_all(&asked);
            let within = near.verdict;
            assert_eq!(stay, 0, "{x} {pair:?}");
            // The elements of odd lanes are finite at the start.
            let at_start = (within.yes | within.no) & 0x5555;
            assert_eq!(at_start, 0, "{x} {pair:?}");
            for (lane, [start, end]) in steps.iter().enumerate() {
                if lane % 2 == 0 {
                    let found = filter::approach(pair, start, end, 0.1, 1.0);
                    assert_eq!(found, Approach::Unsure, "{x} {pair:?}");
                }
            }
        }
    }
}

/// Gaps of thick elements against exact comparisons, also where the thickness is nearly the
/// distance.
#[test]
fn gaps_are_below_by_little_and_zero_where_elements_are_within() {
    let pairs = [
        ElementPair::VertexVertex,
        ElementPair::VertexEdge,
        ElementPair::VertexFace,
        ElementPair::EdgeEdge,
    ];
    let mut random = Random::new(5);
    let (mut n_within, mut n_small) = (0, 0);
    for round in 0..4000 {
        let pair = pairs[round % 4];
        let scale = [1.0, 0.1, 1e-7][round / 4 % 3];
        let mut number = || scale * f64::from(random.range(-1.5, 0.5));
        let points = [(); 4].map(|()| [(); 3].map(|()| number()));
        let distance = closest_points(pair, &points).distance;
        let near = [0.0, 1.0, -1.0, 3.0, -900.0, 1e6, -1e9, -1e14][round / 12 % 8];
        let sum = distance * (1.0 + near * f64::EPSILON);
        let first = sum * f64::from(random.unit());
        let thickness = match round % 3 {
            0 => [first, sum - first],
            1 => [sum, 0.0],
            // A sum that is no float.
            _ => [sum, sum * 2f64.powi(-60)],
        };
        let (a, b) = points[..pair.n_points()].split_at(pair.n_first());
        let gap = gap_below(a, b, thickness);
        let is_within = |gap: f64| {
            let [a, b] = thickness;
            nearest::are_within(pair, &points, &Reach::of_sum([a, b, gap]))
        };
        if pair != ElementPair::EdgeEdge {
            assert_eq!(gap, gap_below(b, a, thickness));
        }
        if gap == 0.0 {
            assert!(is_within(0.0), "{pair:?} {points:?} {thickness:?}");
            n_within += 1;
            continue;
        }
        assert!(
            !is_within(gap.next_down()),
            "{pair:?} {points:?} {thickness:?}"
        );
        let above = gap * (1.0 + 2f64.powi(-19) * 0.5001);
        assert!(is_within(above), "{pair:?} {points:?} {thickness:?}");
        n_small += usize::from(gap < 1e-14 * distance);
    }
    assert!(n_within > 500 && n_small > 100, "{n_within} {n_small}");
}

/// Sizes of which products over- or underflow are decided like others: in floats, not by exact
/// arithmetic, which takes a thousand times as long.
#[test]
fn sizes_out_of_range_are_decided_in_floats() {
    let mut random = Random::new(11);
    let mut n_decided = 0;
    for round in 0..400 {
        let pair = PAIRS[round % PAIRS.len()];
        let mut point = || [(); 3].map(|()| f64::from(random.range(-1.5, 0.5)));
        let [start, end] = [(); 2].map(|()| [(); 4].map(|()| point()));
        let decided = |exponent: i32| {
            let size = power_of_two(exponent);
            let of = |points: &[Point; 4]| points.map(|point| point.map(|x| x * size));
            let (start, end) = (of(&start), of(&end));
            let approach = filter::approach(pair, &start, &end, 0.1 * size, 1.0);
            let reach = Reach::from(0.3 * size);
            let [low, high] = filter::bounds(pair, &start).unwrap_or([0.0; 2]);
            (
                std::mem::discriminant(&approach),
                filter::answer(pair, &start, &reach),
                low > 0.0 && high < low * (1.0 + 1e-9),
            )
        };
        let expected = decided(0);
        for exponent in [-1000, -800, -500, -230, 99, 101, 200, 340, 900, 1015] {
            assert_eq!(decided(exponent), expected, "{pair:?} 2^{exponent}");
        }
        n_decided += usize::from(expected.1.is_some() && expected.2);
    }
    assert!(n_decided > 350, "{n_decided}");
    // A coordinate that would lose bits: not decided, rather than wrongly.
    let [tiny, huge] = [-1000, 1000].map(power_of_two);
    let points = [[huge, 0.0, tiny], [huge, huge, 0.0], [0.0; 3], [0.0; 3]];
    for (of, found) in [
        (points, None),
        (points.map(|[x, y, _]| [x, y, 0.0]), Some(true)),
    ] {
        let reach = Reach::from(2.0 * huge);
        assert_eq!(
            filter::answer(ElementPair::VertexVertex, &of, &reach),
            found
        );
    }
}
