//! Work in tasks: shared among the workers of a detector, and stopped soon after it is cancelled.

use std::sync::{Mutex, PoisonError};

use crate::query::progress::{Control, Pieces};
use crate::scene::error::Error;
use crate::search::sink::{reserve, with_capacity};
use crate::workers::Workers;

/// The threads, and what stops them.
#[derive(Clone, Copy)]
pub(crate) struct Work<'a> {
    pub workers: &'a Workers,
    pub control: &'a Control,
}

/// What is kept of equal items.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Equal {
    All,
    Once,
}

/// Items merged between two looks at the control.
const BLOCK: usize = 1 << 16;

impl Work<'_> {
    /// To be called between pieces of work that one thread does.
    pub fn step(&self) -> Result<(), Error> {
        self.control.step(0, 1)
    }

    /// Calls `task(ix, item)` once for each item, until one fails.
    ///
    /// # Errors
    /// Cancellation, or one of the errors of the tasks.
    pub fn each<T: Send>(
        &self,
        items: &mut [T],
        task: impl Fn(usize, &mut T) -> Result<(), Error> + Sync,
    ) -> Result<(), Error> {
        let n = items.len();
        let items: Vec<Mutex<&mut T>> = items.iter_mut().map(Mutex::new).collect();
        let failed: Mutex<Option<Error>> = Mutex::new(None);
        let failure = || failed.lock().unwrap_or_else(PoisonError::into_inner);
        let pieces = Pieces::new(self.control, n);
        self.workers
            .for_each(&mut vec![(); self.workers.n()], n, |(), ix| {
                if failure().is_some() {
                    return;
                }
                let step = pieces.take();
                let mut item = items[ix].lock().unwrap_or_else(PoisonError::into_inner);
                if let Err(error) = step.and_then(|()| task(ix, &mut item)) {
                    failure().get_or_insert(error);
                }
            });
        drop(items);
        let failed = failed.into_inner().unwrap_or_else(PoisonError::into_inner);
        failed.map_or(Ok(()), Err)
    }

    /// One sorted list of all items of some sorted lists: neighbours are merged, two and two, until
    /// one list is left.
    ///
    /// # Errors
    /// Cancellation; no memory.
    pub fn merged<T: Ord + Copy + Send>(
        &self,
        mut runs: Vec<Vec<T>>,
        equal: Equal,
        what: &'static str,
    ) -> Result<Vec<T>, Error> {
        while runs.len() > 1 {
            let mut pairs: Vec<(Vec<T>, Vec<T>)> = Vec::with_capacity(runs.len().div_ceil(2));
            let mut rest = runs.into_iter();
            while let Some(first) = rest.next() {
                pairs.push((first, rest.next().unwrap_or_default()));
            }
            self.each(&mut pairs, |_, (first, second)| {
                let merged = match second[..] {
                    [] => return Ok(()),
                    _ => self.merge(first, second, equal, what)?,
                };
                (*first, *second) = (merged, Vec::new());
                Ok(())
            })?;
            runs = pairs.into_iter().map(|(merged, _)| merged).collect();
        }
        Ok(runs.pop().unwrap_or_default())
    }

    fn merge<T: Ord + Copy>(
        &self,
        first: &[T],
        second: &[T],
        equal: Equal,
        what: &'static str,
    ) -> Result<Vec<T>, Error> {
        let mut merged = with_capacity(first.len() + second.len(), what)?;
        let (mut first, mut second) = (first, second);
        while let ([x, rest_x @ ..], [y, rest_y @ ..]) = (first, second) {
            if merged.len().is_multiple_of(BLOCK) {
                self.step()?;
            }
            let takes_first = x <= y;
            merged.push(if takes_first { *x } else { *y });
            if !takes_first || (equal == Equal::Once && x == y) {
                second = rest_y;
            }
            if takes_first {
                first = rest_x;
            }
        }
        for rest in [first, second] {
            reserve(&mut merged, rest.len(), what)?;
            merged.extend_from_slice(rest);
        }
        Ok(merged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::query::progress::CancelToken;

    #[test]
    fn lists_are_merged_whatever_their_number() {
        let control = Control::new();
        for threads in [1, 3] {
            let workers = Workers::new(threads);
            let work = Work {
                workers: &workers,
                control: &control,
            };
            for n_runs in 0..9u32 {
                let runs: Vec<Vec<u32>> = (0..n_runs)
                    .map(|run| (0..run * 5 % 7).map(|x| x * (run + 1)).collect())
                    .collect();
                let mut all: Vec<u32> = runs.concat();
                all.sort_unstable();
                assert_eq!(work.merged(runs.clone(), Equal::All, "").unwrap(), all);
                all.dedup();
                assert_eq!(work.merged(runs, Equal::Once, "").unwrap(), all);
            }
        }
    }

    #[test]
    fn a_failed_task_and_a_cancelled_token_end_the_work() {
        let workers = Workers::new(2);
        let token = CancelToken::new();
        let control = Control::new().cancel(&token);
        let work = Work {
            workers: &workers,
            control: &control,
        };
        let bad = |ix, _: &mut u8| match ix {
            5 => Err(Error::Threads("a test".to_owned())),
            _ => Ok(()),
        };
        assert!(matches!(
            work.each(&mut [0; 9], bad),
            Err(Error::Threads(_))
        ));
        token.cancel();
        let stopped = work.merged(vec![vec![1], vec![2]], Equal::All, "");
        assert!(matches!(stopped, Err(Error::Cancelled)));
    }
}
