//! What a step knows of its start: intersections that touch nothing, and seams of meshes that were
//! not welded.

use impinge::{BodyId, Error, PairFilter, PairKind, Query, Scene, Start, Weld};
use impinge_tests::detectors;

/// A thin rod through a plate: edges of the rod pass through the insides of two faces, and no
/// vertex is near any face of the other body.
fn rod_through_plate() -> (Scene, [BodyId; 2]) {
    let mut scene = Scene::new();
    let plate = scene
        .add_triangles(
            &[[0, 1, 2], [0, 2, 3]],
            &[
                [-100.0f32, -100.0, 0.0],
                [100.0, -100.0, 0.0],
                [100.0, 100.0, 0.0],
                [-100.0, 100.0, 0.0],
            ],
        )
        .expect("good");
    // Corner i at one end, i + 4 at the other.
    let ring = [
        [20.0f32, -20.0],
        [22.0, -20.0],
        [22.0, -22.0],
        [20.0, -22.0],
    ];
    let rod: Vec<[f32; 3]> = [-50.0f32, 50.0]
        .iter()
        .flat_map(|&z| ring.map(|[x, y]| [x, y, z]))
        .collect();
    let sides = (0..4u32).flat_map(|i| {
        let j = (i + 1) % 4;
        [[i, j, j + 4], [i, j + 4, i + 4]]
    });
    let faces: Vec<[u32; 3]> = sides.collect();
    let rod = scene.add_triangles(&faces, &rod).expect("good");
    (scene, [plate, rod])
}

#[test]
fn a_rod_through_a_plate_is_near_it() {
    let (scene, [plate, rod]) = rod_through_plate();
    for mut detector in detectors() {
        let n_pairs = detector.count(&scene, &Query::between_all()).expect("good");
        assert_eq!(n_pairs, 8);
        for distance in [0.0, 2.0] {
            let query = Query::between_all().closest_points();
            let near = detector.near(&scene, distance, &query).expect("good");
            // Four sides and four diagonals pass through the one face of the plate.
            assert_eq!(near.len(), 8, "{distance}");
            for pair in near.iter() {
                assert_eq!(
                    (pair.kind, pair.a.body, pair.b.body),
                    (PairKind::EdgeFace, rod, plate)
                );
                let closest = pair.closest.expect("asked for");
                assert_eq!(closest.distance, 0.0);
                assert_eq!(closest.points[0], closest.points[1]);
                assert_eq!(closest.points[0][2], 0.0);
            }
        }
    }
}

#[test]
fn a_start_that_intersects_is_not_free_if_asked() {
    let (mut scene, [plate, rod]) = rod_through_plate();
    let end: Vec<[f32; 3]> = [-49.0f32, 51.0]
        .iter()
        .flat_map(|&z| {
            [
                [20.0, -20.0, z],
                [22.0, -20.0, z],
                [22.0, -22.0, z],
                [20.0, -22.0, z],
            ]
        })
        .collect();
    scene.set_end_positions(rod, &end).expect("good");
    for mut detector in detectors() {
        // Nothing touches on the way.
        let report = Query::all();
        assert!(detector.is_free(&scene, &report).expect("good"));
        let advance = detector.advance(&scene, &report).expect("good");
        assert_eq!((advance.fraction, advance.start_intersects), (1.0, None));
        let impacts = detector.impacts(&scene, &report).expect("good");
        assert_eq!((impacts.len(), impacts.start_intersects()), (0, None));

        let verify = Query::all().start(Start::Verify);
        assert!(!detector.is_free(&scene, &verify).expect("good"));
        let advance = detector.advance(&scene, &verify).expect("good");
        assert_eq!((advance.fraction, advance.first), (0.0, None));
        assert_eq!(advance.start_intersects, Some(true));
        assert_eq!(
            advance.positions(rod),
            Some(scene.body(rod).expect("known").positions())
        );
        let impacts = detector.impacts(&scene, &verify).expect("good");
        assert_eq!((impacts.len(), impacts.start_intersects()), (0, Some(true)));
        // What the start took is said, also where the step is asked about after it.
        let apart = verify.clone().exclude((plate, rod));
        for query in [&verify, &apart] {
            let impacts = detector.impacts(&scene, query).expect("good");
            let stages = impacts.stats().stages.iter().map(|stage| stage.name);
            assert_eq!(stages.filter(|&name| name == "start").count(), 1);
        }
        assert_eq!(detector.earliest(&scene, &verify).expect("good"), None);
        assert_eq!(detector.start_intersects(), Some(true));
        assert_eq!(detector.earliest(&scene, &report).expect("good"), None);
        assert_eq!(detector.start_intersects(), None);
        // Pairs that may not collide do not intersect either.
        for (may, is_free) in [(false, true), (true, false)] {
            let filter = PairFilter::new(move |_| may);
            let filtered = verify.clone().filter(filter);
            assert_eq!(detector.is_free(&scene, &filtered).expect("good"), is_free);
            assert_eq!(detector.start_intersects(), Some(!is_free));
        }
        // Each body alone is fine.
        for body in [plate, rod] {
            let alone = Query::self_of(body).start(Start::Verify);
            assert!(detector.is_free(&scene, &alone).expect("good"));
            let impacts = detector.impacts(&scene, &alone).expect("good");
            assert_eq!(impacts.start_intersects(), Some(false));
            assert_eq!(detector.earliest(&scene, &alone).expect("good"), None);
            assert_eq!(detector.start_intersects(), Some(false));
        }
        let ignoring = Query::all().exclude((plate, rod)).start(Start::Verify);
        assert!(detector.is_free(&scene, &ignoring).expect("good"));
        assert_eq!(
            detector
                .impacts(&scene, &report)
                .expect("good")
                .start_intersects(),
            None
        );
    }
}

