//! Groups of at most 64 primitives, and the structures over them that both backends share: boxes,
//! clusters, trees, adjacency masks, the grid. Imports only `elements` and `index`.

pub(crate) mod adjacency;
#[allow(missing_docs)]
pub mod bounds;
pub(crate) mod clusters;
#[allow(missing_docs)]
pub mod grid;
pub(crate) mod hierarchy;
pub(crate) mod hubs;
pub(crate) mod rings;
mod unique;

use rayon::prelude::*;

pub use crate::index::GROUP;

/// A cluster's vertices are padded to whole chunks of this many: a loop over them needs no remainder, and its end
/// is easy to predict.
pub(crate) const CHUNK: usize = 8;

/// Entries that a thread makes at a time.
const BLOCK: usize = 4096;

/// A list made from another one, entry by entry, from its number too, on the threads of the pool at hand. Collecting from
/// a parallel iterator takes four times as long: it counts entries one by one.
pub(crate) fn made_from<A: Sync, B: Copy + Send>(
    from: &[A],
    make: impl Fn(usize, &A) -> B + Sync,
) -> Vec<B> {
    let mut made = Vec::with_capacity(from.len());
    let room = &mut made.spare_capacity_mut()[..from.len()];
    let blocks = room.par_chunks_mut(BLOCK).zip(from.par_chunks(BLOCK));
    blocks.enumerate().for_each(|(block, (room, from))| {
        for (ix, (room, from)) in room.iter_mut().zip(from).enumerate() {
            room.write(make(block * BLOCK + ix, from));
        }
    });
    // SAFETY: the blocks are as many and as long as those of `from`, and each of their entries was written.
    unsafe { made.set_len(from.len()) };
    made
}
