//! Kinds of pairs of moving elements.

/// A pair of elements by their kinds, with the order of its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ElementPair {
    /// Points 0 and 1: one vertex each.
    VertexVertex,
    /// Point 0 is the vertex, points 1 and 2 are the edge.
    VertexEdge,
    /// Point 0 is the vertex, points 1, 2 and 3 are the face.
    VertexFace,
    /// Points 0 and 1 are one edge, points 2 and 3 the other.
    EdgeEdge,
}

impl ElementPair {
    /// How many points the two elements have together. Further points are ignored.
    #[inline]
    #[must_use]
    pub fn n_points(self) -> usize {
        match self {
            Self::VertexVertex => 2,
            Self::VertexEdge => 3,
            Self::VertexFace | Self::EdgeEdge => 4,
        }
    }

    /// How many of the points are the first element's.
    #[inline]
    #[must_use]
    pub fn n_first(self) -> usize {
        match self {
            Self::VertexVertex | Self::VertexEdge | Self::VertexFace => 1,
            Self::EdgeEdge => 2,
        }
    }

    /// The corners of the difference polygon, in cyclic order: which point minus which.
    pub(crate) fn corners(self) -> &'static [[usize; 2]] {
        match self {
            Self::VertexVertex => &[[1, 0]],
            Self::VertexEdge => &[[1, 0], [2, 0]],
            Self::VertexFace => &[[1, 0], [2, 0], [3, 0]],
            Self::EdgeEdge => &[[0, 2], [1, 2], [1, 3], [0, 3]],
        }
    }
}
