"""The step questions of ipc-toolkit, exactly: beside ``ipctk``, for solvers that use its barrier.

>>> import numpy as np
>>> from impinge import ipc
>>> rest = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 1], [4, 0, 1], [0, 4, 1]], float)
>>> faces = np.array([[0, 1, 2], [3, 4, 5]])
>>> mesh = ipc.CollisionMesh(rest, ipc.edges(faces), faces)  # or an ipctk.CollisionMesh
>>> moved = rest.copy()
>>> moved[3:, 2] = -3                                        # one triangle falls through the other
>>> ipc.is_step_collision_free(mesh, rest, moved)
False
>>> step = ipc.compute_collision_free_stepsize(mesh, rest, moved)
>>> 0.24997 < step < 0.25                                    # it stops 1e-4 above the other
True
>>> ipc.has_intersections(mesh, rest + step * (moved - rest))
False

The names and the order of the arguments are those of ipctk 1.6. A solver keeps its
``ipctk.CollisionMesh`` for its collisions and potentials, and asks these functions
about the same mesh. The mesh of this module is for programs without ipctk: ipctk's functions do not
take it.

``BroadPhase`` goes wherever ipctk takes a ``broad_phase``, so that a solver changes nothing else:
``collisions.build(mesh, x, dhat, broad_phase=ipc.BroadPhase())``. It needs ipctk, the rest of this
module does not.

Like ipc-toolkit's, the step size leaves every pair a share of its distance: with
``conservative_rescaling`` of 0.8, a fifth, but at most 1e-4. It is decided exactly, so no tolerance
and no number of iterations makes it shorter. What it promises is said in
`compute_collision_free_stepsize`.

Threads may share a mesh, and a forked process may go on with the mesh of its parent.
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal, Optional
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from . import _impinge
from ._candidates import Candidates, Question, any_may
from ._detector import Detector
from ._errors import InvalidError, Seam
from ._filters import labels_of
from ._scene import Scene

if TYPE_CHECKING:
    from ._broad_phase import BroadPhase

# `BroadPhase` is public, too, but needs ipctk, which an import of all names must not.
__all__ = [
    "Candidates",
    "CollisionMesh",
    "candidates",
    "compute_collision_free_stepsize",
    "edges",
    "has_intersections",
    "is_step_collision_free",
]


def __getattr__(name: str) -> Any:
    # A subclass of one of ipctk, which the rest of this module does without.
    if name == "BroadPhase":
        from ._broad_phase import BroadPhase

        return BroadPhase
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


#: The largest distance that a step leaves, as in ipc-toolkit.
_CLEARANCE = 1e-4
#: `conservative_rescaling` of ipctk's `TightInclusionCCD`.
_RESCALING = 0.8

_Array = Any
_Mesh = Any  # A CollisionMesh of this module or of ipctk.
#: A body of a mesh: what adds it to a scene, its elements, and its vertices in the mesh; `None` for
#: all.
_Part = tuple[Callable[..., object], npt.NDArray[np.int64], Optional[npt.NDArray[np.uint32]]]


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

    Vertices that neither a face nor an edge names are loose points: they meet faces, loose edges
    and each other.

    Raises
    ------
    ValueError, TypeError
        Positions that are not ``(v, 3)`` (meshes in two dimensions are not served), an index out of
        range.
    """

    can_collide: Callable[[int, int], bool] | None
    """callable or None : whether two vertices may collide, as in ipc-toolkit. Two elements that
    touch count when any vertex of one may collide with any of the other. It is called with the
    lower vertex first, and what it says is kept for the question. ``None`` (the default) lets all
    of them."""

    def __init__(self, rest_positions: _Array, edges: _Array = (), faces: _Array = ()) -> None:
        rest = np.asarray(rest_positions)
        if rest.ndim != 2 or rest.shape[1] != 3:
            flat = rest.ndim == 2 and rest.shape[1] == 2
            hint = "; two dimensions are not served" if flat else ""
            raise InvalidError(f"rest_positions: shape (n, 3) expected, {rest.shape} given{hint}")
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
                raise InvalidError(f"{place} = {value}: there are {n_vertices} vertices")
        self.can_collide = None
        self._local = threading.local()
        self._edge_table: tuple[npt.NDArray[np.int64], ...] | None = None
        self._edges_are_checked = False
        self._body_edges: dict[int, npt.NDArray[np.int64]] = {}
        self._face_table: tuple[npt.NDArray[np.int64], ...] | None = None
        given = np.unique(_edge_keys(self._edges))
        given = given[~np.isin(given, _edge_keys(_edges_of(self._faces)))]
        self._loose = np.stack([given >> 32, given & 0xFFFFFFFF], axis=1)
        named = np.zeros(len(self._rest), bool)
        named[self._faces.ravel()] = True
        named[self._loose.ravel()] = True
        self._points = np.flatnonzero(~named)
        parts: list[_Part] = [
            (Scene.add, self._faces, None),
            (Scene.add_edges, self._loose, None),
            (_add_points, self._points, self._points.astype(np.uint32)),
        ]
        self._parts = [part for part in parts if len(part[1])]
        # One body of all of them: edges and points are degenerate triangles.
        loose, points = self._loose[:, [0, 1, 1]], np.stack([self._points] * 3, axis=1)
        self._as_faces = np.concatenate([self._faces, loose, points])
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

    def _held(self) -> _Held:
        """What this thread of this process asks with."""
        held: _Held | None = getattr(self._local, "held", None)
        if held is not None and held.process != os.getpid():
            # Its threads did not survive the fork, and its end would wait for them.
            _OF_PARENTS.append(held)
            held = None
        if held is None:
            held = self._local.held = _Held(self)
        return held

    def _edge_numbers(self, corners: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
        """The rows of `edges` that have these two vertices each; -1 where none has."""
        if self._edge_table is None:
            keys = _edge_keys(self._edges)
            order = np.argsort(keys, kind="stable")
            keys = keys[order]
            twice = np.flatnonzero(keys[1:] == keys[:-1])
            if len(twice):
                first, second = (int(row) for row in order[twice[0] : twice[0] + 2])
                pair = tuple(np.sort(self._edges[first]).tolist())
                raise InvalidError(f"edges[{first}] and edges[{second}]: both are the edge {pair}")
            # No key is beyond the last one, so that every search ends at a row.
            keys = np.append(keys, np.iinfo(np.int64).max)
            self._edge_table = keys, np.append(order, -1)
        keys, rows = self._edge_table
        wanted = _edge_keys(corners)
        at = np.searchsorted(keys, wanted)
        return np.where(keys[at] == wanted, rows[at], -1)

    def _check_edges(self) -> None:
        """Refuses a face whose edges are not among `edges`."""
        if self._edges_are_checked:
            return
        sides = _edges_of(self._faces)
        absent = self._edge_numbers(sides) < 0
        if absent.any():
            edge = tuple(sides[np.argmax(absent)].tolist())
            raise InvalidError(f"edges: a face has the edge {edge}, which is not among them")
        self._edges_are_checked = True

    def _edges_of_body(self, body: int) -> npt.NDArray[np.int64]:
        """The rows of `edges` that the edges of a body are; -1 for those that it lacks."""
        if body not in self._body_edges:
            corners = self._held().scene.edges(body).astype(np.int64)
            self._body_edges[body] = self._edge_numbers(corners)
        return self._body_edges[body]

    def _face_numbers(
        self, corners: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """All rows of `faces` that have these three vertices each: which of `corners`, and the row."""
        if self._face_table is None:
            low, middle, high = np.sort(self._faces, axis=1).T
            sides = np.unique(low << 32 | middle)
            keys = np.searchsorted(sides, low << 32 | middle) << 32 | high
            order = np.argsort(keys, kind="stable")
            self._face_table = sides, keys[order], order
        sides, keys, rows = self._face_table
        low, middle, high = np.sort(corners, axis=1).T
        wanted = np.searchsorted(sides, low << 32 | middle) << 32 | high
        first = np.searchsorted(keys, wanted)
        n_rows = np.searchsorted(keys, wanted, side="right") - first
        which = np.repeat(np.arange(len(wanted)), n_rows)
        # Of several, one after the other.
        before = np.cumsum(n_rows) - n_rows
        return which, rows[(first - before)[which] + np.arange(len(which))]

    def _collector(
        self,
        labels: npt.NDArray[np.int64] | None = None,
        may: Callable[[int, int], bool] | None = None,
    ) -> Any:
        """A filter that remembers pairs."""
        return _impinge._VertexFilter([rows for _, _, rows in self._parts], labels, may, True)

    def _filter(self, labels: npt.NDArray[np.int64] | None, may: Callable[[int, int], bool] | None) -> Any:
        """Which pairs of elements collide; `None` if all do that share no vertex of a body."""
        if labels is None and may is None and not self._is_mixed:
            return None
        rows = [rows for _, _, rows in self._parts]
        return _impinge._VertexFilter(rows, labels, may)

    def _labels(self, labels: _Array) -> npt.NDArray[np.int64]:
        """Labels of vertices, which are checked."""
        given = np.asarray(labels)
        if given.dtype.kind not in "iu" or given.shape != (self.num_vertices,):
            shape = f"({self.num_vertices},)"
            what = f"integers of shape {shape} expected, as the mesh has vertices"
            raise InvalidError(f"labels: {what}, {given.dtype} of shape {given.shape} given")
        return np.ascontiguousarray(given, np.int64)

    def __repr__(self) -> str:
        counts = f"{self.num_vertices} vertices, {self.num_edges} edges, {self.num_faces} faces"
        return f"CollisionMesh({counts})"


class _Held:
    """A detector and a scene, which are kept: a steady step adds no bodies."""

    def __init__(self, mesh: CollisionMesh) -> None:
        self.process = os.getpid()
        self.detector = Detector("cpu")
        self.scene = Scene()
        self._parts = mesh._parts
        self._as_faces = mesh._as_faces
        self._has_faces_only = len(mesh._as_faces) == len(mesh._faces)
        self._whole = Scene()
        self._margin = 0.0

    def near(self, distance: float, **options: Any) -> Any:
        """The pairs within a distance. A solver asks again and again while little moves."""
        # A margin fits other distances of about the same size. Another one takes a new detector.
        fits = distance / 16 <= self._margin <= distance / 2
        if 0 < distance < math.inf and not fits:
            self.detector = Detector("cpu", reuse_margin=distance / 4)
            self._margin = distance / 4
        return self.detector.near(self.scene, distance, **options)

    def place(self, vertices: npt.NDArray[Any], end: npt.NDArray[Any] | None = None) -> Scene:
        """The bodies at these positions, and where they move to."""
        scene = self.scene
        # All are added before an end is set, which may be refused: a later call finds them there.
        if len(scene) == 0:
            for add, elements, rows in self._parts:
                add(scene, vertices if rows is None else vertices[rows], elements)
        else:
            for body, (_, _, rows) in enumerate(self._parts):
                scene.set_positions(body, vertices if rows is None else vertices[rows])
        if end is not None:
            for body, (_, _, rows) in enumerate(self._parts):
                scene.set_end_positions(body, end if rows is None else end[rows])
        return scene

    def intersect(
        self,
        vertices: npt.NDArray[Any],
        label_of: npt.NDArray[np.int64] | None,
        may: Callable[[int, int], bool] | None,
    ) -> bool:
        """Whether any elements intersect that may collide, in more than the vertices that they share. They are placed there."""
        scene = self.scene
        if not self._has_faces_only:
            scene = self._whole
            if len(scene) == 0:
                scene.add(vertices, self._as_faces)
            else:
                scene.set_positions(0, vertices)
        if label_of is None and may is None:
            return self.detector.any(scene)
        rows = self.detector.detect(scene).rows
        a, b = self._as_faces[rows[:, 1]], self._as_faces[rows[:, 3]]
        if label_of is not None:
            labels = label_of[np.concatenate([a, b], axis=1)]
            keep = (labels != labels[:, :1]).any(axis=1)
            a, b = a[keep], b[keep]
        return len(a) > 0 and (may is None or bool(any_may(a, b, may).any()))


def candidates(
    mesh: _Mesh,
    vertices: _Array,
    vertices_t1: _Array | None = None,
    inflation_radius: float = 0.0,
    *,
    mode: Literal["exact", "boxes"] = "exact",
    labels: _Array | None = None,
) -> Candidates:
    """Pairs of elements that may touch, as ``ipctk.Candidates.build`` finds them, mostly fewer: as arrays, and for ipctk.

    Parameters
    ----------
    mesh, labels
        As for `is_step_collision_free`.
    vertices : array_like, shape (v, 3)
        Positions, or those at the start of a step.
    vertices_t1 : array_like, shape (v, 3), optional
        Positions at the end of a step.
    inflation_radius : float
        By how much boxes are inflated, 0 or more. For a barrier half the distance at which it begins.
    mode : {"exact", "boxes"}
        As for `BroadPhase`: ``"exact"``, only pairs that come within twice the radius, and in a step those that ipctk's continuous
        detection may stop for; or all pairs whose inflated boxes overlap.

    Returns
    -------
    Candidates
        ``to_ipctk()`` makes an ``ipctk.Candidates`` of it.

    Raises
    ------
    ValueError, TypeError
        As `is_step_collision_free`; an edge of a face that the mesh's `edges` lack, or one that they have twice.
    """
    ours = _served(mesh)
    if mode not in ("exact", "boxes"):
        raise InvalidError(f"mode: {mode!r} given, 'exact' or 'boxes' allowed")
    ends: tuple[npt.NDArray[Any], ...]
    if vertices_t1 is None:
        ends = (_positions(ours, vertices, "vertices"),)
    else:
        ends = _ends(ours, vertices, vertices_t1, "vertices")
    ours._check_edges()
    question = Question(ours, ends, inflation_radius, mode)
    return Candidates(question.all_found(*_allowed(ours, mesh, labels)))


def _edge_keys(rows: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Each edge as one number, whatever its direction."""
    low, high = np.sort(rows.astype(np.int64), axis=1).T
    keys: npt.NDArray[np.int64] = low << 32 | high
    return keys


def _add_points(scene: Scene, vertices: npt.NDArray[Any], _: object) -> None:
    scene.add_points(vertices)


#: Detectors of the processes that this one was forked from.
_OF_PARENTS: list[_Held] = []

#: Meshes of ipc-toolkit that were asked about, each with the mesh that answers for it.
_SERVED: WeakKeyDictionary[Any, CollisionMesh] = WeakKeyDictionary()


def _served(mesh: Any) -> CollisionMesh:
    """The mesh, or for one of ipc-toolkit the mesh that answers for it."""
    if isinstance(mesh, CollisionMesh):
        return mesh
    needed = ("rest_positions", "edges", "faces", "can_collide")
    if not all(hasattr(mesh, name) for name in needed):
        raise TypeError(f"mesh: a CollisionMesh expected, {type(mesh).__name__} given")
    if len(getattr(mesh, "planes", ())):
        raise InvalidError("mesh: planes are not served; give the mesh faces in their place")
    ours = _SERVED.get(mesh)
    if ours is None:
        # A copy: arrays that view its positions keep the mesh alive.
        rest = np.array(mesh.rest_positions)
        ours = _SERVED.setdefault(mesh, CollisionMesh(rest, mesh.edges, mesh.faces))
    return ours


def is_step_collision_free(
    mesh: _Mesh,
    vertices_t0: _Array,
    vertices_t1: _Array,
    min_distance: float = 0.0,
    broad_phase: object = None,
    narrow_phase_ccd: object = None,
    *,
    labels: _Array | None = None,
) -> bool:
    """Whether nothing intersects at the start, and nothing touches on straight lines to the end.

    ipc-toolkit takes it that the start is free: of an edge that already pierces a face, which
    touches neither a vertex nor an edge, it says ``True``, and this function ``False``. Of starts
    that are free both speak of the same.

    Parameters
    ----------
    mesh : CollisionMesh
        Of ipctk, or of this module. One of ipctk is looked at once: its edges and faces must not
        change.
    vertices_t0, vertices_t1 : array_like, shape (v, 3)
        Positions at the start and at the end. Two arrays of float32 are answered as such, others as
        float64.
    min_distance : float
        The distance that elements must keep, 0 or more: Euclidean, and decided exactly. ipc-toolkit
        compares it axis by axis, so its steps are mostly shorter, and where hardly more than
        `min_distance` is left they may end below it.
    broad_phase, narrow_phase_ccd : object
        Taken so that calls of ipc-toolkit work. There is one method, and it is exact, so neither
        changes this answer.
    labels : array_like of int, shape (v,), optional
        One label per vertex: elements whose vertices all have the same do not collide. With it the
        mesh's `can_collide` is not asked. Patches are labels as they are; static obstacles
        ``numpy.minimum(numpy.arange(v), n_dynamic)``; connected components what
        ``scipy.sparse.csgraph.connected_components`` gives.

    Returns
    -------
    bool
        Exact. Touching counts (a distance of exactly `min_distance`), at the start too, and so does
        all that `has_intersections` finds there.

    Raises
    ------
    ValueError, TypeError
        Positions of another shape than the mesh has, or that are not finite; a `min_distance` below
        0; a mesh with planes.
    """
    ours = _served(mesh)
    start, end, distance = _step(ours, vertices_t0, vertices_t1, min_distance)
    held = ours._held()
    allowed = _allowed(ours, mesh, labels)
    scene = held.place(start, end)
    if held.intersect(start, *allowed):
        return False
    return held.detector._is_free(
        scene, {"separation": distance, "_filter": ours._filter(*allowed)}
    )


def compute_collision_free_stepsize(
    mesh: _Mesh,
    vertices_t0: _Array,
    vertices_t1: _Array,
    min_distance: float = 0.0,
    broad_phase: object = None,
    narrow_phase_ccd: object = None,
    *,
    labels: _Array | None = None,
) -> float:
    """How far all vertices can move on straight lines from one pose towards another.

    As in ipc-toolkit, the start must be free of intersections, and is not asked: an edge that
    pierces a face touches neither a vertex nor an edge. Ask `has_intersections` once.

    Parameters
    ----------
    mesh, vertices_t0, vertices_t1, min_distance, broad_phase, labels
        As for `is_step_collision_free`.
    narrow_phase_ccd : object, optional
        Its `conservative_rescaling` counts, 0.8 without one. Tolerances and numbers of iterations
        mean nothing here.

    Returns
    -------
    float
        The largest step in [0, 1], rounded down to 24 bits, for which every pair (also an edge of no
        face and a vertex of another one, which ipc-toolkit does not ask) keeps
        ``min_distance + min((1 - conservative_rescaling) * (d - min_distance), 1e-4)``, where d is
        its distance at the start. 1 if it keeps that to the end. So a step never ends at contact,
        and the next one is never 0 for that reason.

        This is proven for positions as solvers compute them, in the precision of the arrays and
        rounding included: by ``vertices_t0 + a * (vertices_t1 - vertices_t0)`` or by ``vertices_t0
        + a * dx`` with ``vertices_t1 = vertices_t0 + dx``, for *every* ``a`` from 0 to the step, so
        also for all halves that a line search tries. The straight way from `vertices_t0` to these
        positions is free.

        0 if elements touch at the start, or are as near as `min_distance`; and if moving elements
        are apart by less than rounding can move them, 25 unit roundoffs of their largest coordinate
        (3e-15 of it in float64).

    Raises
    ------
    ValueError, TypeError
        As `is_step_collision_free`; a mesh with seams, whose vertices at one position are not
        shared, where they touch at the start (`Seam`): every step would be 0.
    """
    ours = _served(mesh)
    start, end, distance = _step(ours, vertices_t0, vertices_t1, min_distance)
    rescaling = float(getattr(narrow_phase_ccd, "conservative_rescaling", _RESCALING))
    if not 0 < rescaling <= 1:
        raise InvalidError(
            f"conservative_rescaling: {rescaling} given, above 0 and at most 1 allowed"
        )
    held = ours._held()
    scene = held.place(start, end)
    try:
        allowed = _allowed(ours, mesh, labels)
        options = {
            "separation": distance,
            "clearance": _CLEARANCE,
            # With all of its distance to lose, a pair still keeps what rounding moves.
            "clearance_share": max(1 - rescaling, 1e-9),
            "_filter": ours._filter(*allowed),
        }
        advance = held.detector._advance(scene, options)
    except Seam:
        # Parts that have come to touch at a vertex are no seam: there is no step, as for all that
        # touches.
        if len(np.unique(ours._rest, axis=0)) < len(ours._rest):
            collector = ours._collector(*allowed)
            held.detector._impacts(scene, {"separation": distance, "_filter": collector})
            raise _seam(start, collector) from None
        return 0.0
    return advance.fraction


def _seam(start: npt.NDArray[Any], collector: Any) -> Seam:
    """The error that names, by the mesh's numbers, the lowest two vertices at one position of pairs that touch."""
    found = []
    for n_a, n_b in [(1, 3), (2, 2), (2, 1), (1, 1)]:
        corners = collector.collected(n_a, n_b).astype(np.int64)
        a, b = np.broadcast_arrays(corners[:, :n_a, None], corners[:, None, n_a:])
        coincide = (start[a] == start[b]).all(axis=3) & (a != b)
        both = np.stack([a[coincide], b[coincide]], axis=1)
        found += np.sort(both, axis=1).tolist()
    first, second = min(found)
    n_coincident = len(start) - len(np.unique(start, axis=0))
    return Seam(
        f"vertices {first} and {second} are at one position but not shared, so what they belong to touches at the start, "
        f"and no step can be taken: weld the mesh ({n_coincident} of its vertices lie at positions of others)"
    )


def has_intersections(
    mesh: _Mesh, vertices: _Array, broad_phase: object = None, *, labels: _Array | None = None
) -> bool:
    """Whether elements of a mesh intersect: faces with faces, loose edges and points with all.

    Parameters
    ----------
    mesh, broad_phase, labels
        As for `is_step_collision_free`.
    vertices : array_like, shape (v, 3)
        Positions.

    Returns
    -------
    bool
        Exact, and touching counts. Elements that share a vertex count where they meet in more than
        what they share (``shared_vertex="resolve"``): ipc-toolkit does not look at these, and
        misses a face that is folded through its neighbour, or a loose edge along another one.

    Raises
    ------
    ValueError, TypeError
        As `is_step_collision_free`.
    """
    ours = _served(mesh)
    held = ours._held()
    at = _positions(ours, vertices, "vertices")
    held.place(at)
    return held.intersect(at, *_allowed(ours, mesh, labels))


def _allowed(
    ours: CollisionMesh, mesh: _Mesh, labels: _Array | None
) -> tuple[npt.NDArray[np.int64] | None, Callable[[int, int], bool] | None]:
    """Which vertices may collide: by labels, which take the place of what the mesh says, and by a function."""
    if labels is not None:
        return ours._labels(labels), None
    return labels_of(mesh.can_collide, ours.num_vertices)


def _step(
    mesh: CollisionMesh, vertices_t0: _Array, vertices_t1: _Array, min_distance: float
) -> tuple[npt.NDArray[Any], npt.NDArray[Any], float]:
    distance = _impinge._length(min_distance, "min_distance")
    if not (math.isfinite(distance) and distance >= 0):
        raise InvalidError(f"min_distance: {distance} given, a finite number of 0 or more allowed")
    return *_ends(mesh, vertices_t0, vertices_t1, "vertices_t0"), distance


def _ends(
    mesh: CollisionMesh, vertices_t0: _Array, vertices_t1: _Array, name: str
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    start = _positions(mesh, vertices_t0, name)
    end = _positions(mesh, vertices_t1, "vertices_t1")
    if start.dtype != end.dtype:
        start, end = start.astype(np.float64), end.astype(np.float64)
    return start, end


def _positions(mesh: CollisionMesh, vertices: _Array, name: str) -> npt.NDArray[Any]:
    """Positions of the vertices of a mesh, which are checked."""
    positions = np.asarray(vertices)
    if positions.dtype != np.float32:
        positions = positions.astype(np.float64, copy=False)
    if positions.shape != (mesh.num_vertices, 3):
        expected = f"shape ({mesh.num_vertices}, 3) expected, as the mesh has"
        raise InvalidError(f"{name}: {expected}, {positions.shape} given")
    if not np.isfinite(positions).all():
        row, column = (int(ix) for ix in np.argwhere(~np.isfinite(positions))[0])
        raise InvalidError(
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
        raise InvalidError(f"{name}: shape (n, {n_columns}) expected, {array.shape} given")
    return array.astype(np.int64)
