//! Neighbours that cannot meet, under `SharedVertex::Resolve`: found per vertex instead of per
//! pair.
//!
//! In: the rings of a surface, and its positions. Out: for each cluster, the lanes of triangles
//! with a *crease*: a vertex whose triangles are not certainly side by side. Two triangles that
//! share a vertex are tested only if both have a crease.
//!
//! Seen along an axis, the triangles around a vertex are sectors of a plane. If they all turn the
//! same way and together go around the vertex no more than once, no two sectors overlap, so no two
//! triangles meet anywhere but in the simplex that they share. On a smooth surface nearly every
//! vertex passes, also where neighbours lie in one plane.
//!
//! 1. Of each triangle in single precision: which way it turns, and which lines through its corners
//!    its far sides cross (`impinge_exact::filter::turns`), a register of triangles at a time.
//! 2. Of each vertex: whether all of its triangles turn the same way, and how many lines they
//!    cross. Where that leaves it open, its ring is gone along in `f64`, along the axes and then
//!    along the sum of its normals.
//! 3. Of each cluster: which triangles have a vertex with a crease.
//!
//! Reason for each discard: sectors that do not overlap. `docs/exactness.md`, "Creases", has the
//! proof and the bound.

use std::sync::atomic::{AtomicU16, AtomicU64, Ordering};

use crate::bvh::GROUP;
use crate::bvh::clusters::Clustering;
use crate::bvh::rings::{CornerAt, Ring, Rings};
use crate::scene::elements::Elements;
use crate::scene::index::ClusterIx;
use crate::scene::positions::Positions;
use crate::workers::Workers;
use impinge_exact::internal::filter;

use crate::simd::{ClusterFaces, Isa, Simd, with_isa};

/// Words of 64 vertices, or clusters of 64 triangles, per task.
const TASK: usize = 32;

/// The creases of one body in one pose.
#[derive(Debug, Default)]
pub(crate) struct Creases {
    /// The stamp of the positions; 0 for none.
    positions_stamp: u64,
    /// One bit per vertex.
    vertices: Vec<AtomicU64>,
    /// One bit per triangle.
    lanes: Vec<AtomicU64>,
    /// One word per triangle, by slot; empty if positions are not in single precision.
    turns: Vec<AtomicU16>,
}

impl Creases {
    pub fn bytes(&self) -> usize {
        let words = self.vertices.capacity() + self.lanes.capacity();
        size_of::<AtomicU64>() * words + size_of::<AtomicU16>() * self.turns.capacity()
    }

    /// The triangles of a cluster that have a crease.
    #[inline(always)]
    pub fn of(&self, cluster: ClusterIx) -> u64 {
        self.lanes[cluster.index()].load(Ordering::Relaxed)
    }

    /// Finds the creases of a pose, unless they are known.
    pub fn find(
        &mut self,
        isa: Isa,
        workers: &Workers,
        clustering: &Clustering,
        (positions, stamp): (&Positions, u64),
    ) {
        let (Elements::Triangles(faces), Some(rings)) = (&clustering.corners, clustering.rings())
        else {
            return;
        };
        if self.positions_stamp == stamp {
            return;
        }
        self.positions_stamp = stamp;
        let n_words = rings.n_vertices().div_ceil(64);
        self.vertices.resize_with(n_words, AtomicU64::default);
        self.lanes
            .resize_with(clustering.n_clusters(), AtomicU64::default);
        let n_turns = match positions {
            Positions::F32(_) => clustering.n_clusters() * GROUP,
            Positions::F64(_) => 0,
        };
        self.turns.resize_with(n_turns, AtomicU16::default);
        let (vertices, lanes, turns) = (&self.vertices, &self.lanes, &self.turns);
        let no_scratch = &mut vec![(); workers.n()][..];
        let n_each = workers.task(TASK);
        if let Positions::F32(positions) = positions {
            let n_words = n_each * GROUP;
            workers.for_each(no_scratch, turns.len().div_ceil(n_words), |(), task| {
                let clusters = task * n_each;
                let words = &turns[clusters * GROUP..turns.len().min((clusters + n_each) * GROUP)];
                with_isa!(isa, put_turns, (
                    clustering: &Clustering = clustering,
                    positions: &[[f32; 3]] = positions,
                    first: usize = clusters,
                    words: &[AtomicU16] = words,
                ));
            });
        }
        workers.for_each(no_scratch, n_words.div_ceil(n_each), |(), task| {
            for (word, bits) in chunk(vertices, n_each, task) {
                let creases = match positions {
                    Positions::F32(positions) => {
                        let positions = &positions[..];
                        creases(rings, word, turns, |vertex| {
                            positions[vertex].map(f64::from)
                        })
                    }
                    Positions::F64(positions) => {
                        let positions = &positions[..];
                        creases(rings, word, turns, |vertex| positions[vertex])
                    }
                };
                bits.store(creases, Ordering::Relaxed);
            }
        });
        let is_crease = |vertex: u32| {
            vertices[vertex as usize / 64].load(Ordering::Relaxed) >> (vertex % 64) & 1
        };
        workers.for_each(no_scratch, lanes.len().div_ceil(n_each), |(), task| {
            for (cluster, bits) in chunk(lanes, n_each, task) {
                let cluster = ClusterIx::from_usize(cluster);
                let of_cluster = clustering.vertices(cluster);
                if of_cluster
                    .iter()
                    .fold(0, |any, &vertex| any | is_crease(vertex))
                    == 0
                {
                    bits.store(0, Ordering::Relaxed);
                    continue;
                }
                let faces = &faces[clustering.slots(cluster)];
                let folded = (0..).zip(faces).fold(0, |folded, (lane, &[a, b, c])| {
                    folded | (is_crease(a) | is_crease(b) | is_crease(c)) << lane
                });
                bits.store(folded, Ordering::Relaxed);
            }
        });
    }
}

