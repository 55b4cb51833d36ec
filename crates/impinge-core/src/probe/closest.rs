//! The elements that are nearest to each point, by branch and bound.
//!
//! Nodes are opened nearest box first, and skipped if their boxes are farther away than an element
//! certainly is. Of an element, floats that enclose its distance are found. What may be nearest by
//! these is kept, mostly one element, or the few that share the nearest edge or vertex. Exact
//! comparisons decide among these. So the answer does not depend on the order of the search.
//!
//! Where several are asked for, that many of the smallest upper bounds are kept, and the largest of
//! these is the bound. Floats put most of them in order, exact comparisons the rest.
//!
//! Points come in an order in which most are near to the one before. So the elements found last are
//! a first bound for the next point.
//!
//! Cost: per point some dozens of boxes per level of the tree, and in one or two clusters 64 boxes
//! and a few elements.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::{Looks, Target, WHAT};
use crate::answers::closest::ClosestElement;
use crate::answers::pairs::Element;
use crate::bvh::bounds::Bounds;
use crate::scene::elements::with_corners;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{ClusterIx, ElementIx};
use crate::scene::positions::Real;
use crate::scene::vector::dot;
use crate::search::narrow::Corners;
use crate::search::sink::grow;
use crate::search::work::Work;
use crate::simd::{Isa, LaneBounds, Lanes, Simd, up_to, with_isa};
use impinge_exact::Point;
use impinge_exact::internal::{
    Reach, closest_of_elements, compare_point_distances, elements_are_within, point_distance_bounds,
};

