//! Features of elements, and the parts of the difference polygon that they are.

use crate::element_pair::ElementPair;

/// A feature of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Feature {
    /// A vertex of the element, by its number in the element.
    Vertex(u8),
    /// An edge: edge k of a face goes from vertex k to the next. An edge itself is its edge 0.
    Edge(u8),
    /// The face.
    Face,
}

/// The nearest features of two elements: those whose relative interiors contain the nearest points.
///
/// A nearest point on the border of a feature belongs to the smaller feature. Where there are
/// several nearest points (of parallel edges or flat elements), the first of the smallest features
/// counts, in the order of ipc-toolkit's names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct NearestFeatures {
    /// The feature of the first element.
    pub a: Feature,
    /// The feature of the second element.
    pub b: Feature,
    /// Whether the edges are parallel (or one is a point), or the face is degenerate. There may
    /// then be other nearest points.
    pub is_parallel: bool,
}

impl NearestFeatures {
    /// ipc-toolkit's name of the distance type: `P_T`, `P_E0`, `P_T0`; `EA_EB`, `EA_EB0`,
    /// `EA0_EB1`; for a vertex and an edge `P_E`, `P_E0`, `P_E1`; for two vertices `P_P`.
    #[must_use]
    pub fn name(&self, pair: ElementPair) -> &'static str {
        use Feature::{Edge, Vertex};
        let pick = |names: [&'static str; 3], ix: u8| names[usize::from(ix) % 3];
        match (pair, self.a, self.b) {
            (ElementPair::VertexVertex, ..) => "P_P",
            (ElementPair::VertexEdge, _, Vertex(ix)) => pick(["P_E0", "P_E1", ""], ix),
            (ElementPair::VertexEdge, ..) => "P_E",
            (ElementPair::VertexFace, _, Vertex(ix)) => pick(["P_T0", "P_T1", "P_T2"], ix),
            (ElementPair::VertexFace, _, Edge(ix)) => pick(["P_E0", "P_E1", "P_E2"], ix),
            (ElementPair::VertexFace, ..) => "P_T",
            (ElementPair::EdgeEdge, Vertex(0), Vertex(ix)) => pick(["EA0_EB0", "EA0_EB1", ""], ix),
            (ElementPair::EdgeEdge, Vertex(_), Vertex(ix)) => pick(["EA1_EB0", "EA1_EB1", ""], ix),
            (ElementPair::EdgeEdge, _, Vertex(ix)) => pick(["EA_EB0", "EA_EB1", ""], ix),
            (ElementPair::EdgeEdge, Vertex(ix), _) => pick(["EA0_EB", "EA1_EB", ""], ix),
            (ElementPair::EdgeEdge, ..) => "EA_EB",
        }
    }
}

/// A part of the difference polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PolygonPart {
    Face,
    /// From this corner to the next.
    Edge(usize),
    Corner(usize),
}

impl PolygonPart {
    /// The part with a number: corner i is i, edge i is 4 + i, the face is 8.
    #[inline]
    pub(super) fn numbered(number: u8) -> Option<Self> {
        let ix = usize::from(number);
        match ix {
            0..4 => Some(Self::Corner(ix)),
            4..8 => Some(Self::Edge(ix - 4)),
            8 => Some(Self::Face),
            _ => None,
        }
    }

    /// The features whose difference the part is.
    pub(super) fn named(self, pair: ElementPair, is_flat: bool) -> NearestFeatures {
        use Feature::{Edge, Face, Vertex};
        let number = |ix: usize| u8::try_from(ix).unwrap_or(0);
        let (a, b) = match (pair, self) {
            (ElementPair::EdgeEdge, Self::Face) => (Edge(0), Edge(0)),
            (ElementPair::EdgeEdge, Self::Edge(ix)) => [
                (Edge(0), Vertex(0)),
                (Vertex(1), Edge(0)),
                (Edge(0), Vertex(1)),
                (Vertex(0), Edge(0)),
            ][ix],
            (ElementPair::EdgeEdge, Self::Corner(ix)) => [
                (Vertex(0), Vertex(0)),
                (Vertex(1), Vertex(0)),
                (Vertex(1), Vertex(1)),
                (Vertex(0), Vertex(1)),
            ][ix],
            (_, Self::Face) => (Vertex(0), Face),
            (_, Self::Edge(ix)) => (Vertex(0), Edge(number(ix))),
            (_, Self::Corner(ix)) => (Vertex(0), Vertex(number(ix))),
        };
        NearestFeatures {
            a,
            b,
            is_parallel: is_flat,
        }
    }
}
