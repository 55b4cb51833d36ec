//! What comes in as an argument becomes rows of numbers: read where they lie when the layout
//! allows it, converted when nothing is lost, refused by name otherwise.
//!
//! An argument is taken, in this order, as a NumPy array, through DLPack, or through
//! `numpy.asarray` (buffer protocol, `__array__`, nested sequences).

use std::borrow::Cow;
use std::collections::HashMap;

use impinge::{BodyKind, Elements, Positions};
use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray2,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyIndexError, PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::errors::{Names, invalid, number};

/// Positions in the precision in which they are answered, in C order.
pub enum PositionArray<'py> {
    F32(PyReadonlyArray2<'py, f32>),
    F64(PyReadonlyArray2<'py, f64>),
}

impl<'py> PositionArray<'py> {
    /// Takes the argument `name` as `(n, 3)` positions.
    pub fn new(argument: &Bound<'py, PyAny>, name: &str) -> PyResult<Self> {
        let (array, kind) = as_rows(argument, name, &[3])?;
        match kind {
            // Half precision widens to single without loss.
            NumberKind::Float(2 | 4) => Ok(PositionArray::F32(in_c_order(&array, "=f4")?)),
            _ => doubles(&array, kind, name).map(PositionArray::F64),
        }
    }

    /// The rows themselves.
    pub fn rows(&self) -> PyResult<Rows<'_>> {
        Ok(match self {
            PositionArray::F32(array) => Rows::F32(slice_rows(array)?),
            PositionArray::F64(array) => Rows::F64(slice_rows(array)?),
        })
    }

    /// How many positions there are.
    pub fn len(&self) -> usize {
        match self {
            PositionArray::F32(array) => array.shape()[0],
            PositionArray::F64(array) => array.shape()[0],
        }
    }
}

/// Rows of three coordinates where they lie.
#[derive(Clone, Copy)]
pub enum Rows<'a> {
    F32(&'a [[f32; 3]]),
    F64(&'a [[f64; 3]]),
}

/// Runs the same code for both precisions: `with_rows!(rows, |rows| …)`.
macro_rules! with_rows {
    ($given:expr, |$rows:ident| $body:expr) => {
        match $given {
            $crate::arrays::Rows::F32($rows) => $body,
            $crate::arrays::Rows::F64($rows) => $body,
        }
    };
}
pub(crate) use with_rows;

impl<'a> Rows<'a> {
    /// The same as doubles, which loses nothing.
    pub fn widened(self) -> Cow<'a, [[f64; 3]]> {
        match self {
            Rows::F32(rows) => rows.iter().map(|row| row.map(f64::from)).collect(),
            Rows::F64(rows) => Cow::Borrowed(rows),
        }
    }
}

/// What the rows of an index array are.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum RowKind {
    Of(BodyKind),
    /// Faces of four corners, each cut into two triangles.
    Quads,
}

/// Vertex indices: three or four per row, or as many as an element of the kind has corners. Quads
/// become triangles.
pub fn elements(
    argument: &Bound<'_, PyAny>,
    names: Names<'_>,
    kind: Option<RowKind>,
    n_vertices: usize,
) -> PyResult<Elements> {
    let name = names.elements;
    let allowed: &[usize] = match kind {
        None => &[3, 4],
        Some(RowKind::Of(BodyKind::Points)) => &[1],
        Some(RowKind::Of(BodyKind::Edges)) => &[2],
        Some(RowKind::Of(BodyKind::Triangles)) => &[3],
        Some(RowKind::Of(BodyKind::Tetrahedra) | RowKind::Quads) => &[4],
    };
    let (indices, n_columns) = index_rows(argument, name, allowed, n_vertices)?;
    Ok(match (n_columns, kind) {
        (1, _) => Elements::Points(indices.as_chunks().0.to_vec()),
        (2, _) => Elements::Edges(indices.as_chunks().0.to_vec()),
        (3, _) => Elements::Triangles(indices.as_chunks().0.to_vec()),
        (_, Some(RowKind::Quads)) => Elements::Triangles(cut_quads(indices.as_chunks().0)),
        (_, None) if !are_tetrahedra(indices.as_chunks().0) => {
            let kind = names.kind;
            return Err(invalid(format!(
                "{name}: rows of four are tetrahedra or quads, and no two of them share three vertices, which would \
                 tell: say {kind}=\"tetrahedra\", or {kind}=\"quads\" to cut each into two triangles"
            )));
        }
        _ => Elements::Tetrahedra(indices.as_chunks().0.to_vec()),
    })
}

