//! glTF and GLB.

use crate::*;

#[test]
fn gltf_transforms_multiply_down_the_tree() {
    let turned = r#","rotation":[0,0,0.7071067811865476,0.7071067811865476],"scale":[2,2,2],"translation":[10,0,0]"#;
    let mesh = read_bytes(
        &glb_of(&gltf_json("", turned), &gltf_buffer()),
        Format::Gltf,
        "g",
        &ReadOptions::as_they_are(),
    )
    .or_show();
    let Positions::F64(positions) = &mesh.positions else {
        panic!("moved positions are f64")
    };
    for ([x, y, z], moved) in VERTICES.into_iter().zip(positions) {
        for (expected, found) in [10.0 - 2.0 * y, 2.0 * x, 2.0 * z].into_iter().zip(moved) {
            assert!((expected - found).abs() < 1e-12, "{moved:?}");
        }
    }

    // Numbers are read as the nearest ones in f64.
    let far = r#","translation":[1.2371344566345215,0,0]"#;
    let mesh = read_bytes(
        &glb_of(&gltf_json("", far), &gltf_buffer()),
        Format::Gltf,
        "g",
        &ReadOptions::as_they_are(),
    )
    .or_show();
    assert_eq!(
        mesh.positions.get(0),
        Some([1.237_134_456_634_521_5, 0.0, 0.0])
    );

    // A parent that moves, children that use the mesh twice, once as a matrix.
    let json = gltf_json("", "").replace(
        r#"[{"mesh":0}]"#,
        r#"[{"children":[1,2],"translation":[1,0,0]},{"mesh":0},{"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,5,1]}]"#,
    );
    let mesh = read_bytes(
        &glb_of(&json, &gltf_buffer()),
        Format::Gltf,
        "g",
        &ReadOptions::as_they_are(),
    )
    .or_show();
    assert_eq!((mesh.n_vertices(), mesh.n_elements()), (10, 6));
    assert_eq!(mesh.positions.get(1), Some([2.0, 0.0, 0.0]));
    assert_eq!(mesh.positions.get(6), Some([2.0, 0.0, 5.0]));
    assert_eq!(triangles(&mesh)[3], TRIANGLES[0].map(|ix| ix + 5));
}

