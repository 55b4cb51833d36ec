//! The problems of each primitive, for pictures.

/// One kind of problem of a primitive, in the order in which pictures show them: the first that
/// applies gives the colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Problem {
    /// Shares more points with another primitive than their common vertices, edge or face.
    SelfIntersection,
    /// Has the same vertices as an earlier primitive.
    Duplicate,
    /// Has an edge (a tetrahedron: a face) of more than two primitives.
    NonManifold,
    /// Has an edge (a tetrahedron: a face) whose other primitive has the opposite orientation.
    Inconsistent,
    /// Has zero area (a tetrahedron: zero volume).
    Degenerate,
    /// Has an edge of no other triangle. Not used for tetrahedra, which always have a border.
    Boundary,
    /// Is a side of a wall that is thinner than [was asked](crate::Options::min_thickness).
    Thin,
}

impl Problem {
    /// All problems, the most serious first.
    pub const ALL: [Problem; 7] = [
        Problem::SelfIntersection,
        Problem::Duplicate,
        Problem::NonManifold,
        Problem::Inconsistent,
        Problem::Degenerate,
        Problem::Boundary,
        Problem::Thin,
    ];

    fn bit(self) -> u8 {
        1 << self as u8
    }

    /// The problem's colour in pictures, sRGB.
    pub fn color(self) -> [u8; 3] {
        match self {
            Problem::SelfIntersection => [214, 39, 40],
            Problem::Duplicate => [255, 127, 14],
            Problem::NonManifold => [148, 103, 189],
            Problem::Inconsistent => [188, 189, 34],
            Problem::Degenerate => [227, 119, 194],
            Problem::Boundary => [27, 95, 217],
            Problem::Thin => [23, 190, 207],
        }
    }

    /// The name of the problem's colour, for a legend.
    pub fn color_name(self) -> &'static str {
        match self {
            Problem::SelfIntersection => "red",
            Problem::Duplicate => "orange",
            Problem::NonManifold => "purple",
            Problem::Inconsistent => "olive",
            Problem::Degenerate => "pink",
            Problem::Boundary => "blue",
            Problem::Thin => "cyan",
        }
    }

    /// The problem's name in rows, and in the program's `--fail-on`.
    pub fn key(self) -> &'static str {
        match self {
            Problem::SelfIntersection => "self-intersections",
            Problem::Duplicate => "duplicates",
            Problem::NonManifold => "non-manifold",
            Problem::Inconsistent => "orientation",
            Problem::Degenerate => "degenerate",
            Problem::Boundary => "boundary",
            Problem::Thin => "thin",
        }
    }

    /// The problem's name in a legend.
    pub fn name(self) -> &'static str {
        match self {
            Problem::SelfIntersection => "self-intersection",
            Problem::Duplicate => "duplicate",
            Problem::NonManifold => "non-manifold",
            Problem::Inconsistent => "inconsistent orientation",
            Problem::Degenerate => "degenerate",
            Problem::Boundary => "open border",
            Problem::Thin => "thin wall",
        }
    }
}

/// The problems of one primitive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Marks(u8);

impl Marks {
    pub(crate) fn add(&mut self, problem: Problem) {
        self.0 |= problem.bit();
    }

    /// Whether the primitive has the problem.
    pub fn has(self, problem: Problem) -> bool {
        self.0 & problem.bit() != 0
    }

    /// The most serious problem, if there is any.
    pub fn first(self) -> Option<Problem> {
        Problem::ALL.into_iter().find(|&problem| self.has(problem))
    }
}
