//! The filters' answers compared with those of exact signs. The signs themselves are compared with
//! an independent oracle in `tests/exact`.

use super::Point;
use super::filter::{
    self, BATCH, LANES, TABLE, TetrahedronPairs8, TrianglePairs8, Triangles8, Triangles64, Verdict,
    Verdict16, number, shared_edge, shared_vertex, tetrahedra_answer, triangles_answer,
};
use super::tetrahedron::tetrahedra_intersect_by_signs;
use super::triangle::triangles_intersect_by_signs;
use super::{tetrahedra_intersect_beyond_shared, triangles_intersect_beyond_shared};
use impinge_testing::random::Random;

impl TrianglePairs8 {
    /// Puts a pair into a lane.
    fn set(&mut self, lane: usize, a: &[Point; 3], b: &[Point; 3]) {
        for vertex in 0..3 {
            for axis in 0..3 {
                self.a[vertex][axis][lane] = a[vertex][axis];
                self.b[vertex][axis][lane] = b[vertex][axis];
            }
        }
    }

    /// The pair of a lane.
    fn get(&self, lane: usize) -> ([Point; 3], [Point; 3]) {
        (lane_of(&self.a, lane), lane_of(&self.b, lane))
    }
}

fn lane_of(triangles: &Triangles8, lane: usize) -> [Point; 3] {
    std::array::from_fn(|vertex| std::array::from_fn(|axis| triangles[vertex][axis][lane]))
}

/// Defines a function that asks a generic one on all instruction sets of this processor, whose
/// answers must be the same.
macro_rules! on_all {
    (f64: $($rest:tt)*) => { on_all!([Portable, Avx2, Avx512] $($rest)*); };
    (f32: $($rest:tt)*) => { on_all!([Portable32, Avx2F32, Avx512F32] $($rest)*); };
    (
        [$portable:ident, $avx2:ident, $avx512:ident]
        fn $name:ident($($arg:ident: $type:ty),*) -> $answer:ty = $($asked:ident)::+
    ) => {
        fn $name($($arg: $type),*) -> $answer {
            use crate::filter::number;
            let answer = $($asked)::+::<number::$portable>($($arg),*);
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2($($arg: $type),*) -> $answer {
                    $($asked)::+::<number::$avx2>($($arg),*)
                }
                #[target_feature(enable = "avx512f,avx512dq")]
                fn avx512($($arg: $type),*) -> $answer {
                    $($asked)::+::<number::$avx512>($($arg),*)
                }
                if is_x86_feature_detected!("avx2") {
                    // SAFETY: just detected.
                    assert_eq!(answer, unsafe { avx2($($arg),*) });
                }
                if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
                    // SAFETY: just detected.
                    assert_eq!(answer, unsafe { avx512($($arg),*) });
                }
            }
            answer
        }
    };
}
pub(crate) use on_all;

on_all!(f64: fn classify(pairs: &TrianglePairs8) -> Verdict = filter::classify);
on_all!(f64: fn reject_by_planes(pairs: &TrianglePairs8) -> u8 = filter::reject_by_planes);
on_all!(
    f64: fn classify_by_faces(pairs: &TetrahedronPairs8) -> Verdict = filter::classify_by_faces
);
on_all!(
    f64: fn classify_tetrahedra(pairs: &TetrahedronPairs8) -> Verdict = filter::classify_tetrahedra
);
on_all!(f32: fn classify_in_tables(pairs: &InTables) -> Verdict16 = InTables::classify);

/// Two groups of triangles in f32, and the slots of a batch of pairs.
struct InTables {
    tables: [Triangles64; 2],
    slots: [[u8; BATCH]; 2],
}

impl InTables {
    /// Two groups from a generator, and random slots.
    fn new(random: &mut Random, mut triangle: impl FnMut(&mut Random) -> [Point; 3]) -> Self {
        let mut tables = [[[[0.0f32; TABLE]; 3]; 3]; 2];
        for table in &mut tables {
            for slot in 0..TABLE {
                for (corner, point) in table.iter_mut().zip(triangle(random)) {
                    for (row, x) in corner.iter_mut().zip(point) {
                        row[slot] = x as f32;
                    }
                }
            }
        }
        let slots = [(); 2].map(|()| [(); BATCH].map(|()| (random.bits() % TABLE as u64) as u8));
        InTables { tables, slots }
    }

