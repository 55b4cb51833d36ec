//! The answer which elements are near each element: lists, as compressed sparse rows.

use crate::answers::home::{Home, gives_back};
use crate::plan::Plan;
use crate::query::pair_kind::PairKind;
use crate::scene::Scene;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::pair_numbers;
use crate::search::found::KeysByKind;
use crate::search::sink::reserve;
use crate::search::stats::Stats;

/// Compressed sparse rows: the neighbours of element `i` are `indices[offsets[i]..offsets[i + 1]]`,
/// ascending.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Csr {
    /// Where the list of each element starts, and the end of the last one: one more than there are
    /// elements.
    pub offsets: Vec<u64>,
    /// The neighbours.
    pub indices: Vec<u32>,
    /// How far away each is, in the unit of the scene, rounded down: below the distance by at most
    /// 2^-20 of it, or a few times the smallest `f64`; and 0 if and only if they touch or are as
    /// near as that.
    pub distances: Vec<f64>,
}

impl Csr {
    /// The neighbours of an element, and their distances.
    ///
    /// # Panics
    /// There is no such element.
    pub fn of(&self, element: usize) -> impl ExactSizeIterator<Item = (u32, f64)> + '_ {
        let range = self.offsets[element] as usize..self.offsets[element + 1] as usize;
        let indices = self.indices[range.clone()].iter().copied();
        indices.zip(self.distances[range].iter().copied())
    }

    fn clear(&mut self) {
        self.offsets.clear();
        self.indices.clear();
        self.distances.clear();
    }

    /// Makes rows of entries `(row, column, distance)`, which are gone through twice and keep their
    /// order within a row.
    fn fill(
        &mut self,
        n_rows: usize,
        entries: impl Iterator<Item = (u32, u32, f64)> + Clone,
    ) -> Result<(), Error> {
        const WHAT: &str = "neighbours";
        reserve(&mut self.offsets, n_rows + 1, WHAT)?;
        // Counted one place later, so that the second pass can move each row's start to its end.
        self.offsets.resize(n_rows + 1, 0);
        let mut n = 0;
        for (row, _, _) in entries.clone() {
            n += 1;
            if let Some(count) = self.offsets.get_mut(row as usize + 2) {
                *count += 1;
            }
        }
        for row in 2..=n_rows {
            self.offsets[row] += self.offsets[row - 1];
        }
        reserve(&mut self.indices, n, WHAT)?;
        reserve(&mut self.distances, n, WHAT)?;
        self.indices.resize(n, 0);
        self.distances.resize(n, 0.0);
        for (row, column, distance) in entries {
            let at = &mut self.offsets[row as usize + 1];
            (self.indices[*at as usize], self.distances[*at as usize]) = (column, distance);
            *at += 1;
        }
        Ok(())
    }

    fn bytes(&self) -> usize {
        8 * self.offsets.capacity() + 4 * self.indices.capacity() + 8 * self.distances.capacity()
    }
}

/// Which elements are near each element: see [`Detector::neighbours`](crate::Detector::neighbours).
///
/// The vertices of all bodies are numbered one after another in the order of the bodies, whether
/// the query is about a body or not, and so are the edges and the faces:
/// [`first`](Neighbours::first).
#[derive(Clone, Default)]
pub struct Neighbours {
    /// The first vertex, edge and face of each body.
    bodies: Vec<(BodyId, [u32; 3])>,
    /// By kind: of the elements that the kind names first, and of the others.
    lists: [[Csr; 2]; PairKind::ALL.len()],
    n_pairs: usize,
    stats: Stats,
    /// Where its buffers go when it is dropped.
    home: Home<Neighbours>,
}

gives_back!(Neighbours);

/// The parts in the order of [`Neighbours::bodies`].
const PARTS: [Part; 3] = [Part::Vertices, Part::Edges, Part::Faces];

fn place(part: Part) -> usize {
    PARTS.iter().position(|&of| of == part).unwrap_or(0)
}

impl Neighbours {
    pub(crate) fn begin(&mut self) {
        self.bodies.clear();
        self.lists.iter_mut().flatten().for_each(Csr::clear);
        self.n_pairs = 0;
        self.stats.clear();
    }

    pub(crate) fn stats_mut(&mut self) -> &mut Stats {
        &mut self.stats
    }

