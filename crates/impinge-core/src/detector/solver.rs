//! What penetration-free solvers ask in every iteration: how far each vertex may move, and which
//! elements are near each element.
//!
//! ```text
//! near pairs (keys)  ->  Measured   a number below the distance of each pair, in parallel
//! SafeDistances                     of each vertex, the least share of these
//! Neighbours                        the pairs by element
//! ```
//!
//! For safe distances, pairs whose bounds show that they give no vertex less are dropped where they
//! are found.

use super::Detector;
use super::in_step::Keys;
use super::near::name_features;
use crate::answers::near::Labels;
use crate::answers::neighbours::Neighbours;
use crate::answers::safe::SafeDistances;
use crate::plan::{Plan, TestId};
use crate::query::Query;
use crate::query::pair_kind::PairKind;
use crate::query::step::check_distance;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::index::{ElementIx, PartIx};
use crate::search::found::KeysByKind;
use crate::search::narrow::{Corners, exact_kind};
use crate::search::pair_reader::{Located, PairReader, Side};
use crate::search::runner::{Job, Outcome};
use crate::search::shares::Shares;
use crate::search::sink::reserve;
use crate::search::stats::Stats;
use crate::search::work::Work;
use crate::simd::{Isa, Simd, with_isa};
use crate::workers::clock::Instant;
use impinge_exact::ElementPair;
use impinge_exact::internal::filter::{LANES, Points8, Spans8, distance_bounds, put_point};
use impinge_exact::internal::{gap_below, gap_by_bounds};

/// Pairs that a task measures.
const TASK: usize = 1024;

/// Memory of these questions.
#[derive(Debug, Default)]
pub(super) struct SolverMemory {
    pub keys: KeysByKind,
    distances: [Vec<f64>; PairKind::ALL.len()],
    shares: Shares,
}

impl Detector {
    /// How far each vertex may move, on any path, so that nothing touches: for each pair of
    /// elements that do not share a vertex, the largest number of the vertices of one and the
    /// largest of the other add up to less than their distance, minus the
    /// [thickness](Scene::set_thickness) of both. No number is above `most`, which is a
    /// length in the unit of the scene. The cost grows with `most`, since all pairs within twice
    /// `most` are looked at: take no more than a vertex moves in a step.
    ///
    /// Both elements get half of the distance; what is [fixed](Query::fixed) gets 0 and leaves all
    /// of it to the other. Each number is rounded down: it is below what the smallest distance of
    /// its vertex allows by at most 2^-10 of it, and never above. Pairs that touch get 0, and are
    /// [named](SafeDistances::touching). If there are any, what they have in common is no longer
    /// ruled out: it is for the caller to part them.
    ///
    /// So a solver may move every vertex by its number, in any direction and in any order, and
    /// needs no test in between. The motion of a vertex is what it really does: rounding of its new
    /// position counts. The bodies' end positions are ignored, and so are pairs of elements of one
    /// body that share a vertex, which no numbers above 0 could keep apart. Tetrahedra take part
    /// with their surface: that they turn inside out is not noticed, see
    /// [`add_tetrahedra`](Scene::add_tetrahedra).
    ///
    /// ```
    /// use impinge::{Backend, Bounds, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let corners = [[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    /// let floor = scene.add_triangles(&[[0, 1, 2]], &corners)?;
    /// let points = scene.add_points(&[[1.0f32, 1.0, 0.5], [1.0, 1.0, 9.0]])?;
    /// let query = Query::all().fixed([floor]);
    /// let safe = Detector::new(Backend::Cpu)?.safe_distances(&scene, 1.0, &query)?;
    /// let bounds = safe.of(points).expect("a body");
    /// assert!(bounds.get(0) < 0.5 && bounds.get(0) > 0.4999);
    /// assert_eq!(bounds.get(1), 1.0);
    /// assert_eq!(safe.of(floor), Some(Bounds::F32(&[0.0; 3])));
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// As [`near`](Detector::near), with a `most` that is negative or not finite, and for fixed
    /// bodies that are not in the scene.
    pub fn safe_distances(
        &mut self,
        scene: &Scene,
        most: f64,
        query: &Query,
    ) -> Result<SafeDistances, Error> {
        check_distance("most", most)?;
        if (2.0 * most).is_infinite() {
            return Err(Error::Setting {
                setting: "most",
                given: format!("{most:e}"),
                allowed: "a number whose double is finite",
            });
        }
        for &body in &query.fixed {
            scene.body(body)?;
        }
        let plan = Plan::nearness(scene, query, 2.0 * most, self.settings.limits())?;
        self.solver.shares.begin(scene, &plan, query, most)?;
        let mut memory = std::mem::take(&mut self.solver);
        let shares = std::mem::take(&mut memory.shares);
        let mut safe = self.homes.safe.take();
        let mut outcome = Safe {
            safe: &mut safe,
            memory: &mut memory,
            shares: &shares,
            isa: Isa::detect(self.settings.instruction_set),
            query,
        };
        let keys = Keys::Lowering(&shares);
        let found = self.find_near_keys(scene, query, &plan, keys, &mut outcome);
        memory.shares = shares;
        self.solver = memory;
        self.stats.clone_from(safe.stats());
        found.map(|_| safe)
    }

