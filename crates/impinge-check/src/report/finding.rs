//! What can be wrong with a mesh, as a run names and counts it.

use std::fmt;
use std::str::FromStr;

use crate::marks::Problem;
use crate::row::{Counts, ErrorKind, Row};
use crate::text::several;

/// One kind of finding of a mesh: what a run counts and may fail on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Finding {
    /// Pairs that also meet outside their common vertices, edge or face.
    SelfIntersections,
    /// Elements of zero area or volume.
    Degenerate,
    /// Elements with the vertices of an earlier one.
    Duplicates,
    /// Edges of more than two triangles, vertices of several fans.
    NonManifold,
    /// Neighbours with opposite orientations.
    Orientation,
    /// Closed pieces whose faces point inward, or, around a cavity, outward.
    InsideOut,
    /// Edges of only one triangle.
    Boundary,
    /// Walls that are thinner than [was asked](crate::Options::min_thickness).
    Thin,
    /// Coordinates that are NaN or infinite.
    Nan,
    /// The mesh could not be checked, whatever the reason.
    Error,
}

impl Finding {
    /// All kinds, in the order of a summary.
    pub const ALL: [Finding; 10] = [
        Finding::SelfIntersections,
        Finding::Degenerate,
        Finding::Duplicates,
        Finding::NonManifold,
        Finding::Orientation,
        Finding::InsideOut,
        Finding::Boundary,
        Finding::Thin,
        Finding::Nan,
        Finding::Error,
    ];

    /// The name: that of the [problem](Problem::key), `nan` or `error`.
    pub fn name(self) -> &'static str {
        match (self.problem(), self) {
            (Some(problem), _) => problem.key(),
            (None, Finding::Nan) => "nan",
            (None, _) => "error",
        }
    }

    /// The words for it in a sentence: "3 with …".
    pub fn words(self) -> &'static str {
        match self {
            Finding::SelfIntersections => "self-intersections",
            Finding::Degenerate => "degenerate elements",
            Finding::Duplicates => "duplicate elements",
            Finding::NonManifold => "non-manifold edges or vertices",
            Finding::Boundary => "an open border",
            Finding::Orientation => "inconsistent orientation",
            Finding::InsideOut => "faces inside out",
            Finding::Thin => "thin walls",
            Finding::Nan => "coordinates that are not finite",
            Finding::Error => "an error",
        }
    }

    /// The problem of elements that it counts; `None` where it is one of the whole mesh.
    pub fn problem(self) -> Option<Problem> {
        match self {
            Finding::SelfIntersections => Some(Problem::SelfIntersection),
            Finding::Degenerate => Some(Problem::Degenerate),
            Finding::Duplicates => Some(Problem::Duplicate),
            Finding::NonManifold => Some(Problem::NonManifold),
            Finding::Orientation => Some(Problem::Inconsistent),
            Finding::InsideOut => Some(Problem::InsideOut),
            Finding::Boundary => Some(Problem::Boundary),
            Finding::Thin => Some(Problem::Thin),
            Finding::Nan | Finding::Error => None,
        }
    }

    /// Whether a mesh has it.
    pub fn is_in(self, row: &Row) -> bool {
        match (&row.result, self) {
            (Err(failure), Finding::Nan) => failure.kind == ErrorKind::NotFinite,
            (Err(_), _) => self == Finding::Error,
            (Ok(counts), _) => self.count(counts) > 0,
        }
    }

    /// How many of them a mesh has.
    pub fn count(self, counts: &Counts) -> u64 {
        match self {
            Finding::SelfIntersections => counts.self_intersections,
            Finding::Degenerate => counts.degenerate,
            Finding::Duplicates => counts.duplicates,
            Finding::NonManifold => counts.non_manifold_facets + counts.non_manifold_vertices,
            Finding::Orientation => counts.inconsistent_facets,
            // Rows of earlier versions have the volume alone.
            Finding::InsideOut => {
                let is_negative = counts.volume.is_some_and(|volume| volume < 0.0);
                counts.inside_out.unwrap_or(is_negative.into())
            }
            // Meshes of tetrahedra always have a border.
            Finding::Boundary if counts.n_tetrahedra > 0 => 0,
            Finding::Boundary => counts.boundary_facets,
            Finding::Thin => counts.thin_faces.unwrap_or(0),
            Finding::Nan | Finding::Error => 0,
        }
    }

    /// What is wrong with a mesh that has it, and near which point, in a line.
    pub(super) fn message(self, row: &Row) -> String {
        let counts = match &row.result {
            Ok(counts) => counts,
            Err(failure) => return failure.message.clone(),
        };
        let said = self.said(counts);
        let mut places = row.places.iter();
        match places.find(|place| Some(place.problem) == self.problem()) {
            None => said,
            Some(place) => {
                let [x, y, z] = place.point;
                format!("{said}, near ({x}, {y}, {z})")
            }
        }
    }

    fn said(self, counts: &Counts) -> String {
        let [facet, facets] = match counts.n_tetrahedra {
            0 => ["edge", "edges"],
            _ => ["face", "faces"],
        };
        let n = self.count(counts);
        match self {
            Finding::SelfIntersections => several(
                n,
                "pair of elements intersects",
                "pairs of elements intersect",
            ),
            Finding::Degenerate => several(n, "degenerate element", "degenerate elements"),
            Finding::Duplicates => several(n, "duplicate element", "duplicate elements"),
            Finding::NonManifold => {
                let facets = several(counts.non_manifold_facets, facet, facets);
                let vertices = several(counts.non_manifold_vertices, "vertex", "vertices");
                format!("not manifold: {facets}, {vertices}")
            }
            Finding::Boundary => format!("open border of {}", several(n, facet, facets)),
            Finding::Orientation => {
                let facets = several(n, facet, facets);
                format!("inconsistent orientation at {facets}")
            }
            Finding::InsideOut => {
                several(n, "closed surface inside out", "closed surfaces inside out")
            }
            Finding::Thin => several(n, "face at a thin wall", "faces at thin walls"),
            Finding::Nan | Finding::Error => self.words().to_owned(),
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Finding {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut all = Finding::ALL.into_iter();
        all.find(|finding| finding.name() == text).ok_or_else(|| {
            format!(
                "{text:?} is none of {}",
                Finding::ALL.map(Finding::name).join(", ")
            )
        })
    }
}
