//! Where pairs go while a frame is being answered: from many threads, within the limits.
//!
//! ```text
//! workers   block  block  block       about a thousand pairs each, kept from frame to frame
//!               \    |    /
//! held      | ............... |       the memory of the last answer, used again
//! overflow  | chunk | chunk | …       pairs that do not fit there; joined to `held` in the end
//! ```
//!
//! Memory: the answer, and once more the answer while chunks are joined. Every allocation here may
//! fail. Then all pairs are dropped, and the error names what did not fit.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::query::goal::{Goal, Limits};
use crate::scene::error::Error;
use crate::scene::index::Number;
use crate::search::memory;

/// Pairs that a worker gathers before it hands them over.
pub const BLOCK: usize = 1024;

/// Bytes of the first chunk; each further one is twice as large, up to the most.
const FIRST_CHUNK: usize = 1 << 15;
const LARGEST_CHUNK: usize = 1 << 20;

/// Reserves space for `n_more` more items. The error names `what` and how many items the list
/// holds.
///
/// # Errors
/// There is no memory for them.
pub(crate) fn reserve<T>(
    list: &mut Vec<T>,
    n_more: usize,
    what: &'static str,
) -> Result<(), Error> {
    let n = list.len();
    let bytes = n.saturating_add(n_more).saturating_mul(size_of::<T>());
    if memory::may_hold(bytes as u64) && list.try_reserve_exact(n_more).is_ok() {
        return Ok(());
    }
    Err(out_of_memory::<T>(n, n_more, what))
}

/// An empty list with space for `n` items.
///
/// # Errors
/// There is no memory for them.
pub(crate) fn with_capacity<T>(n: usize, what: &'static str) -> Result<Vec<T>, Error> {
    let mut list = Vec::new();
    reserve(&mut list, n, what)?;
    Ok(list)
}

/// A list of `n` equal values.
///
/// # Errors
/// There is no memory for them.
pub(crate) fn filled<T: Clone>(value: T, n: usize, what: &'static str) -> Result<Vec<T>, Error> {
    let mut list = with_capacity(n, what)?;
    list.resize(n, value);
    Ok(list)
}

/// Reserves space for `n_more` more items in a list that grows often. A full list doubles.
///
/// # Errors
/// There is no memory for them.
#[inline]
pub(crate) fn grow<T>(list: &mut Vec<T>, n_more: usize, what: &'static str) -> Result<(), Error> {
    let n = list.len();
    let reserved = list.try_reserve(n_more);
    reserved.map_err(|_| out_of_memory::<T>(n, n_more, what))
}

fn out_of_memory<T>(n: usize, n_more: usize, what: &'static str) -> Error {
    Error::OutOfMemory {
        what,
        n: n as u64,
        needed: (size_of::<T>() as u64).saturating_mul(n_more as u64),
    }
}

/// Takes the pairs that a finder finds: keys, unless they come with a value. Each goes to one of
/// several lists.
#[derive(Debug)]
pub struct Answer<T = u64, const LISTS: usize = 1> {
    is_over: AtomicBool,
    /// The lowest key found, if that is wanted: the number that comes first in its upper half.
    lowest: AtomicU64,
    state: Mutex<State<T, LISTS>>,
}

#[derive(Debug)]
struct State<T, const LISTS: usize> {
    limits: Limits,
    goal: Goal,
    n: u64,
    lists: [List<T>; LISTS],
    held_by_finder: u64,
    error: Option<Error>,
}

#[derive(Debug)]
struct List<T> {
    held: Vec<T>,
    chunks: Vec<Vec<T>>,
}

impl<T> List<T> {
    /// With memory to use.
    fn in_buffer(mut held: Vec<T>) -> Self {
        held.clear();
        List {
            held,
            chunks: Vec::new(),
        }
    }
}

impl<T: Copy, const LISTS: usize> Default for Answer<T, LISTS> {
    fn default() -> Self {
        let rooms = std::array::from_fn(|_| Vec::new());
        Answer::new(Limits::default(), Goal::All, rooms)
    }
}