    /// The pairs of [`near`](Detector::near) as lists: of each vertex the faces near it, of each
    /// face the vertices, of each edge the edges, and so on for the kinds that the query asks for.
    /// Edges with faces that they do not meet, and vertices of no element, have none, as there.
    /// Each neighbour comes with its distance, minus the [thickness](Scene::set_thickness) of both,
    /// rounded down: by at most 2^-20 of it, or by 2^-1045. It is 0 if and only if the elements
    /// touch, or are at most as far apart as they are thick, or farther by no more than 2^-1045.
    ///
    /// ```
    /// use impinge::{Backend, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])?;
    /// scene.add_points(&[[9.0f32, 9.0, 9.0], [1.0, 1.0, 0.5]])?;
    /// let near = Detector::new(Backend::Cpu)?.neighbours(&scene, 1.0, &Query::all())?;
    /// // The second point is vertex 4 of all.
    /// assert_eq!(near.vf().offsets, [0, 0, 0, 0, 0, 1]);
    /// assert_eq!(near.fv().indices, [4]);
    /// # Ok(()) }
    /// ```
    ///
    /// # Errors
    /// As [`near`](Detector::near), and more than 2^32 vertices, edges or faces.
    pub fn neighbours(
        &mut self,
        scene: &Scene,
        distance: f64,
        query: &Query,
    ) -> Result<Neighbours, Error> {
        let mut neighbours = self.homes.neighbours.take();
        let mut memory = std::mem::take(&mut self.solver);
        let mut outcome = NeighbourLists {
            neighbours: &mut neighbours,
            memory: &mut memory,
            isa: Isa::detect(self.settings.instruction_set),
        };
        let found = self.find_near(scene, distance, query, &mut outcome);
        self.solver = memory;
        self.stats.clone_from(neighbours.stats());
        found.map(|_| neighbours)
    }
}

/// A pair whose distance was measured.
struct Measured<'a> {
    key: u64,
    located: &'a [Located; 2],
    /// A number that is at most its distance minus the thickness of both, by little; 0 if and only
    /// if that is not above 0, or by no more than 2^-1045.
    distance: f64,
}

