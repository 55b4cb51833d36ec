//! The closed pieces of a surface, and which of them are inside out.
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

use std::cmp::Ordering;

use impinge::exact::{Point, Sign};
use impinge::{Backend, Detector, Error, Scene, Settings};
use impinge_io::Positions;

use crate::facets::{facets, groups, is_simplex};
use crate::surface::{Surface, at};
use crate::union_find::UnionFind;
use crate::volume;

/// A closed piece of one orientation.
pub struct Shell {
    /// Ascending.
    pub faces: Vec<u32>,
    /// Of the volume that it encloses.
    pub sign: Sign,
    /// The box around it.
    pub low: Point,
    pub high: Point,
    /// How many shells it is inside.
    pub depth: u32,
}

impl Shell {
    /// Whether it is inside an odd number of others.
    pub fn is_cavity(&self) -> bool {
        self.depth % 2 == 1
    }

    /// Whether its faces point into matter. A shell of zero volume has no inside.
    pub fn is_inside_out(&self) -> bool {
        let wrong = match self.is_cavity() {
            true => Sign::Positive,
            false => Sign::Negative,
        };
        self.sign == wrong
    }
}

/// The closed pieces of one orientation, and how many others each is inside.
pub fn nested(surface: &Surface, threads: usize) -> Result<Vec<Shell>, Error> {
    let mut shells = shells(surface);
    nest(&surface.positions, &surface.faces, &mut shells, threads)?;
    Ok(shells)
}

/// The closed pieces of one orientation, whose depth is not counted yet.
pub fn shells(surface: &Surface) -> Vec<Shell> {
    let n = surface.faces.len();
    let sorted = facets(&surface.faces, surface.n_vertices());
    let mut pieces = UnionFind::new(n as u32);
    let mut is_closed: Vec<bool> = surface.faces.iter().map(is_simplex).collect();
    for group in groups(&sorted) {
        let closes = matches!(group, [a, b] if a.is_even != b.is_even);
        for facet in group {
            pieces.join(group[0].element, facet.element);
            is_closed[facet.element as usize] &= closes;
        }
    }
    drop(sorted);
    closed(&surface.positions, &surface.faces, &mut pieces, is_closed)
}

/// The closed ones of pieces, whose depth is not counted yet. `is_closed` says of each face whether
/// it has a neighbour of its orientation across each edge.
pub fn closed(
    positions: &Positions,
    faces: &[[u32; 3]],
    pieces: &mut UnionFind,
    mut is_closed: Vec<bool>,
) -> Vec<Shell> {
    let n = faces.len();
    let corners = |face: u32| faces[face as usize].map(|vertex| at(positions, vertex));
    let roots: Vec<u32> = (0..n as u32).map(|face| pieces.root(face)).collect();
    for face in 0..n {
        let closed = is_closed[face];
        is_closed[roots[face] as usize] &= closed;
    }
    let mut places = vec![usize::MAX; n];
    let mut shells: Vec<Shell> = Vec::new();
    for (face, &root) in roots.iter().enumerate() {
        let root = root as usize;
        if !is_closed[root] {
            continue;
        }
        // The root is the lowest face of its piece.
        if root == face {
            places[root] = shells.len();
            shells.push(Shell {
                faces: Vec::new(),
                sign: Sign::Zero,
                low: [f64::INFINITY; 3],
                high: [f64::NEG_INFINITY; 3],
                depth: 0,
            });
        }
        let shell = &mut shells[places[root]];
        shell.faces.push(face as u32);
        for point in corners(face as u32) {
            for (axis, x) in point.into_iter().enumerate() {
                shell.low[axis] = shell.low[axis].min(x);
                shell.high[axis] = shell.high[axis].max(x);
            }
        }
    }
    for shell in &mut shells {
        shell.sign = volume::sign(shell.faces.iter().map(|&face| corners(face)));
    }
    shells
}

/// Counts for each shell the shells that it is inside.
pub fn nest(
    positions: &Positions,
    faces: &[[u32; 3]],
    shells: &mut [Shell],
    threads: usize,
) -> Result<(), Error> {
    if shells.len() < 2 {
        return Ok(());
    }
    // Ascending by where boxes begin, so that what may contain a shell begins before it.
    let along = sweep_axis(shells);
    let mut order: Vec<usize> = (0..shells.len()).collect();
    order.sort_by(|&a, &b| {
        let axes = [along, (along + 1) % 3, (along + 2) % 3];
        let differ = |x: f64, y: f64| x.partial_cmp(&y).unwrap_or(Ordering::Equal);
        axes.into_iter().fold(Ordering::Equal, |order, axis| {
            order
                .then(differ(shells[a].low[axis], shells[b].low[axis]))
                .then(differ(shells[b].high[axis], shells[a].high[axis]))
        })
    });
    let mut inner: Vec<Vec<usize>> = vec![Vec::new(); shells.len()];
    let mut open: Vec<usize> = Vec::new();
    for &shell in &order {
        let Shell { low, high, .. } = &shells[shell];
        open.retain(|&outer| shells[outer].high[along] >= low[along]);
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
        let (triangles, points) = compact(positions, faces, &shells[outer].faces);
        let body = scene.add_triangles(&triangles, &points)?;
        let mut points: Vec<Point> = Vec::new();
        let mut ends = Vec::with_capacity(inner.len());
        for &shell in inner {
            points.extend(compact(positions, faces, &shells[shell].faces).1);
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

/// The axis along which the boxes are shortest, compared with the box around all of them: there the
/// fewest overlap.
fn sweep_axis(shells: &[Shell]) -> usize {
    let crowd = |axis: usize| {
        let low = shells.iter().map(|shell| shell.low[axis]);
        let high = shells.iter().map(|shell| shell.high[axis]);
        let whole = high.fold(f64::NEG_INFINITY, f64::max) - low.fold(f64::INFINITY, f64::min);
        let lengths = shells
            .iter()
            .map(|shell| shell.high[axis] - shell.low[axis]);
        let crowd = lengths.map(|length| length / whole).sum::<f64>();
        if crowd.is_finite() {
            crowd
        } else {
            f64::INFINITY
        }
    };
    let crowds = [0, 1, 2].map(crowd);
    let best = (0..3).min_by(|&a, &b| crowds[a].total_cmp(&crowds[b]));
    best.unwrap_or(0)
}

/// Faces with the vertices that they use alone.
fn compact(
    positions: &Positions,
    faces: &[[u32; 3]],
    chosen: &[u32],
) -> (Vec<[u32; 3]>, Vec<Point>) {
    let corners = || chosen.iter().map(|&face| faces[face as usize]);
    let mut vertices: Vec<u32> = corners().flatten().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let place = |vertex: u32| vertices.partition_point(|&held| held < vertex) as u32;
    let faces = corners().map(|face| face.map(place)).collect();
    let points = vertices
        .iter()
        .map(|&vertex| at(positions, vertex))
        .collect();
    (faces, points)
}
