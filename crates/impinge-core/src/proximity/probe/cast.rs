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

use super::boxes::{GROWN, Waiting, wait_in_order};
use super::{HITS, Looks, Target};
use crate::answers::hits::RayHit;
use crate::answers::pairs::Element;
use crate::bvh::bounds::{Bounds, round_down, round_up};
use crate::query::step::Hit;
use crate::scene::elements::with_corners;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{ClusterIx, ElementIx};
use crate::search::narrow::Corners;
use crate::search::sink::grow;
use crate::search::work::Work;
use crate::simd::{Isa, LaneBounds, Lanes, Simd, up_to, with_isa};
use impinge_exact::internal::filter::{cross, difference, dot, size};
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
    _simd: S,
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
        waiting: Vec::new(),
    };
    for ray in rays {
        search.begin(ray);
        for (number, &(_, target)) in bodies.iter().enumerate() {
            search.visit(number, target, ray)?;
        }
        let is_hit = !search.found.is_empty();
        search.answer(bodies, ray, &mut into.0)?;
        into.1.push((into.0.len(), is_hit));
    }
    Ok(())
}

/// An element that a ray certainly meets.
struct RayCandidate {
    /// The ray does not come to it before this.
    low: f64,
    /// The place of the body among those that are looked at.
    body: usize,
    /// The place of the element in the order of the clusters.
    slot: usize,
    met: Option<Met>,
}

/// The numbers of a hit.
struct Met {
    t: f64,
    t_end: f64,
    feature: Feature,
    barycentrics: [f64; 3],
}

impl Met {
    /// In twice the precision of floats where that suffices.
    #[inline(always)]
    fn new(ray: &Ray, corners: &[Point]) -> Option<Self> {
        if let &[a, b, c] = corners
            && let Some((t, barycentrics)) = meet_inside(ray, &[a, b, c])
        {
            return Some(Met {
                t,
                t_end: t,
                feature: Feature::Face,
                barycentrics,
            });
        }
        Met::exactly(ray, corners)
    }

    fn exactly(ray: &Ray, corners: &[Point]) -> Option<Self> {
        let meeting = meet(ray, corners)?;
        Some(Met {
            t: meeting.entry.rounded_down(),
            t_end: meeting.exit.rounded_down(),
            feature: meeting.feature,
            barycentrics: meeting.barycentrics,
        })
    }
}

/// A hit among others of its ray.
struct RayFound {
    met: Met,
    body: usize,
    element: ElementIx,
    corners: Corners,
}

