//! Stage `bounds` of methods that work in a grid: the primitives that reach another body.
//!
//! In: positions. Out: where bodies may meet, the primitives that reach there, and their boxes; in the
//! order of bodies and, within one, of primitives. Cost: every vertex once for the boxes of bodies, every
//! primitive's corners once. Invariant: no pair that intersects has a primitive that is not kept.

use std::sync::Mutex;

use crate::frame::Frame;
use crate::grouping::bounds::Bounds;
use crate::grouping::grid::FineRange;

use super::bounds;
use super::dispatch::NodePair;
use super::simd::{Isa, Simd, dispatch};
use super::top_level::TopLevel;
use super::workers::Workers;
use super::world::World;

/// Primitives whose boxes a task finds.
const BOUNDS_TASK: usize = 4096;

/// A primitive that reaches the region.
#[derive(Debug, Clone, Copy)]
pub struct Kept {
    /// Its box.
    pub bounds: Bounds,
    /// The fine cells that it touches; the grid fills them in.
    pub range: FineRange,
    /// Whose it is.
    pub participant: u32,
    /// Its index within the body.
    pub primitive: u32,
}

/// A task of the bounds stage: a run of one participant's primitives.
#[derive(Debug, Clone, Copy)]
struct BoundsTask {
    participant: u32,
    first: u32,
    end: u32,
}

/// The kept primitives of a frame, and the memory for them.
pub struct KeptList {
    isa: Isa,
    bodies: Vec<Bounds>,
    /// For each participant, the box in which others may meet it.
    reach: Vec<Bounds>,
    top: TopLevel,
    stack: Vec<NodePair>,
    tasks: Vec<BoundsTask>,
    parts: Vec<Mutex<Vec<Kept>>>,
    /// The primitives.
    pub kept: Vec<Kept>,
}

impl KeptList {
    /// An empty one.
    pub fn new(isa: Isa) -> Self {
        KeptList {
            isa,
            bodies: Vec::new(),
            reach: Vec::new(),
            top: TopLevel::default(),
            stack: Vec::new(),
            tasks: Vec::new(),
            parts: Vec::new(),
            kept: Vec::new(),
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let parts: usize = self
            .parts
            .iter()
            .map(|part| part.lock().map_or(0, |part| part.capacity()))
            .sum();
        size_of::<Kept>() * (self.kept.capacity() + parts)
            + size_of::<Bounds>() * (self.bodies.capacity() + self.reach.capacity())
            + self.top.bytes()
    }

    /// Boxes of bodies, where they reach each other, and the primitives that do. `scratches` are one
    /// a worker and only counted.
    pub fn find<S: Send>(&mut self, world: World<'_>, workers: &Workers, scratches: &mut [S]) {
        let frame = world.frame;
        self.tasks.clear();
        for (ix, participant) in frame.participants.iter().enumerate() {
            let n = participant.n_primitives;
            self.tasks
                .extend((0..n).step_by(BOUNDS_TASK).map(|first| BoundsTask {
                    participant: ix as u32,
                    first,
                    end: n.min(first.saturating_add(BOUNDS_TASK as u32)),
                }));
        }
        self.parts
            .resize_with(self.tasks.len().max(self.parts.len()), Mutex::default);
        self.find_bodies(world);
        self.find_reach(world);
        let (tasks, parts, reach) = (&self.tasks, &self.parts, &self.reach);
        workers.for_each(scratches, tasks.len(), |_, task_ix| {
            let task = tasks[task_ix];
            let reach = &reach[task.participant as usize];
            let body = world.body(task.participant);
            let mut part = parts[task_ix].lock().expect("no task panics");
            part.clear();
            for primitive in task.first..task.end {
                let bounds = bounds::of_vertices(body.positions, body.corners(primitive));
                if bounds.overlaps(reach) {
                    part.push(Kept {
                        bounds,
                        range: FineRange {
                            lo: [0; 3],
                            hi: [0; 3],
                        },
                        participant: task.participant,
                        primitive,
                    });
                }
            }
        });
        self.kept.clear();
        let n_kept = self.parts[..self.tasks.len()]
            .iter_mut()
            .map(|part| part.get_mut().expect("no task panics").len())
            .sum();
        self.kept.reserve_exact(n_kept);
        for part in &mut self.parts[..self.tasks.len()] {
            self.kept
                .extend_from_slice(part.get_mut().expect("no task panics"));
        }
    }

    fn find_bodies(&mut self, world: World<'_>) {
        self.bodies.clear();
        for ix in 0..world.frame.participants.len() {
            let body = world.body(ix as u32);
            self.bodies.push(match body.participant.n_primitives {
                0 => Bounds::EMPTY,
                _ => bounds::of_all(body.positions),
            });
        }
    }

    /// Reason for the discard that follows: a pair's boxes share a point, which lies in both bodies'
    /// boxes, so each primitive meets the intersection of the two.
    fn find_reach(&mut self, world: World<'_>) {
        let frame = world.frame;
        let KeptList {
            isa,
            bodies,
            reach,
            top,
            stack,
            ..
        } = self;
        reach.clear();
        reach.extend(
            frame
                .participants
                .iter()
                .zip(&*bodies)
                .map(|(participant, bounds)| match participant.within {
                    true => *bounds,
                    false => Bounds::EMPTY,
                }),
        );
        if frame.between() {
            top.refit(bodies.len(), |ix| bodies[ix as usize]);
            let bodies = &bodies[..];
            dispatch!(*isa, reach_pairs, (
                top: &TopLevel = top,
                stack: &mut Vec<NodePair> = stack,
                frame: &Frame = frame,
                bodies: &[Bounds] = bodies,
                reach: &mut [Bounds] = reach,
            ));
        }
    }

    /// The box of all reaches; none when nothing reaches anything.
    pub fn region(&self) -> Option<Bounds> {
        let mut region = Bounds::EMPTY;
        for reach in &self.reach {
            region.join(reach);
        }
        (!self.kept.is_empty()).then_some(region)
    }
}

#[inline(always)]
fn reach_pairs<S: Simd>(
    simd: S,
    top: &TopLevel,
    stack: &mut Vec<NodePair>,
    frame: &Frame,
    bodies: &[Bounds],
    reach: &mut [Bounds],
) {
    let met = top.pairs(simd, stack, |a, b| {
        let (a, b) = (a as usize, b as usize);
        if frame.meets(a, b) {
            let both = bodies[a].intersection(&bodies[b]);
            reach[a].join(&both);
            reach[b].join(&both);
        }
        Ok::<(), std::convert::Infallible>(())
    });
    let Ok(()) = met;
}
