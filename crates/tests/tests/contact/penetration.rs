//! What lies inside, and the regions' normals, depths and volumes.

use impinge_core::contact::{Penetration, Region, SolidOverlap};
use impinge_core::{Backend, Detector, Elements, Error, Exclusion, PairKind, Query, Scene};
use impinge_scenes::{Model, Random, surfaces};

use super::detect;

fn overlap(a: &Model, b: &Model) -> Penetration {
    let mut scene = Scene::new();
    let ids = [a, b].map(|model| model.add_to(&mut scene).unwrap());
    let pairs = detect(&scene, &Query::between(ids[0], ids[1]));
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let contacts = detector.contacts(&scene, &pairs).unwrap();
    let found = detector.penetration(&scene, &contacts, ids[0], ids[1]);
    // The same with the bodies in the other order, and with their topologies cached.
    let again = detector.penetration(&scene, &contacts, ids[1], ids[0]);
    let (found, again) = (found.unwrap(), again.unwrap());
    assert_eq!(found, again);
    found
}

/// The winding number by solid angles (Van Oosterom & Strackee 1983), in floating point.
fn winding(model: &Model, [x, y, z]: [f32; 3]) -> f64 {
    let at = [x, y, z].map(f64::from);
    let mut sum = 0.0;
    for face in 0..model.elements.len() {
        let corners = model.elements.corners(face);
        let [a, b, c] = [0, 1, 2].map(|k| {
            let p = model.positions[corners[k] as usize].map(f64::from);
            [0, 1, 2].map(|k| p[k] - at[k])
        });
        let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let length = |p| f64::sqrt(dot(p, p));
        let det = a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        let (la, lb, lc) = (length(a), length(b), length(c));
        let around = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        sum += 2.0 * det.atan2(around);
    }
    sum / (4.0 * std::f64::consts::PI)
}

fn volume(model: &Model) -> f64 {
    (0..model.elements.len())
        .map(|face| {
            let corners = model.elements.corners(face);
            let [a, b, c] = [0, 1, 2].map(|k| model.positions[corners[k] as usize].map(f64::from));
            (a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0]))
                / 6.0
        })
        .sum()
}

/// Two models as the shells of one body.
fn both(a: &Model, b: &Model) -> Model {
    let n = a.positions.len() as u32;
    let faces: Vec<[u32; 3]> = [(a, 0), (b, n)]
        .into_iter()
        .flat_map(|(model, first)| {
            (0..model.elements.len()).map(move |face| {
                let corners = model.elements.corners(face);
                [0, 1, 2].map(|k| corners[k] + first)
            })
        })
        .collect();
    Model {
        positions: [&a.positions[..], &b.positions[..]].concat(),
        elements: faces.into(),
    }
}

fn turned(model: &Model) -> Model {
    // 3, 4, 5 and 5, 12, 13 about two axes.
    let (c, s, d, t) = (0.6, 0.8, 12.0 / 13.0, 5.0 / 13.0);
    model.mapped(|[x, y, z]| {
        let (x, y) = (c * x - s * y, s * x + c * y);
        [x, d * y - t * z, t * y + d * z]
    })
}

#[test]
fn vertices_inside_are_those_of_solid_angles() {
    let ball = surfaces::bumpy_ball(1_500, 0.25);
    for other in [
        surfaces::torus(40, 24, 0.5, 0.2).translated([0.3, 0.1, 0.05]),
        ball.translated([0.3, 0.21, 0.11]),
        both(
            &surfaces::ball(300).scaled(0.3),
            &surfaces::ball(300).translated([0.6, 0.1, 0.0]),
        ),
    ] {
        let found = overlap(&ball, &other);
        for (side, (model, there)) in [(&ball, &other), (&other, &ball)].into_iter().enumerate() {
            let expected: Vec<u32> = (0u32..)
                .zip(&model.positions)
                .filter(|(_, at)| winding(there, **at).abs() > 0.5)
                .map(|(vertex, _)| vertex)
                .collect();
            assert!(expected.len() > 20);
            assert_eq!(found.inside[side], expected);
        }
    }
}

/// The region's normal, which must exist.
fn normal(region: &Region) -> [f64; 3] {
    region.normal.expect("a normal")
}

#[test]
fn cubes_overlap_in_a_box() {
    let cube = surfaces::cube([0.0; 3], 1.0);
    let moved = cube.translated([0.31, 0.42, 0.73]);
    for (a, b) in [
        (cube.clone(), moved.clone()),
        (turned(&cube), turned(&moved)),
    ] {
        let found = overlap(&a, &b);
        assert_eq!(found.regions.len(), 1);
        let expected = 0.69 * 0.58 * 0.27;
        let volume = found.volume().unwrap();
        assert!((volume - expected).abs() < 1e-6, "{volume} {expected}");
        // The overlap's faces have areas 0.58 · 0.27, 0.69 · 0.27 and 0.69 · 0.58.
        let area = found.regions[0].area;
        let size = area.iter().map(|x| x * x).sum::<f64>();
        let expected: f64 = [0.58 * 0.27, 0.69 * 0.27, 0.69 * 0.58]
            .iter()
            .map(|x| x * x)
            .sum();
        assert!((size - expected).abs() < 1e-6, "{area:?}");
    }
}

/// The derivative of the volume with respect to the first body's position is the area.
#[test]
fn the_area_is_how_the_volume_grows() {
    let a = surfaces::bumpy_ball(2_000, 0.2);
    let b = surfaces::torus(40, 24, 0.4, 0.2).translated([0.4, 0.1, 0.05]);
    let found = overlap(&a, &b);
    let area = found.regions.iter().fold([0.0; 3], |sum, region| {
        [0, 1, 2].map(|k| sum[k] + region.area[k])
    });
    let step = 1e-3f32;
    for axis in 0..3 {
        let mut there = [0.0; 3];
        there[axis] = step;
        let ahead = overlap(&a.translated(there), &b).volume().unwrap();
        let behind = overlap(&a.translated(there.map(|x| -x)), &b)
            .volume()
            .unwrap();
        let slope = (ahead - behind) / (2.0 * f64::from(step));
        assert!(
            (slope - area[axis]).abs() < 2e-3,
            "{axis}: {slope} {area:?}"
        );
    }
}

