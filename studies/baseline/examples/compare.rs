//! Compares the baselines with impinge, on a mesh and its copy moved by an offset:
//!
//! ```text
//! cargo run --release -p impinge-baseline --example compare -- bunny.ply 0.373 0.008 0.01
//! ```

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use impinge_baseline::duplicates::{self, Missing, Possible, TwoLevels};
use impinge_baseline::{Settings, UniformGrid};
#[cfg(feature = "gpu")]
use impinge_core::BodyId;
use impinge_core::{Backend, Detector, Method, Pairs, Query, Scene};

const FRAMES: usize = 15;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, offset @ ..] = &arguments[..] else {
        return Err("usage: compare MESH DX DY DZ".into());
    };
    let offset: Vec<f32> = offset.iter().map(|x| x.parse()).collect::<Result<_, _>>()?;
    let mesh = impinge_io::read(Path::new(path), &impinge_io::ReadOptions::as_they_are())?;
    let positions = mesh.positions.to_f32_rounded();
    let moved: Vec<[f32; 3]> = positions
        .iter()
        .map(|point| std::array::from_fn(|axis| point[axis] + offset.get(axis).unwrap_or(&0.0)))
        .collect();
    let elements = match mesh.elements {
        impinge_io::Elements::Triangles(faces) => impinge_core::Elements::Triangles(faces),
        impinge_io::Elements::Tetrahedra(tets) => impinge_core::Elements::Tetrahedra(tets),
    };
    let mut scene = Scene::new();
    let a = scene.add((elements.clone(), positions))?;
    let b = scene.add((elements, moved))?;
    let n = scene.bodies().map(|(_, body)| body.n_elements()).sum();
    for method in [Method::Clusters, Method::Cells] {
        let mut detector = Detector::new(
            impinge_core::Settings::new()
                .method(method)
                .backend(Backend::Cpu),
        )?;
        let query = Query::between(a, b);
        show(method.name(), || {
            Ok(detector.detect(&scene, &query)?.clone())
        })?;
    }
    for (name, owner_rule) in [("uniform grid", false), ("uniform grid, owner rule", true)] {
        let mut grid = UniformGrid::new(Settings {
            owner_rule,
            ..Settings::default()
        })?;
        show(name, || Ok(grid.detect(&scene, a, b)?.pairs.clone()))?;
        println!("    {:?}", grid.detect(&scene, a, b)?.counts);
    }
    #[cfg(feature = "gpu")]
    on_gpu(&scene, a, b)?;
    for possible in [Possible::Masks, Possible::Boxes] {
        let mut two_levels = TwoLevels::new(duplicates::Settings {
            possible,
            ..duplicates::Settings::default()
        })?;
        println!("two levels, {possible:?}");
        let all = two_levels.detect(&scene, a, b)?.clone();
        show("  repeated", || {
            Ok(two_levels.detect(&scene, a, b)?.clone())
        })?;
        let checks = two_levels.count(&scene, a, b)?;
        let (share, average) = (checks.repeated_share(), checks.average());
        println!("    {checks:?}, {share:.2} repeated, {average:.2} tests on average");
        show("  DJB2", || {
            Ok(two_levels.detect_djb2(&scene, a, b, n)?.clone())
        })?;
        for factor in [1, 2, 4, 8, 16] {
            let found = two_levels.detect_djb2(&scene, a, b, factor * n)?;
            let missing = Missing::of(&all, found, a, b);
            println!(
                "    {factor} n slots: {:.4} of elements missing, {:.4} of pairs",
                missing.rate(),
                missing.pair_rate()
            );
        }
    }
    Ok(())
}

/// impinge and the baseline on a GPU, if there is one.
#[cfg(feature = "gpu")]
fn on_gpu(scene: &Scene, a: BodyId, b: BodyId) -> Result<(), Box<dyn Error>> {
    use impinge_baseline::gpu;
    let Some(device) = impinge_core::devices().into_iter().next() else {
        return Ok(());
    };
    println!("on {device}");
    for method in [Method::Clusters, Method::Cells] {
        let mut detector = Detector::new(
            impinge_core::Settings::new()
                .method(method)
                .backend(Backend::Gpu),
        )?;
        let query = Query::between(a, b);
        show(method.name(), || {
            Ok(detector.detect(scene, &query)?.clone())
        })?;
    }
    for (name, owner_rule) in [("uniform grid", false), ("uniform grid, owner rule", true)] {
        let mut grid = gpu::UniformGrid::new(gpu::Settings {
            owner_rule,
            ..gpu::Settings::default()
        })?;
        show(name, || Ok(grid.detect(scene, a, b)?.pairs.clone()))?;
        println!("    {:?}", grid.detect(scene, a, b)?.counts);
    }
    Ok(())
}

/// The median frame.
fn show(
    name: &str,
    mut detect: impl FnMut() -> Result<Pairs, Box<dyn Error>>,
) -> Result<(), Box<dyn Error>> {
    let mut frames = Vec::new();
    for _ in 0..FRAMES {
        let start = Instant::now();
        let pairs = detect()?;
        frames.push((start.elapsed(), pairs));
    }
    frames.sort_by_key(|(time, _)| *time);
    let (time, pairs) = &frames[FRAMES / 2];
    let stats = pairs.stats();
    let (ms, n) = (time.as_secs_f64() * 1e3, pairs.len());
    println!(
        "{name}: {ms:.3} ms, {n} pairs, {} tests",
        stats.n_candidates
    );
    for stage in &stats.stages {
        print!("    {} {:.3}", stage.name, stage.ms);
    }
    println!();
    Ok(())
}
