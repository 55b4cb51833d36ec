//! The Python module `impinge`: the library's scenes, detectors and answers on NumPy arrays.
//!
//! What Python users read is written in Python, in the package's own modules, and in
//! `docs/python.md`. This crate converts arguments, names what it refuses, and lets go of the
//! interpreter while it works.

mod answers;
mod arrays;
mod bodies;
mod closest;
mod contact;
mod datasets;
mod detector;
mod devices;
mod errors;
mod exclusion;
mod files;
mod functions;
mod hits;
mod lent;
mod meshes;
mod near;
mod options;
mod scene;
mod settings;
mod solver;
mod statistics;
mod stencils;
mod vertex_filter;
mod watch;

use pyo3::prelude::*;

/// Exact, real-time collision detection for deforming meshes (compiled part).
#[pymodule]
mod _impinge {
    use impinge::PairKind;
    use pyo3::prelude::*;
    use pyo3::types::{PyModule, PyTuple};

    use super::near::{FEATURES, TYPES};

    #[pymodule_export]
    use super::answers::{Advance, Candidates, Impacts, Pairs, Truncation};
    #[pymodule_export]
    use super::bodies::Body;
    #[pymodule_export]
    use super::closest::Closest;
    #[pymodule_export]
    use super::contact::{Contacts, Penetration};
    #[pymodule_export]
    use super::datasets::{
        _check, _check_columns, _findings, _fix, _report, _serve_check, _tiles_describe,
        _tiles_merge, _tiles_plan, _tiles_run, _tiles_scatter,
    };
    #[pymodule_export]
    use super::detector::DetectorBase;
    #[pymodule_export]
    use super::devices::_devices;
    #[pymodule_export]
    use super::exclusion::{_groups, _rings, Exclusion};
    #[pymodule_export]
    use super::files::{_mesh, Mesh, read, read_bodies};
    #[pymodule_export]
    use super::functions::{_hash_rows, _weld};
    #[pymodule_export]
    use super::hits::Hits;
    #[pymodule_export]
    use super::near::{_rest_pairs, Near};
    #[pymodule_export]
    use super::options::_check_options;
    #[pymodule_export]
    use super::scene::Scene;
    #[pymodule_export]
    use super::settings::_length;
    #[pymodule_export]
    use super::solver::{Neighbours, SafeDistances};
    #[pymodule_export]
    use super::stencils::{_project_psd, _stencils, Stencils};
    #[pymodule_export]
    use super::vertex_filter::VertexFilter;
    #[pymodule_export]
    use super::watch::CancelToken;

    /// The names that numbers of columns stand for.
    #[pymodule_init]
    fn names(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let names = |names: &[&str]| PyTuple::new(module.py(), names);
        module.add("KINDS", names(&PairKind::ALL.map(PairKind::name))?)?;
        module.add("TYPES", names(&TYPES)?)?;
        module.add("FEATURES", names(&FEATURES)?)
    }

    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the name that Python expects")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
