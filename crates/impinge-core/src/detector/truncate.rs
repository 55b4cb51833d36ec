//! How far each vertex may go in a step, so that nothing touches on the way.
//!
//! ```text
//! candidates (keys)   pairs whose boxes over the step meet; no others can meet, however short each vertex stops
//! are they apart?     a pair stays apart if its vertices lie on either side of two planes, at the start and where they are now:
//!                     eight pairs at a time, across one direction after the other
//! else they stop      the vertices that go towards the other element, before planes between the two
//! again               for pairs of which a vertex was stopped since, until there are none
//! ```
//!
//! Where the vertices are now is always rounded as it is stored, so what is asked last is the
//! proof. In each round all pairs see the same positions, and of several shares of a way the least
//! counts: the order does not matter.

use std::sync::atomic::{AtomicU64, Ordering};

use super::Detector;
use super::advance::{moving, refuse_cell, refuse_seams};
use super::in_step::Keys;
use crate::answers::truncation::Truncation;
use crate::plan::{Plan, TestId};
use crate::query::Query;
use crate::query::pair_kind::PairKind;
use crate::query::step::Start;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Positions;
use crate::search::found::KeysByKind;
use crate::search::narrow::exact_kind;
use crate::search::runner::{Job, Outcome};
use crate::search::sink::{filled, reserve};
use crate::search::stats::Stats;
use crate::search::work::Work;
use crate::simd::{Isa, Simd, with_isa};
use crate::workers::clock::Instant;
use impinge_exact::internal::filter::{LANES, Points8};
use impinge_exact::internal::{Apart8, apart_by_lane, shares_apart};
use impinge_exact::{ElementPair, Point};

/// Pairs that a task looks at.
const TASK: usize = 1024;

impl Detector {
    /// How far each vertex may go on its way to its end position, so that nothing touches: each
    /// vertex stops for itself, where [`advance`](Detector::advance) stops all of them at one
    /// fraction of the step.
    ///
    /// The straight way from the start to the *rounded* positions is free in the sense of
    /// [`is_free`](Detector::is_free), if the start was free of intersections, and except for pairs
    /// that touch at the start. Elements that are to keep a [separation](Query::separation) or a
    /// [clearance](Query::clearance) do so at every moment.
    ///
    /// Elements that stay apart as they go the same way are not stopped. Where two come too near,
    /// the vertices that go towards the other element stop before planes across their shortest way
    /// at the start, or at the end: if only one of them comes nearer, it gets all of the room but a
    /// thousandth, and if both do, each gets a share of it, by how far it wants to go. So some
    /// vertices stop that might have passed; the next step takes them farther.
    ///
    /// The vertices of pairs that touch at the start, or are nearer than they are to keep, stay
    /// where they are, and [are counted](Truncation::n_touching); under [`Start::Skip`] they go as
    /// far as other pairs let them. The seams of a mesh that was not welded are refused by name.
    /// Found on the CPU.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Positions, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])?;
    /// let points = scene.add_points(&[[1.0f32, 1.0, 1.0], [9.0, 9.0, 1.0]])?;
    /// scene.set_end_positions(points, &[[1.0f32, 1.0, -1.0], [9.0, 9.0, -1.0]])?;
    /// let mut detector = Detector::new(Backend::Cpu)?;
    /// let truncation = detector.truncate(&scene, &Query::all())?;
    /// // The first point stops above the triangle, the second one passes it.
    /// let at = truncation.positions(points).expect("they move");
    /// assert!(at.point(0)[2] > 0.0 && at.point(0)[2] < 0.002);
    /// assert_eq!((at.point(1)[2], truncation.n_cut()), (-1.0, 1));
    /// truncation.apply(&mut scene)?;
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// As [`advance`](Detector::advance).
    ///
    /// # Sources
    /// Divide and Truncate (Chen et al., SIGGRAPH 2026) for planes that divide the room between
    /// elements. Their proof in floats, and for rounded positions, is ours.
    pub fn truncate(&mut self, scene: &Scene, query: &Query) -> Result<Truncation, Error> {
        refuse_cell(query)?;
        let plan = Plan::truncation(scene, query, self.settings.limits())?;
        let start = self.verify(scene, query)?.map(|start| start.intersects);
        let mut truncation = Truncation {
            start_intersects: start,
            ..Truncation::default()
        };
        if start == Some(true) {
            let stay = moving(scene).map(|(id, at, _)| (id, at.clone()));
            truncation.positions = stay.collect();
            return Ok(truncation);
        }
        let mut outcome = Truncated {
            truncation,
            keys: std::mem::take(&mut self.solver.keys),
            isa: Isa::detect(self.settings.instruction_set),
            stats: Stats::default(),
        };
        let found = self.find_keys(scene, &plan, Keys::All, &mut outcome);
        self.stats.clone_from(&outcome.stats);
        self.solver.keys = outcome.keys;
        found.map(|_| outcome.truncation)
    }
}

