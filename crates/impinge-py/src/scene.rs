//! `impinge.Scene`: bodies, their topology and positions.

use impinge::{BodyId, BodyKind, Elements, Filter, Part, Positions, Real, Thickness, Weld};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::{PyRuntimeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyList, PyTuple};

use crate::arrays::{self, PositionArray, RowKind, positions_array, slice_rows};
use crate::bodies::{Body, body_id, new_scene_number};
use crate::errors::{Names, invalid, raise, refuse};
use crate::exclusion::Exclusion;
use crate::lent;
use crate::meshes;
use crate::settings::{self, Argument, flags, length, unsigned};

const ARGUMENTS: Names<'static> = Names {
    vertices: "vertices",
    elements: "faces",
    kind: "kind",
};

/// What `impinge.Scene` is made of.
#[pyclass(module = "impinge._impinge", name = "SceneBase", subclass)]
pub struct Scene {
    pub inner: impinge::Scene,
    pub number: u64,
}

impl Scene {
    /// A scene without bodies.
    pub fn empty() -> Self {
        Scene {
            inner: impinge::Scene::new(),
            number: new_scene_number(),
        }
    }

    /// The body that an argument names.
    pub fn id(&self, argument: &Bound<'_, PyAny>, name: &str) -> PyResult<BodyId> {
        let id = body_id(
            argument,
            name,
            self.number,
            self.inner.bodies().map(|(id, _)| id),
        )?;
        self.inner.body(id).map_err(raise)?;
        Ok(id)
    }

    fn body(&self, argument: &Bound<'_, PyAny>) -> PyResult<&impinge::Body> {
        self.inner.body(self.id(argument, "body")?).map_err(raise)
    }

    fn handle(&self, id: BodyId) -> Body {
        Body {
            id,
            scene: self.number,
        }
    }

    /// Adds a body whose arguments go by other names in the caller's signature.
    pub fn add_named(
        &mut self,
        vertices: &Bound<'_, PyAny>,
        elements: &Bound<'_, PyAny>,
        kind: Option<RowKind>,
        names: Names<'_>,
    ) -> PyResult<BodyId> {
        self.add_welded(vertices, elements, kind, names, false)
    }

    /// As [`add_named`](Self::add_named); with `weld`, vertices at the same position become one.
    pub fn add_welded(
        &mut self,
        vertices: &Bound<'_, PyAny>,
        elements: &Bound<'_, PyAny>,
        kind: Option<RowKind>,
        names: Names<'_>,
        weld: bool,
    ) -> PyResult<BodyId> {
        let positions = PositionArray::new(vertices, names.vertices)?;
        let mut elements = arrays::elements(elements, names, kind, positions.len())?;
        let held = if weld {
            let (weld, welded) = welded(&positions)?;
            elements = apply(&weld, &elements);
            welded
        } else {
            stored(&positions)?
        };
        self.inner
            .add((elements, held))
            .map_err(|error| refuse(error, names))
    }
}

/// A welding of vertices at the same position, and the positions that stay.
pub fn welded(positions: &PositionArray<'_>) -> PyResult<(Weld, Positions)> {
    fn welded<R: Real>(positions: &[[R; 3]]) -> PyResult<(Weld, Positions)> {
        let weld = Weld::by_position(positions);
        let welded = weld
            .positions(positions)
            .map_err(|error| raise(error.into()))?;
        Ok((weld, welded.into()))
    }
    match positions {
        PositionArray::F32(array) => welded::<f32>(slice_rows(array)?),
        PositionArray::F64(array) => welded::<f64>(slice_rows(array)?),
    }
}

/// Elements with the indices of welded vertices.
fn apply(weld: &Weld, elements: &Elements) -> Elements {
    match elements {
        Elements::Points(points) => Elements::Points(weld.apply(points)),
        Elements::Edges(edges) => Elements::Edges(weld.apply(edges)),
        Elements::Triangles(faces) => Elements::Triangles(weld.apply(faces)),
        Elements::Tetrahedra(tets) => Elements::Tetrahedra(weld.apply(tets)),
    }
}

fn stored(positions: &PositionArray<'_>) -> PyResult<Positions> {
    Ok(match positions {
        PositionArray::F32(array) => Positions::F32(slice_rows(array)?.to_vec().into()),
        PositionArray::F64(array) => Positions::F64(slice_rows(array)?.to_vec().into()),
    })
}

