//! The last lines of `impinge check`: what helps, and why it fails.

use std::io::Write;
use std::path::Path;

use impinge_check::{Finding, Report, Row};
use impinge_io::printable;

use super::args::CheckArgs;
use crate::error::Error;
use crate::output::out;

/// Whether a mesh has what `fix` mends.
pub fn is_mendable(row: &Row) -> bool {
    const MENDED: [Finding; 5] = [
        Finding::Degenerate,
        Finding::Duplicates,
        Finding::NonManifold,
        Finding::Orientation,
        Finding::InsideOut,
    ];
    let is_surface = matches!(&row.result, Ok(counts) if counts.n_tetrahedra == 0);
    is_surface && MENDED.iter().any(|finding| finding.is_in(row))
}

/// The first mesh that `fix` would mend. What it has split stays as it is.
pub fn mendable<'a>(rows: &'a [Row], args: &CheckArgs) -> Option<&'a Row> {
    let mut rows = rows.iter();
    rows.find(|row| is_mendable(row))
        .filter(|_| !args.keep_seams)
}

/// Whether vertices at one position may keep apart what is not manifold where they are welded.
pub fn may_have_seams(row: &Row) -> bool {
    let is_shared = row.result.as_ref().is_ok_and(|counts| {
        counts.n_welded > 0 && counts.n_vertices <= counts.n_triangles.saturating_mul(3) / 2
    });
    is_shared && Finding::NonManifold.is_in(row)
}

/// Prints the command that helps most: one that mends, or, where nothing can be mended, one that
/// shows. `keeps`: whether the first mesh that `fix` would mend needs no mending with seams kept.
pub fn print_next(rows: &[Row], keeps: bool, args: &CheckArgs) -> Result<(), Error> {
    let crosses = |row: &&Row| Finding::SelfIntersections.is_in(row);
    let command = match (mendable(rows, args), rows.iter().find(crosses)) {
        (Some(row), _) if keeps => {
            format!("impinge check {} --keep-seams", quoted(&row.path))
        }
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

/// The name of a file as a word of a command line, in quotes if a shell would take it apart.
pub fn quoted(name: &str) -> String {
    // Else it is an option.
    let name = match name.starts_with('-') {
        true => format!("./{name}"),
        false => name.to_owned(),
    };
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c);
    if name.chars().all(is_plain) {
        return name;
    }
    if printable(&name) == name {
        return format!("'{}'", name.replace('\'', "'\\''"));
    }
    let escaped = |c: char| match c {
        '\'' | '\\' => format!("\\{c}"),
        '\n' => "\\n".to_owned(),
        c if printable(c.to_string()) == c.to_string() => c.to_string(),
        c => format!("\\u{:04x}", u32::from(c)),
    };
    format!("$'{}'", name.chars().map(escaped).collect::<String>())
}

/// Fails if any mesh has a finding that makes the run fail, or could not be checked.
pub fn fail(report: &Report<'_>) -> Result<(), Error> {
    match report.failure() {
        None => Ok(()),
        Some(failed) if failed.is_finding => Err(Error::CheckFailed(failed.message)),
        Some(failed) => Err(Error::Unread(failed.message)),
    }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn names_are_words_of_a_shell() {
        for (name, word) in [
            ("a/b-1.obj", "a/b-1.obj"),
            ("-d.obj", "./-d.obj"),
            ("it's one.obj", r"'it'\''s one.obj'"),
            ("nl\nx.obj", r"$'nl\nx.obj'"),
            ("'\\\u{1b}\u{202e}1.obj", r"$'\'\\\u001b\u202e1.obj'"),
        ] {
            assert_eq!(quoted(name), word);
        }
    }
}
