//! Random pairs of moving elements, most of them made to cause trouble, against the oracle.

use dashu_int::IBig;
use impinge_exact::{Contact, ElementPair, first_contact, touch};

use crate::generators::{Kind, Random};
use crate::grid::Grid;
use crate::oracle;

pub type Point = [f64; 3];

pub const PAIRS: [ElementPair; 4] = [
    ElementPair::VertexVertex,
    ElementPair::VertexEdge,
    ElementPair::VertexFace,
    ElementPair::EdgeEdge,
];

/// The corners of the difference polygon, by the definition of a pair.
pub fn corners(pair: ElementPair) -> &'static [[usize; 2]] {
    match pair {
        ElementPair::VertexVertex => &[[1, 0]],
        ElementPair::VertexEdge => &[[1, 0], [2, 0]],
        ElementPair::VertexFace => &[[1, 0], [2, 0], [3, 0]],
        ElementPair::EdgeEdge => &[[0, 2], [0, 3], [1, 2], [1, 3]],
    }
}

/// Floats as integers over one power of two.
pub fn integers_over(numbers: &[f64]) -> Vec<IBig> {
    let lowest = -1074;
    let integer = |x: &f64| {
        let bits = x.to_bits();
        let biased = (bits >> 52 & 0x7ff) as i32;
        let fraction = bits & ((1 << 52) - 1);
        let (mantissa, exponent) = match biased {
            0 => (fraction, -1074),
            _ => (fraction | 1 << 52, biased - 1075),
        };
        let magnitude = IBig::from(mantissa) << (exponent - lowest) as usize;
        if *x < 0.0 { -magnitude } else { magnitude }
    };
    let integers: Vec<IBig> = numbers.iter().map(integer).collect();
    let zeros = integers
        .iter()
        .filter(|x| **x != IBig::ZERO)
        .map(|x| x.trailing_zeros().unwrap())
        .min()
        .unwrap_or(0);
    integers.iter().map(|x| x >> zeros).collect()
}

fn integers(points: &[Point]) -> Vec<[IBig; 3]> {
    let numbers: Vec<f64> = points.iter().flatten().copied().collect();
    integers_over(&numbers)
        .chunks_exact(3)
        .map(|point| std::array::from_fn(|k| point[k].clone()))
        .collect()
}

fn expected(pair: ElementPair, start: &[Point; 4], end: &[Point; 4]) -> oracle::Moments {
    let all: Vec<Point> = start.iter().chain(end).copied().collect();
    let all = integers(&all);
    let polygon = |first: usize| -> Vec<[IBig; 3]> {
        corners(pair)
            .iter()
            .map(|&[i, j]| std::array::from_fn(|k| &all[first + i][k] - &all[first + j][k]))
            .collect()
    };
    oracle::contacts(&polygon(0), &polygon(4))
}

/// Compares an answer with the oracle's; returns whether there is contact after the start.
fn check(pair: ElementPair, start: &[Point; 4], end: &[Point; 4], note: &str) -> bool {
    let expected = expected(pair, start, end);
    let found = first_contact(pair, start, end);
    let case = || format!("{note} {pair:?} {start:?} {end:?} {found:?} {expected:?}");
    assert_eq!(touch(pair, start), expected.include_start(), "{}", case());
    let Some(Contact {
        time,
        is_exact,
        at_start,
    }) = found
    else {
        assert!(expected.is_empty(), "{}", case());
        return false;
    };
    assert!((0.0..=1.0).contains(&time), "{}", case());
    assert_eq!(at_start, expected.include_start(), "{}", case());
    let next = if time < 1.0 { time.next_up() } else { 2.0 };
    assert_eq!(
        expected.first_is_between(time, next),
        (true, is_exact),
        "{}",
        case()
    );
    !at_start
}

/// How the points of a lattice move.
#[derive(Clone, Copy, Debug)]
pub enum Motion {
    /// Each on its own.
    Free,
    /// All in one plane at all times: f is zero everywhere.
    Flat,
    /// All in one plane at the start and in another at the end.
    FlatAtEnds,
    /// All on one line.
    Line,
    /// Nothing moves.
    Still,
    /// One element stays, the other moves as a whole.
    Together,
    /// Two points start at one place.
    Coincident,
    /// Two points move as one, in one element or in both.
    Twins,
}

pub const MOTIONS: [Motion; 8] = [
    Motion::Free,
    Motion::Flat,
    Motion::FlatAtEnds,
    Motion::Line,
    Motion::Still,
    Motion::Together,
    Motion::Coincident,
    Motion::Twins,
];

