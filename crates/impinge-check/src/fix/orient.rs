//! Gives neighbours the same orientation.
//!
//! Faces are neighbours across edges of exactly two faces. Edges of more faces are no way from face
//! to face, because there neighbours in one sense are none in another; splitting pairs them
//! afterwards by the orientations found here.

use super::Surface;
use crate::facets::{facets, groups};

const NONE: u32 = u32::MAX;

/// Turns the fewest faces of each piece so that its neighbours agree. Returns how many faces were
/// turned, and how many pieces have no consistent orientation; these stay as they are.
pub fn orient(surface: &mut Surface) -> (u64, u64) {
    let n = surface.faces.len();
    let mut neighbours = vec![[(NONE, false); 3]; n];
    let sorted = facets(&surface.faces, surface.n_vertices());
    let mut disagree = false;
    for group in groups(&sorted) {
        if let [a, b] = group {
            let agree = a.is_even != b.is_even;
            disagree |= !agree;
            for (from, to) in [(a, b), (b, a)] {
                let free = neighbours[from.element as usize]
                    .iter_mut()
                    .find(|(face, _)| *face == NONE);
                if let Some(free) = free {
                    *free = (to.element, agree);
                }
            }
        }
    }
    drop(sorted);
    if !disagree {
        return (0, 0);
    }
    const UNSEEN: u8 = 2;
    let mut turned = vec![UNSEEN; n];
    let mut piece = Vec::new();
    let (mut n_turned, mut n_without) = (0, 0);
    for start in 0..n {
        if turned[start] != UNSEEN {
            continue;
        }
        turned[start] = 0;
        piece.clear();
        piece.push(start as u32);
        let mut is_consistent = true;
        let mut next = 0;
        while let Some(&face) = piece.get(next) {
            next += 1;
            for &(other, agree) in &neighbours[face as usize] {
                if other == NONE {
                    continue;
                }
                let wanted = turned[face as usize] ^ u8::from(!agree);
                let held = &mut turned[other as usize];
                if *held == UNSEEN {
                    *held = wanted;
                    piece.push(other);
                } else {
                    is_consistent &= *held == wanted;
                }
            }
        }
        if !is_consistent {
            n_without += 1;
            continue;
        }
        let of_piece = piece.iter().filter(|&&face| turned[face as usize] == 1);
        let n_marked = of_piece.count();
        // If both halves are equally many, the first face stays.
        let to_turn = u8::from(2 * n_marked <= piece.len());
        for &face in piece
            .iter()
            .filter(|&&face| turned[face as usize] == to_turn)
        {
            surface.faces[face as usize].swap(1, 2);
            n_turned += 1;
        }
    }
    (n_turned, n_without)
}
