//! Closes holes of few edges with triangles between their vertices.
//!
//! A hole is a simple loop of border edges. Of all its triangulations the one of the least area is
//! chosen (dynamic programming, as Barequet and Sharir 1995), among those without a triangle of
//! zero area and without a diagonal that is an edge of the mesh already. A hole whose filling
//! intersects anything is opened again, so closing holes adds no self-intersection. Cost: the cube
//! of the hole's edges, and one search for self-intersections.

use std::collections::{HashMap, HashSet};

use impinge::Error;
use impinge::exact::Point;

use super::{FixOptions, Repairs, Surface, faces};
use crate::analysis::{Options, intersecting_with_seams, is_flat_triangle};
use crate::facets::{facets, groups};

/// The most edges of a hole that can be closed.
pub const MOST_HOLE_EDGES: usize = 256;

/// Closes what can be closed, and counts it in addition to what was closed before.
pub fn close(
    surface: &mut Surface,
    options: &FixOptions,
    repairs: &mut Repairs,
) -> Result<(), Error> {
    let sorted = facets(&surface.faces, surface.n_vertices());
    let mut edges: HashSet<[u32; 2]> = HashSet::new();
    let mut borders: Vec<[u32; 2]> = Vec::new();
    // Faces alone: what looks like a hole of three edges is their outside.
    let mut alone_at: HashSet<[u32; 3]> = HashSet::new();
    for group in groups(&sorted) {
        let [u, v, _] = group[0].vertices;
        edges.insert([u, v]);
        if let [alone] = group {
            let face = surface.faces[alone.element as usize];
            let mut vertices = face;
            vertices.sort_unstable();
            alone_at.insert(vertices);
            let is_forward = (0..3).any(|ix| face[ix] == u && face[(ix + 1) % 3] == v);
            // The filling passes the edge against the face.
            borders.push(if is_forward { [v, u] } else { [u, v] });
        }
    }
    drop(sorted);
    let n_before = surface.faces.len();
    // The hole of each new face.
    let mut hole_of: Vec<u32> = Vec::new();
    let mut n_holes = 0u32;
    for hole in loops(&borders, options.close_holes) {
        let points: Vec<Point> = hole.iter().map(|&vertex| surface.at(vertex)).collect();
        let mut vertices = hole.clone();
        vertices.sort_unstable();
        let is_outside = matches!(vertices[..], [a, b, c] if alone_at.contains(&[a, b, c]));
        let filling = triangulate(&hole, &points, &edges).filter(|_| !is_outside);
        let Some(filling) = filling else {
            repairs.refused_holes += 1;
            continue;
        };
        for face in filling {
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                let (a, b) = (face[a], face[b]);
                edges.insert([a.min(b), a.max(b)]);
            }
            surface.faces.push(face);
            hole_of.push(n_holes);
        }
        n_holes += 1;
    }
    let mut is_bad = vec![false; n_holes as usize];
    if n_holes > 0 {
        let checked = Options {
            weld: false,
            keep_seams: true,
            places: 0,
            threads: options.threads,
            ..Options::default()
        };
        let intersects = intersecting_with_seams(&surface.mesh(), &checked)?;
        for (&hole, &intersects) in hole_of.iter().zip(&intersects[n_before..]) {
            is_bad[hole as usize] |= intersects;
        }
        let mut goes = vec![false; n_before];
        goes.extend(hole_of.iter().map(|&hole| is_bad[hole as usize]));
        let n_reopened = faces::remove(surface, &goes);
        repairs.added_faces += hole_of.len() as u64 - n_reopened;
    }
    let n_bad = is_bad.iter().filter(|is_bad| **is_bad).count() as u64;
    repairs.refused_holes += n_bad;
    repairs.closed_holes += u64::from(n_holes) - n_bad;
    Ok(())
}

/// Closed loops of border edges with at most `most` edges, in which each vertex has one edge in and
/// one out.
fn loops(borders: &[[u32; 2]], most: usize) -> Vec<Vec<u32>> {
    const SEVERAL: u32 = u32::MAX;
    let (mut next, mut entries) = (HashMap::new(), HashMap::new());
    for &[from, to] in borders {
        next.entry(from)
            .and_modify(|to| *to = SEVERAL)
            .or_insert(to);
        *entries.entry(to).or_insert(0u32) += 1;
    }
    let mut starts: Vec<u32> = next.keys().copied().collect();
    starts.sort_unstable();
    let mut seen: HashSet<u32> = HashSet::new();
    let mut found = Vec::new();
    for start in starts {
        if seen.contains(&start) {
            continue;
        }
        let mut hole = Vec::new();
        let mut vertex = start;
        let is_closed = loop {
            if !seen.insert(vertex) {
                break vertex == start;
            }
            if entries.get(&vertex) != Some(&1) {
                break false;
            }
            hole.push(vertex);
            match next.get(&vertex) {
                Some(&to) if to != SEVERAL => vertex = to,
                _ => break false,
            }
        };
        if is_closed && (3..=most).contains(&hole.len()) {
            found.push(hole);
        }
    }
    found
}

/// The triangulation of the least area; `None` if there is none that is allowed.
fn triangulate(hole: &[u32], points: &[Point], edges: &HashSet<[u32; 2]>) -> Option<Vec<[u32; 3]>> {
    let n = hole.len();
    let key = |a: usize, b: usize| [hole[a].min(hole[b]), hole[a].max(hole[b])];
    // A diagonal of the hole must be no edge yet.
    let is_free = |a: usize, b: usize| {
        let is_side = b == a + 1 || (a == 0 && b == n - 1);
        is_side || !edges.contains(&key(a, b))
    };
    let mut costs = vec![0.0f64; n * n];
    let mut choices = vec![usize::MAX; n * n];
    for width in 2..n {
        for a in 0..n - width {
            let b = a + width;
            let mut least = f64::INFINITY;
            if is_free(a, b) {
                for middle in a + 1..b {
                    let below = costs[a * n + middle] + costs[middle * n + b];
                    if below >= least {
                        continue;
                    }
                    let corners = [points[a], points[middle], points[b]];
                    let cost = below + area(&corners);
                    if cost < least && !is_flat_triangle(&corners) {
                        least = cost;
                        choices[a * n + b] = middle;
                    }
                }
            }
            costs[a * n + b] = least;
        }
    }
    if costs[n - 1].is_infinite() {
        return None;
    }
    let mut faces = Vec::with_capacity(n - 2);
    let mut open = vec![(0, n - 1)];
    while let Some((a, b)) = open.pop() {
        if b - a < 2 {
            continue;
        }
        let middle = choices[a * n + b];
        faces.push([hole[a], hole[middle], hole[b]]);
        open.extend([(a, middle), (middle, b)]);
    }
    Some(faces)
}

/// The area, rounded; only to choose by.
fn area([a, b, c]: &[Point; 3]) -> f64 {
    let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
    let cross = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    cross.iter().map(|x| x * x).sum::<f64>().sqrt()
}
