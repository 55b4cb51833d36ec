//! What is said about the rows of many meshes, for people and for other programs.

mod finding;
mod formats;
mod table;

use std::fmt::Write;

use impinge_io::printable;

pub use self::finding::Finding;
pub use self::formats::escaped;
use crate::row::{Counts, Row};
use crate::text::{grouped, several};

/// The most meshes that a table lists.
const LISTED: usize = 50;

/// The columns of a table after the mesh's name. Those that a finding counts name it.
pub const COLUMNS: [(&str, Option<Finding>); 8] = [
    ("elements", None),
    ("self-int.", Some(Finding::SelfIntersections)),
    ("degenerate", Some(Finding::Degenerate)),
    ("duplicate", Some(Finding::Duplicates)),
    ("non-man.", Some(Finding::NonManifold)),
    ("orient.", Some(Finding::Orientation)),
    ("border", Some(Finding::Boundary)),
    ("pieces", None),
];

/// A further column: its name, and the cell of a mesh.
type Column = (&'static str, fn(&Counts) -> String);

/// The numbers of a mesh under [`COLUMNS`].
pub fn numbers(counts: &Counts) -> [u64; 8] {
    [
        counts.n_triangles + counts.n_tetrahedra,
        counts.self_intersections,
        counts.degenerate,
        counts.duplicates,
        counts.non_manifold_facets + counts.non_manifold_vertices,
        counts.inconsistent_facets,
        counts.boundary_facets,
        counts.components,
    ]
}

/// The rows of a run, and which findings make it fail.
///
/// ```
/// use impinge_check::{Finding, Report, Row};
/// let object = serde_json::json!({ "path": "a.ply", "welded": true, "error": "a.ply: empty", "error_kind": "file" });
/// let rows = [Row::from_json(&object).unwrap()];
/// let report = Report { rows: &rows, fail_on: &[Finding::Nan] };
/// assert_eq!(report.summary(), "1 mesh: 0 without any finding, 1 with an error");
/// assert!(report.github().starts_with("::error file=a.ply,title=an error::a.ply: empty\n"));
/// assert!(!report.failure().unwrap().is_finding);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Report<'a> {
    /// One row per mesh.
    pub rows: &'a [Row],
    /// What makes the run fail. A mesh that could not be checked always does.
    pub fail_on: &'a [Finding],
}

/// Why a run fails.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failed {
    /// A sentence with numbers.
    pub message: String,
    /// Whether a mesh has what the run fails on, not only one that could not be checked.
    pub is_finding: bool,
}

fn has_any(row: &Row) -> bool {
    Finding::ALL.iter().any(|finding| finding.is_in(row))
}

fn meshes(n: usize) -> String {
    several(n as u64, "mesh", "meshes")
}

/// The name and the message of a mesh that could not be checked. Most messages about files already
/// name the file.
fn error_line(row: &Row) -> Option<String> {
    let failure = row.result.as_ref().err()?;
    let name = printable(&row.path);
    Some(match failure.message.starts_with(&name) {
        true => failure.message.clone(),
        false => format!("{name}: {}", failure.message),
    })
}

