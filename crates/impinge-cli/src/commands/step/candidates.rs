//! `impinge step --candidates`: pairs of elements whose boxes overlap, written run by run, so that memory holds only one run.

use std::io::{self, Write};
use std::ops::ControlFlow;
use std::time::Instant;

use impinge::{CandidateQuery, Candidates, Control, Detector, PairKind, Statistics};
use impinge_io::{npy_header, npy_header_in};
use serde_json::{Map, Value, json};

use crate::error::Error;
use crate::json::{counters, rounded};
use crate::target::Target;
use crate::text::{counted, grouped, hex};
use crate::values::{RowsFile, RowsFormat};

use super::answer;
use super::load::Moving;

/// Candidates per run, unless the memory budget allows fewer: 128 MiB of keys.
const MOST: u64 = 1 << 24;

/// What was written.
#[derive(Debug, Default)]
pub struct Written {
    counts: [u64; PairKind::ALL.len()],
    hash: u64,
    n_runs: u64,
    ms: f64,
    /// Of the last run.
    stats: Statistics,
}

/// Finds candidates and writes rows `kind, body_a, element_a, body_b, element_b`, sorted.
pub fn write(
    file: &RowsFile,
    (detector, bodies, query): (&mut Detector, &Moving, &CandidateQuery),
    control: &Control<'_>,
) -> Result<Written, Error> {
    let mut rows = Rows::create(file)?;
    let mut written = Written::default();
    let start = Instant::now();
    let mut each = |run: Candidates| match rows.put(&run) {
        Ok(()) => {
            written.add(&run);
            ControlFlow::Continue(())
        }
        Err(error) => ControlFlow::Break(error),
    };
    let found = detector.candidates_in_runs_with(&bodies.scene, query, MOST, &mut each, control)?;
    if let ControlFlow::Break(error) = found {
        return Err(error);
    }
    rows.finish()?;
    written.ms = start.elapsed().as_secs_f64() * 1e3;
    Ok(written)
}

impl Written {
    fn add(&mut self, run: &Candidates) {
        for (kind, n) in PairKind::ALL.into_iter().zip(&mut self.counts) {
            *n += run.of(kind).len() as u64;
        }
        self.hash = self.hash.wrapping_add(run.hash());
        self.n_runs += 1;
        self.stats = run.stats().clone();
    }

    fn n(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// `candidates`, `kinds`, `hash`, `runs`, `distance`, `bodies`, `ms`, `stats`; `ms` holds the time of
    /// finding and writing all runs, `stats` the counters of the last one.
    pub fn json(&self, bodies: &Moving, distance: f64) -> Result<Value, impinge::Error> {
        let kinds = PairKind::ALL.into_iter().zip(self.counts);
        let kinds: Map<String, Value> = kinds
            .map(|(kind, n)| (kind.name().to_owned(), n.into()))
            .collect();
        Ok(json!({
            "candidates": self.n(),
            "kinds": kinds,
            "hash": hex(self.hash),
            "runs": self.n_runs,
            "distance": distance,
            "bodies": answer::described(bodies)?,
            "ms": { "total": rounded(self.ms) },
            "stats": counters(&self.stats),
        }))
    }

    /// Prints counts in one line, and how they were found in another.
    pub fn print(&self, to: &mut impl Write) -> io::Result<()> {
        let counts: Vec<String> = PairKind::ALL
            .into_iter()
            .zip(self.counts)
            .filter(|&(_, n)| n > 0)
            .map(|(kind, n)| format!("{} {}", grouped(n), kind.name()))
            .collect();
        if counts.is_empty() {
            return writeln!(to, "no candidates");
        }
        writeln!(
            to,
            "{} ({}), hash {}",
            counted(self.n(), "candidate"),
            counts.join(", "),
            hex(self.hash)
        )?;
        writeln!(
            to,
            "{} on cpu, {}; {}; {:.3} ms",
            self.stats.method,
            counted(self.stats.n_threads as u64, "thread"),
            counted(self.n_runs, "run"),
            self.ms
        )
    }
}

/// A file of candidates.
struct Rows {
    format: RowsFormat,
    to: Target,
    n: u64,
}

impl Rows {
    fn create(file: &RowsFile) -> Result<Self, Error> {
        let mut to = Target::create(file)?;
        match file.format {
            RowsFormat::Npy => to.write(|to| to.write_all(&longest_header()))?,
            RowsFormat::Csv => {
                to.write(|to| writeln!(to, "kind,body_a,element_a,body_b,element_b"))?;
            }
            RowsFormat::Jsonl => {}
        }
        Ok(Rows {
            format: file.format,
            to,
            n: 0,
        })
    }

    fn put(&mut self, run: &Candidates) -> Result<(), Error> {
        let format = self.format;
        self.n += run.len() as u64;
        self.to.write(|to| {
            for kind in PairKind::ALL {
                for row in run.rows(kind) {
                    put(to, format, kind, row)?;
                }
            }
            Ok(())
        })
    }

    /// Writes the number of rows into the header, and gives the file its name.
    fn finish(mut self) -> Result<(), Error> {
        if self.format == RowsFormat::Npy {
            self.to
                .write_start(&header(longest_header().len(), self.n))?;
        }
        self.to.finish()
    }
}

/// The fields of a packed structured array: `kind` is two characters of four bytes each, as in NumPy.
const FIELDS: &str = "[('kind', '<U2'), ('body_a', '<u4'), ('element_a', '<u4'), ('body_b', '<u4'), ('element_b', '<u4')]";

fn header(n_bytes: usize, n: u64) -> Vec<u8> {
    npy_header_in(n_bytes, FIELDS, &format!("({n},)"))
}

/// A header with room for any number of rows.
fn longest_header() -> Vec<u8> {
    npy_header(FIELDS, &format!("({},)", u64::MAX))
}

fn put(to: &mut dyn Write, format: RowsFormat, kind: PairKind, row: [u32; 4]) -> io::Result<()> {
    let [body_a, a, body_b, b] = row;
    let name = kind.name();
    match format {
        RowsFormat::Npy => {
            for letter in name.chars() {
                to.write_all(&u32::from(letter).to_le_bytes())?;
            }
            to.write_all(row.map(u32::to_le_bytes).as_flattened())
        }
        RowsFormat::Csv => writeln!(to, "{name},{body_a},{a},{body_b},{b}"),
        RowsFormat::Jsonl => writeln!(
            to,
            "{{\"kind\":\"{name}\",\"body_a\":{body_a},\"element_a\":{a},\"body_b\":{body_b},\"element_b\":{b}}}"
        ),
    }
}
