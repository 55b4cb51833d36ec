//! The program `impinge-fem`: runs a scene, prints one line per step, and can write the bodies and
//! their positions, as `impinge sequence` and `impinge view` read them:
//! `cargo run --release -p impinge-fem -- bunny-7k --out out/bunny`.

use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use impinge::{Backend, Detector, Elements};
use impinge_fem::scenes::{DropScene, SceneName, drop_scene};
use impinge_fem::{Error, Simulation, StepReport};
use impinge_io::{ColoredMesh, Pc2Writer, write_ply};

/// Simulates an elastic body that drops on another one
#[derive(Debug, Parser)]
#[command(
    name = "impinge-fem",
    after_help = "If the mesh of a scene is absent, a generated ball stands in, and the first line says so."
)]
struct Args {
    /// The scene
    #[arg(value_parser = scene_name(), default_value = "blocks")]
    scene: SceneName,
    /// Time steps [default: those of the scene, 240]
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// CPU threads [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// A folder for SCENE.ply, the mesh of both bodies, and SCENE.pc2, its positions before each
    /// step and after the last
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

fn scene_name() -> impl TypedValueParser<Value = SceneName> {
    PossibleValuesParser::new(SceneName::ALL.map(SceneName::name)).try_map(|word| {
        let named = |scene: &SceneName| scene.name() == word;
        SceneName::ALL
            .into_iter()
            .find(named)
            .ok_or("no such scene")
    })
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("impinge-fem: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> Result<(), Error> {
    let scene = drop_scene(args.scene)?;
    let n_threads = args.threads.map_or(0, NonZeroUsize::get);
    let mut settings = scene.settings.clone();
    settings.threads = n_threads;
    let mut simulation = Simulation::new(&scene.solids, settings)?;
    let settings = impinge::Settings::from(Backend::Cpu).threads(n_threads);
    let mut detector = Detector::new(settings)?;
    let mut cache = match &args.out {
        Some(folder) => Some(files(folder, args.scene.name(), &simulation)?),
        None => None,
    };
    println!("{}", scene.label);
    println!(
        "step pairs colliding contacts | ms: detect contact assemble solve | iterations, lowest and highest of each, energy"
    );
    for _ in 0..args.steps.unwrap_or(scene.n_steps) {
        if let Some(cache) = &mut cache {
            cache.append(&positions(&simulation)?)?;
        }
        let report = simulation.step(&mut detector)?;
        print(&report, &scene, &simulation);
    }
    if let Some(mut cache) = cache {
        cache.append(&positions(&simulation)?)?;
        cache.finish()?;
    }
    Ok(())
}

fn print(r: &StepReport, scene: &DropScene, simulation: &Simulation) {
    let positions = simulation.positions();
    let (lower, upper) = positions.split_at(scene.solids[0].rest.len());
    let heights = |of: &[[f64; 3]]| {
        let low = of.iter().fold(f64::INFINITY, |low, p| low.min(p[1]));
        let high = of.iter().fold(f64::NEG_INFINITY, |high, p| high.max(p[1]));
        format!("{low:.2}..{high:.2}")
    };
    println!(
        "{:>4} {:>6} {:>6} {:>6} | {:6.2} {:6.2} {:6.2} {:6.2} | {:>3} {} {} {:.1}",
        r.step,
        r.n_pairs,
        r.n_colliding.iter().sum::<usize>(),
        r.n_contacts,
        r.detect_ms,
        r.contact_ms,
        r.assemble_ms,
        r.solve_ms,
        r.n_iterations,
        heights(lower),
        heights(upper),
        simulation.energy().total()
    );
}

/// Writes the mesh, and starts the file of positions.
fn files(folder: &Path, name: &str, simulation: &Simulation) -> Result<Pc2Writer, Error> {
    fs::create_dir_all(folder).map_err(|source| Error::Folder {
        path: folder.display().to_string(),
        source,
    })?;
    let mut tets: Vec<[u32; 4]> = Vec::new();
    let mut n_vertices = 0;
    for &id in simulation.bodies() {
        let body = simulation.scene().body(id)?;
        if let Elements::Tetrahedra(own) = body.elements() {
            tets.extend(own.iter().map(|tet| tet.map(|vertex| vertex + n_vertices)));
        }
        n_vertices += body.positions().len() as u32;
    }
    let mesh = ColoredMesh {
        positions: &impinge_io::Positions::F32(positions(simulation)?),
        elements: &impinge_io::Elements::Tetrahedra(tets),
        element_colors: None,
        colliding: None,
        name,
    };
    let path = folder.join(name);
    write_ply(&path.with_extension("ply"), &[mesh])?;
    let n_vertices = simulation.masses().len();
    Ok(Pc2Writer::create(
        &path.with_extension("pc2"),
        n_vertices,
        0.0,
        1.0,
    )?)
}

/// The positions that the detector gets, body by body.
fn positions(simulation: &Simulation) -> Result<Vec<[f32; 3]>, Error> {
    let bodies = simulation.bodies().iter();
    let shown: Vec<_> = bodies
        .map(|&id| simulation.shown(id))
        .collect::<Result<_, _>>()?;
    Ok(shown.concat())
}
