//! How well clusters fit the pose at hand, and have fitted at best.

#[cfg(feature = "gpu")]
use crate::boxes;
#[cfg(feature = "gpu")]
use crate::bvh::bounds::Aabb;
#[cfg(feature = "gpu")]
use crate::bvh::clusters::Clustering;
#[cfg(feature = "gpu")]
use crate::scene::index::ClusterIx;
#[cfg(feature = "gpu")]
use crate::scene::positions::Positions;
use crate::workers::tuning::Tuning;

/// How well clusters have fitted their body at best.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fit {
    best_spread: f64,
}

impl Default for Fit {
    fn default() -> Self {
        Fit::UNKNOWN
    }
}

impl Fit {
    /// Of clusters that were not looked at yet.
    pub const UNKNOWN: Fit = Fit {
        best_spread: f64::INFINITY,
    };

    /// Takes note of the spread in the pose at hand.
    pub fn note(&mut self, spread: f64) {
        self.best_spread = self.best_spread.min(spread);
    }

    /// Takes note of the spread in the pose at hand; whether the body has flowed away from its
    /// clusters.
    pub fn is_stale(&mut self, spread: f64, tuning: &Tuning) -> bool {
        let is_stale = spread > tuning.stale_from * self.best_spread;
        self.note(spread);
        is_stale
    }
}

/// The number of clusters sampled to judge how well all of them fit.
#[cfg(feature = "gpu")]
const SAMPLES: usize = 64;

/// The [`spread`] of evenly spaced clusters. The same clusters are sampled every time.
#[cfg(feature = "gpu")]
pub(crate) fn sampled_spread(clustering: &Clustering, positions: &Positions) -> f64 {
    let n = clustering.n_clusters();
    let n_samples = n.min(SAMPLES);
    let mut whole = Aabb::EMPTY;
    let mut sum = 0.0;
    for sample in 0..n_samples {
        let cluster = ClusterIx::from_usize(sample * n / n_samples);
        let bounds = boxes::of_vertices(positions, clustering.vertices(cluster));
        sum += bounds.half_area();
        whole.join(&bounds);
    }
    spread(sum, whole.half_area())
}

/// The clusters' summed surface over that of the whole: how well they fit the pose at hand. Both
/// are halves.
pub(crate) fn spread(surface: f64, whole: f64) -> f64 {
    if whole > 0.0 && whole.is_finite() && surface.is_finite() {
        surface / whole
    } else {
        1.0
    }
}
