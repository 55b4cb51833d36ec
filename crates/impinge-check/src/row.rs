//! One row per mesh. It is printed, stored and sent between processes as a line of JSON.

use serde_json::{Map, Value, json};

use crate::marks::MarkRuns;
use crate::places::Place;

/// The counts of one mesh. Facets are edges of triangles and faces of tetrahedra.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Counts {
    /// Vertices, as in the file.
    pub n_vertices: u64,
    /// Vertices removed by welding: they had exactly the position of another vertex.
    pub n_welded: u64,
    /// Triangles; 0 for a mesh of tetrahedra.
    pub n_triangles: u64,
    /// Tetrahedra; 0 for a mesh of triangles.
    pub n_tetrahedra: u64,
    /// Pairs of primitives that share more points than their common vertices, edge or face
    /// ([`SharedVertex::Resolve`](impinge::SharedVertex::Resolve)).
    pub self_intersections: u64,
    /// Primitives in any such pair.
    pub n_intersecting: u64,
    /// [`Pairs::hash`](impinge::Pairs::hash) of these pairs. `None` if they are more than 2^32, and
    /// many of them of primitives with the same vertices: such pairs are counted without being
    /// listed.
    pub hash: Option<u64>,
    /// Primitives of exactly zero area, or volume.
    pub degenerate: u64,
    /// Primitives with the vertices of an earlier one, in any order.
    pub duplicates: u64,
    /// Facets of more than two primitives.
    pub non_manifold_facets: u64,
    /// Vertices around which the primitives form more than one fan.
    pub non_manifold_vertices: u64,
    /// Facets of only one primitive.
    pub boundary_facets: u64,
    /// Connected pieces of the border: holes, for most surfaces.
    pub boundaries: u64,
    /// Facets of two primitives with opposite orientations.
    pub inconsistent_facets: u64,
    /// Pieces connected through facets. Primitives that name a vertex twice belong to none.
    pub components: u64,
    /// Vertices of no primitive, counted after welding.
    pub unused_vertices: u64,
    /// Whether every edge belongs to exactly two triangles; `None` for tetrahedra.
    pub is_watertight: Option<bool>,
    /// The volume that the triangles enclose, rounded once, negative if they are inside out. `None`
    /// unless they are watertight and of one orientation, and if it is larger than any `f64`. Of a
    /// surface that intersects itself, each part of space counts as often as the surface winds
    /// around it.
    pub volume: Option<f64>,
    /// Euler's characteristic V - E + F of the triangles, without vertices of no triangle and
    /// triangles that name a vertex twice; `None` for tetrahedra.
    pub euler: Option<i64>,
    /// Faces at walls that are at most as thick as [was asked](crate::Options::min_thickness).
    /// `None` if nothing was asked, or if the mesh has no closed piece of one orientation.
    pub thin_faces: Option<u64>,
    /// The thickness of the thinnest of these walls, rounded down; `None` if there is none.
    pub thinnest: Option<f64>,
    /// The thickness that was asked for.
    pub min_thickness: Option<f64>,
}

/// Why a mesh has no counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ErrorKind {
    /// The file can't be read: missing, damaged, of an unknown format, without primitives.
    File,
    /// A coordinate is NaN or infinite.
    NotFinite,
    /// The library refuses the content.
    Refused,
    /// The time limit was reached.
    Timeout,
    /// The memory limit was reached.
    Memory,
    /// The child process ended without an answer.
    Crash,
}

impl ErrorKind {
    const ALL: [ErrorKind; 6] = [
        ErrorKind::File,
        ErrorKind::NotFinite,
        ErrorKind::Refused,
        ErrorKind::Timeout,
        ErrorKind::Memory,
        ErrorKind::Crash,
    ];

    /// The name in a row: `file`, `not_finite`, `refused`, `timeout`, `memory` or `crash`.
    pub fn name(self) -> &'static str {
        match self {
            ErrorKind::File => "file",
            ErrorKind::NotFinite => "not_finite",
            ErrorKind::Refused => "refused",
            ErrorKind::Timeout => "timeout",
            ErrorKind::Memory => "memory",
            ErrorKind::Crash => "crash",
        }
    }

    /// Whether another attempt, with other limits or on another machine, may succeed.
    pub fn may_pass(self) -> bool {
        matches!(
            self,
            ErrorKind::Timeout | ErrorKind::Memory | ErrorKind::Crash
        )
    }
}

/// A mesh that could not be checked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// The kind of failure.
    pub kind: ErrorKind,
    /// A message of one line.
    pub message: String,
}

