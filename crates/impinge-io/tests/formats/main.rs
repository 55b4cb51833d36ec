//! Every format and flavour is read correctly.

#[path = "../common/mod.rs"]
mod common;
mod gltf;
mod surfaces;
mod threemf;
mod volumes;

use common::{Order, TRIANGLES, VERTICES, glb_of, gltf_buffer, gltf_json, samples};
use impinge_io::{
    Elements, Error, Format, Mesh, Positions, Prefer, ReadOptions, read, read_bytes,
    read_bytes_with_summary, read_tetgen_bytes, read_with_summary,
};

fn load(format: Format, text: &str) -> Result<Mesh, Error> {
    read_bytes(text.as_bytes(), format, "file", &ReadOptions::as_they_are())
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

/// If `$IMPINGE_SEEDS` names a folder (`fuzz/corpus`), the samples are written there, into one
/// folder per fuzz target.
#[test]
fn samples_are_seeds_for_fuzzing() {
    let Some(folder) = std::env::var_os("IMPINGE_SEEDS").map(std::path::PathBuf::from) else {
        println!("SKIPPED: IMPINGE_SEEDS is not set, no seeds are written");
        return;
    };
    for sample in samples() {
        let target = format!("{:?}", sample.format).to_ascii_lowercase();
        // The first byte tells the fuzz target which kind of file the second one is.
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
            Format::ThreeMf => continue,
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
            read(&path, &ReadOptions::as_they_are()).unwrap(),
            sample.mesh,
            "{}",
            sample.name
        );
    }
}

#[test]
fn unknown_extension_and_missing_file() {
    for (name, said) in [
        (
            "a.xyz",
            "no mesh format has the extension 'xyz' (known: obj, ply",
        ),
        (
            "scan",
            "its name has no extension, which tells the format (known: obj",
        ),
        ("no/such/file.ply", "cannot read: "),
        ("no/such/folder/", "cannot open: "),
    ] {
        let error = read(name.as_ref(), &ReadOptions::as_they_are()).unwrap_err();
        let message = error.to_string();
        assert!(message.starts_with(&format!("{name}: {said}")), "{message}");
    }
}

/// Formats of two files are not offered for bytes.
#[test]
fn unknown_extension_of_bytes() {
    let known = "obj, ply, stl, off, coff, noff, gltf, glb, msh, vtk, vtu, mesh, 3mf";
    assert_eq!(
        Format::from_name("a.xyz").unwrap_err().to_string(),
        format!("a.xyz: no mesh format has the extension 'xyz' (known: {known})")
    );
    for extension in known.split(", ") {
        let format = Format::from_name(&format!("a.{extension}")).or_show();
        assert_ne!(format, Format::Tetgen, "{extension}");
    }
    assert_eq!(Format::from_name("a.ele").or_show(), Format::Tetgen);
}

#[test]
fn readers_weld_unless_told_not_to() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 4 6 5\n";
    let n = |options: &ReadOptions| {
        let mesh = read_bytes(text.as_bytes(), Format::Obj, "file", options).or_show();
        mesh.n_vertices()
    };
    assert_eq!(n(&ReadOptions::default()), 4);
    assert_eq!(n(&ReadOptions::as_they_are()), 6);
}

/// Panics with the error, if there is one.
trait OrShow<T> {
    fn or_show(self) -> T;
}

impl<T> OrShow<T> for Result<T, Error> {
    fn or_show(self) -> T {
        self.unwrap_or_else(|error| panic!("{error}"))
    }
}
