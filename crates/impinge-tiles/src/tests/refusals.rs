//! Errors name files that are missing, stale, damaged or changed, and coordinates that are not
//! finite.

use std::path::{Path, PathBuf};

use impinge::SharedVertex;
use impinge_io::{Mesh, Positions};

use super::made::{
    Random, answer, lattice, oracle, oracle_as_given, plan, rows, run, scatter, write,
};
use crate::chunk::{Chunk, Shape};
use crate::source::Source;
use crate::{Ask, Error, Plan, PlanOptions};

struct Case {
    folder: tempfile::TempDir,
    files: Vec<PathBuf>,
    meshes: Vec<Mesh>,
}

impl Case {
    fn new(seed: u64) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mesh = lattice(&mut Random(seed), 60, false, false);
        let files = vec![write(folder.path(), "a", &mesh)];
        Case {
            folder,
            files,
            meshes: vec![mesh],
        }
    }

    fn tiles(&self) -> PathBuf {
        self.folder.path().join("tiles")
    }

    fn plan(&self, cap: u64) -> Result<Plan, Error> {
        plan(
            &self.tiles(),
            &self.files,
            &PlanOptions {
                cap,
                chunk: 16,
                ..PlanOptions::default()
            },
        )
    }
}

#[test]
fn another_plan_takes_the_merged_answer_with_it() {
    let case = Case::new(7);
    let old = case.plan(20).unwrap();
    scatter(&old).unwrap();
    run(&old, Ask::default()).unwrap();
    old.merge().unwrap();
    let merged = ["rows.npy", "answer.json"].map(|name| case.tiles().join(name));
    let replaced = |cap| PlanOptions {
        cap,
        chunk: 16,
        replace: true,
        ..PlanOptions::default()
    };
    // The very same plan is left as it is, and so is its answer.
    plan(&case.tiles(), &case.files, &replaced(20)).unwrap();
    assert!(merged.iter().all(|path| path.exists()));
    plan(&case.tiles(), &case.files, &replaced(30)).unwrap();
    assert!(!merged.iter().any(|path| path.exists()));
}

