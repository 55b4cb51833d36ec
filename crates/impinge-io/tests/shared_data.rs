//! Every mesh of the shared data is read with the numbers of vertices and elements that its
//! README states.

use std::path::{Path, PathBuf};
use std::time::Instant;

use impinge_io::{Elements, Mesh, Positions, ReadOptions, Sequence, read, weld};

/// The folder of the shared data; `None` if `IMPINGE_NO_DATA=1` is set and it is absent.
fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("IMPINGE_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    if folder.is_dir() {
        return Some(folder);
    }
    let may_be_absent = std::env::var_os("IMPINGE_NO_DATA").is_some_and(|value| value == "1");
    assert!(
        may_be_absent,
        "no shared data at {}: set IMPINGE_DATA, or IMPINGE_NO_DATA=1 to skip this test",
        folder.display()
    );
    None
}

fn load(path: &Path) -> Mesh {
    read(path, &ReadOptions::as_they_are()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn surfaces() {
    let Some(data) = data() else { return };
    for (file, n_vertices, n_triangles, is_f32) in [
        ("meshes/bunny.ply", 34_834, 69_451, true),
        ("meshes/buddha.ply", 49_950, 100_000, true),
        ("meshes/dragon.ply", 201_099, 400_000, true),
        ("meshes/camelhead.off", 11_381, 22_704, false),
        ("meshes/cow.off", 2_762, 5_520, false),
        ("sequences/rumba.ply", 12_811, 25_472, true),
        (
            "ccd/cloth-ball/frames/cloth_ball92.ply",
            46_598,
            92_230,
            true,
        ),
        (
            "ccd/cloth-ball/frames/cloth_ball93.ply",
            46_598,
            92_230,
            true,
        ),
        ("ccd/cloth-funnel/frames/227.ply", 9_450, 18_484, false),
        ("ccd/cloth-funnel/frames/228.ply", 9_450, 18_484, false),
    ] {
        let start = Instant::now();
        let mut mesh = load(&data.join(file));
        println!(
            "{file}: read in {:.1} ms",
            start.elapsed().as_secs_f64() * 1e3
        );
        assert_eq!(
            (mesh.n_vertices(), mesh.n_elements()),
            (n_vertices, n_triangles),
            "{file}"
        );
        assert!(matches!(mesh.elements, Elements::Triangles(_)), "{file}");
        assert_eq!(
            matches!(mesh.positions, Positions::F32(_)),
            is_f32,
            "{file}"
        );
        let start = Instant::now();
        let n_welded = weld(&mut mesh);
        println!(
            "{file}: {n_welded} vertices welded in {:.1} ms",
            start.elapsed().as_secs_f64() * 1e3
        );
        assert_eq!(mesh.n_elements(), n_triangles, "{file}");
    }
}

#[test]
fn tetrahedra() {
    let Some(data) = data() else { return };
    for (file, n_vertices, n_tetrahedra) in [
        ("tets/bunny_19k.msh", 4_670, 19_379),
        ("tets/bunny_7k.msh", 1_869, 7_356),
        ("tets/sphere_5k.msh", 7_034, 27_792),
        ("tets/dragon_8k.msh", 3_038, 8_408),
        ("tets/dragon_15k.msh", 5_239, 15_047),
    ] {
        let mesh = load(&data.join(file));
        assert_eq!(
            (mesh.n_vertices(), mesh.n_elements()),
            (n_vertices, n_tetrahedra),
            "{file}"
        );
        assert!(matches!(mesh.elements, Elements::Tetrahedra(_)), "{file}");
    }
}

#[test]
fn sequences() {
    let Some(data) = data() else { return };
    let mesh = load(&data.join("sequences/rumba.ply"));
    let rumba = Sequence::open(&data.join("sequences/rumba.pc2")).unwrap();
    assert_eq!(
        (rumba.n_frames(), rumba.n_points()),
        (121, mesh.n_vertices())
    );
    for frame_ix in [120, 0, 60] {
        assert_eq!(rumba.frame(frame_ix).unwrap().len(), mesh.n_vertices());
    }
    assert_ne!(rumba.frame(0).unwrap(), rumba.frame(120).unwrap());
    let message = rumba.frame(121).unwrap_err().to_string();
    assert!(message.contains("121"), "{message}");

    let cloth = Sequence::open(&data.join("ccd/cloth-ball/frames/cloth_ball92.ply")).unwrap();
    assert_eq!((cloth.n_frames(), cloth.n_points()), (2, 46_598));
    assert_ne!(cloth.frame(0).unwrap(), cloth.frame(1).unwrap());
}
