//! Near pairs again, from a list of those that were near with a margin: a Verlet list.
//!
//! ```text
//! listing   all stages, within distance + margin; candidates that may be so near are kept, as
//!           lanes of clusters
//! narrow    the listed ones alone, within the distance: as long as no vertex has moved farther
//!           than margin / 2
//! ```
//!
//! Reason: two points come nearer by at most what both move. So a pair that is within the distance
//! was within distance + margin when the list was made. In molecular dynamics the margin is called
//! skin (Verlet 1967, <https://doi.org/10.1103/PhysRev.159.98>).
//!
//! To make a list costs as much as an answer. After one that was of no use, the next is made when
//! vertices have moved little from one question to the next.

use std::ops::Range;
use std::sync::Arc;

use crate::bvh::clusters::Clustering;
use crate::cpu::lane_pairs::WorkItem;
use crate::plan::Plan;
use crate::query::progress::Pieces;
use crate::query::settings::Settings;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::{Positions, Real};
use crate::search::found::StepAnswer;
use crate::search::runner::Job;
use crate::search::sink::Ending;
use crate::search::stats::Stats;
use crate::simd::{Simd, with_isa};

use super::cache::StepCaches;
use super::narrow::Listing;
use super::pairing::{self, StepWorker};
use super::world::{SharedBound, StepWorld};
use super::{BatchStages, StepClusters};

/// Candidates per task, at least, unless it is the last.
const TASK: usize = 2048;

/// The pairs of one question within its distance and a margin.
#[derive(Debug, Default)]
pub(crate) struct VerletList {
    state: ListState,
    /// Of each body that takes part, when the list was made; or at the last question.
    positions: Vec<(BodyId, Positions)>,
    /// Of each part: lanes are those of these.
    clusterings: Vec<Arc<Clustering>>,
    /// By worker.
    listings: Vec<Listing>,
    tasks: Vec<ListedItems>,
}

#[derive(Debug, Default)]
enum ListState {
    /// Nothing was asked.
    #[default]
    New,
    /// Pairs are listed, and no later question was answered from them.
    Unused,
    /// Pairs are listed, and one was.
    Used,
    /// Only positions are known.
    Unlisted,
}

/// Some listed work items.
#[derive(Debug)]
struct ListedItems {
    listing: usize,
    items: Range<usize>,
    lanes: Range<usize>,
}

impl VerletList {
    /// Whether no vertex has moved farther than half of the margin.
    fn is_near(&self, scene: &Scene, margin: f64) -> bool {
        self.positions.iter().all(|(body, then)| {
            let now = scene.body_in(body.slot()).positions();
            have_moved_at_most(margin / 2.0, then, now)
        })
    }

    /// Whether pairs are listed, by clusters as they are.
    fn is_of(&self, plan: &Plan, caches: &StepCaches) -> bool {
        let is_of =
            |(part, own): (_, &Arc<Clustering>)| Arc::ptr_eq(&caches.at(part).clustering, own);
        matches!(self.state, ListState::Unused | ListState::Used)
            && self.clusterings.len() == plan.parts.len()
            && plan.parts.iter().zip(&self.clusterings).all(is_of)
    }

    /// Remembers where the bodies that take part are.
    fn place(&mut self, scene: &Scene, plan: &Plan) {
        self.positions.clear();
        for part in &plan.parts {
            if self.positions.iter().all(|(body, _)| *body != part.id) {
                // An owner may write where shared rows are.
                let copy = match scene.body_in(part.id.slot()).positions() {
                    Positions::F32(rows) => f32::store(rows),
                    Positions::F64(rows) => f64::store(rows),
                };
                self.positions.push((part.id, copy));
            }
        }
    }

