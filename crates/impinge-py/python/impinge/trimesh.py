"""Questions about points under the names of trimesh: change the import, and the answers are exact.

>>> import numpy as np
>>> from impinge.trimesh import ProximityQuery, contains
>>> class Tip:  # or a trimesh.Trimesh
...     vertices = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]])
...     faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
>>> contains(Tip, [[1, 1, 1], [0, 0, 2], [-1, 0, 0]])
array([ True, False, False])
>>> ProximityQuery(Tip).signed_distance([[1, 1, 0.5], [-1, 0, 0]])
array([ 0.5, -1. ])

A mesh is anything with `vertices` and `faces`. It is read again when it has changed. Where trimesh takes a nearest face by floats and casts a
ray to tell inside from outside, these decide: the nearest face is the nearest, of several the lowest, and a point is inside if the
surface winds around it. So the mesh must be closed for `contains` and `signed_distance`, which refuse one that is not, naming an edge; seams, where
vertices are there twice, count as closed. Distances are rounded down. Rays are not here yet.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np
import numpy.typing as npt

from ._detector import Detector
from ._scene import Scene

if TYPE_CHECKING:
    from ._query import _Array

__all__ = ["ProximityQuery", "closest_point", "contains", "signed_distance"]

_Floats = npt.NDArray[np.float64]
_Numbers = npt.NDArray[np.int64]


class ProximityQuery:
    """Nearest points, distances and sides of one mesh, as ``trimesh.proximity.ProximityQuery``.

    Parameters
    ----------
    mesh : trimesh.Trimesh, or anything with `vertices` and `faces`
    threads : int, optional
        CPU threads; by default one per core.
    """

    def __init__(self, mesh: Any, *, threads: SupportsIndex | None = None) -> None:
        self._mesh = mesh
        self._detector = Detector("cpu", threads=threads)
        self._read: tuple[npt.NDArray[Any], npt.NDArray[Any]] | None = None
        self._surface = self._vertices = Scene()

    def on_surface(self, points: _Array) -> tuple[_Floats, _Floats, _Numbers]:
        """The nearest points of the surface.

        Parameters
        ----------
        points : array_like, shape (n, 3)

        Returns
        -------
        closest : numpy.ndarray of float64, shape (n, 3)
            Rounded.
        distance : numpy.ndarray of float64, shape (n,)
            Rounded down.
        triangle_id : numpy.ndarray of int64, shape (n,)
            The face with that point; of several the lowest.
        """
        self._refresh()
        closest = self._detector.closest(self._surface, points)
        return closest.points, closest.distances, closest.elements.astype(np.int64)

    def vertex(self, points: _Array) -> tuple[_Floats, _Numbers]:
        """The nearest vertices.

        Parameters
        ----------
        points : array_like, shape (n, 3)

        Returns
        -------
        distance : numpy.ndarray of float64, shape (n,)
            Rounded down.
        vertex_id : numpy.ndarray of int64, shape (n,)
            Of several the lowest.
        """
        self._refresh()
        closest = self._detector.closest(self._vertices, points)
        return closest.distances, closest.elements.astype(np.int64)

    def signed_distance(self, points: _Array) -> _Floats:
        """How far points are from the surface: positive inside, negative outside, 0 on it.

        Parameters
        ----------
        points : array_like, shape (n, 3)

        Returns
        -------
        numpy.ndarray of float64, shape (n,)
            The sign is exact, and the magnitude is rounded down.

        Raises
        ------
        ValueError
            A surface that is not closed.
        """
        self._refresh()
        places = self._detector.contains(self._surface, 0, points)
        return self._detector.closest(self._surface, points).distances * places

    def contains(self, points: _Array) -> npt.NDArray[np.bool_]:
        """Whether points are inside; what is on the surface is not. `impinge.contains` tells all three apart.

        Parameters
        ----------
        points : array_like, shape (n, 3)

        Returns
        -------
        numpy.ndarray of bool, shape (n,)

        Raises
        ------
        ValueError
            A surface that is not closed.
        """
        self._refresh()
        return self._detector.contains(self._surface, 0, points) > 0

    def _refresh(self) -> None:
        """Reads the mesh, if it has changed."""
        vertices, faces = np.asarray(self._mesh.vertices), np.asarray(self._mesh.faces)
        if self._read is not None:
            if np.array_equal(vertices, self._read[0]) and np.array_equal(faces, self._read[1]):
                return
        self._surface, self._vertices = Scene(), Scene()
        self._surface._add_named(vertices, faces, "triangles", ("vertices", "faces"), True)
        self._vertices.add_points(vertices)
        self._read = vertices.copy(), faces.copy()


def closest_point(mesh: Any, points: _Array) -> tuple[_Floats, _Floats, _Numbers]:
    """As ``trimesh.proximity.closest_point``: see `ProximityQuery.on_surface`.

    Parameters
    ----------
    mesh : trimesh.Trimesh, or anything with `vertices` and `faces`
    points : array_like, shape (n, 3)

    Returns
    -------
    closest, distance, triangle_id
    """
    return ProximityQuery(mesh).on_surface(points)


def signed_distance(mesh: Any, points: _Array) -> _Floats:
    """As ``trimesh.proximity.signed_distance``: see `ProximityQuery.signed_distance`.

    Parameters
    ----------
    mesh : trimesh.Trimesh, or anything with `vertices` and `faces`
    points : array_like, shape (n, 3)

    Returns
    -------
    numpy.ndarray of float64, shape (n,)
    """
    return ProximityQuery(mesh).signed_distance(points)


def contains(mesh: Any, points: _Array) -> npt.NDArray[np.bool_]:
    """As ``trimesh.Trimesh.contains``: see `ProximityQuery.contains`.

    Parameters
    ----------
    mesh : trimesh.Trimesh, or anything with `vertices` and `faces`
    points : array_like, shape (n, 3)

    Returns
    -------
    numpy.ndarray of bool, shape (n,)
    """
    return ProximityQuery(mesh).contains(points)
