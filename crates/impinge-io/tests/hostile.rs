//! Hostile files: meshes that name files elsewhere, inputs that never end, archives that expand
//! without limit, text in other encodings.

mod common;

use std::path::PathBuf;
use std::sync::mpsc;
use std::time::Duration;

use common::{Order, gltf_buffer, gltf_json, samples, surface};
use impinge_io::{Error, Format, Mesh, ReadOptions, Sequence, read, read_bytes};

/// A folder with a mesh folder in it; files outside the mesh folder must never be read.
struct Trap {
    _outer: tempfile::TempDir,
    outer: PathBuf,
    inner: PathBuf,
}

impl Trap {
    fn new() -> Self {
        let temporary = tempfile::tempdir().unwrap();
        let outer = temporary.path().canonicalize().unwrap();
        let inner = outer.join("mesh");
        std::fs::create_dir_all(inner.join("sub")).unwrap();
        Trap {
            _outer: temporary,
            outer,
            inner,
        }
    }

    fn gltf(&self, uri: &str) -> Result<Mesh, Error> {
        let path = self.inner.join("a.gltf");
        let json = gltf_json(&format!(r#","uri":"{uri}""#), "");
        std::fs::write(&path, json).unwrap();
        read(&path, &ReadOptions::as_they_are())
    }
}

/// Asserts that a file outside the mesh folder was refused before it was read.
#[track_caller]
fn assert_outside(result: Result<impl Sized, Error>, what: &str) {
    let Err(error) = result else {
        panic!("{what} was read");
    };
    assert!(matches!(error, Error::Outside { .. }), "{what}: {error}");
    let message = error.to_string();
    assert!(
        message.contains("only files in the folder of the mesh or below it are read")
            && !message.contains('\n'),
        "{message}"
    );
}

#[test]
fn a_gltf_reads_files_of_its_own_folder_only() {
    let trap = Trap::new();
    let secret = trap.outer.join("secret.bin");
    std::fs::write(&secret, gltf_buffer()).unwrap();
    let absolute = secret.display().to_string();
    let escaped: String = absolute
        .bytes()
        .map(|byte| format!("%{byte:02x}"))
        .collect();
    for uri in [
        "../secret.bin",
        "./../secret.bin",
        "sub/../../secret.bin",
        "sub/./../../secret.bin",
        "sub//..//..//secret.bin",
        "../mesh/../secret.bin",
        "no/such/../../../secret.bin",
        "%2e%2e/secret.bin",
        "%2E%2E/secret.bin",
        ".%2e/secret.bin",
        "%2e./secret.bin",
        "..%2fsecret.bin",
        "..%2Fsecret.bin",
        "%2e%2e%2fsecret.bin",
        "sub%2f..%2f..%2fsecret.bin",
        "../../../../../../../../../../etc/hostname",
        "%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/hostname",
        &absolute,
        &format!("/{absolute}"),
        &format!("%2f{}", &absolute[1..]),
        &escaped,
        &format!("file://{absolute}"),
        &format!("file:{absolute}"),
        &format!("FILE://localhost{absolute}"),
        "/etc/hostname",
        "%2fetc%2fhostname",
        "http://example.org/a.bin",
        "C:/secret.bin",
        "..",
    ] {
        assert_outside(trap.gltf(uri), uri);
    }
    // These names do not lead to that file on this system: an error, and never its content.
    for uri in [
        r"..\\secret.bin",
        "%252e%252e/secret.bin",
        "%5c..%5csecret.bin",
        "..%00/secret.bin",
        "%zz/secret.bin",
        "sub",
        ".",
        "",
    ] {
        assert!(trap.gltf(uri).is_err(), "{uri}");
    }
}

#[cfg(unix)]
#[test]
fn links_out_of_the_folder_of_a_gltf_are_refused() {
    use std::os::unix::fs::symlink;
    let trap = Trap::new();
    std::fs::write(trap.outer.join("secret.bin"), gltf_buffer()).unwrap();
    std::fs::write(trap.inner.join("own.bin"), gltf_buffer()).unwrap();
    symlink("../secret.bin", trap.inner.join("link.bin")).unwrap();
    symlink("link.bin", trap.inner.join("twice.bin")).unwrap();
    symlink(&trap.outer, trap.inner.join("up")).unwrap();
    symlink("../..", trap.inner.join("sub/up")).unwrap();
    symlink("/etc/hostname", trap.inner.join("host.bin")).unwrap();
    symlink("/proc/self/environ", trap.inner.join("environ.bin")).unwrap();
    for uri in [
        "link.bin",
        "twice.bin",
        "up/secret.bin",
        "sub/up/secret.bin",
        "sub/up/mesh/../secret.bin",
        "host.bin",
        "environ.bin",
    ] {
        assert_outside(trap.gltf(uri), uri);
    }
    // Links that stay inside, and a folder that is itself reached by a link, do no harm.
    symlink("own.bin", trap.inner.join("alias.bin")).unwrap();
    symlink("../own.bin", trap.inner.join("sub/alias.bin")).unwrap();
    for uri in [
        "own.bin",
        "./own.bin",
        "%6fwn.bin",
        "sub/../own.bin",
        "alias.bin",
        "sub/alias.bin",
        "up/mesh/own.bin",
    ] {
        assert_eq!(trap.gltf(uri).unwrap(), surface(false), "{uri}");
    }
    let by_link = trap.outer.join("elsewhere");
    symlink(&trap.inner, &by_link).unwrap();
    assert!(read(&by_link.join("a.gltf"), &ReadOptions::as_they_are()).is_ok());
}

/// The two files of a TetGen mesh.
fn tetgen() -> (Vec<u8>, Vec<u8>) {
    let sample = samples()
        .into_iter()
        .find(|sample| sample.name == "tetgen from 0")
        .unwrap();
    let cut = sample.bytes.iter().position(|&b| b == 0).unwrap();
    (
        sample.bytes[..cut].to_vec(),
        sample.bytes[cut + 1..].to_vec(),
    )
}

#[cfg(unix)]
#[test]
fn files_found_beside_the_one_named_are_of_its_folder() {
    use std::os::unix::fs::symlink;
    let trap = Trap::new();
    let (nodes, cells) = tetgen();
    let options = ReadOptions::as_they_are();
    std::fs::write(trap.outer.join("a.node"), &nodes).unwrap();
    std::fs::write(trap.inner.join("a.ele"), &cells).unwrap();
    symlink("../a.node", trap.inner.join("a.node")).unwrap();
    assert_outside(read(&trap.inner.join("a.ele"), &options), "a.node");
    // The user may name any link; only files found beside it must lie in the folder.
    std::fs::copy(trap.inner.join("a.ele"), trap.outer.join("b.ele")).unwrap();
    std::fs::write(trap.inner.join("b.node"), &nodes).unwrap();
    symlink("../b.ele", trap.inner.join("b.ele")).unwrap();
    assert!(read(&trap.inner.join("b.ele"), &options).is_ok());
    assert_outside(read(&trap.inner.join("b.node"), &options), "b.ele");

    let off = samples().into_iter().find(|s| s.name == "off").unwrap();
    std::fs::write(trap.inner.join("run_1.off"), &off.bytes).unwrap();
    std::fs::write(trap.outer.join("secret.off"), &off.bytes).unwrap();
    symlink("../secret.off", trap.inner.join("run_2.off")).unwrap();
    for pattern in ["run_1.off", "run_%d.off", "run_*.off"] {
        let sequence = Sequence::open(&trap.inner.join(pattern)).unwrap();
        assert_eq!(sequence.n_frames(), 2);
        assert!(sequence.frame(0).is_ok(), "{pattern}");
        assert_outside(sequence.frame(1), pattern);
    }
    // The user named the link itself, so it is followed.
    assert!(read(&trap.inner.join("run_2.off"), &options).is_ok());
    let sequence = Sequence::open(&trap.inner.join("run_2.off")).unwrap();
    assert!(sequence.frame(0).is_ok());
}

/// Runs `task` on a thread, and fails if it does not return.
#[track_caller]
fn soon<T: Send + 'static>(what: &str, task: impl FnOnce() -> T + Send + 'static) -> T {
    let (done, result) = mpsc::channel();
    std::thread::spawn(move || done.send(task()));
    let Ok(result) = result.recv_timeout(Duration::from_secs(20)) else {
        panic!("{what} hangs");
    };
    result
}

#[cfg(unix)]
#[test]
fn only_regular_files_are_read() {
    use std::os::unix::fs::symlink;
    let trap = Trap::new();
    let fifo = trap.inner.join("pipe.ply");
    let made = std::process::Command::new("mkfifo").arg(&fifo).status();
    assert!(made.unwrap().success());
    let mut hostile = vec![(fifo.clone(), "a pipe")];
    for extension in [
        "ply", "obj", "stl", "off", "gltf", "msh", "vtk", "vtu", "mesh", "node",
    ] {
        let path = trap.inner.join("zero").with_extension(extension);
        symlink("/dev/zero", &path).unwrap();
        hostile.push((path, "a device"));
    }
    let folder = trap.inner.join("folder.obj");
    std::fs::create_dir(&folder).unwrap();
    hostile.push((folder, "a folder"));
    let socket = trap.inner.join("socket.stl");
    let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    hostile.push((socket, "a socket"));
    for (path, what) in hostile {
        let shown = path.display().to_string();
        let read = |path: PathBuf| move || read(&path, &ReadOptions::as_they_are());
        let error = soon(&shown, read(path)).unwrap_err();
        assert!(matches!(error, Error::NotAFile { .. }), "{error}");
        let message = error.to_string();
        assert!(message.contains(what), "{message}");
    }
    for name in ["run.pc2", "run.mdd"] {
        let path = trap.inner.join(name);
        symlink(&fifo, &path).unwrap();
        let error = soon(name, move || Sequence::open(&path)).unwrap_err();
        assert!(matches!(error, Error::NotAFile { .. }), "{error}");
    }
    symlink("/dev/zero", trap.inner.join("frame_1.obj")).unwrap();
    let path = trap.inner.join("frame_*.obj");
    assert!(soon("frames", move || Sequence::open(&path)).is_err());
    symlink("pipe.ply", trap.inner.join("pipe.bin")).unwrap();
    let error = soon("a buffer", move || trap.gltf("pipe.bin")).unwrap_err();
    assert!(matches!(error, Error::NotAFile { .. }), "{error}");
}

#[test]
fn a_file_beyond_the_limit_is_refused_before_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.obj");
    // Sparse: it takes no room on the disk.
    let file = std::fs::File::create(&path).unwrap();
    file.set_len(1 << 40).unwrap();
    let error = read(&path, &ReadOptions::as_they_are()).unwrap_err();
    assert!(matches!(error, Error::TooLarge { .. }), "{error}");
    let message = error.to_string();
    assert!(message.contains(&(1u64 << 40).to_string()), "{message}");
    file.set_len(1000).unwrap();
    let limited = ReadOptions {
        max_file_bytes: 999,
        ..ReadOptions::as_they_are()
    };
    let error = read(&path, &limited).unwrap_err();
    assert!(matches!(error, Error::TooLarge { .. }), "{error}");
}

