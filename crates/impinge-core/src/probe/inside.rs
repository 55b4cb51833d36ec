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
use crate::bvh::bounds::{Bounds, round_down, round_up};
use crate::contact::passes;
use crate::scene::elements::Elements;
use crate::scene::error::Error;
use crate::scene::positions::Real;
use crate::search::work::Work;
use crate::simd::{Isa, Lanes, Simd, up_to, with_isa};
use impinge_exact::internal::{Reach, elements_are_within};
use impinge_exact::{Point, Sign, orient3d};

/// Clusters between two looks at the control.
const LOOK: u32 = 1 << 12;

/// Where each point is: inside (1), on the surface (0) or outside (-1).
///
/// # Errors
/// Cancellation.
pub(super) fn places<R: Real>(
    isa: Isa,
    target: Target<'_>,
    border: Option<&Border>,
    points: &[[R; 3]],
    places: &mut [i8],
    work: Work<'_>,
) -> Result<(), Error> {
    with_isa!(isa, all_places, <R: Real>(
        target: Target<'_> = target,
        border: Option<&Border> = border,
        points: &[[R; 3]] = points,
        places: &mut [i8] = places,
        work: Work<'_> = work,
    ) -> Result<(), Error>)
}

#[inline(always)]
fn all_places<S: Simd, R: Real>(
    simd: S,
    target: Target<'_>,
    border: Option<&Border>,
    points: &[[R; 3]],
    places: &mut [i8],
    work: Work<'_>,
) -> Result<(), Error> {
    let whole = target.boxes.root();
    let mut descent = Descent::default();
    let mut n_seen = 0u32;
    for (point, place) in points.iter().zip(places) {
        let point = point.map(R::widen);
        let at = Bounds {
            min: point.map(round_down),
            max: point.map(round_up),
        };
        *place = -1;
        if !at.overlaps(&whole) {
            continue;
        }
        let (way, query) = match border {
            None => Way::out(&whole, &at),
            Some(_) => (Way::ALONG_X, at),
        };
        let mut found = FoundAround::default();
        descent.start(target.boxes);
        while let Some(cluster) = descent.next(simd, target.boxes, &query) {
            n_seen += 1;
            if n_seen == LOOK {
                n_seen = 0;
                work.step()?;
            }
            let lanes = target.boxes.elements(target.body, cluster);
            let slots = target.boxes.clustering.slots(cluster);
            let mask = simd.overlaps_64(lanes, &query, up_to(slots.len() - 1));
            for lane in Lanes(mask) {
                let slot = slots.start + lane;
                match border {
                    None => found.add_face(target, slot, &point, way),
                    Some(border) => found.add_tetrahedron(target, slot, &point, border),
                }
            }
            if found.is_settled {
                break;
            }
        }
        *place = found.place();
    }
    Ok(())
}

/// The lowest tetrahedron that contains each point.
///
/// # Errors
/// Cancellation.
pub(super) fn lowest<R: Real>(
    isa: Isa,
    target: Target<'_>,
    points: &[[R; 3]],
    lowest: &mut [Option<u32>],
    work: Work<'_>,
) -> Result<(), Error> {
    with_isa!(isa, all_lowest, <R: Real>(
        target: Target<'_> = target,
        points: &[[R; 3]] = points,
        lowest: &mut [Option<u32>] = lowest,
        work: Work<'_> = work,
    ) -> Result<(), Error>)
}

#[inline(always)]
fn all_lowest<S: Simd, R: Real>(
    simd: S,
    target: Target<'_>,
    points: &[[R; 3]],
    lowest: &mut [Option<u32>],
    work: Work<'_>,
) -> Result<(), Error> {
    let whole = target.boxes.root();
    let clustering = &target.boxes.clustering;
    let mut descent = Descent::default();
    let mut looks = Looks::new(work);
    for (point, lowest) in points.iter().zip(lowest) {
        let point = point.map(R::widen);
        let at = Bounds {
            min: point.map(round_down),
            max: point.map(round_up),
        };
        *lowest = None;
        if !at.overlaps(&whole) {
            continue;
        }
        descent.start(target.boxes);
        while let Some(cluster) = descent.next(simd, target.boxes, &at) {
            looks.step()?;
            let lanes = target.boxes.elements(target.body, cluster);
            let slots = clustering.slots(cluster);
            for lane in Lanes(simd.overlaps_64(lanes, &at, up_to(slots.len() - 1))) {
                let slot = slots.start + lane;
                let number = clustering.order[slot].raw();
                let is_lower = lowest.is_none_or(|lowest| number < lowest);
                if is_lower && faces_at(target, slot, &point).is_some() {
                    *lowest = Some(number);
                }
            }
        }
    }
    Ok(())
}

/// What the elements that were looked at say about a point.
#[derive(Debug, Default)]
struct FoundAround {
    winding: i32,
    /// Whether the point is in a tetrahedron.
    is_held: bool,
    /// Whether it is on a face of the surface.
    is_on: bool,
    /// Whether no other element can change the answer.
    is_settled: bool,
}

impl FoundAround {
    #[inline]
    fn add_face(&mut self, target: Target<'_>, slot: usize, point: &Point, way: Way) {
        let Elements::Triangles(faces) = &target.boxes.clustering.corners else {
            return;
        };
        let positions = target.body.positions();
        let corners = faces[slot].map(|vertex| positions.point(vertex as usize));
        if is_on(point, &corners) {
            (self.is_on, self.is_settled) = (true, true);
        } else {
            self.winding += way.passes(point, &corners);
        }
    }

    #[inline]
    fn add_tetrahedron(&mut self, target: Target<'_>, slot: usize, point: &Point, border: &Border) {
        let Some(on) = faces_at(target, slot, point) else {
            return;
        };
        self.is_held = true;
        if on == 0 {
            self.is_settled = true;
        }
        let number = target.boxes.clustering.order[slot].index();
        self.is_on |= on & border.mask(number) != 0;
    }

    fn place(&self) -> i8 {
        // Strictly inside a tetrahedron, whatever else the point is on.
        let is_inner = self.is_held && self.is_settled;
        match self.is_on && !is_inner {
            true => 0,
            false if self.is_held || self.winding != 0 => 1,
            false => -1,
        }
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
    fn out(whole: &Bounds, at: &Bounds) -> (Self, Bounds) {
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