/// The words of one task, numbered.
fn chunk(
    words: &[AtomicU64],
    n_each: usize,
    task: usize,
) -> impl Iterator<Item = (usize, &AtomicU64)> {
    let first = task * n_each;
    (first..).zip(&words[first..words.len().min(first + n_each)])
}

/// Writes the words of the triangles of some clusters.
#[inline(always)]
fn put_turns<S: Simd>(
    simd: S,
    clustering: &Clustering,
    positions: &[[f32; 3]],
    first: usize,
    words: &[AtomicU16],
) {
    let Elements::Triangles(faces) = &clustering.corners else {
        return;
    };
    let mut corners = [[[0.0; GROUP]; 3]; 3];
    let mut turns = [0; GROUP];
    for (cluster, words) in (first..).zip(words.chunks_exact(GROUP)) {
        let cluster = ClusterIx::from_usize(cluster);
        let of_cluster = ClusterFaces {
            faces: &faces[clustering.slots(cluster)],
            vertices: clustering.vertices(cluster),
            local: clustering.local_faces(cluster),
        };
        simd.put_corners(positions, &of_cluster, &mut corners);
        filter::turns::<S::F32>(&corners, &mut turns);
        for (word, &turns) in words.iter().zip(&turns) {
            word.store(turns as u16, Ordering::Relaxed);
        }
    }
}

/// Whether the triangles around a vertex with a closed ring certainly do not overlap, seen along an
/// axis.
#[inline(always)]
fn are_side_by_side(turns: &[AtomicU16], corners: impl Iterator<Item = CornerAt>) -> bool {
    let (mut all, mut n_crossings) = (filter::TURNS, 0);
    for CornerAt { slot, corner } in corners {
        let word = u32::from(turns[slot].load(Ordering::Relaxed));
        all &= word;
        // One byte per axis: a ring has at most 96 triangles.
        let crosses = filter::crossings(word, corner);
        n_crossings += (crosses * 0x40_81) & 0x01_01_01;
    }
    (0..3).any(|axis| all >> (2 * axis) & 0b11 != 0 && n_crossings >> (8 * axis) & 0xff == 2)
}

/// Bit `k`: vertex `64 word + k` is a crease.
fn creases(rings: &Rings, word: usize, turns: &[AtomicU16], at: impl Fn(usize) -> [f64; 3]) -> u64 {
    let first = 64 * word;
    let end = rings.n_vertices().min(first + 64);
    (first..end).fold(0, |creases, vertex| {
        if !turns.is_empty()
            && let Some(corners) = rings.corners(vertex)
            && are_side_by_side(turns, corners)
        {
            return creases;
        }
        let is_crease = match rings.of(vertex) {
            Ring::None => false,
            Ring::Irregular => true,
            Ring::Regular(ring) => {
                let arms = Arms::new(at(vertex), ring, &at);
                !(arms.are_side_by_side_along_an_axis()
                    || arms.are_side_by_side_along_their_normal())
            }
        };
        creases | u64::from(is_crease) << (vertex - first)
    })
}

