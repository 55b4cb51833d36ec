//! Where vertices become boxes, for both backends on the host. (On a device that is the text of
//! `kernels/still.wgsl` and `kernels/moving.wgsl`.)
//!
//! ```text
//! vertices of a pose  ->  box of some vertices   of_vertices, of_run, of_cluster;
//!                                                BoxSource::of_cluster: at both ends of a step
//! corners in tables   ->  boxes of a group       LaneBounds::hold, fill;
//!                                                Sweep: what of a step they must hold
//! ```
//!
//! Boxes of positions in f32 are exact, those of positions in f64 rounded outward. Boxes of points
//! in tables hold these as they are rounded: rounding keeps the order of coordinates, so boxes that
//! are apart prove the elements apart.

/// Functions of what every x86-64 processor has: SSE2. In functions compiled for it its operations
/// are safe, and these are inlined everywhere.
#[cfg(target_arch = "x86_64")]
macro_rules! sse2 {
    ($(fn $name:ident($($argument:ident: $type:ty),*) -> $result:ty $body:block)*) => {$(
        #[inline(always)]
        pub fn $name($($argument: $type),*) -> $result {
            #[inline]
            #[target_feature(enable = "sse2")]
            fn compiled($($argument: $type),*) -> $result $body
            // SAFETY: every x86-64 processor has SSE2.
            unsafe { compiled($($argument),*) }
        }
    )*};
}
#[cfg(target_arch = "x86_64")]
pub(crate) use sse2;

mod extent;
pub(crate) mod scale;
mod sweep;
mod vec4;
mod vec64;

pub(crate) use extent::Extent;
pub(crate) use sweep::Sweep;
pub(crate) use vec4::{Vec4, of_vertices_f32};
use vec4::{center_f32, extent};

use crate::bvh::bounds::{Aabb, LaneBounds, greater, lesser, round_down, round_up};
use crate::bvh::clusters::{Clustering, ToOrder};
use crate::bvh::tree::TreeEntry;
use crate::bvh::{GROUP, made_from};
use crate::scene::Body;
use crate::scene::elements::{Elements, with_corners};
use crate::scene::index::ClusterIx;
use crate::scene::positions::Positions;

/// An instruction set, as far as it reads vertices.
pub(crate) trait ReadVertices: Copy {
    /// The box of some vertices, and whether all are certainly finite: the results of
    /// [`of_vertices_f32`].
    ///
    /// # Panics
    /// If there is no such vertex.
    ///
    /// # Safety
    /// `vertices` must not descend.
    unsafe fn of_ascending(self, positions: &[[f32; 3]], vertices: &[u32]) -> (Aabb, bool);
}

/// The box of some vertices.
#[inline]
pub(crate) fn of_vertices(positions: &Positions, vertices: &[u32]) -> Aabb {
    match positions {
        Positions::F32(positions) => of_vertices_f32(positions, vertices).0,
        Positions::F64(positions) => {
            let [min, max] = vec64::ends(positions, vertices);
            Aabb {
                min: min.map(round_down),
                max: max.map(round_up),
            }
        }
    }
}

/// What the order of a body's clusters follows: the centres of the boxes of all elements, on the
/// threads of the pool at hand, and the elements' sizes if these differ much.
pub(crate) fn centers(elements: &Elements, positions: &Positions) -> ToOrder {
    let centers = with_corners!(elements, |corners| match positions {
        Positions::F32(positions) => numbered(corners, |corners| center_f32(positions, corners)),
        Positions::F64(_) => numbered(corners, |corners| of_vertices(positions, corners).center()),
    });
    ToOrder {
        centers,
        sizes: sizes(elements, positions),
    }
}

/// How many elements are looked at to see whether sizes differ.
const SAMPLE: usize = 256;
/// An element is long if its box is more than so many times as long as that of the middle one.
const LONG: f32 = 8.0;
/// The share of long elements from which they are set apart: one in so many.
const ONE_IN: usize = 32;

/// The class of each element by the length of its box: 0, or how many fourfold lengths it is longer
/// than the middle one's [`LONG`], and 1. `None` where hardly any element is long.
///
/// A long element makes the box of its cluster as long as itself. In clusters of their own, they
/// leave those of short elements as small as these.
fn sizes(elements: &Elements, positions: &Positions) -> Option<Vec<u8>> {
    let length = |element: usize| {
        let bounds = of_vertices(positions, elements.corners(element));
        let [x, y, z] = [0, 1, 2].map(|axis| bounds.max[axis] - bounds.min[axis]);
        greater(greater(x, y), z)
    };
    let n = elements.len();
    if n < GROUP * 2 {
        return None;
    }
    let sample = (0..n).step_by(n.div_ceil(SAMPLE));
    let mut lengths: Vec<f32> = sample.map(length).collect();
    lengths.sort_unstable_by(f32::total_cmp);
    let long = LONG * lengths[lengths.len() / 2];
    let n_long = lengths.iter().filter(|&&length| length > long).count();
    if long == 0.0 || n_long * ONE_IN < lengths.len() {
        return None;
    }
    let class = |length: f32| match length > long {
        // Two binary orders per class.
        true => 1 + ((length.to_bits() >> 23) - (long.to_bits() >> 23)) as u8 / 2,
        false => 0,
    };
    Some((0..n).map(|element| class(length(element))).collect())
}

