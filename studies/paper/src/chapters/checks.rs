//! Whether all contestants found the same pairs.

use super::{heading, lambda, method, paragraph, place};
use crate::document::{Block, NONE, Table, count};
use crate::report::{Report, Scene};

pub(super) fn blocks(report: &Report) -> Vec<Block> {
    let mut table = Table::new(
        "Pairs of all frames together. The hash is the sum of the frames' hashes; it is the same for all contestants that ran all frames.",
        1,
        &[
            "scene",
            "frames",
            "pairs",
            "hash",
            "contestants",
            "frames by the oracle",
            "frames that differ",
        ],
    );
    let scenes: Vec<&Scene> = report.surfaces.iter().chain(&report.volumes).collect();
    let mut differing = Vec::new();
    for scene in scenes {
        let n: usize = scene.runs.iter().map(|run| run.n_frames_differing).sum();
        table.ours(vec![
            scene.name.clone(),
            scene.n_frames.to_string(),
            count(scene.n_pairs.mean * scene.n_frames as f64),
            format!("`{}`", scene.hash),
            scene.runs.len().to_string(),
            match scene.n_frames_of_oracle {
                0 => NONE.to_owned(),
                n => n.to_string(),
            },
            n.to_string(),
        ]);
        for run in scene.runs.iter().filter(|run| run.n_frames_differing > 0) {
            differing.push(format!(
                "**{}, {}, {}, λ {}: {} frames differ**",
                scene.name,
                method(run.method),
                place(run),
                lambda(run),
                run.n_frames_differing
            ));
        }
    }
    for row in &report.duplicates {
        if !row.is_subset {
            differing.push(format!(
                "**{}: the table gave a pair that does not intersect**",
                row.scene
            ));
        }
        if !row.is_equal_without {
            differing.push(format!(
                "**{}: tests without a table gave other pairs**",
                row.scene
            ));
        }
    }
    let mut blocks = vec![
        heading("Agreement"),
        paragraph(
            "The set of pairs depends on positions alone: not on the method, λ, backend or threads, nor on how often pairs are tested. \
             In every frame whole sets were compared, not only their sizes. The oracle compares every box with every \
             box; it checks the frame with the most pairs of the smaller scenes.",
        ),
        Block::Table(table),
    ];
    if !differing.is_empty() {
        blocks.push(Block::List(differing));
    }
    blocks
}
