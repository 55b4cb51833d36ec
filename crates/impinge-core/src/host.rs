//! The frame loop around a method that lives in another crate: what `Detector` is to the library's own.

#[cfg(feature = "gpu")]
pub mod gpu;

use crate::clock::Instant;

use crate::cpu::Job;
use crate::cpu::workers::Workers;
use crate::error::Error;
use crate::frame::Frame;
use crate::pairs::Pairs;
use crate::progress::Control;
use crate::query::Query;
use crate::scene::Scene;
use crate::stats::Statistics;

/// The frame loop around a method from outside.
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
