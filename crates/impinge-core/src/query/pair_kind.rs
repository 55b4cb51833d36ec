//! Kinds of pairs of elements.

use crate::scene::elements::Part;
use crate::scene::words::words;
use impinge_exact::internal::NearestOfElements;
use impinge_exact::{ElementPair, Feature};

/// The kinds of a pair's elements. A pair's `a` is the element that the kind names first. So a
/// vertex and a face are always in this order, whatever their bodies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PairKind {
    /// A vertex and a face.
    VertexFace,
    /// Two edges.
    EdgeEdge,
    /// An edge and a vertex.
    EdgeVertex,
    /// Two vertices.
    VertexVertex,
    /// An edge and a face.
    EdgeFace,
    /// Two faces.
    FaceFace,
}

words!("kinds", "vf, ee, ev, vv, ef or ff", PairKind: [
    VertexFace = "vf", EdgeEdge = "ee", EdgeVertex = "ev", VertexVertex = "vv", EdgeFace = "ef", FaceFace = "ff"; 6
]);

impl PairKind {
    /// The parts of bodies that the elements belong to, in the order of the name.
    ///
    /// ```
    /// use impinge::{PairKind, Part};
    /// assert_eq!(PairKind::VertexFace.parts(), [Part::Vertices, Part::Faces]);
    /// ```
    pub fn parts(self) -> [Part; 2] {
        use Part::{Edges, Faces, Vertices};
        match self {
            PairKind::VertexFace => [Vertices, Faces],
            PairKind::EdgeEdge => [Edges, Edges],
            PairKind::EdgeVertex => [Edges, Vertices],
            PairKind::VertexVertex => [Vertices, Vertices],
            PairKind::EdgeFace => [Edges, Faces],
            PairKind::FaceFace => [Faces, Faces],
        }
    }

    /// ipc-toolkit's name of a pair of this kind with these features.
    pub(crate) fn named(self, features: [Feature; 2]) -> &'static str {
        let pair = match self {
            PairKind::VertexFace => Some((ElementPair::VertexFace, false)),
            PairKind::EdgeEdge => Some((ElementPair::EdgeEdge, false)),
            // The edge is named first.
            PairKind::EdgeVertex => Some((ElementPair::VertexEdge, true)),
            PairKind::VertexVertex => Some((ElementPair::VertexVertex, false)),
            PairKind::EdgeFace | PairKind::FaceFace => None,
        };
        let nearest = NearestOfElements {
            features,
            is_parallel: false,
        };
        nearest.name(pair)
    }

    /// The kind of a pair of elements of two parts.
    pub(crate) fn of(a: Part, b: Part) -> Option<PairKind> {
        use Part::{Edges, Faces, Vertices};
        match (a, b) {
            (Vertices, Faces) | (Faces, Vertices) => Some(PairKind::VertexFace),
            (Edges, Edges) => Some(PairKind::EdgeEdge),
            (Edges, Vertices) | (Vertices, Edges) => Some(PairKind::EdgeVertex),
            (Vertices, Vertices) => Some(PairKind::VertexVertex),
            (Edges, Faces) | (Faces, Edges) => Some(PairKind::EdgeFace),
            (Faces, Faces) => Some(PairKind::FaceFace),
            (Part::Given, _) | (_, Part::Given) => None,
        }
    }
}

/// A set of kinds of pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PairKinds(u8);

impl PairKinds {
    /// All six kinds.
    pub const ALL: PairKinds = PairKinds(0b11_1111);

    /// A bit per kind, in the order of [`PairKind::ALL`].
    #[cfg(feature = "gpu")]
    pub(crate) fn bits(self) -> u32 {
        self.0.into()
    }

    /// Whether the set contains a kind.
    pub fn contains(self, kind: PairKind) -> bool {
        self.0 >> kind as u8 & 1 == 1
    }
}

impl FromIterator<PairKind> for PairKinds {
    fn from_iter<I: IntoIterator<Item = PairKind>>(kinds: I) -> Self {
        let bits = kinds.into_iter().map(|kind| 1 << kind as u8);
        PairKinds(bits.fold(0, std::ops::BitOr::bitor))
    }
}