/// Quad `i` as the triangles `2 i` and `2 i + 1`, along the diagonal from its first corner.
fn cut_quads(quads: &[[u32; 4]]) -> Vec<[u32; 3]> {
    let cut = |&[a, b, c, d]: &[u32; 4]| [[a, b, c], [a, c, d]];
    quads.iter().flat_map(cut).collect()
}

/// Whether rows of four are tetrahedra beyond doubt: neighbours in a mesh of tetrahedra share three
/// vertices and differ in the fourth, which no two quads of a surface do. In meshes one of the
/// first rows tells. No row at all may be either.
fn are_tetrahedra(rows: &[[u32; 4]]) -> bool {
    let mut fourth = HashMap::new();
    rows.is_empty()
        || rows.iter().any(|row| {
            (0..4).any(|left_out| {
                let mut face = [0, 1, 2].map(|ix| row[(left_out + 1 + ix) % 4]);
                face.sort_unstable();
                let is_face = face[0] != face[1] && face[1] != face[2];
                let apex = row[left_out];
                is_face && *fourth.entry(face).or_insert(apex) != apex
            })
        })
}

/// Rows of numbers, `(ROWS, COLUMNS)`, as they are in double precision.
pub fn matrix<const ROWS: usize, const COLUMNS: usize>(
    argument: &Bound<'_, PyAny>,
    name: &str,
) -> PyResult<[[f64; COLUMNS]; ROWS]> {
    let array = as_array(argument, name)?;
    let kind = NumberKind::of(&array, name)?;
    if array.shape() != [ROWS, COLUMNS] {
        let given = array.getattr("shape")?.str()?;
        return Err(invalid(format!(
            "{name}: shape ({ROWS}, {COLUMNS}) expected, {given} given"
        )));
    }
    let doubles = doubles(&array, kind, name)?;
    Ok(slice_rows(&doubles)?.try_into()?)
}

/// An index that may count from the end.
pub fn from_end(index: isize, len: usize, what: &str) -> PyResult<usize> {
    let ix = match usize::try_from(index) {
        Ok(ix) => Some(ix),
        Err(_) => len.checked_sub(index.unsigned_abs()),
    };
    ix.filter(|&ix| ix < len).ok_or_else(|| {
        PyIndexError::new_err(format!("index {index} given, but there are {len} {what}"))
    })
}

/// What a filter answered: `(n,)` bool.
pub fn mask(answer: &Bound<'_, PyAny>, name: &str, n: usize) -> PyResult<Vec<bool>> {
    let array = as_array(answer, name)?;
    let refused = || {
        let given = array.getattr("shape").and_then(|shape| shape.str());
        let dtype = array.dtype().str();
        match (given, dtype) {
            (Ok(shape), Ok(dtype)) => invalid(format!(
                "{name}: shape ({n},) of bool expected, {shape} of {dtype} given"
            )),
            (Err(error), _) | (_, Err(error)) => error,
        }
    };
    if array.shape() != [n] {
        return Err(refused());
    }
    let flags = array.cast::<PyArray1<bool>>().map_err(|_| refused())?;
    Ok(flags.to_vec()?)
}

