"""Bodies by name: `impinge.CollisionManager`, as users of trimesh and FCL know it."""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable, Iterator, Sequence
from copy import copy
from functools import cached_property
from itertools import count
from typing import Any, NamedTuple
from weakref import ref

import numpy as np
import numpy.typing as npt

from ._answers import Pairs
from ._detector import Detector
from ._errors import InvalidError
from ._functions import Settings
from ._impinge import Body, Contacts
from ._scene import Scene

__all__ = ["CollisionManager", "ContactData", "DistanceData", "scene_to_collision"]

_Array = Any
_Name = Hashable
_Vector = npt.NDArray[np.float64]


class _OfTwo:
    """What is said of two objects, by their names."""

    def __init__(self, pair: tuple[_Name, _Name], indices: tuple[int, int]) -> None:
        self.pair, self.indices = pair, indices
        self.names = set(pair)

    def index(self, name: _Name) -> int:
        """The face of the object of this name. Where both objects have it, an error says so: `indices` has both."""
        return self.indices[self._side(name, "indices")]

    def _side(self, name: _Name, both: str) -> int:
        if name not in self.names:
            raise KeyError(name)
        if len(self.names) == 1:
            raise InvalidError(f"name: both objects are called {name!r}: take {both}[0] and {both}[1]")
        return self.pair.index(name)

    def _faces(self) -> str:
        return ", ".join(f"{name!r}: {index}" for name, index in zip(self.pair, self.indices))


class ContactData(_OfTwo):
    """A contact of two objects.

    Attributes
    ----------
    names : set
        The names of the two objects: one name, where those of two managers have the same.
    pair : tuple of two names
        First the object that was added first, or is of this manager.
    indices : tuple of two ints
        The face of each object, in the order of `pair`.
    point : numpy.ndarray, shape (3,)
        Where they meet.
    normal : numpy.ndarray, shape (3,)
        The unit direction from the first object of `pair` to the second: pushed apart along it, they overlap less.
    depth : float
        Of two convex objects, how far they must be pushed. Of others, the extent of a region of the overlap along the normal:
        pushed that far, they may still overlap. 0 if it is unknown.
    """

    def __init__(
        self,
        pair: tuple[_Name, _Name],
        indices: tuple[int, int],
        point: _Vector,
        normal: _Vector,
        depth: float,
    ) -> None:
        super().__init__(pair, indices)
        self.point, self.normal, self.depth = point, normal, depth

    def __repr__(self) -> str:
        return f"ContactData({{{self._faces()}}}, depth={self.depth:.3g})"


class DistanceData(_OfTwo):
    """The nearest faces of two objects.

    Attributes
    ----------
    names : set
        The names of the two objects: one name, where those of two managers have the same.
    pair : tuple of two names
        First the object that was added first, or is of this manager.
    indices : tuple of two ints
        The face of each object, in the order of `pair`.
    points : tuple of two numpy.ndarray, shape (3,)
        The point of each object that `point` gives, in the order of `pair`.
    distance : float
        0 or less if and only if they share a point, or are nearer than the smallest float; less where they overlap and it is known by
        how much.
    """

    def __init__(
        self,
        pair: tuple[_Name, _Name],
        indices: tuple[int, int],
        distance: float,
        points: tuple[_Vector, _Vector],
    ) -> None:
        super().__init__(pair, indices)
        self.distance, self.points = distance, points

    def point(self, name: _Name) -> _Vector:
        """The point of this object that is nearest to the other, or deepest in it; where it is unknown how deep, a point that both share.
        Where both objects have the name, an error says so: `points` has both."""
        return self.points[self._side(name, "points")]

    def __repr__(self) -> str:
        return f"DistanceData({self.distance}, {{{self._faces()}}})"


class _Object(NamedTuple):
    """An object of a manager. Its stamps change when it gets another mesh, and when it is moved."""

    body: Body
    transform: _Array | None
    mesh_stamp: int
    stamp: int


_new_stamp = count(1).__next__


