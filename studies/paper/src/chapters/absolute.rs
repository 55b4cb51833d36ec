//! The paper's times beside ours, with the machines.

use super::{gpu_name, heading, paragraph, places};
use crate::document::{Block, NONE, Table, ms, ratio};
use crate::published;
use crate::report::{Method, Report, Scene};

pub(super) fn blocks(report: &Report) -> Vec<Block> {
    let scenes: Vec<&Scene> = report.surfaces.iter().chain(&report.volumes).collect();
    let gpus = [&report.surfaces[..], &report.volumes[..]]
        .map(places)
        .concat();
    let mut header = vec!["scene", "the paper"];
    let mut columns: Vec<(Method, bool)> = Vec::new();
    for is_gpu in [false, true]
        .into_iter()
        .filter(|is_gpu| gpus.contains(is_gpu))
    {
        header.extend(match is_gpu {
            false => [
                "`Cells`, CPU",
                "`Cells` best λ, CPU",
                "`Clusters`, CPU",
                "the paper / `Clusters`, CPU",
            ],
            true => [
                "`Cells`, GPU",
                "`Cells` best λ, GPU",
                "`Clusters`, GPU",
                "the paper / `Clusters`, GPU",
            ],
        });
        columns.push((Method::Clusters, is_gpu));
    }
    let mut table = Table::new("Average milliseconds per frame.", 1, &header);
    for scene in scenes {
        let papers = published::surface(&scene.name)
            .map(|papers| papers.ms)
            .or_else(|| Some(published::volume(&scene.name)?.ms));
        let mut cells = vec![scene.name.clone(), papers.map_or(NONE.to_owned(), ms)];
        for &(_, is_gpu) in &columns {
            let clusters = scene.run(Method::Clusters, is_gpu);
            let runs = [
                scene.run(Method::Cells, is_gpu),
                scene.best(Method::Cells, is_gpu),
                clusters,
            ];
            cells.extend(runs.map(|run| run.map_or(NONE.to_owned(), |run| ms(run.ms.mean))));
            cells.push(match (papers, clusters) {
                (Some(papers), Some(clusters)) => ratio(papers / clusters.ms.mean),
                _ => NONE.to_owned(),
            });
        }
        table.ours(cells);
    }
    vec![
        heading("Our times beside the paper's"),
        paragraph(format!(
            "The machines are more than a decade apart, and meshes and motions differ: these are absolute numbers, not a comparison of methods. \
             The paper: {}. Here: {}, {} threads; GPU: {}.",
            published::MACHINE,
            report.machine.cpu,
            report.machine.n_threads,
            gpu_name(report)
        )),
        Block::Table(table),
    ]
}
