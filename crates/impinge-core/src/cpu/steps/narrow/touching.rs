//! Which elements touch during a step, and when first.
//!
//! In: candidates. Out: keys and times. Vertices with faces and edges with edges go through filters
//! (`impinge_exact::filter`):
//!
//! ```text
//! far     sixteen pairs at a time in f32, from the tables of the two groups: apart along a few
//!         directions
//! across  those that are left, put side by side: apart along their normals, or never in one plane
//! aside   those that are left: one element always stays beside the other
//!         (if positions are f64: with a margin for their rounding in the tables)
//! search  those that are left, a thousand at a time
//! ```
//!
//! Unsure pairs go to exact arithmetic, and so do pairs of bare edges and points, and all times in
//! double precision.

use crate::bvh::bounds::round_up;
use crate::cpu::lane_pairs::LanePairs;
#[cfg(feature = "gpu")]
use crate::query::goal::Goal;
use crate::query::pair_kind::PairKind;
#[cfg(feature = "gpu")]
use crate::scene::positions::Positions;
use crate::search::found::StepAnswer;
use crate::simd::{Isa, Simd, with_isa};
use impinge_exact::ElementPair;
use impinge_exact::internal::filter::{self, BATCH, Moving64, Search};

use super::super::world::StepWorld;
#[cfg(feature = "gpu")]
use super::batch::Slots;
use super::batch::{Batch, Between, Narrow, NarrowCounts, counts, exact_pair};
use super::contacts::{FirstContacts, Open};
use super::kept;
use super::search::search;

impl Narrow for FirstContacts {
    fn take(&mut self, isa: Isa, world: StepWorld<'_>, batch: Batch<'_>) {
        let between = batch.between;
        self.go_to(isa, world, between);
        let has_clearance = world.plan.has_clearance();
        let (most_kept, _) = world.plan.most_kept(between.a, between.b);
        if most_kept > 0.0 && !has_clearance {
            return self.take_kept(isa, world, batch);
        }
        if !matches!(between.kind, PairKind::VertexFace | PairKind::EdgeEdge) {
            if has_clearance {
                for ix in 0..batch.lane_pairs.len() {
                    self.decide_kept(world, between, batch.slots(ix));
                }
            } else if let Some(pair) = exact_pair(between.kind) {
                for ix in 0..batch.lane_pairs.len() {
                    self.remember_close(world, between, batch.slots(ix));
                    self.decide_exactly(world, between, pair, batch.slots(ix));
                }
            }
            return;
        }
        let until = self.until(world);
        let rounded = batch.rounded();
        if self.open.is_empty() {
            self.is_first = false;
        }
        // Where rounding is large beside the elements, the tables leave what the first step in
        // `f64` drops.
        self.is_first |= rounded > 0.0;
        if rounded.is_finite() {
            let tables = batch.groups.map(|group| &group.points);
            // With a clearance, an element that is moved by what a pair keeps may be in contact:
            // then coordinates of the polygon's corners, not of its edges, differ by up to that.
            let margin = self.margin(world, between) + most_kept + 2.0 * rounded;
            let (limits, lane_pairs) = ((round_up(until), margin), &mut *batch.lane_pairs);
            match between.kind {
                PairKind::VertexFace => with_isa!(isa, drop_vertices_and_faces, (
                    tables: [&Moving64; 2] = tables,
                    limits: (f32, f64) = limits,
                    lane_pairs: &mut LanePairs = lane_pairs,
                )),
                _ => with_isa!(isa, drop_edges, (
                    tables: [&Moving64; 2] = tables,
                    limits: (f32, f64) = limits,
                    lane_pairs: &mut LanePairs = lane_pairs,
                )),
            }
        }
        if has_clearance {
            return self.take_kept(isa, world, batch);
        }
        let filters_early = world.plan.filters_early();
        for ix in 0..batch.lane_pairs.len() {
            if filters_early && !counts(world, between, batch.slots(ix)) {
                continue;
            }
            self.open.push(Open {
                slots: batch.slots(ix),
                search: Search::new(until),
            });
        }
        self.decide_if_full(isa, world);
    }

