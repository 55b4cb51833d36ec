//! The last lines of `impinge check`: what helps, and why it fails.

use std::io::Write;
use std::path::Path;

use impinge_check::{Finding, Report, Row};
use impinge_io::printable;

use super::args::CheckArgs;
use crate::error::Error;
use crate::output::out;

/// Prints the command that helps most: one that mends, or, where nothing can be mended, one that
/// shows.
pub fn print_next(rows: &[Row], args: &CheckArgs) -> Result<(), Error> {
    const MENDED: [Finding; 5] = [
        Finding::Degenerate,
        Finding::Duplicates,
        Finding::NonManifold,
        Finding::Orientation,
        Finding::InsideOut,
    ];
    let is_mendable = |row: &&Row| {
        row.result.as_ref().is_ok_and(|counts| {
            counts.n_tetrahedra == 0 && MENDED.iter().any(|finding| finding.is_in(row))
        })
    };
    let crosses = |row: &&Row| Finding::SelfIntersections.is_in(row);
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

/// Fails if any mesh has a finding that makes the run fail, or could not be checked.
pub fn fail(report: &Report<'_>) -> Result<(), Error> {
    match report.failure() {
        None => Ok(()),
        Some(failed) if failed.is_finding => Err(Error::CheckFailed(failed.message)),
        Some(failed) => Err(Error::Unread(failed.message)),
    }
}
