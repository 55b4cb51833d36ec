//! Stage `bounds` of methods that work in a grid: the elements that reach another body.
//!
//! In: positions. Out: where bodies may meet, and the elements that reach there with their boxes,
//! ordered by body and element. Cost: every vertex once for the boxes of bodies, every
//! element's corners once. Invariant: no pair that intersects has an element that is not kept.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::boxes;
use crate::bvh::bounds::Aabb;
use crate::bvh::grid::FineRange;
use crate::plan::Plan;
use crate::scene::index::{ElementIx, PartIx, Slot};
use crate::scene::words::debug_by_name;

use super::cull::{BoundsTask, Cull};
use super::top_level::TopLevel;
use super::traversal::NodePair;
use super::world::{BodyRef, World};
use crate::simd::{Isa, Simd, with_isa};
use crate::workers::Workers;
use crate::workers::tuning::{Tuning, Ways};

/// Elements per task.
const ELEMENTS: usize = 4096;
/// Vertices per task.
const VERTICES: usize = 1 << 15;

/// An element that reaches the region.
#[derive(Debug, Clone, Copy)]
pub struct InRegion {
    /// Its box.
    pub bounds: Aabb,
    /// The fine cells that it touches; the grid fills them in.
    pub range: FineRange,
    /// Its part.
    pub part: PartIx,
    /// Its index within the body.
    pub element: ElementIx,
}

impl InRegion {
    /// Its slot, where there are no clusters.
    #[inline(always)]
    pub fn slot(&self) -> Slot {
        unclustered(self.element)
    }

    /// An element, if its box meets `reach`.
    #[inline(always)]
    fn reaching(
        body: &BodyRef<'_>,
        part: PartIx,
        element: ElementIx,
        reach: &Aabb,
    ) -> Option<InRegion> {
        let bounds = boxes::of_vertices(body.positions, body.corners(unclustered(element)));
        bounds.overlaps(reach).then_some(InRegion {
            bounds,
            range: FineRange {
                lo: [0; 3],
                hi: [0; 3],
            },
            part,
            element,
        })
    }
}

/// The slot of an element, where there are no clusters.
#[inline(always)]
fn unclustered(element: ElementIx) -> Slot {
    Slot::new(element.raw())
}

debug_by_name!(KeptList => "KeptList");

/// The kept elements of a frame, and the memory for them.
pub struct KeptList {
    isa: Isa,
    tuning: Tuning,
    bodies: Vec<Aabb>,
    /// For each part, the box in which others may meet it.
    reach: Vec<Aabb>,
    top: TopLevel,
    stack: Vec<NodePair>,
    /// Runs of elements.
    runs: Vec<BoundsTask>,
    /// The kept elements of each run.
    parts: Vec<Mutex<Vec<InRegion>>>,
    /// Runs of vertices, with their boxes.
    vertices: Vec<(BoundsTask, Mutex<Aabb>)>,
    cull: Cull,
    /// The bodies in the map; 0 if none was made.
    n_mapped: u64,
    /// The kept elements.
    pub kept: Vec<InRegion>,
}