#[test]
fn a_ball_that_dips_into_a_floor() {
    let floor = surfaces::cuboid([-2.1, -2.2, -1.0], [2.3, 2.0, 0.0]);
    let depth = 0.1;
    let ball = surfaces::icosphere(5).translated([0.123, 0.071, 0.5 - depth]);
    let found = overlap(&ball, &floor);
    assert_eq!(found.regions.len(), 1);
    let region = &found.regions[0];
    assert!(normal(region)[2] > 0.999_99);
    assert!(
        (region.depth.unwrap() - f64::from(depth)).abs() < 2e-3,
        "{region:?}"
    );
    let h = f64::from(depth);
    let cap = std::f64::consts::PI * h * h * (1.5 - h) / 3.0;
    assert!((found.volume().unwrap() / cap - 1.0).abs() < 0.01);
    assert!(region.position[2].abs() < 1e-6 && (region.position[0] - 0.123).abs() < 1e-3);
    // The other way round the normal is the opposite one.
    let other = overlap(&floor, &ball);
    assert!(normal(&other.regions[0])[2] < -0.999_99);
    assert!((other.volume().unwrap() - found.volume().unwrap()).abs() < 1e-9);
}

#[test]
fn regions_are_told_apart_and_held_together() {
    let floor = surfaces::cuboid([-4.1, -4.2, -1.0], [4.3, 4.0, 0.0]);
    // Two balls of one body on two triangles of the floor: two regions.
    let ball = surfaces::ball(500);
    let balls = both(
        &ball.translated([-1.07, 0.11, 0.4]),
        &ball.translated([1.03, 0.13, 0.45]),
    );
    let found = overlap(&balls, &floor);
    assert_eq!(found.regions.len(), 2);
    let inside: usize = found
        .regions
        .iter()
        .map(|region| region.inside[0].len())
        .sum();
    assert_eq!(inside, found.inside[0].len());
    let mut depths: Vec<f64> = found
        .regions
        .iter()
        .map(|region| region.depth.unwrap())
        .collect();
    depths.sort_by(f64::total_cmp);
    assert!(
        (depths[0] - 0.05).abs() < 5e-3 && (depths[1] - 0.1).abs() < 5e-3,
        "{depths:?}"
    );
    // A rod through the floor, without a vertex inside: two loops, one region, nowhere to push.
    let rod = surfaces::cuboid([0.11, 0.21, -3.0], [0.31, 0.42, 3.0]);
    let found = overlap(&rod, &floor);
    assert_eq!(found.regions.len(), 1);
    assert_eq!(
        (found.regions[0].normal, found.regions[0].depth),
        (None, None)
    );
    assert!(found.inside[0].is_empty());
    let expected = 0.2 * 0.21;
    assert!(
        (found.volume().unwrap() - expected).abs() < 1e-6,
        "{:?}",
        found.volume()
    );
}

#[test]
fn a_body_inside_another_is_a_region_without_contacts() {
    let big = surfaces::bumpy_ball(1_000, 0.1).scaled(3.0);
    let small = surfaces::torus(20, 12, 0.2, 0.1);
    let found = overlap(&big, &small);
    assert_eq!(found.regions.len(), 1);
    assert!(found.regions[0].contacts.is_empty());
    assert_eq!(found.inside[1].len(), small.positions.len());
    assert!(found.inside[0].is_empty());
    assert!((found.volume().unwrap() - volume(&small)).abs() < 1e-9);
    // The hole of a ring is outside.
    let ring = surfaces::torus(40, 20, 1.0, 0.3);
    let found = overlap(&ring, &surfaces::ball(100));
    assert!(found.regions.is_empty() && found.volume() == Some(0.0));
}

#[test]
fn touching_bodies_have_a_normal_and_no_depth() {
    let low = surfaces::cuboid([-1.0, -1.0, -1.0], [1.0, 1.0, 0.0]);
    let high = surfaces::cuboid([-0.5, -0.75, 0.0], [0.5, 0.5, 2.0]);
    let found = overlap(&high, &low);
    assert_eq!(found.regions.len(), 1);
    let region = &found.regions[0];
    assert_eq!(normal(region), [0.0, 0.0, 1.0]);
    assert_eq!(region.depth, Some(0.0));
    assert_eq!(region.volume, None);
    assert!((region.patch_area - 1.25).abs() < 1e-12 && (region.length - 4.5).abs() < 1e-12);
    assert!(found.inside.iter().all(Vec::is_empty));
}

/// Coincident bodies and bodies that share a plane: everything is degenerate, and there is still an
/// answer.
#[test]
fn degenerate_overlaps_do_not_panic() {
    let cube = surfaces::cube([0.0; 3], 1.0);
    for offset in [
        [0.0; 3],
        [0.5, 0.0, 0.0],
        [0.5, 0.5, 0.0],
        [0.5, 0.5, 0.5],
        [1.0, 0.0, 0.0],
        [1.0; 3],
    ] {
        let found = overlap(&cube, &cube.translated(offset));
        assert_eq!(found.regions.len(), 1, "{offset:?}");
        // Corners of one that are strictly inside the other, as solid angles see them.
        for corner in &found.inside[1] {
            let at = cube.positions[*corner as usize];
            let at = [0, 1, 2].map(|k| at[k] + offset[k]);
            assert!(at.iter().all(|x| x.abs() < 0.5), "{offset:?}");
        }
        let expected = usize::from(offset == [0.5; 3]);
        assert_eq!(
            found.inside.each_ref().map(Vec::len),
            [expected; 2],
            "{offset:?}"
        );
    }
}

