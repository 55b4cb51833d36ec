//! The exact predicates against an oracle in integer arithmetic, on every kind of trouble, and
//! against published cases.

mod generators;
mod oracle;
mod published;

use generators::{Kind, Random};
use impinge_exact::{
    Sign, orient2d, orient3d, tetrahedra_intersect, tetrahedra_intersect_beyond_shared,
    triangle_tetrahedron_intersect, triangle_tetrahedron_intersect_beyond_shared,
    triangles_intersect, triangles_intersect_beyond_shared,
};

/// How many cases of a kind a test tries; big integers make the wide kinds slow.
fn n_cases(kind: Kind, n: usize) -> usize {
    match kind {
        Kind::Lattice(_) => 6 * n,
        _ if kind.is_wide() => n / 3,
        _ => n,
    }
}

fn permuted<T: Copy, const N: usize>(values: &[T; N], random: &mut Random) -> [T; N] {
    random.permutation().map(|ix| values[ix])
}

/// Two elements cut from one array of points.
fn cut<const N: usize, const M: usize>(points: &[[f64; 3]]) -> ([[f64; 3]; N], [[f64; 3]; M]) {
    (
        points[..N].try_into().expect("N points"),
        points[N..N + M].try_into().expect("M points"),
    )
}

/// Counts answers, so that a test can show that it saw both.
#[derive(Default)]
struct Seen {
    n_yes: usize,
    n_no: usize,
}

impl Seen {
    fn count(&mut self, answer: bool) {
        if answer {
            self.n_yes += 1;
        } else {
            self.n_no += 1;
        }
    }

    fn assert_both(&self, kind: Kind) {
        assert!(
            self.n_yes > 3 && self.n_no > 3,
            "{kind:?} is a one-sided test: {} yes, {} no",
            self.n_yes,
            self.n_no
        );
    }
}

#[test]
fn triangle_pairs_agree_with_the_oracle() {
    let mut random = Random::new(1);
    for kind in Kind::ALL {
        let mut seen = Seen::default();
        for _ in 0..n_cases(kind, 600) {
            let (a, b) = cut::<3, 3>(&kind.points::<6>(&mut random));
            let expected = oracle::intersect(&a, &b);
            seen.count(expected);
            assert_eq!(
                triangles_intersect(&a, &b),
                expected,
                "{kind:?} {a:?} {b:?}"
            );
            assert_eq!(
                triangles_intersect(&b, &a),
                expected,
                "swapped {kind:?} {a:?} {b:?}"
            );
            for _ in 0..4 {
                let (a, b) = (permuted(&a, &mut random), permuted(&b, &mut random));
                assert_eq!(
                    triangles_intersect(&a, &b),
                    expected,
                    "{kind:?} {a:?} {b:?}"
                );
            }
        }
        seen.assert_both(kind);
    }
}

#[test]
fn tetrahedron_pairs_agree_with_the_oracle() {
    let mut random = Random::new(2);
    for kind in Kind::ALL {
        let mut seen = Seen::default();
        for _ in 0..n_cases(kind, 100) {
            let (a, b) = cut::<4, 4>(&kind.points::<8>(&mut random));
            let expected = oracle::intersect(&a, &b);
            seen.count(expected);
            assert_eq!(
                tetrahedra_intersect(&a, &b),
                expected,
                "{kind:?} {a:?} {b:?}"
            );
            assert_eq!(
                tetrahedra_intersect(&b, &a),
                expected,
                "swapped {kind:?} {a:?} {b:?}"
            );
            let (a, b) = (permuted(&a, &mut random), permuted(&b, &mut random));
            assert_eq!(
                tetrahedra_intersect(&a, &b),
                expected,
                "{kind:?} {a:?} {b:?}"
            );
        }
        seen.assert_both(kind);
    }
}

#[test]
fn mixed_pairs_agree_with_the_oracle() {
    let mut random = Random::new(3);
    for kind in Kind::ALL {
        let mut seen = Seen::default();
        for _ in 0..n_cases(kind, 150) {
            let (t, k) = cut::<3, 4>(&kind.points::<7>(&mut random));
            let expected = oracle::intersect(&t, &k);
            seen.count(expected);
            assert_eq!(
                triangle_tetrahedron_intersect(&t, &k),
                expected,
                "{kind:?} {t:?} {k:?}"
            );
            let (t, k) = (permuted(&t, &mut random), permuted(&k, &mut random));
            assert_eq!(
                triangle_tetrahedron_intersect(&t, &k),
                expected,
                "{kind:?} {t:?} {k:?}"
            );
        }
        seen.assert_both(kind);
    }
}

