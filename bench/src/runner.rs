//! Whoever answers a problem: the library with some settings, or a peer.

use crate::Failure;
use crate::problem::Problem;

/// What came out of a frame.
#[derive(Debug, Clone, Copy)]
pub struct Answer {
    /// How many pairs were found.
    pub n_pairs: u64,
    /// A hash of them, from contestants whose answer is exact.
    pub hash: Option<u64>,
    /// Wall time in milliseconds, from positions in memory to pairs in memory.
    pub ms: f64,
}

/// One contestant, set up for one problem.
pub trait Runner {
    /// Its name in tables.
    fn name(&self) -> String;

    /// The settings it runs with, for the record.
    fn setting(&self) -> String;

    /// Rewrites all positions. Not timed.
    fn load(&mut self, problem: &Problem, pose: usize) -> Result<(), Failure>;

    /// Answers as things are now and says how long that took. With `verify`, what comes after the clock
    /// has stopped may include a hash of the answer.
    fn frame(&mut self, verify: bool) -> Result<Answer, Failure>;

    /// Counts, bytes and stages of the last frame, for the record.
    fn details(&self) -> serde_json::Value {
        serde_json::Value::Null
    }
}
