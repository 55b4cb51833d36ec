//! Arrays of callers, as rows of Rust: checked, and copied only where rows are not packed. And
//! views of our own arrays.

use std::borrow::Cow;
use std::ffi::c_void;

use impinge::{Elements, Positions};

use crate::status::Failure;
use crate::types::*;

/// Memory for `n` more rows.
pub fn reserve<T>(list: &mut Vec<T>, n: usize, what: &str) -> Result<(), Failure> {
    list.try_reserve_exact(n)
        .map_err(|_| Failure::out_of_memory(what, n))
}

/// All of an iterator whose length is known.
pub fn collect<T>(items: impl ExactSizeIterator<Item = T>, what: &str) -> Result<Vec<T>, Failure> {
    let mut list = Vec::new();
    reserve(&mut list, items.len(), what)?;
    list.extend(items);
    Ok(list)
}

/// A copy of a slice.
pub fn copied<T: Copy>(rows: &[T], what: &str) -> Result<Vec<T>, Failure> {
    collect(rows.iter().copied(), what)
}

/// Rows of `N` numbers of type `T` in memory of the caller.
#[derive(Clone, Copy)]
struct Strided<T, const N: usize> {
    data: *const T,
    rows: usize,
    /// In bytes.
    strides: [isize; 2],
}

impl<T: Copy, const N: usize> Strided<T, N> {
    /// Checks what can be checked: NULL, alignment, strides.
    fn new(array: &impinge_array, what: &str) -> Result<Self, Failure> {
        let size = size_of::<T>() as isize;
        let packed = [N as isize * size, size];
        let strides = match [array.row_stride, array.column_stride] {
            [0, 0] => packed,
            given => given,
        };
        let view = Strided {
            data: array.data.cast::<T>(),
            rows: array.rows,
            strides,
        };
        if array.rows == 0 {
            return Ok(view);
        }
        if array.data.is_null() {
            return Err(Failure::invalid(format!(
                "{what}: data is NULL, but there are {} rows",
                array.rows
            )));
        }
        if !view.data.is_aligned() {
            return Err(Failure::invalid(format!(
                "{what}: data at {:p} is not aligned to the {size} bytes of a number",
                array.data
            )));
        }
        // So the classes of C++ pass on rows of another length.
        if let [1, columns @ ..=-1] = strides
            && size > 1
        {
            let columns = columns.unsigned_abs();
            let turned = match array.rows == N && columns != N {
                true => ", one row per position or element: transpose the matrix",
                false => "",
            };
            return Err(Failure::invalid(format!(
                "{what}: rows of {columns} numbers given, {N} needed{turned}"
            )));
        }
        for (name, stride, n) in [
            ("row_stride", strides[0], array.rows),
            ("column_stride", strides[1], N),
        ] {
            if stride == 1 && size > 1 {
                // And a list of numbers that does not end with a row.
                return Err(Failure::invalid(format!(
                    "{what}: rows are not of {N} numbers each ({name} is 1: strides are in bytes)"
                )));
            }
            if stride % size != 0 {
                return Err(Failure::invalid(format!(
                    "{what}: {name} is {stride}, which is no multiple of the {size} bytes of a number: strides are in bytes"
                )));
            }
            if stride == 0 && n > 1 {
                return Err(Failure::invalid(format!(
                    "{what}: {name} is 0, so all {n} numbers along it would be one: both strides are 0 for packed rows, or none"
                )));
            }
            let extent = (n as u128 - 1) * stride.unsigned_abs() as u128;
            if extent > isize::MAX as u128 {
                return Err(Failure::invalid(format!(
                    "{what}: {n} steps of {name} {stride} are more than memory has"
                )));
            }
        }
        Ok(view)
    }

    fn is_packed(&self) -> bool {
        let size = size_of::<T>() as isize;
        self.strides == [N as isize * size, size]
    }

    /// The rows where they lie, if they are packed.
    ///
    /// # Safety
    /// The caller's array is as described, and does not change while the slice lives.
    unsafe fn packed<'a>(&self) -> Option<&'a [[T; N]]> {
        if self.rows == 0 {
            return Some(&[]);
        }
        // SAFETY: as promised; data is aligned, is not NULL, and holds packed rows.
        self.is_packed()
            .then(|| unsafe { std::slice::from_raw_parts(self.data.cast::<[T; N]>(), self.rows) })
    }

    /// # Safety
    /// The caller's array is as described, and `row` is one of its rows.
    unsafe fn row(&self, row: usize) -> [T; N] {
        std::array::from_fn(|column| {
            let [by_row, by_column] = self.strides;
            let offset = row as isize * by_row + column as isize * by_column;
            // SAFETY: as promised; data and strides are aligned.
            unsafe { self.data.byte_offset(offset).read() }
        })
    }

    /// # Safety
    /// The caller's array is as described.
    unsafe fn gathered(&self, what: &str) -> Result<Vec<[T; N]>, Failure> {
        // SAFETY: as promised.
        collect((0..self.rows).map(|row| unsafe { self.row(row) }), what)
    }
}

