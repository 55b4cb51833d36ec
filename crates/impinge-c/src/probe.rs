//! Questions about points and rays: `impinge_contains`, `impinge_signed_distance`,
//! `impinge_winding_numbers`, `impinge_locate`, `impinge_find_closest`, `impinge_cast`.

use std::mem::offset_of;

use impinge::{BodyId, Closest, ClosestElement, Detector, Error, Hit, Hits, Scene, Stats};

use crate::answers::{Answer, answer, asked_for, code};
use crate::arrays::{self, Floats, collect, with_rows};
use crate::detector::impinge_detector;
use crate::questions::{question, value};
use crate::scene::impinge_scene;
use crate::stats::Texts;
use crate::status::{Failure, write_all};
use crate::types::*;

/// The elements nearest to points.
pub struct impinge_closest {
    closest: Closest,
    rows: Vec<impinge_closest_element>,
    texts: Texts,
}

fn closest_row(found: Option<ClosestElement>) -> impinge_closest_element {
    match found {
        Some(found) => impinge_closest_element {
            distance: found.distance,
            point: found.point,
            body: found.element.body.index() as u32,
            element: found.element.element,
            feature: code(found.feature).into(),
            found: 1,
        },
        None => impinge_closest_element {
            distance: f64::INFINITY,
            point: [f64::NAN; 3],
            body: ANY_BODY,
            element: NO_ELEMENT,
            feature: NO_FEATURE,
            found: 0,
        },
    }
}

impl Answer for impinge_closest {
    type Row = impinge_closest_element;
    const NAME: &'static str = "closest";
    fn rows(&self) -> &[impinge_closest_element] {
        &self.rows
    }
    fn column(&self, column: u32) -> Option<impinge_array> {
        let numbers = |offset| arrays::field::<_, u32>(&self.rows, offset);
        let floats = |offset| arrays::field::<_, f64>(&self.rows, offset);
        Some(match column {
            COLUMN_ROWS => numbers(offset_of!(impinge_closest_element, body)),
            COLUMN_DISTANCE => floats(offset_of!(impinge_closest_element, distance)),
            COLUMN_POINTS => floats(offset_of!(impinge_closest_element, point)),
            COLUMN_FEATURES => numbers(offset_of!(impinge_closest_element, feature)),
            _ => return None,
        })
    }
    fn stats(&self) -> (&Stats, &Texts) {
        (self.closest.stats(), &self.texts)
    }
}

answer!(
    impinge_closest,
    impinge_closest_count,
    impinge_closest_data,
    impinge_closest_column,
    impinge_closest_stats,
    impinge_closest_destroy
);

/// What rays hit.
pub struct impinge_hits {
    hits: Hits,
    rows: Vec<impinge_ray_hit>,
    is_hit: Vec<u8>,
    /// Nothing if only yes or no was asked for.
    starts: Vec<u64>,
    texts: Texts,
}

impl impinge_hits {
    fn new(hits: Hits, asked: Hit) -> Result<Self, Failure> {
        const WHAT: &str = "hits";
        let mut rows = Vec::new();
        arrays::reserve(&mut rows, hits.iter().len(), WHAT)?;
        for ray in 0..hits.len() {
            rows.extend(hits.of(ray).iter().map(|hit| impinge_ray_hit {
                t: hit.t,
                t_end: hit.t_end,
                barycentrics: hit.barycentrics,
                ray: ray as u64,
                body: hit.element.body.index() as u32,
                element: hit.element.element,
                feature: code(hit.feature).into(),
                reserved: 0,
            }));
        }
        let is_hit = collect(hits.is_hit().iter().map(|&hit| hit.into()), WHAT)?;
        let starts = match asked {
            Hit::Any => Vec::new(),
            _ => collect(hits.offsets().iter().map(|&ix| ix as u64), WHAT)?,
        };
        Ok(impinge_hits {
            hits,
            rows,
            is_hit,
            starts,
            texts: Texts::default(),
        })
    }
}

impl Answer for impinge_hits {
    type Row = impinge_ray_hit;
    const NAME: &'static str = "hits";
    fn rows(&self) -> &[impinge_ray_hit] {
        &self.rows
    }
    fn column(&self, column: u32) -> Option<impinge_array> {
        let numbers = |offset| arrays::field::<_, u32>(&self.rows, offset);
        let floats = |offset| arrays::field::<_, f64>(&self.rows, offset);
        let n_starts = self.is_hit.len() + 1;
        Some(match column {
            COLUMN_IS_HIT => arrays::view_of(&self.is_hit),
            COLUMN_STARTS => {
                return asked_for(&self.starts, n_starts, || arrays::view_of(&self.starts));
            }
            COLUMN_ROWS => numbers(offset_of!(impinge_ray_hit, body)),
            COLUMN_FEATURES => numbers(offset_of!(impinge_ray_hit, feature)),
            COLUMN_T => floats(offset_of!(impinge_ray_hit, t)),
            COLUMN_T_END => floats(offset_of!(impinge_ray_hit, t_end)),
            COLUMN_BARYCENTRICS => floats(offset_of!(impinge_ray_hit, barycentrics)),
            _ => return None,
        })
    }
    fn stats(&self) -> (&Stats, &Texts) {
        (self.hits.stats(), &self.texts)
    }
}