#[test]
fn open_surfaces_are_refused_by_name() {
    let mut scene = Scene::new();
    let sheet = surfaces::cloth(4, 4, 0.3).add_to(&mut scene).unwrap();
    let ball = surfaces::ball(100).add_to(&mut scene).unwrap();
    let pairs = detect(&scene, &Query::between(sheet, ball));
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let contacts = detector.contacts(&scene, &pairs).unwrap();
    let error = detector.penetration(&scene, &contacts, ball, sheet);
    let error = error.unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("body 0: the surface is not closed"),
        "{error}"
    );
}

/// Contacts of other pairs say nothing of two bodies.
#[test]
fn contacts_of_other_bodies_are_refused() {
    let mut scene = Scene::new();
    let ball = surfaces::ball(100);
    let [a, b] = [0.0, 0.3].map(|x| ball.translated([x, 0.0, 0.0]).add_to(&mut scene).unwrap());
    let far = ball.translated([9.0, 0.0, 0.0]).add_to(&mut scene).unwrap();
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let pairs = detect(&scene, &Query::self_of(a));
    let contacts = detector.contacts(&scene, &pairs).unwrap();
    let error = detector.penetration(&scene, &contacts, b, a).unwrap_err();
    assert_eq!(
        error.to_string(),
        "contacts: none of bodies 1 and 0, which intersect, given, those of all pairs of the two allowed"
    );
    let apart = detector.penetration(&scene, &contacts, a, far).unwrap();
    assert_eq!((apart.volume(), apart.regions.len()), (Some(0.0), 0));
}

/// Points where surfaces crossed say nothing of surfaces that are elsewhere or of other faces.
#[test]
fn contacts_of_before_are_refused() {
    let mut scene = Scene::new();
    let (ball, small) = (surfaces::ball(100), surfaces::ball(20));
    let [a, b] = [0.0, 0.3].map(|x| ball.translated([x, 0.0, 0.0]).add_to(&mut scene).unwrap());
    let far = ball.translated([9.0, 0.0, 0.0]).add_to(&mut scene).unwrap();
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let pairs = detect(&scene, &Query::all());
    let contacts = detector.contacts(&scene, &pairs).unwrap();
    scene.set_positions(far, &ball.positions).unwrap();
    let known = detector.penetration(&scene, &contacts, a, b);
    assert_eq!(known.unwrap().regions.len(), 1, "they did not move");
    let before = scene.clone();
    let mut mirrored = scene.clone();
    // The same surface, whose faces have other numbers.
    let elements = ball.elements.clone();
    let Elements::Triangles(mut faces) = elements else {
        panic!("a surface");
    };
    faces.reverse();
    let positions = before.body(b).unwrap().positions().clone();
    mirrored.remesh(b, (faces, positions)).unwrap();
    scene
        .remesh(b, (small.elements.clone(), small.positions.clone()))
        .unwrap();
    let mut moved = before.clone();
    moved.set_positions(b, &ball.positions).unwrap();
    for now in [&scene, &mirrored, &moved] {
        let error = detector.penetration(now, &contacts, a, b).unwrap_err();
        assert!(
            matches!(error, Error::Moved { body } if body == b),
            "{error}"
        );
    }
    assert!(detector.penetration(&before, &contacts, a, b).is_ok());
    // Where the pairs meet now is known, but not which others do.
    let later = detector.contacts(&moved, &pairs).unwrap();
    let error = detector.penetration(&moved, &later, a, b).unwrap_err();
    assert!(matches!(error, Error::Moved { .. }), "{error}");
}

/// Pairs that a query leaves out are not among its contacts.
#[test]
fn contacts_of_a_query_that_left_out_pairs_of_the_two_are_refused() {
    let ball = surfaces::bumpy_ball(300, 0.2);
    let mut scene = Scene::new();
    let [a, b, c] = [[0.0; 3], [0.7, 0.1, 0.0], [0.3, 0.2, 0.6]].map(|place| {
        let moved = ball.translated(place);
        scene.add((moved.elements, moved.positions)).unwrap()
    });
    let n = scene.body(a).unwrap().n_vertices();
    let halves: Vec<u32> = (0..n).map(|vertex| u32::from(vertex < n / 2)).collect();
    scene.set_groups(a, &halves).unwrap();
    scene.set_groups(b, &halves).unwrap();
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let [few, of_others] = [Query::between(a, b), Query::self_of(a)].map(|query| {
        let query = query.kinds([PairKind::VertexFace]);
        Exclusion::from(&detector.near(&scene, 0.01, &query).unwrap())
    });
    let mut ask = |query: &Query, [a, b]: [_; 2]| {
        let pairs = detector.detect(&scene, query).unwrap().clone();
        let contacts = detector.contacts(&scene, &pairs).unwrap();
        detector.penetration(&scene, &contacts, a, b)
    };
    // The numbers of contacts change where contacts of other bodies with the same faces are gone.
    let unnumbered = |mut found: Penetration| {
        for region in &mut found.regions {
            region.contacts = vec![0; region.contacts.len()];
        }
        found
    };
    let whole = ask(&Query::all(), [a, b]).unwrap();
    let of_c = ask(&Query::all(), [a, c]).unwrap();
    let offsets: Vec<u64> = (0..=n as u64).collect();
    let lists = Exclusion::vertices(a, b, offsets, vec![0; n]);
    for (query, why) in [
        (Query::all().exclude(Exclusion::groups(0, 1)), "groups"),
        (Query::all().exclude(lists), "lists of vertices"),
        (Query::all().exclude(few), "pairs of an answer"),
    ] {
        // Nothing is left out of the pairs with the third body, nor by rings.
        let found = ask(&query, [a, c]).unwrap();
        match why {
            "pairs of an answer" => assert_eq!(unnumbered(found), unnumbered(of_c.clone())),
            _ => assert_eq!(found, of_c),
        }
        let error = ask(&query, [a, b]).unwrap_err().to_string();
        let told = format!(
            "contacts: without some of the two, because of {why}, given, those of all pairs of the two allowed"
        );
        assert_eq!(error, told);
    }
    let none = Exclusion::vertices(a, b, vec![0; n + 1], [0u32; 0]);
    for query in [
        Query::all().exclude(Exclusion::rings(2)),
        Query::all().exclude(Exclusion::groups(1, 5)),
        Query::all().exclude(none),
        Query::all().exclude(of_others),
    ] {
        assert_eq!(ask(&query, [a, b]).unwrap(), whole);
    }
    let cell = Query::all().owned_by([-10.0; 3], [0.5, 10.0, 10.0]);
    let error = ask(&cell, [b, c]).unwrap_err().to_string();
    assert!(error.contains("because of a cell"), "{error}");
}