/// The name of a type of numbers.
fn name(of: u32) -> String {
    let names = ["F32", "F64", "U32", "I32", "U64", "I64", "U8"];
    match names.get((of as usize).wrapping_sub(1)) {
        Some(name) => format!("IMPINGE_{name}"),
        None => format!("{of}"),
    }
}

/// Positions of a caller: rows of `N` floats.
pub enum Floats<'a, const N: usize> {
    F32(Cow<'a, [[f32; N]]>),
    F64(Cow<'a, [[f64; N]]>),
}

/// Runs the same code for both precisions: `with_rows!(floats, |rows| …)`.
macro_rules! with_rows {
    ($floats:expr, |$rows:ident| $body:expr) => {
        match $floats {
            $crate::arrays::Floats::F32($rows) => $body,
            $crate::arrays::Floats::F64($rows) => $body,
        }
    };
}
pub(crate) use with_rows;

impl<const N: usize> Floats<'_, N> {
    pub fn len(&self) -> usize {
        with_rows!(self, |rows| rows.len())
    }

    /// One row in double precision.
    pub fn wide(&self, row: usize) -> [f64; N] {
        match self {
            Floats::F32(rows) => rows[row].map(f64::from),
            Floats::F64(rows) => rows[row],
        }
    }
}

impl<const N: usize> Floats<'_, N> {
    /// All rows in double precision.
    pub fn widened(&self, what: &str) -> Result<Vec<[f64; N]>, Failure> {
        collect((0..self.len()).map(|row| self.wide(row)), what)
    }
}

impl Floats<'_, 3> {
    /// A copy that a scene may keep.
    pub fn into_owned(self) -> Result<Positions, Failure> {
        const WHAT: &str = "positions";
        Ok(match self {
            Floats::F32(Cow::Borrowed(rows)) => copied(rows, WHAT)?.into(),
            Floats::F64(Cow::Borrowed(rows)) => copied(rows, WHAT)?.into(),
            Floats::F32(Cow::Owned(rows)) => rows.into(),
            Floats::F64(Cow::Owned(rows)) => rows.into(),
        })
    }
}

/// Floats of a caller, where they lie if they are packed, else copied.
///
/// # Safety
/// The array is as described and does not change while the answer lives.
pub unsafe fn floats<'a, const N: usize>(
    array: &impinge_array,
    what: &str,
) -> Result<Floats<'a, N>, Failure> {
    /// # Safety
    /// As `floats`.
    unsafe fn rows<'a, T: Copy, const N: usize>(
        array: &impinge_array,
        what: &str,
    ) -> Result<Cow<'a, [[T; N]]>, Failure> {
        let view = Strided::<T, N>::new(array, what)?;
        // SAFETY: the caller's promise.
        match unsafe { view.packed() } {
            Some(rows) => Ok(Cow::Borrowed(rows)),
            // SAFETY: the caller's promise.
            None => Ok(Cow::Owned(unsafe { view.gathered(what) }?)),
        }
    }
    match array.r#type {
        // Of no rows the type does not count.
        other if array.rows == 0 && other != F64 => Ok(Floats::F32(Cow::Borrowed(&[]))),
        // SAFETY: the caller's promise.
        F32 => Ok(Floats::F32(unsafe { rows(array, what) }?)),
        // SAFETY: the caller's promise.
        F64 => Ok(Floats::F64(unsafe { rows(array, what) }?)),
        other => Err(Failure::invalid(format!(
            "{what}: its type is {}, where IMPINGE_F32 or IMPINGE_F64 is needed",
            name(other)
        ))),
    }
}

/// Vertex indices of a caller, copied.
///
/// # Safety
/// The array is as described.
pub unsafe fn indices<const N: usize>(
    array: &impinge_array,
    what: &str,
) -> Result<Vec<[u32; N]>, Failure> {
    /// # Safety
    /// As `indices`.
    unsafe fn narrow<T: Copy + TryInto<u32> + std::fmt::Display, const N: usize>(
        array: &impinge_array,
        what: &str,
    ) -> Result<Vec<[u32; N]>, Failure> {
        let view = Strided::<T, N>::new(array, what)?;
        let mut narrow = Vec::new();
        reserve(&mut narrow, view.rows, what)?;
        for row in 0..view.rows {
            let mut corners = [0; N];
            // SAFETY: the caller's promise.
            for (corner, wide) in corners.iter_mut().zip(unsafe { view.row(row) }) {
                *corner = wide.try_into().map_err(|_| {
                    Failure::invalid(format!(
                        "{what}: row {row} has {wide}, where 0 to {} is allowed",
                        u32::MAX
                    ))
                })?;
            }
            narrow.push(corners);
        }
        Ok(narrow)
    }
    // SAFETY: the caller's promise, in all cases.
    unsafe {
        match array.r#type {
            // Of no rows the type does not count.
            _ if array.rows == 0 => Ok(Vec::new()),
            U32 => {
                let view = Strided::<u32, N>::new(array, what)?;
                match view.packed() {
                    Some(rows) => copied(rows, what),
                    None => view.gathered(what),
                }
            }
            I32 => narrow::<i32, N>(array, what),
            U64 => narrow::<u64, N>(array, what),
            I64 => narrow::<i64, N>(array, what),
            U8 => Err(Failure::invalid(format!(
                "{what}: its type is IMPINGE_U8, where integers of 32 or 64 bits are needed"
            ))),
            other => Err(Failure::invalid(format!(
                "{what}: its type is {}, where an integer is needed: are {what} and positions swapped?",
                name(other)
            ))),
        }
    }
}

