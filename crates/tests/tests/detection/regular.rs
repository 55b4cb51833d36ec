//! Flat and regular meshes: the oracle's answers, without exact arithmetic.

use impinge_core::{Method, Query, Scene, SharedVertex};
use impinge_scenes::{Model, regular};
use impinge_tests::{Case, check, cpu, detector, naive};

/// One case per precision: each has its own filters.
fn cases(name: &str, model: &Model, rule: SharedVertex) -> [Case; 2] {
    [false, true].map(|double| {
        let mut scene = Scene::new();
        let body = if double {
            scene.add((model.elements.clone(), model.positions_f64()))
        } else {
            scene.add((model.elements.clone(), model.positions.clone()))
        };
        Case {
            name: format!("{name}, {rule:?}, f64 {double}"),
            scene,
            query: Query::self_of(body.unwrap()).shared_vertex(rule),
        }
    })
}

#[test]
fn regular_meshes_are_decided_by_filters() {
    for surface in regular::ALL {
        let model = (surface.build)(1_500);
        for rule in [SharedVertex::Skip, SharedVertex::Resolve] {
            for case in cases(surface.name, &model, rule) {
                let expected = naive(&case);
                assert!(expected.is_empty(), "{}", case.name);
                check(&case, &expected, cpu(Method::Clusters, 1));
                check(&case, &expected, cpu(Method::Cells, 1));
                let mut detector = detector(Method::Clusters, 1);
                let pairs = detector.detect(&case.scene, &case.query).unwrap();
                let stats = pairs.stats();
                assert!(
                    50 * stats.n_unsure <= stats.n_candidates,
                    "{}: {} of {}",
                    case.name,
                    stats.n_unsure,
                    stats.n_candidates
                );
            }
        }
    }
}

/// A sheet folded onto itself overlaps in one plane, and touches along edges and at single points.
#[test]
fn folded_sheets_are_answered_as_by_the_oracle() {
    for surface in regular::ALL {
        for crease in [4.0, 4.25, 4.5] {
            let model = (surface.build)(600);
            let model = model.mapped(|[x, y, z]| [(x - crease).abs(), y, z]);
            for rule in [SharedVertex::Skip, SharedVertex::Resolve] {
                for case in cases(surface.name, &model, rule) {
                    check(&case, &naive(&case), cpu(Method::Clusters, 1));
                }
            }
        }
    }
}
