//! Whether points are inside a body: exact winding numbers around each point.
//!
//! A closed surface: a ray goes from the point along a coordinate axis to the nearest wall of the
//! body's box, and counts the faces that it meets, with their orientation. As in
//! [`contact`](crate::contact), the ray is shifted by an infinitely small step, so that it meets no
//! edge and no vertex, and the signs are exact. The number is the same along every axis, for the
//! surface is closed. So there is no ray that has to be tried again. A face that contains the point
//! says that it is on the surface.
//!
//! Tetrahedra: those that contain the point, and the border of the body. No ray is needed. Which of
//! them is the lowest is asked in the same way.
//!
//! Cost: per point the clusters that a ray of half the body's size meets, and per cluster one test
//! of 64 boxes.

use super::border::{Border, FACES};
use super::boxes::Descent;
use super::{Looks, Target};
use crate::bvh::bounds::{Aabb, round_down, round_up};
use crate::contact::passes;
use crate::scene::elements::Elements;
use crate::scene::error::Error;
use crate::search::work::Work;
use crate::simd::{Isa, Lanes, Simd, up_to, with_isa};
use impinge_exact::internal::{Reach, elements_are_within};
use impinge_exact::{Point, Sign, orient3d};

/// A question about a point, asked of the elements whose boxes it may meet.
pub(super) trait PointTest: Copy + Sync {
    /// What the elements that were looked at say.
    type Found;
    type Answer: Copy + Send;
    /// The answer about points beside the body.
    const OUTSIDE: Self::Answer;

    /// Before any element, and the box that those to be looked at meet.
    fn begin(self, whole: &Aabb, at: Aabb) -> (Self::Found, Aabb);

    /// Adds an element. Returns whether no other one can change the answer.
    fn add(self, found: &mut Self::Found, target: Target<'_>, slot: usize, point: &Point) -> bool;

    fn answer(found: &Self::Found) -> Self::Answer;
}

/// Answers a question about each point.
///
/// # Errors
/// Cancellation.
pub(super) fn ask<Q: PointTest>(
    isa: Isa,
    question: Q,
    target: Target<'_>,
    points: &[Point],
    answers: &mut [Q::Answer],
    work: Work<'_>,
) -> Result<(), Error> {
    with_isa!(isa, ask_all, <Q: PointTest>(
        question: Q = question,
        target: Target<'_> = target,
        points: &[Point] = points,
        answers: &mut [Q::Answer] = answers,
        work: Work<'_> = work,
    ) -> Result<(), Error>)
}

#[inline(always)]
fn ask_all<S: Simd, Q: PointTest>(
    simd: S,
    question: Q,
    target: Target<'_>,
    points: &[Point],
    answers: &mut [Q::Answer],
    work: Work<'_>,
) -> Result<(), Error> {
    let whole = target.boxes.root();
    let mut descent = Descent::default();
    let mut looks = Looks::new(work);
    for (point, answer) in points.iter().zip(answers) {
        let at = Aabb {
            min: point.map(round_down),
            max: point.map(round_up),
        };
        *answer = Q::OUTSIDE;
        if !at.overlaps(&whole) {
            continue;
        }
        let (mut found, query) = question.begin(&whole, at);
        descent.start(target.boxes);
        while let Some(cluster) = descent.next(simd, target.boxes, &query) {
            looks.step()?;
            let lanes = target.boxes.elements(target.body, cluster);
            let slots = target.boxes.clustering.slots(cluster);
            let mask = simd.overlaps_64(lanes, &query, up_to(slots.len() - 1));
            let mut is_settled = false;
            for lane in Lanes(mask) {
                is_settled |= question.add(&mut found, target, slots.start + lane, point);
            }
            if is_settled {
                break;
            }
        }
        *answer = Q::answer(&found);
    }
    Ok(())
}

/// Whether a point is inside a closed surface (1), on it (0) or outside (-1).
#[derive(Debug, Clone, Copy)]
pub(super) struct InSurface;

/// What faces say about a point.
pub(super) struct FoundFaces {
    way: Way,
    winding: i32,
    /// Whether it is on a face.
    is_on: bool,
}

impl PointTest for InSurface {
    type Found = FoundFaces;
    type Answer = i8;
    const OUTSIDE: i8 = -1;

    #[inline(always)]
    fn begin(self, whole: &Aabb, at: Aabb) -> (FoundFaces, Aabb) {
        let (way, query) = Way::out(whole, &at);
        let found = FoundFaces {
            way,
            winding: 0,
            is_on: false,
        };
        (found, query)
    }

    #[inline]
    fn add(self, found: &mut FoundFaces, target: Target<'_>, slot: usize, point: &Point) -> bool {
        let Elements::Triangles(faces) = &target.boxes.clustering.corners else {
            return false;
        };
        let positions = target.body.positions();
        let corners = faces[slot].map(|vertex| positions.point(vertex as usize));
        if is_on(point, &corners) {
            found.is_on = true;
        } else {
            found.winding += found.way.passes(point, &corners);
        }
        found.is_on
    }

    fn answer(found: &FoundFaces) -> i8 {
        match Around::answer(found) {
            None => 0,
            Some(0) => -1,
            Some(_) => 1,
        }
    }
}

/// How often a closed surface winds around a point; none on the surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Around;

impl PointTest for Around {
    type Found = FoundFaces;
    type Answer = Option<i32>;
    const OUTSIDE: Option<i32> = Some(0);

    #[inline(always)]
    fn begin(self, whole: &Aabb, at: Aabb) -> (FoundFaces, Aabb) {
        InSurface.begin(whole, at)
    }

    #[inline]
    fn add(self, found: &mut FoundFaces, target: Target<'_>, slot: usize, point: &Point) -> bool {
        InSurface.add(found, target, slot, point)
    }

