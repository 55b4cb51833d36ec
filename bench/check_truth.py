"""What is right: counts by NumPy on exact comparisons, and pairs of triangles in rational arithmetic.

Short enough to be believed, and shares nothing with the library. Everything follows docs/exactness.md: vertices at exactly
the same position are one vertex, and a pair is a self-intersection if its triangles share more points than the convex hull
of their common vertices.
"""

import functools
from fractions import Fraction

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def weld(vertices, faces):
    """Vertices at exactly the same position as one; minus zero is zero."""
    _, first, inverse = np.unique(vertices + np.float32(0), axis=0, return_index=True, return_inverse=True)
    return vertices[first], inverse.reshape(-1)[faces]


def names_one_twice(faces):
    a, b, c = faces.T
    return (a == b) | (b == c) | (c == a)


def has_zero_area(vertices, faces):
    """A mask. Only faces that doubles cannot tell from a line are decided in rational arithmetic."""
    corners = vertices[faces].astype(np.float64)
    scale = np.abs(corners).max(axis=(1, 2))
    corners = corners / np.where(scale > 0, scale, 1)[:, None, None]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    mask = np.abs(normal).max(axis=1) < 1e-12
    for ix in np.flatnonzero(mask):
        a, b, c = whole(vertices[faces[ix]])
        mask[ix] = cross(minus(b, a), minus(c, a)) == (0, 0, 0)
    return mask


def first_of_each(faces, as_rotations=False):
    """The first of all faces with the same vertices, in any order or only in any rotation."""
    if as_rotations:
        start = faces.argmin(axis=1)[:, None]
        corners = np.take_along_axis(faces, (start + [0, 1, 2]) % 3, axis=1)
    else:
        corners = np.sort(faces, axis=1)
    # Three numbers of 21 bits.
    assert corners.max(initial=0) < 1 << 21
    keys = corners[:, 0] << 42 | corners[:, 1] << 21 | corners[:, 2]
    return faces[np.sort(np.unique(keys, return_index=True)[1])]


def edges_of(faces):
    """Unique undirected edges, the number of faces at each, and the edge of each side of each face."""
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    keys = sides[:, 0] << 32 | sides[:, 1]
    _, of_side, n_faces = np.unique(keys, return_inverse=True, return_counts=True)
    return n_faces, of_side.reshape(-1, 3)


def pieces(n, a, b):
    """The number of connected components of n things, joined by links (a, b)."""
    return int(connected_components(coo_array((np.ones(len(a), bool), (a, b)), (n, n)), directed=False)[0])


def components(faces, by="edges"):
    """Pieces of a surface: connected by edges, by edges of exactly two faces, or by vertices."""
    if not len(faces):
        return 0
    if by == "vertices":
        used, corners = np.unique(faces, return_inverse=True)
        corners = corners.reshape(-1, 3)
        return pieces(len(used), corners[:, :2].ravel(), corners[:, 1:].ravel())
    n_faces, of_side = edges_of(faces)
    of_side = of_side.copy()
    if by == "edges of two":
        # Every other edge becomes an edge of its own per face.
        alone = n_faces[of_side] != 2
        of_side[alone] = len(n_faces) + np.arange(alone.sum())
    n_edges = int(of_side.max()) + 1
    face = np.repeat(np.arange(len(faces)), 3)
    _, edges = np.unique(of_side.ravel(), return_inverse=True)
    n_edges = int(edges.max()) + 1
    return pieces(len(faces) + n_edges, face, len(faces) + edges)


def counts(vertices, faces):
    """What `impinge check` must count."""
    n_vertices = len(vertices)
    vertices, faces = weld(vertices, faces)
    simple = faces[~names_one_twice(faces)]
    n_faces, _ = edges_of(simple) if len(simple) else (np.zeros(0, int), None)
    return {
        "vertices_welded": n_vertices - len(vertices),
        "degenerate": int(has_zero_area(vertices, faces).sum()),
        "duplicate_faces": len(faces) - len(first_of_each(faces)),
        "non_manifold_edges": int((n_faces > 2).sum()),
        "boundary_edges": int((n_faces == 1).sum()),
        "components": components(simple),
        "unused_vertices": len(vertices) - len(np.unique(faces)),
    }


# Points are tuples of integers: the six points of a pair times the same power of two. Only the corners of an
# intersection are fractions.