class CollisionManager:
    """Rigid objects by name, and which of them collide. The methods are those of ``trimesh.collision.CollisionManager``.

    Two objects collide if and only if two of their faces share a point where their moved vertices are, touching
    included. Faces are surfaces: an object that lies wholly inside another one, without touching it, does not collide with it, and its
    distance is that to the other's faces. trimesh 5.2 hands convex meshes to FCL as solids, so that whatever lies within one collides
    with it. `impinge.contains`, asked about a vertex of the inner object, tells; so does `Detector.penetration`.

    Managers copy and pickle with their settings and all objects, and copies are independent of each other: each process, or each
    thread, may have one. A forked process may go on with those of its parent.

    How deep objects overlap: of two convex ones the shortest way that takes them apart, as FCL has it; of other closed ones how
    far their deepest region of contact extends along its normal. Where neighbouring faces of an object turn different ways, it is
    unknown: `impinge.fix` orients them.

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
        for name in settings:
            if name not in Settings.__annotations__:
                allowed = ", ".join(Settings.__annotations__)
                raise TypeError(f"CollisionManager: {name!r} is no setting of a Detector: {allowed} are")
        self._settings = settings
        self._objects: dict[_Name, _Object] = {}
        #: Changes with any object.
        self._stamp = _new_stamp()
        self._own = _Asked(settings)
        #: With the objects of the manager that was asked about last.
        self._joint: _Joint | None = None

    @property
    def names(self) -> list[_Name]:
        """list : the names of all objects, in the order in which they were added."""
        return list(self._objects)

    def __len__(self) -> int:
        return len(self._objects)

    def __contains__(self, name: object) -> bool:
        return name in self._objects

    def __getstate__(self) -> dict[str, Any]:
        """What copies and pickles are made of: the settings, a scene of their own, and the number and transform of each object."""
        state = dict(vars(self))
        for of_this_one in ("_own", "_joint", "_stamp"):
            del state[of_this_one]
        state["_settings"] = dict(self._settings)
        state["_scene"] = copy(self._own.scene)
        state["_objects"] = [(name, int(held.body), held.transform) for name, held in self._objects.items()]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        state = dict(state)
        scene, objects = state.pop("_scene"), state.pop("_objects")
        CollisionManager.__init__(self, **state["_settings"])
        vars(self).update(state)
        self._own.scene = scene
        bodies = {int(body): body for body in scene.bodies}
        for name, number, matrix in objects:
            self._own.name(name, bodies[number])
            stamp = _new_stamp()
            self._objects[name] = _Object(bodies[number], matrix, stamp, stamp)

    def __repr__(self) -> str:
        return f"CollisionManager({len(self)} objects)"

    def add_object(self, name: _Name, mesh: Any, transform: _Array | None = None) -> None:
        """Adds an object.

        Parameters
        ----------
        name : hashable
            By which it is known from now on. An object that has the name already is replaced.
        mesh
            Anything that `Scene.add` takes by itself, such as a trimesh, or a pair of vertices and faces, as a tuple or a list, with a
            kind behind them where `Scene.add` needs one.
        transform : array_like, shape (4, 4), optional
            Where it is, as for `Scene.set_transform`.

        Raises
        ------
        ValueError, TypeError
            As `Scene.add` and `Scene.set_transform`, or a name that is not hashable; nothing is changed then.
        """
        try:
            hash(name)
        except TypeError:
            raise TypeError(f"name: something hashable expected, {type(name).__name__} given") from None
        # It is kept, and the caller may go on to write to it.
        matrix = None if transform is None else np.array(transform)
        body = self._own.add(name, mesh, matrix)
        if name in self._objects:
            self.remove_object(name)
        self._stamp = _new_stamp()
        self._objects[name] = _Object(body, matrix, self._stamp, self._stamp)

    def remove_object(self, name: _Name) -> None:
        """Removes an object.

        Raises
        ------
        ValueError
            No object has the name.
        """
        self._own.remove(self._body(name))
        del self._objects[name]
        self._stamp = _new_stamp()

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
        matrix = np.array(transform)
        self._own.scene.set_transform(self._body(name), matrix)
        self._stamp = _new_stamp()
        self._objects[name] = self._objects[name]._replace(transform=matrix, stamp=self._stamp)

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
            Pairs of objects that collide, each sorted. With `return_names`.
        list of ContactData
            Of two convex objects the deepest contact, of others all pairs of faces that share a point. With `return_data`.
        """
        return self._own.collisions(None, _sorted, return_names, return_data)

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
            As of `in_collision_internal`. The mesh goes by the name ``"__external"``, and is the second of each `pair`. With `return_data`.
        """
        guest = self._own.add("__external", mesh, transform)
        try:
            return self._own.collisions(guest, lambda a, _: a, return_names, return_data)
        finally:
            self._own.remove(guest)

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
            As of `in_collision_internal`. With `return_data`.
        """
        return self._with(other_manager).collisions(None, _both, return_names, return_data)

    def min_distance_internal(
        self, name: _Name | None = None, return_names: bool = False, return_data: bool = False
    ) -> Any:
        """The smallest distance of any two objects; infinite where there are fewer than two.

        Parameters
        ----------
        name : hashable, optional
            Only the distances of this object to the others.
        return_names, return_data : bool
            What is returned besides.

        Returns
        -------
        float
            Less than 0 where objects overlap and it is known by how much: of those that overlap the most.
        (name, name)
            Sorted. With `return_names`.
        DistanceData
            With `return_data`.
        """
        body = None if name is None else self._body(name)
        return self._own.distance(body, _sorted, return_names, return_data)

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
            Less than 0 where they overlap and it is known by how much: of those that overlap the most.
        name
            Of the nearest object. With `return_name`.
        DistanceData
            The mesh goes by the name ``"__external"``, and is the second of the `pair`. With `return_data`.
        """
        guest = self._own.add("__external", mesh, transform)
        try:
            return self._own.distance(guest, lambda a, _: a, return_name, return_data)
        finally:
            self._own.remove(guest)

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
            Less than 0 where they overlap and it is known by how much: of those that overlap the most.
        (name, name)
            Of this manager and of the other. With `return_names`.
        DistanceData
            With `return_data`.
        """
        return self._with(other_manager).distance(None, _both, return_names, return_data)

    def _body(self, name: _Name) -> Body:
        try:
            return self._objects[name].body
        except KeyError:
            raise InvalidError(f"name: there is no object {name!r}") from None

    def _with(self, other: CollisionManager) -> _Asked:
        """The objects of both managers, of which pairs of one of each are asked about."""
        if not isinstance(other, CollisionManager):
            given = type(other)
            name = given.__name__ if given.__module__ == "builtins" else f"{given.__module__}.{given.__name__}"
            raise TypeError(f"other_manager: an impinge.CollisionManager expected, {name} given")
        joint = self._joint
        if joint is None or joint.other() is not other:
            joint = self._joint = _Joint(self._settings, other)
        joint.update(self, other)
        return joint