    /// Takes sorted keys with the distances of their pairs.
    ///
    /// # Errors
    /// There is no memory for the lists.
    pub(crate) fn fill(
        &mut self,
        (scene, plan): (&Scene, &Plan),
        keys: &KeysByKind,
        distances: &[Vec<f64>; PairKind::ALL.len()],
    ) -> Result<(), Error> {
        let mut n = [0u64; 3];
        for (id, body) in scene.bodies() {
            self.bodies.push((id, n.map(|n| n as u32)));
            n[0] += body.n_vertices() as u64;
            n[1] += body.edges().len() as u64;
            n[2] += body.faces().len() as u64;
        }
        for (given, what) in n.into_iter().zip(["vertices", "edges", "faces"]) {
            let limit = u64::from(u32::MAX);
            if given > limit {
                return Err(Error::TooMany { what, given, limit });
            }
        }
        // What turns a number of the plan into one of the lists.
        let shifts: Vec<u32> = plan
            .parts
            .iter()
            .map(|part| {
                let first = self.first(part.id, part.part).unwrap_or(0);
                first.wrapping_sub(part.first.raw())
            })
            .collect();
        let number = |number| {
            let (part, _) = plan.locate(number);
            number.raw().wrapping_add(shifts[part.index()])
        };
        let lists = self.lists.iter_mut().zip(keys.iter().zip(distances));
        for (kind, ([own, others], (keys, distances))) in PairKind::ALL.into_iter().zip(lists) {
            let pairs = keys.iter().zip(distances).map(|(&key, &distance)| {
                let [a, b] = pair_numbers(key).map(number);
                (a, b, distance)
            });
            let turned = pairs.clone().map(|(a, b, distance)| (b, a, distance));
            let [a, b] = kind.parts();
            let [rows, columns] = [a, b].map(|part| n[place(part)] as usize);
            if a == b {
                // Listed at both: first the lower neighbours of each element, then the higher ones.
                own.fill(rows, turned.chain(pairs))?;
            } else {
                own.fill(rows, pairs)?;
                others.fill(columns, turned)?;
            }
            self.n_pairs += keys.len();
        }
        Ok(())
    }

    /// Bytes of the answer.
    pub(crate) fn bytes(&self) -> u64 {
        let bodies = size_of::<(BodyId, [u32; 3])>() * self.bodies.capacity();
        let lists: usize = self.lists.iter().flatten().map(Csr::bytes).sum();
        (bodies + lists) as u64
    }

    /// The number of the first vertex, edge or face of a body in the lists; `None` if the body was
    /// not in the scene, or for [`Part::Given`].
    pub fn first(&self, body: BodyId, part: Part) -> Option<u32> {
        let ix = self.bodies.binary_search_by_key(&body, |of| of.0).ok()?;
        let place = PARTS.iter().position(|&of| of == part)?;
        Some(self.bodies[ix].1[place])
    }

    /// All bodies of the scene, when it was asked about.
    pub fn bodies(&self) -> impl Iterator<Item = BodyId> + '_ {
        self.bodies.iter().map(|of| of.0)
    }

    /// How many pairs are near: each is in two lists.
    pub fn len(&self) -> usize {
        self.n_pairs
    }

    /// Whether no pair is.
    pub fn is_empty(&self) -> bool {
        self.n_pairs == 0
    }

    /// The lists of the elements that a kind names first: of [`PairKind::VertexFace`], the faces
    /// near each vertex. Where both are of the same kind, each pair is in the lists of both
    /// elements.
    pub fn of(&self, kind: PairKind) -> &Csr {
        &self.lists[kind as usize][0]
    }

    /// The lists of the elements that a kind names second: of [`PairKind::VertexFace`], the
    /// vertices near each face.
    pub fn reversed(&self, kind: PairKind) -> &Csr {
        let [a, b] = kind.parts();
        &self.lists[kind as usize][usize::from(a != b)]
    }

    /// The faces near each vertex.
    pub fn vf(&self) -> &Csr {
        self.of(PairKind::VertexFace)
    }

    /// The vertices near each face.
    pub fn fv(&self) -> &Csr {
        self.reversed(PairKind::VertexFace)
    }

    /// The edges near each edge.
    pub fn ee(&self) -> &Csr {
        self.of(PairKind::EdgeEdge)
    }

    /// How the answer was found.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }
}

impl std::fmt::Debug for Neighbours {
    /// How many pairs there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("Neighbours");
        short.field("len", &self.len());
        short.finish_non_exhaustive()
    }
}
