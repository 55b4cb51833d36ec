//! The elements that are nearest to each point, by branch and bound.
//!
//! Nodes are opened nearest box first, and skipped if their boxes are farther away than an element
//! certainly is. Floats that enclose the distances of elements are found: of sixteen faces at a
//! time in single precision, then, of the candidates of many points, eight at a time in double
//! precision. What then may be nearest is mostly one element, or the few that share the nearest
//! edge or vertex. Exact comparisons decide among them. So the answer does not depend on the order
//! of the search. Distances and points are found last, eight at a time.
//!
//! Where several are asked for, that many of the smallest upper bounds are kept, and the largest of
//! these is the bound. Floats put most of them in order, exact comparisons the rest.
//!
//! Points come in an order in which most are near to the one before. So the elements that seemed
//! nearest to it are a first bound for the next point.
//!
//! Cost: per point some dozens of boxes per level of the tree, eight at a time; 64 boxes in each of
//! some six clusters, and about fifty faces in half of these.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::boxes::{GROWN, SideBySide, Waiting, rounding_of, wait_in_order};
use super::{Looks, Target, WHAT, keep_from};
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
use crate::search::sink::{grow, reserve};
use crate::search::work::Work;
use crate::simd::{Isa, Lanes, Simd, closest_of_pairs, up_to, with_isa};
use impinge_exact::Point;
use impinge_exact::internal::filter::number::{Lookup, Vector};
use impinge_exact::internal::filter::{
    BATCH, LANES, Points8, bounds_and_parts, point_bounds_in_tables, put_point,
};
use impinge_exact::internal::{
    PairAtPart, Reach, compare_point_distances, elements_are_within, nearest_part_of_element,
    paired, point_distance_bounds,
};
use impinge_exact::{ElementPair, NearestPoints};

/// More than what rounding may do to squares of distances of boxes, which are of a few operations.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Candidates that are held before those that are too far away are dropped, where several are asked
/// for.
const FIRST_DROP: usize = 64;

