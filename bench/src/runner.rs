//! Contestants: the library with some settings, or a peer.

use crate::Failure;
use crate::problem::Problem;

/// The result of a frame.
#[derive(Debug, Clone, Copy)]
pub struct Answer {
    /// How many pairs were found.
    pub n_pairs: u64,
    /// A hash of the pairs, from exact contestants.
    pub hash: Option<u64>,
    /// Wall time in milliseconds, from positions in memory to pairs in memory.
    pub ms: f64,
}

/// One contestant, set up for one problem.
pub trait Runner {
    /// Its name in tables.
    fn name(&self) -> String;

    /// Its settings, for the record.
    fn setting(&self) -> String;

    /// Rewrites all positions. Not timed.
    fn load(&mut self, problem: &Problem, pose: usize) -> Result<(), Failure>;

    /// Answers for the current positions and measures the time. With `verify`, it may compute a
    /// hash of the answer after the clock has stopped.
    fn frame(&mut self, verify: bool) -> Result<Answer, Failure>;

    /// Counts, bytes and stages of the last frame, for the record.
    fn details(&self) -> serde_json::Value {
        serde_json::Value::Null
    }
}
