"""Pairs of elements, grouped into places that one can look at. Knows nothing of Blender."""

from __future__ import annotations

from dataclasses import dataclass, field

import impinge
import numpy as np

from .bodies import to_world

__all__ = ["MOST", "Near", "Place", "add_faces", "components", "of_contacts"]

#: The most places that are described, of the most pairs or the smallest distance. Others are only counted.
MOST = 5_000


@dataclass
class Place:
    """Where two bodies, or parts of one, meet or are near. `position` and `radius` are in the world, `names` of the two objects. `faces`
    has, by name, faces of the objects' own meshes. `distance` is the smallest one, None for an intersection.
    """

    names: tuple
    n_pairs: int
    position: np.ndarray
    radius: float
    faces: dict = field(default_factory=dict)
    distance: float | None = None


def add_faces(faces, body, triangles):
    """Adds to the lists by name the faces of an object's own mesh in which triangles of a body lie."""
    polygons = np.unique(body.polygons[triangles])
    polygons = polygons[polygons >= 0]
    if len(polygons):
        known = faces.get(body.name)
        faces[body.name] = polygons if known is None else np.union1d(known, polygons)


def of_contacts(bodies, pairs, contacts, local):
    """The regions in which surfaces meet, those of the most pairs first, as the program counts them; and how many there are in all."""
    places = []
    rows = pairs.rows
    regions = contacts.regions()
    for region in sorted(regions, key=lambda region: -len(region["contacts"]))[:MOST]:
        here = rows[region["contacts"]]
        a, b = (bodies[ix] for ix in region["bodies"])
        low, high = region["bounds"]
        points = np.array([region["position"], low, high])
        if local:
            # All corners of the box, for a rotation moves them apart.
            corners = np.array(np.meshgrid(*zip(low, high))).reshape(3, 8).T
            points = to_world(a.matrix, np.vstack([points[:1], corners]))
        place = Place((a.name, b.name), len(here), points[0], float(np.linalg.norm(np.ptp(points[1:], axis=0)) / 2))
        add_faces(place.faces, a, here[:, 1])
        add_faces(place.faces, b, here[:, 3])
        places.append(place)
    return places, len(regions)


def components(n, a, b):
    """Of each of `n` nodes the lowest one that the edges `a[i]`, `b[i]` connect it to."""
    label = np.arange(n)
    while True:
        roots_a, roots_b = label[a], label[b]
        apart = roots_a != roots_b
        if not apart.any():
            return label
        a, b, roots_a, roots_b = a[apart], b[apart], roots_a[apart], roots_b[apart]
        np.minimum.at(label, np.maximum(roots_a, roots_b), np.minimum(roots_a, roots_b))
        while True:
            further = label[label]
            if np.array_equal(further, label):
                break
            label = further


