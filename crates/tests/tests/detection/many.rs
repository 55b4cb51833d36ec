//! Many bodies: the nearest two, whether any two meet, and pairs across two sets.

use impinge_core::proximity::Nearest;
use impinge_core::{
    Backend, BodyId, CancelToken, Control, Detector, Error, Filter, Method, Query, Scene, Settings,
};
use impinge_scenes::{Model, Random, solids, soup, surfaces};

fn cpu(method: Method) -> Detector {
    Detector::new(Settings::new().backend(Backend::Cpu).method(method)).unwrap()
}

/// Bodies of several kinds at random places of a cube.
fn scatter(n: usize, size: f32, seed: u64) -> (Scene, Vec<BodyId>) {
    let mut random = Random::new(seed);
    let models = [
        surfaces::bumpy_ball(200, 0.3),
        surfaces::cube([0.0; 3], 1.0),
        soup::triangles(20, 0.3, 1),
        solids::block(2, 1, 1, 0.5),
    ];
    let mut scene = Scene::new();
    let mut add = |ix: usize| {
        let model = models[ix % models.len()].translated(random.point(0.0, size));
        model.add_to(&mut scene).unwrap()
    };
    let bodies = (0..n).map(&mut add).collect();
    // A body without elements is nobody's neighbour.
    scene.add_triangles::<f32>(&[], &[]).unwrap();
    (scene, bodies)
}

/// The nearest of all pairs, one by one.
fn one_by_one(
    scene: &Scene,
    bodies: &[BodyId],
    may_meet: impl Fn(BodyId, BodyId) -> bool,
) -> Option<Nearest> {
    let mut detector = cpu(Method::Auto);
    let mut best: Option<Nearest> = None;
    for (ix, &a) in bodies.iter().enumerate() {
        for &b in &bodies[ix + 1..] {
            if may_meet(a, b) {
                let found = detector.distance(scene, a, b).unwrap();
                if found.is_some_and(|found| best.is_none_or(|best| found.distance < best.distance))
                {
                    best = found;
                }
            }
        }
    }
    best
}

#[test]
fn the_nearest_two_are_those_of_all_pairs() {
    let mut kept = cpu(Method::Auto);
    let (mut n_touching, mut n_apart) = (0, 0);
    for seed in 0..12 {
        // From crowded to far apart.
        let (mut scene, mut bodies) = scatter(24, 3.0 + 2.5 * seed as f32, seed);
        for round in 0..3 {
            let expected = one_by_one(&scene, &bodies, |_, _| true);
            let found = kept.nearest(&scene, &Query::between_all()).unwrap();
            assert_eq!(found, expected, "{seed} {round}");
            // Asked again, and of single pairs: what is kept serves other questions.
            assert_eq!(
                kept.nearest(&scene, &Query::between_all()).unwrap(),
                expected
            );
            for pair in bodies.windows(2) {
                let of_two = kept.distance(&scene, pair[0], pair[1]).unwrap();
                let fresh = cpu(Method::Auto).distance(&scene, pair[0], pair[1]);
                assert_eq!(of_two, fresh.unwrap(), "{seed} {round} {pair:?}");
            }
            match found.unwrap().distance {
                0.0 => n_touching += 1,
                _ => n_apart += 1,
            }
            // Some bodies move, one goes and another takes its slot.
            for &body in bodies.iter().step_by(5) {
                let held = scene.body(body).unwrap();
                let points = (0..held.n_vertices()).map(|ix| held.positions().point(ix));
                let moved: Vec<[f32; 3]> = points
                    .map(|[x, y, z]| [x as f32 + 0.3, y as f32 - 0.2, z as f32])
                    .collect();
                scene.set_positions(body, &moved).unwrap();
            }
            scene.remove(bodies[3 + round]).unwrap();
            let ball = surfaces::ball(50).translated([round as f32, 1.0, 0.0]);
            bodies[3 + round] = ball.add_to(&mut scene).unwrap();
        }
    }
    assert!(n_touching > 5 && n_apart > 5, "{n_touching} {n_apart}");
}

