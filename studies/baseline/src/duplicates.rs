//! The paper's two levels without impinge's owner rule.
//!
//! Two elements often share several cells, and the pair is then found in each of them. The paper
//! counts how often (section 4.2, table 3: 62 to 83 % of the pairs are checked more than once, 2.11
//! to 3.72 times on average). It tries a hash table to avoid this, which loses 2.7 to 4.3 % of the
//! colliding elements. In impinge only one cell tests each pair, the cell that holds the lower
//! corner of the pair's common range: nothing is lost, and no table is needed.
//!
//! ```
//! use impinge_core::{Method, Query};
//! use impinge_baseline::duplicates::{Missing, Settings, TwoLevels};
//! use impinge_scenes::{BuiltScene, surfaces};
//! # fn main() -> Result<(), impinge_core::Error> {
//! let balls = BuiltScene::two_body("balls", &surfaces::ball(2_000), [0.4, 0.3, 0.2])?;
//! let (scene, a, b) = (&balls.scene, balls.bodies[0], balls.bodies[1]);
//! let mut two_levels = TwoLevels::new(Settings::default())?;
//! let checks = two_levels.count(scene, a, b)?;
//! assert!(checks.average() >= 1.0);
//! let all = two_levels.detect(scene, a, b)?.clone();
//! let found = two_levels.detect_djb2(scene, a, b, balls.n_elements())?;
//! assert!(Missing::of(&all, found, a, b).rate() < 1.0);
//! # Ok(()) }
//! ```

mod djb2;
mod rules;

use std::sync::Arc;

use impinge_core::cpu::cells::Cells;
use impinge_core::host::Host;
use impinge_core::search::sink::Answer;
use impinge_core::simd::Isa;
use impinge_core::{BodyId, InstructionSet, Pairs, Query, Scene};

use crate::{Error, check_lambda, check_threads};
use djb2::Table;
use rules::{Every, Recorded};

/// Which pairs of a cell reach the intersection test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Possible {
    /// All pairs that touch a common sub-cell, as in the paper (section 3.2).
    #[default]
    Masks,
    /// Of those, only the pairs whose boxes overlap, as in impinge.
    Boxes,
}

/// Settings of [`TwoLevels`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The density coefficient λ of the paper's equation (1), above 0.
    pub lambda: f64,
    /// Elements per group, 1 to 64.
    pub group_size: u32,
    /// Which pairs are tested.
    pub possible: Possible,
    /// CPU threads; 0 means one per core.
    pub threads: usize,
    /// The widest vector instructions that may be used.
    pub instruction_set: InstructionSet,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            lambda: 1.0,
            group_size: 64,
            possible: Possible::default(),
            threads: 0,
            instruction_set: InstructionSet::default(),
        }
    }
}

/// How often pairs are tested if every cell tests the pairs that it finds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Checks {
    /// Tests, including repetitions.
    pub n_tests: u64,
    /// Different pairs that are tested.
    pub n_pairs: u64,
    /// Pairs that are tested more than once.
    pub n_repeated: u64,
}

impl Checks {
    /// The share of the tested pairs that are tested more than once, 0 to 1 (`#MCT` of table 3).
    pub fn repeated_share(&self) -> f64 {
        self.n_repeated as f64 / self.n_pairs.max(1) as f64
    }

    /// Tests per tested pair, at least 1 (`#Checking times` of table 3); 1 if there is none.
    pub fn average(&self) -> f64 {
        self.n_tests.max(1) as f64 / self.n_pairs.max(1) as f64
    }
}

/// The losses of an incomplete answer.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Missing {
    /// Elements of both bodies that take part in any pair.
    pub n_colliding: u64,
    /// Of those, the elements that the incomplete answer does not name.
    pub n_missing: u64,
    /// Pairs of the complete answer.
    pub n_pairs: u64,
    /// Of those, the pairs that the incomplete answer does not have.
    pub n_missing_pairs: u64,
}

impl Missing {
    /// Compares an answer with the complete one.
    pub fn of(all: &Pairs, found: &Pairs, a: BodyId, b: BodyId) -> Self {
        let n_colliding = |pairs: &Pairs| {
            let of_both = [a, b].map(|body| pairs.colliding(body).len() as u64);
            of_both[0] + of_both[1]
        };
        let (n_colliding, n_found) = (n_colliding(all), n_colliding(found));
        Missing {
            n_colliding,
            n_missing: n_colliding.saturating_sub(n_found),
            n_pairs: all.len() as u64,
            n_missing_pairs: all.len().saturating_sub(found.len()) as u64,
        }
    }

