//! Loops on the threads of the rayon pool at hand; plain loops where the thread is
//! [alone](crate::workers::alone). On wasm, which has one thread, that is known to the compiler:
//! what a pool needs would be a tenth of the module.

use rayon::prelude::*;

use crate::workers::alone::is_alone;
use crate::workers::in_parts::filled_in_parts;

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
    let (made, n) = (Vec::with_capacity(from.len()), from.len());
    let made = filled_in_parts(made, n, BLOCK, 0, |first, writer| {
        for (ix, from) in (first..).zip(&from[first..]).take(writer.n_missing()) {
            writer.put(make(ix, from));
        }
    });
    made.unwrap_or_default()
}
