//! The problems of each element, for pictures.

use serde_json::{Value, json};

/// One kind of problem of an element, in the order in which pictures show them: the first that
/// applies gives the colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Problem {
    /// Shares more points with another element than their common vertices, edge or face.
    #[serde(rename = "self-intersections")]
    SelfIntersection,
    /// Has the same vertices as an earlier element.
    #[serde(rename = "duplicates")]
    Duplicate,
    /// Has an edge (a tetrahedron: a face) of more than two elements.
    NonManifold,
    /// Has an edge (a tetrahedron: a face) whose other element has the opposite orientation.
    #[serde(rename = "orientation")]
    Inconsistent,
    /// Is of a closed piece whose faces point inward, or, around a cavity, outward: those that
    /// [`Repair::Outward`](crate::Repair::Outward) turns.
    InsideOut,
    /// Has zero area (a tetrahedron: zero volume).
    Degenerate,
    /// Has an edge of no other triangle. Not used for tetrahedra, which always have a border.
    Boundary,
    /// Is a side of a wall that is thinner than [was asked](crate::Options::min_thickness).
    Thin,
}

impl Problem {
    /// All problems, the most serious first.
    pub const ALL: [Problem; 8] = [
        Problem::SelfIntersection,
        Problem::Duplicate,
        Problem::NonManifold,
        Problem::Inconsistent,
        Problem::InsideOut,
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
            Problem::InsideOut => [140, 86, 75],
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
            Problem::InsideOut => "brown",
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
            Problem::InsideOut => "inside-out",
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
            Problem::InsideOut => "inside out",
            Problem::Degenerate => "degenerate",
            Problem::Boundary => "open border",
            Problem::Thin => "thin wall",
        }
    }
}

/// The problems of one element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Marks(u8);

impl Marks {
    pub(crate) fn add(&mut self, problem: Problem) {
        self.0 |= problem.bit();
    }

    /// Whether the element has the problem.
    pub fn has(self, problem: Problem) -> bool {
        self.0 & problem.bit() != 0
    }

    /// The most serious problem, if there is any.
    pub fn first(self) -> Option<Problem> {
        Problem::ALL.into_iter().find(|&problem| self.has(problem))
    }
}

/// The marks of all elements of a mesh, as runs of elements with the same problems; most
/// elements have none and are left out.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MarkRuns(Vec<(u32, u32, Marks)>);

impl MarkRuns {
    pub(crate) fn new(marks: &[Marks]) -> Self {
        let mut first = 0;
        let runs = marks.chunk_by(|a, b| a == b).map(|run| {
            let n = run.len() as u32;
            first += n;
            (first - n, n, run[0])
        });
        MarkRuns(runs.filter(|run| run.2 != Marks::default()).collect())
    }

    /// The marks of `n` elements; `None` if there are marks of later ones.
    pub(crate) fn marks(&self, n: usize) -> Option<Vec<Marks>> {
        let mut marks = vec![Marks::default(); n];
        for &(first, n, run) in &self.0 {
            let end = (first as usize).checked_add(n as usize)?;
            marks.get_mut(first as usize..end)?.fill(run);
        }
        Some(marks)
    }

    pub(crate) fn to_json(&self) -> Value {
        let runs = self.0.iter();
        runs.map(|&(first, n, marks)| json!([first, n, marks.0]))
            .collect()
    }

    pub(crate) fn from_json(value: &Value) -> Option<Self> {
        let run = |value: &Value| {
            let number = |ix: usize| u32::try_from(value.get(ix)?.as_u64()?).ok();
            Some((
                number(0)?,
                number(1)?,
                Marks(u8::try_from(number(2)?).ok()?),
            ))
        };
        let runs = value.as_array()?.iter().map(run);
        Some(MarkRuns(runs.collect::<Option<_>>()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_survive_json_and_give_all_marks_back() {
        let marks: Vec<Marks> = [0, 0, 3, 3, 3, 0, 1, 64].map(Marks).to_vec();
        let runs = MarkRuns::new(&marks);
        assert_eq!(runs.to_json().to_string(), "[[2,3,3],[6,1,1],[7,1,64]]");
        assert_eq!(MarkRuns::from_json(&runs.to_json()), Some(runs.clone()));
        assert_eq!(runs.marks(marks.len()), Some(marks));
        // Another mesh than the one that was checked.
        assert_eq!(runs.marks(7), None);
        assert_eq!(MarkRuns::from_json(&json!([[0, 1, 256]])), None);
    }
}
