//! A document as one HTML page; figures are files beside it.

use std::fmt::Write as _;

use crate::document::{Block, Figure, Table};

const STYLE: &str = "
  body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 1080px; margin: 2em auto; padding: 0 1em }
  h1, h2, h3 { line-height: 1.2; margin: 1.8em 0 .6em }
  table { border-collapse: collapse; font-size: 13px; margin: .4em 0 1.6em; display: block; overflow-x: auto }
  caption { text-align: left; padding: .4em 0; color: #555 }
  th, td { padding: .25em .6em; border-bottom: 1px solid #ddd; text-align: right; font-variant-numeric: tabular-nums }
  th { border-bottom: 2px solid #888; vertical-align: bottom }
  .text { text-align: left }
  tr.paper { background: #f4f1e8; font-style: italic }
  figure { margin: 1.2em 0 2em }
  figure.many { display: grid; grid-template-columns: repeat(auto-fit, minmax(300px, 1fr)); gap: 1em }
  figure img { max-width: 100%; height: auto }
  figure.one img { width: 760px }
  figcaption { color: #555; font-size: 14px; grid-column: 1 / -1 }
  code { background: #f2f2f2; padding: 0 .2em }
";

/// The document as one page.
pub(crate) fn write(blocks: &[Block]) -> String {
    let title = blocks.iter().find_map(|block| match block {
        Block::Heading(1, title) => Some(title.as_str()),
        _ => None,
    });
    let title = marked(title.unwrap_or_default());
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<title>{title}</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n"
    );
    for block in blocks {
        let _ = match block {
            Block::Heading(level, title) => {
                writeln!(page, "<h{level}>{}</h{level}>", marked(title))
            }
            Block::Paragraph(words) => writeln!(page, "<p>{}</p>", marked(words)),
            Block::List(points) => {
                let points: Vec<String> = points
                    .iter()
                    .map(|point| format!("<li>{}</li>", marked(point)))
                    .collect();
                writeln!(page, "<ul>\n{}\n</ul>", points.join("\n"))
            }
            Block::Table(table) => writeln!(page, "{}", self::table(table)),
            Block::Figure(figure) => writeln!(page, "{}", self::figure(figure)),
        };
    }
    page + "</body>\n</html>\n"
}

fn table(table: &Table) -> String {
    let cells = |tag: &str, cells: &[String]| -> String {
        let cell = |(ix, cell): (usize, &String)| {
            let class = if ix < table.n_text {
                " class=\"text\""
            } else {
                ""
            };
            format!("<{tag}{class}>{}</{tag}>", marked(cell))
        };
        cells.iter().enumerate().map(cell).collect()
    };
    let rows: Vec<String> = table
        .rows
        .iter()
        .map(|row| {
            let class = if row.is_papers {
                " class=\"paper\""
            } else {
                ""
            };
            format!("<tr{class}>{}</tr>", cells("td", &row.cells))
        })
        .collect();
    format!(
        "<table>\n<caption>{}</caption>\n<thead><tr>{}</tr></thead>\n<tbody>\n{}\n</tbody>\n</table>",
        marked(&table.caption),
        cells("th", &table.header),
        rows.join("\n")
    )
}

fn figure(figure: &Figure) -> String {
    let class = if figure.images.len() > 1 {
        "many"
    } else {
        "one"
    };
    let mut text = format!("<figure class=\"{class}\">\n");
    for image in &figure.images {
        let ending = if image.has_svg { "svg" } else { "png" };
        let label = match image.label.as_str() {
            "" => &image.name,
            label => label,
        };
        let (name, label) = (escaped(&image.name), escaped(label));
        let _ = match image.label.is_empty() {
            true => writeln!(text, "<img src=\"{name}.{ending}\" alt=\"{label}\">"),
            false => writeln!(
                text,
                "<div><img src=\"{name}.{ending}\" alt=\"{label}\"><br>{label}</div>"
            ),
        };
    }
    let _ = write!(
        text,
        "<figcaption>{}</figcaption>\n</figure>",
        marked(&figure.caption)
    );
    text
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// Escapes text and converts code and strong words to tags. A mark without its other half stays as
/// it is.
fn marked(text: &str) -> String {
    let mut text = escaped(text);
    for (mark, tag) in [("`", "code"), ("**", "strong")] {
        while let Some((before, rest)) = text.split_once(mark) {
            let Some((inside, after)) = rest.split_once(mark) else {
                break;
            };
            text = format!("{before}<{tag}>{inside}</{tag}>{after}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_become_tags_and_nothing_else_does() {
        assert_eq!(
            marked("a `b` **c** <d> &"),
            "a <code>b</code> <strong>c</strong> &lt;d&gt; &amp;"
        );
        assert_eq!(marked("2 ** 3 `x"), "2 ** 3 `x");
    }

    #[test]
    fn a_page_is_whole() {
        let mut one = Table::new("Table 0", 1, &["who", "n"]);
        one.papers(vec!["paper".into(), "1".into()]);
        let page = write(&[
            Block::Heading(1, "A & B".into()),
            Block::Table(one),
            Block::Figure(Figure::plot("plot", "Figure 0.")),
        ]);
        assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
        assert!(page.contains("<title>A &amp; B</title>"));
        assert!(page.contains("<tr class=\"paper\"><td class=\"text\">paper</td><td>1</td></tr>"));
        assert!(page.contains("<img src=\"plot.svg\" alt=\"plot\">"));
    }
}
