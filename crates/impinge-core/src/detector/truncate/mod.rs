//! How far each vertex may go in a step, so that nothing touches on the way.
//!
//! ```text
//! contacts     pairs that touch on the ways to where the vertices are now: as for all impacts
//! they stop    the vertices that go towards the other element, before planes between the two
//! again        for pairs of which a vertex was stopped since, until none touches
//! at rest      after 255 rounds: planes that are good for any shares, for all that something
//!              still reaches (`at_rest`)
//! ```
//!
//! Where the vertices are now is always rounded as it is stored, so what is asked last is the
//! proof. In each round all pairs see the same positions, and of several shares of a way the least
//! counts: the order does not matter.

mod at_rest;

use std::sync::atomic::{AtomicU64, Ordering};

use super::Detector;
use super::advance::{moving, refuse_cell, refuse_seams, set_end_positions};
use crate::answers::reached::Reached;
use crate::answers::truncation::Truncation;
use crate::plan::{Plan, TestId};
use crate::query::Query;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::index::{ElementIx, PartIx};
use crate::scene::positions::Positions;
use crate::search::found::PairList;
use crate::search::moved::Moved;
use crate::search::narrow::exact_kind;
use crate::search::sink::{filled, grow, reserve};
use crate::search::stats::Stats;
use crate::search::work::Work;
use crate::workers::clock::Instant;
use impinge_exact::internal::{shares_apart, shares_without_room};
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
    /// that touch at the start. Elements that are to keep a [separation](Query::separation), their
    /// [thickness](Scene::set_thickness) or a [clearance](Query::clearance) do so at every moment.
    ///
    /// Elements that do not meet are not stopped. Where two do, the vertices that go towards the
    /// other element stop before planes across their shortest way at the start, or at the end: if
    /// only one of them comes nearer, it gets all of the room but a thousandth, and if both do,
    /// each gets a share of it, by how far it wants to go. Then pairs of which a vertex was stopped
    /// are looked at again, until none meets. So some vertices stop that might have passed; the
    /// next step takes them farther. Where each element stops the next one, as in a pile of rigid
    /// bodies, there is a round for each. After 255 rounds, those that may still meet, directly or
    /// through others, get planes that rest, for all of their pairs: that is the last round, and
    /// takes them no farther than to what was next to them at the start. A body whose end a
    /// [transform](Scene::set_end_transform) made stops as a whole: all of its vertices go the
    /// least share of their ways that one of them may go.
    ///
    /// The vertices of pairs that touch at the start, or are at most as far apart as they are to
    /// keep, stay where they are, and [are counted](Truncation::n_touching); under
    /// [`Start::Skip`](crate::Start::Skip) they go as far as other pairs let them. Whether a pair
    /// does is decided exactly. Where two elements are farther apart by less than floats can
    /// divide, only the vertices that go towards the other stay, or follow it if it goes away. The
    /// seams of a mesh that was not welded are refused by name. Found on the CPU.
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
        let begun = Instant::now();
        let plan_of = |scene: &Scene, limits| Plan::touching(scene, query, limits);
        let mut plan = plan_of(scene, self.limits_of_steps())?;
        self.check_step(scene, &plan)?;
        let start = self.verify(scene, query)?.map(|start| start.intersects);
        let mut truncation = Truncation {
            start_intersects: start,
            reached: Reached::from_start(scene),
            ..Truncation::default()
        };
        if start == Some(true) {
            let stay = moving(scene).map(|(id, at, _)| (id, at.clone()));
            truncation.reached.positions = stay.collect();
            truncation.n_cut = moving(scene).map(n_ways).sum();
            return Ok(truncation);
        }
        let mut vertices = Vertices::new(scene, &plan)?;
        let mut now = scene.clone();
        let mut stats = Stats::default();
        let mut most_pairs = 1 << 16;
        loop {
            let moved = Moved {
                firsts: &vertices.firsts,
                are: &vertices.are_moved,
            };
            let is_first = truncation.n_rounds == 0;
            self.find_contacts_of((&now, &plan), (!is_first).then_some(moved))?;
            stats.add(&self.stats);
            let stops = Instant::now();
            let mut stopping = StoppingPairs::default();
            if truncation.n_rounds == MOST_ROUNDS && self.steps.contacts.found().next().is_some() {
                stopping.meeting = self.part(&vertices, scene, (&now, &plan))?;
                stats.add(&self.stats);
            }
            if stopping.meeting.is_empty() {
                stopping = self.stop(&vertices, (scene, &plan))?;
            }
            let StoppingPairs { touching, meeting } = stopping;
            if is_first {
                // All that touch at the start are known now.
                refuse_seams(scene, &plan, touching.iter().copied())?;
                truncation.n_touching = touching.len() as u64;
                truncation.stopped.numbering.begin(&plan);
            }
            let pairs = &mut truncation.stopped.pairs;
            grow(
                pairs,
                touching.len() + meeting.len(),
                "pairs that stopped vertices",
            )?;
            pairs.extend(touching.into_iter().chain(meeting));
            if pairs.len() > most_pairs {
                // Many meet again in later rounds.
                pairs.sort_unstable_by_key(|&(kind, key)| (kind as usize, key));
                pairs.dedup();
                most_pairs = most_pairs.max(2 * pairs.len());
            }
            let any = vertices.go_back(scene);
            stats.add_ms("stops", stops.elapsed().as_secs_f64() * 1e3);
            if !any {
                break;
            }
            truncation.n_rounds += 1;
            set_end_positions(&mut now, &vertices.positions(scene))?;
            plan = plan_of(&now, self.limits_of_steps())?;
        }
        truncation.n_cut = vertices.n_cut();
        truncation.reached.positions = vertices.positions(scene);
        stats.total_ms = begun.elapsed().as_secs_f64() * 1e3;
        self.stats = stats;
        Ok(truncation)
    }

    /// Stops the vertices of all pairs that touch. Returns those pairs, but for pairs of which no
    /// vertex moves.
    ///
    /// # Errors
    /// Cancellation.
    fn stop(
        &self,
        vertices: &Vertices,
        (scene, plan): (&Scene, &Plan),
    ) -> Result<StoppingPairs, Error> {
        let workers = self.runner.workers();
        let mut tasks = Vec::new();
        for (kind, found) in self.steps.contacts.lists() {
            // Steps have vertices, edges and faces.
            let Some(pair) = exact_kind(TestId::Elements(kind)) else {
                continue;
            };
            let chunks = found.chunks(workers.task(TASK));
            tasks.extend(chunks.map(|found| (kind, pair, found, StoppingPairs::default())));
        }
        let work = Work {
            workers,
            control: &self.control,
        };
        work.each(&mut tasks, |_, (kind, pair, found, stopping)| {
            for found in *found {
                let is_touching = found.value.at_start;
                if vertices.stop((*pair, found.key), is_touching, (scene, plan)) {
                    let list = match is_touching {
                        true => &mut stopping.touching,
                        false => &mut stopping.meeting,
                    };
                    list.push((*kind, found.key));
                }
            }
            Ok(())
        })?;
        let mut all = StoppingPairs::default();
        for (.., own) in tasks {
            all.touching.extend(own.touching);
            all.meeting.extend(own.meeting);
        }
        Ok(all)
    }
}