fn numbered<const N: usize>(
    elements: &[[u32; N]],
    center: impl Fn(&[u32; N]) -> [f32; 3] + Sync,
) -> Vec<TreeEntry> {
    made_from(elements, |number, corners| {
        TreeEntry::new(center(corners), number as u32)
    })
}

/// The box of a cluster, and whether the positions that were read are certainly finite. (f64
/// positions are checked before.)
#[inline(always)]
pub(crate) fn of_cluster<S: ReadVertices>(
    simd: S,
    positions: &Positions,
    clustering: &Clustering,
    cluster: ClusterIx,
) -> (Aabb, bool) {
    let vertices = clustering.vertices(cluster);
    match positions {
        // SAFETY: a cluster's vertices ascend.
        Positions::F32(positions) => unsafe { simd.of_ascending(positions, vertices) },
        Positions::F64(_) => (of_vertices(positions, vertices), true),
    }
}

/// Coordinates processed together in [`of_run`]: several registers hide the latency.
const TOGETHER: usize = 24;

/// The box of a run of a body's vertices.
pub(crate) fn of_run(positions: &Positions, run: std::ops::Range<usize>) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    match positions {
        Positions::F32(positions) => {
            let mut min = [f32::INFINITY; TOGETHER];
            let mut max = [f32::NEG_INFINITY; TOGETHER];
            let (chunks, rest) = positions[run].as_flattened().as_chunks::<TOGETHER>();
            for chunk in chunks {
                for k in 0..TOGETHER {
                    min[k] = lesser(min[k], chunk[k]);
                    max[k] = greater(max[k], chunk[k]);
                }
            }
            for (k, &x) in rest.iter().enumerate() {
                min[k] = lesser(min[k], x);
                max[k] = greater(max[k], x);
            }
            for k in 0..TOGETHER {
                bounds.min[k % 3] = lesser(bounds.min[k % 3], min[k]);
                bounds.max[k % 3] = greater(bounds.max[k % 3], max[k]);
            }
        }
        Positions::F64(positions) => {
            for point in &positions[run] {
                bounds.join(&Aabb {
                    min: point.map(round_down),
                    max: point.map(round_up),
                });
            }
        }
    }
    bounds
}

/// Where a body's vertices are during a step, and what of the step its boxes must hold.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BoxSource<'a> {
    start: &'a Positions,
    /// `None` if the body does not move.
    end: Option<&'a Positions>,
    sweep: Sweep,
    /// How far the box of each element reaches farther than the sweep says.
    each: Option<&'a [f64]>,
}

impl<'a> BoxSource<'a> {
    pub fn new(body: &'a Body, sweep: Sweep, each: Option<&'a [f64]>) -> Self {
        BoxSource {
            start: body.positions(),
            end: body.end_positions(),
            sweep,
            each,
        }
    }

    /// The boxes of a cluster at the start and at the end.
    #[inline(always)]
    pub fn of_cluster<S: ReadVertices>(
        &self,
        simd: S,
        clustering: &Clustering,
        cluster: ClusterIx,
    ) -> [Aabb; 2] {
        let (start, _) = of_cluster(simd, self.start, clustering, cluster);
        let end = match self.end {
            Some(end) => of_cluster(simd, end, clustering, cluster).0,
            None => start,
        };
        let sweep = match self.each {
            None => self.sweep,
            Some(each) => {
                let elements = clustering.elements(cluster).iter();
                let own = elements.map(|element| each[element.index()]);
                let most = own.fold(0.0, f64::max);
                self.sweep.inflated_by(most.next_up())
            }
        };
        sweep.close([start, end])
    }

    /// The positions at the start and at the end.
    #[inline(always)]
    pub fn ends(&self) -> [&'a Positions; 2] {
        [self.start, self.end.unwrap_or(self.start)]
    }

    /// Puts the boxes of a cluster's elements into lanes, by the corners of its elements; to be
    /// [closed](Self::close).
    pub fn fill(&self, clustering: &Clustering, cluster: ClusterIx, boxes: [&mut LaneBounds; 2]) {
        let [start, end] = boxes;
        fill(self.start, clustering, cluster, start);
        match self.end {
            Some(positions) => fill(positions, clustering, cluster, end),
            None => end.clone_from(start),
        }
    }

