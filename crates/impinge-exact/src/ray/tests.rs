use super::*;
use crate::tests::on_all;
use crate::triangle::segment_meets_triangle;
use impinge_testing::random::Random;

fn point(random: &mut Random, low: f64, n: u32) -> Point {
    [(); 3].map(|()| low + f64::from(random.below(n)))
}

fn at(origin: &Point, direction: &Point, t: f64, scale: f64) -> Point {
    [0, 1, 2].map(|k| scale * origin[k] + t * direction[k])
}

/// A number that is small and whole.
fn small(x: &Integer) -> f64 {
    x.quotient(&Integer::from(1), 0, 53, -1074)
}

/// Whether a feature has a point in its inside: it has the point, and without any of its
/// corners it has not.
fn holds_inside(corners: &[Point; 3], feature: Feature, point: &Point) -> bool {
    let vertices = match feature {
        Feature::Vertex(k) => vec![usize::from(k)],
        Feature::Edge(k) => vec![usize::from(k), (usize::from(k) + 1) % 3],
        Feature::Face => vec![0, 1, 2],
    };
    let has = |vertices: &[usize]| {
        let corner = |ix: usize| corners[vertices[ix.min(vertices.len() - 1)]];
        segment_meets_triangle(point, point, &[corner(0), corner(1), corner(2)])
    };
    let is_smaller = |left_out: usize| {
        let mut some = vertices.clone();
        some.remove(left_out);
        !some.is_empty() && has(&some)
    };
    let same = |ix: usize| corners[vertices[0]] == corners[ix];
    has(&vertices)
        && (0..vertices.len()).all(|ix| !is_smaller(ix))
        // Of vertices at one place, the first.
        && (vertices.len() > 1 || !(0..vertices[0]).any(same))
}

/// On a lattice: rays through vertices, along edges and in the planes of faces, faces that are
/// segments and points, rays that are points. Whether they meet, where they enter and where
/// they leave is held against segments and triangles.
#[test]
fn on_a_lattice() {
    const FINE: f64 = 1048576.0;
    let mut random = Random::new(1);
    // Misses, faces, edges, vertices, intervals.
    let mut n = [0usize; 5];
    for round in 0..200_000 {
        let size = 2 + round % 3;
        let corners = [(); 3].map(|()| point(&mut random, 0.0, size));
        let origin = point(&mut random, -1.0, size + 2);
        let direction = point(&mut random, -1.0, 3);
        let most = [0.0, 1.0, 2.0, 9.0, f64::INFINITY][random.below(5) as usize];
        let far = at(
            &origin,
            &direction,
            if most < 9.0 { most } else { 9.0 },
            1.0,
        );
        let ray = Ray {
            origin,
            direction,
            most,
        };
        let case = format!("{ray:?} {corners:?}");
        let Some(meeting) = meet(&ray, &corners) else {
            assert!(!segment_meets_triangle(&origin, &far, &corners), "{case}");
            n[0] += 1;
            continue;
        };
        let times = [&meeting.entry, &meeting.exit].map(|time| {
            assert!(time.exponent == 0 || time.over.is_zero() || time.exponent.abs() < 4);
            let scale = f64::from(2.0f32.powi(time.exponent as i32));
            (scale * small(&time.over), small(&time.under))
        });
        let [(over, under), (over_exit, under_exit)] = times;
        // All of it larger, so that points of the ray are whole.
        let larger = |by: f64| corners.map(|corner| corner.map(|x| by * x));
        let point = at(&origin, &direction, over, under);
        let faces = larger(under);
        assert!(over >= 0.0 && over <= most * under, "{case}");
        assert!(segment_meets_triangle(&point, &point, &faces), "{case}");
        assert!(
            holds_inside(&faces, meeting.feature, &point),
            "{case} {meeting:?}"
        );
        if over > 0.0 {
            let before = at(&origin, &direction, FINE * over - 1.0, FINE * under);
            let start = origin.map(|x| FINE * under * x);
            let fine = larger(FINE * under);
            assert!(!segment_meets_triangle(&start, &before, &fine), "{case}");
        }
        let last = at(&origin, &direction, over_exit, under_exit);
        let faces = larger(under_exit);
        assert!(segment_meets_triangle(&last, &last, &faces), "{case}");
        if over_exit < most * under_exit && direction != [0.0; 3] {
            let after = at(
                &origin,
                &direction,
                FINE * over_exit + 1.0,
                FINE * under_exit,
            );
            let end = at(
                &origin,
                &direction,
                99.0 * FINE * under_exit,
                FINE * under_exit,
            );
            let fine = larger(FINE * under_exit);
            let is_behind = most * under_exit * FINE >= FINE * over_exit + 1.0;
            let meets = segment_meets_triangle(&after, &end, &fine);
            assert!(!is_behind || !meets, "{case}");
        }
        // Rounded down, and the point that the barycentrics give.
        let t = meeting.entry.rounded_down();
        assert!(Parameter::of(t).compare(&meeting.entry).is_le());
        assert!(Parameter::of(t.next_up()).compare(&meeting.entry).is_gt());
        for axis in 0..3 {
            let sum: f64 = (0..3)
                .map(|k| meeting.barycentrics[k] * corners[k][axis])
                .sum();
            let exact = origin[axis] + over / under * direction[axis];
            assert!((sum - exact).abs() < 1e-14, "{case} {meeting:?}");
        }
        n[match meeting.feature {
            Feature::Face => 1,
            Feature::Edge(_) => 2,
            Feature::Vertex(_) => 3,
        }] += 1;
        n[4] += usize::from(meeting.entry.compare(&meeting.exit).is_lt());
    }
    assert!(n.iter().all(|&n| n > 400), "{n:?}");
}

