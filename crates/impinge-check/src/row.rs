//! One row per mesh. It is printed, stored and sent between processes as a line of JSON.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::marks::MarkRuns;
use crate::places::Place;

/// The counts of one mesh. Facets are edges of triangles and faces of tetrahedra.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Counts {
    /// Vertices, as in the file.
    #[serde(rename = "vertices")]
    pub n_vertices: u64,
    /// Vertices removed by welding: they had exactly the position of another vertex.
    #[serde(rename = "vertices_welded")]
    pub n_welded: u64,
    /// Triangles; 0 for a mesh of tetrahedra.
    #[serde(rename = "triangles")]
    pub n_triangles: u64,
    /// Tetrahedra; 0 for a mesh of triangles.
    #[serde(rename = "tetrahedra")]
    pub n_tetrahedra: u64,
    /// Pairs of elements that share more points than their common vertices, edge or face
    /// ([`SharedVertex::Resolve`](impinge::SharedVertex::Resolve)).
    pub self_intersections: u64,
    /// Elements in any such pair.
    #[serde(rename = "intersecting_elements")]
    pub n_intersecting: u64,
    /// [`Pairs::hash`](impinge::Pairs::hash) of these pairs. `None` if they are more than 2^32, and
    /// many of them of elements with the same vertices: such pairs are counted without being
    /// listed.
    #[serde(with = "hex")]
    pub hash: Option<u64>,
    /// Elements of exactly zero area, or volume.
    pub degenerate: u64,
    /// Elements with the vertices of an earlier one, in any order.
    #[serde(rename = "duplicate_faces")]
    pub duplicates: u64,
    /// Facets of more than two elements.
    #[serde(rename = "non_manifold_edges")]
    pub non_manifold_facets: u64,
    /// Vertices around which the elements form more than one fan.
    pub non_manifold_vertices: u64,
    /// Facets of only one element.
    #[serde(rename = "boundary_edges")]
    pub boundary_facets: u64,
    /// Connected pieces of the border: holes, for most surfaces.
    pub boundaries: u64,
    /// Facets of two elements with opposite orientations.
    #[serde(rename = "inconsistent_edges")]
    pub inconsistent_facets: u64,
    /// Closed pieces of one orientation whose faces point inward, or, around a cavity, outward:
    /// those that [`Repair::Outward`](crate::Repair::Outward) turns. `None` for tetrahedra.
    #[serde(rename = "inside_out_pieces")]
    pub inside_out: Option<u64>,
    /// Pieces connected through facets. Elements that name a vertex twice belong to none.
    pub components: u64,
    /// Vertices of no element, counted after welding.
    pub unused_vertices: u64,
    /// Whether every edge belongs to exactly two triangles; `None` for tetrahedra.
    #[serde(rename = "watertight")]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ErrorKind {
    /// The file can't be read: missing, damaged, of an unknown format, without elements.
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
    /// Which problems each element has: see [`Options::marks`](crate::Options::marks). Not part
    /// of the [object](Self::to_json).
    pub marks: Option<MarkRuns>,
    /// What was left out of the file, and, if places name elements, how many polygons were split:
    /// see [`Summary::notes`](impinge_io::Summary::notes). Not part of the
    /// [object](Self::to_json).
    pub notes: Vec<String>,
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
            notes: Vec::new(),
        }
    }

    /// The row as an object. The keys are the same for every mesh. Counts that do not apply are
    /// `null`: all counts of a mesh with an `error`, and the counts of edges of a mesh of
    /// tetrahedra, which has counts of faces instead.
    pub fn to_json(&self) -> Value {
        let (counts, failure) = match &self.result {
            Ok(counts) => (*counts, None),
            Err(failure) => (Counts::default(), Some(failure)),
        };
        let mut object = Map::new();
        object.insert("path".to_owned(), json!(self.path));
        object.insert("welded".to_owned(), json!(self.is_welded));
        for (key, count) in json!(counts).as_object_mut().into_iter().flatten() {
            let count = if failure.is_some() {
                Value::Null
            } else {
                count.take()
            };
            object.insert(key.clone(), count);
        }
        let thickness = THICKNESS.map(|key| (key.to_owned(), object.shift_remove(key)));
        if counts.n_tetrahedra > 0 {
            for [edges, faces] in FACETS {
                let count = object.insert(edges.to_owned(), Value::Null);
                object.insert(faces.to_owned(), json!(count));
            }
        }
        if counts.min_thickness.is_some() {
            object.extend(thickness.map(|(key, of)| (key, json!(of))));
        }
        let places = failure.is_none().then_some(&self.places);
        object.insert("places".to_owned(), json!(places));
        object.insert("error".to_owned(), json!(failure.map(|of| &of.message)));
        object.insert("error_kind".to_owned(), json!(failure.map(|of| of.kind)));
        Value::Object(object)
    }

    /// The row of an object made by [`to_json`](Self::to_json); `None` if the object is not a row.
    pub fn from_json(value: &Value) -> Option<Self> {
        let mut object = value.as_object()?.clone();
        let result = match object.get("error")? {
            Value::Null => {
                for [edges, faces] in FACETS {
                    if let Some(count) = object.remove(faces) {
                        object.insert(edges.to_owned(), count);
                    }
                }
                Ok(Counts::deserialize(&Value::Object(object)).ok()?)
            }
            message => Err(Failure {
                kind: ErrorKind::deserialize(object.get("error_kind")?).ok()?,
                message: message.as_str()?.to_owned(),
            }),
        };
        Some(Row {
            path: value.get("path")?.as_str()?.to_owned(),
            is_welded: value.get("welded")?.as_bool()?,
            result,
            // Rows of earlier versions have none.
            places: match value.get("places") {
                None | Some(Value::Null) => Vec::new(),
                Some(places) => Deserialize::deserialize(places).ok()?,
            },
            marks: None,
            notes: Vec::new(),
        })
    }
}

