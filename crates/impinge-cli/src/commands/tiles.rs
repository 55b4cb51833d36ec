//! `impinge tiles`: scenes larger than memory, step by step.

mod args;

use std::io::Write;

use impinge::{Backend, CancelToken, Control, Settings};
use impinge_io::printable;
use impinge_tiles::{Ask, MergedStep, Plan, PlanOptions, RunOptions, ScatterOptions, TileResult};
use serde::Serialize;

use self::args::{MergeArgs, PlanArgs, RunArgs, ScatterArgs, TilesCommand};
pub use self::args::{TILES_EXAMPLES, TilesArgs};
use crate::error::Error;
use crate::output::out;
use crate::report::{
    self, Impact, KindsOfTiles, TilesMerge, TilesPlan, TilesRun, TilesScatter, TilesStep,
};
use crate::text::{counted, grouped, hex, several};
use crate::watch::Watch;

/// `impinge tiles`.
pub fn tiles(args: &TilesArgs, cancel: &CancelToken) -> Result<(), Error> {
    match &args.command {
        TilesCommand::Plan(args) => plan(args, cancel),
        TilesCommand::Scatter(args) => scatter(args, cancel),
        TilesCommand::Run(args) => run(args, cancel),
        TilesCommand::Merge(args) => merge(args),
    }
}

fn print(json: bool, report: &impl Serialize, text: &str) -> Result<(), Error> {
    if json {
        report::print(report)?;
    } else {
        writeln!(out(), "{text}")?;
    }
    Ok(())
}

fn plan(args: &PlanArgs, cancel: &CancelToken) -> Result<(), Error> {
    let options = PlanOptions {
        cap: args.cap,
        chunk: args.chunk,
        weld: args.weld || !args.no_weld,
        step: args.step,
        separation: args.separation,
        cells: None,
        replace: args.replace,
    };
    let watch = Watch::detection(!args.no_progress, "reading elements");
    let plan = Plan::make(
        &args.folder,
        &args.meshes,
        &options,
        cancel,
        &mut |done, total| {
            watch.report(impinge::Progress { done, total });
        },
    )?;
    drop(watch);
    let n: u64 = plan.files().iter().map(|file| file.n_elements).sum();
    let report = TilesPlan {
        plan: hex(plan.id()),
        files: plan.files().len(),
        step: plan.is_step(),
        elements: n,
        tiles: plan.n_tiles(),
        units: plan.n_units(),
    };
    let text = format!(
        "{} of {} in {}; {} to scatter",
        counted(n, "element"),
        match (plan.files().len() as u64, plan.is_step()) {
            (n, true) => several(n, "moving body", "moving bodies"),
            (n, false) => counted(n, "file"),
        },
        counted(u64::from(plan.n_tiles()), "tile"),
        counted(plan.n_units() as u64, "unit"),
    );
    print(args.json, &report, &text)
}

fn scatter(args: &ScatterArgs, cancel: &CancelToken) -> Result<(), Error> {
    let plan = Plan::open(&args.folder)?;
    let options = ScatterOptions {
        rank: args.share.rank,
        world_size: args.share.world_size.get(),
        threads: args.threads.map_or(0, usize::from),
    };
    let watch = Watch::detection(!args.no_progress, "scattering");
    let scattered = plan.scatter(&options, cancel, &|done, total| {
        watch.report(impinge::Progress { done, total });
    })?;
    drop(watch);
    let report = TilesScatter {
        written: scattered.n_written,
        kept: scattered.n_kept,
        elements: scattered.n_elements,
        records: scattered.n_records,
    };
    let text = format!(
        "{} written, {} kept; {} as {}",
        counted(scattered.n_written, "part"),
        grouped(scattered.n_kept),
        counted(scattered.n_elements, "element"),
        counted(scattered.n_records, "record"),
    );
    print(args.json, &report, &text)
}

