"""Stand-ins for the step questions of ipc-toolkit: a solver changes one import.

>>> import numpy as np
>>> from impinge import ipc                                  # instead of: import ipctk as ipc
>>> rest = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 1], [4, 0, 1], [0, 4, 1]], float)
>>> faces = np.array([[0, 1, 2], [3, 4, 5]])
>>> mesh = ipc.CollisionMesh(rest, ipc.edges(faces), faces)
>>> moved = rest.copy()
>>> moved[3:, 2] = -3                                        # one triangle falls through the other
>>> ipc.is_step_collision_free(mesh, rest, moved)
False
>>> 0.249999 < ipc.compute_collision_free_stepsize(mesh, rest, moved) < 0.25
True

The names and the order of the arguments are those of ipctk 1.6. The answers are exact where those of
ipc-toolkit are conservative up to tolerances and numbers of iterations, so a step is often longer, and never
too long: ``vertices_t0 + step * (vertices_t1 - vertices_t0)``, computed by NumPy as written here and rounded as
NumPy rounds, can be reached on a straight line without contact.

A mesh may also be one of ipc-toolkit itself, so that a solver can keep it for its potentials.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from ._impinge import Detector, Impact, Scene

__all__ = [
    "CollisionMesh",
    "compute_collision_free_stepsize",
    "edges",
    "is_step_collision_free",
]

_Array = Any
_Mesh = Any  # A CollisionMesh of this module or of ipctk.


def edges(faces: _Array) -> npt.NDArray[np.int32]:
    """The unique edges of triangles, as ``ipctk.edges`` finds them.

    Parameters
    ----------
    faces : array_like of int, shape (n, 3)

    Returns
    -------
    numpy.ndarray of int32, shape (m, 2)
        Pairs (low, high) of vertices in the order of (high, low).
    """
    corners = _indices(faces, "faces", 3)
    pairs = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]))
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]][:, ::-1], axis=0)[:, ::-1]
    return np.ascontiguousarray(pairs, np.int32)


# Arguments are called `edges`, too.
_edges_of = edges


class CollisionMesh:
    """A surface, with loose edges and points if it has some, whose vertices take part in steps.

    Parameters
    ----------
    rest_positions : array_like, shape (v, 3)
        Positions at rest. Only their number counts here.
    edges : array_like of int, shape (m, 2), optional
        Edges. Those of a face are found again from `faces`; the others are loose edges.
    faces : array_like of int, shape (n, 3), optional
        Triangles.

    Vertices that neither a face nor an edge names are loose points: they meet faces, loose edges and each other.

    Raises
    ------
    ValueError, TypeError
        Positions that are not ``(v, 3)`` (meshes in two dimensions are not served), an index out of range.
    """

    can_collide: Callable[[int, int], bool] | None
    """callable or None : whether two vertices may collide, as in ipc-toolkit. Two elements that touch count when any
    vertex of one may collide with any of the other. ``None`` (the default) lets all of them."""

    def __init__(self, rest_positions: _Array, edges: _Array = (), faces: _Array = ()) -> None:
        rest = np.asarray(rest_positions)
        if rest.ndim != 2 or rest.shape[1] != 3:
            raise ValueError(f"rest_positions: shape (n, 3) expected, {rest.shape} given")
        self._rest = rest
        self._faces = _indices(faces, "faces", 3)
        self._edges = _indices(edges, "edges", 2)
        n_vertices = len(rest)
        for name, rows in [("faces", self._faces), ("edges", self._edges)]:
            bad = np.argwhere((rows < 0) | (rows >= n_vertices))
            if len(bad):
                row, column = (int(ix) for ix in bad[0])
                value = int(rows[row, column])
                place = f"{name}[{row}, {column}]"
                raise ValueError(f"{place} = {value}: there are {n_vertices} vertices")
        self.can_collide = None
        self._detector = Detector(backend="cpu")
        self._held = Scene()
        self._parts: dict[tuple[int, str], npt.NDArray[np.uint32]] = {}
        of_faces = {tuple(edge) for edge in _edges_of(self._faces).tolist()}
        given = np.unique(np.sort(self._edges), axis=0).tolist()
        self._loose = np.array([edge for edge in given if tuple(edge) not in of_faces], np.int64)
        self._loose = self._loose.reshape(-1, 2)
        named = np.zeros(len(self._rest), bool)
        named[self._faces.ravel()] = True
        named[self._loose.ravel()] = True
        self._points = np.flatnonzero(~named)
        # Elements of two bodies that name one vertex touch there at all times: they do not count.
        self._is_mixed = bool(np.isin(self._loose, self._faces).any())

    @property
    def rest_positions(self) -> npt.NDArray[Any]:
        """numpy.ndarray, shape (v, 3) : positions at rest."""
        return self._rest

    @property
    def edges(self) -> npt.NDArray[np.int64]:
        """numpy.ndarray of int64, shape (m, 2) : the edges as given."""
        return self._edges

    @property
    def faces(self) -> npt.NDArray[np.int64]:
        """numpy.ndarray of int64, shape (n, 3) : the faces as given."""
        return self._faces

    @property
    def num_vertices(self) -> int:
        """int : how many vertices there are."""
        return len(self._rest)

    @property
    def num_edges(self) -> int:
        """int : how many edges were given."""
        return len(self._edges)

    @property
    def num_faces(self) -> int:
        """int : how many faces there are."""
        return len(self._faces)

    @property
    def codim_edges(self) -> npt.NDArray[np.int64]:
        """numpy.ndarray of int64, shape (k, 2) : the edges of no face."""
        return self._loose

    @property
    def codim_vertices(self) -> npt.NDArray[np.int64]:
        """numpy.ndarray of int64, shape (k,) : the vertices of no face and no edge."""
        return self._points

    def _scene(self, vertices: npt.NDArray[Any]) -> Scene:
        """The bodies at these positions. The scene is kept: a steady step adds no bodies."""
        held = self._held
        if len(held) == 0:
            if len(self._faces):
                held.add(vertices, self._faces)
            if len(self._loose):
                held.add_edges(vertices, self._loose)
            if len(self._points):
                held.add_points(vertices[self._points])
        else:
            for body, rows in self._rows():
                held.set_positions(body, vertices if rows is None else vertices[rows])
        return held

    def _move(self, scene: Scene, vertices: npt.NDArray[Any]) -> None:
        for body, rows in self._rows():
            scene.set_end_positions(body, vertices if rows is None else vertices[rows])

    def _rows(self) -> list[tuple[int, npt.NDArray[np.int64] | None]]:
        """Each body with the vertices that it has; `None` for all."""
        rows: list[npt.NDArray[np.int64] | None] = []
        if len(self._faces):
            rows.append(None)
        if len(self._loose):
            rows.append(None)
        if len(self._points):
            rows.append(self._points)
        return list(enumerate(rows))

    def _first(self, scene: Scene, distance: float) -> float | None:
        """The first time at which elements are within a distance that may collide and share no vertex."""
        first = self._detector.earliest(scene, toi="f64", separation=distance)
        if first is None or self._counts(scene, first):
            return None if first is None else first.toi
        impacts = self._detector.impacts(scene, toi="f64", separation=distance)
        return min((hit.toi for hit in impacts if self._counts(scene, hit)), default=None)

    def _is_free(self, scene: Scene, distance: float) -> bool:
        if self._counts_all:
            return self._detector.is_free(scene, separation=distance)
        return self._first(scene, distance) is None

    @property
    def _counts_all(self) -> bool:
        return self.can_collide is None and not self._is_mixed

    def _counts(self, scene: Scene, impact: Impact) -> bool:
        if self._counts_all:
            return True
        a, b = (
            self._corners(scene, int(body), letter, element)
            for letter, body, element in zip(impact.kind, impact.bodies, impact.elements)
        )
        if set(a) & set(b):
            return False
        may = self.can_collide
        return may is None or any(may(x, y) for x in a for y in b)

    def _corners(self, scene: Scene, body: int, letter: str, element: int) -> list[int]:
        """The vertices of the mesh that an element of a body names: a vertex, an edge or a face."""
        if letter == "v":
            rows = self._rows()[body][1]
            return [element if rows is None else int(rows[element])]
        key = (body, letter)
        if key not in self._parts:
            self._parts[key] = scene.elements(body, "edges" if letter == "e" else "faces")
        return [int(vertex) for vertex in self._parts[key][element]]

    def __repr__(self) -> str:
        counts = f"{self.num_vertices} vertices, {self.num_edges} edges, {self.num_faces} faces"
        return f"CollisionMesh({counts})"


#: Meshes of ipc-toolkit that were asked about, each with the mesh that answers for it.
_SERVED: WeakKeyDictionary[Any, CollisionMesh] = WeakKeyDictionary()


@contextmanager
def _served(mesh: Any) -> Iterator[CollisionMesh]:
    """The mesh, or for one of ipc-toolkit the mesh that answers for it."""
    if isinstance(mesh, CollisionMesh):
        yield mesh
        return
    needed = ("rest_positions", "edges", "faces", "can_collide")
    if not all(hasattr(mesh, name) for name in needed):
        raise TypeError(f"mesh: a CollisionMesh expected, {type(mesh).__name__} given")
    ours = _SERVED.get(mesh)
    if ours is None:
        # A copy: arrays that view its positions keep the mesh alive, and so does its filter, below.
        rest = np.array(mesh.rest_positions)
        ours = _SERVED[mesh] = CollisionMesh(rest, mesh.edges, mesh.faces)
    ours.can_collide = mesh.can_collide
    try:
        yield ours
    finally:
        ours.can_collide = None


def is_step_collision_free(
    mesh: _Mesh,
    vertices_t0: _Array,
    vertices_t1: _Array,
    min_distance: float = 0.0,
    broad_phase: object = None,
    narrow_phase_ccd: object = None,
) -> bool:
    """Whether nothing touches while all vertices move on straight lines from one pose to another.

    Parameters
    ----------
    mesh : CollisionMesh
        Of this module, or of ipctk. One of ipctk is looked at once: its edges and faces must not change.
    vertices_t0, vertices_t1 : array_like, shape (v, 3)
        Positions at the start and at the end. Two arrays of float32 are answered as such, others as float64.
    min_distance : float
        The distance that elements must keep, 0 or more: Euclidean, and decided exactly. ipc-toolkit compares it axis by
        axis, so its steps are shorter.
    broad_phase, narrow_phase_ccd : object
        Taken so that calls of ipc-toolkit work, and not used: there is one method, and it is exact.

    Returns
    -------
    bool
        Exact. Touching counts (a distance of exactly `min_distance`), at the start too.

    Raises
    ------
    ValueError, TypeError
        Positions of another shape than the mesh has, or that are not finite; a `min_distance` below 0.
    """
    with _served(mesh) as ours:
        start, end, distance = _step(ours, vertices_t0, vertices_t1, min_distance)
        scene = ours._scene(start)
        ours._move(scene, end)
        return ours._is_free(scene, distance)


def compute_collision_free_stepsize(
    mesh: _Mesh,
    vertices_t0: _Array,
    vertices_t1: _Array,
    min_distance: float = 0.0,
    broad_phase: object = None,
    narrow_phase_ccd: object = None,
) -> float:
    """How far all vertices can move on straight lines from one pose towards another.

    Parameters
    ----------
    mesh, vertices_t0, vertices_t1, min_distance, broad_phase, narrow_phase_ccd
        As for `is_step_collision_free`.

    Returns
    -------
    float
        The largest step in [0, 1], backed off as little as rounding asks for, such that the straight way from
        `vertices_t0` to ``vertices_t0 + step * (vertices_t1 - vertices_t0)``, rounded as NumPy rounds it, is free of
        contact. 1 if the whole step is, 0 if elements touch at the start. With a `min_distance`, elements touch where
        they are as near as that.

    Raises
    ------
    ValueError, TypeError
        As `is_step_collision_free`.
    """
    with _served(mesh) as ours:
        start, end, distance = _step(ours, vertices_t0, vertices_t1, min_distance)
        scene = ours._scene(start)
        ours._move(scene, end)
        first = ours._first(scene, distance)
        if first is None:
            return 1.0
        back_off = 0.0
        while True:
            step = first * (1.0 - back_off)
            reached = start + step * (end - start)
            if step == 0.0 or np.array_equal(reached, start):
                return 0.0
            ours._move(scene, reached)
            if ours._is_free(scene, distance):
                return step
            back_off = min(2.0 * back_off, 1.0) if back_off else float(np.finfo(start.dtype).eps)


def _step(
    mesh: CollisionMesh, vertices_t0: _Array, vertices_t1: _Array, min_distance: float
) -> tuple[npt.NDArray[Any], npt.NDArray[Any], float]:
    distance = float(min_distance)
    if not (math.isfinite(distance) and distance >= 0):
        raise ValueError(f"min_distance: {distance} given, a finite number of 0 or more allowed")
    start = _positions(mesh, vertices_t0, "vertices_t0")
    end = _positions(mesh, vertices_t1, "vertices_t1")
    if start.dtype != end.dtype:
        start, end = start.astype(np.float64), end.astype(np.float64)
    return start, end, distance


def _positions(mesh: CollisionMesh, vertices: _Array, name: str) -> npt.NDArray[Any]:
    positions = np.asarray(vertices)
    if positions.dtype != np.float32:
        positions = positions.astype(np.float64)
    if positions.shape != (mesh.num_vertices, 3):
        expected = f"shape ({mesh.num_vertices}, 3) expected, as the mesh has"
        raise ValueError(f"{name}: {expected}, {positions.shape} given")
    bad = np.argwhere(~np.isfinite(positions))
    if len(bad):
        row, column = (int(ix) for ix in bad[0])
        raise ValueError(
            f"{name}[{row}, {column}] = {positions[row, column]}: a position must be finite"
        )
    return np.ascontiguousarray(positions)


def _indices(rows: _Array, name: str, n_columns: int) -> npt.NDArray[np.int64]:
    array = np.asarray(rows)
    if array.size == 0:
        return np.empty((0, n_columns), np.int64)
    if array.dtype.kind not in "iu":
        raise TypeError(f"{name}: an array of integers expected, dtype {array.dtype} given")
    if array.ndim != 2 or array.shape[1] != n_columns:
        raise ValueError(f"{name}: shape (n, {n_columns}) expected, {array.shape} given")
    return array.astype(np.int64)