    /// Searches the open pairs for first contacts.
    #[inline(never)]
    fn decide(&mut self, isa: Isa, world: StepWorld<'_>) {
        if self.open.is_empty() && self.single.is_empty() {
            return;
        }
        with_isa!(isa, search, (contacts: &mut FirstContacts = self, world: StepWorld<'_> = world));
        self.open.clear();
    }

    fn end(&mut self, answer: StepAnswer<'_>) {
        self.hand_over(answer);
    }

    fn counts(&self) -> NarrowCounts {
        self.counts
    }
}

impl FirstContacts {
    /// Turns to the pairs of two parts.
    #[inline(always)]
    fn go_to(&mut self, isa: Isa, world: StepWorld<'_>, between: Between) {
        if self.between != Some(between) {
            self.decide(isa, world);
            self.between = Some(between);
        }
    }

    /// Takes candidates that keep a distance.
    #[inline(always)]
    fn take_kept(&mut self, isa: Isa, world: StepWorld<'_>, batch: Batch<'_>) {
        with_isa!(isa, kept, (
            contacts: &mut FirstContacts = self,
            world: StepWorld<'_> = world,
            batch: Batch<'_> = batch,
        ));
        self.decide_if_full(isa, world);
    }

    #[inline(always)]
    fn decide_if_full(&mut self, isa: Isa, world: StepWorld<'_>) {
        if self.open.len() >= self.full {
            self.counts.n_full += u64::from(!self.open.is_empty());
            self.decide(isa, world);
        }
    }

    /// Takes pairs of two parts that a device has not dropped, by their places. Each comes with a
    /// time until which it certainly does not touch, and a later one by which it certainly does, at
    /// one time only, if there is one.
    #[cfg(feature = "gpu")]
    pub fn take_undecided(
        &mut self,
        isa: Isa,
        world: StepWorld<'_>,
        between: Between,
        pairs: impl Iterator<Item = (Slots, f64, Option<f64>)>,
    ) {
        self.go_to(isa, world, between);
        let (most_kept, _) = world.plan.most_kept(between.a, between.b);
        if most_kept > 0.0 {
            for (slots, free_until, _) in pairs {
                if world.known.is_cancelled() {
                    return;
                }
                if free_until <= self.until(world) {
                    self.decide_kept(world, between, slots);
                    self.decide_if_full(isa, world);
                }
            }
            return;
        }
        if !matches!(between.kind, PairKind::VertexFace | PairKind::EdgeEdge) {
            if let Some(pair) = exact_pair(between.kind) {
                pairs.for_each(|(slots, ..)| self.decide_exactly(world, between, pair, slots));
            }
            return;
        }
        let are_single = [between.a, between.b].iter().all(|&part| {
            let body = world.plan.body(world.scene, part);
            matches!(body.positions(), Positions::F32(_))
        });
        // Over the whole step, the device has taken the filter's first step for positions in single
        // precision.
        self.is_first = !are_single || matches!(self.goal, Goal::Earliest);
        for (slots, free_until, touches_by) in pairs {
            let until = self.until(world);
            // Meanwhile another pair was found to touch before.
            if free_until > until {
                continue;
            }
            let list = match touches_by {
                Some(_) => &mut self.single,
                None => &mut self.open,
            };
            let high = touches_by.unwrap_or(until);
            list.push(Open {
                slots,
                search: Search::within([free_until, high]),
            });
            if self.open.len() + self.single.len() >= self.full {
                self.decide(isa, world);
            }
        }
    }
}

// Kernels of their own: without optimisation, one for all of them would need more stack than a
// thread has.

#[inline(always)]
fn kept<S: Simd>(simd: S, contacts: &mut FirstContacts, world: StepWorld<'_>, batch: Batch<'_>) {
    kept::take(simd, contacts, world, batch);
}

#[inline(always)]
fn drop_vertices_and_faces<S: Simd>(
    simd: S,
    tables: [&Moving64; 2],
    limits: (f32, f64),
    lane_pairs: &mut LanePairs,
) {
    drop_apart(simd, ElementPair::VertexFace, tables, limits, lane_pairs);
}

#[inline(always)]
fn drop_edges<S: Simd>(
    simd: S,
    tables: [&Moving64; 2],
    limits: (f32, f64),
    lane_pairs: &mut LanePairs,
) {
    drop_apart(simd, ElementPair::EdgeEdge, tables, limits, lane_pairs);
}

/// Drops the candidates that are certainly apart from t = 0 to a time, by more than a margin: the
/// two limits.
#[inline(always)]
fn drop_apart<S: Simd>(
    simd: S,
    pair: ElementPair,
    tables: [&Moving64; 2],
    limits: (f32, f64),
    lane_pairs: &mut LanePairs,
) {
    let mut n_kept = 0;
    for first in (0..lane_pairs.len()).step_by(BATCH) {
        let no = filter::are_far_in_tables::<S::F32>(pair, tables, lane_pairs.batch(first), limits);
        n_kept = lane_pairs.keep_batch(simd, first, !no, n_kept);
    }
    lane_pairs.truncate(n_kept);
    let mut n_kept = 0;
    for first in (0..lane_pairs.len()).step_by(BATCH) {
        let no =
            filter::are_across_in_tables::<S::F32>(pair, tables, lane_pairs.batch(first), limits);
        n_kept = lane_pairs.keep_batch(simd, first, !no, n_kept);
    }
    lane_pairs.truncate(n_kept);
    let mut n_kept = 0;
    for first in (0..lane_pairs.len()).step_by(BATCH) {
        let no =
            filter::are_aside_in_tables::<S::F32>(pair, tables, lane_pairs.batch(first), limits);
        n_kept = lane_pairs.keep_batch(simd, first, !no, n_kept);
    }
    lane_pairs.truncate(n_kept);
}