/// Offsets, `(n,)`: whole numbers from 0.
pub fn offsets(argument: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<usize>> {
    let array = as_array(argument, name)?;
    let kind = NumberKind::of(&array, name)?;
    let shape = array.shape();
    if shape == [0] {
        return Ok(Vec::new());
    }
    if shape.len() != 1 || matches!(kind, NumberKind::Float(_)) {
        return Err(invalid(format!(
            "{name}: a row of whole numbers expected, {} of {} given",
            array.getattr("shape")?.str()?,
            array.dtype().str()?
        )));
    }
    let column = array.call_method1("reshape", ((shape[0], 1),))?;
    let column = column.cast_into::<PyUntypedArray>()?;
    let numbers = in_c_order::<i64>(&column, "=i8")?;
    let convert = |&x: &i64| usize::try_from(x).ok();
    let numbers = numbers.as_slice()?;
    match numbers.iter().position(|x| convert(x).is_none()) {
        Some(at) => Err(invalid(format!(
            "{name}[{at}]: {} given, 0 or more allowed",
            numbers[at]
        ))),
        None => Ok(numbers.iter().filter_map(convert).collect()),
    }
}

/// Whole numbers of 32 bits, `(n,)`, from 0.
pub fn whole_numbers(argument: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<u32>> {
    let number = |(ix, &number): (usize, &usize)| {
        u32::try_from(number).map_err(|_| {
            let most = u32::MAX;
            invalid(format!(
                "{name}[{ix}]: {number} given, at most {most} allowed"
            ))
        })
    };
    let numbers = offsets(argument, name)?;
    numbers.iter().enumerate().map(number).collect()
}

/// Numbers, `(n,)`, of any type.
pub fn numbers(argument: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<f64>> {
    let array = as_array(argument, name)?;
    let kind = NumberKind::of(&array, name)?;
    let shape = array.shape();
    if shape.len() != 1 {
        return Err(invalid(format!(
            "{name}: a number or a row of numbers expected, {} given",
            array.getattr("shape")?.str()?
        )));
    }
    let column = array.call_method1("reshape", ((shape[0], 1),))?;
    let column = column.cast_into::<PyUntypedArray>()?;
    let numbers = doubles(&column, kind, name)?;
    Ok(numbers.as_slice()?.to_vec())
}

/// Rows `(n, n_columns)` of unsigned 32-bit numbers, row after row.
pub fn rows(argument: &Bound<'_, PyAny>, name: &str, n_columns: usize) -> PyResult<Vec<u32>> {
    let (array, numbers) = as_rows(argument, name, &[n_columns])?;
    indices(&array, numbers, name)
}

/// Rows `(n, k)` of vertex indices below `n_vertices`, row after row, and `k`, which is one of
/// those allowed.
pub fn index_rows(
    argument: &Bound<'_, PyAny>,
    name: &str,
    allowed: &[usize],
    n_vertices: usize,
) -> PyResult<(Vec<u32>, usize)> {
    let (array, numbers) = as_rows(argument, name, allowed)?;
    let n_columns = array.shape()[1];
    let indices = indices(&array, numbers, name)?;
    check_indices(&indices, n_columns, name, n_vertices)?;
    Ok((indices, n_columns))
}

/// Refuses an index of a vertex that does not exist.
fn check_indices(indices: &[u32], n_columns: usize, name: &str, n_vertices: usize) -> PyResult<()> {
    let Some(at) = indices.iter().position(|&ix| ix as usize >= n_vertices) else {
        return Ok(());
    };
    let place = format!("{name}[{}, {}]", at / n_columns, at % n_columns);
    Err(invalid(format!(
        "{place} = {}: there are {n_vertices} vertices",
        indices[at]
    )))
}

/// An `(n, 3)` array of the precision in which positions are held.
pub fn positions_array<'py>(py: Python<'py>, positions: &Positions) -> PyResult<Bound<'py, PyAny>> {
    let shape = [positions.len(), 3];
    Ok(match positions {
        Positions::F32(positions) => PyArray1::from_slice(py, positions.as_flattened())
            .reshape(shape)?
            .into_any(),
        Positions::F64(positions) => PyArray1::from_slice(py, positions.as_flattened())
            .reshape(shape)?
            .into_any(),
    })
}

/// The contiguous rows of an array that [`in_c_order`] has made.
pub fn slice_rows<'a, T: Element, const N: usize>(
    array: &'a PyReadonlyArray2<'_, T>,
) -> PyResult<&'a [[T; N]]> {
    Ok(array.as_slice()?.as_chunks().0)
}

/// The numbers that an array may hold, and their size in bytes.
#[derive(Clone, Copy)]
enum NumberKind {
    Float(usize),
    Signed(usize),
    Unsigned(usize),
}

impl NumberKind {
    fn of(array: &Bound<'_, PyUntypedArray>, name: &str) -> PyResult<Self> {
        let dtype = array.dtype();
        let size = dtype.itemsize();
        match dtype.kind() {
            b'f' => Ok(NumberKind::Float(size)),
            b'i' => Ok(NumberKind::Signed(size)),
            b'u' => Ok(NumberKind::Unsigned(size)),
            _ => Err(PyTypeError::new_err(format!(
                "{name}: an array of real numbers expected, dtype {} given",
                dtype.str()?
            ))),
        }
    }
}

