//! Questions about a step, in which bodies move on straight lines from their positions to their end positions.

use crate::error::Error;
use crate::pair_kind::{PairKind, PairKinds};
use crate::query::Query;

/// What happens to pairs that touch at the start of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Start {
    /// They are reported with the time 0.
    #[default]
    Report,
    /// They are not reported, whatever they do later in the step.
    Skip,
}

/// The precision to which times are rounded down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Toi {
    /// The largest `f32` that is not above the first time.
    #[default]
    F32,
    /// The largest `f64` that is not above the first time.
    F64,
}

impl Toi {
    /// The time of a contact in this precision, as an `f64`.
    pub(crate) fn round(self, contact: &crate::exact::Contact) -> f64 {
        match self {
            Toi::F32 => f64::from(contact.time_f32()),
            Toi::F64 => contact.time,
        }
    }
}

/// The question about a step: which bodies, and what is reported.
///
/// Pairs of one body that share a vertex are never reported, whatever the query's adjacency rule.
///
/// ```
/// use impinge::{Query, Start, Step, Toi};
/// let step = Step::new(Query::everything()).start(Start::Skip).toi(Toi::F64);
/// assert_eq!(Step::default(), Step::new(Query::everything()));
/// # let _ = step;
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    pub(crate) query: Query,
    pub(crate) start: Start,
    pub(crate) toi: Toi,
    pub(crate) separation: f64,
}

impl Step {
    /// A step of the bodies of a query.
    pub fn new(query: Query) -> Self {
        Step {
            query,
            start: Start::default(),
            toi: Toi::default(),
            separation: 0.0,
        }
    }

    /// Sets what happens to pairs that touch at the start.
    pub fn start(mut self, start: Start) -> Self {
        self.start = start;
        self
    }

    /// Sets the precision to which times are rounded down.
    pub fn toi(mut self, toi: Toi) -> Self {
        self.toi = toi;
        self
    }

    /// Sets the distance that elements must keep, in the unit of the scene: finite, 0 or more.
    ///
    /// A pair is then reported with the first time at which its distance is at most the separation, decided exactly and
    /// rounded down, and pairs within the separation at the start count as touching at the start. With 0, which is the
    /// default, elements must touch.
    pub fn separation(mut self, separation: f64) -> Self {
        self.separation = separation;
        self
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        check_distance("separation", self.separation)
    }
}

impl Default for Step {
    /// Pairs of different bodies and of one body, all together.
    fn default() -> Self {
        Step::new(Query::everything())
    }
}

impl From<Query> for Step {
    fn from(query: Query) -> Self {
        Step::new(query)
    }
}

/// The question which pairs of elements are candidates for a test of the caller's own.
///
/// Two elements are candidates when their boxes over the whole step, each inflated by `distance` on all sides, overlap
/// (closed): no axis has a gap of more than twice the distance. This is decided exactly. Pairs of one body that share a
/// vertex are never candidates.
#[derive(Debug, Clone, PartialEq)]
pub struct CandidateQuery {
    pub(crate) query: Query,
    pub(crate) kinds: PairKinds,
    pub(crate) distance: f64,
}

impl CandidateQuery {
    /// Candidates of the bodies of a query: vertices with faces and edges with edges, at distance 0.
    pub fn new(query: Query) -> Self {
        CandidateQuery {
            query,
            kinds: [PairKind::VertexFace, PairKind::EdgeEdge]
                .into_iter()
                .collect(),
            distance: 0.0,
        }
    }

    /// Sets the kinds of pairs.
    pub fn kinds(mut self, kinds: impl IntoIterator<Item = PairKind>) -> Self {
        self.kinds = kinds.into_iter().collect();
        self
    }

    /// Sets by how much boxes are inflated on all sides: 0 or more.
    pub fn distance(mut self, distance: f64) -> Self {
        self.distance = distance;
        self
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        check_distance("distance", self.distance)
    }
}

/// Refuses a distance that is negative or not finite.
pub(crate) fn check_distance(setting: &'static str, distance: f64) -> Result<(), Error> {
    if distance >= 0.0 && distance.is_finite() {
        return Ok(());
    }
    Err(Error::Setting {
        setting,
        given: distance.to_string(),
        allowed: "a finite number that is not below 0",
    })
}
