//! How far each vertex may go in a step: by the exact test of the whole step.

use impinge_core::{BodyId, Error, Method, PairFilter, Query, Real, Scene, Start, Truncation};
use impinge_scenes::{Random, soup, surfaces};
use impinge_tests::{detector, detectors};

/// The vertices of all bodies that move: at the start, at the end, and where they were stopped.
pub(super) fn ways(scene: &Scene, truncation: &Truncation) -> Vec<[[f64; 3]; 3]> {
    let mut all = Vec::new();
    for (id, body) in scene.bodies() {
        let Some(end) = body.end_positions() else {
            continue;
        };
        let at = truncation.positions(id).expect("it moves");
        assert_eq!(at.len(), end.len());
        all.extend((0..end.len()).map(|v| [body.positions().point(v), end.point(v), at.point(v)]));
    }
    all
}

/// The same scene with other ends.
pub(super) fn with_ends(scene: &Scene, truncation: &Truncation) -> Scene {
    let mut scene = scene.clone();
    for (id, at) in truncation.iter() {
        scene.set_end_positions(id, at).expect("as many");
    }
    scene
}

/// Asks all detectors, and tests the answer.
pub(super) fn checked(scene: &Scene, query: &Query) -> Truncation {
    let [truncation, others @ ..] =
        detectors().map(|mut detector| detector.truncate(scene, query).expect("an answer"));
    for other in others {
        assert_eq!(truncation, other);
    }
    let mut detector = detector(Method::Clusters, 2);
    // What touches at the start is not free.
    let query = match truncation.n_touching() {
        0 => query.clone(),
        _ => query.clone().start(Start::Skip),
    };
    let stopped = with_ends(scene, &truncation);
    assert!(detector.is_free(&stopped, &query).expect("an answer"));
    let ways = ways(scene, &truncation);
    for [start, end, at] in &ways {
        for k in 0..3 {
            assert!(start[k].min(end[k]) <= at[k] && at[k] <= start[k].max(end[k]));
        }
    }
    let n_before_end = ways.iter().filter(|[_, end, at]| end != at).count() as u64;
    assert!(n_before_end <= truncation.n_cut());
    truncation
}

/// Coordinates as they are held.
fn held<R: Real>(points: &[[f64; 3]], round: impl Fn(f64) -> R) -> Vec<[R; 3]> {
    points.iter().map(|p| p.map(&round)).collect()
}

/// Triangles that fly about, small enough to be apart at the start.
pub(super) fn flying<R: Real>(
    random: &mut Random,
    n: usize,
    far: f64,
    round: impl Fn(f64) -> R + Copy,
) -> Scene {
    let mut scene = Scene::new();
    let mut number = |size: f64| (f64::from(random.unit()) - 0.5) * size;
    for _ in 0..n {
        let at = [(); 3].map(|()| number(4.0));
        let way = [(); 3].map(|()| number(far));
        let corners = [(); 3].map(|()| [0, 1, 2].map(|k: usize| at[k] + number(0.5)));
        let ends = corners.map(|p| [0, 1, 2].map(|k: usize| p[k] + way[k] + number(0.3 * far)));
        let body = scene
            .add_triangles(&[[0, 1, 2]], &held(&corners, round))
            .expect("a triangle");
        scene
            .set_end_positions(body, held(&ends, round))
            .expect("as many");
    }
    scene
}

#[test]
fn steps_to_where_vertices_are_stopped_are_free() {
    let mut random = Random::new(31);
    let (mut n_cut, mut n_all, mut n_rounds) = (0, 0, 0);
    for round in 0..60 {
        let far = [0.2, 1.0, 5.0][round % 3];
        let n = 20 + round % 20;
        let scene = match round % 4 {
            0 | 1 => flying(&mut random, n, far, |x| x as f32),
            2 => flying(&mut random, n, far, |x| x),
            // Far from the origin, where rounding shows.
            _ => flying(&mut random, n, far, |x| (x + 3000.0) as f32),
        };
        let query = match round % 5 {
            3 => Query::all().separation(0.01),
            4 => Query::all().clearance(0.02),
            _ => Query::all(),
        };
        let truncation = checked(&scene, &query);
        n_cut += truncation.n_cut();
        n_rounds += u64::from(truncation.rounds());
        n_all += 3 * n as u64;
        // A free step of the same bodies needs no stop.
        if truncation.n_cut() == 0 {
            assert!(
                detector(Method::Clusters, 1)
                    .is_free(&scene, &query)
                    .expect("an answer")
            );
        }
    }
    assert!(
        n_cut > n_all / 20 && n_cut < n_all / 2,
        "{n_cut} of {n_all}"
    );
    assert!(n_rounds > 0);
}