    /// Takes what the workers have listed.
    fn fill(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        caches: &StepCaches,
        workers: &mut [StepWorker],
    ) {
        self.clusterings.clear();
        let clusterings = plan.parts.iter().map(|part| &caches.at(part).clustering);
        self.clusterings.extend(clusterings.cloned());
        self.place(scene, plan);
        self.state = ListState::Unused;
        self.listings.resize_with(workers.len(), Listing::default);
        self.tasks.clear();
        for (ix, (worker, listing)) in workers.iter_mut().zip(&mut self.listings).enumerate() {
            std::mem::swap(worker.listing(), listing);
            let mut task = ListedItems {
                listing: ix,
                items: 0..0,
                lanes: 0..0,
            };
            for &(_, n) in &listing.items {
                task.items.end += 1;
                task.lanes.end += n as usize;
                if task.lanes.len() >= TASK {
                    let next = ListedItems {
                        listing: ix,
                        items: task.items.end..task.items.end,
                        lanes: task.lanes.end..task.lanes.end,
                    };
                    self.tasks.push(std::mem::replace(&mut task, next));
                }
            }
            if !task.items.is_empty() {
                self.tasks.push(task);
            }
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let positions: usize = self.positions.iter().map(|(_, own)| own.bytes()).sum();
        let listings: usize = self.listings.iter().map(Listing::bytes).sum();
        positions + listings + size_of::<ListedItems>() * self.tasks.capacity()
    }
}

/// Whether certainly no vertex is farther than some length from where it was.
fn have_moved_at_most(length: f64, then: &Positions, now: &Positions) -> bool {
    /// The largest squared way, after few roundings.
    fn most<R: Real>(then: &[[R; 3]], now: &[[R; 3]]) -> f64 {
        then.iter().zip(now).fold(0.0, |most, (x, y)| {
            let [dx, dy, dz] = std::array::from_fn(|axis| y[axis].widen() - x[axis].widen());
            f64::max(most, dx * dx + dy * dy + dz * dz)
        })
    }
    let most = match (then, now) {
        (Positions::F32(then), Positions::F32(now)) if then.len() == now.len() => most(then, now),
        (Positions::F64(then), Positions::F64(now)) if then.len() == now.len() => most(then, now),
        _ => return false,
    };
    // Squares of shorter lengths may be lost.
    length >= 2f64.powi(-500) && most * (1.0 + 2f64.powi(-40)) <= length * length
}

impl StepClusters {
    /// As [`run`](Self::run), for near pairs: by a list, which is made anew if it does not hold and
    /// may be of use. Other lists hold some bytes, too.
    pub fn run_listed(
        &mut self,
        job: Job<'_>,
        settings: &Settings,
        answer: StepAnswer<'_>,
        (list, held_by_others): (&mut VerletList, usize),
        stats: &mut Stats,
    ) -> Result<(), Error> {
        let Job { scene, plan, .. } = job;
        let margin = settings.reuse_margin;
        let is_near = list.is_near(scene, margin);
        if !is_near && matches!(list.state, ListState::Unused | ListState::Unlisted) {
            *list = VerletList {
                state: ListState::Unlisted,
                ..VerletList::default()
            };
            list.place(scene, plan);
            self.run(job, settings, answer, None, stats)?;
            stats.bytes_held += (list.bytes() + held_by_others) as u64;
            return Ok(());
        }
        let wide = plan.within_farther(margin);
        let wider = Job { plan: &wide, ..job };
        self.prepare(wider, settings, stats)?;
        if is_near && list.is_of(plan, &self.caches) {
            list.state = ListState::Used;
        } else {
            // A list that fails holds nothing.
            *list = VerletList::default();
            stats.ways.n_listed += 1;
            let listed = StepAnswer::Listed { margin };
            self.search(wider, settings, listed, None, stats)?;
            if self
                .scratches
                .iter_mut()
                .any(|worker| worker.listing().is_cut)
            {
                self.run(job, settings, answer, None, stats)?;
                stats.bytes_held += held_by_others as u64;
                return Ok(());
            }
            list.fill(scene, plan, &self.caches, &mut self.scratches);
        }
        let held = (self.bytes_besides_scratch() + list.bytes() + held_by_others) as u64;
        answer.share(held);
        answer.check()?;
        for worker in &mut self.scratches {
            worker.begin(stats.n_clusters, plan, settings);
        }
        let known = SharedBound::new(job.control);
        let world = StepWorld::new(self.isa, job, answer, &known, &self.caches);
        let scratches = &mut self.scratches;
        stats.time("narrow", |stats| {
            decide(job, world, list, scratches)?;
            for worker in &mut *scratches {
                StepWorld::counts(worker).add_to(stats);
                worker.end(answer);
            }
            answer.check()
        })?;
        stats.bytes_held = held + self.scratch.bytes() as u64;
        Ok(())
    }
}

/// Decides all listed candidates; the last answers stay with the workers.
fn decide(
    job: Job<'_>,
    world: StepWorld<'_>,
    list: &VerletList,
    workers: &mut [StepWorker],
) -> Result<(), Error> {
    let VerletList {
        listings, tasks, ..
    } = list;
    let pieces = Pieces::new(job.control, tasks.len());
    job.workers.for_each(workers, tasks.len(), |worker, ix| {
        if world.answer.is_over() || pieces.take().is_err() {
            return;
        }
        let task = &tasks[ix];
        let listing = &listings[task.listing];
        with_isa!(world.isa, decide_items, (
            world: StepWorld<'_> = world,
            items: &[(WorkItem, u32)] = &listing.items[task.items.clone()],
            lanes: &[[u8; 2]] = &listing.lanes[task.lanes.clone()],
            worker: &mut StepWorker = worker,
        ));
    });
    pieces.end()
}

#[inline(always)]
fn decide_items<S: Simd>(
    simd: S,
    world: StepWorld<'_>,
    items: &[(WorkItem, u32)],
    mut lanes: &[[u8; 2]],
    worker: &mut StepWorker,
) {
    for &(item, n) in items {
        if world.known.is_cancelled() {
            break;
        }
        let (own, rest) = lanes.split_at(n as usize);
        lanes = rest;
        pairing::decide_listed(simd, world, &item, own, worker);
    }
}
