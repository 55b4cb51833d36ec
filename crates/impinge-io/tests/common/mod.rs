//! One small mesh in every format and flavour, built here byte by byte.

// Each test uses a part of this module.
#![allow(dead_code)]

mod vtu;

pub use vtu::{VtuStorage, vtu};

use impinge_io::{
    Elements, Error, Format, Mesh, Positions, ReadOptions, read_bytes, read_tetgen_bytes,
};

/// Coordinates that f32 represents exactly, so that every flavour has the same values.
pub const VERTICES: [[f64; 3]; 5] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.5, 0.0],
    [0.0, 0.0, -2.25],
    [1.0, 1.0, 1.0],
];
pub const TRIANGLES: [[u32; 3]; 3] = [[0, 2, 1], [1, 2, 3], [4, 0, 3]];
pub const TETRAHEDRA: [[u32; 4]; 2] = [[0, 1, 2, 3], [4, 1, 2, 3]];

/// A file in memory.
pub struct Sample {
    pub name: &'static str,
    pub format: Format,
    pub bytes: Vec<u8>,
    pub mesh: Mesh,
}

impl Sample {
    pub fn read(&self, bytes: &[u8]) -> Result<Mesh, Error> {
        if self.format == Format::Tetgen {
            // Both files in one, separated by a zero byte.
            let cut = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
            let cells = bytes.get(cut + 1..).unwrap_or_default();
            let (node, ele) = (format!("{}.node", self.name), format!("{}.ele", self.name));
            return read_tetgen_bytes(
                &bytes[..cut],
                &node,
                cells,
                &ele,
                &ReadOptions::as_they_are(),
            );
        }
        read_bytes(bytes, self.format, self.name, &ReadOptions::as_they_are())
    }
}

pub fn surface(wide: bool) -> Mesh {
    Mesh {
        positions: positions(wide),
        elements: Elements::Triangles(TRIANGLES.to_vec()),
    }
}

pub fn volume(wide: bool) -> Mesh {
    Mesh {
        positions: positions(wide),
        elements: Elements::Tetrahedra(TETRAHEDRA.to_vec()),
    }
}

pub fn positions(wide: bool) -> Positions {
    if wide {
        Positions::F64(VERTICES.to_vec())
    } else {
        Positions::F32(f32s())
    }
}

fn f32s() -> Vec<[f32; 3]> {
    VERTICES.iter().map(|v| v.map(|c| c as f32)).collect()
}

/// Triangles with three vertices of their own, as in STL.
pub fn soup(wide: bool) -> Mesh {
    let corners: Vec<[f64; 3]> = TRIANGLES
        .as_flattened()
        .iter()
        .map(|&ix| VERTICES[ix as usize])
        .collect();
    let positions = if wide {
        Positions::F64(corners)
    } else {
        Positions::F32(corners.iter().map(|v| v.map(|c| c as f32)).collect())
    };
    Mesh {
        positions,
        elements: Elements::Triangles(vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]]),
    }
}

/// Numbers as bytes in either byte order.
#[derive(Clone, Copy, PartialEq)]
pub enum Order {
    Little,
    Big,
}

impl Order {
    pub fn put<const N: usize>(self, out: &mut Vec<u8>, little: [u8; N]) {
        match self {
            Order::Little => out.extend(little),
            Order::Big => out.extend(little.iter().rev()),
        }
    }

    pub fn f32s(self, values: impl IntoIterator<Item = f32>) -> Vec<u8> {
        let mut out = Vec::new();
        values
            .into_iter()
            .for_each(|value| self.put(&mut out, value.to_le_bytes()));
        out
    }

    pub fn f64s(self, values: impl IntoIterator<Item = f64>) -> Vec<u8> {
        let mut out = Vec::new();
        values
            .into_iter()
            .for_each(|value| self.put(&mut out, value.to_le_bytes()));
        out
    }

    pub fn i32s(self, values: impl IntoIterator<Item = i32>) -> Vec<u8> {
        let mut out = Vec::new();
        values
            .into_iter()
            .for_each(|value| self.put(&mut out, value.to_le_bytes()));
        out
    }

    pub fn i64s(self, values: impl IntoIterator<Item = i64>) -> Vec<u8> {
        let mut out = Vec::new();
        values
            .into_iter()
            .for_each(|value| self.put(&mut out, value.to_le_bytes()));
        out
    }
}