pub fn step_on_lattice(motion: Motion, size: u64, random: &mut Random) -> [[Point; 4]; 2] {
    let mut points = || -> [Point; 4] { Kind::Lattice(size).points(random) };
    let [mut start, mut end] = [points(), points()];
    match motion {
        Motion::Free => {}
        Motion::Flat => {
            for point in start.iter_mut().chain(&mut end) {
                point[2] = point[0] + point[1];
            }
        }
        Motion::FlatAtEnds => {
            for (a, b) in start.iter_mut().zip(&mut end) {
                a[2] = 1.0;
                b[0] = b[1];
            }
        }
        Motion::Line => {
            for point in start.iter_mut().chain(&mut end) {
                *point = [point[0], 2.0 * point[0], -point[0]];
            }
        }
        Motion::Still => end = start,
        Motion::Together => {
            let by = end[0];
            end = start;
            for axis in 0..3 {
                end[0][axis] += by[axis] - size as f64 / 2.0;
            }
        }
        Motion::Coincident => start[1] = start[random.below(4) as usize],
        Motion::Twins => {
            let (i, j) = (random.below(4) as usize, random.below(4) as usize);
            (start[i], end[i]) = (start[j], end[j]);
        }
    }
    [start, end]
}

#[test]
fn lattices_agree_with_the_oracle() {
    let mut random = Random::new(12);
    for motion in MOTIONS {
        for pair in PAIRS {
            let (mut n_later, mut n_none) = (0, 0);
            for round in 0..N_CASES {
                let [start, end] = step_on_lattice(motion, 1 + round % 6, &mut random);
                if check(pair, &start, &end, &format!("{motion:?}")) {
                    n_later += 1;
                } else {
                    n_none += 1;
                }
            }
            assert!(n_none > 0, "{motion:?} {pair:?}");
            let meet_rarely = matches!(pair, ElementPair::VertexVertex | ElementPair::VertexEdge);
            let never_later = matches!(motion, Motion::Still) || meet_rarely;
            assert!(n_later > 2 || never_later, "{motion:?} {pair:?}: {n_later}");
        }
    }
}

const N_CASES: u64 = 150;

/// Layers of cloth of which one moves against the other as a whole: down, aside, both, or within
/// its plane. Edges are parallel, faces coplanar, and vertices meet edges and vertices.
#[test]
fn layers_that_move_as_a_whole_agree_with_the_oracle() {
    let mut random = Random::new(35);
    for grid in Grid::ALL {
        for pair in PAIRS {
            let (mut n_later, mut n_none) = (0, 0);
            for round in 0..120 {
                let points = grid.points(pair, &mut random);
                let n_moving = if pair == ElementPair::EdgeEdge { 2 } else { 1 };
                // Onto a point of the other element, or past it, or not so far; every third time a
                // bit aside.
                let n_targets = corners(pair).len() / n_moving;
                let target = points[n_moving + random.below(n_targets as u64) as usize];
                let far = [1.0, 2.0, 1.25, 0.5][random.below(4) as usize];
                let size = grid.vertex([2, 0], 0)[0] - grid.vertex([0, 0], 0)[0];
                let by: [f64; 3] = std::array::from_fn(|axis| {
                    let aside = if round % 3 == 0 {
                        random.below(21) as f64 / 20.0
                    } else {
                        0.0
                    };
                    // Exact sums for grids of `f32`, so the element does not turn. Those of `f64`
                    // round some.
                    f64::from((far * (target[axis] - points[0][axis]) + aside * size) as f32)
                });
                let mut end = points;
                for point in &mut end[..n_moving] {
                    *point = std::array::from_fn(|axis| point[axis] + by[axis]);
                }
                if check(pair, &points, &end, &format!("{grid:?}")) {
                    n_later += 1;
                } else {
                    n_none += 1;
                }
            }
            assert!(n_none > 0 && n_later > 2, "{grid:?} {pair:?} {n_later}");
        }
    }
}

/// The oracle is slow for kinds with numbers of very different size.
#[test]
fn numbers_of_every_kind_agree_with_the_oracle() {
    let mut random = Random::new(13);
    for kind in Kind::ALL {
        let n = match kind {
            Kind::AnyF32 | Kind::Palette => 6,
            kind if kind.is_wide() => 3,
            _ => 25,
        };
        for pair in PAIRS {
            for _ in 0..n {
                let points = kind.points::<8>(&mut random);
                let start = std::array::from_fn(|ix| points[ix]);
                let end = std::array::from_fn(|ix| points[4 + ix]);
                check(pair, &start, &end, &format!("{kind:?}"));
            }
        }
    }
}

