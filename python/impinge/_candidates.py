"""Pairs of elements by the numbers of ipc-toolkit: what `impinge.ipc` finds for it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal, Optional

import numpy as np
import numpy.typing as npt

from . import _impinge
from ._errors import InvalidError

if TYPE_CHECKING:
    from typing_extensions import TypeAlias

    from .ipc import CollisionMesh

    _Ids: TypeAlias = npt.NDArray[np.int32]
    _May: TypeAlias = Optional[Callable[[int, int], bool]]
    _Mode: TypeAlias = Literal["exact", "boxes"]

#: Tight Inclusion keeps up to this beyond the distance that is asked for, give or take its tolerance. It compares axis by axis, so it stops
#: for pairs that are farther apart by the square root of 3.
_KEPT_IN_STEPS, _BY_AXES = 1.1e-4, 3**0.5
#: By how much more than twice the radius pairs are looked for. Whoever tests them rounds.
_SLACK = 1 + 1e-9

#: The kinds of pairs: the class of ipctk's candidates, and whether the second element comes first there.
KINDS = {
    "vv": ("VertexVertexCandidate", False),
    "ev": ("EdgeVertexCandidate", False),
    "ee": ("EdgeEdgeCandidate", False),
    "vf": ("FaceVertexCandidate", True),
    "ef": ("EdgeFaceCandidate", False),
    "ff": ("FaceFaceCandidate", False),
}
#: How many vertices an element has.
_SIZES = {"v": 1, "e": 2, "f": 3}


class Candidates:
    """Pairs of elements that may come near each other, by the numbers of a mesh of ipc-toolkit.

    ``len(candidates)`` is the number of all pairs.
    """

    def __init__(self, found: dict[str, _Ids]) -> None:
        self._found = found
        for rows in found.values():
            rows.flags.writeable = False

    @property
    def vv_candidates(self) -> _Ids:
        """numpy.ndarray of int32, shape (n, 2) : vertex and vertex, of those that no edge and no face has."""
        return self._found["vv"]

    @property
    def ev_candidates(self) -> _Ids:
        """numpy.ndarray of int32, shape (n, 2) : edge and vertex: an edge of no face, and a vertex that no edge and no face has."""
        return self._found["ev"]

    @property
    def ee_candidates(self) -> _Ids:
        """numpy.ndarray of int32, shape (n, 2) : edge and edge, the lower row of the mesh's `edges` first."""
        return self._found["ee"]

    @property
    def fv_candidates(self) -> _Ids:
        """numpy.ndarray of int32, shape (n, 2) : face and vertex."""
        return self._found["vf"]

    def to_ipctk(self) -> Any:
        """The same pairs as an ``ipctk.Candidates``, for ``NormalCollisions.build`` and its own functions.

        ipctk takes an object per pair: about 0.4 s for a million. `BroadPhase` hands them over in the same way.

        Returns
        -------
        ipctk.Candidates

        Raises
        ------
        ModuleNotFoundError
            ipctk is not installed.
        """
        import ipctk  # type: ignore[import-not-found, import-untyped, unused-ignore]

        made = ipctk.Candidates()
        # Assignment copies each object. Fields that stay empty need none.
        for kind, field in [("vv", "vv"), ("ev", "ev"), ("ee", "ee"), ("vf", "fv")]:
            if len(self._found[kind]):
                setattr(made, f"{field}_candidates", objects(ipctk, kind, self._found[kind]))
        return made

    def __len__(self) -> int:
        return sum(map(len, self._found.values()))

    def __repr__(self) -> str:
        names = {"vf": "fv"}
        counts = (f"{names.get(kind, kind)}: {len(rows)}" for kind, rows in self._found.items())
        return f"Candidates({', '.join(counts)})"


def objects(ipctk: Any, kind: str, rows: _Ids) -> list[Any]:
    """Pairs as ipctk's objects."""
    # `map` over lists calls the class from C. Tuples, which ipctk converts by itself, take twice as long.
    return list(map(getattr(ipctk, KINDS[kind][0]), rows[:, 0].tolist(), rows[:, 1].tolist()))