/// Flat and thin tetrahedra are rare at random: here both lie in few planes.
#[test]
fn flat_tetrahedra_agree_with_the_oracle() {
    let mut random = Random::new(4);
    let mut seen = Seen::default();
    for _ in 0..1500 {
        let mut points = Kind::Lattice(3).points::<8>(&mut random);
        let flatten = random.below(4) as usize;
        for point in &mut points[..4] {
            point[flatten % 3] = 1.0;
        }
        if flatten == 3 {
            for point in &mut points[4..] {
                point[1] = 1.0;
                point[2] = point[0];
            }
        }
        let (a, b) = cut::<4, 4>(&points);
        let expected = oracle::intersect(&a, &b);
        seen.count(expected);
        assert_eq!(tetrahedra_intersect(&a, &b), expected, "{a:?} {b:?}");
        assert_eq!(tetrahedra_intersect(&b, &a), expected, "{b:?} {a:?}");
    }
    seen.assert_both(Kind::Lattice(3));
}

/// Ids of two elements over a pool of `n_ids` points, often repeated within an element when
/// `repeat` is set.
fn random_ids<const N: usize>(random: &mut Random, n_ids: u64, repeat: bool) -> [u32; N] {
    loop {
        let ids: [u32; N] = [(); N].map(|()| random.below(n_ids) as u32);
        let distinct = (1..N).all(|ix| !ids[..ix].contains(&ids[ix]));
        if distinct || repeat {
            return ids;
        }
    }
}

/// Positions and ids of two elements.
type SharedCase<const N: usize, const M: usize> =
    ([[f64; 3]; N], [u32; N], [[f64; 3]; M], [u32; M]);

fn shared_case<const N: usize, const M: usize>(
    random: &mut Random,
    kind: Kind,
) -> SharedCase<N, M> {
    let pool = kind.points::<8>(random);
    let n_ids = (N.max(M) as u64 + 1) + random.below(3);
    let repeat = random.below(8) == 0;
    let (ids_a, ids_b) = (
        random_ids::<N>(random, n_ids, repeat),
        random_ids::<M>(random, n_ids, repeat),
    );
    let at = |id: u32| pool[id as usize];
    (ids_a.map(at), ids_a, ids_b.map(at), ids_b)
}

#[test]
fn neighbouring_triangles_agree_with_the_oracle() {
    let mut random = Random::new(5);
    for kind in Kind::ALL {
        let mut seen = Seen::default();
        for _ in 0..n_cases(kind, 500) {
            let (a, ids_a, b, ids_b) = shared_case::<3, 3>(&mut random, kind);
            let expected = oracle::intersect_beyond_shared(&a, &ids_a, &b, &ids_b);
            seen.count(expected);
            let say = || format!("{kind:?} {a:?} {ids_a:?} {b:?} {ids_b:?}");
            assert_eq!(
                triangles_intersect_beyond_shared(&a, ids_a, &b, ids_b),
                expected,
                "{}",
                say()
            );
            assert_eq!(
                triangles_intersect_beyond_shared(&b, ids_b, &a, ids_a),
                expected,
                "{}",
                say()
            );
        }
        seen.assert_both(kind);
    }
}

#[test]
fn neighbouring_tetrahedra_agree_with_the_oracle() {
    let mut random = Random::new(6);
    for kind in Kind::ALL {
        let mut seen = Seen::default();
        for _ in 0..n_cases(kind, 150) {
            let (a, ids_a, b, ids_b) = shared_case::<4, 4>(&mut random, kind);
            let expected = oracle::intersect_beyond_shared(&a, &ids_a, &b, &ids_b);
            seen.count(expected);
            let say = || format!("{kind:?} {a:?} {ids_a:?} {b:?} {ids_b:?}");
            assert_eq!(
                tetrahedra_intersect_beyond_shared(&a, ids_a, &b, ids_b),
                expected,
                "{}",
                say()
            );
            assert_eq!(
                tetrahedra_intersect_beyond_shared(&b, ids_b, &a, ids_a),
                expected,
                "{}",
                say()
            );
        }
        seen.assert_both(kind);
    }
}