def scene_to_collision(scene: Any, **settings: Any) -> tuple[CollisionManager, dict[str, str]]:
    """A manager of all meshes of a ``trimesh.Scene``, each where its node puts it, as ``trimesh.collision.scene_to_collision``.

    Parameters
    ----------
    scene : trimesh.Scene
    **settings
        As for `Detector`.

    Returns
    -------
    manager : CollisionManager
        One object per node that has a geometry, by the name of the node.
    objects : dict
        For each of these names that of its geometry: ``scene.geometry[objects[name]]`` is the mesh. trimesh has objects of FCL there.

    Raises
    ------
    ValueError, TypeError
        As `CollisionManager.add_object`, and what is no scene of trimesh.

    Examples
    --------
    >>> import impinge
    >>> try:
    ...     impinge.scene_to_collision([])
    ... except TypeError as error:
    ...     print(error)
    scene: a trimesh.Scene expected, list given
    """
    try:
        nodes, geometry = scene.graph.nodes_geometry, scene.geometry
    except AttributeError:
        raise TypeError(f"scene: a trimesh.Scene expected, {type(scene).__name__} given") from None
    manager = CollisionManager(**settings)
    objects: dict[str, str] = {}
    for node in nodes:
        transform, name = scene.graph[node]
        manager.add_object(node, geometry[name], transform)
        objects[node] = name
    return manager, objects


