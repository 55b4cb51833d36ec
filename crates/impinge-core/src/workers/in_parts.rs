//! Loops over an answer that was found before: no detector is at hand, so no helpers.

use std::mem::MaybeUninit;
use std::slice;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::alone::is_alone;
use super::{is_forked, n_at_hand};

/// Gives all items to `work`, in parts of at most `size` with the number of the first, on at most
/// so many threads of the rayon pool at hand; 0 for all of its threads. Few items, and all of them
/// in a fork, whose pool has no threads, are one part for the thread at hand.
pub(crate) fn in_parts<T: Send>(
    items: &mut [T],
    size: usize,
    threads: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    // What a pool needs would be a tenth of a wasm module, so the compiler must know this.
    if is_alone() || threads == 1 || items.len() <= size || is_forked() {
        return work(0, items);
    }
    let n_threads = match (threads, n_at_hand()) {
        (0, all) => all,
        (some, all) => some.min(all),
    };
    let parts = Mutex::new(items.chunks_mut(size).enumerate());
    let next = || parts.lock().unwrap_or_else(PoisonError::into_inner).next();
    let numbers = (0..n_threads).into_par_iter().with_max_len(1);
    numbers.for_each(|_| {
        while let Some((ix, part)) = next() {
            work(ix * size, part);
        }
    });
}

/// Writes entries of a part of a list, in order.
pub(crate) struct PartWriter<'a, T>(slice::IterMut<'a, MaybeUninit<T>>);

impl<T> PartWriter<'_, T> {
    /// How many entries are missing.
    pub fn n_missing(&self) -> usize {
        self.0.len()
    }

    /// Writes the next entry; nothing if none is missing.
    #[inline(always)]
    pub fn put(&mut self, entry: T) {
        if let Some(to) = self.0.next() {
            to.write(entry);
        }
    }
}

/// A list of `n` entries, for which `list`, an empty one, has the memory. `fill` puts entries into
/// parts of it, which [`in_parts`] gives it. `None` if it left a gap.
pub(crate) fn filled_in_parts<T: Copy + Send>(
    mut list: Vec<T>,
    n: usize,
    size: usize,
    threads: usize,
    fill: impl Fn(usize, &mut PartWriter<'_, T>) + Sync,
) -> Option<Vec<T>> {
    list.clear();
    let has_gap = AtomicBool::new(false);
    let spare = &mut list.spare_capacity_mut()[..n];
    in_parts(spare, size, threads, |first, part| {
        let mut writer = PartWriter(part.iter_mut());
        fill(first, &mut writer);
        if writer.n_missing() > 0 {
            has_gap.store(true, Ordering::Relaxed);
        }
    });
    if has_gap.into_inner() {
        return None;
    }
    // SAFETY: the parts have `n` entries, and each was written.
    unsafe { list.set_len(n) };
    Some(list)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;
    use std::sync::Barrier;
    use std::thread;

    use super::*;

    fn in_pool(n_threads: usize, work: impl FnOnce() + Send) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads);
        pool.build().expect("threads").install(work);
    }

    #[test]
    fn every_item_is_worked_on_once() {
        in_pool(3, || {
            for threads in 0..5 {
                for n in [0, 1, 7, 8, 9, 100] {
                    let mut items: Vec<usize> = (0..n).collect();
                    in_parts(&mut items, 8, threads, |first, part| {
                        for (ix, item) in part.iter_mut().enumerate() {
                            assert_eq!(*item, first + ix);
                            *item += 1000;
                        }
                    });
                    assert!(items.into_iter().eq(1000..1000 + n));
                }
            }
        });
    }

    #[test]
    fn a_list_is_filled_or_it_is_none() {
        in_pool(3, || {
            for gap in 0..42 {
                let list = filled_in_parts(Vec::with_capacity(50), 40, 8, 0, |first, writer| {
                    let n = writer.n_missing();
                    (first..first + n)
                        .filter(|&ix| ix != gap)
                        .for_each(|ix| writer.put(ix));
                });
                assert_eq!(list.is_none(), gap < 40, "{gap}");
                assert!(list.is_none_or(|list| list.into_iter().eq(0..40)));
            }
            assert_eq!(filled_in_parts(vec![1], 0, 8, 0, |_, _| ()), Some(vec![]));
        });
    }

    #[test]
    fn as_many_threads_work_as_were_asked_for() {
        in_pool(4, || {
            for (threads, expected) in [(0, 4), (1, 1), (2, 2), (4, 4), (9, 4)] {
                // All threads wait until each of them has a part.
                let barrier = Barrier::new(expected);
                let seen = Mutex::new(HashSet::new());
                in_parts(&mut [(); 64], 1, threads, |_, _| {
                    if seen.lock().unwrap().insert(thread::current().id()) {
                        barrier.wait();
                    }
                });
                assert_eq!(seen.into_inner().unwrap().len(), expected, "{threads}");
            }
        });
    }
}