/// Contacts of other bodies, or of before, say nothing of two that are pinned.
#[test]
fn pinned_bodies_are_refused_whatever_the_contacts_are_of() {
    let ball = surfaces::bumpy_ball(300, 0.2);
    let mut scene = Scene::new();
    let [a, b, c] = [[0.0; 3], [9.0, 0.1, 0.0], [0.3, 0.2, 0.6]].map(|place| {
        let moved = ball.translated(place);
        scene.add((moved.elements, moved.positions)).unwrap()
    });
    let n = scene.body(a).unwrap().n_vertices();
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let mut contacts = |scene: &Scene, query: &Query| {
        let pairs = detector.detect(scene, query).unwrap().clone();
        detector.contacts(scene, &pairs).unwrap()
    };
    let before = contacts(&scene, &Query::all());
    scene
        .set_positions(b, &ball.translated([0.7, 0.1, 0.0]).positions)
        .unwrap();
    for body in [a, b] {
        scene.set_pinned(body, &vec![true; n]).unwrap();
    }
    let of_others = contacts(&scene, &Query::between(a, c));
    for contacts in [&before, &of_others] {
        let error = detector
            .penetration(&scene, contacts, a, b)
            .unwrap_err()
            .to_string();
        assert!(error.contains("pinned faces of both"), "{error}");
    }
}

/// Pairs of pinned faces are never found, so contacts are not all of the two bodies.
#[test]
fn faces_that_are_pinned_in_both_bodies_are_refused() {
    let ball = surfaces::bumpy_ball(300, 0.2);
    let mut scene = Scene::new();
    let [a, b] = [[0.0; 3], [0.7, 0.1, 0.0]].map(|place| {
        let moved = ball.translated(place);
        scene.add((moved.elements, moved.positions)).unwrap()
    });
    let n = scene.body(a).unwrap().n_vertices();
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let mut ask = |scene: &Scene| {
        let pairs = detector.detect(scene, &Query::all()).unwrap().clone();
        let contacts = detector.contacts(scene, &pairs).unwrap();
        detector.penetration(scene, &contacts, b, a)
    };
    let free = ask(&scene).unwrap();
    scene.set_pinned(a, &vec![true; n]).unwrap();
    assert_eq!(ask(&scene).unwrap(), free);
    // One vertex: no face has it alone.
    let mut pinned: Vec<bool> = vec![false; n];
    pinned[0] = true;
    scene.set_pinned(b, &pinned).unwrap();
    assert_eq!(ask(&scene).unwrap(), free);
    scene.set_pinned(b, &vec![true; n]).unwrap();
    let error = ask(&scene).unwrap_err().to_string();
    assert_eq!(
        error,
        "contacts: without some of the two, because of pinned faces of both, given, those of all pairs of the two allowed"
    );
}

/// Each pair of many bodies is as if it were alone in the scene, but for the numbers of its
/// contacts.
#[test]
fn pairs_of_bodies_among_many_are_as_if_alone() {
    let ball = surfaces::bumpy_ball(300, 0.2);
    let places = [[0.0; 3], [0.7, 0.1, 0.0], [0.3, 0.8, 0.2], [9.0, 0.0, 0.0]];
    let models = places.map(|place| ball.translated(place));
    let mut scene = Scene::new();
    let ids = models.each_ref().map(|m| m.add_to(&mut scene).unwrap());
    let pairs = detect(&scene, &Query::all());
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let contacts = detector.contacts(&scene, &pairs).unwrap();
    for [a, b] in [[0, 1], [0, 2], [1, 2], [0, 3]] {
        let mut found = detector
            .penetration(&scene, &contacts, ids[a], ids[b])
            .unwrap();
        let numbers = [ids[a], ids[b]].map(|id| id.index() as u32);
        let own: Vec<u32> = (0..)
            .zip(contacts.rows())
            .filter(|(_, row)| [row[0], row[2]] == numbers)
            .map(|(contact, _)| contact)
            .collect();
        let mut expected = overlap(&models[a], &models[b]);
        for region in &mut expected.regions {
            region
                .contacts
                .iter_mut()
                .for_each(|contact| *contact = own[*contact as usize]);
        }
        for region in found.regions.iter_mut().chain(&mut expected.regions) {
            region.bodies = [0; 2];
        }
        assert_eq!(found, expected, "{a} and {b}");
        assert_eq!(found.regions.is_empty(), b == 3);
    }
}

/// The faces of a surface.
fn faces(model: &Model) -> &[[u32; 3]] {
    match &model.elements {
        Elements::Triangles(faces) => faces,
        _ => panic!("a surface"),
    }
}

/// With the faces turned.
fn inside_out(model: &Model) -> Model {
    let turned: Vec<[u32; 3]> = faces(model).iter().map(|&[a, b, c]| [a, c, b]).collect();
    Model {
        elements: turned.into(),
        positions: model.positions.clone(),
    }
}

fn joined(models: &[Model]) -> Model {
    let (mut all, mut positions) = (Vec::new(), Vec::new());
    for model in models {
        let first = positions.len() as u32;
        all.extend((faces(model).iter()).map(|face| face.map(|vertex| vertex + first)));
        positions.extend(&model.positions);
    }
    Model {
        elements: all.into(),
        positions,
    }
}