fn flip_last_byte(path: &Path) {
    let mut bytes = std::fs::read(path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn steps_ask_for_the_steps_before_them() {
    let case = Case::new(1);
    assert!(matches!(
        Plan::open(&case.tiles()),
        Err(Error::Missing { step: "plan", .. })
    ));
    let plan = case.plan(20).unwrap();
    assert_eq!(Plan::open(&case.tiles()).unwrap(), plan);
    let error = run(&plan, Ask::default()).unwrap_err();
    assert!(
        matches!(
            error,
            Error::Missing {
                n_missing: 4,
                n: 4,
                ..
            }
        ),
        "{error}"
    );
    scatter(&plan).unwrap();
    std::fs::remove_file(plan.part_path(2)).unwrap();
    let error = run(&plan, Ask::default()).unwrap_err().to_string();
    assert!(
        error.contains("unit-00000002.bin: missing; run `tiles scatter` first (1 of 4"),
        "{error}"
    );
    assert_eq!(scatter(&plan).unwrap().n_written, 1);
    let error = plan.merge().unwrap_err().to_string();
    assert!(
        error.contains("tile-00000000.json: missing; run `tiles run` first"),
        "{error}"
    );
    run(&plan, Ask::default()).unwrap();
    plan.merge().unwrap();
}

#[test]
fn damage_is_noticed_and_mended_by_the_step_that_wrote() {
    let case = Case::new(2);
    let plan = case.plan(20).unwrap();
    scatter(&plan).unwrap();
    run(&plan, Ask::default()).unwrap();
    let whole = plan.merge().unwrap();
    let with_pairs = (0..plan.n_tiles())
        .find(|&tile| plan.result(tile).unwrap().n_pairs > 0)
        .unwrap();
    flip_last_byte(&plan.rows_path(with_pairs));
    let error = plan.merge().unwrap_err();
    assert!(
        matches!(&error, Error::Damaged { path, .. } if *path == plan.rows_path(with_pairs)),
        "{error}"
    );
    std::fs::remove_file(plan.rows_path(with_pairs)).unwrap();
    assert!(matches!(
        plan.merge(),
        Err(Error::Missing { n_missing: 1, .. })
    ));
    run(&plan, Ask::default()).unwrap();
    assert_eq!(plan.merge().unwrap(), whole);

    std::fs::write(plan.result_path(0), "{}").unwrap();
    assert!(matches!(plan.merge(), Err(Error::Damaged { .. })));
    run(&plan, Ask::default()).unwrap();

    flip_last_byte(&plan.part_path(1));
    std::fs::remove_dir_all(case.tiles().join("results")).unwrap();
    let error = run(&plan, Ask::default()).unwrap_err();
    assert!(
        matches!(&error, Error::Damaged { path, .. } if *path == plan.part_path(1)),
        "{error}"
    );
    let part = std::fs::read(plan.part_path(0)).unwrap();
    for (n, name) in [
        (part.len() - 1, "cut short"),
        (50, "almost nothing"),
        (0, "nothing"),
    ] {
        std::fs::write(plan.part_path(1), &part[..n]).unwrap();
        assert!(run(&plan, Ask::default()).is_err(), "{name}");
    }
    std::fs::remove_file(plan.part_path(1)).unwrap();
    scatter(&plan).unwrap();
    run(&plan, Ask::default()).unwrap();
    assert_eq!(plan.merge().unwrap(), whole);

    flip_last_byte(&case.tiles().join("plan.json"));
    assert!(Plan::open(&case.tiles()).is_err());
}

#[test]
fn files_of_another_plan_are_stale() {
    let case = Case::new(3);
    let first = case.plan(20).unwrap();
    scatter(&first).unwrap();
    run(&first, Ask::default()).unwrap();
    assert_eq!(case.plan(20).unwrap(), first);
    assert!(matches!(case.plan(25), Err(Error::OtherPlan { .. })));
    let old = case.folder.path().join("old");
    std::fs::rename(case.tiles(), &old).unwrap();
    let second = case.plan(25).unwrap();
    scatter(&second).unwrap();
    run(&second, Ask::default()).unwrap();
    let merged = second.merge().unwrap();
    std::fs::copy(
        old.join("results/tile-00000000.json"),
        second.result_path(0),
    )
    .unwrap();
    let error = second.merge().unwrap_err();
    assert!(
        matches!(&error, Error::Stale { path, .. } if *path == second.result_path(0)),
        "{error}"
    );
    std::fs::copy(old.join("parts/unit-00000000.bin"), second.part_path(0)).unwrap();
    let error = run(&second, Ask::default()).unwrap_err();
    assert!(matches!(error, Error::Stale { .. }), "{error}");
    // The step that writes such a file treats it as missing.
    assert_eq!(scatter(&second).unwrap().n_written, 1);
    run(&second, Ask::default()).unwrap();
    assert_eq!(second.merge().unwrap(), merged);
}

#[test]
fn tiles_that_were_asked_differently_are_not_merged() {
    let case = Case::new(4);
    let plan = case.plan(20).unwrap();
    assert!(plan.n_tiles() > 1);
    scatter(&plan).unwrap();
    run(&plan, Ask::default()).unwrap();
    let skip = Ask {
        shared_vertex: SharedVertex::Skip,
        ..Ask::default()
    };
    let options = crate::RunOptions {
        ask: skip,
        ..crate::RunOptions::default()
    };
    plan.run([1], &options, impinge::Control::new(), &mut |_| {})
        .unwrap();
    assert!(matches!(
        plan.merge(),
        Err(Error::MixedQuestions { tile: 1, .. })
    ));
    run(&plan, skip).unwrap();
    assert_eq!(plan.merge().unwrap().hash, oracle(&case.meshes, skip).1);
}

#[test]
fn a_mesh_that_changes_is_noticed() {
    let case = Case::new(5);
    let plan = case.plan(20).unwrap();
    flip_last_byte(&case.files[0]);
    assert!(matches!(scatter(&plan), Err(Error::Changed { .. })));
    // Parts that are there are those of the file as it was.
    flip_last_byte(&case.files[0]);
    scatter(&plan).unwrap();
    flip_last_byte(&case.files[0]);
    assert!(matches!(scatter(&plan), Err(Error::Changed { .. })));
    // They may outlive it.
    std::fs::remove_file(&case.files[0]).unwrap();
    scatter(&plan).unwrap();
}

/// Returns NaN although the plan saw numbers.
struct Liar;

impl Source for Liar {
    fn reader(&self) -> String {
        "ply".to_owned()
    }
    fn shape(&self) -> Shape {
        Shape {
            corners: 3,
            width: 4,
            poses: 1,
        }
    }
    fn n_elements(&self) -> u64 {
        60
    }
    fn n_vertices(&self) -> u64 {
        3
    }
    fn read(&self, first: u64, n: usize) -> Result<Option<Chunk>, Error> {
        let mut positions = vec![[0.0; 3]; 3 * n];
        positions[7][1] = f64::NAN;
        Ok(Some(Chunk {
            first,
            vertices: vec![0; 3 * n],
            positions,
        }))
    }
}

#[test]
fn a_nan_is_refused_by_plan_and_scatter() {
    let case = Case::new(6);
    let plan = case.plan(20).unwrap();
    let unit = plan.units().nth(1).unwrap();
    let error = plan.scatter_unit(1, unit, &Liar).unwrap_err();
    assert!(
        matches!(error, Error::Coordinate { element: 18, .. }),
        "{error}"
    );
    assert!(!plan.part_path(1).exists());

    for (x, why) in [(f32::NAN, "not a finite"), (f32::INFINITY, "not a finite")] {
        let path = case.folder.path().join("bad.npy");
        std::fs::write(&path, npy(&[[[0.0; 3], [1.0, x, 0.0], [0.0; 3]]])).unwrap();
        let error = super::made::plan(
            &case.folder.path().join("bad"),
            &[path],
            &PlanOptions::default(),
        );
        let error = error.unwrap_err().to_string();
        assert!(
            error.contains("bad.npy: element 0") && error.contains(why),
            "{error}"
        );
    }
}

/// Triangles as an array `(n, 3, 3)` of `<f4`.
pub fn npy(triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let text = format!(
        "{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, 3, 3), }}\n",
        triangles.len()
    );
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.bytes());
    bytes.extend(
        triangles
            .as_flattened()
            .as_flattened()
            .iter()
            .flat_map(|x| x.to_le_bytes()),
    );
    bytes
}

/// The triangles of a mesh, each with corners of its own.
pub fn soup(mesh: &Mesh) -> Vec<[[f32; 3]; 3]> {
    let (Positions::F32(positions), impinge_io::Elements::Triangles(faces)) =
        (&mesh.positions, &mesh.elements)
    else {
        panic!("triangles in f32");
    };
    faces
        .iter()
        .map(|face| face.map(|vertex| positions[vertex as usize]))
        .collect()
}

#[test]
fn soups_are_welded_tile_by_tile_as_the_whole_would_be() {
    let case = Case::new(7);
    let triangles = soup(&case.meshes[0]);
    let array = case.folder.path().join("soup.npy");
    std::fs::write(&array, npy(&triangles)).unwrap();
    let stl = case.folder.path().join("soup.stl");
    let mut bytes = vec![0; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in &triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    std::fs::write(&stl, bytes).unwrap();
    for shared_vertex in [SharedVertex::Skip, SharedVertex::Resolve] {
        for weld in [false, true] {
            let ask = Ask {
                shared_vertex,
                ..Ask::default()
            };
            let mut mesh = Mesh {
                positions: Positions::F32(triangles.as_flattened().to_vec()),
                elements: impinge_io::Elements::Triangles(
                    (0..60).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
                ),
            };
            if weld {
                impinge_io::weld(&mut mesh);
            }
            let expected = oracle_as_given(&[mesh], ask);
            for file in [&array, &stl] {
                let name = format!(
                    "{}-{weld}-{shared_vertex:?}",
                    file.extension().unwrap().display()
                );
                let options = PlanOptions {
                    cap: 15,
                    chunk: 13,
                    weld,
                    ..PlanOptions::default()
                };
                let merged = answer(
                    &case.folder.path().join(name),
                    std::slice::from_ref(file),
                    &options,
                    ask,
                )
                .unwrap();
                assert_eq!((rows(&merged), merged.hash), expected);
            }
        }
    }
}

/// The plan of a PLY file of four vertices and one face.
fn plan_of_face(corners: &[i32]) -> Result<Plan, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("face.ply");
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        .to_vec();
    for position in [
        [0.0f32, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ] {
        bytes.extend(position.iter().flat_map(|x| x.to_le_bytes()));
    }
    bytes.push(corners.len() as u8);
    bytes.extend(corners.iter().flat_map(|x| x.to_le_bytes()));
    std::fs::write(&path, bytes).unwrap();
    plan(
        &folder.path().join("tiles"),
        &[path],
        &PlanOptions::default(),
    )
}

#[test]
fn faces_of_many_corners_are_read_whole() {
    // These faces have as many bytes as triangles with one more byte; only the count of corners
    // distinguishes them.
    let made = plan_of_face(&[0, 1, 2, 3]).unwrap();
    assert_eq!(
        (made.files()[0].reader.as_str(), made.files()[0].n_elements),
        ("whole", 2)
    );
}

#[test]
fn vertices_out_of_range_are_refused_by_the_number_in_the_file() {
    for vertex in [4, -1] {
        let error = plan_of_face(&[0, 1, vertex]).unwrap_err();
        assert!(
            matches!(error, Error::VertexIndex { index, n_vertices: 4, .. } if index == i64::from(vertex)),
            "{error}"
        );
    }
}

#[test]
fn ranks_share_the_work() {
    let case = Case::new(8);
    let plan = case.plan(20).unwrap();
    let mut n = 0;
    for rank in 0..3 {
        let options = crate::ScatterOptions {
            rank,
            world_size: 3,
            threads: 2,
        };
        n += plan
            .scatter(&options, &impinge::CancelToken::new(), &|_, _| {})
            .unwrap()
            .n_written;
    }
    assert_eq!(n, 4);
    let options = crate::ScatterOptions {
        rank: 3,
        world_size: 3,
        threads: 1,
    };
    assert!(matches!(
        plan.scatter(&options, &impinge::CancelToken::new(), &|_, _| {}),
        Err(Error::Argument { what: "rank", .. })
    ));
    run(&plan, Ask::default()).unwrap();
    assert_eq!(
        plan.merge().unwrap().hash,
        oracle(&case.meshes, Ask::default()).1
    );
}
