//! Title, summary, machines, and how it was measured.

use super::{gpu_name, heading, paragraph, places, ratios, short_place};
use crate::document::{Block, Table, percent, range};
use crate::published;
use crate::report::{Method, Report};

pub(super) fn blocks(report: &Report) -> Vec<Block> {
    let mut blocks = vec![
        Block::Heading(1, "The paper's benchmarks, measured again".to_owned()),
        paragraph(
            "The measurements of section 4 of \"Real-time Collision Detection with Two-level Spatial Hashing on GPU\", \
             repeated by one run of `impinge-paper`. Rows in italics are the paper's own numbers. `Cells` is \
             the library's version of the paper's method, `Clusters` is the library's default, and [FWZS11] is the \
             uniform grid with a radix sort that the paper compares itself with.",
        ),
    ];
    if report.is_quick {
        blocks.push(paragraph(
            "**A quick run**: few frames, to check that all contestants agree. Its times are not meaningful.",
        ));
    }
    if report.has_debug_assertions {
        blocks.push(paragraph(
            "**Built with debug assertions**: times are much longer than in a release build.",
        ));
    }
    blocks.extend([
        heading("Summary"),
        Block::List(in_short(report)),
        heading("Machines"),
        Block::Table(machines(report)),
    ]);
    if !report.remarks.is_empty() {
        blocks.push(Block::List(report.remarks.clone()));
    }
    blocks.extend([heading("How it was measured"), Block::List(how())]);
    blocks
}

fn machines(report: &Report) -> Table {
    let machine = &report.machine;
    let mut table = Table::new("The machines of the measurements.", 2, &["", "CPU", "GPU"]);
    table.n_text = 3;
    table.papers(vec![
        "the paper".to_owned(),
        "Intel i7, 3.2 GHz".to_owned(),
        format!("NVIDIA GeForce {}, CUDA 5.0", published::GPU),
    ]);
    let driver = match &report.adapter {
        Some(adapter) => format!(", driver {}", adapter.driver),
        None => String::new(),
    };
    table.ours(vec![
        "here".to_owned(),
        format!(
            "{}, {} of {} threads, {}, {}",
            machine.cpu, machine.n_threads, machine.n_threads_offered, machine.vectors, machine.os
        ),
        gpu_name(report) + &driver,
    ]);
    table
}

fn how() -> Vec<String> {
    [
        "All contestants run in one process on the same frames and take turns, with a pause of 1 ms before each frame, so \
         that all start with cold caches and sleeping threads. All positions are rewritten before each frame.",
        "The clock runs from positions in memory to sorted pairs in memory. On a GPU that includes sending \
         positions, reading pairs back and settling unsure pairs.",
        "Like the paper, the tables print averages, with medians beside them. Ratios are of medians for surfaces and of averages for solids.",
        "λ is 1 for `Cells` and 5 for [FWZS11] as in the paper. Both also run with the λ that was fastest on a few frames \
         of the scene, for each method and machine. On the CPU, `Cells` first drops elements that the other body comes nowhere near, \
         by a coarse map; [FWZS11] has the map too when it runs with its best λ, but follows the paper's description with λ = 5.",
        "A software driver imitates a GPU on the CPU: it runs at most ten frames of each scene, with the paper's λ, and \
         its times say nothing about GPUs.",
    ]
    .map(str::to_owned)
    .into()
}

fn in_short(report: &Report) -> Vec<String> {
    let mut points = Vec::new();
    let scenes = &report.surfaces[..];
    for is_gpu in places(scenes) {
        let place = short_place(is_gpu);
        let run = |method| move |scene| crate::report::Scene::run(scene, method, is_gpu);
        let best = |method| move |scene| crate::report::Scene::best(scene, method, is_gpu);
        let fastest = |method| move |scene| crate::report::Scene::fastest(scene, method, is_gpu);
        let mean = |method: Method| -> Vec<f64> {
            let runs = scenes.iter().filter_map(|scene| scene.run(method, is_gpu));
            runs.map(|run| run.ms.mean).collect()
        };
        let papers: Vec<f64> = scenes
            .iter()
            .filter_map(|scene| Some(published::surface(&scene.name)?.ms))
            .collect();
        points.push(format!(
            "Surfaces on the {place}, average per frame: `Cells` (λ = 1) {} ms, `Clusters` {} ms; the paper on its \
             {}: {} ms.",
            range(&mean(Method::Cells)),
            range(&mean(Method::Clusters)),
            published::GPU,
            range(&papers),
        ));
        let claims = ratios(scenes, run(Method::Fwzs11), run(Method::Cells));
        let at_best = ratios(scenes, best(Method::Fwzs11), best(Method::Cells));
        let clusters = ratios(scenes, fastest(Method::Fwzs11), run(Method::Clusters));
        if !claims.is_empty() {
            let at_best = match at_best.is_empty() {
                true => String::new(),
                false => format!(" and {} times with the best λ of each", range(&at_best)),
            };
            points.push(format!(
                "Against [FWZS11] on the {place} in the same run: `Cells` is {} times as fast with the paper's λ{at_best} \
                 (the paper: more than twice), `Clusters` {} times.",
                range(&claims),
                range(&clusters),
            ));
        }
    }
    let losses = report.duplicates.iter().filter(|row| !row.has_box_test);
    let losses: Vec<f64> = losses.map(|row| row.missing_rate).collect();
    let least = losses.iter().copied().fold(f64::INFINITY, f64::min);
    let most = losses.iter().copied().fold(0.0, f64::max);
    if least <= most {
        let [least, most] = [least, most].map(percent);
        let loss = if least == most {
            most
        } else {
            format!("{least} to {most}")
        };
        points.push(format!(
            "The table hashed by DJB2 loses {loss} of the colliding triangles (the paper: 2.7 % to 4.3 %); the owner rule, \
             which replaces it, loses none."
        ));
    }
    points.push(match report.n_disagreements() {
        0 => "Every contestant found the same set of pairs in every frame.".to_owned(),
        n => format!("**{n} answers differ from the reference**: see the chapter on agreement."),
    });
    points
}
