//! Reports for other programs: SARIF, JUnit, annotations of GitHub. In SARIF and on GitHub a
//! finding is one kind of problem of one mesh: how often it is there, and where its largest place
//! is.

use impinge_io::printable;
use serde_json::{Value, json};

use super::{Finding, Report};
use crate::row::Row;

impl Report<'_> {
    /// The findings of a mesh, in the order of the summary, and whether each makes the run fail. A
    /// mesh that could not be checked has one alone.
    fn findings<'a>(&self, row: &'a Row) -> impl Iterator<Item = (&'a Row, Finding, bool)> {
        let found = Finding::ALL.into_iter().filter(|kind| kind.is_in(row));
        // What is not finite is an error too; it is said once.
        let is_twice = |kind: Finding| kind == Finding::Error && Finding::Nan.is_in(row);
        let fails = |kind| row.result.is_err() || self.fail_on.contains(&kind);
        found
            .filter(move |&kind| !is_twice(kind))
            .map(move |kind| (row, kind, fails(kind)))
    }

    /// A SARIF 2.1.0 log (OASIS). `version`: of the program.
    pub fn sarif(&self, version: &str) -> Value {
        let rules: Vec<Value> = Finding::ALL
            .iter()
            .map(|kind| json!({ "id": kind.name(), "shortDescription": { "text": kind.words() } }))
            .collect();
        let all = self.rows.iter().flat_map(|row| self.findings(row));
        let results: Vec<Value> = all
            .map(|(row, kind, fails)| {
                let index = Finding::ALL.iter().position(|&each| each == kind);
                let places = row.places.iter();
                let places = places.filter(|place| Some(place.problem) == kind.problem());
                let places: Vec<_> = places.collect();
                json!({
                    "ruleId": kind.name(),
                    "ruleIndex": index,
                    "level": if fails { "error" } else { "warning" },
                    "message": { "text": kind.message(row) },
                    "locations": [{
                        "physicalLocation": { "artifactLocation": { "uri": uri(&row.path) } }
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
                    "version": version,
                    "informationUri": "https://github.com/impinge-rs/impinge",
                    "rules": rules,
                } },
                "columnKind": "unicodeCodePoints",
                "results": results,
            }],
        })
    }

    /// A JUnit report: a test case per mesh and problem that makes the run fail; where nothing
    /// does, each finding is a failure.
    pub fn junit(&self) -> String {
        let asks = |kind: Finding| self.fail_on.is_empty() || self.fail_on.contains(&kind);
        let of_walls =
            |row: &Row| matches!(&row.result, Ok(counts) if counts.min_thickness.is_some());
        let asks_walls = self.rows.iter().any(of_walls);
        let kinds: Vec<Finding> = Finding::ALL
            .into_iter()
            .filter(|&kind| !matches!(kind, Finding::Nan | Finding::Error) && asks(kind))
            .filter(|&kind| kind != Finding::Thin || asks_walls)
            .collect();
        let (mut cases, mut n_cases, mut n_failures, mut n_errors) = (String::new(), 0, 0, 0);
        for row in self.rows {
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
                let name = kind.name();
                let start = format!("    <testcase classname=\"{class}\" name=\"{name}\"");
                if kind.is_in(row) {
                    n_failures += 1;
                    let message = escaped(&kind.message(row));
                    cases += &format!(
                        "{start}>\n      <failure type=\"{name}\" message=\"{message}\"/>\n    </testcase>\n"
                    );
                } else {
                    cases += &format!("{start}/>\n");
                }
            }
        }
        let numbers =
            format!("tests=\"{n_cases}\" failures=\"{n_failures}\" errors=\"{n_errors}\"");
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites {numbers}>\n  <testsuite name=\"impinge check\" {numbers}>\n\
             {cases}  </testsuite>\n</testsuites>\n"
        )
    }

    /// Workflow commands of GitHub: an annotation per finding. The text follows, for the log.
    pub fn github(&self) -> String {
        let data = |text: &str| {
            text.replace('%', "%25")
                .replace('\r', "%0D")
                .replace('\n', "%0A")
        };
        let property = |text: &str| data(text).replace(':', "%3A").replace(',', "%2C");
        let mut text = String::new();
        for (row, kind, fails) in self.rows.iter().flat_map(|row| self.findings(row)) {
            text += &format!(
                "::{} file={},title={}::{}\n",
                if fails { "error" } else { "warning" },
                property(&row.path),
                property(kind.words()),
                data(&kind.message(row))
            );
        }
        text + &self.text()
    }
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
