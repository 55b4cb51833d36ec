//! Table 2 and figure 6.

use super::surfaces::pictures;
use super::{contestants, heading, paragraph, places, short_place};
use crate::document::{Block, Figure, NONE, Table, count, ms, twice};
use crate::figures;
use crate::published;
use crate::report::{Method, Report, Scene};

pub(super) fn blocks(report: &Report) -> Vec<Block> {
    let scenes = &report.volumes;
    let mut blocks = vec![
        heading("Table 2: solids of corotated finite elements"),
        paragraph(
            "An elastic body is dropped on another one like it. The positions of every simulation step are recorded, and all \
             contestants find the pairs of tetrahedra of the same steps. The columns are those of the paper: cells, cells of the second \
             level and times are those of `Cells` with λ = 1.",
        ),
        Block::Table(table_2(scenes)),
        Block::List(
            scenes
                .iter()
                .map(|scene| {
                    let advance = scene.simulation_ms.map_or(0.0, |samples| samples.mean);
                    format!(
                        "**{}**: {}; {}; {} steps, {} ms each without detection.",
                        scene.name,
                        scene.mesh,
                        scene.motion,
                        scene.n_frames,
                        ms(advance)
                    )
                })
                .collect(),
        ),
    ];
    blocks.extend(pictures(
        scenes,
        "Figure 6: for each scene the first step with a third of the largest number of pairs (at the maximum, bodies are crushed beyond \
         recognition). Colliding tetrahedra are red in the lower body and blue in the upper one; those inside show through.",
    ));
    blocks.push(Block::Figure(Figure::plot(
        figures::STEPS,
        "Colliding tetrahedra of both bodies, step by step: the bodies fall, meet, are crushed and separate again.",
    )));
    blocks.push(Block::Table(contestants(
        "Table 2, all contestants. Counts are averages per step, and ratios are of averages: the median step has little contact.",
        scenes,
    )));
    blocks
}

fn table_2(scenes: &[Scene]) -> Table {
    let mut table = Table::new(
        "Table 2. The largest number of colliding tetrahedra in any step is given beside the average: the paper's bodies stay pressed \
         together, ours fall, meet and partly separate.",
        2,
        &[
            "scene",
            "source",
            "#Tetra",
            "#Cells",
            "#Sub",
            "#CT",
            "#CT, most",
            "ms, average",
            "ms, median",
            "ms, most",
            "`Clusters` ms, average",
            "median",
            "most",
        ],
    );
    let none = || NONE.to_owned();
    for scene in scenes {
        if let Some(papers) = published::volume(&scene.name) {
            let mut cells = vec![
                scene.name.clone(),
                format!("the paper, {}", published::GPU),
                format!("{} x2", count(papers.n_tetrahedra as f64)),
                count(papers.n_cells as f64),
                count(papers.n_subdivided as f64),
                count(papers.n_colliding as f64),
                none(),
                ms(papers.ms),
            ];
            cells.resize_with(table.header.len(), none);
            table.papers(cells);
        }
        for is_gpu in places(std::slice::from_ref(scene)) {
            let Some(cells) = scene.run(Method::Cells, is_gpu) else {
                continue;
            };
            let clusters = scene.run(Method::Clusters, is_gpu);
            let mut row = vec![
                scene.name.clone(),
                match cells.is_software {
                    true => "here, GPU (software)".to_owned(),
                    false => format!("here, {}", short_place(is_gpu)),
                },
                twice(&scene.n_elements),
                count(cells.n_cells.mean),
                count(cells.n_subdivided.mean),
                count(scene.n_colliding.mean),
                count(scene.n_colliding.max),
            ];
            for run in [Some(cells), clusters] {
                row.extend(match run {
                    Some(run) => [run.ms.mean, run.ms.median, run.ms.max].map(ms),
                    None => [none(), none(), none()],
                });
            }
            table.ours(row);
        }
    }
    table
}
