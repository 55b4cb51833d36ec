//! Which connected pieces of a closed surface have their faces turned inwards, and which bound
//! nothing.
//!
//! A body is where its surface winds around points: where the winding number is not 0. A piece that
//! the others do not wind around faces outwards if its signed volume is positive. One that they
//! wind around is the wall of a cavity if it takes back their winding number: its space is empty.
//! Else there is solid on both of its sides, so it bounds nothing. Pieces are taken not to cross.
//! Where the others do not wind alike around all tried vertices of a piece, pieces cross; it then
//! faces as its own signed volume says.
//!
//! Cost: a sum over all faces; a comparison for each two pieces whose boxes overlap along the
//! longest axis of the body's box; where the box of a piece is within another's, also a ray for it,
//! and 16 more if the piece seems to bound nothing.

use super::inside::{ByY, passes};
use super::topology::EdgesAround;
use crate::boxes::scale::Scale;
use crate::scene::Body;
use crate::scene::elements::Elements;
use crate::scene::error::Error;
use crate::scene::index::VertexIx;
use crate::scene::vector::{cross, dot, sub};
use crate::search::work::Work;
use impinge_exact::{Point, Sign, orient3d};

/// Faces, or pairs of boxes, between two looks at the control.
const LOOK: usize = 1 << 13;
/// Vertices of a piece that are tried.
const MOST_SEEDS: usize = 16;

/// By piece: 1 if its faces are turned outwards, -1 if inwards, 0 if it bounds nothing.
pub(super) fn orientations(
    body: &Body,
    topology: &EdgesAround,
    work: Work<'_>,
) -> Result<Vec<f64>, Error> {
    let Elements::Triangles(faces) = body.elements() else {
        return Ok(Vec::new());
    };
    let position = |vertex: u32| body.positions().point(vertex as usize);
    let n_pieces = topology.n_pieces();
    let boxes = boxes(body, topology);
    let scales: Vec<Scale> = boxes.iter().copied().map(Scale::of_points).collect();
    let mut volumes = vec![0.0; n_pieces];
    let mut origins: Vec<Option<Point>> = vec![None; n_pieces];
    for some in faces.chunks(LOOK) {
        work.step()?;
        for face in some.iter().filter(|face| has_corners(face)) {
            let piece = topology.piece(VertexIx::new(face[0]));
            let corners = face.map(|vertex| scales[piece].point(position(vertex)));
            // Of the piece itself: from afar, the sign of a small volume would be lost.
            let origin = *origins[piece].get_or_insert(corners[0]);
            let [p, q, r] = corners.map(|corner| sub(corner, origin));
            volumes[piece] += dot(p, cross(q, r));
        }
    }
    let own: Vec<i32> = (volumes.iter())
        .map(|&volume| if volume < 0.0 { -1 } else { 1 })
        .collect();
    let nested = nested(&boxes, work)?;
    let around = match nested.is_empty() {
        true => vec![0; n_pieces],
        false => around(body, topology, &own, nested, work)?,
    };
    let orientation = |(&own, &around): (&i32, &i32)| match (around, around + own) {
        (0, _) => f64::from(own),
        (_, 0) => f64::from(-own),
        _ => 0.0,
    };
    Ok(own.iter().zip(&around).map(orientation).collect())
}

/// The box of each piece.
fn boxes(body: &Body, topology: &EdgesAround) -> Vec<[Point; 2]> {
    let nowhere = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    let mut boxes = vec![nowhere; topology.n_pieces()];
    for vertex in VertexIx::up_to(body.n_vertices()) {
        if topology.neighbours(vertex).is_empty() {
            continue;
        }
        let [low, high] = &mut boxes[topology.piece(vertex)];
        let point = body.positions().point(vertex.index());
        for k in 0..3 {
            low[k] = low[k].min(point[k]);
            high[k] = high[k].max(point[k]);
        }
    }
    boxes
}

/// The pieces whose boxes are within the box of another piece.
fn nested(boxes: &[[Point; 2]], work: Work<'_>) -> Result<Vec<usize>, Error> {
    let axis = longest_axis(boxes);
    let [start, end] = [0, 1].map(|k| move |piece: usize| boxes[piece][k][axis]);
    let mut by_start: Vec<usize> = (0..boxes.len()).collect();
    by_start.sort_by(|&p, &q| start(p).total_cmp(&start(q)));
    let is_within = |piece: usize, other: usize| {
        let ([low, high], [other_low, other_high]) = (boxes[piece], boxes[other]);
        piece != other && (0..3).all(|k| other_low[k] <= low[k] && high[k] <= other_high[k])
    };
    let mut nested = Vec::new();
    // Those that begin before, or at the same place, and do not end before.
    let mut open: Vec<usize> = Vec::new();
    let mut n_looked = 0;
    for at_one in by_start.chunk_by(|&p, &q| start(p) == start(q)) {
        n_looked += open.len();
        open.retain(|&other| end(other) >= start(at_one[0]));
        open.extend(at_one);
        for &piece in at_one {
            n_looked += open.len();
            if n_looked >= LOOK {
                work.step()?;
                n_looked = 0;
            }
            if open.iter().any(|&other| is_within(piece, other)) {
                nested.push(piece);
            }
        }
    }
    Ok(nested)
}