impl Report<'_> {
    /// A table with one line per mesh (if there are many, per mesh with a finding), then the
    /// [summary](Self::summary).
    pub fn text(&self) -> String {
        let few = self.rows.len() <= LISTED;
        let listed: Vec<&Row> = self.rows.iter().filter(|row| few || has_any(row)).collect();
        let more = self.more_columns();
        let lines = listed.iter().take(LISTED).filter_map(|row| {
            let counts = row.result.as_ref().ok()?;
            let name = [printable(&row.path)].into_iter();
            let cells = name.chain(numbers(counts).map(grouped));
            let more = more.iter().map(|&(_, of)| of(counts));
            Some(cells.chain(more).collect::<Vec<_>>())
        });
        let lines: Vec<_> = lines.collect();
        let mut text = String::new();
        if !lines.is_empty() {
            let names = ["mesh"].into_iter().chain(COLUMNS.map(|(name, _)| name));
            let names = names.chain(more.iter().map(|&(name, _)| name));
            text += &aligned(names.map(str::to_owned).collect(), lines);
            text.push('\n');
        }
        for line in listed.iter().take(LISTED).filter_map(|row| error_line(row)) {
            text += &line;
            text.push('\n');
        }
        if listed.len() > LISTED {
            let more = meshes(listed.len() - LISTED);
            let _ = writeln!(text, "… and {more} more: see --json");
        }
        for row in self.rows.iter().filter(|_| few) {
            let thinnest = row.result.as_ref().ok().and_then(|counts| counts.thinnest);
            if let Some(thinnest) = thinnest {
                let name = printable(&row.path);
                let _ = writeln!(text, "{name}: the thinnest wall is {thinnest}");
            }
        }
        text += &self.summary();
        text.push('\n');
        text
    }

    /// The columns that only some tables have: pieces that are inside out, if there are any, and
    /// thin walls, if they were asked for.
    fn more_columns(&self) -> Vec<Column> {
        fn cell(n: Option<u64>) -> String {
            n.map_or("-".to_owned(), grouped)
        }
        let mut columns: Vec<Column> = Vec::new();
        if self.rows.iter().any(|row| Finding::InsideOut.is_in(row)) {
            columns.push(("inside out", |counts| cell(counts.inside_out)));
        }
        let asks = |row: &Row| matches!(&row.result, Ok(counts) if counts.min_thickness.is_some());
        if self.rows.iter().any(asks) {
            columns.push(("thin", |counts| cell(counts.thin_faces)));
        }
        columns
    }

    /// How many meshes have what, in one line.
    pub fn summary(&self) -> String {
        let n_clean = self.rows.iter().filter(|row| !has_any(row)).count();
        if n_clean == self.rows.len() && n_clean > 0 {
            let all = if n_clean == 1 { "clean" } else { "all clean" };
            return format!("{}: {all}", meshes(n_clean));
        }
        let clean = format!("{} without any finding", grouped(n_clean as u64));
        let parts: Vec<String> = [clean]
            .into_iter()
            .chain(self.with(&Finding::ALL))
            .collect();
        format!("{}: {}", meshes(self.rows.len()), parts.join(", "))
    }

    /// "3 with self-intersections" for each finding that a mesh has.
    fn with(&self, findings: &[Finding]) -> Vec<String> {
        let all = Finding::ALL.into_iter().filter(|it| findings.contains(it));
        let counts = all.map(|finding| (finding, self.n(|row| finding.is_in(row))));
        let found: Vec<(Finding, u64)> = counts.filter(|&(_, n)| n > 0).collect();
        // What is not finite is an error too.
        let has_errors = found.iter().any(|&(finding, _)| finding == Finding::Error);
        let not_finite = found.iter().find(|&&(finding, _)| finding == Finding::Nan);
        let not_finite = not_finite.filter(|_| has_errors).map(|&(_, n)| grouped(n));
        let said = |&(finding, n): &(Finding, u64)| {
            let said = format!("{} with {}", grouped(n), finding.words());
            match (finding, &not_finite) {
                (Finding::Nan, Some(_)) => None,
                (Finding::Error, Some(n)) => Some(format!("{said} ({n} not finite)")),
                _ => Some(said),
            }
        };
        found.iter().filter_map(said).collect()
    }

    fn n(&self, is_it: impl Fn(&Row) -> bool) -> u64 {
        self.rows.iter().filter(|row| is_it(row)).count() as u64
    }

    /// Whether a mesh makes the run fail.
    fn fails(&self, row: &Row) -> bool {
        row.result.is_err() || self.fail_on.iter().any(|finding| finding.is_in(row))
    }

    /// Why the run fails, if it does.
    pub fn failure(&self) -> Option<Failed> {
        let n = grouped(self.rows.len() as u64);
        let n_unchecked = self.n(|row| row.result.is_err());
        let unchecked = grouped(n_unchecked);
        let mut found = self.with(self.fail_on);
        if found.is_empty() {
            return (n_unchecked > 0).then(|| Failed {
                message: format!("{unchecked} of {n} meshes could not be checked"),
                is_finding: false,
            });
        }
        if n_unchecked > 0 && !self.fail_on.contains(&Finding::Error) {
            found.push(format!("{unchecked} could not be checked"));
        }
        let n_failed = grouped(self.n(|row| self.fails(row)));
        Some(Failed {
            message: format!("{n_failed} of {n} meshes failed: {}", found.join(", ")),
            is_finding: true,
        })
    }

    /// A table in Markdown, for the summary of a workflow: meshes with a finding, those that fail
    /// first.
    pub fn markdown(&self) -> String {
        let said = self.failure().map(|failed| failed.message);
        let said = said.unwrap_or_else(|| self.summary());
        let mut text = format!("### impinge check\n\n{said}\n\n");
        let mut bad: Vec<&Row> = self.rows.iter().filter(|row| has_any(row)).collect();
        bad.sort_by_key(|row| !self.fails(row));
        let cell = |text: &str| {
            let text = text.replace('\\', "\\\\").replace('|', "\\|");
            text.replace('<', "&lt;").replace('`', "\\`")
        };
        let more = self.more_columns();
        let counted: Vec<(&Row, &Counts)> = bad
            .iter()
            .filter_map(|row| Some((*row, row.result.as_ref().ok()?)))
            .take(LISTED)
            .collect();
        if !counted.is_empty() {
            let names = COLUMNS.map(|(name, _)| name).into_iter();
            let names: Vec<&str> = names.chain(more.iter().map(|&(name, _)| name)).collect();
            let _ = writeln!(
                text,
                "| mesh | {} |\n|---|{}",
                names.join(" | "),
                "---:|".repeat(names.len())
            );
            for (row, counts) in counted {
                let numbers = numbers(counts).map(grouped).into_iter();
                let numbers = numbers.chain(more.iter().map(|&(_, of)| of(counts)));
                let numbers = numbers.collect::<Vec<_>>().join(" | ");
                let _ = writeln!(text, "| {} | {numbers} |", cell(&printable(&row.path)));
            }
            text.push('\n');
        }
        for line in bad.iter().take(LISTED).filter_map(|row| error_line(row)) {
            let _ = writeln!(text, "- {}", cell(&line));
        }
        if bad.len() > LISTED {
            let n = meshes(bad.len());
            let _ = writeln!(text, "\nOnly {LISTED} of {n} with a finding are listed.");
        }
        text + "\n"
    }
}

/// Lines of cells as a table: the first column is aligned left, all others right.
fn aligned(header: Vec<String>, mut lines: Vec<Vec<String>>) -> String {
    lines.insert(0, header);
    let width = |text: &str| text.chars().count();
    let widths: Vec<usize> = (0..lines[0].len())
        .map(|ix| lines.iter().map(|line| width(&line[ix])).max().unwrap_or(0))
        .collect();
    let mut text = String::new();
    for line in lines {
        let cells = line.iter().zip(&widths).enumerate();
        let cells = cells.map(|(ix, (cell, &width))| match ix {
            0 => format!("{cell:<width$}"),
            _ => format!("{cell:>width$}"),
        });
        text += cells.collect::<Vec<_>>().join("  ").trim_end();
        text.push('\n');
    }
    text
}