/// Two flat tetrahedra in different planes, or on one line, that share the edge where they meet.
/// The answer depends on how far each extends along the line of the edge.
#[test]
fn flat_tetrahedra_that_share_an_edge_agree_with_the_oracle() {
    let mut random = Random::new(11);
    let mut seen = Seen::default();
    for _ in 0..3000 {
        let mut points = Kind::Lattice(4).points::<6>(&mut random);
        let [u, v, p, q, r, s] = &mut points;
        for point in [&mut *u, v] {
            (point[1], point[2]) = (2.0, 2.0);
        }
        for point in [p, q] {
            point[2] = 2.0;
        }
        for point in [r, s] {
            point[1] = 2.0;
        }
        let at = |ids: [u32; 4]| ids.map(|id| points[id as usize]);
        let (ids_a, ids_b) = ([0, 1, 2, 3], [1, 4, 0, 5]);
        let (a, b) = (at(ids_a), at(ids_b));
        let expected = oracle::intersect_beyond_shared(&a, &ids_a, &b, &ids_b);
        seen.count(expected);
        assert_eq!(
            tetrahedra_intersect_beyond_shared(&a, ids_a, &b, ids_b),
            expected,
            "{points:?}"
        );
        assert_eq!(
            tetrahedra_intersect_beyond_shared(&b, ids_b, &a, ids_a),
            expected,
            "{points:?}"
        );
    }
    seen.assert_both(Kind::Lattice(4));
}

#[test]
fn neighbours_of_two_kinds_agree_with_the_oracle() {
    let mut random = Random::new(7);
    for kind in [
        Kind::Lattice(1),
        Kind::Lattice(2),
        Kind::Skewed(1),
        Kind::Palette,
        Kind::Plain,
    ] {
        for _ in 0..n_cases(kind, 300) {
            let (t, ids_t, k, ids_k) = shared_case::<3, 4>(&mut random, kind);
            assert_eq!(
                triangle_tetrahedron_intersect_beyond_shared(&t, ids_t, &k, ids_k),
                oracle::intersect_beyond_shared(&t, &ids_t, &k, &ids_k),
                "{kind:?} {t:?} {ids_t:?} {k:?} {ids_k:?}"
            );
        }
    }
}

/// The usual rules for shared vertices, on triangles that are not degenerate.
#[test]
fn neighbouring_triangles_follow_the_usual_rules() {
    let mut random = Random::new(8);
    let mut n_by_shared = [0; 4];
    for _ in 0..20_000 {
        let (a, ids_a, b, ids_b) = shared_case::<3, 3>(&mut random, Kind::Lattice(2));
        let degenerate = |t: &[[f64; 3]; 3]| {
            [[0, 1], [1, 2], [2, 0]].iter().all(|&[i, j]| {
                orient2d([t[0][i], t[0][j]], [t[1][i], t[1][j]], [t[2][i], t[2][j]]) == Sign::Zero
            })
        };
        if degenerate(&a) || degenerate(&b) {
            continue;
        }
        let shared: Vec<u32> = ids_a.into_iter().filter(|id| ids_b.contains(id)).collect();
        n_by_shared[shared.len()] += 1;
        let expected = match shared[..] {
            [] => triangles_intersect(&a, &b),
            [vertex] => {
                let at = ids_a.iter().position(|&id| id == vertex).expect("shared");
                let opposite = [a[(at + 1) % 3], a[(at + 2) % 3], a[(at + 2) % 3]];
                let at = ids_b.iter().position(|&id| id == vertex).expect("shared");
                let other = [b[(at + 1) % 3], b[(at + 2) % 3], b[(at + 2) % 3]];
                triangles_intersect(&opposite, &b) || triangles_intersect(&other, &a)
            }
            [_, _] => {
                let apex = |ids: [u32; 3], t: &[[f64; 3]; 3]| {
                    t[ids
                        .iter()
                        .position(|id| !shared.contains(id))
                        .expect("not shared")]
                };
                let edge = ids_a.iter().zip(&a).filter(|(id, _)| shared.contains(id));
                let [u, v]: [[f64; 3]; 2] = edge
                    .map(|(_, p)| *p)
                    .collect::<Vec<_>>()
                    .try_into()
                    .expect("two");
                let (p, q) = (apex(ids_a, &a), apex(ids_b, &b));
                // Coplanar, and the normals of both triangles over the edge point the same way;
                // small integers make this exact.
                let normal = |apex: [f64; 3]| {
                    let (e, f): ([f64; 3], [f64; 3]) = (
                        std::array::from_fn(|k| v[k] - u[k]),
                        std::array::from_fn(|k| apex[k] - u[k]),
                    );
                    [
                        e[1] * f[2] - e[2] * f[1],
                        e[2] * f[0] - e[0] * f[2],
                        e[0] * f[1] - e[1] * f[0],
                    ]
                };
                let (n, m) = (normal(p), normal(q));
                orient3d(&u, &v, &p, &q) == Sign::Zero
                    && n[0] * m[0] + n[1] * m[1] + n[2] * m[2] > 0.0
            }
            _ => true,
        };
        assert_eq!(
            triangles_intersect_beyond_shared(&a, ids_a, &b, ids_b),
            expected,
            "{a:?} {ids_a:?} {b:?} {ids_b:?}"
        );
    }
    assert!(n_by_shared.iter().all(|&n| n > 100), "{n_by_shared:?}");
}

