//! The elements that are nearest to each point, by branch and bound.
//!
//! Nodes are opened nearest box first, and skipped if their boxes are farther away than an element
//! certainly is. Floats that enclose the distances of elements are found: of sixteen faces at a
//! time in single precision, then in double precision of those that may still be nearest. These are
//! mostly one element, or the few that share the nearest edge or vertex. Exact comparisons decide
//! among them. So the answer does not depend on the order of the search.
//!
//! Where several are asked for, that many of the smallest upper bounds are kept, and the largest of
//! these is the bound. Floats put most of them in order, exact comparisons the rest.
//!
//! Points come in an order in which most are near to the one before. So the elements found last are
//! a first bound for the next point.
//!
//! Cost: per point some dozens of boxes per level of the tree, eight at a time; 64 boxes in each of
//! some six clusters, and about fifty faces in half of these.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::boxes::{GROWN, Rows, Waiting, rounding_of, wait_in_order};
use super::{Looks, Target, WHAT};
use crate::answers::closest::ClosestElement;
use crate::answers::pairs::Element;
use crate::bvh::GROUP;
use crate::bvh::bounds::{round_down, round_up};
use crate::scene::elements::with_corners;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{ClusterIx, ElementIx};
use crate::scene::positions::Real;
use crate::search::narrow::Corners;
use crate::search::sink::grow;
use crate::search::work::Work;
use crate::simd::{Isa, Lanes, Simd, up_to, with_isa};
use impinge_exact::Point;
use impinge_exact::internal::filter::number::Lookup;
use impinge_exact::internal::filter::{BATCH, point_bounds_in_tables};
use impinge_exact::internal::{
    Reach, closest_of_elements, compare_point_distances, elements_are_within, point_distance_bounds,
};

/// More than what rounding may do to squares of distances of boxes, which are of a few operations.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Candidates that are held before those that are too far away are dropped, where several are asked
/// for.
const FIRST_DROP: usize = 64;

