//! A report as headings, paragraphs, tables and figures: the input of both writers.
//!
//! Text may contain `` `code` `` and `**strong**` words, but no other markup.

/// One piece of a document.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Block {
    /// A heading: 1 is the title.
    Heading(u8, String),
    /// A paragraph.
    Paragraph(String),
    /// Points, one per line.
    List(Vec<String>),
    /// A table.
    Table(Table),
    /// A figure.
    Figure(Figure),
}

/// A table with a caption above it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Table {
    pub caption: String,
    /// Names of the columns.
    pub header: Vec<String>,
    /// How many columns hold text, counted from the left; the others hold numbers.
    pub n_text: usize,
    pub rows: Vec<Row>,
}

/// A row of a table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Row {
    pub cells: Vec<String>,
    /// Whether it holds the paper's own numbers.
    pub is_papers: bool,
}

/// Pictures under one caption.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Figure {
    pub caption: String,
    pub images: Vec<Image>,
}

/// A picture, drawn or plotted.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Image {
    /// The file's name without its extension.
    pub name: String,
    /// Whether it is an SVG, else a PNG.
    pub is_plot: bool,
    /// The label below the picture, if a figure has several.
    pub label: String,
}

impl Table {
    pub fn new(caption: impl Into<String>, n_text: usize, header: &[&str]) -> Self {
        Table {
            caption: caption.into(),
            header: header.iter().map(|name| (*name).to_owned()).collect(),
            n_text,
            rows: Vec::new(),
        }
    }

    pub fn ours(&mut self, cells: Vec<String>) {
        self.rows.push(Row {
            cells,
            is_papers: false,
        });
    }

    pub fn papers(&mut self, cells: Vec<String>) {
        self.rows.push(Row {
            cells,
            is_papers: true,
        });
    }
}

impl Figure {
    /// One plot.
    pub fn plot(name: &str, caption: impl Into<String>) -> Self {
        Figure {
            caption: caption.into(),
            images: vec![Image {
                name: name.to_owned(),
                is_plot: true,
                label: String::new(),
            }],
        }
    }
}

/// The text for a missing number.
pub(crate) const NONE: &str = "–";

/// 1234567.0 as 1,234,567.
pub(crate) fn count(n: f64) -> String {
    let digits = format!("{n:.0}");
    let mut text = String::new();
    for (ix, digit) in digits.chars().enumerate() {
        if ix > 0 && (digits.len() - ix).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A time in milliseconds with three significant figures.
pub(crate) fn ms(ms: f64) -> String {
    match ms {
        ms if ms >= 99.95 => format!("{ms:.0}"),
        ms if ms >= 9.995 => format!("{ms:.1}"),
        ms if ms >= 0.9995 => format!("{ms:.2}"),
        ms => format!("{ms:.3}"),
    }
}

/// A share in per cent, with more digits if it is small.
pub(crate) fn percent(share: f64) -> String {
    match 100.0 * share {
        0.0 => "0".to_owned(),
        p if p < 0.01 => "< 0.01 %".to_owned(),
        p if p < 1.0 => format!("{p:.2} %"),
        p => format!("{p:.1} %"),
    }
}

/// λ: powers of two below 1 as fractions.
pub(crate) fn density(lambda: f64) -> String {
    let inverse = 1.0 / lambda;
    match inverse > 1.0 && inverse.fract() == 0.0 {
        true => format!("1/{inverse}"),
        false => lambda.to_string(),
    }
}

/// A ratio.
pub(crate) fn ratio(ratio: f64) -> String {
    match ratio {
        ratio if ratio >= 99.5 => format!("{ratio:.0}"),
        ratio if ratio >= 9.95 => format!("{ratio:.1}"),
        ratio => format!("{ratio:.2}"),
    }
}

/// "0.6" if both ends are equal, else "0.6 to 2.1".
pub(crate) fn range(values: &[f64]) -> String {
    let (low, high) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| {
            (low.min(x), high.max(x))
        });
    if low > high {
        return NONE.to_owned();
    }
    let [low, high] = [low, high].map(|x| format!("{x:.1}"));
    if low == high {
        low
    } else {
        format!("{low} to {high}")
    }
}

/// An element count as "15,000 x2".
pub(crate) fn twice(n_elements: &[usize]) -> String {
    match n_elements {
        // Meshes have far fewer than 2^53 elements.
        [a, b] if a == b => format!("{} x2", count(*a as f64)),
        all => all
            .iter()
            .map(|n| count(*n as f64))
            .collect::<Vec<_>>()
            .join(" + "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_readable() {
        assert_eq!([0.0, 999.4, 1e6].map(count), ["0", "999", "1,000,000"]);
        assert_eq!(
            [0.0451, 1.004, 12.34, 123.4].map(ms),
            ["0.045", "1.00", "12.3", "123"]
        );
        assert_eq!(
            [0.0, 1e-6, 0.0037, 0.62].map(percent),
            ["0", "< 0.01 %", "0.37 %", "62.0 %"]
        );
        assert_eq!(
            [0.015625, 0.3, 1.0, 5.0].map(density),
            ["1/64", "0.3", "1", "5"]
        );
        assert_eq!(range(&[2.04, 1.0, 3.0]), "1.0 to 3.0");
        assert_eq!(range(&[2.0]), "2.0");
        assert_eq!(range(&[]), NONE);
        assert_eq!(twice(&[15_000, 15_000]), "15,000 x2");
        assert_eq!(twice(&[10, 20]), "10 + 20");
    }
}