pub fn coordinates() -> impl Iterator<Item = f64> {
    VERTICES.into_iter().flatten()
}

/// One line per vertex, with a prefix and a suffix around its coordinates.
pub fn vertex_lines(before: impl Fn(usize) -> String, after: &str) -> String {
    let line = |(ix, [x, y, z]): (usize, &[f64; 3])| format!("{}{x} {y} {z}{after}\n", before(ix));
    VERTICES.iter().enumerate().map(line).collect()
}

/// One line per cell, its vertices counted from `first`.
pub fn cell_lines<const N: usize>(
    cells: &[[u32; N]],
    first: u32,
    before: impl Fn(usize) -> String,
    after: &str,
) -> String {
    let words = |cell: &[u32; N]| cell.map(|ix| (ix + first).to_string()).join(" ");
    let line = |(ix, cell)| format!("{}{}{after}\n", before(ix), words(cell));
    cells.iter().enumerate().map(line).collect()
}

pub fn samples() -> Vec<Sample> {
    let mut samples = Vec::new();
    let mut add = |name, format, bytes: Vec<u8>, mesh| {
        samples.push(Sample {
            name,
            format,
            bytes,
            mesh,
        })
    };
    let none = |_| String::new();

    let obj = format!(
        "# a comment\no body\n{}vn 0 0 1\n{}",
        vertex_lines(|_| "v ".into(), ""),
        cell_lines(&TRIANGLES, 1, |_| "f ".into(), "")
    );
    add("obj", Format::Obj, obj.into_bytes(), surface(true));

    let off = format!(
        "OFF\n5 3 0\n{}{}",
        vertex_lines(none, ""),
        cell_lines(&TRIANGLES, 0, |_| "3 ".into(), " 255 0 0")
    );
    add("off", Format::Off, off.into_bytes(), surface(true));

    let ply = format!(
        "{}{}{}",
        ply_header("ascii", "float"),
        vertex_lines(none, " 7"),
        cell_lines(&TRIANGLES, 0, |_| "3 ".into(), "")
    );
    add("ply ascii", Format::Ply, ply.into_bytes(), surface(true));
    add(
        "ply little",
        Format::Ply,
        ply_binary(Order::Little),
        surface(false),
    );
    add(
        "ply big",
        Format::Ply,
        ply_binary(Order::Big),
        surface(false),
    );

    add(
        "stl ascii",
        Format::Stl,
        stl_ascii().into_bytes(),
        soup(true),
    );
    add(
        "stl binary",
        Format::Stl,
        stl_binary(b"solid with a lying title"),
        soup(false),
    );

    add("gltf", Format::Gltf, gltf().into_bytes(), surface(false));
    add("glb", Format::Gltf, glb(), surface(false));

    for (kind, deflates) in [("3mf stored", false), ("3mf deflated", true)] {
        let archive = zip(&[(MODEL, threemf().as_bytes())], deflates);
        add(kind, Format::ThreeMf, archive, surface(true));
    }

    let msh = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Comments\n$ any\n$EndComments\n$Nodes\n5\n{}$EndNodes\n$Elements\n4\n1 15 2 0 0 1\n2 2 2 0 0 1 2 3\n{}$EndElements\n",
        vertex_lines(|ix| format!("{} ", ix + 1), ""),
        cell_lines(&TETRAHEDRA, 1, |ix| format!("{} 4 2 0 0 ", ix + 3), ""),
    );
    add("msh 2.2 ascii", Format::Msh, msh.into_bytes(), volume(true));
    add(
        "msh 2.2 little",
        Format::Msh,
        msh2_binary(Order::Little),
        volume(true),
    );
    add(
        "msh 2.2 big",
        Format::Msh,
        msh2_binary(Order::Big),
        volume(true),
    );
    let msh = format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 5 1 5\n3 1 0 5\n1\n2\n3\n4\n5\n{}$EndNodes\n$Elements\n2 3 1 3\n1 1 1 1\n1 1 2\n3 1 4 2\n{}$EndElements\n",
        vertex_lines(none, ""),
        cell_lines(&TETRAHEDRA, 1, |ix| format!("{} ", ix + 2), ""),
    );
    add("msh 4.1 ascii", Format::Msh, msh.into_bytes(), volume(true));
    add(
        "msh 4.1 little",
        Format::Msh,
        msh4_binary(Order::Little),
        volume(true),
    );
    add(
        "msh 4.1 big",
        Format::Msh,
        msh4_binary(Order::Big),
        volume(true),
    );

    let head = "# vtk DataFile Version 3.0\ntitle\n";
    let vtk = format!(
        "{head}ASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n{}CELLS 3 13\n{}2 0 1\nCELL_TYPES 3\n10\n10\n3\nCELL_DATA 3\nSCALARS s int\n",
        vertex_lines(none, ""),
        cell_lines(&TETRAHEDRA, 0, |_| "4 ".into(), ""),
    );
    add(
        "vtk grid ascii",
        Format::Vtk,
        vtk.into_bytes(),
        volume(true),
    );
    let vtk = format!(
        "{head}ASCII\nDATASET POLYDATA\nPOINTS 5 double\n{}POLYGONS 3 12\n{}",
        vertex_lines(none, ""),
        cell_lines(&TRIANGLES, 0, |_| "3 ".into(), "")
    );
    add(
        "vtk polydata ascii",
        Format::Vtk,
        vtk.into_bytes(),
        surface(true),
    );
    add("vtk grid binary", Format::Vtk, vtk_binary(), volume(false));
    add("vtk 5.1 binary", Format::Vtk, vtk51_binary(), volume(true));

    for (name, storage) in vtu::STORAGES {
        add(
            name,
            Format::Vtu,
            vtu(storage),
            volume(storage == VtuStorage::Ascii),
        );
    }

    let medit = format!(
        "MeshVersionFormatted 2\n# comment\nDimension\n3\nVertices\n5\n{}Edges\n1\n1 2 0\nTriangles 1\n1 2 3 0\nTetrahedra 2\n{}RequiredVertices\n1\n1\nEnd\n",
        vertex_lines(none, " 0"),
        cell_lines(&TETRAHEDRA, 1, none, " 0"),
    );
    add("medit", Format::Medit, medit.into_bytes(), volume(true));

    for (name, first) in [("tetgen from 0", 0), ("tetgen from 1", 1)] {
        let tetgen = format!(
            "# nodes\n5 3 1 0\n{}\0# cells\n2 4 0\n{}",
            vertex_lines(|ix| format!("{} ", ix + first as usize), " 0.5"),
            cell_lines(
                &TETRAHEDRA,
                first,
                |ix| format!("{} ", ix + first as usize),
                ""
            ),
        );
        add(name, Format::Tetgen, tetgen.into_bytes(), volume(true));
    }
    samples
}