/// Candidates that become positions.
struct Truncated {
    truncation: Truncation,
    keys: KeysByKind,
    isa: Isa,
    stats: Stats,
}

impl Outcome<u64, { PairKind::ALL.len() }> for Truncated {
    fn begin(&mut self, _: &Plan) {
        self.stats.clear();
    }

    fn stats_mut(&mut self) -> &mut Stats {
        &mut self.stats
    }

    fn take_buffers(&mut self) -> KeysByKind {
        std::mem::take(&mut self.keys)
    }

    fn fill(&mut self, job: Job<'_>, keys: KeysByKind) -> Result<(), Error> {
        self.keys = keys;
        let start = Instant::now();
        let Job { scene, plan, .. } = job;
        let mut vertices = Vertices::new(job)?;
        let mut pairs = Pairs::new(job, self.isa, &self.keys);
        let truncation = &mut self.truncation;
        pairs.stop(&vertices)?;
        // All that touch at the start are known now.
        refuse_seams(scene, plan, pairs.touching())?;
        truncation.n_touching = pairs.touching().count() as u64;
        while vertices.go_back(scene) {
            truncation.n_rounds += 1;
            pairs.stop(&vertices)?;
        }
        truncation.n_cut = vertices.n_cut();
        truncation.positions = vertices.positions(scene);
        self.stats
            .add_ms("truncate", start.elapsed().as_secs_f64() * 1e3);
        Ok(())
    }

    fn bytes(&self) -> u64 {
        let keys: usize = self.keys.iter().map(Vec::capacity).sum();
        (size_of::<u64>() * keys) as u64
    }
}

/// How far each vertex of each body goes.
struct Vertices {
    /// Of each: the start, where it is now, rounded as it is stored, and the end.
    ways: Vec<[Point; 3]>,
    /// How far each was taken back since the first round: at least that.
    moved: Vec<f64>,
    all: Vec<Vertex>,
    /// The bits of the share of its way that each is to go at most: floats of at least 0 are in the
    /// order of their bits.
    most: Vec<AtomicU64>,
    /// The first vertex of the body of each part.
    firsts: Vec<usize>,
}

/// How far a vertex goes.
struct Vertex {
    /// The share of its way.
    share: f64,
    /// How often it was stopped.
    n_stops: u8,
}

/// A vertex that was stopped so often stays at its start: rounds end.
const MOST_STOPS: u8 = 60;

impl Vertices {
    /// All go to their ends.
    ///
    /// # Errors
    /// There is no memory for them.
    fn new(job: Job<'_>) -> Result<Self, Error> {
        let Job { scene, plan, .. } = job;
        let n = scene.bodies().map(|(_, body)| body.n_vertices()).sum();
        const WHAT: &str = "vertices";
        let moved = filled(0.0, n, WHAT)?;
        let (mut ways, mut all, mut most) = (Vec::new(), Vec::new(), Vec::new());
        reserve(&mut ways, n, WHAT)?;
        reserve(&mut all, n, WHAT)?;
        reserve(&mut most, n, WHAT)?;
        most.resize_with(n, || AtomicU64::new(WHOLE));
        all.resize_with(n, || Vertex {
            share: 1.0,
            n_stops: 0,
        });
        for (_, body) in scene.bodies() {
            let start = body.positions();
            let end = body.end_positions().unwrap_or(start);
            ways.extend((0..body.n_vertices()).map(|vertex| {
                let [start, end] = [start.point(vertex), end.point(vertex)];
                [start, end, end]
            }));
        }
        Ok(Vertices {
            ways,
            moved,
            all,
            most,
            firsts: plan.first_vertices(scene),
        })
    }