impl KeptList {
    /// An empty list.
    pub fn new(isa: Isa, tuning: Tuning) -> Self {
        KeptList {
            isa,
            tuning,
            bodies: Vec::new(),
            reach: Vec::new(),
            top: TopLevel::default(),
            stack: Vec::new(),
            runs: Vec::new(),
            parts: Vec::new(),
            vertices: Vec::new(),
            cull: Cull::default(),
            n_mapped: 0,
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
        size_of::<InRegion>() * (self.kept.capacity() + parts)
            + size_of::<Aabb>() * (self.bodies.capacity() + self.reach.capacity())
            + self.top.bytes()
            + size_of::<(BoundsTask, Mutex<Aabb>)>() * self.vertices.capacity()
            + self.cull.bytes()
    }

    /// The scratches of as many workers as are worth waking.
    fn few<'a, S>(&self, world: World<'_>, scratches: &'a mut [S]) -> &'a mut [S] {
        let n = match world.plan.n_elements() < self.tuning.cull_parallel_from {
            true => 1,
            false => scratches.len(),
        };
        &mut scratches[..n]
    }

    /// Says which ways the frame went.
    pub(super) fn report(&self, ways: &mut Ways) {
        ways.n_mapped = self.n_mapped;
        if self.n_mapped > 0 {
            ways.n_everywhere = self.cull.n_everywhere();
        }
    }

    /// Finds the boxes of bodies, where bodies reach each other, and the elements that reach
    /// there. `scratches` has one entry per worker; only their number matters.
    pub fn find<S: Send>(&mut self, world: World<'_>, workers: &Workers, scratches: &mut [S]) {
        let scratches = self.few(world, scratches);
        self.begin(world, workers, scratches);
        let (runs, parts, reach) = (&self.runs, &self.parts, &self.reach);
        workers.for_each(scratches, runs.len(), |_, ix| {
            let run = runs[ix];
            let body = world.body(run.part);
            let reach = &reach[run.part.index()];
            let mut part = parts[ix].lock().expect("no task panics");
            part.clear();
            for element in (run.first..run.end).map(ElementIx::new) {
                part.extend(InRegion::reaching(&body, run.part, element, reach));
            }
        });
        self.gather();
    }

    /// [`find`](KeptList::find), without the elements that no other body comes near.
    /// Returns how many elements were near where bodies meet.
    pub fn find_sharing<S: Send>(
        &mut self,
        world: World<'_>,
        workers: &Workers,
        scratches: &mut [S],
    ) -> usize {
        let scratches = self.few(world, scratches);
        // Bodies queried for self-collision keep every element, and with many bodies the map
        // rejects almost nothing; skip it in both cases.
        let parts = &world.plan.parts;
        if !world.plan.between()
            || parts.len() > self.tuning.most_maps.min(Cull::MOST_MAPS)
            || parts.iter().all(|part| part.within)
        {
            self.find(world, workers, scratches);
            return self.kept.len();
        }
        self.begin(world, workers, scratches);
        self.kept.clear();
        let Some(region) = self.joined_reach() else {
            return 0;
        };
        self.cull
            .begin(world, &region, self.runs.len(), &self.tuning);
        self.n_mapped = world.plan.parts.len() as u64;
        let isa = self.isa;
        let codes = self.cull.codes();
        let (cull, vertices) = (&self.cull, &self.vertices);
        workers.for_each(scratches, vertices.len(), |_, ix| {
            let run = vertices[ix].0;
            let range = run.first as usize..run.end as usize;
            let positions = world.body(run.part).positions;
            // SAFETY: runs do not overlap, and codes are read only after all are written.
            unsafe { codes.put(isa, positions, range, cull.first_code(run.part)) };
        });
        let (runs, parts, reach) = (&self.runs, &self.parts, &self.reach);
        workers.for_each(scratches, runs.len(), |_, ix| {
            let run = runs[ix];
            cull.mark(world, run, ix, &reach[run.part.index()]);
        });
        self.cull.compare();
        let cull = &self.cull;
        let n_near = AtomicUsize::new(0);
        workers.for_each(scratches, runs.len(), |_, ix| {
            let run = runs[ix];
            let body = world.body(run.part);
            let reach = &reach[run.part.index()];
            let mut part = parts[ix].lock().expect("no task panics");
            part.clear();
            let n = cull.for_live(ix, |element| {
                part.extend(InRegion::reaching(&body, run.part, element, reach));
            });
            n_near.fetch_add(n, Ordering::Relaxed);
        });
        self.gather();
        n_near.into_inner()
    }

    /// Makes the tasks, and finds the boxes of bodies and where they reach each other.
    fn begin<S: Send>(&mut self, world: World<'_>, workers: &Workers, scratches: &mut [S]) {
        self.n_mapped = 0;
        let n_elements = workers.task(ELEMENTS) as u32;
        let n_vertices_each = workers.task(VERTICES) as u32;
        self.runs.clear();
        self.vertices.clear();
        for (ix, part) in world.plan.numbered_parts() {
            let n_vertices = match part.n_elements {
                0 => 0,
                _ => world.body(ix).positions.len() as u32,
            };
            self.runs
                .extend(BoundsTask::cut(ix, part.n_elements, n_elements));
            self.vertices.extend(
                BoundsTask::cut(ix, n_vertices, n_vertices_each)
                    .map(|run| (run, Mutex::new(Aabb::EMPTY))),
            );
        }
        self.parts
            .resize_with(self.runs.len().max(self.parts.len()), Mutex::default);
        let vertices = &self.vertices;
        workers.for_each(scratches, vertices.len(), |_, ix| {
            let (run, bounds) = &vertices[ix];
            let positions = world.body(run.part).positions;
            let range = run.first as usize..run.end as usize;
            *bounds.lock().expect("no task panics") = boxes::of_run(positions, range);
        });
        self.bodies.clear();
        self.bodies.resize(world.plan.parts.len(), Aabb::EMPTY);
        for (run, bounds) in &mut self.vertices {
            let bounds = bounds.get_mut().expect("no task panics");
            self.bodies[run.part.index()].join(bounds);
        }
        self.find_reach(world);
    }

    /// Concatenates the kept elements of all runs.
    fn gather(&mut self) {
        let parts = &mut self.parts[..self.runs.len()];
        self.kept.clear();
        let n_kept = parts
            .iter_mut()
            .map(|part| part.get_mut().expect("no task panics").len())
            .sum();
        self.kept.reserve_exact(n_kept);
        for part in parts {
            self.kept
                .extend_from_slice(part.get_mut().expect("no task panics"));
        }
    }

    /// Finds the box in which each part may meet others. Reason for the discard that follows: the
    /// boxes of a pair share a point. It lies in both bodies' boxes, so each element meets the
    /// intersection of the two.
    fn find_reach(&mut self, world: World<'_>) {
        let plan = world.plan;
        let KeptList {
            isa,
            tuning,
            bodies,
            reach,
            top,
            stack,
            ..
        } = self;
        reach.clear();
        reach.extend(
            plan.parts
                .iter()
                .zip(&*bodies)
                .map(|(part, bounds)| match part.within {
                    true => *bounds,
                    false => Aabb::EMPTY,
                }),
        );
        if plan.between() {
            top.refit(bodies.len(), tuning, |part| bodies[part.index()]);
            let bodies = &bodies[..];
            with_isa!(*isa, reach_pairs, (
                top: &TopLevel = top,
                stack: &mut Vec<NodePair> = stack,
                plan: &Plan = plan,
                bodies: &[Aabb] = bodies,
                reach: &mut [Aabb] = reach,
            ));
        }
    }

    /// The box of all reaches; `None` if no elements were kept.
    pub fn region(&self) -> Option<Aabb> {
        self.joined_reach().filter(|_| !self.kept.is_empty())
    }

    fn joined_reach(&self) -> Option<Aabb> {
        let mut region = Aabb::EMPTY;
        for reach in &self.reach {
            region.join(reach);
        }
        (region != Aabb::EMPTY).then_some(region)
    }
}

#[inline(always)]
fn reach_pairs<S: Simd>(
    simd: S,
    top: &TopLevel,
    stack: &mut Vec<NodePair>,
    plan: &Plan,
    bodies: &[Aabb],
    reach: &mut [Aabb],
) {
    let lane_pairs = top.pairs(simd, stack, |a, b| {
        if plan.test(a, b).is_some() {
            let (a, b) = (a.index(), b.index());
            let both = bodies[a].intersection(&bodies[b]);
            reach[a].join(&both);
            reach[b].join(&both);
        }
        Ok::<(), std::convert::Infallible>(())
    });
    let Ok(()) = lane_pairs;
}
