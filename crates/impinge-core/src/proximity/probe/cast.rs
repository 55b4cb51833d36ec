//! What rays hit: the way down the trees past boxes, nearest first, then floats, then exact
//! arithmetic.
//!
//! A node is skipped if the ray certainly misses its box, or comes to it later than to the first
//! hit. Of an element, floats say that the ray certainly misses it, or meets it too late, or
//! certainly passes through its inside, between two parameters. What is in doubt is decided exactly
//! at once. Of the hits that may be first, mostly one, the numbers are found last: rounded from
//! twice the precision of floats where that suffices. So the answer does not depend on the order of
//! the search.
//!
//! Cost: per ray some dozens of boxes per level, eight at a time, in a few clusters 64 boxes at a
//! time, and some faces.

use std::cmp::Ordering;

use super::boxes::{GROWN, SideBySide, Waiting, wait_in_order};
use super::{HITS, Looks, Target, keep_from};
use crate::answers::hits::RayHit;
use crate::answers::pairs::Element;
use crate::bvh::GROUP;
use crate::bvh::bounds::{Aabb, round_down, round_up};
use crate::query::step::Hit;
use crate::scene::elements::with_corners;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{ClusterIx, ElementIx};
use crate::search::narrow::Corners;
use crate::search::sink::grow;
use crate::search::work::Work;
use crate::simd::{Isa, Lanes, Simd, up_to, with_isa};
use impinge_exact::internal::filter::number::{Lookup, Vector};
use impinge_exact::internal::filter::{LANES, cross, difference, dot, size};
use impinge_exact::internal::{Ray, meet, meet_inside};
use impinge_exact::{Feature, Point};

/// More than the relative error of a few operations.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// More than the error of a determinant, relative to the cube of its largest number.
const ERROR: f64 = 512.0 * f64::EPSILON;
/// Sizes of numbers of which no product of three is wrong by underflow, or overflows.
const MODERATE: std::ops::Range<f64> = 1e-60..1e60;
/// The largest coordinates of rays and boxes that are held against each other: 2^60.
const FAR: f32 = (1u64 << 60) as f32;

/// What rays hit: one list after the other, and where the lists end.
pub(super) type HitLists = (Vec<RayHit>, Vec<(usize, bool)>);

