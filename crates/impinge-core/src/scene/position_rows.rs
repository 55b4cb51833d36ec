//! An array of positions, either a body's own or shared with its owner.

use std::any::Any;
use std::ops::Deref;
use std::sync::Arc;

/// `(n, 3)` positions: an array of the body's own, or one that is shared with its owner and
/// therefore only read.
///
/// ```
/// use std::sync::Arc;
/// use impinge_core::PositionRows;
/// let own = PositionRows::from(vec![[0.0f32; 3]; 8]);
/// let simulated = Arc::new(vec![[0.0f32; 3]; 8]);
/// let shared = PositionRows::shared(Arc::clone(&simulated));
/// assert_eq!(own, shared);
/// assert!(std::ptr::eq(&shared[..], &simulated[..]));
/// ```
pub struct PositionRows<R>(HeldRows<R>);

enum HeldRows<R> {
    Own(Vec<[R; 3]>),
    Shared(SharedRows<R>),
}

/// A slice and the owner of its memory.
struct SharedRows<R> {
    rows: *const [[R; 3]],
    owner: Arc<dyn Any + Send + Sync>,
}

// SAFETY: a `SharedRows` is used like a reference to its rows, which may be sent if `R` is `Sync`.
// The owner is `Send` and `Sync`.
unsafe impl<R: Sync> Send for SharedRows<R> {}
// SAFETY: only shared references to the rows are handed out, and `R` is `Sync`; so is the owner.
unsafe impl<R: Sync> Sync for SharedRows<R> {}

impl<R: Copy> PositionRows<R> {
    /// Shares the rows of an owner, without a copy. The owner lives at least as long as these rows
    /// and their clones. It is asked for its rows once.
    pub fn shared<O: AsRef<[[R; 3]]> + Send + Sync + 'static>(owner: Arc<O>) -> Self {
        let rows: *const [[R; 3]] = (*owner).as_ref();
        PositionRows(HeldRows::Shared(SharedRows { rows, owner }))
    }

    /// Whether the rows are those of an owner.
    pub(crate) fn is_shared(&self) -> bool {
        matches!(self.0, HeldRows::Shared(_))
    }

    /// The rows to be changed; shared ones are copied first.
    pub(crate) fn own(&mut self) -> &mut Vec<[R; 3]> {
        if self.is_shared() {
            self.0 = HeldRows::Own(self.to_vec());
        }
        match &mut self.0 {
            HeldRows::Own(rows) => rows,
            HeldRows::Shared(_) => unreachable!("copied above"),
        }
    }

    /// Copies as many rows as there are. Memory of one's own is reused.
    pub(crate) fn copy_from(&mut self, rows: &[[R; 3]]) {
        match &mut self.0 {
            HeldRows::Own(own) => own.copy_from_slice(rows),
            HeldRows::Shared(_) => self.0 = HeldRows::Own(rows.to_vec()),
        }
    }

    /// Bytes of one's own.
    pub(crate) fn bytes(&self) -> usize {
        match &self.0 {
            HeldRows::Own(rows) => size_of_val(&rows[..]),
            HeldRows::Shared(_) => 0,
        }
    }
}

impl<R> Deref for PositionRows<R> {
    type Target = [[R; 3]];

    #[inline(always)]
    fn deref(&self) -> &[[R; 3]] {
        match &self.0 {
            HeldRows::Own(rows) => rows,
            // SAFETY: `shared` got these rows from a reference to the owner. The `Arc` keeps the
            // owner alive and in its place, and while it exists nobody gets a `&mut` to the owner.
            // So the rows are borrowed as long as `self` is.
            HeldRows::Shared(shared) => unsafe { &*shared.rows },
        }
    }
}

/// Shared rows stay shared.
impl<R: Clone> Clone for PositionRows<R> {
    fn clone(&self) -> Self {
        PositionRows(match &self.0 {
            HeldRows::Own(rows) => HeldRows::Own(rows.clone()),
            HeldRows::Shared(SharedRows { rows, owner }) => HeldRows::Shared(SharedRows {
                rows: *rows,
                owner: Arc::clone(owner),
            }),
        })
    }
}

impl<R: std::fmt::Debug> std::fmt::Debug for PositionRows<R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        (**self).fmt(f)
    }
}

impl<R: PartialEq> PartialEq for PositionRows<R> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<R> From<Vec<[R; 3]>> for PositionRows<R> {
    fn from(rows: Vec<[R; 3]>) -> Self {
        PositionRows(HeldRows::Own(rows))
    }
}

impl<R> FromIterator<[R; 3]> for PositionRows<R> {
    fn from_iter<I: IntoIterator<Item = [R; 3]>>(rows: I) -> Self {
        rows.into_iter().collect::<Vec<_>>().into()
    }
}
