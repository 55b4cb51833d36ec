//! Reports for other programs: SARIF, JUnit, annotations of GitHub.
//!
//! A finding is one problem of one mesh: how often it is there, and where its largest place is.

use std::io::Write;

use impinge_check::{Counts, Place, Problem, Row};
use impinge_io::printable;
use serde_json::{Value, json};

use super::args::{CheckArgs, FailOn, Format};
use crate::error::Error;
use crate::output::out;
use crate::text::several;

/// One problem of one mesh.
struct Finding<'a> {
    row: &'a Row,
    kind: FailOn,
    /// Whether it makes the run fail.
    fails: bool,
    message: String,
    places: Vec<&'a Place>,
}

/// Prints all findings.
pub fn print(rows: &[Row], args: &CheckArgs) -> Result<(), Error> {
    let text = match args.format {
        Format::Text => return Ok(()),
        Format::Sarif => format!("{}\n", sarif(rows, args)),
        Format::Junit => junit(rows, args),
        Format::Github => github(rows, args),
    };
    Ok(out().write_all(text.as_bytes())?)
}

impl FailOn {
    /// The name of the option's value.
    pub fn key(self) -> &'static str {
        match self {
            FailOn::SelfIntersections => "self-intersections",
            FailOn::Degenerate => "degenerate",
            FailOn::Duplicates => "duplicates",
            FailOn::NonManifold => "non-manifold",
            FailOn::Boundary => "boundary",
            FailOn::Orientation => "orientation",
            FailOn::Thin => "thin",
            FailOn::Interpenetrating => "interpenetrating",
            FailOn::Touching => "touching",
            FailOn::Near => "near",
            FailOn::Nan => "nan",
            FailOn::Error => "error",
            FailOn::Any => "any",
        }
    }

    fn problem(self) -> Option<Problem> {
        Problem::ALL
            .into_iter()
            .find(|problem| problem.key() == self.key())
    }
}

/// The problems of a mesh, in the order of the summary. A mesh that could not be checked has one
/// alone.
fn findings<'a>(row: &'a Row, args: &CheckArgs) -> Vec<Finding<'a>> {
    let of = |kind: FailOn| {
        let is_named = args.fail_on.contains(&kind) || args.fail_on.contains(&FailOn::Any);
        Finding {
            row,
            kind,
            fails: is_named || row.result.is_err(),
            message: message(row, kind),
            places: row
                .places
                .iter()
                .filter(|place| Some(place.problem) == kind.problem())
                .collect(),
        }
    };
    let found = FailOn::EACH.into_iter().filter(|kind| kind.is_in(row));
    // What is not finite is an error too; it is said once.
    let is_twice = |kind: &FailOn| *kind == FailOn::Error && FailOn::Nan.is_in(row);
    found.filter(|kind| !is_twice(kind)).map(of).collect()
}

fn message(row: &Row, kind: FailOn) -> String {
    let counts = match &row.result {
        Ok(counts) => counts,
        Err(failure) => return failure.message.clone(),
    };
    let said = said(kind, counts);
    let first = row
        .places
        .iter()
        .find(|place| Some(place.problem) == kind.problem());
    match first {
        None => said,
        Some(place) => {
            let [x, y, z] = place.point;
            format!("{said}, near ({x}, {y}, {z})")
        }
    }
}

fn said(kind: FailOn, counts: &Counts) -> String {
    let facets = if counts.n_tetrahedra > 0 {
        ["face", "faces"]
    } else {
        ["edge", "edges"]
    };
    let [facet, facets] = facets;
    match kind {
        FailOn::SelfIntersections => several(
            counts.self_intersections,
            "pair of elements intersects",
            "pairs of elements intersect",
        ),
        FailOn::Degenerate => several(
            counts.degenerate,
            "degenerate element",
            "degenerate elements",
        ),
        FailOn::Duplicates => several(counts.duplicates, "duplicate element", "duplicate elements"),
        FailOn::NonManifold => {
            let facets = several(counts.non_manifold_facets, facet, facets);
            let vertices = several(counts.non_manifold_vertices, "vertex", "vertices");
            format!("not manifold: {facets}, {vertices}")
        }
        FailOn::Boundary => format!(
            "open border of {}",
            several(counts.boundary_facets, facet, facets)
        ),
        FailOn::Orientation => format!(
            "inconsistent orientation at {}",
            several(counts.inconsistent_facets, facet, facets)
        ),
        FailOn::Thin => {
            let n = counts.thin_faces.unwrap_or(0);
            several(n, "face at a thin wall", "faces at thin walls")
        }
        FailOn::Interpenetrating
        | FailOn::Touching
        | FailOn::Near
        | FailOn::Nan
        | FailOn::Error
        | FailOn::Any => kind.words().to_owned(),
    }
}