/// A compressed VTU whose points are `n_blocks` blocks of 2 MiB of zeros.
fn bomb(n_blocks: usize) -> Vec<u8> {
    const BLOCK: usize = 2 << 20;
    let zeros = miniz_oxide::deflate::compress_to_vec_zlib(&vec![0; BLOCK], 9);
    let u32s = |values: &[usize]| -> Vec<u8> {
        values
            .iter()
            .flat_map(|&value| (value as u32).to_le_bytes())
            .collect()
    };
    let mut sizes = vec![n_blocks, BLOCK, 0];
    sizes.extend(std::iter::repeat_n(zeros.len(), n_blocks));
    let mut file = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\" compressor=\"vtkZLibDataCompressor\">\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"0\">\n<Points>\n\
         <DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/>\n</Points>\n</Piece>\n\
         </UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_",
        n_blocks * BLOCK / 12
    )
    .into_bytes();
    file.extend(u32s(&sizes));
    file.extend(zeros.repeat(n_blocks));
    file.extend(b"\n</AppendedData>\n</VTKFile>\n");
    file
}

#[test]
fn compressed_data_expands_within_limits() {
    let read =
        |bytes: &[u8], options: &ReadOptions| read_bytes(bytes, Format::Vtu, "b.vtu", options);
    // 2.8 MB that expand to 2.9 GB: refused without reserving that memory.
    let bytes = bomb(1400);
    assert!(
        (2_500_000..3_500_000).contains(&bytes.len()),
        "{}",
        bytes.len()
    );
    let error = read(&bytes, &ReadOptions::as_they_are()).unwrap_err();
    assert!(matches!(error, Error::TooLarge { .. }), "{error}");
    assert!(error.to_string().contains("expanded"), "{error}");
    // A small file may expand to a few megabytes, unless the option forbids it.
    let small = bomb(3);
    let error = read(&small, &ReadOptions::as_they_are()).unwrap_err();
    assert!(!matches!(error, Error::TooLarge { .. }), "{error}");
    let tight = ReadOptions {
        max_expanded_bytes: 1 << 20,
        ..ReadOptions::as_they_are()
    };
    let error = read(&small, &tight).unwrap_err();
    assert!(matches!(error, Error::TooLarge { .. }), "{error}");
}

