//! What rays hit: the way down the trees past boxes, nearest first, then floats, then exact arithmetic.
//!
//! A node is skipped if the ray certainly misses its box, or comes to it later than to the first hit. Of an element, floats say
//! that the ray certainly misses it, or meets it too late. All others are decided exactly. So the answer does not depend on the
//! order of the search.
//!
//! Cost: per ray some dozens of boxes per level, in a few clusters 64 boxes, and per hit some microseconds of exact arithmetic.

use std::cmp::Ordering;

use super::{Looks, Target};
use crate::answers::hits::RayHit;
use crate::answers::pairs::Element;
use crate::bvh::bounds::Bounds;
use crate::query::step::Hit;
use crate::scene::elements::with_corners;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{ClusterIx, ElementIx};
use crate::search::narrow::Corners;
use crate::search::work::Work;
use impinge_exact::Point;
use impinge_exact::internal::{Meeting, Ray, meet};

/// More than the relative error of a few operations.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// More than the error of a determinant, relative to the product of its vectors' sizes.
const ERROR: f64 = 128.0 * f64::EPSILON;
/// Sizes of products that are not wrong by underflow, and do not overflow.
const SAFE: std::ops::Range<f64> = 1e-200..1e200;
/// Sizes of numbers of rays that are held against boxes.
const MODERATE: std::ops::Range<f64> = 1e-100..1e100;

