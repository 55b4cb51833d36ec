//! What methods that live in other crates are made of: the baselines that this library is measured
//! against stand on the same frame, boxes, grid, threads and exact test, so that only the method differs.
//!
//! Not part of the stable interface.

#[cfg(feature = "gpu")]
pub mod gpu;

use std::time::Instant;

pub use crate::cpu::Job;
pub use crate::cpu::cells::{Cells, MOST_ENTRIES_EACH, Options, Owner, Rule, for_cells};
pub use crate::cpu::kept::{Kept, KeptList};
pub use crate::cpu::narrow::{Candidate, Settler};
pub use crate::cpu::simd::{Isa, LaneBounds, masks};
pub use crate::cpu::subcells::Asked;
pub use crate::cpu::workers::Workers;
pub use crate::cpu::world::World;
pub use crate::error::Error;
pub use crate::frame::{Frame, Participant, pair_key};
pub use crate::grouping::GROUP;
pub use crate::grouping::bounds::Bounds;
pub use crate::grouping::grid::{FineRange, Grid, owns};

use crate::pairs::Pairs;
use crate::progress::Control;
use crate::query::Query;
use crate::scene::Scene;
use crate::stats::Statistics;

/// The frame loop around a method from outside: what `Detector` is to the library's own.
pub struct Host {
    frame: Frame,
    pairs: Pairs,
    workers: Workers,
}

impl Host {
    /// With `threads` workers; 0 for one a core.
    ///
    /// # Errors
    /// Threads that do not start.
    pub fn new(threads: usize) -> Result<Self, Error> {
        Ok(Host {
            frame: Frame::default(),
            pairs: Pairs::default(),
            workers: Workers::new(threads)?,
        })
    }

    /// One frame: resolves and checks the query, has `method` append the keys of all pairs, in any
    /// order, sorts them and drops repetitions.
    ///
    /// # Errors
    /// A stale id, refused positions, those of the method.
    pub fn detect(
        &mut self,
        scene: &Scene,
        query: &Query,
        name: &'static str,
        method: impl FnOnce(Job<'_>, &mut Vec<u64>, &mut Statistics) -> Result<(), Error>,
    ) -> Result<&Pairs, Error> {
        let start = Instant::now();
        self.frame.resolve(scene, query)?;
        let _shift = self.workers.shift(self.frame.n_primitives());
        self.pairs.begin(&self.frame);
        self.frame.check(scene)?;
        let (keys, stats) = self.pairs.parts_mut();
        stats.method = name;
        stats.n_threads = self.workers.n();
        stats.backend.push_str("cpu");
        let job = Job {
            scene,
            frame: &self.frame,
            workers: &self.workers,
            control: &Control::new(),
        };
        method(job, keys, stats)?;
        stats.time("collect", |_| {
            keys.sort_unstable();
            keys.dedup();
        });
        stats.total_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(&self.pairs)
    }
}