/// Elements as an array of vertex indices.
fn of_elements<'py>(py: Python<'py>, elements: &Elements) -> PyResult<Bound<'py, PyAny>> {
    let (flat, n_columns) = match elements {
        Elements::Points(points) => (points.as_flattened(), 1),
        Elements::Edges(edges) => (edges.as_flattened(), 2),
        Elements::Triangles(faces) => (faces.as_flattened(), 3),
        Elements::Tetrahedra(tets) => (tets.as_flattened(), 4),
    };
    let shape = [elements.len(), n_columns];
    Ok(PyArray1::from_slice(py, flat).reshape(shape)?.into_any())
}

/// How deep two convex bodies overlap, which way, and where.
type Overlap = (f64, [f64; 3], [f64; 3]);

/// Borrows a scene to change it; a detection in another thread may be reading it.
fn change<'py>(scene: &Bound<'py, Scene>) -> PyResult<PyRefMut<'py, Scene>> {
    scene.try_borrow_mut().map_err(|_| {
        PyRuntimeError::new_err("the scene is being read by a detection: wait for it to end")
    })
}

/// An argument about a body, as errors name it.
fn named(id: BodyId, argument: &str) -> String {
    format!("body {id}: {argument}")
}

/// An error of positions that a body is given.
fn refuse_of(id: BodyId, error: impinge::Error) -> PyErr {
    match error {
        // Names the body.
        impinge::Error::WrongNumberOfPositions { .. } => refuse(error, ARGUMENTS),
        error => refuse(
            error,
            Names {
                vertices: &named(id, "vertices"),
                ..ARGUMENTS
            },
        ),
    }
}

/// Moves a body, or the end of its step, by a matrix.
fn move_by(
    scene: &Bound<'_, Scene>,
    body: &Bound<'_, PyAny>,
    matrix: &Bound<'_, PyAny>,
    set: impl Fn(&mut impinge::Scene, BodyId, &[[f64; 4]; 4]) -> Result<(), impinge::Error>,
) -> PyResult<()> {
    let mut scene = change(scene)?;
    let id = scene.id(body, "body")?;
    let matrix = arrays::matrix(matrix, "matrix")?;
    set(&mut scene.inner, id, &matrix).map_err(|error| match error {
        impinge::Error::Setting { given, allowed, .. } => {
            invalid(format!("matrix: {given} given, {allowed} allowed"))
        }
        error => raise(error),
    })
}

#[pymethods]
impl Scene {
    #[new]
    fn new() -> Self {
        Scene::empty()
    }

    fn _add(
        slf: &Bound<'_, Self>,
        vertices: &Bound<'_, PyAny>,
        faces: Argument<'_, '_>,
        kind: Argument<'_, '_>,
    ) -> PyResult<Body> {
        let kind = settings::kind(kind, ARGUMENTS.kind)?;
        let id = match faces {
            Some(faces) => change(slf)?.add_named(vertices, faces, kind, ARGUMENTS)?,
            None => {
                let mesh = meshes::parts(vertices, kind)?;
                change(slf)?.add_named(&mesh.vertices, &mesh.elements, mesh.kind, mesh.names)?
            }
        };
        Ok(slf.try_borrow()?.handle(id))
    }

    /// For functions whose arguments have other names; with `weld`, vertices at the same position
    /// become one.
    fn _add_named(
        slf: &Bound<'_, Self>,
        vertices: &Bound<'_, PyAny>,
        elements: &Bound<'_, PyAny>,
        kind: Argument<'_, '_>,
        names: (String, String, String),
        #[pyo3(from_py_with = flags::weld)] weld: bool,
    ) -> PyResult<()> {
        let names = Names {
            vertices: &names.0,
            elements: &names.1,
            kind: &names.2,
        };
        let kind = settings::kind(kind, names.kind)?;
        change(slf)?.add_welded(vertices, elements, kind, names, weld)?;
        Ok(())
    }

