//! Questions about points and rays, and pairs that are left out: the answers through C are those of
//! Rust.

use std::ptr::{null, null_mut};

use impinge::{Backend, Detector, Exclusion, Hit, Query, Scene};
use impinge_scenes::solids::solid_ball;
use impinge_scenes::{Random, surfaces};

use super::{Built, catalogue, numbers, of_models, through_c};
use crate::arrays::{no_rows, view, view_of};
use crate::probe::*;
use crate::questions::*;
use crate::scene::*;
use crate::types::*;

fn points(n: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut random = Random::new(seed);
    (0..n)
        .map(|_| [0; 3].map(|_: i32| f64::from(random.range(-1.5, 1.5))))
        .collect()
}

#[test]
fn points_and_rays_are_those_of_rust() {
    let (at, directions) = (points(300, 1), points(300, 2));
    let narrow: Vec<[f32; 3]> = at.iter().map(|x| x.map(|x| x as f32)).collect();
    let (mut n_located, mut n_wound) = (0, 0);
    let cells = of_models(&[solid_ball(200), surfaces::ball(500)]);
    for (name, scene) in catalogue().into_iter().chain([("cells", cells)]) {
        let built = through_c(&scene);
        let (on, of) = (built.detector, built.scene.cast_const());
        let mut detector = Detector::new(Backend::Cpu).expect("the CPU");
        // SAFETY: as in `through_c`.
        unsafe {
            for (most, n_nearest) in [(0.1, 1), (f64::INFINITY, 1), (0.5, 7)] {
                let query = Query::all().n_nearest(n_nearest);
                let expected = detector.closest(&scene, &narrow, most, &query);
                let expected = expected.expect("nearest elements");
                let several = impinge_query {
                    n_nearest,
                    ..impinge_query::default()
                };
                // One is the default.
                let query = if n_nearest == 1 {
                    null()
                } else {
                    &raw const several
                };
                let mut closest = null_mut();
                let status = impinge_find_closest(on, of, view(&narrow), most, query, &mut closest);
                assert_eq!(status, OK);
                assert_eq!(impinge_closest_hash(closest), expected.hash(), "{name}");
                assert_eq!(impinge_closest_n_nearest(closest), n_nearest as usize);
                let n = impinge_closest_count(closest);
                assert_eq!(n, narrow.len() * n_nearest as usize);
                let rows = std::slice::from_raw_parts(impinge_closest_data(closest), n);
                for (row, found) in rows.iter().zip(expected.iter()) {
                    assert_eq!(row.found, u32::from(found.is_some()));
                    let Some(found) = found else {
                        assert_eq!((row.body, row.element), (ANY_BODY, NO_ELEMENT));
                        continue;
                    };
                    assert_eq!((row.distance, row.point), (found.distance, found.point));
                    assert_eq!(row.element, found.element.element);
                }
                impinge_closest_destroy(closest);
            }
            for (hits, bits) in [
                (Hit::First, HITS_FIRST),
                (Hit::Any, HITS_ANY),
                (Hit::All, HITS_ALL),
            ] {
                let query = Query::all().hits(hits);
                let expected = detector.cast(&scene, &at, &directions, 2.0, &query);
                let expected = expected.expect("hits");
                let query = impinge_query {
                    hits: bits,
                    ..impinge_query::default()
                };
                let mut found = null_mut();
                let rays = [view(&at), view(&directions)];
                let status = impinge_cast(on, of, rays[0], rays[1], 2.0, &query, &mut found);
                assert_eq!(status, OK);
                assert_eq!(impinge_hits_hash(found), expected.hash(), "{name}");
                assert_eq!(impinge_hits_n_rays(found), at.len());
                assert_eq!(impinge_hits_count(found), expected.iter().len());
                let rows = impinge_hits_data(found);
                for (ix, (hit, of)) in expected.iter().zip(expected.rows()).enumerate() {
                    let row = &*rows.add(ix);
                    assert_eq!([row.body, row.element], of);
                    assert_eq!((row.t, row.t_end), (hit.t, hit.t_end));
                    assert_eq!(row.barycentrics, hit.barycentrics);
                }
                let mut starts = no_rows(U8);
                let status = impinge_hits_column(found, COLUMN_STARTS, &mut starts);
                assert_eq!(status, if hits == Hit::Any { INVALID } else { OK });
                if status == OK {
                    let starts = numbers::<u64>(&starts).iter().map(|&ix| ix as usize);
                    assert!(starts.eq(expected.offsets().iter().copied()));
                }
                impinge_hits_destroy(found);
            }
            for (id, _) in scene.bodies() {
                let body = id.index() as u32;
                let mut tetrahedra = vec![9; at.len()];
                let status = impinge_locate(on, of, body, view(&narrow), tetrahedra.as_mut_ptr());
                match detector.locate(&scene, id, &narrow) {
                    Ok(expected) => {
                        let numbers = expected.iter().map(|of| of.unwrap_or(NO_ELEMENT));
                        assert!(status == OK && numbers.eq(tetrahedra), "{name}");
                        n_located += expected.iter().flatten().count();
                    }
                    Err(_) => {
                        assert!(status == INVALID && tetrahedra.iter().all(|&of| of == 9));
                    }
                }
                let mut windings = vec![9; at.len()];
                let to = windings.as_mut_ptr();
                let status = impinge_winding_numbers(on, of, body, view(&narrow), to);
                match detector.winding_numbers(&scene, id, &narrow) {
                    Ok(expected) => {
                        let numbers = expected.iter().map(|of| of.unwrap_or(ON_SURFACE));
                        assert!(status == OK && numbers.eq(windings), "{name}");
                        n_wound += expected.iter().flatten().filter(|&&n| n != 0).count();
                    }
                    Err(_) => {
                        assert!(status == INVALID && windings.iter().all(|&of| of == 9));
                    }
                }
                let (mut places, mut signed) = (vec![9; at.len()], vec![f64::NAN; at.len()]);
                let status = impinge_contains(on, of, body, view(&at), places.as_mut_ptr());
                match detector.contains(&scene, id, &at) {
                    Ok(expected) => assert_eq!((status, &places), (OK, &expected), "{name}"),
                    Err(_) => {
                        assert_eq!(status, INVALID);
                        assert!(places.iter().all(|&place| place == 9));
                        continue;
                    }
                }
                let expected = detector
                    .signed_distance(&scene, id, &at)
                    .expect("distances");
                let status = impinge_signed_distance(on, of, body, view(&at), signed.as_mut_ptr());
                assert_eq!((status, signed), (OK, expected));
            }
            let (mut nearest, mut found) = (std::mem::zeroed::<impinge_nearest>(), -1);
            let query = impinge_query {
                own: 0,
                ..impinge_query::default()
            };
            assert_eq!(
                impinge_find_nearest(on, of, &query, &mut nearest, &mut found),
                OK
            );
            let expected = detector.nearest(&scene, &Query::between_all());
            let expected = expected.expect("an answer").map(|of| {
                let body = |of: impinge::Element| (of.body.index() as u32, of.element);
                (of.distance, body(of.a), body(of.b))
            });
            let row = (
                nearest.distance,
                (nearest.body_a, nearest.element_a),
                (nearest.body_b, nearest.element_b),
            );
            assert_eq!((found == 1).then_some(row), expected, "{name}");
        }
    }
    assert!(n_located > 3 && n_wound > 3, "{n_located} {n_wound}");
}