    /// Lets a vertex go at most a share of its way.
    fn stop(&self, vertex: usize, share: f64) {
        self.most[vertex].fetch_min(share.to_bits(), Ordering::Relaxed);
    }

    /// Takes the vertices back that were stopped. Returns whether there were any.
    fn go_back(&mut self, scene: &Scene) -> bool {
        let mut any = false;
        let now = self.ways.iter_mut().zip(&mut self.moved);
        let mut all = self.all.iter_mut().zip(&mut self.most).zip(now);
        for (_, body) in scene.bodies() {
            let start = body.positions();
            let end = body.end_positions().unwrap_or(start);
            let own = all.by_ref().take(body.n_vertices());
            for (ix, ((vertex, most), ([_, now, _], moved))) in own.enumerate() {
                let most = std::mem::replace(most.get_mut(), WHOLE);
                if most < WHOLE {
                    any = true;
                    let least = start.share_of_rounding(end, ix);
                    // Twice as much each time, and nothing in the end, whatever the numbers.
                    let back = least * f64::from(vertex.n_stops).exp2();
                    let share = f64::from_bits(most).min(vertex.share - back);
                    let is_last = vertex.n_stops >= MOST_STOPS;
                    vertex.share = if is_last { 0.0 } else { share.max(0.0) };
                    vertex.n_stops += 1;
                    let at = start.blend_point(end, ix, vertex.share);
                    let back: f64 = (0..3).map(|k| (at[k] - now[k]).abs()).sum();
                    *moved = (*moved + back * (1.0 + 8.0 * f64::EPSILON)).next_up();
                    *now = at;
                }
            }
        }
        any
    }

    fn n_cut(&self) -> u64 {
        self.all.iter().filter(|vertex| vertex.share < 1.0).count() as u64
    }

    /// The positions of all bodies that move.
    fn positions(&self, scene: &Scene) -> Vec<(BodyId, Positions)> {
        let mut rest = self.ways.iter().map(|&[_, now, _]| now);
        let mut positions = Vec::new();
        for (id, body) in scene.bodies() {
            let own = rest.by_ref().take(body.n_vertices());
            positions.push((
                id,
                match (body.positions(), body.end_positions()) {
                    (_, None) => {
                        own.for_each(drop);
                        continue;
                    }
                    (Positions::F32(_), Some(Positions::F32(_))) => {
                        // They were rounded.
                        Positions::from(own.map(|p| p.map(|x| x as f32)).collect::<Vec<_>>())
                    }
                    _ => Positions::from(own.collect::<Vec<_>>()),
                },
            ));
        }
        positions
    }
}

/// The bits of 1: all of a way.
const WHOLE: u64 = 1.0_f64.to_bits();

impl Vertices {
    /// The points of a pair at one of the times of [`ways`](Vertices::ways).
    fn points(&self, pair: &Pair, time: usize) -> [Point; 4] {
        pair.vertices.map(|vertex| self.ways[vertex as usize][time])
    }

    /// How far the vertices of a pair were taken back together, but for rounding.
    fn moved(&self, pair: &Pair) -> f64 {
        let [a, b, c, d] = pair.vertices.map(|vertex| self.moved[vertex as usize]);
        a + b + c + d
    }

    /// Whether any vertex of a pair is not at its start.
    fn any_moves(&self, pair: &Pair) -> bool {
        let mut all = pair.vertices.iter();
        all.any(|&vertex| {
            let [start, now, _] = &self.ways[vertex as usize];
            start != now
        })
    }
}

/// A pair that could meet.
struct Pair {
    key: u64,
    /// Its vertices among all, in the order of the exact test; the first again, where there are
    /// fewer.
    vertices: [u32; 4],
    /// How near its elements may come.
    kept: f64,
    /// It need not be looked at again before its vertices have been taken back so far together.
    until: f64,
}

/// It need not be looked at again at all.
const DONE: f64 = f64::INFINITY;

/// Some pairs of one kind that could meet.
struct PairsOfKind<'a> {
    kind: PairKind,
    pair: ElementPair,
    /// Those that were not looked at yet.
    keys: &'a [u64],
    /// Those that may have to be looked at again.
    pairs: Vec<Pair>,
    /// Those of which no vertex may move: they touch at the start.
    touching: Vec<u64>,
}

