"""What a question is about: meshes as arrays. Knows nothing of Blender."""

from __future__ import annotations

from dataclasses import dataclass

import impinge
import numpy as np

__all__ = ["Body", "World", "to_world", "welded"]


@dataclass
class Body:
    """An object as it was in one frame.

    `vertices`, (v, 3) float32, are in the object's own space; `matrix`, (4, 4) float64, takes them to the world. `triangles`, (t, 3), name
    vertices. `polygons`, (t,), are the faces of the object's own mesh that the triangles come from, -1 where a modifier made one.
    `selected`, (t,) bool, is None where all triangles count.
    """

    name: str
    vertices: np.ndarray
    triangles: np.ndarray
    polygons: np.ndarray
    matrix: np.ndarray
    selected: np.ndarray | None = None

    @property
    def has_faces(self):
        return len(self.triangles) > 0


def to_world(matrix, points):
    """Points in the world, float64. Equal points stay equal, which a matrix product by BLAS would not promise."""
    x, y, z = np.asarray(points, np.float64).T
    return np.stack([row[0] * x + row[1] * y + row[2] * z + row[3] for row in matrix[:3]], axis=1)


def welded(body, weld):
    """Vertices and triangles of a body with one vertex per position, in its own space."""
    if not weld:
        return body.vertices, body.triangles
    vertices, triangles, _ = impinge.weld(body.vertices, body.triangles)
    return vertices, triangles


class World:
    """A scene of impinge that follows bodies from frame to frame. While their topology stays, only positions are set, and a detector
    can use again what it has found about them.
    """

    def __init__(self):
        self._scene = impinge.Scene()
        self._triangles = []

    def update(self, bodies, weld, local):
        """The scene with these bodies, in their own space or in the world.

        Raises ValueError with the name of the object whose positions cannot be used.
        """
        if len(bodies) != len(self._triangles):
            self.__init__()
        is_new = not self._triangles
        for ix, body in enumerate(bodies):
            vertices, triangles = welded(body, weld)
            if not local:
                vertices = to_world(body.matrix, vertices)
            try:
                if is_new:
                    self._scene.add(vertices, triangles)
                    self._triangles.append(triangles)
                elif len(vertices) == self._scene.n_vertices(ix) and np.array_equal(triangles, self._triangles[ix]):
                    self._scene.set_positions(ix, vertices)
                else:
                    self._scene.remesh(ix, vertices, triangles)
                    self._triangles[ix] = triangles
            except ValueError as error:
                # A scene that holds only some of the bodies is of no use.
                self.__init__()
                raise ValueError(f"{body.name}: {error}") from error
        return self._scene
