//! What penetration-free solvers ask in every iteration: how far each vertex may move, and which
//! elements are near each element.
//!
//! ```text
//! near pairs (keys)  ->  Measured    a number below the distance of each pair, in parallel
//! SafeDistances                      of each vertex, the least share of these
//! Neighbours                         the pairs by element
//! ```

use std::sync::atomic::{AtomicU64, Ordering};

use super::Detector;
use super::near::name_features;
use crate::answers::near::Labels;
use crate::answers::neighbours::Neighbours;
use crate::answers::safe::SafeDistances;
use crate::plan::Plan;
use crate::query::Query;
use crate::query::pair_kind::PairKind;
use crate::query::step::check_distance;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::index::{PartIx, pair_numbers};
use crate::search::found::KeysByKind;
use crate::search::narrow::Corners;
use crate::search::runner::{Job, Outcome};
use crate::search::sink::reserve;
use crate::search::stats::Stats;
use crate::search::work::Work;
use crate::workers::clock::Instant;
use impinge_exact::internal::distance_below;

/// Pairs that a task measures.
const TASK: usize = 1024;

/// Memory of these questions.
#[derive(Debug, Default)]
pub(super) struct SolverMemory {
    pub keys: KeysByKind,
    distances: [Vec<f64>; PairKind::ALL.len()],
    /// Of each vertex of each body, the bits of the least share: floats of at least 0 are in the
    /// order of their bits.
    least: Vec<AtomicU64>,
}

impl Detector {
    /// How far each vertex may move, on any path, so that nothing touches: for each pair of
    /// elements that do not share a vertex, the largest number of the vertices of one and the
    /// largest of the other add up to less than their distance, minus the
    /// [thickness](Scene::set_thickness) of both bodies. No number is above `most`, which is a
    /// length in the unit of the scene.
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
    /// body that share a vertex, which no numbers above 0 could keep apart.
    ///
    /// ```
    /// use impinge::{Backend, Bounds, Detector, Query, Scene};
    /// # fn main() -> Result<(), impinge::Error> {
    /// let mut scene = Scene::new();
    /// let floor = scene.add_triangles(&[[0, 1, 2]], &[[0.0f32, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]])?;
    /// let points = scene.add_points(&[[1.0f32, 1.0, 0.5], [1.0, 1.0, 9.0]])?;
    /// let safe = Detector::new(Backend::Cpu)?.safe_distances(&scene, 1.0, &Query::all().fixed([floor]))?;
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
        check_distance("most", 2.0 * most)?;
        for &body in &query.fixed {
            scene.body(body)?;
        }
        let mut safe = self.homes.safe.take();
        let mut memory = std::mem::take(&mut self.solver);
        let mut outcome = Safe {
            safe: &mut safe,
            memory: &mut memory,
            query,
            most,
        };
        let found = self.find_near(scene, 2.0 * most, query, &mut outcome);
        self.solver = memory;
        self.stats.clone_from(safe.stats());
        found.map(|_| safe)
    }

    /// The pairs of [`near`](Detector::near) as lists: of each vertex the faces near it, of each
    /// face the vertices, of each edge the edges, and so on for the kinds that the query asks for.
    /// Each neighbour comes with its distance, rounded down.
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
        let mut outcome = Listed {
            neighbours: &mut neighbours,
            memory: &mut memory,
        };
        let found = self.find_near(scene, distance, query, &mut outcome);
        self.solver = memory;
        self.stats.clone_from(neighbours.stats());
        found.map(|_| neighbours)
    }
}

/// A pair whose distance was measured.
struct Measured<'a> {
    parts: [PartIx; 2],
    corners: [&'a [u32]; 2],
    /// A number below its distance minus the thickness of both bodies; 0 if and only if that is not
    /// above 0.
    distance: f64,
}