/// The nearest elements to each point: as many entries as are asked for, nearest first.
///
/// # Errors
/// Cancellation.
pub(super) fn closest<R: Real>(
    isa: Isa,
    bodies: &[(BodyId, Target<'_>)],
    points: &[[R; 3]],
    (most, n_nearest): (f64, usize),
    found: &mut [Option<ClosestElement>],
    work: Work<'_>,
) -> Result<(), Error> {
    with_isa!(isa, all_closest, <R: Real>(
        bodies: &[(BodyId, Target<'_>)] = bodies,
        points: &[[R; 3]] = points,
        most: f64 = most,
        n_nearest: usize = n_nearest,
        found: &mut [Option<ClosestElement>] = found,
        work: Work<'_> = work,
    ) -> Result<(), Error>)
}

#[inline(always)]
fn all_closest<S: Simd, R: Real>(
    simd: S,
    bodies: &[(BodyId, Target<'_>)],
    points: &[[R; 3]],
    most: f64,
    n_nearest: usize,
    found: &mut [Option<ClosestElement>],
    work: Work<'_>,
) -> Result<(), Error> {
    let mut search = PointSearch::new(n_nearest, work);
    let mut order: Vec<(f32, usize)> = Vec::new();
    let (mut likely, mut nearest) = (Vec::new(), Vec::new());
    for (point, found) in points.iter().zip(found.chunks_exact_mut(n_nearest)) {
        let point = point.map(R::widen);
        search.begin(most);
        search.expect(bodies, &point, &likely)?;
        order.clear();
        let rounded = RoundedPoint::<S::F32>::new(&point);
        let mut squares = [0.0; GROUP];
        for (number, (_, target)) in bodies.iter().enumerate() {
            let (top, _) = target.boxes.top();
            rounded.squared_distances(top.rows(), search.limit, &mut squares);
            order.push((squares[0], number));
        }
        order.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        for &(low, body) in &order {
            if low > search.limit {
                break;
            }
            search.visit(simd, (body, bodies[body].1), &point, &rounded)?;
        }
        nearest.clear();
        match n_nearest {
            1 => nearest.extend(search.nearest(bodies, &point)?),
            _ => search.nearest_of_many(bodies, &point, &mut nearest)?,
        }
        for (found, one) in found.iter_mut().zip(&nearest) {
            search.looks.step()?;
            *found = one.answer(bodies, &point, most);
            if found.is_none() {
                break;
            }
        }
        if nearest.len() == n_nearest {
            std::mem::swap(&mut likely, &mut nearest);
        }
    }
    Ok(())
}

/// An element that may be nearest.
#[derive(Debug, Clone, Copy)]
struct PointCandidate {
    /// The distance is certainly not below this.
    low: f64,
    /// Nor above this.
    high: f64,
    /// The place of the body among those that are looked at.
    body: usize,
    /// The place of the element in the order of the clusters.
    slot: usize,
}

impl PointCandidate {
    fn corners(&self, bodies: &[(BodyId, Target<'_>)]) -> Corners {
        let (_, target) = &bodies[self.body];
        corners(target, self.slot)
    }

    /// The body and the element, by number.
    fn name(&self, bodies: &[(BodyId, Target<'_>)]) -> (usize, ElementIx) {
        let (_, target) = &bodies[self.body];
        (self.body, target.boxes.clustering.order[self.slot])
    }

    /// What is said about it, if it is at most a distance away.
    fn answer(
        &self,
        bodies: &[(BodyId, Target<'_>)],
        point: &Point,
        most: f64,
    ) -> Option<ClosestElement> {
        let corners = self.corners(bodies);
        let corners = corners.points();
        if most < f64::INFINITY && !elements_are_within(&[*point], corners, &Reach::from(most)) {
            return None;
        }
        let (nearest, distance, points) = closest_of_elements(&[*point], corners);
        let (body, element) = self.name(bodies);
        Some(ClosestElement {
            element: Element {
                body: bodies[body].0,
                element: element.raw(),
            },
            feature: nearest.features[1],
            distance,
            point: points[1],
        })
    }
}

#[inline(always)]
fn corners(target: &Target<'_>, slot: usize) -> Corners {
    let elements = &target.boxes.clustering.corners;
    with_corners!(elements, |all| Corners::new(
        target.body.positions(),
        &all[slot]
    ))
}

/// Two numbers between which the distance of an element from a point certainly is.
#[inline(always)]
fn bounds_of(target: &Target<'_>, slot: usize, point: &Point) -> [f64; 2] {
    point_distance_bounds(point, corners(target, slot).points())
}

/// The search for one point; the memory is kept for the next.
struct PointSearch<'a> {
    looks: Looks<'a>,
    /// How many elements are asked for.
    n_nearest: usize,
    /// As many elements as are asked for are certainly not farther away.
    high: f64,
    /// Boxes whose squared distance is larger hold nothing as near.
    limit: f32,
    candidates: Vec<PointCandidate>,
    /// Where several are asked for: the smallest upper bounds of candidates, at most as many, as
    /// bits, which have the same order.
    highs: BinaryHeap<u64>,
    /// How many candidates are held before those that are too far away are dropped.
    drop_at: usize,
    /// By the squared distances of their boxes.
    waiting: Vec<Waiting>,
}

impl<'a> PointSearch<'a> {
    fn new(n_nearest: usize, work: Work<'a>) -> Self {
        PointSearch {
            looks: Looks::new(work),
            n_nearest,
            high: f64::INFINITY,
            limit: f32::INFINITY,
            candidates: Vec::new(),
            highs: BinaryHeap::new(),
            drop_at: FIRST_DROP,
            waiting: Vec::new(),
        }
    }

    fn begin(&mut self, most: f64) {
        self.candidates.clear();
        self.highs.clear();
        self.drop_at = FIRST_DROP;
        (self.high, self.limit) = (f64::INFINITY, f32::INFINITY);
        self.tighten(most);
    }

    /// Takes the bound that as many elements as are asked for give, if there are as many: those
    /// found last.
    #[inline(always)]
    fn expect(
        &mut self,
        bodies: &[(BodyId, Target<'_>)],
        point: &Point,
        likely: &[PointCandidate],
    ) -> Result<(), Error> {
        let mut largest = None;
        for one in likely {
            self.looks.step()?;
            let [_, high] = point_distance_bounds(point, one.corners(bodies).points());
            if largest.is_none_or(|largest| high > largest) {
                largest = Some(high);
            }
        }
        if let Some(high) = largest {
            self.tighten(high);
        }
        Ok(())
    }

    #[inline(always)]
    fn tighten(&mut self, high: f64) {
        if high < self.high {
            self.high = high;
            let square = high * high * (1.0 + ROUNDING) + f64::MIN_POSITIVE;
            self.limit = round_up(square) * GROWN;
        }
    }

    /// Adds the elements of a body that may be nearest.
    #[inline(always)]
    fn visit<S: Simd>(
        &mut self,
        simd: S,
        (body, target): (usize, Target<'_>),
        point: &Point,
        rounded: &RoundedPoint<S::F32>,
    ) -> Result<(), Error> {
        let boxes = target.boxes;
        let mut lows = [0.0; GROUP];
        let (mut siblings, mut level) = boxes.top();
        self.waiting.clear();
        loop {
            let mask = rounded.squared_distances(siblings.rows(), self.limit, &mut lows);
            wait_in_order(&mut self.waiting, (siblings, level), mask, &lows);
            // The next node above the clusters, whose children are looked at next.
            loop {
                let Some((low, of_node, node)) = self.waiting.pop() else {
                    return Ok(());
                };
                if low > self.limit {
                    continue;
                }
                self.looks.step()?;
                if of_node > 0 {
                    siblings = boxes.children(of_node, node);
                    level = of_node - 1;
                    break;
                }
                let cluster = ClusterIx::new(node);
                self.compare(simd, (body, target), cluster, point, rounded, &mut lows)?;
            }
        }
    }

    /// Adds the elements of a cluster that may be nearest.
    #[inline(always)]
    fn compare<S: Simd>(
        &mut self,
        simd: S,
        (body, target): (usize, Target<'_>),
        cluster: ClusterIx,
        point: &Point,
        rounded: &RoundedPoint<S::F32>,
        lows: &mut [f32; GROUP],
    ) -> Result<(), Error> {
        let slots = target.boxes.clustering.slots(cluster);
        let lanes = target.boxes.elements(target.body, cluster);
        let mask = rounded.squared_distances(Rows::of_elements(lanes), self.limit, lows);
        let mut mask = mask & up_to(slots.len() - 1);
        if mask == 0 {
            return Ok(());
        }
        grow(&mut self.candidates, GROUP, WHAT)?;
        let Some(faces) = target.boxes.faces(target.body, cluster) else {
            for lane in Lanes(mask) {
                if lows[lane] <= self.limit {
                    let slot = slots.start + lane;
                    self.add(bounds_of(&target, slot, point), body, slot);
                }
            }
            return Ok(());
        };
        let error = rounded.error + target.boxes.rounding();
        let mut list = [0u8; GROUP];
        while mask != 0 {
            let n = simd.list_lanes(mask, &mut list).min(BATCH);
            let Some(batch) = list.first_chunk::<BATCH>() else {
                break;
            };
            let [lowest, highest] =
                point_bounds_in_tables::<S::F32>(&rounded.nearest, faces, batch);
            for ix in 0..n {
                let slot = slots.start + usize::from(batch[ix]);
                let (low, high) = (f64::from(lowest[ix]), f64::from(highest[ix]));
                let bounds = match high < f64::INFINITY {
                    true => [low - error, high + error],
                    // Sizes are out of range.
                    false => bounds_of(&target, slot, point),
                };
                self.add(bounds, body, slot);
            }
            // Lanes after these, of boxes that are still near enough.
            mask &= !up_to(usize::from(batch[n - 1])) & not_above::<S::F32>(lows, self.limit);
        }
        Ok(())
    }

    /// Adds an element, whose distance is between two numbers, if it may be nearest. There is room
    /// for it among the candidates.
    #[inline(always)]
    fn add(&mut self, [low, high]: [f64; 2], body: usize, slot: usize) {
        if low > self.high {
            return;
        }
        let candidate = PointCandidate {
            low,
            high,
            body,
            slot,
        };
        if self.n_nearest > 1 {
            self.add_to_many(candidate);
            return;
        }
        if high < self.high {
            self.tighten(high);
            self.candidates.retain(|other| other.low <= high);
        }
        self.candidates.push(candidate);
    }

    /// Adds an element that may be among the nearest, where several are asked for.
    #[inline(never)]
    fn add_to_many(&mut self, candidate: PointCandidate) {
        self.candidates.push(candidate);
        let high = candidate.high.abs().to_bits();
        if self.highs.len() < self.n_nearest {
            self.highs.push(high);
        } else if self.highs.peek().is_some_and(|&largest| high < largest) {
            self.highs.pop();
            self.highs.push(high);
        } else {
            return;
        }
        if self.highs.len() == self.n_nearest
            && let Some(&largest) = self.highs.peek()
        {
            self.tighten(f64::from_bits(largest));
        }
        if self.candidates.len() >= self.drop_at {
            let most = self.high;
            self.candidates.retain(|other| other.low <= most);
            self.drop_at = FIRST_DROP + 2 * self.candidates.len();
        }
    }

    /// Encloses the distances of candidates in double precision, and drops those that are certainly
    /// farther away than as many as are asked for.
    ///
    /// # Errors
    /// Cancellation.
    fn narrow(&mut self, bodies: &[(BodyId, Target<'_>)], point: &Point) -> Result<(), Error> {
        let Self {
            looks,
            high,
            candidates,
            ..
        } = self;
        candidates.retain(|one| one.low <= *high);
        if candidates.len() <= self.n_nearest {
            return Ok(());
        }
        let mut least = f64::INFINITY;
        for one in candidates.iter_mut() {
            looks.step()?;
            let [low, high] = point_distance_bounds(point, one.corners(bodies).points());
            // Either encloses the distance.
            one.low = one.low.max(low);
            one.high = one.high.min(high);
            least = least.min(one.high);
        }
        if self.n_nearest == 1 {
            candidates.retain(|one| one.low <= least);
        }
        Ok(())
    }

    /// As many of the candidates as are asked for, nearest first; of several at one distance the
    /// lowest first.
    ///
    /// # Errors
    /// Cancellation.
    fn nearest_of_many(
        &mut self,
        bodies: &[(BodyId, Target<'_>)],
        point: &Point,
        nearest: &mut Vec<PointCandidate>,
    ) -> Result<(), Error> {
        self.narrow(bodies, point)?;
        grow(nearest, self.candidates.len(), WHAT)?;
        nearest.extend_from_slice(&self.candidates);
        nearest.sort_unstable_by(|x, y| {
            if x.high < y.low {
                return Ordering::Less;
            }
            if y.high < x.low {
                return Ordering::Greater;
            }
            let [a, b] = [x, y].map(|one| one.corners(bodies));
            compare_point_distances(point, a.points(), b.points())
                .then_with(|| x.name(bodies).cmp(&y.name(bodies)))
        });
        nearest.truncate(self.n_nearest);
        Ok(())
    }

    /// The nearest of the candidates, of several the lowest.
    ///
    /// # Errors
    /// Cancellation.
    fn nearest(
        &mut self,
        bodies: &[(BodyId, Target<'_>)],
        point: &Point,
    ) -> Result<Option<PointCandidate>, Error> {
        self.narrow(bodies, point)?;
        let mut candidates = std::mem::take(&mut self.candidates);
        candidates.sort_unstable_by_key(|candidate| candidate.name(bodies));
        let mut best: Option<PointCandidate> = None;
        for &candidate in &candidates {
            if let Some(best) = best {
                self.looks.step()?;
                let [other, corners] = [candidate, best].map(|one| one.corners(bodies));
                let order = compare_point_distances(point, other.points(), corners.points());
                if order != Ordering::Less {
                    continue;
                }
            }
            best = Some(candidate);
        }
        self.candidates = candidates;
        Ok(best)
    }
}

/// A point as boxes and faces in single precision are held against it.
struct RoundedPoint<V> {
    /// Rounded down and up.
    ends: [[V; 3]; 2],
    /// Rounded to nearest.
    nearest: [f32; 3],
    /// More than rounding to nearest may move it.
    error: f64,
}

impl<V: Lookup> RoundedPoint<V> {
    #[inline(always)]
    fn new(point: &Point) -> Self {
        let mut rounded = RoundedPoint {
            ends: [[V::splat(0.0); 3]; 2],
            nearest: [0.0; 3],
            error: 0.0,
        };
        let mut is_exact = true;
        for (axis, &x) in point.iter().enumerate() {
            rounded.ends[0][axis] = V::splat(f64::from(round_down(x)));
            rounded.ends[1][axis] = V::splat(f64::from(round_up(x)));
            rounded.nearest[axis] = <f32 as Real>::round(x);
            is_exact &= f64::from(rounded.nearest[axis]) == x;
        }
        if !is_exact {
            rounded.error = rounding_of(rounded.nearest);
        }
        rounded
    }

    /// The squares of the distances from some boxes, about and never too large but for
    /// [`GROWN`], and those that are not above a limit that has grown. What follows the boxes that
    /// there are is arbitrary.
    #[cfg_attr(target_family = "wasm", inline(never))]
    #[cfg_attr(not(target_family = "wasm"), inline(always))]
    fn squared_distances(&self, rows: Rows<'_>, limit: f32, squares: &mut [f32; GROUP]) -> u64 {
        let limit = V::splat(f64::from(limit));
        let [down, up] = &self.ends;
        let mut mask = 0;
        for first in (0..rows.n).step_by(V::N) {
            let mut sum = V::splat(0.0);
            for axis in 0..3 {
                let below = rows.ends::<V>(0, axis, first) - up[axis];
                let above = down[axis] - rows.ends::<V>(1, axis, first);
                let gap = below.larger(above).larger(V::splat(0.0));
                sum = sum + gap * gap;
            }
            sum.put(squares, first);
            mask |= u64::from(V::bits(!sum.gt(limit))) << first;
        }
        mask
    }
}

/// Bit k: number k is not above a limit.
#[inline(always)]
fn not_above<V: Lookup>(numbers: &[f32; GROUP], limit: f32) -> u64 {
    let limit = V::splat(f64::from(limit));
    let mut mask = 0;
    for first in (0..GROUP).step_by(V::N) {
        let is_above = V::row(numbers, first).gt(limit);
        mask |= u64::from(V::bits(!is_above)) << first;
    }
    mask
}
