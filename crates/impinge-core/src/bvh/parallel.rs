//! Loops on the threads of the rayon pool at hand; plain loops where the thread is
//! [alone](crate::workers::alone). On wasm, which has one thread, that is known to the compiler:
//! what a pool needs would be a tenth of the module.

use std::mem::MaybeUninit;

use rayon::prelude::*;

use crate::workers::alone::is_alone;

/// Entries that a thread makes at a time.
const BLOCK: usize = 4096;

/// The number of threads.
pub(super) fn n_threads() -> usize {
    if is_alone() {
        1
    } else {
        rayon::current_num_threads()
    }
}

/// Does both.
pub(super) fn join(a: impl FnOnce() + Send, b: impl FnOnce() + Send) {
    if is_alone() {
        a();
        b();
    } else {
        rayon::join(a, b);
    }
}

/// What is made of each number below `n`, in order. Each thread has a scratch of its own, and takes
/// at least `at_least` numbers.
pub(super) fn made<S: Send, T: Send>(
    n: usize,
    at_least: usize,
    scratch: impl Fn() -> S + Sync + Send,
    make: impl Fn(&mut S, usize) -> T + Sync + Send,
) -> Vec<T> {
    if is_alone() {
        let mut scratch = scratch();
        return (0..n).map(|ix| make(&mut scratch, ix)).collect();
    }
    let numbers = (0..n).into_par_iter().with_min_len(at_least);
    numbers.map_init(scratch, make).collect()
}

/// Does something with each item.
pub(crate) fn for_each<T: Send>(items: Vec<T>, work: impl Fn(T) + Sync + Send) {
    if is_alone() {
        items.into_iter().for_each(work);
    } else {
        items.into_par_iter().for_each(work);
    }
}

/// A list made from another one, entry by entry, from its number too. Collecting from a parallel
/// iterator takes four times as long: it counts entries one by one.
pub(crate) fn made_from<A: Sync, B: Copy + Send>(
    from: &[A],
    make: impl Fn(usize, &A) -> B + Sync,
) -> Vec<B> {
    let mut made = Vec::with_capacity(from.len());
    let room = &mut made.spare_capacity_mut()[..from.len()];
    let fill = |block: usize, room: &mut [MaybeUninit<B>], from: &[A]| {
        for (ix, (room, from)) in room.iter_mut().zip(from).enumerate() {
            room.write(make(block * BLOCK + ix, from));
        }
    };
    if is_alone() {
        fill(0, room, from);
    } else {
        let blocks = room.par_chunks_mut(BLOCK).zip(from.par_chunks(BLOCK));
        let each = blocks.enumerate();
        each.for_each(|(block, (room, from))| fill(block, room, from));
    }
    // SAFETY: the room is as long as `from`, and each of its entries was written.
    unsafe { made.set_len(from.len()) };
    made
}