/// The hash of the near pairs that a query leaves.
///
/// # Safety
/// As in `through_c`.
unsafe fn near_hash(built: &Built, query: &impinge_query) -> u64 {
    let mut near = null_mut();
    // SAFETY: the caller's promise.
    unsafe {
        let status = impinge_find_near(built.detector, built.scene, 0.1, query, &mut near);
        assert_eq!(status, OK);
        let hash = crate::answers::impinge_near_hash(near);
        crate::answers::impinge_near_destroy(near);
        hash
    }
}

#[test]
fn what_is_left_out_is_what_rust_leaves_out() {
    let ball = surfaces::ball(500);
    let mut scene = of_models(&[ball.clone(), ball.translated([0.9, 0.0, 0.0])]);
    let built = through_c(&scene);
    let mut detector = Detector::new(Backend::Cpu).expect("the CPU");
    let ids: Vec<_> = scene.bodies().map(|(id, _)| id).collect();
    let groups: Vec<u32> = (0..ball.positions.len() as u32).map(|ix| ix % 2).collect();
    let pinned: Vec<bool> = groups.iter().map(|&group| group == 1).collect();
    let bytes: Vec<u8> = pinned.iter().map(|&flag| flag.into()).collect();
    let mut check = |scene: &Scene, query: &impinge_query, own: &Query| {
        let expected = detector.near(scene, 0.1, own).expect("near pairs").hash();
        // SAFETY: as in `through_c`.
        assert_eq!(unsafe { near_hash(&built, query) }, expected);
        expected
    };
    let all = check(&scene, &impinge_query::default(), &Query::all());
    let of_kind = |kind, a, b, n| impinge_exclusion {
        kind,
        a,
        b,
        n,
        offsets: no_rows(U32),
        vertices: no_rows(U32),
    };
    let with = |list: &[impinge_exclusion]| impinge_query {
        exclusions: list.as_ptr(),
        n_exclusions: list.len(),
        ..impinge_query::default()
    };
    let rings = [of_kind(EXCLUDE_RINGS, 0, 0, 2)];
    let own = Query::all().exclude(Exclusion::rings(2));
    assert_ne!(check(&scene, &with(&rings), &own), all);
    // SAFETY: as in `through_c`.
    unsafe {
        for (body, &id) in (0..).zip(&ids) {
            assert_eq!(
                impinge_scene_set_groups(built.scene, body, view_of(&groups)),
                OK
            );
            scene.set_groups(id, &groups).expect("as many as vertices");
        }
    }
    let exclusions = [
        of_kind(EXCLUDE_GROUPS, 1, 0, 0),
        of_kind(EXCLUDE_BODIES, 0, 0, 0),
    ];
    let own = Query::all().exclude(Exclusion::groups(0, 1));
    let own = own.exclude((ids[0], ids[0]));
    check(&scene, &with(&exclusions), &own);
    // SAFETY: as in `through_c`.
    unsafe {
        assert_eq!(
            impinge_scene_set_pinned(built.scene, 0, view_of(&bytes)),
            OK
        );
        assert_eq!(
            impinge_scene_set_pinned(built.scene, 1, view_of(&groups)),
            OK
        );
    }
    for &id in &ids {
        scene.set_pinned(id, &pinned).expect("as many as vertices");
    }
    let left = check(&scene, &impinge_query::default(), &Query::all());
    assert_ne!(left, all);
    let mut rest = null_mut();
    // SAFETY: as in `through_c`.
    unsafe {
        let status = impinge_find_near(built.detector, built.scene, 0.05, null(), &mut rest);
        assert_eq!(status, OK);
        let list = [rest.cast_const().cast()];
        let query = impinge_query {
            rest_pairs: list.as_ptr(),
            n_rest_pairs: 1,
            ..impinge_query::default()
        };
        let mut detector = Detector::new(Backend::Cpu).expect("the CPU");
        let at_rest = detector.near(&scene, 0.05, &Query::all());
        let at_rest = at_rest.expect("near pairs");
        let own = Query::all().exclude(&at_rest);
        let hash = check(&scene, &query, &own);
        assert!(hash != left && hash != 0 && !at_rest.is_empty());
        crate::answers::impinge_near_destroy(rest);
    }
}