/// What rays hit.
///
/// # Errors
/// Cancellation.
pub(super) fn cast(
    isa: Isa,
    bodies: &[(BodyId, Target<'_>)],
    rays: &[Ray],
    hits: Hit,
    into: &mut HitLists,
    work: Work<'_>,
) -> Result<(), Error> {
    with_isa!(isa, cast_all, (
        bodies: &[(BodyId, Target<'_>)] = bodies,
        rays: &[Ray] = rays,
        hits: Hit = hits,
        into: &mut HitLists = into,
        work: Work<'_> = work,
    ) -> Result<(), Error>)
}

#[inline(always)]
fn cast_all<S: Simd>(
    simd: S,
    bodies: &[(BodyId, Target<'_>)],
    rays: &[Ray],
    hits: Hit,
    into: &mut HitLists,
    work: Work<'_>,
) -> Result<(), Error> {
    let mut search = RaySearch {
        looks: Looks::new(work),
        hits,
        limit: f64::INFINITY,
        found: Vec::new(),
        first: 0,
        n_answered: 0,
        ends: Vec::new(),
        waiting: Vec::new(),
    };
    let mut left = rays;
    while let Some((ray, after)) = left.split_first() {
        left = after;
        search.begin(ray);
        for (number, &(_, target)) in bodies.iter().enumerate() {
            search.visit(simd, number, target, ray)?;
        }
        search.end()?;
        if left.is_empty() || search.found.len() >= MANY {
            search.answer(simd, bodies, rays, into)?;
        }
    }
    Ok(())
}

/// Candidates of several rays, of which the numbers are found at once.
const MANY: usize = 128;

/// An element that a ray certainly meets.
struct RayCandidate {
    /// The ray does not come to it before this.
    low: f64,
    /// The place of the body among those that are looked at.
    body: usize,
    /// The place of the element in the order of the clusters.
    slot: usize,
    met: Option<HitPoint>,
}

/// Where on its way a ray meets an element, and where of the element.
#[derive(Clone, Copy)]
struct HitPoint {
    t: f64,
    t_end: f64,
    feature: Feature,
    barycentrics: [f64; 3],
}

impl HitPoint {
    fn exactly(ray: &Ray, corners: &[Point]) -> Option<Self> {
        let meeting = meet(ray, corners)?;
        Some(HitPoint {
            t: meeting.entry.rounded_down(),
            t_end: meeting.exit.rounded_down(),
            feature: meeting.feature,
            barycentrics: meeting.barycentrics,
        })
    }
}

/// A hit among others of its ray.
struct RayFound {
    met: HitPoint,
    body: usize,
    element: ElementIx,
    corners: Corners,
}

impl RayFound {
    #[inline(always)]
    fn new(candidate: &RayCandidate, bodies: &[(BodyId, Target<'_>)]) -> Option<Self> {
        let &RayCandidate {
            body, slot, met, ..
        } = candidate;
        let target = bodies[body].1;
        let corners = corners(target, slot);
        Some(RayFound {
            met: met?,
            body,
            element: target.boxes.clustering.order[slot],
            corners,
        })
    }

    /// The exact order of the hits of a ray.
    fn compare(&self, other: &RayFound, ray: &Ray) -> Ordering {
        let exactly = || {
            let [one, two] = [self, other].map(|found| meet(ray, found.corners.points()));
            one.zip(two)
                .map_or(Ordering::Equal, |(one, two)| one.entry.compare(&two.entry))
        };
        self.met
            .t
            .total_cmp(&other.met.t)
            .then_with(exactly)
            .then((self.body, self.element).cmp(&(other.body, other.element)))
    }

    fn answer(&self, bodies: &[(BodyId, Target<'_>)]) -> RayHit {
        RayHit {
            element: Element {
                body: bodies[self.body].0,
                element: self.element.raw(),
            },
            feature: self.met.feature,
            t: self.met.t,
            t_end: self.met.t_end,
            barycentrics: self.met.barycentrics,
        }
    }
}

#[inline(always)]
fn corners(target: Target<'_>, slot: usize) -> Corners {
    with_corners!(&target.boxes.clustering.corners, |all| Corners::new(
        target.body.positions(),
        &all[slot]
    ))
}

/// A ray as boxes are held against it, in single precision: rounded so that it meets all that the
/// ray meets.
struct Slabs<V> {
    axes: [Slab<V>; 3],
    /// Axes along which the ray goes down: it comes to high ends first.
    is_down: [bool; 3],
}

/// A ray along an axis.
#[derive(Clone, Copy)]
struct Slab<V> {
    /// The origin, rounded towards where the ray comes from and where it goes.
    origin: [V; 2],
    /// Of the direction: infinite for 0, and no number if the axis is not looked at.
    inverse: V,
}

impl<V: Lookup> Slab<V> {
    /// Narrows when the ray is in some boxes: from then on, and until then, negated, which leaves
    /// larger numbers for both. Comparisons with what is no number are false.
    #[inline(always)]
    fn narrow(
        &self,
        [near, minus_far]: [V; 2],
        [enters, leaves]: [&[f32]; 2],
        first: usize,
    ) -> [V; 2] {
        let t = (V::row(enters, first) - self.origin[1]) * self.inverse;
        let minus_t = (self.origin[0] - V::row(leaves, first)) * self.inverse;
        [t.larger(near), minus_t.larger(minus_far)]
    }
}

impl<V: Lookup> Slabs<V> {
    #[inline(always)]
    fn new(ray: &Ray, whole: &Aabb) -> Self {
        let nothing = V::splat(f64::NAN);
        let none = Slab {
            origin: [nothing; 2],
            inverse: nothing,
        };
        let mut slabs = Slabs {
            axes: [none; 3],
            is_down: ray.direction.map(|x| x < 0.0),
        };
        for axis in 0..3 {
            let (origin, direction) = (ray.origin[axis], ray.direction[axis]);
            let (below, above) = (round_down(origin), round_up(origin));
            let is_down = slabs.is_down[axis];
            let slab = &mut slabs.axes[axis];
            slab.origin = [below, above].map(|x| V::splat(f64::from(x)));
            if is_down {
                slab.origin.reverse();
            }
            let inverse = 1.0 / direction.abs();
            let is_moderate = inverse == f64::INFINITY && direction == 0.0
                || (1.0 / f64::from(FAR)..f64::from(FAR)).contains(&inverse);
            let [low, high] = [whole.min[axis], whole.max[axis]];
            let is_near =
                below.abs() <= FAR && above.abs() <= FAR && low.abs() <= FAR && high.abs() <= FAR;
            if is_moderate && is_near {
                slab.inverse = V::splat(if is_down { -inverse } else { inverse });
            }
        }
        slabs
    }

    /// When the ray comes to some boxes, about and never too late, and those that it may reach
    /// before a limit. What follows the boxes that there are is arbitrary.
    #[cfg_attr(target_family = "wasm", inline(never))]
    #[cfg_attr(not(target_family = "wasm"), inline(always))]
    fn reach<B: SideBySide<READ>, const READ: usize>(
        &self,
        boxes: &B,
        limit: f32,
        nears: &mut [f32; GROUP],
    ) -> u64 {
        let limit = V::splat(f64::from(-limit));
        let (grown, least) = (f64::from(GROWN), f64::from(f32::MIN_POSITIVE));
        let [x, y, z] = &self.axes;
        let rows = |axis: usize| {
            let is_down = self.is_down[axis];
            [
                &boxes.row(is_down, axis)[..],
                &boxes.row(!is_down, axis)[..],
            ]
        };
        let [of_x, of_y, of_z] = [rows(0), rows(1), rows(2)];
        let mut mask = 0;
        for first in (0..B::N).step_by(V::N) {
            let ends = [V::splat(0.0), limit];
            let ends = x.narrow(ends, of_x, first);
            let ends = y.narrow(ends, of_y, first);
            let [near, minus_far] = z.narrow(ends, of_z, first);
            near.put(nears, first);
            let is_missed = near.gt(V::splat(least) - minus_far * V::splat(grown));
            mask |= u64::from(V::bits(!is_missed)) << first;
        }
        mask
    }
}

/// The search of one ray after the other; the memory is kept.
struct RaySearch<'a> {
    looks: Looks<'a>,
    hits: Hit,
    /// What the ray meets later is not asked for.
    limit: f64,
    /// Of the rays that are not answered yet, one after the other.
    found: Vec<RayCandidate>,
    /// The first of this ray.
    first: usize,
    /// How many rays are answered.
    n_answered: usize,
    /// Where the candidates of those that are not end.
    ends: Vec<usize>,
    /// By when the ray comes to their boxes.
    waiting: Vec<Waiting>,
}

impl RaySearch<'_> {
    #[inline(always)]
    fn begin(&mut self, ray: &Ray) {
        self.first = self.found.len();
        self.limit = ray.most;
    }

    /// The limit for boxes.
    #[inline(always)]
    fn limit_of_boxes(&self) -> f32 {
        round_up(self.limit)
    }

    /// Adds what the ray hits of a body.
    #[inline(always)]
    fn visit<S: Simd>(
        &mut self,
        _: S,
        body: usize,
        target: Target<'_>,
        ray: &Ray,
    ) -> Result<(), Error> {
        let boxes = target.boxes;
        let slabs = Slabs::<S::F32>::new(ray, &boxes.root());
        let mut nears = [0.0; GROUP];
        let (mut siblings, mut level) = boxes.top();
        self.waiting.clear();
        loop {
            let mask = slabs.reach(siblings, self.limit_of_boxes(), &mut nears);
            wait_in_order(&mut self.waiting, (siblings, level), mask, &nears);
            // The next node above the clusters, whose children are looked at next.
            loop {
                let Some((near, of_node, node)) = self.waiting.pop() else {
                    return Ok(());
                };
                let limit = self.limit_of_boxes();
                if near > limit * GROWN + f32::MIN_POSITIVE {
                    continue;
                }
                self.looks.step()?;
                if of_node > 0 {
                    siblings = boxes.children(of_node, node);
                    level = of_node - 1;
                    break;
                }
                self.look(
                    (body, target),
                    ClusterIx::new(node),
                    ray,
                    &slabs,
                    &mut nears,
                )?;
                if self.hits == Hit::Any && self.found.len() > self.first {
                    return Ok(());
                }
            }
        }
    }

    /// Adds what the ray hits of a cluster.
    #[inline(always)]
    fn look<V: Lookup>(
        &mut self,
        (body, target): (usize, Target<'_>),
        cluster: ClusterIx,
        ray: &Ray,
        slabs: &Slabs<V>,
        nears: &mut [f32; GROUP],
    ) -> Result<(), Error> {
        let slots = target.boxes.clustering.slots(cluster);
        let lanes = target.boxes.elements(target.body, cluster);
        let mask = slabs.reach(lanes, self.limit_of_boxes(), nears);
        for lane in Lanes(mask & up_to(slots.len() - 1)) {
            if nears[lane] > self.limit_of_boxes() * GROWN + f32::MIN_POSITIVE {
                continue;
            }
            let slot = slots.start + lane;
            let corners = corners(target, slot);
            let (low, high, met) = match self.passes(ray, corners.points()) {
                RayPasses::Not => continue,
                RayPasses::Inside(low, high) => (low, high, None),
                RayPasses::InDoubt => {
                    self.looks.step()?;
                    let Some(met) = HitPoint::exactly(ray, corners.points()) else {
                        continue;
                    };
                    // The exact parameter is below the next float.
                    (met.t, met.t.next_up(), Some(met))
                }
            };
            if self.hits != Hit::All && high < self.limit {
                self.limit = high;
                // What may be met so early.
                keep_from(&mut self.found, self.first, |one| one.low <= high);
            }
            grow(&mut self.found, 1, HITS)?;
            self.found.push(RayCandidate {
                low,
                body,
                slot,
                met,
            });
        }
        Ok(())
    }

    /// Ends the search of a ray.
    ///
    /// # Errors
    /// Memory.
    #[inline(always)]
    fn end(&mut self) -> Result<(), Error> {
        grow(&mut self.ends, 1, HITS)?;
        self.ends.push(self.found.len());
        Ok(())
    }

    /// Whether floats tell that a ray misses a face, or meets it after the limit, or passes through
    /// its inside.
    #[inline(always)]
    fn passes(&self, ray: &Ray, corners: &[Point]) -> RayPasses {
        let &[a, b, c] = corners else {
            return RayPasses::InDoubt;
        };
        let d = &ray.direction;
        let a = difference(&a, &ray.origin);
        let b = difference(&b, &ray.origin);
        let c = difference(&c, &ray.origin);
        let largest = size(&a).max(size(&b)).max(size(&c));
        let of_way = size(d);
        if !MODERATE.contains(&largest) || !MODERATE.contains(&of_way) {
            return RayPasses::InDoubt;
        }
        // The barycentrics times a common factor, whose sum that is.
        let error = ERROR * (largest * largest * of_way);
        let across = cross(&a, d);
        let (of_b, of_c) = (dot(&c, &across), -dot(&b, &across));
        let are_apart = |x: f64, y: f64| x > error && y < -error || x < -error && y > error;
        if are_apart(of_b, of_c) {
            return RayPasses::Not;
        }
        let normal = cross(&difference(&b, &a), &difference(&c, &a));
        let slope = dot(d, &normal);
        let of_a = slope - of_b - of_c;
        if are_apart(of_a, of_b) || are_apart(of_a, of_c) {
            return RayPasses::Not;
        }
        if slope.abs() <= error {
            return RayPasses::InDoubt;
        }
        let height = dot(&a, &normal);
        let of_height = ERROR * (largest * largest * largest);
        let sign = if slope < 0.0 { -1.0 } else { 1.0 };
        let (height, slope) = (sign * height, sign * slope);
        let low = (height - of_height) / (slope + error) * (1.0 - ROUNDING);
        if height < -of_height || low > self.limit {
            return RayPasses::Not;
        }
        let high = (height + of_height) / (slope - error) * (1.0 + ROUNDING);
        let is_inside = sign * of_a > error && sign * of_b > error && sign * of_c > error;
        match is_inside && height > of_height && high <= ray.most {
            true => RayPasses::Inside(low, high),
            false => RayPasses::InDoubt,
        }
    }

    /// What is said of rays that are not answered yet: nothing, the first hits, or all in order.
    ///
    /// # Errors
    /// Cancellation.
    #[inline(always)]
    fn answer<S: Simd>(
        &mut self,
        _: S,
        bodies: &[(BodyId, Target<'_>)],
        rays: &[Ray],
        into: &mut HitLists,
    ) -> Result<(), Error> {
        let rays = &rays[self.n_answered..][..self.ends.len()];
        self.n_answered += rays.len();
        if self.hits != Hit::Any {
            self.find_numbers::<S::F64>(bodies, rays);
        }
        let mut all: Vec<RayFound> = Vec::new();
        let mut first = 0;
        for (ray, &end) in rays.iter().zip(&self.ends) {
            let candidates = &self.found[first..end];
            first = end;
            match self.hits {
                Hit::Any => {}
                Hit::First => {
                    let mut nearest: Option<RayFound> = None;
                    for candidate in candidates {
                        let Some(found) = RayFound::new(candidate, bodies) else {
                            continue;
                        };
                        match &nearest {
                            Some(nearest) if found.compare(nearest, ray).is_ge() => {}
                            _ => nearest = Some(found),
                        }
                    }
                    grow(&mut into.0, 1, HITS)?;
                    into.0.extend(nearest.map(|hit| hit.answer(bodies)));
                }
                _ => {
                    all.clear();
                    for candidate in candidates {
                        self.looks.step()?;
                        grow(&mut all, 1, HITS)?;
                        all.extend(RayFound::new(candidate, bodies));
                    }
                    grow(&mut into.0, all.len(), HITS)?;
                    all.sort_unstable_by(|one, other| one.compare(other, ray));
                    into.0.extend(all.iter().map(|found| found.answer(bodies)));
                }
            }
            into.1.push((into.0.len(), !candidates.is_empty()));
        }
        self.found.clear();
        self.ends.clear();
        Ok(())
    }

    /// Finds the numbers of hits through the insides of faces, eight at a time, in twice the
    /// precision of floats where that suffices.
    #[inline(always)]
    fn find_numbers<V: Vector>(&mut self, bodies: &[(BodyId, Target<'_>)], rays: &[Ray]) {
        let mut batch = [(Ray::default(), [[0.0; 3]; 3]); LANES];
        let mut of_batch = [0; LANES];
        let (mut n, mut ray) = (0, 0);
        for ix in 0..=self.found.len() {
            if n == LANES || ix == self.found.len() {
                let found = meet_inside::<V>(&batch[..n]);
                for (lane, &of_lane) in of_batch[..n].iter().enumerate() {
                    let (ray, face) = &batch[lane];
                    self.found[of_lane].met = match found[lane] {
                        Some((t, barycentrics)) => Some(HitPoint {
                            t,
                            t_end: t,
                            feature: Feature::Face,
                            barycentrics,
                        }),
                        None => HitPoint::exactly(ray, face),
                    };
                }
                n = 0;
            }
            let Some(candidate) = self.found.get(ix) else {
                break;
            };
            while self.ends[ray] <= ix {
                ray += 1;
            }
            if candidate.met.is_none()
                && let &[a, b, c] = corners(bodies[candidate.body].1, candidate.slot).points()
            {
                batch[n] = (rays[ray], [a, b, c]);
                of_batch[n] = ix;
                n += 1;
            }
        }
    }
}

/// What floats tell of a ray and a face.
enum RayPasses {
    Not,
    /// Through its inside, between these parameters.
    Inside(f64, f64),
    InDoubt,
}
