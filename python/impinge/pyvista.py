"""Questions about a mesh of pyvista, on the mesh: `mesh.impinge.contains(points)`.

>>> import pyvista as pv
>>> ball = pv.Sphere(radius=2.0)
>>> ball.impinge.contains([[0, 0, 0], [0, 0, 3]])
array([ 1, -1], dtype=int8)
>>> ball.impinge.cast([[0, 0, 5]], [[0, 0, -1]]).t
array([3.])
>>> len(ball.impinge.self_pairs())
0

Nothing is to be imported: pyvista 0.48 and later finds this module where impinge is installed. A mesh is a `pyvista.PolyData` of
triangles. It is read again when it has changed. Vertices at one position count as one, so a mesh that is split along its edges for shading is
closed all the same.
"""

from __future__ import annotations

from importlib import import_module
from math import inf
from typing import TYPE_CHECKING, Any, Literal, SupportsFloat, SupportsIndex

import numpy as np
import numpy.typing as npt

from ._answers import Closest, Hits
from ._errors import InvalidError
from .trimesh import _OfMesh

if TYPE_CHECKING:
    from ._query import _Array

__all__ = ["PolyDataAccessor"]

_Rows = npt.NDArray[np.uint32]


class PolyDataAccessor(_OfMesh):
    """What `mesh.impinge` is.

    Parameters
    ----------
    mesh : pyvista.PolyData
        Of triangles.
    """

    def _arrays(self) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        if not self._mesh.is_all_triangles:
            raise InvalidError("mesh: not all of its cells are triangles: take mesh.triangulate()")
        return np.asarray(self._mesh.points), np.asarray(self._mesh.regular_faces).reshape(-1, 3)

    def closest(
        self, points: _Array, most: SupportsFloat = inf, *, n_nearest: SupportsIndex = 1
    ) -> Closest:
        """The face that is nearest to each point, with the nearest point and its distance, or the k nearest faces.

        Parameters
        ----------
        points : array_like, shape (n, 3)
        most : float
            Faces farther away are not looked for.
        n_nearest : int
            How many faces to find for each point.

        Returns
        -------
        Closest
        """
        return self._detector.closest(self._surface(), points, most, n_nearest=n_nearest)

    def contains(self, points: _Array) -> npt.NDArray[np.int8]:
        """Where points lie: inside, on the surface or outside. Decided exactly.

        Parameters
        ----------
        points : array_like, shape (n, 3)

        Returns
        -------
        numpy.ndarray of int8, shape (n,)
            1 inside, 0 on the surface, -1 outside.

        Raises
        ------
        ValueError
            A surface that is not closed: the error names an edge.
        """
        return self._detector.contains(self._surface(), 0, points)

    def signed_distance(self, points: _Array) -> npt.NDArray[np.float64]:
        """How far points are from the surface: positive inside, negative outside, 0 on it.

        pyvista's `compute_implicit_distance` has the opposite sign.

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
            A surface that is not closed: the error names an edge.
        """
        return self._detector.signed_distance(self._surface(), 0, points)

    def cast(
        self,
        origins: _Array,
        directions: _Array,
        most: SupportsFloat = inf,
        *,
        hits: Literal["first", "any", "all"] = "first",
    ) -> Hits:
        """What rays hit: the points ``origin + t * direction``, for t from 0 to `most`. Decided exactly.

        Parameters
        ----------
        origins, directions : array_like, shape (n, 3)
            Directions need not have unit length.
        most : float
            The largest t: infinity for rays, 1 for segments.
        hits : {"first", "any", "all"}
            What each ray hits first, whether it hits anything, or all that it hits.

        Returns
        -------
        Hits
        """
        return self._detector.cast(self._surface(), origins, directions, most, hits=hits)

    def self_pairs(self) -> _Rows:
        """Which faces intersect each other: pairs that share more points than the vertices they have in common.

        Returns
        -------
        numpy.ndarray of uint32, shape (n, 2)
            The lower face of each pair first; sorted.
        """
        return self._detector.detect(self._surface(), self_of=0).self_of(0)


_pyvista = import_module("pyvista")
if not hasattr(_pyvista, "register_dataset_accessor"):
    raise ImportError(f"pyvista {_pyvista.__version__} has no accessors: 0.48 or later is needed")
_pyvista.register_dataset_accessor("impinge", _pyvista.PolyData)(PolyDataAccessor)
