//! Which elements are near each element, as lists: `impinge_find_neighbours`.

use impinge::{Csr, Neighbours, PairKind, Part};

use crate::arrays::{collect, reserve, view_of};
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
    /// In the caller's numbers of edges, where these are not the library's: by kind, and then from
    /// either side.
    own: Option<[[Lists; 2]; PairKind::ALL.len()]>,
    texts: Texts,
}

#[derive(Default)]
struct Lists {
    offsets: Vec<u64>,
    indices: Vec<u32>,
    distances: Vec<f64>,
}

const WHAT: &str = "neighbours";

impl impinge_neighbours {
    fn new(neighbours: Neighbours, scene: &impinge_scene) -> Result<Self, Failure> {
        let parts = [Part::Vertices, Part::Edges, Part::Faces];
        let mut firsts: Vec<_> = neighbours
            .bodies()
            .map(|id| {
                let first = parts.map(|part| neighbours.first(id, part).unwrap_or(0));
                (id.index() as u32, first)
            })
            .collect();
        let own = match scene.renames_edges() {
            true => Some(rename(&neighbours, scene, &mut firsts)?),
            false => None,
        };
        Ok(impinge_neighbours {
            neighbours,
            firsts,
            own,
            texts: Texts::default(),
        })
    }

    /// Offsets, indices and distances of the lists of one kind.
    fn lists(&self, kind: PairKind, is_reversed: bool) -> [impinge_array; 3] {
        let [a, b] = kind.parts();
        match &self.own {
            Some(own) => {
                let of = &own[kind as usize][usize::from(is_reversed && a != b)];
                [
                    view_of(&of.offsets),
                    view_of(&of.indices),
                    view_of(&of.distances),
                ]
            }
            None => {
                let of: &Csr = match is_reversed {
                    true => self.neighbours.reversed(kind),
                    false => self.neighbours.of(kind),
                };
                [
                    view_of(&of.offsets),
                    view_of(&of.indices),
                    view_of(&of.distances),
                ]
            }
        }
    }
}

/// Numbers edges as the caller does, and makes `firsts` those of these numbers: a list of the
/// caller's may have more rows than its body has edges.
fn rename(
    neighbours: &Neighbours,
    scene: &impinge_scene,
    firsts: &mut [(u32, [u32; 3])],
) -> Result<[[Lists; 2]; PairKind::ALL.len()], Failure> {
    // By the library's numbers.
    let mut own_of = Vec::new();
    let mut start = 0;
    for (body, first) in firsts.iter_mut() {
        let (n, numbers) = (scene.n_edges(*body)?, scene.edge_numbers(*body));
        reserve(&mut own_of, n, WHAT)?;
        own_of.extend((0..n as u32).map(|edge| start + numbers.map_or(edge, |of| of.own(edge))));
        first[1] = start;
        let n_rows = numbers.map_or(n, |of| of.rows.len());
        let end = start as usize + n_rows;
        start = u32::try_from(end).map_err(|_| {
            Failure::invalid(format!(
                "edges: {end} rows of all bodies given, at most 2^32 - 1 can be listed"
            ))
        })?;
    }
    let mut own: [[Lists; 2]; PairKind::ALL.len()] = Default::default();
    for kind in PairKind::ALL {
        let [a, b] = kind.parts();
        let sides = [
            (neighbours.of(kind), [a, b]),
            (neighbours.reversed(kind), [b, a]),
        ];
        let n_sides = if a == b { 1 } else { 2 };
        for (side, (of, parts)) in sides.into_iter().take(n_sides).enumerate() {
            own[kind as usize][side] = renamed(of, parts, &own_of, start as usize)?;
        }
    }
    Ok(own)
}

/// Lists in the caller's numbers: those of edges in another order, each ascending.
fn renamed(
    of: &Csr,
    [rows, columns]: [Part; 2],
    own_of: &[u32],
    n_edges: usize,
) -> Result<Lists, Failure> {
    // Kinds that were not asked for have no lists.
    let Some(n_given) = of.offsets.len().checked_sub(1) else {
        return Ok(Lists::default());
    };
    let own = |part: Part, element: u32| match part {
        Part::Edges => own_of[element as usize],
        _ => element,
    };
    let n = if rows == Part::Edges {
        n_edges
    } else {
        n_given
    };
    let mut given_of = collect((0..n).map(|_| None), WHAT)?;
    for element in 0..n_given {
        given_of[own(rows, element as u32) as usize] = Some(element);
    }
    let mut lists = Lists::default();
    reserve(&mut lists.offsets, n + 1, WHAT)?;
    reserve(&mut lists.indices, of.indices.len(), WHAT)?;
    reserve(&mut lists.distances, of.indices.len(), WHAT)?;
    let mut list: Vec<(u32, f64)> = Vec::new();
    for given in given_of {
        lists.offsets.push(lists.indices.len() as u64);
        let Some(given) = given else { continue };
        list.clear();
        list.extend(of.of(given).map(|(column, x)| (own(columns, column), x)));
        list.sort_unstable_by_key(|&(column, _)| column);
        lists.indices.extend(list.iter().map(|&(column, _)| column));
        lists.distances.extend(list.iter().map(|&(_, x)| x));
    }
    lists.offsets.push(lists.indices.len() as u64);
    Ok(lists)
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
            impinge_neighbours::new(found, of.scene)
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
        let (_, found) = found.ok_or_else(|| {
            Failure::invalid(format!(
                "there was no body {body} among the {} of the scene",
                firsts.len()
            ))
        })?;
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
        let of = unsafe { held(neighbours, "neighbours") }?;
        let found = kind_of(kind).ok_or_else(|| {
            Failure::invalid(format!(
                "kind: {kind} given, one of IMPINGE_VF, _EE, _EV, _VV, _EF and _FF allowed"
            ))
        })?;
        if reversed > 1 {
            return Err(Failure::invalid(format!(
                "reversed: {reversed} given, 0 or 1 allowed"
            )));
        }
        let views = of.lists(found, reversed == 1);
        for (to, view) in [offsets, indices, distances].into_iter().zip(views) {
            if !to.is_null() {
                // SAFETY: see `impinge_find_neighbours`.
                unsafe { to.write(view) };
            }
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