/// Answers do not change when all coordinates are scaled by one power of two, to the very ends
/// of the range of doubles.
#[test]
fn scaling_to_the_ends_of_the_range_changes_nothing() {
    let mut random = Random::new(9);
    for kind in [Kind::Lattice(2), Kind::Skewed(2), Kind::NearlyTouching64] {
        for _ in 0..500 {
            let points = kind.points::<8>(&mut random);
            let magnitudes = || {
                points
                    .iter()
                    .flatten()
                    .map(|x| x.abs())
                    .filter(|&x| x > 0.0)
            };
            let largest = magnitudes().fold(1.0, f64::max);
            let smallest = magnitudes().fold(1.0, f64::min);
            // No bit is lost: the lowest of a coordinate is 2^-52 of it or more.
            let up = 2.0_f64.powi((f64::MAX / largest).log2() as i32 - 1);
            let down = 2.0_f64.powi((f64::MIN_POSITIVE / smallest).log2() as i32 + 1);
            let (a, b) = cut::<4, 4>(&points);
            let (t, s) = cut::<3, 3>(&points);
            for scale in [up, down] {
                let scaled = points.map(|point| point.map(|x| x * scale));
                assert!(
                    scaled.iter().flatten().all(|x| x.is_finite()),
                    "{kind:?} by {scale:e}"
                );
                let (a_scaled, b_scaled) = cut::<4, 4>(&scaled);
                let (t_scaled, s_scaled) = cut::<3, 3>(&scaled);
                assert_eq!(
                    tetrahedra_intersect(&a_scaled, &b_scaled),
                    tetrahedra_intersect(&a, &b),
                    "{kind:?} {a:?} {b:?} by {scale:e}"
                );
                assert_eq!(
                    triangles_intersect(&t_scaled, &s_scaled),
                    triangles_intersect(&t, &s),
                    "{kind:?} {t:?} {s:?} by {scale:e}"
                );
            }
        }
    }
}

/// Input that callers should refuse gives some answer, not a panic.
#[test]
fn numbers_that_are_not_finite_do_not_panic() {
    let mut random = Random::new(10);
    let values = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        5e-324,
        0.0,
        1.0,
    ];
    for _ in 0..2000 {
        let points = [[0.0; 3]; 8].map(|point| point.map(|_: f64| random.pick(&values)));
        let (a, b) = cut::<4, 4>(&points);
        let (t, s) = cut::<3, 3>(&points);
        let _ = tetrahedra_intersect(&a, &b);
        let _ = triangles_intersect(&t, &s);
        let _ = triangle_tetrahedron_intersect(&t, &b);
        let _ = tetrahedra_intersect_beyond_shared(&a, [0, 1, 2, 3], &b, [0, 4, 5, 6]);
        let _ = tetrahedra_intersect_beyond_shared(&a, [0, 1, 2, 3], &b, [0, 1, 5, 6]);
        let _ = triangles_intersect_beyond_shared(&t, [0, 1, 2], &s, [0, 1, 3]);
    }
}
