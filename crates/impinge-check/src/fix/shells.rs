//! Turns closed shells so that matter is inside.
//!
//! A shell is a piece without a border and of one orientation. It is inside out if the sign of its
//! signed volume, which is decided exactly, is not the one that its place asks for: positive for a
//! shell inside an even number of others, negative for a cavity, which is inside an odd number.
//! Which shell is inside which is decided exactly too, by `Detector::contains`: a shell is inside
//! another one if its vertices are, those on the other surface left out. Shells that pass through
//! each other contain each other as little as shells that are apart.
//!
//! The sign of the volume is used, not the normal at an extreme vertex: both agree for shells that
//! do not intersect themselves, and for others the volume says which orientation has more matter
//! inside.

use impinge::exact::{Point, Sign};
use impinge::{Backend, Detector, Error, Scene, Settings};

use super::Repairs;
use crate::surface::{Shell, Surface, shells};

/// Turns the shells that are inside out. Returns whether there were any.
///
/// `turned` says of each face whether it is turned already, and is kept up: a shell counts as
/// turned if faces of it are.
pub fn turn(
    surface: &mut Surface,
    threads: usize,
    turned: &mut Vec<bool>,
    repairs: &mut Repairs,
) -> Result<bool, Error> {
    let mut shells = shells(surface);
    repairs.shells = shells.len() as u64;
    nest(surface, &mut shells, threads)?;
    turned.resize(surface.faces.len(), false);
    let mut any = false;
    for shell in &shells {
        let is_cavity = shell.depth % 2 == 1;
        repairs.cavities += u64::from(is_cavity);
        let wanted = if is_cavity {
            Sign::Negative
        } else {
            Sign::Positive
        };
        if shell.sign.is_zero() {
            repairs.flat_shells += 1;
        } else if shell.sign != wanted {
            any = true;
            for &face in &shell.faces {
                surface.faces[face as usize].swap(1, 2);
                turned[face as usize] ^= true;
            }
        }
        let is_turned = shell.faces.iter().any(|&face| turned[face as usize]);
        repairs.turned_shells += u64::from(is_turned && !shell.sign.is_zero());
    }
    Ok(any)
}

/// Counts for each shell the shells that it is inside.
fn nest(surface: &Surface, shells: &mut [Shell], threads: usize) -> Result<(), Error> {
    if shells.len() < 2 {
        return Ok(());
    }
    // Ascending by where boxes begin, so that what may contain a shell begins before it.
    let mut order: Vec<usize> = (0..shells.len()).collect();
    order.sort_by(|&a, &b| {
        shells[a].low[0]
            .total_cmp(&shells[b].low[0])
            .then(shells[b].high[0].total_cmp(&shells[a].high[0]))
    });
    let mut inner: Vec<Vec<usize>> = vec![Vec::new(); shells.len()];
    let mut open: Vec<usize> = Vec::new();
    for &shell in &order {
        let Shell { low, high, .. } = &shells[shell];
        open.retain(|&outer| shells[outer].high[0] >= low[0]);
        for &outer in &open {
            let around = &shells[outer];
            let fits =
                |axis: usize| around.low[axis] <= low[axis] && high[axis] <= around.high[axis];
            if (0..3).all(fits) {
                inner[outer].push(shell);
            }
        }
        open.push(shell);
    }
    let mut detector = Detector::new(Settings::new().backend(Backend::Cpu).threads(threads))?;
    for (outer, inner) in inner.iter().enumerate() {
        if inner.is_empty() || shells[outer].sign.is_zero() {
            continue;
        }
        let mut scene = Scene::new();
        let (faces, points) = compact(surface, &shells[outer].faces);
        let body = scene.add_triangles(&faces, &points)?;
        let mut points: Vec<Point> = Vec::new();
        let mut ends = Vec::with_capacity(inner.len());
        for &shell in inner {
            points.extend(compact(surface, &shells[shell].faces).1);
            ends.push(points.len());
        }
        let places = detector.contains(&scene, body, &points)?;
        let mut start = 0;
        for (&shell, end) in inner.iter().zip(ends) {
            let places = &places[start..end];
            start = end;
            let is_inside = places.contains(&1) && !places.contains(&-1);
            shells[shell].depth += u32::from(is_inside);
        }
    }
    Ok(())
}

/// Faces with the vertices that they use alone.
fn compact(surface: &Surface, chosen: &[u32]) -> (Vec<[u32; 3]>, Vec<Point>) {
    let corners = || chosen.iter().map(|&face| surface.faces[face as usize]);
    let mut vertices: Vec<u32> = corners().flatten().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let place = |vertex: u32| vertices.partition_point(|&held| held < vertex) as u32;
    let faces = corners().map(|face| face.map(place)).collect();
    let points = vertices.iter().map(|&vertex| surface.at(vertex)).collect();
    (faces, points)
}
