//! The same for the GPU: a method from outside is a plan of passes that work in cells.

use crate::clock::Instant;
use std::sync::Arc;

use crate::error::Error;
use crate::frame::Frame;
use crate::gpu::cells::InCells;
use crate::gpu::engine::{Engine, Options};
use crate::gpu::room::{Capacities, Counts};
use crate::gpu::{Gpu, Wanted};
use crate::pairs::Pairs;
use crate::progress::Control;
use crate::query::Query;
use crate::scene::Scene;
use crate::settings::Method;

/// The frame loop around a plan from outside.
pub struct Host {
    frame: Frame,
    pairs: Pairs,
    engine: Engine,
}

impl Host {
    /// On the adapter whose name contains `device`, or the best there is, with cells as dense as `lambda`.
    /// `first` is the room to begin with, and `memory_budget` bytes are what the engine's own buffers may
    /// have: beyond it, the work is done in parts.
    ///
    /// # Errors
    /// No adapter fits; the driver refuses.
    pub fn new(
        device: Option<&str>,
        lambda: f64,
        first: Option<Capacities>,
        memory_budget: Option<u64>,
        plan: Box<dyn InCells>,
    ) -> Result<Self, Error> {
        let gpu = Gpu::open(device.map_or(Wanted::Any, Wanted::Named))?;
        let options = Options {
            method: Method::Cells,
            lambda,
            group_size: 64,
            recluster: false,
            memory_budget,
            in_pieces: false,
        };
        let first = first.unwrap_or_default();
        Ok(Host {
            frame: Frame::default(),
            pairs: Pairs::default(),
            engine: Engine::of_guest(Arc::clone(&gpu), options, first, plan),
        })
    }

    /// One frame, repetitions dropped; and what each pass counted.
    ///
    /// # Errors
    /// A stale id, refused positions, the device's own.
    pub fn detect(
        &mut self,
        scene: &Scene,
        query: &Query,
        name: &'static str,
    ) -> Result<(&Pairs, &[Counts]), Error> {
        let start = Instant::now();
        self.frame.resolve(scene, query)?;
        self.frame.check(scene)?;
        self.pairs.begin(&self.frame);
        let (keys, stats) = self.pairs.parts_mut();
        stats.method = name;
        stats.n_threads = 1;
        let gpu = Arc::clone(self.engine.gpu());
        stats.backend.push_str(gpu.name());
        gpu.block_on(
            self.engine
                .run(scene, &self.frame, &Control::new(), keys, stats),
        )?;
        stats.time("collect", |_| {
            keys.sort_unstable();
            keys.dedup();
        });
        stats.total_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok((&self.pairs, &self.engine.complete))
    }
}
