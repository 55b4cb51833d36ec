//! The text of the report, chapter by chapter: turns data into headings, tables and sentences. All
//! numbers come from the data, and the data chooses the sentences that draw a conclusion.

mod absolute;
mod checks;
mod comparison;
mod differences;
mod duplicates;
mod opening;
mod surfaces;
mod volumes;

use crate::document::{Block, NONE, Table, count, density, ms, percent, ratio};
use crate::report::{Method, Report, Run, Scene};

/// The whole report.
pub(crate) fn all(report: &Report) -> Vec<Block> {
    let mut blocks = opening::blocks(report);
    if !report.surfaces.is_empty() {
        blocks.extend(surfaces::blocks(report));
        blocks.extend(comparison::blocks(report));
    }
    if !report.duplicates.is_empty() {
        blocks.extend(duplicates::blocks(report));
    }
    if !report.volumes.is_empty() {
        blocks.extend(volumes::blocks(report));
    }
    blocks.extend(absolute::blocks(report));
    blocks.extend(differences::blocks(report));
    blocks.extend(checks::blocks(report));
    blocks
}

fn heading(title: &str) -> Block {
    Block::Heading(2, title.to_owned())
}

fn paragraph(words: impl Into<String>) -> Block {
    Block::Paragraph(words.into())
}

/// The name of a method in tables.
fn method(method: Method) -> &'static str {
    match method {
        Method::Cells => "`Cells` (two levels)",
        Method::Clusters => "`Clusters` (ours)",
        Method::Fwzs11 => "[FWZS11]",
    }
}

/// The place where a contestant ran.
fn place(run: &Run) -> &'static str {
    match (run.is_gpu, run.is_software) {
        (false, _) => "CPU",
        (true, false) => "GPU",
        (true, true) => "GPU (software)",
    }
}

/// λ, and whether it is the paper's or the best one.
fn lambda(run: &Run) -> String {
    match run.lambda {
        None => NONE.to_owned(),
        Some(lambda) => {
            let whose = match (run.is_papers_lambda, run.is_chosen_lambda) {
                (true, true) => " (paper, best)",
                (true, false) => " (paper)",
                (false, _) => " (best)",
            };
            density(lambda) + whose
        }
    }
}

/// Every contestant on every scene, in full.
fn contestants(caption: &str, scenes: &[Scene]) -> Table {
    let mut table = Table::new(
        caption,
        3,
        &[
            "scene",
            "contestant",
            "on",
            "λ",
            "ms, average",
            "ms, median",
            "[FWZS11] / this",
            "cells",
            "second level",
            "entries",
            "candidates",
            "unsure",
            "MB held",
            "stages, ms (median)",
        ],
    );
    for scene in scenes {
        // For solids, half of the steps have little contact or none, so the mean is used.
        let typical = |run: &Run| match scene.simulation_ms {
            Some(_) => run.ms.mean,
            None => run.ms.median,
        };
        for run in &scene.runs {
            let whole = scene.run(Method::Fwzs11, run.is_gpu);
            let counted = |n: f64| {
                if run.lambda.is_some() {
                    count(n)
                } else {
                    NONE.to_owned()
                }
            };
            let stages: Vec<String> = run
                .stages
                .iter()
                .filter(|stage| stage.ms.median >= 0.005)
                .map(|stage| format!("{} {}", stage.name, ms(stage.ms.median)))
                .collect();
            table.ours(vec![
                scene.name.clone(),
                method(run.method).to_owned(),
                place(run).to_owned(),
                lambda(run),
                ms(run.ms.mean),
                ms(run.ms.median),
                whole.map_or(NONE.to_owned(), |whole| {
                    ratio(typical(whole) / typical(run))
                }),
                counted(run.n_cells.mean),
                counted(run.n_subdivided.mean),
                counted(run.n_entries.mean),
                count(run.n_candidates.mean),
                percent(share(run.n_unsure.mean, run.n_candidates.mean)),
                format!("{:.1}", run.bytes_held as f64 / 1e6),
                stages.join(", "),
            ]);
        }
    }
    table
}

/// The share of a part in a whole; 0 if the whole is 0.
fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

/// Median times of one contestant over those of another, scene by scene where both ran.
fn ratios<'a>(
    scenes: &'a [Scene],
    over: impl Fn(&'a Scene) -> Option<&'a Run>,
    under: impl Fn(&'a Scene) -> Option<&'a Run>,
) -> Vec<f64> {
    let of = |scene| Some(over(scene)?.ms.median / under(scene)?.ms.median);
    scenes.iter().filter_map(of).collect()
}

/// The name of the GPU in sentences; a software driver is marked as such.
fn gpu_name(report: &Report) -> String {
    match &report.adapter {
        None => NONE.to_owned(),
        Some(adapter) if adapter.is_software => {
            format!("{} (**software**: it runs on the CPU)", adapter.name)
        }
        Some(adapter) => adapter.name.clone(),
    }
}

/// Where contestants ran: on the CPU, on a GPU.
fn places(scenes: &[Scene]) -> Vec<bool> {
    let ran = |is_gpu| {
        scenes
            .iter()
            .any(|scene| scene.runs.iter().any(|run| run.is_gpu == is_gpu))
    };
    [false, true]
        .into_iter()
        .filter(|is_gpu| ran(*is_gpu))
        .collect()
}

/// `"CPU"` or `"GPU"`.
fn short_place(is_gpu: bool) -> &'static str {
    if is_gpu { "GPU" } else { "CPU" }
}
