//! Which elements are near each element, as lists: `impinge_find_neighbours`.

use impinge::{Csr, Neighbours, Part};

use crate::arrays::view_of;
use crate::detector::impinge_detector;
use crate::questions::question;
use crate::scene::impinge_scene;
use crate::stats::{Texts, fill};
use crate::status::{Failure, destroy, guard, held, put};
use crate::types::*;

/// Lists of what is near each element.
pub struct impinge_neighbours {
    neighbours: Neighbours,
    /// The first vertex, edge and face of each body, by its number.
    firsts: Vec<(u32, [u32; 3])>,
    texts: Texts,
}

impl impinge_neighbours {
    fn new(neighbours: Neighbours) -> Self {
        let parts = [Part::Vertices, Part::Edges, Part::Faces];
        let firsts = neighbours
            .bodies()
            .map(|id| {
                let first = parts.map(|part| neighbours.first(id, part).unwrap_or(0));
                (id.index() as u32, first)
            })
            .collect();
        impinge_neighbours {
            neighbours,
            firsts,
            texts: Texts::default(),
        }
    }

    /// The lists of one kind.
    fn lists(&self, kind: u32, reversed: u32) -> Result<&Csr, Failure> {
        let kind = kind_of(kind).ok_or_else(|| {
            Failure::invalid(format!(
                "kind: {kind} given, one of IMPINGE_VF, _EE, _EV, _VV, _EF and _FF allowed"
            ))
        })?;
        match reversed {
            0 => Ok(self.neighbours.of(kind)),
            1 => Ok(self.neighbours.reversed(kind)),
            _ => Err(Failure::invalid(format!(
                "reversed: {reversed} given, 0 or 1 allowed"
            ))),
        }
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_neighbours(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    distance: f64,
    query: *const impinge_query,
    neighbours: *mut *mut impinge_neighbours,
) -> Status {
    // SAFETY: `impinge.h` says what pointers are, here and in all functions below.
    unsafe {
        question((detector, scene, query), (neighbours, "neighbours"), |of| {
            let query = of.asked.query()?;
            let scene = &of.scene.scene;
            let found = of.detector.neighbours(scene, distance, &query)?;
            Ok(impinge_neighbours::new(found))
        })
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_neighbours_count(neighbours: *const impinge_neighbours) -> usize {
    // SAFETY: see `impinge_find_neighbours`.
    unsafe { neighbours.as_ref() }.map_or(0, |of| of.neighbours.len())
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_neighbours_first(
    neighbours: *const impinge_neighbours,
    body: u32,
    first: *mut [u32; 3],
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_find_neighbours`.
        let firsts = &unsafe { held(neighbours, "neighbours") }?.firsts;
        let found = firsts.iter().find(|(of, _)| *of == body);
        let (_, found) = found.ok_or_else(|| Failure::no_body(body, firsts.len()))?;
        // SAFETY: see `impinge_find_neighbours`.
        unsafe { put(first, "first", *found) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_neighbours_lists(
    neighbours: *const impinge_neighbours,
    kind: u32,
    reversed: u32,
    offsets: *mut impinge_array,
    indices: *mut impinge_array,
    distances: *mut impinge_array,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_find_neighbours`.
        let lists = unsafe { held(neighbours, "neighbours") }?.lists(kind, reversed)?;
        let views = [
            view_of(&lists.offsets),
            view_of(&lists.indices),
            view_of(&lists.distances),
        ];
        for (to, view) in [offsets, indices, distances].into_iter().zip(views) {
            if !to.is_null() {
                // SAFETY: see `impinge_find_neighbours`.
                unsafe { to.write_unaligned(view) };
            }
        }
        Ok(())
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_neighbours_distances_f32(
    neighbours: *const impinge_neighbours,
    kind: u32,
    reversed: u32,
    distances: *mut f32,
    room: usize,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_find_neighbours`.
        let lists = unsafe { held(neighbours, "neighbours") }?.lists(kind, reversed)?;
        let n = lists.distances.len();
        if room < n {
            return Err(Failure::invalid(format!(
                "distances: room for {room} numbers given, {n} needed"
            )));
        }
        if n == 0 {
            return Ok(());
        }
        if distances.is_null() {
            return Err(Failure::null("distances"));
        }
        for (ix, distance) in lists.distances_f32().enumerate() {
            // SAFETY: The caller has room for so many numbers there.
            unsafe { distances.add(ix).write_unaligned(distance) };
        }
        Ok(())
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_neighbours_stats(
    neighbours: *const impinge_neighbours,
    stats: *mut impinge_stats,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_find_neighbours`.
        let of = unsafe { held(neighbours, "neighbours") }?;
        // SAFETY: see `impinge_find_neighbours`.
        unsafe { fill(of.neighbours.stats(), &of.texts, stats) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_neighbours_destroy(neighbours: *mut impinge_neighbours) {
    // SAFETY: see `impinge_find_neighbours`.
    unsafe { destroy(neighbours) }
}
