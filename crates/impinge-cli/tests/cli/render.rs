//! Pictures: `impinge render`, and `--png` of `pairs` and `self`.

use std::path::Path;

use impinge::Query;
use impinge_scenes::solids::solid_ball;
use impinge_scenes::surfaces::ball;
use serde_json::json;

use crate::harness::{Folder, Run, oracle};

/// Width, height and RGB pixels of a PNG file.
pub fn pixels(path: &Path) -> ([u32; 2], Vec<[u8; 3]>) {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let (width, height) = reader.info().size();
    assert_eq!(
        (reader.info().color_type, reader.info().bit_depth),
        (png::ColorType::Rgb, png::BitDepth::Eight)
    );
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    ([width, height], bytes.as_chunks().0.to_vec())
}

/// How many pixels are red, and how many blue.
pub fn red_and_blue(pixels: &[[u8; 3]]) -> [usize; 2] {
    let is_red = |&&[r, g, b]: &&[u8; 3]| r > 100 && u32::from(r) > 2 * u32::from(g.max(b));
    let is_blue = |&&[r, g, b]: &&[u8; 3]| b > 100 && u32::from(b) > 2 * u32::from(r) && b > g;
    [
        pixels.iter().filter(is_red).count(),
        pixels.iter().filter(is_blue).count(),
    ]
}

fn two_balls() -> Folder {
    let folder = Folder::new();
    folder.ply("a.ply", &ball(2_000));
    folder.ply("b.ply", &ball(2_000).translated([0.7, 0.2, 0.1]));
    folder.medit("b.mesh", &solid_ball(1_000).translated([0.7, 0.2, 0.1]));
    folder
}

#[test]
fn what_meets_is_red_and_blue() {
    let folder = two_balls();
    for other in ["b.ply", "b.mesh"] {
        let args = ["render", "a.ply", other, "--png", "out.png"];
        let text = folder
            .run(args.iter().chain(&["--size", "320x200"]))
            .printed();
        assert!(
            text.contains("wrote out.png") && text.contains(" pairs of "),
            "{text}"
        );
        let (size, seen) = pixels(&folder.path("out.png"));
        assert_eq!(size, [320, 200]);
        let counts = red_and_blue(&seen);
        assert!(counts.iter().all(|&n| n > 50), "{other}: {counts:?}");
        // The same command gives the same bytes; another viewpoint gives other bytes.
        let once = std::fs::read(folder.path("out.png")).unwrap();
        let again = |options: &[&str]| {
            folder
                .run(args.iter().chain(&["--size", "320x200"]).chain(options))
                .printed();
            std::fs::read(folder.path("out.png")).unwrap()
        };
        assert!(once == again(&[]));
        for options in [
            &["--azimuth", "-70"][..],
            &["--elevation", "-5"],
            &["--up", "z"],
            &["--orthographic"],
            &["--see-through", "0"],
        ] {
            assert!(once != again(options), "{options:?}");
        }
    }
    // A single body meets no other, and this one does not meet itself.
    let alone = folder
        .run(["render", "a.ply", "--png", "out.png", "--size", "64x64"])
        .printed();
    assert!(alone.contains("\nwithin 1 mesh, "), "{alone}");
    let (_, seen) = pixels(&folder.path("out.png"));
    assert_eq!(red_and_blue(&seen), [0, 0]);
}

#[test]
fn answers_come_with_their_picture() {
    let folder = two_balls();
    let models = [ball(2_000), ball(2_000).translated([0.7, 0.2, 0.1])];
    let (rows, hash) = oracle(&[&models[0], &models[1]], |_| Query::between_all());
    for command in ["pairs", "render"] {
        let args = [command, "a.ply", "b.ply", "--png", "out.png", "--json"];
        let object = folder.run(args).json();
        assert_eq!(object["hash"], json!(hash));
        assert_eq!(object["pairs"], json!(rows.len()));
        let (size, seen) = pixels(&folder.path("out.png"));
        assert_eq!(size, [1280, 960]);
        assert!(red_and_blue(&seen).iter().all(|&n| n > 500));
        std::fs::remove_file(folder.path("out.png")).unwrap();
    }
    // Two triangles of one body that cross.
    folder.text(
        "cross.obj",
        "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0.5 0.5 -1\nv 0.5 0.5 1\nv 1.5 1.5 1\nf 1 2 3\nf 4 5 6\n",
    );
    for args in [
        &["self", "cross.obj", "--png", "out.png"][..],
        &["render", "cross.obj", "--self", "--png", "out.png"],
        &["render", "cross.obj", "--png", "out.png"],
    ] {
        folder
            .run(args.iter().chain(&["--size", "100x100"]))
            .printed();
        let [red, blue] = red_and_blue(&pixels(&folder.path("out.png")).1);
        assert!(red > 1_000 && blue == 0, "{red} {blue}");
    }
}

#[test]
fn no_adapter_is_needed_unless_one_is_named() {
    let folder = two_balls();
    let run = |command: &str, options: &[&str]| -> Run {
        let args = [
            command,
            "a.ply",
            "b.ply",
            "--png",
            "out.png",
            "--backend",
            "cpu",
        ];
        let mut command = folder.command(args.iter().chain(options));
        // The Vulkan loader takes drivers only from here.
        command.env("VK_DRIVER_FILES", "/no/driver.json");
        command.env("VK_ICD_FILENAMES", "/no/driver.json");
        command.output().unwrap().into()
    };
    for command in ["render", "pairs"] {
        run(command, &[]).printed();
        let [red, blue] = red_and_blue(&pixels(&folder.path("out.png")).1);
        assert!(red > 500 && blue > 500, "{red} {blue}");
        std::fs::remove_file(folder.path("out.png")).unwrap();
    }
    let options = ["--device", "no such device"];
    let line = run("render", &options).error();
    let said = match cfg!(feature = "gpu") {
        true => "no GPU adapter to draw with: ",
        false => "this impinge was built without the GPU backend: ",
    };
    assert!(line.starts_with(said), "{line}");
    let Run {
        code,
        stdout,
        stderr,
    } = run("pairs", &options);
    assert_eq!(code, Some(1));
    assert!(stdout.contains(" pairs of "), "{stdout}");
    assert_eq!(stderr, format!("impinge: {line}\n"));
    assert!(!folder.path("out.png").exists());
}

#[test]
fn pictures_that_cannot_be_are_refused() {
    let folder = two_balls();
    for options in [
        &["render", "a.ply"][..],
        &["render", "--png", "out.png"],
        &["render", "a.ply", "--png", "out.jpg"],
        &["render", "a.ply", "--png", "out.png", "--size", "0x10"],
        &["render", "a.ply", "--png", "out.png", "--elevation", "91"],
        &["render", "a.ply", "--png", "out.png", "--azimuth", "nan"],
        &["render", "a.ply", "--png", "out.png", "--see-through", "2"],
        &["render", "a.ply", "--png", "out.png", "--up", "x"],
        &["pairs", "a.ply", "b.ply", "--size", "10x10"],
    ] {
        folder.run(options).misuse();
    }
    let error = |options: &[&str]| {
        folder
            .run(["render", "a.ply"].iter().chain(options))
            .error()
    };
    let line = error(&["--png", "out.png", "--size", "4000000000x10"]);
    assert!(
        line.starts_with("a picture of 4000000000 x 10 pixels"),
        "{line}"
    );
    let line = error(&["--png", "no/out.png", "--size", "10x10"]);
    assert!(line.contains("no/out.png"), "{line}");
}
