"""What a question is about, and how it is asked: the options of every question, and `Query`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, SupportsFloat, SupportsIndex, TypedDict

from ._impinge import KINDS, Body, CancelToken, Exclusion, _check_options, _groups, _rings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from typing_extensions import TypeAlias, Unpack

    # An array-like, or anything that speaks DLPack or the buffer protocol.
    _Array: TypeAlias = Any
    # A handle of a body, or its number.
    _Body: TypeAlias = Body | SupportsIndex
    _PairKind: TypeAlias = Literal["vf", "ee", "ev", "vv", "ef", "ff"]
    _Exclusion: TypeAlias = tuple[_Body, _Body] | Exclusion
    _Progress: TypeAlias = Callable[[int, int], object]

__all__ = ["Query", "groups", "rings"]


class Fields(TypedDict, total=False):
    """The options of a question that a `Query` can hold."""

    which: Literal["all", "between", "self"]
    between: tuple[_Body, _Body] | None
    self_of: _Body | None
    of: _Body | None
    kinds: Iterable[_PairKind] | None
    shared_vertex: Literal["resolve", "skip"]
    exclude: _Exclusion | Iterable[_Exclusion]
    owned_by: _Array | None
    start: Literal["report", "skip", "verify"]
    separation: SupportsFloat
    clearance: SupportsFloat
    clearance_share: SupportsFloat
    precision: Literal["f32", "f64"]
    distances: bool
    closest_points: bool
    hits: Literal["first", "any", "all"]
    n_nearest: SupportsIndex
    fixed: Iterable[_Body]


class Control(TypedDict, total=False):
    """What every question heeds."""

    cancel: CancelToken | None
    progress: _Progress | None


class Options(Fields, Control, total=False):
    """The keywords of a question."""

    query: Query | None


#: What is asked where nothing is said.
_DEFAULTS: dict[str, Any] = {
    "which": "all",
    "between": None,
    "self_of": None,
    "of": None,
    "kinds": None,
    "shared_vertex": "resolve",
    "exclude": (),
    "owned_by": None,
    "start": "report",
    "separation": 0.0,
    "clearance": 0.0,
    "clearance_share": 0.2,
    "precision": "f32",
    "distances": False,
    "closest_points": False,
    "hits": "first",
    "n_nearest": 1,
    "fixed": (),
}
_SCOPE = ("which", "between", "self_of", "of")


class Query:
    """What a question is about, and how it is asked: a value that many questions can share.

    Every question of `Detector` takes these options as keywords, and a query as ``query=``, whose options other
    keywords override. An option that is ``None`` was not given. A query cannot be changed; `replace` makes another one. Queries
    compare by what they ask, and pickle, with bodies as numbers.

    Which pairs; a question that cannot honour one of these refuses it by name:

    Parameters
    ----------
    which : {"all", "between", "self"}
        Pairs of all bodies: all of them, those of different bodies, or self-collision.
    between : (Body, Body)
        Pairs of these two bodies, whatever their filters say. At most one of `which`, `between`, `self_of` and `of` is given.
    self_of : Body
        Pairs of elements of one body.
    of : Body
        All pairs of one body, self-collision included.
    kinds : sequence of {"vf", "ee", "ev", "vv", "ef", "ff"}
        Which kinds of pairs: of vertices, edges and faces. `Detector.detect`, `count` and `any` are about the elements that bodies were
        given as, and take none. Steps and candidates: by default ``"vf"`` and ``"ee"``, ``"ev"`` where neither
        body has faces, and ``"vv"`` where both are bodies of points. `Detector.near`: these and ``"ef"``. Kinds that are named count for all bodies: ``"ev"`` also for those with faces.
        Vertices of no element have no pairs.
    shared_vertex : {"resolve", "skip"}
        `Detector.detect`, `count` and `any`: elements of one body that share a vertex are reported when they meet in more than what they
        share, or never; with the same vertices always, with some of the other's vertices and no others never; edges of
        one body that share a vertex never. In all other questions pairs that share a vertex never count.
    exclude : (Body, Body), Exclusion, or sequence of these
        What is left out before it is decided. Bodies: their pairs; a body named twice leaves out its self-collision. ``rings(n)``: pairs
        that are near in the surface. ``groups(g, h)``: groups of vertices that do not meet. ``scene.rest_pairs(r)``: pairs that were
        near at rest; of `Detector.detect`, `count` and `any` the elements of which a corner, an edge or a face was in such a pair. These
        three find all pairs first, so that limits count what is left out, too. Several `groups` are one rule: see there. `Detector.nearest` takes bodies alone.
        Nothing is proven of pairs that are left out: a step that is free (`Detector.is_free`), or that `Detector.truncate`, `advance` or
        `safe_distances` allow, may take them through each other.
    owned_by : (low, high)
        Only the pairs that belong to the half-open box between these two corners, three numbers each: a pair belongs
        to the cell that holds the larger of the lower corners of its two bounding boxes, axis by axis; in a step, of boxes that hold
        their elements from the start to the end. For programs that cut space into cells themselves; corners may be infinite.

    How; a question that has no use for one of these ignores it:

    start : {"report", "skip", "verify"}
        Pairs that touch at the start of a step: reported with the time 0, or left out whatever they do later. ``"verify"``
        reports them and asks whether elements intersect at the start, neighbours resolved: an edge inside a face
        touches nothing until it comes to a border. Then ``start_intersects`` says so, `Detector.is_free` is false, and
        `Detector.advance` allows no step.
    separation : float
        In the unit of the scene, 0 or more: a distance that counts as touching in a step. A pair is reported with the first time at which its
        distance is at most that, decided exactly. The thickness of both elements adds to it (`Scene.set_thickness`).
    clearance, clearance_share : float
        What a step leaves, a length in the unit of the scene: every pair keeps
        ``separation + min(clearance, clearance_share * (d - separation))``, with d its distance at the start. A pair is then reported
        with the first time at which its distance is at most that. With 1e-4 and 0.2 this is ipc-toolkit's
        ``conservative_rescaling=0.8``.
    precision : {"f32", "f64"}
        To which precision times are rounded down.
    distances : bool
        `Detector.near`: whether to find distances, too.
    closest_points : bool
        `Detector.near`: whether to find distances and nearest points, too.
    hits : {"first", "any", "all"}
        `Detector.cast`: what each ray hits first, whether it hits anything, or all that it hits.
    n_nearest : int
        `Detector.closest`: how many of the nearest elements to find for each point.
    fixed : sequence of Body
        `Detector.safe_distances`: bodies that do not move, and leave the whole distance to what is near them. Steps
        (`Detector.truncate`, `Detector.advance`) ignore it: what stands still there is a body without end positions.

    Raises
    ------
    ValueError, TypeError
        An option that no question could take. Bodies are looked up by the question.

    Examples
    --------
    >>> import impinge
    >>> query = impinge.Query(which="self", clearance=1e-4)
    >>> query.replace(precision="f64")
    Query(which='self', clearance=0.0001, precision='f64')
    >>> query == impinge.Query(clearance=1e-4, which="self"), query.clearance_share
    (True, 0.2)
    """

    __slots__ = ("_given",)
    #: What differs from the defaults, which the compiled part reads.
    _given: dict[str, Any]

    which: Literal["all", "between", "self"] | None
    between: tuple[_Body, _Body] | None
    self_of: _Body | None
    of: _Body | None
    kinds: tuple[_PairKind, ...] | None
    shared_vertex: Literal["resolve", "skip"]
    exclude: tuple[_Exclusion, ...]
    owned_by: tuple[tuple[float, ...], tuple[float, ...]] | None
    start: Literal["report", "skip", "verify"]
    separation: float
    clearance: float
    clearance_share: float
    precision: Literal["f32", "f64"]
    distances: bool
    closest_points: bool
    hits: Literal["first", "any", "all"]
    n_nearest: int
    fixed: tuple[_Body, ...]

    def __init__(self, **options: Unpack[Fields]) -> None:
        told: dict[str, Any] = {**options}
        told = {name: value for name, value in told.items() if value is not None}
        for name in ("query", "cancel", "progress"):
            if name in told:
                raise TypeError(f"{name}: no part of a Query, but a keyword of the question")
        for name in ("kinds", "exclude", "fixed"):
            # What can be read only once is read here.
            if hasattr(told.get(name), "__next__"):
                told[name] = list(told[name])
        _check_options(told)
        canonical = {name: _canonical(name, told[name]) for name in _DEFAULTS if name in told}
        given = {name: value for name, value in canonical.items() if value != _DEFAULTS[name]}
        object.__setattr__(self, "_given", given)

    def replace(self, **options: Unpack[Fields]) -> Query:
        """The same query with other options.

        Parameters
        ----------
        **options
            As for `Query`; ``None`` is the default. One of `which`, `between`, `self_of` and `of` takes the place of all four.

        Returns
        -------
        Query
        """
        mine = self._given
        if any(options.get(name) is not None for name in _SCOPE):
            mine = {name: value for name, value in mine.items() if name not in _SCOPE}
        return Query(**{**mine, **options})

    if not TYPE_CHECKING:

        def __getattr__(self, name):
            if name not in _DEFAULTS:
                raise AttributeError(f"a Query has no option {name!r}")
            if name == "which" and any(other in self._given for other in _SCOPE[1:]):
                return None
            return self._given.get(name, _DEFAULTS[name])

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{name}: a Query cannot be changed, replace makes another one")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{name}: a Query cannot be changed, replace makes another one")

    def __dir__(self) -> Iterable[str]:
        return [*object.__dir__(self), *_DEFAULTS]

    def __eq__(self, other: object) -> bool:
        return self._given == other._given if isinstance(other, Query) else NotImplemented

    def __hash__(self) -> int:
        return hash(frozenset(self._given.items()))

    def __repr__(self) -> str:
        return f"Query({', '.join(f'{name}={value!r}' for name, value in self._given.items())})"

    def __reduce__(self) -> tuple[Any, ...]:
        return _query, (_numbers(self._given),)


def rings(n: SupportsIndex) -> Exclusion:
    """Leaves out pairs of one body that are near each other in its surface: some vertex of one element is at most `n` edges away from
    some vertex of the other. For ``exclude=``. Nothing is proven of pairs that are left out: they may pass through each other.

    Parameters
    ----------
    n : int
        0 to 16; 0 leaves out what shares a vertex, 1 also what an edge joins.

    Returns
    -------
    Exclusion

    Examples
    --------
    >>> import impinge
    >>> impinge.Query(exclude=[(0, 1), impinge.rings(2)])
    Query(exclude=((0, 1), rings(2)))
    """
    return _rings(n)


def groups(g: SupportsIndex, h: SupportsIndex) -> Exclusion:
    """Leaves out pairs of elements of two groups of vertices (`Scene.set_groups`), or of one with itself: where each vertex of one element
    and each vertex of the other are in such groups. For ``exclude=``.

    Several are one rule: a pair is left out where each vertex of one element and each vertex of the other are in the two groups of one
    of them, not always the same one. So ``[groups(0, 1), groups(1, 2)]`` leaves out a vertex of group 1 with an edge of a vertex of
    group 0 and one of group 2, which neither leaves out alone.

    Parameters
    ----------
    g, h : int

    Returns
    -------
    Exclusion
    """
    return _groups(g, h)


def _query(given: dict[str, Any]) -> Query:
    return Query(**given)


def _numbers(value: Any) -> Any:
    """The same with bodies as numbers."""
    if isinstance(value, dict):
        return {name: _numbers(item) for name, item in value.items()}
    if isinstance(value, tuple):
        return tuple(map(_numbers, value))
    return int(value) if isinstance(value, Body) else value


def _canonical(name: str, value: Any) -> Any:
    """An option that was checked, in the one form in which it is compared."""
    if name in ("separation", "clearance", "clearance_share"):
        return float(value)
    if name == "n_nearest":
        return int(value)
    if name == "kinds":
        kinds = {value} if isinstance(value, str) else set(value)
        return tuple(kind for kind in KINDS if kind in kinds)
    if name == "between":
        return tuple(value)
    if name == "fixed":
        return tuple(sorted(set(value)))
    if name == "exclude":
        pairs = [value] if isinstance(value, Exclusion) else list(value)
        if len(pairs) == 2 and all(hasattr(body, "__index__") for body in pairs):
            pairs = [pairs]
        bodies = {tuple(sorted(pair)) for pair in pairs if not isinstance(pair, Exclusion)}
        others = {pair for pair in pairs if isinstance(pair, Exclusion)}
        return (*sorted(bodies), *sorted(others, key=repr))
    if name == "owned_by":
        low, high = value
        return tuple(map(float, low)), tuple(map(float, high))
    return value