/// Keys of counts: of triangles, and of tetrahedra.
const FACETS: [[&str; 2]; 4] = [
    ["duplicate_faces", "duplicate_tetrahedra"],
    ["non_manifold_edges", "non_manifold_faces"],
    ["boundary_edges", "boundary_faces"],
    ["inconsistent_edges", "inconsistent_faces"],
];

/// Keys of meshes whose thickness was asked for.
const THICKNESS: [&str; 3] = ["min_thickness", "thin_faces", "thinnest"];

/// A hash as 16 hexadecimal digits.
mod hex {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    #[expect(clippy::ref_option, reason = "serde calls it so")]
    pub fn serialize<S: Serializer>(hash: &Option<u64>, to: S) -> Result<S::Ok, S::Error> {
        hash.map(|hash| format!("{hash:016x}")).serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u64>, D::Error> {
        let text = Option::<String>::deserialize(from)?;
        let hash = text.map(|text| u64::from_str_radix(&text, 16));
        hash.transpose().map_err(Error::custom)
    }
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
                inside_out: (n_tetrahedra == 0).then_some(18),
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
            notes: Vec::new(),
        }
    }

    /// The bytes that rows have: what was stored is read, and compares.
    #[test]
    fn rows_keep_their_bytes() {
        let failed = Row::failed("x", false, ErrorKind::NotFinite, "no number");
        let rows = [counted(3, 0), counted(4, 0), counted(0, 3), failed];
        let mut expected = include_str!("../tests/rows.jsonl").lines();
        for row in rows {
            assert_eq!(Some(row.to_json().to_string().as_str()), expected.next());
        }
        for problem in Problem::ALL {
            assert_eq!(json!(problem), problem.key());
        }
        for kind in [ErrorKind::NotFinite, ErrorKind::File, ErrorKind::Crash] {
            assert_eq!(json!(kind), kind.name());
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
        // Rows of earlier versions do not count pieces that are inside out.
        let mut earlier = counted(4, 0).to_json();
        earlier
            .as_object_mut()
            .unwrap()
            .shift_remove("inside_out_pieces");
        let counts = Row::from_json(&earlier).unwrap().result.unwrap();
        assert_eq!(counts.inside_out, None);
    }
}