/// The pairs that stop vertices in a round: those that touch at the start, and all others.
#[derive(Default)]
struct StoppingPairs {
    touching: PairList,
    meeting: PairList,
}

/// A pair by its test and its key.
type Pair = (ElementPair, u64);

/// How far each vertex of each body goes.
struct Vertices {
    /// Of each: the start, where it is now, rounded as it is stored, and the end.
    ways: Vec<[Point; 3]>,
    /// Whether each was taken back in the last round.
    are_moved: Vec<bool>,
    all: Vec<Vertex>,
    /// The bits of the share of its way that each is to go at most: floats of at least 0 are in the
    /// order of their bits.
    most: Vec<AtomicU64>,
    /// The first vertex of the body of each part.
    firsts: Vec<usize>,
}

/// How far a vertex goes.
#[derive(Clone, Copy)]
struct Vertex {
    /// The share of its way.
    share: f64,
    /// How often it was stopped.
    n_stops: u8,
}

/// A vertex that was stopped so often stays at its start: rounds end.
const MOST_STOPS: u8 = 60;

/// So many rounds look only at pairs that meet. One more may follow, see [`at_rest`].
const MOST_ROUNDS: u32 = 255;

impl Vertices {
    /// All go to their ends.
    ///
    /// # Errors
    /// There is no memory for them.
    fn new(scene: &Scene, plan: &Plan) -> Result<Self, Error> {
        let n = scene.bodies().map(|(_, body)| body.n_vertices()).sum();
        const WHAT: &str = "vertices";
        let are_moved = filled(false, n, WHAT)?;
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
            are_moved,
            all,
            most,
            firsts: plan.first_vertices(scene),
        })
    }

    /// Lets a vertex go at most a share of its way.
    fn stop_at(&self, vertex: usize, share: f64) {
        self.most[vertex].fetch_min(share.to_bits(), Ordering::Relaxed);
    }

    /// Takes the vertices back that were stopped. Returns whether there were any.
    fn go_back(&mut self, scene: &Scene) -> bool {
        let mut any = false;
        let mut first = 0;
        for (_, body) in scene.bodies() {
            let start = body.positions();
            let end = body.end_positions().unwrap_or(start);
            let own = first..first + body.n_vertices();
            first = own.end;
            let vertices = &mut self.all[own.clone()];
            let are_moved = &mut self.are_moved[own.clone()];
            let mosts = &mut self.most[own.clone()];
            for (ix, (vertex, most)) in vertices.iter_mut().zip(mosts).enumerate() {
                let most = std::mem::replace(most.get_mut(), WHOLE);
                are_moved[ix] = most < WHOLE;
                if are_moved[ix] {
                    let least = start.share_of_rounding(end, ix);
                    // Twice as much each time, and nothing in the end, whatever the numbers.
                    let back = least * (1u64 << vertex.n_stops.min(MOST_STOPS)) as f64;
                    let share = f64::from_bits(most).min(vertex.share - back);
                    let is_last = vertex.n_stops >= MOST_STOPS;
                    vertex.share = if is_last { 0.0 } else { share.max(0.0) };
                    vertex.n_stops += 1;
                }
            }
            if !are_moved.contains(&true) {
                continue;
            }
            any = true;
            if body.has_end_by_transform() {
                let share = vertices
                    .iter()
                    .map(|vertex| vertex.share)
                    .fold(1.0, f64::min);
                let n_stops = vertices.iter().map(|vertex| vertex.n_stops).max();
                let n_stops = n_stops.unwrap_or(0);
                vertices.fill(Vertex { share, n_stops });
                are_moved.fill(true);
            }
            for (ix, [_, now, _]) in self.ways[own].iter_mut().enumerate() {
                if are_moved[ix] {
                    *now = start.blend_point(end, ix, vertices[ix].share);
                }
            }
        }
        any
    }

    fn n_cut(&self) -> u64 {
        let each = self.all.iter().zip(&self.ways);
        each.filter(|(vertex, [start, _, end])| vertex.share < 1.0 && start != end)
            .count() as u64
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

/// How many vertices of a body move.
fn n_ways((_, start, end): (BodyId, &Positions, &Positions)) -> u64 {
    let moves = |&ix: &usize| start.point(ix) != end.point(ix);
    (0..start.len()).filter(moves).count() as u64
}

/// The bits of 1: all of a way.
const WHOLE: u64 = 1.0_f64.to_bits();

/// The points of a pair, as the exact tests take them.
struct PairPoints {
    n: usize,
    /// The number of each vertex; the first again, where there are fewer.
    own: [usize; 4],
    start: [Point; 4],
    now: [Point; 4],
    end: [Point; 4],
}

impl PairPoints {
    /// The places of those that move.
    fn moving(&self) -> impl Iterator<Item = usize> {
        (0..self.n).filter(|&ix| self.now[ix] != self.start[ix])
    }

    /// The numbers of the vertices that move.
    fn movers(&self) -> impl Iterator<Item = usize> {
        self.moving().map(|ix| self.own[ix])
    }

    /// At the start, now, and at the end.
    fn times(&self) -> [&[Point; 4]; 3] {
        [&self.start, &self.now, &self.end]
    }
}

/// The elements of a pair, in the order of the exact tests.
fn located(plan: &Plan, pair: ElementPair, key: u64) -> [(PartIx, ElementIx); 2] {
    let mut located = plan.located(key);
    if pair == ElementPair::VertexEdge {
        // Such pairs are named edge first, but tested vertex first.
        located.reverse();
    }
    located
}

impl Vertices {
    fn points(
        &self,
        located: &[(PartIx, ElementIx); 2],
        (scene, plan): (&Scene, &Plan),
    ) -> PairPoints {
        let mut own = [usize::MAX; 4];
        let mut n = 0;
        for (part, element) in located {
            let corners = plan
                .body(scene, *part)
                .corners(plan.part(*part).part, element);
            for &corner in corners {
                own[n] = self.firsts[part.index()] + corner as usize;
                n += 1;
            }
        }
        let first = own[0];
        own[n..].fill(first);
        let [start, now, end] = [0, 1, 2].map(|time| own.map(|vertex| self.ways[vertex][time]));
        PairPoints {
            n,
            own,
            start,
            now,
            end,
        }
    }

    /// Stops the vertices of a pair that go towards the other element, or all of them if it touches
    /// at the start. Returns whether any of them moves: if none does, it touches at the start.
    fn stop(&self, (pair, key): Pair, is_touching: bool, (scene, plan): (&Scene, &Plan)) -> bool {
        let located = located(plan, pair, key);
        let points = self.points(&located, (scene, plan));
        if points.moving().next().is_none() {
            return false;
        }
        if is_touching {
            return self.stop_by(&points, &[0.0; 4]);
        }
        let kept = plan.kept(scene, located, pair, [&points.start, &points.end]);
        let is_any_less = |shares: &[f64; 4]| points.moving().any(|ix| shares[ix] < 1.0);
        // Where no share is less, the planes are too close for that.
        let shares = shares_apart(pair, points.times(), kept)
            .filter(is_any_less)
            .unwrap_or_else(|| shares_without_room(pair, points.times(), kept));
        self.stop_by(&points, &shares)
    }

    /// Has the vertices of a pair that move go shares of their ways. Returns whether any of them
    /// may go less than the whole.
    fn stop_by(&self, points: &PairPoints, shares: &[f64; 4]) -> bool {
        let mut any = false;
        for ix in points.moving().filter(|&ix| shares[ix] < 1.0) {
            any = true;
            self.stop_at(points.own[ix], shares[ix]);
        }
        any
    }
}
