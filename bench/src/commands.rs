//! The commands: their problems, contestants and tables.

use impinge::{Backend, Method};
use impinge_scenes::deform::Wave;
use impinge_scenes::{adversarial, regular, surfaces};

use crate::measure::{self, Table};
use crate::ours::{Feed, Ours};
use crate::problem::{Ask, Problem, models, posed};
use crate::report::{Report, figures, grouped};
use crate::runner::Runner;
use crate::{
    Failure, Options, c, distance, files, gpu, near, once, resident, solver_sizes, step_sizes,
    steps,
};

/// Runs a command by its name.
pub fn run(command: &str, options: &Options) -> Result<(), Failure> {
    let mut report = match command {
        "two-body" | "motion" | "self" | "tets" | "bodies" | "sizes" | "adversarial" | "gpu"
        | "resident" | "regular" | "steps" | "step-sizes" | "solver-sizes" | "near"
        | "distance" | "once" => Report::new(command),
        "device" => {
            println!("{}", gpu::slug(&gpu::device(options)?));
            return Ok(());
        }
        _ => return Err(format!("no command `{command}`; --help lists what there is").into()),
    };
    match command {
        "two-body" => two_body(options, &mut report)?,
        "motion" => motion(options, &mut report)?,
        "self" => within(options, &mut report)?,
        "tets" => tets(options, &mut report)?,
        "bodies" => bodies(options, &mut report)?,
        "sizes" => sizes(options, &mut report)?,
        "gpu" => gpu::scenes(options, &mut report)?,
        "resident" => resident::run(options, &mut report)?,
        "regular" => regular_surfaces(options, &mut report)?,
        "steps" => steps::run(options, &mut report)?,
        "step-sizes" => step_sizes::run(options, &mut report)?,
        "solver-sizes" => solver_sizes::run(options, &mut report)?,
        "near" => near::run(options, &mut report)?,
        "distance" => distance::run(options, &mut report)?,
        "once" => once::run(options, &mut report)?,
        _ => adversarial_scenes(options, &mut report)?,
    }
    report.write(options.json.as_deref(), options.record.as_deref())
}

/// The best settings of the peers, reused for problems of the same kind.
#[derive(Default)]
struct Peers {
    #[cfg(feature = "embree")]
    embree: Option<crate::embree::Setting>,
    #[cfg(feature = "parry")]
    parry: Option<crate::parry::Setting>,
}

impl Peers {
    /// All available peers, with their best settings; settings found before are reused.
    #[cfg_attr(not(any(feature = "embree", feature = "parry")), allow(unused))]
    fn runners(&mut self, problem: &Problem) -> Result<Vec<Box<dyn Runner>>, Failure> {
        let mut runners = Vec::new();
        #[cfg(feature = "embree")]
        {
            let (runner, setting) = crate::embree::tuned(problem, self.embree)?;
            self.embree = Some(setting);
            runners.push(runner);
        }
        #[cfg(feature = "parry")]
        {
            let (runner, setting) = crate::parry::tuned(problem, self.parry)?;
            self.parry = Some(setting);
            runners.push(runner);
        }
        Ok(runners)
    }
}

/// The library's contestants; the others are compared with the first one. `variants` adds positions
/// copied on the clock, and a single thread. Other affinities of helper threads follow the first
/// contestant.
fn ours(
    problem: &Problem,
    options: &Options,
    variants: bool,
) -> Result<Vec<Box<dyn Runner>>, Failure> {
    let clusters = options.settings(Method::Clusters);
    let in_place = Ours::new(problem, clusters.clone(), Feed::InPlace)?;
    let mut runners: Vec<Box<dyn Runner>> = vec![Box::new(in_place)];
    for &affinity in &options.affinities[1..] {
        let other = clusters.clone().affinity(affinity);
        runners.push(Box::new(Ours::new(problem, other, Feed::InPlace)?));
    }
    if variants {
        for feed in [Feed::Copied, Feed::Shared] {
            runners.push(Box::new(Ours::new(problem, clusters.clone(), feed)?));
        }
        if options.threads == 0 && options.backend == Backend::Cpu {
            let single = clusters.threads(1);
            let feeds = [Feed::InPlace, Feed::Copied, Feed::Shared];
            let n_feeds = if options.c_library.is_some() { 3 } else { 1 };
            for feed in &feeds[..n_feeds] {
                runners.push(Box::new(Ours::new(problem, single.clone(), *feed)?));
            }
        }
        runners.extend(c::runners(problem, options)?);
    }
    if options.cells {
        let cells = options.settings(Method::Cells);
        runners.push(Box::new(Ours::new(problem, cells, Feed::InPlace)?));
    }
    Ok(runners)
}