    fn _add_many(
        slf: &Bound<'_, Self>,
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        vertex_offsets: &Bound<'_, PyAny>,
        face_offsets: &Bound<'_, PyAny>,
        kind: Argument<'_, '_>,
    ) -> PyResult<Vec<Body>> {
        let kind = settings::kind(kind, ARGUMENTS.kind)?;
        if kind == Some(RowKind::Quads) {
            return Err(invalid(
                "kind: \"quads\" given, which would move the offsets; cut them into triangles first",
            ));
        }
        let positions = PositionArray::new(vertices, "vertices")?;
        let elements = arrays::elements(faces, ARGUMENTS, kind, positions.len())?;
        let of_vertices = arrays::offsets(vertex_offsets, "vertex_offsets")?;
        let of_faces = arrays::offsets(face_offsets, "face_offsets")?;
        let mut scene = change(slf)?;
        let inner = &mut scene.inner;
        let ids = match &positions {
            PositionArray::F32(array) => {
                let rows = slice_rows::<f32, 3>(array)?;
                inner.add_many(&elements, &of_faces, rows, &of_vertices)
            }
            PositionArray::F64(array) => {
                let rows = slice_rows::<f64, 3>(array)?;
                inner.add_many(&elements, &of_faces, rows, &of_vertices)
            }
        };
        let ids = ids.map_err(|error| match error {
            impinge::Error::Setting {
                setting: "element_offsets",
                given,
                allowed,
            } => invalid(format!("face_offsets: {given} given, {allowed} allowed")),
            error => raise(error),
        })?;
        Ok(ids.into_iter().map(|id| scene.handle(id)).collect())
    }

    fn _add_edges(
        slf: &Bound<'_, Self>,
        vertices: &Bound<'_, PyAny>,
        edges: &Bound<'_, PyAny>,
    ) -> PyResult<Body> {
        let names = Names {
            elements: "edges",
            ..ARGUMENTS
        };
        let mut scene = change(slf)?;
        let id = scene.add_named(vertices, edges, Some(RowKind::Of(BodyKind::Edges)), names)?;
        Ok(scene.handle(id))
    }

    fn _add_points(slf: &Bound<'_, Self>, vertices: &Bound<'_, PyAny>) -> PyResult<Body> {
        let mut scene = change(slf)?;
        let positions = PositionArray::new(vertices, "vertices")?;
        let id = match &positions {
            PositionArray::F32(array) => scene.inner.add_points::<f32>(slice_rows(array)?),
            PositionArray::F64(array) => scene.inner.add_points::<f64>(slice_rows(array)?),
        }
        .map_err(|error| refuse(error, ARGUMENTS))?;
        Ok(scene.handle(id))
    }

