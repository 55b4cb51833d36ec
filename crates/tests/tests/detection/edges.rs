//! Edges that are numbered by the caller: every answer that names edges, beside the same answer in
//! the library's numbers.

use std::collections::BTreeMap;

use impinge_core::exact::Feature;
use impinge_core::{
    BodyId, Detector, Element, Elements, Error, PairKind, Part, Query, Scene, Thickness,
};
use impinge_scenes::{Random, solids, surfaces};
use impinge_tests::detectors;

/// Crumpled cloth, and a solid that meets it; random end positions.
fn scene(seed: u64) -> (Scene, [BodyId; 2]) {
    let mut random = Random::new(seed);
    let mut scene = Scene::new();
    let models = [surfaces::cloth(9, 7, 0.2), solids::block(3, 3, 3, 0.25)];
    let bodies = models.map(|model| {
        let mut at = |by: f32| -> Vec<[f32; 3]> {
            let mut moved = |p: &[f32; 3]| {
                let q = random.point(-0.1, 0.1);
                [p[0] + q[0], p[1] + q[1], p[2] + q[2] + by]
            };
            model.positions.iter().map(&mut moved).collect()
        };
        let (start, end) = (at(0.0), at(0.1));
        let body = scene.add((model.elements.clone(), start)).expect("good");
        scene.set_end_positions(body, end).expect("good");
        body
    });
    (scene, bodies)
}

fn edges(scene: &Scene, body: BodyId) -> Vec<[u32; 2]> {
    match scene.body(body).expect("held").edges() {
        Elements::Edges(edges) => edges.clone(),
        _ => panic!("edges are edges"),
    }
}

/// The same edges in a random order; every second one in the other direction, if `turned`.
fn shuffled(seed: u64, mut edges: Vec<[u32; 2]>, turned: bool) -> Vec<[u32; 2]> {
    let mut random = Random::new(seed);
    for ix in (1..edges.len()).rev() {
        edges.swap(ix, random.below(ix as u32 + 1) as usize);
    }
    for edge in edges.iter_mut().step_by(2).filter(|_| turned) {
        edge.reverse();
    }
    edges
}

/// An element or a feature of one by its body and its vertices, in order.
type Named = (usize, Vec<u32>);

fn corners(scene: &Scene, part: Part, of: Element) -> Vec<u32> {
    match part {
        Part::Vertices => vec![of.element],
        _ => {
            let body = scene.body(of.body).expect("held");
            body.part(part).corners(of.element as usize).to_vec()
        }
    }
}

fn named(scene: &Scene, part: Part, of: Element) -> Named {
    let mut corners = corners(scene, part, of);
    corners.sort_unstable();
    (of.body.index(), corners)
}

/// A pair by its vertices, the same whichever element comes first.
fn pair(scene: &Scene, kind: PairKind, [a, b]: [Element; 2]) -> Vec<Named> {
    let [of_a, of_b] = kind.parts();
    let mut pair = vec![named(scene, of_a, a), named(scene, of_b, b)];
    pair.sort();
    pair
}

/// The vertices of a feature.
fn feature(scene: &Scene, part: Part, of: Element, feature: Feature) -> Named {
    let corners = corners(scene, part, of);
    let mut own = match feature {
        Feature::Vertex(ix) => vec![corners[usize::from(ix)]],
        Feature::Edge(ix) => {
            let ix = usize::from(ix);
            vec![corners[ix], corners[(ix + 1) % corners.len()]]
        }
        Feature::Face => corners,
    };
    own.sort_unstable();
    (of.body.index(), own)
}

