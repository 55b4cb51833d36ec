//! The clusters of bodies on the host: found once per topology, and again for a body that has flowed far
//! away from its clusters.

use std::sync::Arc;

use crate::error::Error;
use crate::grouping::bounds::{Bounds, round_down, round_up};
use crate::grouping::clusters::Clustering;
use crate::ids::BodyId;
use crate::positions::Positions;
use crate::run::Job;
use crate::scene::Body;
use crate::stats::Statistics;

/// How much the clusters' surface may grow against the body's before it is clustered again.
const STALE: f64 = 1.5;
/// The number of clusters sampled to judge how well a body's clusters fit its pose.
const SAMPLES: usize = 64;

/// The clusters of a body, kept while its topology stays and they fit its pose.
#[derive(Debug)]
pub struct Cached {
    topology_stamp: u64,
    /// Identifies the clustering: no two of a detector have the same number.
    pub number: u64,
    /// The stamp of the positions that were judged last.
    judged_stamp: u64,
    /// The lowest [`spread`] so far.
    best_spread: f64,
    pub(crate) clustering: Arc<Clustering>,
}

/// Clusterings by slot of the body.
#[derive(Debug, Default)]
pub struct Clusterings {
    known: Vec<Option<Box<Cached>>>,
    n_made: u64,
}

impl Clusterings {
    /// The clustering of a body, if it is known.
    pub fn of(&self, id: BodyId) -> Option<&Cached> {
        self.known.get(id.index())?.as_deref()
    }

    /// Clusters bodies that are new, were re-meshed, or have flowed away from their clusters;
    /// forgets removed bodies. The host does not know the pose of `resident` bodies, so it does not
    /// judge their clusters.
    ///
    /// # Errors
    /// Threads that do not start.
    pub fn update(
        &mut self,
        job: Job<'_>,
        resident: &[BodyId],
        recluster: bool,
        stats: &mut Statistics,
    ) -> Result<(), Error> {
        let Job {
            scene,
            frame,
            workers,
            ..
        } = job;
        let n_slots = frame.layers.last().map_or(0, |last| last.id.index() + 1);
        if self.known.len() < n_slots {
            self.known.resize_with(n_slots, || None);
        }
        if self.known.len() > scene.n_bodies() {
            for (slot, cache) in self.known.iter_mut().enumerate() {
                if !scene.holds(slot) {
                    *cache = None;
                }
            }
        }
        for (ix, participant) in frame.layers.iter().enumerate() {
            let body = frame.body(scene, ix);
            let cache = &mut self.known[participant.id.index()];
            let known = cache
                .as_mut()
                .filter(|cache| cache.topology_stamp == body.topology_stamp());
            if let Some(cache) = known {
                let is_judged = !recluster
                    || cache.judged_stamp == body.positions_stamp()
                    || resident.contains(&participant.id);
                if is_judged || !cache.is_stale(body) {
                    continue;
                }
                stats.n_reclustered += 1;
            }
            stats.n_clustered += 1;
            self.n_made += 1;
            let number = self.n_made;
            let made = workers.install(body.n_primitives(), || Cached::new(body, number))?;
            *cache = Some(Box::new(made));
        }
        Ok(())
    }
}

impl Cached {
    fn new(body: &Body, number: u64) -> Self {
        let (elements, positions) = (body.elements(), body.positions());
        let clustering = Clustering::new(elements, |primitive| {
            bounds_of(positions, elements.corners(primitive))
        });
        Cached {
            topology_stamp: body.topology_stamp(),
            number,
            judged_stamp: body.positions_stamp(),
            best_spread: spread(&clustering, positions),
            clustering: Arc::new(clustering),
        }
    }

    /// Whether the body has flowed away from its clusters.
    fn is_stale(&mut self, body: &Body) -> bool {
        self.judged_stamp = body.positions_stamp();
        let spread = spread(&self.clustering, body.positions());
        let is_stale = spread > STALE * self.best_spread;
        self.best_spread = self.best_spread.min(spread);
        is_stale
    }
}

/// The summed surface of evenly spaced clusters, divided by the surface of the box around them: how well the
/// clusters fit the current pose. Every frame samples the same clusters for both.
fn spread(clustering: &Clustering, positions: &Positions) -> f64 {
    let n = clustering.n_clusters();
    let n_samples = n.min(SAMPLES);
    let mut whole = Bounds::EMPTY;
    let mut sum = 0.0;
    for sample in 0..n_samples {
        let bounds = bounds_of(positions, clustering.vertices(sample * n / n_samples));
        sum += bounds.half_area();
        whole.join(&bounds);
    }
    let whole = whole.half_area();
    if whole > 0.0 && sum.is_finite() {
        sum / whole
    } else {
        1.0
    }
}

pub fn bounds_of(positions: &Positions, corners: &[u32]) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    for &corner in corners {
        let point = positions.point(corner as usize);
        bounds.join(&Bounds {
            min: point.map(round_down),
            max: point.map(round_up),
        });
    }
    bounds
}