/// The shares of their ways that the vertices of a body go, from the least to the most.
fn shares_of(scene: &Scene, body: BodyId, truncation: &Truncation) -> [f64; 2] {
    let held = scene.body(body).expect("known");
    let (start, end) = (held.positions(), held.end_positions().expect("it moves"));
    let at = truncation.positions(body).expect("it moves");
    let mut shares = [1.0f64, 0.0];
    for vertex in 0..start.len() {
        let [start, end, at] = [start, end, at].map(|positions| positions.point(vertex));
        // Along the axis on which it goes farthest, as far as rounding tells.
        let of_axis = (0..3).map(|k| (end[k] - start[k], at[k] - start[k]));
        let (whole, gone) = of_axis.fold((0.0f64, 0.0), |most, axis| {
            if axis.0.abs() > most.0.abs() {
                axis
            } else {
                most
            }
        });
        shares = [shares[0].min(gone / whole), shares[1].max(gone / whole)];
    }
    shares
}

/// A body that a transform moves keeps its shape: it stops as a whole, and others for themselves.
#[test]
fn a_rigid_body_stops_as_a_whole() {
    let mut random = Random::new(8);
    let ball = surfaces::ball(80);
    let ball: Vec<[f64; 3]> = ball.positions.iter().map(|p| p.map(f64::from)).collect();
    let (sin, cos) = 0.6f64.sin_cos();
    let (mut n_stopped, mut n_apart) = (0, 0);
    for round in 0..12 {
        let mut scene = flying(&mut random, 20, 0.5, |x| x);
        let still: Vec<_> = scene.bodies().map(|(id, _)| id).take(10).collect();
        for id in still {
            scene.clear_end_positions(id).expect("known");
        }
        let far = 6.0 + f64::from(round);
        let faces = surfaces::ball(80).elements;
        let ball = ball
            .iter()
            .map(|[x, y, z]| [x - 4.0, *y, *z])
            .collect::<Vec<_>>();
        let body = scene.add((faces, ball)).expect("a ball");
        let turn = [
            [cos, -sin, 0.0, far],
            [sin, cos, 0.0, 2.0],
            [0.0, 0.0, 1.0, 0.1],
            [0.0, 0.0, 0.0, 1.0],
        ];
        scene.set_end_transform(body, &turn).expect("good");
        let [least, most] = shares_of(&scene, body, &checked(&scene, &Query::all()));
        assert!(most - least < 1e-12, "{least} {most}");
        n_stopped += usize::from(most > 0.0 && most < 1.0);
        // Given as positions, each of its vertices stops for itself.
        let end = scene.body(body).expect("known").end_positions().cloned();
        scene
            .set_end_positions(body, end.expect("it moves"))
            .expect("as many");
        let [least, most] = shares_of(&scene, body, &checked(&scene, &Query::all()));
        n_apart += usize::from(most - least > 1e-3);
    }
    assert!(n_stopped > 6 && n_apart > 6, "{n_stopped} {n_apart}");
}

