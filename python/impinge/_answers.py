"""Answers: sorted, the same bytes on every method, backend and thread count. They own their data."""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, NoReturn, SupportsIndex, overload

import numpy as np
import numpy.typing as npt

from . import _impinge
from ._errors import InvalidError

if TYPE_CHECKING:
    from ._impinge import Body
    from ._query import _Array, _Body, _PairKind
    from ._scene import Scene

__all__ = [
    "Advance",
    "Candidates",
    "Changes",
    "Closest",
    "Csr",
    "Hits",
    "Impact",
    "Impacts",
    "Nearest",
    "NearPairs",
    "Neighbours",
    "Pairs",
    "SafeDistances",
    "Stats",
    "Stencils",
    "Truncation",
]


@dataclass(frozen=True, repr=False)
class Stats:
    """What a question cost and what it went through. The answer never depends on any of this.

    Attributes
    ----------
    backend : str
        ``"cpu"`` or the name of the GPU.
    method : str
        ``"clusters"``, ``"cells"`` or ``"naive"``.
    n_threads : int
        Threads that worked.
    stages : dict of str to float
        Wall time in milliseconds by stage, in the order of their first run.
    total_ms : float
        Wall time of the whole question in milliseconds.
    grid : tuple of three int, or None
        ``"cells"``: cells of the first level along x, y and z.
    n_subdivided : int
        ``"cells"``: cells that went through the second level.
    n_entries : int
        ``"cells"``: entries of the cell lists, an element counted once a cell.
    n_clusters : int
        ``"clusters"``: clusters of all bodies that took part.
    n_culled : int
        ``"clusters"`` on the CPU: those proven to lie beside all other bodies, whose boxes were not needed.
    n_work_items : int
        Pairs of groups that were paired.
    n_candidates : int
        Pairs of elements whose boxes overlap and that the adjacency rule lets through.
    n_unsure : int
        Candidates that the floating-point filter left to exact arithmetic.
    n_clustered : int
        Bodies that were clustered in this frame, the first time included.
    n_reclustered : int
        Of those, bodies clustered again because they had flowed away from their rest pose.
    n_batches : int
        Runs over parts of the work; 1 when the memory budget allowed for all at once.
    n_pieces : int
        GPU: pieces that a scene was cut into because the device or the budget could not hold it whole; 0 if it was not.
    n_reruns : int
        Stages that were run again because a buffer had to grow.
    bytes_held : int
        Bytes that the detector holds, the answer not counted.
    """

    backend: str
    method: str
    n_threads: int
    stages: dict[str, float]
    total_ms: float
    grid: tuple[int, int, int] | None
    n_subdivided: int
    n_entries: int
    n_clusters: int
    n_culled: int
    n_work_items: int
    n_candidates: int
    n_unsure: int
    n_clustered: int
    n_reclustered: int
    n_batches: int
    n_pieces: int
    n_reruns: int
    bytes_held: int

    @property
    def unsure_share(self) -> float:
        """float : ``n_unsure`` by ``n_candidates``; 0 without candidates."""
        return self.n_unsure / self.n_candidates if self.n_candidates else 0.0

    def as_dict(self) -> dict[str, Any]:
        """All of it as a dictionary, ready for ``json.dump``.

        Returns
        -------
        dict
        """
        return {**asdict(self), "unsure_share": self.unsure_share}

    def __repr__(self) -> str:
        stages = ", ".join(f"{name} {ms:.3f}" for name, ms in self.stages.items())
        counts = f"{self.n_candidates} candidates, {self.n_unsure} unsure"
        where = f"{self.method!r} on {self.backend!r}"
        return f"Stats({self.total_ms:.3f} ms by {where}: {stages}; {counts})"


class Impact(NamedTuple):
    """Two elements that touch during a step, and when first.

    `kind` is ``"vf"`` (a vertex and a face), ``"ee"`` (two edges), ``"ev"`` (an edge and a vertex) or ``"vv"`` (two
    vertices); its first letter is the element of `body_a`. `toi` is the first time in [0, 1] at which they touch, rounded down;
    `at_start` says whether that is the start.
    """

    kind: _PairKind
    body_a: Body
    element_a: int
    body_b: Body
    element_b: int
    toi: float
    at_start: bool

    def __copy__(self) -> Impact:
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError("an Impact names bodies of a live scene: pickle its numbers, such as int(impact.body_a)")


class Nearest(NamedTuple):
    """The pair of elements of two bodies that are nearest to each other.

    `distance` is in the unit of the scene, rounded down: the largest float that is not above the true one. It is 0 if and only if they
    share a point, which is decided exactly, or are nearer than the smallest float. `points` is an array of float64, shape (2, 3): the point of
    each element that is nearest to the other, rounded; where they touch, a point that they share, twice. Of several pairs at the same
    distance, rounded down, the lowest.
    """

    distance: float
    body_a: Body
    element_a: int
    body_b: Body
    element_b: int
    points: npt.NDArray[np.float64]

    def __copy__(self) -> Nearest:
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError("a Nearest names bodies of a live scene: pickle its numbers, such as int(nearest.body_a)")


