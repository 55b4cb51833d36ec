//! The GPUs of this machine, for Python.

use pyo3::prelude::*;

/// The fields of `impinge.DeviceInfo`.
type Fields = (String, String, String, bool, u64);

#[pyfunction]
pub fn _devices(py: Python<'_>) -> Vec<Fields> {
    py.detach(|| {
        let found = impinge::devices().into_iter();
        found
            .map(|device| {
                (
                    device.name,
                    device.interface,
                    device.driver,
                    device.is_software,
                    device.max_binding,
                )
            })
            .collect()
    })
}
