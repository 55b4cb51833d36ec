//! Table 3 and figure 7.

use super::{heading, paragraph};
use crate::document::{Block, Figure, NONE, Table, count, ms, percent};
use crate::figures;
use crate::published;
use crate::report::{Duplicates, Report};

pub(super) fn blocks(report: &Report) -> Vec<Block> {
    let mut blocks = vec![
        heading("Table 3: pairs found more than once"),
        paragraph(
            "Two triangles that share several cells are found in each of them. The table compares three ways to handle this, on the CPU with \
             λ = 1. Without hash: every cell tests the pairs that it finds. With hash: a table hashed by DJB2, with as many slots as \
             there are triangles, keeps one pair per slot. Owner rule of `Cells`: \
             only the cell that holds the lower corner of the pair's common range tests it.",
        ),
        Block::Table(table_3(
            report,
            false,
            "Table 3, as in the paper: all pairs of a cell that touch a common sub-cell are tested.",
        )),
        Block::Table(table_3(
            report,
            true,
            "Table 3 with boxes compared before the table, as in `Cells`: fewer pairs, so fewer collisions in a slot.",
        )),
        Block::List(vec![
            "#CT: colliding triangles of both bodies, average over frames. #Missing rate: the share of them that the table loses. The share of \
             lost pairs is higher, because a triangle is missing only if all its pairs are."
                .to_owned(),
            "#MCT: share of the tested pairs that are tested more than once. #Checking times: average number of tests per tested pair. A pair \
             that shares several sub-cells of one cell counts once here; the paper does not say how it counts."
                .to_owned(),
            "All pairs that pass the table are pairs of the exact answer, and testing everything gives the exact answer. Both were \
             checked against the owner rule in every frame."
                .to_owned(),
        ]),
    ];
    if let Some(sizes) = &report.table_sizes {
        let mut table = Table::new(
            format!(
                "Figure 7 in numbers: {}, {} elements, {} frames.",
                sizes.scene,
                count(sizes.n_elements as f64),
                sizes.n_frames
            ),
            0,
            &[
                "slots",
                "slots / elements",
                "missing rate",
                "missing pairs",
                "missing rate after box tests",
                "owner rule",
            ],
        );
        for point in &sizes.points {
            table.ours(vec![
                count(point.table_size as f64),
                format!(
                    "{:.3}",
                    point.table_size as f64 / sizes.n_elements.max(1) as f64
                ),
                percent(point.missing_rate),
                percent(point.missing_rate_of_pairs),
                percent(point.missing_rate_with_box_test),
                "0".to_owned(),
            ]);
        }
        blocks.extend([
            heading("Figure 7: missing rate against the table's size"),
            Block::Figure(Figure::plot(
                figures::TABLE_SIZES,
                "Figure 7: the losses of a table hashed by DJB2, against its size. The paper's figure has no numbers; the \
                 point is from its table 3. The owner rule needs no table.",
            )),
            Block::Table(table),
        ]);
    }
    blocks
}

fn table_3(report: &Report, has_box_test: bool, caption: &str) -> Table {
    let mut table = Table::new(
        caption,
        2,
        &[
            "scene",
            "source",
            "ms without hash",
            "ms with hash",
            "ms, owner rule",
            "#CT without",
            "#CT with",
            "#CT, owner rule",
            "#Missing rate",
            "missing pairs",
            "#MCT",
            "#Checking times",
        ],
    );
    let none = || NONE.to_owned();
    for row in report
        .duplicates
        .iter()
        .filter(|row| row.has_box_test == has_box_test)
    {
        let Duplicates { scene, .. } = row;
        if let Some(papers) = published::duplicates(scene) {
            table.papers(vec![
                scene.clone(),
                format!("the paper, {}", published::GPU),
                ms(papers.ms_without),
                ms(papers.ms_with),
                none(),
                count(papers.n_colliding_without as f64),
                count(papers.n_colliding_with as f64),
                none(),
                format!("{:.3}", papers.missing_rate),
                none(),
                format!("{:.2}", papers.share_repeated),
                format!("{:.2}", papers.times_checked),
            ]);
        }
        table.ours(vec![
            scene.clone(),
            "here, CPU".to_owned(),
            ms(row.ms_without.mean),
            ms(row.ms_with.mean),
            ms(row.ms_owner.mean),
            count(row.n_colliding_without),
            count(row.n_colliding_with),
            count(row.n_colliding_owner),
            format!("{:.3}", row.missing_rate),
            format!("{:.3}", row.missing_rate_of_pairs),
            format!("{:.2}", row.share_repeated),
            format!("{:.2}", row.times_checked),
        ]);
    }
    table
}
