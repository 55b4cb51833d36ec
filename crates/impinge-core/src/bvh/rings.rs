//! The ring of each vertex of a surface: the other vertices of its triangles, in the order in which
//! they go around it.
//!
//! ```text
//!        p1 ---- p0          closed: p0 p1 p2 p3 p4 p0
//!       /  \    /  \
//!     p2 --- v ---- p4       open (v on a boundary): p0 p1 p2
//!       \   |  __/
//!        \  | /
//!          p3
//! ```
//!
//! Vertices whose triangles form neither one closed ring nor one open ring are *irregular*. Hubs
//! are irregular too: `hubs` decides their pairs. A vertex of a single triangle has no ring, for no
//! pair shares it.
//!
//! Cost: `O(n)` once per topology; 32 bytes per triangle.

use super::hubs::{self, HUB};
use super::parallel;

/// The vertices of one task while rings are ordered.
const MIN_VERTICES: usize = 4096;

/// The rings of one body.
#[derive(Debug)]
pub(crate) struct Rings {
    /// Where the ring of each vertex starts, and one past the last.
    starts: Vec<u32>,
    /// Ring after ring; a closed one ends with its first vertex.
    vertices: Vec<u32>,
    /// The corners at each vertex with a closed ring of triangles of one sense, one less than its
    /// ring has vertices; else [`IRREGULAR`].
    corners: Vec<u32>,
}

/// A corner of a triangle, by the slot of the triangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CornerAt {
    pub slot: usize,
    pub corner: u32,
}

/// What is known of the triangles around a vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ring<'a> {
    /// At most one triangle names the vertex.
    None,
    /// No order goes around the vertex once.
    Irregular,
    /// At least two triangles: each has two consecutive vertices of the list.
    Regular(&'a [u32]),
}

/// Marks the ring of an irregular vertex.
const IRREGULAR: u32 = u32::MAX;

impl Rings {
    pub fn new(faces: &[[u32; 3]]) -> Self {
        let counts = hubs::counts(faces);
        let mut starts = Vec::with_capacity(counts.len() + 1);
        let mut start = 0;
        starts.push(start);
        for &count in &counts {
            start += match count {
                0 | 1 => 0,
                // Nothing but the mark.
                count if count > HUB => 1,
                count => count + 1,
            };
            starts.push(start);
        }
        // The sides opposite each vertex: two vertices each.
        let mut side_starts = Vec::with_capacity(counts.len() + 1);
        let mut start = 0;
        side_starts.push(start);
        for &count in &counts {
            start += if (2..=HUB).contains(&count) { count } else { 0 };
            side_starts.push(start);
        }
        let mut next = side_starts.clone();
        let mut sides = vec![[0u32; 2]; start as usize];
        let mut corners = vec![IRREGULAR; *starts.last().expect("never empty") as usize];
        for (slot, face) in faces.iter().enumerate() {
            for corner in 0..3 {
                let vertex = face[corner] as usize;
                if (2..=HUB).contains(&counts[vertex]) {
                    let side = next[vertex];
                    sides[side as usize] = [face[(corner + 1) % 3], face[(corner + 2) % 3]];
                    let at = starts[vertex] + (side - side_starts[vertex]);
                    corners[at as usize] = packed(slot, corner);
                    next[vertex] += 1;
                }
            }
        }
        drop(next);
        let mut vertices = vec![IRREGULAR; *starts.last().expect("never empty") as usize];
        let mut parts = Vec::new();
        let (mut rest, mut rest_corners) = (&mut vertices[..], &mut corners[..]);
        let mut rest_sides = &mut sides[..];
        for first in (0..counts.len()).step_by(MIN_VERTICES) {
            let end = counts.len().min(first + MIN_VERTICES);
            let n_part = (starts[end] - starts[first]) as usize;
            let (part, part_corners);
            (part, rest) = rest.split_at_mut(n_part);
            (part_corners, rest_corners) = rest_corners.split_at_mut(n_part);
            let part_sides;
            (part_sides, rest_sides) =
                rest_sides.split_at_mut((side_starts[end] - side_starts[first]) as usize);
            parts.push((first..end, [part, part_corners], part_sides));
        }
        parallel::for_each(parts, |(range, [part, corners], sides)| {
            let (first, first_side) = (starts[range.start], side_starts[range.start]);
            for vertex in range {
                let ring = (starts[vertex] - first) as usize..(starts[vertex + 1] - first) as usize;
                let own = (side_starts[vertex] - first_side) as usize
                    ..(side_starts[vertex + 1] - first_side) as usize;
                if own.is_empty() {
                    continue;
                }
                let (ring, corners) = (&mut part[ring.clone()], &mut corners[ring]);
                let is_ring = put_in_order(&mut sides[own], ring);
                if !is_ring {
                    ring.fill(IRREGULAR);
                }
                let is_closed = is_ring && ring.first() == ring.last();
                if !(is_closed && are_alike(faces, &corners[..corners.len() - 1])) {
                    corners[0] = IRREGULAR;
                }
            }
        });
        Rings {
            starts,
            vertices,
            corners,
        }
    }

