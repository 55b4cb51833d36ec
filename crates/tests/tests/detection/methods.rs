//! Every method against the oracle, on every case; and proof that the comparison can fail.

use std::sync::Arc;

use impinge_core::{
    Affinity, Detector, Error, InstructionSet, Method, Positions, Query, Recluster, Scene,
    SharedVertex, Start, hash_rows,
};
use impinge_scenes::deform::{self, Deform};
use impinge_scenes::{soup, surfaces};
use impinge_tests::{Case, agree, cases, check, cpu, detector, naive, rows};

#[test]
fn methods_agree_with_the_oracle() {
    for (ix, case) in cases().into_iter().enumerate() {
        let expected = naive(&case);
        check(&case, &expected, cpu(Method::Auto, 1));
        check(&case, &expected, cpu(Method::Clusters, 1));
        let affinity = [Affinity::Auto, Affinity::Inherited][ix % 2];
        let settings = cpu(Method::Clusters, 2).affinity(affinity);
        check(&case, &expected, settings);
        for instruction_set in [InstructionSet::Portable, InstructionSet::Avx2] {
            for method in [Method::Clusters, Method::Cells] {
                let settings = cpu(method, 1).instruction_set(instruction_set);
                check(&case, &expected, settings);
            }
        }
        for (lambda, group_size) in [(1.0, 64), (0.01, 5), (20.0, 64)] {
            let settings = cpu(Method::Cells, 1 + usize::from(lambda > 1.0))
                .density(lambda)
                .group_size(group_size);
            check(&case, &expected, settings);
        }
    }
}

/// A candidate is a pair that the adjacency rule admits and whose boxes overlap. The boxes of
/// bodies in f64 are rounded to f32 outward, so there are a few more of them. Around a hub, a
/// vertex of very many elements, `Clusters` tells pairs apart by their directions, so there are
/// fewer.
#[test]
fn methods_count_the_same_candidates() {
    for case in cases() {
        let count = |method: Method| {
            let mut detector = detector(method, 1);
            let pairs = detector.detect(&case.scene, &case.query).unwrap();
            pairs.stats().n_candidates
        };
        let n = count(Method::Naive);
        let is_single = |positions: &Positions| matches!(positions, Positions::F32(_));
        let is_equal = case
            .scene
            .bodies()
            .all(|(_, body)| is_single(body.positions()));
        for method in [Method::Clusters, Method::Cells] {
            let found = count(method);
            let has_hub = method == Method::Clusters && case.name.contains("fan");
            assert!(
                found == n || (!is_equal && found > n) || (has_hub && found < n),
                "{} {method:?}: {found} candidates, {n} by the oracle",
                case.name
            );
        }
    }
}

#[test]
fn liars_are_caught() {
    let case = cases().swap_remove(0);
    let truth = naive(&case);
    assert!(truth.len() > 10);
    let verdict = |answer: Vec<[u32; 4]>| agree(&truth, &answer, hash_rows(answer.iter().copied()));
    assert_eq!(verdict(truth.clone()), Ok(()));
    let mut dropped = truth.clone();
    dropped.remove(5);
    assert!(verdict(dropped).is_err());
    let mut added = truth.clone();
    added.push([0, u32::MAX, 1, u32::MAX]);
    assert!(verdict(added).is_err());
    let mut swapped = truth.clone();
    let [body_a, a, body_b, b] = swapped[3];
    swapped[3] = [body_a, b, body_b, a];
    assert!(verdict(swapped).is_err());
    let mut repeated = truth.clone();
    repeated[4] = repeated[5];
    assert!(verdict(repeated).is_err());
    let mut unsorted = truth.clone();
    unsorted.swap(1, 2);
    assert!(verdict(unsorted).is_err());
}