class Question:
    """Which pairs there are of a mesh at some positions, or in a step from the first to the second of `ends`.

    Answers are kept until the next question: of faces against vertices and of edges against edges there is one search.
    """

    def __init__(
        self, mesh: CollisionMesh, ends: Sequence[npt.NDArray[Any]], radius: object, mode: _Mode
    ) -> None:
        self._radius = radius = _impinge._length(radius, "inflation_radius")
        if not (math.isfinite(radius) and radius >= 0):
            raise InvalidError(
                f"inflation_radius: {radius} given, a finite number of 0 or more allowed"
            )
        self._mesh = mesh
        self._held = held = mesh._held()
        self._ends = ends
        self._mode = mode
        self._moves = len(ends) == 2
        held.place(*ends)
        self._known: dict[tuple[str, ...], Any] = {}
        # In the order of the parts of a mesh.
        bodies = iter(held.scene.bodies)
        self._faces = next(bodies) if len(mesh._faces) else None
        self._loose = next(bodies) if len(mesh._loose) else None
        self._points = next(bodies) if len(mesh._points) else None

    @property
    def n_vertices(self) -> int:
        """How many vertices the mesh has."""
        return self._mesh.num_vertices

    def find(self, kind: str, bodies: tuple[Any, Any] | None = None) -> _Ids:
        """All pairs of a kind that share no vertex, by the mesh's numbers, as ipctk orders them.

        `bodies`: only pairs of these two, or of one if they are the same.
        """
        first, second = self._numbers_of_pairs(kind, bodies)
        keep = (first >= 0) & (second >= 0)
        if not keep.all():
            first, second = first[keep], second[keep]
        if len(self._mesh._parts) > 1:
            # Within a body the detector sees to neighbours.
            corners_a, corners_b = self._corners(kind[0], first), self._corners(kind[1], second)
            apart = ~(corners_a[:, :, None] == corners_b[:, None, :]).any(axis=(1, 2))
            first, second = first[apart], second[apart]
        is_collected = self._is_collected(kind, bodies)
        if is_collected:
            meet = self._boxes_meet(kind, first, second)
            first, second = first[meet], second[meet]
        if KINDS[kind][1]:
            first, second = second, first
        elif kind[0] == kind[1]:
            first, second = np.minimum(first, second), np.maximum(first, second)
        is_repeated = self._faces is not None and self._loose is not None
        if is_repeated or is_collected:
            # Vertices that a face and a loose edge have are vertices of two bodies; and threads collect in any order.
            keys = np.unique(first << 32 | second)
            first, second = keys >> 32, keys & 0xFFFFFFFF
        rows = np.empty((len(first), 2), np.int32)
        rows[:, 0], rows[:, 1] = first, second
        return rows

    def _is_by_boxes(self, kind: str, bodies: tuple[Any, Any] | None) -> bool:
        of_step = kind in ("vf", "ee") or (kind in ("vv", "ev") and self._faces is None)
        # Edges and faces, and faces and faces, are near where others are: their boxes are all that is asked for.
        return self._mode == "boxes" or not (of_step or bodies is not None)

    def _is_collected(self, kind: str, bodies: tuple[Any, Any] | None) -> bool:
        return self._moves and not self._is_by_boxes(kind, bodies)

    def _numbers_of_pairs(
        self, kind: str, bodies: tuple[Any, Any] | None
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        if self._is_collected(kind, bodies):
            return self._numbers_in_step(kind, bodies)
        held, radius = self._held, self._radius

        def ask(options: dict[str, Any]) -> Any:
            if self._is_by_boxes(kind, bodies):
                return held.detector.candidates(held.scene, radius, **options)
            return held.near(2 * radius * _SLACK, **options)

        found = self._once(kind, bodies, ask)
        body_a, a, body_b, b = found.of(kind).rows.T
        return self._numbers(kind[0], body_a, a), self._numbers(kind[1], body_b, b)

    def _numbers_in_step(
        self, kind: str, bodies: tuple[Any, Any] | None
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """The pairs that come near during the step, or which might as far as floats can tell."""

        def collect(options: dict[str, Any]) -> Any:
            # The times of contacts, which are exact, cost far more than to know which pairs have one. The filter
            # is asked before they are sought.
            collector = self._mesh._collector()
            reach = _BY_AXES * (2 * self._radius + _KEPT_IN_STEPS)
            detector, scene = self._held.detector, self._held.scene
            detector._impacts(scene, {**options, "separation": reach, "_filter": collector})
            return {
                kind: collector.collected(*(_SIZES[part] for part in kind)).astype(np.int64)
                for kind in options["kinds"]
            }

        corners = self._once(kind, bodies, collect)[kind]
        n_a = _SIZES[kind[0]]
        a, b = corners[:, :n_a], corners[:, n_a:]
        if kind == "vf":
            which, faces = self._mesh._face_numbers(b)
            return a[which, 0], faces
        if kind[0] == "e":
            edges = self._mesh._edge_numbers(a)
            return edges, b[:, 0] if kind[1] == "v" else self._mesh._edge_numbers(b)
        return a[:, 0], b[:, 0]

    def _boxes_meet(
        self, kind: str, first: npt.NDArray[np.int64], second: npt.NDArray[np.int64]
    ) -> npt.NDArray[np.bool_]:
        """Whether the boxes over the step overlap: ipctk looks at no other pairs, whatever a step keeps."""
        low, high = np.minimum(*self._ends), np.maximum(*self._ends)
        # Boxes of its own default are in single precision.
        slack = 2.0**-21 * max(np.abs(low).max(), np.abs(high).max())
        corners = [self._corners(part, of) for part, of in zip(kind, (first, second))]
        (low_a, low_b), (high_a, high_b) = (
            [getattr(at[of], side)(axis=1) for of in corners]
            for at, side in [(low, "min"), (high, "max")]
        )
        gap = np.maximum(low_a - high_b, low_b - high_a).max(axis=1, initial=-np.inf)
        meet: npt.NDArray[np.bool_] = gap <= 2 * self._radius + slack
        return meet

    def _once(
        self, kind: str, bodies: tuple[Any, Any] | None, ask: Callable[[dict[str, Any]], Any]
    ) -> Any:
        """The answer about a kind of pairs, with those that are found in the same search."""
        together = ("vf", "ee") if kind in ("vf", "ee") else (kind,)
        if together not in self._known:
            options: dict[str, Any] = {"kinds": together}
            if bodies is not None:
                is_self = bodies[0] == bodies[1]
                options["self_of" if is_self else "between"] = bodies[0] if is_self else bodies
            self._known[together] = ask(options)
        return self._known[together]

    def _numbers(
        self, part: str, bodies: npt.NDArray[np.uint32], elements: npt.NDArray[np.uint32]
    ) -> npt.NDArray[np.int64]:
        """The numbers of vertices, edges or faces in the mesh; -1 for edges that it lacks."""
        numbers = elements.astype(np.int64)
        if part == "f":
            return numbers
        parts = self._mesh._parts
        if part == "e" and len(parts) == 1:
            return self._mesh._edges_of_body(0)[elements]
        for body, (_, _, rows) in enumerate(parts):
            of_body = bodies == body
            if part == "e" and of_body.any():
                numbers[of_body] = self._mesh._edges_of_body(body)[elements[of_body]]
            elif part == "v" and rows is not None:
                numbers[of_body] = rows[elements[of_body]]
        return numbers

    def _corners(self, part: str, numbers: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """The vertices of elements, shape (n, 1), (n, 2) or (n, 3)."""
        if part == "v":
            return numbers[:, None]
        return (self._mesh._edges if part == "e" else self._mesh._faces)[numbers]

    def passing(
        self, kind: str, rows: _Ids, labels: npt.NDArray[np.int64] | None, may: _May
    ) -> _Ids:
        """The pairs of which any vertices may collide."""
        if len(rows) == 0 or (labels is None and may is None):
            return rows
        parts = kind[::-1] if KINDS[kind][1] else kind
        a, b = (self._corners(part, rows[:, ix].astype(np.int64)) for ix, part in enumerate(parts))
        if labels is not None:
            of_all = labels[np.concatenate([a, b], axis=1)]
            keep: npt.NDArray[np.bool_] = (of_all != of_all[:, :1]).any(axis=1)
            if may is None:
                return rows[keep]
            rows, a, b = _chosen(keep, rows, a, b)
        return rows if may is None else rows[any_may(a, b, may)]

    def all_found(self, labels: npt.NDArray[np.int64] | None, may: _May) -> dict[str, _Ids]:
        """The pairs that ipctk tests in three dimensions."""
        none = np.empty((0, 2), np.int32)
        found = {
            "vv": self.find("vv", (self._points, self._points)) if self._points is not None else none,
            "ev": none,
            "ee": self.find("ee"),
            "vf": self.find("vf"),
        }
        if self._loose is not None and self._points is not None:
            found["ev"] = self.find("ev", (self._loose, self._points))
        return {kind: self.passing(kind, rows, labels, may) for kind, rows in found.items()}


def _chosen(keep: npt.NDArray[np.bool_], *arrays: npt.NDArray[Any]) -> Any:
    return tuple(array[keep] for array in arrays)


def any_may(
    a: npt.NDArray[np.int64], b: npt.NDArray[np.int64], may: Callable[[int, int], bool]
) -> npt.NDArray[np.bool_]:
    """For each row, whether any vertex of `a` may collide with any of `b`."""
    passes = np.zeros(len(a), bool)
    left = np.arange(len(a))
    for i in range(a.shape[1]):
        for j in range(b.shape[1]):
            x, y = a[left, i], b[left, j]
            # Once per two vertices of a column, and only for pairs of elements that have not passed yet.
            keys, places = np.unique(np.minimum(x, y) << 32 | np.maximum(x, y), return_inverse=True)
            low, high = (keys >> 32).tolist(), (keys & 0xFFFFFFFF).tolist()
            said = np.fromiter(map(may, low, high), bool, len(keys))[places.reshape(-1)]
            passes[left[said]] = True
            left = left[~said]
            if len(left) == 0:
                return passes
    return passes
