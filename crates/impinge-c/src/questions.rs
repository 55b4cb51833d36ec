//! The questions that a detector answers: `impinge_detect`, `impinge_find_*` and the like.

use std::ffi::c_void;
use std::ops::ControlFlow;

use impinge::exact::ElementPair;
use impinge::exact::internal::Keep;
use impinge::proximity::Nearest;
use impinge::{Detector, PairKind};

use crate::answers::{
    impact_row, impinge_candidates, impinge_impacts, impinge_near, impinge_pairs,
};
use crate::arrays::{self, reserve};
use crate::detector::{ask, impinge_detector};
use crate::motion::{impinge_motion, put_found};
use crate::query::{Asked, check_length};
use crate::scene::{Bodies, impinge_scene};
use crate::sized::read_sized;
use crate::status::{Failure, clear, guard, put};
use crate::types::*;

/// A question of a caller.
pub struct Question<'a> {
    pub detector: &'a mut Detector,
    pub scene: &'a Bodies,
    pub asked: Asked<'a>,
}

/// Puts a question about a scene. `answer` is cleared first.
///
/// # Safety
/// Pointers are as `impinge.h` says.
pub unsafe fn question<A>(
    (detector, scene, query): (
        *mut impinge_detector,
        *const impinge_scene,
        *const impinge_query,
    ),
    (answer, what): (*mut *mut A, &str),
    find: impl FnOnce(Question<'_>) -> Result<A, Failure>,
) -> Status {
    // SAFETY: the caller's promise, in all calls.
    unsafe {
        if !answer.is_null() {
            answer.write_unaligned(std::ptr::null_mut());
        }
        ask(detector, scene, |detector, scene| {
            clear(answer, what)?;
            let found = find(Question {
                detector,
                scene,
                asked: Asked::read(query, scene)?,
            })?;
            put(answer, what, Box::into_raw(Box::new(found)))
        })
    }
}

/// Puts a question whose answer is a value.
///
/// # Safety
/// As [`question`].
pub unsafe fn value(
    (detector, scene, query): (
        *mut impinge_detector,
        *const impinge_scene,
        *const impinge_query,
    ),
    find: impl FnOnce(Question<'_>) -> Result<(), Failure>,
) -> Status {
    // SAFETY: the caller's promise, in all calls.
    unsafe {
        ask(detector, scene, |detector, scene| {
            find(Question {
                detector,
                scene,
                asked: Asked::read(query, scene)?,
            })
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_query_default(query: *mut impinge_query) {
    // SAFETY: `impinge.h` says what pointers are, here and in all functions below. Without room for
    // it there is nothing to fill.
    let _ = unsafe { put(query, "query", impinge_query::default()) };
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_step_default(step: *mut impinge_query) {
    // SAFETY: see `impinge_query_default`.
    unsafe { impinge_query_default(step) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_detect(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    query: *const impinge_query,
    pairs: *mut *mut impinge_pairs,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        question((detector, scene, query), (pairs, "pairs"), |of| {
            let query = of.asked.query()?;
            impinge_pairs::new(of.detector.detect(&of.scene.scene, &query)?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_count(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    query: *const impinge_query,
    n: *mut u64,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        value((detector, scene, query), |of| {
            let query = of.asked.query()?;
            let found = of.detector.count(&of.scene.scene, &query)?;
            put(n, "n", found)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_any(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    query: *const impinge_query,
    any: *mut i32,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        value((detector, scene, query), |of| {
            let query = of.asked.query()?;
            let found = of.detector.any(&of.scene.scene, &query)?;
            put(any, "any", i32::from(found))
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_impacts(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    step: *const impinge_query,
    impacts: *mut *mut impinge_impacts,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        question((detector, scene, step), (impacts, "impacts"), |of| {
            let step = of.asked.step()?;
            let impacts = of.detector.impacts(&of.scene.scene, &step)?;
            impinge_impacts::new(impacts)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_earliest(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    step: *const impinge_query,
    impact: *mut impinge_impact,
    found: *mut i32,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        value((detector, scene, step), |of| {
            let step = of.asked.step()?;
            let first = of.detector.earliest(&of.scene.scene, &step)?;
            let row = first.map(|impact| impact_row(&impact));
            put_found(row, (impact, "impact"), found)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_is_free(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    step: *const impinge_query,
    is_free: *mut i32,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        value((detector, scene, step), |of| {
            let step = of.asked.step()?;
            let found = of.detector.is_free(&of.scene.scene, &step)?;
            put(is_free, "is_free", i32::from(found))
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_advance(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    step: *const impinge_query,
    fraction: *mut f64,
    motion: *mut *mut impinge_motion,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        if !motion.is_null() {
            motion.write_unaligned(std::ptr::null_mut());
        }
        value((detector, scene, step), |of| {
            if fraction.is_null() && motion.is_null() {
                return Err(Failure::null("fraction and motion: each"));
            }
            let step = of.asked.step()?;
            let found = of.detector.advance(&of.scene.scene, &step)?;
            if !fraction.is_null() {
                fraction.write_unaligned(found.fraction);
            }
            if !motion.is_null() {
                let stats = of.detector.stats().clone();
                let made = impinge_motion::new(found, stats);
                motion.write_unaligned(Box::into_raw(Box::new(made)));
            }
            Ok(())
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_truncate(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    step: *const impinge_query,
    motion: *mut *mut impinge_motion,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        question((detector, scene, step), (motion, "motion"), |of| {
            let step = of.asked.step()?;
            let found = of.detector.truncate(&of.scene.scene, &step)?;
            let stats = of.detector.stats().clone();
            Ok(impinge_motion::by_vertex(found, stats))
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_candidates(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    inflation: f64,
    query: *const impinge_query,
    candidates: *mut *mut impinge_candidates,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        question((detector, scene, query), (candidates, "candidates"), |of| {
            let query = of.asked.query()?;
            let scene = &of.scene.scene;
            let candidates = of.detector.candidates(scene, inflation, &query)?;
            impinge_candidates::new(candidates)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_candidates_in_runs(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    inflation: f64,
    query: *const impinge_query,
    most: u64,
    each: Option<RunCallback>,
    user: *mut c_void,
    n: *mut u64,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        value((detector, scene, query), |of| {
            let each = each.ok_or_else(|| Failure::null("each"))?;
            let query = of.asked.query()?;
            let mut rows = Vec::new();
            let mut n_given = 0;
            let hand_out = |run: impinge::Candidates| {
                for kind in PairKind::ALL {
                    rows.clear();
                    let of_kind = run.rows_of(kind);
                    if let Err(failure) = reserve(&mut rows, of_kind.len(), "candidates") {
                        return ControlFlow::Break(Err(failure));
                    }
                    rows.extend(of_kind.map(impinge_pair::from));
                    if rows.is_empty() {
                        continue;
                    }
                    n_given += rows.len() as u64;
                    if each(user, bit(kind), rows.as_ptr(), rows.len()) != 0 {
                        return ControlFlow::Break(Ok(()));
                    }
                }
                ControlFlow::Continue(())
            };
            let scene = &of.scene.scene;
            let end = of
                .detector
                .candidates_in_runs(scene, inflation, &query, most, hand_out)?;
            if let ControlFlow::Break(end) = end {
                end?;
            }
            if !n.is_null() {
                n.write_unaligned(n_given);
            }
            Ok(())
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_near(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    distance: f64,
    query: *const impinge_query,
    near_pairs: *mut *mut impinge_near,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        question((detector, scene, query), (near_pairs, "near_pairs"), |of| {
            let query = of.asked.query()?;
            let near = of.detector.near(&of.scene.scene, distance, &query)?;
            impinge_near::new(near)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_distance(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    a: u32,
    b: u32,
    nearest: *mut impinge_nearest,
    found: *mut i32,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        value((detector, scene, std::ptr::null()), |of| {
            let [of_a, of_b] = [of.scene.id(a)?, of.scene.id(b)?];
            let closest = of.detector.distance(&of.scene.scene, of_a, of_b)?;
            put_found(closest.map(nearest_row), (nearest, "nearest"), found)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_nearest(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    query: *const impinge_query,
    nearest: *mut impinge_nearest,
    found: *mut i32,
) -> Status {
    // SAFETY: see `impinge_query_default`.
    unsafe {
        value((detector, scene, query), |of| {
            let query = of.asked.query()?;
            let closest = of.detector.nearest(&of.scene.scene, &query)?;
            put_found(closest.map(nearest_row), (nearest, "nearest"), found)
        })
    }
}

fn nearest_row(of: Nearest) -> impinge_nearest {
    impinge_nearest {
        distance: of.distance,
        points: of.points,
        body_a: of.a.body.index() as u32,
        element_a: of.a.element,
        body_b: of.b.body.index() as u32,
        element_b: of.b.element,
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_first_contact(
    kind: u32,
    start: impinge_array,
    end: impinge_array,
    query: *const impinge_query,
    toi: *mut f64,
    found: *mut i32,
) -> Status {
    guard(|| {
        // The edge is named first, and is tested second.
        let (pair, n, order) = match kind_of(kind) {
            Some(PairKind::VertexFace) => (ElementPair::VertexFace, 4, [0, 1, 2, 3]),
            Some(PairKind::EdgeEdge) => (ElementPair::EdgeEdge, 4, [0, 1, 2, 3]),
            Some(PairKind::EdgeVertex) => (ElementPair::VertexEdge, 3, [2, 0, 1, 1]),
            Some(PairKind::VertexVertex) => (ElementPair::VertexVertex, 2, [0, 1, 1, 1]),
            _ => {
                return Err(Failure::invalid(format!(
                    "kind: {kind} given, IMPINGE_VF, _EE, _EV or _VV allowed"
                )));
            }
        };
        // SAFETY: see `impinge_query_default`.
        let given = unsafe { read_sized(query) }?;
        check_length("separation", given.separation)?;
        check_length("clearance", given.clearance)?;
        if !(0.0..1.0).contains(&given.clearance_share) {
            return Err(Failure::invalid(format!(
                "clearance_share: {} given, a number from 0 to less than 1 allowed",
                given.clearance_share
            )));
        }
        let points = |array: &impinge_array, what: &str| {
            // SAFETY: see `impinge_query_default`.
            let rows = unsafe { arrays::floats::<3>(array, what) }?;
            if rows.len() != n {
                let given = rows.len();
                return Err(Failure::invalid(format!(
                    "{what}: {given} rows given, {n} needed"
                )));
            }
            if let Some(row) = (0..n).find(|&row| rows.wide(row).iter().any(|x| !x.is_finite())) {
                let [x, y, z] = rows.wide(row);
                return Err(Failure::invalid(format!(
                    "{what}: row {row} has a non-finite position ({x}, {y}, {z})"
                )));
            }
            Ok(order.map(|row| rows.wide(row)))
        };
        let ends = [points(&start, "start")?, points(&end, "end")?];
        let keep = Keep {
            separation: given.separation,
            clearance: given.clearance,
            share: given.clearance_share,
            is_rounded: false,
        };
        let contact = keep.first(pair, ends.each_ref(), f64::EPSILON / 2.0);
        // SAFETY: see `impinge_query_default`.
        unsafe { put_found(contact.map(|contact| contact.time), (toi, "toi"), found) }
    })
}
