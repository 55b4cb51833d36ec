//! Questions about a step, in which bodies move on straight lines from their positions to their end positions.

use std::fmt;
use std::sync::Arc;

use crate::query::Query;
use crate::query::pair_kind::{PairKind, PairKinds};
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use impinge_exact::internal::Keep;

/// What happens to pairs that touch at the start of a step, and whether the start is asked for intersections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Start {
    /// They are reported with the time 0. Surfaces that already pass through each other need not touch at all: an edge inside
    /// a face, or a body inside another, has no contact until it comes to a border.
    #[default]
    Report,
    /// They are not reported, whatever they do later in the step.
    Skip,
    /// As `Report`, and the start is asked for intersections: [`Detector::any`](crate::Detector::any) of the same bodies, with
    /// [`SharedVertex::Resolve`](crate::SharedVertex::Resolve). If there are any, [`is_free`](crate::Detector::is_free) is false
    /// and [`advance`](crate::Detector::advance) allows no step; [`Impacts::start_intersects`](crate::Impacts::start_intersects)
    /// and [`Advance::start_intersects`](crate::Advance::start_intersects) say so, and after any of these questions and
    /// [`earliest`](crate::Detector::earliest), [`Detector::start_intersects`](crate::Detector::start_intersects).
    Verify,
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
    pub(crate) fn round(self, contact: &impinge_exact::Contact) -> f64 {
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
    pub(crate) clearance: Clearance,
    pub(crate) filter: Option<PairFilter>,
}

impl Step {
    /// A step of the bodies of a query.
    pub fn new(query: Query) -> Self {
        Step {
            query,
            start: Start::default(),
            toi: Toi::default(),
            separation: 0.0,
            clearance: Clearance::new(0.0),
            filter: None,
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

    /// Sets what a step leaves between elements, in the unit of the scene: finite, 0 or more.
    ///
    /// A pair whose distance at the start is d keeps `separation + min(clearance, share (d - separation))`, with a
    /// [share](Clearance::share) of 0.2 by default: it counts as in contact at the first time at which its distance is at most that.
    /// Such contacts are not at the start; pairs within the separation at the start count as touching there, as they do without a
    /// clearance. All of this is decided exactly; d - separation is rounded up to 24 bits first.
    ///
    /// So a chain of steps comes as near to contact as it likes, but never stops just short of it, where barriers are endless. With
    /// a clearance of 1e-4 this is what ipc-toolkit's `conservative_rescaling = 0.8` does.
    ///
    /// ```
    /// use impinge::{Clearance, Step};
    /// let step = Step::default().clearance(1e-4);
    /// assert_eq!(step, Step::default().clearance(Clearance::new(1e-4).share(0.2)));
    /// ```
    pub fn clearance(mut self, clearance: impl Into<Clearance>) -> Self {
        self.clearance = clearance.into();
        self
    }

    /// Leaves out the pairs that a filter refuses. It is asked about pairs that are in contact, or might be as far as floats can tell;
    /// an [early](PairFilter::early) one sooner.
    pub fn filter(mut self, filter: PairFilter) -> Self {
        self.filter = Some(filter);
        self
    }

    /// What pairs keep.
    pub(crate) fn keep(&self) -> Keep {
        Keep {
            separation: self.separation,
            clearance: self.clearance.distance,
            share: self.clearance.share,
            is_rounded: false,
        }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        check_distance("separation", self.separation)?;
        check_distance("clearance", self.clearance.distance)?;
        match (0.0..1.0).contains(&self.clearance.share) {
            true => Ok(()),
            false => Err(Error::Setting {
                setting: "clearance_share",
                given: self.clearance.share.to_string(),
                allowed: "a number from 0 to less than 1",
            }),
        }
    }
}

/// What a step leaves between elements: a distance, but of pairs that are near at the start only a share of theirs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clearance {
    pub(crate) distance: f64,
    pub(crate) share: f64,
}

impl Clearance {
    /// A distance in the unit of the scene, and a share of 0.2.
    pub fn new(distance: f64) -> Self {
        Clearance {
            distance,
            share: 0.2,
        }
    }

    /// Sets the share of its distance at the start that a pair keeps at most: from 0, which keeps nothing, to less than 1.
    pub fn share(mut self, share: f64) -> Self {
        self.share = share;
        self
    }
}

impl From<f64> for Clearance {
    fn from(distance: f64) -> Self {
        Clearance::new(distance)
    }
}

/// The vertices of an element, and their body.
pub type ElementVertices<'a> = (BodyId, &'a [u32]);

/// Which pairs of elements may collide, as a function of their vertices. Threads call it at the same time.
#[derive(Clone)]
pub struct PairFilter {
    passes: Arc<Passes>,
    is_early: bool,
}

type Passes = dyn Fn([ElementVertices<'_>; 2]) -> bool + Send + Sync;

impl PairFilter {
    /// A filter that lets the pairs pass for which a function is true. For one pair it must always say the same. The first element is
    /// the one that the [kind](PairKind) of the pair names first.
    pub fn new(passes: impl Fn([ElementVertices<'_>; 2]) -> bool + Send + Sync + 'static) -> Self {
        PairFilter {
            passes: Arc::new(passes),
            is_early: false,
        }
    }

    /// Says that the function costs little: it is then asked before distances and times, about all pairs that boxes and the first
    /// filters leave.
    pub fn early(mut self) -> Self {
        self.is_early = true;
        self
    }

    pub(crate) fn is_early(&self) -> bool {
        self.is_early
    }

    pub(crate) fn passes(&self, pair: [ElementVertices<'_>; 2]) -> bool {
        (self.passes)(pair)
    }
}

impl fmt::Debug for PairFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("PairFilter")
    }
}

/// Whether they are one filter, or clones of one.
impl PartialEq for PairFilter {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.passes, &other.passes)
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
