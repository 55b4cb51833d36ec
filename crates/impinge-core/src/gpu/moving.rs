//! Steps on the device: it drops pairs that certainly do not touch, and the host settles all others.
//!
//! ```text
//! layers -> bounds -> dispatch -> pairing -> narrow -> places of pairs -> host: first contacts
//! ```
//!
//! The stages are those of `Clusters`, with two boxes per node. So times of contact come from the CPU alone.

use std::sync::Arc;

use super::device::Scopes;
use super::engine::{Engine, Outcome, TakeLeft, Taker};
use super::world::{ResidentEnds, weigh_moving};
use crate::clock::Instant;
use crate::error::Error;
use crate::grouping::clusters::Clustering;
use crate::run::Job;
use crate::settings::{Method, Settings};
use crate::sink::Goal;
use crate::stats::Statistics;

impl Engine {
    /// The engine for steps, on the same device.
    pub fn for_steps(&mut self) -> &mut Engine {
        if self.of_steps.is_none() {
            let settings = Settings {
                method: Method::Clusters,
                ..self.settings.clone()
            };
            let gpu = Arc::clone(self.gpu());
            let mut engine = Engine::with_guest(gpu, settings, self.first, None);
            engine.most_bound = self.most_bound;
            engine.is_traced = self.is_traced;
            self.of_steps = Some(Box::new(engine));
        }
        self.of_steps.as_mut().expect("just made")
    }

    /// Hands over all pairs of a step that the device has not dropped, as far as they matter for what is sought. Returns false if the
    /// device, or the memory budget, cannot hold the step; then nothing has been handed over.
    ///
    /// # Errors
    /// Device errors, a budget too small for the smallest pass, cancellation, those of `take`.
    pub async fn find_left(
        &mut self,
        job: Job<'_>,
        clusterings: &[Arc<Clustering>],
        (sought, take): (Goal, &mut TakeLeft<'_>),
        stats: &mut Statistics,
    ) -> Result<bool, Error> {
        let result = self
            .answer_step(job, clusterings, (sought, take), stats)
            .await;
        if let Err(Error::Gpu { .. }) = result {
            self.begin_anew();
        }
        result
    }

    async fn answer_step(
        &mut self,
        job: Job<'_>,
        clusterings: &[Arc<Clustering>],
        (sought, take): (Goal, &mut TakeLeft<'_>),
        stats: &mut Statistics,
    ) -> Result<bool, Error> {
        self.gpu.check_lost()?;
        self.complete.clear();
        (self.sought, self.touches_by) = (sought, None);
        let start = Instant::now();
        let most = self.most();
        if !weigh_moving(job, clusterings).is_some_and(|weight| weight.fits(most)) {
            return Ok(false);
        }
        let scopes = Scopes::open(&self.gpu.device);
        let none = ResidentEnds::default();
        let world = &mut self.world;
        let updated = world.update_moving(&self.gpu, job, clusterings, &none, stats);
        let closed = scopes.close();
        updated?;
        closed.await?;
        if self.first_room(None).is_err() {
            // The buffers' spare room exceeds the budget.
            self.world.forget_buffers();
            self.world
                .update_moving(&self.gpu, job, clusterings, &none, stats)?;
        }
        stats.add_ms("upload", start.elapsed().as_secs_f64() * 1e3);
        let work = Vec::from_iter(self.whole(job.frame));
        let outcome = self.work_off(job, Taker::Left(take), work, stats);
        match outcome.await? {
            Outcome::Complete => {
                stats.bytes_held += self.world.bytes() + self.room.bytes();
                Ok(true)
            }
            Outcome::Crowded(error) => Err(error),
        }
    }
}
