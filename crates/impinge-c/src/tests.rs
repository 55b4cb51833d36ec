//! Tests of the interface from within: layouts, hashes beside those of Rust, the caller's numbers
//! of edges. `tests/` has those in C and C++, which `scripts/test-c` runs.

#[cfg(feature = "gpu")]
mod gpu;
mod probe;
mod queries;

use std::collections::BTreeMap;
use std::mem::offset_of;
use std::path::Path;
use std::process::Command;
use std::ptr::{null, null_mut};

use impinge::{Backend, Detector, Elements, Method, PairKind, Positions, Query, Scene};
use impinge_scenes::{BuiltScene, Model, adversarial, soup, surfaces};

use crate::answers::*;
use crate::arrays::{elements_view, positions_view};
use crate::contacts::*;
use crate::detector::*;
use crate::motion::*;
use crate::questions::*;
use crate::scene::*;
use crate::types::*;

/// Name and offset, size or value of everything that both languages declare.
fn layout_in_rust() -> BTreeMap<String, usize> {
    let mut layout = BTreeMap::new();
    macro_rules! structure {
        ($name:ident: $($field:ident),*) => {
            layout.insert(stringify!($name).to_owned(), size_of::<$name>());
            $(
                let field = stringify!($field).trim_start_matches("r#");
                let field = if field == "own" { "self" } else { field };
                layout.insert(format!("{}.{field}", stringify!($name)), offset_of!($name, $field));
            )*
        };
    }
    macro_rules! constants {
        ($($name:ident),*) => {
            $( layout.insert(stringify!($name).to_owned(), $name as usize); )*
        };
    }
    layout.insert("impinge_status".to_owned(), size_of::<Status>());
    structure!(impinge_array: data, rows, row_stride, column_stride, r#type);
    structure!(impinge_exclusion: kind, a, b, n, offsets, vertices);
    structure!(impinge_query: size, between, own, shared_vertex, a, b, kinds, start, precision, hits, n_nearest, flags, separation, clearance, clearance_share, cell_low, cell_high, exclusions, n_exclusions, fixed, n_fixed, passes, passes_user, rest_pairs, n_rest_pairs);
    structure!(impinge_element: vertices, n_vertices, body);
    structure!(impinge_settings: size, backend, method, threads, memory_budget, max_pairs, cancelled, user, progress, log, device, reuse_margin);
    structure!(impinge_pair: body_a, element_a, body_b, element_b);
    structure!(impinge_impact: toi, kind, body_a, element_a, body_b, element_b, at_start);
    structure!(impinge_nearest: distance, points, body_a, element_a, body_b, element_b);
    structure!(impinge_device: name, interface_name, driver, max_binding, is_software, reserved);
    structure!(impinge_closest_element: distance, point, body, element, feature, found);
    structure!(impinge_ray_hit: t, t_end, barycentrics, ray, body, element, feature, reserved);
    structure!(impinge_region: position, bounds, length, patch_area, area, normal, depth, volume, body_a, body_b, n_contacts, n_inside);
    structure!(impinge_stats: size, n_threads, total_ms, n_candidates, n_unsure, n_work_items, n_clusters, n_culled, n_clustered, n_batches, n_reruns, bytes_held, backend, method);
    constants!(
        OK,
        INVALID,
        OUT_OF_MEMORY,
        BUDGET,
        TOO_MANY_PAIRS,
        CANCELLED,
        DEVICE,
        INTERNAL,
        ABI_VERSION,
        F32,
        F64,
        U32,
        I32,
        U64,
        I64,
        U8,
        POINTS,
        EDGES,
        TRIANGLES,
        TETRAHEDRA,
        ANY_BODY,
        BACKEND_AUTO,
        BACKEND_CPU,
        BACKEND_GPU,
        SKIP,
        RESOLVE,
        START_REPORT,
        START_SKIP,
        START_VERIFY,
        DISTANCES,
        CLOSEST_POINTS,
        SIGNED,
        CELL,
        HITS_FIRST,
        HITS_ANY,
        HITS_ALL,
        EXCLUDE_BODIES,
        EXCLUDE_RINGS,
        EXCLUDE_GROUPS,
        EXCLUDE_VERTICES,
        SHAPE_SOLID,
        SHAPE_EMPTY,
        SHAPE_POINT,
        SHAPE_SEGMENT,
        SHAPE_POLYGON,
        NO_FEATURE,
        NO_ELEMENT,
        ON_SURFACE,
        LOG_ERROR,
        LOG_INFO,
        COLUMN_KIND,
        COLUMN_ROWS,
        COLUMN_DISTANCE,
        COLUMN_POINTS,
        COLUMN_FEATURES,
        COLUMN_PARALLEL,
        COLUMN_TOI,
        COLUMN_AT_START,
        COLUMN_SHAPE,
        COLUMN_STARTS,
        COLUMN_CORNERS,
        COLUMN_CONTACT_POINTS,
        COLUMN_CURVE_STARTS,
        COLUMN_CURVE_POINTS,
        COLUMN_CURVE_CLOSED,
        COLUMN_CURVE_LENGTH,
        COLUMN_INSIDE_A,
        COLUMN_INSIDE_B,
        COLUMN_IS_HIT,
        COLUMN_T,
        COLUMN_T_END,
        COLUMN_BARYCENTRICS,
        COLUMN_VERTICES,
        COLUMN_WEIGHT,
        COLUMN_COEFFICIENTS,
        COLUMN_SQUARED_DISTANCE,
        COLUMN_GRADIENT,
        COLUMN_HESSIAN,
        COLUMN_MOLLIFIER,
        COLUMN_MOLLIFIER_GRADIENT,
        COLUMN_MOLLIFIER_HESSIAN,
        COLUMN_KEPT,
        COLUMN_NEW,
        COLUMN_GONE
    );
    for kind in PairKind::ALL {
        layout.insert(kind.name().to_uppercase(), bit(kind) as usize);
    }
    // A method has its place in the list as its number.
    for (ix, method) in Method::ALL.into_iter().enumerate() {
        layout.insert(format!("METHOD_{}", method.name().to_uppercase()), ix);
    }
    layout
}

/// The same, as a compiler of C or C++ sees `impinge.h`.
fn layout_in(compiler: &str, language: &str) -> BTreeMap<String, usize> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program =
        std::env::temp_dir().join(format!("impinge-layout-{language}-{}", std::process::id()));
    let compiled = Command::new(compiler)
        .args(["-x", language, "-I"])
        .arg(here.join("include"))
        .arg(here.join("tests/layout.c"))
        .arg("-o")
        .arg(&program)
        .status();
    assert!(
        compiled
            .expect("a compiler, as the linker of Rust needs one")
            .success()
    );
    let output = Command::new(&program).output().expect("it was compiled");
    std::fs::remove_file(&program).expect("it is there");
    let text = String::from_utf8(output.stdout).expect("text");
    let lines = text.lines().filter_map(|line| line.split_once(' '));
    lines
        .map(|(name, number)| {
            let name = name.strip_prefix("ERROR_").unwrap_or(name);
            (name.to_owned(), number.parse().expect("a number"))
        })
        .collect()
}