/// A text in UTF-16 with or without a byte order mark.
fn utf16(text: &str, order: Order, has_mark: bool) -> Vec<u8> {
    let mark = has_mark.then_some(0xfeff);
    let units = mark.into_iter().chain(text.encode_utf16());
    units
        .flat_map(|unit| match order {
            Order::Little => unit.to_le_bytes(),
            Order::Big => unit.to_be_bytes(),
        })
        .collect()
}

#[test]
fn text_with_a_mark_is_read_and_utf_16_refused_by_name() {
    for sample in samples() {
        let is_text = std::str::from_utf8(&sample.bytes)
            .is_ok_and(|text| !text.contains('\0') || sample.format == Format::Tetgen);
        if !is_text {
            continue;
        }
        let marked = [b"\xef\xbb\xbf".as_slice(), &sample.bytes].concat();
        assert_eq!(
            sample.read(&marked).unwrap(),
            sample.mesh,
            "{}",
            sample.name
        );
        if sample.format == Format::Tetgen {
            continue;
        }
        let text = std::str::from_utf8(&sample.bytes).unwrap();
        for order in [Order::Little, Order::Big] {
            for has_mark in [true, false] {
                let error = sample.read(&utf16(text, order, has_mark)).unwrap_err();
                let message = error.to_string();
                assert!(
                    matches!(error, Error::Unsupported { .. }) && message.contains("UTF-16"),
                    "{}: {message}",
                    sample.name
                );
            }
        }
    }
    let (nodes, cells) = tetgen();
    let nodes = utf16(std::str::from_utf8(&nodes).unwrap(), Order::Little, true);
    let options = ReadOptions::as_they_are();
    let error =
        impinge_io::read_tetgen_bytes(&nodes, "a.node", &cells, "a.ele", &options).unwrap_err();
    assert!(
        error.to_string().contains("a.node: text in UTF-16"),
        "{error}"
    );
}

