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
    all.set_item("n_threads", stats.n_threads)?;
    all.set_item("stages", stages)?;
    all.set_item("total_ms", stats.total_ms)?;
    all.set_item("grid", stats.grid.map(<(u32, u32, u32)>::from))?;
    all.set_item("n_subdivided", stats.n_subdivided)?;
    all.set_item("n_entries", stats.n_entries)?;
    all.set_item("n_clusters", stats.n_clusters)?;
    all.set_item("n_culled", stats.n_culled)?;
    all.set_item("n_work_items", stats.n_work_items)?;
    all.set_item("n_candidates", stats.n_candidates)?;
    all.set_item("n_unsure", stats.n_unsure)?;
    all.set_item("n_clustered", stats.n_clustered)?;
    all.set_item("n_reclustered", stats.n_reclustered)?;
    all.set_item("n_batches", stats.n_batches)?;
    all.set_item("n_pieces", stats.n_pieces)?;
    all.set_item("n_reruns", stats.n_reruns)?;
    all.set_item("bytes_held", stats.bytes_held)?;
    Ok(all)
}
