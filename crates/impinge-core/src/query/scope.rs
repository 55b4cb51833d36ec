//! Queries: which bodies, and what a shared vertex means.

use std::collections::BTreeSet;

use crate::scene::ids::BodyId;

/// How pairs of one body that share vertices are treated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum SharedVertex {
    /// Pairs that share a vertex index are not reported.
    Skip,
    /// The default: they are reported when they meet in more than the parts that they share. Triangles: sharing one
    /// vertex, when the edge opposite it in one meets the other triangle; sharing an edge, when
    /// they are coplanar and fold to the same side; sharing all three, always. Tetrahedra: when
    /// the intersection is larger than the common vertex, edge or face. Edges and points of one body
    /// that share a vertex are not reported under either rule.
    #[default]
    Resolve,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    Between(BodyId, BodyId),
    Within(BodyId),
    /// Pairs of one of [`Query::across`] and another body.
    Across,
    /// All bodies: pairs of different bodies, pairs within one, or both.
    All {
        between: bool,
        within: bool,
    },
}

/// A half-open box of space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cell {
    pub low: [f64; 3],
    pub high: [f64; 3],
}

impl Cell {
    pub fn holds(&self, point: [f64; 3]) -> bool {
        (0..3).all(|axis| self.low[axis] <= point[axis] && point[axis] < self.high[axis])
    }
}

/// The question put to a scene.
///
/// ```
/// use impinge::{Query, SharedVertex};
/// let query = Query::everything().shared_vertex(SharedVertex::Skip);
/// assert_ne!(query, Query::everything());
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Query {
    pub(crate) scope: Scope,
    pub(crate) shared_vertex: SharedVertex,
    pub(crate) ignored: BTreeSet<(BodyId, BodyId)>,
    pub(crate) cell: Option<Cell>,
    /// Only of [`Scope::Across`].
    pub(crate) across: BTreeSet<BodyId>,
}

impl Query {
    fn new(scope: Scope) -> Self {
        Query {
            scope,
            shared_vertex: SharedVertex::default(),
            ignored: BTreeSet::new(),
            cell: None,
            across: BTreeSet::new(),
        }
    }

    /// Pairs between two bodies. Named explicitly, they meet whatever their filters say.
    pub fn between(a: BodyId, b: BodyId) -> Self {
        Query::new(Scope::Between(a, b))
    }

    /// Pairs of different bodies, for all bodies whose [`Filter`](crate::Filter)s let them meet.
    pub fn all() -> Self {
        Query::new(Scope::All {
            between: true,
            within: false,
        })
    }

    /// Self-collision of one body.
    pub fn within(body: BodyId) -> Self {
        Query::new(Scope::Within(body))
    }

    /// Self-collision of every body.
    pub fn all_within() -> Self {
        Query::new(Scope::All {
            between: false,
            within: true,
        })
    }

    /// Pairs of different bodies and of one body, all together.
    pub fn everything() -> Self {
        Query::new(Scope::All {
            between: true,
            within: true,
        })
    }

    /// Pairs of one of some bodies and one that is not among them. As those of [`between`](Query::between), they meet whatever
    /// their filters say.
    pub fn across(bodies: impl IntoIterator<Item = BodyId>) -> Self {
        Query {
            across: bodies.into_iter().collect(),
            ..Query::new(Scope::Across)
        }
    }

    /// The adjacency rule of self-collision: [`SharedVertex::Resolve`], unless it is said. Vertices are shared when their
    /// indices are equal: positions that coincide count once they are welded.
    pub fn shared_vertex(mut self, rule: SharedVertex) -> Self {
        self.shared_vertex = rule;
        self
    }

    /// Leaves out the pairs of these two bodies; with `a == b`, the self-collision of `a`.
    pub fn ignore(mut self, a: BodyId, b: BodyId) -> Self {
        self.ignored.insert((a.min(b), a.max(b)));
        self
    }

    /// Only the pairs that belong to the half-open box `[low, high)`: for programs that cut space into cells themselves, such
    /// as MPI codes. A pair belongs to the cell that holds the larger of the lower corners of its two bounding boxes,
    /// axis by axis. So if each process has all primitives whose boxes touch its cell, and the cells cover space without
    /// overlap, each pair of the whole is found by exactly one process. Bounds may be infinite.
    ///
    /// For a step, boxes hold their elements from the start to the end. If pairs at a distance count as well, a process
    /// needs all elements whose boxes touch its cell when they are inflated, on all sides, by that distance: the
    /// separation of a step, the distance of a [`NearQuery`](crate::NearQuery) with both bodies' thickness, twice the distance of a
    /// [`CandidateQuery`](crate::CandidateQuery).
    ///
    /// All intersections of the query are found and held first: [`Settings::max_pairs`](crate::Settings::max_pairs) and the memory
    /// budget count them, also those of [`Detector::count`](crate::Detector::count); [`Detector::any`](crate::Detector::any) does not
    /// stop early, and has no limit of pairs. Steps and distances hold only the pairs of the cell.
    /// [`Detector::advance`](crate::Detector::advance) and frames that stay on a device refuse a cell, and so does every question if a
    /// lower bound is above the upper one.
    ///
    /// ```
    /// use impinge::Query;
    /// let left = Query::everything().owned_by([f64::NEG_INFINITY; 3], [0.0, f64::INFINITY, f64::INFINITY]);
    /// ```
    pub fn owned_by(mut self, low: [f64; 3], high: [f64; 3]) -> Self {
        self.cell = Some(Cell { low, high });
        self
    }
}