pub fn ply_header(storage: &str, float: &str) -> String {
    format!(
        "ply\nformat {storage} 1.0\ncomment c\nelement vertex 5\nproperty {float} x\nproperty {float} y\nproperty {float} z\nproperty uchar quality\n\
         element face 3\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

fn ply_binary(order: Order) -> Vec<u8> {
    let mut out = ply_header(
        if order == Order::Little {
            "binary_little_endian"
        } else {
            "binary_big_endian"
        },
        "float",
    )
    .into_bytes();
    for vertex in f32s() {
        out.extend(order.f32s(vertex));
        out.push(7);
    }
    for triangle in TRIANGLES {
        out.push(3);
        out.extend(order.i32s(triangle.map(|ix| ix as i32)));
    }
    out
}

fn stl_ascii() -> String {
    let corner = |&ix: &u32| {
        let [x, y, z] = VERTICES[ix as usize];
        format!("  vertex {x} {y} {z}\n")
    };
    let facet = |triangle: &[u32; 3]| {
        let corners: String = triangle.iter().map(corner).collect();
        format!("facet normal nan 0 0\n outer loop\n{corners} endloop\nendfacet\n")
    };
    format!(
        "solid some name\n{}endsolid some name\n",
        TRIANGLES.iter().map(facet).collect::<String>()
    )
}

fn stl_binary(title: &[u8]) -> Vec<u8> {
    let mut out = title.to_vec();
    out.resize(80, b' ');
    out.extend(3u32.to_le_bytes());
    for triangle in TRIANGLES {
        out.extend([0; 12]);
        for ix in triangle {
            out.extend(Order::Little.f32s(VERTICES[ix as usize].map(|c| c as f32)));
        }
        out.extend([0; 2]);
    }
    out
}

/// Positions, then u16 indices, padded.
pub fn gltf_buffer() -> Vec<u8> {
    let mut buffer = Order::Little.f32s(coordinates().map(|c| c as f32));
    buffer.extend(
        TRIANGLES
            .as_flattened()
            .iter()
            .flat_map(|&ix| (ix as u16).to_le_bytes()),
    );
    buffer.extend([0; 2]);
    buffer
}

/// A document; `uri` is the URI of the buffer with a comma before it, or empty.
pub fn gltf_json(uri: &str, node: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0{node}}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":9}},"indices":1}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":5,"type":"VEC3"}},{{"bufferView":1,"componentType":5123,"count":9,"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteLength":60}},{{"buffer":0,"byteOffset":60,"byteLength":18}}],
"buffers":[{{"byteLength":80{uri}}}]}}"#
    )
}