/// The result for one mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The file, as it was named.
    pub path: String,
    /// Whether vertices at one position were welded first.
    pub is_welded: bool,
    /// The counts, or why there are none.
    pub result: Result<Counts, Failure>,
    /// Where the problems are: see [`Options::places`](crate::Options::places).
    pub places: Vec<Place>,
    /// Which problems each primitive has: see [`Options::marks`](crate::Options::marks). Not part of
    /// the [object](Self::to_json).
    pub marks: Option<MarkRuns>,
}

impl Row {
    /// The row of a mesh that could not be checked.
    pub fn failed(path: &str, is_welded: bool, kind: ErrorKind, message: &str) -> Self {
        let lines = message
            .lines()
            .map(str::trim)
            .filter(|line| !line.is_empty());
        Row {
            path: path.to_owned(),
            is_welded,
            result: Err(Failure {
                kind,
                message: lines.collect::<Vec<_>>().join("; "),
            }),
            places: Vec::new(),
            marks: None,
        }
    }

    /// The row as an object. The keys are the same for every mesh. Counts that do not apply are
    /// `null`: all counts of a mesh with an `error`, and the counts of edges of a mesh of
    /// tetrahedra, which has counts of faces instead.
    pub fn to_json(&self) -> Value {
        let counts = self.result.as_ref().ok();
        let number = |get: fn(&Counts) -> u64| counts.map(get);
        let is_solid = counts.is_some_and(|counts| counts.n_tetrahedra > 0);
        let of_kind =
            |solid: bool, get: fn(&Counts) -> u64| counts.filter(|_| is_solid == solid).map(get);
        let mut object = Map::new();
        let mut put = |key: &str, value: Value| object.insert(key.to_owned(), value);
        put("path", json!(self.path));
        put("welded", json!(self.is_welded));
        put("vertices", json!(number(|c| c.n_vertices)));
        put("vertices_welded", json!(number(|c| c.n_welded)));
        put("triangles", json!(number(|c| c.n_triangles)));
        put("tetrahedra", json!(number(|c| c.n_tetrahedra)));
        put(
            "self_intersections",
            json!(number(|c| c.self_intersections)),
        );
        put(
            "intersecting_primitives",
            json!(number(|c| c.n_intersecting)),
        );
        let hash = counts.and_then(|counts| counts.hash);
        put("hash", json!(hash.map(|hash| format!("{hash:016x}"))));
        put("degenerate", json!(number(|c| c.degenerate)));
        put("duplicate_faces", json!(of_kind(false, |c| c.duplicates)));
        put(
            "non_manifold_edges",
            json!(of_kind(false, |c| c.non_manifold_facets)),
        );
        put(
            "non_manifold_vertices",
            json!(number(|c| c.non_manifold_vertices)),
        );
        put(
            "boundary_edges",
            json!(of_kind(false, |c| c.boundary_facets)),
        );
        put("boundaries", json!(number(|c| c.boundaries)));
        put(
            "inconsistent_edges",
            json!(of_kind(false, |c| c.inconsistent_facets)),
        );
        put("components", json!(number(|c| c.components)));
        put("unused_vertices", json!(number(|c| c.unused_vertices)));
        put("watertight", json!(counts.and_then(|c| c.is_watertight)));
        put("volume", json!(counts.and_then(|c| c.volume)));
        put("euler", json!(counts.and_then(|c| c.euler)));
        if is_solid {
            put(
                "duplicate_tetrahedra",
                json!(of_kind(true, |c| c.duplicates)),
            );
            put(
                "non_manifold_faces",
                json!(of_kind(true, |c| c.non_manifold_facets)),
            );
            put(
                "boundary_faces",
                json!(of_kind(true, |c| c.boundary_facets)),
            );
            put(
                "inconsistent_faces",
                json!(of_kind(true, |c| c.inconsistent_facets)),
            );
        }
        if let Some(asked) = counts.and_then(|c| c.min_thickness) {
            put("min_thickness", json!(asked));
            put("thin_faces", json!(counts.and_then(|c| c.thin_faces)));
            put("thinnest", json!(counts.and_then(|c| c.thinnest)));
        }
        let places = || self.places.iter().map(Place::to_json).collect();
        put(
            "places",
            counts.map_or(Value::Null, |_| Value::Array(places())),
        );
        let failure = self.result.as_ref().err();
        put("error", json!(failure.map(|failure| &failure.message)));
        put(
            "error_kind",
            json!(failure.map(|failure| failure.kind.name())),
        );
        Value::Object(object)
    }

