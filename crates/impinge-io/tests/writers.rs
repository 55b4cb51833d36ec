//! Written files read back as the same meshes.

mod common;

use std::collections::HashSet;
use std::path::Path;

use common::{positions, surface, volume};
use impinge_io::{
    ColoredMesh, Elements, Error, Mesh, Pc2Writer, Positions, Prefer, ReadOptions, Sequence, read,
    read_with_summary, write_glb, write_plain_ply, write_ply, write_vtu,
};

const RED: [u8; 3] = [220, 40, 30];
const BLUE: [u8; 3] = [30, 60, 220];
const COLORS: [[u8; 3]; 3] = [RED, BLUE, RED];

fn colored<'a>(mesh: &'a Mesh, colors: Option<&'a [[u8; 3]]>) -> ColoredMesh<'a> {
    ColoredMesh {
        positions: &mesh.positions,
        elements: &mesh.elements,
        element_colors: colors,
        colliding: None,
        name: "a \"body\" <1>",
    }
}

fn load(path: &Path) -> Mesh {
    read(path, &ReadOptions::as_they_are()).unwrap_or_else(|error| panic!("{error}"))
}

/// A function that writes meshes.
type Writer = fn(&Path, &[ColoredMesh]) -> Result<(), Error>;

/// The names of all files in a folder.
fn names(folder: &Path) -> HashSet<String> {
    std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn ply_keeps_vertices_ids_and_precision() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    for wide in [false, true] {
        for mesh in [surface(wide), volume(wide)] {
            let colors = &COLORS[..mesh.n_elements()];
            write_ply(&path, &[colored(&mesh, Some(colors))]).unwrap();
            assert_eq!(load(&path), mesh);
        }
    }
    let bytes = {
        write_ply(&path, &[colored(&surface(false), Some(&COLORS))]).unwrap();
        std::fs::read(&path).unwrap()
    };
    // The last record: 3, the indices, the colour, the body.
    assert_eq!(
        bytes[bytes.len() - 20..],
        [
            3, 4, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, RED[0], RED[1], RED[2], 0, 0, 0, 0
        ]
    );
    assert_eq!(names(folder.path()), HashSet::from(["a.ply".to_owned()]));
}

#[test]
fn ply_of_several_bodies_counts_vertices_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let (first, second) = (surface(false), surface(true));
    write_ply(
        &path,
        &[colored(&first, None), colored(&second, Some(&COLORS))],
    )
    .unwrap();
    let mesh = load(&path);
    assert_eq!(
        mesh.positions,
        Positions::F64([common::VERTICES, common::VERTICES].concat())
    );
    let Elements::Triangles(triangles) = &mesh.elements else {
        panic!("tetrahedra")
    };
    assert_eq!(triangles[..3], common::TRIANGLES);
    assert_eq!(
        triangles[3..],
        common::TRIANGLES.map(|triangle| triangle.map(|ix| ix + 5))
    );
}

#[test]
fn surface_of_tetrahedra_is_drawn_from_outside() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let mesh = volume(true);
    write_ply(&path, &[colored(&mesh, None)]).unwrap();
    let options = ReadOptions {
        prefer: Prefer::Triangles,
        ..ReadOptions::as_they_are()
    };
    let (drawn, summary) = read_with_summary(&path, &options).unwrap();
    assert_eq!(summary.n_tetrahedra_skipped, 2);
    let Elements::Triangles(faces) = &drawn.elements else {
        panic!("tetrahedra")
    };
    // Two tetrahedra with a common face, 1 2 3.
    assert_eq!(faces.len(), 6);
    let volume_below = |faces: &[[u32; 3]]| -> f64 {
        let at = |ix: u32| drawn.positions.get(ix as usize).unwrap();
        let signed = |face: &[u32; 3]| {
            let [[a, b, c], [d, e, f], [g, h, i]] = face.map(at);
            (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)) / 6.0
        };
        faces.iter().map(signed).sum()
    };
    // Each tetrahedron's faces enclose a positive volume: 1 * 1.5 * 2.25 / 6 for the first, |det| /
    // 6 for the second.
    assert!((volume_below(faces) - (0.5625 + volume_of_second())).abs() < 1e-12);
}

/// The volume of the tetrahedron 4 1 2 3.
fn volume_of_second() -> f64 {
    let [o, a, b, c] = [4, 1, 2, 3].map(|ix| common::VERTICES[ix]);
    let [u, v, w] = [a, b, c].map(|p| [p[0] - o[0], p[1] - o[1], p[2] - o[2]]);
    let det = u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0])
        + u[2] * (v[0] * w[1] - v[1] * w[0]);
    det.abs() / 6.0
}

