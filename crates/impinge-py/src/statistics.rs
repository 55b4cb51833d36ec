//! What a detection cost, for Python.

use pyo3::prelude::*;
use pyo3::types::PyDict;

/// What a detection cost and what it went through. The pairs never depend on any of this.
#[pyclass(module = "impinge", frozen)]
pub struct Statistics {
    pub inner: impinge::Statistics,
}

#[pymethods]
impl Statistics {
    /// str : ``"cpu"`` or the name of the GPU.
    #[getter]
    fn backend(&self) -> &str {
        &self.inner.backend
    }

    /// str : ``"clusters"``, ``"cells"`` or ``"naive"``.
    #[getter]
    fn method(&self) -> &str {
        self.inner.method
    }

    /// int : threads that worked.
    #[getter]
    fn n_threads(&self) -> usize {
        self.inner.n_threads
    }

    /// dict of str to float : wall time in milliseconds by stage, in the order of their first run.
    #[getter]
    fn stages<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let stages = PyDict::new(py);
        for stage in &self.inner.stages {
            stages.set_item(stage.name, stage.ms)?;
        }
        Ok(stages)
    }

    /// float : wall time of the whole detection in milliseconds.
    #[getter]
    fn total_ms(&self) -> f64 {
        self.inner.total_ms
    }

    /// tuple of three int, or None : ``"cells"``: cells of the first level along x, y and z.
    #[getter]
    fn grid(&self) -> Option<(u32, u32, u32)> {
        self.inner.grid.map(Into::into)
    }

    /// int : ``"cells"``: cells that went through the second level.
    #[getter]
    fn n_subdivided(&self) -> u64 {
        self.inner.n_subdivided
    }

    /// int : ``"cells"``: entries of the cell lists, a primitive counted once a cell.
    #[getter]
    fn n_entries(&self) -> u64 {
        self.inner.n_entries
    }

    /// int : ``"clusters"``: clusters of all bodies that took part.
    #[getter]
    fn n_clusters(&self) -> u64 {
        self.inner.n_clusters
    }

    /// int : ``"clusters"`` on the CPU: those proven to lie beside all other bodies, whose boxes were not needed.
    #[getter]
    fn n_culled(&self) -> u64 {
        self.inner.n_culled
    }

    /// int : pairs of groups that were paired.
    #[getter]
    fn n_work_items(&self) -> u64 {
        self.inner.n_work_items
    }

    /// int : pairs of primitives whose boxes overlap and that the adjacency rule lets through.
    #[getter]
    fn n_candidates(&self) -> u64 {
        self.inner.n_candidates
    }

    /// int : candidates that the floating-point filter left to exact arithmetic.
    #[getter]
    fn n_unsure(&self) -> u64 {
        self.inner.n_unsure
    }

    /// float : ``n_unsure`` by ``n_candidates``; 0 without candidates.
    #[getter]
    fn unsure_share(&self) -> f64 {
        if self.inner.n_candidates == 0 {
            0.0
        } else {
            // Counts this large (2**53) are out of reach, so both are exact.
            self.inner.n_unsure as f64 / self.inner.n_candidates as f64
        }
    }

    /// int : bodies that were clustered in this frame, the first time included.
    #[getter]
    fn n_clustered(&self) -> u64 {
        self.inner.n_clustered
    }

    /// int : of those, bodies clustered again because they had flowed away from their rest pose.
    #[getter]
    fn n_reclustered(&self) -> u64 {
        self.inner.n_reclustered
    }

    /// int : runs over parts of the work; 1 when the memory budget allowed for all at once.
    #[getter]
    fn n_batches(&self) -> u64 {
        self.inner.n_batches
    }

    /// int : GPU: pieces that a scene was cut into because the device or the budget could not hold it
    /// whole; 0 if it was not.
    #[getter]
    fn n_pieces(&self) -> u64 {
        self.inner.n_pieces
    }

    /// int : stages that were run again because a buffer had to grow.
    #[getter]
    fn n_reruns(&self) -> u64 {
        self.inner.n_reruns
    }

    /// int : bytes that the detector holds, the answer not counted.
    #[getter]
    fn bytes_held(&self) -> u64 {
        self.inner.bytes_held
    }

    /// All of it as a dictionary, ready for ``json.dump``.
    ///
    /// Returns
    /// -------
    /// dict
    fn as_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        all.set_item("backend", self.backend())?;
        all.set_item("method", self.method())?;
        all.set_item("n_threads", self.n_threads())?;
        all.set_item("stages", self.stages(py)?)?;
        all.set_item("total_ms", self.total_ms())?;
        all.set_item("grid", self.grid())?;
        all.set_item("n_subdivided", self.n_subdivided())?;
        all.set_item("n_entries", self.n_entries())?;
        all.set_item("n_clusters", self.n_clusters())?;
        all.set_item("n_culled", self.n_culled())?;
        all.set_item("n_work_items", self.n_work_items())?;
        all.set_item("n_candidates", self.n_candidates())?;
        all.set_item("n_unsure", self.n_unsure())?;
        all.set_item("unsure_share", self.unsure_share())?;
        all.set_item("n_clustered", self.n_clustered())?;
        all.set_item("n_reclustered", self.n_reclustered())?;
        all.set_item("n_batches", self.n_batches())?;
        all.set_item("n_pieces", self.n_pieces())?;
        all.set_item("n_reruns", self.n_reruns())?;
        all.set_item("bytes_held", self.bytes_held())?;
        Ok(all)
    }

    fn __repr__(&self) -> String {
        let stages: Vec<String> = self
            .inner
            .stages
            .iter()
            .map(|stage| format!("{} {:.3}", stage.name, stage.ms))
            .collect();
        format!(
            "Statistics({:.3} ms by {:?} on {:?}: {}; {} candidates, {} unsure)",
            self.inner.total_ms,
            self.inner.method,
            self.inner.backend,
            stages.join(", "),
            self.inner.n_candidates,
            self.inner.n_unsure
        )
    }
}