    /// The triangles of a pair.
    fn get(&self, lane: usize) -> [[Point; 3]; 2] {
        std::array::from_fn(|side| {
            let slot = usize::from(self.slots[side][lane]);
            self.tables[side].map(|corner| corner.map(|row| f64::from(row[slot])))
        })
    }

    fn classify<V: number::Lookup>(&self) -> Verdict16 {
        let InTables { tables, slots } = self;
        let (tables, slots) = ([&tables[0], &tables[1]], [&slots[0], &slots[1]]);
        filter::classify_in_tables::<V>(tables, slots, u16::MAX)
    }
}

/// Compares the answers of the filter in f32 with the truth, for many batches. Returns how many
/// pairs it settled, and how many of these intersect.
fn check_in_tables(
    random: &mut Random,
    n_batches: u32,
    mut triangle: impl FnMut(&mut Random) -> [Point; 3],
) -> (u32, u32) {
    let (mut n_settled, mut n_yes) = (0, 0);
    for _ in 0..n_batches {
        let pairs = InTables::new(random, &mut triangle);
        let Verdict16 { yes, no } = classify_in_tables(&pairs);
        assert_eq!(yes & no, 0, "a lane with both answers");
        for lane in 0..BATCH {
            let [a, b] = pairs.get(lane);
            let wrong = if triangles_intersect_by_signs(&a, &b) {
                no
            } else {
                yes
            };
            assert_eq!(wrong >> lane & 1, 0, "the filter is wrong: {a:?} {b:?}");
        }
        n_settled += (yes | no).count_ones();
        n_yes += yes.count_ones();
    }
    (n_settled, n_yes)
}

/// The answer for one pair, put into every lane of a batch; `None` when unsure.
fn in_all_lanes(
    classify: fn(&TetrahedronPairs8) -> Verdict,
    a: &[Point; 4],
    b: &[Point; 4],
) -> Option<bool> {
    let mut pairs = TetrahedronPairs8::default();
    for lane in 0..LANES {
        for vertex in 0..4 {
            for axis in 0..3 {
                pairs.a[vertex][axis][lane] = a[vertex][axis];
                pairs.b[vertex][axis][lane] = b[vertex][axis];
            }
        }
    }
    match classify(&pairs) {
        Verdict { yes: 0xff, no: 0 } => Some(true),
        Verdict { yes: 0, no: 0xff } => Some(false),
        Verdict { yes: 0, no: 0 } => None,
        verdict => panic!("lanes differ: {verdict:?}"),
    }
}

/// Random points in the unit cube.
fn plain<const N: usize>(random: &mut Random) -> [Point; N] {
    [(); N].map(|()| [(); 3].map(|()| random.unit().into()))
}

/// Points that make many determinants zero, or nearly zero.
fn troublesome<const N: usize>(random: &mut Random) -> [Point; N] {
    let kind = random.bits() % 6;
    let far = [0.0, 1e6, 1e30][(random.bits() % 3) as usize];
    // A lattice of one plane in no special position; in `f32` nearly so.
    let n_bits = [20, 50][(random.bits() % 2) as usize];
    let axes = [(); 2].map(|()| [(); 3].map(|()| (random.bits() >> (64 - n_bits)) as f64));
    [(); N].map(|()| {
        let steps = [(); 2].map(|()| (random.bits() % 4) as f64);
        std::array::from_fn(|axis| {
            let bits = random.bits();
            let x = (bits % 3) as f64;
            let ulps = ((bits >> 32) % 3) as f64;
            match kind {
                0 => x,
                1 => x * 0.1 + f64::EPSILON * ulps,
                2 => x * 0.1 + f64::from(f32::EPSILON) / 16.0 * ulps,
                3 => x + far * ((bits >> 16) % 2) as f64,
                4 => steps[0] * axes[0][axis] + steps[1] * axes[1][axis],
                _ => loop {
                    let any = f32::from_bits(random.bits() as u32);
                    if any.is_finite() {
                        break f64::from(any);
                    }
                },
            }
        })
    })
}

