//! How far a step can be taken, as a whole or by each vertex: `impinge_motion_*`.

use impinge::{Advance, Positions, Scene, Stats, Truncation};

use crate::answers::{impact_row, impinge_candidates};
use crate::arrays;
use crate::detector::asked;
use crate::scene::impinge_scene;
use crate::stats::{Texts, fill};
use crate::status::{Failure, change, clear, destroy, guard, held, put};
use crate::types::*;

/// Positions to which a step can be taken.
pub struct impinge_motion {
    of: Motion,
    stats: Stats,
    texts: Texts,
}

enum Motion {
    Whole {
        advance: Advance,
        first: Option<impinge_impact>,
    },
    ByVertex(Truncation),
}

impl Motion {
    /// Where the vertices of a body are then; `None` for one that stands still.
    fn positions(&self, body: u32) -> Result<Option<&Positions>, Failure> {
        let start = match self {
            Motion::Whole { advance, .. } => advance.start(),
            Motion::ByVertex(truncation) => truncation.start(),
        };
        let mut ids = start.bodies().iter().map(|start| start.body);
        let id = ids.find(|id| id.index() == body as usize);
        let id = id.ok_or_else(|| Failure::no_body(body, start.bodies().len()))?;
        Ok(match self {
            Motion::Whole { advance, .. } => advance.positions(id),
            Motion::ByVertex(truncation) => truncation.positions(id),
        })
    }

    fn truncation(&self) -> Option<&Truncation> {
        match self {
            Motion::Whole { .. } => None,
            Motion::ByVertex(truncation) => Some(truncation),
        }
    }

    fn start_intersects(&self) -> Option<bool> {
        match self {
            Motion::Whole { advance, .. } => advance.start_intersects,
            Motion::ByVertex(truncation) => truncation.start_intersects(),
        }
    }

    fn apply(&self, scene: &mut Scene) -> Result<(), impinge::Error> {
        match self {
            Motion::Whole { advance, .. } => advance.apply(scene),
            Motion::ByVertex(truncation) => truncation.apply(scene),
        }
    }
}

impl impinge_motion {
    pub fn new(advance: Advance, stats: Stats) -> Self {
        let first = advance.first.map(|impact| impact_row(&impact));
        impinge_motion {
            of: Motion::Whole { advance, first },
            stats,
            texts: Texts::default(),
        }
    }

    pub fn by_vertex(truncation: Truncation, stats: Stats) -> Self {
        impinge_motion {
            of: Motion::ByVertex(truncation),
            stats,
            texts: Texts::default(),
        }
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_fraction(motion: *const impinge_motion) -> f64 {
    // SAFETY: `impinge.h` says what pointers are.
    match unsafe { motion.as_ref() }.map(|motion| &motion.of) {
        None => 0.0,
        Some(Motion::Whole { advance, .. }) => advance.fraction,
        Some(Motion::ByVertex(_)) => f64::NAN,
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_first(
    motion: *const impinge_motion,
    impact: *mut impinge_impact,
    found: *mut i32,
) -> Status {
    guard(|| {
        // SAFETY: `impinge.h` says what pointers are.
        let Motion::Whole { first, .. } = unsafe { held(motion, "motion") }?.of else {
            return Err(Failure::invalid(
                "motion: it is of impinge_truncate, which finds no first contact",
            ));
        };
        // SAFETY: `impinge.h` says what pointers are.
        unsafe { put_found(first, (impact, "impact"), found) }
    })
}

/// Writes what was found, if anything was. Whether a pointer is refused does not depend on it.
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
    if to.is_null() {
        return Err(Failure::null(what));
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
    asked(unsafe { motion.as_ref() }.and_then(|motion| motion.of.start_intersects()))
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
        let shown = motion.of.positions(body)?.map(arrays::positions_view);
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
            Ok(held(motion, "motion")?.of.apply(&mut scene.scene)?)
        })
    }
}

/// A count of a truncation; 0 of an advance, and for NULL.
///
/// # Safety
/// As `impinge.h` says.
unsafe fn counted<T: Default>(motion: *const impinge_motion, of: fn(&Truncation) -> T) -> T {
    // SAFETY: the caller's promise.
    let motion = unsafe { motion.as_ref() };
    let truncation = motion.and_then(|motion| motion.of.truncation());
    truncation.map_or_else(T::default, of)
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_n_cut(motion: *const impinge_motion) -> u64 {
    // SAFETY: `impinge.h` says what pointers are.
    unsafe { counted(motion, Truncation::n_cut) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_n_touching(motion: *const impinge_motion) -> u64 {
    // SAFETY: `impinge.h` says what pointers are.
    unsafe { counted(motion, Truncation::n_touching) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_rounds(motion: *const impinge_motion) -> u32 {
    // SAFETY: `impinge.h` says what pointers are.
    unsafe { counted(motion, Truncation::rounds) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_motion_pairs(
    motion: *const impinge_motion,
    pairs: *mut *mut impinge_candidates,
) -> Status {
    guard(|| {
        // SAFETY: `impinge.h` says what pointers are, in all calls.
        unsafe {
            clear(pairs, "pairs")?;
            let truncation = held(motion, "motion")?.of.truncation().ok_or_else(|| {
                Failure::invalid("motion: it is of impinge_advance, which stops no vertex alone")
            })?;
            let found = Box::new(impinge_candidates::new(truncation.pairs())?);
            put(pairs, "pairs", Box::into_raw(found))
        }
    })
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