fn as_array<'py>(argument: &Bound<'py, PyAny>, name: &str) -> PyResult<Bound<'py, PyUntypedArray>> {
    let numpy = argument.py().import("numpy")?;
    if let Ok(array) = argument.cast::<PyUntypedArray>() {
        let masked = numpy.getattr("ma")?;
        if array.is_instance(&masked.getattr("MaskedArray")?)?
            && masked.call_method1("is_masked", (array,))?.is_truthy()?
        {
            return Err(invalid(format!(
                "{name}: a masked array with masked entries; fill or drop them first"
            )));
        }
        return Ok(array.clone());
    }
    // A producer that DLPack cannot serve (a gradient to keep, a read-only buffer) may still
    // offer `__array__`, whose refusal explains more.
    if argument.hasattr("__dlpack__")?
        && let Ok(array) = numpy.call_method1("from_dlpack", (argument,))
    {
        return Ok(array.cast_into::<PyUntypedArray>()?);
    }
    let array = numpy
        .call_method1("asarray", (argument,))
        .map_err(|cause| {
            let py = argument.py();
            let message = format!("{name}: not usable as an array: {}", cause.value(py));
            let error = if cause.is_instance_of::<PyValueError>(py) {
                invalid(message)
            } else {
                PyTypeError::new_err(message)
            };
            error.set_cause(py, Some(cause));
            error
        })?;
    Ok(array.cast_into::<PyUntypedArray>()?)
}

/// An array of numbers in rows, of one of the lengths allowed. Nothing at all, `[]`, is no rows of
/// the first.
fn as_rows<'py>(
    argument: &Bound<'py, PyAny>,
    name: &str,
    allowed: &[usize],
) -> PyResult<(Bound<'py, PyUntypedArray>, NumberKind)> {
    let array = as_array(argument, name)?;
    let kind = NumberKind::of(&array, name)?;
    match *array.shape() {
        [_, n_columns] if allowed.contains(&n_columns) => Ok((array, kind)),
        [0] => {
            let none = array.call_method1("reshape", ((0, allowed[0]),))?;
            Ok((none.cast_into::<PyUntypedArray>()?, kind))
        }
        _ => {
            let expected: Vec<String> = allowed.iter().map(|n| format!("(n, {n})")).collect();
            Err(invalid(format!(
                "{name}: shape {} expected, {} given",
                expected.join(" or "),
                array.getattr("shape")?.str()?
            )))
        }
    }
}

/// The array itself when it is in C order, aligned and of this type, else a converted copy.
fn in_c_order<'py, T: Element>(
    array: &Bound<'py, PyUntypedArray>,
    dtype: &str,
) -> PyResult<PyReadonlyArray2<'py, T>> {
    if array.is_c_contiguous()
        && array.is_aligned()
        && let Ok(same) = array.cast::<PyArray2<T>>()
    {
        return Ok(same.try_readonly()?);
    }
    let numpy = array.py().import("numpy")?;
    let converted = numpy.call_method1("require", (array, dtype, ["C", "A"]))?;
    Ok(converted.cast_into::<PyArray2<T>>()?.try_readonly()?)
}

/// In double precision, which every number survives.
fn doubles<'py>(
    array: &Bound<'py, PyUntypedArray>,
    kind: NumberKind,
    name: &str,
) -> PyResult<PyReadonlyArray2<'py, f64>> {
    match kind {
        NumberKind::Float(size) if size > 8 => return extended_to_double(array, name),
        NumberKind::Signed(8) => {
            let native = in_c_order::<i64>(array, "=i8")?;
            check_exact(&native, name, |&x: &i64| fits_double(x.unsigned_abs()))?;
        }
        NumberKind::Unsigned(8) => {
            let native = in_c_order::<u64>(array, "=u8")?;
            check_exact(&native, name, |&x: &u64| fits_double(x))?;
        }
        // Integers of at most 32 bits are doubles.
        _ => {}
    }
    in_c_order(array, "=f8")
}

