//! What a question about a step needs besides: what counts at the start, how exact times are, what
//! a step leaves, which pairs may collide.

use std::fmt;
use std::sync::Arc;

#[cfg(doc)]
use crate::query::pair_kind::PairKind;
use crate::scene::error::{Error, shown};
use crate::scene::ids::BodyId;
use crate::scene::words::words;

/// What happens to pairs that touch at the start of a step, and whether the start is asked for
/// intersections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Start {
    /// They are reported with the time 0. Surfaces that already pass through each other need not
    /// touch at all: an edge inside a face, or a body inside another, has no contact until it comes
    /// to a border.
    #[default]
    Report,
    /// They are not reported, whatever they do later in the step.
    Skip,
    /// As `Report`, and the start is asked for intersections:
    /// [`Detector::any`](crate::Detector::any) of the same bodies, with
    /// [`SharedVertex::Resolve`](crate::SharedVertex::Resolve). If there are any,
    /// [`is_free`](crate::Detector::is_free) is false and [`advance`](crate::Detector::advance)
    /// allows no step; [`Impacts::start_intersects`](crate::Impacts::start_intersects) and
    /// [`Advance::start_intersects`](crate::Advance::start_intersects) say so, and after any of
    /// these questions and [`earliest`](crate::Detector::earliest),
    /// [`Detector::start_intersects`](crate::Detector::start_intersects).
    Verify,
}

words!("start", "report, skip or verify", Start: [Report = "report", Skip = "skip", Verify = "verify"; 3]);

/// What is asked of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Hit {
    /// What each ray hits first: at the smallest parameter, of several the lowest by body and then
    /// by number.
    #[default]
    First,
    /// Whether each ray hits anything.
    Any,
    /// All that each ray hits.
    All,
}

words!("hits", "first, any or all", Hit: [First = "first", Any = "any", All = "all"; 3]);

/// The precision to which times are rounded down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Precision {
    /// The largest `f32` that is not above the first time.
    #[default]
    F32,
    /// The largest `f64` that is not above the first time.
    F64,
}

words!("precision", "f32 or f64", Precision: [F32 = "f32", F64 = "f64"; 2]);

impl Precision {
    /// The time of a contact in this precision, as an `f64`.
    pub(crate) fn round(self, contact: &impinge_exact::Contact) -> f64 {
        match self {
            Precision::F32 => f64::from(contact.time_f32()),
            Precision::F64 => contact.time,
        }
    }
}

/// What a step leaves between elements: a distance, but of pairs that are near at the start only a
/// share of theirs.
#[derive(Debug, Clone, Copy, PartialEq)]
#[must_use]
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

    /// Sets the share of its distance at the start that a pair keeps at most: from 0, which keeps
    /// nothing (in [`advance`](crate::Detector::advance) what rounding takes), to less than 1.
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

/// Which pairs of elements may collide, as a function of their vertices. Threads call it at the
/// same time.
#[derive(Clone)]
#[must_use]
pub struct PairFilter {
    passes: Arc<PairPasses>,
    is_early: bool,
}

type PairPasses = dyn Fn([ElementVertices<'_>; 2]) -> bool + Send + Sync;

impl PairFilter {
    /// A filter that lets the pairs pass for which a function is true. For one pair it must always
    /// say the same. The first element is the one that the [kind](PairKind) of the pair names
    /// first.
    pub fn new(passes: impl Fn([ElementVertices<'_>; 2]) -> bool + Send + Sync + 'static) -> Self {
        PairFilter {
            passes: Arc::new(passes),
            is_early: false,
        }
    }

    /// Says that the function costs little: it is then asked before distances and times, about all
    /// pairs that boxes and the first filters leave.
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

/// Refuses a distance that is negative or not finite.
pub(crate) fn check_distance(setting: &'static str, distance: f64) -> Result<(), Error> {
    if distance >= 0.0 && distance.is_finite() {
        return Ok(());
    }
    Err(Error::Setting {
        setting,
        given: shown(distance),
        allowed: "a finite number that is not below 0",
    })
}
