//! What `impinge.Stencils` is made of: derivatives of distances, as arrays.

use impinge::{Stencil, project_psd_all};
use numpy::{
    Element, IxDyn, PyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::answers::{collect, kind_numbers, to_array};
use crate::arrays::{PositionArray, Rows};
use crate::errors::{invalid, raise};
use crate::near::{Near, type_numbers};
use crate::scene::Scene;
use crate::settings::{flags, unexpected};

/// Numbers of rows of any shape.
type Numbers<'py> = Bound<'py, PyArray<f64, IxDyn>>;

/// What `impinge.Stencils` is made of.
#[pyclass(module = "impinge._impinge", frozen)]
pub struct Stencils {
    inner: impinge::Stencils,
}

impl Stencils {
    /// Of near pairs, at the positions of a scene.
    fn new(
        near: &Near,
        scene: &Bound<'_, PyAny>,
        rest: &Bound<'_, PyAny>,
        by_area: bool,
    ) -> PyResult<Self> {
        let py = scene.py();
        let scene = scene
            .cast::<Scene>()
            .map_err(|_| unexpected(scene, "scene", "a Scene"))?
            .try_borrow()
            .map_err(|_| PyRuntimeError::new_err("the scene is being changed by another thread"))?;
        if by_area && rest.is_none() {
            return Err(invalid(
                "by_area: areas are those at rest, but rest is None",
            ));
        }
        let rest = match rest.is_none() {
            true => None,
            false => Some(PositionArray::new(rest, "rest")?),
        };
        let rows = rest.as_ref().map(PositionArray::rows).transpose()?;
        let bodies = &scene.inner;
        let inner = py.detach(|| {
            let rest = rows.map(Rows::widened);
            match &rest {
                Some(rest) if by_area => near.iter().stencils_by_area(bodies, rest),
                _ => near.iter().stencils(bodies, rest.as_deref()),
            }
        });
        let inner = inner.map_err(raise)?;
        Ok(Stencils { inner })
    }

    /// One number, row or matrix per stencil.
    fn numbers<'py, T: Copy + Send>(
        &self,
        py: Python<'py>,
        shape: &[usize],
        flat: impl FnOnce(Vec<T>) -> Vec<f64> + Send,
        of: impl Fn(&Stencil) -> T + Send + Sync,
    ) -> PyResult<Numbers<'py>> {
        let n = self.inner.len();
        let rows = py.detach(|| self.inner.column(of).map(flat));
        let rows = rows.map_err(raise)?;
        shaped(py, rows, &[&[n], shape].concat())
    }
}

/// Rows as an array.
fn shaped<'py, T: Element>(
    py: Python<'py>,
    flat: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArray<T, IxDyn>>> {
    PyArray1::from_vec(py, flat).reshape(shape)
}

#[pymethods]
impl Stencils {
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let rows = self.inner.iter().map(|of| of.vertices);
        to_array(py, collect(self.__len__(), rows)?)
    }

    fn kinds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        kind_numbers(py, self.__len__(), self.inner.iter().map(|of| of.kind))
    }

    fn types<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let rows = self.inner.iter();
        type_numbers(py, rows.map(|of| (of.kind, of.features, of.name())))
    }

    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        self.numbers(py, &[], |rows| rows, |of| of.weight)
    }

    fn coefficients<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        self.numbers(py, &[4], Vec::into_flattened, Stencil::coefficients)
    }

    fn squared_distances<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        self.numbers(py, &[], |rows| rows, Stencil::squared_distance)
    }

    fn gradients<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        self.numbers(py, &[12], Vec::into_flattened, Stencil::gradient)
    }

    fn hessians<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        let flat = |rows: Vec<_>| rows.into_flattened().into_flattened();
        self.numbers(py, &[12, 12], flat, Stencil::hessian)
    }

    fn mollifiers<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        self.numbers(py, &[], |rows| rows, Stencil::mollifier)
    }

    fn mollifier_gradients<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        self.numbers(py, &[12], Vec::into_flattened, Stencil::mollifier_gradient)
    }

    fn mollifier_hessians<'py>(&self, py: Python<'py>) -> PyResult<Numbers<'py>> {
        let flat = |rows: Vec<_>| rows.into_flattened().into_flattened();
        self.numbers(py, &[12, 12], flat, Stencil::mollifier_hessian)
    }

    fn mollified<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let rows = py.detach(|| self.inner.column(Stencil::is_mollified));
        Ok(PyArray1::from_vec(py, rows.map_err(raise)?))
    }

    fn offsets<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.inner.offsets())
    }

    fn merged(&self, py: Python<'_>) -> PyResult<Stencils> {
        let inner = py.detach(|| self.inner.merged()).map_err(raise)?;
        Ok(Stencils { inner })
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }
}

/// Of near pairs, with positions at rest or `None`.
#[pyfunction]
pub fn _stencils(
    near: &Bound<'_, Near>,
    scene: &Bound<'_, PyAny>,
    rest: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = flags::by_area)] by_area: bool,
) -> PyResult<Stencils> {
    Stencils::new(near.get(), scene, rest, by_area)
}

/// Copies of square matrices without their negative eigenvalues.
#[pyfunction]
pub fn _project_psd<'py>(
    py: Python<'py>,
    matrices: PyReadonlyArrayDyn<'py, f64>,
    threads: usize,
) -> PyResult<Numbers<'py>> {
    let shape = matrices.shape().to_vec();
    // In the order of rows, however they are stored.
    let mut flat = collect(matrices.len(), matrices.as_array().iter().copied())?;
    let size = shape.last().copied().unwrap_or_default();
    let projected = py.detach(|| project_psd_all(&mut flat, size, threads));
    projected.map_err(raise)?;
    shaped(py, flat, &shape)
}
