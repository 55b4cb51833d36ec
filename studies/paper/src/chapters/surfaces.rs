//! Table 1 and figure 4.

use super::{contestants, heading, paragraph, places, short_place};
use crate::document::{Block, Figure, Image, NONE, Table, count, ms, percent, twice};
use crate::published;
use crate::report::{Method, Report, Scene};

pub(super) fn blocks(report: &Report) -> Vec<Block> {
    let scenes = &report.surfaces;
    let mut blocks = vec![
        heading("Table 1: surfaces"),
        paragraph(
            "Two copies of a mesh wave and drift into each other. The columns are those of the paper: cells, cells of the second \
             level and times are those of `Cells` with λ = 1. Candidates are pairs whose boxes overlap; unsure is \
             the share of them that the floating-point filter left to exact arithmetic.",
        ),
        Block::Table(table_1(scenes)),
    ];
    blocks.push(Block::List(
        scenes
            .iter()
            .map(|scene| {
                format!(
                    "**{}**: {}; {}; {} frames.",
                    scene.name, scene.mesh, scene.motion, scene.n_frames
                )
            })
            .collect(),
    ));
    blocks.extend(pictures(
        scenes,
        "Figure 4: the frame with the most pairs of each scene. Colliding triangles are red in the first body and blue in the \
         second one; those behind other faces show through.",
    ));
    blocks.push(Block::Table(contestants(
        "Table 1, all contestants. Counts are averages per frame; the column before them gives the speed of a contestant relative to \
         [FWZS11] with λ = 5.",
        scenes,
    )));
    blocks
}

/// Pictures of all scenes that have one.
pub(super) fn pictures(scenes: &[Scene], caption: &str) -> Option<Block> {
    let images: Vec<Image> = scenes
        .iter()
        .filter_map(|scene| {
            Some(Image {
                name: scene.picture.as_ref()?.trim_end_matches(".png").to_owned(),
                is_plot: false,
                label: scene.name.clone(),
            })
        })
        .collect();
    (!images.is_empty()).then(|| {
        Block::Figure(Figure {
            caption: caption.to_owned(),
            images,
        })
    })
}

fn table_1(scenes: &[Scene]) -> Table {
    let mut table = Table::new(
        "Table 1.",
        2,
        &[
            "scene",
            "source",
            "#Tri",
            "#Cells",
            "#Sub",
            "#CT",
            "ms, average",
            "ms, median",
            "`Clusters` ms, average",
            "median",
            "candidates",
            "unsure",
        ],
    );
    let none = || NONE.to_owned();
    for scene in scenes {
        if let Some(papers) = published::surface(&scene.name) {
            table.papers(vec![
                scene.name.clone(),
                format!("the paper, {}", published::GPU),
                format!("{}k x2", papers.n_triangles / 1000),
                count(papers.n_cells as f64),
                count(papers.n_subdivided as f64),
                count(papers.n_colliding as f64),
                ms(papers.ms),
                none(),
                none(),
                none(),
                none(),
                none(),
            ]);
        }
        for is_gpu in places(std::slice::from_ref(scene)) {
            let Some(cells) = scene.run(Method::Cells, is_gpu) else {
                continue;
            };
            let clusters = scene.run(Method::Clusters, is_gpu);
            let of_clusters = |value: fn(&crate::report::Run) -> f64| {
                clusters.map_or_else(none, |run| ms(value(run)))
            };
            table.ours(vec![
                scene.name.clone(),
                match cells.is_software {
                    true => "here, GPU (software)".to_owned(),
                    false => format!("here, {}", short_place(is_gpu)),
                },
                twice(&scene.n_elements),
                count(cells.n_cells.mean),
                count(cells.n_subdivided.mean),
                count(scene.n_colliding.mean),
                ms(cells.ms.mean),
                ms(cells.ms.median),
                of_clusters(|run| run.ms.mean),
                of_clusters(|run| run.ms.median),
                count(cells.n_candidates.mean),
                percent(super::share(cells.n_unsure.mean, cells.n_candidates.mean)),
            ]);
        }
    }
    table
}