#[test]
fn glb_splits_vertices_where_colors_meet() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let mesh = surface(false);
    // Red 0 2 1 and 4 0 3, blue 1 2 3: vertices 1, 2 and 3 occur in both colours.
    write_glb(
        &path,
        &[
            colored(&mesh, Some(&COLORS)),
            colored(&mesh, None),
            colored(&volume(true), None),
        ],
    )
    .unwrap();
    let read_back = load(&path);
    let corners = |mesh: &Mesh| -> Vec<[f64; 3]> {
        mesh.elements
            .indices()
            .iter()
            .map(|&ix| mesh.positions.get(ix as usize).unwrap())
            .collect()
    };
    assert!(matches!(read_back.positions, Positions::F32(_)));
    assert_eq!(read_back.n_vertices(), 8 + 5 + 5);
    assert_eq!(
        corners(&read_back)[..18],
        [corners(&mesh), corners(&mesh)].concat()
    );
    assert_eq!(read_back.n_elements(), 3 + 3 + 6);

    let bytes = std::fs::read(&path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    assert_eq!(bytes[8..12], (bytes.len() as u32).to_le_bytes());
    assert_eq!(
        json["accessors"][0]["min"],
        serde_json::json!([0.0, 0.0, -2.25])
    );
    assert_eq!(
        json["accessors"][0]["max"],
        serde_json::json!([1.0, 1.5, 1.0])
    );
    assert_eq!(json["nodes"][0]["name"], "a \"body\" <1>");
    let colors = json["bufferViews"][1]["byteOffset"].as_u64().unwrap() as usize + 20 + length + 8;
    assert_eq!(
        bytes[colors..colors + 16],
        [[RED; 3], [BLUE; 3]].concat().map_rgba()[..16]
    );
}

/// Colours as stored in GLB.
trait MapRgba {
    fn map_rgba(&self) -> Vec<u8>;
}

impl MapRgba for Vec<[u8; 3]> {
    fn map_rgba(&self) -> Vec<u8> {
        self.iter()
            .flat_map(|&[red, green, blue]| [red, green, blue, 255])
            .collect()
    }
}

#[test]
fn glb_without_bodies_is_a_valid_file_without_meshes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    write_glb(&path, &[]).unwrap();
    let error = read(&path, &ReadOptions::as_they_are()).unwrap_err();
    assert!(matches!(error, Error::NoElements { .. }), "{error}");
}

#[test]
fn glb_refuses_what_is_not_finite_in_f32() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let mesh = Mesh {
        positions: Positions::F64(vec![[0.0, 0.0, 1e300]]),
        elements: Elements::Triangles(vec![[0, 0, 0]]),
    };
    let error = write_glb(&path, &[colored(&mesh, None)]).unwrap_err();
    assert!(
        matches!(error, Error::NotFinite { vertex: 0, .. }),
        "{error}"
    );
    assert!(names(folder.path()).is_empty());
}

#[test]
fn vtu_keeps_vertices_ids_and_precision() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vtu");
    for wide in [false, true] {
        for mesh in [surface(wide), volume(wide)] {
            let flags = vec![true; mesh.n_elements()];
            let mesh_out = ColoredMesh {
                colliding: Some(&flags),
                ..colored(&mesh, None)
            };
            write_vtu(&path, &[mesh_out]).unwrap();
            assert_eq!(load(&path), mesh);
        }
    }
    // Bodies of both kinds: the tetrahedra win unless triangles are requested.
    let (first, second) = (surface(false), volume(true));
    write_vtu(
        &path,
        &[colored(&first, Some(&COLORS)), colored(&second, None)],
    )
    .unwrap();
    let mesh = load(&path);
    assert_eq!(
        mesh.elements,
        Elements::Tetrahedra(
            common::TETRAHEDRA
                .map(|cell| cell.map(|ix| ix + 5))
                .to_vec()
        )
    );
    let text = String::from_utf8_lossy(&std::fs::read(&path).unwrap()).into_owned();
    assert!(
        text.contains("Name=\"body\"")
            && text.contains("Name=\"color\"")
            && !text.contains("Name=\"colliding\"")
    );
}

#[test]
fn vtu_cell_data_are_where_they_are_announced() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vtu");
    let mesh = surface(false);
    let flagged = ColoredMesh {
        colliding: Some(&[false, true, true]),
        ..colored(&mesh, Some(&COLORS))
    };
    write_vtu(&path, &[flagged, colored(&mesh, None)]).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    const START: &[u8] = b"<AppendedData encoding=\"raw\">\n_";
    let start = bytes.windows(START.len()).position(|w| w == START).unwrap();
    let (text, data) = (
        String::from_utf8_lossy(&bytes[..start]).into_owned(),
        start + START.len(),
    );
    let array = |name: &str| {
        let element = text
            .split('<')
            .find(|element| element.contains(&format!("Name=\"{name}\"")))
            .unwrap();
        let offset: usize = element
            .split("offset=\"")
            .nth(1)
            .unwrap()
            .split('"')
            .next()
            .unwrap()
            .parse()
            .unwrap();
        let start = data + offset + 8;
        let length = u64::from_le_bytes(bytes[start - 8..start].try_into().unwrap()) as usize;
        bytes[start..start + length].to_vec()
    };
    assert_eq!(array("colliding"), [0, 1, 1, 0, 0, 0]);
    assert_eq!(
        array("body"),
        [[0i32; 3], [1; 3]]
            .concat()
            .iter()
            .flat_map(|body| body.to_le_bytes())
            .collect::<Vec<u8>>()
    );
    assert_eq!(array("color")[..9], COLORS.concat());
    assert_eq!(array("types"), [5; 6]);
}

