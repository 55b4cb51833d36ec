//! The table of `impinge check`, and its failures.

use std::io::Write;
use std::path::Path;

use impinge_check::{Counts, ErrorKind, Row};
use impinge_io::printable;

use super::args::{CheckArgs, FailOn};
use crate::error::Error;
use crate::output::{out, table};
use crate::text::grouped;

/// The most meshes that a table lists.
const LISTED: usize = 50;

impl FailOn {
    /// All problems except `any`, in the order of the summary.
    pub const EACH: [FailOn; 9] = [
        FailOn::SelfIntersections,
        FailOn::Degenerate,
        FailOn::Duplicates,
        FailOn::NonManifold,
        FailOn::Orientation,
        FailOn::Boundary,
        FailOn::Thin,
        FailOn::Nan,
        FailOn::Error,
    ];

    /// The words for it in a sentence: "3 with …".
    pub fn words(self) -> &'static str {
        match self {
            FailOn::SelfIntersections => "self-intersections",
            FailOn::Degenerate => "degenerate primitives",
            FailOn::Duplicates => "duplicate primitives",
            FailOn::NonManifold => "non-manifold edges or vertices",
            FailOn::Boundary => "an open border",
            FailOn::Orientation => "inconsistent orientation",
            FailOn::Thin => "thin walls",
            FailOn::Interpenetrating => "parts that share space",
            FailOn::Touching => "parts that touch",
            FailOn::Near => "parts that are near",
            FailOn::Nan => "coordinates that are not finite",
            FailOn::Error => "an error",
            FailOn::Any => "any of these",
        }
    }

    /// Whether a mesh has the problem.
    pub fn is_in(self, row: &Row) -> bool {
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
            FailOn::Thin => counted(|c| c.thin_faces.unwrap_or(0)),
            // Of assemblies, which have no rows.
            FailOn::Interpenetrating | FailOn::Touching | FailOn::Near => false,
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
    let asks = |row: &Row| matches!(&row.result, Ok(counts) if counts.min_thickness.is_some());
    let asks_walls = rows.iter().any(asks);
    let lines = listed.iter().take(LISTED).filter_map(|row| {
        let counts = row.result.as_ref().ok()?;
        let name = [printable(&row.path)].into_iter();
        let numbers = name.chain(line(counts).map(grouped));
        let thin = asks_walls.then(|| match counts.thin_faces {
            Some(n) => grouped(n),
            None => "-".to_owned(),
        });
        Some(numbers.chain(thin).collect())
    });
    let lines: Vec<_> = lines.collect();
    if !lines.is_empty() {
        let mut header = vec![
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
        header.extend(asks_walls.then_some("thin"));
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
    for (name, counts) in rows
        .iter()
        .filter_map(|row| Some((&row.path, row.result.as_ref().ok()?)))
    {
        if let Some(thinnest) = counts.thinnest.filter(|_| few) {
            writeln!(to, "{}: the thinnest wall is {thinnest}", printable(name))?;
        }
    }
    writeln!(to, "{}", summary(rows))?;
    Ok(())
}

/// How many meshes have what, in one line.
pub fn summary(rows: &[Row]) -> String {
    let n_clean = rows.iter().filter(|row| !FailOn::Any.is_in(row)).count();
    if n_clean == rows.len() && n_clean > 0 {
        let all = if n_clean == 1 { "clean" } else { "all clean" };
        return format!("{}: {all}", meshes(n_clean as u64));
    }
    let mut parts = vec![format!("{} without any finding", grouped(n_clean as u64))];
    for what in FailOn::EACH {
        let n = rows.iter().filter(|row| what.is_in(row)).count();
        if n > 0 {
            parts.push(format!("{} with {}", grouped(n as u64), what.words()));
        }
    }
    format!("{}: {}", meshes(rows.len() as u64), parts.join(", "))
}

fn meshes(n: u64) -> String {
    format!("{} mesh{}", grouped(n), if n == 1 { "" } else { "es" })
}

/// The numbers of a mesh, in the order of the columns.
pub fn line(counts: &Counts) -> [u64; 8] {
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

/// Prints the command that helps most: one that mends, or, where nothing can be mended, one that
/// shows.
pub fn print_next(rows: &[Row], args: &CheckArgs) -> Result<(), Error> {
    let is_mendable = |row: &&Row| {
        row.result.as_ref().is_ok_and(|counts| {
            let found = counts.degenerate
                + counts.duplicates
                + counts.non_manifold_facets
                + counts.non_manifold_vertices
                + counts.inconsistent_facets;
            let is_inside_out =
                counts.volume.is_some_and(|volume| volume < 0.0) && counts.components == 1;
            counts.n_tetrahedra == 0 && (found > 0 || is_inside_out)
        })
    };
    let crosses = |row: &&Row| FailOn::SelfIntersections.is_in(row);
    // What fix has split stays as it is.
    let mendable = rows.iter().find(is_mendable).filter(|_| !args.keep_seams);
    let command = match (mendable, rows.iter().find(crosses)) {
        (Some(row), _) => {
            let stem = Path::new(&row.path).file_stem().unwrap_or_default();
            let out = format!("{}-mended.ply", stem.to_string_lossy());
            format!("impinge fix {} --out {}", quoted(&row.path), quoted(&out))
        }
        (None, Some(row)) if args.png.is_none() => {
            format!("impinge render {} --png where.png", quoted(&row.path))
        }
        _ => return Ok(()),
    };
    writeln!(out(), "next: {command}")?;
    Ok(())
}

/// A word of a command line, in quotes if a shell would take it apart.
fn quoted(word: &str) -> String {
    let word = printable(word);
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c);
    match word.chars().all(is_plain) {
        true => word,
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
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