/// Numbers of any size give what small ones give, and values of t are compared across rays.
#[test]
fn of_any_size() {
    let corners = [[0.0, 0.0, 3.0], [3.0, 0.0, 3.0], [0.0, 3.0, 3.0]];
    let ray = |size: f64, length: f64| Ray {
        origin: [size, size, 0.0],
        direction: [0.0, 0.0, 7.0 * length],
        most: f64::INFINITY,
    };
    for size in [1e-320, 1e-300, 1e-20, 1.0, 1e20, 1e300] {
        let scaled = corners.map(|corner| corner.map(|x| x * size));
        let meeting = meet(&ray(size, size), &scaled).unwrap();
        assert_eq!(meeting.feature, Feature::Face);
        if size >= 1e-300 {
            assert!((meeting.entry.rounded_down() - 3.0 / 7.0).abs() < 1e-15);
            assert!(
                meeting
                    .barycentrics
                    .iter()
                    .all(|w| (w - 1.0 / 3.0).abs() < 1e-15)
            );
        }
    }
    let tiny = meet(&ray(1.0, 1e-320), &corners).unwrap();
    assert_eq!(tiny.entry.rounded_down(), f64::MAX);
    let huge = meet(&ray(1.0, 1e307), &corners).unwrap();
    assert!(huge.entry.rounded_down() < 1e-306);
    let slow = meet(&ray(1.0, 1.0), &corners).unwrap();
    assert!(huge.entry.compare(&slow.entry).is_lt());
    assert!(slow.entry.compare(&tiny.entry).is_lt());
    assert!(slow.entry.compare(&slow.entry).is_eq());
    let behind = Ray {
        direction: [0.0, 0.0, -1.0],
        ..ray(1.0, 1.0)
    };
    assert!(meet(&behind, &corners).is_none());
    assert!(meet(&behind, &[]).is_none());
}

/// Entries and barycentrics.
type Inside = [Option<(f64, [f64; 3])>; LANES];
on_all!(f64: fn each_register(batch: &[(Ray, [Point; 3])]) -> Inside = meet_inside);