#: Detectors of the processes that this one was forked from: what they had there cannot be ended here.
_OF_PARENTS: list[Detector] = []


class _Asked:
    """Named bodies in a scene, and the detector that is asked about them."""

    def __init__(self, settings: dict[str, Any]) -> None:
        self.scene = Scene()
        self._settings = settings
        self._detector = Detector(**settings)
        self._process = os.getpid()
        #: By the numbers of bodies: their names, and which of two comes first.
        self._names: dict[int, _Name] = {}
        self._order: dict[int, int] = {}
        self._convex: dict[int, bool] = {}

    @property
    def detector(self) -> Detector:
        """The detector of this process."""
        if self._process != os.getpid():
            # Threads and a GPU do not survive a fork.
            _OF_PARENTS.append(self._detector)
            self._detector, self._process = Detector(**self._settings), os.getpid()
        return self._detector

    def add(self, name: _Name, mesh: Any, transform: _Array | None, after: int = 0) -> Body:
        """Adds a body that comes after those that are there, and by `after` later."""
        scene = self.scene
        body = scene.add(*_arrays(mesh))
        if transform is not None:
            try:
                scene.set_transform(body, transform)
            except BaseException:
                scene.remove(body)
                raise
        self.name(name, body, after)
        return body

    def name(self, name: _Name, body: Body, after: int = 0) -> None:
        """Names a body of the scene; it comes after those that are named, and by `after` later."""
        self._names[int(body)] = name
        self._order[int(body)] = after + _new_stamp()

    def remove(self, body: Body) -> None:
        self.scene.remove(body)
        for held in (self._names, self._order, self._convex):
            held.pop(int(body), None)

    def _sides(self, a: int, b: int, across: Body | None) -> tuple[_Name, _Name, bool]:
        """Names two bodies by their numbers, and says whether they come in the other order: the body `across` which is asked
        comes last, else that which was added later."""
        swapped = a == int(across) if across is not None else self._order[a] > self._order[b]
        first, second = (b, a) if swapped else (a, b)
        return self._names[first], self._names[second], swapped

    def collisions(
        self,
        across: Body | None,
        name: Callable[[_Name, _Name], Any],
        return_names: bool,
        return_data: bool,
    ) -> Any:
        asked = _asked(across)
        if not (return_names or return_data):
            return self.detector._any(self.scene, asked)
        pairs = Pairs(self.detector._detect(self.scene, asked))
        parts: list[Any] = [len(pairs) > 0]
        touching = _Touching(self.detector, self.scene, pairs)
        rows = touching.rows
        both, of_row, counts = np.unique(
            rows[:, [0, 2]], axis=0, return_inverse=True, return_counts=True
        )
        if return_names:
            parts.append({name(*self._sides(a, b, across)[:2]) for a, b in both.tolist()})
        if return_data:
            data: list[ContactData] = []
            # The rows of each pair of bodies.
            order = np.argsort(of_row.reshape(-1), kind="stable")
            groups = np.split(order, np.cumsum(counts)[:-1])
            for (a, b), own in zip(both.tolist(), groups):
                first, second, swapped = self._sides(a, b, across)
                for row, point, normal, depth in self._overlaps(touching, a, b, own):
                    faces = (int(rows[row, 1]), int(rows[row, 3]))
                    if swapped:
                        faces, normal = faces[::-1], -normal
                    data.append(ContactData((first, second), faces, point, normal, depth))
            parts.append(data)
        return _answer(parts)

    def _overlaps(
        self, touching: _Touching, a: int, b: int, rows: npt.NDArray[np.intp]
    ) -> Iterator[tuple[int, _Vector, _Vector, float]]:
        """Of two bodies: a row of the pairs, the point, the normal from the first body to the second, the depth."""
        if self._is_convex(a) and self._is_convex(b):
            found = self._convex_overlap(a, b)
            if found is not None:
                depth, normal, deepest = found
                yield int(rows[0]), deepest - 0.5 * depth * normal, normal, depth
                return
        contacts, points = touching.contacts, touching.points
        try:
            regions = self.detector.penetration(self.scene, contacts, a, b).regions()
        except (ValueError, TypeError):
            # Not closed, or not made of triangles.
            regions = touching.surfaces.get((a, b), [])
        known = {}
        for region in regions:
            for contact in region["contacts"].tolist():
                known[contact] = (region["normal"], region.get("depth"))
        for row in rows.tolist():
            # A region's normal is the way of the first body.
            way, far = known.get(row, (None, None))
            if way is None:
                way = _normal(touching.corners(b, touching.rows[row, 3]))
            yield row, points[row], -way, 0.0 if far is None else far

    def distance(
        self,
        across: Body | None,
        name: Callable[[_Name, _Name], Any],
        return_names: bool,
        return_data: bool,
    ) -> Any:
        nearest = self.detector.nearest(self.scene, across=None if across is None else [across])
        if nearest is None:
            parts: list[Any] = [float("inf"), None, None]
        else:
            found = _Found(
                nearest.distance,
                (int(nearest.body_a), int(nearest.body_b)),
                (nearest.element_a, nearest.element_b),
                tuple(nearest.points),
            )
            if found.distance == 0:
                found = self._deepest(found, across)
            first, second, swapped = self._sides(*found.bodies, across)
            elements, ends = found.elements, found.ends
            if swapped:
                elements, ends = elements[::-1], ends[::-1]
            data = DistanceData((first, second), elements, found.distance, ends)
            parts = [found.distance, name(first, second), data]
        wanted = [True, return_names, return_data]
        return _answer([part for part, is_wanted in zip(parts, wanted) if is_wanted])

    def _deepest(self, touching: _Found, across: Body | None) -> _Found:
        """Of all pairs of bodies that share a point the one that overlaps the most. `touching` is one of them: the answer, where
        no depth is known."""
        pairs = Pairs(self.detector._detect(self.scene, _asked(across)))
        rows, where = pairs.rows, _Touching(self.detector, self.scene, pairs)
        both, first = np.unique(rows[:, [0, 2]], axis=0, return_index=True)
        deepest = touching
        for (a, b), row in zip(both.tolist(), first.tolist()):
            distance, ends = self._depth(where, a, b)
            if distance < deepest.distance:
                elements = int(rows[row, 1]), int(rows[row, 3])
                deepest = _Found(distance, (a, b), elements, ends)
        return deepest

    def _depth(self, touching: _Touching, a: int, b: int) -> tuple[float, Any]:
        """The distance of two bodies that share a point, less than 0 where they overlap, and the deepest points."""
        if self._is_convex(a) and self._is_convex(b):
            found = self._convex_overlap(a, b)
            if found is None:
                return 0.0, None
            depth, normal, deepest = found
            return (-depth if depth else 0.0), (deepest, deepest - depth * normal)
        try:
            regions = self.detector.penetration(self.scene, touching.contacts, a, b).regions()
        except (ValueError, TypeError):
            return 0.0, None
        deep = [region for region in regions if region["depth"]]
        if not deep:
            return 0.0, None
        region = max(deep, key=lambda region: float(region["depth"]))
        way = 0.5 * region["depth"] * region["normal"]
        return -region["depth"], (region["position"] - way, region["position"] + way)

    def _convex_overlap(self, a: int, b: int) -> tuple[float, _Vector, _Vector] | None:
        """Depth, normal from the first body to the second, the deepest vertex of the first."""
        found = self.scene._convex_overlap(a, b)
        if found is None:
            return None
        depth, normal, deepest = found
        return depth, np.array(normal), np.array(deepest)

    def _is_convex(self, number: int) -> bool:
        known = self._convex.get(number)
        if known is None:
            scene = self.scene
            # At rest: far from the origin moved positions are rounded so much that faces are flat no longer.
            known = scene.kind(number) == "triangles" and _is_convex(
                scene.rest_positions(number), scene.elements(number)
            )
            self._convex[number] = known
        return known


