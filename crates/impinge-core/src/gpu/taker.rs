//! Where the results of passes go: pairs to the sink of a frame, the rest of a step's candidates to the host's stages.

use crate::error::Error;
use crate::sink::Answer;
use crate::undecided::Left;

/// Takes what the device says about a part of a step. Returns whether more is wanted.
pub(crate) type TakeLeft<'a> = dyn FnMut(Left<'_>) -> Result<bool, Error> + 'a;

/// Takes the results of complete passes.
pub(super) enum Taker<'a, 'b> {
    /// Pairs that intersect.
    Answer(&'a Answer),
    /// Pairs of a step that may touch.
    Left(&'a mut TakeLeft<'b>),
}

impl Taker<'_, '_> {
    /// To be told of certain pairs, even where a buffer was too small for them.
    pub fn foresee(&self, n_more: u64) -> Result<(), Error> {
        match self {
            Taker::Answer(answer) => answer.foresee(n_more),
            Taker::Left(_) => Ok(()),
        }
    }
}
