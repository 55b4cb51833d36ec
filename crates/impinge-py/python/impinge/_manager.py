"""Bodies by name: `impinge.CollisionManager`, as users of trimesh and FCL know it."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ._impinge import Body, Detector, Distances, Nearest, Result, Scene

__all__ = ["CollisionManager", "ContactData", "DistanceData"]

_Array = Any
_Name = Hashable


class ContactData:
    """Two faces that share a point.

    Attributes
    ----------
    names : set
        The names of the two objects.
    """

    def __init__(self, names: tuple[_Name, _Name], indices: tuple[int, int]) -> None:
        self.names = set(names)
        self._indices = dict(zip(names, indices))

    def index(self, name: _Name) -> int:
        """The face of the object of this name."""
        return self._indices[name]

    def __repr__(self) -> str:
        return f"ContactData({self._indices})"


class DistanceData:
    """The nearest faces of two objects.

    Attributes
    ----------
    names : set
        The names of the two objects.
    distance : float
        0 if and only if they share a point.
    """

    def __init__(self, names: tuple[_Name, _Name], nearest: Nearest) -> None:
        self.names = set(names)
        self.distance = nearest.distance
        self._indices = dict(zip(names, nearest.primitives))
        points = nearest.points
        self._points = {} if points is None else dict(zip(names, points))

    def index(self, name: _Name) -> int:
        """The face of the object of this name."""
        return self._indices[name]

    def point(self, name: _Name) -> npt.NDArray[np.float64] | None:
        """The point of this object that is nearest to the other, or `None` where they share points."""
        return self._points.get(name)

    def __repr__(self) -> str:
        return f"DistanceData({self.distance}, {self._indices})"


class CollisionManager:
    """Rigid objects by name, and which of them collide. The methods are those of ``trimesh.collision.CollisionManager``.

    Two objects collide if and only if two of their faces share a point where their moved vertices are, touching
    included; an object inside another one without touching it does not collide with it, as faces are surfaces.

    Parameters
    ----------
    **settings
        As for `Detector`.

    Examples
    --------
    >>> import numpy as np, impinge
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    >>> faces = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]
    >>> manager = impinge.CollisionManager(backend="cpu")
    >>> manager.add_object("left", (corners, faces))
    >>> manager.add_object("right", (corners, faces), transform=np.eye(4) + 2 * np.eye(4, k=3))
    >>> manager.in_collision_internal()
    False
    >>> manager.min_distance_internal()
    1.0
    >>> manager.set_transform("right", np.eye(4))
    >>> manager.in_collision_internal(return_names=True)
    (True, {('left', 'right')})
    """

    def __init__(self, **settings: Any) -> None:
        self._scene = Scene()
        self._detector = Detector(**settings)
        self._distances = Distances()
        self._bodies: dict[_Name, Body] = {}

    @property
    def names(self) -> list[_Name]:
        """list : the names of all objects, in the order in which they were added."""
        return list(self._bodies)

    def __len__(self) -> int:
        return len(self._bodies)

    def __contains__(self, name: object) -> bool:
        return name in self._bodies

    def __repr__(self) -> str:
        return f"CollisionManager({len(self)} objects)"

    def add_object(self, name: _Name, mesh: Any, transform: _Array | None = None) -> None:
        """Adds an object.

        Parameters
        ----------
        name : hashable
            By which it is known from now on. An object that has the name already is replaced.
        mesh
            Anything that `Scene.add` takes by itself, such as a trimesh, or a pair of vertices and faces.
        transform : array_like, shape (4, 4), optional
            Where it is, as for `Scene.set_transform`.

        Raises
        ------
        ValueError, TypeError
            As `Scene.add` and `Scene.set_transform`; nothing is changed then.
        """
        body = _add(self._scene, mesh, transform)
        if name in self._bodies:
            self.remove_object(name)
        self._bodies[name] = body

    def remove_object(self, name: _Name) -> None:
        """Removes an object.

        Raises
        ------
        ValueError
            No object has the name.
        """
        self._scene.remove(self._body(name))
        del self._bodies[name]

    def set_transform(self, name: _Name, transform: _Array) -> None:
        """Moves an object from its rest positions, as `Scene.set_transform` does.

        Parameters
        ----------
        name : hashable
        transform : array_like, shape (4, 4)

        Raises
        ------
        ValueError
            No object has the name; a matrix that `Scene.set_transform` refuses.
        """
        self._scene.set_transform(self._body(name), transform)

    def in_collision_internal(self, return_names: bool = False, return_data: bool = False) -> Any:
        """Whether any two objects collide.

        Parameters
        ----------
        return_names, return_data : bool
            What is returned besides.

        Returns
        -------
        bool
        set of (name, name)
            Pairs of objects that collide, the name that was added first coming first. With `return_names`.
        list of ContactData
            All pairs of faces that share a point. With `return_data`.
        """
        result = self._detector.detect(self._scene)
        names = {int(body): name for name, body in self._bodies.items()}
        order = {name: ix for ix, name in enumerate(self._bodies)}

        def pair(row: npt.NDArray[np.uint32]) -> tuple[_Name, _Name]:
            a, b = names[int(row[0])], names[int(row[2])]
            return (a, b) if order[a] < order[b] else (b, a)

        return _answer(result, names, pair, return_names, return_data)

    def in_collision_single(
        self,
        mesh: Any,
        transform: _Array | None = None,
        return_names: bool = False,
        return_data: bool = False,
    ) -> Any:
        """Whether any object collides with a mesh that is not in the manager.

        Parameters
        ----------
        mesh, transform
            As for `add_object`.
        return_names, return_data : bool
            What is returned besides.

        Returns
        -------
        bool
        set of name
            The objects that collide with the mesh. With `return_names`.
        list of ContactData
            The mesh goes by the name ``"__external"``. With `return_data`.
        """
        with _Guest(self, mesh, transform) as guest:
            result = self._with_guest(guest)
            names = {int(body): name for name, body in self._bodies.items()}
            names[int(guest)] = "__external"

            def other(row: npt.NDArray[np.uint32]) -> _Name:
                return names[int(row[0] if row[2] == int(guest) else row[2])]

            return _answer(result, names, other, return_names, return_data)

    def in_collision_other(
        self, other_manager: CollisionManager, return_names: bool = False, return_data: bool = False
    ) -> Any:
        """Whether any object collides with one of another manager.

        Parameters
        ----------
        other_manager : CollisionManager
        return_names, return_data : bool
            What is returned besides.

        Returns
        -------
        bool
        set of (name, name)
            A name of this manager and one of the other. With `return_names`.
        list of ContactData
            With `return_data`.
        """
        pairs: set[tuple[_Name, _Name]] = set()
        data: list[ContactData] = []
        for theirs in other_manager._bodies.values():
            name = next(key for key, body in other_manager._bodies.items() if body is theirs)
            with _Guest(self, _mesh(other_manager._scene, theirs)) as guest:
                result = self._with_guest(guest)
                names = {int(body): mine for mine, body in self._bodies.items()}
                names[int(guest)] = name
                for row in _first_rows(result, not return_data):
                    is_first = row[0] == int(guest)
                    mine = names[int(row[2] if is_first else row[0])]
                    pairs.add((mine, name))
                    indices = (int(row[3]), int(row[1])) if is_first else (int(row[1]), int(row[3]))
                    data.append(ContactData((mine, name), indices))
        parts: list[Any] = [bool(pairs)]
        parts += [pairs] if return_names else []
        parts += [data] if return_data else []
        return parts[0] if len(parts) == 1 else tuple(parts)

    def min_distance_internal(self, return_names: bool = False, return_data: bool = False) -> Any:
        """The smallest distance of any two objects; infinite where there are fewer than two.

        Parameters
        ----------
        return_names, return_data : bool
            What is returned besides.

        Returns
        -------
        float
        (name, name)
            With `return_names`.
        DistanceData
            With `return_data`.
        """
        items = list(self._bodies.items())
        pairs = [(a, b) for ix, a in enumerate(items) for b in items[ix + 1 :]]
        return _nearest(self, pairs, lambda a, b: (a, b), return_names, return_data)

    def min_distance_single(
        self,
        mesh: Any,
        transform: _Array | None = None,
        return_name: bool = False,
        return_data: bool = False,
    ) -> Any:
        """The smallest distance of any object to a mesh that is not in the manager.

        Parameters
        ----------
        mesh, transform
            As for `add_object`.
        return_name, return_data : bool
            What is returned besides.

        Returns
        -------
        float
        name
            Of the nearest object. With `return_name`.
        DistanceData
            The mesh goes by the name ``"__external"``. With `return_data`.
        """
        with _Guest(self, mesh, transform) as guest:
            pairs = [(item, ("__external", guest)) for item in self._bodies.items()]
            return _nearest(self, pairs, lambda a, _: a, return_name, return_data)

    def min_distance_other(
        self, other_manager: CollisionManager, return_names: bool = False, return_data: bool = False
    ) -> Any:
        """The smallest distance of an object to one of another manager.

        Parameters
        ----------
        other_manager : CollisionManager
        return_names, return_data : bool
            What is returned besides.

        Returns
        -------
        float
        (name, name)
            Of this manager and of the other. With `return_names`.
        DistanceData
            With `return_data`.
        """
        guests = []
        try:
            for name, body in other_manager._bodies.items():
                guests.append((name, _add(self._scene, _mesh(other_manager._scene, body), None)))
            pairs = [(mine, theirs) for mine in self._bodies.items() for theirs in guests]
            return _nearest(self, pairs, lambda a, b: (a, b), return_names, return_data)
        finally:
            for _, body in guests:
                self._scene.remove(body)

    def _with_guest(self, guest: Body) -> Result:
        """The pairs of a mesh that is in the scene for a moment, and of no other objects."""
        mine = list(self._bodies.values())
        try:
            # A guest is in the first group and meets the second, where everybody else is.
            self._scene.set_filter(guest, category=1, mask=2)
            for body in mine:
                self._scene.set_filter(body, category=2, mask=1)
            return self._detector.detect(self._scene)
        finally:
            for body in mine:
                self._scene.set_filter(body)

    def _body(self, name: _Name) -> Body:
        try:
            return self._bodies[name]
        except KeyError:
            raise ValueError(f"name: there is no object {name!r}") from None


class _Guest:
    """A mesh that is in a manager's scene while it is asked about."""

    def __init__(self, manager: CollisionManager, mesh: Any, transform: _Array | None = None) -> None:
        self._scene = manager._scene
        self._body = _add(self._scene, mesh, transform)

    def __enter__(self) -> Body:
        return self._body

    def __exit__(self, *_: object) -> None:
        self._scene.remove(self._body)


