//! Which connected pieces of a closed surface have their faces turned inwards.
//!
//! The signed volume of a piece says on which side of its faces the space lies that it encloses.
//! That space is empty where the piece is the wall of a cavity: where the other pieces wind around
//! it once more than the piece itself takes away. So a piece faces outwards if its volume is
//! positive and the others do not wind around it the wrong way, or if it is negative and they wind
//! around it.
//!
//! Cost: a sum over all faces; with several pieces also a ray for each.

use super::inside::passes;
use super::topology::EdgesAround;
use crate::scene::Body;
use crate::scene::elements::Elements;
use crate::scene::error::Error;
use crate::scene::index::VertexIx;
use crate::scene::vector::{cross, dot, sub};
use crate::search::work::Work;
use impinge_exact::Point;

/// Faces between two looks at the control.
const LOOK: usize = 1 << 13;

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
    let mut seeds: Vec<Option<Point>> = vec![None; n_pieces];
    let origin = faces.first().map_or([0.0; 3], |face| position(face[0]));
    for some in faces.chunks(LOOK) {
        work.step()?;
        for face in some {
            let piece = topology.piece(VertexIx::new(face[0]));
            let corners = face.map(position);
            seeds[piece].get_or_insert(corners[0]);
            let [p, q, r] = corners.map(|corner| sub(corner, origin));
            volumes[piece] += dot(p, cross(q, r));
        }
    }
    let mut around = vec![0; n_pieces];
    if n_pieces > 1 && volumes.iter().any(|&volume| volume < 0.0) {
        let mut by_y: Vec<(Point, usize)> = (seeds.iter().zip(0..))
            .filter_map(|(seed, piece)| Some(((*seed)?, piece)))
            .collect();
        by_y.sort_unstable_by(|(p, i), (q, j)| p[1].total_cmp(&q[1]).then(i.cmp(j)));
        for some in faces.chunks(LOOK) {
            work.step()?;
            for face in some {
                let own = topology.piece(VertexIx::new(face[0]));
                let corners = face.map(position);
                let ys = corners.map(|corner| corner[1]);
                let (low, high) = (ys[0].min(ys[1]).min(ys[2]), ys[0].max(ys[1]).max(ys[2]));
                let first = by_y.partition_point(|(point, _)| point[1] < low);
                let met = by_y[first..].iter();
                for (point, piece) in met.take_while(|(point, _)| point[1] <= high) {
                    if *piece != own {
                        around[*piece] += passes(point, &corners);
                    }
                }
            }
        }
    }
    let sign = |(&volume, &around): (&f64, &i32)| match volume < 0.0 {
        true if around <= 0 => -1.0,
        false if around < 0 => -1.0,
        _ => 1.0,
    };
    Ok(volumes.iter().zip(&around).map(sign).collect())
}
