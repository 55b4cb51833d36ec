//! Lists of entries by vertex, one after the other: compressed sparse rows.

use crate::scene::error::Error;

use super::sink::filled;

/// The entries at each vertex, or at whatever is numbered.
#[derive(Debug)]
pub(crate) struct SparseRows<T> {
    /// Where the row of each vertex starts, where the last one ends, and once more its end.
    starts: Vec<usize>,
    entries: Vec<T>,
}

impl<T: Copy + Default> SparseRows<T> {
    /// The rows of `n_rows` vertices from entries, each with the number of its vertex. `entries` is
    /// called twice, and gives the same both times; rows keep its order.
    ///
    /// # Errors
    /// There is no memory for them.
    pub fn new<I: Iterator<Item = (u32, T)>>(
        n_rows: usize,
        entries: impl Fn() -> I,
        what: &'static str,
    ) -> Result<Self, Error> {
        // Counted one place later, so that the second pass can move each start to its end.
        let mut starts = filled(0, n_rows + 2, what)?;
        let mut n = 0;
        for (row, _) in entries() {
            starts[row as usize + 2] += 1;
            n += 1;
        }
        for row in 2..starts.len() {
            starts[row] += starts[row - 1];
        }
        let mut sorted = filled(T::default(), n, what)?;
        for (row, entry) in entries() {
            let next = &mut starts[row as usize + 1];
            sorted[*next] = entry;
            *next += 1;
        }
        Ok(SparseRows {
            starts,
            entries: sorted,
        })
    }

    /// The entries at a vertex; none at one that has no row.
    #[inline]
    pub fn of(&self, row: usize) -> &[T] {
        match self.starts.get(row..row + 2) {
            Some(&[start, end]) => &self.entries[start..end],
            _ => &[],
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.starts[..]) + size_of_val(&self.entries[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_keep_the_order_of_their_entries() {
        let given = [(3, 'a'), (0, 'b'), (3, 'c'), (1, 'd'), (3, 'e')];
        let rows = SparseRows::new(5, || given.iter().copied(), "letters").expect("memory");
        let expected: [&[char]; 7] = [&['b'], &['d'], &[], &['a', 'c', 'e'], &[], &[], &[]];
        for (row, expected) in expected.into_iter().enumerate() {
            assert_eq!(rows.of(row), expected, "{row}");
        }
        let empty = SparseRows::new(0, || [(0, 'a'); 0].into_iter(), "letters").expect("memory");
        assert!(empty.of(0).is_empty() && empty.of(1).is_empty());
    }
}