/// Numbers by what they belong to.
type Answer = BTreeMap<(&'static str, Option<PairKind>, Vec<Named>), Vec<f64>>;

/// What every question says that names edges, by vertices; and its hashes.
fn answers(detector: &mut Detector, scene: &Scene) -> (Answer, Vec<u64>) {
    let query = Query::all();
    let mut all = Answer::new();
    let every = query.clone().kinds(PairKind::ALL);
    let every = every.distances().closest_points();
    let near = detector.near(scene, 0.08, &every).expect("near pairs");
    let rest: Vec<[f64; 3]> = (scene.bodies())
        .flat_map(|(_, body)| (0..body.n_vertices()).map(|ix| body.positions().point(ix)))
        .collect();
    for of in near.iter() {
        let mut name = pair(scene, of.kind, [of.a, of.b]);
        let [part_a, part_b] = of.kind.parts();
        let mut features = [
            feature(scene, part_a, of.a, of.features[0]),
            feature(scene, part_b, of.b, of.features[1]),
        ];
        features.sort();
        name.extend(features);
        let closest = of.closest.expect("asked for").points;
        let mut numbers = vec![of.distance.expect("asked for")];
        // Sums of both points do not depend on which comes first.
        numbers.extend((0..3).map(|axis| closest[0][axis] + closest[1][axis]));
        assert!(all.insert(("near", Some(of.kind), name), numbers).is_none());
    }
    let kinds = [PairKind::VertexFace, PairKind::EdgeEdge];
    let solved = query.clone().kinds(kinds);
    let solved = detector.near(scene, 0.08, &solved).expect("near pairs");
    let stencils = solved.stencils_by_area(scene, &rest).expect("stencils");
    assert_eq!(stencils.len(), solved.len());
    for (of, stencil) in solved.iter().zip(stencils.iter()) {
        let name = pair(scene, of.kind, [of.a, of.b]);
        all.insert(("stencil", Some(of.kind), name), vec![stencil.weight]);
    }
    let impacts = detector.impacts(scene, &query).expect("impacts");
    for of in impacts.iter() {
        let name = pair(scene, of.kind, [of.a, of.b]);
        all.insert(("impact", Some(of.kind), name), vec![of.toi]);
    }
    let candidates = detector.candidates(scene, 0.01, &query);
    let candidates = candidates.expect("candidates");
    for (kind, a, b) in candidates.iter() {
        let name = pair(scene, kind, [a, b]);
        all.insert(("candidate", Some(kind), name), vec![]);
    }
    let lists = detector.neighbours(scene, 0.08, &query);
    let lists = lists.expect("lists");
    let ids: Vec<BodyId> = lists.bodies().collect();
    let located = |part: Part, number: u32| {
        let first = |&&body: &&BodyId| lists.first(body, part).expect("held") <= number;
        let body = *ids.iter().rev().find(first).expect("the first is 0");
        let element = number - lists.first(body, part).expect("held");
        Element { body, element }
    };
    for kind in PairKind::ALL {
        let [part_a, part_b] = kind.parts();
        let of = lists.of(kind);
        for row in 0..of.offsets.len().saturating_sub(1) {
            for (column, distance) in of.of(row) {
                let a = located(part_a, row as u32);
                let name = pair(scene, kind, [a, located(part_b, column)]);
                all.insert(("list", Some(kind), name), vec![distance]);
            }
        }
    }
    let first = detector.earliest(scene, &query).expect("the first");
    let first = first.expect("something touches");
    all.insert(("earliest", None, vec![]), vec![first.toi]);
    let hashes = vec![near.hash(), impacts.hash(), candidates.hash()];
    (all, hashes)
}

/// Compares the pairs and their numbers: times exactly, others up to the rounding, which may depend
/// on the direction of an edge and on which of two comes first.
fn compare(expected: &Answer, answer: &Answer) {
    assert!(expected.keys().eq(answer.keys()));
    for ((name, expected), answer) in expected.iter().zip(answer.values()) {
        match name.0 {
            "impact" | "earliest" => assert_eq!(expected, answer, "{name:?}"),
            _ => {
                let mut each = expected.iter().zip(answer);
                let are_close = each.all(|(x, y)| (x - y).abs() < 1e-12);
                assert!(are_close, "{name:?}: {expected:?} {answer:?}");
            }
        }
    }
}

#[test]
fn answers_have_the_callers_numbers() {
    for turned in [false, true] {
        let (before, bodies) = scene(31);
        let mut after = before.clone();
        for body in bodies {
            let rows = shuffled(7, edges(&before, body), turned);
            after.set_edges(body, &rows).expect("the same edges");
            assert_eq!(edges(&after, body), rows);
            assert!(after.body(body).expect("held").has_own_edges());
        }
        let mut hashes = Vec::new();
        for mut detector in detectors() {
            let (expected, old) = answers(&mut detector, &before);
            let of = |name| expected.keys().filter(|key| key.0 == name).count();
            for name in ["near", "stencil", "impact", "candidate", "list"] {
                assert!(of(name) > 80, "{name}: {}", of(name));
            }
            // The detector has the clusters of the old edges now.
            let (answer, own) = answers(&mut detector, &after);
            compare(&expected, &answer);
            assert!(old.iter().zip(&own).all(|(old, own)| old != own));
            hashes.push(own);
        }
        assert!(hashes.iter().all(|own| *own == hashes[0]));
    }
}

#[test]
fn no_rows_are_the_numbers_of_the_library() {
    let (mut scene, [cloth, _]) = scene(32);
    let own = edges(&scene, cloth);
    let hash = |scene: &Scene| {
        let [mut detector, ..] = detectors();
        detector
            .near(scene, 0.1, &Query::all())
            .expect("near")
            .hash()
    };
    let expected = hash(&scene);
    scene
        .set_edges(cloth, &shuffled(3, own.clone(), true))
        .expect("good");
    assert_ne!(hash(&scene), expected);
    let set = scene.clone();
    scene.set_edges(cloth, &[]).expect("good");
    assert_eq!(
        (edges(&scene, cloth), hash(&scene)),
        (own.clone(), expected)
    );
    assert!(!scene.body(cloth).expect("held").has_own_edges());
    // So are those of new elements.
    let mut scene = set;
    let body = scene.body(cloth).expect("held").clone();
    let mesh = (body.elements().clone(), body.positions().clone());
    scene.remesh(cloth, mesh).expect("good");
    assert_eq!(edges(&scene, cloth), own);
}

#[test]
fn a_thickness_of_each_edge_moves_with_its_edge() {
    let (mut before, [cloth, _]) = scene(33);
    let own = edges(&before, cloth);
    let rows = shuffled(5, own.clone(), true);
    let thick = |[a, b]: &[u32; 2]| f64::from(a.min(b) % 7 + a.max(b) % 5) * 0.01;
    let each = |rows: &[[u32; 2]]| -> Vec<f64> { rows.iter().map(thick).collect() };
    let mut after = before.clone();
    let set = before.set_thickness(cloth, Thickness::edges(each(&own)));
    set.expect("good");
    before.set_edges(cloth, &rows).expect("the same edges");
    after.set_edges(cloth, &rows).expect("the same edges");
    let set = after.set_thickness(cloth, Thickness::edges(each(&rows)));
    set.expect("good");
    let of = |scene: &Scene| {
        let body = scene.body(cloth).expect("held");
        body.thickness_by_element().map(|(_, each)| each.to_vec())
    };
    assert_eq!(of(&before), Some(each(&rows)));
    for mut detector in detectors() {
        let mut hash = |scene: &Scene| {
            let near = detector.near(scene, 0.02, &Query::all());
            near.expect("near pairs").hash()
        };
        assert_eq!(hash(&before), hash(&after));
    }
}

#[test]
fn wrong_edges_are_refused_by_name() {
    let (mut scene, [cloth, block]) = scene(34);
    let own = edges(&scene, cloth);
    let n = own.len();
    let rod = scene
        .add_edges(&[[0, 1]], &[[0.0f32; 3], [1.0; 3]])
        .expect("good");
    let points = scene.add_points(&[[0.0f32; 3]]).expect("good");
    let mut refuse = |body: BodyId, rows: &[[u32; 2]]| {
        let error = scene.set_edges(body, rows).unwrap_err();
        assert_eq!(edges(&scene, cloth), own, "{error}");
        (error.to_string(), error)
    };
    let mut rows = own.clone();
    rows[5] = [62, 0];
    let (text, error) = refuse(cloth, &rows);
    assert!(matches!(
        error,
        Error::Edge {
            row: 5,
            vertices: [62, 0],
            ..
        }
    ));
    assert_eq!(
        text,
        "body 0: row 5 of edges has vertices 62 and 0, between which there is no edge"
    );
    // No vertex at all, and a vertex twice.
    for bad in [[u32::MAX, 0], [1, 1]] {
        rows[5] = bad;
        assert!(refuse(cloth, &rows).0.contains("row 5"));
    }
    rows[5] = [own[3][1], own[3][0]];
    let (text, error) = refuse(cloth, &rows);
    assert!(matches!(error, Error::Edge { row: 5, .. }));
    assert!(text.starts_with("body 0: row 5 of edges") && text.ends_with(", as row 3 has"));
    rows.remove(5);
    let (text, _) = refuse(cloth, &rows);
    let expected = format!(
        "body 0: {} rows of edges given, but there are {n} edges",
        n - 1
    );
    assert_eq!(text, expected);
    let (text, _) = refuse(rod, &[[0, 1]]);
    assert_eq!(
        text,
        "body 2 is made of edges, where triangles or tetrahedra are needed"
    );
    let (text, _) = refuse(points, &[]);
    assert_eq!(
        text,
        "body 3 is made of points, where triangles or tetrahedra are needed"
    );
    // An edge inside of tetrahedra is none of the surface.
    let inside = |scene: &Scene| {
        let surface = edges(scene, block);
        let Elements::Tetrahedra(tets) = scene.body(block).expect("held").elements() else {
            panic!("tetrahedra");
        };
        let sides = tets
            .iter()
            .flat_map(|t| [[t[0], t[1]], [t[0], t[2]], [t[1], t[3]]]);
        let is_inside = |&[a, b]: &[u32; 2]| !surface.contains(&[a.min(b), a.max(b)]);
        sides.into_iter().find(is_inside).expect("some are")
    };
    let mut rows = edges(&scene, block);
    rows[0] = inside(&scene);
    assert!(matches!(
        scene.set_edges(block, &rows),
        Err(Error::Edge { row: 0, .. })
    ));
    scene.remove(rod).expect("held");
    assert!(matches!(
        scene.set_edges(rod, &[]),
        Err(Error::UnknownBody { .. })
    ));
}