#[test]
#[cfg(unix)]
fn layouts_are_those_of_the_header() {
    let expected = layout_in_rust();
    assert!(expected.len() > 150);
    assert_eq!(layout_in("cc", "c"), expected);
    // Every constant of the header is among them.
    let header = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/impinge.h");
    let header = std::fs::read_to_string(header).expect("the header");
    let names = header.lines().filter_map(|line| {
        let (name, value) = line.strip_prefix("#define IMPINGE_")?.split_once(' ')?;
        (!value.is_empty()).then(|| name.strip_prefix("ERROR_").unwrap_or(name))
    });
    let missing: Vec<_> = names.filter(|&name| !expected.contains_key(name)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// The rows of a packed view.
///
/// # Safety
/// The view is one of ours, of rows of this type.
unsafe fn numbers<T>(of: &impinge_array) -> &[T] {
    match of.rows {
        0 => &[],
        // SAFETY: the caller's promise.
        n => unsafe { std::slice::from_raw_parts(of.data.cast(), n) },
    }
}

/// A scene built through C.
struct Built {
    scene: *mut impinge_scene,
    detector: *mut impinge_detector,
}

impl Drop for Built {
    fn drop(&mut self) {
        // SAFETY: both are ours, and ended once.
        unsafe {
            impinge_scene_destroy(self.scene);
            impinge_detector_destroy(self.detector);
        }
    }
}

/// The same bodies, through C, with a detector on the CPU.
fn through_c(scene: &Scene) -> Built {
    on_backend(1, scene)
}

/// The same bodies, through C, with a detector on a backend of `impinge.h`.
fn on_backend(backend: u32, scene: &Scene) -> Built {
    let (mut built, mut detector) = (null_mut(), null_mut());
    // SAFETY: all pointers are to variables and arrays that live as long as the call.
    unsafe {
        assert_eq!(impinge_scene_create(&mut built), OK);
        for (_, body) in scene.bodies() {
            let at = positions_view(body.positions());
            let elements = elements_view(body.elements());
            let mut number = ANY_BODY;
            let added = match body.elements() {
                Elements::Points(_) => impinge_scene_add_points(built, at, &mut number),
                Elements::Edges(_) => impinge_scene_add_edges(built, elements, at, &mut number),
                Elements::Triangles(_) => {
                    impinge_scene_add_triangles(built, elements, at, &mut number)
                }
                Elements::Tetrahedra(_) => {
                    impinge_scene_add_tetrahedra(built, elements, at, &mut number)
                }
            };
            assert_eq!(added, OK);
            if let Some(end) = body.end_positions() {
                assert_eq!(
                    impinge_scene_set_end_positions(built, number, positions_view(end)),
                    OK
                );
            }
        }
        let settings = impinge_settings {
            backend,
            threads: 2,
            ..impinge_settings::default()
        };
        assert_eq!(impinge_detector_create(&settings, &mut detector), OK);
    }
    Built {
        scene: built,
        detector,
    }
}

/// Moves every second body, so that the scene has a step.
fn move_bodies(scene: &mut Scene) {
    let bodies: Vec<_> = scene
        .bodies()
        .map(|(id, body)| (id, body.positions().clone()))
        .collect();
    for (ix, (id, positions)) in bodies.into_iter().enumerate() {
        let by = if ix % 2 == 0 { 0.25 } else { -0.125 };
        match positions {
            Positions::F32(at) => {
                let end: Vec<_> = at.iter().map(|&[x, y, z]| [x + by as f32, y, z]).collect();
                scene.set_end_positions(id, &end).expect("finite");
            }
            Positions::F64(at) => {
                let end: Vec<_> = at.iter().map(|&[x, y, z]| [x + by, y, z]).collect();
                scene.set_end_positions(id, &end).expect("finite");
            }
        }
    }
}

fn of_models(models: &[Model]) -> Scene {
    let mut scene = Scene::new();
    for model in models {
        model.add_to(&mut scene).expect("a good model");
    }
    move_bodies(&mut scene);
    scene
}

/// Scenes of every kind of body, large and degenerate ones.
fn catalogue() -> Vec<(&'static str, Scene)> {
    let adversarial = |built: Result<BuiltScene, impinge::Error>| {
        let mut scene = built.expect("a good scene").scene;
        move_bodies(&mut scene);
        scene
    };
    let ball = surfaces::ball(2_000);
    let mut strands = of_models(&[surfaces::ball(500)]);
    let mut random = impinge_scenes::Random::new(3);
    let mut point = || [0; 3].map(|_: i32| f64::from(random.range(-1.0, 1.0)));
    let at: Vec<[f64; 3]> = (0..600).map(|_| point()).collect();
    let edges: Vec<[u32; 2]> = (0..300).map(|ix| [2 * ix, 2 * ix + 1]).collect();
    strands.add_edges(&edges, &at).expect("finite");
    strands.add_points(&at).expect("finite");
    move_bodies(&mut strands);
    vec![
        (
            "balls",
            of_models(&[ball.clone(), ball.translated([0.9, 0.0, 0.0])]),
        ),
        (
            "soup",
            of_models(&[
                soup::triangles(2_000, 0.05, 1),
                soup::tetrahedra(1_000, 0.05, 2),
            ]),
        ),
        (
            "lattice",
            of_models(&[
                soup::lattice_triangles(100, 20, 3),
                soup::lattice_web(60, 10, 7),
            ]),
        ),
        (
            "tetrahedra",
            of_models(&[soup::lattice_web_tetrahedra(60, 10, 8), ball]),
        ),
        ("strands and points", strands),
        ("boxes", adversarial(adversarial::boxes(30, 1))),
        ("coincident", adversarial(adversarial::coincident(60))),
        ("needles", adversarial(adversarial::needle_row(200))),
    ]
}

/// Asks a backend about the whole catalogue through C, and the CPU through Rust.
fn assert_hashes(backend: u32) {
    for (name, scene) in catalogue() {
        let built = on_backend(backend, &scene);
        let mut detector = Detector::new(Backend::Cpu).expect("the CPU");
        let (on, of) = (built.detector, built.scene.cast_const());
        // SAFETY: as in `through_c`.
        unsafe {
            let everything = Query::all();
            let mut pairs = null_mut();
            assert_eq!(impinge_detect(on, of, null(), &mut pairs), OK);
            let expected = detector.detect(&scene, &everything).expect("pairs");
            assert_eq!(impinge_pairs_hash(pairs), expected.hash(), "{name}");
            let n = impinge_pairs_count(pairs);
            assert_eq!(n, expected.len());
            assert_eq!(
                impinge_hash_pairs(impinge_pairs_data(pairs), n),
                expected.hash()
            );
            let (mut count, mut any) = (0, -1);
            assert_eq!(impinge_count(on, of, null(), &mut count), OK);
            assert_eq!(impinge_any(on, of, null(), &mut any), OK);
            assert_eq!((count, any), (n as u64, i32::from(n > 0)));
            let mut contacts = null_mut();
            assert_eq!(impinge_find_contacts(on, of, pairs, &mut contacts), OK);
            assert_eq!(
                (
                    impinge_contacts_count(contacts),
                    impinge_contacts_hash(contacts)
                ),
                (n, expected.hash())
            );
            impinge_contacts_destroy(contacts);
            impinge_pairs_destroy(pairs);

            let mut impacts = null_mut();
            assert_eq!(impinge_find_impacts(on, of, null(), &mut impacts), OK);
            let expected = detector.impacts(&scene, &everything).expect("impacts");
            assert_eq!(impinge_impacts_hash(impacts), expected.hash(), "{name}");
            let n = impinge_impacts_count(impacts);
            assert_eq!(
                impinge_hash_impacts(impinge_impacts_data(impacts), n),
                expected.hash()
            );
            for (ix, expected) in expected.rows().enumerate() {
                let row = &*impinge_impacts_data(impacts).add(ix);
                assert_eq!(
                    [row.body_a, row.element_a, row.body_b, row.element_b],
                    expected
                );
            }
            impinge_impacts_destroy(impacts);

            let mut candidates = null_mut();
            assert_eq!(
                impinge_find_candidates(on, of, 0.01, null(), &mut candidates),
                OK
            );
            let expected = detector.candidates(&scene, 0.01, &everything);
            let expected = expected.expect("candidates");
            assert_eq!(
                impinge_candidates_hash(candidates),
                expected.hash(),
                "{name}"
            );
            let given = std::slice::from_raw_parts(
                impinge_candidates_data(candidates),
                impinge_candidates_count(candidates),
            );
            assert!(expected.rows().eq(given.iter().map(|row| row.row())));
            impinge_candidates_destroy(candidates);

            let mut near = null_mut();
            assert_eq!(impinge_find_near(on, of, 0.02, null(), &mut near), OK);
            let expected = detector.near(&scene, 0.02, &everything);
            let expected = expected.expect("near pairs");
            assert_eq!(impinge_near_hash(near), expected.hash(), "{name}");
            assert_eq!(impinge_near_count(near), expected.len());
            for (ix, expected) in expected.rows().enumerate() {
                assert_eq!((*impinge_near_data(near).add(ix)).row(), expected);
            }
            impinge_near_destroy(near);

            // Pairs at the start allow no step, or are seams: both say the same.
            let (mut fraction, mut motion) = (-1.0, null_mut());
            let status = impinge_advance(on, of, null(), &mut fraction, &mut motion);
            match detector.advance(&scene, &everything) {
                Ok(expected) => assert_eq!((status, fraction), (OK, expected.fraction), "{name}"),
                Err(_) => assert_eq!((status, fraction), (INVALID, -1.0), "{name}"),
            }
            impinge_motion_destroy(motion);
        }
    }
}

#[test]
fn answers_have_the_hashes_of_rust() {
    assert_hashes(1);
}

#[test]
fn edges_have_the_numbers_of_the_caller() {
    let ball = surfaces::ball(500);
    let mut scene = of_models(&[ball.clone(), ball.translated([0.9, 0.0, 0.0])]);
    let built = through_c(&scene);
    let hashes = || {
        let (mut near, mut impacts) = (null_mut(), null_mut());
        // SAFETY: as in `through_c`.
        unsafe {
            let (on, of) = (built.detector, built.scene.cast_const());
            assert_eq!(impinge_find_near(on, of, 0.02, null(), &mut near), OK);
            assert_eq!(impinge_find_impacts(on, of, null(), &mut impacts), OK);
            assert!(impinge_near_count(near) > 100 && impinge_impacts_count(impacts) > 100);
            let hashes = [impinge_near_hash(near), impinge_impacts_hash(impacts)];
            impinge_near_destroy(near);
            impinge_impacts_destroy(impacts);
            hashes
        }
    };
    let expected = |scene: &Scene| {
        let mut detector = Detector::new(Backend::Cpu).expect("the CPU");
        let near = detector.near(scene, 0.02, &Query::all());
        let impacts = detector.impacts(scene, &Query::all());
        [
            near.expect("near pairs").hash(),
            impacts.expect("impacts").hash(),
        ]
    };
    let before = hashes();
    assert_eq!(before, expected(&scene));
    let ids: Vec<_> = scene.bodies().map(|(id, _)| id).collect();
    for id in ids {
        let Elements::Edges(mut rows) = scene.body(id).expect("held").edges().clone() else {
            panic!("edges are edges");
        };
        rows.reverse();
        rows.iter_mut().step_by(2).for_each(|edge| edge.reverse());
        scene.set_edges(id, &rows).expect("the same edges");
        let body = id.index() as u32;
        // SAFETY: as in `through_c`; the view has as many rows as it says.
        unsafe {
            let given = crate::arrays::view(&rows);
            assert_eq!(impinge_scene_set_edges(built.scene, body, given), OK);
            let mut view = crate::arrays::no_rows(U32);
            assert_eq!(impinge_scene_edges(built.scene, body, &mut view), OK);
            let own = std::slice::from_raw_parts(view.data.cast::<[u32; 2]>(), view.rows);
            assert_eq!(own, rows);
        }
    }
    let after = hashes();
    assert_eq!(after, expected(&scene));
    assert!(before[0] != after[0] && before[1] != after[1]);
    // No rows: the library's numbers again.
    for body in 0..2 {
        // SAFETY: as above.
        let set =
            unsafe { impinge_scene_set_edges(built.scene, body, crate::arrays::no_rows(U32)) };
        assert_eq!(set, OK);
    }
    assert_eq!(hashes(), before);
}

#[test]
fn runs_are_the_whole() {
    unsafe extern "C" fn each(
        user: *mut std::ffi::c_void,
        kind: u32,
        rows: *const impinge_pair,
        n: usize,
    ) -> i32 {
        // SAFETY: `user` is the list below.
        let list = unsafe { &mut *user.cast::<Vec<(u32, impinge_pair)>>() };
        // SAFETY: as `impinge.h` says.
        list.extend(
            unsafe { std::slice::from_raw_parts(rows, n) }
                .iter()
                .map(|&row| (kind, row)),
        );
        i32::from(list.len() > 100_000)
    }
    let (_, scene) = catalogue().swap_remove(0);
    let built = through_c(&scene);
    let mut list: Vec<(u32, impinge_pair)> = Vec::new();
    let mut candidates = null_mut();
    let mut n = 0;
    // SAFETY: as in `through_c`; `user` is the list.
    unsafe {
        assert_eq!(
            impinge_find_candidates(built.detector, built.scene, 0.01, null(), &mut candidates),
            OK
        );
        let user = std::ptr::from_mut(&mut list).cast();
        let status = impinge_find_candidates_in_runs(
            built.detector,
            built.scene,
            0.01,
            null(),
            1_000,
            Some(each),
            user,
            &mut n,
        );
        assert_eq!(status, OK);
        let whole = std::slice::from_raw_parts(
            impinge_candidates_data(candidates),
            impinge_candidates_count(candidates),
        );
        assert!(whole.len() > 2_000 && n == whole.len() as u64);
        assert!(list.iter().map(|(_, row)| row).eq(whole));
        impinge_candidates_destroy(candidates);
    }
}
