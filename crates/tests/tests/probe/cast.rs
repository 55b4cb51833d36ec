//! `cast`: what rays hit. Where one ray meets one element is held against other predicates in
//! `impinge-exact`; here the search is held against all elements, one by one.

use crate::elements;
use impinge_core::exact::internal::{Meeting, Ray, meet};
use impinge_core::{
    Backend, BodyId, CancelToken, Control, Detector, Error, Hit, Hits, Query, RayHit, Scene,
};
use impinge_scenes::{Random, solids, soup, surfaces};

fn ask(scene: &Scene, rays: &[[[f64; 3]; 2]], most: f64, hits: Hit) -> Hits {
    let [origins, directions] = [0, 1].map(|k| rays.iter().map(|ray| ray[k]).collect::<Vec<_>>());
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let query = Query::all().hits(hits);
    detector
        .cast(scene, &origins, &directions, most, &query)
        .unwrap()
}

/// Holds all three answers against all elements; returns the numbers of hits, ties for the first,
/// and intervals.
fn check(scene: &Scene, rays: &[[[f64; 3]; 2]], most: f64) -> [usize; 3] {
    let elements = elements(scene);
    let [first, any, all] =
        [Hit::First, Hit::Any, Hit::All].map(|hits| ask(scene, rays, most, hits));
    let mut n = [0; 3];
    for (ix, &[origin, direction]) in rays.iter().enumerate() {
        let ray = Ray {
            origin,
            direction,
            most,
        };
        let met = elements.iter().filter_map(|(body, element, corners)| {
            meet(&ray, corners).map(|meeting| (meeting, *body, *element))
        });
        let mut met: Vec<(Meeting, BodyId, u32)> = met.collect();
        // Stable: of several at one parameter, the lowest comes first.
        met.sort_by(|x, y| x.0.entry.compare(&y.0.entry));
        let same = |hit: &RayHit, (meeting, body, element): &(Meeting, BodyId, u32)| {
            (hit.element.body, hit.element.element) == (*body, *element)
                && hit.t == meeting.entry.rounded_down()
                && hit.t_end == meeting.exit.rounded_down()
                && hit.feature == meeting.feature
                && hit.barycentrics == meeting.barycentrics
        };
        assert_eq!(all.of(ix).len(), met.len(), "{ray:?}");
        assert!(
            all.of(ix).iter().zip(&met).all(|(hit, met)| same(hit, met)),
            "{ray:?}"
        );
        assert_eq!(first.of(ix), &all.of(ix)[..met.len().min(1)], "{ray:?}");
        assert!(any.of(ix).is_empty());
        for hits in [&first, &any, &all] {
            assert_eq!(hits.is_hit()[ix], !met.is_empty(), "{ray:?}");
        }
        n[0] += met.len();
        n[1] += usize::from(met.len() > 1 && met[0].0.entry.compare(&met[1].0.entry).is_eq());
        n[2] += met
            .iter()
            .filter(|(meeting, ..)| meeting.entry.compare(&meeting.exit).is_lt())
            .count();
    }
    n
}

/// Rays through vertices, along edges, in the planes of faces, and some that are points.
#[test]
fn lattices() {
    let mut random = Random::new(1);
    let mut n = [0; 3];
    for seed in 0..4 {
        let mut scene = Scene::new();
        soup::lattice_triangles(90, 3, seed)
            .add_to(&mut scene)
            .unwrap();
        soup::lattice_triangles(60, 3, seed + 10)
            .add_to(&mut scene)
            .unwrap();
        let rays: Vec<_> = (0..1500)
            .map(|_| {
                let origin = [(); 3].map(|()| f64::from(random.below(9)) / 2.0 - 0.5);
                [
                    origin,
                    [(); 3].map(|()| f64::from(random.below(5)) / 2.0 - 1.0),
                ]
            })
            .collect();
        for most in [f64::INFINITY, 1.0, 0.0] {
            let of_one = check(&scene, &rays, most);
            n = [0, 1, 2].map(|k| n[k] + of_one[k]);
        }
    }
    assert!(n[0] > 10_000 && n[1] > 1000 && n[2] > 1000, "{n:?}");
}