impl SolverMemory {
    /// Measures the distance of each pair, in parallel, and takes the labels off keys. `each` is
    /// told of each pair, and says which key it then has.
    ///
    /// # Errors
    /// There is no memory, cancellation.
    fn measure(
        &mut self,
        job: Job<'_>,
        isa: Isa,
        keys: KeysByKind,
        stats: &mut Stats,
        each: impl Fn(Measured<'_>) -> u64 + Sync,
    ) -> Result<(), Error> {
        let start = Instant::now();
        let Job {
            scene,
            plan,
            workers,
            control,
        } = job;
        self.keys = keys;
        let labels = Labels::new(plan.n_elements());
        let n_each = workers.task(TASK);
        let mut tasks = Vec::new();
        let lists = self.keys.iter_mut().zip(&mut self.distances);
        for (kind, (keys, distances)) in PairKind::ALL.into_iter().zip(lists) {
            distances.clear();
            reserve(distances, keys.len(), "distances")?;
            distances.resize(keys.len(), 0.0);
            let parts = keys.chunks_mut(n_each).zip(distances.chunks_mut(n_each));
            tasks.extend(parts.map(|(keys, distances)| (kind, keys, distances)));
        }
        let n_tasks = tasks.len() as u64;
        Work { workers, control }.each(&mut tasks, |_, (kind, keys, distances)| {
            let pair = exact_kind(TestId::Elements(*kind));
            let mut points = Points8::default();
            let mut reader = PairReader::new(scene, plan);
            let mut located = [[Located::default(); 2]; LANES];
            for (keys, distances) in keys.chunks_mut(LANES).zip(distances.chunks_mut(LANES)) {
                for (lane, (key, located)) in keys.iter_mut().zip(&mut located).enumerate() {
                    (*key, _) = labels.split(*key);
                    *located = reader.locate(*key);
                    if let Some(pair) = pair {
                        put_points(pair, reader.sides(located), lane, &mut points);
                    }
                }
                let bounds = pair.map(|pair| bounds_by_lane(isa, pair, &points));
                let pairs = keys.iter_mut().zip(&located).enumerate();
                for ((lane, (key, located)), to) in pairs.zip(distances) {
                    let thickness = plan.thickness_of_both(*located);
                    let known = bounds.as_ref().and_then(|bounds| {
                        gap_by_bounds([bounds.low[lane], bounds.high[lane]], thickness)
                    });
                    *to = known.unwrap_or_else(|| match kind {
                        // They meet.
                        PairKind::EdgeFace => 0.0,
                        _ => gap_of((scene, plan), located, thickness),
                    });
                    *key = each(Measured {
                        key: *key,
                        located,
                        distance: *to,
                    });
                }
            }
            Ok(())
        })?;
        control.step(n_tasks, n_tasks)?;
        stats.add_ms("measure", start.elapsed().as_secs_f64() * 1e3);
        Ok(())
    }

    fn bytes(&self) -> u64 {
        let distances: usize = self.distances.iter().map(Vec::capacity).sum();
        let keys: usize = self.keys.iter().map(Vec::capacity).sum();
        (size_of::<f64>() * (distances + keys)) as u64
    }
}

/// A number that is at most the distance of a pair minus its thickness, by its exact value.
#[inline(never)]
fn gap_of((scene, plan): (&Scene, &Plan), located: &[Located; 2], thickness: [f64; 2]) -> f64 {
    let [a, b] = located.each_ref().map(|(part, element)| {
        let body = plan.body(scene, *part);
        let corners = body.corners(plan.part(*part).part, element);
        Corners::new(body.positions(), corners)
    });
    gap_below(a.points(), b.points(), thickness)
}

/// Writes the points of a pair into a lane, in the order of the exact test.
#[inline(always)]
fn put_points(
    pair: ElementPair,
    mut sides: [Side<'_>; 2],
    lane: usize,
    Points8(points): &mut Points8,
) {
    if pair == ElementPair::VertexEdge {
        // Such pairs are named edge first, but tested vertex first.
        sides.reverse();
    }
    let mut rows = points.iter_mut();
    for side in sides {
        for (point, row) in side.points().zip(&mut rows) {
            put_point(row, lane, &point);
        }
    }
}

/// Bounds of the distances of eight pairs.
fn bounds_by_lane(isa: Isa, pair: ElementPair, points: &Points8) -> Spans8 {
    with_isa!(isa, bounds_in_registers, (
        pair: ElementPair = pair,
        points: &Points8 = points,
    ) -> Spans8)
}

#[inline(always)]
fn bounds_in_registers<S: Simd>(_: S, pair: ElementPair, points: &Points8) -> Spans8 {
    distance_bounds::<S::F64>(pair, points)
}

/// Near pairs that become a bound per vertex.
struct Safe<'a> {
    safe: &'a mut SafeDistances,
    memory: &'a mut SolverMemory,
    /// As far as the pairs lower them that were not dropped.
    shares: &'a Shares,
    isa: Isa,
    query: &'a Query,
}

impl Outcome<u64, { PairKind::ALL.len() }> for Safe<'_> {
    fn begin(&mut self, plan: &Plan) {
        self.safe.begin(plan);
    }

