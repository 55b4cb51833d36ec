//! Meshes of other libraries as vertices and faces.

use impinge::BodyKind;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::RowKind;
use crate::errors::{Names, invalid};
use crate::files::Mesh;

/// What `Scene.add` takes from a mesh.
pub struct Parts<'py> {
    pub vertices: Bound<'py, PyAny>,
    pub elements: Bound<'py, PyAny>,
    pub kind: Option<RowKind>,
    pub names: Names<'static>,
}

/// Takes a mesh apart: one with `vertices` and `faces` (trimesh) or `triangles` (Open3D), or with
/// `points` and `cells_dict` (meshio).
pub fn parts<'py>(mesh: &Bound<'py, PyAny>, kind: Option<RowKind>) -> PyResult<Parts<'py>> {
    // Of a mesh that was read it is known what its rows are.
    let known = mesh.cast::<Mesh>().ok().map(|mesh| mesh.get().kind());
    let kind = kind.or(known);
    if mesh.hasattr("vertices")? {
        for (attribute, elements) in [("faces", "mesh.faces"), ("triangles", "mesh.triangles")] {
            if mesh.hasattr(attribute)? {
                return Ok(Parts {
                    vertices: mesh.getattr("vertices")?,
                    elements: mesh.getattr(attribute)?,
                    kind,
                    names: Names {
                        vertices: "mesh.vertices",
                        elements,
                        kind: "kind",
                    },
                });
            }
        }
    }
    if mesh.hasattr("points")? && mesh.hasattr("cells_dict")? {
        let cells = mesh.getattr("cells_dict")?;
        let cells = cells.cast::<PyDict>()?;
        let (name, kind) = cell_type(cells, kind)?;
        let elements = cells.get_item(name)?;
        return Ok(Parts {
            vertices: mesh.getattr("points")?,
            elements: elements.ok_or_else(|| nothing(cells, name))?,
            kind: Some(kind),
            names: Names {
                vertices: "mesh.points",
                elements: "mesh.cells",
                kind: "kind",
            },
        });
    }
    let hint = match kind {
        Some(RowKind::Of(BodyKind::Points)) => " (add_points takes all vertices as points)",
        _ => "",
    };
    Err(PyTypeError::new_err(format!(
        "faces: none given with a {}, which is no mesh: vertices and faces expected, or an object that has them{hint}",
        mesh.get_type().name()?
    )))
}

/// The cells of meshio that are taken.
const CELLS: [(&str, RowKind); 5] = [
    ("triangle", RowKind::Of(BodyKind::Triangles)),
    ("tetra", RowKind::Of(BodyKind::Tetrahedra)),
    ("quad", RowKind::Quads),
    ("line", RowKind::Of(BodyKind::Edges)),
    ("vertex", RowKind::Of(BodyKind::Points)),
];

fn cell_type(
    cells: &Bound<'_, PyDict>,
    kind: Option<RowKind>,
) -> PyResult<(&'static str, RowKind)> {
    if let Some(kind) = kind {
        let of_kind = CELLS.into_iter().find(|cell| cell.1 == kind);
        return of_kind.ok_or_else(|| nothing(cells, "cells of this kind"));
    }
    let names = types(cells);
    let known = |name: &String| CELLS.into_iter().find(|cell| cell.0 == name);
    // Lines and vertices beside faces are markings of those.
    let mut found: Vec<_> = names.iter().filter_map(known).collect();
    if found
        .iter()
        .any(|cell| cell.0.len() > 3 && !matches!(cell.0, "line" | "vertex"))
    {
        found.retain(|cell| !matches!(cell.0, "line" | "vertex"));
    }
    let unknown = names.iter().any(|name| known(name).is_none());
    match (&found[..], unknown) {
        ([("quad", _)], false) => Err(invalid(
            "mesh.cells: quads, which are no triangles: say kind=\"quads\" to cut each into two",
        )),
        ([one], false) => Ok(*one),
        _ => Err(invalid(format!(
            "mesh.cells: {} given, one of triangle and tetra expected: say which by kind=",
            if names.is_empty() {
                "none".to_owned()
            } else {
                names.join(", ")
            }
        ))),
    }
}

fn types(cells: &Bound<'_, PyDict>) -> Vec<String> {
    let names = cells.keys().into_iter();
    names.filter_map(|name| name.extract().ok()).collect()
}

fn nothing(cells: &Bound<'_, PyDict>, name: &str) -> PyErr {
    invalid(format!(
        "mesh.cells: {name} expected, {} given",
        types(cells).join(", ")
    ))
}