    /// The corners at a vertex, in any order, if its ring is closed and all triangles turn around
    /// it in the sense in which they name their corners, or all in the other one.
    #[inline(always)]
    pub fn corners(&self, vertex: usize) -> Option<impl Iterator<Item = CornerAt> + '_> {
        let of = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
        let (_, corners) = self.corners[of].split_last()?;
        let first = corners.first()?;
        (*first != IRREGULAR).then(|| {
            corners.iter().map(|&packed| CornerAt {
                slot: (packed >> 2) as usize,
                corner: packed & 3,
            })
        })
    }

    /// One more than the highest vertex that a triangle names.
    pub fn n_vertices(&self) -> usize {
        self.starts.len() - 1
    }

    #[inline(always)]
    pub fn of(&self, vertex: usize) -> Ring<'_> {
        let ring = &self.vertices[self.starts[vertex] as usize..self.starts[vertex + 1] as usize];
        match ring.first() {
            None => Ring::None,
            Some(&IRREGULAR) => Ring::Irregular,
            Some(_) => Ring::Regular(ring),
        }
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&self.starts[..])
            + size_of_val(&self.vertices[..])
            + size_of_val(&self.corners[..])
    }
}

/// Whether all triangles of a closed ring name its vertices in the same sense: then each vertex of
/// the ring follows the middle once.
fn are_alike(faces: &[[u32; 3]], corners: &[u32]) -> bool {
    let next = |packed: u32| {
        if packed == IRREGULAR {
            return None;
        }
        let face = faces.get((packed >> 2) as usize)?;
        Some(face[((packed & 3) as usize + 1) % 3])
    };
    (corners.iter().enumerate()).all(|(ix, &corner)| {
        let next_here = next(corner);
        next_here.is_some() && corners[..ix].iter().all(|&other| next(other) != next_here)
    })
}

/// A corner in 32 bits; [`IRREGULAR`] if its place has more than 30.
fn packed(slot: usize, corner: usize) -> u32 {
    match slot < 1 << 30 {
        true => (slot << 2 | corner) as u32,
        false => IRREGULAR,
    }
}

