//! Keyword arguments as the library's settings.

use std::ops::RangeInclusive;

use impinge::{Affinity, Backend, BodyKind, InstructionSet, Method, Recluster, Settings};
use pyo3::exceptions::{PyOverflowError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat};

use crate::arrays::RowKind;
use crate::errors::invalid;

/// An argument of Python's side that may be left out.
pub type Argument<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

/// Picks the value that goes with a name, or lists the names.
pub fn choose_one<T: Copy>(
    argument: &Bound<'_, PyAny>,
    name: &str,
    choices: &[(&str, T)],
) -> PyResult<T> {
    let given = text(argument, name)?;
    if let Some(&(_, value)) = choices.iter().find(|(choice, _)| *choice == given) {
        return Ok(value);
    }
    let choices: Vec<String> = choices
        .iter()
        .map(|(choice, _)| format!("{choice:?}"))
        .collect();
    Err(invalid(format!(
        "{name}: {given:?} given, {} allowed",
        choices.join(", ")
    )))
}

/// A string argument.
fn text(argument: &Bound<'_, PyAny>, name: &str) -> PyResult<String> {
    argument
        .extract()
        .map_err(|_| unexpected(argument, name, "a string"))
}

/// The exception for an argument of the wrong type. PyO3 names the argument in a note, which
/// Python before 3.11 does not have; this message names it everywhere.
pub fn unexpected(argument: &Bound<'_, PyAny>, name: &str, expected: &str) -> PyErr {
    match argument.get_type().name() {
        Ok(given) => PyTypeError::new_err(format!("{name}: {expected} expected, {given} given")),
        Err(error) => error,
    }
}

/// A number, rounded to `f64`; the library refuses those that are out of range.
pub fn number(value: &Bound<'_, PyAny>, name: &str) -> PyResult<f64> {
    let py = value.py();
    value.extract().map_err(|error: PyErr| {
        if error.is_instance_of::<PyTypeError>(py) {
            unexpected(value, name, "a number")
        } else if error.is_instance_of::<PyOverflowError>(py) {
            let given = shown(value);
            invalid(format!("{name}: {given} given, which float64 cannot hold"))
        } else {
            error
        }
    })
}

/// A number that `f64` holds as it is.
pub fn length(value: &Bound<'_, PyAny>, name: &str) -> PyResult<f64> {
    if let Ok(float) = value.cast::<PyFloat>() {
        return Ok(float.value());
    }
    let rounded = number(value, name)?;
    // NumPy compares its integers with floats as floats.
    let integer = value.call_method0("__index__");
    let given = integer.as_ref().unwrap_or(value);
    // What cannot be compared is taken as it says that it is.
    if given.lt(rounded).unwrap_or(false) || given.gt(rounded).unwrap_or(false) {
        let given = shown(given);
        return Err(invalid(format!(
            "{name}: {given} given, which float64 cannot hold without loss"
        )));
    }
    Ok(rounded)
}

/// [`length`] for Python's side.
#[pyfunction]
pub fn _length(value: &Bound<'_, PyAny>, name: &str) -> PyResult<f64> {
    length(value, name)
}

/// A number as Python writes it; whole numbers of many digits are not written.
fn shown(number: &Bound<'_, PyAny>) -> String {
    match number.str().map(|text| text.to_string()) {
        Ok(text) if text.len() <= 64 => text,
        _ => "a number of very many digits".into(),
    }
}

/// A truth value.
pub fn flag(value: &Bound<'_, PyAny>, name: &str) -> PyResult<bool> {
    value
        .extract()
        .map_err(|_| unexpected(value, name, "True or False"))
}

/// [`flag`] by the name of the argument, for `from_py_with`.
pub mod flags {
    use pyo3::prelude::*;

    macro_rules! named {
        ($($name:ident)*) => {$(
            pub fn $name(given: &Bound<'_, PyAny>) -> PyResult<bool> {
                super::flag(given, stringify!($name))
            }
        )*};
    }
    named!(again by_area copy replace step weld);
}

