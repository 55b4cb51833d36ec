//! The answer which elements are near each element: lists, as compressed sparse rows.

use std::ops::Range;

use crate::answers::home::{Home, gives_back};
use crate::bvh::bounds::round_down;
use crate::plan::{Plan, QueryPart};
use crate::query::pair_kind::PairKind;
use crate::scene::Scene;
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::search::found::KeysByKind;
use crate::search::sink::reserve;
use crate::search::stats::Stats;
use crate::search::work::Work;
use crate::workers::alone::is_alone;

/// Pairs that a task takes.
const TASK: usize = 1 << 13;

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
    /// How far away each is, minus the thickness of both, in the unit of the scene, rounded down:
    /// by at most 2^-20 of it, or by 2^-1045; 0 if and only if they touch, or are at most as far
    /// apart as they are thick, or farther by no more than 2^-1045.
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

    /// The distances in single precision, rounded down once more: also 0 where they are below the
    /// smallest `f32`.
    pub fn distances_f32(&self) -> impl ExactSizeIterator<Item = f32> + '_ {
        self.distances.iter().map(|&distance| round_down(distance))
    }

    /// Makes rows of sorted pairs with their distances: a row for one side or for each, with the
    /// other one as the column. Within a row, columns of `by` come in that order. Each task makes
    /// some rows.
    fn fill(
        &mut self,
        n_rows: usize,
        (pairs, distances): (&[u64], &[f64]),
        by: &[By],
        work: Work<'_>,
    ) -> Result<(), Error> {
        let n = by.len() * pairs.len();
        fit(&mut self.offsets, n_rows + 1)?;
        fit(&mut self.indices, n)?;
        fit(&mut self.distances, n)?;
        self.offsets.fill(0);
        if n == 0 {
            return Ok(());
        }
        let n_tasks = n.div_ceil(work.workers.task(TASK)).min(work.workers.n());
        // Counted one place later, so that the second pass can move each row's start to its end.
        let n_each = n_rows.div_ceil(n_tasks);
        let counts = &mut self.offsets[2..];
        let count = |first: usize, counts: &mut [u64]| {
            let rows = first..first + counts.len();
            for by in by {
                by.each(&rows, pairs, |row, _, _| counts[row - first] += 1);
            }
        };
        if is_alone() || n_tasks == 1 {
            count(0, counts);
        } else {
            let mut tasks: Vec<_> = counts.chunks_mut(n_each).collect();
            work.each(&mut tasks, |task, counts| {
                count(task * n_each, counts);
                Ok(())
            })?;
        }
        for row in 2..=n_rows {
            self.offsets[row] += self.offsets[row - 1];
        }
        let place = |rows: &mut Rows<'_>| {
            let Rows {
                first,
                before,
                starts,
                indices,
                distances: into,
            } = rows;
            for by in by {
                let rows = *first..*first + starts.len();
                by.each(&rows, pairs, |row, column, ix| {
                    let next = &mut starts[row - *first];
                    let at = *next as usize - *before;
                    (indices[at], into[at]) = (column, distances[ix]);
                    *next += 1;
                });
            }
        };
        let mut rest = Rows {
            first: 0,
            before: 0,
            starts: &mut self.offsets[1..],
            indices: &mut self.indices,
            distances: &mut self.distances,
        };
        if is_alone() || n_tasks == 1 {
            place(&mut rest);
            return Ok(());
        }
        let mut tasks = Vec::with_capacity(n_tasks);
        for task in 1..n_tasks {
            let own;
            (own, rest) = rest.split_before(n as u64 * task as u64 / n_tasks as u64);
            tasks.push(own);
        }
        tasks.push(rest);
        work.each(&mut tasks, |_, rows| {
            place(rows);
            Ok(())
        })
    }

    fn bytes(&self) -> usize {
        8 * self.offsets.capacity() + 4 * self.indices.capacity() + 8 * self.distances.capacity()
    }
}

/// Some rows that are being filled.
struct Rows<'a> {
    first: usize,
    /// Entries of the rows before.
    before: usize,
    starts: &'a mut [u64],
    indices: &'a mut [u32],
    distances: &'a mut [f64],
}