/// Compares a verdict with the truth, lane by lane; returns the number of settled lanes.
fn check(yes: u8, no: u8, truth: &[bool; LANES], say: impl Fn(usize) -> String) -> u32 {
    assert_eq!(yes & no, 0, "a lane with both answers");
    for (lane, &truth) in truth.iter().enumerate() {
        let wrong = if truth { no } else { yes };
        assert_eq!(wrong >> lane & 1, 0, "the filter is wrong: {}", say(lane));
    }
    (yes | no).count_ones()
}

/// A batch of pairs from a generator, with the truth of each.
fn triangle_batch(
    mut pair: impl FnMut() -> ([Point; 3], [Point; 3]),
    truth: impl Fn(&[Point; 3], &[Point; 3]) -> bool,
) -> (TrianglePairs8, [bool; LANES]) {
    let mut pairs = TrianglePairs8::default();
    let truth = std::array::from_fn(|lane| {
        let (a, b) = pair();
        pairs.set(lane, &a, &b);
        assert_eq!(pairs.get(lane), (a, b));
        truth(&a, &b)
    });
    (pairs, truth)
}

#[test]
fn filter_settles_random_triangles_and_is_right() {
    let mut random = Random::new(1);
    let (mut n_settled, mut n_rejected, mut n_yes) = (0, 0, 0);
    let n_batches = 2000;
    for _ in 0..n_batches {
        let (pairs, truth) = triangle_batch(
            || (plain(&mut random), plain(&mut random)),
            triangles_intersect_by_signs,
        );
        let say = |lane| format!("{:?}", pairs.get(lane));
        let verdict = classify(&pairs);
        n_settled += check(verdict.yes, verdict.no, &truth, say);
        n_yes += verdict.yes.count_ones();
        let apart = reject_by_planes(&pairs);
        n_rejected += check(0, apart, &truth, say);
        assert_eq!(
            apart & verdict.no,
            apart,
            "classify knows less than its first step"
        );
        for lane in 0..LANES {
            let (a, b) = pairs.get(lane);
            let expected = match (verdict.yes >> lane & 1, verdict.no >> lane & 1) {
                (1, _) => Some(true),
                (_, 1) => Some(false),
                _ => None,
            };
            assert_eq!(triangles_answer(&a, &b), expected);
        }
    }
    let n = n_batches * LANES as u32;
    assert!(
        n_settled * 1000 > n * 999,
        "only {n_settled} of {n} settled"
    );
    assert!(
        n_rejected > n / 4 && n_yes > n / 20,
        "{n_rejected} rejected, {n_yes} meet"
    );
}

#[test]
fn filter_is_never_wrong_on_troublesome_triangles() {
    let mut random = Random::new(2);
    let mut n_settled = 0;
    let n_batches = 10_000;
    for _ in 0..n_batches {
        let (pairs, truth) = triangle_batch(
            || {
                let [a, b, c, d, e, f] = troublesome(&mut random);
                ([a, b, c], [d, e, f])
            },
            triangles_intersect_by_signs,
        );
        let say = |lane| format!("{:?}", pairs.get(lane));
        let verdict = classify(&pairs);
        n_settled += check(verdict.yes, verdict.no, &truth, say);
        check(0, reject_by_planes(&pairs), &truth, say);
    }
    let n = n_batches * LANES as u32;
    assert!(
        n_settled > n / 10 && n_settled < n,
        "{n_settled} of {n} settled"
    );
}

