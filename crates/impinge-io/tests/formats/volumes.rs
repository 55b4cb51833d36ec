//! MSH, VTK, VTU, Medit and TetGen.

use crate::*;

#[test]
fn msh_tags_with_gaps_are_numbered_in_order() {
    let msh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n70 0 0 0\n7 1 0 0\n900 0 1 0\n-8 0 0 1\n$EndNodes\n$Elements\n3\n1 2 2 0 0 70 900 7\n2 3 2 0 0 7 70 900 -8\n3 1 0 7 70\n$EndElements\n";
    let (mesh, summary) = read_bytes_with_summary(
        msh.as_bytes(),
        Format::Msh,
        "m",
        &ReadOptions::as_they_are(),
    )
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
        ("$MeshFormat\n4 0 8\n".into(), "file:2: MSH version '4' (supported: 2.0 to 2.2 and 4.1) is not supported"),
        (format!("{nodes}$Elements\n1\n1 4 0 1 5 5 2\n$EndElements\n"), "file:11: expected the tag of one of the 2 nodes, found 2"),
        (format!("{nodes}$Elements\n1\n1 5 0 1 5 5 2 1 1 1 1\n$EndElements\n"), "file:11: element type 5 (hexahedra; supported: triangles, quadrangles and tetrahedra) is not supported"),
        (format!("{nodes}$Elements\n1\n1 11 0 1\n"), "file:11: element type 11 (of higher order; supported: triangles, quadrangles and tetrahedra) is not supported"),
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
    let (mesh, summary) = read_bytes_with_summary(
        vtk.as_bytes(),
        Format::Vtk,
        "v",
        &ReadOptions::as_they_are(),
    )
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
            "file:4: the dataset 'STRUCTURED_GRID' (supported: UNSTRUCTURED_GRID and POLYDATA) is not supported",
        ),
        (
            format!("{start}CELLS 1 4\n3 0 1\n2\nCELL_TYPES 1 5\n"),
            "file:8: vertex index 2 is out of range; vertices: 2, numbered from 0",
        ),
        (
            format!("{start}CELLS 1 9\n8\n0 0 0 0 0 0 0 0\nCELL_TYPES 1\n12\n"),
            "file:11: cell type 12 (hexahedra; supported: triangles, polygons and tetrahedra) is not supported",
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
            "vertex index 3 is out of range; vertices: 3, numbered from 0",
        ),
        (
            "0 1 2<",
            "0 1 -1<",
            "vertex index -1 is out of range; vertices: 3, numbered from 0",
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
            "cell type 14 (pyramids; supported: triangles, polygons and tetrahedra) is not supported",
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
            "the VTK file type 'ImageData' (supported: UnstructuredGrid) is not supported",
        ),
        (
            "<VTKFile",
            "<VTKFile compressor=\"vtkLZMADataCompressor\"",
            "the compressor 'vtkLZMADataCompressor' (supported: zlib and LZ4) is not supported",
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
    // The header of the points: 2 blocks of 31 bytes, 29 in the last one. Let it say 2^31 - 1 of
    // 31.
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
        &ReadOptions::as_they_are(),
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
            "file:9: vertex index 5 is out of range; vertices: 4, numbered from 1",
        ),
        (
            "Triangles 2\n1 2 3 0\n",
            "file:10: expected a vertex index, found the end of the file",
        ),
        (
            "Hexahedra 1\n1 2 3 4 1 2 3 4 0\n",
            "file:8: the section 'Hexahedra' of 1 cells (supported: triangles, quadrilaterals and tetrahedra) is not supported",
        ),
        (
            "Vertices 1\n",
            "file:8: expected one section 'Vertices', found a second one",
        ),
        ("7\n", "file:8: expected a keyword, found '7'"),
    ] {
        assert_eq!(message(Format::Medit, &format!("{start}{more}")), expected);
    }
    // Without 'End'.
    let mesh = load(Format::Medit, &format!("{start}Triangles 1\n1 2 3 0\n")).or_show();
    assert_eq!(triangles(&mesh), [[0, 1, 2]]);
    assert_eq!(
        message(Format::Medit, "MeshVersionFormatted 1\nDimension 2\n"),
        "file:2: dimension 2 (supported: 3) is not supported"
    );
}

#[test]
fn tetgen_files_find_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("a.node", "4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n");
    write("a.face", "1 1\n1 1 2 3 -1\n");
    let options = ReadOptions::as_they_are();
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
            .n_elements(),
        1
    );

    let nodes = "2 3 0 0\n0 0 0 0\n1 1 0 0\n";
    for (nodes, cells, expected) in [
        (
            nodes,
            "1 4 0\n0 0 1 2 0\n",
            "e.ele:2: vertex index 2 is out of range; vertices: 2, numbered from 0",
        ),
        (
            nodes,
            "1 10 0\n",
            "e.ele:1: a tetrahedron of 10 nodes (supported: 4) is not supported",
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
            "n.node:1: dimension 2 (supported: 3) is not supported",
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
    // A parser that compares each attribute or namespace with all others would take minutes.
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
