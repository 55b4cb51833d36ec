//! Keyword arguments as the library's settings.

use impinge::{
    Backend, InstructionSet, Kind, Method, Part, Placement, Recluster, Settings, SharedVertex,
    Start, Toi,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBool;

use crate::arrays::RowKind;

/// An argument of Python's side that may be left out.
pub type Argument<'a, 'py> = Option<&'a Bound<'py, PyAny>>;

/// Picks the value that goes with a name, or lists the names. Without an argument, the default.
fn choose<T: Copy + Default>(
    argument: Argument<'_, '_>,
    name: &str,
    choices: &[(&str, T)],
) -> PyResult<T> {
    match argument {
        Some(argument) => choose_one(argument, name, choices),
        None => Ok(T::default()),
    }
}

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
    Err(PyValueError::new_err(format!(
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

/// What the rows of an index array are; `None` leaves it to their length.
pub fn kind(argument: Argument<'_, '_>) -> PyResult<Option<RowKind>> {
    let mut kinds = Kind::ALL
        .map(|kind| (kind.name(), Some(RowKind::Of(kind))))
        .to_vec();
    kinds.push(("quads", Some(RowKind::Quads)));
    match argument {
        Some(argument) => choose_one(argument, "kind", &kinds),
        None => Ok(None),
    }
}

/// What becomes of primitives that share a vertex.
pub fn shared_vertex(argument: Argument<'_, '_>) -> PyResult<SharedVertex> {
    choose(
        argument,
        "shared_vertex",
        &[
            ("skip", SharedVertex::Skip),
            ("resolve", SharedVertex::Resolve),
        ],
    )
}

/// What becomes of pairs that touch at the start of a step.
pub fn start(argument: Argument<'_, '_>) -> PyResult<Start> {
    let choices = [
        ("report", Start::Report),
        ("skip", Start::Skip),
        ("verify", Start::Verify),
    ];
    choose(argument, "start", &choices)
}

/// To which precision times are rounded down.
pub fn toi(argument: Argument<'_, '_>) -> PyResult<Toi> {
    choose(argument, "toi", &[("f32", Toi::F32), ("f64", Toi::F64)])
}

/// Which elements of a body.
pub fn part(argument: Argument<'_, '_>) -> PyResult<Part> {
    let Some(argument) = argument else {
        return Ok(Part::Given);
    };
    let choices = [
        ("given", Part::Given),
        ("vertices", Part::Vertices),
        ("edges", Part::Edges),
        ("faces", Part::Faces),
    ];
    choose_one(argument, "part", &choices)
}

/// A whole number from 0 to `most`.
pub fn unsigned(argument: &Bound<'_, PyAny>, name: &str, most: u64) -> PyResult<u64> {
    let integer = if argument.is_instance_of::<PyBool>() {
        None
    } else {
        argument.call_method0("__index__").ok()
    };
    let Some(integer) = integer else {
        return Err(unexpected(argument, name, "a whole number"));
    };
    match integer.extract::<u64>() {
        Ok(number) if number <= most => Ok(number),
        _ => Err(PyValueError::new_err(format!(
            "{name}: {} given, 0 to {most} allowed",
            integer.str()?
        ))),
    }
}

const BACKENDS: [(&str, Backend); 3] = [
    ("auto", Backend::Auto),
    ("cpu", Backend::Cpu),
    ("gpu", Backend::Gpu),
];
const PLACEMENTS: [(&str, Placement); 2] = [
    ("auto", Placement::Auto),
    ("inherited", Placement::Inherited),
];
const RECLUSTER: [(&str, Recluster); 2] = [("auto", Recluster::Auto), ("never", Recluster::Never)];
const INSTRUCTION_SETS: [(&str, InstructionSet); 3] = [
    ("portable", InstructionSet::Portable),
    ("avx2", InstructionSet::Avx2),
    ("avx512", InstructionSet::Avx512),
];

/// The name by which a value is chosen.
fn name_of<T: PartialEq>(value: T, choices: &[(&'static str, T)]) -> Option<&'static str> {
    let found = choices.iter().find(|(_, choice)| *choice == value);
    found.map(|(name, _)| *name)
}

/// The name of a backend.
pub fn backend_name(backend: Backend) -> Option<&'static str> {
    name_of(backend, &BACKENDS)
}

/// The name of a placement of helper threads.
pub fn placement_name(placement: Placement) -> Option<&'static str> {
    name_of(placement, &PLACEMENTS)
}

/// The name of a rule of clustering again.
pub fn recluster_name(recluster: Recluster) -> Option<&'static str> {
    name_of(recluster, &RECLUSTER)
}

/// The name of an instruction set.
pub fn instruction_set_name(instruction_set: InstructionSet) -> Option<&'static str> {
    name_of(instruction_set, &INSTRUCTION_SETS)
}

/// What the detector's constructor was told, in its order.
pub struct Told<'a, 'py> {
    pub method: Argument<'a, 'py>,
    pub backend: Argument<'a, 'py>,
    pub device: Argument<'a, 'py>,
    pub threads: Argument<'a, 'py>,
    pub memory_budget: Argument<'a, 'py>,
    pub max_pairs: Argument<'a, 'py>,
    pub lambda: Argument<'a, 'py>,
    pub group_size: Argument<'a, 'py>,
    pub recluster: Argument<'a, 'py>,
    pub instruction_set: Argument<'a, 'py>,
    pub placement: Argument<'a, 'py>,
}

impl Told<'_, '_> {
    /// The library's settings.
    pub fn settings(self) -> PyResult<Settings> {
        let mut settings = Settings {
            method: choose(
                self.method,
                "method",
                &Method::ALL.map(|method| (method.name(), method)),
            )?,
            backend: choose(self.backend, "backend", &BACKENDS)?,
            placement: choose(self.placement, "placement", &PLACEMENTS)?,
            recluster: choose(self.recluster, "recluster", &RECLUSTER)?,
            instruction_set: choose(self.instruction_set, "instruction_set", &INSTRUCTION_SETS)?,
            ..Settings::default()
        };
        if let Some(device) = self.device {
            settings.device = Some(text(device, "device")?);
        }
        if let Some(threads) = self.threads {
            settings.threads = unsigned(threads, "threads", 1024)? as usize;
        }
        if let Some(budget) = self.memory_budget {
            settings.memory_budget = Some(unsigned(budget, "memory_budget", u64::MAX)?);
        }
        if let Some(limit) = self.max_pairs {
            settings.max_pairs = Some(unsigned(limit, "max_pairs", u64::MAX)?);
        }
        if let Some(lambda) = self.lambda {
            settings.lambda = lambda
                .extract()
                .map_err(|_| unexpected(lambda, "lambda_", "a number"))?;
        }
        if let Some(group_size) = self.group_size {
            settings.group_size = unsigned(group_size, "group_size", 64)? as u32;
        }
        Ok(settings)
    }
}
