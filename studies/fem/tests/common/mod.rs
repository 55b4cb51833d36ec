//! Helpers shared by the tests.

// Each test binary uses a part of this module.
#![allow(dead_code)]

use impinge::{Backend, Detector};
use impinge_fem::Settings;

pub fn cpu() -> Detector {
    Detector::new(Backend::Cpu).unwrap()
}

/// Default settings on one thread, because many tests run at the same time.
pub fn still() -> Settings {
    Settings {
        threads: 1,
        ..Settings::default()
    }
}

pub fn no_gravity() -> Settings {
    Settings {
        gravity: [0.0; 3],
        ..still()
    }
}

pub fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

pub fn sum(vectors: impl IntoIterator<Item = [f64; 3]>) -> [f64; 3] {
    vectors
        .into_iter()
        .fold([0.0; 3], |s, v| std::array::from_fn(|k| s[k] + v[k]))
}

pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
