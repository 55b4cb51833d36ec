//! Which connected pieces of a closed surface have their faces turned inwards, and which bound
//! nothing.
//!
//! A body is where its surface winds around points: where the winding number is not 0. A piece that
//! the others do not wind around faces outwards if its signed volume is positive. One that they wind
//! around is the wall of a cavity if it takes back their winding number: its space is empty. Else
//! there is solid on both of its sides, so it bounds nothing. Pieces are taken not to cross.
//!
//! Cost: a sum over all faces; where the box of a piece is within another's, also a ray for it.

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

/// Faces between two looks at the control.
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
    let scales: Vec<Scale> = boxes.iter().map(|ends| Scale::of_points(ends)).collect();
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
    let nested = nested(&boxes);
    let around = match nested.is_empty() {
        true => vec![0; n_pieces],
        false => around(body, faces, topology, nested, work)?,
    };
    let orientation = |(&volume, &around): (&f64, &i32)| {
        let own = if volume < 0.0 { -1 } else { 1 };
        match (around, around + own) {
            (0, _) => f64::from(own),
            (_, 0) => f64::from(-own),
            _ => 0.0,
        }
    };
    Ok(volumes.iter().zip(&around).map(orientation).collect())
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
fn nested(boxes: &[[Point; 2]]) -> Vec<usize> {
    let mut from_left: Vec<usize> = (0..boxes.len()).collect();
    from_left.sort_by(|&p, &q| boxes[p][0][0].total_cmp(&boxes[q][0][0]));
    let is_within = |piece: usize, other: usize| {
        let ([low, high], [other_low, other_high]) = (boxes[piece], boxes[other]);
        piece != other && (0..3).all(|k| other_low[k] <= low[k] && high[k] <= other_high[k])
    };
    let mut nested = Vec::new();
    // Those that begin further left, or at the same place, and do not end before.
    let mut open: Vec<usize> = Vec::new();
    for at_one in from_left.chunk_by(|&p, &q| boxes[p][0][0] == boxes[q][0][0]) {
        open.retain(|&other| boxes[other][1][0] >= boxes[at_one[0]][0][0]);
        open.extend(at_one);
        let is_nested = |piece: &usize| open.iter().any(|&other| is_within(*piece, other));
        nested.extend(at_one.iter().copied().filter(is_nested));
    }
    nested
}

/// Whether a face names three vertices.
fn has_corners([a, b, c]: &[u32; 3]) -> bool {
    a != b && b != c && c != a
}

/// How often the others wind around each of the wanted pieces: around a vertex of it that is on none
/// of them, if one of a few is not.
fn around(
    body: &Body,
    faces: &[[u32; 3]],
    topology: &EdgesAround,
    mut wanted: Vec<usize>,
    work: Work<'_>,
) -> Result<Vec<i32>, Error> {
    let position = |vertex: u32| body.positions().point(vertex as usize);
    let n_pieces = topology.n_pieces();
    let mut of_pieces: Vec<Vec<u32>> = vec![Vec::new(); n_pieces];
    for (ix, face) in (0u32..).zip(faces).filter(|(_, face)| has_corners(face)) {
        of_pieces[topology.piece(VertexIx::new(face[0]))].push(ix);
    }
    let mut found = vec![0; n_pieces];
    wanted.retain(|&piece| !of_pieces[piece].is_empty());
    for attempt in 0..MOST_SEEDS {
        // From all over the piece.
        let seed = |piece: usize| {
            let own = &of_pieces[piece];
            let face = own[attempt * own.len() / MOST_SEEDS];
            // There are no more pieces than vertices.
            (position(faces[face as usize][attempt % 3]), piece as u32)
        };
        let seeds = ByY::new(wanted.iter().map(|&piece| seed(piece)).collect());
        let mut is_on = vec![false; n_pieces];
        wanted.iter().for_each(|&piece| found[piece] = 0);
        for some in faces.chunks(LOOK) {
            work.step()?;
            for face in some {
                let own = topology.piece(VertexIx::new(face[0]));
                let corners = face.map(position);
                for (point, piece) in seeds.near(&corners).filter(|(_, piece)| *piece != own) {
                    found[piece] += passes(point, &corners);
                    is_on[piece] |= may_be_on(point, &corners);
                }
            }
        }
        wanted.retain(|&piece| is_on[piece]);
        if wanted.is_empty() {
            break;
        }
    }
    Ok(found)
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
