//! What a question cost, for Python.

use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The fields of `impinge.Stats`.
pub fn to_dict<'py>(py: Python<'py>, stats: &impinge::Stats) -> PyResult<Bound<'py, PyDict>> {
    let stages = PyDict::new(py);
    for stage in &stats.stages {
        stages.set_item(stage.name, stage.ms)?;
    }
    let all = PyDict::new(py);
    all.set_item("backend", &stats.backend)?;
    all.set_item("method", stats.method)?;
    all.set_item("stages", stages)?;
    all.set_item("total_ms", stats.total_ms)?;
    all.set_item("grid", stats.grid.map(<(u32, u32, u32)>::from))?;
    for (name, n) in stats.counts() {
        all.set_item(name, n)?;
    }
    Ok(all)
}
