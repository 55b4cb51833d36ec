//! The bodies of a file: nodes of glTF, objects and groups of OBJ.

use impinge_io::{
    ColoredMesh, Elements, Format, Mesh, NamedMesh, Positions, ReadOptions, read, read_bodies,
    read_bodies_bytes, read_bytes, write_glb,
};

fn obj(text: &str) -> Vec<NamedMesh> {
    let options = ReadOptions::as_they_are();
    let (bodies, _) = read_bodies_bytes(text.as_bytes(), Format::Obj, "a.obj", &options).unwrap();
    bodies
}

/// The corners of each triangle, which no numbering of vertices changes.
fn corners(mesh: &Mesh) -> Vec<[[f64; 3]; 3]> {
    let Elements::Triangles(faces) = &mesh.elements else {
        panic!("triangles expected");
    };
    faces
        .iter()
        .map(|face| face.map(|ix| mesh.positions.get(ix as usize).unwrap()))
        .collect()
}

fn names(bodies: &[NamedMesh]) -> Vec<Option<&str>> {
    bodies.iter().map(|body| body.name.as_deref()).collect()
}

const VERTICES: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nv 0 0 1\n";

#[test]
fn groups_of_an_obj_are_bodies() {
    let text = format!(
        "{VERTICES}g left wing\nf 1 2 3 4\ng tail\nf 1 2 6\ng empty\ng left wing\nf 2 3 6\ng\nf 3 4 6\n"
    );
    let bodies = obj(&text);
    assert_eq!(
        names(&bodies),
        [Some("left wing"), Some("tail"), Some("default")]
    );
    // The quad is cut into two; a group that begins again goes on. Vertices of no face of the body
    // are left out.
    let n: Vec<_> = bodies
        .iter()
        .map(|body| (body.mesh.n_elements(), body.mesh.n_vertices()))
        .collect();
    assert_eq!(n, [(3, 5), (1, 3), (1, 3)]);
    let whole = read_bytes(
        text.as_bytes(),
        Format::Obj,
        "a.obj",
        &ReadOptions::as_they_are(),
    )
    .unwrap();
    let all = corners(&whole);
    assert_eq!(corners(&bodies[0].mesh), [all[0], all[1], all[3]]);
    assert_eq!(corners(&bodies[1].mesh), [all[2]]);
    assert_eq!(corners(&bodies[2].mesh), [all[4]]);
}

#[test]
fn objects_come_before_groups() {
    let bodies = obj(&format!(
        "{VERTICES}g loose\nf 1 2 3\no door\ng red\nf 1 2 6\ng blue\nf 2 3 6\no handle\nf 3 4 6\n"
    ));
    assert_eq!(
        names(&bodies),
        [Some("default"), Some("door"), Some("handle")]
    );
    assert_eq!(bodies[1].mesh.n_elements(), 2);
}

#[test]
fn objects_of_one_name_stay_apart() {
    let bodies = obj(&format!(
        "{VERTICES}o x\no x\nf 1 2 3\nf 1 3 4\no x\nf 1 2 6\no y\nf 2 3 6\no\no x\nf 3 4 6\n"
    ));
    let found: Vec<_> = bodies
        .iter()
        .map(|body| (body.name.as_deref().unwrap(), body.mesh.n_elements()))
        .collect();
    // One without faces is none.
    assert_eq!(found, [("x", 2), ("x (2)", 1), ("y", 1), ("x (3)", 1)]);
}

#[test]
fn no_two_bodies_have_one_name() {
    let bodies = obj(&format!(
        "{VERTICES}o a\nf 1 2 3\no a (2)\nf 1 3 4\no a\nf 1 2 6\no a (2)\nf 2 3 6\n"
    ));
    let expected = ["a", "a (2)", "a (3)", "a (2) (2)"];
    assert_eq!(names(&bodies), expected.map(Some));
}

#[test]
fn vertices_of_bodies_have_the_numbers_of_the_file() {
    let text = format!("{VERTICES}v 0 0 0\no a\nf 1 3 7\no b\nf 6 3 4\n");
    let [a, b] = &obj(&text)[..] else {
        panic!("two bodies");
    };
    assert_eq!(a.vertices.as_deref(), Some(&[0, 2, 6][..]));
    assert_eq!(b.vertices.as_deref(), Some(&[2, 3, 5][..]));
    // Of welded ones, the first.
    let weld = ReadOptions::default();
    let read = |text: &str| read_bodies_bytes(text.as_bytes(), Format::Obj, "a.obj", &weld);
    let (bodies, _) = read(&text).unwrap();
    assert_eq!(bodies[0].vertices.as_deref(), Some(&[0, 2][..]));
    // A file of one body has its own vertices.
    assert_eq!(obj(&format!("{VERTICES}o a\nf 1 2 3\n"))[0].vertices, None);
    let (bodies, _) = read(&format!("{VERTICES}v 0 0 0\nv 2 2 2\nf 1 3 8\n")).unwrap();
    let whole = [0, 1, 2, 3, 4, 5, 7];
    assert_eq!(bodies[0].vertices.as_deref(), Some(&whole[..]));
}

