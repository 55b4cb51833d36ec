//! The query for pairs within a distance.

use std::collections::BTreeMap;

use crate::query::Query;
use crate::query::pair_kind::{PairKind, PairKinds};
use crate::scene::ids::BodyId;

/// Which pairs of elements are near: of which bodies, of which kinds, and within which distance.
///
/// Two elements are near when their Euclidean distance is at most `distance` plus the thickness of both bodies; of two
/// elements of one body, twice its thickness. The sum is that of real numbers: nothing is rounded. Pairs of one body that
/// share a vertex are left out.
///
/// An edge and a face ([`PairKind::EdgeFace`]) are reported if and only if they meet, whatever the distance: their distance is 0. If
/// they do not meet but are near, then so are the edge and an edge of the face, or an end of the edge and the face, and these pairs
/// say it: with each of them repeated, answers would have three times as many pairs.
///
/// ```
/// use impinge::{NearQuery, PairKind, Query};
/// let query = NearQuery::new(Query::everything()).distance(0.01).closest_points();
/// let faces = NearQuery::new(Query::all()).kinds([PairKind::FaceFace]);
/// assert_ne!(query, faces);
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct NearQuery {
    pub(crate) query: Query,
    pub(crate) kinds: Option<PairKinds>,
    pub(crate) distance: f64,
    pub(crate) thickness: BTreeMap<BodyId, f64>,
    pub(crate) distances: bool,
    pub(crate) closest: bool,
}

impl NearQuery {
    /// Of the bodies of a query, with a distance of 0: elements that touch.
    pub fn new(query: Query) -> Self {
        NearQuery {
            query,
            kinds: None,
            distance: 0.0,
            thickness: BTreeMap::new(),
            distances: false,
            closest: false,
        }
    }

    /// Which kinds of pairs. If this is not said: vertices and faces, edges and edges, edges that meet faces; where bodies are made
    /// of edges or points alone also edges and vertices, vertices and vertices. Any two elements that are near have such a pair among
    /// their parts, so bodies are at least the distance apart if there are none, and neighbours that fold onto each other have one too.
    /// Only faces with the same three vertices, and a body inside tetrahedra, have none: [`Detector::any`](crate::Detector::any)
    /// finds these.
    pub fn kinds(mut self, kinds: impl IntoIterator<Item = PairKind>) -> Self {
        self.kinds = Some(kinds.into_iter().collect());
        self
    }

    /// The distance, in the unit of the scene: finite, 0 or more.
    pub fn distance(mut self, distance: f64) -> Self {
        self.distance = distance;
        self
    }

    /// How thick a body is: what its elements add to the distance. Finite, 0 or more; 0 if this is not said.
    pub fn thickness(mut self, body: BodyId, thickness: f64) -> Self {
        self.thickness.insert(body, thickness);
        self
    }

    /// Asks for distances as `f64`, too: [`NearPair::distance`](crate::NearPair::distance), 8 bytes per pair.
    pub fn distances(mut self) -> Self {
        self.distances = true;
        self
    }

    /// Asks for distances and nearest points as `f64`, too: [`NearPair::closest`](crate::NearPair::closest), 56 bytes per pair.
    pub fn closest_points(mut self) -> Self {
        (self.distances, self.closest) = (true, true);
        self
    }
}

impl From<Query> for NearQuery {
    fn from(query: Query) -> Self {
        NearQuery::new(query)
    }
}
