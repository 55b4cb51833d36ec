//! A library with the GPU backend, on any GPU or software driver.

use std::ffi::{CStr, c_char};

use super::*;
use crate::devices::*;
use crate::status::impinge_error_message;

const GPU: u32 = 2;

fn text<'a>(at: *const c_char) -> &'a str {
    // SAFETY: texts of a list of devices, of stats or of an error, which live as long as the test
    // reads them.
    unsafe { CStr::from_ptr(at) }.to_str().expect("UTF-8")
}

#[test]
fn answers_on_a_gpu_have_the_hashes_of_the_cpu() {
    assert_hashes(GPU);
}

#[test]
fn devices_have_names_that_settings_take() {
    let (_, scene) = catalogue().swap_remove(0);
    let (mut devices, mut detector) = (null_mut(), null_mut());
    // SAFETY: all pointers are to variables and handles that live as long as the call.
    unsafe {
        assert_eq!(impinge_find_devices(&mut devices), OK);
        let n = impinge_devices_count(devices);
        assert!(n > 0, "these tests need a GPU or a software driver");
        let first = &*impinge_devices_data(devices);
        assert!(["vulkan", "metal", "dx12"].contains(&text(first.interface_name)));
        assert!(first.max_binding > 0 && first.is_software < 2 && !first.driver.is_null());
        let name = text(first.name).to_owned();
        let mut settings = impinge_settings {
            backend: GPU,
            device: first.name,
            ..impinge_settings::default()
        };
        assert_eq!(impinge_detector_create(&settings, &mut detector), OK);
        // The name is copied.
        impinge_devices_destroy(devices);
        let built = through_c(&scene);
        let (mut pairs, mut expected) = (null_mut(), null_mut());
        assert_eq!(
            impinge_detect(detector, built.scene, null(), &mut pairs),
            OK
        );
        assert_eq!(
            impinge_detect(built.detector, built.scene, null(), &mut expected),
            OK
        );
        assert!(impinge_pairs_count(pairs) > 0);
        assert_eq!(impinge_pairs_hash(pairs), impinge_pairs_hash(expected));
        let mut stats = impinge_stats {
            size: size_of::<impinge_stats>() as u32,
            ..std::mem::zeroed()
        };
        assert_eq!(impinge_detector_stats(detector, &mut stats), OK);
        assert!(
            text(stats.backend).contains(&name),
            "{}",
            text(stats.backend)
        );
        impinge_pairs_destroy(pairs);
        impinge_pairs_destroy(expected);
        impinge_detector_destroy(detector);

        settings.device = c"no such device".as_ptr();
        detector = null_mut();
        assert_eq!(impinge_detector_create(&settings, &mut detector), DEVICE);
        assert!(detector.is_null());
        let message = text(impinge_error_message());
        assert!(message.contains("no such device"), "{message}");
    }
}