/// More than what rounding may do to squares of distances of boxes, which are of a few operations.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// The square of the shortest way across which planes are taken.
const SHORTEST: f64 = 1e-250;

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
    _simd: S,
    bodies: &[(BodyId, Target<'_>)],
    points: &[[R; 3]],
    most: f64,
    n_nearest: usize,
    found: &mut [Option<ClosestElement>],
    work: Work<'_>,
) -> Result<(), Error> {
    let mut search = PointSearch::new(n_nearest, work);
    let mut order: Vec<(f64, usize)> = Vec::new();
    let (mut likely, mut nearest) = (Vec::new(), Vec::new());
    for (point, found) in points.iter().zip(found.chunks_exact_mut(n_nearest)) {
        let point = point.map(R::widen);
        search.begin(most);
        search.expect(bodies, &point, &likely)?;
        order.clear();
        for (number, (_, target)) in bodies.iter().enumerate() {
            order.push((squared_distance(&target.boxes.root(), &point), number));
        }
        order.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        for &(low, body) in &order {
            if low > search.limit {
                break;
            }
            search.visit(body, bodies[body].1, &point)?;
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

/// The search for one point; the memory is kept for the next.
struct PointSearch<'a> {
    looks: Looks<'a>,
    /// How many elements are asked for.
    n_nearest: usize,
    /// As many elements as are asked for are certainly not farther away.
    high: f64,
    /// Boxes whose squared distance is larger hold nothing as near.
    limit: f64,
    /// About the shortest way from that element to the point, and its length times `high`.
    way: Point,
    level: f64,
    candidates: Vec<PointCandidate>,
    /// Where several are asked for: the smallest upper bounds of candidates, at most as many, as
    /// bits, which have the same order.
    highs: BinaryHeap<u64>,
    /// How many candidates are held before those that are too far away are dropped.
    drop_at: usize,
    /// Squared distances of boxes, levels and nodes that wait.
    waiting: Vec<(f64, usize, usize)>,
}

impl<'a> PointSearch<'a> {
    fn new(n_nearest: usize, work: Work<'a>) -> Self {
        PointSearch {
            looks: Looks::new(work),
            n_nearest,
            high: f64::INFINITY,
            limit: f64::INFINITY,
            way: [0.0; 3],
            level: f64::INFINITY,
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
        (self.high, self.limit) = (f64::INFINITY, f64::INFINITY);
        (self.way, self.level) = ([0.0; 3], f64::INFINITY);
        self.tighten(most, [0.0; 3]);
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
        let mut largest: Option<(f64, Point)> = None;
        for one in likely {
            self.looks.step()?;
            let ([_, high], way) = point_distance_bounds(point, one.corners(bodies).points());
            if largest.is_none_or(|(largest, _)| high > largest) {
                largest = Some((high, way));
            }
        }
        if let Some((high, way)) = largest {
            self.tighten(high, way);
        }
        Ok(())
    }

    #[inline(always)]
    fn tighten(&mut self, high: f64, way: Point) {
        if high < self.high {
            self.high = high;
            self.limit = high * high * (1.0 + ROUNDING) + f64::MIN_POSITIVE;
            self.way = way;
            let square = dot(way, way);
            // The squares of shorter ways lose bits.
            self.level = match square > SHORTEST {
                true => high * square.sqrt() * (1.0 + ROUNDING),
                false => f64::INFINITY,
            };
        }
    }

    /// Whether all corners of an element are beyond a plane across the way, which is farther from
    /// the point than the nearest element. Most elements whose boxes are near are seen to be
    /// farther so.
    #[inline(always)]
    fn is_beyond(&self, point: &Point, corners: &[Point]) -> bool {
        let (mut lowest, mut size) = (f64::INFINITY, 0.0f64);
        for corner in corners {
            let to = [0, 1, 2].map(|k| point[k] - corner[k]);
            lowest = lowest.min(dot(self.way, to));
            size = size.max(to[0].abs() + to[1].abs() + to[2].abs());
        }
        let of_way = self.way[0]
            .abs()
            .max(self.way[1].abs())
            .max(self.way[2].abs());
        // Three differences, products and sums.
        lowest - ROUNDING * of_way * size > self.level
    }

    /// Adds the elements of a body that may be nearest.
    #[inline(always)]
    fn visit(&mut self, body: usize, target: Target<'_>, point: &Point) -> Result<(), Error> {
        let boxes = target.boxes;
        self.waiting.clear();
        if let Some(top) = boxes.n_levels().checked_sub(1) {
            self.waiting.push((0.0, top, 0));
        }
        while let Some((low, level, node)) = self.waiting.pop() {
            if low > self.limit {
                continue;
            }
            self.looks.step()?;
            if level == 0 {
                self.compare(body, target, ClusterIx::new(node as u32), point)?;
                continue;
            }
            let first = self.waiting.len();
            for child in boxes.clustering.shape.children(level, node) {
                let low = squared_distance(&boxes.node(level - 1, child), point);
                if low > self.limit {
                    continue;
                }
                // The nearest is popped first.
                let mut place = self.waiting.len();
                self.waiting.push((low, level - 1, child));
                while place > first && self.waiting[place - 1].0 < low {
                    self.waiting.swap(place - 1, place);
                    place -= 1;
                }
            }
        }
        Ok(())
    }

    /// Adds the elements of a cluster that may be nearest.
    #[inline(always)]
    fn compare(
        &mut self,
        body: usize,
        target: Target<'_>,
        cluster: ClusterIx,
        point: &Point,
    ) -> Result<(), Error> {
        let slots = target.boxes.clustering.slots(cluster);
        let lows = squared_distances(target.boxes.elements(target.body, cluster), point);
        // The nearest box first: then most others are too far away.
        let mut nearest = 0;
        let mut mask = 0u64;
        for lane in 0..slots.len() {
            mask |= u64::from(lows[lane] <= self.limit) << lane;
            if lows[lane] < lows[nearest] {
                nearest = lane;
            }
        }
        if mask >> nearest & 1 == 0 {
            return Ok(());
        }
        let rest = mask & up_to(slots.len() - 1) & !(1 << nearest);
        for lane in std::iter::once(nearest).chain(Lanes(rest)) {
            if lows[lane] > self.limit {
                continue;
            }
            let slot = slots.start + lane;
            let corners = corners(&target, slot);
            if self.is_beyond(point, corners.points()) {
                continue;
            }
            let ([low, high], way) = point_distance_bounds(point, corners.points());
            if low > self.high {
                continue;
            }
            let candidate = PointCandidate {
                low,
                high,
                body,
                slot,
            };
            grow(&mut self.candidates, 1, WHAT)?;
            if self.n_nearest > 1 {
                self.add_to_many(candidate, way);
                continue;
            }
            if high < self.high {
                self.tighten(high, way);
                self.candidates.retain(|other| other.low <= high);
            }
            self.candidates.push(candidate);
        }
        Ok(())
    }

    /// Adds an element that may be among the nearest, where several are asked for. `way` is about
    /// the shortest way from it to the point; across any way there is a plane that is too far.
    #[inline(never)]
    fn add_to_many(&mut self, candidate: PointCandidate, way: Point) {
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
            self.tighten(f64::from_bits(largest), way);
        }
        if self.candidates.len() >= self.drop_at {
            let most = self.high;
            self.candidates.retain(|other| other.low <= most);
            self.drop_at = FIRST_DROP + 2 * self.candidates.len();
        }
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
        for candidate in &self.candidates {
            self.looks.step()?;
            if candidate.low <= self.high {
                grow(nearest, 1, WHAT)?;
                nearest.push(*candidate);
            }
        }
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

/// The square of a point's distance from a box, rounded.
#[inline(always)]
fn squared_distance(bounds: &Bounds, point: &Point) -> f64 {
    let mut sum = 0.0;
    for (axis, &x) in point.iter().enumerate() {
        sum += squared_gap(bounds.min[axis], bounds.max[axis], x);
    }
    sum
}

/// The squares of a point's distances from the boxes of a cluster, rounded.
#[inline(always)]
fn squared_distances(lanes: &LaneBounds, point: &Point) -> [f64; 64] {
    let mut sums = [0.0; 64];
    for (axis, &x) in point.iter().enumerate() {
        let (min, max) = (&lanes.min[axis], &lanes.max[axis]);
        for (lane, sum) in sums.iter_mut().enumerate() {
            *sum += squared_gap(min[lane], max[lane], x);
        }
    }
    sums
}

#[inline(always)]
fn squared_gap(min: f32, max: f32, x: f64) -> f64 {
    let (below, above) = (f64::from(min) - x, x - f64::from(max));
    let gap = if below > above { below } else { above };
    let gap = if gap > 0.0 { gap } else { 0.0 };
    gap * gap
}
