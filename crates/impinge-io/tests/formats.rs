//! Every format and flavour is read as what it is.

mod common;

use common::{TRIANGLES, VERTICES, glb_of, gltf_buffer, gltf_json, samples};
use impinge_io::{
    Elements, Error, Format, Mesh, Positions, Prefer, ReadOptions, read, read_bytes,
    read_bytes_with_summary, read_tetgen_bytes, read_with_summary,
};

fn load(format: Format, text: &str) -> Result<Mesh, Error> {
    read_bytes(text.as_bytes(), format, "file", &ReadOptions::default())
}

fn triangles(mesh: &Mesh) -> &[[u32; 3]] {
    match &mesh.elements {
        Elements::Triangles(triangles) => triangles,
        Elements::Tetrahedra(_) => panic!("tetrahedra"),
    }
}

fn message(format: Format, text: &str) -> String {
    let message = load(format, text).expect_err(text).to_string();
    assert!(!message.contains('\n'), "{message}");
    message
}

#[test]
fn all_samples() {
    for sample in samples() {
        let mesh = sample
            .read(&sample.bytes)
            .unwrap_or_else(|error| panic!("{}: {error}", sample.name));
        assert_eq!(mesh, sample.mesh, "{}", sample.name);
    }
}

/// Where `$IMPINGE_SEEDS` names a folder (`fuzz/corpus`), the samples go there, for each fuzz target into its own.
#[test]
fn samples_are_seeds_for_fuzzing() {
    let Some(folder) = std::env::var_os("IMPINGE_SEEDS").map(std::path::PathBuf::from) else {
        println!("SKIPPED: IMPINGE_SEEDS is not set, no seeds are written");
        return;
    };
    for sample in samples() {
        let target = format!("{:?}", sample.format).to_ascii_lowercase();
        // The first byte tells that target which kind of file the second one is.
        let kind: &[u8] = if sample.format == Format::Tetgen {
            b"d"
        } else {
            b""
        };
        let folder = folder.join(target);
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join(sample.name), [kind, &sample.bytes].concat()).unwrap();
    }
}

#[test]
fn by_path_and_with_windows_line_ends() {
    let folder = tempfile::tempdir().unwrap();
    for sample in samples()
        .iter()
        .filter(|sample| sample.bytes.is_ascii() && sample.format != Format::Tetgen)
    {
        let extension = match sample.format {
            Format::Obj => "obj",
            Format::Off => "OFF",
            Format::Ply => "ply",
            Format::Stl => "stl",
            Format::Gltf => "gltf",
            Format::Msh => "msh",
            Format::Vtk => "vtk",
            Format::Vtu => "vtu",
            Format::Medit => "mesh",
            other => panic!("{other:?}"),
        };
        if sample.bytes.contains(&0) {
            continue;
        }
        let path = folder.path().join(format!("a b.{extension}"));
        let text = String::from_utf8(sample.bytes.clone())
            .unwrap()
            .replace('\n', "\r\n");
        std::fs::write(&path, text).unwrap();
        assert_eq!(
            read(&path, &ReadOptions::default()).unwrap(),
            sample.mesh,
            "{}",
            sample.name
        );
    }
}

#[test]
fn unknown_extension_and_missing_file() {
    let message = read("a.xyz".as_ref(), &ReadOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        message.starts_with("a.xyz: no mesh format has the extension 'xyz' (known: obj, ply"),
        "{message}"
    );
    let message = read("no/such/file.ply".as_ref(), &ReadOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        message.starts_with("no/such/file.ply: cannot read: "),
        "{message}"
    );
}

#[test]
fn text_is_read_as_f64_without_rounding() {
    // Neighbours of 0.1 in f64 that are one number in f32.
    let (one, other) = (0.1f64, f64::from_bits(0.1f64.to_bits() + 1));
    let obj = format!("v {one} 0 0\nv {other:e} 1 0\nv +1.5E0 -0.0 .5\nf 1 2 3\n");
    let mesh = load(Format::Obj, &obj).unwrap();
    assert_eq!(
        mesh.positions,
        Positions::F64(vec![[one, 0.0, 0.0], [other, 1.0, 0.0], [1.5, -0.0, 0.5]])
    );
}

