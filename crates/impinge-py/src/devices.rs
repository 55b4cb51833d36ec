//! The GPUs of this machine, for Python.

use pyo3::prelude::*;

/// A GPU adapter: hardware, or a driver that does the work of a GPU on the CPU.
#[pyclass(module = "impinge", frozen, eq)]
#[derive(PartialEq)]
pub struct Device {
    inner: impinge::DeviceInfo,
}

#[pymethods]
impl Device {
    /// str : its name; any part of it chooses it in ``Detector(device=...)``.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    /// str : ``"vulkan"``, ``"metal"`` or ``"dx12"``.
    #[getter]
    fn interface(&self) -> &str {
        &self.inner.interface
    }

    /// str : the driver and its version.
    #[getter]
    fn driver(&self) -> &str {
        &self.inner.driver
    }

    /// bool : whether it is a program on the CPU, which ``backend="auto"`` passes over.
    #[getter]
    fn is_software(&self) -> bool {
        self.inner.is_software
    }

    /// int : bytes that one buffer binding may have.
    #[getter]
    fn max_binding(&self) -> u64 {
        self.inner.max_binding
    }

    fn __repr__(&self) -> String {
        let Self { inner } = self;
        format!("Device({:?}, {:?})", inner.name, inner.interface)
    }
}

/// The GPUs that ``backend="gpu"`` can use, hardware first.
///
/// Returns
/// -------
/// list of Device
///     Empty where there is none.
///
/// Examples
/// --------
/// >>> import impinge
/// >>> all(device.name for device in impinge.devices())
/// True
#[pyfunction]
pub fn devices(py: Python<'_>) -> Vec<Device> {
    py.detach(|| {
        let found = impinge::devices().into_iter();
        found.map(|inner| Device { inner }).collect()
    })
}