#[test]
fn frames_follow_the_positions() {
    let rest = surfaces::torus_knot(3000, Default::default());
    let mut scene = Scene::new();
    let a = rest.add_to(&mut scene).unwrap();
    let b = rest.translated([0.2, 0.1, 0.3]).add_to(&mut scene).unwrap();
    let query = Query::all();
    let mut clusters = detector(Method::Clusters, 2);
    let mut cells = detector(Method::Cells, 2);
    let mut seen = std::collections::BTreeSet::new();
    for frame in 0..6 {
        let moved = rest.mapped(|[x, y, z]| {
            let angle = 0.4 * frame as f32 * z;
            let (sin, cos) = angle.sin_cos();
            [cos * x - sin * y, sin * x + cos * y, z]
        });
        scene.set_positions(a, &moved.positions).unwrap();
        if frame % 2 == 0 {
            scene.positions_mut::<f32>(b).unwrap()[frame] = [0.0, 0.1, 0.2];
        }
        let case = Case {
            name: "frames".into(),
            scene: scene.clone(),
            query: query.clone(),
        };
        let expected = naive(&case);
        seen.insert(expected.len());
        for detector in [&mut clusters, &mut cells] {
            let pairs = detector.detect(&scene, &query).unwrap();
            agree(&expected, &rows(&pairs), pairs.hash()).unwrap();
        }
    }
    assert!(seen.len() > 2, "the frames differ: {seen:?}");
}

#[test]
fn bodies_come_go_and_change() {
    let mut scene = Scene::new();
    let ball = surfaces::ball(400);
    let a = ball.add_to(&mut scene).unwrap();
    let b = ball.translated([0.5, 0.0, 0.0]).add_to(&mut scene).unwrap();
    let mut detectors = [Method::Clusters, Method::Cells].map(|method| detector(method, 1));
    let mut compare = |scene: &Scene| {
        let case = Case {
            name: "changes".into(),
            scene: scene.clone(),
            query: Query::between_all(),
        };
        let expected = naive(&case);
        for detector in &mut detectors {
            let pairs = detector.detect(scene, &case.query).unwrap();
            agree(&expected, &rows(&pairs), pairs.hash()).unwrap();
        }
        expected.len()
    };
    assert!(compare(&scene) > 0);
    let soup = soup::tetrahedra(100, 0.3, 1);
    scene
        .remesh(b, (soup.elements.clone(), soup.positions.clone()))
        .unwrap();
    assert!(compare(&scene) > 0);
    scene.remove(a).unwrap();
    assert_eq!(compare(&scene), 0);
    assert!(matches!(
        scene.body(a),
        Err(impinge_core::Error::UnknownBody { .. })
    ));
    let again = ball.add_to(&mut scene).unwrap();
    assert_eq!(again.index(), a.index());
    assert_ne!(again, a);
    assert!(compare(&scene) > 0);
}

#[test]
fn metamorphic_twins_agree() {
    let a = surfaces::bumpy_ball(900, 0.3);
    let b = surfaces::torus(30, 16, 0.8, 0.3);
    let pairs_of = |a: &impinge_scenes::Model, b: &impinge_scenes::Model, method| {
        let mut scene = Scene::new();
        let (id_a, id_b) = (a.add_to(&mut scene).unwrap(), b.add_to(&mut scene).unwrap());
        let mut detector = detector(method, 1);
        let pairs = detector
            .detect(&scene, &Query::between(id_a, id_b))
            .unwrap();
        pairs.between(id_a, id_b).collect::<Vec<_>>()
    };
    for method in [Method::Clusters, Method::Cells, Method::Naive] {
        let plain = pairs_of(&a, &b, method);
        assert!(plain.len() > 50);
        let mut swapped: Vec<_> = pairs_of(&b, &a, method)
            .into_iter()
            .map(|[i, j]| [j, i])
            .collect();
        swapped.sort_unstable();
        assert_eq!(plain, swapped);
        // Scaling by a power of two is exact.
        assert_eq!(plain, pairs_of(&a.scaled(0.125), &b.scaled(0.125), method));
        let n = a.n_elements() as u32;
        let mut reversed = a.clone();
        let impinge_core::Elements::Triangles(faces) = &mut reversed.elements else {
            unreachable!()
        };
        faces.reverse();
        for face in faces.iter_mut() {
            face.rotate_left(1);
        }
        let mut permuted: Vec<_> = pairs_of(&reversed, &b, method)
            .into_iter()
            .map(|[i, j]| [n - 1 - i, j])
            .collect();
        permuted.sort_unstable();
        assert_eq!(plain, permuted);
    }
}