def whole(points):
    ratios = [[float(x).as_integer_ratio() for x in point] for point in points]
    scale = max(denominator for point in ratios for _, denominator in point)
    return [tuple(n * (scale // d) for n, d in point) for point in ratios]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def negated(a):
    return -a[0], -a[1], -a[2]


def half_spaces(triangle):
    """Half-spaces n . x <= c whose intersection is the triangle, be it a segment or a point."""
    a, b, c = triangle
    normal = cross(minus(b, a), minus(c, a))
    if normal != (0, 0, 0):
        sides = [(cross(minus(q, p), normal), p) for p, q in [(a, b), (b, c), (c, a)]]
        planes = [(normal, a), (negated(normal), a), *sides]
    else:
        # Points of a line are in the order of their coordinates, forwards or backwards.
        p, q = min(triangle), max(triangle)
        along = minus(q, p)
        axes = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
        across = axes if p == q else [cross(along, axis) for axis in axes]
        planes = [(n, p) for n in across] + [(negated(n), p) for n in across]
        planes += [(along, q), (negated(along), p)]
    return [(n, dot(n, p)) for n, p in planes]


def clipped(polygon, n, c):
    """The part of a convex polygon, given by its corners in order, with n . x <= c (Sutherland and Hodgman 1974)."""
    heights = [dot(n, p) - c for p in polygon]
    part = []
    for ix, (p, at_p) in enumerate(zip(polygon, heights)):
        q, at_q = polygon[(ix + 1) % len(polygon)], heights[(ix + 1) % len(polygon)]
        if at_p <= 0:
            part.append(p)
        if at_p < 0 < at_q or at_q < 0 < at_p:
            t = Fraction(at_p, at_p - at_q)
            part.append(tuple(x + t * (y - x) for x, y in zip(p, q)))
    return part


def intersection(a, b):
    """The corners of what two triangles share."""
    polygon = list(a)
    for n, c in half_spaces(b):
        polygon = clipped(polygon, n, c)
        if not polygon:
            break
    return polygon


def is_within_hull(point, hull):
    """Whether a point is on the segment or at the point that one or two points span."""
    p, q = hull[0], hull[-1]
    if p == q:
        return point == p
    along = minus(q, p)
    there = minus(point, p)
    return cross(along, there) == (0, 0, 0) and 0 <= dot(along, there) <= dot(along, along)


#: Kinds of pairs that are self-intersections.
SAME = "same three vertices"
ZERO_AREA = "a face of zero area"
FOLD = "share an edge, folded flat"
VERTEX_CROSS = "share a vertex, and cross"
VERTEX_TOUCH = "share a vertex, and touch elsewhere"
VERTEX_PLANE = "share a vertex, in one plane"
PLANE = "in one plane"
TOUCH = "touch, do not cross"
CROSS = "cross"
KINDS = [CROSS, VERTEX_CROSS, TOUCH, PLANE, VERTEX_TOUCH, VERTEX_PLANE, FOLD, ZERO_AREA, SAME]


def judged(corners_a, ids_a, corners_b, ids_b):
    """Whether a pair is a self-intersection, and its kind. If not, the kind says what the two share."""
    points = whole([*corners_a, *corners_b])
    a, b = points[:3], points[3:]
    common = set(ids_a) & set(ids_b)
    is_flat = (0, 0, 0) in [cross(minus(t[1], t[0]), minus(t[2], t[0])) for t in (a, b)]
    if set(ids_a) == set(ids_b):
        return True, SAME
    shared = [point for point, number in zip(a, ids_a) if number in common]
    shared = sorted(set(shared))
    found = intersection(a, b)
    beyond = [point for point in found if not shared or not is_within_hull(point, shared)] if len(shared) < 3 else []
    if not beyond:
        what = ["nothing", "a vertex", "an edge"][min(len(common), 2)]
        return False, f"share {what}" + (", one of zero area" if is_flat else "")
    if is_flat:
        return True, ZERO_AREA
    sides = [sides_of(a, b), sides_of(b, a)]
    in_plane = sides[0] == {0}
    if len(common) == 2:
        return True, FOLD
    # Each has corners strictly on both sides of the other, and they meet in more than a point.
    crosses = all({-1, 1} <= side for side in sides) and len(set(found)) > 1
    if len(common) == 1:
        return True, VERTEX_PLANE if in_plane else VERTEX_CROSS if crosses else VERTEX_TOUCH
    return True, PLANE if in_plane else CROSS if crosses else TOUCH


def sides_of(a, b):
    """On which sides of b's plane the corners of a are."""
    normal = cross(minus(b[1], b[0]), minus(b[2], b[0]))
    heights = [dot(normal, minus(point, b[0])) for point in a]
    return {(height > 0) - (height < 0) for height in heights}


class Judge:
    """Decides pairs of one mesh; each pair is decided once."""

    def __init__(self, vertices, faces):
        self.given, self.known = (vertices, faces), {}

    @functools.cached_property
    def welded(self):
        return weld(*self.given)

    @functools.cached_property
    def boxes(self):
        vertices, faces = self.welded
        return vertices[faces].min(axis=1), vertices[faces].max(axis=1)

    def pair(self, a, b):
        key = (min(a, b), max(a, b))
        if key not in self.known:
            vertices, faces = self.welded
            of_a, of_b = (faces[ix] for ix in key)
            self.known[key] = judged(vertices[of_a], of_a.tolist(), vertices[of_b], of_b.tolist())
        return self.known[key]

    def near(self, face):
        """Faces whose boxes meet that of a face."""
        low, high = self.boxes
        beside = (low <= high[face]) & (high >= low[face])
        return [int(other) for other in np.flatnonzero(beside.all(axis=1)) if other != face]
