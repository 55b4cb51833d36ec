//! What kernels know of each part besides its elements: whom it meets, and how its pairs are
//! numbered.

use crate::plan::{Plan, QueryPart};
use crate::scene::elements::Part;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::PartIx;
use crate::scene::positions::Positions;
use crate::scene::{Filter, Scene};
use crate::search::runner::Job;

use super::layout::{
    BARE, BODY_SHIFT, Body, EDGES, FACES, NO_ROOT, NodePair, OWN_PARTS, POINTS, VERTICES,
};
use super::open::GpuContext;
use super::view::{Motion, SLACK, View};
use super::world::{DeviceWorld, ResidentEnds, sample};

impl DeviceWorld {
    /// Sends the records of all parts and the list of ignored pairs, if they differ from those on
    /// the device.
    ///
    /// # Errors
    /// More than the device can bind at once.
    pub(super) fn send_records(
        &mut self,
        gpu: &GpuContext,
        job: Job<'_>,
        motion: Motion,
        resident: &ResidentEnds<'_>,
    ) -> Result<(), Error> {
        let Job { scene, plan, .. } = job;
        let view = self.views[motion as usize].as_ref().expect("just sent");
        let mut records = self.unasked_records(scene, motion, resident);
        self.put_records(plan, (motion, view), &mut records);
        let ignored = self.ignored(plan, (motion, view));
        let parts = &self.parts;
        let sample = |part: u32| sample(scene, parts[part as usize].id);
        let view = self.views[motion as usize].as_mut().expect("just sent");
        if let Some(top) = &mut view.top
            && top.reorder(&mut self.trees.nodes, sample)
        {
            let gates = top.gates(&self.trees.nodes);
            self.nodes.write(gpu, u64::from(top.first_gate), gates);
            view.is_moved = true;
        }
        view.send(gpu, records, ignored)
    }

    /// The records of all parts as of those that do not take part: their boxes may be refitted too.
    fn unasked_records(
        &self,
        scene: &Scene,
        motion: Motion,
        resident: &ResidentEnds<'_>,
    ) -> Vec<Body> {
        let is_rounded = |id: BodyId| {
            let body = scene.body_in(id.slot());
            let of_ends = [Some(body.positions()), body.end_positions()];
            let mut ends = of_ends
                .into_iter()
                .zip(&resident.buffers)
                .take(motion.n_ends() as usize);
            ends.any(|(end, held)| {
                matches!(end, Some(Positions::F64(_))) && !held.contains_key(&id)
            })
        };
        let mut first_slot = 0;
        let mut records = Vec::with_capacity(self.parts.len());
        for part in &self.parts {
            records.push(Body {
                root: NO_ROOT,
                slack: if is_rounded(part.id) { SLACK } else { 0 },
                first_slot,
                ..Body::default()
            });
            // Slots fit 31 bits.
            first_slot += part.clustering.order.len() as u32;
        }
        records
    }

    /// Completes the records of the parts that take part.
    fn put_records(&self, plan: &Plan, (motion, view): (Motion, &View), records: &mut [Body]) {
        let meets_bodies = match motion {
            Motion::Still => plan.between(),
            Motion::Moving => plan.meets_bodies(),
        };
        for ((ix, query_part), &part) in plan.numbered_parts().zip(&view.parts) {
            // Bodies without a category meet no other body.
            let filter = match meets_bodies {
                true => plan.filter(ix),
                false => Filter {
                    category: 0,
                    mask: 0,
                },
            };
            let record = &mut records[part as usize];
            *record = Body {
                root: self.trees.roots[part as usize],
                within: u32::from(match motion {
                    Motion::Still => query_part.within,
                    Motion::Moving => plan.test(ix, ix).is_some(),
                }),
                part: match motion {
                    Motion::Still => 0,
                    Motion::Moving => {
                        let body = self.number(query_part.id).unwrap_or(0) as u32;
                        flags(query_part) | body << BODY_SHIFT
                    }
                },
                category: words(filter.category),
                mask: words(filter.mask),
                first_number: query_part.first.raw(),
                ..*record
            };
        }
    }

    /// The sorted list of ignored pairs: of parts in a frame, of bodies in a step.
    fn ignored(&self, plan: &Plan, (motion, view): (Motion, &View)) -> Vec<NodePair> {
        let number = |id: BodyId| self.number(id).map(|number| number as u32);
        let mut ignored: Vec<NodePair> = match motion {
            Motion::Still => {
                let part = |query_part: PartIx| view.parts[query_part.index()];
                let pairs = plan.excluded_pairs().map(|(a, b)| [part(a), part(b)]);
                let pair = |[a, b]: [u32; 2]| NodePair {
                    a: a.min(b),
                    b: a.max(b),
                };
                pairs.map(pair).collect()
            }
            Motion::Moving => {
                let pairs = plan.excluded_bodies();
                let pair = |(a, b)| {
                    Some(NodePair {
                        a: number(a)?,
                        b: number(b)?,
                    })
                };
                pairs.filter_map(pair).collect()
            }
        };
        ignored.sort_unstable_by_key(|pair| (pair.a, pair.b));
        ignored
    }
}

/// The low and the high word.
fn words(bits: u64) -> [u32; 2] {
    [bits as u32, (bits >> 32) as u32]
}

/// What `meets_parts.wgsl` needs to know of a query_part besides its body.
fn flags(query_part: &QueryPart) -> u32 {
    let part = match query_part.part {
        Part::Edges => EDGES,
        Part::Vertices => VERTICES,
        Part::Faces | Part::Given => FACES,
    };
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    part | flag(query_part.is_bare, BARE)
        | flag(query_part.is_points, POINTS)
        | flag(query_part.within, OWN_PARTS)
}
