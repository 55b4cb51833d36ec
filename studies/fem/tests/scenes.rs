//! The scenes with the meshes of the shared data.

mod common;

use std::process::Command;

use common::cpu;
use impinge::{Detector, Method, Settings};
use impinge_fem::Simulation;
use impinge_fem::scenes::{SceneName, drop_scene};
use impinge_io::{Elements, ReadOptions, Sequence, read};

#[test]
fn the_meshes_are_those_of_the_tables() {
    for (name, n_tets) in [
        (SceneName::Bunny7k, 7_356),
        (SceneName::Bunny19k, 19_379),
        (SceneName::Dragon8k, 8_408),
        (SceneName::Dragon15k, 15_047),
    ] {
        let scene = drop_scene(name).unwrap();
        if scene.is_stand_in {
            let may_be_absent =
                std::env::var_os("IMPINGE_NO_DATA").is_some_and(|value| value == "1");
            assert!(
                may_be_absent,
                "the mesh of {} is absent: set IMPINGE_DATA, or IMPINGE_NO_DATA=1 to skip this test",
                name.name()
            );
            continue;
        }
        assert!(scene.solids.iter().all(|solid| solid.tets.len() == n_tets));
        assert!(scene.n_steps >= 200);
        // Every mesh can be simulated, and the bodies start apart.
        let mut simulation = Simulation::new(&scene.solids, scene.settings).unwrap();
        assert_eq!(simulation.step(&mut cpu()).unwrap().n_pairs, 0);
    }
}

#[test]
fn a_body_dropped_on_another_crushes_it_and_every_method_sees_the_same() {
    let scene = drop_scene(SceneName::Bunny7k).unwrap();
    if scene.is_stand_in {
        println!(
            "no mesh of {} here: a ball stands in",
            SceneName::Bunny7k.name()
        );
    }
    let height = |simulation: &Simulation| {
        let n = simulation.masses().len() / 2;
        let lower = &simulation.positions()[..n];
        lower.iter().fold(0.0, |top: f64, p| top.max(p[1]))
    };
    let mut simulation = Simulation::new(&scene.solids, scene.settings).unwrap();
    let start = height(&simulation);
    let mut detector = cpu();
    let mut most = 0;
    for _ in 0..60 {
        let report = simulation.step(&mut detector).unwrap();
        assert!(report.residual <= simulation.settings().tolerance);
        most = most.max(report.n_colliding.iter().sum());
    }
    assert!(most > 500, "{most}");
    assert!(
        height(&simulation) < 0.8 * start,
        "{start} {}",
        height(&simulation)
    );
    let expected = simulation.detect(&mut detector).unwrap();
    let mut cells = Detector::new(Settings::new().method(Method::Cells)).unwrap();
    let pairs = simulation.detect(&mut cells).unwrap();
    assert!(expected.len() > 500 && pairs.rows().eq(expected.rows()));
}

#[test]
fn the_program_writes_a_mesh_and_its_positions() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_impinge-fem"));
        let output = command.current_dir(&folder).args(args).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{said}");
        String::from_utf8(output.stdout).unwrap()
    };
    let printed = run(&["blocks", "--steps", "40", "--out", "out/run"]);
    assert!(
        printed.starts_with("block, 1296 tetrahedra, twice\n"),
        "{printed}"
    );
    let at = |name: &str| folder.path().join("out/run").join(name);
    let mesh = read(&at("blocks.ply"), &ReadOptions::as_they_are()).unwrap();
    assert!(matches!(&mesh.elements, Elements::Tetrahedra(tets) if tets.len() == 2 * 1296));
    let sequence = Sequence::open(&at("blocks.pc2")).unwrap();
    assert_eq!(sequence.n_frames(), 41);
    assert_eq!(mesh.positions, sequence.frame(0).unwrap());

    // The last frame is the state after 40 steps, and bodies have met by then.
    let scene = drop_scene(SceneName::Blocks).unwrap();
    let mut simulation = Simulation::new(&scene.solids, scene.settings).unwrap();
    let mut detector = cpu();
    for _ in 0..40 {
        simulation.step(&mut detector).unwrap();
    }
    let rounded = |p: [f64; 3]| p.map(|x| x as f32);
    let last = simulation.positions().into_iter().map(rounded).collect();
    assert_eq!(
        sequence.frame(40).unwrap(),
        impinge_io::Positions::F32(last)
    );
    assert!(simulation.detect(&mut detector).unwrap().len() > 100);
}