#[test]
fn a_chain_of_such_steps_never_touches() {
    let mut random = Random::new(5);
    let mut scene = soup_in_motion(&mut random);
    let mut detector = detector(Method::Clusters, 2);
    let (mut n_cut, mut n_rounds) = (0, 0);
    for round in 0..40 {
        let truncation = detector.truncate(&scene, &Query::all()).expect("an answer");
        assert_eq!(truncation.n_touching(), 0);
        // The oracle looks at all pairs in each round, not only at those that have moved.
        if round % 8 == 0 {
            assert_eq!(truncation, checked(&scene, &Query::all()));
            n_rounds += truncation.rounds();
        }
        n_cut += truncation.n_cut();
        truncation.apply(&mut scene).expect("the same bodies");
        assert!(!detector.any(&scene, &Query::all()).expect("an answer"));
        move_on(&mut scene, &mut random);
    }
    assert!(n_cut > 1000 && n_rounds > 5, "{n_cut} {n_rounds}");
}

/// Triangles that are apart, on their ways.
pub(super) fn soup_in_motion(random: &mut Random) -> Scene {
    let mut scene = Scene::new();
    let mut at = Vec::new();
    for ix in 0..125 {
        let cell = [ix % 5, ix / 5 % 5, ix / 25].map(f64::from);
        let corner = |random: &mut Random| cell.map(|x| x + 0.4 * f64::from(random.unit()));
        at.extend([corner(random), corner(random), corner(random)]);
    }
    let faces: Vec<[u32; 3]> = (0..125)
        .map(|ix| [3 * ix, 3 * ix + 1, 3 * ix + 2])
        .collect();
    scene
        .add_triangles(&faces, &held(&at, |x| x as f32))
        .expect("a soup");
    move_on(&mut scene, random);
    scene
}

/// Sends every vertex somewhere.
fn move_on(scene: &mut Scene, random: &mut Random) {
    let ids: Vec<BodyId> = scene.bodies().map(|(id, _)| id).collect();
    for id in ids {
        let positions = scene.body(id).expect("held").positions();
        let ends: Vec<[f32; 3]> = (0..positions.len())
            .map(|v| {
                (positions.point(v))
                    .map(|x| (0.98 * x + 0.8 * (f64::from(random.unit()) - 0.5)) as f32)
            })
            .collect();
        scene.set_end_positions(id, &ends).expect("as many");
    }
}

#[test]
fn what_moves_together_is_not_stopped() {
    // A sheet that flies within its own plane, by many edges: static planes between its vertices
    // would stop all of them.
    let sheet = surfaces::bumpy_ball(2000, 0.2);
    let mut scene = Scene::new();
    let body = sheet.add_to(&mut scene).expect("a ball");
    let wall = scene
        .add_triangles(
            &[[0, 1, 2]],
            &[
                [2.0_f32, -50.0, -50.0],
                [2.0, 50.0, -50.0],
                [2.0, 0.0, 50.0],
            ],
        )
        .expect("a wall");
    let moved = |by: f32| sheet.translated([by, 0.0, 0.0]).positions;
    scene.set_end_positions(body, moved(1.0)).expect("as many");
    let truncation = checked(&scene, &Query::all());
    assert_eq!((truncation.n_cut(), truncation.rounds()), (0, 0));
    assert_eq!(truncation.positions(wall), None);
    // Against the wall, some do stop, but those behind the ball's widest part do not have to.
    scene.set_end_positions(body, moved(1.6)).expect("as many");
    let truncation = checked(&scene, &Query::all());
    let n = sheet.positions.len() as u64;
    assert!(
        truncation.n_cut() > 10 && truncation.n_cut() < n * 3 / 4,
        "{truncation:?} {n}"
    );
}