#[test]
fn meshes_of_all_kinds() {
    let mut random = Random::new(2);
    let mut scene = Scene::new();
    surfaces::icosphere(3).add_to(&mut scene).unwrap();
    soup::triangles(200, 0.3, 7)
        .translated([1.5, 0.0, 0.0])
        .add_to(&mut scene)
        .unwrap();
    solids::block(2, 2, 2, 0.5).add_to(&mut scene).unwrap();
    let ends: Vec<[f32; 3]> = (0..40).map(|_| random.point(-1.0, 2.0)).collect();
    let edges: Vec<[u32; 2]> = (0..39).map(|ix| [ix, ix + 1]).collect();
    scene.add_edges(&edges, &ends).unwrap();
    scene.add_points(&ends).unwrap();
    let mut point = || random.point(-3.0, 3.0).map(f64::from);
    let mut rays: Vec<_> = (0..400).map(|_| [point(), point()]).collect();
    // To vertices from the middle, where they are exact, and far out.
    rays.extend(ends.iter().map(|end| [[0.0; 3], end.map(f64::from)]));
    rays.extend(
        surfaces::icosphere(1)
            .positions_f64()
            .iter()
            .map(|&p| [[0.0; 3], p]),
    );
    rays.push([[1e6, 1e-3, 2e-3], [-1.0, 0.0, 0.0]]);
    rays.push([[-1e300, 0.0, 0.0], [1e300, 0.0, 0.0]]);
    rays.push([[-4.0, 1e-310, 0.0], [1e-310, 0.0, 1e-320]]);
    for most in [f64::INFINITY, 1.0] {
        let [n, ..] = check(&scene, &rays, most);
        assert!(n > 300, "{n}");
    }
}

/// Faces so near each other that rounded parameters are the same, and origins as near to faces.
#[test]
fn nearly_at_once() {
    let mut scene = Scene::new();
    let (mut faces, mut corners) = (Vec::new(), Vec::new());
    // In no order, and a few last bits, or a little more, apart.
    for ix in 0..64u32 {
        let z = 1.9 + f64::from(ix * 29 % 64 / 2) * if ix % 2 == 0 { f64::EPSILON } else { 1e-5 };
        corners.extend([[-1.0, -1.0, z], [4.0, -1.0, z], [-1.0, 4.0, z]]);
        faces.push([3 * ix, 3 * ix + 1, 3 * ix + 2]);
    }
    scene.add_triangles(&faces, &corners).unwrap();
    let mut random = Random::new(3);
    let mut number = || f64::from(random.point(0.0, 1.0)[0]);
    let mut rays: Vec<_> = (0..200)
        .map(|_| [[number(), number(), 0.0], [0.0, 0.0, 1.7 + 0.3 * number()]])
        .collect();
    for height in [1e-5, 1e-12, 1e-15, 0.0] {
        for way in [1.0, -1.0] {
            let z = 1.9 - way * height;
            rays.push([[number(), number(), z], [0.0, 0.0, way]]);
            rays.push([
                [number(), number(), z],
                [1e-3 * number(), 1e-3, way * number()],
            ]);
        }
    }
    let [n, ..] = check(&scene, &rays, f64::INFINITY);
    assert!(n > 12_000, "{n}");
    let all = ask(&scene, &rays, f64::INFINITY, Hit::All);
    let same = (0..200).flat_map(|ray| all.of(ray).windows(2));
    let same = same.filter(|two| two[0].t == two[1].t && two[0].element > two[1].element);
    assert!(same.count() > 500);
}