/// The wall of a cavity may touch the surface around it, with the first of its vertices.
#[test]
fn cavities_that_touch_are_cavities_inside_out_or_not() {
    let cube = surfaces::cuboid([0.0; 3], [2.0; 3]);
    let other = surfaces::cuboid([0.91, -0.53, 0.47], [1.23, 3.1, 1.49]);
    for touches in [
        [2.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
        [1.0, 2.0, 1.0],
        [1.0, 1.0, 0.0],
    ] {
        let solid = Model {
            elements: vec![[0u32, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].into(),
            positions: vec![
                touches,
                [1.4, 0.61, 0.7],
                [0.6, 1.3, 0.62],
                [1.03, 1.07, 1.6],
            ],
        };
        let volume = |model: &Model| overlap(model, &other).volume().expect("generic");
        let solid_volume = volume(&solid).abs();
        let is_outward = {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| solid.positions[k].map(f64::from));
            let [u, v, w] = [b, c, d].map(|p| [0, 1, 2].map(|k| p[k] - a[k]));
            let det = u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0])
                + u[2] * (v[0] * w[1] - v[1] * w[0]);
            det > 0.0
        };
        let wall = if is_outward {
            inside_out(&solid)
        } else {
            solid.clone()
        };
        let hollow = joined(&[cube.clone(), wall]);
        let expected = volume(&cube) - solid_volume;
        assert!(solid_volume > 0.01, "{solid_volume}");
        for model in [&hollow, &inside_out(&hollow)] {
            let found = volume(model);
            assert!(
                (found - expected).abs() < 1e-6,
                "{touches:?}: {found} for {expected}"
            );
        }
    }
}

/// The volume of a small piece is lost in sums from afar.
#[test]
fn small_pieces_far_apart_face_as_they_do() {
    let ball = surfaces::bumpy_ball(100, 0.2);
    let at = |x: f64| -> Vec<[f64; 3]> {
        let points = ball
            .positions
            .iter()
            .map(|p| p.map(|x| 1e-4 * f64::from(x)));
        points.map(|[px, y, z]| [px + x, y + x, z]).collect()
    };
    let n = ball.positions.len() as u32;
    let other = faces(&ball)
        .iter()
        .map(|face| face.map(|vertex| vertex + n));
    let both: Vec<[u32; 3]> = faces(&ball).iter().copied().chain(other).collect();
    for place in [1e4, 2.3e4, 3.1e4, 4.7e4, 5.9e4] {
        let mut scene = Scene::new();
        let ends = [at(0.0), at(place)].concat();
        let a = scene.add_triangles(&both, &ends).unwrap();
        let b = scene
            .add_triangles(faces(&ball), &at(place + 2e-5))
            .unwrap();
        let mut detector = Detector::new(Backend::Cpu).unwrap();
        let pairs = detector.detect(&scene, &Query::between(a, b)).unwrap();
        let pairs = pairs.clone();
        let contacts = detector.contacts(&scene, &pairs).unwrap();
        let found = detector.penetration(&scene, &contacts, a, b).unwrap();
        assert!(found.volume().unwrap() > 0.0, "{:?}", found.regions);
        let normal = found.regions[0].normal.unwrap();
        assert!(normal[0] < 0.0, "the first is pushed back: {normal:?}");
    }
}

/// Faces may be turned inwards: what two bodies have in common, and which way is out, do not depend on it.
#[test]
fn bodies_that_are_inside_out_overlap_as_they_are() {
    let ball = surfaces::bumpy_ball(400, 0.2);
    let shell = |model: &Model, size: f32| model.mapped(|at| at.map(|x| size * x));
    // A ball with a cavity, and another one inside that.
    let hollow = joined(&[
        ball.clone(),
        inside_out(&shell(&ball, 0.7)),
        shell(&ball, 0.4),
    ]);
    for (a, b) in [
        (ball.clone(), ball.translated([0.713, 0.117, 0.053])),
        (hollow.clone(), ball.translated([0.913, 0.119, 0.057])),
        (hollow.translated([0.011, 0.307, 0.113]), hollow.clone()),
        // A small part of a large one.
        (
            shell(&ball, 9.0),
            shell(&ball, 0.5).translated(ball.positions[17].map(|x| 9.18 * x)),
        ),
    ] {
        let right = overlap(&a, &b);
        let volume = right.volume().expect("right");
        assert!(volume > 0.0, "{volume}");
        let [turned_a, turned_b] = [&a, &b].map(inside_out);
        for (a, b) in [(&turned_a, &b), (&a, &turned_b), (&turned_a, &turned_b)] {
            let found = overlap(a, b);
            assert_eq!(found.inside, right.inside);
            assert_eq!(found.regions.len(), right.regions.len());
            let own = found.volume().expect("generic");
            assert!((own - volume).abs() < 1e-9 * volume, "{own} for {volume}");
            for (found, right) in found.regions.iter().zip(&right.regions) {
                let (n, m) = (found.normal, right.normal);
                assert_eq!(n.is_some(), m.is_some());
                let along = |(n, m): ([f64; 3], [f64; 3])| (0..3).map(|k| n[k] * m[k]).sum::<f64>();
                assert!(
                    n.zip(m).is_none_or(|both| along(both) > 0.999),
                    "{n:?} {m:?}"
                );
                assert!((found.depth.unwrap_or(0.0) - right.depth.unwrap_or(0.0)).abs() < 1e-6);
            }
        }
    }
}

/// A box in `f64`, as a surface.
fn cuboid(low: [f64; 3], high: [f64; 3]) -> (Vec<[u32; 3]>, Vec<[f64; 3]>) {
    let model = surfaces::cuboid([0.0; 3], [1.0; 3]);
    let at = |p: &[f32; 3]| [0, 1, 2].map(|k| if p[k] == 0.0 { low[k] } else { high[k] });
    (
        faces(&model).to_vec(),
        model.positions.iter().map(at).collect(),
    )
}