/// The vertices of a ring as seen from its middle.
struct Arms<'a, P> {
    middle: [f64; 3],
    ring: &'a [u32],
    at: &'a P,
}

impl<'a, P: Fn(usize) -> [f64; 3]> Arms<'a, P> {
    fn new(middle: [f64; 3], ring: &'a [u32], at: &'a P) -> Self {
        Arms { middle, ring, at }
    }

    #[inline(always)]
    fn arm(&self, other: u32) -> [f64; 3] {
        let other = (self.at)(other as usize);
        [0, 1, 2].map(|axis| other[axis] - self.middle[axis])
    }

    fn is_closed(&self) -> bool {
        self.ring.first() == self.ring.last()
    }

    /// Whether seen along some axis the triangles certainly do not overlap.
    #[inline(always)]
    fn are_side_by_side_along_an_axis(&self) -> bool {
        let first = self.arm(self.ring[0]);
        let mut last = first;
        let mut seen = [TurnsSeen::default(); 3];
        for &other in &self.ring[1..] {
            let next = self.arm(other);
            for (axis, seen) in seen.iter_mut().enumerate() {
                let crosses = is_below(axis, &last) != is_below(axis, &next);
                seen.add(turn(axis, &last, &next), crosses);
            }
            last = next;
        }
        (0..3).any(|axis| {
            let closing = turn(axis, &last, &first);
            seen[axis].is_once_at_most((!self.is_closed()).then_some(closing))
        })
    }

    /// Whether seen along the sum of their normals the triangles certainly do not overlap: at the
    /// edges of boxes and at the rims of cylinders they do along every axis.
    #[inline(never)]
    fn are_side_by_side_along_their_normal(&self) -> bool {
        let mut normal = [0.0; 3];
        for side in self.ring.windows(2) {
            let [from, to] = [self.arm(side[0]), self.arm(side[1])];
            let cross = cross(&from, &to);
            // As long as one another, whatever the size of their triangles.
            let length = cross.map(|(up, down)| (up - down) * (up - down));
            let length = (length[0] + length[1] + length[2]).sqrt();
            for axis in 0..3 {
                normal[axis] += (cross[axis].0 - cross[axis].1) / length;
            }
        }
        let first = self.arm(self.ring[0]);
        let Some(mut was_below) = is_below_along(&normal, &first) else {
            return false;
        };
        let mut last = first;
        let mut seen = TurnsSeen::default();
        for &other in &self.ring[1..] {
            let next = self.arm(other);
            let Some(is_below) = is_below_along(&normal, &next) else {
                return false;
            };
            seen.add(turn_along(&normal, &last, &next), was_below != is_below);
            (last, was_below) = (next, is_below);
        }
        let closing = turn_along(&normal, &last, &first);
        seen.is_once_at_most((!self.is_closed()).then_some(closing))
    }
}

/// What is seen along one axis while going along a ring.
#[derive(Debug, Clone, Copy)]
struct TurnsSeen {
    /// Whether every triangle certainly turns to the left, and whether every one does to the right.
    all: [bool; 2],
    /// How often the ring goes from one half-plane to the other.
    n_crossings: u32,
}

impl Default for TurnsSeen {
    fn default() -> Self {
        TurnsSeen {
            all: [true; 2],
            n_crossings: 0,
        }
    }
}

impl TurnsSeen {
    #[inline(always)]
    fn add(&mut self, [left, right]: [bool; 2], crosses: bool) {
        self.all[0] &= left;
        self.all[1] &= right;
        self.n_crossings += u32::from(crosses);
    }

    /// Whether the triangles turn the same way and do not overlap. An open ring also has the turn
    /// from its last vertex to its first.
    #[inline(always)]
    fn is_once_at_most(&self, closing: Option<[bool; 2]>) -> bool {
        let [left, right] = self.all;
        match closing {
            None => (left || right) && self.n_crossings == 2,
            Some(closing) => match self.n_crossings {
                0 | 1 => left || right,
                2 => (left && closing[0]) || (right && closing[1]),
                _ => false,
            },
        }
    }
}

/// 2^-50: eight rounding errors.
const RELATIVE: f64 = f64::from_bits((1023 - 50) << 52);
/// 2^-1000, far above what is lost when a product underflows.
const ABSOLUTE: f64 = f64::from_bits((1023 - 1000) << 52);

