//! The table of `impinge check`, and its failures.

use std::io::Write;

use impinge_check::{Counts, ErrorKind, Row};

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
            if failure.message.starts_with(&row.path) {
                writeln!(to, "{}", failure.message)?;
            } else {
                writeln!(to, "{}: {}", row.path, failure.message)?;
            }
        }
    }
    if listed.len() > LISTED {
        let n = (listed.len() - LISTED) as u64;
        writeln!(to, "… and {} more: see --json or --out DIR", meshes(n))?;
    }
    let n_clean = rows.iter().filter(|row| !FailOn::Any.is_in(row)).count();
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
    let mut line = vec![row.path.clone()];
    line.extend(numbers.map(grouped));
    line
}

/// Fails if any mesh has one of the named problems.
pub fn fail_on(rows: &[Row], named: &[FailOn]) -> Result<(), Error> {
    let n_failed = rows
        .iter()
        .filter(|row| named.iter().any(|what| what.is_in(row)))
        .count();
    if n_failed == 0 {
        return Ok(());
    }
    let each = FailOn::EACH
        .into_iter()
        .filter(|what| named.contains(what) || named.contains(&FailOn::Any));
    let found = each.filter_map(|what| {
        let n = rows.iter().filter(|row| what.is_in(row)).count() as u64;
        (n > 0).then(|| format!("{} with {}", grouped(n), what.words()))
    });
    Err(Error::CheckFailed(format!(
        "{} of {} meshes failed: {}",
        grouped(n_failed as u64),
        grouped(rows.len() as u64),
        found.collect::<Vec<_>>().join(", ")
    )))
}