/// Whether a magnitude survives the way to double precision: at most 53 bits from its highest to
/// its lowest set bit.
fn fits_double(magnitude: u64) -> bool {
    magnitude == 0 || magnitude.ilog2() - magnitude.trailing_zeros() < 53
}

fn check_exact<T: Element + std::fmt::Display>(
    array: &PyReadonlyArray2<'_, T>,
    name: &str,
    exact: impl Fn(&T) -> bool,
) -> PyResult<()> {
    match array.as_array().indexed_iter().find(|(_, x)| !exact(x)) {
        None => Ok(()),
        Some(((row, column), x)) => Err(invalid(format!(
            "{name}[{row}, {column}] = {x}: not representable in float64 without loss"
        ))),
    }
}

/// `numpy.longdouble` to double precision, where every number survives it.
fn extended_to_double<'py>(
    array: &Bound<'py, PyUntypedArray>,
    name: &str,
) -> PyResult<PyReadonlyArray2<'py, f64>> {
    let numpy = array.py().import("numpy")?;
    let double = numpy.call_method1("require", (array, "=f8", ["C", "A"]))?;
    let differs = array.rich_compare(&double, pyo3::basic::CompareOp::Ne)?;
    // What was not finite before is refused later, by that name.
    let finite = numpy.call_method1("isfinite", (array,))?;
    let lossy = numpy.call_method1("logical_and", (differs, finite))?;
    let places = numpy.call_method1("argwhere", (lossy,))?;
    if places.len()? == 0 {
        return Ok(double.cast_into::<PyArray2<f64>>()?.try_readonly()?);
    }
    let place = places.get_item(0)?;
    let (row, column): (usize, usize) =
        (place.get_item(0)?.extract()?, place.get_item(1)?.extract()?);
    Err(invalid(format!(
        "{name}[{row}, {column}] = {}: not representable in float64 without loss",
        array.get_item((row, column))?.str()?
    )))
}

fn indices(
    array: &Bound<'_, PyUntypedArray>,
    numbers: NumberKind,
    name: &str,
) -> PyResult<Vec<u32>> {
    match numbers {
        NumberKind::Unsigned(4) => Ok(in_c_order::<u32>(array, "=u4")?.as_slice()?.to_vec()),
        NumberKind::Unsigned(_) => whole(&in_c_order::<u64>(array, "=u8")?, name),
        NumberKind::Signed(4) => whole(&in_c_order::<i32>(array, "=i4")?, name),
        NumberKind::Signed(_) => whole(&in_c_order::<i64>(array, "=i8")?, name),
        NumberKind::Float(size) => {
            let doubles = if size > 8 {
                extended_to_double(array, name)?
            } else {
                in_c_order::<f64>(array, "=f8")?
            };
            let convert = |&x: &f64| {
                // The range is checked first, so the cast is exact.
                (x.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&x)).then_some(x as u32)
            };
            collect(&doubles, name, convert, |&x| {
                let why = if x.fract() == 0.0 {
                    OUTSIDE
                } else {
                    "not a whole number"
                };
                format!("{}: {why}", number(x))
            })
        }
    }
}

const OUTSIDE: &str = "an index lies between 0 and 4294967295";

fn whole<T: Element + Copy + TryInto<u32> + std::fmt::Display>(
    array: &PyReadonlyArray2<'_, T>,
    name: &str,
) -> PyResult<Vec<u32>> {
    collect(
        array,
        name,
        |&x| x.try_into().ok(),
        |x| format!("{x}: {OUTSIDE}"),
    )
}

/// Converts every entry, or names the first that has no place among the indices.
fn collect<T: Element>(
    array: &PyReadonlyArray2<'_, T>,
    name: &str,
    convert: impl Fn(&T) -> Option<u32>,
    complaint: impl Fn(&T) -> String,
) -> PyResult<Vec<u32>> {
    let entries = array.as_slice()?;
    let mut indices = Vec::with_capacity(entries.len());
    for (at, entry) in entries.iter().enumerate() {
        match convert(entry) {
            Some(ix) => indices.push(ix),
            None => {
                let n_columns = array.shape()[1];
                return Err(invalid(format!(
                    "{name}[{}, {}] = {}",
                    at / n_columns,
                    at % n_columns,
                    complaint(entry)
                )));
            }
        }
    }
    Ok(indices)
}