fn contest(
    problem: &Problem,
    options: &Options,
    peers: &mut Peers,
    default_frames: usize,
    variants: bool,
) -> Result<Table, Failure> {
    eprintln!(
        "{}: {} elements …",
        problem.name,
        grouped(problem.n_elements() as u64)
    );
    let mut runners = ours(problem, options, variants)?;
    if options.peers {
        runners.extend(peers.runners(problem)?);
    }
    measure::run(
        problem,
        runners,
        options.frames.unwrap_or(default_frames),
        options.turn,
    )
}

fn two_body(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let scenes = match &options.scene {
        Some(scene) => vec![scene.as_str()],
        None => vec!["ball", "bunny", "buddha", "dragon", "parts"],
    };
    for scene in scenes {
        let problem = files::two_body(scene)?.by_oracle()?;
        report.contest(&contest(
            &problem,
            options,
            &mut Peers::default(),
            40,
            true,
        )?);
    }
    Ok(())
}

/// Relative speeds, in widths of a body per frame.
const SPEEDS: [f32; 4] = [0.001, 0.003, 0.01, 0.03];

fn motion(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let scene = options.scene.as_deref().unwrap_or("dragon");
    let mut peers = Peers::default();
    for speed in SPEEDS {
        let problem = files::passing(scene, speed)?;
        report.contest(&contest(&problem, options, &mut peers, 120, false)?);
    }
    Ok(())
}

fn within(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let problem = files::within(options.scene.as_deref().unwrap_or("dragon"))?.by_oracle()?;
    report.contest(&contest(
        &problem,
        options,
        &mut Peers::default(),
        20,
        true,
    )?);
    Ok(())
}

fn tets(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let problem = files::tets()?.by_oracle()?;
    report.contest(&contest(
        &problem,
        options,
        &mut Peers::default(),
        40,
        true,
    )?);
    Ok(())
}

fn bodies(options: &Options, report: &mut Report) -> Result<(), Failure> {
    for n_bodies in [1_000, 10_000, 100_000] {
        if options.size.is_some_and(|largest| n_bodies > largest) {
            continue;
        }
        let models = models(adversarial::boxes(n_bodies, 1)?)?;
        let name = format!("{} bodies", grouped(n_bodies as u64));
        let problem = Problem::mirrored(&name, models, Ask::All).about(
            "cubes of 12 triangles placed and turned at random; frames alternate with the mirror image",
        ).by_oracle()?;
        let frames = if n_bodies > 10_000 { 10 } else { 40 };
        report.contest(&contest(
            &problem,
            options,
            &mut Peers::default(),
            frames,
            true,
        )?);
    }
    Ok(())
}

fn sizes(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let mut peers = Peers::default();
    let mut tables = Vec::new();
    for n in [
        10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000, 10_000_000,
    ] {
        if options.size.is_some_and(|largest| n > largest) {
            continue;
        }
        let body = surfaces::stand_in(n / 2);
        let other = body.translated([0.4, 0.01, 0.01]);
        let name = format!("{} triangles", grouped(n as u64));
        let models = vec![body, other];
        let problem = Problem::moving(&name, models, Ask::Between, &Wave::default(), [1.0, 2.0])
            .about("generated tubes along a knot; frames alternate between two moments of a wave");
        let frames = if n > 1_000_000 { 6 } else { 20 };
        let table = contest(&problem, options, &mut peers, frames, false)?;
        report.contest(&table);
        tables.push(table);
    }
    let mut text = "### Cost against size\n\n".to_owned();
    let Some(first) = tables.first() else {
        return Ok(());
    };
    text += "| triangles | pairs |";
    for row in &first.rows {
        text += &format!(" {} ms | ns per triangle |", row.name);
    }
    text +=
        " bytes per triangle, positions and topology | bytes per triangle, detector |\n|---:|---:|";
    text += &"---:|---:|".repeat(first.rows.len() + 1);
    text.push('\n');
    for table in &tables {
        let n = table.n_elements as f64;
        text += &format!(
            "| {} | {} |",
            grouped(table.n_elements as u64),
            grouped(table.rows[0].n_pairs)
        );
        for row in &table.rows {
            text += &format!(
                " {} | {:.1} |",
                figures(row.median_ms),
                row.median_ms * 1e6 / n
            );
        }
        let bytes = |key: &str| table.rows[0].details[key].as_f64().unwrap_or(0.0) / n;
        text += &format!(
            " {:.1} | {:.1} |\n",
            bytes("bytes_scene"),
            bytes("bytes_held")
        );
    }
    report.say(&text);
    Ok(())
}

