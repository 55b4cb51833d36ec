//! `impinge._impinge._VertexFilter`: which pairs of elements `impinge.ipc` lets collide.

use std::sync::{Arc, Mutex, PoisonError};

use impinge::{ElementVertices, PairFilter};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

/// Which pairs of elements collide, by their vertices in a mesh whose parts are several bodies.
///
/// Two elements that name a common vertex of the mesh do not. Nor do elements whose vertices all have one label. Of the
/// others, those do for which `may` is true of any vertex of one with any vertex of the other; it is called last.
#[pyclass(module = "impinge", name = "_VertexFilter", frozen)]
pub struct VertexFilter {
    pub inner: PairFilter,
    raised: Raised,
}

/// The first exception of the callback.
type Raised = Arc<Mutex<Option<PyErr>>>;

#[pymethods]
impl VertexFilter {
    /// `rows`: for each body the numbers of its vertices in the mesh, or ``None`` where they are the same. `labels`: one per
    /// vertex of the mesh.
    #[new]
    fn new(
        rows: Vec<Option<PyReadonlyArray1<'_, u32>>>,
        labels: Option<PyReadonlyArray1<'_, i64>>,
        may: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let mut maps = Vec::new();
        for row in &rows {
            maps.push(match row {
                Some(row) => Some(row.as_slice()?.to_vec()),
                None => None,
            });
        }
        let labels = match &labels {
            Some(labels) => Some(labels.as_slice()?.to_vec()),
            None => None,
        };
        let is_early = may.is_none();
        let raised = Raised::default();
        let of_callback = Arc::clone(&raised);
        let inner = PairFilter::new(move |pair| {
            let [a, b] = pair.map(|element| in_mesh(&maps, element));
            if a.iter().any(|vertex| b.contains(vertex)) {
                return false;
            }
            if let Some(labels) = &labels {
                let label = |vertex: &u32| labels.get(*vertex as usize);
                let first = label(&a[0]);
                if a.iter().chain(&b).all(|vertex| label(vertex) == first) {
                    return false;
                }
            }
            may.as_ref()
                .is_none_or(|may| passes(may, &a, &b, &of_callback))
        });
        Ok(VertexFilter {
            inner: if is_early { inner.early() } else { inner },
            raised,
        })
    }
}

impl VertexFilter {
    /// Raises what the callback raised during a question.
    pub fn check(&self) -> PyResult<()> {
        let mut raised = self.raised.lock().unwrap_or_else(PoisonError::into_inner);
        raised.take().map_or(Ok(()), Err)
    }
}

/// The vertices of an element as those of the mesh.
fn in_mesh(maps: &[Option<Vec<u32>>], (body, corners): ElementVertices<'_>) -> Vec<u32> {
    match maps.get(body.index()) {
        Some(Some(map)) => corners.iter().map(|&corner| map[corner as usize]).collect(),
        _ => corners.to_vec(),
    }
}

/// Whether any vertices of two elements may collide. After an exception, nothing is asked any more.
fn passes(may: &Py<PyAny>, a: &[u32], b: &[u32], raised: &Raised) -> bool {
    let ask = |py: Python<'_>| -> PyResult<bool> {
        for &x in a {
            for &y in b {
                if may.call1(py, (x, y))?.is_truthy(py)? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    };
    let is_over = |raised: &Raised| raised.lock().is_ok_and(|raised| raised.is_some());
    if is_over(raised) {
        return false;
    }
    match Python::try_attach(ask) {
        Some(Ok(passes)) => passes,
        Some(Err(error)) => {
            let mut raised = raised.lock().unwrap_or_else(PoisonError::into_inner);
            raised.get_or_insert(error);
            false
        }
        None => false,
    }
}
