//! How far each vertex may go in a step, so that nothing touches on the way.
//!
//! ```text
//! candidates (keys)   pairs whose boxes over the step meet; no others can meet, however short each vertex stops
//! are they apart?     a pair stays apart if its vertices lie on either side of two planes, at the start and where they are now
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
use crate::scene::index::pair_numbers;
use crate::scene::positions::Positions;
use crate::search::found::KeysByKind;
use crate::search::narrow::{FirstContact, PairElement};
use crate::search::runner::{Job, Outcome};
use crate::search::sink::reserve;
use crate::search::stats::Stats;
use crate::search::work::Work;
use crate::workers::clock::Instant;
use impinge_exact::internal::{shares_apart, spare_apart};
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
        let mut pairs = Pairs::new(job, &self.keys)?;
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
    /// Where that is, rounded as it is stored.
    at: Point,
    /// How often it was stopped.
    n_stops: u8,
    /// How far it was taken back since the first round: at least that.
    moved: f64,
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
        let (mut all, mut most) = (Vec::new(), Vec::new());
        reserve(&mut all, n, "vertices")?;
        reserve(&mut most, n, "vertices")?;
        most.resize_with(n, || AtomicU64::new(WHOLE));
        for (_, body) in scene.bodies() {
            let end = body.end_positions().unwrap_or(body.positions());
            all.extend((0..body.n_vertices()).map(|vertex| Vertex {
                share: 1.0,
                at: end.point(vertex),
                n_stops: 0,
                moved: 0.0,
            }));
        }
        Ok(Vertices {
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
        let mut all = self.all.iter_mut().zip(&mut self.most);
        for (_, body) in scene.bodies() {
            let start = body.positions();
            let end = body.end_positions().unwrap_or(start);
            let own = all.by_ref().take(body.n_vertices());
            for (ix, (vertex, most)) in own.enumerate() {
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
                    let back: f64 = (0..3).map(|k| (at[k] - vertex.at[k]).abs()).sum();
                    vertex.moved = (vertex.moved + back * (1.0 + 8.0 * f64::EPSILON)).next_up();
                    vertex.at = at;
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
        let mut rest = self.all.iter().map(|vertex| vertex.at);
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

/// A pair that could meet.
struct Pair {
    kind: PairKind,
    key: u64,
    state: State,
    /// Its vertices among all; the first again, where there are fewer.
    vertices: [u32; 4],
    /// It need not be looked at again before its vertices have been taken back so far together.
    until: f64,
}

/// What is known of a pair.
#[derive(Clone, Copy, PartialEq)]
enum State {
    /// Nothing.
    New,
    /// It counts, and was apart at the start, or none of its vertices moves.
    Apart,
    /// None of its vertices may move: it touches at the start.
    Touches,
    /// It does not count.
    Skipped,
}

/// The points of a pair at the start, now, and at the end.
struct Ways {
    pair: ElementPair,
    times: [[Point; 4]; 3],
    /// How near they may come.
    kept: f64,
    vertices: [u32; 4],
}

impl Ways {
    fn new(job: Job<'_>, vertices: &Vertices, kind: PairKind, key: u64) -> Self {
        let Job { scene, plan, .. } = job;
        let located = pair_numbers(key).map(|number| plan.locate(number));
        let elements = (located.each_ref()).map(|located| PairElement::new(scene, plan, located));
        let (pair, elements, [start, end]) =
            FirstContact::ends(TestId::Elements(kind), elements, 1.0)
                .expect("steps have vertices, edges and faces");
        let all = elements.iter().flat_map(|element| {
            let first = vertices.firsts[element.part.index()];
            let corners = element.corners.iter();
            corners.map(move |&corner| first + corner as usize)
        });
        let (mut now, mut numbers) = (end, [0; 4]);
        for (ix, vertex) in all.enumerate() {
            now[ix] = vertices.all[vertex].at;
            // All numbers of parts are below 2^32, and vertices are a part.
            numbers[ix] = vertex as u32;
        }
        let first = numbers[0];
        numbers[pair.n_points()..].fill(first);
        let parts = elements.map(|element| element.part);
        Ways {
            pair,
            times: [start, now, end],
            kept: plan.kept(scene, parts, pair, [&start, &end]),
            vertices: numbers,
        }
    }

    /// Stops the vertices that go towards the other element, if the two do not stay apart. Returns
    /// also how far vertices may be taken back before it has to be asked again.
    fn stop(&self, plan: &Plan, vertices: &Vertices) -> (State, f64) {
        let [start, now, end] = &self.times;
        let points = 0..self.pair.n_points();
        let moving = points.filter(|&ix| now[ix] != start[ix]);
        if moving.clone().next().is_none() {
            return (State::Apart, f64::INFINITY);
        }
        if let Some(spare) = spare_apart(self.pair, [start, now, end], self.kept) {
            return (State::Apart, spare);
        }
        let Some(shares) = shares_apart(self.pair, [start, now, end], self.kept) else {
            if plan.start == Start::Skip && plan.at_start(self.pair, start).at_start {
                return (State::Skipped, 0.0);
            }
            moving.for_each(|ix| vertices.stop(self.vertices[ix] as usize, 0.0));
            return (State::Touches, 0.0);
        };
        // Where no share is less, the planes are too close for that: each goes back a little.
        let is_any_less = shares.iter().any(|&share| share < 1.0);
        for ix in moving {
            let share = shares[ix];
            if share < 1.0 || !is_any_less {
                let share = share.min(1.0 - f64::EPSILON);
                vertices.stop(self.vertices[ix] as usize, share);
            }
        }
        (State::Apart, 0.0)
    }
}

/// The pairs that could meet.
struct Pairs<'a> {
    job: Job<'a>,
    all: Vec<Pair>,
}

impl<'a> Pairs<'a> {
    /// # Errors
    /// There is no memory for them.
    fn new(job: Job<'a>, keys: &KeysByKind) -> Result<Self, Error> {
        let mut all = Vec::new();
        reserve(&mut all, keys.iter().map(Vec::len).sum(), "pairs")?;
        for (kind, keys) in PairKind::ALL.into_iter().zip(keys) {
            all.extend(keys.iter().map(|&key| Pair {
                kind,
                key,
                state: State::New,
                vertices: [0; 4],
                until: 0.0,
            }));
        }
        Ok(Pairs { job, all })
    }

    /// Stops the vertices of all pairs that do not stay apart as they are now. Most need no second
    /// look: their vertices are not taken back far enough.
    ///
    /// # Errors
    /// Cancellation.
    fn stop(&mut self, vertices: &Vertices) -> Result<(), Error> {
        let job = self.job;
        let Job {
            scene,
            plan,
            workers,
            control,
        } = job;
        let mut tasks: Vec<&mut [Pair]> = self.all.chunks_mut(workers.task(TASK)).collect();
        Work { workers, control }.each(&mut tasks, |_, pairs| {
            for pair in pairs.iter_mut() {
                let numbers = pair.vertices;
                let moved = || -> f64 {
                    let all = numbers.iter();
                    // Rounded up as far as four numbers can be rounded down.
                    let sum: f64 = all.map(|&vertex| vertices.all[vertex as usize].moved).sum();
                    sum * (1.0 + 8.0 * f64::EPSILON)
                };
                match pair.state {
                    State::New if !plan.counts(scene, pair.key) => pair.state = State::Skipped,
                    State::Apart if moved() < pair.until => {}
                    State::New | State::Apart => {
                        let ways = Ways::new(job, vertices, pair.kind, pair.key);
                        pair.vertices = ways.vertices;
                        let spare;
                        (pair.state, spare) = ways.stop(plan, vertices);
                        let all = ways.vertices.iter();
                        let moved: f64 =
                            all.map(|&vertex| vertices.all[vertex as usize].moved).sum();
                        pair.until = (moved * (1.0 - 8.0 * f64::EPSILON) + spare).next_down();
                    }
                    State::Touches | State::Skipped => {}
                }
            }
            Ok(())
        })
    }

    /// The pairs of which no vertex moves.
    fn touching(&self) -> impl Iterator<Item = (PairKind, u64)> {
        let touching = self.all.iter().filter(|pair| pair.state == State::Touches);
        touching.map(|pair| (pair.kind, pair.key))
    }
}
