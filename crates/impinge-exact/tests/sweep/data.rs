//! Pairs with published answers, and steps whose contacts and times are known to the last bit. The
//! data is not part of the repository: without it the tests fail, unless `IMPINGE_NO_DATA=1` is
//! set.

use impinge_exact::{ElementPair, first_contact};
use impinge_io::{Elements, Positions, ReadOptions};
use impinge_testing::data::test_file;
use impinge_testing::npy;

type Point = [f64; 3];

/// Points of a pair at the start and at the end.
type Step = [[Point; 4]; 2];

/// Queries of Wang et al. 2021 with exact booleans: eight rows of three fractions, then the truth.
fn queries(kind: &str) -> Option<Vec<(Step, bool, String)>> {
    let folder = test_file("ccd/queries")?;
    let mut queries = Vec::new();
    for scene in std::fs::read_dir(folder).unwrap() {
        for file in std::fs::read_dir(scene.unwrap().path().join(kind)).unwrap() {
            let path = file.unwrap().path();
            let text = std::fs::read_to_string(&path).unwrap();
            let rows: Vec<(Point, bool)> = text.lines().map(row).collect();
            for (ix, rows) in rows.chunks_exact(8).enumerate() {
                let at = |first: usize| std::array::from_fn(|k| rows[first + k].0);
                let name = format!("{} query {ix}", path.display());
                queries.push(([at(0), at(4)], rows[0].1, name));
            }
        }
    }
    Some(queries)
}

fn row(line: &str) -> (Point, bool) {
    let fields: Vec<&str> = line.split(',').collect();
    let fraction = |ix: usize| {
        let [over, under]: [i128; 2] = [0, 1].map(|k| fields[2 * ix + k].parse().unwrap());
        assert!(under > 0 && under & (under - 1) == 0, "a power of two");
        let over_float = over as f64;
        assert_eq!(over_float as i128, over, "a numerator of 53 bits");
        over_float / under as f64
    };
    (std::array::from_fn(fraction), fields[6] == "1")
}

fn check_queries(kind: &str, pair: ElementPair, n_expected: usize) {
    let Some(queries) = queries(kind) else {
        return;
    };
    assert_eq!(queries.len(), n_expected);
    assert!(queries.iter().filter(|query| query.1).count() > 10);
    for ([start, end], truth, name) in &queries {
        assert_eq!(first_contact(pair, start, end).is_some(), *truth, "{name}");
        // The two touch at some time backwards if and only if they touch at some time forwards.
        assert_eq!(
            first_contact(pair, end, start).is_some(),
            *truth,
            "{name}, reversed"
        );
    }
}

#[test]
fn published_vertex_face_queries() {
    check_queries("vertex-face", ElementPair::VertexFace, N_VERTEX_FACE);
}

#[test]
fn published_edge_edge_queries() {
    check_queries("edge-edge", ElementPair::EdgeEdge, N_EDGE_EDGE);
}

const N_VERTEX_FACE: usize = 1500;
const N_EDGE_EDGE: usize = 1324;

/// A step of a simulation, and all its contacts.
struct Recorded {
    name: &'static str,
    start: Vec<Point>,
    end: Vec<Point>,
    faces: Vec<[u32; 3]>,
    /// Numbered by (high, low), as `igl::edges` does.
    edges: Vec<[u32; 2]>,
}