impl Rows<'_> {
    /// The rows that start before an entry, and the others.
    fn split_before(self, entry: u64) -> (Self, Self) {
        let n = self.starts.partition_point(|&start| start < entry);
        let (starts, later) = self.starts.split_at_mut(n);
        let n_own = match later.first() {
            Some(&start) => start as usize - self.before,
            None => self.indices.len(),
        };
        let (indices, later_indices) = self.indices.split_at_mut(n_own);
        let (distances, later_distances) = self.distances.split_at_mut(n_own);
        let own = Rows {
            starts,
            indices,
            distances,
            ..self
        };
        let rest = Rows {
            first: self.first + n,
            before: self.before + n_own,
            starts: later,
            indices: later_indices,
            distances: later_distances,
        };
        (own, rest)
    }
}

/// Gives a list a length, whatever it then holds.
fn fit<T: Copy + Default>(list: &mut Vec<T>, n: usize) -> Result<(), Error> {
    reserve(list, n.saturating_sub(list.len()), "neighbours")?;
    list.resize(n, T::default());
    Ok(())
}

/// Which side of a pair has the row.
#[derive(Debug, Clone, Copy)]
enum By {
    First,
    Second,
}

impl By {
    /// Tells of the pairs with some rows: the row, the column, and which pair it is. Pairs are
    /// sorted.
    #[inline(always)]
    fn each(self, rows: &Range<usize>, pairs: &[u64], mut tell: impl FnMut(usize, u32, usize)) {
        match self {
            By::First => {
                let [first, end] = [rows.start, rows.end]
                    .map(|row| pairs.partition_point(|pair| (pair >> 32) < row as u64));
                for (ix, &pair) in (first..).zip(&pairs[first..end]) {
                    tell((pair >> 32) as usize, pair as u32, ix);
                }
            }
            By::Second => {
                for (ix, &pair) in pairs.iter().enumerate() {
                    let row = pair as u32 as usize;
                    if rows.contains(&row) {
                        tell(row, (pair >> 32) as u32, ix);
                    }
                }
            }
        }
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
    /// How many vertices, edges and faces all bodies have.
    n_elements: [usize; 3],
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
        // Lists are overwritten as a whole.
        self.n_pairs = 0;
        self.stats.clear();
    }

    pub(crate) fn stats_mut(&mut self) -> &mut Stats {
        &mut self.stats
    }

    /// Numbers the elements of all bodies. Returns the number of the first element of each part of
    /// the plan, whose parts are in the same order.
    ///
    /// # Errors
    /// There are too many.
    pub(crate) fn number(&mut self, scene: &Scene, plan: &Plan) -> Result<Vec<u32>, Error> {
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
        self.n_elements = n.map(|n| n as usize);
        let first = |part: &QueryPart| self.first(part.id, part.part).unwrap_or(0);
        Ok(plan.parts.iter().map(first).collect())
    }

    /// Takes sorted pairs of numbers, the first one in the upper half, with their distances.
    ///
    /// # Errors
    /// There is no memory for the lists; cancellation.
    pub(crate) fn fill(
        &mut self,
        pairs: &KeysByKind,
        distances: &[Vec<f64>; PairKind::ALL.len()],
        work: Work<'_>,
    ) -> Result<(), Error> {
        let lists = self.lists.iter_mut().zip(pairs.iter().zip(distances));
        for (kind, ([own, others], (pairs, distances))) in PairKind::ALL.into_iter().zip(lists) {
            let pairs = (&pairs[..], &distances[..]);
            let [a, b] = kind.parts();
            let [rows, columns] = [a, b].map(|part| self.n_elements[place(part)]);
            if a == b {
                // Listed at both: first the lower neighbours of each element, then the higher ones.
                own.fill(rows, pairs, &[By::Second, By::First], work)?;
            } else {
                own.fill(rows, pairs, &[By::First], work)?;
                others.fill(columns, pairs, &[By::Second], work)?;
            }
            self.n_pairs += pairs.0.len();
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