def _add(scene: Scene, mesh: Any, transform: _Array | None) -> Body:
    if isinstance(mesh, tuple):
        body = scene.add(*mesh)
    else:
        body = scene.add(mesh)
    if transform is not None:
        try:
            scene.set_transform(body, transform)
        except BaseException:
            scene.remove(body)
            raise
    return body


def _mesh(scene: Scene, body: Body) -> tuple[_Array, _Array, str]:
    return scene.positions(body), scene.elements(body), scene.kind(body)


def _first_rows(result: Result, once: bool) -> Iterator[npt.NDArray[np.uint32]]:
    """All rows, or one per pair of bodies."""
    rows = result.rows
    if once and len(rows):
        rows = rows[np.unique(rows[:, [0, 2]], axis=0, return_index=True)[1]]
    return iter(rows)


def _answer(
    result: Result, names: dict[int, _Name], of: Any, return_names: bool, return_data: bool
) -> Any:
    parts: list[Any] = [len(result) > 0]
    if return_names:
        parts.append({of(row) for row in _first_rows(result, True)})
    if return_data:
        rows = result.rows.tolist()
        parts.append([ContactData((names[a], names[b]), (i, j)) for a, i, b, j in rows])
    return parts[0] if len(parts) == 1 else tuple(parts)


def _nearest(
    manager: CollisionManager, pairs: list[Any], name: Any, return_names: bool, return_data: bool
) -> Any:
    """The nearest of some pairs of (name, body). Pairs whose boxes are farther apart than the best are left out."""
    boxes: dict[Body, tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]] = {}

    def box(body: Body) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        if body not in boxes:
            positions = manager._scene.positions(body).astype(np.float64)
            boxes[body] = (positions.min(0), positions.max(0))
        return boxes[body]

    def gap(pair: Any) -> float:
        (_, a), (_, b) = pair
        if not (manager._scene.n_vertices(a) and manager._scene.n_vertices(b)):
            return np.inf
        (low_a, high_a), (low_b, high_b) = box(a), box(b)
        gaps = np.maximum(np.maximum(low_a - high_b, low_b - high_a), 0)
        # Below the true distance of the boxes, whatever was rounded.
        return float(np.sqrt((gaps**2).sum())) * (1 - 1e-12)

    best: Any = None
    for near, _, pair in sorted((gap(pair), ix, pair) for ix, pair in enumerate(pairs)):
        if best is not None and near > best[0].distance:
            break
        (_, a), (_, b) = pair
        nearest = manager._distances.between(manager._scene, a, b)
        if nearest is not None and (best is None or nearest.distance < best[0].distance):
            best = (nearest, pair)
    if best is None:
        parts: list[Any] = [float("inf"), None, None]
    else:
        nearest, ((a, _), (b, _)) = best
        parts = [nearest.distance, name(a, b), DistanceData((a, b), nearest)]
    chosen = [parts[0]]
    chosen += [parts[1]] if return_names else []
    chosen += [parts[2]] if return_data else []
    return chosen[0] if len(chosen) == 1 else tuple(chosen)