#[test]
fn filter_in_f32_settles_random_triangles_and_is_right() {
    let mut random = Random::new(11);
    // The largest coordinates, the usual ones, and some whose determinants nearly underflow.
    for (scale, share_settled) in [(2.0f64.powi(24), 95), (1.0, 95), (2.0f64.powi(-18), 80)] {
        let scaled = |point: Point| point.map(|x| x * scale);
        let (n_settled, n_yes) =
            check_in_tables(&mut random, 1000, |random| plain(random).map(scaled));
        let n = 1000 * BATCH as u32;
        assert!(
            n_settled * 100 > n * share_settled && n_yes > n / 20,
            "scale {scale}: {n_settled} of {n} settled, {n_yes} meet"
        );
    }
    // Where everything underflows, every pair is unsure.
    let scale = 2.0f64.powi(-120);
    let tiny = |random: &mut Random| plain(random).map(|point| point.map(|x| x * scale));
    assert_eq!(check_in_tables(&mut random, 100, tiny), (0, 0));
}

#[test]
fn filter_in_f32_is_never_wrong_on_troublesome_triangles() {
    let mut random = Random::new(12);
    let within = |point: Point| {
        let largest = f64::from(filter::LARGEST_F32);
        point.map(|x| x.clamp(-largest, largest))
    };
    let n_batches = 3000;
    let (n_settled, _) = check_in_tables(&mut random, n_batches, |random| {
        troublesome(random).map(within)
    });
    let n = n_batches * BATCH as u32;
    assert!(
        n_settled > n / 20 && n_settled < n,
        "{n_settled} of {n} settled"
    );
    // Nearly coplanar, nearly touching: corners a few units in the last place from a lattice.
    let (n_settled, n_yes) = check_in_tables(&mut random, n_batches, |random| {
        [(); 3].map(|()| {
            [(); 3].map(|()| {
                let bits = random.bits();
                let x = (bits % 4) as f32 * 0.1 + 1.0;
                f64::from(f32::from_bits(x.to_bits() + (bits >> 32) as u32 % 8))
            })
        })
    });
    assert!(
        n_yes > 100 && n_settled < n,
        "{n_settled} settled, {n_yes} meet"
    );
}

#[test]
fn filter_is_right_on_triangles_that_share_a_vertex_or_an_edge() {
    let mut random = Random::new(3);
    let n_batches = 4000;
    for is_troublesome in [false, true] {
        let (mut n_vertex, mut n_edge, mut n_yes) = (0, 0, 0);
        for _ in 0..n_batches {
            let mut points = || -> [Point; 5] {
                if is_troublesome {
                    troublesome(&mut random)
                } else {
                    plain(&mut random)
                }
            };
            let (pairs, truth) = triangle_batch(
                || {
                    let [v, a, b, c, d] = points();
                    ([v, a, b], [v, c, d])
                },
                beyond_vertex_by_signs,
            );
            let say = |lane| format!("{:?}", pairs.get(lane));
            let (mut yes, mut no) = (0, 0);
            for lane in 0..LANES {
                let (a, b) = pairs.get(lane);
                let (meet, miss) = shared_vertex(&a[0], [&a[1], &a[2]], [&b[1], &b[2]]);
                yes |= u8::from(meet) << lane;
                no |= u8::from(miss) << lane;
            }
            n_vertex += check(yes, no, &truth, say);
            n_yes += yes.count_ones();
            let (pairs, truth) = triangle_batch(
                || {
                    let [u, v, a, b, _] = points();
                    ([u, v, a], [v, u, b])
                },
                |a, b| triangles_intersect_beyond_shared(a, [0, 1, 2], b, [1, 0, 3]),
            );
            let say = |lane| format!("{:?}", pairs.get(lane));
            let no = (0..LANES).fold(0, |no, lane| {
                let (a, b) = pairs.get(lane);
                no | u8::from(shared_edge(&a[0], &a[1], &a[2], &b[2])) << lane
            });
            n_edge += check(0, no, &truth, say);
        }
        let n = n_batches * LANES as u32;
        assert!(n_yes > n / 200, "{n_yes} of {n} meet");
        if !is_troublesome {
            assert!(n_vertex * 1000 > n * 999, "only {n_vertex} of {n} settled");
            assert!(n_edge * 1000 > n * 999, "only {n_edge} of {n} settled");
        }
    }
}

