//! `impinge step --candidates`: pairs of elements whose boxes overlap, written run by run, so that
//! memory holds only one run.

use std::io::{self, Write};
use std::ops::ControlFlow;
use std::time::Instant;

use impinge::{Candidates, Detector, PairKind, Query, Stats};
use impinge_io::{Cell, ELEMENTS, KIND};

use crate::asked::Asked;
use crate::error::Error;
use crate::origins::Origins;
use crate::report;
use crate::rows::Rows;
use crate::text::{self, counted, hex};
use crate::values::RowsFile;

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
    stats: Stats,
}

/// Finds candidates and writes rows `kind, body_a, element_a, body_b, element_b`, sorted.
pub fn write(
    file: &RowsFile,
    (detector, bodies): (&mut Detector, &Moving),
    (inflation, query): (f64, &Query),
) -> Result<Written, Error> {
    let columns = [&[KIND][..], &ELEMENTS].concat();
    let mut rows = Rows::create(file, columns, None)?;
    let mut written = Written::default();
    let start = Instant::now();
    let mut each = |run: Candidates| match rows.put(cells(&bodies.origins, &run)) {
        Ok(()) => {
            written.add(&bodies.origins, &run);
            ControlFlow::Continue(())
        }
        Err(error) => ControlFlow::Break(error),
    };
    let found = detector.candidates_in_runs(&bodies.scene, inflation, query, MOST, &mut each)?;
    if let ControlFlow::Break(error) = found {
        return Err(error);
    }
    rows.finish()?;
    written.ms = start.elapsed().as_secs_f64() * 1e3;
    Ok(written)
}

/// The rows of one kind, with vertices as files number them.
fn named<'a>(
    origins: &'a Origins,
    run: &'a Candidates,
    kind: PairKind,
) -> impl Iterator<Item = [u32; 4]> + 'a {
    run.rows_of(kind).map(move |row| origins.row(kind, row))
}

fn cells<'a>(
    origins: &'a Origins,
    run: &'a Candidates,
) -> impl Iterator<Item = [Cell<'static>; 5]> + 'a {
    let of = move |kind: PairKind| {
        let kind_cell = Cell::Text(kind.name());
        named(origins, run, kind).map(move |row| {
            let [body_a, a, body_b, b] = row.map(Cell::Number);
            [kind_cell, body_a, a, body_b, b]
        })
    };
    PairKind::ALL.into_iter().flat_map(of)
}

impl Written {
    fn add(&mut self, origins: &Origins, run: &Candidates) {
        for (kind, n) in PairKind::ALL.into_iter().zip(&mut self.counts) {
            *n += run.of(kind).len() as u64;
            let hash = Candidates::hash_rows(kind, named(origins, run, kind));
            self.hash = self.hash.wrapping_add(hash);
        }
        self.n_runs += 1;
        self.stats = run.stats().clone();
    }

    fn kinds(&self) -> [(PairKind, u64); PairKind::ALL.len()] {
        PairKind::ALL.map(|kind| (kind, self.counts[kind as usize]))
    }

    fn n(&self) -> u64 {
        self.counts.iter().sum()
    }

    pub fn report(
        &self,
        bodies: &Moving,
        inflation: f64,
        asked: Asked,
    ) -> Result<report::Candidates, impinge::Error> {
        Ok(report::Candidates {
            candidates: self.n(),
            kinds: report::Kinds::new(|kind| self.counts[kind as usize]),
            hash: hex(self.hash),
            runs: self.n_runs,
            inflation,
            asked: report::AskedOfStep::new(asked),
            bodies: answer::described(bodies)?,
            ms: report::Total::new(self.ms),
            stats: report::Counters::new(&self.stats),
        })
    }

    /// Prints counts in one line, and how they were found in another.
    pub fn print(&self, to: &mut impl Write) -> io::Result<()> {
        if self.n() == 0 {
            return writeln!(to, "no candidates");
        }
        writeln!(
            to,
            "{} ({}), hash {}",
            counted(self.n(), "candidate"),
            text::kinds(self.kinds()),
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