/// What the rows of an index array are; `None` leaves it to their length.
pub fn kind(argument: Argument<'_, '_>, name: &str) -> PyResult<Option<RowKind>> {
    let mut kinds = BodyKind::ALL
        .map(|kind| (kind.name(), Some(RowKind::Of(kind))))
        .to_vec();
    kinds.push(("quads", Some(RowKind::Quads)));
    match argument {
        Some(argument) => choose_one(argument, name, &kinds),
        None => Ok(None),
    }
}

/// A whole number from 0 to `most`.
pub fn unsigned(argument: &Bound<'_, PyAny>, name: &str, most: u64) -> PyResult<u64> {
    whole(argument, name, 0..=most)
}

/// A whole number in a range.
pub fn whole(
    argument: &Bound<'_, PyAny>,
    name: &str,
    allowed: RangeInclusive<u64>,
) -> PyResult<u64> {
    let integer = if argument.is_instance_of::<PyBool>() {
        None
    } else {
        argument.call_method0("__index__").ok()
    };
    let Some(integer) = integer else {
        return Err(unexpected(argument, name, "a whole number"));
    };
    match integer.extract::<u64>() {
        Ok(number) if allowed.contains(&number) => Ok(number),
        _ => Err(invalid(format!(
            "{name}: {} given, {} to {} allowed",
            shown(&integer),
            allowed.start(),
            allowed.end()
        ))),
    }
}

/// Whether pairs of different bodies count, and those of one body.
pub const WHICH: [(&str, [bool; 2]); 3] = [
    ("all", [true, true]),
    ("between", [true, false]),
    ("self", [false, true]),
];

/// The words of a choice of the library, for [`choose_one`].
macro_rules! words {
    ($choice:ty) => {
        &<$choice>::ALL.map(|one| (one.name(), one))
    };
}
pub(crate) use words;

/// The library's settings, from Python's keywords. Those that are `None` were not given.
pub fn read(keywords: &Bound<'_, PyDict>) -> PyResult<Settings> {
    let mut settings = Settings::default();
    for (name, value) in keywords {
        if value.is_none() {
            continue;
        }
        let name = name.extract::<String>()?;
        match name.as_str() {
            "backend" => settings.backend = choose_one(&value, &name, words!(Backend))?,
            "method" => settings.method = choose_one(&value, &name, words!(Method))?,
            "device" => settings.device = Some(text(&value, &name)?),
            "threads" => settings.threads = unsigned(&value, &name, 1024)? as usize,
            "memory_budget" => {
                settings.memory_budget = Some(unsigned(&value, &name, u64::MAX)?);
            }
            "max_pairs" => settings.max_pairs = Some(unsigned(&value, &name, u64::MAX)?),
            "recluster" => settings.recluster = choose_one(&value, &name, words!(Recluster))?,
            "instruction_set" => {
                settings.instruction_set = choose_one(&value, &name, words!(InstructionSet))?;
            }
            "density" => settings.density = number(&value, &name)?,
            "reuse_margin" => settings.reuse_margin = number(&value, &name)?,
            "affinity" => settings.affinity = choose_one(&value, &name, words!(Affinity))?,
            _ => settings.group_size = unsigned(&value, &name, 64)? as u32,
        }
    }
    Ok(settings)
}

/// The keywords that give these settings.
pub fn to_dict<'py>(py: Python<'py>, settings: &Settings) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    all.set_item("backend", settings.backend.name())?;
    all.set_item("method", settings.method.name())?;
    all.set_item("device", &settings.device)?;
    let threads = (settings.threads > 0).then_some(settings.threads);
    all.set_item("threads", threads)?;
    all.set_item("memory_budget", settings.memory_budget)?;
    all.set_item("max_pairs", settings.max_pairs)?;
    all.set_item("recluster", settings.recluster.name())?;
    let instruction_set = settings.instruction_set.name();
    all.set_item("instruction_set", instruction_set)?;
    all.set_item("density", settings.density)?;
    all.set_item("reuse_margin", settings.reuse_margin)?;
    all.set_item("affinity", settings.affinity.name())?;
    all.set_item("_group_size", settings.group_size)?;
    Ok(all)
}
