//! The oracle: every box against every box, then the exact test. It defines what is correct.
//!
//! Cost: quadratic in primitives; memory: the boxes. A box is the extent of a primitive's corners
//! in double precision; boxes that do not overlap (closed) hold primitives that cannot meet.

use crate::error::Error;
use crate::frame::{Frame, pair_key};
use crate::narrow::settle;
use crate::progress::Control;
use crate::scene::Scene;
use crate::stats::Statistics;

#[derive(Clone, Copy)]
struct Box64 {
    min: [f64; 3],
    max: [f64; 3],
}

fn overlap(a: &Box64, b: &Box64) -> bool {
    (0..3).all(|axis| a.min[axis] <= b.max[axis] && b.min[axis] <= a.max[axis])
}

/// Appends the keys of all pairs that the frame asks for, sorted.
pub(crate) fn run(
    scene: &Scene,
    frame: &Frame,
    control: &Control<'_>,
    keys: &mut Vec<u64>,
    stats: &mut Statistics,
) -> Result<(), Error> {
    let boxes = boxes(scene, frame);
    let n = boxes.len();
    for a in 0..n {
        control.step(a as u64, n as u64)?;
        let a_ix = frame.owner(a as u32);
        for b in a + 1..n {
            let b_ix = frame.owner(b as u32);
            let asked = if a_ix == b_ix {
                frame.participants[a_ix].within
            } else {
                frame.meets(a_ix, b_ix)
            };
            if asked && overlap(&boxes[a], &boxes[b]) {
                stats.n_candidates += 1;
                if settle(scene, frame, a as u32, b as u32) {
                    keys.push(pair_key(a as u32, b as u32));
                }
            }
        }
    }
    Ok(())
}

fn boxes(scene: &Scene, frame: &Frame) -> Vec<Box64> {
    let mut boxes = Vec::new();
    for participant_ix in 0..frame.participants.len() {
        let body = frame.body(scene, participant_ix);
        boxes.extend((0..body.n_primitives()).map(|primitive| {
            let corners = body.corner_points(primitive);
            Box64 {
                min: std::array::from_fn(|axis| {
                    corners.iter().fold(f64::INFINITY, |m, p| m.min(p[axis]))
                }),
                max: std::array::from_fn(|axis| {
                    corners
                        .iter()
                        .fold(f64::NEG_INFINITY, |m, p| m.max(p[axis]))
                }),
            }
        }));
    }
    boxes
}