/// Only pairs of the lowest bodies are looked at, once a pair of these touches.
#[test]
fn in_a_crowd_the_lowest_pair_that_touches_is_found() {
    let mut kept = cpu(Method::Auto);
    let mut n_lower = 0;
    for seed in 0..3 {
        let (mut scene, bodies) = scatter(80, 6.0, seed);
        for round in 0..4 {
            let found = kept.nearest(&scene, &Query::between_all()).unwrap();
            assert_eq!(
                found,
                one_by_one(&scene, &bodies, |_, _| true),
                "{seed} {round}"
            );
            let found = found.unwrap();
            assert_eq!(found.distance, 0.0);
            assert!(kept.any(&scene, &Query::between_all()).unwrap());
            let moved = |body: BodyId, by: [f64; 3]| -> Vec<[f64; 3]> {
                let held = scene.body(body).unwrap();
                let points = (0..held.n_vertices()).map(|ix| held.positions().point(ix));
                points.map(|p| [0, 1, 2].map(|k| p[k] + by[k])).collect()
            };
            let first = |body: BodyId| scene.body(body).unwrap().positions().point(0);
            let (a, b) = (found.a.body, found.b.body);
            let between = bodies.iter().copied().find(|&body| a < body && body < b);
            let (body, positions) = match between {
                // A body between the two comes to the first: a lower pair, while both still touch.
                Some(body) => {
                    let (from, to) = (first(body), first(a));
                    n_lower += 1;
                    (body, moved(body, [0, 1, 2].map(|k| to[k] - from[k])))
                }
                // The first goes far away.
                None => (a, moved(a, [100.0, 0.0, 0.0])),
            };
            scene.set_positions(body, positions).unwrap();
        }
    }
    assert!(n_lower > 3, "{n_lower}");
}

/// Of pairs at one distance, the lowest.
#[test]
fn ties_are_the_lowest_pair() {
    let cube = surfaces::cube([0.0; 3], 1.0);
    let mut scene = Scene::new();
    let row: Vec<BodyId> = (0..40)
        .map(|ix| {
            let at = [2.0 * ((ix * 7) % 40) as f32, 0.0, 0.0];
            cube.translated(at).add_to(&mut scene).unwrap()
        })
        .collect();
    let found = cpu(Method::Auto)
        .nearest(&scene, &Query::between_all())
        .unwrap();
    assert_eq!(found, one_by_one(&scene, &row, |_, _| true));
    assert_eq!(found.unwrap().distance, 1.0);
}

#[test]
fn filters_and_queries_say_which_bodies_are_asked() {
    let (mut scene, bodies) = scatter(20, 12.0, 3);
    let mut detector = cpu(Method::Auto);
    for (ix, &body) in bodies.iter().enumerate() {
        let filter = Filter {
            category: 1 << (ix % 2),
            mask: 2 >> (ix % 2),
        };
        scene.set_filter(body, filter).unwrap();
    }
    let is_odd = |body: BodyId| body.index() % 2 == 1;
    let found = detector.nearest(&scene, &Query::between_all()).unwrap();
    assert_eq!(
        found,
        one_by_one(&scene, &bodies, |a, b| is_odd(a) != is_odd(b))
    );
    let some = [bodies[2], bodies[5], bodies[6]];
    let found = detector.nearest(&scene, &Query::across(some)).unwrap();
    let across = |a, b| some.contains(&a) != some.contains(&b);
    assert_eq!(found, one_by_one(&scene, &bodies, across));
    let query = Query::between_all().exclude((found.unwrap().a.body, found.unwrap().b.body));
    assert_ne!(detector.nearest(&scene, &query).unwrap(), found);
    let pair = Query::between(bodies[7], bodies[4]);
    let [found, expected] = [
        detector.nearest(&scene, &pair).unwrap(),
        detector.distance(&scene, bodies[4], bodies[7]).unwrap(),
    ];
    assert_eq!(found, expected);

    for query in [Query::all(), Query::self_of(bodies[0])] {
        let refused = detector.nearest(&scene, &query).unwrap_err().to_string();
        assert!(refused.contains("self-collision"), "{refused}");
    }
    let cell = Query::between_all().owned_by([0.0; 3], [1.0; 3]);
    assert!(detector.nearest(&scene, &cell).is_err());
    let token = CancelToken::new();
    token.cancel();
    detector.set_control(Control::new().cancel(&token));
    let cancelled = detector.nearest(&scene, &Query::between_all());
    assert!(matches!(cancelled, Err(Error::Cancelled)));
    detector.set_control(Control::new());
    assert_eq!(
        detector
            .nearest(&Scene::new(), &Query::between_all())
            .unwrap(),
        None
    );
}