/// Titles of binary STL may be any bytes; they are never taken for UTF-16.
#[test]
fn a_binary_stl_may_have_any_title() {
    let sample = samples()
        .into_iter()
        .find(|sample| sample.name == "stl binary")
        .unwrap();
    for start in [b"\xff\xfe", b"\xfe\xff", b"\xef\xbb"] {
        let mut bytes = sample.bytes.clone();
        bytes[..2].copy_from_slice(start);
        assert_eq!(sample.read(&bytes).unwrap(), sample.mesh);
    }
}

/// Reading is linear in the corners of a polygon; otherwise this test would take hours.
#[test]
fn a_polygon_of_many_corners_is_read_at_once() {
    const N: usize = 300_000;
    let vertices: String = (0..N)
        .map(|ix| format!("{} {} 0\n", ix % 1000, ix / 1000))
        .collect();
    let corners =
        |first: usize| -> String { (first..N + first).map(|ix| format!(" {ix}")).collect() };
    let obj = format!(
        "{}f{}\n",
        vertices
            .lines()
            .map(|line| format!("v {line}\n"))
            .collect::<String>(),
        corners(1)
    );
    let off = format!("OFF\n{N} 1 0\n{vertices}{N}{}\n", corners(0));
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex {N}\nproperty float x\nproperty float y\nproperty float z\n\
         element face 1\nproperty list uint uint vertex_indices\nend_header\n{vertices}{N}{}\n",
        corners(0)
    );
    let vtk = format!(
        "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS {N} float\n{vertices}POLYGONS 1 {}\n{N}{}\n",
        N + 1,
        corners(0)
    );
    // Each corner on a line of its own, which OBJ continues.
    let long = obj.replacen(&corners(1), &corners(1).replace(' ', " \\\n"), 1);
    for (format, text) in [
        (Format::Obj, obj),
        (Format::Obj, long),
        (Format::Off, off),
        (Format::Ply, ply),
        (Format::Vtk, vtk),
    ] {
        let read = move || read_bytes(text.as_bytes(), format, "file", &ReadOptions::as_they_are());
        let mesh = soon("a polygon", read).unwrap();
        assert_eq!(mesh.n_elements(), N - 2, "{format:?}");
    }
}

/// What a checkout without Git LFS has in place of a mesh is no damaged mesh, and a folder no file
/// of an unknown format.
#[test]
fn pointers_and_folders_are_called_what_they_are() {
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 5\n";
    for format in [Format::Obj, Format::Stl, Format::Gltf, Format::Ply] {
        let options = ReadOptions::as_they_are();
        let said = read_bytes(pointer, format, "a", &options)
            .unwrap_err()
            .to_string();
        assert!(said.contains("git lfs pull"), "{said}");
    }
    let folder = tempfile::tempdir().unwrap();
    let said = Format::from_path(folder.path()).unwrap_err().to_string();
    let expected = format!(
        "{path}: is a folder, not a regular file; its files are named as in {path}/*.obj",
        path = folder.path().display()
    );
    assert_eq!(said, expected);
}
