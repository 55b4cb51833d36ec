//! GPUs: listed and chosen by name; unknown names are refused.

use crate::harness::Folder;
use impinge_scenes::surfaces::ball;

#[test]
fn devices_are_listed_and_one_answers_like_the_cpu() {
    let folder = Folder::new();
    let list = folder.run(["devices", "--json"]).printed();
    let list: serde_json::Value = serde_json::from_str(&list).unwrap();
    let list = list.as_array().unwrap();
    assert!(!list.is_empty(), "a GPU or a software driver is needed");
    let name = list[0]["name"].as_str().unwrap();
    assert!(folder.run(["devices"]).printed().contains(name));
    folder.ply("a.ply", &ball(400));
    folder.ply("b.ply", &ball(400).translated([0.3, 0.1, 0.0]));
    let hash = |backend: &str| {
        let run = folder.run(["pairs", "a.ply", "b.ply", "--backend", backend, "--json"]);
        let answer: serde_json::Value = serde_json::from_str(&run.printed()).unwrap();
        (answer["hash"].clone(), answer["backend"].clone())
    };
    let (on_cpu, on_gpu) = (hash("cpu"), hash("gpu"));
    assert_eq!(on_cpu.0, on_gpu.0);
    assert_eq!(on_cpu.1, "cpu");
    assert_eq!(on_gpu.1, name);
}

#[test]
fn a_device_answers_steps_like_the_cpu() {
    let folder = Folder::new();
    let still = ball(400);
    let (low, high) = still.bounds().unwrap();
    let width = high[0] - low[0];
    let moving = still.translated([1.05 * width, 0.1 * width, 0.0]);
    folder.ply("a.ply", &still);
    folder.ply("f0.ply", &moving);
    folder.ply(
        "f1.ply",
        &moving.translated([-0.3 * width, 0.0, 0.1 * width]),
    );
    let files = ["step", "a.ply", "a.ply", "f0.ply", "f1.ply", "--json"];
    let answer = |arguments: &[&str], backend: &str| {
        let arguments = [arguments, &["--backend", backend]].concat();
        let printed = folder.run(arguments).printed();
        let answer: serde_json::Value = serde_json::from_str(&printed).unwrap();
        let found = ["free", "earliest", "hash", "impacts"].map(|key| answer[key].clone());
        (found, answer["backend"].clone())
    };
    let sequence = [
        "sequence", "f0.ply", "f%d.ply", "--other", "a.ply", "--ccd", "--json",
    ];
    let earliest = [&files[..], &["--earliest"]].concat();
    for arguments in [&files[..], &earliest, &sequence] {
        let (on_cpu, on_gpu) = (answer(arguments, "cpu"), answer(arguments, "gpu"));
        assert_eq!(on_cpu.0, on_gpu.0, "{arguments:?}");
        assert_ne!(on_cpu.0[1], serde_json::Value::Null, "{arguments:?}");
        assert_eq!(on_cpu.1, "cpu", "{arguments:?}");
        assert_ne!(on_gpu.1, "cpu", "{arguments:?}");
    }
}