impl<T: Copy, const LISTS: usize> Answer<T, LISTS> {
    /// Starts an answer. `rooms` is memory that it may use: the lists of an earlier
    /// [`finish`](Answer::finish).
    pub fn new(limits: Limits, goal: Goal, rooms: [Vec<T>; LISTS]) -> Self {
        let mut state = State::new(limits, goal);
        // With a memory budget, the last answer's memory is not used again: its capacity would
        // count beside that of this answer.
        if limits.memory_budget.is_none() {
            state.lists = rooms.map(List::in_buffer);
        }
        Answer {
            is_over: AtomicBool::new(false),
            lowest: AtomicU64::new(u64::MAX),
            state: Mutex::new(state),
        }
    }

    /// Pairs per block; 1 where the first pair ends or narrows the search.
    pub fn block(&self) -> usize {
        match self.state().goal {
            Goal::Any | Goal::Lowest { .. } => 1,
            Goal::All | Goal::Count | Goal::Earliest => BLOCK,
        }
    }

    /// How many work items are gathered before they are paired, at most `room`. They are few where
    /// the first pair ends or narrows the search.
    pub fn most_items(&self, room: usize) -> usize {
        match self.state().goal {
            Goal::Any | Goal::Lowest { .. } => room.min(BLOCK),
            Goal::All | Goal::Count | Goal::Earliest => room,
        }
    }

    /// Takes a block of pairs for one of the lists. Once the answer is over, pairs are dropped.
    pub fn extend(&self, list: usize, block: impl ExactSizeIterator<Item = T>) {
        if block.len() == 0 || self.is_over() {
            return;
        }
        let state = &mut *self.state();
        let result = state.count(block.len() as u64);
        let result = result.and_then(|()| match state.goal {
            Goal::All | Goal::Earliest => state.put(list, block),
            Goal::Count | Goal::Any | Goal::Lowest { .. } => Ok(()),
        });
        self.note(result, state);
    }

    /// Whether nothing more is wanted, so that workers can stop.
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    /// Whether a pair was asked for and found.
    pub fn is_enough(&self) -> bool {
        let state = &*self.state();
        state.goal == Goal::Any && state.n > 0
    }

    /// What ends the frame early, if anything does.
    ///
    /// # Errors
    /// More pairs than allowed, no memory, a memory budget that is too small; a cancellation where
    /// the answer [is enough](Answer::is_enough).
    pub fn check(&self) -> Result<(), Error> {
        match self.is_over() {
            true => Err(self.state().error.clone().unwrap_or(Error::Cancelled)),
            false => Ok(()),
        }
    }

    /// As [`check`](Answer::check), when `n_more` pairs are certain but not yet handed over.
    ///
    /// # Errors
    /// Those of `check`.
    pub fn foresee(&self, n_more: u64) -> Result<(), Error> {
        if n_more > 0 && !self.is_over() {
            let state = &mut *self.state();
            let result = state.foresee(n_more);
            self.note(result, state);
        }
        self.check()
    }

    /// Call this before delivering `n_more` certain pairs. Ends the search at once if they exceed
    /// the limit or the available memory. Returns whether the pairs should be delivered: not if the
    /// search is over or only counts.
    pub fn announce(&self, n_more: u64) -> bool {
        if self.is_over() {
            return false;
        }
        let state = &mut *self.state();
        let result = match state.goal {
            Goal::All | Goal::Earliest => {
                state.foresee(n_more).and_then(|()| state.has_room(n_more))
            }
            Goal::Count | Goal::Any | Goal::Lowest { .. } => state.count(n_more),
        };
        self.note(result, state);
        state.goal.holds() && !self.is_over()
    }

    /// Forgets all pairs. They will be found again by another method.
    pub fn forget(&self) {
        let state = &mut *self.state();
        for list in &mut state.lists {
            list.held.clear();
            list.chunks.clear();
        }
        state.n = 0;
    }

    /// Says how much of the memory budget the finder itself holds. The rest is for the answer.
    pub fn share(&self, held_by_finder: u64) {
        let state = &mut *self.state();
        state.held_by_finder = held_by_finder;
        let result = state.keep_budget();
        self.note(result, state);
    }

