//! The library as a contestant.

use std::sync::Arc;
use std::time::Instant;

use impinge::{Affinity, BodyId, Detector, Method, Query, Scene, Settings, Stats};
use serde_json::json;

use crate::Failure;
use crate::problem::{Body, Problem};
use crate::runner::{Answer, Runner};

/// How the library gets its positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Feed {
    /// Written in place through `positions_mut` before the clock starts, as for the peers.
    /// Detection checks them, and this is timed.
    InPlace,
    /// Copied and checked by `set_positions` while the clock runs.
    Copied,
    /// The same of an array that is shared, so nothing is copied.
    Shared,
}

/// A detector and its scene.
pub struct Ours {
    scene: Scene,
    ids: Vec<BodyId>,
    query: Query,
    detector: Detector,
    feed: Feed,
    /// The positions that are set in the next frame.
    next: Vec<Arc<Vec<[f32; 3]>>>,
    /// The positions that are set, pose by pose.
    poses: Vec<Vec<Arc<Vec<[f32; 3]>>>>,
    stats: Stats,
}

impl Ours {
    /// Sets the problem up.
    pub fn new(problem: &Problem, settings: Settings, feed: Feed) -> Result<Self, Failure> {
        let (scene, ids, query) = problem.scene()?;
        let pose = |pose: usize| -> Vec<Arc<Vec<[f32; 3]>>> {
            let copy = |body: &Body| Arc::new(body.poses[pose].clone());
            match feed {
                Feed::InPlace => Vec::new(),
                Feed::Copied | Feed::Shared => problem.bodies.iter().map(copy).collect(),
            }
        };
        Ok(Ours {
            scene,
            ids,
            query,
            detector: Detector::new(settings)?,
            feed,
            next: Vec::new(),
            poses: (0..problem.n_poses()).map(pose).collect(),
            stats: Stats::default(),
        })
    }
}

impl Runner for Ours {
    fn name(&self) -> String {
        let settings = self.detector.settings();
        let mut name = format!("impinge {}", settings.method.name());
        if settings.threads != 0 {
            name += &format!(", {} thread", settings.threads);
            if settings.threads > 1 {
                name.push('s');
            }
        }
        if settings.affinity == Affinity::Inherited {
            name += ", helpers anywhere";
        }
        match self.feed {
            Feed::InPlace => {}
            Feed::Copied => name += ", positions copied",
            Feed::Shared => name += ", positions shared",
        }
        name
    }

    fn setting(&self) -> String {
        let settings = self.detector.settings();
        match settings.method {
            Method::Cells => format!(
                "lambda {}, groups of {}",
                settings.density, settings.group_size
            ),
            _ => "default".to_owned(),
        }
    }

    fn load(&mut self, problem: &Problem, pose: usize) -> Result<(), Failure> {
        match self.feed {
            Feed::Copied | Feed::Shared => self.next = self.poses[pose].clone(),
            Feed::InPlace => {
                for (&id, body) in self.ids.iter().zip(&problem.bodies) {
                    self.scene
                        .positions_mut::<f32>(id)?
                        .copy_from_slice(&body.poses[pose]);
                }
            }
        }
        Ok(())
    }

    fn frame(&mut self, verify: bool) -> Result<Answer, Failure> {
        let start = Instant::now();
        for (&id, positions) in self.ids.iter().zip(&self.next) {
            match self.feed {
                Feed::Shared => self.scene.set_positions(id, positions.clone())?,
                _ => self.scene.set_positions(id, &positions[..])?,
            }
        }
        let pairs = self.detector.detect(&self.scene, &self.query)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        self.stats.clone_from(pairs.stats());
        Ok(Answer {
            n_pairs: pairs.len() as u64,
            hash: verify.then(|| pairs.hash()),
            ms,
        })
    }

    fn details(&self) -> serde_json::Value {
        let stats = &self.stats;
        let stages: serde_json::Map<_, _> = stats
            .stages
            .iter()
            .map(|stage| (stage.name.to_owned(), json!(stage.ms)))
            .collect();
        json!({
            "threads": stats.n_threads,
            "clusters": stats.n_clusters,
            "work_items": stats.n_work_items,
            "candidates": stats.n_candidates,
            "unsure": stats.n_unsure,
            "slabs": stats.n_batches,
            "bytes_held": stats.bytes_held,
            "bytes_scene": self.scene.bytes(),
            "stages_ms": stages,
        })
    }
}