class _Found(NamedTuple):
    """Two bodies, how far they are apart, which of their elements, and where."""

    distance: float
    bodies: tuple[int, int]
    elements: tuple[int, int]
    ends: Any


def _asked(across: Body | None) -> dict[str, Any]:
    """Asks for all pairs of bodies, or for those of one."""
    return {"which": "between"} if across is None else {"_across": [across]}


#: The objects of the other manager come after all others.
_LATER = 2**62


class _Joint(_Asked):
    """Copies of the objects of two managers. They are kept: of those that have moved, only the matrix is new."""

    def __init__(self, settings: dict[str, Any], other: CollisionManager) -> None:
        super().__init__(settings)
        self.other = ref(other)
        self._held: tuple[dict[_Name, _Object], dict[_Name, _Object]] = ({}, {})
        self._stamps = [0, 0]

    def update(self, *managers: CollisionManager) -> None:
        for side, manager in enumerate(managers):
            if self._stamps[side] == manager._stamp:
                continue
            held = self._held[side]
            for name in [name for name in held if name not in manager._objects]:
                self.remove(held.pop(name).body)
            for name, given in manager._objects.items():
                mine = held.get(name)
                if mine is not None and mine.stamp == given.stamp:
                    continue
                if mine is not None and mine.mesh_stamp == given.mesh_stamp:
                    self.scene.set_transform(mine.body, given.transform)
                    held[name] = given._replace(body=mine.body)
                    continue
                if mine is not None:
                    self.remove(held.pop(name).body)
                scene, body = manager._own.scene, given.body
                mesh = (scene.rest_positions(body), scene.elements(body), scene.kind(body))
                added = self.add(name, mesh, given.transform, after=side * _LATER)
                # Objects meet those of the other manager alone.
                self.scene.set_filter(added, category=1 + side, mask=2 - side)
                held[name] = given._replace(body=added)
            self._stamps[side] = manager._stamp