#[test]
fn bodies_that_flow_away_are_clustered_again() {
    let rest = surfaces::ball(20_000);
    let mut scene = Scene::new();
    let a = rest.add_to(&mut scene).unwrap();
    let b = rest.translated([0.4, 0.0, 0.0]).add_to(&mut scene).unwrap();
    let query = Query::between(a, b);
    let mut auto = detector(Method::Clusters, 1);
    let mut never = Detector::new(cpu(Method::Clusters, 1).recluster(Recluster::Never)).unwrap();
    assert_eq!(auto.detect(&scene, &query).unwrap().stats().n_clustered, 2);
    never.detect(&scene, &query).unwrap();
    let mut flowed = rest.positions.clone();
    deform::Flow::default().apply(&rest.positions, 40.0, &mut flowed);
    scene.set_positions(a, &flowed).unwrap();
    let by_auto = auto.detect(&scene, &query).unwrap();
    let by_never = never.detect(&scene, &query).unwrap();
    assert!(by_auto.rows().eq(by_never.rows()));
    assert_eq!(by_auto.stats().n_reclustered, 1);
    assert_eq!(by_never.stats().n_reclustered, 0);
    assert!(by_auto.stats().n_work_items < by_never.stats().n_work_items);
    // The next frame has nothing left to recluster.
    scene.set_positions(a, &flowed).unwrap();
    assert_eq!(
        auto.detect(&scene, &query).unwrap().stats().n_reclustered,
        0
    );
}

#[test]
fn a_frame_that_failed_leaves_nothing_behind() {
    let ball = surfaces::bumpy_ball(3_000, 0.2);
    for (method, decided) in [
        (Method::Clusters, 1),
        // Enough frames for culled clusters to be left out.
        (Method::Clusters, 6),
        (Method::Cells, 1),
    ] {
        let mut scene = Scene::new();
        let a = ball.add_to(&mut scene).unwrap();
        let b = ball.translated([0.8, 0.1, 0.0]).add_to(&mut scene).unwrap();
        let query = Query::between(a, b);
        let mut detector = detector(method, 1);
        for _ in 0..decided {
            scene.set_positions(a, &ball.positions).unwrap();
            let place = ball.translated([0.8, 0.1, 0.0]).positions;
            scene.set_positions(b, &place).unwrap();
            assert!(!detector.detect(&scene, &query).unwrap().is_empty());
        }
        // Restoring the clone brings back the old positions and their old stamps, so a stale cache
        // would look valid.
        let saved = scene.clone();
        for bad in [a, b] {
            for body in [a, b] {
                let positions = scene.positions_mut::<f32>(body).unwrap();
                positions.iter_mut().for_each(|point| point[0] += 100.0);
            }
            scene.positions_mut::<f32>(bad).unwrap()[7][1] = f32::NAN;
            assert!(detector.detect(&scene, &query).is_err());
            scene = saved.clone();
            for offset in [[0.8, 0.1, 0.0], [-0.8, 0.1, 0.0], [0.0, 0.0, 0.9]] {
                let mut fresh = impinge_tests::detector(method, 1);
                let expected = fresh.detect(&scene, &query).unwrap();
                assert!(!expected.is_empty());
                let found = detector.detect(&scene, &query).unwrap();
                assert!(
                    found.rows().eq(expected.rows()),
                    "{method:?} {decided} {offset:?}"
                );
                let place = ball.translated(offset).positions;
                scene.set_positions(b, &place).unwrap();
            }
            scene = saved.clone();
        }
    }
}

/// Two balls of many triangles, and where the second one is at rest.
fn large_balls(scene: &mut Scene) -> [impinge_core::BodyId; 2] {
    let ball = surfaces::ball(12_000);
    let b = ball.translated([0.5, 0.1, 0.0]);
    [ball, b].map(|model| model.add_to(scene).unwrap())
}