#[test]
fn obj_polygons_negative_indices_and_continued_lines() {
    let obj = "v 0 0 0 1.0\nv 1 0 0\nv 1 1 0 0.5 0.5 0.5\nvt 0 0\nf 1/1/1 2//3 3/1 4/2 # five is behind\nv 0 1 0\ng other\nf -4 -3\\\n -1\nl 1 2\np 1\nusemtl x\n";
    let (mesh, summary) =
        read_bytes_with_summary(obj.as_bytes(), Format::Obj, "o", &ReadOptions::default())
            .or_show();
    assert_eq!(triangles(&mesh), [[0, 1, 2], [0, 2, 3], [0, 1, 3]]);
    assert_eq!(
        (
            summary.n_polygons_fanned,
            summary.n_lines_skipped,
            summary.n_points_skipped
        ),
        (1, 1, 1)
    );
}

/// Shows the error where there is one.
trait OrShow<T> {
    fn or_show(self) -> T;
}

impl<T> OrShow<T> for Result<T, Error> {
    fn or_show(self) -> T {
        self.unwrap_or_else(|error| panic!("{error}"))
    }
}

#[test]
fn obj_errors_name_the_line_and_both_numbers() {
    for (obj, expected) in [
        (
            "v 0 0 0\nf 1 2 3\n",
            "file:2: vertex index 3 is out of range: 1 vertices, numbered from 1",
        ),
        (
            "v 0 0 0\nv 0 0 0\nf 1 2 -3\n",
            "file:3: vertex index -3 is out of range: 2 vertices, numbered from -2",
        ),
        (
            "v 0 0 0\nf 1 0 1\n",
            "file:2: vertex index 0 is out of range: 1 vertices, numbered from 1",
        ),
        (
            "v 0 0 0\nf 1 1 99999999999\n",
            "file:2: vertex index 99999999999 is out of range: 1 vertices, numbered from 1",
        ),
        ("v 0 0\n", "file:1: expected z, found the end of the line"),
        ("v 0 0 o\n", "file:1: expected z, found 'o'"),
        (
            "v 0 0 1e999\n",
            "file:1: vertex 0 has the coordinate inf, which is not a finite number",
        ),
        (
            "v 0 nan 1\n",
            "file:1: vertex 0 has the coordinate NaN, which is not a finite number",
        ),
        (
            "v 0 0 0\nf 1 1\n",
            "file:2: expected 3 corners of a polygon, or more, found 2",
        ),
        (
            "v 0 0 0\nf 1 x 1\n",
            "file:2: expected a vertex index, found 'x'",
        ),
        (
            "surf 0 1 0 1\n",
            "file:1: free-form geometry ('surf'; only polygons are read) is not supported",
        ),
        (
            "v 0 0 0\nl 1 1\n",
            "file: no triangles or tetrahedra in this file (1 vertices, 0 triangles, 0 tetrahedra, 1 lines, 0 points)",
        ),
    ] {
        assert_eq!(message(Format::Obj, obj), expected);
    }
}

#[test]
fn byte_order_marks_hide_no_vertex() {
    let mesh = load(Format::Obj, "\u{feff}v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").or_show();
    assert_eq!(mesh.n_vertices(), 3);
    let mesh = load(Format::Off, "\u{feff}OFF 1 1 0\n0 0 0\n3 0 0 0\n").or_show();
    assert_eq!(mesh.n_vertices(), 1);
}