impl RayFound {
    #[inline(always)]
    fn new(candidate: RayCandidate, bodies: &[(BodyId, Target<'_>)], ray: &Ray) -> Option<Self> {
        let RayCandidate { body, slot, .. } = candidate;
        let target = bodies[body].1;
        let corners = corners(target, slot);
        let met = match candidate.met {
            Some(met) => met,
            None => Met::new(ray, corners.points())?,
        };
        Some(RayFound {
            met,
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
struct Slabs {
    /// The origin, rounded down and up.
    origin: [[f32; 3]; 2],
    /// Of the direction: infinite for 0, and no number along axes that are not looked at.
    inverse: [f32; 3],
    is_down: [bool; 3],
}

impl Slabs {
    fn new(ray: &Ray, whole: &Bounds) -> Self {
        let mut slabs = Slabs {
            origin: [[0.0; 3]; 2],
            inverse: [f32::NAN; 3],
            is_down: [false; 3],
        };
        for axis in 0..3 {
            let (origin, direction) = (ray.origin[axis], ray.direction[axis]);
            let (below, above) = (round_down(origin), round_up(origin));
            slabs.origin[0][axis] = below;
            slabs.origin[1][axis] = above;
            slabs.is_down[axis] = direction < 0.0;
            let inverse = 1.0 / direction.abs();
            let is_moderate = inverse == f64::INFINITY && direction == 0.0
                || (1.0 / f64::from(FAR)..f64::from(FAR)).contains(&inverse);
            let [low, high] = [whole.min[axis], whole.max[axis]];
            let is_near =
                below.abs() <= FAR && above.abs() <= FAR && low.abs() <= FAR && high.abs() <= FAR;
            if is_moderate && is_near {
                let inverse = inverse as f32;
                slabs.inverse[axis] = if slabs.is_down[axis] {
                    -inverse
                } else {
                    inverse
                };
            }
        }
        slabs
    }

    /// When the ray comes to some boxes, about and never too late, and those that it may reach
    /// before a limit.
    #[inline(always)]
    fn reach<const N: usize>(&self, boxes: [[&[f32; N]; 3]; 2], limit: f32) -> ([f32; N], u64) {
        let (mut near, mut far) = ([0.0f32; N], [limit; N]);
        let [low, high] = boxes;
        for (axis, (low, high)) in low.into_iter().zip(high).enumerate() {
            let [below, above] = [self.origin[0][axis], self.origin[1][axis]];
            let ((enter, at_enter), (leave, at_leave)) = match self.is_down[axis] {
                true => ((high, below), (low, above)),
                false => ((low, above), (high, below)),
            };
            let inverse = self.inverse[axis];
            for (lane, (near, far)) in near.iter_mut().zip(&mut far).enumerate() {
                // Comparisons with what is no number are false.
                let t = (enter[lane] - at_enter) * inverse;
                *near = if t > *near { t } else { *near };
                let t = (leave[lane] - at_leave) * inverse;
                *far = if t < *far { t } else { *far };
            }
        }
        let mut mask = 0;
        for (lane, (near, far)) in near.iter().zip(far).enumerate() {
            mask |= u64::from(*near <= far * GROWN + f32::MIN_POSITIVE) << lane;
        }
        (near, mask)
    }
}

/// The search of one ray; the memory is kept for the next.
struct RaySearch<'a> {
    looks: Looks<'a>,
    hits: Hit,
    /// What the ray meets later is not asked for.
    limit: f64,
    found: Vec<RayCandidate>,
    /// By when the ray comes to their boxes.
    waiting: Vec<Waiting>,
}

impl RaySearch<'_> {
    fn begin(&mut self, ray: &Ray) {
        self.found.clear();
        self.limit = ray.most;
    }

    /// The limit for boxes.
    #[inline(always)]
    fn limit_of_boxes(&self) -> f32 {
        round_up(self.limit)
    }

    /// Adds what the ray hits of a body.
    #[inline(always)]
    fn visit(&mut self, body: usize, target: Target<'_>, ray: &Ray) -> Result<(), Error> {
        let boxes = target.boxes;
        let slabs = Slabs::new(ray, &boxes.root());
        self.waiting.clear();
        if let Some(top) = boxes.n_levels().checked_sub(1) {
            self.waiting.push((0.0, top as u32, 0));
        }
        while let Some((near, level, node)) = self.waiting.pop() {
            let limit = self.limit_of_boxes();
            if near > limit * GROWN + f32::MIN_POSITIVE {
                continue;
            }
            self.looks.step()?;
            if level == 0 {
                self.look(body, target, ClusterIx::new(node), ray, &slabs)?;
                if self.hits == Hit::Any && !self.found.is_empty() {
                    return Ok(());
                }
                continue;
            }
            let (level, first) = (level - 1, self.waiting.len());
            let children = boxes
                .clustering
                .shape
                .children(level as usize + 1, node as usize);
            let eight = boxes.eight(level as usize, children.start);
            let (nears, mask) = slabs.reach(eight, limit);
            for lane in Lanes(mask & up_to(children.len() - 1)) {
                let child = (children.start + lane) as u32;
                wait_in_order(&mut self.waiting, first, (nears[lane], level, child));
            }
        }
        Ok(())
    }

    /// Adds what the ray hits of a cluster.
    #[inline(always)]
    fn look(
        &mut self,
        body: usize,
        target: Target<'_>,
        cluster: ClusterIx,
        ray: &Ray,
        slabs: &Slabs,
    ) -> Result<(), Error> {
        let slots = target.boxes.clustering.slots(cluster);
        let lanes: &LaneBounds = target.boxes.elements(target.body, cluster);
        let rows = [lanes.min.each_ref(), lanes.max.each_ref()];
        let (nears, mask) = slabs.reach(rows, self.limit_of_boxes());
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
                    let Some(met) = Met::exactly(ray, corners.points()) else {
                        continue;
                    };
                    // The exact parameter is below the next float.
                    (met.t, met.t.next_up(), Some(met))
                }
            };
            if self.hits != Hit::All && high < self.limit {
                self.limit = high;
                self.found.retain(|other| other.low <= high);
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

    /// What is said of a ray: nothing, the first hit, or all in order.
    ///
    /// # Errors
    /// Cancellation.
    fn answer(
        &mut self,
        bodies: &[(BodyId, Target<'_>)],
        ray: &Ray,
        into: &mut Vec<RayHit>,
    ) -> Result<(), Error> {
        if self.hits == Hit::Any {
            return Ok(());
        }
        if self.hits == Hit::First {
            let mut first: Option<RayFound> = None;
            for candidate in self.found.drain(..) {
                let Some(found) = RayFound::new(candidate, bodies, ray) else {
                    continue;
                };
                match &first {
                    Some(first) if found.compare(first, ray).is_ge() => {}
                    _ => first = Some(found),
                }
            }
            grow(into, 1, HITS)?;
            if let Some(first) = first {
                into.push(first.answer(bodies));
            }
            return Ok(());
        }
        let mut all: Vec<RayFound> = Vec::new();
        for candidate in self.found.drain(..) {
            self.looks.step()?;
            grow(&mut all, 1, HITS)?;
            all.extend(RayFound::new(candidate, bodies, ray));
        }
        grow(into, all.len(), HITS)?;
        all.sort_unstable_by(|one, other| one.compare(other, ray));
        into.extend(all.iter().map(|found| found.answer(bodies)));
        Ok(())
    }
}

/// What floats tell of a ray and a face.
enum RayPasses {
    Not,
    /// Through its inside, between these parameters.
    Inside(f64, f64),
    InDoubt,
}