/// 2^-900: with `RELATIVE` it is still far above that.
const UNDERFLOW: f64 = f64::from_bits((1023 - 900) << 52);

/// The two products of each coordinate of the cross product of two arms.
#[inline(always)]
fn cross(from: &[f64; 3], to: &[f64; 3]) -> [(f64, f64); 3] {
    [0, 1, 2].map(|axis| {
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        (from[i] * to[j], from[j] * to[i])
    })
}

/// Seen along an axis, whether the turn from one arm to another is certainly to the left, and
/// certainly to the right.
#[inline(always)]
fn turn(axis: usize, from: &[f64; 3], to: &[f64; 3]) -> [bool; 2] {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let (up, down) = (from[i] * to[j], from[j] * to[i]);
    let (turn, bound) = (up - down, RELATIVE * (up.abs() + down.abs()) + ABSOLUTE);
    [turn > bound, turn < -bound]
}

/// The same, seen along a direction: the sign of (from x to) . direction.
#[inline(always)]
fn turn_along(direction: &[f64; 3], from: &[f64; 3], to: &[f64; 3]) -> [bool; 2] {
    let (mut turn, mut size) = (0.0, 0.0);
    for (along, (up, down)) in direction.iter().zip(cross(from, to)) {
        turn += along * (up - down);
        // What is lost where a product underflows grows with `along`.
        size += along.abs() * (up.abs() + down.abs() + UNDERFLOW);
    }
    let bound = 2.0 * RELATIVE * size + ABSOLUTE;
    [turn > bound, turn < -bound]
}

/// Seen along a direction, on which side of a line an arm certainly lies. Any line would do; on the
/// image of a vector that is like no other, meshes rarely have vertices.
#[inline(always)]
fn is_below_along(direction: &[f64; 3], arm: &[f64; 3]) -> Option<bool> {
    const LINE: [f64; 3] = [0.331, 0.577, 0.747];
    match turn_along(arm, direction, &LINE) {
        [false, false] => None,
        [_, is_below] => Some(is_below),
    }
}