/// Flags of a caller, copied: 0 and 1 of any integer type, or bytes.
///
/// # Safety
/// The array is as described.
pub unsafe fn flags(array: &impinge_array, what: &str) -> Result<Vec<bool>, Failure> {
    let refuse = |row: usize, given: u32| {
        Failure::invalid(format!(
            "{what}: row {row} has {given}, where 0 or 1 is allowed"
        ))
    };
    let flag = |(row, given): (usize, u32)| match given {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(refuse(row, given)),
    };
    if array.r#type != U8 {
        // SAFETY: the caller's promise.
        let rows = unsafe { indices::<1>(array, what) }?;
        return rows
            .as_flattened()
            .iter()
            .copied()
            .enumerate()
            .map(flag)
            .collect();
    }
    let view = Strided::<u8, 1>::new(array, what)?;
    // SAFETY: the caller's promise.
    let rows = (0..view.rows).map(|row| (row, unsafe { view.row(row) }[0].into()));
    rows.map(flag).collect()
}

/// Elements of a kind, copied.
///
/// # Safety
/// The array is as described.
pub unsafe fn elements(
    kind: u32,
    array: &impinge_array,
    n_vertices: usize,
) -> Result<Elements, Failure> {
    // SAFETY: the caller's promise, in all cases.
    unsafe {
        Ok(match kind {
            POINTS if array.rows > 0 => {
                return Err(Failure::invalid(format!(
                    "elements: {} rows, but points have one element per position and are given none",
                    array.rows
                )));
            }
            POINTS => {
                let n = u32::try_from(n_vertices).map_err(|_| {
                    Failure::invalid(format!(
                        "positions: {n_vertices} rows, at most 2^32 - 1 can be held"
                    ))
                })?;
                collect((0..n as usize).map(|vertex| [vertex as u32]), "points")?.into()
            }
            EDGES => indices::<2>(array, "edges")?.into(),
            TRIANGLES => indices::<3>(array, "faces")?.into(),
            TETRAHEDRA => indices::<4>(array, "tetrahedra")?.into(),
            other => {
                return Err(Failure::invalid(format!(
                    "kind: {other} given, IMPINGE_POINTS to IMPINGE_TETRAHEDRA allowed"
                )));
            }
        })
    }
}

/// A type of numbers that arrays of ours have.
pub trait Number {
    const TYPE: u32;
}
impl Number for f32 {
    const TYPE: u32 = F32;
}
impl Number for f64 {
    const TYPE: u32 = F64;
}
impl Number for u32 {
    const TYPE: u32 = U32;
}
impl Number for u64 {
    const TYPE: u32 = U64;
}
impl Number for u8 {
    const TYPE: u32 = U8;
}

/// A view of rows.
pub fn view<T: Number, const N: usize>(rows: &[[T; N]]) -> impinge_array {
    impinge_array {
        data: rows.as_ptr().cast::<c_void>(),
        rows: rows.len(),
        row_stride: size_of::<[T; N]>() as isize,
        column_stride: size_of::<T>() as isize,
        r#type: T::TYPE,
    }
}

/// A view of single numbers.
pub fn view_of<T: Number>(numbers: &[T]) -> impinge_array {
    view(numbers.as_chunks::<1>().0)
}

/// A view of one field of many structures: `offset` bytes from the start of each.
pub fn field<S, T: Number>(rows: &[S], offset: usize) -> impinge_array {
    impinge_array {
        data: rows.as_ptr().cast::<u8>().wrapping_add(offset).cast(),
        rows: rows.len(),
        row_stride: size_of::<S>() as isize,
        column_stride: size_of::<T>() as isize,
        r#type: T::TYPE,
    }
}

/// A view of positions.
pub fn positions_view(positions: &Positions) -> impinge_array {
    match positions {
        Positions::F32(rows) => view(rows),
        Positions::F64(rows) => view(rows),
    }
}

/// A view of nothing, of this type.
pub fn no_rows(of: u32) -> impinge_array {
    impinge_array {
        data: std::ptr::null(),
        rows: 0,
        row_stride: 0,
        column_stride: 0,
        r#type: of,
    }
}

/// A view of elements.
pub fn elements_view(elements: &Elements) -> impinge_array {
    match elements {
        Elements::Points(rows) => view(rows),
        Elements::Edges(rows) => view(rows),
        Elements::Triangles(rows) => view(rows),
        Elements::Tetrahedra(rows) => view(rows),
    }
}