impl Recorded {
    fn read(name: &'static str, frames: [&str; 2]) -> Option<Self> {
        let mut faces = Vec::new();
        let mut ends = Vec::new();
        for frame in frames {
            let path = test_file(&format!("ccd/{name}/frames/{frame}.ply"))?;
            let mesh = impinge_io::read(&path, &ReadOptions::as_they_are()).unwrap();
            let Elements::Triangles(found) = mesh.elements else {
                panic!("a surface");
            };
            faces = found;
            ends.push(match mesh.positions {
                Positions::F32(points) => points.iter().map(|p| p.map(f64::from)).collect(),
                Positions::F64(points) => points,
            });
        }
        let mut edges: Vec<[u32; 2]> = faces
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.max(b), a.min(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let [start, end] = ends.try_into().ok()?;
        Some(Self {
            name,
            start,
            end,
            faces,
            edges,
        })
    }

    fn step(&self, pair: ElementPair, [a, b]: [u32; 2]) -> Step {
        let at = |ix: u32| ix as usize;
        let vertices = match pair {
            ElementPair::VertexFace => {
                let [p, q, r] = self.faces[at(b)];
                [a, p, q, r]
            }
            _ => {
                let ([p, q], [r, s]) = (self.edges[at(a)], self.edges[at(b)]);
                [p, q, r, s]
            }
        };
        [&self.start, &self.end].map(|points| vertices.map(|ix| points[at(ix)]))
    }

    /// The rows of one kind, with their times.
    fn contacts(&self, kind: &str) -> Option<Vec<([u32; 2], f32, f64)>> {
        let file = |what: &str| {
            let path = test_file(&format!("ccd/{}/{kind}_{what}.npy", self.name))?;
            Some(std::fs::read(path).unwrap())
        };
        let pairs = npy::rows(&file("contacts")?, "<u4", u32::from_le_bytes);
        let times_f32 = npy::rows(&file("toi_f32")?, "<f4", f32::from_le_bytes);
        let times_f64 = npy::rows(&file("toi_f64")?, "<f8", f64::from_le_bytes);
        assert_eq!([times_f32.len(), times_f64.len()], [pairs.len(); 2]);
        let times = times_f32.into_iter().zip(times_f64);
        let rows = pairs.into_iter().zip(times);
        Some(
            rows.map(|(row, ([narrow], [wide]))| (row, narrow, wide))
                .collect(),
        )
    }

    fn check(&self, kind: &str, pair: ElementPair, n_expected: usize) {
        let Some(contacts) = self.contacts(kind) else {
            return;
        };
        assert_eq!(contacts.len(), n_expected);
        for (row, time_f32, time_f64) in contacts {
            let [start, end] = self.step(pair, row);
            let contact = first_contact(pair, &start, &end)
                .unwrap_or_else(|| panic!("{} {kind} {row:?} is a contact", self.name));
            assert_eq!(contact.time.to_bits(), time_f64.to_bits(), "{kind} {row:?}");
            assert_eq!(
                contact.time_f32().to_bits(),
                time_f32.to_bits(),
                "{kind} {row:?}"
            );
            assert_eq!(contact.at_start, time_f64 == 0.0, "{kind} {row:?}");
        }
    }

    /// The pairs with published answers: those that touch are among the contacts, the others are
    /// not.
    fn check_published(&self, kind: &str, pair: ElementPair, number: &str) {
        let json = |what: &str| -> Option<serde_json::Value> {
            let path = test_file(&format!("ccd/{}/{what}.json", self.name))?;
            Some(serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap())
        };
        let (Some(boxes), Some(answers)) = (
            json(&format!("boxes/{number}{kind}")),
            json(&format!("mma_bool/{number}{kind}_mma_bool")),
        ) else {
            return;
        };
        let (boxes, answers) = (boxes.as_array().unwrap(), answers.as_array().unwrap());
        assert_eq!(boxes.len(), answers.len());
        let n_vertices = u32::try_from(self.start.len()).unwrap();
        let n_edges = u32::try_from(self.edges.len()).unwrap();
        for (ids, answer) in boxes.iter().zip(answers) {
            let [a, b] = [0, 1].map(|k| u32::try_from(ids[k].as_u64().unwrap()).unwrap());
            let row = match pair {
                ElementPair::VertexFace => [a, b - n_vertices - n_edges],
                _ => [a - n_vertices, b - n_vertices],
            };
            let [start, end] = self.step(pair, row);
            let found = first_contact(pair, &start, &end).is_some();
            assert_eq!(found, answer.as_bool().unwrap(), "{kind} {row:?}");
        }
    }
}

#[test]
fn every_contact_of_the_cloth_on_the_ball_to_the_last_bit() {
    let Some(step) = Recorded::read("cloth-ball", ["cloth_ball92", "cloth_ball93"]) else {
        return;
    };
    assert_eq!(step.edges.len(), 138_825);
    step.check("vf", ElementPair::VertexFace, 19_032);
    step.check("ee", ElementPair::EdgeEdge, 94_822);
    step.check_published("vf", ElementPair::VertexFace, "92");
    step.check_published("ee", ElementPair::EdgeEdge, "92");
}

#[test]
fn every_contact_of_the_cloth_in_the_funnel_to_the_last_bit() {
    let Some(step) = Recorded::read("cloth-funnel", ["227", "228"]) else {
        return;
    };
    step.check("vf", ElementPair::VertexFace, 27);
    step.check("ee", ElementPair::EdgeEdge, 107);
    step.check_published("vf", ElementPair::VertexFace, "227");
    step.check_published("ee", ElementPair::EdgeEdge, "227");
}
