//! Runs a method of another crate in the frame loop of this one.

#[cfg(feature = "gpu")]
pub mod gpu;

use std::sync::Arc;

use crate::error::Error;
use crate::pairs::Pairs;
use crate::progress::Control;
use crate::query::Query;
use crate::run::{Finder, FrameLoop, Job, ready};
use crate::scene::Scene;
use crate::settings::Placement;
use crate::sink::{Answer, Limits, Wanted};
use crate::stats::Statistics;
use crate::tuning::Tuning;

/// The frame loop around a method of another crate, on the CPU.
pub struct Host {
    frames: FrameLoop,
}

impl Host {
    /// Creates a host with `threads` workers; 0 for one per core.
    pub fn new(threads: usize) -> Self {
        let frames = FrameLoop::new(
            threads,
            Placement::default(),
            Limits::default(),
            Tuning::default(),
        );
        Host { frames }
    }

    /// One frame: resolves and checks the query, has `method` hand over the keys of all pairs, in any
    /// order, sorts them and drops repetitions.
    ///
    /// # Errors
    /// A stale id, refused positions, errors of the method.
    pub fn detect(
        &mut self,
        scene: &Scene,
        query: &Query,
        name: &'static str,
        method: impl FnMut(Job<'_>, &Arc<Answer>, &mut Statistics) -> Result<(), Error>,
    ) -> Result<&Pairs, Error> {
        let mut guest = Guest { name, method };
        ready(
            self.frames
                .run(scene, query, &Control::new(), Wanted::Pairs, &mut guest),
        )?;
        Ok(self.frames.pairs())
    }
}

struct Guest<F> {
    name: &'static str,
    method: F,
}

impl<F> Finder for Guest<F>
where
    F: FnMut(Job<'_>, &Arc<Answer>, &mut Statistics) -> Result<(), Error>,
{
    fn method(&self) -> &'static str {
        self.name
    }

    fn backend(&self) -> &str {
        "cpu"
    }

    fn repeats(&self) -> bool {
        true
    }

    async fn find(
        &mut self,
        job: Job<'_>,
        answer: &Arc<Answer>,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        (self.method)(job, answer, stats)
    }
}