    /// All pairs, each list in one piece and unsorted, and how many pairs there are.
    ///
    /// # Errors
    /// Those of [`check`](Answer::check), but none where the answer [is enough](Answer::is_enough).
    pub fn finish(&self) -> Result<([Vec<T>; LISTS], u64), Error> {
        let state = &mut *self.state();
        let joined = match state.error.take() {
            Some(error) => Err(error),
            None => state.join(),
        };
        let n = state.n;
        let State { lists, .. } = std::mem::replace(state, State::new(state.limits, state.goal));
        joined.map(|()| (lists.map(|list| list.held), n))
    }

    fn state(&self) -> MutexGuard<'_, State<T, LISTS>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn note(&self, result: Result<(), Error>, state: &mut State<T, LISTS>) {
        if let Err(error) = result {
            // Free the pairs first, so that the error can be reported without running out of memory
            // again.
            state.drop_pairs();
            state.error = Some(error);
            self.is_over.store(true, Ordering::Relaxed);
        } else if state.goal == Goal::Any && state.n > 0 {
            self.is_over.store(true, Ordering::Relaxed);
        }
    }
}

/// Tells workers when to stop.
pub trait Ending: Copy + Sync {
    /// Whether nothing more is wanted, so that workers can stop.
    fn is_over(&self) -> bool;

    /// What ends the frame early, if anything does.
    ///
    /// # Errors
    /// Those of [`Answer::check`].
    fn check(&self) -> Result<(), Error>;

    /// As [`Answer::share`].
    fn share(&self, held_by_finder: u64);

    /// As [`Answer::most_items`].
    fn most_items(&self, room: usize) -> usize;
}

impl Ending for &Arc<Answer> {
    fn is_over(&self) -> bool {
        Answer::is_over(self)
    }

    fn check(&self) -> Result<(), Error> {
        Answer::check(self)
    }

    fn share(&self, held_by_finder: u64) {
        Answer::share(self, held_by_finder);
    }

    fn most_items(&self, room: usize) -> usize {
        Answer::most_items(self, room)
    }
}

impl Answer {
    /// Takes all keys of a block; it is empty afterwards and keeps its memory.
    pub fn take(&self, block: &mut Vec<u64>) {
        if let Some(by_second) = self.seeks_lowest() {
            let keys = block.iter().map(|&key| turned(key, by_second));
            let lowest = keys.min().unwrap_or(u64::MAX);
            self.lowest.fetch_min(lowest, Ordering::Relaxed);
        }
        self.extend(0, block.drain(..));
    }

    /// Whether the lowest pair is wanted, and then whether by its second element.
    pub fn seeks_lowest(&self) -> Option<bool> {
        match self.state().goal {
            Goal::Lowest { by_second } => Some(by_second),
            Goal::All | Goal::Count | Goal::Any | Goal::Earliest => None,
        }
    }

    /// The number in the upper half of the lowest key found; the highest number before a key is
    /// found. No pair with a higher number can be the lowest.
    pub fn up_to(&self) -> Number {
        Number::new((self.lowest.load(Ordering::Relaxed) >> 32) as u32)
    }

    /// The lowest key found, its lower number in the upper half as in every key.
    pub fn lowest(&self) -> Option<u64> {
        let lowest = self.lowest.load(Ordering::Relaxed);
        let by_second = self.seeks_lowest()?;
        (lowest != u64::MAX).then(|| turned(lowest, by_second))
    }
}

/// A key whose number that comes first is in its upper half, and back.
fn turned(key: u64, by_second: bool) -> u64 {
    key.rotate_left(if by_second { 32 } else { 0 })
}

impl<T, const LISTS: usize> State<T, LISTS> {
    fn new(limits: Limits, goal: Goal) -> Self {
        State {
            limits,
            goal,
            n: 0,
            lists: std::array::from_fn(|_| List::in_buffer(Vec::new())),
            held_by_finder: 0,
            error: None,
        }
    }

    fn drop_pairs(&mut self) {
        self.lists = std::array::from_fn(|_| List::in_buffer(Vec::new()));
    }
}

impl<T: Copy, const LISTS: usize> State<T, LISTS> {
    fn count(&mut self, n_more: u64) -> Result<(), Error> {
        self.n += n_more;
        match self.limits.max_pairs {
            Some(limit) if self.n > limit && self.goal != Goal::Any => Err(Error::TooManyPairs {
                found: self.n,
                limit,
            }),
            _ => Ok(()),
        }
    }