    /// With `copy`, the array may change afterwards; without, it is read where it lies.
    fn _set_positions(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        vertices: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = flags::copy)] copy: bool,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let name = named(id, "vertices");
        let positions = PositionArray::new(vertices, &name)?;
        let inner = &mut scene.inner;
        match &positions {
            _ if !copy => inner.set_positions(id, lent::positions(vertices, &positions, &name)?),
            PositionArray::F32(array) => inner.set_positions(id, slice_rows::<f32, 3>(array)?),
            PositionArray::F64(array) => inner.set_positions(id, slice_rows::<f64, 3>(array)?),
        }
        .map_err(|error| refuse_of(id, error))
    }

    /// As `_set_positions`; `None` forgets them.
    fn _set_end_positions(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        vertices: Argument<'_, '_>,
        #[pyo3(from_py_with = flags::copy)] copy: bool,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let inner = &mut scene.inner;
        let Some(vertices) = vertices else {
            return inner.clear_end_positions(id).map_err(raise);
        };
        let name = named(id, "vertices");
        let positions = PositionArray::new(vertices, &name)?;
        match &positions {
            _ if !copy => {
                inner.set_end_positions(id, lent::positions(vertices, &positions, &name)?)
            }
            PositionArray::F32(array) => inner.set_end_positions(id, slice_rows::<f32, 3>(array)?),
            PositionArray::F64(array) => inner.set_end_positions(id, slice_rows::<f64, 3>(array)?),
        }
        .map_err(|error| refuse_of(id, error))
    }

    fn _remesh(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        kind: Argument<'_, '_>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let positions = PositionArray::new(vertices, ARGUMENTS.vertices)?;
        let kind = settings::kind(kind, ARGUMENTS.kind)?;
        let elements = arrays::elements(faces, ARGUMENTS, kind, positions.len())?;
        scene
            .inner
            .remesh(id, (elements, stored(&positions)?))
            .map_err(|error| refuse(error, ARGUMENTS))
    }

    fn _set_transform(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        matrix: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        move_by(slf, body, matrix, impinge::Scene::set_transform)
    }

    fn _set_end_transform(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        matrix: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        move_by(slf, body, matrix, impinge::Scene::set_end_transform)
    }

    fn _transform<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let matrix = self.body(body)?.transform();
        let flat = matrix.map(|rows| PyArray1::from_slice(py, rows.as_flattened()));
        flat.map(|flat| Ok(flat.reshape([4, 4])?.into_any()))
            .transpose()
    }

    fn _rest_positions<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        positions_array(py, self.body(body)?.rest_positions())
    }

    fn _remove(slf: &Bound<'_, Self>, body: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        scene.inner.remove(id).map_err(raise)
    }

    fn _set_filter(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        category: Argument<'_, '_>,
        mask: Argument<'_, '_>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let mut filter = Filter::default();
        if let Some(category) = category {
            filter.category = unsigned(category, "category", u64::MAX)?;
        }
        if let Some(mask) = mask {
            filter.mask = unsigned(mask, "mask", u64::MAX)?;
        }
        scene.inner.set_filter(id, filter).map_err(raise)
    }

    fn _set_edges(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        edges: Argument<'_, '_>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let n_vertices = scene.inner.body(id).map_err(raise)?.n_vertices();
        let edges = match edges {
            None => Vec::new(),
            Some(edges) => arrays::index_rows(edges, "edges", &[2], n_vertices)?.0,
        };
        (scene.inner.set_edges(id, edges.as_chunks().0)).map_err(raise)
    }

    fn _set_groups(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        groups: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let id = change(slf)?.id(body, "body")?;
        // An array of the caller's own kind may ask the scene while it is read.
        let groups = arrays::whole_numbers(groups, &named(id, "groups"))?;
        change(slf)?.inner.set_groups(id, &groups).map_err(raise)
    }

    fn _set_pinned(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        pinned: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let n_vertices = scene.inner.body(id).map_err(raise)?.n_vertices();
        let pinned = arrays::mask(pinned, &named(id, "pinned"), n_vertices)?;
        scene.inner.set_pinned(id, &pinned).map_err(raise)
    }

    fn _set_thickness(
        slf: &Bound<'_, Self>,
        body: &Bound<'_, PyAny>,
        thickness: &Bound<'_, PyAny>,
        part: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let mut scene = change(slf)?;
        let id = scene.id(body, "body")?;
        let thickness = self::thickness(thickness, part)?;
        scene.inner.set_thickness(id, thickness).map_err(raise)
    }

    fn _vertex_pairs(
        &self,
        body: &Bound<'_, PyAny>,
        offsets: &Bound<'_, PyAny>,
        vertices: &Bound<'_, PyAny>,
        other: &Bound<'_, PyAny>,
    ) -> PyResult<Exclusion> {
        let a = self.id(body, "body")?;
        let b = match other.is_none() {
            true => a,
            false => self.id(other, "other")?,
        };
        let offsets = arrays::offsets(offsets, "offsets")?;
        let offsets = offsets.into_iter().map(|offset| offset as u64).collect();
        let vertices = arrays::whole_numbers(vertices, "vertices")?;
        Ok(Exclusion::vertices([a, b], offsets, vertices, self.number))
    }

    /// Without filters and pinned vertices, for pairs at rest.
    fn _at_rest(&self) -> Self {
        Scene {
            inner: self.inner.at_rest(),
            number: self.number,
        }
    }

    fn _positions<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        positions_array(py, self.body(body)?.positions())
    }

    fn _end_positions<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let end = self.body(body)?.end_positions();
        end.map(|end| positions_array(py, end)).transpose()
    }

    fn _elements<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        of_elements(py, self.body(body)?.elements())
    }

    fn _edges<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        of_elements(py, self.body(body)?.edges())
    }

    fn _faces<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        of_elements(py, self.body(body)?.faces())
    }

    fn _kind(&self, body: &Bound<'_, PyAny>) -> PyResult<&'static str> {
        Ok(self.body(body)?.kind().name())
    }

    fn _n_elements(&self, body: &Bound<'_, PyAny>) -> PyResult<usize> {
        Ok(self.body(body)?.n_elements())
    }

    fn _convex_overlap(
        &self,
        py: Python<'_>,
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
    ) -> PyResult<Option<Overlap>> {
        let checked = |body, name| -> PyResult<&impinge::Body> {
            let id = self.id(body, name)?;
            self.inner.check_positions(id).map_err(raise)?;
            self.inner.body(id).map_err(raise)
        };
        let bodies = [checked(a, "a")?, checked(b, "b")?];
        Ok(py.detach(|| {
            let [a, b] = bodies.map(|body| -> Vec<[f64; 3]> {
                let vertices = 0..body.n_vertices();
                vertices.map(|ix| body.positions().point(ix)).collect()
            });
            let found = impinge::contact::convex_overlap(&a, &b)?;
            Some((found.depth, found.normal, a[found.vertex]))
        }))
    }

    fn _n_vertices(&self, body: &Bound<'_, PyAny>) -> PyResult<usize> {
        Ok(self.body(body)?.n_vertices())
    }

    fn _bodies(&self) -> Vec<Body> {
        self.inner.bodies().map(|(id, _)| self.handle(id)).collect()
    }

    fn _nbytes(&self) -> usize {
        self.inner.bytes()
    }

    fn __len__(&self) -> usize {
        self.inner.n_bodies()
    }

    fn __contains__(&self, body: &Bound<'_, PyAny>) -> bool {
        self.id(body, "body").is_ok()
    }

    fn __repr__(&self) -> String {
        const SHOWN: usize = 6;
        let bodies = self.inner.bodies();
        let counts = bodies.map(|(id, body)| (id, body.n_elements(), body.kind().name()));
        if self.inner.n_bodies() <= SHOWN {
            let each = counts.map(|(id, n, kind)| format!("{id}: {n} {kind}"));
            return format!("Scene({})", each.collect::<Vec<_>>().join(", "));
        }
        let mut totals = BodyKind::ALL.map(|kind| (kind.name(), 0));
        for (_, n, kind) in counts {
            for total in totals.iter_mut().filter(|total| total.0 == kind) {
                total.1 += n;
            }
        }
        let totals = totals.iter().filter(|(_, n)| *n > 0);
        let totals: Vec<String> = totals.map(|(kind, n)| format!("{n} {kind}")).collect();
        format!(
            "Scene({} bodies: {})",
            self.inner.n_bodies(),
            totals.join(", ")
        )
    }

    /// A clone: handles, answers and exclusions of the scene are also those of its copies.
    fn __copy__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let other = slf.get_type().call0()?;
        let scene = slf.try_borrow()?;
        let mut copied = change(other.cast::<Scene>()?)?;
        // What is added to two scenes without bodies has nothing in common.
        if scene.inner.n_bodies() > 0 {
            copied.number = scene.number;
        }
        copied.inner = scene.inner.deep_clone();
        drop(copied);
        Ok(other)
    }

    fn __deepcopy__<'py>(
        slf: &Bound<'py, Self>,
        _memo: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        Scene::__copy__(slf)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let py = slf.py();
        let scene = slf.try_borrow()?;
        let bodies = PyList::empty(py);
        for (id, body) in scene.inner.bodies() {
            let number = id.index().into_pyobject(py)?;
            let filter = body.filter();
            bodies.append((
                id.index(),
                body.kind().name(),
                positions_array(py, body.rest_positions())?,
                scene._elements(py, &number)?,
                scene._transform(py, &number)?,
                // A step has taken it from rest to where no matrix does, or widened it.
                (
                    is_elsewhere(body)
                        .then(|| positions_array(py, body.positions()))
                        .transpose()?,
                    scene._end_positions(py, &number)?,
                    body.has_end_by_transform(),
                ),
                filter.category,
                filter.mask,
                thickness_array(py, body),
                body.groups().map(|each| PyArray1::from_slice(py, each)),
                body.pinned().map(|each| PyArray1::from_slice(py, each)),
                (body.has_own_edges())
                    .then(|| scene._edges(py, &number))
                    .transpose()?,
            ))?;
        }
        (slf.get_type(), (), bodies).into_pyobject(py)
    }

    fn __setstate__(slf: &Bound<'_, Self>, bodies: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut scene = change(slf)?;
        let mut gaps = Vec::new();
        for state in bodies.try_iter()? {
            let state = state?;
            let item = |ix: usize| state.get_item(ix);
            // Numbers of bodies that were removed are left free.
            let number: usize = item(0)?.extract()?;
            while scene.inner.n_bodies() < number {
                gaps.push(scene.inner.add_points::<f32>(&[]).map_err(raise)?);
            }
            let (kind, vertices, elements) = (item(1)?, item(2)?, item(3)?);
            let kind = settings::kind(Some(&kind), ARGUMENTS.kind)?;
            let id = scene.add_named(&vertices, &elements, kind, ARGUMENTS)?;
            let matrix = item(4)?;
            if !matrix.is_none() {
                let matrix = arrays::matrix(&matrix, "matrix")?;
                scene.inner.set_transform(id, &matrix).map_err(raise)?;
            }
            let step: (Bound<'_, PyAny>, Bound<'_, PyAny>, bool) = item(5)?.extract()?;
            let [reached, end] = [saved_positions(&step.0)?, saved_positions(&step.1)?];
            let held = &mut scene.inner;
            held.restore_step(id, reached.as_ref(), end.as_ref(), step.2)
                .map_err(raise)?;
            let filter = Filter {
                category: item(6)?.extract()?,
                mask: item(7)?.extract()?,
            };
            scene.inner.set_filter(id, filter).map_err(raise)?;
            let edges = item(11)?;
            if !edges.is_none() {
                let edges = arrays::index_rows(&edges, "edges", &[2], usize::MAX)?.0;
                (scene.inner.set_edges(id, edges.as_chunks().0)).map_err(raise)?;
            }
            let (part, thickness): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item(8)?.extract()?;
            let thickness = self::thickness(&thickness, &part)?;
            scene.inner.set_thickness(id, thickness).map_err(raise)?;
            let groups: Option<Bound<'_, PyArray1<u32>>> = item(9)?.extract()?;
            if let Some(groups) = groups {
                let groups = groups.to_vec()?;
                scene.inner.set_groups(id, &groups).map_err(raise)?;
            }
            let pinned: Option<Bound<'_, PyArray1<bool>>> = item(10)?.extract()?;
            if let Some(pinned) = pinned {
                let pinned = pinned.to_vec()?;
                scene.inner.set_pinned(id, &pinned).map_err(raise)?;
            }
        }
        for id in gaps.into_iter().rev() {
            scene.inner.remove(id).map_err(raise)?;
        }
        Ok(())
    }
}