    fn stats_mut(&mut self) -> &mut Stats {
        self.safe.stats_mut()
    }

    fn take_buffers(&mut self) -> KeysByKind {
        std::mem::take(&mut self.memory.keys)
    }

    fn fill(&mut self, job: Job<'_>, keys: KeysByKind) -> Result<(), Error> {
        let Job { scene, plan, .. } = job;
        let shares = self.shares;
        let stats = self.safe.stats_mut();
        (self.memory).measure(job, self.isa, keys, stats, |pair| {
            let [(a, of_a), (b, of_b)] = pair.located;
            let corners = |part, element| {
                let body = plan.body(scene, part);
                body.corners(plan.part(part).part, element)
            };
            let corners = [corners(*a, of_a), corners(*b, of_b)];
            shares.between([*a, *b]).take(corners, pair.distance);
            pair.key
        })?;
        self.safe.fill(scene, shares.iter())?;
        // The keys of the pairs that touch, which have no labels now.
        let labels = Labels::new(plan.n_elements());
        let lists = self.memory.keys.iter().zip(&self.memory.distances);
        let mut touching = KeysByKind::default();
        for (touching, (keys, distances)) in touching.iter_mut().zip(lists) {
            let all = keys.iter().zip(distances);
            let own = all.filter(|&(_, &distance)| distance == 0.0);
            touching.extend(own.map(|(&key, _)| labels.put(key, Labels::UNKNOWN)));
        }
        name_features(&mut self.safe.touching, job, touching, self.query, self.isa)
    }

    fn bytes(&self) -> u64 {
        self.safe.bytes() + self.memory.bytes() + self.shares.bytes() as u64
    }
}

/// Near pairs that become lists.
struct NeighbourLists<'a> {
    neighbours: &'a mut Neighbours,
    memory: &'a mut SolverMemory,
    isa: Isa,
}

impl Outcome<u64, { PairKind::ALL.len() }> for NeighbourLists<'_> {
    fn begin(&mut self, _: &Plan) {
        self.neighbours.begin();
    }

    fn stats_mut(&mut self) -> &mut Stats {
        self.neighbours.stats_mut()
    }

    fn take_buffers(&mut self) -> KeysByKind {
        std::mem::take(&mut self.memory.keys)
    }

    fn fill(&mut self, job: Job<'_>, keys: KeysByKind) -> Result<(), Error> {
        let firsts = self.neighbours.number(job.scene, job.plan)?;
        let stats = self.neighbours.stats_mut();
        (self.memory).measure(job, self.isa, keys, stats, |pair| {
            let [(a, of_a), (b, of_b)] = pair.located;
            let number = |part: PartIx, element: ElementIx| firsts[part.index()] + element.raw();
            u64::from(number(*a, *of_a)) << 32 | u64::from(number(*b, *of_b))
        })?;
        let start = Instant::now();
        let SolverMemory {
            keys, distances, ..
        } = &*self.memory;
        let Job {
            workers, control, ..
        } = job;
        let work = Work { workers, control };
        self.neighbours.fill(keys, distances, work)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        self.neighbours.stats_mut().add_ms("lists", ms);
        Ok(())
    }

    fn bytes(&self) -> u64 {
        self.neighbours.bytes() + self.memory.bytes()
    }
}