class _Touching:
    """Where pairs meet. It is found when it is first asked for: convex bodies need none of it."""

    def __init__(self, detector: Detector, scene: Scene, pairs: Pairs) -> None:
        self._detector, self._scene, self._pairs = detector, scene, pairs
        #: Those of the contacts, too.
        self.rows = pairs.rows
        #: Positions and elements, by the numbers of bodies: copies, too.
        self._meshes: dict[int, tuple[_Array, npt.NDArray[np.uint32]]] = {}

    @cached_property
    def contacts(self) -> Contacts:
        return self._detector.contacts(self._scene, self._pairs)

    @cached_property
    def points(self) -> _Vector:
        """The middle of each contact's corners; of a contact without corners, that of the first element's corners."""
        contacts = self.contacts
        starts = contacts.starts.astype(np.intp)
        counts = np.diff(starts)
        sums = np.zeros((len(counts), 3))
        of_corner = np.repeat(np.arange(len(counts)), counts)
        np.add.at(sums, of_corner, contacts.points[contacts.corners])
        middles: _Vector = sums / np.maximum(counts, 1)[:, None]
        for row in np.flatnonzero(counts == 0).tolist():
            a, element = self.rows[row, :2].tolist()
            middles[row] = self.corners(a, element).mean(0)
        return middles

    @cached_property
    def surfaces(self) -> dict[tuple[int, int], list[dict[str, Any]]]:
        """The regions of bodies without an inside, by bodies."""
        surfaces: dict[tuple[int, int], list[dict[str, Any]]] = {}
        for region in self.contacts.regions():
            surfaces.setdefault(region["bodies"], []).append(region)
        return surfaces

    def corners(self, body: int, element: int) -> _Array:
        """The positions of an element's corners."""
        mesh = self._meshes.get(body)
        if mesh is None:
            mesh = self._scene.positions(body), self._scene.elements(body)
            self._meshes[body] = mesh
        positions, elements = mesh
        return positions[elements[element]]


def _arrays(mesh: Any) -> Sequence[Any]:
    """A mesh as the arguments of `Scene.add`."""
    if not isinstance(mesh, (tuple, list)):
        return (mesh,)
    if len(mesh) not in (2, 3):
        given = type(mesh).__name__
        raise TypeError(f"mesh: a pair of vertices and faces expected, perhaps with a kind, a {given} of {len(mesh)} given")
    return mesh