/// Whether neither the rest positions of a body nor its matrix say all of where it is.
fn is_elsewhere(body: &impinge::Body) -> bool {
    let (now, rest) = (body.positions(), body.rest_positions());
    match body.transform() {
        None => now != rest,
        Some(_) => std::mem::discriminant(now) != std::mem::discriminant(rest),
    }
}

/// Positions of a saved body, or `None`.
fn saved_positions(saved: &Bound<'_, PyAny>) -> PyResult<Option<Positions>> {
    if saved.is_none() {
        return Ok(None);
    }
    stored(&PositionArray::new(saved, "vertices")?).map(Some)
}

/// One number; or one per vertex, edge or face.
fn thickness(given: &Bound<'_, PyAny>, part: &Bound<'_, PyAny>) -> PyResult<Thickness<'static>> {
    let part = match part.is_none() {
        true => None,
        false => Some(part.extract::<String>().map_err(|_| {
            PyTypeError::new_err("part: \"vertices\", \"edges\" or \"faces\" expected")
        })?),
    };
    // An array of one number would be read as that number.
    let is_array = given.getattr("ndim").is_ok_and(|n| n.ne(0).unwrap_or(true));
    if part.is_none() && !is_array && given.extract::<f64>().is_ok() {
        return Ok(length(given, "thickness")?.into());
    }
    if let (Some(part), false) = (&part, is_array)
        && given.extract::<f64>().is_ok()
    {
        return Err(invalid(format!(
            "thickness: one number given with part={part:?}: one number is of the whole body, without a part; with one, give a row of \
             numbers, one for each of its {part}"
        )));
    }
    let each = arrays::numbers(given, "thickness")?;
    match part.as_deref() {
        None | Some("vertices") => Ok(Thickness::vertices(each)),
        Some("edges") => Ok(Thickness::edges(each)),
        Some("faces") => Ok(Thickness::faces(each)),
        Some(other) => Err(invalid(format!(
            "part: {other:?} given, \"vertices\", \"edges\" or \"faces\" allowed"
        ))),
    }
}

/// The part that it was given for, and what [`thickness`] reads.
fn thickness_array(py: Python<'_>, body: &impinge::Body) -> (Option<&'static str>, Py<PyAny>) {
    match body.thickness_by_element() {
        None => (None, PyFloat::new(py, body.thickness()).into_any().unbind()),
        Some((part, each)) => {
            let part = match part {
                Part::Edges => "edges",
                Part::Faces | Part::Given => "faces",
                Part::Vertices => "vertices",
            };
            (
                Some(part),
                PyArray1::from_slice(py, each).into_any().unbind(),
            )
        }
    }
}
