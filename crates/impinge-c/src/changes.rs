//! What has changed since an older answer: `impinge_pairs_changes`.

use std::cmp::Ordering;

use impinge::Changes;

use crate::answers::{impinge_impacts, impinge_near, impinge_pairs};
use crate::arrays::{self, collect, reserve};
use crate::status::{Failure, clear, destroy, guard, held, put};
use crate::types::*;

const WHAT: &str = "changes";

/// Rows of two answers.
#[derive(Default)]
pub struct impinge_changes {
    kept: Vec<[u64; 2]>,
    new: Vec<u64>,
    gone: Vec<u64>,
}

/// The pairs of an answer in the library's order.
trait Compared {
    const NAME: &'static str;
    /// What makes each pair the same.
    fn keys(&self) -> impl Iterator<Item: Ord>;
    /// Where the answer's rows are in that order; empty if they have it.
    fn order(&self) -> &[usize];
}

impl Compared for impinge_pairs {
    const NAME: &'static str = "pairs";
    fn keys(&self) -> impl Iterator<Item: Ord> {
        self.pairs.iter()
    }
    fn order(&self) -> &[usize] {
        &[]
    }
}

impl Compared for impinge_impacts {
    const NAME: &'static str = "impacts";
    fn keys(&self) -> impl Iterator<Item: Ord> {
        let impacts = self.impacts.iter();
        impacts.map(|impact| (impact.kind, impact.a, impact.b))
    }
    fn order(&self) -> &[usize] {
        &self.order
    }
}

impl Compared for impinge_near {
    const NAME: &'static str = "near_pairs";
    fn keys(&self) -> impl Iterator<Item: Ord> {
        let near = self.near.iter();
        near.map(|pair| (pair.kind, pair.a, pair.b))
    }
    fn order(&self) -> &[usize] {
        &self.order
    }
}

/// Appends to a list that grows as lists do.
fn push<T>(list: &mut Vec<T>, item: T) -> Result<(), Failure> {
    if list.len() == list.capacity() {
        reserve(list, list.len().max(64), WHAT)?;
    }
    list.push(item);
    Ok(())
}

/// The row of each pair.
fn rows(order: &[usize]) -> Result<Vec<u64>, Failure> {
    let mut rows = collect(order.iter().map(|_| 0), WHAT)?;
    for (row, &ix) in order.iter().enumerate() {
        rows[ix] = row as u64;
    }
    Ok(rows)
}

impl impinge_changes {
    fn new<A: Compared>(answer: &A, old: &A) -> Result<Self, Failure> {
        let (before, after) = (rows(old.order())?, rows(answer.order())?);
        let row = |rows: &[u64], ix: usize| rows.get(ix).map_or(ix as u64, |&row| row);
        let mut changes = impinge_changes::default();
        Changes::each(old.keys(), answer.keys(), |order, [old, new]| match order {
            Ordering::Less => push(&mut changes.gone, row(&before, old)),
            Ordering::Greater => push(&mut changes.new, row(&after, new)),
            Ordering::Equal => push(&mut changes.kept, [row(&before, old), row(&after, new)]),
        })?;
        if !before.is_empty() || !after.is_empty() {
            changes.kept.sort_unstable();
            changes.new.sort_unstable();
            changes.gone.sort_unstable();
        }
        Ok(changes)
    }
}

/// # Safety
/// As `impinge.h` says of `_changes`.
unsafe fn changes<A: Compared>(
    answer: *const A,
    old: *const A,
    changes: *mut *mut impinge_changes,
) -> Status {
    guard(|| {
        // SAFETY: the caller's promise.
        unsafe {
            clear(changes, WHAT)?;
            let found = impinge_changes::new(held(answer, A::NAME)?, held(old, "old")?)?;
            put(changes, WHAT, Box::into_raw(Box::new(found)))
        }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_pairs_changes(
    pairs: *const impinge_pairs,
    old: *const impinge_pairs,
    found: *mut *mut impinge_changes,
) -> Status {
    // SAFETY: `impinge.h` says what pointers are, here and in all functions below.
    unsafe { changes(pairs, old, found) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_impacts_changes(
    impacts: *const impinge_impacts,
    old: *const impinge_impacts,
    found: *mut *mut impinge_changes,
) -> Status {
    // SAFETY: see `impinge_pairs_changes`.
    unsafe { changes(impacts, old, found) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_near_changes(
    near_pairs: *const impinge_near,
    old: *const impinge_near,
    found: *mut *mut impinge_changes,
) -> Status {
    // SAFETY: see `impinge_pairs_changes`.
    unsafe { changes(near_pairs, old, found) }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_changes_column(
    changes: *const impinge_changes,
    column: u32,
    view: *mut impinge_array,
) -> Status {
    guard(|| {
        // SAFETY: see `impinge_pairs_changes`.
        let changes = unsafe { held(changes, WHAT) }?;
        let found = match column {
            COLUMN_KEPT => arrays::view(&changes.kept),
            COLUMN_NEW => arrays::view_of(&changes.new),
            COLUMN_GONE => arrays::view_of(&changes.gone),
            _ => {
                return Err(Failure::invalid(format!(
                    "column: changes have no column {column}"
                )));
            }
        };
        // SAFETY: see `impinge_pairs_changes`.
        unsafe { put(view, "view", found) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_changes_destroy(changes: *mut impinge_changes) {
    // SAFETY: see `impinge_pairs_changes`.
    unsafe { destroy(changes) }
}
