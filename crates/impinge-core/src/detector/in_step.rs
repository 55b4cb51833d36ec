//! Finds pairs of vertices, edges and faces, for every question about them.

use std::sync::Arc;

use crate::answers::near::Labels;
use crate::cpu::steps::{ByDevice, StepClusters, VerletList};
#[cfg(feature = "gpu")]
use crate::gpu::Engine;
use crate::plan::{Question, TestId};
use crate::query::pair_kind::PairKind;
use crate::query::settings::{Method, Settings};
use crate::query::step::Start;
use crate::scene::error::Error;
use crate::search::found::{ContactAnswer, Found, KeyAnswer, PairList, StepAnswer};
use crate::search::key_ranges::{KeyRanges, Tally};
use crate::search::moved::Moved;
use crate::search::naive;
use crate::search::narrow::{BoxOverlap, FirstContact, Within};
use crate::search::runner::{Finder, Job};
use crate::search::shares::Shares;
use crate::search::sink::Ending;
use crate::search::stats::Stats;
use impinge_exact::Contact;

/// Which keys to find.
#[derive(Clone, Copy, Default)]
pub(super) enum Keys<'a> {
    #[default]
    All,
    /// Those of pairs that may lower some vertex's share, and perhaps others.
    Lowering(&'a Shares),
    /// Those in some ranges.
    In(&'a KeyRanges),
    /// They are counted and forgotten.
    Counted(&'a Tally),
    /// Of contacts that the CPU finds: all, or those of pairs with a vertex that has moved.
    Moved(Option<Moved<'a>>),
}

/// On the CPU, where for contacts a device may find candidates.
pub(super) struct InStep<'a> {
    pub clusters: &'a mut StepClusters,
    pub settings: &'a Settings,
    #[cfg(feature = "gpu")]
    pub gpu: &'a mut Option<Engine>,
    pub keys: Keys<'a>,
    /// Where near pairs are listed, if they are, and the bytes of other lists.
    pub list: Option<(&'a mut VerletList, usize)>,
    pub seen: Seen,
}

/// What was seen besides the contacts.
#[derive(Debug, Default)]
pub(super) struct Seen {
    /// Whether a device has found that something touches; then the list of contacts may be empty.
    pub touches: bool,
    /// The pairs that rounded positions may make touch, up to the earliest contact, by kind and
    /// key, if known.
    pub close: Option<PairList>,
}

impl InStep<'_> {
    fn find_contacts(
        &mut self,
        job: Job<'_>,
        answer: &ContactAnswer,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        if self.settings.method == Method::Naive {
            let skips = job.plan.start == Start::Skip;
            return run_naive(&FirstContact, job, stats, |kind, key, value: Contact| {
                if !(skips && value.at_start) {
                    answer.extend(kind as usize, [Found { key, value }].into_iter());
                }
                answer.check()
            });
        }
        let found = StepAnswer::Contacts(answer);
        if let Keys::Moved(moved) = self.keys {
            return self.clusters.run(job, self.settings, found, moved, stats);
        }
        match self.find_on_device(job, found, stats)? {
            ByDevice::Done => return Ok(()),
            ByDevice::Touches => self.seen.touches = true,
            ByDevice::Not => {
                answer.forget();
                self.clusters.run(job, self.settings, found, None, stats)?;
                if job.plan.is_rounded() {
                    self.seen.close = self.clusters.close();
                }
            }
        }
        Ok(())
    }

    #[cfg(feature = "gpu")]
    fn find_on_device(
        &mut self,
        job: Job<'_>,
        answer: StepAnswer<'_>,
        stats: &mut Stats,
    ) -> Result<ByDevice, Error> {
        super::gpu::find_in_step(self.gpu, self.clusters, (job, self.settings), answer, stats)
    }

    #[cfg(not(feature = "gpu"))]
    #[expect(
        clippy::unused_self,
        clippy::unnecessary_wraps,
        reason = "there is no device"
    )]
    fn find_on_device(
        &mut self,
        _: Job<'_>,
        _: StepAnswer<'_>,
        _: &mut Stats,
    ) -> Result<ByDevice, Error> {
        Ok(ByDevice::Not)
    }

    fn find_keys(
        &mut self,
        job: Job<'_>,
        answer: &KeyAnswer,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let answer = match self.keys {
            Keys::All | Keys::Moved(_) => StepAnswer::Keys(answer),
            Keys::Lowering(shares) => StepAnswer::Lowering(answer, shares),
            Keys::In(ranges) => StepAnswer::KeysIn(answer, ranges),
            Keys::Counted(tally) => StepAnswer::Counts(tally),
        };
        if self.settings.method != Method::Naive {
            let Self {
                clusters, settings, ..
            } = self;
            return match &mut self.list {
                Some((list, held_by_others)) => {
                    let list = (&mut **list, *held_by_others);
                    clusters.run_listed(job, settings, answer, list, stats)
                }
                None => clusters.run(job, settings, answer, None, stats),
            };
        }
        let mut block = Vec::new();
        let mut emit = |kind, key| {
            block.push(key);
            answer.take_keys(kind, &mut block);
            answer.check()
        };
        if job.plan.question == Question::Overlap {
            return run_naive(&BoxOverlap, job, stats, |kind, key, ()| emit(kind, key));
        }
        let labels = Labels::new(job.plan.n_elements());
        run_naive(&Within, job, stats, |kind, key, ()| {
            emit(kind, labels.put(key, Labels::UNKNOWN))
        })
    }

    fn method_name(&self) -> &'static str {
        match self.settings.method {
            Method::Naive => Method::Naive,
            // The grid is for intersections.
            Method::Auto | Method::Clusters | Method::Cells => Method::Clusters,
        }
        .name()
    }
}

/// The oracle's pairs, as far as they count.
fn run_naive<T: crate::search::narrow::Test>(
    test: &T,
    job: Job<'_>,
    stats: &mut Stats,
    mut emit: impl FnMut(PairKind, u64, T::Value) -> Result<(), Error>,
) -> Result<(), Error> {
    let Job {
        scene,
        plan,
        control,
        ..
    } = job;
    stats.time("naive", |stats| {
        naive::run(
            test,
            scene,
            plan,
            control,
            stats,
            |id, key, value| match id {
                TestId::Elements(kind) if plan.counts(scene, key) => emit(kind, key, value),
                _ => Ok(()),
            },
        )
    })
}

impl Finder<Found<Contact>, { PairKind::ALL.len() }> for InStep<'_> {
    fn method(&self) -> &'static str {
        self.method_name()
    }

    async fn find(
        &mut self,
        job: Job<'_>,
        answer: &Arc<ContactAnswer>,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        self.find_contacts(job, answer, stats)
    }
}

impl Finder<u64, { PairKind::ALL.len() }> for InStep<'_> {
    fn method(&self) -> &'static str {
        self.method_name()
    }

    async fn find(
        &mut self,
        job: Job<'_>,
        answer: &Arc<KeyAnswer>,
        stats: &mut Stats,
    ) -> Result<(), Error> {
        self.find_keys(job, answer, stats)
    }
}