#[test]
fn what_has_no_parts_is_one_body() {
    for (text, name) in [
        ("f 1 2 3\nf 1 3 4\n", None),
        ("g all\nf 1 2 3\nf 1 3 4\n", Some("all")),
        ("o Y\nf 1 2 3\nf 1 3 4\n", Some("Y")),
        ("g red\no Y\nf 1 2 3\ng blue\nf 1 3 4\no Z\n", Some("Y")),
        // No name, and none of faces.
        ("o\nf 1 2 3\nf 1 3 4\n", None),
        ("f 1 2 3\nf 1 3 4\no Y\n", None),
    ] {
        let bodies = obj(&format!("{VERTICES}{text}"));
        assert_eq!(names(&bodies), [name]);
        // As it is, with the vertices of no face.
        assert_eq!(
            (bodies[0].mesh.n_elements(), bodies[0].mesh.n_vertices()),
            (2, 6)
        );
    }
}

#[test]
fn faces_before_the_first_name_are_a_body() {
    for word in ["o", "g"] {
        let bodies = obj(&format!("{VERTICES}f 1 2 3\n{word} Y\nf 3 2 4\nf 3 2 6\n"));
        assert_eq!(names(&bodies), [Some("default"), Some("Y")]);
        let n = bodies.iter().map(|body| body.mesh.n_elements());
        assert_eq!(n.collect::<Vec<_>>(), [1, 2]);
    }
}

#[test]
fn bodies_are_welded_each_by_itself() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\n\
                g a\nf 1 2 3\nf 4 6 5\ng b\nf 1 2 7\n";
    let options = ReadOptions {
        weld: true,
        ..ReadOptions::default()
    };
    let (bodies, summary) =
        read_bodies_bytes(text.as_bytes(), Format::Obj, "a.obj", &options).unwrap();
    assert_eq!(summary.n_welded, 2);
    assert_eq!(
        bodies[0].mesh.elements,
        Elements::Triangles(vec![[0, 1, 2], [1, 3, 2]])
    );
    assert_eq!(bodies[1].mesh.n_vertices(), 3);
}

#[test]
fn nodes_of_a_glb_are_bodies() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let positions = |z: f32| Positions::F32(vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]]);
    let held = [positions(0.0), positions(1.0), positions(2.0)];
    let elements = Elements::Triangles(vec![[0, 1, 2]]);
    let meshes: Vec<_> = held
        .iter()
        .zip(["worm", "ball", "worm"])
        .map(|(positions, name)| ColoredMesh {
            positions,
            elements: &elements,
            element_colors: None,
            colliding: None,
            name,
        })
        .collect();
    write_glb(&path, &meshes).unwrap();
    let (bodies, _) = read_bodies(&path, &ReadOptions::as_they_are()).unwrap();
    // Each node is a body, also of a name that another one has.
    assert_eq!(
        names(&bodies),
        [Some("worm"), Some("ball"), Some("worm (2)")]
    );
    for (body, positions) in bodies.iter().zip(&held) {
        assert_eq!(&body.mesh.positions, positions);
    }
    let whole = read(&path, &ReadOptions::as_they_are()).unwrap();
    assert_eq!(whole.n_elements(), 3);
}

#[test]
fn nodes_are_placed_and_named() {
    let json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
        "nodes":[{"children":[1,2,3]},{"mesh":0,"translation":[5,0,0]},{"mesh":0,"name":"right"},{"mesh":1}],
        "meshes":[{"name":"part","primitives":[{"attributes":{"POSITION":0}}]},
                  {"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],
        "bufferViews":[{"buffer":0,"byteLength":36}],
        "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#;
    let (bodies, _) = read_bodies_bytes(
        json.as_bytes(),
        Format::Gltf,
        "a.gltf",
        &ReadOptions::as_they_are(),
    )
    .unwrap();
    assert_eq!(
        names(&bodies),
        [Some("part"), Some("right"), Some("node 3")]
    );
    assert_eq!(bodies[0].mesh.positions.get(1), Some([6.0, 0.0, 0.0]));
    assert_eq!(bodies[1].mesh.positions.get(1), Some([1.0, 0.0, 0.0]));
    // The only node has its name, if it has one.
    for (node, name) in [(1, Some("part")), (2, Some("right")), (3, None)] {
        let one = json.replace("\"nodes\":[0]", &format!("\"nodes\":[{node}]"));
        let options = ReadOptions::as_they_are();
        let (bodies, _) =
            read_bodies_bytes(one.as_bytes(), Format::Gltf, "a.gltf", &options).unwrap();
        assert_eq!(names(&bodies), [name]);
    }
}