/// Whether two triangles meet beyond their shared vertex 0, without any filter: each is given as a
/// flat tetrahedron that repeats the triangle's last point.
fn beyond_vertex_by_signs(a: &[Point; 3], b: &[Point; 3]) -> bool {
    let flat = |t: &[Point; 3]| [t[0], t[1], t[2], t[2]];
    tetrahedra_intersect_beyond_shared(&flat(a), [0, 1, 2, 3], &flat(b), [0, 4, 5, 6])
}

#[test]
fn filter_settles_random_tetrahedra_and_is_right() {
    let mut random = Random::new(4);
    let (mut n_settled, mut n_by_faces, mut n_by_edges, mut n_yes) = (0, 0, 0, 0);
    let n = 4000;
    for _ in 0..n {
        let (a, mut b) = (plain(&mut random), plain(&mut random));
        b.iter_mut().for_each(|point: &mut Point| point[0] += 0.3);
        let truth = tetrahedra_intersect_by_signs(&a, &b);
        let answer = tetrahedra_answer(&a, &b);
        n_settled += u32::from(answer.is_some());
        let by_faces = in_all_lanes(classify_by_faces, &a, &b);
        n_by_faces += u32::from(by_faces.is_some());
        assert!(by_faces.is_none_or(|answer| answer == truth), "{a:?} {b:?}");
        let by_edges = in_all_lanes(classify_tetrahedra, &a, &b);
        n_by_edges += u32::from(by_edges.is_some());
        assert!(by_edges.is_none_or(|answer| answer == truth), "{a:?} {b:?}");
        n_yes += u32::from(truth);
        assert!(answer.is_none_or(|answer| answer == truth), "{a:?} {b:?}");
    }
    assert!(
        n_settled * 1000 > n * 999,
        "only {n_settled} of {n} settled"
    );
    assert!(
        n_by_faces > n / 3,
        "only {n_by_faces} of {n} settled by faces"
    );
    assert!(
        n_by_edges * 1000 > n * 999,
        "only {n_by_edges} of {n} settled by faces and edges"
    );
    assert!(n_yes > n / 10 && n_yes < n * 9 / 10, "{n_yes} of {n} meet");
}

#[test]
fn filter_is_never_wrong_on_troublesome_tetrahedra() {
    let mut random = Random::new(5);
    let mut n_settled = 0;
    for _ in 0..20_000 {
        let [a, b, c, d, e, f, g, h] = troublesome(&mut random);
        let (a, b) = ([a, b, c, d], [e, f, g, h]);
        for classify in [classify_by_faces, classify_tetrahedra] {
            if let Some(answer) = in_all_lanes(classify, &a, &b) {
                assert_eq!(answer, tetrahedra_intersect_by_signs(&a, &b), "{a:?} {b:?}");
            }
        }
        if let Some(answer) = tetrahedra_answer(&a, &b) {
            assert_eq!(answer, tetrahedra_intersect_by_signs(&a, &b), "{a:?} {b:?}");
            n_settled += 1;
        }
    }
    assert!(n_settled > 1000, "{n_settled} settled");
}

/// NaN and infinity are outside the promised range: their lanes are unsure, and nothing panics.
#[test]
fn filter_is_unsure_of_nan_and_overflow() {
    let good: [Point; 3] = [[0.0, 0.0, -1.0], [0.1, 0.0, 1.0], [0.0, 0.1, 1.0]];
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for lane in 0..LANES {
            for vertex in 0..3 {
                for axis in 0..3 {
                    let mut pairs = TrianglePairs8::default();
                    let mut broken: [Point; 3] =
                        [[-1.0, -1.0, 0.0], [2.0, -1.0, 0.0], [0.0, 2.0, 0.0]];
                    broken[vertex][axis] = bad;
                    pairs.set(lane, &broken, &good);
                    assert_eq!(classify(&pairs), Verdict::default());
                    assert_eq!(reject_by_planes(&pairs), 0);
                }
            }
        }
    }
}