/// Two triangles that share one vertex, one through the inside of the other: no vertex touches a
/// face, and no edge an edge.
#[test]
fn a_face_through_its_neighbour_is_near_it_and_an_intersection_of_the_start() {
    let faces = [[0, 1, 2], [0, 3, 4]];
    let at = |x: f32| {
        [
            [0.0f32, 0.0, 0.0],
            [4.0, 0.0, 0.0],
            [0.0, 4.0, 0.0],
            [x, x, -1.0],
            [x, x, 1.0],
        ]
    };
    for mut detector in detectors() {
        for (positions, intersects) in [(at(1.0), true), (at(-1.0), false)] {
            let mut scene = Scene::new();
            scene.add_triangles(&faces, &positions).expect("good");
            let end = positions.map(|[x, y, z]| [x, y, z + 1.0]);
            let body = scene.bodies().next().expect("one").0;
            scene.set_end_positions(body, &end).expect("good");
            assert!(detector.is_free(&scene, &Query::all()).expect("good"));
            let verify = Query::all().start(Start::Verify);
            assert_eq!(
                detector.is_free(&scene, &verify).expect("good"),
                !intersects
            );
            let impacts = detector.impacts(&scene, &verify).expect("good");
            assert_eq!(impacts.start_intersects(), Some(intersects));
            let query = Query::all();
            let near = detector.near(&scene, 0.5, &query).expect("good");
            assert_eq!(near.len(), usize::from(intersects));
            assert_eq!(near.of(PairKind::EdgeFace).len(), near.len());
        }
    }
}

/// A strip of two squares whose common edge is there twice.
const SEAM: [[f32; 3]; 6] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
];
const SEAM_FACES: [[u32; 3]; 2] = [[0, 1, 2], [3, 4, 5]];

#[test]
fn seams_are_refused_by_name_and_welding_mends_them() {
    let lifted = SEAM.map(|[x, y, z]| [x, y, z + 1.0]);
    for mut detector in detectors() {
        let mut scene = Scene::new();
        let far = [[9.0f32, 0.0, 0.0], [9.0, 1.0, 0.0], [9.0, 0.0, 1.0]];
        scene.add_triangles(&[[0, 1, 2]], &far).expect("good");
        let body = scene.add_triangles(&SEAM_FACES, &SEAM).expect("good");
        scene.set_end_positions(body, &lifted).expect("good");
        let error = detector.advance(&scene, &Query::all()).unwrap_err();
        let expected = Error::Seam {
            body,
            vertices: [1, 3],
            n_coincident: 2,
        };
        assert_eq!(error, expected);
        let text = error.to_string();
        assert!(
            text.contains("vertices 1 and 3") && text.contains("weld"),
            "{text}"
        );
        // Who has touching starts on purpose goes on.
        let skip = Query::all().start(Start::Skip);
        assert_eq!(detector.advance(&scene, &skip).expect("good").fraction, 1.0);
        assert_eq!(
            detector
                .impacts(&scene, &Query::all())
                .expect("good")
                .iter()
                .filter(|impact| impact.at_start)
                .count(),
            11
        );

        let weld = Weld::by_position(&SEAM);
        let mut scene = Scene::new();
        let positions = weld.positions(&SEAM).expect("as many");
        let body = scene
            .add_triangles(&weld.apply(&SEAM_FACES), &positions)
            .expect("good");
        scene
            .set_end_positions(body, weld.positions(&lifted).expect("as many"))
            .expect("good");
        let advance = detector
            .advance(&scene, &Query::all().start(Start::Verify))
            .expect("good");
        assert_eq!(
            (advance.fraction, advance.start_intersects),
            (1.0, Some(false))
        );
    }
}

/// Two bodies that touch at the start are no seam, and neither are parts of one body that touch
/// away from vertices.
#[test]
fn touching_starts_that_are_no_seams_are_answered() {
    for mut detector in detectors() {
        let mut scene = Scene::new();
        for face in SEAM_FACES {
            let [a, b, c] = face.map(|corner| SEAM[corner as usize]);
            let body = scene.add_triangles(&[[0, 1, 2]], &[a, b, c]).expect("good");
            let end = [a, b, c].map(|[x, y, z]| [x, y, z + 1.0]);
            scene.set_end_positions(body, &end).expect("good");
        }
        let advance = detector.advance(&scene, &Query::all()).expect("good");
        assert!(advance.fraction == 0.0 && advance.first.expect("touches").at_start);

        let mut scene = Scene::new();
        let corners = [
            [0.0f32, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [0.0, 2.0, 0.0],
            [0.5, 0.5, 0.0],
            [0.5, 0.5, 1.0],
            [1.0, 0.5, 1.0],
        ];
        let body = scene
            .add_triangles(&[[0, 1, 2], [3, 4, 5]], &corners)
            .expect("good");
        let end = corners.map(|[x, y, z]| [x + 1.0, y, z]);
        scene.set_end_positions(body, &end).expect("good");
        let advance = detector.advance(&scene, &Query::all()).expect("good");
        assert!(advance.fraction == 0.0 && advance.first.expect("touches").at_start);
    }
}