/// The pairs that could meet.
struct Pairs<'a> {
    job: Job<'a>,
    isa: Isa,
    /// By how much coordinates on the ways are rounded at most.
    rounded: f64,
    tasks: Vec<PairsOfKind<'a>>,
}

impl<'a> Pairs<'a> {
    fn new(job: Job<'a>, isa: Isa, keys: &'a KeysByKind) -> Self {
        let n_each = job.workers.task(TASK);
        let mut tasks = Vec::new();
        for (kind, keys) in PairKind::ALL.into_iter().zip(keys) {
            // Steps have vertices, edges and faces.
            let Some(pair) = exact_kind(TestId::Elements(kind)) else {
                continue;
            };
            tasks.extend(keys.chunks(n_each).map(|keys| PairsOfKind {
                kind,
                pair,
                keys,
                pairs: Vec::new(),
                touching: Vec::new(),
            }));
        }
        let rounded = job.scene.bodies().map(|(_, body)| {
            let end = body.end_positions();
            end.map_or(0.0, |end| body.positions().most_rounded(end))
        });
        Pairs {
            job,
            isa,
            rounded: rounded.fold(0.0, f64::max),
            tasks,
        }
    }

    /// Stops the vertices of all pairs that do not stay apart as they are now. Most need no second
    /// look: their vertices are not taken back far enough, or they stay apart however far.
    ///
    /// # Errors
    /// Cancellation; there is no memory.
    fn stop(&mut self, vertices: &Vertices) -> Result<(), Error> {
        let (job, isa, rounded) = (self.job, self.isa, self.rounded);
        let Job {
            workers, control, ..
        } = job;
        Work { workers, control }.each(&mut self.tasks, |_, task| {
            task.take_new(job, vertices)?;
            task.look((isa, rounded), vertices);
            task.stop(job.plan, vertices);
            task.pairs.retain(|pair| pair.until < DONE);
            Ok(())
        })
    }

    /// The pairs of which no vertex moves.
    fn touching(&self) -> impl Iterator<Item = (PairKind, u64)> {
        let tasks = self.tasks.iter();
        tasks.flat_map(|task| task.touching.iter().map(|&key| (task.kind, key)))
    }
}

