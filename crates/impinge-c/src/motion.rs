//! How far a step can be taken: `impinge_motion_*`.

use impinge::{Advance, Positions, Stats};

use crate::answers::impact_row;
use crate::arrays;
use crate::detector::asked;
use crate::scene::impinge_scene;
use crate::stats::{Texts, fill};
use crate::status::{Failure, change, destroy, guard, held, put};
use crate::types::*;

/// Positions to which a step can be taken.
pub struct impinge_motion {
    advance: Advance,
    first: Option<impinge_impact>,
    stats: Stats,
    texts: Texts,
}

impl impinge_motion {
    pub fn new(advance: Advance, stats: Stats, scene: &impinge_scene) -> Self {
        impinge_motion {
            first: advance.first.map(|impact| impact_row(&impact, scene)),
            advance,
            stats,
            texts: Texts::default(),
        }
    }

    fn positions(&self, body: u32) -> Option<&Positions> {
        let mut all = self.advance.positions.iter();
        let found = all.find(|(id, _)| id.index() == body as usize);
        found.map(|(_, positions)| positions)
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_fraction(motion: *const impinge_motion) -> f64 {
    // SAFETY: `impinge.h` says what pointers are.
    unsafe { motion.as_ref() }.map_or(0.0, |motion| motion.advance.fraction)
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_first(
    motion: *const impinge_motion,
    impact: *mut impinge_impact,
    found: *mut i32,
) -> Status {
    guard(|| {
        // SAFETY: `impinge.h` says what pointers are.
        let motion = unsafe { held(motion, "motion") }?;
        // SAFETY: `impinge.h` says what pointers are.
        unsafe { put_found(motion.first, (impact, "impact"), found) }
    })
}

/// Writes what was found, if anything was.
///
/// # Safety
/// `to` and `found` are NULL or can be written.
pub unsafe fn put_found<T>(
    value: Option<T>,
    (to, what): (*mut T, &str),
    found: *mut i32,
) -> Result<(), Failure> {
    if found.is_null() {
        return Err(Failure::null("found"));
    }
    let is_found = value.is_some();
    if let Some(value) = value {
        // SAFETY: the caller's promise.
        unsafe { put(to, what, value) }?;
    }
    // SAFETY: the caller's promise.
    unsafe { put(found, "found", i32::from(is_found)) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_start_intersects(motion: *const impinge_motion) -> i32 {
    // SAFETY: `impinge.h` says what pointers are.
    asked(unsafe { motion.as_ref() }.and_then(|motion| motion.advance.start_intersects))
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_positions(
    motion: *const impinge_motion,
    body: u32,
    view: *mut impinge_array,
) -> Status {
    guard(|| {
        // SAFETY: `impinge.h` says what pointers are.
        let motion = unsafe { held(motion, "motion") }?;
        let shown = motion.positions(body).map(arrays::positions_view);
        // SAFETY: `impinge.h` says what pointers are.
        unsafe { put(view, "view", shown.unwrap_or(arrays::no_rows(F64))) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_apply(
    motion: *const impinge_motion,
    scene: *mut impinge_scene,
) -> Status {
    // SAFETY: `impinge.h` says what pointers are.
    unsafe {
        change(scene, |scene| {
            Ok(held(motion, "motion")?.advance.apply(&mut scene.scene)?)
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_stats(
    motion: *const impinge_motion,
    stats: *mut impinge_stats,
) -> Status {
    guard(|| {
        // SAFETY: `impinge.h` says what pointers are.
        let motion = unsafe { held(motion, "motion") }?;
        // SAFETY: `impinge.h` says what pointers are.
        unsafe { fill(&motion.stats, &motion.texts, stats) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_destroy(motion: *mut impinge_motion) {
    // SAFETY: `impinge.h` says what pointers are.
    unsafe { destroy(motion) }
}