fn overlap_of(
    a: &(Vec<[u32; 3]>, Vec<[f64; 3]>),
    b: &(Vec<[u32; 3]>, Vec<[f64; 3]>),
) -> Penetration {
    let mut scene = Scene::new();
    let [a, b] = [a, b].map(|(faces, positions)| scene.add_triangles(faces, positions).unwrap());
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let pairs = detector.detect(&scene, &Query::between(a, b)).unwrap();
    let pairs = pairs.clone();
    let contacts = detector.contacts(&scene, &pairs).unwrap();
    detector.penetration(&scene, &contacts, a, b).unwrap()
}

/// Contacts without some of the pairs of two bodies would give other volumes.
#[test]
fn contacts_of_filtered_pairs_are_refused() {
    let ball = surfaces::bumpy_ball(300, 0.2);
    let mut scene = Scene::new();
    let [a, b, c] = [[0.0; 3], [0.7, 0.1, 0.0], [0.3, 0.2, 0.6]]
        .map(|place| ball.translated(place).add_to(&mut scene).unwrap());
    let mut detector = Detector::new(Backend::Cpu).unwrap();
    let all = detector.detect(&scene, &Query::all()).unwrap().clone();
    let mut ask = |pairs: &impinge_core::Pairs, [a, b]: [_; 2]| {
        let contacts = detector.contacts(&scene, pairs).unwrap();
        detector.penetration(&scene, &contacts, a, b)
    };
    let whole = ask(&all, [a, b]).unwrap();
    let mut kept = all.clone();
    kept.retain(|_, _| true);
    assert_eq!(ask(&kept, [a, b]).unwrap(), whole);
    // One pair of the two others.
    let mut is_first = true;
    kept.retain(|p, q| [p.body, q.body] != [b, c] || !std::mem::take(&mut is_first));
    assert_eq!(kept.len(), all.len() - 1);
    assert_eq!(ask(&kept, [a, b]).unwrap().volume(), whole.volume());
    let error = ask(&kept, [c, b]).unwrap_err().to_string();
    assert_eq!(
        error,
        "contacts: without some of the two, because of `retain`, given, those of all pairs of the two allowed"
    );
}

/// A shell around which the others wind anyway bounds nothing.
#[test]
fn shells_within_a_solid_that_face_as_it_does_are_solid() {
    let outer = surfaces::cuboid([0.0; 3], [8.0; 3]);
    let inner = surfaces::cuboid([2.0; 3], [6.0; 3]);
    let cavity = inside_out(&surfaces::cuboid([2.5; 3], [5.5; 3]));
    let peg = surfaces::cuboid([3.1, 3.2, 1.0], [4.1, 4.2, 3.0]);
    let through = surfaces::cuboid([3.1, 3.2, 1.0], [4.1, 4.2, 9.0]);
    let around = surfaces::cuboid([1.0, 1.1, 1.2], [9.0, 9.1, 9.2]);
    let bodies = [
        joined(&[outer.clone(), inner.clone()]),
        joined(&[inner, outer.clone()]),
        joined(&[outer, surfaces::cuboid([2.0; 3], [6.0; 3]), cavity]),
    ];
    for body in &bodies {
        for turned in [body.clone(), inside_out(body)] {
            let found = overlap(&turned, &peg);
            assert_eq!(found.inside[1].len(), 8);
            assert_eq!(found.regions.len(), 1);
            assert!((found.volume().unwrap() - 2.0).abs() < 1e-6, "{found:?}");
            let found = overlap(&turned, &through);
            assert_eq!(found.regions.len(), 1);
            assert!((found.volume().unwrap() - 7.0).abs() < 1e-5, "{found:?}");
            let region = &found.regions[0];
            assert!(normal(region)[2] < -0.999, "{region:?}");
            assert!((region.depth.unwrap() - 7.0).abs() < 1e-6, "{region:?}");
            // The inner shells are wholly in the other body.
            let found = overlap(&turned, &around);
            assert_eq!(found.regions.len(), 1);
            assert_eq!(found.inside[0].len(), turned.positions.len() - 7);
            let expected = 7.0 * 6.9 * 6.8;
            assert!(
                (found.volume().unwrap() - expected).abs() < 1e-3,
                "{found:?}"
            );
        }
    }
}

/// Squares and cubes of lengths overflow and underflow long before lengths do.
#[test]
fn normals_and_depths_are_right_at_any_size() {
    for exponent in [-1000, -600, -300, -260, 0, 255, 260, 350, 600, 1000] {
        let e = 2f64.powi(exponent);
        let sized = |(faces, positions): (Vec<[u32; 3]>, Vec<[f64; 3]>)| {
            let positions: Vec<[f64; 3]> = positions.iter().map(|p| p.map(|x| x * e)).collect();
            (faces, positions)
        };
        let a = sized(cuboid([0.0; 3], [4.0; 3]));
        let b = sized(cuboid([1.25, 1.125, 3.0], [2.25, 2.125, 5.0]));
        let (turned_faces, positions) = b.clone();
        let turned_faces: Vec<[u32; 3]> = turned_faces.iter().map(|&[a, b, c]| [a, c, b]).collect();
        for b in [b, (turned_faces, positions)] {
            let found = overlap_of(&a, &b);
            assert_eq!(found.regions.len(), 1);
            let region = &found.regions[0];
            assert_eq!(
                normal(region).map(|x| x + 0.0),
                [0.0, 0.0, -1.0],
                "{exponent}"
            );
            assert_eq!(region.depth, Some(e), "{exponent}");
            assert_eq!(region.length, 4.0 * e, "{exponent}");
            let (volume, expected) = (found.volume().unwrap(), e * e * e);
            assert!(
                volume == expected || (volume / expected - 1.0).abs() < 1e-12,
                "{exponent}: {volume} for {expected}"
            );
            assert_eq!(region.area[2], e * e, "{exponent}");
            assert_eq!(
                region.position,
                [1.75 * e, 1.625 * e, 4.0 * e],
                "{exponent}"
            );
        }
        // Touching in a patch.
        let b = sized(cuboid([1.25, 1.125, 4.0], [2.25, 2.125, 5.0]));
        let found = overlap_of(&a, &b);
        let region = &found.regions[0];
        assert_eq!(
            normal(region).map(|x| x + 0.0),
            [0.0, 0.0, -1.0],
            "{exponent}"
        );
        assert_eq!((region.patch_area, region.depth), (e * e, Some(0.0)));
    }
}

