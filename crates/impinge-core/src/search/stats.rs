//! Counts and times of a frame.

use crate::workers::clock::Instant;
use crate::workers::tuning::Ways;

/// A word that the program knows. By this name serde does not take it for borrowed from its input.
type Word = &'static str;

/// Time spent in one stage.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Stage {
    /// The stage's name, the same on every backend: `bounds`, `traversal`, `pairing`, …
    #[cfg_attr(feature = "serde", serde(with = "words"))]
    pub name: Word,
    /// Wall time in milliseconds.
    pub ms: f64,
}

/// Counts and times of one frame. The pairs never depend on any of this.
#[derive(Debug, Default, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default))]
pub struct Stats {
    /// `"cpu"` or the GPU's name.
    pub backend: String,
    /// `"clusters"`, `"cells"` or `"naive"`.
    #[cfg_attr(feature = "serde", serde(with = "words"))]
    pub method: Word,
    /// Threads used.
    pub n_threads: usize,
    /// The stages in the order in which they ran.
    pub stages: Vec<Stage>,
    /// Wall time of the whole frame in milliseconds.
    pub total_ms: f64,
    /// `Cells`: cells of the first level along x, y, z.
    pub grid: Option<[u32; 3]>,
    /// `Cells`: cells that went through the second level.
    pub n_subdivided: u64,
    /// `Cells`: entries of the cell lists, where an element counts once per cell. Elements that
    /// no other body comes near may have none.
    pub n_entries: u64,
    /// `Clusters`: clusters of all bodies that take part.
    pub n_clusters: u64,
    /// `Clusters` on the CPU: clusters that were proven to lie beside all other bodies, so that
    /// their boxes were not needed.
    pub n_culled: u64,
    /// Work items: pairs of groups whose elements were paired.
    pub n_work_items: u64,
    /// Pairs whose boxes overlap and that the adjacency rule admits.
    pub n_candidates: u64,
    /// Candidates that the floating-point filter left to exact arithmetic. On a GPU: that the
    /// filter on the device left to the CPU, which decides them with a filter in `f64` and then
    /// exactly.
    pub n_unsure: u64,
    /// Bodies that were clustered in this frame, for the first time or again.
    pub n_clustered: u64,
    /// Of those, bodies clustered again because they had flowed away from the pose in which they
    /// were clustered.
    pub n_reclustered: u64,
    /// Parts in which the work was done; 1 if the memory budget allowed all of it at once.
    pub n_batches: u64,
    /// GPU: pieces in which the scene was answered because the device or the memory budget cannot
    /// hold all of it; 0 if it can.
    pub n_pieces: u64,
    /// Stages that were run again because a buffer had to grow.
    pub n_reruns: u64,
    /// Bytes that the detector holds, the answer included.
    pub bytes_held: u64,
    /// Not for users: the ways that the frame went.
    #[doc(hidden)]
    #[cfg_attr(feature = "serde", serde(skip))]
    pub ways: Ways,
}

impl Clone for Stats {
    fn clone(&self) -> Self {
        let mut stats = Stats::default();
        stats.clone_from(self);
        stats
    }

    /// Keeps the allocated memory.
    fn clone_from(&mut self, other: &Self) {
        self.stages.clone_from(&other.stages);
        self.backend.clone_from(&other.backend);
        *self = Stats {
            stages: std::mem::take(&mut self.stages),
            backend: std::mem::take(&mut self.backend),
            ..*other
        };
    }
}

impl Stats {
    /// All counts, each with the name of its field, in the order of the fields.
    pub fn counts(&self) -> impl Iterator<Item = (&'static str, u64)> {
        macro_rules! named {
            ($($count:ident)*) => {{
                let Stats {
                    backend: _,
                    method: _,
                    stages: _,
                    total_ms: _,
                    grid: _,
                    ways: _,
                    $($count),*
                } = self;
                [$((stringify!($count), *$count as u64)),*]
            }};
        }
        let counts = named! {
            n_threads n_subdivided n_entries n_clusters n_culled n_work_items n_candidates n_unsure
            n_clustered n_reclustered n_batches n_pieces n_reruns bytes_held
        };
        counts.into_iter()
    }

    /// Says how a question is answered, of statistics that are clear or hold what came before it.
    pub(crate) fn found_by(&mut self, method: &'static str, backend: &str, n_threads: usize) {
        (self.method, self.n_threads) = (method, n_threads);
        self.backend.clear();
        self.backend.push_str(backend);
    }

    /// Clears everything, but keeps the allocated memory.
    pub(crate) fn clear(&mut self) {
        self.clone_from(&Stats::default());
    }

    /// Adds time to a stage; appends the stage if it is new.
    #[doc(hidden)]
    pub fn add_ms(&mut self, name: &'static str, ms: f64) {
        match self.stages.iter_mut().find(|stage| stage.name == name) {
            Some(stage) => stage.ms += ms,
            None => self.stages.push(Stage { name, ms }),
        }
    }

    /// Adds the stages and the work of a frame to those of the frames before.
    pub(crate) fn add(&mut self, frame: &Self) {
        let mut all = frame.clone();
        for stage in &frame.stages {
            self.add_ms(stage.name, stage.ms);
        }
        std::mem::swap(&mut all.stages, &mut self.stages);
        let sums = [
            (&mut all.n_culled, self.n_culled),
            (&mut all.n_work_items, self.n_work_items),
            (&mut all.n_candidates, self.n_candidates),
            (&mut all.n_unsure, self.n_unsure),
            (&mut all.n_clustered, self.n_clustered),
            (&mut all.n_reclustered, self.n_reclustered),
            (&mut all.n_batches, self.n_batches),
        ];
        for (sum, before) in sums {
            *sum += before;
        }
        all.bytes_held = all.bytes_held.max(self.bytes_held);
        *self = all;
    }

    /// Runs one stage and adds its wall time.
    #[doc(hidden)]
    pub fn time<T>(&mut self, name: &'static str, stage: impl FnOnce(&mut Self) -> T) -> T {
        let start = Instant::now();
        let result = stage(self);
        self.add_ms(name, start.elapsed().as_secs_f64() * 1e3);
        result
    }

    /// Milliseconds of a stage; 0 if it did not run.
    pub fn stage_ms(&self, name: &str) -> f64 {
        self.stages
            .iter()
            .find(|stage| stage.name == name)
            .map_or(0.0, |stage| stage.ms)
    }
}

/// Words of statistics that were written by another run.
#[cfg(feature = "serde")]
mod words {
    use std::collections::BTreeSet;
    use std::sync::{Mutex, PoisonError};

    use serde::{Deserialize, Deserializer, Serializer};

    use super::Word;

    pub fn serialize<S: Serializer>(word: &Word, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(word)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Word, D::Error> {
        String::deserialize(from).map(kept)
    }

    /// The word as one that lives as long as the program. Each is kept once, and there are few:
    /// methods and stages.
    fn kept(word: String) -> Word {
        static KEPT: Mutex<BTreeSet<Word>> = Mutex::new(BTreeSet::new());
        let mut all = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        match all.get(word.as_str()) {
            Some(held) => held,
            None => {
                let word: Word = word.leak();
                all.insert(word);
                word
            }
        }
    }
}
