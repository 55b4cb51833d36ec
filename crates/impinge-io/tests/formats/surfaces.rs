//! OBJ, OFF, PLY and STL.

use crate::*;

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
    let (mesh, summary) = read_bytes_with_summary(
        obj.as_bytes(),
        Format::Obj,
        "o",
        &ReadOptions::as_they_are(),
    )
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

#[test]
fn a_concave_polygon_is_cut_inside_whichever_corner_comes_first() {
    let vertices = "v 0 0 0\nv 4 0 0\nv 0.5 0.5 0\nv 0 4 0\n";
    for (face, expected) in [
        ("f 1 2 3 4\n", [[0, 1, 2], [0, 2, 3]]),
        ("f 2 3 4 1\n", [[0, 1, 2], [2, 3, 0]]),
    ] {
        // Also where the face comes before its vertices.
        for obj in [format!("{vertices}{face}"), format!("{face}{vertices}")] {
            assert_eq!(triangles(&load(Format::Obj, &obj).unwrap()), expected);
        }
    }
}

#[test]
fn obj_errors_name_the_line_and_both_numbers() {
    for (obj, expected) in [
        (
            "v 0 0 0\nf 1 2 3\n",
            "file:2: vertex index 3 is out of range; vertices: 1, numbered from 1",
        ),
        (
            "v 0 0 0\nv 0 0 0\nf 1 2 -3\n",
            "file:3: vertex index -3 is out of range; vertices: 2, numbered from -2",
        ),
        (
            "v 0 0 0\nf 1 0 1\n",
            "file:2: vertex index 0 is out of range; vertices: 1, numbered from 1",
        ),
        (
            "v 0 0 0\nf 1 1 99999999999\n",
            "file:2: vertex index 99999999999 is out of range; vertices: 1, numbered from 1",
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
            "v 0 0 0\nf\n",
            "file:2: expected 3 corners of a polygon, or more, found 0",
        ),
        (
            "v 0 0 0\nf 1 1\n",
            "file: no triangles or tetrahedra in this file (vertices: 1, triangles: 0, tetrahedra: 0, lines: 1, points: 0)",
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
            "file: no triangles or tetrahedra in this file (vertices: 1, triangles: 0, tetrahedra: 0, lines: 1, points: 0)",
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
fn obj_faces_of_one_or_two_corners_are_counted_and_skipped() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\nf 1 2 3\nf 3\nf -1/1 -2/1\n";
    let options = ReadOptions::as_they_are();
    let (mesh, summary) =
        read_bytes_with_summary(obj.as_bytes(), Format::Obj, "file", &options).or_show();
    assert_eq!(triangles(&mesh), [[0, 1, 2]]);
    assert_eq!((summary.n_lines_skipped, summary.n_points_skipped), (2, 1));
    // Their vertices must exist.
    assert_eq!(
        message(Format::Obj, "v 0 0 0\nf 1 2\n"),
        "file:2: vertex index 2 is out of range; vertices: 1, numbered from 1"
    );
}

#[test]
fn obj_lines_whose_first_word_is_not_known_are_said() {
    let notes = |lines: &str| {
        let obj = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n{lines}");
        let options = ReadOptions::as_they_are();
        let (mesh, summary) =
            read_bytes_with_summary(obj.as_bytes(), Format::Obj, "file", &options).or_show();
        assert_eq!(triangles(&mesh), [[0, 1, 2]]);
        summary.notes()
    };
    let said =
        "lines skipped, whose first word is not known: 3, the first of them line 6, 'F 1 2 3'";
    assert_eq!(
        notes("# comment\nF 1 2 3\nfoo 1 \\\n2\n\ngarbage line here\n"),
        [said]
    );
    let known = "vn 0 0 1\nvt 0 0\ng a\no b\ns off\nmg 1 2\nusemtl m\nmtllib m.mtl\nusemap off\nmaplib x\nbevel on\n\
        c_interp off\nd_interp off\nlod 1\nshadow_obj x\ntrace_obj x\nctech cparm 1\nstech curv 1\ncstype bezier\ndeg 3\n\
        bmat u 1\nstep 1\nparm u 0 1\ntrim 0 1 1\nhole 0 1 1\nscrv 0 1 1\nsp 1\nend\ncon 1 1 1 1\nres 1 1\np 1\n\t\n#\n";
    assert_eq!(notes(known), [""; 0]);
}

/// A binary OFF file: numbers of 32 bits, the most significant byte first.
fn binary_off(keyword: &str, vertices: &[&[f32]], faces: &[(&[i32], &[f32])]) -> Vec<u8> {
    let mut bytes = format!("{keyword} BINARY\n").into_bytes();
    let int = |bytes: &mut Vec<u8>, n: i32| bytes.extend(n.to_be_bytes());
    let floats = |bytes: &mut Vec<u8>, all: &[f32]| {
        bytes.extend(all.iter().flat_map(|x| x.to_be_bytes()));
    };
    for n in [vertices.len(), faces.len(), 0] {
        int(&mut bytes, n as i32);
    }
    for vertex in vertices {
        floats(&mut bytes, vertex);
    }
    for (corners, color) in faces {
        int(&mut bytes, corners.len() as i32);
        for &corner in *corners {
            int(&mut bytes, corner);
        }
        int(&mut bytes, color.len() as i32);
        floats(&mut bytes, color);
    }
    bytes
}

#[test]
fn off_binary() {
    let read = |bytes: &[u8]| {
        read_bytes_with_summary(bytes, Format::Off, "file", &ReadOptions::as_they_are())
    };
    let (a, b, c) = ([0.5, -0.0, 0.0], [1.0, 0.0, 1e-40], [0.0, 1.0, 3e38]);
    let faces: [(&[i32], &[f32]); 3] = [
        (&[0, 1, 2], &[0.5; 4]),
        (&[0, 2], &[]),
        (&[0, 1, 2, 1], &[]),
    ];
    let with = |extra: usize| [a, b, c].map(|p| [&p[..], &vec![9.0; extra][..]].concat());
    for (keyword, extra) in [("OFF", 0), ("NOFF", 3), ("COFF", 4), ("STCNOFF", 9)] {
        let vertices = with(extra);
        let vertices: Vec<&[f32]> = vertices.iter().map(Vec::as_slice).collect();
        let bytes = binary_off(keyword, &vertices, &faces);
        let (mesh, summary) = read(&bytes).or_show();
        assert_eq!(mesh.positions, Positions::F32(vec![a, b, c]), "{keyword}");
        assert_eq!(
            triangles(&mesh),
            [[0, 1, 2], [0, 1, 2], [0, 2, 1]],
            "{keyword}"
        );
        assert_eq!(summary.n_lines_skipped, 1);
        // Cut off anywhere it is an error.
        for n in 0..bytes.len() {
            read(&bytes[..n]).unwrap_err();
        }
    }
    let vertices: [&[f32]; 3] = [&a, &b, &c];
    let error = |faces: &[(&[i32], &[f32])], vertices: &[&[f32]]| {
        read(&binary_off("OFF", vertices, faces))
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        error(&[(&[0, 1, 3], &[])], &vertices),
        "file: byte 59: vertex index 3 is out of range; vertices: 3, numbered from 0"
    );
    assert_eq!(
        error(&[(&[], &[])], &vertices),
        "file: byte 59: expected 3 corners of a polygon, or more, found 0"
    );
    assert_eq!(
        error(&[], &[&a, &[0.0, f32::NAN, 0.0]]),
        "file: byte 35: vertex 1 has the coordinate NaN, which is not a finite number"
    );
    let mut hostile = b"OFF BINARY\n".to_vec();
    hostile.extend([i32::MAX, i32::MAX, 0].iter().flat_map(|n| n.to_be_bytes()));
    assert!(
        read(&hostile)
            .unwrap_err()
            .to_string()
            .contains("vertices: 25769803764 bytes")
    );
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
            "file: byte 11: the number of vertices: 4 bytes are needed, but 0 are left",
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
            "file:4: vertex index 1 is out of range; vertices: 1, numbered from 0",
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
    let (mesh, summary) = read_bytes_with_summary(
        strips.as_bytes(),
        Format::Ply,
        "p",
        &ReadOptions::as_they_are(),
    )
    .or_show();
    assert_eq!(triangles(&mesh), [[0, 1, 2], [2, 1, 3], [4, 3, 2]]);
    assert_eq!(mesh.positions.get(1), Some([1.0, 0.0, 0.0]));
    assert_eq!(mesh.positions.get(3), Some([0.0, 0.0, 1.0]));
    assert_eq!(summary.n_lines_skipped, 1);

    let tets = format!(
        "{head}element face 1\nproperty uchar c\nproperty list uchar int vertex_index\nelement tetra 2\nproperty list uchar int vertex_indices\nend_header\n{body}7 4 0 1 2 3\n4 0 1 2 3\n4 4 3 2 1\n"
    );
    let (mesh, summary) = read_bytes_with_summary(
        tets.as_bytes(),
        Format::Ply,
        "p",
        &ReadOptions::as_they_are(),
    )
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
        ..ReadOptions::as_they_are()
    };
    let (mesh, summary) =
        read_bytes_with_summary(tets.as_bytes(), Format::Ply, "p", &options).or_show();
    assert_eq!(triangles(&mesh), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(summary.n_tetrahedra_skipped, 2);
    let options = ReadOptions {
        prefer: Prefer::Tetrahedra,
        ..ReadOptions::as_they_are()
    };
    let error = read_bytes(strips.as_bytes(), Format::Ply, "p", &options).unwrap_err();
    assert!(
        matches!(
            error,
            Error::NoElements {
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
    // A list before the vertices, integer coordinates, and a property on either side of a face's
    // vertices.
    let mut ply = b"ply\nformat binary_big_endian 1.0\nelement list 2\nproperty list ushort short v\nelement face 2\nproperty uchar a\n\
        property list uint8 uint16 vertex_index\nproperty list uchar uchar b\nelement vertex 4\nproperty int16 x\nproperty uint8 y\nproperty int8 z\nend_header\n"
        .to_vec();
    ply.extend([0, 1, 9, 9, 0, 0]);
    ply.extend([7, 4, 0, 0, 0, 1, 0, 2, 0, 3, 1, 5]);
    ply.extend([7, 3, 0, 3, 0, 1, 0, 2, 0]);
    ply.extend([0xff, 0xfe, 200, 0xff, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1]);
    let mesh = read_bytes(&ply, Format::Ply, "p", &ReadOptions::as_they_are()).or_show();
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
        (format!("{faces}3 0 0 1\n"), "file:11: vertex index 1 is out of range; vertices: 1, numbered from 0"),
        (format!("{faces}3 0 0 -1\n"), "file:11: vertex index -1 is out of range; vertices: 1, numbered from 0"),
        (format!("{faces}3 0 0\n"), "file:11: expected an item of a list, found the end of the line"),
        (format!("{faces}3 0 0 0 0\n"), "file:11: expected the end of the line, found '0'"),
        (format!("{faces}2 0 0\n"), "file:11: expected 3 corners of a polygon, or more, found 2"),
        (faces.clone(), "file:11: expected 1 records of the element 'face', found 0"),
    ] {
        assert_eq!(message(Format::Ply, &ply), expected);
    }
    let binary = |n_bytes: usize| {
        let header = faces
            .replace("ascii", "binary_little_endian")
            .replace("face 1", "face 5")
            .replace("vertex 1", "vertex 2");
        let header = header.split_inclusive("end_header\n").next().unwrap();
        let data = [
            &[0; 24][..],
            &[3, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0].repeat(5),
        ]
        .concat();
        let bytes = [header.as_bytes(), &data[..n_bytes]].concat();
        let read = read_bytes(&bytes, Format::Ply, "file", &ReadOptions::default());
        let text = read.unwrap_err().to_string();
        text.split_once("expected ")
            .unwrap_or(("", &text))
            .1
            .to_owned()
    };
    assert_eq!(binary(23), "2 records of the element 'vertex', found 1");
    assert_eq!(binary(24), "5 records of the element 'face', found 0");
    assert_eq!(
        binary(24 + 3 * 13),
        "5 records of the element 'face', found 3"
    );
    // In the midst of one.
    assert!(binary(24 + 3 * 13 + 5).ends_with("a list: 12 bytes are needed, but 4 are left"));
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
        ..ReadOptions::as_they_are()
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
    for (text, found) in [("garbage", "other text"), ("", "an empty file")] {
        let expected = "an STL file: text that begins with 'solid', or a binary file";
        assert_eq!(
            message(Format::Stl, text),
            format!("file: expected {expected}, found {found}")
        );
    }
    assert_eq!(
        message(Format::Stl, "cut\0"),
        "file: byte 0: the title: 80 bytes are needed, but 4 are left"
    );
}

#[test]
fn bytes_that_are_no_obj_file_are_refused_as_such() {
    let noise: Vec<u8> = (0..4000u32)
        .map(|i| ((i * i * 7 + i * 131) >> 3) as u8)
        .collect();
    // In much noise, some lines begin as those of a mesh.
    for lines in [&b""[..], b"\ns \xff\nl 2\n", b"\nv \xc0 1 2\n", b"\nf \0\n"] {
        let bytes = [&noise, lines].concat();
        let error = read_bytes(&bytes, Format::Obj, "noise.obj", &ReadOptions::default());
        let text = error.unwrap_err().to_string();
        assert!(
            text.starts_with("noise.obj: expected the text of an OBJ file"),
            "{text}"
        );
    }
}

#[test]
fn what_follows_the_announced_data_is_counted() {
    let beyond = |format, bytes: &[u8]| {
        let read = read_bytes_with_summary(bytes, format, "f", &ReadOptions::as_they_are());
        let (mesh, summary) = read.or_show();
        assert_eq!(mesh.n_elements(), 1);
        summary.n_bytes_beyond
    };
    let off = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let binary_ply = [
        ply.replace("ascii", "binary_little_endian")
            .split_inclusive("end_header\n")
            .next()
            .unwrap()
            .as_bytes(),
        &[0; 36],
        &[3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0],
    ]
    .concat();
    let binary_off = [
        &b"OFF BINARY\n"[..],
        &Order::Big.i32s([3, 1, 0]),
        &[0; 36],
        &Order::Big.i32s([3, 0, 1, 2, 0]),
    ]
    .concat();
    let stl = [&[0; 80][..], &[1, 0, 0, 0], &[0; 50]].concat();
    for (format, bytes) in [
        (Format::Off, off.as_bytes()),
        (Format::Ply, ply.as_bytes()),
        (Format::Ply, &binary_ply),
        (Format::Off, &binary_off),
        (Format::Stl, &stl),
    ] {
        assert_eq!(beyond(format, bytes), 0, "{format:?}");
        assert_eq!(
            beyond(format, &[bytes, b"\n \r\n\0"].concat()),
            0,
            "{format:?}"
        );
        // All that is there, also white space and zeros at its ends.
        let more = [bytes, b"3 0 1 2\n3 2 1 0\n\0\0"].concat();
        assert_eq!(beyond(format, &more), 18, "{format:?}");
    }
    let ended = format!("{off}\n# the end\n");
    assert_eq!(beyond(Format::Off, ended.as_bytes()), 0);
    assert_eq!(
        beyond(Format::Off, format!("{ended}3 2 1 0 # so").as_bytes()),
        12
    );
}
