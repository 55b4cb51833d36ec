//! The answer how far each vertex may move.

use crate::answers::home::{Home, gives_back};
use crate::answers::near::NearPairs;
use crate::bvh::bounds::round_down;
use crate::plan::Plan;
use crate::scene::Scene;
use crate::scene::error::Error;
use crate::scene::ids::BodyId;
use crate::scene::positions::Positions;
use crate::search::sink::reserve;
use crate::search::stats::Stats;

/// How far each vertex of one body may move, in the precision of its positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bounds<'a> {
    /// Of positions in single precision.
    F32(&'a [f32]),
    /// Of positions in double precision.
    F64(&'a [f64]),
}

impl Bounds<'_> {
    /// The number of vertices.
    pub fn len(&self) -> usize {
        match self {
            Bounds::F32(bounds) => bounds.len(),
            Bounds::F64(bounds) => bounds.len(),
        }
    }

    /// Whether the body has no vertices.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How far one vertex may move.
    ///
    /// # Panics
    /// There is no such vertex.
    pub fn get(&self, vertex: usize) -> f64 {
        match self {
            Bounds::F32(bounds) => f64::from(bounds[vertex]),
            Bounds::F64(bounds) => bounds[vertex],
        }
    }
}

/// How far each vertex may move so that nothing touches: see
/// [`Detector::safe_distances`](crate::Detector::safe_distances).
///
/// The same input gives the same bytes on every method, backend, thread count and budget.
#[derive(Clone, Default)]
pub struct SafeDistances {
    bodies: Vec<BoundsOfBody>,
    /// Of all bodies, one after the other.
    singles: Vec<f32>,
    doubles: Vec<f64>,
    pub(crate) touching: NearPairs,
    stats: Stats,
    /// Where its buffers go when it is dropped.
    home: Home<SafeDistances>,
}

gives_back!(SafeDistances);

#[derive(Debug, Clone, Copy)]
struct BoundsOfBody {
    id: BodyId,
    is_double: bool,
    first: usize,
    n: usize,
}

impl SafeDistances {
    pub(crate) fn begin(&mut self, plan: &Plan) {
        self.bodies.clear();
        self.singles.clear();
        self.doubles.clear();
        self.touching.begin(plan);
        self.stats.clear();
    }

    pub(crate) fn stats_mut(&mut self) -> &mut Stats {
        &mut self.stats
    }

    /// Takes the bounds of all vertices of all bodies, and rounds them down to the precision of the
    /// bodies.
    ///
    /// # Errors
    /// There is no memory for them.
    pub(crate) fn fill(
        &mut self,
        scene: &Scene,
        bounds: impl Iterator<Item = f64>,
    ) -> Result<(), Error> {
        let mut bounds = bounds;
        for (id, body) in scene.bodies() {
            let n = body.n_vertices();
            let is_double = matches!(body.positions(), Positions::F64(_));
            let own = bounds.by_ref().take(n);
            let first = if is_double {
                let first = self.doubles.len();
                reserve(&mut self.doubles, n, "safe distances")?;
                self.doubles.extend(own);
                first
            } else {
                let first = self.singles.len();
                reserve(&mut self.singles, n, "safe distances")?;
                self.singles.extend(own.map(round_down));
                first
            };
            self.bodies.push(BoundsOfBody {
                id,
                is_double,
                first,
                n,
            });
        }
        Ok(())
    }

    /// All bodies of the scene, when it was asked about.
    pub fn bodies(&self) -> impl Iterator<Item = BodyId> + '_ {
        self.bodies.iter().map(|of| of.id)
    }

    /// How many vertices they have together.
    pub fn n_vertices(&self) -> usize {
        self.singles.len() + self.doubles.len()
    }

    /// Bytes of the answer.
    pub(crate) fn bytes(&self) -> u64 {
        let bodies = size_of::<BoundsOfBody>() * self.bodies.capacity();
        let bounds = 4 * self.singles.capacity() + 8 * self.doubles.capacity();
        (bodies + bounds) as u64 + self.touching.bytes()
    }

    /// How far each vertex of a body may move, in the unit of the scene, by the number of the
    /// vertex; `None` if the body was not in the scene. A vertex that belongs to no element has
    /// `most`, as has each vertex of a body that the query is not about.
    pub fn of(&self, body: BodyId) -> Option<Bounds<'_>> {
        let found = self.bodies.binary_search_by_key(&body, |of| of.id);
        let BoundsOfBody {
            is_double,
            first,
            n,
            ..
        } = self.bodies[found.ok()?];
        Some(if is_double {
            Bounds::F64(&self.doubles[first..first + n])
        } else {
            Bounds::F32(&self.singles[first..first + n])
        })
    }

    /// The pairs at distance 0, or at most as far apart as they are thick, whose vertices may not
    /// move at all. So are pairs nearer than the smallest `f64`, or farther than thick by no more
    /// than 2^-1045: ask [`Detector::any`](crate::Detector::any) what touches. Pairs of two
    /// [fixed](crate::Query::fixed) bodies are among them, and unless the query names kinds, an
    /// edge that pierces a face.
    pub fn touching(&self) -> &NearPairs {
        &self.touching
    }

    /// How the answer was found.
    pub fn stats(&self) -> &Stats {
        &self.stats
    }
}

impl std::fmt::Debug for SafeDistances {
    /// How many vertices and touching pairs there are.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut short = f.debug_struct("SafeDistances");
        short.field("n_vertices", &self.n_vertices());
        short.field("n_touching", &self.touching.len());
        short.finish_non_exhaustive()
    }
}