/// Writes the vertices of the sides around one vertex in an order in which consecutive ones are a
/// side. `false` if there is none: some vertex belongs to three sides, or the sides form several
/// rings. The sides end up in another order.
fn put_in_order(sides: &mut [[u32; 2]], ring: &mut [u32]) -> bool {
    let n_at = |sides: &[[u32; 2]], vertex: u32| {
        sides
            .iter()
            .flatten()
            .filter(|&&other| other == vertex)
            .count()
    };
    let mut n_ends = 0;
    for ix in 0..sides.len() {
        let [p, q] = sides[ix];
        if p == q {
            return false;
        }
        for (vertex, other) in [(p, q), (q, p)] {
            match n_at(sides, vertex) {
                1 => {
                    // The first end begins the list.
                    if n_ends == 0 {
                        sides[ix] = [vertex, other];
                        sides.swap(0, ix);
                    }
                    n_ends += 1;
                }
                2 => (),
                _ => return false,
            }
        }
    }
    if n_ends != 0 && n_ends != 2 {
        return false;
    }
    let [first, mut last] = sides[0];
    ring[0] = first;
    ring[1] = last;
    for n in 1..sides.len() {
        let Some(found) = sides[n..].iter().position(|side| side.contains(&last)) else {
            return false;
        };
        sides.swap(n, n + found);
        let [p, q] = sides[n];
        last = if p == last { q } else { p };
        ring[n + 1] = last;
    }
    // A closed ring comes back to its first vertex, and not before its end: no vertex belongs to
    // three sides.
    n_ends == 2 || last == first
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(faces: &[[u32; 3]], vertex: usize) -> Option<Vec<u32>> {
        match Rings::new(faces).of(vertex) {
            Ring::Regular(ring) => Some(ring.to_vec()),
            _ => None,
        }
    }

    #[test]
    fn a_closed_ring_comes_back_to_its_first_vertex() {
        // The triangles have different orientations, which does not matter.
        let faces = [[0, 1, 2], [3, 4, 0], [0, 3, 2], [4, 1, 0]];
        let ring = ring(&faces, 0).unwrap();
        assert_eq!(ring.len(), 5);
        assert_eq!(ring[0], ring[4]);
        for side in ring.windows(2) {
            assert!(
                faces
                    .iter()
                    .any(|face| face.contains(&side[0]) && face.contains(&side[1]))
            );
        }
        // Each of the others has two triangles.
        assert_eq!(Rings::new(&faces).n_vertices(), 5);
    }

    #[test]
    fn an_open_ring_goes_from_one_end_to_the_other() {
        let found = ring(&[[0, 2, 3], [0, 1, 2], [0, 4, 3]], 0).unwrap();
        assert!(found == [1, 2, 3, 4] || found == [4, 3, 2, 1], "{found:?}");
    }

    #[test]
    fn irregular_vertices_are_known() {
        let irregular = |faces: &[[u32; 3]]| Rings::new(faces).of(0) == Ring::Irregular;
        // Two fans that meet in one vertex, open and closed.
        assert!(irregular(&[[0, 1, 2], [0, 3, 4]]));
        let tetrahedra = [
            [0, 1, 2],
            [0, 2, 3],
            [0, 3, 1],
            [0, 4, 5],
            [0, 5, 6],
            [0, 6, 4],
        ];
        assert!(irregular(&tetrahedra));
        // A closed ring and an open one.
        assert!(irregular(&[[0, 1, 2], [0, 2, 3], [0, 3, 1], [0, 4, 5]]));
        // Three triangles at one edge.
        assert!(irregular(&[[0, 1, 2], [0, 1, 3], [0, 1, 4]]));
        // Degenerate triangles.
        assert!(irregular(&[[0, 1, 1], [0, 1, 2]]));
        assert!(irregular(&[[0, 0, 1], [0, 1, 2]]));
        // A vertex with one triangle has no ring; nor has one with none.
        assert_eq!(Rings::new(&[[0, 2, 3]]).of(0), Ring::None);
        assert_eq!(Rings::new(&[[0, 2, 3]]).of(1), Ring::None);
        // The same triangle twice goes there and back.
        assert_eq!(ring(&[[0, 1, 2], [0, 1, 2]], 0).unwrap().len(), 3);
        // A hub.
        let fan: Vec<[u32; 3]> = (1..=HUB + 1).map(|ix| [0, ix, ix + 1]).collect();
        assert!(irregular(&fan));
    }
}
