//! `impinge._impinge._VertexFilter`: which pairs of elements `impinge.ipc` lets collide.
//!
//! What a callback says of two vertices is kept for the question, whichever elements have them:
//! neighbouring pairs of elements share most of theirs, and a call of Python costs more than all
//! the rest of a pair.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use impinge::{ElementVertices, PairFilter};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;

/// Which pairs of elements collide, by their vertices in a mesh whose parts are several bodies.
///
/// Two elements that name a common vertex of the mesh do not. Nor do elements whose vertices all
/// have one label. Of the others, those do for which `may` is true of any vertex of one with any
/// vertex of the other. It is called last, and with the lower vertex first, so that threads do not
/// decide the order.
#[pyclass(module = "impinge", name = "_VertexFilter", frozen)]
pub struct VertexFilter {
    pub inner: PairFilter,
    raised: Raised,
    collected: Collected,
}

/// The first exception of the callback.
type Raised = Arc<Mutex<Option<PyErr>>>;

/// The vertices of pairs that were asked about, by how many each element has, one pair after the
/// other.
type Collected = Arc<Mutex<HashMap<(usize, usize), Vec<u32>>>>;

/// A callback, and what it has said.
struct Callback {
    may: Py<PyAny>,
    known: Mutex<HashMap<(u32, u32), bool>>,
    raised: Raised,
}

#[pymethods]
impl VertexFilter {
    /// `rows`: for each body the numbers of its vertices in the mesh, or ``None`` where they are
    /// the same. `labels`: one per vertex of the mesh. With `collects`, pairs that pass are
    /// remembered and refused: a step is then asked about pairs in contact, or which might be as
    /// far as floats can tell, and no time is found.
    #[new]
    #[pyo3(signature = (rows, labels, may, collects=false))]
    fn new(
        rows: Vec<Option<PyReadonlyArray1<'_, u32>>>,
        labels: Option<PyReadonlyArray1<'_, i64>>,
        may: Option<Py<PyAny>>,
        collects: bool,
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
        let is_early = may.is_none() && !collects;
        let collected = Collected::default();
        let collector = collects.then(|| Arc::clone(&collected));
        let raised = Raised::default();
        let callback = may.map(|may| Callback {
            may,
            known: Mutex::default(),
            raised: Arc::clone(&raised),
        });
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
            let passes = callback
                .as_ref()
                .is_none_or(|callback| callback.passes(&a, &b));
            let Some(collector) = &collector else {
                return passes;
            };
            if passes {
                let mut collected = collector.lock().unwrap_or_else(PoisonError::into_inner);
                let vertices = collected.entry((a.len(), b.len())).or_default();
                vertices.extend(a.iter().chain(&b));
            }
            false
        });
        Ok(VertexFilter {
            inner: if is_early { inner.early() } else { inner },
            raised,
            collected,
        })
    }

    /// Takes the pairs that were remembered, of elements with `n_a` and `n_b` vertices: a row of
    /// vertices of the mesh per pair.
    fn collected<'py>(
        &self,
        py: Python<'py>,
        n_a: usize,
        n_b: usize,
    ) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let mut collected = self
            .collected
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let vertices = collected.remove(&(n_a, n_b)).unwrap_or_default();
        let n_pairs = vertices.len() / (n_a + n_b).max(1);
        PyArray1::from_vec(py, vertices).reshape([n_pairs, n_a + n_b])
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

impl Callback {
    /// Whether any vertices of two elements may collide. After an exception, nothing is asked any
    /// more.
    fn passes(&self, a: &[u32], b: &[u32]) -> bool {
        let pairs = a
            .iter()
            .flat_map(|&x| b.iter().map(move |&y| (x.min(y), x.max(y))));
        let mut unknown = Vec::new();
        {
            // Not held while the interpreter is waited for.
            let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
            for pair in pairs {
                match known.get(&pair) {
                    Some(true) => return true,
                    Some(false) => {}
                    None => unknown.push(pair),
                }
            }
        }
        if unknown.is_empty() || self.has_raised() {
            return false;
        }
        match Python::try_attach(|py| self.ask(py, &unknown)) {
            Some(Ok(any)) => any,
            Some(Err(error)) => {
                let mut raised = self.raised.lock().unwrap_or_else(PoisonError::into_inner);
                raised.get_or_insert(error);
                false
            }
            None => false,
        }
    }

    /// Whether the callback is true of any of some pairs of vertices: it is asked up to the first.
    fn ask(&self, py: Python<'_>, pairs: &[(u32, u32)]) -> PyResult<bool> {
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        for &pair in pairs {
            // Another thread may have asked meanwhile.
            let said = known().get(&pair).copied();
            let may = match said {
                Some(may) => may,
                None => {
                    let may = self.may.call1(py, pair)?.is_truthy(py)?;
                    known().insert(pair, may);
                    may
                }
            };
            if may {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn has_raised(&self) -> bool {
        self.raised.lock().is_ok_and(|raised| raised.is_some())
    }
}