#[test]
fn who_touches_at_the_start_stays_or_is_skipped() {
    let mut scene = Scene::new();
    let floor = [[0.0_f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    scene.add_triangles(&[[0, 1, 2]], &floor).expect("a floor");
    let points = scene
        .add_points(&[[1.0_f32, 1.0, 0.0], [1.0, 2.0, 1.0]])
        .expect("points");
    let ends = [[1.0_f32, 1.0, 1.0], [1.0, 2.0, 2.0]];
    scene.set_end_positions(points, &ends).expect("as many");
    let truncation = checked(&scene, &Query::all());
    assert_eq!((truncation.n_touching(), truncation.n_cut()), (1, 1));
    let at = truncation.positions(points).expect("it moves");
    assert_eq!([at.point(0)[2], at.point(1)[2]], [0.0, 2.0]);
    let skipping = Query::all().start(Start::Skip);
    let truncation = checked(&scene, &skipping);
    assert_eq!((truncation.n_touching(), truncation.n_cut()), (0, 0));
    // Two triangles through each other: nothing moves, if anyone asks.
    let mut scene = Scene::new();
    let soup = soup::triangles(200, 0.6, 3);
    let body = soup.add_to(&mut scene).expect("a soup");
    let far = soup.translated([9.0, 0.0, 0.0]).positions;
    scene.set_end_positions(body, &far).expect("as many");
    let verified = Query::all().start(Start::Verify);
    let truncation = detector(Method::Clusters, 1)
        .truncate(&scene, &verified)
        .expect("an answer");
    assert_eq!(truncation.start_intersects(), Some(true));
    let stays = |[start, _, at]: [[f64; 3]; 3]| start == at;
    assert!(ways(&scene, &truncation).into_iter().all(stays));
}

#[test]
fn seams_are_refused_by_name() {
    let mut scene = Scene::new();
    let at = [
        [0.0_f32, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 1.0, 0.0],
    ];
    let body = scene
        .add_triangles(&[[0, 1, 2], [3, 5, 4]], &at)
        .expect("two triangles");
    let ends = at.map(|[x, y, z]| [x, y, z + 1.0]);
    scene.set_end_positions(body, &ends).expect("as many");
    let refused = detector(Method::Clusters, 1).truncate(&scene, &Query::all());
    let Err(Error::Seam {
        body: named,
        n_coincident,
        ..
    }) = refused
    else {
        panic!("{refused:?}");
    };
    assert_eq!((named, n_coincident), (body, 2));
}

#[test]
fn what_is_left_out_is_not_kept_apart() {
    let mut scene = Scene::new();
    let floor = [[0.0_f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let floor = scene.add_triangles(&[[0, 1, 2]], &floor).expect("a floor");
    let point = scene.add_points(&[[1.0_f32, 1.0, 1.0]]).expect("a point");
    scene
        .set_end_positions(point, &[[1.0_f32, 1.0, -1.0]])
        .expect("as many");
    let mut detector = detector(Method::Clusters, 1);
    let mut n_cut = |query: &Query| detector.truncate(&scene, query).expect("an answer").n_cut();
    assert_eq!(n_cut(&Query::all()), 1);
    assert_eq!(n_cut(&Query::all().exclude((floor, point))), 0);
    assert_eq!(n_cut(&Query::all().filter(PairFilter::new(|_| false))), 0);
}

/// A point over a floor, at a height; both go to other heights.
fn over_a_floor<R: Real>(
    height: f64,
    [floor_to, point_to]: [f64; 2],
    round: impl Fn(f64) -> R + Copy,
) -> (Scene, [BodyId; 2]) {
    let mut scene = Scene::new();
    let floor = |z: f64| held(&[[0.0, 0.0, z], [4.0, 0.0, z], [0.0, 4.0, z]], round);
    let point = |z: f64| held(&[[1.0, 1.0, z]], round);
    let below = scene
        .add_triangles(&[[0, 1, 2]], &floor(0.0))
        .expect("a floor");
    let above = scene.add_points(&point(height)).expect("a point");
    scene
        .set_end_positions(below, floor(floor_to))
        .expect("as many");
    scene
        .set_end_positions(above, point(point_to))
        .expect("as many");
    (scene, [below, above])
}

/// Heights of the floor's corners and of the point where they were stopped.
fn heights(truncation: &Truncation, bodies: [BodyId; 2]) -> ([f64; 3], f64) {
    let [floor, point] = bodies.map(|body| truncation.positions(body).expect("it moves"));
    ([0, 1, 2].map(|ix| floor.point(ix)[2]), point.point(0)[2])
}

/// A pair touches if it is exactly as near as it is to keep. Where there is no room that floats can
/// divide, who goes towards the other stays or follows, and who goes away goes on.
#[test]
fn without_room_only_who_goes_towards_the_other_stops() {
    for kept in [0.1, 0.125, 1.0] {
        for (n_ulps, is_thick, is_double) in
            (0..24).flat_map(|n| [(n, true, true), (n, false, true), (n, true, false)])
        {
            let single = (0..n_ulps).fold(kept as f32, |z, _| z.next_up());
            let height = match is_double {
                true => (0..n_ulps).fold(kept, |z: f64, _| z.next_up()),
                false => f64::from(single),
            };
            let with = |ends: [f64; 2]| {
                let (mut scene, bodies) = match is_double {
                    true => over_a_floor(height, ends, |x| x),
                    false => over_a_floor(height, ends, |x| x as f32),
                };
                let query = match is_thick {
                    true => {
                        scene.set_thickness(bodies[0], kept).expect("good");
                        Query::all()
                    }
                    false => Query::all().separation(kept),
                };
                (scene, bodies, query)
            };
            let touches = u64::from(height <= kept);
            // The floor sinks by less than the point: that follows, or stays.
            let (scene, bodies, query) = with([-0.05, -1.0]);
            let truncation = checked(&scene, &query);
            assert_eq!(truncation.n_touching(), touches, "{kept} {n_ulps}");
            let sunk = f64::from(-0.05_f32);
            let (floor, point) = heights(&truncation, bodies);
            if touches == 1 {
                assert_eq!((floor, point), ([0.0; 3], height));
            } else {
                assert_eq!(truncation.n_cut(), 1, "{kept} {n_ulps}");
                assert!(floor.iter().all(|z| (z - sunk).abs() < 1e-8), "{floor:?}");
                let least = floor[0] + kept;
                assert!(point > least && point < least + 1e-3, "{point} {least}");
                assert!(truncation.rounds() < 6, "{truncation:?}");
            }
            let skipping = checked(&scene, &query.start(Start::Skip));
            assert_eq!(skipping.n_touching(), 0);
            // The point goes away, and the floor follows by more than there is room for.
            let (scene, bodies, query) = with([1.0, height + 0.5]);
            let truncation = checked(&scene, &query);
            assert_eq!(truncation.n_touching(), touches);
            let (floor, point) = heights(&truncation, bodies);
            if touches == 0 {
                assert_eq!(truncation.n_cut(), 3);
                assert!((point - height - 0.5).abs() < 1e-6);
                assert!(
                    floor.iter().all(|&z| z > 0.49 && z < 0.5 + 1e-5),
                    "{floor:?}"
                );
            }
            // Both go towards the other.
            let (scene, bodies, query) = with([0.5, 0.0]);
            let truncation = checked(&scene, &query);
            assert_eq!(truncation.n_touching(), touches);
            let (floor, point) = heights(&truncation, bodies);
            assert!(floor.iter().all(|&z| z < 0.001) && point > kept - 1e-12);
        }
    }
}

/// A point that is pushed onto a thick floor until there is no room left goes on when the floor
/// sinks.
#[test]
fn what_was_pushed_until_no_room_was_left_follows_a_sinking_floor() {
    let (mut scene, [floor, point]) = over_a_floor(0.5, [0.0, 0.5], |x| x);
    scene.clear_end_positions(floor).expect("known");
    scene.set_thickness(floor, 0.1).expect("good");
    let move_by = |scene: &mut Scene, body, by: f64| {
        let at = scene.body(body).expect("known").positions();
        let ends = Vec::from_iter((0..at.len()).map(|ix| {
            let [x, y, z] = at.point(ix);
            [x, y, z + by]
        }));
        scene.set_end_positions(body, &ends).expect("as many");
    };
    let height = |scene: &Scene, body| scene.body(body).expect("known").positions().point(0)[2];
    for _ in 0..12 {
        move_by(&mut scene, point, -0.3);
        let truncation = checked(&scene, &Query::all());
        assert_eq!(truncation.n_touching(), 0);
        truncation.apply(&mut scene).expect("the same scene");
    }
    assert!(height(&scene, point) < 0.1 + 1e-15);
    for round in 1..5 {
        move_by(&mut scene, point, -0.3);
        move_by(&mut scene, floor, -0.1);
        let truncation = checked(&scene, &Query::all());
        assert_eq!((truncation.n_touching(), truncation.n_cut()), (0, 1));
        truncation.apply(&mut scene).expect("the same scene");
        let [floor, point] = [floor, point].map(|body| height(&scene, body));
        assert!((floor + 0.1 * f64::from(round)).abs() < 1e-12, "{floor}");
        assert!(point - floor < 0.1002, "{point} {floor}");
    }
}

/// Slanted elements a few units in the last place beyond what they keep, that go anywhere.
#[test]
fn slanted_elements_without_room_stay_apart() {
    let mut random = Random::new(77);
    let (mut n_touching, mut n_moved, mut n_rounds) = (0, 0, 0);
    for round in 0..120 {
        let mut number = |size: f64| (f64::from(random.unit()) - 0.5) * size;
        let mut scene = Scene::new();
        let face = [(); 3].map(|()| [(); 3].map(|()| number(2.0)));
        let middle: [f64; 3] =
            core::array::from_fn(|k| (face[0][k] + face[1][k] + face[2][k]) / 3.0);
        let [u, v] = [1, 2].map(|ix: usize| [0, 1, 2].map(|k: usize| face[ix][k] - face[0][k]));
        let normal = [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ];
        let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
        let kept = [0.1, 1e-4, 1e-9, 0.0][round % 4];
        // A few units in the last place more or less.
        let far = kept * (1.0 + 4e-16) + number(2e-16);
        let point: [f64; 3] = core::array::from_fn(|k| middle[k] + far * normal[k] / length);
        let way = [(); 3].map(|()| number(0.2));
        let floor = scene.add_triangles(&[[0, 1, 2]], &face).expect("a face");
        let body = scene.add_points(&[point]).expect("a point");
        let ends = face.map(|p| [0, 1, 2].map(|k: usize| p[k] + way[k] + number(0.1)));
        scene.set_end_positions(floor, &ends).expect("as many");
        let end = [0, 1, 2].map(|k: usize| point[k] + number(0.4));
        scene.set_end_positions(body, &[end]).expect("as many");
        let query = Query::all().separation(kept);
        let truncation = checked(&scene, &query);
        let near = detector(Method::Clusters, 1)
            .near(&scene, kept, &Query::all())
            .expect("an answer");
        assert_eq!(truncation.n_touching(), near.len() as u64, "{round}");
        n_touching += truncation.n_touching();
        n_rounds = n_rounds.max(truncation.rounds());
        if truncation.n_touching() == 0 {
            n_moved += u64::from(truncation.n_cut() < 4);
        }
    }
    assert!(n_touching > 10 && n_moved > 50, "{n_touching} {n_moved}");
    assert!(n_rounds < 60, "{n_rounds}");
}

/// Squares of such coordinates overflow or underflow in `f64`.
#[test]
fn very_large_and_very_small_scenes_move_alike() {
    let triangle = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    let heights = |exponent: i32| {
        let size = 2f64.powi(exponent);
        let mut scene = Scene::new();
        let sized = triangle.map(|p: [f64; 3]| p.map(|x| x * size));
        scene.add_triangles(&[[0, 1, 2]], &sized).expect("good");
        let point = scene.add_points(&[[size, size, size]]).expect("good");
        let mut detector = detector(Method::Clusters, 1);
        let end = [[size, size, -size]];
        let chain = [(); 3].map(|()| {
            scene.set_end_positions(point, &end).expect("good");
            checked(&scene, &Query::all());
            let truncation = detector.truncate(&scene, &Query::all()).expect("good");
            truncation.apply(&mut scene).expect("good");
            scene.body(point).expect("held").positions().point(0)[2] / size
        });
        assert!(chain[0] < 1.0 && chain.is_sorted_by(|a, b| a > b) && chain[2] > 0.0);
        chain
    };
    let usual = heights(0);
    for exponent in [-960, -600, -300, 300, 600, 1000, 1021] {
        let those = heights(exponent);
        for (a, b) in usual.iter().zip(those) {
            assert!((b / a - 1.0).abs() < 1e-9, "{exponent}: {those:?}");
        }
    }
}