#[test]
fn auto_asks_the_grid_once_and_clusters_from_then_on() {
    let mut scene = Scene::new();
    let [a, b] = large_balls(&mut scene);
    let query = Query::between(a, b);
    let mut auto = detector(Method::Auto, 2);
    let mut clusters = detector(Method::Clusters, 2);
    let mut ask = |scene: &Scene, query: &Query| {
        let pairs = auto.detect(scene, query).unwrap();
        let expected = clusters.detect(scene, query).unwrap();
        assert!(pairs.rows().eq(expected.rows()));
        pairs.stats().method
    };
    assert_eq!(ask(&scene, &query), "cells");
    assert_eq!(ask(&scene, &query), "clusters");
    // Bodies that are known stay known, whichever question they were in.
    assert_eq!(ask(&scene, &Query::self_of(a)), "clusters");
    let [c, d] = large_balls(&mut scene);
    assert_eq!(
        ask(&scene, &Query::between(b, c)),
        "clusters",
        "half of it is known"
    );
    assert_eq!(
        ask(&scene, &Query::between(a, d)),
        "clusters",
        "half of it is known"
    );
    let [e, f] = large_balls(&mut scene);
    assert_eq!(ask(&scene, &Query::between(e, f)), "cells");
    // A new topology is a new body.
    for body in [e, f] {
        let (elements, positions) = {
            let held = scene.body(body).unwrap();
            (held.elements().clone(), held.positions().clone())
        };
        scene.remesh(body, (elements, positions)).unwrap();
    }
    assert_eq!(ask(&scene, &Query::between(e, f)), "cells");
    assert_eq!(ask(&scene, &Query::between(e, f)), "clusters");
    // Small bodies do not count, however many they are; nor do few elements.
    let mut small = Scene::new();
    for ix in 0..40 {
        let at = [0.5 * ix as f32, 0.1, 0.0];
        surfaces::ball(400)
            .translated(at)
            .add_to(&mut small)
            .unwrap();
    }
    assert_eq!(ask(&small, &Query::between_all()), "clusters");
    let mut few = Scene::new();
    for at in [0.0, 0.5] {
        surfaces::ball(4_000)
            .translated([at, 0.1, 0.0])
            .add_to(&mut few)
            .unwrap();
    }
    assert_eq!(ask(&few, &Query::between_all()), "clusters");
}

#[test]
fn auto_finds_the_same_in_the_grid_as_clusters_do() {
    let mut scene = Scene::new();
    let tetrahedra = soup::tetrahedra(3_000, 0.05, 1);
    let triangles = soup::triangles(6_000, 0.03, 2);
    let ball = surfaces::bumpy_ball(5_000, 0.2);
    scene
        .add((tetrahedra.elements.clone(), tetrahedra.positions.clone()))
        .unwrap();
    scene
        .add((triangles.elements.clone(), triangles.positions_f64()))
        .unwrap();
    scene
        .add((ball.elements.clone(), ball.positions.clone()))
        .unwrap();
    scene
        .add((ball.elements.clone(), ball.positions_f64()))
        .unwrap();
    // And one that meets no other.
    ball.translated([3.0, 0.0, 0.0]).add_to(&mut scene).unwrap();
    // Under `Resolve`, clusters decide neighbours per vertex, and the grid does not: then the first
    // frame takes clusters.
    for query in [
        Query::between_all(),
        Query::all().shared_vertex(SharedVertex::Skip),
    ] {
        let new = |method| detector(method, 2);
        let mut clusters = new(Method::Clusters);
        let expected = clusters.detect(&scene, &query).unwrap();
        let n = expected.len() as u64;
        assert!(n > 1_000, "{n}");
        let mut auto = new(Method::Auto);
        let found = auto.detect(&scene, &query).unwrap();
        assert_eq!(found.stats().method, "cells");
        assert!(expected.rows().eq(found.rows()));
        assert_eq!(new(Method::Auto).count(&scene, &query).unwrap(), n);
        assert!(new(Method::Auto).any(&scene, &query).unwrap());
    }
}

