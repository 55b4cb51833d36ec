//! The clusters of bodies on the host: found once per topology, and again for a body that has flowed far
//! away from its clusters.

use std::sync::Arc;

use crate::clusterings::{Clustered, Fit, Store, sampled_spread};
use crate::error::Error;
use crate::grouping::clusters::Clustering;
use crate::hull;
use crate::ids::BodyId;
use crate::plan::Layer;
use crate::run::Job;
use crate::scene::Body;
use crate::stats::Statistics;
use crate::tuning::Tuning;

/// The clusters of a body, kept while its topology stays and they fit its pose.
#[derive(Debug)]
pub struct Cached {
    topology_stamp: u64,
    /// The stamp of the positions that were judged last.
    judged_stamp: u64,
    /// How well the sampled clusters have fitted the body.
    fit: Fit,
    pub(crate) clustering: Arc<Clustering>,
}

/// Clusterings by slot of the body.
#[derive(Debug, Default)]
pub struct Clusterings {
    known: Store<Cached>,
}

impl Clusterings {
    /// The clustering of a body, if it is known.
    pub fn of(&self, id: BodyId) -> Option<&Cached> {
        self.known.of(id)
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
        let tuning = Tuning::default();
        let is_stale = |cached: &mut Cached, layer: &Layer, body: &Body| {
            recluster
                && cached.judged_stamp != body.positions_stamp()
                && !resident.contains(&layer.id)
                && cached.is_stale(body, &tuning)
        };
        self.known
            .update(job, stats, is_stale, |body, _| Cached::new(body))
    }
}

impl Clustered for Cached {
    fn topology_stamp(&self) -> u64 {
        self.topology_stamp
    }

    fn n_clusters(&self) -> usize {
        self.clustering.n_clusters()
    }
}

impl Cached {
    fn new(body: &Body) -> Self {
        let (elements, positions) = (body.elements(), body.positions());
        let clustering = Clustering::new(elements, hull::centers(elements, positions));
        let mut fit = Fit::UNKNOWN;
        fit.note(sampled_spread(&clustering, positions));
        Cached {
            topology_stamp: body.topology_stamp(),
            judged_stamp: body.positions_stamp(),
            fit,
            clustering: Arc::new(clustering),
        }
    }

    /// Whether the body has flowed away from its clusters.
    fn is_stale(&mut self, body: &Body, tuning: &Tuning) -> bool {
        self.judged_stamp = body.positions_stamp();
        let spread = sampled_spread(&self.clustering, body.positions());
        self.fit.is_stale(spread, tuning)
    }
}
