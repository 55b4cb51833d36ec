//! How far each vertex may move at most, by the pairs seen so far: what becomes less is what the
//! [safe distances](crate::Detector::safe_distances) are made of.
//!
//! Each pair divides its distance between its two elements, and of several shares of a vertex the
//! least counts. So the order does not matter, and a pair whose shares are certainly no less than
//! those that its vertices have anyway need not be measured.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::bvh::GROUP;
use crate::plan::Plan;
use crate::query::Query;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::index::PartIx;
use crate::simd::Lanes32;

use super::sink::reserve;

/// Of each vertex of each body, its share.
#[derive(Debug, Default)]
pub(crate) struct Shares {
    /// Their bits: floats of at least 0 are in the order of their bits.
    all: Vec<AtomicU64>,
    /// Of each part, the first vertex of its body, and whether that is fixed.
    parts: Vec<(usize, bool)>,
}

/// Of a lower bound of a distance, what certainly is no more than is measured, which may be less
/// than the distance by 2^-20 of it.
const BELOW: f64 = 1.0 - 1.0 / (1 << 19) as f64;

impl Shares {
    /// All vertices may move by `most`, but for those of fixed bodies.
    ///
    /// # Errors
    /// There is no memory for them.
    pub fn begin(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        query: &Query,
        most: f64,
    ) -> Result<(), Error> {
        let n_vertices = scene.bodies().map(|(_, body)| body.n_vertices()).sum();
        self.all.clear();
        reserve(&mut self.all, n_vertices, "safe distances")?;
        for (id, body) in scene.bodies() {
            let own = if query.fixed.contains(&id) { 0.0 } else { most };
            let own = std::iter::repeat_n(own.to_bits(), body.n_vertices());
            self.all.extend(own.map(AtomicU64::new));
        }
        self.parts.clear();
        let firsts = plan.first_vertices(scene);
        let are_fixed = plan.parts.iter().map(|part| query.fixed.contains(&part.id));
        self.parts.extend(firsts.into_iter().zip(are_fixed));
        Ok(())
    }

    /// What each vertex has.
    pub fn iter(&self) -> impl Iterator<Item = f64> + '_ {
        let all = self.all.iter();
        all.map(|bits| f64::from_bits(bits.load(Ordering::Relaxed)))
    }

    /// Bytes of them.
    pub fn bytes(&self) -> usize {
        size_of::<AtomicU64>() * self.all.capacity()
    }

    /// Those of the vertices of two parts.
    pub fn between(&self, parts: [PartIx; 2]) -> SharesBetween<'_> {
        let [a, b] = parts.map(|part| self.parts[part.index()]);
        SharesBetween {
            all: [&self.all[a.0..], &self.all[b.0..]],
            are_fixed: [a.1, b.1],
        }
    }
}

/// The shares of the vertices of two parts.
pub(crate) struct SharesBetween<'a> {
    all: [&'a [AtomicU64]; 2],
    are_fixed: [bool; 2],
}

impl SharesBetween<'_> {
    /// Takes a pair, by a number that is at most its distance without the thickness, and both
    /// elements' corners.
    pub fn take(&self, corners: [&[u32]; 2], distance: f64) {
        let shares = self.divided(distance);
        for side in 0..2 {
            for &corner in corners[side] {
                lower(&self.all[side][corner as usize], shares[side]);
            }
        }
    }

    /// Takes a pair, by numbers between which its distance is, and how thick both elements are:
    /// none of its vertices has more than the second one gives. Returns whether the pair may give
    /// less than they have, or not be apart. Its corners are those at a slot of some lists.
    // No closures: this is inlined into kernels.
    #[inline(always)]
    pub fn lower_by(
        &self,
        corners: [(&[Lanes32], u8); 2],
        [low, high]: [f64; 2],
        thickness: f64,
    ) -> bool {
        let low = without(thickness, low * BELOW);
        let high = at_most_without(thickness, high);
        // As those of the distance itself: no number here is larger for a smaller distance.
        let (low_shares, high_shares) = (self.divided(low), self.divided(high));
        let mut is_less = low <= 0.0;
        for side in 0..2 {
            let (lists, slot) = corners[side];
            for list in lists {
                let share = &self.all[side][list.0[slot as usize % GROUP] as usize];
                let now = f64::from_bits(share.load(Ordering::Relaxed));
                is_less |= low_shares[side] < now;
                if high_shares[side] < now {
                    lower(share, high_shares[side]);
                }
            }
        }
        is_less
    }

    /// How far the vertices of either element may move, so that both together move less than a
    /// number. Neither has to share with what is fixed.
    #[inline(always)]
    fn divided(&self, distance: f64) -> [f64; 2] {
        match self.are_fixed {
            [true, true] => [0.0; 2],
            [true, false] => [0.0, below(distance)],
            [false, true] => [below(distance), 0.0],
            // Half of an odd multiple of the smallest number may be rounded up.
            [false, false] => [below(distance / 2.0); 2],
        }
    }
}

/// The next number below one that is not negative; 0 below 0.
#[inline(always)]
fn below(number: f64) -> f64 {
    // Floats are in the order of their bits.
    f64::from_bits(number.to_bits().saturating_sub(1))
}

/// A number that is at most the distance of two elements minus their thickness, from one that is at
/// most their distance: 0 if that is not certainly above 0.
#[inline(always)]
fn without(thickness: f64, distance: f64) -> f64 {
    match thickness {
        0.0 => distance,
        _ => (distance - thickness).next_down().max(0.0),
    }
}

/// A number that is at least the distance of two elements minus their thickness, from one that is
/// at least their distance. A thickness above 0 is the float after a sum that was rounded.
#[inline(always)]
fn at_most_without(thickness: f64, distance: f64) -> f64 {
    match thickness {
        0.0 => distance,
        _ => {
            let least = thickness.next_down().next_down();
            (distance - least).next_up().max(0.0)
        }
    }
}

#[inline(always)]
fn lower(share: &AtomicU64, to: f64) {
    // Most are not lowered, and reading is cheaper.
    if to.to_bits() < share.load(Ordering::Relaxed) {
        share.fetch_min(to.to_bits(), Ordering::Relaxed);
    }
}