#[test]
fn what_does_not_fit_together_is_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = surface(false);
    let broken = Mesh {
        positions: Positions::F32(vec![[0.0; 3]; 2]),
        ..mesh.clone()
    };
    let writers: [(&str, Writer); 3] = [
        ("a.ply", write_ply),
        ("a.glb", write_glb),
        ("a.vtu", write_vtu),
    ];
    for (name, write) in writers {
        let path = folder.path().join(name);
        let message = write(&path, &[colored(&mesh, Some(&COLORS[..2]))])
            .unwrap_err()
            .to_string();
        assert!(
            message
                .ends_with("colours of the elements of body 'a \"body\" <1>': expected 3, found 2"),
            "{message}"
        );
        let flagged = ColoredMesh {
            colliding: Some(&[true; 4]),
            ..colored(&mesh, None)
        };
        let message = write(&path, &[flagged]).unwrap_err().to_string();
        assert!(message.ends_with("expected 3, found 4"), "{message}");
        let message = write(&path, &[colored(&broken, None)])
            .unwrap_err()
            .to_string();
        assert!(
            message.ends_with("vertex index 4 is out of range; vertices: 2, numbered from 0"),
            "{message}"
        );
        let nowhere = folder.path().join("no/such").join(name);
        assert!(matches!(
            write(&nowhere, &[colored(&mesh, None)]),
            Err(Error::Io {
                action: "create",
                ..
            })
        ));
    }
    assert!(names(folder.path()).is_empty());
}

#[test]
fn a_file_is_replaced_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pc2");
    std::fs::write(&path, "before").unwrap();
    let mut writer = Pc2Writer::create(&path, 2, 0.0, 1.0).unwrap();
    writer.append(&[[1.0; 3], [2.0; 3]]).unwrap();
    drop(writer);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "before");
    assert_eq!(names(folder.path()), HashSet::from(["a.pc2".to_owned()]));
}

#[test]
fn pc2_is_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.pc2");
    let Positions::F32(rest) = positions(false) else {
        panic!("f64")
    };
    let mut writer = Pc2Writer::create(&path, rest.len(), 3.0, 0.5).unwrap();
    let frames: Vec<Vec<[f32; 3]>> = (0..4)
        .map(|step| {
            rest.iter()
                .map(|p| p.map(|c| c + step as f32 * 0.25))
                .collect()
        })
        .collect();
    for frame in &frames {
        writer.append(frame).unwrap();
    }
    let message = writer.append(&rest[1..]).unwrap_err().to_string();
    assert!(
        message.ends_with("a.pc2: positions of frame 4: expected 5, found 4"),
        "{message}"
    );
    writer.finish().unwrap();
    let sequence = Sequence::open(&path).unwrap();
    assert_eq!((sequence.n_frames(), sequence.n_points()), (4, 5));
    for frame_ix in [2, 0, 3, 1] {
        assert_eq!(
            sequence.frame(frame_ix).unwrap(),
            Positions::F32(frames[frame_ix].clone())
        );
    }
    assert_eq!(std::fs::metadata(&path).unwrap().len(), 32 + 4 * 5 * 12);
}

#[test]
fn names_may_be_as_long_as_files_may_have_them() {
    let folder = tempfile::tempdir().unwrap();
    // Of bytes, and of characters of three bytes.
    for name in ["n".repeat(251), "\u{4e00}".repeat(83)] {
        let path = folder.path().join(name + ".ply");
        write_ply(&path, &[colored(&surface(false), None)]).unwrap();
        assert_eq!(load(&path), surface(false));
    }
}

#[test]
fn plain_files_have_positions_and_faces_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plain.ply");
    for wide in [false, true] {
        let mesh = surface(wide);
        let Elements::Triangles(faces) = &mesh.elements else {
            panic!("triangles")
        };
        write_plain_ply(&path, &mesh.positions, faces).unwrap();
        assert_eq!(load(&path), mesh);
        let bytes = std::fs::read(&path).unwrap();
        let size = if wide { 8 } else { 4 };
        let data = 3 * size * mesh.n_vertices() + 13 * faces.len();
        let float = if wide { "double" } else { "float" };
        let header = format!(
            "ply\nformat binary_little_endian 1.0\ncomment written by impinge\nelement vertex {}\nproperty {float} x\n\
             property {float} y\nproperty {float} z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
            mesh.n_vertices(),
            faces.len()
        );
        assert_eq!(
            String::from_utf8_lossy(&bytes[..bytes.len() - data]),
            header
        );
    }
}

#[cfg(unix)]
#[test]
fn links_stay_links_and_devices_are_written_directly() {
    let folder = tempfile::tempdir().unwrap();
    let (target, link) = (
        folder.path().join("target.ply"),
        folder.path().join("link.ply"),
    );
    std::fs::write(&target, "before").unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    write_ply(&link, &[colored(&surface(false), None)]).unwrap();
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(load(&target), surface(false));
    write_ply(Path::new("/dev/null"), &[colored(&surface(false), None)]).unwrap();
    assert!(!std::fs::metadata("/dev/null").unwrap().is_file());
}