impl SolverMemory {
    /// Takes keys with labels off, and measures the distance of each pair, in parallel. `each` is
    /// told of each pair.
    ///
    /// # Errors
    /// There is no memory, cancellation.
    fn measure(
        &mut self,
        job: Job<'_>,
        keys: KeysByKind,
        stats: &mut Stats,
        each: impl Fn(Measured<'_>) + Sync,
    ) -> Result<(), Error> {
        let start = Instant::now();
        let Job {
            scene,
            plan,
            workers,
            control,
        } = job;
        self.keys = keys;
        let labels = Labels::new(plan.n_primitives());
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
            for (key, distance) in keys.iter_mut().zip(&mut **distances) {
                (*key, _) = labels.split(*key);
                let [a, b] = pair_numbers(*key).map(|number| plan.locate(number));
                let parts = [a.0, b.0];
                let corners = [&a, &b].map(|(part, element)| {
                    let body = plan.body(scene, *part);
                    body.corners(plan.part(*part).part, element)
                });
                *distance = match kind {
                    // They meet.
                    PairKind::EdgeFace => 0.0,
                    _ => {
                        let [a, b] = [0, 1].map(|side| {
                            let body = plan.body(scene, parts[side]);
                            Corners::new(body.positions(), corners[side])
                        });
                        plan.without_thickness(parts, distance_below(a.points(), b.points()))
                    }
                };
                each(Measured {
                    parts,
                    corners,
                    distance: *distance,
                });
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
        (size_of::<f64>() * (distances + keys + self.least.capacity())) as u64
    }
}

/// Near pairs that become a bound per vertex.
struct Safe<'a> {
    safe: &'a mut SafeDistances,
    memory: &'a mut SolverMemory,
    query: &'a Query,
    most: f64,
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
        let is_fixed = |part: PartIx| self.query.fixed.contains(&plan.part(part).id);
        let are_fixed: Vec<bool> = plan.part_ixs().map(is_fixed).collect();
        let n_vertices = scene.bodies().map(|(_, body)| body.n_vertices()).sum();
        let firsts = plan.first_vertices(scene);
        let mut least = std::mem::take(&mut self.memory.least);
        least.clear();
        reserve(&mut least, n_vertices, "safe distances")?;
        for (id, body) in scene.bodies() {
            // What is fixed does not move.
            let most = if self.query.fixed.contains(&id) {
                0.0
            } else {
                self.most
            };
            let own = std::iter::repeat_n(most.to_bits(), body.n_vertices());
            least.extend(own.map(AtomicU64::new));
        }
        let stats = self.safe.stats_mut();
        self.memory.measure(job, keys, stats, |pair| {
            let shares = shares(
                pair.distance,
                pair.parts.map(|part| are_fixed[part.index()]),
            );
            for side in 0..2 {
                let first = firsts[pair.parts[side].index()];
                for &corner in pair.corners[side] {
                    let bits = shares[side].to_bits();
                    least[first + corner as usize].fetch_min(bits, Ordering::Relaxed);
                }
            }
        })?;
        let bounds = least
            .iter()
            .map(|bits| f64::from_bits(bits.load(Ordering::Relaxed)));
        self.safe.fill(scene, bounds)?;
        self.memory.least = least;
        // The keys of the pairs that touch, which have no labels now.
        let labels = Labels::new(plan.n_primitives());
        let lists = self.memory.keys.iter().zip(&self.memory.distances);
        let mut touching = KeysByKind::default();
        for (touching, (keys, distances)) in touching.iter_mut().zip(lists) {
            let all = keys.iter().zip(distances);
            let own = all.filter(|&(_, &distance)| distance == 0.0);
            touching.extend(own.map(|(&key, _)| labels.put(key, Labels::UNKNOWN)));
        }
        name_features(&mut self.safe.touching, job, touching, self.query)
    }

    fn bytes(&self) -> u64 {
        self.safe.bytes() + self.memory.bytes()
    }
}

/// How far the vertices of either element of a pair may move, so that both together move less than
/// a number. Neither has to share with what is fixed.
fn shares(distance: f64, are_fixed: [bool; 2]) -> [f64; 2] {
    match are_fixed {
        [true, true] => [0.0; 2],
        [true, false] => [0.0, distance],
        [false, true] => [distance, 0.0],
        [false, false] => {
            let half = distance / 2.0;
            // Half of an odd multiple of the smallest number may be rounded up.
            let half = if half + half > distance {
                half.next_down()
            } else {
                half
            };
            [half; 2]
        }
    }
}

/// Near pairs that become lists.
struct Listed<'a> {
    neighbours: &'a mut Neighbours,
    memory: &'a mut SolverMemory,
}

impl Outcome<u64, { PairKind::ALL.len() }> for Listed<'_> {
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
        let stats = self.neighbours.stats_mut();
        self.memory.measure(job, keys, stats, |_| ())?;
        let start = Instant::now();
        let SolverMemory {
            keys, distances, ..
        } = &*self.memory;
        self.neighbours
            .fill((job.scene, job.plan), keys, distances)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        self.neighbours.stats_mut().add_ms("lists", ms);
        Ok(())
    }

    fn bytes(&self) -> u64 {
        self.neighbours.bytes() + self.memory.bytes()
    }
}