/// Where a vertex lies on the other surface, what hangs together is one region, whose volume is
/// unknown: no part of it has a wrong number.
#[test]
fn vertices_on_the_other_surface_belong_to_the_region_around_them() {
    let cube = cuboid([0.0; 3], [1.0; 3]);
    let tetrahedron = |corners: [[f64; 3]; 4]| {
        let faces = vec![[0u32, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
        (faces, corners.to_vec())
    };
    let spike = tetrahedron([
        [0.25, 0.25, 2.0],
        [0.75, 0.375, 2.0],
        [0.4375, 0.75, 2.0],
        [0.5, 0.4375, 0.0],
    ]);
    let corner_on_wall = [
        [0.5, 0.25, 0.0],
        [0.25, 0.625, 0.5],
        [0.75, 0.6875, 0.5],
        [0.5, 0.25, 0.75],
    ];
    let peg = cuboid([0.375, 0.25, 0.0], [0.625, 0.4375, 2.0]);
    for (b, depth) in [
        (spike, Some(1.0)),
        (cuboid([0.25, 0.375, 0.0], [0.625, 0.75, 0.75]), Some(0.75)),
        (tetrahedron(corner_on_wall), None),
        (tetrahedron([1, 0, 3, 2].map(|k| corner_on_wall[k])), None),
        (tetrahedron([3, 2, 1, 0].map(|k| corner_on_wall[k])), None),
        (peg, Some(1.0)),
    ] {
        for swapped in [false, true] {
            let found = match swapped {
                false => overlap_of(&cube, &b),
                true => overlap_of(&b, &cube),
            };
            assert_eq!(found.regions.len(), 1, "{:?}", found.regions);
            let region = &found.regions[0];
            assert_eq!((region.volume, found.volume()), (None, None));
            let deep = region.depth.map(|depth| (depth * 64.0).round() / 64.0);
            assert_eq!(deep, depth, "{region:?}");
        }
    }
    // A corner that is flush with the other's: its tip inside belongs to it.
    let (four, flush) = (cuboid([0.0; 3], [4.0; 3]), cuboid([2.0; 3], [4.0; 3]));
    let found = overlap_of(&four, &flush);
    assert_eq!(found.regions.len(), 1);
    assert_eq!((found.volume(), found.inside[1].len()), (None, 1));
    assert_eq!(found.regions[0].inside, found.inside);
}

/// Two vertices that touch are in one region if the edge between them is inside, and in two if it
/// is outside.
#[test]
fn edges_between_vertices_that_touch_join_what_they_run_through() {
    let two = {
        let (faces, mut positions) = cuboid([-1.0, 0.0, 0.0], [0.0, 4.0, 4.0]);
        let (other_faces, other) = cuboid([4.0, 0.0, 0.0], [5.0, 4.0, 4.0]);
        let n = positions.len() as u32;
        positions.extend(other);
        let moved = other_faces.iter().map(|face| face.map(|vertex| vertex + n));
        (faces.iter().copied().chain(moved).collect(), positions)
    };
    let between = (
        vec![[0u32, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]],
        vec![
            [0.0, 1.0, 1.25],
            [4.0, 2.25, 2.0],
            [2.0, 0.5, 3.0],
            [2.0, 3.0, 3.5],
        ],
    );
    let one = cuboid([0.0; 3], [4.0; 3]);
    let turned = |(faces, positions): &(Vec<[u32; 3]>, Vec<[f64; 3]>)| {
        let faces = faces.iter().map(|&[a, b, c]| [a, c, b]).collect();
        (faces, positions.clone())
    };
    for (body, n) in [(&two, 2), (&one, 1)] {
        for body in [body, &turned(body)] {
            assert_eq!(overlap_of(body, &between).regions.len(), n);
            let found = overlap_of(&between, body);
            assert_eq!((found.regions.len(), found.volume()), (n, None));
        }
    }
}

/// Pieces of one body may face differently.
#[test]
fn pieces_that_face_differently_have_one_normal() {
    let cube = surfaces::cuboid([0.0; 3], [4.0; 3]);
    let prong = surfaces::cuboid([1.0, 1.0, 3.0], [2.0, 2.0, 5.0]);
    // An edge of the cube passes edges of both, so they count as connected.
    let small = surfaces::cuboid([2.5, 2.5, 3.5], [3.0, 3.0, 5.0]);
    for other in [small.clone(), inside_out(&small)] {
        let found = overlap(&cube, &joined(&[prong.clone(), other]));
        assert_eq!(found.regions.len(), 1);
        assert_eq!(normal(&found.regions[0]).map(|x| x + 0.0), [0.0, 0.0, -1.0]);
    }
}

/// Two pieces that face differently may touch in an edge, where their curves meet.
#[test]
fn pieces_that_touch_in_an_edge_and_face_differently_have_one_normal() {
    let large = surfaces::cuboid([1.0, 1.0, 0.0], [3.0, 3.0, 4.0]);
    let small = surfaces::cuboid([0.0; 3], [1.0, 1.0, 4.0]);
    let lid = surfaces::cuboid([-2.0, -1.5, 3.0], [5.0, 4.0, 5.0]);
    for (large, small) in [
        (large.clone(), small.clone()),
        (inside_out(&large), small.clone()),
        (large.clone(), inside_out(&small)),
        (inside_out(&large), inside_out(&small)),
    ] {
        for pieces in [[large.clone(), small.clone()], [small.clone(), large]] {
            let found = overlap(&joined(&pieces), &lid);
            assert_eq!(found.regions.len(), 1);
            let region = &found.regions[0];
            assert!((region.area[2] - 5.0).abs() < 1e-6, "{region:?}");
            assert_eq!(normal(region).map(|x| x + 0.0), [0.0, 0.0, -1.0]);
        }
    }
}

/// Parts that overlap and face outwards, as in CAD: where one is out of the others it counts.
#[test]
fn pieces_that_cross_face_as_they_do() {
    // An L of two arms.
    let corners = [
        [0.0f32, 0.0],
        [10.0, 0.0],
        [10.0, 1.0],
        [1.0, 1.0],
        [1.0, 10.0],
        [0.0, 10.0],
    ];
    let cap = [[0u32, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
    let sides = (0..6u32).flat_map(|k| {
        let next = (k + 1) % 6;
        [[k, next, next + 6], [k, next + 6, k + 6]]
    });
    let caps = cap
        .iter()
        .flat_map(|&[a, b, c]| [[a, c, b], [a + 6, b + 6, c + 6]]);
    let bent = Model {
        elements: caps.chain(sides).collect::<Vec<_>>().into(),
        positions: [0.0, 1.0]
            .iter()
            .flat_map(|&z| corners.map(|[x, y]| [x, y, z]))
            .collect(),
    };
    assert!((volume(&bent) - 19.0).abs() < 1e-9);
    let block = surfaces::cuboid([0.5, 0.5, 0.25], [5.0, 5.0, 0.75]);
    let part = surfaces::cuboid([4.5, 4.25, 0.1], [6.0, 6.0, 0.9]);
    let around = surfaces::cuboid([0.25, 0.3, 0.1], [6.0, 6.1, 0.9]);
    for pieces in [[bent.clone(), block.clone()], [block, bent]] {
        let body = joined(&pieces);
        for body in [body.clone(), inside_out(&body)] {
            let found = overlap(&body, &part);
            assert_eq!(found.regions.len(), 1);
            let region = &found.regions[0];
            let own = normal(region);
            assert!(own[0] < -0.83 && own[1] < -0.55, "{own:?}");
            assert!(
                (region.depth.unwrap() - 0.375 / 0.375f64.hypot(0.25)).abs() < 1e-6,
                "{region:?}"
            );
            assert!((region.volume.unwrap() - 0.1875).abs() < 1e-6, "{region:?}");
            // The block is wholly inside, without contact.
            let found = overlap(&body, &around);
            let n_whole = found
                .regions
                .iter()
                .filter(|region| region.contacts.is_empty());
            assert_eq!(n_whole.count(), 1, "{:?}", found.regions);
        }
    }
}

/// Infinite volumes of two signs have no sum.
#[test]
fn infinite_volumes_that_cancel_are_unknown() {
    let hollow = joined(&[
        surfaces::cuboid([0.0; 3], [8.0; 3]),
        inside_out(&surfaces::cuboid([2.0; 3], [6.0; 3])),
    ]);
    let around = surfaces::cuboid([1.0, 1.1, 1.2], [9.0, 9.1, 9.2]);
    let ask = |exponent: i32| {
        let [hollow, around] = [&hollow, &around].map(|model| {
            let e = 2f64.powi(exponent);
            let positions = model.positions.iter().map(|p| p.map(|x| f64::from(x) * e));
            (faces(model).to_vec(), positions.collect())
        });
        let found = overlap_of(&hollow, &around);
        let volumes: Vec<f64> = (found.regions.iter())
            .map(|region| region.volume.unwrap())
            .collect();
        (volumes, found.volume())
    };
    let (volumes, sum) = ask(0);
    assert!(volumes[0] > 0.0 && (volumes[1] + 64.0).abs() < 1e-9);
    assert_eq!(sum, Some(volumes[0] + volumes[1]));
    assert_eq!(ask(350), (vec![f64::INFINITY, f64::NEG_INFINITY], None));
}

/// What two tetrahedra on a small lattice have in common is one region, which has the extent and the
/// volume of what cutting one by the other leaves. Many of them touch by vertices, edges and planes.
#[test]
fn tetrahedra_on_a_lattice_have_what_cutting_leaves() {
    let mut random = Random::new(23);
    let faces = vec![[0u32, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
    let (mut n_generic, mut n_other, mut n_deep) = (0, 0, 0);
    let mut cut = SolidOverlap::new();
    for _ in 0..3_000 {
        let mut tetrahedron = || -> [[f64; 3]; 4] {
            std::array::from_fn(|_| std::array::from_fn(|_| f64::from(random.below(5))))
        };
        let (a, b) = (tetrahedron(), tetrahedron());
        cut.cut(&a, &b);
        let Some((volume, _)) = cut.volume().filter(|found| found.0 > 1e-6) else {
            continue;
        };
        let found = overlap_of(&(faces.clone(), a.to_vec()), &(faces.clone(), b.to_vec()));
        assert_eq!(found.regions.len(), 1, "{a:?} {b:?} {:?}", found.regions);
        let region = &found.regions[0];
        match region.volume {
            Some(own) => {
                n_generic += 1;
                assert!((own - volume).abs() < 1e-9, "{a:?} {b:?}: {own} {volume}");
            }
            None => n_other += 1,
        }
        if let Some((normal, depth)) = region.normal.zip(region.depth) {
            n_deep += 1;
            let extent = cut.extent(&normal);
            assert!(
                (depth - extent).abs() < 1e-9,
                "{a:?} {b:?}: {depth} {extent}"
            );
        }
    }
    assert!(
        n_generic > 100 && n_other > 100 && n_deep > 200,
        "{n_generic} {n_other} {n_deep}"
    );
}