    /// Missing elements divided by colliding elements, 0 to 1: the paper's missing rate.
    pub fn rate(&self) -> f64 {
        self.n_missing as f64 / self.n_colliding.max(1) as f64
    }

    /// Missing pairs divided by pairs, 0 to 1.
    pub fn pair_rate(&self) -> f64 {
        self.n_missing_pairs as f64 / self.n_pairs.max(1) as f64
    }
}

/// The paper's two levels between two bodies, without the owner rule. Memory lives here and is
/// reused.
pub struct TwoLevels {
    settings: Settings,
    host: Host,
    cells: Cells,
    table: Table,
}

impl TwoLevels {
    /// Creates the method with explicit settings.
    ///
    /// # Errors
    /// A setting out of its range.
    pub fn new(settings: Settings) -> Result<Self, Error> {
        check_lambda(settings.lambda)?;
        check_threads(settings.threads)?;
        if !(1..=64).contains(&settings.group_size) {
            return Err(Error::Setting {
                setting: "group size",
                given: settings.group_size.to_string(),
                allowed: "1 to 64",
            });
        }
        Ok(TwoLevels {
            settings,
            host: Host::new(settings.threads),
            cells: Cells::new(&of_cells(&settings)),
            table: Table::new(Isa::detect(settings.instruction_set)),
        })
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Tests every pair in every cell where it is found (table 3, "without hash"). Nothing is
    /// missing; `n_candidates` of the statistics counts the tests, including repetitions.
    ///
    /// # Errors
    /// A stale id, one body named twice, refused positions.
    pub fn detect(&mut self, scene: &Scene, a: BodyId, b: BodyId) -> Result<&Pairs, Error> {
        let settings = of_cells(&self.settings);
        let rule = Every(self.settings.possible);
        let cells = &mut self.cells;
        let query = Query::between(a, b);
        self.host.detect(
            scene,
            &query,
            "two levels, repeated",
            |job, answer, stats| cells.run(job, answer, &settings, &rule, stats),
        )
    }

    /// Like [`detect`](TwoLevels::detect), but pairs go through a table of `table_size` slots
    /// before the tests (table 3, "with hash"; the paper has as many slots as there are
    /// elements). DJB2 maps each pair to a slot. Of all pairs in a slot only the lowest is
    /// tested, so that the answer does not depend on threads; the others are lost.
    ///
    /// # Errors
    /// As `detect`; a table without slots or with more than 2^32.
    pub fn detect_djb2(
        &mut self,
        scene: &Scene,
        a: BodyId,
        b: BodyId,
        table_size: usize,
    ) -> Result<&Pairs, Error> {
        let settings = of_cells(&self.settings);
        let possible = self.settings.possible;
        let (cells, table) = (&mut self.cells, &mut self.table);
        let query = Query::between(a, b);
        self.host
            .detect(scene, &query, "two levels, DJB2", |job, answer, stats| {
                stats.time("table", |_| table.clear(table_size))?;
                cells.run(job, answer, &settings, &table.rule(possible), stats)?;
                table.decide(job, answer, stats)
            })
    }

    /// Counts how often [`detect`](TwoLevels::detect) tests pairs. It records every test, which
    /// takes 16 bytes per test, so do not time it.
    ///
    /// # Errors
    /// As `detect`.
    pub fn count(&mut self, scene: &Scene, a: BodyId, b: BodyId) -> Result<Checks, Error> {
        let settings = of_cells(&self.settings);
        let possible = self.settings.possible;
        let cells = &mut self.cells;
        let tests = Arc::new(Answer::default());
        let query = Query::between(a, b);
        self.host
            .detect(scene, &query, "two levels, counted", |job, _, stats| {
                let rule = Recorded {
                    possible,
                    plan: job.plan,
                };
                cells.run(job, &tests, &settings, &rule, stats)
            })?;
        let ([mut tested], _) = tests.finish()?;
        tested.sort_unstable();
        let mut checks = Checks::default();
        for same in tested.chunk_by(u64::eq) {
            checks.n_tests += same.len() as u64;
            checks.n_pairs += 1;
            checks.n_repeated += u64::from(same.len() > 1);
        }
        Ok(checks)
    }
}

/// The settings for impinge's own stages.
fn of_cells(settings: &Settings) -> impinge_core::Settings {
    impinge_core::Settings::new()
        .density(settings.lambda)
        .group_size(settings.group_size)
        .instruction_set(settings.instruction_set)
}