fn gltf() -> String {
    let data = base64(&gltf_buffer());
    gltf_json(
        &format!(r#","uri":"data:application/octet-stream;base64,{data}""#),
        "",
    )
}

pub fn glb_of(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF".to_vec();
    let length = 12 + 8 + json.len() + 8 + binary.len();
    for word in [2, length as u32, json.len() as u32] {
        out.extend(word.to_le_bytes());
    }
    out.extend(b"JSON");
    out.extend(json);
    out.extend((binary.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(binary);
    out
}

fn glb() -> Vec<u8> {
    glb_of(&gltf_json("", ""), &gltf_buffer())
}

fn msh2_binary(order: Order) -> Vec<u8> {
    let mut out = b"$MeshFormat\n2.2 1 8\n".to_vec();
    out.extend(order.i32s([1]));
    out.extend(b"\n$EndMeshFormat\n$Nodes\n5\n");
    for (tag, vertex) in (1..).zip(VERTICES) {
        out.extend(order.i32s([tag]));
        out.extend(order.f64s(vertex));
    }
    out.extend(b"\n$EndNodes\n$Elements\n3\n");
    out.extend(order.i32s([2, 1, 2, 1, 0, 0, 1, 2, 3]));
    out.extend(order.i32s([4, 2, 2]));
    for (number, cell) in (2..).zip(TETRAHEDRA) {
        out.extend(order.i32s([number, 0, 0]));
        out.extend(order.i32s(cell.map(|ix| ix as i32 + 1)));
    }
    out.extend(b"\n$EndElements\n");
    out
}

fn msh4_binary(order: Order) -> Vec<u8> {
    let mut out = b"$MeshFormat\n4.1 1 8\n".to_vec();
    out.extend(order.i32s([1]));
    out.extend(b"\n$EndMeshFormat\n$Nodes\n");
    out.extend(order.i64s([1, 5, 1, 5]));
    out.extend(order.i32s([3, 1, 0]));
    out.extend(order.i64s([5, 1, 2, 3, 4, 5]));
    out.extend(order.f64s(coordinates()));
    out.extend(b"\n$EndNodes\n$Elements\n");
    out.extend(order.i64s([1, 2, 1, 2]));
    out.extend(order.i32s([3, 1, 4]));
    out.extend(order.i64s([2]));
    for (number, cell) in (1..).zip(TETRAHEDRA) {
        out.extend(order.i64s([number]));
        out.extend(order.i64s(cell.map(|ix| i64::from(ix) + 1)));
    }
    out.extend(b"\n$EndElements\n");
    out
}

fn vtk_binary() -> Vec<u8> {
    let mut out =
        b"# vtk DataFile Version 3.0\ntitle\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n"
            .to_vec();
    out.extend(Order::Big.f32s(coordinates().map(|c| c as f32)));
    out.extend(b"\nCELLS 2 10\n");
    for cell in TETRAHEDRA {
        out.extend(Order::Big.i32s([4]));
        out.extend(Order::Big.i32s(cell.map(|ix| ix as i32)));
    }
    out.extend(b"\nCELL_TYPES 2\n");
    out.extend(Order::Big.i32s([10, 10]));
    out.push(b'\n');
    out
}

fn vtk51_binary() -> Vec<u8> {
    let mut out = b"# vtk DataFile Version 5.1\ntitle\nBINARY\nDATASET UNSTRUCTURED_GRID\nFIELD FieldData 1\nTIME 1 1 double\n".to_vec();
    out.extend(Order::Big.f64s([0.5]));
    out.extend(b"\nPOINTS 5 double\n");
    out.extend(Order::Big.f64s(coordinates()));
    out.extend(b"\nMETADATA\nINFORMATION 0\n\nCELLS 3 8\nOFFSETS vtktypeint64\n");
    out.extend(Order::Big.i64s([0, 4, 8]));
    out.extend(b"\nCONNECTIVITY vtktypeint64\n");
    out.extend(Order::Big.i64s(TETRAHEDRA.as_flattened().iter().map(|&ix| i64::from(ix))));
    out.extend(b"\nCELL_TYPES 2\n");
    out.extend(Order::Big.i32s([10, 10]));
    out.push(b'\n');
    out
}

pub fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    for chunk in bytes.chunks(3) {
        let mut three = [0; 3];
        three[..chunk.len()].copy_from_slice(chunk);
        let bits = u32::from_be_bytes([0, three[0], three[1], three[2]]);
        for ix in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * ix) & 63) as usize];
            out.push(if ix <= chunk.len() {
                digit as char
            } else {
                '='
            });
        }
    }
    out
}