    /// The row of an object made by [`to_json`](Self::to_json); `None` if the object is not a row.
    pub fn from_json(value: &Value) -> Option<Self> {
        let result = match value.get("error")? {
            Value::Null => Ok(counts(value)?),
            message => {
                let name = value.get("error_kind")?.as_str()?;
                let kind = ErrorKind::ALL
                    .into_iter()
                    .find(|kind| kind.name() == name)?;
                let message = message.as_str()?.to_owned();
                Err(Failure { kind, message })
            }
        };
        Some(Row {
            path: value.get("path")?.as_str()?.to_owned(),
            is_welded: value.get("welded")?.as_bool()?,
            result,
            // Rows of earlier versions have none.
            places: match value.get("places") {
                Some(Value::Array(places)) => {
                    places.iter().map(Place::from_json).collect::<Option<_>>()?
                }
                _ => Vec::new(),
            },
            marks: None,
        })
    }
}

fn counts(value: &Value) -> Option<Counts> {
    let number = |key: &str| value.get(key)?.as_u64();
    let either = |edges: &str, faces: &str| number(edges).or_else(|| number(faces));
    Some(Counts {
        n_vertices: number("vertices")?,
        n_welded: number("vertices_welded")?,
        n_triangles: number("triangles")?,
        n_tetrahedra: number("tetrahedra")?,
        self_intersections: number("self_intersections")?,
        n_intersecting: number("intersecting_primitives")?,
        hash: match value.get("hash")? {
            Value::Null => None,
            hash => Some(u64::from_str_radix(hash.as_str()?, 16).ok()?),
        },
        degenerate: number("degenerate")?,
        duplicates: either("duplicate_faces", "duplicate_tetrahedra")?,
        non_manifold_facets: either("non_manifold_edges", "non_manifold_faces")?,
        non_manifold_vertices: number("non_manifold_vertices")?,
        boundary_facets: either("boundary_edges", "boundary_faces")?,
        boundaries: number("boundaries")?,
        inconsistent_facets: either("inconsistent_edges", "inconsistent_faces")?,
        components: number("components")?,
        unused_vertices: number("unused_vertices")?,
        is_watertight: value.get("watertight").and_then(Value::as_bool),
        volume: value.get("volume").and_then(Value::as_f64),
        euler: value.get("euler").and_then(Value::as_i64),
        thin_faces: value.get("thin_faces").and_then(Value::as_u64),
        thinnest: value.get("thinnest").and_then(Value::as_f64),
        min_thickness: value.get("min_thickness").and_then(Value::as_f64),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::marks::Problem;

    fn counted(n_triangles: u64, n_tetrahedra: u64) -> Row {
        Row {
            path: "a \"b\".ply".to_owned(),
            is_welded: true,
            result: Ok(Counts {
                n_vertices: 1,
                n_welded: 2,
                n_triangles,
                n_tetrahedra,
                self_intersections: 5,
                n_intersecting: 6,
                hash: (n_triangles > 3).then_some(u64::MAX - 6),
                degenerate: 8,
                duplicates: 9,
                non_manifold_facets: 10,
                non_manifold_vertices: 11,
                boundary_facets: 12,
                boundaries: 13,
                inconsistent_facets: 14,
                components: 15,
                unused_vertices: 16,
                is_watertight: (n_tetrahedra == 0).then_some(true),
                volume: (n_triangles > 3).then_some(0.1),
                euler: (n_tetrahedra == 0).then_some(-2),
                thin_faces: (n_triangles > 3).then_some(17),
                thinnest: (n_triangles > 3).then_some(0.2),
                min_thickness: (n_triangles > 3).then_some(0.3),
            }),
            places: vec![Place {
                problem: Problem::Boundary,
                vertex: (n_triangles > 3).then_some(7),
                point: [0.1, -2.0, 1e-30],
                size: 0.3,
                n_elements: 4,
                elements: vec![1, 5],
            }],
            marks: None,
        }
    }

    #[test]
    fn rows_survive_json() {
        let failed = Row::failed("x", false, ErrorKind::Memory, "too\n\n  much\n");
        assert_eq!(failed.result.as_ref().unwrap_err().message, "too; much");
        for row in [counted(3, 0), counted(4, 0), counted(0, 3), failed] {
            let text = row.to_json().to_string();
            assert!(!text.contains('\n'));
            let value = serde_json::from_str(&text).unwrap();
            assert_eq!(Row::from_json(&value), Some(row));
        }
        assert_eq!(Row::from_json(&json!({"path": "x", "error": null})), None);
    }
}