/// The same bytes for every instruction set, number of threads and precision, and for bodies that
/// move.
#[test]
fn every_way_gives_the_same_answer() {
    let mut random = Random::new(9);
    let model = surfaces::torus_knot(20_000, surfaces::Knot::default());
    let [origins, directions] = [0, 1].map(|_| {
        (0..3000)
            .map(|_| random.point(-0.5, 0.5))
            .collect::<Vec<[f32; 3]>>()
    });
    let wide = [&origins, &directions].map(|rows| {
        rows.iter()
            .map(|row| row.map(f64::from))
            .collect::<Vec<_>>()
    });
    let turned = [&origins, &directions]
        .map(|rows| rows.iter().map(|&[x, y, z]| [y, z, x]).collect::<Vec<_>>());
    let mut scene = Scene::new();
    let body = model.add_to(&mut scene).unwrap();
    let moved: Vec<[f32; 3]> = model.positions.iter().map(|&[x, y, z]| [y, z, x]).collect();
    for hits in Hit::ALL {
        let query = Query::all().hits(hits);
        let mut known: Option<Hits> = None;
        for (threads, mut detector) in crate::detectors() {
            let most = f64::INFINITY;
            let mut moving = scene.clone();
            let narrow = detector
                .cast(&moving, &origins, &directions, most, &query)
                .unwrap();
            let of_wide = detector
                .cast(&moving, &wide[0], &wide[1], most, &query)
                .unwrap();
            moving.set_positions(body, &moved).unwrap();
            let of_turned = detector
                .cast(&moving, &turned[0], &turned[1], most, &query)
                .unwrap();
            let known = known.get_or_insert_with(|| narrow.clone());
            for other in [&narrow, &of_wide, &of_turned] {
                assert!(known.iter().eq(other.iter()));
                assert_eq!(
                    (known.offsets(), known.is_hit()),
                    (other.offsets(), other.is_hit())
                );
                assert_eq!(known.hash(), other.hash());
            }
            assert_eq!(narrow.stats().n_threads, threads);
        }
        let known = known.unwrap();
        let n = known.is_hit().iter().filter(|&&is| is).count();
        assert!(n > 100, "{n}");
    }
}

#[test]
fn what_is_refused() {
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let mut scene = Scene::new();
    let cube = surfaces::cube([0.0; 3], 1.0).add_to(&mut scene).unwrap();
    let row = [[0.0f32, 0.0, 1.0]];
    for (most, directions, setting) in [
        (-1.0, 1, "most"),
        (f64::NAN, 1, "most"),
        (1.0, 0, "directions"),
    ] {
        let error = detector
            .cast(&scene, &row, &row[..directions], most, &Query::all())
            .unwrap_err();
        assert!(matches!(error, Error::Setting { setting: given, .. } if given == setting));
    }
    let error = detector.cast(&scene, &row, &[row[0]; 2], 1.0, &Query::all());
    assert_eq!(
        error.unwrap_err().to_string(),
        "directions: 1 origins and 2 directions given, as many directions as origins allowed"
    );
    let error = detector
        .cast(&scene, &row, &[[f32::NAN; 3]], 1.0, &Query::all())
        .unwrap_err();
    assert!(matches!(
        error,
        Error::NonFinitePoint {
            what: "directions",
            row: 0,
            ..
        }
    ));
    let refused = detector.cast(&scene, &row, &row, 1.0, &Query::self_all());
    assert!(matches!(refused, Err(Error::Setting { .. })));
    let token = CancelToken::new();
    token.cancel();
    detector.set_control(Control::new().cancel(&token));
    assert!(matches!(
        detector.cast(&scene, &row, &row, 1.0, &Query::all()),
        Err(Error::Cancelled)
    ));
    detector.set_control(Control::new());
    let hits = detector
        .cast(&scene, &row, &row, 1.0, &Query::of(cube))
        .unwrap();
    assert_eq!(
        (hits.len(), hits.of(1).len(), hits.offsets()),
        (1, 0, &[0, 0][..])
    );
    scene.remove(cube).unwrap();
    assert!(
        detector
            .cast(&scene, &row, &row, 1.0, &Query::of(cube))
            .is_err()
    );
    assert_eq!(
        detector
            .cast(&scene, &row, &row, 1.0, &Query::all())
            .unwrap()
            .is_hit(),
        [false]
    );
}
