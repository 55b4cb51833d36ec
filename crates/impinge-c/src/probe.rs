//! Questions about points and rays: `impinge_contains`, `impinge_signed_distance`,
//! `impinge_winding_numbers`, `impinge_locate`, `impinge_find_closest`, `impinge_cast`.

use std::mem::offset_of;

use impinge::{Closest, ClosestElement, Detector, Error, Hit, Hits, Query, Scene, Stats};

use crate::answers::{Answer, answer, asked_for, code};
use crate::arrays::{self, Floats, collect};
use crate::detector::impinge_detector;
use crate::questions::{question, value};
use crate::scene::impinge_scene;
use crate::stats::Texts;
use crate::status::Failure;
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
            feature: code(found.feature, false).into(),
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
                feature: code(hit.feature, false).into(),
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

fn find_closest(
    detector: &mut Detector,
    scene: &Scene,
    points: &Floats<'_, 3>,
    most: f64,
    query: &Query,
) -> Result<Closest, Error> {
    match points {
        Floats::F32(points) => detector.closest(scene, points, most, query),
        Floats::F64(points) => detector.closest(scene, points, most, query),
    }
}

/// Writes a number per point.
///
/// # Safety
/// `to` is NULL or has room for the values.
unsafe fn put_each<T>(
    to: *mut T,
    what: &str,
    values: impl ExactSizeIterator<Item = T>,
) -> Result<(), Failure> {
    if to.is_null() && values.len() > 0 {
        return Err(Failure::null(what));
    }
    for (ix, value) in values.enumerate() {
        // SAFETY: the caller's promise.
        unsafe { to.add(ix).write(value) };
    }
    Ok(())
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_contains(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    body: u32,
    points: impinge_array,
    places: *mut i8,
) -> Status {
    // SAFETY: `impinge.h` says what pointers are, here and in all functions below.
    unsafe {
        value((detector, scene, std::ptr::null()), |of| {
            let body = of.scene.id(body)?;
            let points = arrays::floats::<3>(&points, "points")?;
            let scene = &of.scene.scene;
            let found = match &points {
                Floats::F32(points) => of.detector.contains(scene, body, points)?,
                Floats::F64(points) => of.detector.contains(scene, body, points)?,
            };
            put_each(places, "places", found.into_iter())
        })
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
    // SAFETY: see `impinge_contains`.
    unsafe {
        value((detector, scene, std::ptr::null()), |of| {
            let body = of.scene.id(body)?;
            let points = arrays::floats::<3>(&points, "points")?;
            let scene = &of.scene.scene;
            let signed = match &points {
                Floats::F32(points) => of.detector.signed_distance(scene, body, points)?,
                Floats::F64(points) => of.detector.signed_distance(scene, body, points)?,
            };
            put_each(distances, "distances", signed.into_iter())
        })
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
    // SAFETY: see `impinge_contains`.
    unsafe {
        value((detector, scene, std::ptr::null()), |of| {
            let body = of.scene.id(body)?;
            let points = arrays::floats::<3>(&points, "points")?;
            let scene = &of.scene.scene;
            let found = match &points {
                Floats::F32(points) => of.detector.winding_numbers(scene, body, points)?,
                Floats::F64(points) => of.detector.winding_numbers(scene, body, points)?,
            };
            let numbers = found.into_iter().map(|of| of.unwrap_or(ON_SURFACE));
            put_each(windings, "windings", numbers)
        })
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
    // SAFETY: see `impinge_contains`.
    unsafe {
        value((detector, scene, std::ptr::null()), |of| {
            let body = of.scene.id(body)?;
            let points = arrays::floats::<3>(&points, "points")?;
            let scene = &of.scene.scene;
            let found = match &points {
                Floats::F32(points) => of.detector.locate(scene, body, points)?,
                Floats::F64(points) => of.detector.locate(scene, body, points)?,
            };
            let numbers = found.into_iter().map(|of| of.unwrap_or(NO_ELEMENT));
            put_each(tetrahedra, "tetrahedra", numbers)
        })
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
            let found = find_closest(of.detector, &of.scene.scene, &points, most, &query)?;
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