#[test]
fn auto_frees_the_grid_and_what_bodies_that_are_gone_had() {
    let mut scene = Scene::new();
    let [a, b] = large_balls(&mut scene);
    let mut auto = detector(Method::Auto, 1);
    let mut held = |scene: &Scene, method: &str| {
        // Neither the pairs nor memory to sort them in is held.
        auto.count(scene, &Query::between_all()).unwrap();
        assert_eq!(auto.stats().method, method);
        auto.stats().bytes_held
    };
    let grid = held(&scene, "cells");
    let clusters = held(&scene, "clusters");
    assert!(grid < clusters / 4, "{grid} of {clusters}");
    // Far apart: the grid is not even made.
    for (ix, body) in large_balls(&mut scene).into_iter().enumerate() {
        let matrix = [
            [1.0, 0.0, 0.0, 100.0 + 100.0 * ix as f64],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        scene.set_transform(body, &matrix).unwrap();
    }
    large_balls(&mut scene);
    let with_old = held(&scene, "cells");
    assert!(with_old > clusters / 2, "{with_old} of {clusters}");
    scene.remove(a).unwrap();
    scene.remove(b).unwrap();
    for _ in 0..3 {
        large_balls(&mut scene);
    }
    let left = held(&scene, "cells");
    // At least the order and the corners of 24,000 triangles. Clusters have a few bytes more, how
    // many depends on the instruction set; the rest is of all bodies together.
    assert!(left + 16 * 24_000 < with_old, "{left} of {with_old}");
}

#[test]
fn auto_leaves_crowded_cells_resolved_neighbours_and_budgets_to_clusters() {
    let ask = |model: &impinge_scenes::Model, rule, memory_budget| {
        let mut scene = Scene::new();
        model.add_to(&mut scene).unwrap();
        let query = Query::all().shared_vertex(rule);
        let mut auto = Detector::new(cpu(Method::Auto, 2).memory_budget(memory_budget)).unwrap();
        let pairs = auto.detect(&scene, &query).unwrap();
        let mut cells = detector(Method::Cells, 2);
        assert!(
            pairs
                .rows()
                .eq(cells.detect(&scene, &query).unwrap().rows())
        );
        assert_eq!(
            pairs.stats().grid.is_some(),
            pairs.stats().method == "cells"
        );
        pairs.stats().method
    };
    let knot = surfaces::torus_knot(20_000, Default::default());
    assert_eq!(ask(&knot, SharedVertex::Skip, None), "cells");
    assert_eq!(ask(&knot, SharedVertex::Resolve, None), "clusters");
    assert_eq!(ask(&knot, SharedVertex::Skip, Some(1 << 28)), "clusters");
    // Almost all triangles in a small part of the whole.
    let mut crowded = surfaces::torus_knot(20_000, Default::default()).scaled(1.0 / 1024.0);
    crowded.positions[0] = [1.0, 1.0, 1.0];
    crowded.positions[1] = [-1.0, -1.0, -1.0];
    assert_eq!(ask(&crowded, SharedVertex::Skip, None), "clusters");
}

#[test]
fn auto_refuses_what_the_grid_does_not_look_at() {
    let mut scene = Scene::new();
    let [a, b] = large_balls(&mut scene);
    scene.positions_mut::<f32>(a).unwrap()[7] = [f32::NAN; 3];
    let mut auto = detector(Method::Auto, 2);
    let error = auto.detect(&scene, &Query::between(a, b)).unwrap_err();
    assert!(error.to_string().contains("vertex 7"), "{error}");
}

#[test]
fn pairs_of_all_cells_are_the_pairs_of_the_whole() {
    const INFINITY: f64 = f64::INFINITY;
    // Every kind of case is among them.
    for case in cases().into_iter().step_by(3) {
        let expected = naive(&case);
        let mut detector = detector(Method::Clusters, 1);
        let mut found = Vec::new();
        for octant in 0..8 {
            // Cut at lattice points, where boxes end.
            let is_high = [0, 1, 2].map(|axis| octant >> axis & 1 == 1);
            let low = is_high.map(|is_high| if is_high { 1.0 } else { -INFINITY });
            let high = is_high.map(|is_high| if is_high { INFINITY } else { 1.0 });
            let query = case.query.clone().owned_by(low, high);
            let n = detector.count(&case.scene, &query).unwrap();
            assert_eq!(detector.any(&case.scene, &query).unwrap(), n > 0);
            let pairs = detector.detect(&case.scene, &query).unwrap();
            assert_eq!(pairs.len() as u64, n);
            found.extend(pairs.rows());
        }
        found.sort_unstable();
        assert_eq!(found, expected, "{}", case.name);
    }
}

#[test]
fn cells_are_refused_where_they_mean_nothing() {
    let mut scene = Scene::new();
    let [a, b] = large_balls(&mut scene);
    let mut detector = detector(Method::Auto, 1);
    let query = Query::between(a, b).owned_by([0.0; 3], [f64::NAN; 3]);
    let error = detector.detect(&scene, &query).unwrap_err().to_string();
    assert!(error.starts_with("owned_by: "), "{error}");
    let upside_down = Query::between(a, b).owned_by([1.0; 3], [0.0; 3]);
    let error = detector
        .detect(&scene, &upside_down)
        .unwrap_err()
        .to_string();
    assert!(error.starts_with("owned_by: "), "{error}");
    // All pairs count, but not for a yes or no.
    let everywhere = Query::between(a, b).owned_by([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]);
    let mut few = Detector::new(cpu(Method::Clusters, 1).max_pairs(Some(1))).unwrap();
    let refused = few.detect(&scene, &everywhere).unwrap_err();
    assert!(
        matches!(refused, impinge_core::Error::TooManyPairs { .. }),
        "{refused}"
    );
    assert!(few.any(&scene, &everywhere).unwrap());
}

#[test]
fn positions_that_are_taken_over_are_those_of_the_body() {
    let mut scene = Scene::new();
    let [a, b] = large_balls(&mut scene);
    let query = Query::between(a, b);
    let mut detector = detector(Method::Clusters, 1);
    detector.detect(&scene, &query).unwrap();
    let ball = surfaces::ball(12_000);
    let mut copied = scene.clone();
    let _other = ball.positions.clone();
    for frame in 1..4 {
        let next = ball.translated([0.1 * frame as f32, 0.0, 0.2]).positions;
        copied.set_positions(b, &next).unwrap();
        let first = next.as_ptr();
        scene.set_positions(b, next).unwrap();
        let Positions::F32(held) = scene.body(b).unwrap().positions() else {
            panic!("given in single precision");
        };
        assert_eq!(held.as_ptr(), first);
        let found = rows(&detector.detect(&scene, &query).unwrap());
        assert!(!found.is_empty());
        assert_eq!(found, rows(&detector.detect(&copied, &query).unwrap()));
    }
    let before = scene.body(b).unwrap().positions().clone();
    assert!(scene.set_positions(b, vec![[0.0f32; 3]; 2]).is_err());
    let bad = vec![[f32::NAN; 3]; before.len()];
    assert!(scene.set_positions(b, bad).is_err());
    assert_eq!(*scene.body(b).unwrap().positions(), before);
}

#[test]
fn lent_positions_are_those_that_would_have_been_copied() {
    let mut scene = Scene::new();
    let [a, b] = large_balls(&mut scene);
    let query = Query::between(a, b);
    let mut detector = detector(Method::Clusters, 1);
    detector.detect(&scene, &query).unwrap();
    let ball = surfaces::ball(12_000);
    let mut copied = scene.clone();
    let mut last = None;
    for frame in 1..4 {
        let next = Arc::new(ball.translated([0.1 * frame as f32, 0.0, 0.2]).positions);
        copied.set_positions(b, &next[..]).unwrap();
        scene.set_positions(b, Arc::clone(&next)).unwrap();
        let Positions::F32(held) = scene.body(b).unwrap().positions() else {
            panic!("lent in single precision");
        };
        assert!(std::ptr::eq(&held[..], &next[..]));
        let found = rows(&detector.detect(&scene, &query).unwrap());
        assert!(!found.is_empty());
        assert_eq!(found, rows(&detector.detect(&copied, &query).unwrap()));
        // The scene has dropped the frame before.
        if let Some(mut last) = last.replace(next) {
            assert!(Arc::get_mut(&mut last).is_some());
        }
    }
    // A clone shares what is shared; whoever writes copies first.
    let mut lent = last.unwrap();
    let before = lent.as_ref().clone();
    let clone = scene.clone();
    assert_eq!(Arc::strong_count(&lent), 3);
    scene.positions_mut::<f32>(b).unwrap()[0] = [9.0; 3];
    assert_eq!(
        clone.body(b).unwrap().positions().point(0),
        before[0].map(f64::from)
    );
    drop(clone);
    assert_eq!(*Arc::get_mut(&mut lent).unwrap(), before);
    let share = || Arc::clone(&lent);
    let other = vec![[0.5f32; 3]; before.len()];
    scene.set_positions(b, share()).unwrap();
    let shift = |x: f64| {
        let mut matrix = [[0.0; 4]; 4];
        (0..4).for_each(|ix| matrix[ix][ix] = 1.0);
        matrix[0][3] = x;
        matrix
    };
    scene.set_transform(b, &shift(8.0)).unwrap();
    assert_eq!(*lent, before);
    assert_eq!(
        *scene.body(b).unwrap().rest_positions(),
        Positions::from(before.clone())
    );
    // A transform that is refused brings the shared positions back.
    scene.set_positions(b, share()).unwrap();
    assert!(scene.set_transform(b, &shift(1e300)).is_err());
    assert_eq!(
        *scene.body(b).unwrap().positions(),
        Positions::from(before.clone())
    );
    scene.set_positions(b, &other).unwrap();
    assert_eq!(Arc::strong_count(&lent), 1);
}

#[test]
fn lent_positions_are_checked_at_once() {
    let mut scene = Scene::new();
    let [_, b] = large_balls(&mut scene);
    let before = scene.body(b).unwrap().positions().clone();
    let n = before.len();
    let mut bad = vec![[0.0f64; 3]; n];
    bad[n - 1][2] = f64::INFINITY;
    for refused in [vec![[0.0; 3]; n - 1], bad] {
        let shared = || Arc::new(refused.clone());
        let expected = scene.set_positions(b, &refused).unwrap_err().to_string();
        let error = scene.set_positions(b, shared()).unwrap_err();
        assert_eq!(error.to_string(), expected);
        let error = scene.set_end_positions(b, shared()).unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
    assert_eq!(*scene.body(b).unwrap().positions(), before);
    assert_eq!(scene.body(b).unwrap().end_positions(), None);
}

#[test]
fn lent_ends_of_a_step_are_those_that_would_have_been_copied() {
    let mut scene = Scene::new();
    let [_, b] = large_balls(&mut scene);
    let mut copied = scene.clone();
    let mut detector = detector(Method::Clusters, 1);
    let ball = surfaces::ball(12_000);
    let ends = [0.9, 0.6].map(|x| ball.translated([x, 0.0, 0.2]));
    // The second end is in double precision: the start is widened.
    copied.set_end_positions(b, &ends[0].positions).unwrap();
    scene
        .set_end_positions(b, Arc::new(ends[0].positions.clone()))
        .unwrap();
    for wide in [false, true] {
        if wide {
            let end = ends[1].positions_f64();
            copied.set_end_positions(b, &end).unwrap();
            scene.set_end_positions(b, end).unwrap();
        }
        let [lent, copy] = [&scene, &copied].map(|scene| scene.body(b).unwrap());
        assert_eq!(lent.positions(), copy.positions());
        assert_eq!(lent.end_positions(), copy.end_positions());
        let step = Query::between_all();
        let hash = detector.impacts(&copied, &step).unwrap().hash();
        let impacts = detector.impacts(&scene, &step).unwrap();
        assert!(!impacts.is_empty() && impacts.hash() == hash);
    }
}

#[test]
fn lent_ends_are_dropped_when_the_body_stands_still() {
    let mut scene = Scene::new();
    let [_, b] = large_balls(&mut scene);
    let mut detector = detector(Method::Clusters, 1);
    let start = scene.body(b).unwrap().positions().clone();
    let lent = Arc::new(surfaces::ball(12_000).translated([9.0; 3]).positions);
    let unit: [[f64; 4]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    type Stop<'a> = &'a dyn Fn(&mut Scene) -> Result<(), Error>;
    let stops: [Stop<'_>; 4] = [
        &|scene| scene.clear_end_positions(b),
        &|scene| scene.set_positions(b, &start),
        &|scene| scene.set_transform(b, &unit),
        &|scene| scene.positions_mut::<f32>(b).map(drop),
    ];
    for stop in stops {
        scene.set_end_positions(b, Arc::clone(&lent)).unwrap();
        stop(&mut scene).unwrap();
        assert_eq!(Arc::strong_count(&lent), 1);
        assert_eq!(scene.body(b).unwrap().end_positions(), None);
    }
    // A step that is taken drops them, too.
    let step = Query::between_all().start(Start::Skip);
    scene.set_end_positions(b, Arc::clone(&lent)).unwrap();
    let advance = detector.advance(&scene, &step).unwrap();
    advance.apply(&mut scene).unwrap();
    drop(advance);
    assert_eq!(Arc::strong_count(&lent), 1);
}
