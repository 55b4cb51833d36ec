//! What impinge's owner rule replaces: the paper's two levels without it.
//!
//! Two primitives often share several cells, and are then found in each of them. The paper counts how
//! often (section 4.2, table 3: 62 to 83 % of the pairs are checked more than once, 2.11 to 3.72 times on
//! average) and tries a hash table against it, which loses 2.7 to 4.3 % of the colliding primitives.
//! impinge has each pair tested by one cell alone, the one that holds the lower corner of the pair's
//! common range: nothing is lost, and there is no table.
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
//! let found = two_levels.detect_djb2(scene, a, b, balls.n_primitives())?;
//! assert!(Missing::of(&all, found, a, b).rate() < 1.0);
//! # Ok(()) }
//! ```

mod djb2;
mod rules;

use impinge_core::cpu::cells::Cells;
use impinge_core::cpu::simd::Isa;
use impinge_core::host::Host;
use impinge_core::{BodyId, InstructionSet, Pairs, Query, Scene};

use crate::{Error, check_lambda, check_threads};
use djb2::Table;
use rules::{Every, Recorded};

/// Which pairs of a cell go on to the intersection test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Possible {
    /// All that touch a common sub-cell, as the paper has it (section 3.2).
    #[default]
    Masks,
    /// Of those, the ones whose boxes overlap, as impinge has it.
    Boxes,
}

/// What [`TwoLevels`] may be told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The density coefficient λ of the paper's equation (1), above 0.
    pub lambda: f64,
    /// Primitives a group, 1 to 64.
    pub group_size: u32,
    /// Which pairs are tested.
    pub possible: Possible,
    /// CPU threads; 0 means one a core.
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

/// How often pairs are tested when every cell tests what it finds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Checks {
    /// Tests, repetitions counted.
    pub n_tests: u64,
    /// Pairs that are tested at all.
    pub n_pairs: u64,
    /// Pairs that are tested more than once.
    pub n_repeated: u64,
}

impl Checks {
    /// The share of the tested pairs that are tested more than once, 0 to 1 (`#MCT` of table 3).
    pub fn repeated_share(&self) -> f64 {
        self.n_repeated as f64 / self.n_pairs.max(1) as f64
    }

    /// Tests a pair that is tested, 1 at least (`#Checking times` of table 3); 1 when there is none.
    pub fn average(&self) -> f64 {
        self.n_tests.max(1) as f64 / self.n_pairs.max(1) as f64
    }
}

/// What an incomplete answer lacks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Missing {
    /// Primitives of both bodies that take part in any pair.
    pub n_colliding: u64,
    /// Of those, the ones that the incomplete answer does not name.
    pub n_missing: u64,
    /// Pairs.
    pub n_pairs: u64,
    /// Of those, the ones that the incomplete answer does not have.
    pub n_missing_pairs: u64,
}

impl Missing {
    /// Compares an answer with the whole of it.
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

    /// Missing primitives to colliding primitives, 0 to 1: the paper's missing rate.
    pub fn rate(&self) -> f64 {
        self.n_missing as f64 / self.n_colliding.max(1) as f64
    }

    /// Missing pairs to pairs, 0 to 1.
    pub fn pair_rate(&self) -> f64 {
        self.n_missing_pairs as f64 / self.n_pairs.max(1) as f64
    }
}

/// The paper's two levels between two bodies, without the owner rule. Memory lives here and is reused.
pub struct TwoLevels {
    settings: Settings,
    host: Host,
    cells: Cells,
    table: Table,
}

impl TwoLevels {
    /// With everything said.
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
            cells: Cells::new(settings.instruction_set),
            table: Table::new(Isa::detect(settings.instruction_set)),
        })
    }

    /// What it was told.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Every pair tested in every cell where it is found (table 3, "without hash"). Nothing is missing;
    /// `n_candidates` of the statistics counts the tests, repetitions included.
    ///
    /// # Errors
    /// A stale id, one body named twice, refused positions.
    pub fn detect(&mut self, scene: &Scene, a: BodyId, b: BodyId) -> Result<&Pairs, Error> {
        let settings = of_cells(&self.settings);
        let rule = Every(self.settings.possible);
        let cells = &mut self.cells;
        let query = Query::between(a, b);
        self.host
            .detect(scene, &query, "two levels, repeated", |job, keys, stats| {
                cells.run(job, &settings, &rule, keys, stats)
            })
    }

    /// As [`detect`](TwoLevels::detect), but a table of `table_size` slots stands before the tests (table 3,
    /// "with hash"; the paper has as many slots as there are primitives). Each pair goes to the slot that
    /// DJB2 gives it; of all pairs in a slot only one is tested, and the others are lost. Which one: the
    /// lowest, so that the answer does not depend on threads.
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
            .detect(scene, &query, "two levels, DJB2", |job, keys, stats| {
                stats.time("table", |_| table.clear(table_size))?;
                cells.run(job, &settings, &table.rule(possible), keys, stats)?;
                table.settle(job, keys, stats);
                Ok(())
            })
    }

    /// How often pairs are tested by [`detect`](TwoLevels::detect). Every test is written down, so this
    /// takes 16 bytes a test and is not for timing.
    ///
    /// # Errors
    /// As `detect`.
    pub fn count(&mut self, scene: &Scene, a: BodyId, b: BodyId) -> Result<Checks, Error> {
        let settings = of_cells(&self.settings);
        let possible = self.settings.possible;
        let cells = &mut self.cells;
        let mut tested = Vec::new();
        let query = Query::between(a, b);
        self.host
            .detect(scene, &query, "two levels, counted", |job, _, stats| {
                let rule = Recorded {
                    possible,
                    frame: job.frame,
                };
                cells.run(job, &settings, &rule, &mut tested, stats)
            })?;
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

/// What impinge's own stages are told.
fn of_cells(settings: &Settings) -> impinge_core::Settings {
    impinge_core::Settings {
        lambda: settings.lambda,
        group_size: settings.group_size,
        ..impinge_core::Settings::default()
    }
}
