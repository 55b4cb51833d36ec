//! `impinge simulate`: bodies that deform and push each other, written as a sequence.

use std::fs::create_dir_all;
use std::io::Write;

use impinge::{BodyId, CancelToken, Control, Detector, Pairs};
use impinge_fem::scenes::{DropScene, drop_scene};
use impinge_fem::{Simulation, State, StepReport};
use impinge_io::printable;

use crate::args::SimulateArgs;
use crate::commands::record::{Found, Record};
use crate::detection::{Times, detector, percentile};
use crate::error::Error;
use crate::output::{out, stage_table, table};
use crate::stop::Patience;
use crate::text::{counted, grouped};
use crate::watch::Watch;

/// The number of steps between two saved states.
const SAVE_EVERY: u64 = 25;

/// The names of the solids.
const NAMES: [&str; 2] = ["lower", "upper"];

/// `impinge simulate`.
pub fn simulate(args: &SimulateArgs, cancel: &CancelToken) -> Result<(), Error> {
    let mut detector = detector(&args.detector)?;
    let scene = drop_scene(args.scene)?;
    let n_steps = args.steps.map_or(scene.n_steps, u64::from);
    let mut settings = scene.settings.clone();
    settings.threads = args.detector.threads.map_or(0, Into::into);
    let mut simulation = Simulation::new(&scene.solids, settings)?;
    let bodies: Vec<(BodyId, &str)> = simulation.bodies().iter().copied().zip(NAMES).collect();

    create_dir_all(&args.out).map_err(|source| Error::Write {
        path: args.out.clone(),
        source,
    })?;
    let saved = Record::saved_state(&args.out)?;
    let mut record = match (args.resume, saved) {
        (true, Some((path, bytes))) => {
            State::from_bytes(&bytes)
                .and_then(|state| simulation.restore(&state))
                .map_err(|source| Error::SavedState { path, source })?;
            if simulation.n_steps() > n_steps {
                return Err(Error::Usage(format!(
                    "{} holds {} already, more than --steps {n_steps}",
                    printable(&args.out),
                    counted(simulation.n_steps(), "step")
                )));
            }
            Record::resume(args, &simulation)?
        }
        (false, Some((path, _))) => {
            return Err(Error::Usage(format!(
                "{} exists: continue from it with --resume, or choose another folder",
                printable(&path)
            )));
        }
        (_, None) => Record::create(args, &simulation)?,
    };
    introduce(&scene, &simulation, n_steps)?;

    let n_left = n_steps - simulation.n_steps();
    let watch = Watch::frames(
        !args.detector.no_progress,
        usize::try_from(n_left).unwrap_or(usize::MAX),
        false,
    );
    // A step is short, so a request to stop waits for it, and its state is saved.
    let _patience = Patience::new();
    detector.set_control(Control::new().cancel(cancel));
    let mut summary = Summary::default();
    let result = run(
        &mut simulation,
        &mut detector,
        n_steps,
        cancel,
        &mut Running {
            bodies: &bodies,
            record: &mut record,
            summary: &mut summary,
            watch: &watch,
        },
    );
    drop(watch);
    match result {
        Ok(()) => {}
        Err(Error::Simulation(impinge_fem::Error::Detection(impinge::Error::Cancelled))) => {
            record.save(&simulation.state())?;
            return Err(Error::Stopped {
                step: simulation.n_steps(),
                n_steps,
                folder: args.out.clone(),
            });
        }
        Err(error) => return Err(error),
    }
    summary.print(&bodies)?;
    writeln!(out(), "wrote {}", record.describe())?;
    Ok(())
}

fn introduce(scene: &DropScene, simulation: &Simulation, n_steps: u64) -> Result<(), Error> {
    let mut to = out();
    writeln!(
        to,
        "{}: {} of {} ms{}",
        scene.label,
        counted(n_steps, "step"),
        simulation.settings().dt * 1e3,
        match simulation.n_steps() {
            0 => String::new(),
            done => format!(", continuing after step {}", grouped(done)),
        }
    )?;
    Ok(to.flush()?)
}

/// The outputs of a run.
struct Running<'a> {
    bodies: &'a [(BodyId, &'a str)],
    record: &'a mut Record,
    summary: &'a mut Summary,
    watch: &'a Watch,
}

/// Runs the simulation. Frame k shows the state after k steps and its pairs; it is written before
/// step k is made.
fn run(
    simulation: &mut Simulation,
    detector: &mut Detector,
    n_steps: u64,
    cancel: &CancelToken,
    to: &mut Running<'_>,
) -> Result<(), Error> {
    loop {
        if cancel.is_cancelled() {
            return Err(impinge_fem::Error::from(impinge::Error::Cancelled).into());
        }
        let step = simulation.n_steps();
        let pairs = &simulation.detect(detector)?;
        to.record.frame(simulation, to.bodies, pairs)?;
        to.summary.found(to.bodies, pairs);
        let found = Found::new(step, to.bodies, pairs);
        if step == n_steps {
            to.record.row(&found, None)?;
            return to.record.save(&simulation.state());
        }
        let report = simulation.advance(pairs)?;
        to.record.row(&found, Some(&report))?;
        to.summary.advanced(&report);
        if simulation.n_steps().is_multiple_of(SAVE_EVERY) {
            to.record.save(&simulation.state())?;
        }
        to.watch.frame_done();
    }
}

/// Counts and times of this run.
#[derive(Default)]
struct Summary {
    times: Times,
    advance_ms: Vec<f64>,
    n_iterations: usize,
    /// The number of pairs of each frame; below, the colliding tetrahedra of each body.
    n_pairs: Vec<usize>,
    n_colliding: Vec<Vec<usize>>,
}

impl Summary {
    fn found(&mut self, bodies: &[(BodyId, &str)], pairs: &Pairs) {
        self.times.add(pairs.stats());
        self.n_pairs.push(pairs.len());
        let colliding = |&(id, _): &(BodyId, &str)| pairs.colliding(id).len();
        self.n_colliding
            .push(bodies.iter().map(colliding).collect());
    }

    fn advanced(&mut self, report: &StepReport) {
        self.advance_ms.push(report.advance_ms);
        self.n_iterations += report.n_iterations;
    }

    fn print(&self, bodies: &[(BodyId, &str)]) -> Result<(), Error> {
        let mut to = out();
        writeln!(to, "\n{}\n", stage_table(&self.times))?;
        let n_frames = self.n_pairs.len().max(1);
        let row = |what: &str, counts: &[usize]| {
            let mean = counts.iter().sum::<usize>() as f64 / n_frames as f64;
            let most = counts.iter().max().copied().unwrap_or(0);
            vec![what.to_owned(), format!("{mean:.0}"), grouped(most as u64)]
        };
        let mut rows = vec![row("pairs", &self.n_pairs)];
        for (ix, (_, name)) in bodies.iter().enumerate() {
            let counts: Vec<usize> = self.n_colliding.iter().map(|frame| frame[ix]).collect();
            rows.push(row(&format!("colliding tetrahedra, {name} body"), &counts));
        }
        writeln!(to, "{}\n", table(&["found", "average", "most"], &[0], rows))?;
        if !self.advance_ms.is_empty() {
            writeln!(
                to,
                "finite elements: median {:.3} ms per step, 95 % within {:.3} ms; {:.1} iterations of the solver",
                percentile(&self.advance_ms, 50),
                percentile(&self.advance_ms, 95),
                self.n_iterations as f64 / self.advance_ms.len() as f64
            )?;
        }
        Ok(())
    }
}
