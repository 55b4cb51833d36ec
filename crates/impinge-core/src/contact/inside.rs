//! Which vertices of a surface lie inside a closed one: exact winding numbers.
//!
//! Along an edge that does not meet the other surface, the winding number is constant. So vertices
//! joined by such edges form one *part* with one winding number. A part that reaches beyond the
//! other body's box is outside; each other part costs one ray.
//!
//! A ray goes from a vertex along +x and counts the faces that it meets, with their orientation. It
//! is shifted by an infinitely small step along y and a smaller one along z, so that it meets no
//! edge. The shift decides alike for both faces at an edge, so no crossing is counted twice or
//! missed. Signs are exact.
//!
//! Cost: the vertices within the other's box, and per part with a ray the faces that its y value
//! meets.

use std::sync::{Mutex, PoisonError};

use super::topology::EdgesAround;
use crate::scene::Body;
use crate::scene::elements::Elements;
use crate::scene::error::Error;
use crate::scene::index::VertexIx;
use crate::search::work::Work;
use impinge_exact::{Point, Sign, orient2d, orient3d};

/// Vertices between two looks at the control.
const LOOK: usize = 1 << 14;
/// Faces per task, and between two looks at the control.
const FACES: usize = 1 << 13;

/// The part of each vertex, and the winding number of each part.
pub(super) struct ConnectedParts {
    /// For each vertex: its part, or [`NO_PART`].
    part_of: Vec<u32>,
    winding: Vec<i32>,
}

/// The part of a vertex that lies outside, or on the other surface.
const NO_PART: u32 = u32::MAX;

/// A surface whose vertices inside another body are wanted, and where it meets that body's surface.
pub(super) struct Asked<'a> {
    pub body: &'a Body,
    pub topology: &'a EdgesAround,
    /// Whether a vertex lies on the other surface.
    pub is_on: &'a (dyn Fn(VertexIx) -> bool + Sync),
    /// Whether an edge meets the other surface.
    pub is_crossed: &'a (dyn Fn([VertexIx; 2]) -> bool + Sync),
}

impl ConnectedParts {
    /// The parts of a surface inside another body.
    ///
    /// # Errors
    /// Cancellation.
    pub fn new(asked: &Asked<'_>, other: &Body, work: Work<'_>) -> Result<Self, Error> {
        let n_vertices = asked.body.n_vertices();
        let mut parts = ConnectedParts {
            part_of: vec![NO_PART; n_vertices],
            winding: Vec::new(),
        };
        let Some(bounds) = bounds(other) else {
            return Ok(parts);
        };
        let position = |vertex: VertexIx| asked.body.positions().point(vertex.index());
        let is_near = |vertex: VertexIx| {
            let point = position(vertex);
            (0..3).all(|k| bounds[0][k] <= point[k] && point[k] <= bounds[1][k])
        };
        let mut seeds: Vec<(Point, u32)> = Vec::new();
        let mut members: Vec<VertexIx> = Vec::new();
        let mut is_seen = vec![false; n_vertices];
        let mut n_looked = 0usize;
        for seed in VertexIx::up_to(n_vertices) {
            n_looked += 1;
            if n_looked.is_multiple_of(LOOK) {
                work.step()?;
            }
            if is_seen[seed.index()]
                || asked.topology.neighbours(seed).is_empty()
                || !is_near(seed)
                || (asked.is_on)(seed)
            {
                continue;
            }
            // All vertices joined to the seed, and whether any of them is beyond the box.
            is_seen[seed.index()] = true;
            members.clear();
            members.push(seed);
            let mut is_outside = false;
            let mut next = 0;
            while let Some(&vertex) = members.get(next) {
                next += 1;
                n_looked += 1;
                if n_looked.is_multiple_of(LOOK) {
                    work.step()?;
                }
                for &other in asked.topology.neighbours(vertex) {
                    if (asked.is_crossed)([vertex.min(other), vertex.max(other)])
                        || (asked.is_on)(other)
                    {
                        continue;
                    }
                    if !is_near(other) {
                        is_outside = true;
                    } else if !is_seen[other.index()] {
                        is_seen[other.index()] = true;
                        members.push(other);
                    }
                }
            }
            if !is_outside {
                let part = seeds.len() as u32;
                seeds.push((position(seed), part));
                for &vertex in &members {
                    parts.part_of[vertex.index()] = part;
                }
            }
        }
        parts.winding = windings(seeds, other, work)?;
        Ok(parts)
    }

