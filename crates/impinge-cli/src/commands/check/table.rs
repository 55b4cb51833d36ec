//! The table of `impinge check`, and its failures.

use std::io::Write;

use impinge_check::{Counts, ErrorKind, Row};
use impinge_io::printable;

use super::args::FailOn;
use crate::error::Error;
use crate::output::{out, table};
use crate::text::grouped;

/// The most meshes that a table lists.
const LISTED: usize = 50;

impl FailOn {
    /// All problems except `any`, in the order of the summary.
    const EACH: [FailOn; 8] = [
        FailOn::SelfIntersections,
        FailOn::Degenerate,
        FailOn::Duplicates,
        FailOn::NonManifold,
        FailOn::Orientation,
        FailOn::Boundary,
        FailOn::Nan,
        FailOn::Error,
    ];

    /// The words for it in a sentence: "3 with …".
    fn words(self) -> &'static str {
        match self {
            FailOn::SelfIntersections => "self-intersections",
            FailOn::Degenerate => "degenerate primitives",
            FailOn::Duplicates => "duplicate primitives",
            FailOn::NonManifold => "non-manifold edges or vertices",
            FailOn::Boundary => "an open border",
            FailOn::Orientation => "inconsistent orientation",
            FailOn::Nan => "coordinates that are not finite",
            FailOn::Error => "an error",
            FailOn::Any => "any of these",
        }
    }

    /// Whether a mesh has the problem.
    fn is_in(self, row: &Row) -> bool {
        let counted =
            |get: fn(&Counts) -> u64| row.result.as_ref().is_ok_and(|counts| get(counts) > 0);
        match self {
            FailOn::SelfIntersections => counted(|c| c.self_intersections),
            FailOn::Degenerate => counted(|c| c.degenerate),
            FailOn::Duplicates => counted(|c| c.duplicates),
            FailOn::NonManifold => counted(|c| c.non_manifold_facets + c.non_manifold_vertices),
            // Meshes of tetrahedra always have a border.
            FailOn::Boundary => counted(|c| {
                if c.n_tetrahedra > 0 {
                    0
                } else {
                    c.boundary_facets
                }
            }),
            FailOn::Orientation => counted(|c| c.inconsistent_facets),
            FailOn::Nan => {
                matches!(&row.result, Err(failure) if failure.kind == ErrorKind::NotFinite)
            }
            FailOn::Error => row.result.is_err(),
            FailOn::Any => FailOn::EACH.iter().any(|each| each.is_in(row)),
        }
    }
}

/// Prints one row per mesh (if there are many, only meshes with a problem), then a summary.
pub fn print(rows: &[Row]) -> Result<(), Error> {
    let mut to = out();
    let few = rows.len() <= LISTED;
    let listed: Vec<&Row> = rows
        .iter()
        .filter(|row| few || FailOn::Any.is_in(row))
        .collect();
    let lines = listed
        .iter()
        .take(LISTED)
        .filter_map(|row| Some(line(row, row.result.as_ref().ok()?)));
    let lines: Vec<_> = lines.collect();
    if !lines.is_empty() {
        let header = [
            "mesh",
            "primitives",
            "self-int.",
            "degenerate",
            "duplicate",
            "non-man.",
            "orient.",
            "border",
            "pieces",
        ];
        writeln!(to, "{}\n", table(&header, &[0], lines))?;
    }
    for row in listed.iter().take(LISTED) {
        if let Err(failure) = &row.result {
            // Most messages about files already name the file.
            let name = printable(&row.path);
            if failure.message.starts_with(&name) {
                writeln!(to, "{}", failure.message)?;
            } else {
                writeln!(to, "{name}: {}", failure.message)?;
            }
        }
    }
    if listed.len() > LISTED {
        let n = (listed.len() - LISTED) as u64;
        writeln!(to, "… and {} more: see --json or --out DIR", meshes(n))?;
    }
    let n_clean = rows.iter().filter(|row| !FailOn::Any.is_in(row)).count();
    if n_clean == rows.len() && n_clean > 0 {
        let all = if n_clean == 1 { "clean" } else { "all clean" };
        writeln!(to, "{}: {all}", meshes(n_clean as u64))?;
        return Ok(());
    }
    let mut parts = vec![format!("{} without any finding", grouped(n_clean as u64))];
    for what in FailOn::EACH {
        let n = rows.iter().filter(|row| what.is_in(row)).count();
        if n > 0 {
            parts.push(format!("{} with {}", grouped(n as u64), what.words()));
        }
    }
    writeln!(to, "{}: {}", meshes(rows.len() as u64), parts.join(", "))?;
    Ok(())
}

fn meshes(n: u64) -> String {
    format!("{} mesh{}", grouped(n), if n == 1 { "" } else { "es" })
}

fn line(row: &Row, counts: &Counts) -> Vec<String> {
    let numbers = [
        counts.n_triangles + counts.n_tetrahedra,
        counts.self_intersections,
        counts.degenerate,
        counts.duplicates,
        counts.non_manifold_facets + counts.non_manifold_vertices,
        counts.inconsistent_facets,
        counts.boundary_facets,
        counts.components,
    ];
    let mut line = vec![printable(&row.path)];
    line.extend(numbers.map(grouped));
    line
}

/// Fails if any mesh has one of the named problems, or could not be checked.
pub fn fail(rows: &[Row], named: &[FailOn]) -> Result<(), Error> {
    let n_with = |what: &dyn Fn(&Row) -> bool| {
        let n = rows.iter().filter(|row| what(row)).count();
        grouped(n as u64)
    };
    let is_unchecked = |row: &Row| row.result.is_err();
    let is_named = |row: &Row| named.iter().any(|what| what.is_in(row));
    let unchecked = format!("{} could not be checked", n_with(&is_unchecked));
    let n = grouped(rows.len() as u64);
    if !rows.iter().any(is_named) {
        return match rows.iter().any(is_unchecked) {
            false => Ok(()),
            true => Err(Error::Unread(format!(
                "{} of {n} meshes could not be checked",
                n_with(&is_unchecked)
            ))),
        };
    }
    let asked = |what: FailOn| named.contains(&what) || named.contains(&FailOn::Any);
    let mut found: Vec<String> = FailOn::EACH
        .into_iter()
        .filter(|&what| asked(what) && rows.iter().any(|row| what.is_in(row)))
        .map(|what| format!("{} with {}", n_with(&|row| what.is_in(row)), what.words()))
        .collect();
    if rows.iter().any(is_unchecked) && !asked(FailOn::Error) {
        found.push(unchecked);
    }
    let n_failed = n_with(&|row| is_named(row) || is_unchecked(row));
    let found = found.join(", ");
    Err(Error::CheckFailed(format!(
        "{n_failed} of {n} meshes failed: {found}"
    )))
}