/// The longest axis of the box around some boxes.
fn longest_axis(boxes: &[[Point; 2]]) -> usize {
    let length = |axis: usize| {
        let low = boxes.iter().map(|ends| ends[0][axis]);
        let high = boxes.iter().map(|ends| ends[1][axis]);
        // Halved, so that it does not overflow.
        high.fold(f64::NEG_INFINITY, f64::max) / 2.0 - low.fold(f64::INFINITY, f64::min) / 2.0
    };
    let lengths = [0, 1, 2].map(length);
    (1..3).fold(0, |best, axis| {
        if lengths[axis] > lengths[best] {
            axis
        } else {
            best
        }
    })
}

/// Whether a face names three vertices.
fn has_corners([a, b, c]: &[u32; 3]) -> bool {
    a != b && b != c && c != a
}

/// How often the others wind around each of the wanted pieces; 0 if they wind around its vertices
/// differently. Vertices on the others are left out if one of a few is not.
fn around(
    body: &Body,
    topology: &EdgesAround,
    own: &[i32],
    mut wanted: Vec<usize>,
    work: Work<'_>,
) -> Result<Vec<i32>, Error> {
    let mut vertices: Vec<Vec<VertexIx>> = vec![Vec::new(); own.len()];
    for vertex in VertexIx::up_to(body.n_vertices()) {
        if !topology.neighbours(vertex).is_empty() {
            vertices[topology.piece(vertex)].push(vertex);
        }
    }
    let mut found = vec![0; own.len()];
    wanted.retain(|&piece| !vertices[piece].is_empty());
    for most_seeds in [1, MOST_SEEDS] {
        let mut seeds = Vec::new();
        for &piece in &wanted {
            // From all over the piece.
            let of_piece = &vertices[piece];
            let n = of_piece.len().min(most_seeds);
            seeds.extend((0..n).map(|k| of_piece[k * of_piece.len() / n]));
        }
        let around = around_seeds(body, topology, &seeds, work)?;
        let mut unsure = Vec::new();
        let piece = |seed: usize| topology.piece(seeds[seed]);
        let numbers: Vec<usize> = (0..seeds.len()).collect();
        for of_piece in numbers.chunk_by(|&p, &q| piece(p) == piece(q)) {
            let piece = piece(of_piece[0]);
            let mut off = (of_piece.iter())
                .map(|&seed| around[seed])
                .filter(|seed| !seed.is_on);
            let first = off.next();
            found[piece] = match first {
                Some(first) if off.all(|seed| seed.winding == first.winding) => first.winding,
                Some(_) => 0,
                None => around[of_piece[of_piece.len() - 1]].winding,
            };
            // One vertex does not tell that a piece bounds nothing.
            if first.is_none() || found[piece] != 0 && found[piece] + own[piece] != 0 {
                unsure.push(piece);
            }
        }
        wanted = unsure;
        if wanted.is_empty() {
            break;
        }
    }
    Ok(found)
}

/// What the other pieces are to a vertex.
#[derive(Clone, Copy, Default)]
struct AroundSeed {
    /// How often they wind around the vertex.
    winding: i32,
    /// Whether it may be on one of them.
    is_on: bool,
}

fn around_seeds(
    body: &Body,
    topology: &EdgesAround,
    seeds: &[VertexIx],
    work: Work<'_>,
) -> Result<Vec<AroundSeed>, Error> {
    let Elements::Triangles(faces) = body.elements() else {
        return Ok(Vec::new());
    };
    let position = |vertex: VertexIx| body.positions().point(vertex.index());
    // There are no more seeds than vertices.
    let points = (0u32..).zip(seeds);
    let by_y = ByY::new(points.map(|(ix, &seed)| (position(seed), ix)).collect());
    let mut around = vec![AroundSeed::default(); seeds.len()];
    for some in faces.chunks(LOOK) {
        work.step()?;
        for face in some.iter().map(|face| face.map(VertexIx::new)) {
            let own = topology.piece(face[0]);
            let corners = face.map(position);
            for (point, seed) in by_y.near(&corners) {
                if topology.piece(seeds[seed]) != own {
                    around[seed].winding += passes(point, &corners);
                    around[seed].is_on |= may_be_on(point, &corners);
                }
            }
        }
    }
    Ok(around)
}

/// Whether a point is in the box of a face and in its plane.
fn may_be_on(point: &Point, corners: &[Point; 3]) -> bool {
    let is_between = |axis: usize| {
        let [p, q, r] = corners.map(|corner| corner[axis]);
        p.min(q).min(r) <= point[axis] && point[axis] <= p.max(q).max(r)
    };
    let [a, b, c] = corners;
    (0..3).all(is_between) && orient3d(a, b, c, point) == Sign::Zero
}