    /// The box of an element over the whole step, not rounded.
    #[inline]
    pub fn extent(&self, corners: &[u32]) -> Extent {
        let ends = self.ends();
        let [Positions::F64(start), Positions::F64(end)] = ends else {
            let points = corners
                .iter()
                .flat_map(|&corner| ends.map(|positions| positions.point(corner as usize)));
            return Extent::of(points);
        };
        let [start, end] = [start, end].map(|positions| {
            let [min, max] = vec64::ends(positions, corners);
            Extent { min, max }
        });
        let mut both = start;
        both.join(&end);
        both
    }

    /// Makes the boxes to be tested from those of a cluster's elements at both ends:
    /// [`Sweep::close_all`].
    #[inline(always)]
    pub fn close(
        &self,
        clustering: &Clustering,
        cluster: ClusterIx,
        [start, end]: [&mut LaneBounds; 2],
    ) {
        let size = clustering.size(cluster);
        if let Some(each) = self.each {
            let elements = clustering.elements(cluster);
            let mut by = [0.0; GROUP];
            for (by, element) in by.iter_mut().zip(elements) {
                *by = round_up(each[element.index()]);
            }
            sweep::inflate_each(start, &by);
            sweep::inflate_each(end, &by);
        }
        self.sweep.close_all([start, end], size);
    }
}

/// Puts the boxes of a cluster's elements into lanes; lanes past its size become empty.
pub(crate) fn fill(
    positions: &Positions,
    clustering: &Clustering,
    cluster: ClusterIx,
    lanes: &mut LaneBounds,
) {
    let slots = clustering.slots(cluster);
    with_corners!(&clustering.corners, |corners| of_elements(
        positions,
        &corners[slots],
        lanes
    ));
}

fn of_elements<const N: usize>(
    positions: &Positions,
    corners: &[[u32; N]],
    lanes: &mut LaneBounds,
) {
    match positions {
        Positions::F32(positions) => {
            let positions = &positions[..];
            let (fours, rest) = corners.as_chunks::<4>();
            for (four_ix, four) in fours.iter().enumerate() {
                let [a, b, c, d] = four;
                let (min_a, max_a) = extent(positions, a);
                let (min_b, max_b) = extent(positions, b);
                let (min_c, max_c) = extent(positions, c);
                let (min_d, max_d) = extent(positions, d);
                let min = Vec4::transpose([min_a, min_b, min_c, min_d]);
                let max = Vec4::transpose([max_a, max_b, max_c, max_d]);
                let lane = 4 * four_ix;
                for axis in 0..3 {
                    lanes.min[axis][lane..lane + 4].copy_from_slice(&min[axis]);
                    lanes.max[axis][lane..lane + 4].copy_from_slice(&max[axis]);
                }
            }
            let done = corners.len() - rest.len();
            for (lane, corners) in (done..).zip(rest) {
                let (min, max) = extent(positions, corners);
                let (min, max) = (min.xyz(), max.xyz());
                lanes.put(lane, &Aabb { min, max });
            }
        }
        Positions::F64(positions) => {
            // Rounded when all ends are known: many at a time.
            let mut ends = [[[0.0; GROUP]; 3]; 2];
            for (lane, corners) in corners.iter().enumerate() {
                let [min, max] = vec64::ends(positions, corners);
                for axis in 0..3 {
                    ends[0][axis][lane] = min[axis];
                    ends[1][axis][lane] = max[axis];
                }
            }
            let [min, max] = &ends;
            for axis in 0..3 {
                for (rounded, &x) in lanes.min[axis].iter_mut().zip(&min[axis]) {
                    *rounded = round_down(x);
                }
                for (rounded, &x) in lanes.max[axis].iter_mut().zip(&max[axis]) {
                    *rounded = round_up(x);
                }
            }
        }
    }
    lanes.clear_from(corners.len());
}

impl LaneBounds {
    /// The boxes of elements whose corners are in tables, one element per lane; lanes past `size`
    /// become empty.
    #[inline(always)]
    pub fn hold<const N: usize>(&mut self, corners: [&[[f32; GROUP]; 3]; N], size: usize) {
        for axis in 0..3 {
            for lane in 0..GROUP {
                let first = corners[0][axis][lane];
                let (mut min, mut max) = (first, first);
                for corner in &corners[1..] {
                    min = lesser(min, corner[axis][lane]);
                    max = greater(max, corner[axis][lane]);
                }
                (self.min[axis][lane], self.max[axis][lane]) = (min, max);
            }
        }
        self.clear_from(size);
    }
}
