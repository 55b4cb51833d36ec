//! A document as Markdown, with tables in GitHub's syntax.

use std::fmt::Write as _;

use crate::document::{Block, Figure, Table};

/// The document as one text.
pub(crate) fn write(blocks: &[Block]) -> String {
    let mut text = String::new();
    for block in blocks {
        match block {
            Block::Heading(level, title) => {
                let _ = writeln!(text, "{} {title}\n", "#".repeat(usize::from(*level)));
            }
            Block::Paragraph(words) => {
                let _ = writeln!(text, "{words}\n");
            }
            Block::List(points) => {
                for point in points {
                    let _ = writeln!(text, "- {point}");
                }
                text.push('\n');
            }
            Block::Table(table) => self::table(&mut text, table),
            Block::Figure(figure) => self::figure(&mut text, figure),
        }
    }
    text
}

fn table(text: &mut String, table: &Table) {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let _ = writeln!(text, "{}\n", table.caption);
    *text += &line(&table.header);
    let rule = |ix| if ix < table.n_text { "---" } else { "---:" };
    let rules: Vec<&str> = (0..table.header.len()).map(rule).collect();
    let _ = writeln!(text, "|{}|", rules.join("|"));
    for row in &table.rows {
        let cells = row.cells.iter().map(|cell| cell.replace('|', "\\|"));
        let cells: Vec<String> = match row.is_papers {
            true => cells.map(|cell| format!("*{cell}*")).collect(),
            false => cells.collect(),
        };
        *text += &line(&cells);
    }
    text.push('\n');
}

fn figure(text: &mut String, figure: &Figure) {
    for image in &figure.images {
        let label = match image.label.as_str() {
            "" => &image.name,
            label => label,
        };
        let ending = if image.is_plot { "svg" } else { "png" };
        let _ = writeln!(text, "![{label}]({}.{ending})", image.name);
    }
    let _ = writeln!(text, "\n{}\n", figure.caption);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_and_figures() {
        let mut one = Table::new("Table 0: numbers.", 1, &["who", "how many"]);
        one.papers(vec!["paper".into(), "1".into()]);
        one.ours(vec!["a|b".into(), "2".into()]);
        let text = write(&[
            Block::Heading(2, "Here".into()),
            Block::Table(one),
            Block::Figure(Figure::plot("plot", "Figure 0.")),
        ]);
        assert_eq!(
            text,
            "## Here\n\nTable 0: numbers.\n\n| who | how many |\n|---|---:|\n| *paper* | *1* |\n\
             | a\\|b | 2 |\n\n![plot](plot.svg)\n\nFigure 0.\n\n"
        );
    }
}
