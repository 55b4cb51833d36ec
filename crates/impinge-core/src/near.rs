//! What is asked of elements that are near each other, and the answer.

use std::collections::BTreeMap;

use crate::error::Error;
use crate::exact::{Feature, NearestOfElements};
use crate::frame::{Ask, Frame};
use crate::ids::BodyId;
use crate::impacts::{Numbering, row};
use crate::pair_kind::{PairKind, PairKinds};
use crate::pairs::{Primitive, hash_row, mix};
use crate::query::Query;
use crate::scene::Scene;
use crate::stats::Statistics;
use crate::step::check_distance;

/// Which pairs of elements are near: of which bodies, of which kinds, and within which distance.
///
/// Two elements are near when their Euclidean distance is at most `distance` plus the thickness of both bodies; of two
/// elements of one body, twice its thickness. The sum is that of real numbers: nothing is rounded. Pairs of one body that
/// share a vertex are left out.
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
    kinds: Option<PairKinds>,
    distance: f64,
    thickness: BTreeMap<BodyId, f64>,
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
            closest: false,
        }
    }

    /// Which kinds of pairs. If this is not said: vertices and faces, edges and edges; where bodies are made of edges or
    /// points alone also edges and vertices, vertices and vertices. Any two elements that are near have such a pair among
    /// their parts, unless an edge passes through the inside of a face.
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

    /// Asks for distances and nearest points as `f64`, too: [`NearPair::closest`].
    pub fn closest_points(mut self) -> Self {
        self.closest = true;
        self
    }

    /// Resolves the query.
    pub(crate) fn resolve(&self, scene: &Scene, frame: &mut Frame) -> Result<(), Error> {
        let numbers = self.thickness.values().map(|&number| ("thickness", number));
        for (setting, number) in numbers.chain([("distance", self.distance)]) {
            check_distance(setting, number)?;
        }
        for &body in self.thickness.keys() {
            scene.body(body)?;
        }
        let ask = match self.kinds {
            Some(kinds) => Ask::Candidates(kinds),
            None => Ask::Impacts,
        };
        frame.resolve_for(scene, &self.query, ask)?;
        frame.stand_still();
        frame.set_reach(self.distance, &self.thickness);
        Ok(())
    }
}

impl From<Query> for NearQuery {
    fn from(query: Query) -> Self {
        NearQuery::new(query)
    }
}

/// Two elements that are near each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearPair {
    /// What they are.
    pub kind: PairKind,
    /// The element that the kind names first, numbered as in [`Impact::a`](crate::Impact::a).
    pub a: Primitive,
    /// The other element. Where both are of the same kind, it is of a body with a higher id, or the higher element.
    pub b: Primitive,
    /// The features of `a` and of `b` that are nearest to each other, decided exactly: those with the nearest points
    /// in their inside. Of several at the same distance, the first of the smallest.
    pub features: [Feature; 2],
    /// Whether nearest points may not be the only ones: edges are parallel, or an element is degenerate, or faces are
    /// parallel.
    pub is_parallel: bool,
    name: &'static str,
    /// Distance and nearest points, where [`NearQuery::closest_points`] asks for them.
    pub closest: Option<ClosestPoints>,
}

/// Nearest points of two elements and their distance, rounded.
///
/// They are computed from exact quotients in one order of operations, so they have the same bits on every machine. Whether
/// a pair is near is decided exactly, not by these numbers: a distance may be rounded to a number above the one asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPoints {
    /// The distance, wrong by a few units in the last place at most. 0 for elements that touch.
    pub distance: f64,
    /// A point of `a` and one of `b`, x, y, z each.
    pub points: [[f64; 3]; 2],
}

impl NearPair {
    /// The row `[body_a, element_a, body_b, element_b]`, with bodies by their [`index`](BodyId::index).
    pub fn row(&self) -> [u32; 4] {
        row(self.a, self.b)
    }

    /// ipc-toolkit's name of the distance type: `P_T`, `P_E0`, `P_T0` of a vertex and a face; `EA_EB`, `EA_EB0`, `EA0_EB1`
    /// of edges; `P_E`, `P_E0`, `P_E1` of an edge and a vertex; `P_P` of vertices. Of an edge and a face, or of faces, the
    /// kinds of the features: `P_P`, `P_E`, `P_T`, `E_E`, and `E_T` where an edge passes through a face.
    pub fn name(&self) -> &'static str {
        self.name
    }
}

/// All pairs of elements that are near, sorted by `(kind, body_a, element_a, body_b, element_b)`.
///
/// The same input gives the same bytes on every method, backend, thread count and budget.
#[derive(Debug, Clone, Default)]
pub struct NearPairs {
    numbering: Numbering,
    pairs: Vec<NearPair>,
    stats: Statistics,
}

impl NearPairs {
    /// Takes over the frame's numbering.
    pub(crate) fn begin(&mut self, frame: &Frame) {
        self.numbering.begin(frame);
        self.pairs.clear();
        self.stats.clear();
    }

    pub(crate) fn stats_mut(&mut self) -> &mut Statistics {
        &mut self.stats
    }

    /// Names what was found of one kind, in the order of the keys; the elements' features follow. Kinds come in their
    /// order.
    pub(crate) fn extend(&mut self, kind: PairKind, keys: impl Iterator<Item = u64>) {
        let numbering = &self.numbering;
        self.pairs.extend(keys.map(|key| {
            let (a, b) = numbering.pair(key);
            NearPair {
                kind,
                a,
                b,
                features: [Feature::Face; 2],
                is_parallel: false,
                name: "",
                closest: None,
            }
        }));
    }

    /// Bytes of the answer.
    pub(crate) fn bytes(&self) -> u64 {
        (size_of::<NearPair>() * self.pairs.capacity()) as u64
    }

    pub(crate) fn pairs_mut(&mut self) -> &mut [NearPair] {
        &mut self.pairs
    }

    /// How many pairs are near.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Whether no pair is.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// All of them, sorted.
    pub fn as_slice(&self) -> &[NearPair] {
        &self.pairs
    }

    /// All of them, sorted.
    pub fn iter(&self) -> std::slice::Iter<'_, NearPair> {
        self.pairs.iter()
    }

    /// Those of one kind.
    pub fn of(&self, kind: PairKind) -> &[NearPair] {
        let start = self.pairs.partition_point(|pair| pair.kind < kind);
        let end = self.pairs.partition_point(|pair| pair.kind <= kind);
        &self.pairs[start..end]
    }

    /// A hash of the set of pairs and their features that does not depend on their order: the wrapping sum of a mixed
    /// 64-bit word per pair. Distances and points are not part of it.
    pub fn hash(&self) -> u64 {
        self.pairs.iter().fold(0, |sum, pair| {
            let [a, b] = pair.features.map(|feature| match feature {
                Feature::Vertex(ix) => u64::from(ix),
                Feature::Edge(ix) => 8 + u64::from(ix),
                Feature::Face => 16,
            });
            let word = pair.kind as u64 | a << 8 | b << 16 | u64::from(pair.is_parallel) << 24;
            sum.wrapping_add(mix(hash_row(pair.row()) ^ mix(word)))
        })
    }

    /// How the answer was found.
    pub fn stats(&self) -> &Statistics {
        &self.stats
    }
}

impl NearPair {
    pub(crate) fn set_nearest(&mut self, nearest: &NearestOfElements) {
        self.features = nearest.features;
        self.is_parallel = nearest.is_parallel;
        self.name = nearest.name;
    }
}

impl<'a> IntoIterator for &'a NearPairs {
    type Item = &'a NearPair;
    type IntoIter = std::slice::Iter<'a, NearPair>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
