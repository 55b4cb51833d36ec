//! How far each vertex may move: `impinge_find_safe_distances`.

use impinge::{Bounds, SafeDistances};

use crate::answers::impinge_near;
use crate::arrays::{no_rows, view_of};
use crate::detector::impinge_detector;
use crate::questions::question;
use crate::scene::impinge_scene;
use crate::stats::{Texts, fill};
use crate::status::{Failure, destroy, guard, held, put};
use crate::types::*;

/// A bound per vertex.
pub struct impinge_safe_distances {
    safe: SafeDistances,
    touching: impinge_near,
    texts: Texts,
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_safe_distances(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    most: f64,
    query: *const impinge_query,
    safe_distances: *mut *mut impinge_safe_distances,
) -> Status {
    let answer = (safe_distances, "safe_distances");
    // SAFETY: `impinge.h` says what pointers are, here and in all functions below.
    unsafe {
        question((detector, scene, query), answer, |of| {
            let query = of.asked.query()?;
            let safe = of.detector.safe_distances(&of.scene.scene, most, &query)?;
            Ok(impinge_safe_distances {
                touching: impinge_near::new(safe.touching().clone())?,
                safe,
                texts: Texts::default(),
            })
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_safe_distances_of(
    safe_distances: *const impinge_safe_distances,
    body: u32,
    view: *mut impinge_array,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_find_safe_distances`.
        let safe = &unsafe { held(safe_distances, "safe_distances") }?.safe;
        let id = safe.bodies().find(|id| id.index() == body as usize);
        let bounds = id.and_then(|id| safe.of(id));
        let bounds = bounds.ok_or_else(|| Failure::no_body(body, safe.bodies().count()))?;
        let shown = match bounds {
            Bounds::F32([]) => no_rows(F32),
            Bounds::F64([]) => no_rows(F64),
            Bounds::F32(bounds) => view_of(bounds),
            Bounds::F64(bounds) => view_of(bounds),
        };
        // SAFETY: see `impinge_find_safe_distances`.
        unsafe { put(view, "view", shown) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_safe_distances_touching(
    safe_distances: *const impinge_safe_distances,
) -> *const impinge_near {
    // SAFETY: see `impinge_find_safe_distances`.
    let safe = unsafe { safe_distances.as_ref() };
    safe.map_or(std::ptr::null(), |safe| &raw const safe.touching)
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_safe_distances_stats(
    safe_distances: *const impinge_safe_distances,
    stats: *mut impinge_stats,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_find_safe_distances`.
        let safe = unsafe { held(safe_distances, "safe_distances") }?;
        // SAFETY: see `impinge_find_safe_distances`.
        unsafe { fill(safe.safe.stats(), &safe.texts, stats) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_safe_distances_destroy(
    safe_distances: *mut impinge_safe_distances,
) {
    // SAFETY: see `impinge_find_safe_distances`.
    unsafe { destroy(safe_distances) }
}