/// Asserts what must hold for every mesh that a reader returns.
pub fn assert_valid(mesh: &Mesh) {
    let n = mesh.n_vertices();
    assert!(
        mesh.elements.indices().iter().all(|&ix| (ix as usize) < n),
        "an index beyond {n}"
    );
    assert!(
        mesh.positions
            .to_f64()
            .as_flattened()
            .iter()
            .all(|c| c.is_finite()),
        "a coordinate that is not finite"
    );
    assert!(!mesh.elements.is_empty(), "no elements");
}

/// The part of a 3MF file that holds its model.
pub const MODEL: &str = "3D/3dmodel.model";

/// The vertices and the triangles as the `mesh` of a 3MF model.
pub fn threemf_mesh() -> String {
    let vertices = VERTICES.map(|[x, y, z]| format!("<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>\n"));
    let triangles =
        TRIANGLES.map(|[a, b, c]| format!("<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"/>\n"));
    format!(
        "<mesh><vertices>\n{}</vertices><triangles>\n{}</triangles></mesh>",
        vertices.concat(),
        triangles.concat()
    )
}

/// A 3MF model of these objects and items.
pub fn threemf_model(objects: &str, items: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<model xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" xmlns:p=\"p\">\n\
         <resources>{objects}</resources>\n<build>{items}</build></model>\n"
    )
}

fn threemf() -> String {
    let object = format!(
        "<object id=\"1\" name=\"a &amp; b\">{}</object>",
        threemf_mesh()
    );
    threemf_model(&object, "<item objectid=\"1\"/>")
}

/// A ZIP archive of these parts.
pub fn zip(parts: &[(&str, &[u8])], deflates: bool) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, content) in parts {
        let crc = !content.iter().fold(u32::MAX, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| {
                if crc & 1 == 0 {
                    crc >> 1
                } else {
                    crc >> 1 ^ 0xEDB8_8320
                }
            })
        });
        let packed = match deflates {
            true => miniz_oxide::deflate::compress_to_vec(content, 6),
            false => content.to_vec(),
        };
        let offset = bytes.len() as u32;
        let mut fields: Vec<u8> = [20u16, 0, if deflates { 8 } else { 0 }, 0, 0]
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        for number in [crc, packed.len() as u32, content.len() as u32] {
            fields.extend(number.to_le_bytes());
        }
        fields.extend((name.len() as u16).to_le_bytes());
        fields.extend([0; 2]);
        bytes.extend(b"PK\x03\x04");
        bytes.extend(&fields);
        bytes.extend(name.as_bytes());
        bytes.extend(&packed);
        directory.extend(b"PK\x01\x02\x14\0");
        directory.extend(&fields);
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let start = bytes.len() as u32;
    let n = parts.len() as u16;
    bytes.extend(&directory);
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend([n, n].iter().flat_map(|n| n.to_le_bytes()));
    bytes.extend((directory.len() as u32).to_le_bytes());
    bytes.extend(start.to_le_bytes());
    bytes.extend([0; 2]);
    bytes
}