fn adversarial_scenes(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let size = options.size.unwrap_or(1_000_000);
    let methods = if options.cells {
        vec![Method::Clusters, Method::Cells]
    } else {
        vec![Method::Clusters]
    };
    let mut text = "Each scene beside a plain one (two bodies that meet) of as many elements. `per item` is time over \
                    elements plus pairs.\n\n\
                    | scene | method | elements | pairs | candidates | ms | plain ms | ratio | ns per item | plain | bytes per element |\n\
                    |---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n"
        .to_owned();
    for entry in adversarial::SCENES {
        if options
            .scene
            .as_ref()
            .is_some_and(|scene| scene != entry.name)
        {
            continue;
        }
        let n = size.min(entry.max_n);
        let problem = posed((entry.build)(n)?, entry.probes)?;
        let plain = posed(
            adversarial::plain(problem.n_elements())?,
            "two bodies that meet",
        )?;
        for &method in &methods {
            let measured = |problem: &Problem| -> Result<Table, Failure> {
                let runner = Ours::new(problem, options.settings(method), Feed::InPlace)?;
                measure::run(
                    problem,
                    vec![Box::new(runner)],
                    options.frames.unwrap_or(5),
                    options.turn,
                )
            };
            let (table, base) = (measured(&problem)?, measured(&plain)?);
            let (row, base_row) = (&table.rows[0], &base.rows[0]);
            let per_item = |table: &Table| {
                let row = &table.rows[0];
                row.median_ms * 1e6 / (table.n_elements as f64 + row.n_pairs as f64)
            };
            let count = |key: &str| row.details[key].as_u64().unwrap_or(0);
            text += &format!(
                "| {} | {} | {} | {} | {} | {} | {} | {:.1} | {:.1} | {:.1} | {:.0} |\n",
                entry.name,
                method.name(),
                grouped(table.n_elements as u64),
                grouped(row.n_pairs),
                grouped(count("candidates")),
                figures(row.median_ms),
                figures(base_row.median_ms),
                row.median_ms / base_row.median_ms,
                per_item(&table),
                per_item(&base),
                count("bytes_held") as f64 / table.n_elements as f64,
            );
            report.keep(&table);
            report.keep(&base);
        }
    }
    report.say(&text);
    Ok(())
}

/// Surfaces at rest, none of which meets itself: each beside the rough one of the same run.
fn regular_surfaces(options: &Options, report: &mut Report) -> Result<(), Failure> {
    let size = options.size.unwrap_or(80_000);
    let mut text = "Self-collision of surfaces that do not meet themselves. `ratio` is to the rough surface under `skip`.\n\n\
                    | surface | pairs that share a vertex | triangles | candidates | unsure | ms | ratio |\n\
                    |---|---|---:|---:|---:|---:|---:|\n"
        .to_owned();
    let mut rough_ms = None;
    for surface in regular::ALL {
        for (ask, rule) in [(Ask::Within, "skip"), (Ask::Resolved, "resolve")] {
            let model = (surface.build)(size);
            let problem = Problem::mirrored(surface.name, vec![model], ask)
                .about(surface.what)
                .expecting(Some(0));
            let runner = Ours::new(&problem, options.settings(Method::Clusters), Feed::InPlace)?;
            let frames = options.frames.unwrap_or(40);
            let table = measure::run(&problem, vec![Box::new(runner)], frames, options.turn)?;
            let row = &table.rows[0];
            let rough_ms = *rough_ms.get_or_insert(row.median_ms);
            let count = |key: &str| grouped(row.details[key].as_u64().unwrap_or(0));
            text += &format!(
                "| {} | {rule} | {} | {} | {} | {} | {:.1} |\n",
                surface.name,
                grouped(table.n_elements as u64),
                count("candidates"),
                count("unsure"),
                figures(row.median_ms),
                row.median_ms / rough_ms,
            );
            report.keep(&table);
        }
    }
    report.say(&text);
    Ok(())
}
