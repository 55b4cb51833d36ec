//! The GPUs of this machine: `impinge_find_devices`.

#[cfg(feature = "gpu")]
use std::ffi::CString;

use crate::status::{clear, destroy, guard, put};
use crate::types::*;

/// The GPUs that can run the library's kernels.
#[derive(Default)]
pub struct impinge_devices {
    rows: Vec<impinge_device>,
    /// What the rows point to.
    #[cfg(feature = "gpu")]
    texts: Vec<CString>,
}

#[cfg(feature = "gpu")]
fn find() -> impinge_devices {
    let mut found = impinge_devices::default();
    for device in impinge::devices() {
        let texts = [&device.name, &device.interface, &device.driver];
        let [name, interface_name, driver] = texts.map(|text| {
            let text = CString::new(text.replace('\0', "")).unwrap_or_default();
            let at = text.as_ptr();
            found.texts.push(text);
            at
        });
        found.rows.push(impinge_device {
            name,
            interface_name,
            driver,
            max_binding: device.max_binding,
            is_software: device.is_software.into(),
            reserved: 0,
        });
    }
    found
}

/// Without the GPU backend there are none that it can run on.
#[cfg(not(feature = "gpu"))]
fn find() -> impinge_devices {
    impinge_devices::default()
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_devices(devices: *mut *mut impinge_devices) -> Status {
    guard(|| {
        // SAFETY: `impinge.h` says what pointers are, here and in all functions below.
        unsafe {
            clear(devices, "devices")?;
            put(devices, "devices", Box::into_raw(Box::new(find())))
        }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_devices_count(devices: *const impinge_devices) -> usize {
    // SAFETY: see `impinge_find_devices`.
    unsafe { devices.as_ref() }.map_or(0, |of| of.rows.len())
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_devices_data(
    devices: *const impinge_devices,
) -> *const impinge_device {
    // SAFETY: see `impinge_find_devices`.
    match unsafe { devices.as_ref() }.map(|of| &of.rows[..]) {
        None | Some([]) => std::ptr::null(),
        Some(rows) => rows.as_ptr(),
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_devices_destroy(devices: *mut impinge_devices) {
    // SAFETY: see `impinge_find_devices`.
    unsafe { destroy(devices) }
}
