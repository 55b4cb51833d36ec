"""Questions about points, rays and collisions under the names of trimesh: change the import, and the answers are exact.

>>> import numpy as np
>>> from impinge.trimesh import ProximityQuery, contains
>>> class Tip:  # or a trimesh.Trimesh
...     vertices = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]])
...     faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
>>> contains(Tip, [[1, 1, 1], [0, 0, 2], [-1, 0, 0]])
array([ True, False, False])
>>> ProximityQuery(Tip).signed_distance([[1, 1, 0.5], [-1, 0, 0]])
array([ 0.5, -1. ])
>>> from impinge.trimesh import RayMeshIntersector
>>> RayMeshIntersector(Tip).intersects_first([[1, 1, -2], [9, 9, -2]], [[0, 0, 1], [0, 0, 1]])
array([ 0, -1])

A mesh is anything with `vertices` and `faces`. It is read again when it has changed. Where trimesh takes a nearest face by floats and casts a
ray to tell inside from outside, these decide: the nearest face is the nearest, of several the lowest, and a point is inside if the
surface winds around it. So the mesh must be closed for `contains` and `signed_distance`, which refuse one that is not, naming an edge; seams, where
vertices are there twice, count as closed. Distances are rounded down. A ray hits whatever it
shares a point with: edges, vertices and faces in whose plane it lies, which trimesh leaves out or counts as rounding has it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, SupportsIndex

import numpy as np
import numpy.typing as npt

from ._answers import Closest
from ._detector import Detector
from ._manager import CollisionManager, scene_to_collision
from ._scene import Scene

if TYPE_CHECKING:
    from ._query import _Array

__all__ = [
    "CollisionManager",
    "ProximityQuery",
    "RayMeshIntersector",
    "closest_point",
    "contains",
    "scene_to_collision",
    "signed_distance",
]

_Floats = npt.NDArray[np.float64]
_Numbers = npt.NDArray[np.int64]


class _OfMesh:
    """Asks about one mesh, which is read again when it has changed."""

    def __init__(self, mesh: Any, *, threads: SupportsIndex | None = None) -> None:
        self._mesh = mesh
        self._detector = Detector("cpu", threads=threads)
        self._read: tuple[npt.NDArray[Any], npt.NDArray[Any]] | None = None
        self._scene = Scene()
        #: The vertices as a body of points, and the surface whose they are.
        self._vertices: tuple[Scene, Scene] | None = None

    def _arrays(self) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        return np.asarray(self._mesh.vertices), np.asarray(self._mesh.faces)

    def _surface(self) -> Scene:
        """A scene of the mesh as it is now."""
        vertices, faces = self._arrays()
        if self._read is not None:
            if np.array_equal(vertices, self._read[0]) and np.array_equal(faces, self._read[1]):
                return self._scene
        self._scene = Scene()
        self._scene._add_named(vertices, faces, "triangles", ("vertices", "faces", "kind"), True)
        self._read = vertices.copy(), faces.copy()
        return self._scene

    def _contains(self, points: _Array) -> npt.NDArray[np.bool_]:
        return self._detector.contains(self._surface(), 0, points) > 0


def _numbers(closest: Closest) -> _Numbers:
    """The nearest elements; -1 where there is none."""
    numbers = closest.elements.astype(np.int64)
    numbers[np.isinf(closest.distances)] = -1
    return numbers


class ProximityQuery(_OfMesh):
    """Nearest points, distances and sides of one mesh, as ``trimesh.proximity.ProximityQuery``.

    Parameters
    ----------
    mesh : trimesh.Trimesh, or anything with `vertices` and `faces`
    threads : int, optional
        CPU threads; by default one per core.
    """

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
            The face with that point; of several the lowest. -1 if the mesh has no faces; the point is then NaN, the distance infinite.
        """
        closest = self._detector.closest(self._surface(), points)
        return closest.points, closest.distances, _numbers(closest)

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
            Of several the lowest. -1 if the mesh has no vertices; the distance is then infinite.
        """
        surface = self._surface()
        if self._vertices is None or self._vertices[0] is not surface:
            self._vertices = surface, Scene()
            self._vertices[1].add_points(np.asarray(self._mesh.vertices))
        closest = self._detector.closest(self._vertices[1], points)
        return closest.distances, _numbers(closest)

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
        return self._detector.signed_distance(self._surface(), 0, points)

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
        return self._contains(points)


class RayMeshIntersector(_OfMesh):
    """What rays hit of one mesh, as ``trimesh.ray.ray_triangle.RayMeshIntersector`` and ``trimesh.ray.ray_pyembree``.

    Directions need not have unit length. Decided exactly: a ray hits all faces with which it shares a point.

    Parameters
    ----------
    mesh : trimesh.Trimesh, or anything with `vertices` and `faces`
    scale_to_box : bool
        Without meaning here: nothing is scaled.
    threads : int, optional
        CPU threads; by default one per core.
    """

    def __init__(
        self, mesh: Any, scale_to_box: bool = True, *, threads: SupportsIndex | None = None
    ) -> None:
        del scale_to_box
        super().__init__(mesh, threads=threads)

    def intersects_id(
        self,
        ray_origins: _Array,
        ray_directions: _Array,
        *,
        multiple_hits: bool = True,
        max_hits: SupportsIndex | None = None,
        return_locations: bool = False,
    ) -> tuple[_Numbers, _Numbers] | tuple[_Numbers, _Numbers, _Floats]:
        """The faces that rays hit. Options are named: their order differs between trimesh's two classes.

        Parameters
        ----------
        ray_origins, ray_directions : array_like, shape (n, 3)
        multiple_hits : bool
            All faces that a ray hits, or the first; of several at one place the lowest.
        max_hits : int, optional
            The most hits of a ray, the first ones; by default all.
        return_locations : bool
            Whether to return where, too. Then of several faces that a ray hits at one place, as on an edge, only the lowest is
            named, so that hits can be counted.

        Returns
        -------
        index_tri, index_ray : numpy.ndarray of int64, shape (m,)
            By ray, then by distance.
        locations : numpy.ndarray of float64, shape (m, 3)
            If they were asked for. Rounded.
        """
        kind: Literal["first", "all"] = "all" if multiple_hits else "first"
        hits = self._detector.cast(self._surface(), ray_origins, ray_directions, hits=kind)
        starts = hits.offsets.astype(np.int64)
        ray: _Numbers = np.repeat(np.arange(len(hits)), starts[1:] - starts[:-1])
        # Asked for the first hits, there is a row for each ray.
        held = np.ones(len(ray), bool) if multiple_hits else hits.hit
        face, t = hits.elements[held].astype(np.int64), hits.t[held]
        kept = np.ones(len(ray), bool)
        if return_locations:
            kept[1:] = (ray[1:] != ray[:-1]) | (t[1:] != t[:-1])
        if max_hits is not None:
            # The number of each hit among those of its ray that are kept.
            before = np.cumsum(kept) - kept
            kept &= before - before[starts[ray]] < int(max_hits)
        if not return_locations:
            return face[kept], ray[kept]
        corners = np.asarray(self._mesh.vertices, np.float64)[np.asarray(self._mesh.faces)[face[kept]]]
        locations = np.einsum("nk,nkj->nj", hits.barycentrics[held][kept], corners)
        return face[kept], ray[kept], locations

    def intersects_location(
        self, ray_origins: _Array, ray_directions: _Array, multiple_hits: bool = True
    ) -> tuple[_Floats, _Numbers, _Numbers]:
        """Where rays hit the mesh, each place once.

        Parameters
        ----------
        ray_origins, ray_directions : array_like, shape (n, 3)
        multiple_hits : bool
            All places, or the first of each ray.

        Returns
        -------
        locations : numpy.ndarray of float64, shape (m, 3)
        index_ray, index_tri : numpy.ndarray of int64, shape (m,)
        """
        face, ray, locations = self.intersects_id(  # type: ignore[misc]
            ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True
        )
        return locations, ray, face

    def intersects_first(self, ray_origins: _Array, ray_directions: _Array) -> _Numbers:
        """The first face that each ray hits.

        Parameters
        ----------
        ray_origins, ray_directions : array_like, shape (n, 3)

        Returns
        -------
        numpy.ndarray of int64, shape (n,)
            -1 where it hits nothing.
        """
        hits = self._detector.cast(self._surface(), ray_origins, ray_directions)
        return np.where(hits.hit, hits.elements.astype(np.int64), -1)

    def intersects_any(self, ray_origins: _Array, ray_directions: _Array) -> npt.NDArray[np.bool_]:
        """Whether each ray hits the mesh.

        Parameters
        ----------
        ray_origins, ray_directions : array_like, shape (n, 3)

        Returns
        -------
        numpy.ndarray of bool, shape (n,)
        """
        return self._detector.cast(self._surface(), ray_origins, ray_directions, hits="any").hit

    def contains_points(self, points: _Array) -> npt.NDArray[np.bool_]:
        """As `ProximityQuery.contains`: no ray decides.

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
        return self._contains(points)


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
