//! `impinge demo`.

use impinge_io::{ReadOptions, read};
use serde_json::json;

use crate::harness::Folder;
use crate::render::{pixels, red_and_blue};

#[test]
fn a_small_demo_finds_checks_and_writes() {
    let folder = Folder::new();
    let text = folder
        .run(["demo", "--triangles", "3000", "--frames", "12"])
        .printed();
    for word in [
        "3 deforming bodies, 3,000 triangles, 12 frames",
        "worm with itself",
        "frames per second",
        "checked: naive (every box against every box) finds the same",
        "wrote out/demo.glb, a mesh, and out/demo.png, its picture",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let last = "Look at out/demo.png, then ask about meshes of your own: impinge pairs a.obj b.obj";
    assert_eq!(text.lines().last(), Some(last));
    let (size, pixels) = pixels(&folder.path("out/demo.png"));
    assert_eq!(size, [1280, 960]);
    let [red, blue] = red_and_blue(&pixels);
    assert!(red > 1_000 && blue > 1_000, "{red} {blue}");
    let mesh = read(&folder.path("out/demo.glb"), &ReadOptions::as_they_are()).unwrap();
    assert_eq!(mesh.n_elements(), 3_000);
    // All bodies meet, and the worm meets itself: otherwise the demo would show nothing.
    for what in [
        "worm with itself",
        "worm and knot",
        "worm and ball",
        "knot and ball",
    ] {
        let row = text.lines().find(|line| line.starts_with(what)).unwrap();
        let numbers: Vec<u64> = row[what.len()..]
            .split_whitespace()
            .map(|number| number.replace(',', "").parse().unwrap())
            .collect();
        assert!(numbers.iter().all(|n| *n > 0), "{row}");
    }
    // The file that was written has the answer that was printed: its nodes are the bodies.
    let (most, _) = text
        .lines()
        .find_map(|line| line.split_once(" to ")?.1.split_once(" pairs per frame"))
        .unwrap();
    let most: u64 = most.replace(',', "").parse().unwrap();
    let object = folder
        .run(["pairs", "out/demo.glb", "--self", "--json"])
        .json();
    assert_eq!(object["pairs"], json!(most));
    let bodies = object["bodies"].as_array().unwrap();
    let names: Vec<_> = bodies.iter().map(|body| &body["name"]).collect();
    assert_eq!(names, ["worm", "knot", "ball"]);
    let text = folder.run(["pairs", "out/demo.glb"]).printed();
    assert!(
        text.starts_with("out/demo.glb: ") && text.contains(" pairs of 3,000 triangles"),
        "{text}"
    );
    assert!(
        text.contains("\nbetween 3 nodes of out/demo.glb, "),
        "{text}"
    );
}

#[test]
fn every_method_is_checked_by_another_one() {
    let folder = Folder::new();
    for (method, by) in [
        ("auto", "naive (every box against every box)"),
        ("clusters", "naive (every box against every box)"),
        ("cells", "naive (every box against every box)"),
        ("naive", "clusters"),
    ] {
        let text = folder
            .run([
                "demo",
                "--triangles",
                "1200",
                "--frames",
                "2",
                "--out",
                "seen.ply",
                "--method",
                method,
            ])
            .printed();
        assert!(
            text.contains(&format!("checked: {by} finds the same")),
            "{text}"
        );
        assert!(folder.path("seen.ply").is_file() && folder.path("seen.png").is_file());
    }
}

/// More triangles than the oracle gets: the sample is said to be one.
#[test]
fn a_sample_is_not_mistaken_for_the_answer() {
    let folder = Folder::new();
    let text = folder
        .run(["demo", "--triangles", "20000", "--frames", "2"])
        .printed();
    let line = text
        .lines()
        .find(|line| line.starts_with("checked"))
        .unwrap();
    assert!(
        line.starts_with("checked on a sample: ") && line.contains(" finds the same ones in "),
        "{line}"
    );
}