/// A SARIF 2.1.0 log (OASIS).
fn sarif(rows: &[Row], args: &CheckArgs) -> Value {
    let rules: Vec<Value> = FailOn::EACH
        .iter()
        .map(|kind| json!({ "id": kind.key(), "shortDescription": { "text": kind.words() } }))
        .collect();
    let all = rows.iter().flat_map(|row| findings(row, args));
    let results: Vec<Value> = all
        .map(|finding| {
            let index = FailOn::EACH.iter().position(|&kind| kind == finding.kind);
            let places: Vec<Value> = finding.places.iter().map(|place| place.to_json()).collect();
            json!({
                "ruleId": finding.kind.key(),
                "ruleIndex": index,
                "level": if finding.fails { "error" } else { "warning" },
                "message": { "text": finding.message },
                "locations": [{
                    "physicalLocation": { "artifactLocation": { "uri": uri(&finding.row.path) } }
                }],
                "properties": { "places": places },
            })
        })
        .collect();
    json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": {
                "name": "impinge check",
                "version": env!("CARGO_PKG_VERSION"),
                "informationUri": "https://github.com/impinge-rs/impinge",
                "rules": rules,
            } },
            "columnKind": "unicodeCodePoints",
            "results": results,
        }],
    })
}

/// A path as a relative reference (RFC 3986).
fn uri(path: &str) -> String {
    let path = if cfg!(windows) {
        path.replace('\\', "/")
    } else {
        path.to_owned()
    };
    let mut text = String::with_capacity(path.len());
    for byte in path.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => {
                text.push(byte.into());
            }
            _ => text += &format!("%{byte:02X}"),
        }
    }
    text
}

/// A test case per mesh and problem. Without --fail-on every finding is a failure.
fn junit(rows: &[Row], args: &CheckArgs) -> String {
    let asks = |kind: FailOn| {
        args.fail_on.is_empty()
            || args.fail_on.contains(&kind)
            || args.fail_on.contains(&FailOn::Any)
    };
    let kinds: Vec<FailOn> = FailOn::EACH
        .into_iter()
        .filter(|&kind| kind.problem().is_some() && asks(kind))
        .filter(|&kind| kind != FailOn::Thin || args.min_thickness.is_some())
        .collect();
    let (mut cases, mut n_cases, mut n_failures, mut n_errors) = (String::new(), 0, 0, 0);
    for row in rows {
        let class = escaped(&row.path);
        if let Err(failure) = &row.result {
            n_cases += 1;
            n_errors += 1;
            cases += &format!(
                "    <testcase classname=\"{class}\" name=\"check\">\n      <error type=\"{}\" message=\"{}\"/>\n    </testcase>\n",
                failure.kind.name(),
                escaped(&failure.message)
            );
            continue;
        }
        for &kind in &kinds {
            n_cases += 1;
            let start = format!(
                "    <testcase classname=\"{class}\" name=\"{}\"",
                kind.key()
            );
            if kind.is_in(row) {
                n_failures += 1;
                cases += &format!(
                    "{start}>\n      <failure type=\"{}\" message=\"{}\"/>\n    </testcase>\n",
                    kind.key(),
                    escaped(&message(row, kind))
                );
            } else {
                cases += &format!("{start}/>\n");
            }
        }
    }
    let numbers = format!("tests=\"{n_cases}\" failures=\"{n_failures}\" errors=\"{n_errors}\"");
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites {numbers}>\n  <testsuite name=\"impinge check\" {numbers}>\n\
         {cases}  </testsuite>\n</testsuites>\n"
    )
}

/// Text in an attribute of XML or HTML. Control characters, which XML cannot hold, are escaped as
/// in all messages.
pub fn escaped(text: &str) -> String {
    let mut safe = String::new();
    for c in printable(text).chars() {
        match c {
            '&' => safe += "&amp;",
            '<' => safe += "&lt;",
            '>' => safe += "&gt;",
            '"' => safe += "&quot;",
            '\'' => safe += "&#39;",
            '\u{fffe}' | '\u{ffff}' => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// Workflow commands of GitHub: an annotation per finding.
fn github(rows: &[Row], args: &CheckArgs) -> String {
    let data = |text: &str| {
        text.replace('%', "%25")
            .replace('\r', "%0D")
            .replace('\n', "%0A")
    };
    let property = |text: &str| data(text).replace(':', "%3A").replace(',', "%2C");
    let all = rows.iter().flat_map(|row| findings(row, args));
    all.map(|finding| {
        format!(
            "::{} file={},title={}::{}\n",
            if finding.fails { "error" } else { "warning" },
            property(&finding.row.path),
            property(finding.kind.words()),
            data(&finding.message)
        )
    })
    .collect()
}