/// Pairs of two sets, with every method; and `any` says whether there are some, in crowds and where
/// nothing meets.
#[test]
fn across_two_sets_and_any() {
    let (mut n_none, mut n_some) = (0, 0);
    let mut kept = cpu(Method::Auto);
    for seed in 0..16 {
        let (scene, bodies) = scatter(30, 2.0 + 3.0 * seed as f32, seed);
        let some: Vec<BodyId> = bodies.iter().copied().step_by(4).collect();
        let all: Vec<[u32; 4]> = kept
            .detect(&scene, &Query::between_all())
            .unwrap()
            .rows()
            .collect();
        let is_some = |body: u32| body.is_multiple_of(4);
        let across = all.iter().copied();
        let across: Vec<[u32; 4]> = across
            .filter(|row| is_some(row[0]) != is_some(row[2]))
            .collect();
        for method in [Method::Clusters, Method::Cells, Method::Naive] {
            let mut detector = cpu(method);
            let query = Query::across(some.iter().copied());
            let rows: Vec<[u32; 4]> = detector.detect(&scene, &query).unwrap().rows().collect();
            assert!(rows == across, "{method:?} {seed}");
            assert_eq!(detector.any(&scene, &query).unwrap(), !across.is_empty());
            assert_eq!(
                detector.any(&scene, &Query::between_all()).unwrap(),
                !all.is_empty()
            );
        }
        assert_eq!(
            kept.any(&scene, &Query::between_all()).unwrap(),
            !all.is_empty()
        );
        assert!(kept.stats().n_threads > 0);
        match all.is_empty() {
            true => n_none += 1,
            false => n_some += 1,
        }
    }
    assert!(n_none > 2 && n_some > 2, "{n_none} {n_some}");
    // Many bodies that are close to one another and do not meet: too long for the short way.
    let wall: Vec<Model> = (0..30)
        .map(|ix| surfaces::cloth(40, 40, 0.1).translated([0.0, 0.0, 1e-3 * ix as f32]))
        .collect();
    let mut scene = Scene::new();
    for sheet in &wall {
        sheet
            .mapped(|[x, y, z]| [x, y, z + 0.5 * (x + y)])
            .add_to(&mut scene)
            .unwrap();
    }
    assert!(!kept.any(&scene, &Query::between_all()).unwrap());
    assert_eq!(kept.detect(&scene, &Query::between_all()).unwrap().len(), 0);
}

#[test]
fn all_pairs_of_one_body_are_its_own_too() {
    let mut scene = Scene::new();
    let tangled = soup::triangles(60, 0.5, 1).add_to(&mut scene).unwrap();
    for x in [20.0, 40.0] {
        let far = surfaces::bumpy_ball(200, 0.3).translated([x, 0.0, 0.0]);
        far.add_to(&mut scene).unwrap();
    }
    let (crowd, bodies) = scatter(20, 12.0, 3);
    for (scene, body) in [(&scene, tangled), (&crowd, bodies[2]), (&crowd, bodies[0])] {
        let query = Query::of(body);
        let mut detector = cpu(Method::Auto);
        let n = detector.count(scene, &query).unwrap();
        assert_eq!(detector.any(scene, &query).unwrap(), n > 0, "{n}");
    }
    assert!(cpu(Method::Auto).any(&scene, &Query::of(tangled)).unwrap());
}