impl PairsOfKind<'_> {
    /// The pairs that count and of which some vertex moves.
    ///
    /// # Errors
    /// There is no memory for them.
    fn take_new(&mut self, job: Job<'_>, vertices: &Vertices) -> Result<(), Error> {
        let Job { scene, plan, .. } = job;
        let keys = std::mem::take(&mut self.keys);
        reserve(&mut self.pairs, keys.len(), "pairs")?;
        for &key in keys {
            if !plan.counts(scene, key) {
                continue;
            }
            let mut located = plan.located(key);
            if self.pair == ElementPair::VertexEdge {
                // Such pairs are named edge first, but tested vertex first.
                located.reverse();
            }
            let mut numbers = [0; 4];
            let mut n = 0;
            for (part, element) in &located {
                let corners = plan
                    .body(scene, *part)
                    .corners(plan.part(*part).part, element);
                for &corner in corners {
                    // All numbers of parts are below 2^32, and vertices are a part.
                    numbers[n] = (vertices.firsts[part.index()] + corner as usize) as u32;
                    n += 1;
                }
            }
            let first = numbers[0];
            numbers[n..].fill(first);
            let mut pair = Pair {
                key,
                vertices: numbers,
                kept: plan.bound(),
                until: 0.0,
            };
            if !vertices.any_moves(&pair) {
                continue;
            }
            if plan.has_clearance() {
                let [start, end] = [0, 2].map(|time| vertices.points(&pair, time));
                let parts = [located[0].0, located[1].0];
                pair.kept = plan.kept(scene, parts, self.pair, [&start, &end]);
            }
            self.pairs.push(pair);
        }
        Ok(())
    }

    /// Says of each pair that stays apart until when it does so. What is left has an `until` below
    /// 0.
    fn look(&mut self, (isa, rounded): (Isa, f64), vertices: &Vertices) {
        const UNKNOWN: f64 = -1.0;
        let mut open: Vec<u32> = Vec::new();
        for (ix, pair) in self.pairs.iter_mut().enumerate() {
            // Rounded up as far as four numbers can be rounded down.
            if vertices.moved(pair) * (1.0 + 8.0 * f64::EPSILON) < pair.until {
                continue;
            }
            if vertices.any_moves(pair) {
                pair.until = UNKNOWN;
                open.push(ix as u32);
            } else {
                pair.until = DONE;
            }
        }
        let mut later = Vec::new();
        let mut times: [Points8; 3] = Default::default();
        // Where elements are far apart, a way between any two points does.
        for at in [None, Some(0), Some(2), Some(1)] {
            for eight in open.chunks(LANES) {
                let mut kept = [0.0; LANES];
                for (lane, &ix) in eight.iter().enumerate() {
                    let pair = &self.pairs[ix as usize];
                    kept[lane] = pair.kept;
                    put_points(vertices, pair, lane, &mut times, at == Some(2));
                }
                let apart = apart_across(isa, self.pair, &times, at, &kept, rounded);
                for (lane, &ix) in eight.iter().enumerate() {
                    let pair = &mut self.pairs[ix as usize];
                    let spare = apart.spare[lane];
                    if apart.always >> lane & 1 == 1 {
                        pair.until = DONE;
                    } else if spare > 0.0 {
                        let moved = vertices.moved(pair) * (1.0 - 8.0 * f64::EPSILON);
                        pair.until = (moved + spare).next_down();
                    } else {
                        later.push(ix);
                    }
                }
            }
            std::mem::swap(&mut open, &mut later);
            later.clear();
        }
    }

    /// Stops the vertices that go towards the other element, of pairs that do not stay apart.
    fn stop(&mut self, plan: &Plan, vertices: &Vertices) {
        for pair in &mut self.pairs {
            if pair.until >= 0.0 {
                continue;
            }
            let [start, now, end] = [0, 1, 2].map(|time| vertices.points(pair, time));
            let moving = (0..self.pair.n_points()).filter(|&ix| now[ix] != start[ix]);
            let Some(shares) = shares_apart(self.pair, [&start, &now, &end], pair.kept) else {
                pair.until = DONE;
                if plan.start == Start::Skip && plan.at_start(self.pair, &start).at_start {
                    continue;
                }
                moving.for_each(|ix| vertices.stop(pair.vertices[ix] as usize, 0.0));
                self.touching.push(pair.key);
                continue;
            };
            // Where no share is less, the planes are too close for that: each goes back a little.
            let is_any_less = shares.iter().any(|&share| share < 1.0);
            for ix in moving {
                let share = shares[ix];
                if share < 1.0 || !is_any_less {
                    let share = share.min(1.0 - f64::EPSILON);
                    vertices.stop(pair.vertices[ix] as usize, share);
                }
            }
            // It is looked at in the next round.
            pair.until = 0.0;
        }
    }
}

/// Writes the points of a pair into a lane: at the start and now, and on request at the end.
fn put_points(
    vertices: &Vertices,
    pair: &Pair,
    lane: usize,
    times: &mut [Points8; 3],
    with_end: bool,
) {
    let n_times = if with_end { 3 } else { 2 };
    for (k, &vertex) in pair.vertices.iter().enumerate() {
        let way = &vertices.ways[vertex as usize];
        for (Points8(points), point) in times.iter_mut().zip(way).take(n_times) {
            for (row, x) in points[k].iter_mut().zip(point) {
                row[lane] = *x;
            }
        }
    }
}

/// Whether eight pairs stay apart, across ways at one of some times.
fn apart_across(
    isa: Isa,
    pair: ElementPair,
    times: &[Points8; 3],
    at: Option<usize>,
    kept: &[f64; LANES],
    rounded: f64,
) -> Apart8 {
    let at = at.map(|time| &times[time]);
    with_isa!(isa, apart_in_registers, (
        pair: ElementPair = pair,
        times: &[Points8; 3] = times,
        at: Option<&Points8> = at,
        kept: &[f64; LANES] = kept,
        rounded: f64 = rounded,
    ) -> Apart8)
}

#[inline(always)]
fn apart_in_registers<S: Simd>(
    _: S,
    pair: ElementPair,
    [start, now, _]: &[Points8; 3],
    at: Option<&Points8>,
    kept: &[f64; LANES],
    rounded: f64,
) -> Apart8 {
    apart_by_lane::<S::F64>(pair, [start, now], at, kept, rounded)
}