/// The nearest elements to each point: as many entries as are asked for, nearest first.
///
/// # Errors
/// Cancellation.
pub(super) fn closest(
    isa: Isa,
    bodies: &[(BodyId, Target<'_>)],
    points: &[Point],
    asked: (f64, usize),
    found: &mut [Option<ClosestElement>],
    work: Work<'_>,
) -> Result<(), Error> {
    with_isa!(isa, all_closest, (
        isa: Isa = isa,
        bodies: &[(BodyId, Target<'_>)] = bodies,
        points: &[Point] = points,
        asked: (f64, usize) = asked,
        found: &mut [Option<ClosestElement>] = found,
        work: Work<'_> = work,
    ) -> Result<(), Error>)
}

#[inline(always)]
fn all_closest<S: Simd>(
    simd: S,
    isa: Isa,
    bodies: &[(BodyId, Target<'_>)],
    points: &[Point],
    (most, n_nearest): (f64, usize),
    found: &mut [Option<ClosestElement>],
    work: Work<'_>,
) -> Result<(), Error> {
    let mut search = PointSearch::new(isa, n_nearest, work);
    let mut order: Vec<(f32, usize)> = Vec::new();
    let mut n_answered = 0;
    for (ix, point) in points.iter().enumerate() {
        search.begin(most);
        search.expect(bodies, point)?;
        order.clear();
        let rounded = RoundedPoint::<S::F32>::new(point);
        let mut squares = [0.0; GROUP];
        for (number, (_, target)) in bodies.iter().enumerate() {
            let (top, _) = target.boxes.top();
            rounded.squared_distances(top, search.limit, &mut squares);
            order.push((squares[0], number));
        }
        order.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        for &(low, body) in &order {
            if low > search.limit {
                break;
            }
            search.visit(simd, (body, bodies[body].1), point, &rounded)?;
        }
        search.end(point)?;
        let n_waiting = search.candidates.len().max(search.of_points.len());
        if n_waiting >= MANY || ix + 1 == points.len() {
            let n = search.of_points.len();
            let found = &mut found[n_answered * n_nearest..][..n * n_nearest];
            search.answer::<S::F64>(bodies, most, found)?;
            n_answered += n;
        }
    }
    Ok(())
}

/// Candidates of several points, of which the numbers are found at once.
const MANY: usize = 256;

/// A number that no part has.
const UNKNOWN: u8 = u8::MAX;

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
    /// The number of its nearest part, if that is known.
    part: u8,
}

impl PointCandidate {
    #[inline(always)]
    fn corners(&self, bodies: &[(BodyId, Target<'_>)]) -> Corners {
        let (_, target) = &bodies[self.body];
        corners(target, self.slot)
    }

    /// The body and the element, by number.
    fn name(&self, bodies: &[(BodyId, Target<'_>)]) -> (usize, ElementIx) {
        let (_, target) = &bodies[self.body];
        (self.body, target.boxes.clustering.order[self.slot])
    }

    /// Takes another enclosure of the distance, and the nearest part.
    #[inline(always)]
    fn narrow(&mut self, [low, high]: [f64; 2], part: u8) {
        self.low = self.low.max(low);
        self.high = self.high.min(high);
        self.part = part;
    }

    /// Which is nearer to a point; of two at one distance the lower one is.
    fn compare(&self, other: &Self, bodies: &[(BodyId, Target<'_>)], point: &Point) -> Ordering {
        if self.high < other.low {
            return Ordering::Less;
        }
        if other.high < self.low {
            return Ordering::Greater;
        }
        let [a, b] = [self, other].map(|one| one.corners(bodies));
        compare_point_distances(point, (a.points(), self.part), (b.points(), other.part))
            .then_with(|| self.name(bodies).cmp(&other.name(bodies)))
    }

    /// Whether it is at most a distance away.
    fn is_within(&self, most: f64, bodies: &[(BodyId, Target<'_>)], point: &Point) -> bool {
        self.high <= most
            || self.low <= most
                && elements_are_within(&[*point], self.corners(bodies).points(), &Reach::from(most))
    }

    /// What is said about it.
    fn answer(&self, bodies: &[(BodyId, Target<'_>)], closest: &NearestPoints) -> ClosestElement {
        let (body, element) = self.name(bodies);
        ClosestElement {
            element: Element {
                body: bodies[body].0,
                element: element.raw(),
            },
            feature: closest.nearest.b,
            distance: closest.distance,
            point: closest.points[1],
        }
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

/// A point that is not answered yet.
struct WaitingPoint {
    point: Point,
    /// Where its candidates end.
    end: usize,
}

/// The search for one point after the other; the memory is kept.
struct PointSearch<'a> {
    looks: Looks<'a>,
    isa: Isa,
    /// How many elements are asked for.
    n_nearest: usize,
    /// As many elements as are asked for are certainly not farther away.
    high: f64,
    /// Boxes whose squared distance is larger hold nothing as near.
    limit: f32,
    /// Of the points that are not answered yet, one after the other.
    candidates: Vec<PointCandidate>,
    /// The first of this point.
    first: usize,
    /// The points that are not answered yet.
    of_points: Vec<WaitingPoint>,
    /// As many elements as are asked for that seem nearest to the point before.
    likely: Vec<PointCandidate>,
    /// The nearest elements, each with the place of its answer.
    nearest: Vec<(PointCandidate, usize)>,
    /// The same, as pairs with their points.
    pairs: Vec<PairAtPart>,
    /// What is found of these.
    closest: Vec<Option<NearestPoints>>,
    /// Where several are asked for: the smallest upper bounds of candidates, at most as many, as
    /// bits, which have the same order.
    highs: BinaryHeap<u64>,
    /// How many candidates are held before those that are too far away are dropped.
    drop_at: usize,
    /// By the squared distances of their boxes.
    waiting: Vec<Waiting>,
}

impl<'a> PointSearch<'a> {
    fn new(isa: Isa, n_nearest: usize, work: Work<'a>) -> Self {
        PointSearch {
            looks: Looks::new(work),
            isa,
            n_nearest,
            high: f64::INFINITY,
            limit: f32::INFINITY,
            candidates: Vec::new(),
            first: 0,
            of_points: Vec::new(),
            likely: Vec::new(),
            nearest: Vec::new(),
            pairs: Vec::new(),
            closest: Vec::new(),
            highs: BinaryHeap::new(),
            drop_at: FIRST_DROP,
            waiting: Vec::new(),
        }
    }

    fn begin(&mut self, most: f64) {
        self.first = self.candidates.len();
        self.highs.clear();
        self.drop_at = FIRST_DROP;
        (self.high, self.limit) = (f64::INFINITY, f32::INFINITY);
        self.tighten(most);
    }

    /// Takes the bound that as many elements as are asked for give, if there are as many: those
    /// that seemed nearest to the point before.
    #[inline(always)]
    fn expect(&mut self, bodies: &[(BodyId, Target<'_>)], point: &Point) -> Result<(), Error> {
        let mut largest = None;
        for one in &self.likely {
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
            let mask = rounded.squared_distances(siblings, self.limit, &mut lows);
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
        let mask = rounded.squared_distances(lanes, self.limit, lows);
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
            let [lowest, mut highest] =
                point_bounds_in_tables::<S::F32>(&rounded.nearest, faces, batch);
            for (ix, high) in highest.iter_mut().enumerate() {
                *high = if ix < n { *high } else { f32::INFINITY };
            }
            if self.n_nearest == 1 {
                self.tighten(f64::from(least(highest)) + error);
            }
            let near = not_above::<S::F32>(&lowest, round_up(self.high + error));
            for ix in Lanes(near & up_to(n - 1)) {
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
            part: UNKNOWN,
        };
        if self.n_nearest > 1 {
            self.add_to_many(candidate);
            return;
        }
        if high < self.high {
            self.tighten(high);
            self.forget_farther_than(high);
        }
        self.candidates.push(candidate);
    }

    /// Keeps of this point's candidates those that may be so near.
    #[inline(always)]
    fn forget_farther_than(&mut self, high: f64) {
        keep_from(&mut self.candidates, self.first, |one| one.low <= high);
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
        if self.candidates.len() - self.first >= self.drop_at {
            self.forget_farther_than(self.high);
            self.drop_at = FIRST_DROP + 2 * (self.candidates.len() - self.first);
        }
    }

    /// Ends the search for a point.
    ///
    /// # Errors
    /// Memory.
    #[inline(always)]
    fn end(&mut self, point: &Point) -> Result<(), Error> {
        self.forget_farther_than(self.high);
        grow(&mut self.of_points, 1, WHAT)?;
        self.of_points.push(WaitingPoint {
            point: *point,
            end: self.candidates.len(),
        });
        let candidates = &self.candidates[self.first..];
        if self.n_nearest == 1 {
            let likely = candidates.iter().min_by(|x, y| x.high.total_cmp(&y.high));
            if let Some(&likely) = likely {
                self.likely.clear();
                self.likely.push(likely);
            }
        } else if candidates.len() >= self.n_nearest {
            self.likely.clear();
            grow(&mut self.likely, candidates.len(), WHAT)?;
            self.likely.extend_from_slice(candidates);
            self.likely
                .sort_unstable_by(|x, y| x.high.total_cmp(&y.high));
            self.likely.truncate(self.n_nearest);
        }
        Ok(())
    }

    /// What is said of the points that are not answered yet: as many of their candidates as are
    /// asked for, nearest first; of several at one distance the lowest first.
    ///
    /// # Errors
    /// Cancellation, memory.
    #[inline(always)]
    fn answer<V: Vector>(
        &mut self,
        bodies: &[(BodyId, Target<'_>)],
        most: f64,
        found: &mut [Option<ClosestElement>],
    ) -> Result<(), Error> {
        self.narrow::<V>(bodies)?;
        self.nearest.clear();
        grow(&mut self.nearest, self.candidates.len(), WHAT)?;
        let mut first = 0;
        for (ix, &WaitingPoint { point, end }) in self.of_points.iter().enumerate() {
            let candidates = &mut self.candidates[first..end];
            first = end;
            if self.n_nearest > 1 {
                self.looks.step()?;
                candidates.sort_unstable_by(|x, y| x.compare(y, bodies, &point));
            } else if let Some((nearest, others)) = candidates.split_first_mut() {
                for other in others {
                    self.looks.step()?;
                    if other.compare(nearest, bodies, &point).is_lt() {
                        *nearest = *other;
                    }
                }
            }
            for (nth, one) in candidates.iter().take(self.n_nearest).enumerate() {
                if !one.is_within(most, bodies, &point) {
                    break;
                }
                self.nearest.push((*one, ix * self.n_nearest + nth));
            }
        }
        self.pairs.clear();
        grow(&mut self.pairs, self.nearest.len(), WHAT)?;
        for (one, place) in &self.nearest {
            let point = &self.of_points[place / self.n_nearest].point;
            let (pair, points) = paired(point, one.corners(bodies).points());
            let part = one.part;
            self.pairs.push(PairAtPart { pair, points, part });
        }
        reserve(&mut self.closest, self.pairs.len(), WHAT)?;
        self.closest.resize(self.pairs.len(), None);
        closest_of_pairs(self.isa, &self.pairs, &mut self.closest);
        found.fill(None);
        for ((one, place), closest) in self.nearest.iter().zip(&self.closest) {
            found[*place] = closest.as_ref().map(|closest| one.answer(bodies, closest));
        }
        self.candidates.clear();
        self.of_points.clear();
        Ok(())
    }

    /// Encloses the distances of candidates in double precision, and finds their nearest parts.
    ///
    /// # Errors
    /// Cancellation.
    #[inline(always)]
    fn narrow<V: Vector>(&mut self, bodies: &[(BodyId, Target<'_>)]) -> Result<(), Error> {
        let mut points = Points8::default();
        let mut of_lane = [0; LANES];
        let (mut n, mut waiting) = (0, 0);
        for ix in 0..=self.candidates.len() {
            if n == LANES || ix == self.candidates.len() {
                let (bounds, parts) = bounds_and_parts::<V>(ElementPair::VertexFace, &points);
                for (lane, &of_lane) in of_lane[..n].iter().enumerate() {
                    let one = &mut self.candidates[of_lane];
                    one.narrow([bounds.low[lane], bounds.high[lane]], parts[lane]);
                }
                n = 0;
            }
            let Some(one) = self.candidates.get_mut(ix) else {
                break;
            };
            self.looks.step()?;
            while self.of_points[waiting].end <= ix {
                waiting += 1;
            }
            let point = &self.of_points[waiting].point;
            let corners = one.corners(bodies);
            let corners = corners.points();
            if let &[a, b, c] = corners {
                for (row, at) in points.0.iter_mut().zip([point, &a, &b, &c]) {
                    put_point(row, n, at);
                }
                of_lane[n] = ix;
                n += 1;
            } else {
                let part = nearest_part_of_element(point, corners);
                one.narrow(point_distance_bounds(point, corners), part);
            }
        }
        Ok(())
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
    fn squared_distances<B: SideBySide<READ>, const READ: usize>(
        &self,
        boxes: &B,
        limit: f32,
        squares: &mut [f32; GROUP],
    ) -> u64 {
        let limit = V::splat(f64::from(limit));
        let [down, up] = &self.ends;
        let square = |axis: usize, first: usize| {
            let below = V::row(boxes.row(false, axis), first) - up[axis];
            let above = down[axis] - V::row(boxes.row(true, axis), first);
            let gap = below.larger(above).larger(V::splat(0.0));
            gap * gap
        };
        let mut mask = 0;
        for first in (0..B::N).step_by(V::N) {
            let sum = square(0, first) + square(1, first) + square(2, first);
            sum.put(squares, first);
            mask |= u64::from(V::bits(!sum.gt(limit))) << first;
        }
        mask
    }
}

/// Bit k: number k of whole registers is not above a limit.
#[inline(always)]
fn not_above<V: Lookup>(numbers: &[f32], limit: f32) -> u64 {
    let limit = V::splat(f64::from(limit));
    let mut mask = 0;
    for first in (0..numbers.len()).step_by(V::N) {
        let is_above = V::row(numbers, first).gt(limit);
        mask |= u64::from(V::bits(!is_above)) << first;
    }
    mask
}

/// The least of some numbers.
#[inline(always)]
fn least(mut numbers: [f32; BATCH]) -> f32 {
    let mut n = BATCH;
    while n > 1 {
        n /= 2;
        for ix in 0..n {
            numbers[ix] = numbers[ix].min(numbers[ix + n]);
        }
    }
    numbers[0]
}
