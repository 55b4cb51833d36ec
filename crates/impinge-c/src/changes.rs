//! What has changed since an older answer: `impinge_pairs_changes`.

use std::cmp::Ordering;

use impinge::Changes;

use crate::answers::{impinge_impacts, impinge_near, impinge_pairs};
use crate::arrays::{self, reserve};
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

/// The pairs of an answer.
trait Compared {
    const NAME: &'static str;
    /// Refuses an older answer with which it cannot be compared.
    fn check_comparable(&self, old: &Self) -> Result<(), impinge::Error>;
    /// What makes each pair the same.
    fn keys(&self) -> impl Iterator<Item: Ord>;
}

impl Compared for impinge_pairs {
    const NAME: &'static str = "pairs";
    fn check_comparable(&self, old: &Self) -> Result<(), impinge::Error> {
        self.pairs.check_comparable(&old.pairs)
    }
    fn keys(&self) -> impl Iterator<Item: Ord> {
        self.pairs.iter()
    }
}

impl Compared for impinge_impacts {
    const NAME: &'static str = "impacts";
    fn check_comparable(&self, old: &Self) -> Result<(), impinge::Error> {
        self.impacts.check_comparable(&old.impacts, None)
    }
    fn keys(&self) -> impl Iterator<Item: Ord> {
        let impacts = self.impacts.iter();
        impacts.map(|impact| (impact.kind, impact.a, impact.b))
    }
}

impl Compared for impinge_near {
    const NAME: &'static str = "near_pairs";
    fn check_comparable(&self, old: &Self) -> Result<(), impinge::Error> {
        self.near.check_comparable(&old.near, None)
    }
    fn keys(&self) -> impl Iterator<Item: Ord> {
        let near = self.near.iter();
        near.map(|pair| (pair.kind, pair.a, pair.b))
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

impl impinge_changes {
    fn new<A: Compared>(answer: &A, old: &A) -> Result<Self, Failure> {
        answer.check_comparable(old)?;
        let mut changes = impinge_changes::default();
        Changes::each(old.keys(), answer.keys(), |order, [old, new]| match order {
            Ordering::Less => push(&mut changes.gone, old as u64),
            Ordering::Greater => push(&mut changes.new, new as u64),
            Ordering::Equal => push(&mut changes.kept, [old as u64, new as u64]),
        })?;
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
