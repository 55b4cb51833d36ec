//! What is asked about pairs of elements, and of which parts of bodies.

use std::ops::Range;

use crate::boxes::Sweep;
use crate::query::pair_kind::PairKind;
use crate::scene::Filter;
use crate::scene::elements::{BodyKind, Part};
use crate::scene::ids::BodyId;
use crate::scene::index::{ElementIx, Number};

/// One part of one body that takes part in a frame.
#[derive(Debug, Clone, Copy)]
pub struct QueryPart {
    /// The body.
    pub id: BodyId,
    /// Which of its elements.
    pub part: Part,
    /// Global number of its first element.
    pub first: Number,
    /// How many numbers its elements take up. Vertices are numbered as positions are, whether they
    /// take part or not.
    pub n_elements: u32,
    /// The kind of its elements.
    pub kind: BodyKind,
    /// Whether its self-collision is queried.
    pub within: bool,
    /// Of the numbers of its elements.
    pub(crate) numbers_stamp: u64,
    /// Of the positions of the body.
    pub(crate) positions_stamp: u64,
    /// Whether the body has no faces.
    pub(crate) is_bare: bool,
    /// Whether the body has no edges either.
    pub(crate) is_points: bool,
    pub(super) filter: Filter,
    /// How thick the body is: what its elements add to the distance that is asked; the most of
    /// them, where each has its own.
    pub(super) thickness: f64,
    /// How far vertices may be from their ways, because positions on these are rounded.
    pub(super) rounded: f64,
}

impl QueryPart {
    /// The global number of an element.
    #[inline(always)]
    pub fn number(&self, element: ElementIx) -> Number {
        self.first.plus(element)
    }

    /// The element that has a global number.
    #[inline(always)]
    pub fn element(&self, number: Number) -> ElementIx {
        number.minus(self.first)
    }

    /// The global numbers of its elements.
    pub fn numbers(&self) -> Range<Number> {
        self.first..self.number(ElementIx::new(self.n_elements))
    }
}

/// The question about pairs of elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Question {
    /// Whether elements that bodies were given as share a point.
    #[default]
    Intersection,
    /// Whether and when vertices, edges and faces first touch during a step, or come as near as
    /// they may.
    Contact,
    /// Which vertices, edges and faces are within a distance, at the positions that bodies have.
    Nearness,
    /// Which vertices, edges and faces have boxes that overlap during a step.
    Overlap,
}

impl Question {
    /// The parts of bodies that take part, in the order of their parts. In this order, the lower
    /// number of a pair belongs to the element that its kind names first: edges come before
    /// vertices, and vertices before faces.
    pub(super) fn parts(self) -> &'static [Part] {
        match self {
            Question::Intersection => &[Part::Given],
            Question::Contact | Question::Nearness | Question::Overlap => {
                &[Part::Edges, Part::Vertices, Part::Faces]
            }
        }
    }

    /// What of a step is examined.
    pub(super) fn sweep(self) -> Sweep {
        match self {
            Question::Intersection | Question::Nearness => Sweep::STILL,
            Question::Contact => Sweep::WHOLE,
            Question::Overlap => Sweep {
                is_swept: true,
                ..Sweep::WHOLE
            },
        }
    }
}

/// The test of a pair of elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TestId {
    /// Whether the elements that bodies were given as share a point.
    Intersection,
    /// The question about vertices, edges and faces.
    Elements(PairKind),
}
