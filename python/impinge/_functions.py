"""The everyday cases in one line, and what needs no scene."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple, SupportsFloat, SupportsIndex, TypedDict

import numpy as np
import numpy.typing as npt

from . import _impinge
from ._answers import Closest, Hits
from ._detector import Detector
from ._errors import InvalidError
from ._scene import Scene

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._query import _Array
    from ._scene import _RowKind

__all__ = [
    "DeviceInfo",
    "cast",
    "closest_points",
    "contains",
    "devices",
    "hash_rows",
    "pairs",
    "project_psd",
    "self_pairs",
    "signed_distance",
    "weld",
]


class Settings(TypedDict, total=False):
    """The settings of a detector."""

    backend: Literal["auto", "cpu", "gpu"]
    method: Literal["auto", "clusters", "cells", "naive"]
    device: str | None
    threads: SupportsIndex | None
    memory_budget: SupportsIndex | None
    max_pairs: SupportsIndex | None
    recluster: Literal["auto", "never"]
    instruction_set: Literal["portable", "avx2", "avx512"] | None
    density: SupportsFloat
    reuse_margin: SupportsFloat
    affinity: Literal["inherited", "auto"]


def pairs(
    vertices_a: _Array,
    faces_a: _Array,
    vertices_b: _Array,
    faces_b: _Array,
    *,
    weld: bool = False,
    kind_a: _RowKind | None = None,
    kind_b: _RowKind | None = None,
    **settings: Unpack[Settings],
) -> npt.NDArray[np.uint32]:
    """Which elements of two meshes intersect.

    Parameters
    ----------
    vertices_a, vertices_b : array_like, shape (v, 3)
        Positions, float32 or float64.
    faces_a, faces_b : array_like of int, shape (n, 3) or (n, 4)
        Triangles or tetrahedra as vertex indices.
    weld : bool
        Whether vertices of one mesh at the same position become one first. This does not change which elements of two
        meshes intersect.
    kind_a, kind_b : {"points", "edges", "triangles", "tetrahedra", "quads"}, optional
        What the rows of `faces_a` and `faces_b` are, as for `Scene.add`.
    **settings
        As for `Detector`, but for ``backend``, which is ``"cpu"`` unless it is given: waking a GPU
        does not pay for one question.

    Returns
    -------
    numpy.ndarray of uint32, shape (n, 2)
        Every pair (row of `faces_a`, row of `faces_b`) that shares a point, touching included;
        sorted.

    Raises
    ------
    ValueError, TypeError
        As `Scene.add` and `Detector`.

    Examples
    --------
    >>> import numpy as np, impinge
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    >>> impinge.pairs(corners, [[0, 1, 2]], corners + [0, 0, 1], [[0, 1, 2]])
    array([], shape=(0, 2), dtype=uint32)
    """
    scene = Scene()
    scene._add_named(vertices_a, faces_a, kind_a, ("vertices_a", "faces_a", "kind_a"), weld)
    scene._add_named(vertices_b, faces_b, kind_b, ("vertices_b", "faces_b", "kind_b"), weld)
    settings.setdefault("backend", "cpu")
    found = Detector(**settings)._detect(scene, {"between": (0, 1)})
    return found.between(0, 1)


def self_pairs(
    vertices: _Array,
    faces: _Array,
    *,
    shared_vertex: Literal["resolve", "skip"] = "resolve",
    weld: bool = False,
    kind: _RowKind | None = None,
    **settings: Unpack[Settings],
) -> npt.NDArray[np.uint32]:
    """Which elements of one mesh intersect each other.

    Parameters
    ----------
    vertices : array_like, shape (v, 3)
        Positions, float32 or float64.
    faces : array_like of int, shape (n, 3) or (n, 4)
        Triangles or tetrahedra as vertex indices.
    shared_vertex : {"resolve", "skip"}
        Elements that share a vertex index are reported when they share more points than the vertices
        they have in common, as two with the same vertices always do, or never. Vertices at one position
        with different indices are not shared, unless they are welded.
    weld : bool
        Whether vertices at the same position become one first, as `weld` does. Rows of the answer stay those of
        `faces`; with it, the answer about the arrays of a file is that of the program ``impinge self``.
    kind : {"points", "edges", "triangles", "tetrahedra", "quads"}, optional
        What the rows of `faces` are, as for `Scene.add`.
    **settings
        As for `Detector`, but for ``backend``, which is ``"cpu"`` unless it is given: waking a GPU
        does not pay for one question.

    Returns
    -------
    numpy.ndarray of uint32, shape (n, 2)
        Pairs of rows of `faces`, the lower one first; sorted.

    Raises
    ------
    ValueError, TypeError
        As `Scene.add` and `Detector`.
    """
    scene, detector = _one_mesh(vertices, faces, kind, weld, settings)
    return detector._detect(scene, {"self_of": 0, "shared_vertex": shared_vertex}).self_of(0)


def closest_points(
    vertices: _Array,
    faces: _Array,
    points: _Array,
    *,
    n_nearest: SupportsIndex = 1,
    kind: _RowKind | None = None,
    **settings: Unpack[Settings],
) -> Closest:
    """The face of a mesh that is nearest to each point, with the nearest point and its distance, or the k nearest faces.

    Parameters
    ----------
    vertices : array_like, shape (v, 3)
        Positions, float32 or float64.
    faces : array_like of int, shape (n, 3) or (n, 4)
        Triangles, or tetrahedra, whose surface is looked at, as vertex indices.
    points : array_like, shape (n, 3)
        Float32 or float64, taken as they are.
    n_nearest : int
        How many faces to find for each point.
    kind : {"points", "edges", "triangles", "tetrahedra", "quads"}, optional
        What the rows of `faces` are, as for `Scene.add`.
    **settings
        As for `Detector`, but for ``backend``, which is ``"cpu"`` unless it is given.

    Returns
    -------
    Closest
        Its `points`, `distances` and `elements` are what trimesh's ``closest_point`` returns.

    Raises
    ------
    ValueError, TypeError
        As `Scene.add` and `Detector.closest`.

    Examples
    --------
    >>> import impinge
    >>> closest = impinge.closest_points([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]], [[1, 1, 2]])
    >>> closest.points.tolist(), closest.distances.tolist(), closest.elements.tolist()
    ([[1.0, 1.0, 0.0]], [2.0], [0])
    """
    scene, detector = _one_mesh(vertices, faces, kind, False, settings)
    return Closest(detector._closest(scene, points, np.inf, {"n_nearest": n_nearest}))


def cast(
    vertices: _Array,
    faces: _Array,
    origins: _Array,
    directions: _Array,
    most: SupportsFloat = np.inf,
    *,
    hits: Literal["first", "any", "all"] = "first",
    kind: _RowKind | None = None,
    **settings: Unpack[Settings],
) -> Hits:
    """What rays hit of a mesh: the points ``origin + t * direction``, for t from 0 to `most`. Decided exactly. A direction
    of zero is the origin alone.

    Parameters
    ----------
    vertices : array_like, shape (v, 3)
        Positions, float32 or float64.
    faces : array_like of int, shape (n, 3) or (n, 4)
        Triangles, or tetrahedra, whose surface is looked at, as vertex indices.
    origins, directions : array_like, shape (n, 3)
        Float32 or float64, taken as they are. Directions need not have unit length.
    most : float
        The largest t: infinity for rays, 1 for segments.
    hits : {"first", "any", "all"}
        What each ray hits first, whether it hits anything, or all that it hits.
    kind : {"points", "edges", "triangles", "tetrahedra", "quads"}, optional
        What the rows of `faces` are, as for `Scene.add`.
    **settings
        As for `Detector`, but for ``backend``, which is ``"cpu"`` unless it is given.

    Returns
    -------
    Hits

    Raises
    ------
    ValueError, TypeError
        As `Scene.add` and `Detector.cast`.

    Examples
    --------
    >>> import impinge
    >>> hits = impinge.cast([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]], [[1, 1, 2]], [[0, 0, -1]])
    >>> hits.t.tolist(), hits.elements.tolist(), hits.barycentrics.tolist()
    ([2.0], [0], [[0.5, 0.25, 0.25]])
    """
    scene, detector = _one_mesh(vertices, faces, kind, False, settings)
    return Hits(detector._cast(scene, origins, directions, most, {"hits": hits}))


def signed_distance(
    vertices: _Array,
    faces: _Array,
    points: _Array,
    *,
    weld: bool = False,
    kind: _RowKind | None = None,
    **settings: Unpack[Settings],
) -> npt.NDArray[np.float64]:
    """How far points are from the surface of a closed mesh: positive inside, negative outside, as trimesh has it.

    Parameters
    ----------
    vertices, faces, points, weld, kind, **settings
        As for `contains`.

    Returns
    -------
    numpy.ndarray of float64, shape (n,)
        0 on the surface. The sign is exact, and the magnitude is rounded down: never above the true distance. Of tetrahedra that
        overlap as `Detector.signed_distance`.

    Raises
    ------
    ValueError, TypeError
        As `contains`.

    Examples
    --------
    >>> import impinge
    >>> corners = [[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]]
    >>> faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    >>> impinge.signed_distance(corners, faces, [[1, 1, 0.5], [0, 0, 2], [-1, 0, 0]]).tolist()
    [0.5, 0.0, -1.0]
    """
    scene, detector = _one_mesh(vertices, faces, kind, weld, settings)
    return detector._signed_distance(scene, 0, points, {})


def contains(
    vertices: _Array,
    faces: _Array,
    points: _Array,
    *,
    weld: bool = False,
    kind: _RowKind | None = None,
    **settings: Unpack[Settings],
) -> npt.NDArray[np.int8]:
    """Where points lie: inside a closed mesh, on its surface or outside. Decided exactly.

    Parameters
    ----------
    vertices : array_like, shape (v, 3)
        Positions, float32 or float64.
    faces : array_like of int, shape (n, 3) or (n, 4)
        Triangles or tetrahedra as vertex indices.
    points : array_like, shape (n, 3)
        Float32 or float64, taken as they are.
    weld : bool
        Whether vertices at the same position become one first, as `weld` does: meshes with seams are not closed without.
    kind : {"triangles", "tetrahedra", "quads"}, optional
        What the rows of `faces` are, as for `Scene.add`.
    **settings
        As for `Detector`, but for ``backend``, which is ``"cpu"`` unless it is given.

    Returns
    -------
    numpy.ndarray of int8, shape (n,)
        1 inside, 0 on the surface, -1 outside, as `Detector.contains`.

    Raises
    ------
    ValueError, TypeError
        As `Scene.add` and `Detector.contains`: above all a surface that is not closed.

    Examples
    --------
    >>> import impinge
    >>> corners = [[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]]
    >>> faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    >>> impinge.contains(corners, faces, [[1, 1, 1], [0, 0, 2], [-1, 0, 0]])
    array([ 1,  0, -1], dtype=int8)
    """
    scene, detector = _one_mesh(vertices, faces, kind, weld, settings)
    return detector._contains(scene, 0, points, {})


#: The winding number of a point on the surface (`winding_numbers`): the lowest int32.
ON_SURFACE = -(2**31)


def winding_numbers(
    vertices: _Array,
    faces: _Array,
    points: _Array,
    *,
    weld: bool = False,
    **settings: Unpack[Settings],
) -> npt.NDArray[np.int32]:
    """How often a closed surface winds around each point; more than once where it overlaps itself. Decided exactly.

    Parameters
    ----------
    vertices : array_like, shape (v, 3)
        Positions, float32 or float64.
    faces : array_like of int, shape (n, 3)
        Vertex indices.
    points : array_like, shape (n, 3)
        Float32 or float64, taken as they are.
    weld : bool
        As `Scene.add`: vertices at the same place count as one.
    **settings
        As for `Detector`, but for ``backend``, which is ``"cpu"`` unless it is given.

    Returns
    -------
    numpy.ndarray of int32, shape (n,)
        As `Detector.winding_numbers`: 0 outside, `ON_SURFACE` on the surface.

    Raises
    ------
    ValueError, TypeError
        As `Scene.add` and `Detector.winding_numbers`.

    Examples
    --------
    >>> import impinge
    >>> corners = [[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]]
    >>> faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    >>> impinge.winding_numbers(corners, faces, [[1, 1, 1], [-1, 0, 0]])
    array([1, 0], dtype=int32)
    """
    scene, detector = _one_mesh(vertices, faces, "triangles", weld, settings)
    return detector._winding_numbers(scene, 0, points, {})


def locate(
    vertices: _Array,
    tetrahedra: _Array,
    points: _Array,
    **settings: Unpack[Settings],
) -> npt.NDArray[np.int64]:
    """Which tetrahedron contains each point: the lowest, where several share the face, edge or vertex on which it is. Decided exactly.

    Parameters
    ----------
    vertices : array_like, shape (v, 3)
        Positions, float32 or float64.
    tetrahedra : array_like of int, shape (n, 4)
        Vertex indices.
    points : array_like, shape (n, 3)
        Float32 or float64, taken as they are.
    **settings
        As for `Detector`, but for ``backend``, which is ``"cpu"`` unless it is given.

    Returns
    -------
    numpy.ndarray of int64, shape (n,)
        Numbers of tetrahedra, -1 outside, as `Detector.locate`.

    Raises
    ------
    ValueError, TypeError
        As `Scene.add` and `Detector.locate`.

    Examples
    --------
    >>> import impinge
    >>> corners = [[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4], [0, 0, -4]]
    >>> impinge.locate(corners, [[0, 1, 2, 3], [0, 2, 1, 4]], [[1, 1, -1], [1, 1, 0], [3, 3, 3]])
    array([ 1,  0, -1])
    """
    scene, detector = _one_mesh(vertices, tetrahedra, "tetrahedra", False, settings, "tetrahedra")
    return detector._locate(scene, 0, points, {})


def _one_mesh(
    vertices: _Array, faces: _Array, kind: _RowKind | None, weld: bool, settings: Settings, name: str = "faces"
) -> tuple[Scene, Detector]:
    """A scene of one mesh, and a detector, on the CPU unless the settings say otherwise."""
    scene = Scene()
    scene._add_named(vertices, faces, kind, ("vertices", name, "kind"), weld)
    settings.setdefault("backend", "cpu")
    return scene, Detector(**settings)


def weld(
    vertices: _Array, faces: _Array
) -> tuple[npt.NDArray[Any], npt.NDArray[np.uint32], npt.NDArray[np.uint32]]:
    """Makes one vertex of all vertices at the same position.

    Files such as STL, and meshes of renderers, repeat a vertex along each seam. Faces on both sides of a seam
    then touch, but are no neighbours, because vertices are shared when their indices are equal.

    Parameters
    ----------
    vertices : array_like, shape (v, 3)
        Positions, float32 or float64. They are compared as numbers, without a tolerance; of equal ones the
        first stays. NaN equals nothing.
    faces : array_like of int, shape (n, k), k from 1 to 4
        Elements of any kind as vertex indices.

    Returns
    -------
    vertices : numpy.ndarray, shape (w, 3)
        The vertices that stay, in their order and precision.
    faces : numpy.ndarray of uint32, shape (n, k)
        The same elements in the same order, with the indices of the vertices that stay.
    map : numpy.ndarray of uint32, shape (v,)
        For each vertex its index among those that stay. The positions of a later frame are welded by
        ``positions[numpy.unique(map, return_index=True)[1]]``.

    Raises
    ------
    ValueError, TypeError
        As `Scene.add`.

    Examples
    --------
    >>> import impinge
    >>> soup = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> vertices, faces, index = impinge.weld(soup, [[0, 1, 2], [3, 4, 5]])
    >>> faces
    array([[0, 1, 2],
           [1, 3, 2]], dtype=uint32)
    >>> index
    array([0, 1, 2, 1, 3, 2], dtype=uint32)
    """
    return _impinge._weld(vertices, faces)


def hash_rows(rows: _Array) -> int:
    """`Pairs.hash` of rows that come from elsewhere.

    Parameters
    ----------
    rows : array_like of int, shape (n, 4)
        As `Pairs.rows`. The order of rows does not matter; in each, the lower (body, element) comes first.

    Returns
    -------
    int
    """
    return _impinge._hash_rows(rows)


def project_psd(matrices: _Array, *, threads: int = 0) -> npt.NDArray[np.float64]:
    """The nearest symmetric matrices without negative eigenvalues, for Newton's method.

    Parameters
    ----------
    matrices : array_like of float, shape (..., k, k), k one of 3, 6, 9 and 12
        Symmetric; else the mean of each and its transpose is taken.
    threads : int, default 0
        How many threads compute, at most; 0 for one per core.

    Returns
    -------
    numpy.ndarray of float64, of the same shape
        Exactly symmetric. Negative eigenvalues became 0, as by ipc-toolkit's ``CLAMP``. The same bits on every machine
        and by any number of threads.

    Raises
    ------
    ValueError, TypeError
        Another shape, or no numbers; a number that is not finite; threads below 0.

    Examples
    --------
    >>> import impinge, numpy as np
    >>> matrix = np.diag([2.0, -1.0, 0.5])
    >>> impinge.project_psd(matrix).diagonal().tolist()
    [2.0, 0.0, 0.5]
    """
    given = np.asarray(matrices)
    if given.dtype.kind not in "biuf":
        raise TypeError(f"matrices: numbers expected, {given.dtype} given")
    if given.ndim < 2 or given.shape[-1] != given.shape[-2] or given.shape[-1] not in (3, 6, 9, 12):
        raise InvalidError(f"matrices: shape (..., k, k) with k of 3, 6, 9 or 12 expected, {given.shape} given")
    if threads < 0:
        raise InvalidError(f"threads: {threads} given, 0 or more allowed")
    return _impinge._project_psd(given.astype(np.float64, copy=False), threads)


class DeviceInfo(NamedTuple):
    """A GPU adapter: hardware, or a driver that does the work of a GPU on the CPU.

    Any part of its `name` chooses it in ``Detector(device=...)``. `interface` is ``"vulkan"``, ``"metal"`` or ``"dx12"``; `driver` the
    driver and its version. `is_software`: whether it is a program on the CPU, which ``backend="auto"`` passes over.
    `max_binding`: bytes that one buffer binding may have.
    """

    name: str
    interface: str
    driver: str
    is_software: bool
    max_binding: int


def devices() -> list[DeviceInfo]:
    """The GPUs that ``backend="gpu"`` can use, hardware first.

    Returns
    -------
    list of DeviceInfo
        Empty where there is none.

    Examples
    --------
    >>> import impinge
    >>> all(device.name for device in impinge.devices())
    True
    """
    return [DeviceInfo(*device) for device in _impinge._devices()]