def _locked(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    array.flags.writeable = False
    return array


class Changes(NamedTuple):
    """The pairs of an answer beside those of an older one. All indices ascend, and fit NumPy: what a solver keeps per pair
    (multipliers, anchors of friction, a warm start) moves by ``moved[kept[:, 1]] = values[kept[:, 0]]``.

    Attributes
    ----------
    kept : numpy.ndarray of int64, shape (n, 2)
        Of each pair that is in both answers its index in the old one and in the new one.
    new : numpy.ndarray of int64, shape (n,)
        Indices in the new answer.
    gone : numpy.ndarray of int64, shape (n,)
        Indices in the old answer.
    """

    kept: npt.NDArray[np.int64]
    new: npt.NDArray[np.int64]
    gone: npt.NDArray[np.int64]


def _older(old: Any, needed: type[Any]) -> Any:
    """What an older answer is made of; refuses one to another question."""
    if isinstance(old, needed):
        return old._inner
    raise TypeError(f"old: {type(old).__name__} given, {needed.__name__} needed")


def _no_index(given: str) -> TypeError:
    return TypeError(f"index: a whole number, a slice or an array of whole numbers or booleans expected, {given} given")


class _Answer:
    """What answers have in common."""

    __slots__ = ("_inner",)

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    @property
    def stats(self) -> Stats:
        """Stats : what the answer cost."""
        return Stats(**self._inner.stats())

    def __reduce__(self) -> NoReturn:
        name = type(self).__name__
        raise TypeError(f"{name} name bodies of a live scene: pickle their arrays")


class _Rows(_Answer):
    """What answers with rows have in common. ``len`` is their number."""

    __slots__ = ("_rows",)

    def __init__(self, inner: Any) -> None:
        super().__init__(inner)
        self._rows: npt.NDArray[np.uint32] | None = None

    def __len__(self) -> int:
        return len(self._inner)


class Pairs(_Rows):
    """The pairs of elements that intersect: sorted.

    ``len(pairs)`` is their number; no pairs are false. Pairs are a sequence of rows, each a tuple of four int: number of a body, its
    element, number of the other body, its element. A slice is an array, and so are the rows that an array of whole numbers or of
    booleans chooses, and ``numpy.asarray(pairs)``, which has shape (n, 4).
    """

    __slots__ = ("_hash",)
    _inner: _impinge.Pairs

    def __init__(self, inner: _impinge.Pairs) -> None:
        super().__init__(inner)
        self._hash: int | None = None

    @property
    def rows(self) -> npt.NDArray[np.uint32]:
        """numpy.ndarray of uint32, shape (n, 4) : all pairs, sorted, one per row: number of a body, its element, number of the other
        body, its element. Read-only, and made once.
        """
        if self._rows is None:
            self._rows = _locked(self._inner.rows())
        return self._rows

    def changes(self, old: Pairs) -> Changes:
        """Which pairs an older answer also has, which are new, and which are gone.

        Two pairs are the same if their bodies and elements are. Pairs of a body that was removed and of one that has its number now
        differ.

        Parameters
        ----------
        old : Pairs
            Of the same scene or a copy of it.

        Returns
        -------
        Changes

        Raises
        ------
        TypeError
            An answer to another question.
        ValueError
            An answer about another scene; or both have pairs of a body that was re-meshed between them.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> rods = scene.add_edges([[1, 1, -1], [1, 1, 1], [2, 1, 3], [2, 1, 5]], [[0, 1], [2, 3]])
        >>> detector = impinge.Detector("cpu")
        >>> before = detector.detect(scene)
        >>> scene.set_positions(rods, [[1, 1, -1], [1, 1, 1], [2, 1, -1], [2, 1, 1]])
        >>> after = detector.detect(scene)
        >>> kept, new, gone = after.changes(before)
        >>> kept.tolist(), new.tolist(), gone.tolist()
        ([[0, 0]], [1], [])
        """
        return Changes(*self._inner.changes(_older(old, Pairs)))

    def between(self, a: _Body, b: _Body) -> npt.NDArray[np.uint32]:
        """The pairs of two bodies.

        Parameters
        ----------
        a, b : Body or int

        Returns
        -------
        numpy.ndarray of uint32, shape (n, 2)
            Element of `a`, element of `b`; sorted.

        Raises
        ------
        ValueError
            A body that took no part, or one named twice.
        """
        return self._inner.between(a, b)

    def self_of(self, body: _Body) -> npt.NDArray[np.uint32]:
        """The pairs of elements of one body.

        Parameters
        ----------
        body : Body or int

        Returns
        -------
        numpy.ndarray of uint32, shape (n, 2)
            The lower element first; sorted.

        Raises
        ------
        ValueError
            A body that took no part.
        """
        return self._inner.self_of(body)

    @overload
    def colliding(self, body: None = None) -> dict[Body, npt.NDArray[np.uint32]]: ...
    @overload
    def colliding(self, body: _Body) -> npt.NDArray[np.uint32]: ...
    def colliding(self, body: _Body | None = None) -> Any:
        """The elements that take part in any pair, for colouring: of a body, or of all bodies in one pass.

        Parameters
        ----------
        body : Body or int, optional

        Returns
        -------
        numpy.ndarray of uint32, shape (n,)
            Sorted, each once. Without a body, a dict with such an array for each Body that has any, in order; it is
            indexed by the numbers of bodies, too.
        """
        return self._inner.all_colliding() if body is None else self._inner.colliding(body)

    def retain(self, keep: _Array) -> Pairs:
        """The pairs that a filter of your own keeps, by body, element, vertex or anything else.

        Parameters
        ----------
        keep : array_like of bool, shape (n,)
            One per row of `rows`.

        Returns
        -------
        Pairs
            New ones; these stay as they are. `Detector.penetration` refuses contacts of two bodies without some of their
            pairs.

        Raises
        ------
        ValueError
            A mask of another shape or dtype.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> for z in (0, 1):
        ...     _ = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, z]], [[0, 1, 2], [0, 1, 3]])
        >>> pairs = impinge.Detector("cpu").detect(scene, which="between")
        >>> len(pairs), len(pairs.retain(pairs.rows[:, 1] == 0))
        (4, 2)
        """
        return Pairs(self._inner.retain(keep))

    @property
    def bodies(self) -> list[Body]:
        """list of Body : the bodies that took part, in order."""
        return self._inner.bodies()

    @property
    def hash(self) -> int:
        """int : a 64-bit hash of the set of pairs; equal sets have equal hashes everywhere."""
        if self._hash is None:
            self._hash = self._inner.hash()
        return self._hash

    # An array of one element is a SupportsIndex to type checkers, too.
    @overload
    def __getitem__(  # type: ignore[overload-overlap]
        self, index: slice | npt.NDArray[Any] | list[int] | list[bool], /
    ) -> npt.NDArray[np.uint32]: ...
    @overload
    def __getitem__(self, index: SupportsIndex, /) -> tuple[int, int, int, int]: ...
    def __getitem__(self, index: Any, /) -> Any:
        if isinstance(index, slice):
            return self.rows[index]
        if isinstance(index, list):
            index = np.array(index, None if index else np.intp)
        if hasattr(index, "__array__"):
            index = np.asarray(index)
            if index.ndim == 1 and index.dtype.kind in "biu":
                return self.rows[index]
            if index.ndim or index.dtype.kind not in "iu":
                raise _no_index(f"an array of {index.dtype} and shape {index.shape}")
        elif not hasattr(index, "__index__"):
            raise _no_index(type(index).__name__)
        if not -len(self) <= index < len(self):
            raise IndexError(f"index {index} given, but there are {len(self)} pairs")
        return tuple(self.rows[index].tolist())

    def __iter__(self) -> Iterator[tuple[int, int, int, int]]:
        for start in range(0, len(self), 4096):
            yield from map(tuple, self.rows[start : start + 4096].tolist())

    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[Any]:
        rows = self.rows
        if dtype is not None and rows.dtype != dtype:
            if copy is False:
                raise InvalidError(f"copy=False: rows are uint32, {np.dtype(dtype)} asked for")
            return rows.astype(dtype)
        return rows.copy() if copy else rows

    def __reduce__(self) -> NoReturn:
        raise TypeError("Pairs name bodies of a live scene: pickle pairs.rows")

    def __repr__(self) -> str:
        n_bodies = len(self._inner.bodies())
        return f"Pairs({len(self)} pairs of {n_bodies} bodies, hash {self.hash:#018x})"


class _OfKinds(_Rows):
    """What answers about pairs of several kinds have in common."""

    __slots__ = ("_kinds",)

    def __init__(self, inner: Any) -> None:
        super().__init__(inner)
        self._kinds: npt.NDArray[np.uint8] | None = None

    @property
    def rows(self) -> npt.NDArray[np.uint32]:
        """numpy.ndarray of uint32, shape (n, 4) : number of a body, its element, number of the other body, its element. The element that
        the kind names first comes first. Read-only, and made once.

        A vertex is numbered as positions are, a face as it was given (of tetrahedra as in `Scene.faces`), an edge as in `Scene.edges`.
        """
        if self._rows is None:
            self._rows = _locked(self._inner.rows())
        return self._rows

    @property
    def kinds(self) -> npt.NDArray[np.uint8]:
        """numpy.ndarray of uint8, shape (n,) : what the pairs are, as an index of `impinge.KINDS`: ``"vf"`` (a vertex and a face),
        ``"ee"`` (two edges), ``"ev"`` (an edge and a vertex), ``"vv"`` (two vertices), ``"ef"`` (an edge and a face) or ``"ff"`` (two
        faces). Read-only, and made once.
        """
        if self._kinds is None:
            self._kinds = _locked(self._inner.kinds())
        return self._kinds

    @property
    def hash(self) -> int:
        """int : a 64-bit hash of the set, all that was decided of its pairs included; equal sets have equal hashes everywhere."""
        value: int = self._inner.hash()
        return value

    def __repr__(self) -> str:
        counts = np.bincount(self.kinds, minlength=len(_impinge.KINDS)).tolist()
        named = [f"{kind}: {n}" for kind, n in zip(_impinge.KINDS, counts) if n]
        return f"{type(self).__name__}({', '.join(named)})"


class Impacts(_OfKinds):
    """The pairs of elements that touch during a step, sorted by kind, then by bodies and elements.

    ``len(impacts)`` is their number; impacts of a free step are false. They are indexed and iterated as `Impact`, and taken as arrays
    by the attributes, one row per impact.
    """

    __slots__ = ()
    _inner: _impinge.Impacts

    @property
    def toi(self) -> npt.NDArray[np.floating[Any]]:
        """numpy.ndarray of float32, or float64 after ``precision="f64"``, shape (n,) : first times in [0, 1], each rounded down."""
        return self._inner.toi()

    @property
    def at_start(self) -> npt.NDArray[np.bool_]:
        """numpy.ndarray of bool, shape (n,) : which touch at the start, at time 0."""
        return self._inner.at_start()

    @property
    def start_intersects(self) -> bool | None:
        """bool or None : whether elements intersect at the start of the step; ``None`` if nobody asked, which only
        ``start="verify"`` does.
        """
        return self._inner.start_intersects()

    def changes(self, old: Impacts) -> Changes:
        """Which pairs an older answer also has, which are new, and which are gone, as `Pairs.changes`.

        Two pairs are the same if their kinds, bodies and elements are, whatever their times.

        Parameters
        ----------
        old : Impacts
            Of the same scene or a copy of it. Parts (`of`) are compared as they are: beside another part, or beside all, pairs of
            other kinds are new or gone.

        Returns
        -------
        Changes

        Raises
        ------
        TypeError
            An answer to another question.
        ValueError
            An answer about another scene; or both have pairs with elements of the same sort (vertices, edges or faces) of a body
            that was re-meshed between them, or with edges of it that were set (`Scene.set_edges`).
        """
        return Changes(*self._inner.changes(_older(old, Impacts)))

    def of(self, kind: _PairKind) -> Impacts:
        """Those of one kind.

        Parameters
        ----------
        kind : {"vf", "ee", "ev", "vv", "ef", "ff"}

        Returns
        -------
        Impacts
            A part of the same answer, which is not copied.
        """
        return Impacts(self._inner.of(kind))

    def earliest(self) -> Impact | None:
        """The impact with the least time; of several, the first row.

        Returns
        -------
        Impact or None
            ``None`` where nothing touches.
        """
        first = self._inner.earliest()
        return None if first is None else Impact(*first)

    def __getitem__(self, index: SupportsIndex, /) -> Impact:
        return Impact(*self._inner[index])

    def __iter__(self) -> Iterator[Impact]:
        return (Impact(*self._inner[ix]) for ix in range(len(self)))

    def __repr__(self) -> str:
        first = self.earliest()
        if first is not None:
            return f"Impacts({len(self)}, the first at {first.toi!r})"
        is_verified = self.start_intersects is True
        return f"Impacts(0, {'the start intersects' if is_verified else 'nothing touches'})"


class NearPairs(_OfKinds):
    """The pairs of elements that are within a distance of each other, sorted by kind, then by bodies and elements.

    ``len(near)`` is their number. The attributes are arrays with one row per pair.
    """

    __slots__ = ()
    _inner: _impinge.Near

    @property
    def types(self) -> npt.NDArray[np.uint8]:
        """numpy.ndarray of uint8, shape (n,) : which features are nearest, as an index of `impinge.TYPES`, which are
        ipc-toolkit's names: ``"P_T"``, ``"P_E0"``, ``"P_T0"``, ``"EA_EB"``, ``"EA_EB0"``, ``"EA0_EB0"``, …; of an edge and
        a face, and of two faces, without numbers. Decided exactly.
        """
        return self._inner.types()

    @property
    def features(self) -> npt.NDArray[np.uint8]:
        """numpy.ndarray of uint8, shape (n, 2) : the nearest feature of either element, as an index of `impinge.FEATURES`: ``"v0"``
        to ``"v2"``, ``"e0"`` to ``"e2"`` (edge k goes from vertex k to the next) or ``"f"``.
        """
        return self._inner.features()

    @property
    def parallel(self) -> npt.NDArray[np.bool_]:
        """numpy.ndarray of bool, shape (n,) : where nearest points may not be the only ones."""
        return self._inner.parallel()

    @property
    def distances(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n,) : distances, rounded down: the largest floats that are not above the true ones. Only after
        ``distances=True`` or ``closest_points=True``.
        """
        return self._inner.distances()

    @property
    def points(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n, 2, 3) : a nearest point of either element, rounded. Only after
        ``closest_points=True``.
        """
        return self._inner.points()

    def changes(self, old: NearPairs) -> Changes:
        """Which pairs an older answer also has, which are new, and which are gone, as `Pairs.changes`.

        Two pairs are the same if their kinds, bodies and elements are, whatever their features and distances.

        Parameters
        ----------
        old : NearPairs
            Of the same scene or a copy of it. Parts (`of`) are compared as they are: beside another part, or beside all, pairs of
            other kinds are new or gone.

        Returns
        -------
        Changes

        Raises
        ------
        TypeError
            An answer to another question.
        ValueError
            An answer about another scene; or both have pairs with elements of the same sort (vertices, edges or faces) of a body
            that was re-meshed between them, or with edges of it that were set (`Scene.set_edges`).
        """
        return Changes(*self._inner.changes(_older(old, NearPairs)))

    def of(self, kind: _PairKind) -> NearPairs:
        """Those of one kind.

        Parameters
        ----------
        kind : {"vf", "ee", "ev", "vv", "ef", "ff"}

        Returns
        -------
        NearPairs
            A part of the same answer, which is not copied.
        """
        return NearPairs(self._inner.of(kind))

    def stencils(self, scene: Scene, rest: _Array | None = None, *, by_area: bool = False) -> Stencils:
        """What a potential needs to know about each pair: vertices, squared distance, gradient and Hessian.

        Parameters
        ----------
        scene : Scene
            With the positions at which distances are taken: as it was when the pairs were found, or moved since. Features are
            those that were nearest when the pairs were found.
        rest : array_like, shape (v, 3), optional
            Positions at rest of all vertices of the scene, body after body. They switch on the mollifier of nearly parallel edges,
            whose threshold depends on their lengths at rest.
        by_area : bool, default False
            Weights are areas at rest in place of numbers of pairs, as with ipc-toolkit's ``use_area_weighting``: a potential then does not
            depend on how fine a mesh is. A pair of a vertex and a face weighs a quarter of the vertex's area, of edges a quarter of both
            areas, of an edge and a vertex half of that of the vertex, of vertices half of both. To a vertex or an edge belongs a third
            of each face around it; without faces, the length of an edge, and half that of each edge at a vertex; 1 to a vertex alone.

        Returns
        -------
        Stencils
            One per pair, in the same order. A potential sums over its `Stencils.merged`.

        Raises
        ------
        ValueError, TypeError
            Pairs of kind ``"ef"`` or ``"ff"``, which have no stencil, of another scene, or of a body that was re-meshed; another
            number of positions at rest.

        Examples
        --------
        A quadratic barrier of height 1 that begins at a distance of 1, and its derivatives:

        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> drop = scene.add_points([[1, 1, 0.5]])
        >>> contacts = impinge.Detector("cpu").near(scene, 1.0).stencils(scene).merged()
        >>> contacts.vertices.tolist(), impinge.TYPES[contacts.types[0]]
        ([[3, 0, 1, 2]], 'P_T')
        >>> s = contacts.squared_distances
        >>> float((contacts.weights * (1 - s) ** 2).sum())
        0.5625
        >>> gradients = (contacts.weights * -2 * (1 - s))[:, None] * contacts.gradients
        >>> gradients.reshape(-1, 4, 3)[0, 0].tolist()             # of the point: it is pushed up
        [-0.0, -0.0, -1.5]
        """
        return Stencils(_impinge._stencils(self._inner, scene, rest, by_area))


class Stencils:
    """Up to four vertices per near pair or contact, and how their squared distance depends on their positions.

    ``len(stencils)`` is their number. The attributes are arrays with one row per stencil; each access computes new ones, on at most as
    many threads as the detector has that found the pairs. Numbers are computed in float64 in one fixed order of operations: the same bits
    on every machine.

    Vertices come in the order of ipc-toolkit: the vertex and the face's three, two of either edge, the vertex and the edge's two,
    two vertices. Where there are fewer than four, the first is repeated. Coefficients and derivatives are 0 there, so sums over all
    four are right, as of ``numpy.add.at`` and of sparse matrices.
    """

    __slots__ = ("_inner",)

    def __init__(self, inner: _impinge.Stencils) -> None:
        self._inner = inner

    def merged(self) -> Stencils:
        """One stencil per contact: features that several pairs share once, with the sum of their weights.

        A vertex above an edge is near both of its faces and to the edges beside it; these pairs become one stencil of the vertex and the
        edge. Nearly parallel edges stay pairs of edges, since a mollifier belongs to each. These are the sets and
        weights of ipc-toolkit's ``NormalCollisions`` of type IPC. Where two types have the same distance, as for a vertex exactly above
        an edge, ipc-toolkit may name the other.

        Returns
        -------
        Stencils
            Sorted by kind, then vertices.
        """
        return Stencils(self._inner.merged())

    @property
    def vertices(self) -> npt.NDArray[np.uint32]:
        """numpy.ndarray of uint32, shape (n, 4) : vertices by their numbers in the whole scene: see `offsets`."""
        return self._inner.vertices()

    @property
    def offsets(self) -> npt.NDArray[np.uint32]:
        """numpy.ndarray of uint32, shape (b + 1,) : the number of the first vertex of each body by its index, and the number of all.

        Vertices are numbered body after body, so they index ``numpy.concatenate([scene.positions(body) for body in scene.bodies])``.
        """
        return self._inner.offsets()

    @property
    def weights(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n,) : how many pairs each stands for; with `by_area`, the area that they stand for."""
        return self._inner.weights()

    @property
    def kinds(self) -> npt.NDArray[np.uint8]:
        """numpy.ndarray of uint8, shape (n,) : what is near what, as an index of `impinge.KINDS`."""
        return self._inner.kinds()

    @property
    def types(self) -> npt.NDArray[np.uint8]:
        """numpy.ndarray of uint8, shape (n,) : types of distance, as `NearPairs.types`."""
        return self._inner.types()

    @property
    def coefficients(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n, 4) : with ``c`` a row and ``x`` the positions of its vertices, ``c @ x`` is the way from
        one nearest point to the other. Those of one element sum to 1, those of the other to -1."""
        return self._inner.coefficients()

    @property
    def squared_distances(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n,) : squares of the distances."""
        return self._inner.squared_distances()

    @property
    def gradients(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n, 12) : derivatives of the squared distances by x, y, z of the first vertex, then of the
        second and so on."""
        return self._inner.gradients()

    @property
    def hessians(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n, 12, 12) : second derivatives of the squared distances, exactly symmetric."""
        return self._inner.hessians()

    @property
    def mollified(self) -> npt.NDArray[np.bool_]:
        """numpy.ndarray of bool, shape (n,) : where the mollifier is below 1."""
        return self._inner.mollified()

    @property
    def mollifiers(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n,) : the factor that makes a potential smooth where edges become parallel and another type of
        distance takes over (Li et al., *Incremental Potential Contact*, 2020, 4.4). 1 where `rest` was not given."""
        return self._inner.mollifiers()

    @property
    def mollifier_gradients(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n, 12) : derivatives of the mollifiers."""
        return self._inner.mollifier_gradients()

    @property
    def mollifier_hessians(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n, 12, 12) : second derivatives of the mollifiers, exactly symmetric."""
        return self._inner.mollifier_hessians()

    def __len__(self) -> int:
        return len(self._inner)

    def __reduce__(self) -> NoReturn:
        raise TypeError("Stencils name vertices of a live scene: pickle their arrays")

    def __repr__(self) -> str:
        counts = np.bincount(self.kinds, minlength=len(_impinge.KINDS)).tolist()
        named = [f"{kind}: {n}" for kind, n in zip(_impinge.KINDS, counts) if n]
        return f"Stencils({', '.join(named)})"


class SafeDistances(_Answer):
    """How far each vertex may move, on any path, so that nothing touches."""

    __slots__ = ()
    _inner: _impinge.SafeDistances

    def of(self, body: _Body) -> npt.NDArray[np.floating[Any]]:
        """The bounds of the vertices of a body, in the unit of the scene, rounded down.

        Parameters
        ----------
        body : Body or int

        Returns
        -------
        numpy.ndarray, shape (v,), float32 or float64 as the positions of the body

        Raises
        ------
        ValueError, TypeError
            A body that was not in the scene.
        """
        return self._inner.of(body)

    @property
    def touching(self) -> NearPairs:
        """NearPairs : the pairs at distance 0, or at most as far apart as their bodies are thick, whose vertices may not move at all.

        Pairs of two `fixed` bodies are among them, and pairs that do not touch but are nearer than the smallest float.
        """
        return NearPairs(self._inner.touching())

    def __repr__(self) -> str:
        return f"SafeDistances({self._inner.n_vertices()} vertices, {self._inner.n_touching()} touching pairs)"


class Csr(NamedTuple):
    """Compressed sparse rows: the neighbours of element ``i`` are ``indices[offsets[i]:offsets[i + 1]]``, ascending.

    `distances` are in the unit of the scene, minus the thickness of both elements, and rounded down: by at most 2**-20 of it, or by
    2**-1045, and 0 if and only if the elements touch, or are at most as far apart as they are thick, or farther by no more than
    2**-1045. With SciPy, ``csr_array((csr.distances, csr.indices, csr.offsets), shape=(n, m))`` is a matrix.
    """

    offsets: npt.NDArray[np.uint64]
    indices: npt.NDArray[np.uint32]
    distances: npt.NDArray[np.float32] | npt.NDArray[np.float64]


class Neighbours(_Answer):
    """Which elements are near each element: the pairs of `Detector.near` as lists.

    ``len(neighbours)`` is the number of pairs. The vertices of all bodies are numbered one after another in the order of the bodies,
    and so are the edges and the faces: `first`.
    """

    __slots__ = ("_lists", "_rooms")
    _inner: _impinge.Neighbours

    def __init__(self, inner: _impinge.Neighbours) -> None:
        super().__init__(inner)
        self._lists: dict[tuple[str, bool], Csr] = {}
        self._rooms: dict[tuple[str, bool], Csr] = {}

    def _again(self, inner: _impinge.Neighbours) -> None:
        """Takes another answer. Its lists are read into the memory of those of the one before."""
        self._inner = inner
        self._lists.clear()

    def of(self, kind: _PairKind, *, reverse: bool = False, out: Csr | None = None) -> Csr:
        """The lists of a kind of pairs: of ``"vf"``, the faces near each vertex, or with `reverse` the vertices near each face.

        Parameters
        ----------
        kind : {"vf", "ee", "ev", "vv", "ef", "ff"}
        reverse : bool
        out : Csr of arrays, optional
            Where to write the numbers, instead of new memory: offsets of uint64, indices of uint32, and distances of float64 or
            float32, which are rounded down once more. They may have room for more.

        Returns
        -------
        Csr
            Arrays that are made once; or the beginnings of those of `out`.

        Raises
        ------
        ValueError
            An array that has no room for all numbers: it says how many it needs. Then nothing is written.
        """
        key = (kind, bool(reverse))
        if out is not None:
            return self._fill(key, Csr(*out))
        if key not in self._lists:
            n_offsets, n = self._inner.sizes(*key)
            room = self._rooms.get(key)
            if room is None or room.offsets.size < n_offsets or room.indices.size < n:
                # A little more than now, if it is not the first answer.
                more = 0 if room is None else n // 4
                room = self._rooms[key] = Csr(
                    np.empty(n_offsets, np.uint64),
                    np.empty(n + more, np.uint32),
                    np.empty(n + more, np.float64),
                )
            self._lists[key] = Csr(*map(_locked, self._fill(key, room)))
        return self._lists[key]

    def _fill(self, key: tuple[_PairKind, bool], room: Csr) -> Csr:
        self._inner.fill(*key, *room)
        n_offsets, n = self._inner.sizes(*key)
        return Csr(room.offsets[:n_offsets], room.indices[:n], room.distances[:n])

    @property
    def vf(self) -> Csr:
        """Csr : the faces near each vertex."""
        return self.of("vf")

    @property
    def fv(self) -> Csr:
        """Csr : the vertices near each face."""
        return self.of("vf", reverse=True)

    @property
    def ee(self) -> Csr:
        """Csr : the edges near each edge; a pair is in the lists of both."""
        return self.of("ee")

    def first(self, body: _Body, part: Literal["vertices", "edges", "faces"]) -> int:
        """The number of the first vertex, edge or face of a body in the lists.

        Parameters
        ----------
        body : Body or int
        part : {"vertices", "edges", "faces"}

        Returns
        -------
        int

        Raises
        ------
        ValueError, TypeError
            A body that was not in the scene.
        """
        return self._inner.first(body, part)

    def __len__(self) -> int:
        return len(self._inner)

    def __reduce__(self) -> NoReturn:
        raise TypeError("Neighbours belong to a live scene: pickle their arrays")

    def __repr__(self) -> str:
        return f"Neighbours({len(self)} pairs)"


class Candidates(_OfKinds):
    """Pairs of elements whose boxes overlap during a step, sorted by kind, then by bodies and elements.

    ``len(candidates)`` is their number. The attributes are arrays with one row per pair.
    """

    __slots__ = ()
    _inner: _impinge.Candidates

    def of(self, kind: _PairKind) -> Candidates:
        """Those of one kind.

        Parameters
        ----------
        kind : {"vf", "ee", "ev", "vv", "ef", "ff"}

        Returns
        -------
        Candidates
            A part of the same answer, which is not copied.
        """
        return Candidates(self._inner.of(kind))


class Closest(_Rows):
    """The element that is nearest to each point. ``len(closest)`` is the number of points; the attributes are arrays with one row per
    point. Asked with ``n_nearest=k`` and k above 1, they have shape (n, k) and (n, k, 2) or (n, k, 3): of each point k elements, nearest
    first, those at the same distance by body and number.
    """

    __slots__ = ()
    _inner: _impinge.Closest

    @property
    def rows(self) -> npt.NDArray[np.uint32]:
        """numpy.ndarray of uint32, shape (n, 2) : number of the body and its element: a face as it was given (of tetrahedra as in
        `Scene.faces`), or an edge or a point of bodies that have no faces. Decided exactly; of several at the same distance the lowest.
        4294967295 twice where nothing, or nothing more, is as near as was asked for. Read-only, and made once.
        """
        if self._rows is None:
            self._rows = _locked(self._inner.rows())
        return self._rows

    @property
    def elements(self) -> npt.NDArray[np.uint32]:
        """numpy.ndarray of uint32, shape (n,) : the second column of `rows`."""
        return self.rows[..., 1]

    @property
    def distances(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n,) : distances, rounded down: never above the true one. Infinity where nothing is near."""
        return self._inner.distances()

    @property
    def points(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n, 3) : the nearest point of the element, rounded. NaN where nothing is near."""
        return self._inner.points()

    @property
    def features(self) -> npt.NDArray[np.uint8]:
        """numpy.ndarray of uint8, shape (n,) : the feature of the element on which that point lies, as an index of
        `impinge.FEATURES`. 255 where nothing is near.
        """
        return self._inner.features()

    @property
    def hash(self) -> int:
        """int : a 64-bit hash of the rows in their order; equal answers have equal hashes everywhere."""
        return self._inner.hash()

    def __reduce__(self) -> NoReturn:
        raise TypeError("a Closest names bodies of a live scene: pickle its arrays")

    def __repr__(self) -> str:
        return f"Closest({len(self)} points)"


class Hits(_Rows):
    """What rays hit. ``len(hits)`` is the number of rays.

    Asked with ``hits="first"``, the columns have one row per ray. With ``"all"`` they have one per hit, the rays one after the other:
    those of ray i are the rows ``offsets[i]`` to ``offsets[i + 1]``, by `t`, then by body and number. With ``"any"`` there is only
    `hit`.
    """

    __slots__ = ()
    _inner: _impinge.Hits

    @property
    def hit(self) -> npt.NDArray[np.bool_]:
        """numpy.ndarray of bool, shape (rays,) : whether each ray hits anything. Exact."""
        return self._inner.hit()

    @property
    def offsets(self) -> npt.NDArray[np.uint64]:
        """numpy.ndarray of uint64, shape (rays + 1,) : where the hits of each ray start among all hits, and the end of the last.
        ``numpy.repeat(numpy.arange(len(hits)), numpy.diff(hits.offsets))`` is the ray of each hit.
        """
        return self._inner.offsets()

    @property
    def rows(self) -> npt.NDArray[np.uint32]:
        """numpy.ndarray of uint32, shape (n, 2) : number of the body and its element, as in `Closest.rows`. Exact. 4294967295 twice
        where a ray hits nothing. Read-only, and made once.
        """
        if self._rows is None:
            self._rows = _locked(self._inner.rows())
        return self._rows

    @property
    def elements(self) -> npt.NDArray[np.uint32]:
        """numpy.ndarray of uint32, shape (n,) : the second column of `rows`."""
        return self.rows[:, 1]

    @property
    def t(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n,) : where the ray comes to the element, in units of its direction, rounded down: never
        above the true one. Infinity where a ray hits nothing.
        """
        return self._inner.t()

    @property
    def t_end(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n,) : where it leaves the element, rounded down: `t`, unless it lies in the face's plane."""
        return self._inner.t_end()

    @property
    def barycentrics(self) -> npt.NDArray[np.float64]:
        """numpy.ndarray of float64, shape (n, 3) : the point of entry as weights of the element's corners, each rounded to nearest.
        NaN where a ray hits nothing.
        """
        return self._inner.barycentrics()

    @property
    def features(self) -> npt.NDArray[np.uint8]:
        """numpy.ndarray of uint8, shape (n,) : the feature of the element on which that point lies, as an index of `impinge.FEATURES`.
        Exact. 255 where a ray hits nothing.
        """
        return self._inner.features()

    @property
    def hash(self) -> int:
        """int : a 64-bit hash of the rays, what they hit and in which order; equal answers have equal hashes everywhere."""
        return self._inner.hash()

    def __repr__(self) -> str:
        return f"Hits({len(self)} rays)"


class _Motion:
    """Where vertices are after a step, as far as it can be taken."""

    __slots__ = ("_inner",)

    _inner: _impinge.Advance | _impinge.Truncation

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    @property
    def start_intersects(self) -> bool | None:
        """bool or None : whether elements intersect at the start, so that nothing can be moved; ``None`` if nobody asked, which only
        ``start="verify"`` does.
        """
        return self._inner.start_intersects

    @property
    def bodies(self) -> list[Body]:
        """list of Body : the bodies that move."""
        return self._inner.bodies()

    def positions(self, body: _Body) -> npt.NDArray[np.floating[Any]] | None:
        """Where the vertices of a body are then, rounded to the precision in which they are held.

        The straight way from the start to these rounded positions is free, if the start was free of intersections, and but for what
        touches at the start.

        Parameters
        ----------
        body : Body or int

        Returns
        -------
        numpy.ndarray, shape (v, 3), float32 or float64, or None
            A copy; ``None`` for a body that stands still.

        Raises
        ------
        ValueError, TypeError
            A body of another scene.
        """
        return self._inner.positions(body)

    def apply(self, scene: Scene) -> None:
        """Takes the step: the bodies that move get these positions, and stand still until they are given end
        positions again. Bodies whose end `Scene.set_end_transform` set keep their rest positions; of others
        these are the rest positions then, too.

        Parameters
        ----------
        scene : Scene
            The scene that was asked about.

        Raises
        ------
        ValueError
            A body that has other positions than when the step was found, also one that does not move: nothing would be known of
            the step. A body that is new, or that moves and is gone. The scene is unchanged then.
        """
        self._inner.apply(scene)

    def __reduce__(self) -> NoReturn:
        raise TypeError(f"{type(self).__name__} names bodies of a live scene: pickle its arrays")


class Advance(_Motion):
    """How far a step can be taken, and where vertices are then."""

    __slots__ = ()
    _inner: _impinge.Advance

    @property
    def fraction(self) -> float:
        """float : the part of the step that can be taken: 1 for all of it, 0 for none. With a clearance it holds for all smaller
        parts, and for positions that you compute (see `Detector.advance`).
        """
        return self._inner.fraction

    @property
    def first(self) -> Impact | None:
        """Impact or None : the first contact of the whole step; ``None`` where nothing touches. Whatever ``precision`` says, its time is
        rounded down to float64, so it may be later than that of `Detector.earliest`. With a clearance: the first time at which a pair is
        as near as it may come, rounding included, as a float32: the pair that limits the step, also where nothing touches and
        `Detector.impacts` finds none.
        """
        first = self._inner.first()
        return None if first is None else Impact(*first)

    @property
    def n_tried(self) -> int:
        """int : how many fractions were tried."""
        return self._inner.n_tried

    def __repr__(self) -> str:
        return f"Advance(fraction={self.fraction!r}, {len(self.bodies)} bodies)"


class Truncation(_Motion):
    """How far each vertex can go in a step: `Detector.truncate`."""

    __slots__ = ()
    _inner: _impinge.Truncation

    @property
    def n_cut(self) -> int:
        """int : how many vertices were stopped before the end of their way."""
        return self._inner.n_cut

    @property
    def n_touching(self) -> int:
        """int : how many pairs already touch at the start, or are at most as far apart as they are to keep: their vertices were not
        moved. Pairs of which no vertex moves are not counted.
        """
        return self._inner.n_touching

    @property
    def rounds(self) -> int:
        """int : how often pairs were looked at again, because vertices had been stopped; at most 256 times."""
        return self._inner.rounds

    @property
    def pairs(self) -> Candidates:
        """Candidates : the pairs that stopped vertices, those that touch at the start included. Sorted anew each time, so that it costs
        no time where nobody asks.
        """
        return Candidates(self._inner.pairs())

    def __repr__(self) -> str:
        return f"Truncation(n_cut={self.n_cut}, {len(self.bodies)} bodies)"


def _refused(reason: str) -> Callable[[Any], NoReturn]:
    def reduce(_: Any) -> NoReturn:
        raise TypeError(reason)

    return reduce


def _reduced(exclusion: _impinge.Exclusion) -> tuple[Any, ...]:
    try:
        return exclusion.__reduce__()
    except TypeError as error:
        raise TypeError(f"{error}: pickle the scene, and make it there again") from None


# Classes of the compiled module of which users pickle something else.
copyreg.pickle(_impinge.Contacts, _refused("Contacts name bodies of a live scene: pickle their arrays"))
copyreg.pickle(_impinge.Penetration, _refused("a Penetration names bodies of a live scene: pickle its arrays and regions()"))
copyreg.pickle(_impinge.CancelToken, _refused("a CancelToken stops questions of its own process alone: pickle none, and make one there"))
copyreg.pickle(_impinge.Exclusion, _reduced)
