//! Which parts of bodies take part, and whether their positions are fit for it.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::query::{Query, Scope};
use crate::scene::elements::{BodyKind, Part};
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{Number, PartIx};
use crate::scene::positions::{Positions, Real};
use crate::scene::{Filter, Scene};
use crate::workers::Workers;
use crate::workers::alone::is_alone;

use super::{Plan, QueryPart};

/// Vertices whose positions a task checks: half a megabyte.
const CHECKED_BY_A_TASK: usize = 1 << 15;

/// Whether the positions of a task are finite.
fn are_finite(positions: &Positions, task: usize) -> bool {
    let first = task * CHECKED_BY_A_TASK;
    let vertices = first..positions.len().min(first + CHECKED_BY_A_TASK);
    match positions {
        Positions::F32(positions) => Real::all_finite(positions[vertices].as_flattened()),
        Positions::F64(positions) => Real::all_finite(positions[vertices].as_flattened()),
    }
}

impl Plan {
    pub(super) fn push_part(
        &mut self,
        scene: &Scene,
        query: &Query,
        part: Part,
    ) -> Result<(), Error> {
        match query.scope {
            Scope::Between(a, b) => {
                self.between = true;
                for id in [a.min(b), a.max(b)] {
                    self.push(scene, id, part, false, Some(Filter::default()))?;
                }
            }
            Scope::SelfOf(body) => {
                self.between = false;
                self.push(scene, body, part, true, None)?;
            }
            Scope::Across { within } => {
                self.between = true;
                for (id, _) in scene.bodies() {
                    let is_named = query.across.contains(&id);
                    let (category, mask) = match is_named {
                        true => (1, 2),
                        false => (2, 1),
                    };
                    let filter = Filter { category, mask };
                    self.push(scene, id, part, within && is_named, Some(filter))?;
                }
            }
            Scope::All { between, within } => {
                self.between = between;
                for (id, _) in scene.bodies() {
                    self.push(scene, id, part, within, None)?;
                }
            }
        }
        Ok(())
    }

    /// Refuses positions that were not checked when they were given and are not finite. All threads
    /// read those of a large body.
    pub fn check(&self, scene: &Scene, workers: &Workers) -> Result<(), Error> {
        self.part_ixs().try_for_each(|part| {
            let body = self.body(scene, part);
            let n_tasks = body.n_vertices().div_ceil(CHECKED_BY_A_TASK);
            if !is_alone() && !body.is_checked() && n_tasks > 1 && workers.n() > 1 {
                let is_bad = AtomicBool::new(false);
                workers.for_each(&mut vec![(); workers.n()], n_tasks, |(), task| {
                    if !are_finite(body.positions(), task) {
                        is_bad.store(true, Ordering::Relaxed);
                    }
                });
                if !is_bad.into_inner() {
                    body.set_checked();
                    return Ok(());
                }
            }
            // It names the first.
            self.check_one(scene, part)
        })
    }

    /// As [`check`](Plan::check), for one part.
    pub fn check_one(&self, scene: &Scene, part: PartIx) -> Result<(), Error> {
        let body = self.body(scene, part);
        body.check_once(self.part(part).id)
    }

    fn push(
        &mut self,
        scene: &Scene,
        id: BodyId,
        part: Part,
        within: bool,
        filter: Option<Filter>,
    ) -> Result<(), Error> {
        let body = scene.body(id)?;
        let elements = body.part(part);
        if part != Part::Given && elements.is_empty() {
            return Ok(());
        }
        let first = self.n_elements();
        let n = match part {
            Part::Vertices => body.n_vertices() as u64,
            _ => elements.len() as u64,
        };
        let limit = u64::from(u32::MAX);
        if first + n > limit {
            return Err(Error::TooMany {
                what: "elements in one query",
                given: first + n,
                limit,
            });
        }
        self.parts.push(QueryPart {
            id,
            part,
            first: Number::new(first as u32),
            n_elements: n as u32,
            kind: elements.kind(),
            numbers_stamp: body.numbers_stamp(part),
            positions_stamp: body.positions_stamp(),
            is_bare: body.kind() < BodyKind::Triangles,
            is_points: body.kind() == BodyKind::Points,
            within: within && !self.excluded.contains(&(id, id)),
            filter: filter.unwrap_or(body.filter()),
            thickness: 0.0,
            rounded: 0.0,
        });
        Ok(())
    }
}