def _answer(parts: list[Any]) -> Any:
    """What a method returns: its one part, or all as a tuple."""
    return parts[0] if len(parts) == 1 else tuple(parts)


def _both(a: _Name, b: _Name) -> tuple[_Name, _Name]:
    return a, b


def _sorted(a: _Name, b: _Name) -> tuple[_Name, _Name]:
    """Two names in their order; of names that have none, by their text."""
    try:
        return (a, b) if a <= b else (b, a)  # type: ignore[operator]
    except TypeError:
        return (a, b) if repr(a) <= repr(b) else (b, a)


def _normal(corners: _Array) -> _Vector:
    """The unit normal of a triangle; zeros if it is degenerate or something else."""
    corners = np.asarray(corners, np.float64)
    normal = (
        np.cross(corners[1] - corners[0], corners[2] - corners[0])
        if len(corners) > 2
        else np.zeros(3)
    )
    length = np.linalg.norm(normal)
    return normal / length if length > 0 else normal


def _turns(p: _Vector, q: _Vector, r: _Vector) -> float:
    """How often triangles go around the origin, by their solid angles (Van Oosterom and Strackee 1983); 0 if all are in one plane
    with it. Each edge of a star that goes around twice bends outwards, too."""
    volumes = np.einsum("ij,ij->i", p, np.cross(q, r))
    if np.abs(volumes).max() < 1e-12:
        return 0.0
    a, b, c = (np.linalg.norm(x, axis=1) for x in (p, q, r))
    pq, qr, rp = (np.einsum("ij,ij->i", x, y) for x, y in ((p, q), (q, r), (r, p)))
    return abs(float(np.arctan2(volumes, a * b * c + pq * c + qr * a + rp * b).sum())) / (2 * np.pi)


#: How far vertices of convex bodies may stand out of faces, as a part of their size: those of files are rounded.
_FLAT = 1e-6


def _is_convex(vertices: _Array, faces: npt.NDArray[np.uint32]) -> bool:
    """Whether triangles are one closed surface of all vertices, faces of which turn one way and bend outwards at each edge."""
    n_sides = 3 * len(faces)
    if len(faces) < 4 or n_sides % 2:
        return False
    ways = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    sides = np.sort(ways, axis=1)
    order = np.lexsort(sides.T)
    sides = sides[order]
    first, second = sides[::2], sides[1::2]
    if (first != second).any() or (first[1:] == first[:-1]).all(1).any():
        return False
    # Neighbours that turn the same way run along their edge in opposite ones.
    ways = ways[order]
    if (ways[::2] == ways[1::2]).any():
        return False
    if len(np.unique(faces)) != len(vertices) or len(vertices) - n_sides // 2 + len(faces) != 2:
        return False
    points = np.asarray(vertices, np.float64)
    # Around the origin and of size 1: squares of very large or small numbers are none.
    points = points - (0.5 * points.min(0) + 0.5 * points.max(0))
    size = np.abs(points).max()
    if not 0 < size < np.inf:
        return False
    points = points / size
    points -= points.mean(0)
    corners = points[faces]
    p, q, r = corners.transpose(1, 0, 2)
    normals = np.cross(q - p, r - p)
    if np.einsum("ij,ij->", p, normals) < 0:
        normals = -normals
    if _turns(p, q, r) > 1.5:
        return False
    lengths = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(lengths, np.finfo(float).tiny)[:, None]
    one, other = order[::2] // 3, order[1::2] // 3
    flat = _FLAT * np.ptp(points, axis=0).max()
    heights = np.einsum("ijk,ik->ij", corners[other] - p[one][:, None], normals[one])
    if heights.max() > flat:
        return False
    # A face without area, but for rounding, says nothing of the edge between the faces on its sides: these are compared with all
    # vertices.
    longest = np.square(corners - corners[:, [1, 2, 0]]).sum(2).max(1)
    empty = lengths <= _FLAT * longest
    beside = np.concatenate([one[empty[other]], other[empty[one]]])
    return all(((points - p[face]) @ normals[face]).max() <= flat for face in np.unique(beside).tolist())