#[test]
fn gltf_modes_shared_positions_and_external_buffers() {
    // Two elements of one mesh share their positions: a strip, and a fan without indices.
    let json = gltf_json(r#","uri":"my%20data.bin""#, "")
        .replace(r#""indices":1}"#, r#""indices":1,"mode":5},{"attributes":{"POSITION":0},"mode":6},{"attributes":{"POSITION":0},"mode":1}"#);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("my data.bin"), gltf_buffer()).unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, &json).unwrap();
    let (mesh, summary) = read_with_summary(&path, &ReadOptions::as_they_are()).or_show();
    assert_eq!(mesh.n_vertices(), 5);
    let [a, b, c] = TRIANGLES;
    assert_eq!(
        triangles(&mesh),
        [
            a,
            [a[2], a[1], b[0]],
            [a[2], b[0], b[1]],
            [b[1], b[0], b[2]],
            [b[1], b[2], c[0]],
            [c[0], b[2], c[1]],
            [c[0], c[1], c[2]],
            [0, 1, 2],
            [0, 2, 3],
            [0, 3, 4]
        ]
    );
    assert_eq!(summary.n_lines_skipped, 1);
    let message = load(Format::Gltf, &json).unwrap_err().to_string();
    assert_eq!(
        message,
        "file: buffer 0 at 'my%20data.bin' (files beside a mesh in memory are not read; a .glb file has its buffers in it) is not supported"
    );
    for outside in ["/etc/passwd", "file:///etc/passwd", "http://a/b"] {
        std::fs::write(&path, json.replace("my%20data.bin", outside)).unwrap();
        let error = read(&path, &ReadOptions::as_they_are()).unwrap_err();
        assert!(matches!(error, Error::Outside { .. }), "{error}");
    }
}

#[test]
fn gltf_sparse_and_quantized() {
    let sparse = gltf_json("", "").replace(
        r#""componentType":5126,"count":5,"type":"VEC3""#,
        r#""componentType":5126,"count":5,"type":"VEC3","sparse":{"count":1,"indices":{"bufferView":1,"byteOffset":2,"componentType":5123},"values":{"bufferView":0,"byteOffset":12}}"#,
    );
    let mesh = read_bytes(
        &glb_of(&sparse, &gltf_buffer()),
        Format::Gltf,
        "g",
        &ReadOptions::as_they_are(),
    )
    .or_show();
    // The second index is 2, and the second position (1, 0, 0).
    assert_eq!(mesh.positions.get(2), Some([1.0, 0.0, 0.0]));

    let quantized = gltf_json("", "")
        .replace(
            r#""componentType":5126"#,
            r#""componentType":5122,"normalized":true"#,
        )
        .replace(r#""byteLength":60}"#, r#""byteLength":60,"byteStride":8}"#);
    let mut buffer = gltf_buffer();
    buffer[8..14].copy_from_slice(&[0xff, 0x7f, 0x01, 0x80, 0x00, 0x80]);
    let mesh = read_bytes(
        &glb_of(&quantized, &buffer),
        Format::Gltf,
        "g",
        &ReadOptions::as_they_are(),
    )
    .or_show();
    assert_eq!(mesh.positions.get(1), Some([1.0, -1.0, -1.0]));
}

#[test]
fn gltf_errors() {
    let json = gltf_json("", "");
    for (from, to, expected) in [
        (
            r#""count":9"#,
            r#""count":10"#,
            "file: 10 values in buffer view 1: 20 bytes are needed, but 18 are left",
        ),
        (
            r#""count":9"#,
            r#""count":8"#,
            "file: expected 9 indices of triangles, found 8",
        ),
        (
            r#""count":5"#,
            r#""count":4"#,
            "file: vertex index 4 is out of range; vertices: 4, numbered from 0",
        ),
        (
            r#""indices":1"#,
            r#""indices":7"#,
            "file: expected an index of accessors below 2, found 7",
        ),
        (
            r#""nodes":[0]"#,
            r#""nodes":[0,0]"#,
            "file: expected nodes that form a tree, found node 0 twice",
        ),
        (
            r#"{"mesh":0}"#,
            r#"{"mesh":0,"children":[0]}"#,
            "file: expected nodes that form a tree, found node 0 twice",
        ),
        (
            r#""asset""#,
            r#""extensionsRequired":["KHR_draco_mesh_compression"],"asset""#,
            "file: the extension 'KHR_draco_mesh_compression' (a compressed mesh: export it again without compression) is not supported",
        ),
        (
            r#""asset""#,
            r#""extensionsRequired":["a\nb"],"asset""#,
            r"file: the extension 'a\nb' is not supported",
        ),
        (
            r#""byteLength":18"#,
            r#""byteLength":9000"#,
            "file: buffer view 1: 9060 bytes are needed, but 80 are left",
        ),
        (
            r#""byteLength":80"#,
            r#""byteLength":81"#,
            "file: buffer 0: 81 bytes are needed, but 80 are left",
        ),
        (
            r#""2.0""#,
            r#""1.0""#,
            "file: glTF version '1.0' (supported: 2.x) is not supported",
        ),
    ] {
        let broken = json.replace(from, to);
        assert_ne!(broken, json);
        let error = read_bytes(
            &glb_of(&broken, &gltf_buffer()),
            Format::Gltf,
            "file",
            &ReadOptions::as_they_are(),
        )
        .unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
    assert!(
        message(Format::Gltf, "{\"asset\": {\n\"version\" 2}}")
            .starts_with("file:2: expected glTF in JSON, found expected `:`")
    );
}

#[test]
fn gltf_instances_are_held_to_the_budget() {
    let nodes = vec![r#"{"mesh":0}"#; 1000].join(",");
    let all: Vec<String> = (0..1000).map(|ix| ix.to_string()).collect();
    let json = gltf_json("", "")
        .replace(r#"{"mesh":0}"#, &nodes)
        .replace(r#""nodes":[0]"#, &format!(r#""nodes":[{}]"#, all.join(",")));
    let glb = glb_of(&json, &gltf_buffer());
    let options = ReadOptions::as_they_are();
    assert_eq!(
        read_bytes(&glb, Format::Gltf, "g", &options)
            .or_show()
            .n_elements(),
        3000
    );
    let options = ReadOptions {
        max_expanded_bytes: 1000,
        ..options
    };
    let error = read_bytes(&glb, Format::Gltf, "g", &options).unwrap_err();
    assert!(matches!(error, Error::TooLarge { .. }), "{error}");
}

#[test]
fn what_moves_a_mesh_but_is_not_applied_is_counted() {
    let summary = |json: &str| {
        let glb = glb_of(json, &gltf_buffer());
        let options = ReadOptions::as_they_are();
        let read = read_bytes_with_summary(&glb, Format::Gltf, "g", &options);
        read.or_show().1.n_at_rest
    };
    let json = gltf_json("", "");
    assert_eq!(summary(&json), 0);
    let with = |more: &str| json.replace(r#"[{"mesh":0}]"#, &format!(r#"[{{"mesh":0{more}}}]"#));
    assert_ne!(with(r#","skin":0"#), json);
    assert_eq!(summary(&with(r#","skin":0"#)), 1);
    assert_eq!(summary(&with(r#","weights":[0,0.5]"#)), 1);
    // Targets without weight change nothing.
    assert_eq!(summary(&with(r#","weights":[0,0]"#)), 0);
}

/// Only a projection has another fourth row, and a matrix that was written row by row.
#[test]
fn a_matrix_with_another_fourth_row_is_refused() {
    let read = |matrix: &str| {
        let json = gltf_json("", &format!(r#","matrix":[{matrix}]"#));
        let glb = glb_of(&json, &gltf_buffer());
        read_bytes(&glb, Format::Gltf, "g", &ReadOptions::as_they_are())
    };
    assert!(read("1,0,0,0, 0,1,0,0, 0,0,1,0, 5,0,0,1").is_ok());
    assert_eq!(
        read("1,0,0,5, 0,1,0,0, 0,0,1,0, 0,0,0,1")
            .unwrap_err()
            .to_string(),
        "g: expected 0, 0, 0, 1 as the fourth row of the matrix of node 0, found 5, 0, 0, 1"
    );
}

#[test]
fn faces_of_a_mirrored_node_are_turned() {
    let faces = |nodes: &str, roots: &str, mode: &str| {
        let json = gltf_json("", "")
            .replace(r#"[{"mesh":0}]"#, nodes)
            .replace(r#"[{"nodes":[0]}]"#, &format!(r#"[{{"nodes":{roots}}}]"#))
            .replace(r#""indices":1}"#, &format!(r#""indices":1{mode}}}"#));
        let glb = glb_of(&json, &gltf_buffer());
        let mesh = read_bytes(&glb, Format::Gltf, "g", &ReadOptions::as_they_are()).or_show();
        triangles(&mesh).to_vec()
    };
    let turned = |faces: &[[u32; 3]]| faces.iter().map(|&[a, b, c]| [a, c, b]).collect::<Vec<_>>();
    // By a scale, by a matrix, and by a parent; two mirrors are none.
    for (nodes, is_mirrored) in [
        (r#"[{"mesh":0,"scale":[-1,1,1]}]"#, true),
        (r#"[{"mesh":0,"scale":[-2,-3,1]}]"#, false),
        (
            r#"[{"mesh":0,"matrix":[0,1,0,0,1,0,0,0,0,0,1,0,5,0,0,1]}]"#,
            true,
        ),
        (
            r#"[{"children":[1],"scale":[1,-1,1]},{"mesh":0,"translation":[1,0,0]}]"#,
            true,
        ),
        (
            r#"[{"children":[1],"scale":[1,-1,1]},{"mesh":0,"scale":[1,1,-1]}]"#,
            false,
        ),
    ] {
        for mode in ["", r#","mode":5"#, r#","mode":6"#] {
            let plain = faces(r#"[{"mesh":0}]"#, "[0]", mode);
            let expected = if is_mirrored { turned(&plain) } else { plain };
            assert_eq!(faces(nodes, "[0]", mode), expected, "{nodes} {mode}");
        }
    }
    // One mesh, used as it is and mirrored: each node has its own faces.
    let plain = faces(r#"[{"mesh":0}]"#, "[0]", "");
    let three = faces(
        r#"[{"mesh":0},{"mesh":0,"scale":[1,1,-1]},{"mesh":0}]"#,
        "[0,1,2]",
        "",
    );
    let moved = |faces: &[[u32; 3]], by| faces.iter().map(|face| face.map(|ix| ix + by)).collect();
    let parts: [Vec<[u32; 3]>; 3] = [plain.clone(), moved(&turned(&plain), 5), moved(&plain, 10)];
    assert_eq!(three, parts.concat());
}

#[test]
fn meshes_outside_the_scene_are_counted() {
    let read = |scene: &str, scenes: &str| {
        let json = gltf_json("", "")
            .replace(r#""scene":0,"#, scene)
            .replace(r#"[{"nodes":[0]}]"#, scenes)
            .replace(
                r#"[{"mesh":0}]"#,
                r#"[{"mesh":0},{"mesh":0},{"children":[3]},{"mesh":0}]"#,
            );
        let glb = glb_of(&json, &gltf_buffer());
        let read = read_bytes_with_summary(&glb, Format::Gltf, "g", &ReadOptions::as_they_are());
        let (mesh, summary) = read.or_show();
        (mesh.n_elements(), summary.n_out_of_scene)
    };
    // Without a choice, the first scene is read.
    assert_eq!(read("", r#"[{"nodes":[0]},{"nodes":[1,2]}]"#), (3, 2));
    let scene = r#""scene":1,"#;
    assert_eq!(read(scene, r#"[{"nodes":[0]},{"nodes":[1,2]}]"#), (6, 1));
    // Nodes of several scenes are not left out, nodes of none are.
    assert_eq!(read(scene, r#"[{"nodes":[0]},{"nodes":[0,1,2]}]"#), (9, 0));
    assert_eq!(read("", r#"[{"nodes":[0,2]}]"#), (6, 1));
    assert_eq!(read("", "[]"), (9, 0));
}