/// What rays hit, one list after the other, and where the lists end.
///
/// # Errors
/// Cancellation.
pub(super) fn cast(
    bodies: &[(BodyId, Target<'_>)],
    rays: impl Iterator<Item = Ray>,
    hits: Hit,
    into: &mut (Vec<RayHit>, Vec<(usize, bool)>),
    work: Work<'_>,
) -> Result<(), Error> {
    let mut search = Search {
        looks: Looks::new(work),
        hits,
        limit: f64::INFINITY,
        found: Vec::new(),
        waiting: Vec::new(),
    };
    for ray in rays {
        search.begin(&ray);
        for (number, &(_, target)) in bodies.iter().enumerate() {
            search.visit(number, target, &ray)?;
        }
        let is_hit = !search.found.is_empty();
        search.sort()?;
        if hits != Hit::Any {
            into.0
                .extend(search.found.iter().map(|found| found.answer(bodies)));
        }
        into.1.push((into.0.len(), is_hit));
    }
    Ok(())
}

struct Found {
    meeting: Meeting,
    t: f64,
    /// The place of the body among those that are looked at.
    body: usize,
    element: ElementIx,
}

impl Found {
    /// The exact order of hits.
    fn compare(&self, other: &Found) -> Ordering {
        let by_float = self.t.total_cmp(&other.t);
        by_float
            .then_with(|| self.meeting.entry.compare(&other.meeting.entry))
            .then((self.body, self.element).cmp(&(other.body, other.element)))
    }

    fn answer(&self, bodies: &[(BodyId, Target<'_>)]) -> RayHit {
        RayHit {
            element: Element {
                body: bodies[self.body].0,
                element: self.element.raw(),
            },
            feature: self.meeting.feature,
            t: self.t,
            t_end: self.meeting.exit.rounded_down(),
            barycentrics: self.meeting.barycentrics,
        }
    }
}

/// The search of one ray; the memory is kept for the next.
struct Search<'a> {
    looks: Looks<'a>,
    hits: Hit,
    /// What the ray meets later is not asked for.
    limit: f64,
    found: Vec<Found>,
    /// The parameters at which the ray comes to boxes, levels and nodes that wait.
    waiting: Vec<(f64, usize, usize)>,
}

impl Search<'_> {
    fn begin(&mut self, ray: &Ray) {
        self.found.clear();
        self.limit = ray.most;
    }

    /// When the ray comes to a box, about; `None` if it certainly does not before the limit.
    fn reaches(&self, bounds: &Bounds, ray: &Ray) -> Option<f64> {
        let (mut near, mut far) = (0.0f64, self.limit);
        for axis in 0..3 {
            let (from, way) = (ray.origin[axis], ray.direction[axis]);
            let ends = [bounds.min[axis], bounds.max[axis]].map(f64::from);
            if way == 0.0 {
                if from < ends[0] || ends[1] < from {
                    return None;
                }
                continue;
            }
            let is_moderate = |x: f64| x == 0.0 || MODERATE.contains(&x.abs());
            if !is_moderate(from) || !is_moderate(way) {
                continue;
            }
            let [x, y] = ends.map(|end| (end - from) / way);
            near = near.max(x.min(y));
            far = far.min(x.max(y));
        }
        (near <= far * (1.0 + ROUNDING)).then_some(near)
    }

    /// Adds what the ray hits of a body.
    fn visit(&mut self, body: usize, target: Target<'_>, ray: &Ray) -> Result<(), Error> {
        let boxes = target.boxes;
        self.waiting.clear();
        if let Some(top) = boxes.n_levels().checked_sub(1) {
            self.waiting.push((0.0, top, 0));
        }
        while let Some((near, level, node)) = self.waiting.pop() {
            if near > self.limit * (1.0 + ROUNDING) {
                continue;
            }
            self.looks.step()?;
            if level == 0 {
                self.look(body, target, ClusterIx::new(node as u32), ray)?;
                if self.hits == Hit::Any && !self.found.is_empty() {
                    return Ok(());
                }
                continue;
            }
            let first = self.waiting.len();
            for child in boxes.clustering.shape.children(level, node) {
                if let Some(near) = self.reaches(&boxes.node(level - 1, child), ray) {
                    self.waiting.push((near, level - 1, child));
                }
            }
            // The nearest is popped first.
            self.waiting[first..].sort_unstable_by(|x, y| y.0.total_cmp(&x.0));
        }
        Ok(())
    }

    /// Adds what the ray hits of a cluster.
    fn look(
        &mut self,
        body: usize,
        target: Target<'_>,
        cluster: ClusterIx,
        ray: &Ray,
    ) -> Result<(), Error> {
        let clustering = &target.boxes.clustering;
        let lanes = target.boxes.elements(target.body, cluster);
        for (lane, slot) in clustering.slots(cluster).enumerate() {
            if self.reaches(&lanes.at(lane), ray).is_none() {
                continue;
            }
            let corners = with_corners!(&clustering.corners, |all| Corners::new(
                target.body.positions(),
                &all[slot]
            ));
            let corners = corners.points();
            if self.certainly_misses(ray, corners) {
                continue;
            }
            self.looks.step()?;
            let Some(meeting) = meet(ray, corners) else {
                continue;
            };
            let found = Found {
                t: meeting.entry.rounded_down(),
                meeting,
                body,
                element: clustering.order[slot],
            };
            if self.hits == Hit::All {
                self.found.push(found);
                continue;
            }
            // The exact parameter is below the next float.
            self.limit = self.limit.min(found.t.next_up());
            match self.found.first_mut() {
                Some(known) if found.compare(known).is_lt() => *known = found,
                Some(_) => {}
                None => self.found.push(found),
            }
        }
        Ok(())
    }

    /// Whether floats tell that a ray misses a face, or meets it after the limit. If they cannot: no.
    fn certainly_misses(&self, ray: &Ray, corners: &[Point]) -> bool {
        let &[a, b, c] = corners else {
            return false;
        };
        let d = &ray.direction;
        let [a, b, c] = [a, b, c].map(|corner| difference(&corner, &ray.origin));
        // The barycentrics times a common factor: 1, -1, or 0 if floats cannot tell.
        let signs = [[&b, &c], [&c, &a], [&a, &b]].map(|[p, q]| {
            let (value, error) = determinant(p, q, d);
            f64::from(value > error) - f64::from(-value > error)
        });
        if signs.contains(&1.0) && signs.contains(&-1.0) {
            return true;
        }
        let ways = [&b, &c].map(|corner| difference(corner, &a));
        let (height, of_height) = determinant(&ways[0], &ways[1], &a);
        let (slope, of_slope) = determinant(&ways[0], &ways[1], d);
        if slope.abs() <= of_slope {
            return false;
        }
        let height = if slope < 0.0 { -height } else { height };
        if height < -of_height {
            return true;
        }
        let lowest = (height - of_height) / (slope.abs() + of_slope);
        lowest * (1.0 - ROUNDING) > self.limit
    }

    /// Puts the hits of a ray in order.
    ///
    /// # Errors
    /// Cancellation.
    fn sort(&mut self) -> Result<(), Error> {
        self.looks.work.step()?;
        self.found.sort_unstable_by(Found::compare);
        Ok(())
    }
}

fn difference(p: &Point, q: &Point) -> Point {
    [0, 1, 2].map(|k| p[k] - q[k])
}

/// (p x q) . r, and more than its error; infinity where products may underflow or overflow.
fn determinant(p: &Point, q: &Point, r: &Point) -> (f64, f64) {
    let size = |v: &Point| v[0].abs().max(v[1].abs()).max(v[2].abs());
    let value = (p[1] * q[2] - p[2] * q[1]) * r[0]
        + (p[2] * q[0] - p[0] * q[2]) * r[1]
        + (p[0] * q[1] - p[1] * q[0]) * r[2];
    let sizes = [p, q, r].map(size);
    let product = sizes[0] * sizes[1] * sizes[2];
    let is_safe = SAFE.contains(&product) && sizes.iter().all(|x| MODERATE.contains(x));
    (
        value,
        if is_safe {
            ERROR * product
        } else {
            f64::INFINITY
        },
    )
}
