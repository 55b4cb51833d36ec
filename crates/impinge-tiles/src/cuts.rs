//! The choice of cuts: at medians of a sample of boxes, until a cell holds few enough elements.

use crate::cells::{Bounds, Cells};

/// A cell is not cut if the two sides together would hold more than this multiple of its
/// elements.
const MAX_GROWTH: f64 = 1.5;

/// A cell is not cut if the larger side would keep more than this share of its elements.
const MAX_KEPT: f64 = 0.9;

/// The most cuts on the way to a cell.
const MAX_DEPTH: usize = 64;

/// Cells of about `cap` elements each, from a sample in which each box stands for `weight`
/// elements. The result depends on the sample alone.
pub fn cells(sample: &[Bounds], weight: f64, cap: u64) -> Cells {
    let mut cells = Cells::whole();
    let all: Vec<u32> = (0..sample.len() as u32).collect();
    let mut open = vec![(0u32, all, 0usize)];
    while let Some((tile, members, depth)) = open.pop() {
        if members.len() as f64 * weight <= cap as f64 || depth == MAX_DEPTH {
            continue;
        }
        let Some((axis, at)) = best_cut(sample, &members) else {
            continue;
        };
        let high_tile = cells.cut(tile, axis, at);
        let (low, high): (Vec<u32>, Vec<u32>) = (
            members
                .iter()
                .copied()
                .filter(|&ix| sample[ix as usize].0[axis] < at)
                .collect(),
            members
                .iter()
                .copied()
                .filter(|&ix| sample[ix as usize].1[axis] >= at)
                .collect(),
        );
        open.push((high_tile, high, depth + 1));
        open.push((tile, low, depth + 1));
    }
    cells
}

/// The median cut that copies the fewest boxes; `None` if no cut is worth its copies, as for boxes
/// on one spot.
fn best_cut(sample: &[Bounds], members: &[u32]) -> Option<(usize, f64)> {
    let n = members.len() as f64;
    let mut best: Option<(usize, usize, f64)> = None;
    for axis in 0..3 {
        let mut lows: Vec<f64> = members
            .iter()
            .map(|&ix| sample[ix as usize].0[axis])
            .collect();
        let middle = lows.len() / 2;
        let (_, &mut at, _) = lows.select_nth_unstable_by(middle, f64::total_cmp);
        let n_low = members
            .iter()
            .filter(|&&ix| sample[ix as usize].0[axis] < at)
            .count();
        let n_high = members
            .iter()
            .filter(|&&ix| sample[ix as usize].1[axis] >= at)
            .count();
        let is_worth_it =
            (n_low + n_high) as f64 <= MAX_GROWTH * n && n_low.max(n_high) as f64 <= MAX_KEPT * n;
        if is_worth_it && best.is_none_or(|(copies, ..)| n_low + n_high < copies) {
            best = Some((n_low + n_high, axis, at));
        }
    }
    best.map(|(_, axis, at)| (axis, at))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_boxes_is_cut_evenly() {
        let sample: Vec<Bounds> = (0..1000)
            .map(|ix| ([f64::from(ix), 0.0, 0.0], [f64::from(ix) + 0.5, 1.0, 1.0]))
            .collect();
        let cells = cells(&sample, 1.0, 100);
        assert!((10..=16).contains(&cells.n_tiles()), "{}", cells.n_tiles());
        let mut counts = vec![0; cells.n_tiles() as usize];
        for (lo, hi) in &sample {
            for tile in cells.touched(*lo, *hi) {
                counts[tile as usize] += 1;
            }
        }
        assert!(counts.iter().all(|&n| n <= 101), "{counts:?}");
        assert!(counts.iter().sum::<i32>() <= 1016);
    }

    #[test]
    fn boxes_on_one_spot_are_not_cut() {
        let sample = vec![([0.0; 3], [1.0; 3]); 1000];
        assert_eq!(cells(&sample, 1.0, 10).n_tiles(), 1);
        let flat = vec![([0.0; 3], [0.0; 3]); 1000];
        assert_eq!(cells(&flat, 1.0, 10).n_tiles(), 1);
    }
}