class Near:
    """Near pairs of a scene of these bodies. `n_pairs` of them count: those with an element in selected triangles."""

    def __init__(self, bodies, scene, near):
        self._bodies, self._near, self._fans = bodies, near, {}
        numbers = range(len(bodies))
        self._first = np.cumsum([0] + [scene.n_vertices(ix) for ix in numbers])
        self._triangles = [scene.elements(ix).astype(np.int64) for ix in numbers]
        self._rows = near.rows.astype(np.int64)
        self._letters = np.array([list(name) for name in impinge.KINDS])[near.kinds]
        # Per pair and side, the three vertices of a face, those of an edge and a vertex repeated; counted through all bodies.
        self._corners = np.stack([self._corners_of(scene, side) for side in (0, 1)], axis=1)
        kept = np.ones(len(self._rows), bool)
        if any(body.selected is not None for body in bodies):
            kept = self._is_selected(0) | self._is_selected(1)
        self._kept = np.flatnonzero(kept)
        self.n_pairs = len(self._kept)

    def _each(self, side, letters):
        """Body by body, its pairs on this side whose elements are of one of these letters."""
        for ix in range(len(self._bodies)):
            here = np.flatnonzero((self._rows[:, 2 * side] == ix) & np.isin(self._letters[:, side], letters))
            if len(here):
                yield ix, here, self._rows[here, 2 * side + 1]

    def _corners_of(self, scene, side):
        out = np.empty((len(self._rows), 3), np.int64)
        for ix, here, elements in self._each(side, ["v"]):
            out[here] = elements[:, None] + self._first[ix]
        for ix, here, elements in self._each(side, ["e"]):
            out[here] = scene.edges(ix)[elements][:, [0, 1, 1]] + self._first[ix]
        for ix, here, elements in self._each(side, ["f"]):
            out[here] = self._triangles[ix][elements] + self._first[ix]
        return out

    def _is_selected(self, side):
        """Faces that are selected, edges and vertices all of whose vertices are in such faces."""
        out = np.zeros(len(self._rows), bool)
        vertices = np.zeros(self._first[-1], bool)
        for ix, body in enumerate(self._bodies):
            if body.selected is not None:
                vertices[self._triangles[ix][body.selected] + self._first[ix]] = True
        for ix, here, _ in self._each(side, ["v", "e"]):
            out[here] = vertices[self._corners[here, side]].all(axis=1)
        for ix, here, elements in self._each(side, ["f"]):
            selected = self._bodies[ix].selected
            out[here] = True if selected is None else selected[elements]
        return out

    def faces(self, pairs=None):
        """By name, the faces of the objects' own meshes in these pairs, with all that have a near edge or vertex."""
        pairs = self._kept if pairs is None else pairs
        faces = {}
        for side in (0, 1):
            numbers = self._rows[pairs, 2 * side]
            for ix in np.unique(numbers):
                here = pairs[numbers == ix]
                is_face = self._letters[here, side] == "f"
                add_faces(faces, self._bodies[ix], self._rows[here[is_face], 2 * side + 1])
                ends = self._corners[here[~is_face], side, :2] - self._first[ix]
                add_faces(faces, self._bodies[ix], self._triangles_at(ix, ends))
        return faces

    def _triangles_at(self, ix, ends):
        """The triangles of a body that have both ends of one of these edges; those of a vertex are the same."""
        triangles = self._triangles[ix]
        order, starts = self._around(ix)
        n_each = starts[ends[:, 0] + 1] - starts[ends[:, 0]]
        # The runs `starts[a]..starts[a + 1]`, one after the other.
        run = np.repeat(starts[ends[:, 0]] - np.cumsum(n_each) + n_each, n_each) + np.arange(n_each.sum())
        fan = order[run]
        return fan[(triangles[fan] == np.repeat(ends[:, 1], n_each)[:, None]).any(axis=1)]

    def _around(self, ix):
        """The triangles around all vertices, and where those of each begin."""
        if ix not in self._fans:
            self._fans[ix] = self._find_fans(ix)
        return self._fans[ix]

    def _find_fans(self, ix):
        corners = self._triangles[ix].ravel()
        order = np.argsort(corners, kind="stable")
        n_vertices = self._first[ix + 1] - self._first[ix]
        return order // 3, np.searchsorted(corners[order], np.arange(n_vertices + 1))

    def places(self):
        """Pairs of the same two bodies whose elements share vertices are one place, and so are those that pairs connect. The nearest places
        first, and how many there are in all.
        """
        two = self._rows[self._kept][:, [0, 2]]
        _, of_bodies = np.unique(two.min(axis=1) * len(self._bodies) + two.max(axis=1), return_inverse=True)
        corners = self._corners[self._kept].reshape(-1, 6) + of_bodies.reshape(-1, 1) * self._first[-1]
        used, index = np.unique(corners, return_inverse=True)
        index = index.reshape(-1, 6)
        label = components(len(used), np.repeat(index[:, 0], 5), index[:, 1:].ravel())[index[:, 0]]
        order = np.argsort(label, kind="stable")
        starts = np.flatnonzero(np.diff(label[order], prepend=-1))
        distances = self._near.distances[self._kept][order]
        nearest = np.minimum.reduceat(distances, starts)
        ends = np.append(starts[1:], len(order))
        places = []
        for group in np.argsort(nearest, kind="stable")[:MOST]:
            pairs = self._kept[order[starts[group] : ends[group]]]
            points = self._near.points[pairs].reshape(-1, 3)
            low, high = points.min(axis=0), points.max(axis=0)
            involved = np.unique(self._rows[pairs][:, [0, 2]])
            names = tuple(self._bodies[ix].name for ix in (involved[0], involved[-1]))
            radius = float(np.linalg.norm(high - low) / 2)
            places.append(Place(names, len(pairs), (low + high) / 2, radius, self.faces(pairs), float(nearest[group])))
        return places, len(starts)