/// Seen along an axis, which of two half-planes an arm points to: the one of angles from 0 up to
/// but without 180 degrees, or the other.
#[inline(always)]
fn is_below(axis: usize, arm: &[f64; 3]) -> bool {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    arm[j] < 0.0 || (arm[j] == 0.0 && arm[i] < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::clusters::ToOrder;
    use crate::bvh::tree::TreeEntry;
    use crate::query::settings::InstructionSet;
    use crate::scene::index::Slot;

    /// The triangles that have a crease.
    fn folded(faces: &[[u32; 3]], positions: &[[f64; 3]]) -> Vec<u32> {
        let elements = Elements::from(faces.to_vec());
        let numbers = 0..faces.len() as u32;
        let to_order = ToOrder {
            centers: numbers
                .map(|number| TreeEntry::new([0.0; 3], number))
                .collect(),
            sizes: None,
        };
        let clustering = Clustering::new(&elements, to_order, false, &|| true).expect("it goes on");
        clustering.find_rings();
        let mut answers = Vec::new();
        let single = positions.iter().map(|p| p.map(|x| x as f32)).collect();
        for positions in [Positions::from(positions.to_vec()), Positions::F32(single)] {
            let mut creases = Creases::default();
            let isa = Isa::detect(InstructionSet::default());
            creases.find(isa, &Workers::new(1), &clustering, (&positions, 1));
            let mut folded: Vec<u32> = Slot::up_to(faces.len())
                .filter(|slot| creases.of(slot.cluster()) >> slot.lane() & 1 == 1)
                .map(|slot| clustering.element(slot).raw())
                .collect();
            folded.sort_unstable();
            answers.push(folded);
        }
        assert_eq!(answers[0], answers[1]);
        answers.swap_remove(0)
    }

    /// Triangles around vertex 0, each of so many degrees. A closed fan ends where it began.
    fn fan(n: u32, degrees: f64, closed: bool, tilt: f64) -> (Vec<[u32; 3]>, Vec<[f64; 3]>) {
        let n_vertices = if closed { n } else { n + 1 };
        let faces = (0..n).map(|ix| [0, 1 + ix, 1 + (ix + 1) % n_vertices]);
        let rim = (0..n_vertices).map(|ix| {
            let angle = (f64::from(ix) * degrees + 7.0).to_radians();
            [angle.cos(), angle.sin(), tilt * angle.cos()]
        });
        let positions = std::iter::once([0.0; 3]).chain(rim).collect();
        (faces.collect(), positions)
    }

    #[test]
    fn fans_that_go_around_once_at_most_have_no_crease() {
        let all = |n: u32| (0..n).collect::<Vec<u32>>();
        for tilt in [0.0, 0.5, 20.0] {
            for (n, degrees, closed, is_crease) in [
                (2, 60.0, false, false),
                (4, 80.0, false, false),
                (7, 51.0, false, false),
                (8, 44.0, false, false),
                (3, 179.0, false, true),
                (9, 50.0, false, true),
                (12, 50.0, false, true),
                (3, 120.0, true, false),
                (7, 360.0 / 7.0, true, false),
                (10, 72.0, true, true),
                (40, 27.0, true, true),
            ] {
                let (faces, positions) = fan(n, degrees, closed, tilt);
                let expected = if is_crease { all(n) } else { Vec::new() };
                let name = format!("{n} of {degrees}, closed {closed}, tilt {tilt}");
                assert_eq!(folded(&faces, &positions), expected, "{name}");
                // The other way round, seen from every axis.
                for axis in 1..3 {
                    let turned = positions.iter().map(|&p| {
                        let mut p = p;
                        p[2] = -p[2];
                        p.rotate_right(axis);
                        p
                    });
                    let turned: Vec<[f64; 3]> = turned.collect();
                    assert_eq!(folded(&faces, &turned), expected, "{name}, {axis}");
                }
            }
        }
    }

    #[test]
    fn the_corner_of_a_box_has_no_crease() {
        let rim = [
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 1.0, 1.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
        ];
        let faces: Vec<[u32; 3]> = (0..6).map(|ix| [0, 1 + ix, 1 + (ix + 1) % 6]).collect();
        let positions = |rim: &[[f64; 3]]| [&[[0.0; 3]], rim].concat();
        assert!(folded(&faces, &positions(&rim)).is_empty());
        // A corner pushed through the opposite side.
        let mut pushed = rim;
        pushed[1] = [0.25, 0.25, 1.0];
        assert_eq!(folded(&faces, &positions(&pushed)).len(), 6);
    }

    #[test]
    fn a_sheet_has_creases_where_it_is_folded() {
        let n = 12u32;
        let vertex = |x: u32, y: u32| y * (n + 1) + x;
        let faces: Vec<[u32; 3]> = (0..n)
            .flat_map(|y| (0..n).map(move |x| [x, y]))
            .flat_map(|[x, y]| {
                let [p, q] = [vertex(x, y), vertex(x + 1, y)];
                let [r, s] = [vertex(x, y + 1), vertex(x + 1, y + 1)];
                [[p, q, s], [p, s, r]]
            })
            .collect();
        let sheet = |height: &dyn Fn(u32) -> [f64; 2]| -> Vec<[f64; 3]> {
            (0..=n)
                .flat_map(|y| (0..=n).map(move |x| [x, y]))
                .map(|[x, y]| {
                    let [x, z] = height(x);
                    [x, f64::from(y), z]
                })
                .collect()
        };
        let flat = sheet(&|x| [f64::from(x), 0.0]);
        assert!(folded(&faces, &flat).is_empty());
        let wave = sheet(&|x| [f64::from(x), f64::from(x * x % 5)]);
        assert!(folded(&faces, &wave).is_empty());
        // Folded back onto itself at x = 6.
        let back = sheet(&|x| [f64::from(x.min(12 - x)), 0.0]);
        let found = folded(&faces, &back);
        let at_crease = |face: &[u32; 3]| face.iter().any(|vertex| vertex % (n + 1) == 6);
        let expected: Vec<u32> = (0..)
            .zip(&faces)
            .filter_map(|(ix, face)| at_crease(face).then_some(ix))
            .collect();
        assert_eq!(found, expected);
        // Creased by a right angle, so that one half is seen as a line along every axis.
        let crease = sheet(&|x| [f64::from(x.min(6)), -f64::from(x.max(6) - 6)]);
        assert!(folded(&faces, &crease).is_empty());
        // Not a number is never certain.
        let mut broken = flat.clone();
        broken[vertex(3, 3) as usize][0] = f64::NAN;
        assert!(!folded(&faces, &broken).is_empty());
    }
}
