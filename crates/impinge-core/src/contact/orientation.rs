//! Which connected pieces of a closed surface have their faces turned inwards.
//!
//! The signed volume of a piece says on which side of its faces the space lies that it encloses.
//! That space is empty where the piece is the wall of a cavity: where the other pieces wind around
//! it once more than the piece itself takes away. So a piece faces outwards if its volume is
//! positive and the others do not wind around it the wrong way, or if it is negative and they wind
//! around it.
//!
//! Cost: a sum over all faces; with several pieces, some of which face inwards or are cavities, also a
//! ray for each.

use super::inside::{ByY, passes};
use super::topology::EdgesAround;
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

/// By piece: -1 if its faces are turned inwards, else 1.
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
    let mut volumes = vec![0.0; n_pieces];
    let mut origins: Vec<Option<Point>> = vec![None; n_pieces];
    for some in faces.chunks(LOOK) {
        work.step()?;
        for face in some.iter().filter(|face| has_corners(face)) {
            let piece = topology.piece(VertexIx::new(face[0]));
            let corners = face.map(position);
            // Of the piece itself: from afar, the sign of a small volume would be lost.
            let origin = *origins[piece].get_or_insert(corners[0]);
            let [p, q, r] = corners.map(|corner| sub(corner, origin));
            volumes[piece] += dot(p, cross(q, r));
        }
    }
    let around = match n_pieces > 1 && volumes.iter().any(|&volume| volume < 0.0) {
        true => around(body, faces, topology, work)?,
        false => vec![0; n_pieces],
    };
    let sign = |(&volume, &around): (&f64, &i32)| {
        let is_inward = around < 0 || (volume < 0.0 && around == 0);
        if is_inward { -1.0 } else { 1.0 }
    };
    Ok(volumes.iter().zip(&around).map(sign).collect())
}

/// Whether a face names three vertices.
fn has_corners([a, b, c]: &[u32; 3]) -> bool {
    a != b && b != c && c != a
}

/// How often the others wind around each piece: around a vertex of it that is on none of them, if
/// one of a few is not.
fn around(
    body: &Body,
    faces: &[[u32; 3]],
    topology: &EdgesAround,
    work: Work<'_>,
) -> Result<Vec<i32>, Error> {
    let position = |vertex: u32| body.positions().point(vertex as usize);
    let n_pieces = topology.n_pieces();
    let mut of_pieces: Vec<Vec<u32>> = vec![Vec::new(); n_pieces];
    for (ix, face) in (0u32..).zip(faces).filter(|(_, face)| has_corners(face)) {
        of_pieces[topology.piece(VertexIx::new(face[0]))].push(ix);
    }
    let mut found = vec![0; n_pieces];
    let mut wanted: Vec<usize> = (0..n_pieces)
        .filter(|&piece| !of_pieces[piece].is_empty())
        .collect();
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