    /// The part of a vertex; `None` unless it is inside.
    pub fn inside(&self, vertex: VertexIx) -> Option<u32> {
        let part = self.part_of[vertex.index()];
        (part != NO_PART && self.winding[part as usize] != 0).then_some(part)
    }

    /// How often the other surface winds around a vertex that is not on it.
    pub fn winding(&self, vertex: VertexIx) -> i32 {
        match self.part_of[vertex.index()] {
            NO_PART => 0,
            part => self.winding[part as usize],
        }
    }

    pub fn n_parts(&self) -> usize {
        self.winding.len()
    }
}

/// The box of a body's vertices.
fn bounds(body: &Body) -> Option<[Point; 2]> {
    (0..body.n_vertices())
        .map(|vertex| body.positions().point(vertex))
        .map(|point| [point; 2])
        .reduce(|[low, high], [p, _]| {
            [
                [0, 1, 2].map(|k| low[k].min(p[k])),
                [0, 1, 2].map(|k| high[k].max(p[k])),
            ]
        })
}

/// Numbered points, sorted by y: rays are met by few of the faces.
pub(super) struct ByY(Vec<(Point, u32)>);

impl ByY {
    pub fn new(mut points: Vec<(Point, u32)>) -> Self {
        points.sort_unstable_by(|(p, i), (q, j)| p[1].total_cmp(&q[1]).then(i.cmp(j)));
        ByY(points)
    }

    /// The points whose ray may pass a face, and their numbers.
    #[inline]
    pub fn near(&self, corners: &[Point; 3]) -> impl Iterator<Item = (&Point, usize)> {
        let ys = corners.map(|corner| corner[1]);
        let (low, high) = (ys[0].min(ys[1]).min(ys[2]), ys[0].max(ys[1]).max(ys[2]));
        let first = self.0.partition_point(|(point, _)| point[1] < low);
        let near = self.0[first..].iter();
        near.take_while(move |(point, _)| point[1] <= high)
            .map(|(point, number)| (point, *number as usize))
    }
}

/// How often a closed surface winds around each point, none of which lies on it.
fn windings(seeds: Vec<(Point, u32)>, body: &Body, work: Work<'_>) -> Result<Vec<i32>, Error> {
    let n = seeds.len();
    let Elements::Triangles(faces) = body.elements() else {
        return Ok(vec![0; n]);
    };
    if n == 0 {
        return Ok(Vec::new());
    }
    let seeds = ByY::new(seeds);
    let add = |sums: &mut [i32], face: &[u32; 3]| {
        let corners = face.map(|vertex| body.positions().point(vertex as usize));
        for (point, number) in seeds.near(&corners) {
            sums[number] += passes(point, &corners);
        }
    };
    // A task of few faces takes less than its list of sums if there are many seeds.
    let n_each = FACES.max(n);
    let mut tasks: Vec<&[[u32; 3]]> = faces.chunks(n_each).collect();
    let all = Mutex::new(vec![0; n]);
    work.each(&mut tasks, |_, faces| {
        let mut sums = vec![0; n];
        for some in faces.chunks(FACES) {
            some.iter().for_each(|face| add(&mut sums, face));
            work.step()?;
        }
        let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
        all.iter_mut().zip(sums).for_each(|(all, sum)| *all += sum);
        Ok(())
    })?;
    Ok(all.into_inner().unwrap_or_else(PoisonError::into_inner))
}

/// 1 if the shifted ray from a point leaves through a face, -1 if it enters through it, else 0.
pub(crate) fn passes(point: &Point, corners: &[Point; 3]) -> i32 {
    if corners.iter().all(|corner| corner[0] < point[0]) {
        return 0;
    }
    let flat = |p: &Point| [p[1], p[2]];
    let at = flat(point);
    // The edges above the shifted point in the plane of y and z: those that lead to higher y minus
    // those that lead to lower y.
    let mut around = 0;
    for k in 0..3 {
        let (p, q) = (flat(&corners[k]), flat(&corners[(k + 1) % 3]));
        let (from, to, way) = if p[0] < q[0] { (p, q, 1) } else { (q, p, -1) };
        if from[0] <= at[0] && at[0] < to[0] && orient2d(from, to, at) == Sign::Negative {
            around += way;
        }
    }
    // An edge that leads to lower y lies above the inside of a triangle that turns
    // counter-clockwise, whose normal points along +x.
    let normal = -around;
    let [a, b, c] = corners;
    let height = -(orient3d(a, b, c, point) as i32);
    match normal {
        0 => 0,
        _ if height == -normal => normal,
        _ => 0,
    }
}