answer!(
    impinge_hits,
    impinge_hits_count,
    impinge_hits_data,
    impinge_hits_column,
    impinge_hits_stats,
    impinge_hits_destroy
);

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_closest_hash(closest: *const impinge_closest) -> u64 {
    // SAFETY: see `answer!`.
    unsafe { closest.as_ref() }.map_or(0, |of| of.closest.hash())
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_closest_n_nearest(closest: *const impinge_closest) -> usize {
    // SAFETY: see `answer!`.
    unsafe { closest.as_ref() }.map_or(0, |of| of.closest.n_nearest())
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_hits_hash(hits: *const impinge_hits) -> u64 {
    // SAFETY: see `answer!`.
    unsafe { hits.as_ref() }.map_or(0, |of| of.hits.hash())
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_hits_n_rays(hits: *const impinge_hits) -> usize {
    // SAFETY: see `answer!`.
    unsafe { hits.as_ref() }.map_or(0, |of| of.hits.len())
}

/// Asks about points and a body, and writes a number per point.
///
/// # Safety
/// As `impinge.h` says; `to` is NULL or has room for a number per point.
unsafe fn per_point<A, T>(
    (detector, scene): (*mut impinge_detector, *const impinge_scene),
    (body, points): (u32, &impinge_array),
    (to, what): (*mut T, &str),
    ask: impl FnOnce(&mut Detector, &Scene, BodyId, &Floats<'_, 3>) -> Result<Vec<A>, Error>,
    written: impl Fn(A) -> T,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe {
        value((detector, scene, std::ptr::null()), |of| {
            let body = of.scene.id(body)?;
            let points = arrays::floats::<3>(points, "points")?;
            let found = ask(of.detector, &of.scene.scene, body, &points)?;
            if to.is_null() && !found.is_empty() {
                return Err(Failure::null(what));
            }
            write_all(to, found.into_iter().map(written));
            Ok(())
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_contains(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    body: u32,
    points: impinge_array,
    places: *mut i8,
) -> Status {
    let ask = |detector: &mut Detector, scene: &Scene, body, points: &Floats<'_, 3>| {
        with_rows!(points, |points| detector.contains(scene, body, points))
    };
    // SAFETY: `impinge.h` says what pointers are, here and in all functions below.
    unsafe {
        per_point(
            (detector, scene),
            (body, &points),
            (places, "places"),
            ask,
            |place| place,
        )
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_signed_distance(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    body: u32,
    points: impinge_array,
    distances: *mut f64,
) -> Status {
    let ask = |detector: &mut Detector, scene: &Scene, body, points: &Floats<'_, 3>| {
        with_rows!(points, |points| detector
            .signed_distance(scene, body, points))
    };
    // SAFETY: see `impinge_contains`.
    unsafe {
        per_point(
            (detector, scene),
            (body, &points),
            (distances, "distances"),
            ask,
            |distance| distance,
        )
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_winding_numbers(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    body: u32,
    points: impinge_array,
    windings: *mut i32,
) -> Status {
    let ask = |detector: &mut Detector, scene: &Scene, body, points: &Floats<'_, 3>| {
        with_rows!(points, |points| detector
            .winding_numbers(scene, body, points))
    };
    // SAFETY: see `impinge_contains`.
    unsafe {
        per_point(
            (detector, scene),
            (body, &points),
            (windings, "windings"),
            ask,
            |winding| winding.unwrap_or(ON_SURFACE),
        )
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_locate(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    body: u32,
    points: impinge_array,
    tetrahedra: *mut u32,
) -> Status {
    let ask = |detector: &mut Detector, scene: &Scene, body, points: &Floats<'_, 3>| {
        with_rows!(points, |points| detector.locate(scene, body, points))
    };
    // SAFETY: see `impinge_contains`.
    unsafe {
        per_point(
            (detector, scene),
            (body, &points),
            (tetrahedra, "tetrahedra"),
            ask,
            |tetrahedron| tetrahedron.unwrap_or(NO_ELEMENT),
        )
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_closest(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    points: impinge_array,
    most: f64,
    query: *const impinge_query,
    closest: *mut *mut impinge_closest,
) -> Status {
    // SAFETY: see `impinge_contains`.
    unsafe {
        question((detector, scene, query), (closest, "closest"), |of| {
            let query = of.asked.query()?;
            let points = arrays::floats::<3>(&points, "points")?;
            let scene = &of.scene.scene;
            let found = with_rows!(&points, |points| of
                .detector
                .closest(scene, points, most, &query)?);
            Ok(impinge_closest {
                rows: collect(found.iter().map(closest_row), "rows")?,
                closest: found,
                texts: Texts::default(),
            })
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_cast(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    origins: impinge_array,
    directions: impinge_array,
    most: f64,
    query: *const impinge_query,
    hits: *mut *mut impinge_hits,
) -> Status {
    // SAFETY: see `impinge_contains`.
    unsafe {
        question((detector, scene, query), (hits, "hits"), |of| {
            let query = of.asked.query()?;
            let origins = arrays::floats::<3>(&origins, "origins")?;
            let directions = arrays::floats::<3>(&directions, "directions")?;
            let scene = &of.scene.scene;
            let found = match (&origins, &directions) {
                (Floats::F32(origins), Floats::F32(directions)) => {
                    of.detector.cast(scene, origins, directions, most, &query)?
                }
                (Floats::F64(origins), Floats::F64(directions)) => {
                    of.detector.cast(scene, origins, directions, most, &query)?
                }
                // Single precision, read as double, is the same number.
                _ => {
                    let origins = origins.widened("origins")?;
                    let directions = directions.widened("directions")?;
                    of.detector
                        .cast(scene, &origins, &directions, most, &query)?
                }
            };
            impinge_hits::new(found, of.asked.hits()?)
        })
    }
}
