//! Keyword arguments as the library's settings.

use impinge::{Backend, InstructionSet, Method, Recluster, Settings, SharedVertex};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBool;

/// Picks the value that goes with a name, or lists the names.
pub fn choose<T: Copy>(setting: &str, given: &str, choices: &[(&str, T)]) -> PyResult<T> {
    choices
        .iter()
        .find(|(name, _)| *name == given)
        .map(|&(_, value)| value)
        .ok_or_else(|| {
            let names: Vec<String> = choices
                .iter()
                .map(|(name, _)| format!("{name:?}"))
                .collect();
            PyValueError::new_err(format!(
                "{setting}: {given:?} given, {} allowed",
                names.join(", ")
            ))
        })
}

/// `"clusters"`, `"cells"` or `"naive"`.
pub fn method(name: &str) -> PyResult<Method> {
    choose(
        "method",
        name,
        &[Method::Clusters, Method::Cells, Method::Naive].map(|method| (method.name(), method)),
    )
}

/// `"auto"`, `"cpu"` or `"gpu"`.
pub fn backend(name: &str) -> PyResult<Backend> {
    choose(
        "backend",
        name,
        &[
            ("auto", Backend::Auto),
            ("cpu", Backend::Cpu),
            ("gpu", Backend::Gpu),
        ],
    )
}

/// `"auto"` or `"never"`.
pub fn recluster(name: &str) -> PyResult<Recluster> {
    choose(
        "recluster",
        name,
        &[("auto", Recluster::Auto), ("never", Recluster::Never)],
    )
}

/// `"portable"`, `"avx2"` or `"avx512"`.
pub fn instruction_set(name: &str) -> PyResult<InstructionSet> {
    choose(
        "instruction_set",
        name,
        &[
            ("portable", InstructionSet::Portable),
            ("avx2", InstructionSet::Avx2),
            ("avx512", InstructionSet::Avx512),
        ],
    )
}

/// `"skip"` or `"resolve"`.
pub fn shared_vertex(name: &str) -> PyResult<SharedVertex> {
    choose(
        "shared_vertex",
        name,
        &[
            ("skip", SharedVertex::Skip),
            ("resolve", SharedVertex::Resolve),
        ],
    )
}

/// A whole number from 0 to `most`.
pub fn unsigned(argument: &Bound<'_, PyAny>, name: &str, most: u64) -> PyResult<u64> {
    let integer = if argument.is_instance_of::<PyBool>() {
        None
    } else {
        argument.call_method0("__index__").ok()
    };
    let Some(integer) = integer else {
        return Err(PyTypeError::new_err(format!(
            "{name}: a whole number expected, {} given",
            argument.get_type().name()?
        )));
    };
    match integer.extract::<u64>() {
        Ok(number) if number <= most => Ok(number),
        _ => Err(PyValueError::new_err(format!(
            "{name}: {} given, 0 to {most} allowed",
            integer.str()?
        ))),
    }
}

/// What the detector's constructor was told, in its order.
pub struct Told<'a, 'py> {
    pub method: &'a str,
    pub backend: &'a str,
    pub device: Option<String>,
    pub threads: Option<&'a Bound<'py, PyAny>>,
    pub memory_budget: Option<&'a Bound<'py, PyAny>>,
    pub lambda: Option<&'a Bound<'py, PyAny>>,
    pub group_size: Option<&'a Bound<'py, PyAny>>,
    pub recluster: &'a str,
    pub instruction_set: &'a str,
}

impl Told<'_, '_> {
    /// The library's settings.
    pub fn settings(self) -> PyResult<Settings> {
        let threads = match self.threads {
            Some(threads) => unsigned(threads, "threads", 1024)?,
            None => 0,
        };
        let memory_budget = match self.memory_budget {
            Some(budget) => Some(unsigned(budget, "memory_budget", u64::MAX)?),
            None => None,
        };
        let lambda = match self.lambda {
            Some(lambda) => lambda.extract().map_err(|_| {
                PyTypeError::new_err(format!("lambda_: a number expected, {lambda:?} given"))
            })?,
            None => Settings::default().lambda,
        };
        let group_size = match self.group_size {
            Some(group_size) => unsigned(group_size, "group_size", 64)? as u32,
            None => Settings::default().group_size,
        };
        Ok(Settings {
            method: method(self.method)?,
            backend: backend(self.backend)?,
            threads: threads as usize,
            instruction_set: instruction_set(self.instruction_set)?,
            lambda,
            group_size,
            memory_budget,
            recluster: recluster(self.recluster)?,
            device: self.device,
        })
    }
}