    /// As [`count`](State::count) for pairs that will be counted when they are handed over, unless
    /// one is enough.
    fn foresee(&mut self, n_more: u64) -> Result<(), Error> {
        let n = self.n;
        let result = self.count(n_more);
        if self.goal != Goal::Any {
            self.n = n;
        }
        result
    }

    fn put(
        &mut self,
        list: usize,
        mut block: impl ExactSizeIterator<Item = T>,
    ) -> Result<(), Error> {
        let held = &mut self.lists[list].held;
        let room = held.capacity() - held.len();
        held.extend(block.by_ref().take(room));
        while block.len() > 0 {
            let chunks = &self.lists[list].chunks;
            let full = |chunk: &Vec<T>| chunk.len() == chunk.capacity();
            if chunks.last().is_none_or(full) {
                self.add_chunk(list)?;
            }
            let chunks = &mut self.lists[list].chunks;
            let chunk = chunks.last_mut().expect("there is one with room");
            let room = chunk.capacity() - chunk.len();
            chunk.extend(block.by_ref().take(room));
        }
        Ok(())
    }

    fn add_chunk(&mut self, list: usize) -> Result<(), Error> {
        let List { chunks, .. } = &mut self.lists[list];
        let [first, largest] = [FIRST_CHUNK, LARGEST_CHUNK].map(|bytes| bytes / size_of::<T>());
        let last = chunks.last().map_or(0, Vec::capacity);
        let size = (2 * last).clamp(first, largest);
        let mut chunk = Vec::new();
        // Joining the chunks takes the same once more.
        let joined = self.n.saturating_mul(2 * size_of::<T>() as u64);
        if !memory::may_hold(joined)
            || chunk.try_reserve_exact(size).is_err()
            || chunks.try_reserve(1).is_err()
        {
            return Err(self.no_memory(size));
        }
        chunks.push(chunk);
        self.keep_budget()
    }

    /// Whether `n_more` more pairs fit into the budget, and whether there is memory for them.
    fn has_room(&self, n_more: u64) -> Result<(), Error> {
        let needed = n_more.saturating_mul(size_of::<T>() as u64 + self.limits.besides);
        if let Some(budget) = self.limits.memory_budget
            && needed > budget
        {
            return Err(Error::MemoryBudget {
                what: "the pairs that are certain",
                needed,
                budget,
            });
        }
        let n = usize::try_from(n_more).unwrap_or(usize::MAX);
        with_capacity::<T>(n, "pairs").map_err(|_| self.no_memory(n))?;
        Ok(())
    }

    /// Appends the chunks to what is held.
    fn join(&mut self) -> Result<(), Error> {
        for ix in 0..LISTS {
            let List { held, chunks } = &mut self.lists[ix];
            let more: usize = chunks.iter().map(Vec::len).sum();
            if more > 0 && held.try_reserve_exact(more).is_err() {
                let error = self.no_memory(more);
                self.drop_pairs();
                return Err(error);
            }
            for chunk in chunks.drain(..) {
                held.extend_from_slice(&chunk);
            }
            *chunks = Vec::new();
        }
        Ok(())
    }

    /// Fails if the answer and the finder exceed the budget. Chunks count twice: joining them
    /// copies them.
    fn keep_budget(&self) -> Result<(), Error> {
        let Some(budget) = self.limits.memory_budget else {
            return Ok(());
        };
        let room = |list: &List<T>| {
            let chunks: usize = list.chunks.iter().map(Vec::capacity).sum();
            let joined = match chunks {
                0 => 0,
                more => list.held.capacity() + more,
            };
            list.held.capacity() + chunks + joined
        };
        let room: usize = self.lists.iter().map(room).sum();
        let besides = self.n.saturating_mul(self.limits.besides);
        let needed = self.held_by_finder + (size_of::<T>() * room) as u64 + besides;
        if needed <= budget {
            return Ok(());
        }
        Err(Error::MemoryBudget {
            what: "the pairs found so far and the detector itself",
            needed,
            budget,
        })
    }

    fn no_memory(&self, n_more: usize) -> Error {
        Error::OutOfMemory {
            what: "pairs",
            n: self.n,
            needed: (size_of::<T>() as u64).saturating_mul(n_more as u64),
        }
    }
}