/// The same question asked in other ways.
#[test]
fn twins_agree() {
    let mut random = Random::new(14);
    for round in 0..3000 {
        let motion = MOTIONS[round % MOTIONS.len()];
        let [start, end] = step_on_lattice(motion, 1 + round as u64 % 5, &mut random);
        for pair in PAIRS {
            let found = first_contact(pair, &start, &end);
            let same = |what: &str, order: [usize; 4]| {
                let twin = [&start, &end].map(|points| order.map(|ix| points[ix]));
                let answer = first_contact(pair, &twin[0], &twin[1]);
                assert_eq!(answer, found, "{what} {pair:?} {start:?} {end:?}");
            };
            match pair {
                ElementPair::VertexVertex => same("swapped", [1, 0, 2, 3]),
                ElementPair::VertexEdge => same("turned edge", [0, 2, 1, 3]),
                ElementPair::VertexFace => {
                    same("turned face", [0, 2, 3, 1]);
                    same("mirrored face", [0, 1, 3, 2]);
                }
                ElementPair::EdgeEdge => {
                    same("swapped", [2, 3, 0, 1]);
                    same("turned edge", [1, 0, 2, 3]);
                    same("both turned", [1, 0, 3, 2]);
                }
            }
            // Moving or scaling everything changes nothing, even with another shift at the end than
            // at the start.
            let moved = |by: f64, scale: f64, points: &[Point; 4]| {
                points.map(|point| point.map(|x| (x + by) * scale))
            };
            let scale = 2.0_f64.powi(random.below(400) as i32 - 200);
            let answer = first_contact(pair, &moved(4.0, scale, &start), &moved(-9.0, scale, &end));
            assert_eq!(answer, found, "moved {pair:?} {start:?} {end:?}");
            // Backwards there is contact if and only if there is forwards.
            let back = first_contact(pair, &end, &start);
            assert_eq!(
                back.is_some(),
                found.is_some(),
                "{pair:?} {start:?} {end:?}"
            );
            // In two halves: the first half has the contact if the contact is no later than the
            // middle.
            let middle: [Point; 4] = std::array::from_fn(|ix| {
                std::array::from_fn(|axis| (start[ix][axis] + end[ix][axis]) / 2.0)
            });
            let halves = [
                first_contact(pair, &start, &middle),
                first_contact(pair, &middle, &end),
            ];
            let in_time = found.filter(|contact| contact.is_within(0.5));
            assert_eq!(
                halves[0].map(|half| half.time / 2.0),
                in_time.map(|whole| whole.time)
            );
            assert_eq!(halves[0].or(halves[1]).is_some(), found.is_some());
            if let (None, Some(second)) = (halves[0], halves[1]) {
                let whole = 0.5 + second.time / 2.0;
                assert!((found.unwrap().time - whole).abs() <= f64::EPSILON / 2.0);
            }
        }
    }
}

#[test]
fn times_are_rounded_down() {
    let at = |z: f64| {
        [
            [0.25, 0.25, z],
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
        ]
    };
    let vertex_face =
        |from: f64, to: f64| first_contact(ElementPair::VertexFace, &at(from), &at(to)).unwrap();
    // 1 / (1 + 2): the nearest f64 is below, the nearest f32 above.
    let third = vertex_face(1.0, -2.0);
    assert_eq!(third.time, 1.0_f64 / 3.0);
    assert_eq!(third.time_f32(), (1.0_f32 / 3.0).next_down());
    assert!(!third.is_exact && third.is_within(0.34) && !third.is_within(third.time));
    // Times that are floats.
    let half = vertex_face(1.0, -1.0);
    assert!(half.is_exact && half.time == 0.5 && half.is_within(0.5));
    assert!(vertex_face(1.0, 0.0).is_exact && vertex_face(1.0, 0.0).time == 1.0);
    // A time below the smallest `f32` rounds down to zero, though the two do not touch at the
    // start.
    let tiny = f64::from(f32::from_bits(1));
    let early = vertex_face(tiny, -f64::from(f32::MAX));
    assert!(early.time > 0.0 && early.time_f32() == 0.0 && !early.at_start);
    let largest = f64::MAX;
    let earliest = vertex_face(1e-15, -largest);
    assert!(earliest.time == f64::from_bits(1) && !earliest.at_start);
    // Below the smallest positive number.
    let earliest = vertex_face(f64::from_bits(1), -largest);
    assert!(earliest.time == 0.0 && !earliest.is_exact && !earliest.at_start);
    let start = vertex_face(0.0, -largest);
    assert!(start.time == 0.0 && start.is_exact && start.at_start);
}
