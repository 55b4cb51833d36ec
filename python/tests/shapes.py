"""Meshes that the tests share: generated, so that every machine has them."""

import numpy as np


def lattice_triangles(n, k, seed, shared=False):
    """Triangles with corners on a (k+1)^3 integer lattice: coincident, collinear, coplanar.

    With `shared`, corners with one position are one vertex, so that triangles share vertices.
    """
    return _lattice(n, k, seed, 3, shared)


def lattice_tetrahedra(n, k, seed, shared=False):
    """Tetrahedra on the lattice, flat and coincident ones included."""
    return _lattice(n, k, seed, 4, shared)


def _lattice(n, k, seed, corners, shared):
    points = np.random.default_rng(seed).integers(0, k + 1, (n * corners, 3))
    elements = np.arange(n * corners).reshape(n, corners)
    if shared:
        points, inverse = np.unique(points, axis=0, return_inverse=True)
        elements = inverse.reshape(n, corners)
    return points.astype(np.float32), elements.astype(np.uint32)


def soup(n, size, seed, dtype=np.float32):
    """Small triangles anywhere in the unit cube."""
    random = np.random.default_rng(seed)
    points = random.random((n, 1, 3)) + size * (random.random((n, 3, 3)) - 0.5)
    return points.reshape(-1, 3).astype(dtype), np.arange(3 * n, dtype=np.uint32).reshape(n, 3)


def ball(n_rings=20, n_segments=32, dtype=np.float32):
    """A closed ball of radius 1: (vertices, faces)."""
    ring = np.pi * np.arange(1, n_rings) / n_rings
    segment = 2 * np.pi * np.arange(n_segments) / n_segments
    ring, segment = (grid.ravel() for grid in np.meshgrid(ring, segment, indexing="ij"))
    x, y = np.sin(ring) * np.cos(segment), np.sin(ring) * np.sin(segment)
    vertices = np.vstack([np.stack([x, y, np.cos(ring)], 1), [[0, 0, 1], [0, 0, -1]]])
    north, south = len(vertices) - 2, len(vertices) - 1

    def at(r, s):
        return r * n_segments + s % n_segments

    faces = []
    for s in range(n_segments):
        faces.append((north, at(0, s), at(0, s + 1)))
        faces.append((south, at(n_rings - 2, s + 1), at(n_rings - 2, s)))
        for r in range(n_rings - 2):
            faces.append((at(r, s), at(r + 1, s), at(r + 1, s + 1)))
            faces.append((at(r, s), at(r + 1, s + 1), at(r, s + 1)))
    return vertices.astype(dtype), np.array(faces, np.uint32)


#: One triangle, and the same one standing across it.
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
ACROSS = TRIANGLE[:, [0, 2, 1]] + np.float32([0, 0.25, -0.25])
FACE = np.array([[0, 1, 2]], np.uint32)
