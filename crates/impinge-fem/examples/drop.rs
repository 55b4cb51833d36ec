//! Runs a scene and prints one line per step:
//! `cargo run --release -p impinge-fem --example drop -- bunny-7k 240`.

use impinge::{Backend, Detector};
use impinge_fem::scenes::{SceneName, drop_scene};
use impinge_fem::{Error, Simulation};

fn main() -> Result<(), Error> {
    let mut args = std::env::args().skip(1);
    let wanted = args.next().unwrap_or_else(|| "blocks".to_owned());
    let name = SceneName::ALL
        .into_iter()
        .find(|name| name.name() == wanted)
        .unwrap_or(SceneName::Blocks);
    let scene = drop_scene(name)?;
    let n_steps = args.next().and_then(|n| n.parse().ok());
    let n_steps = n_steps.unwrap_or(scene.n_steps);
    println!("{}", scene.label);
    println!(
        "step pairs colliding contacts | ms: detect contact assemble solve | iterations, lowest height, energy"
    );
    let mut simulation = Simulation::new(&scene.solids, scene.settings)?;
    let mut detector = Detector::new(Backend::Cpu)?;
    for _ in 0..n_steps {
        let r = simulation.step(&mut detector)?;
        let n_lower = scene.solids[0].rest.len();
        let heights = |range: &[[f64; 3]]| {
            range
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
                    (low.min(p[1]), high.max(p[1]))
                })
        };
        let positions = simulation.positions();
        let (lower, upper) = (
            heights(&positions[..n_lower]),
            heights(&positions[n_lower..]),
        );
        println!(
            "{:>4} {:>6} {:>6} {:>6} | {:6.2} {:6.2} {:6.2} {:6.2} | {:>3} {:.2}..{:.2} {:.2}..{:.2} {:.1}",
            r.step,
            r.n_pairs,
            r.n_colliding.iter().sum::<usize>(),
            r.n_contacts,
            r.detect_ms,
            r.contact_ms,
            r.assemble_ms,
            r.solve_ms,
            r.n_iterations,
            lower.0,
            lower.1,
            upper.0,
            upper.1,
            simulation.energy().total()
        );
    }
    Ok(())
}