/// What floats say of rays through faces is what integers say, where they say anything.
#[test]
fn inside() {
    let mut batch = Vec::new();
    let mut random = Random::new(77);
    let mut n = [0; 4];
    for round in 0..60_004 {
        // Sizes that differ, numbers of few and of many bits, and rays that nearly lie in the
        // face or miss it.
        let size = [1.0, 1e-9, 1e12, 3e-31][round % 4];
        let bits = [4, 1 << 20, 1 << 40][round % 3];
        let far = [0.0, 0.0, 1000.0][round / 12 % 3];
        let mut number = || size * ((random.bits() % (2 * bits)) as f64 / bits as f64 - 1.0);
        let corners: [Point; 3] = [(); 3].map(|()| [(); 3].map(|()| number()));
        let origin = [number(), number(), number() + far * size];
        let shares = [number(), number(), number()].map(|x| (x / size).abs() + 1e-3);
        let sum: f64 = shares.iter().sum();
        let to: Point = [0, 1, 2].map(|axis| {
            let at: f64 = (0..3).map(|k| shares[k] / sum * corners[k][axis]).sum();
            at - origin[axis]
        });
        let direction = if round % 7 == 0 {
            to.map(|x| (x as f32).into())
        } else {
            to
        };
        let most = [f64::INFINITY, 1.0, 0.5][round / 36 % 3];
        let ray = Ray {
            origin,
            direction,
            most,
        };
        batch.push((ray, corners));
        // Not all lanes are used.
        if batch.len() < 7 {
            continue;
        }
        let found = each_register(&batch);
        assert!(found[7].is_none());
        for ((lane, (ray, corners)), found) in batch.drain(..).enumerate().zip(found) {
            let Some((t, barycentrics)) = found else {
                n[3] += 1;
                continue;
            };
            let meeting = meet(&ray, &corners).expect("{ray:?} {corners:?}");
            assert_eq!(meeting.feature, Feature::Face, "{ray:?} {corners:?}");
            for end in [meeting.entry.rounded_down(), meeting.exit.rounded_down()] {
                assert_eq!(end.to_bits(), t.to_bits(), "{ray:?} {corners:?}");
            }
            assert_eq!(
                meeting.barycentrics.map(f64::to_bits),
                barycentrics.map(f64::to_bits),
                "{ray:?} {corners:?}"
            );
            n[(round + 1 + lane - 7) % 3] += 1;
        }
    }
    assert!(n[1] > 5000 && n[2] > 5000 && n[3] > 5000, "{n:?}");
}

/// Elements of one and of two corners.
#[test]
fn edges_and_points() {
    let ray = Ray {
        origin: [0.0; 3],
        direction: [2.0, 0.0, 0.0],
        most: 3.0,
    };
    let edge = |p: Point, q: Point| {
        meet(&ray, &[p, q]).map(|at| {
            let [entry, exit] = [at.entry, at.exit].map(|t| t.rounded_down());
            (at.feature, entry, exit, at.barycentrics)
        })
    };
    let crossed = edge([1.0, -1.0, 0.0], [1.0, 3.0, 0.0]);
    assert_eq!(
        crossed,
        Some((Feature::Edge(0), 0.5, 0.5, [0.75, 0.25, 0.0]))
    );
    let along = edge([8.0, 0.0, 0.0], [4.0, 0.0, 0.0]);
    assert_eq!(along, Some((Feature::Vertex(1), 2.0, 3.0, [0.0, 1.0, 0.0])));
    let around = edge([-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]);
    assert_eq!(around, Some((Feature::Edge(0), 0.0, 1.0, [0.5, 0.5, 0.0])));
    assert_eq!(edge([8.0, 0.0, 0.0], [7.0, 0.0, 0.0]), None);
    assert_eq!(edge([1.0, 1.0, 0.0], [1.0, 3.0, 0.0]), None);
    let point = meet(&ray, &[[4.0, 0.0, 0.0]]).unwrap();
    assert_eq!(point.feature, Feature::Vertex(0));
    assert_eq!(point.entry.rounded_down(), 2.0);
    assert!(meet(&ray, &[[4.0, 1.0, 0.0]]).is_none());
}