#[test]
fn off_variants() {
    for off in [
        "OFF # comment\n# more\n3 1\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "COFF 3 1 0\n0 0 0 255 0 0 255\n1 0 0 1 1 1 1\n0 1 0 1 1 1 1\n\n3 0 1 2 0.5 0.5 0.5\n",
        "NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n",
        "3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2",
        "OFF\n3 3 0\n0 0 0\n1 0 0\n0 1 0\n1 0\n2 0 1\n3 0 1 2\n",
    ] {
        let mesh = load(Format::Off, off).or_show();
        assert_eq!(
            mesh.positions,
            Positions::F64(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
            "{off}"
        );
        assert_eq!(triangles(&mesh), [[0, 1, 2]], "{off}");
    }
    for (off, expected) in [
        (
            "4OFF\n1 0 0\n",
            "file:1: the keyword '4OFF' (vertices have three coordinates here) is not supported",
        ),
        (
            "OFF BINARY\n",
            "file:1: binary OFF (text is) is not supported",
        ),
        (
            "OFF\n3 1 0\n0 0 0\n1 0 0\n",
            "file:5: expected 3 vertices, found 2",
        ),
        (
            "OFF\n1 2 0\n0 0 0\n3 0 0 0\n",
            "file:5: expected 2 faces, found 1",
        ),
        (
            "OFF\n1 1 0\n0 0 0\n3 0 0 1\n",
            "file:4: vertex index 1 is out of range: 1 vertices, numbered from 0",
        ),
        (
            "OFF\n1 1 0\n0 0 0\n3 0 0\n",
            "file:4: expected 3 corners, found 2",
        ),
        (
            "OFF\n1 1 0\n0 0 0\n0\n",
            "file:4: expected 3 corners of a polygon, or more, found 0",
        ),
        (
            "OFF\n-1 1 0\n",
            "file:2: expected the numbers of vertices and faces, found '-1'",
        ),
        (
            "OFF\n5000000000 1 0\n",
            "file:2: number of vertices: 5000000000 is more than the limit of 4294967295",
        ),
    ] {
        assert_eq!(message(Format::Off, off), expected);
    }
}

#[test]
fn ply_strips_tetrahedra_and_other_elements() {
    let head = "ply\nformat ascii 1.0\nobj_info x\nelement other 1\nproperty int a\nproperty list uchar float b\nelement vertex 5\nproperty list uchar int tags\nproperty double z\nproperty double x\nproperty double y\n";
    let body = "1 2 0.5 0.25\n0 0 0 0\n1 9 0 1 0\n0 0 0 1\n0 1 0 0\n0 1 1 1\n";
    let strips = format!(
        "{head}element tristrips 1\nproperty list int int vertex_indices\nelement edge 1\nproperty int a\nend_header\n{body}8 0 1 2 3 -1 4 3 2\n5\n"
    );
    let (mesh, summary) =
        read_bytes_with_summary(strips.as_bytes(), Format::Ply, "p", &ReadOptions::default())
            .or_show();
    assert_eq!(triangles(&mesh), [[0, 1, 2], [2, 1, 3], [4, 3, 2]]);
    assert_eq!(mesh.positions.get(1), Some([1.0, 0.0, 0.0]));
    assert_eq!(mesh.positions.get(3), Some([0.0, 0.0, 1.0]));
    assert_eq!(summary.n_lines_skipped, 1);

    let tets = format!(
        "{head}element face 1\nproperty uchar c\nproperty list uchar int vertex_index\nelement tetra 2\nproperty list uchar int vertex_indices\nend_header\n{body}7 4 0 1 2 3\n4 0 1 2 3\n4 4 3 2 1\n"
    );
    let (mesh, summary) =
        read_bytes_with_summary(tets.as_bytes(), Format::Ply, "p", &ReadOptions::default())
            .or_show();
    assert_eq!(
        mesh.elements,
        Elements::Tetrahedra(vec![[0, 1, 2, 3], [4, 3, 2, 1]])
    );
    assert_eq!(
        (summary.n_triangles_skipped, summary.n_polygons_fanned),
        (2, 1)
    );
    let options = ReadOptions {
        prefer: Prefer::Triangles,
        ..ReadOptions::default()
    };
    let (mesh, summary) =
        read_bytes_with_summary(tets.as_bytes(), Format::Ply, "p", &options).or_show();
    assert_eq!(triangles(&mesh), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(summary.n_tetrahedra_skipped, 2);
    let options = ReadOptions {
        prefer: Prefer::Tetrahedra,
        ..ReadOptions::default()
    };
    let error = read_bytes(strips.as_bytes(), Format::Ply, "p", &options).unwrap_err();
    assert!(
        matches!(
            error,
            Error::NoPrimitives {
                wanted: "tetrahedra",
                n_triangles: 3,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn ply_binary_with_properties_of_all_kinds_around() {
    // A list before the vertices, integer coordinates, and a property on either side of a face's vertices.
    let mut ply = b"ply\nformat binary_big_endian 1.0\nelement list 2\nproperty list ushort short v\nelement face 2\nproperty uchar a\n\
        property list uint8 uint16 vertex_index\nproperty list uchar uchar b\nelement vertex 4\nproperty int16 x\nproperty uint8 y\nproperty int8 z\nend_header\n"
        .to_vec();
    ply.extend([0, 1, 9, 9, 0, 0]);
    ply.extend([7, 4, 0, 0, 0, 1, 0, 2, 0, 3, 1, 5]);
    ply.extend([7, 3, 0, 3, 0, 1, 0, 2, 0]);
    ply.extend([0xff, 0xfe, 200, 0xff, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1]);
    let mesh = read_bytes(&ply, Format::Ply, "p", &ReadOptions::default()).or_show();
    assert_eq!(
        mesh.positions,
        Positions::F32(vec![
            [-2.0, 200.0, -1.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [256.0, 0.0, 1.0]
        ])
    );
    assert_eq!(triangles(&mesh), [[0, 1, 2], [0, 2, 3], [3, 1, 2]]);
}

#[test]
fn ply_errors() {
    let vertices = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
    let faces = format!(
        "{vertices}element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n"
    );
    for (ply, expected) in [
        ("plY\n".to_owned(), "file:1: expected 'ply', found 'plY'"),
        ("ply\nformat ascii 1.0\nend_header\n".into(), "file:4: expected an element 'vertex' in the header, found none"),
        ("ply\nformat text 1.0\n".into(), "file:2: expected 'ascii', 'binary_little_endian' or 'binary_big_endian', found 'text'"),
        ("ply\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n".into(), "file:6: expected a line 'format' in the header, found none"),
        ("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n".into(), "file:3: expected a property 'z' of the element 'vertex', found none"),
        (format!("{vertices}element face 1\nproperty list uchar float vertex_indices\nend_header\n0 0 0\n"), "file:7: expected an integer type for vertex indices, found a floating one"),
        (format!("{vertices}element face 1\nproperty int a\nend_header\n0 0 0\n1\n"), "file:7: expected a list 'vertex_indices' of the element 'face', found none"),
        (format!("{faces}3 0 0 1\n"), "file:11: vertex index 1 is out of range: 1 vertices, numbered from 0"),
        (format!("{faces}3 0 0 -1\n"), "file:11: vertex index -1 is out of range: 1 vertices, numbered from 0"),
        (format!("{faces}3 0 0\n"), "file:11: expected an item of a list, found the end of the line"),
        (format!("{faces}3 0 0 0 0\n"), "file:11: expected the end of the line, found '0'"),
        (format!("{faces}2 0 0\n"), "file:11: expected 3 corners of a polygon, or more, found 2"),
        (faces.clone(), "file:11: expected 1 records of the element 'face', found 0"),
    ] {
        assert_eq!(message(Format::Ply, &ply), expected);
    }
}

#[test]
fn stl_of_several_solids() {
    let facet =
        "FACET NORMAL 0 0 1 OUTER LOOP VERTEX 0 0 0 VERTEX 1 0 0 VERTEX 0 1 0 ENDLOOP ENDFACET";
    let mesh = load(
        Format::Stl,
        &format!("solid\n{facet}\nendsolid\nsolid facet\n{facet}\nendsolid facet\n"),
    )
    .or_show();
    assert_eq!(triangles(&mesh), [[0, 1, 2], [3, 4, 5]]);
    let options = ReadOptions {
        weld: true,
        ..ReadOptions::default()
    };
    let (mesh, summary) = read_bytes_with_summary(
        format!("solid a\n{facet}\n{facet}\nendsolid").as_bytes(),
        Format::Stl,
        "s",
        &options,
    )
    .or_show();
    assert_eq!(triangles(&mesh), [[0, 1, 2], [0, 1, 2]]);
    assert_eq!((mesh.n_vertices(), summary.n_welded), (3, 3));
    assert_eq!(
        message(Format::Stl, "solid\nfacet normal 0 0 1\nouter\nvertex"),
        "file:4: expected 'loop', found 'vertex'"
    );
    assert_eq!(
        message(Format::Stl, &format!("solid\n{facet}\n")),
        "file:3: expected 'endsolid', found the end of the file"
    );
    assert_eq!(
        message(Format::Stl, "garbage"),
        "file: byte 0: the title needs 80 bytes, but 7 are left"
    );
}

#[test]
fn gltf_transforms_multiply_down_the_tree() {
    let turned = r#","rotation":[0,0,0.7071067811865476,0.7071067811865476],"scale":[2,2,2],"translation":[10,0,0]"#;
    let mesh = read_bytes(
        &glb_of(&gltf_json("", turned), &gltf_buffer()),
        Format::Gltf,
        "g",
        &ReadOptions::default(),
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

    // A parent that moves, children that use the mesh twice, once as a matrix.
    let json = gltf_json("", "").replace(
        r#"[{"mesh":0}]"#,
        r#"[{"children":[1,2],"translation":[1,0,0]},{"mesh":0},{"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,5,1]}]"#,
    );
    let mesh = read_bytes(
        &glb_of(&json, &gltf_buffer()),
        Format::Gltf,
        "g",
        &ReadOptions::default(),
    )
    .or_show();
    assert_eq!((mesh.n_vertices(), mesh.n_primitives()), (10, 6));
    assert_eq!(mesh.positions.get(1), Some([2.0, 0.0, 0.0]));
    assert_eq!(mesh.positions.get(6), Some([2.0, 0.0, 5.0]));
    assert_eq!(triangles(&mesh)[3], TRIANGLES[0].map(|ix| ix + 5));
}

#[test]
fn gltf_modes_shared_positions_and_external_buffers() {
    // Two primitives of one mesh share their positions: a strip, and a fan without indices.
    let json = gltf_json(r#","uri":"my%20data.bin""#, "")
        .replace(r#""indices":1}"#, r#""indices":1,"mode":5},{"attributes":{"POSITION":0},"mode":6},{"attributes":{"POSITION":0},"mode":1}"#);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("my data.bin"), gltf_buffer()).unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, &json).unwrap();
    let (mesh, summary) = read_with_summary(&path, &ReadOptions::default()).or_show();
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
        "file: buffer 0 at 'my%20data.bin' (files beside a mesh in memory are not read) is not supported"
    );
    for outside in ["/etc/passwd", "file:///etc/passwd", "http://a/b"] {
        std::fs::write(&path, json.replace("my%20data.bin", outside)).unwrap();
        let error = read(&path, &ReadOptions::default()).unwrap_err();
        assert!(matches!(error, Error::Unsupported { .. }), "{error}");
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
        &ReadOptions::default(),
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
        &ReadOptions::default(),
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
            "file: 10 values in buffer view 1 needs 20 bytes, but 18 are left",
        ),
        (
            r#""count":9"#,
            r#""count":8"#,
            "file: expected 9 indices of triangles, found 8",
        ),
        (
            r#""count":5"#,
            r#""count":4"#,
            "file: vertex index 4 is out of range: 4 vertices, numbered from 0",
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
            "file: the extension 'KHR_draco_mesh_compressi…' is not supported",
        ),
        (
            r#""byteLength":18"#,
            r#""byteLength":9000"#,
            "file: buffer view 1 needs 9060 bytes, but 80 are left",
        ),
        (
            r#""byteLength":80"#,
            r#""byteLength":81"#,
            "file: buffer 0 needs 81 bytes, but 80 are left",
        ),
        (
            r#""2.0""#,
            r#""1.0""#,
            "file: glTF version '1.0' (2.x is) is not supported",
        ),
    ] {
        let broken = json.replace(from, to);
        assert_ne!(broken, json);
        let error = read_bytes(
            &glb_of(&broken, &gltf_buffer()),
            Format::Gltf,
            "file",
            &ReadOptions::default(),
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
    let options = ReadOptions::default();
    assert_eq!(
        read_bytes(&glb, Format::Gltf, "g", &options)
            .or_show()
            .n_primitives(),
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
fn msh_tags_with_gaps_are_numbered_in_order() {
    let msh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n70 0 0 0\n7 1 0 0\n900 0 1 0\n-8 0 0 1\n$EndNodes\n$Elements\n3\n1 2 2 0 0 70 900 7\n2 3 2 0 0 7 70 900 -8\n3 1 0 7 70\n$EndElements\n";
    let (mesh, summary) =
        read_bytes_with_summary(msh.as_bytes(), Format::Msh, "m", &ReadOptions::default())
            .or_show();
    assert_eq!(triangles(&mesh), [[0, 2, 1], [1, 0, 2], [1, 2, 3]]);
    assert_eq!(mesh.positions.get(3), Some([0.0, 0.0, 1.0]));
    assert_eq!((summary.n_lines_skipped, summary.n_polygons_fanned), (1, 1));
}

#[test]
fn msh_errors() {
    let start = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
    let nodes = format!("{start}$Nodes\n2\n1 0 0 0\n5 1 0 0\n$EndNodes\n");
    for (msh, expected) in [
        ("$Nodes\n".to_owned(), "file:1: expected '$MeshFormat', found '$Nodes'"),
        ("$MeshFormat\n4 0 8\n".into(), "file:2: MSH version '4' (2.0 to 2.2 and 4.1 are) is not supported"),
        (format!("{nodes}$Elements\n1\n1 4 0 1 5 5 2\n$EndElements\n"), "file:11: expected the tag of one of the 2 nodes, found 2"),
        (format!("{nodes}$Elements\n1\n1 5 0 1 5 5 2 1 1 1 1\n$EndElements\n"), "file:11: element type 5 (hexahedra; triangles, quadrangles and tetrahedra are) is not supported"),
        (format!("{nodes}$Elements\n1\n1 11 0 1\n"), "file:11: element type 11 (of higher order; triangles, quadrangles and tetrahedra are) is not supported"),
        (format!("{nodes}$Elements\n1\n1 999 0 1\n"), "file:11: expected an element type, found 999"),
        (format!("{nodes}$Elements\n2\n1 2 0 1 1 1\n$EndElements\n"), "file:12: expected an element's number, found '$EndElements'"),
        (format!("{start}$Nodes\n2\n1 0 0 0\n1 1 0 0\n$EndNodes\n"), "file:4: expected a tag of its own for each node, found the tag 1 twice"),
        (format!("{start}$Elements\n"), "file:4: expected $Nodes before $Elements, found none"),
        (format!("{start}$Other\n$EndOthe"), "file:4: expected '$EndOther', found the end of the file"),
        ("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 3 1 2\n3 0 0 2\n1\n2\n0 0 0\n1 0 0\n$EndNodes\n".into(), "file:4: expected 3 nodes, found 2"),
    ] {
        assert_eq!(message(Format::Msh, &msh), expected);
    }
}

#[test]
fn msh_parametric_nodes() {
    let msh = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 3 1 3\n2 0 1 3\n1\n2\n3\n0 0 0 9 9\n1 0 0 9 9\n0 1 0 9 9\n$EndNodes\n$Elements\n1 1 1 1\n2 0 2 1\n1 1 2 3\n$EndElements\n";
    let mesh = load(Format::Msh, msh).or_show();
    assert_eq!(
        mesh.positions,
        Positions::F64(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    );
}

#[test]
fn vtk_cells_of_all_kinds() {
    let vtk = "# vtk DataFile Version 2.0\n\nascii\ndataset unstructured_grid\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 1 1 0\nCELLS 7 27\n\
        3 0 1 2\n4 0 1 2 3\n4 0 1 2 3\n4 0 1 2 3\n1 0\n2 0 1\n2 1 2\nCELL_TYPES 7\n5 8 9 6 1 3 3\nPOINT_DATA 4\nanything";
    let (mesh, summary) =
        read_bytes_with_summary(vtk.as_bytes(), Format::Vtk, "v", &ReadOptions::default())
            .or_show();
    assert_eq!(
        triangles(&mesh),
        [
            [0, 1, 2],
            [0, 1, 3],
            [0, 3, 2],
            [0, 1, 2],
            [0, 2, 3],
            [0, 1, 2],
            [2, 1, 3]
        ]
    );
    assert_eq!(
        (
            summary.n_points_skipped,
            summary.n_lines_skipped,
            summary.n_polygons_fanned
        ),
        (1, 2, 2)
    );

    let vtk = "# vtk DataFile Version 5.1\nt\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 1 1 0\nVERTICES 2 1\nOFFSETS vtktypeint64\n0 1\nCONNECTIVITY vtktypeint64\n0\n\
        TRIANGLE_STRIPS 2 4\nOFFSETS vtktypeint64\n0 4\nCONNECTIVITY vtktypeint64\n0 1 2 3\nMETADATA\nINFORMATION 0\n\nPOLYGONS 2 3\nOFFSETS vtktypeint64\n0 3\nCONNECTIVITY vtktypeint64\n3 2 1\n";
    assert_eq!(
        triangles(&load(Format::Vtk, vtk).or_show()),
        [[0, 1, 2], [2, 1, 3], [3, 2, 1]]
    );
}

#[test]
fn vtk_errors() {
    let start = "# vtk DataFile Version 2.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 2 float\n0 0 0 1 0 0\n";
    for (vtk, expected) in [
        (
            "# vtk\n".to_owned(),
            "file:1: expected '# vtk DataFile Version', found '# vtk'",
        ),
        (
            "# vtk DataFile Version 2.0\nt\nASCII\nDATASET STRUCTURED_GRID\n".into(),
            "file:4: the dataset 'STRUCTURED_GRID' (UNSTRUCTURED_GRID and POLYDATA are) is not supported",
        ),
        (
            format!("{start}CELLS 1 4\n3 0 1\n2\nCELL_TYPES 1 5\n"),
            "file:8: vertex index 2 is out of range: 2 vertices, numbered from 0",
        ),
        (
            format!("{start}CELLS 1 9\n8\n0 0 0 0 0 0 0 0\nCELL_TYPES 1\n12\n"),
            "file:11: cell type 12 (hexahedra; triangles, polygons and tetrahedra are) is not supported",
        ),
        (
            format!("{start}CELLS 1 4\n4 0 1 0\n"),
            "file:8: expected the size of cell 0, 0 to 3, found 4",
        ),
        (
            format!("{start}CELLS 2 4\n3 0 1 0\n"),
            "file:7: expected 2 cells, found 1",
        ),
        (
            format!("{start}CELLS 1 4\n3 0 1 0\nCELL_TYPES 2\n5 5\n"),
            "file:9: expected 1 cell types, found 2",
        ),
        (
            format!("{start}CELLS 1 4\n3 0 1 0\n"),
            "file:9: expected CELL_TYPES, found none",
        ),
        (
            format!("{start}CELLS 1 5\n4 0 1 0 0\nCELL_TYPES 1\n5\n"),
            "file:10: expected 3 points of a cell of type 5, found 4",
        ),
        (
            format!("{start}SOMETHING\n"),
            "file:7: expected a section of the dataset, found 'SOMETHING'",
        ),
    ] {
        assert_eq!(message(Format::Vtk, &vtk), expected);
    }
}

#[test]
fn vtu_pieces_and_errors() {
    let piece = "<Piece NumberOfPoints=\"3\" NumberOfCells=\"1\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\">0 0 0 0.1 0 0 0 1 0</DataArray></Points>\
        <Cells><DataArray type=\"Int32\" Name=\"connectivity\">0 1 2</DataArray><DataArray type=\"Int32\" Name=\"offsets\">3</DataArray><DataArray type=\"UInt8\" Name=\"types\">5</DataArray></Cells></Piece>";
    let file = |pieces: &str| {
        format!(
            "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid>{pieces}</UnstructuredGrid></VTKFile>"
        )
    };
    let mesh = load(
        Format::Vtu,
        &file(&(piece.to_owned() + "<Piece NumberOfPoints=\"0\" NumberOfCells=\"0\"/>" + piece)),
    )
    .or_show();
    assert_eq!(mesh.n_vertices(), 6);
    assert_eq!(mesh.positions.get(4), Some([0.1, 0.0, 0.0]));
    assert_eq!(triangles(&mesh), [[0, 1, 2], [3, 4, 5]]);
    for (from, to, expected) in [
        (
            "0 1 2<",
            "0 1 3<",
            "vertex index 3 is out of range: 3 vertices, numbered from 0",
        ),
        (
            "0 1 2<",
            "0 1 -1<",
            "vertex index -1 is out of range: 3 vertices, numbered from 0",
        ),
        (
            ">3<",
            ">4<",
            "expected an offset of cell 0 from 0 to 3, found 4",
        ),
        (">3<", ">3 3<", "expected 1 offsets of cells, found 2"),
        (
            ">5<",
            ">14<",
            "cell type 14 (pyramids; triangles, polygons and tetrahedra are) is not supported",
        ),
        ("0 1 0<", "0 1<", "expected 9 coordinates, found 8"),
        ("0 1 0<", "0 1 x<", "expected a number, found 'x'"),
        (
            "0 1 0<",
            "0 1 inf<",
            "vertex 2 has the coordinate inf, which is not a finite number",
        ),
        (
            "type=\"Int32\" Name=\"off",
            "type=\"int\" Name=\"off",
            "expected a type of numbers, found 'int'",
        ),
        (
            "Name=\"offsets\"",
            "Name=\"offset\"",
            "expected a 'DataArray' named 'offsets', found none",
        ),
        (
            "NumberOfPoints=\"3\"",
            "NumberOfPoints=\"x\"",
            "expected a number in 'NumberOfPoints', found 'x'",
        ),
        (
            "type=\"UnstructuredGrid\"",
            "type=\"ImageData\"",
            "the VTK file type 'ImageData' (UnstructuredGrid is) is not supported",
        ),
        (
            "<VTKFile",
            "<VTKFile compressor=\"vtkLZMADataCompressor\"",
            "the compressor 'vtkLZMADataCompressor' (zlib and LZ4 are) is not supported",
        ),
    ] {
        let broken = file(piece).replace(from, to);
        assert_ne!(broken, file(piece));
        let message = message(Format::Vtu, &broken);
        assert!(
            message.starts_with("file: byte ") && message.ends_with(expected),
            "{message}"
        );
    }
    assert!(
        message(Format::Vtu, "<VTKFile>\n<a></b>")
            .starts_with("file: byte 13: expected well-formed XML, found ")
    );
}

#[test]
fn vtu_compressed_data_is_held_to_what_it_says() {
    let vtu = String::from_utf8(common::vtu(common::VtuStorage::InlineZlib)).unwrap();
    // The header of the points: 2 blocks of 31 bytes, 29 in the last one. Let it say 2^31 - 1 of 31.
    let header = |block: u32| {
        let words = [2, block, 29].map(u32::to_le_bytes);
        common::base64(&words.concat())
    };
    let lying = vtu.replace(&header(31), &header(0x7fff_ffff));
    assert_ne!(lying, vtu);
    assert_eq!(
        message(Format::Vtu, &lying),
        "file: byte 217: length of block 1 out of 17 bytes: 2147483647 is more than the limit of 18764"
    );
}

#[test]
fn medit_errors_and_sections() {
    let start =
        "MeshVersionFormatted 1\nDimension 3\nVertices 4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n1 1 0 0\n";
    let (mesh, summary) = read_bytes_with_summary(
        format!("{start}Corners\n2\n1 2\nQuadrilaterals 1\n1 2 4 3 7\nNormals 1\n0 0 1e-3\nTriangles 1\n1 2 3 0\nHexahedra 0\nEnd\nTriangles 9").as_bytes(),
        Format::Medit,
        "m",
        &ReadOptions::default(),
    )
    .or_show();
    assert_eq!(triangles(&mesh), [[0, 1, 3], [0, 3, 2], [0, 1, 2]]);
    assert_eq!(
        (summary.n_points_skipped, summary.n_polygons_fanned),
        (2, 1)
    );
    for (more, expected) in [
        (
            "Triangles 1\n1 2 5 0\n",
            "file:9: vertex index 5 is out of range: 4 vertices, numbered from 1",
        ),
        (
            "Triangles 2\n1 2 3 0\n",
            "file:10: expected a vertex index, found the end of the file",
        ),
        (
            "Hexahedra 1\n1 2 3 4 1 2 3 4 0\n",
            "file:8: the section 'Hexahedra' of 1 cells (triangles, quadrilaterals and tetrahedra are) is not supported",
        ),
        (
            "Vertices 1\n",
            "file:8: expected one section 'Vertices', found a second one",
        ),
        ("7\n", "file:8: expected a keyword, found '7'"),
    ] {
        assert_eq!(message(Format::Medit, &format!("{start}{more}")), expected);
    }
    assert_eq!(
        message(Format::Medit, "MeshVersionFormatted 1\nDimension 2\n"),
        "file:2: dimension 2 (3 is) is not supported"
    );
}

#[test]
fn tetgen_files_find_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("a.node", "4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n");
    write("a.face", "1 1\n1 1 2 3 -1\n");
    let options = ReadOptions::default();
    let mesh = read(&folder.path().join("a.node"), &options).or_show();
    assert_eq!(triangles(&mesh), [[0, 1, 2]]);
    write("a.ele", "1 4 0\n1 4 3 2 1\n");
    for name in ["a.node", "a.ele"] {
        let mesh = read(&folder.path().join(name), &options).or_show();
        assert_eq!(mesh.elements, Elements::Tetrahedra(vec![[3, 2, 1, 0]]));
    }
    assert_eq!(
        read(&folder.path().join("a.face"), &options)
            .or_show()
            .n_primitives(),
        1
    );

    let nodes = "2 3 0 0\n0 0 0 0\n1 1 0 0\n";
    for (nodes, cells, expected) in [
        (
            nodes,
            "1 4 0\n0 0 1 2 0\n",
            "e.ele:2: vertex index 2 is out of range: 2 vertices, numbered from 0",
        ),
        (
            nodes,
            "1 10 0\n",
            "e.ele:1: a tetrahedron of 10 nodes (4 is) is not supported",
        ),
        (
            nodes,
            "2 4 0\n0 0 1 1 0\n",
            "e.ele:3: expected 2 cells, found 1",
        ),
        (
            "2 3 0 0\n0 0 0 0\n2 1 0 0\n",
            "",
            "n.node:3: expected vertex number 1, found 2",
        ),
        (
            "2 3 0 0\n5 0 0 0\n",
            "",
            "n.node:2: expected the number of the first vertex, 0 or 1, found 5",
        ),
        (
            "2 2 0 0\n",
            "",
            "n.node:1: dimension 2 (3 is) is not supported",
        ),
        (
            "2 3 0 0\n0 0 0 0\n",
            "",
            "n.node:3: expected 2 vertices, found 1",
        ),
    ] {
        let error = read_tetgen_bytes(
            nodes.as_bytes(),
            "n.node",
            cells.as_bytes(),
            "e.ele",
            &options,
        )
        .unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
}

#[test]
fn vtu_of_any_shape_takes_linear_time() {
    // A parser that checks each attribute or namespace against all others takes minutes for these.
    let n = 200_000;
    let attributes: String = (0..n).map(|ix| format!(" a{ix}=''")).collect();
    let namespaces: String = (0..n)
        .map(|ix| format!("<a xmlns:n{ix}='u{ix}'>"))
        .collect();
    let start = std::time::Instant::now();
    for xml in [
        format!("<VTKFile type='UnstructuredGrid'><a{attributes}/></VTKFile>"),
        format!(
            "<VTKFile type='UnstructuredGrid'>{namespaces}{}</VTKFile>",
            "</a>".repeat(n)
        ),
    ] {
        assert_eq!(
            message(Format::Vtu, &xml),
            "file: byte 0: expected an element 'UnstructuredGrid', found none"
        );
    }
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}