    fn answer(found: &FoundFaces) -> Option<i32> {
        (!found.is_on).then_some(found.winding)
    }
}

/// Whether a point is inside a body of tetrahedra (1), on its surface (0) or outside (-1).
#[derive(Debug, Clone, Copy)]
pub(super) struct InTetrahedra<'a> {
    pub border: &'a Border,
}

/// What tetrahedra say about a point.
#[derive(Debug, Default)]
pub(super) struct FoundTetrahedra {
    /// Whether it is in one.
    is_held: bool,
    /// Whether it is on a face of the surface.
    is_on: bool,
    /// Whether it is strictly inside one, whatever else it is on.
    is_inner: bool,
}

impl PointTest for InTetrahedra<'_> {
    type Found = FoundTetrahedra;
    type Answer = i8;
    const OUTSIDE: i8 = -1;

    #[inline(always)]
    fn begin(self, _: &Aabb, at: Aabb) -> (FoundTetrahedra, Aabb) {
        (FoundTetrahedra::default(), at)
    }

    #[inline]
    fn add(
        self,
        found: &mut FoundTetrahedra,
        target: Target<'_>,
        slot: usize,
        point: &Point,
    ) -> bool {
        if let Some(on) = faces_at(target, slot, point) {
            let number = target.boxes.clustering.order[slot].index();
            found.is_held = true;
            found.is_inner |= on == 0;
            found.is_on |= on & self.border.mask(number) != 0;
        }
        found.is_inner
    }

    fn answer(found: &FoundTetrahedra) -> i8 {
        match found.is_held {
            true if found.is_on && !found.is_inner => 0,
            true => 1,
            false => -1,
        }
    }
}

/// Which tetrahedron contains a point, of several the lowest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lowest;

impl PointTest for Lowest {
    type Found = Option<u32>;
    type Answer = Option<u32>;
    const OUTSIDE: Option<u32> = None;

    #[inline(always)]
    fn begin(self, _: &Aabb, at: Aabb) -> (Option<u32>, Aabb) {
        (None, at)
    }

    #[inline]
    fn add(self, found: &mut Option<u32>, target: Target<'_>, slot: usize, point: &Point) -> bool {
        let number = target.boxes.clustering.order[slot].raw();
        let is_lower = found.is_none_or(|found| number < found);
        if is_lower && faces_at(target, slot, point).is_some() {
            *found = Some(number);
        }
        false
    }

    fn answer(found: &Option<u32>) -> Option<u32> {
        *found
    }
}

/// On which faces of a tetrahedron a point is: bit `k` says face `k`. `None` outside.
#[inline]
fn faces_at(target: Target<'_>, slot: usize, point: &Point) -> Option<u8> {
    let Elements::Tetrahedra(tetrahedra) = &target.boxes.clustering.corners else {
        return None;
    };
    let positions = target.body.positions();
    let corners = tetrahedra[slot].map(|vertex| positions.point(vertex as usize));
    let faces = FACES.map(|face| face.map(|corner| corners[corner]));
    let whole = orient3d(&corners[0], &corners[1], &corners[2], &corners[3]);
    let mut on = 0u8;
    if whole.is_zero() {
        // A flat one is the union of its faces.
        for (k, face) in faces.iter().enumerate() {
            on |= u8::from(is_on(point, face)) << k;
        }
        return (on != 0).then_some(on);
    }
    for (k, [a, b, c]) in faces.iter().enumerate() {
        // The side of the face on which the corner opposite is, and that of the point.
        let [inner, side] = [&corners[k], point].map(|other| orient3d(a, b, c, other));
        if side.is_zero() {
            on |= 1 << k;
        } else if side != inner {
            return None;
        }
    }
    Some(on)
}

/// Whether a triangle contains a point.
#[inline]
fn is_on(point: &Point, corners: &[Point; 3]) -> bool {
    let [a, b, c] = corners;
    let is_near = (0..3).all(|k| {
        let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
        low <= point[k] && point[k] <= high
    });
    is_near
        && orient3d(a, b, c, point) == Sign::Zero
        && elements_are_within(&[*point], corners, &Reach::from(0.0))
}

/// A direction along a coordinate axis.
#[derive(Debug, Clone, Copy)]
struct Way {
    axis: usize,
    is_down: bool,
}

impl Way {
    const ALONG_X: Way = Way {
        axis: 0,
        is_down: false,
    };

    /// The shortest way out of a box, and the box of a ray that goes that way.
    #[inline(always)]
    fn out(whole: &Aabb, at: &Aabb) -> (Self, Aabb) {
        let (mut way, mut least) = (Way::ALONG_X, f32::INFINITY);
        for axis in 0..3 {
            let down = at.min[axis] - whole.min[axis];
            let up = whole.max[axis] - at.max[axis];
            for (is_down, length) in [(false, up), (true, down)] {
                if length < least {
                    (way, least) = (Way { axis, is_down }, length);
                }
            }
        }
        let mut query = *at;
        match way.is_down {
            true => query.min[way.axis] = f32::NEG_INFINITY,
            false => query.max[way.axis] = f32::INFINITY,
        }
        (way, query)
    }

    /// 1 if the shifted ray from a point leaves through a face, -1 if it enters through it, else 0.
    #[inline]
    fn passes(self, point: &Point, corners: &[Point; 3]) -> i32 {
        // The axes take turns, which keeps orientations; a mirror reverses them.
        let turned = |p: &Point| {
            let [x, y, z] = [0, 1, 2].map(|k| p[(self.axis + k) % 3]);
            [if self.is_down { -x } else { x }, y, z]
        };
        let sum = passes(&turned(point), &corners.each_ref().map(turned));
        if self.is_down { -sum } else { sum }
    }
}