fn run(args: &RunArgs, cancel: &CancelToken) -> Result<(), Error> {
    let plan = Plan::open(&args.folder)?;
    let tiles: Vec<u32> = match args.tile {
        Some(tile) => vec![tile],
        None => {
            let (rank, world_size) = (args.share.rank, args.share.world_size.get());
            if rank >= world_size {
                return Err(Error::Usage(format!(
                    "--rank {rank} of --world-size {world_size}: ranks start at 0"
                )));
            }
            (0..plan.n_tiles())
                .filter(|&tile| tile as usize % world_size == rank)
                .collect()
        }
    };
    let options = RunOptions {
        ask: Ask {
            between: !args.within,
            within: !args.between,
            shared_vertex: args.shared_vertex,
            start: args.start,
            precision: args.precision,
        },
        settings: Settings::new()
            .backend(Backend::Cpu)
            .method(args.method)
            .threads(args.threads.map_or(0, usize::from))
            .memory_budget(args.memory_budget),
        again: args.again,
    };
    let watch = Watch::things(!args.no_progress, tiles.len(), "tiles", args.json);
    let control = Control::new().cancel(cancel);
    let mut results: Vec<TileResult> = Vec::new();
    let mut printed = Ok(());
    plan.run(tiles, &options, control, &mut |result| {
        watch.frame_done();
        if args.json && printed.is_ok() {
            printed = report::print(&of_tile(result));
        }
        results.push(result.clone());
    })?;
    drop(watch);
    printed?;
    if !args.json {
        summarise(&results)?;
    }
    Ok(())
}

fn of_tile(result: &TileResult) -> TilesRun {
    TilesRun {
        tile: result.tile,
        elements: result.n_elements,
        pairs: result.n_pairs,
        hash: hex(result.hash),
        elsewhere: result.n_elsewhere,
        pieces: result.n_pieces,
        kept: result.was_kept,
    }
}

fn summarise(results: &[TileResult]) -> Result<(), Error> {
    let mut to = out();
    for result in results.iter().filter(|result| result.n_pieces > 1) {
        writeln!(
            to,
            "tile {}: {} that no cut of space separates; run in {} pieces, every piece against every other",
            result.tile,
            counted(result.n_elements, "element"),
            grouped(result.n_pieces),
        )?;
    }
    let n_pairs = results.iter().map(|result| result.n_pairs).sum();
    let n_kept = results.iter().filter(|result| result.was_kept).count() as u64;
    writeln!(
        to,
        "{}, {} kept; {}",
        counted(results.len() as u64, "tile"),
        grouped(n_kept),
        counted(n_pairs, "pair"),
    )?;
    Ok(())
}

fn merge(args: &MergeArgs) -> Result<(), Error> {
    let plan = Plan::open(&args.folder)?;
    let merged = plan.merge()?;
    // As `plan` takes them: in a step, the start and the end of each body.
    let files = plan.files().iter();
    let paths = files.flat_map(|file| std::iter::once(&file.path).chain(&file.end));
    let files = paths.map(|path| path.display().to_string());
    let report = TilesMerge {
        pairs: merged.n_pairs,
        hash: hex(merged.hash),
        asked: merged.asked.clone(),
        welded: plan.welds(),
        tiles: plan.n_tiles(),
        records: merged.n_records,
        uncut_tiles: merged.n_uncut,
        rows: merged.rows.display().to_string(),
        files: files.collect(),
        step: merged
            .step
            .as_ref()
            .map(|step| of_step(step, plan.separation())),
    };
    let mut found = counted(merged.n_pairs, "pair");
    if let Some(step) = &merged.step {
        let kinds = step
            .kinds
            .map(|(kind, n)| format!("{} {}", grouped(n), kind.name()));
        found = format!(
            "{} ({}), {} touching at the start",
            counted(merged.n_pairs, "impact"),
            kinds.join(", "),
            grouped(step.touching_at_start),
        );
    }
    let start = match plan.is_step() {
        true => {
            "\nwhether the start intersects was not asked: a plan of the starts without --step says it"
        }
        false => "",
    };
    let text = format!(
        "{found}, hash {} ({}, {}); rows in {}{start}",
        hex(merged.hash),
        merged.asked,
        match plan.welds() {
            true => "vertices welded",
            false => "vertices as in the files",
        },
        printable(&merged.rows),
    );
    print(args.json, &report, &text)
}

/// What `impinge step --json` says too, under the same keys.
fn of_step(step: &MergedStep, separation: f64) -> TilesStep {
    let earliest = step.earliest;
    let [(_, vf), (_, ee)] = step.kinds;
    TilesStep {
        free: earliest.is_none(),
        start_intersects: (),
        earliest: earliest.map(|(kind, row, toi)| Impact::new(kind, row, toi)),
        kinds: KindsOfTiles { vf, ee },
        touching_at_start: step.touching_at_start,
        separation,
    }
}
