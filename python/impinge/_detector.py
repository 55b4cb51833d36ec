"""`impinge.Detector`: settings and questions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import inf
from typing import TYPE_CHECKING, Any, Literal, SupportsFloat, SupportsIndex

import numpy as np
import numpy.typing as npt

from ._answers import (
    Advance,
    Candidates,
    Closest,
    Hits,
    Impact,
    Impacts,
    Nearest,
    NearPairs,
    Neighbours,
    Pairs,
    SafeDistances,
    Stats,
    Truncation,
)
from ._impinge import Contacts, DetectorBase, Penetration

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._query import Control, Options, _Array, _Body
    from ._scene import Scene

__all__ = ["Detector"]


class Detector(DetectorBase):
    """Answers questions about scenes, frame after frame. Scratch memory lives here and is used again.

    The answer depends on the scene and the question alone: not on method, backend, threads, memory or any other setting.

    Every question takes the options of `Query` as keywords, ``query=Query(...)`` for many of them, ``cancel=CancelToken()``, which
    stops it from another thread, and ``progress=f``: called as ``f(done, total)`` from this thread, about every 50 ms and at the end
    of each stage, in units that differ by stage. An exception of `f` stops the question and is raised. Without options, a
    question is about all pairs of all bodies whose filters let them meet, self-collision included. The interpreter is released
    meanwhile, and Ctrl-C stops a long run.

    All questions raise:

    - ValueError, TypeError: a question that makes no sense, an option that is unknown or that this question cannot honour, a body that
      was removed or is of another scene;
    - MemoryError: no memory for the answer, or a memory budget too small for it;
    - `TooManyPairs`: more pairs than `max_pairs` allows, as soon as that is certain;
    - `Cancelled`: stopped by `cancel`;
    - RuntimeError: a detector that is busy in another thread or was made before a fork (but for ``backend="cpu", threads=1``), a GPU failure.

    The detector stays usable after each of them.

    Parameters
    ----------
    backend : {"auto", "cpu", "gpu"}
        Where. ``"auto"`` takes a GPU where there is one and it pays: for steps, and for frames after one with 50,000 candidates or more.
    method : {"auto", "clusters", "cells", "naive"}
        How candidates are found. ``"clusters"``: groups fixed by topology, the fast one for bodies that
        come back. ``"cells"``: the two-level grid of the paper. ``"auto"``: cells for large bodies that are new,
        clusters as soon as they come back. ``"naive"``: every box against every box, the oracle.
    device : str, optional
        Part of a GPU's name, to choose among several.
    threads : int, optional
        CPU threads; by default one per core.
    memory_budget : int, optional
        Bytes that the detector may hold, the answer included; by default as many as it takes.
    max_pairs : int, optional
        The most pairs that an answer may have; by default any number.
    recluster : {"auto", "never"}
        ``"clusters"``: whether a body that has flowed far from its rest pose is clustered anew.
    instruction_set : {"avx512", "avx2", "portable"}, optional
        The widest vector instructions that the CPU may use, where it has them; by default any.
    density : float
        ``"cells"``: the density coefficient of the paper's equation (1), above 0.
    reuse_margin : float
        A distance, for solvers that ask again and again while little moves. If it is above 0, `near`, `neighbours` and `safe_distances` list
        the pairs within their distance and this margin, and look at no others until some vertex has moved farther than half of it, or
        anything but positions has changed. The answers are the same. With a `memory_budget` nothing is listed. After a list that served no
        second question, the next is made when vertices have moved at most half of the margin between two.
    affinity : {"inherited", "auto"}
        Which cores helper threads may run on. ``"inherited"``: the affinity of no thread is ever set. ``"auto"``: on Linux, with up to 8
        threads, not the core on which the calling thread is running, which makes frames faster where nobody else places threads.

    Raises
    ------
    ValueError, TypeError
        A setting out of its range.
    RuntimeError
        No GPU for ``backend="gpu"`` (`DeviceError`), or threads that do not start.

    Examples
    --------
    >>> import impinge
    >>> impinge.Detector("cpu", method="cells", threads=1)
    Detector(backend='cpu', method='cells', threads=1)
    """

    __slots__ = ("__weakref__",)

    def __new__(
        cls,
        backend: Literal["auto", "cpu", "gpu"] = "auto",
        *,
        method: Literal["auto", "clusters", "cells", "naive"] = "auto",
        device: str | None = None,
        threads: SupportsIndex | None = None,
        memory_budget: SupportsIndex | None = None,
        max_pairs: SupportsIndex | None = None,
        recluster: Literal["auto", "never"] = "auto",
        instruction_set: Literal["portable", "avx2", "avx512"] | None = None,
        density: SupportsFloat = 1.0,
        reuse_margin: SupportsFloat = 0.0,
        affinity: Literal["inherited", "auto"] = "inherited",
        _group_size: SupportsIndex | None = None,
    ) -> Detector:
        settings = {
            "backend": backend,
            "method": method,
            "device": device,
            "threads": threads,
            "memory_budget": memory_budget,
            "max_pairs": max_pairs,
            "recluster": recluster,
            "instruction_set": instruction_set,
            "density": density,
            "reuse_margin": reuse_margin,
            "affinity": affinity,
            "_group_size": _group_size,
        }
        return super().__new__(cls, settings)

    @property
    def settings(self) -> dict[str, Any]:
        """dict : the settings, as keywords of `Detector`."""
        return {name: value for name, value in self._settings().items() if name[0] != "_"}

    @property
    def stats(self) -> Stats:
        """Stats : what the last question cost; if it failed, how far it came."""
        return Stats(**self._stats())

    @property
    def start_intersects(self) -> bool | None:
        """bool or None : whether elements intersect at the start of the step that was asked about last; ``None`` if that was not
        asked, which only ``start="verify"`` does.
        """
        return self._start_intersects()

    def detect(self, scene: Scene, **options: Unpack[Options]) -> Pairs:
        """Finds all pairs of elements that intersect, as things are in the scene now: that share a point. Touching counts.

        Elements are those that bodies were given as: triangles, tetrahedra, edges, points.

        Parameters
        ----------
        scene : Scene
        **options
            As for `Query`, and ``query``, ``cancel`` and ``progress``, as for `Detector`. No `kinds`.

        Returns
        -------
        Pairs

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> blade = scene.add([[1, 1, -1], [2, 1, -1], [1, 1, 1]], [[0, 1, 2]])
        >>> detector = impinge.Detector("cpu")
        >>> detector.detect(scene).rows.tolist(), len(detector.detect(scene, self_of=floor))
        ([[0, 0, 1, 0]], 0)
        """
        return Pairs(self._detect(scene, options))

    def count(self, scene: Scene, **options: Unpack[Options]) -> int:
        """Counts the pairs that `detect` would find. None of them is held, so there may be more than memory has room for.

        Parameters
        ----------
        scene, **options
            As for `detect`.

        Returns
        -------
        int
        """
        return self._count(scene, options)

    def any(self, scene: Scene, **options: Unpack[Options]) -> bool:
        """Says whether `detect` would find any pair. The search ends with the first one that is certain.

        Parameters
        ----------
        scene, **options
            As for `detect`.

        Returns
        -------
        bool
        """
        return self._any(scene, options)

    def impacts(self, scene: Scene, **options: Unpack[Options]) -> Impacts:
        """Finds all pairs of elements that touch during a step, each with the first time at which it does.

        Every vertex moves on a straight line, from its position at time 0 to its end position
        (`Scene.set_end_positions`) at time 1. Pairs are of a vertex and a face (``"vf"``) and of two edges
        (``"ee"``); where a body is made of edges or points alone also of an edge and a vertex (``"ev"``) and of
        two vertices (``"vv"``). Of tetrahedra the surface takes part. Pairs of one body that share a vertex
        are left out. The answer is exact: a pair is reported if and only if the two closed elements share a
        point at some time, and its time is that of the first contact, rounded down.

        Parameters
        ----------
        scene : Scene
        **options
            As for `Query`, and ``query``, ``cancel`` and ``progress``, as for `Detector`. If a distance is asked for as well as
            `owned_by`, a program needs the elements whose boxes touch its cell when inflated by it.

        Returns
        -------
        Impacts

        Raises
        ------
        ValueError
            A separation or a clearance that is negative or not finite; a share that is not from 0 to less than 1.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> point = scene.add_points([[1, 1, 1]])
        >>> scene.set_end_positions(point, [[1, 1, -3]])
        >>> impacts = impinge.Detector("cpu").impacts(scene)
        >>> impacts[0]
        Impact(kind='vf', body_a=Body(1), element_a=0, body_b=Body(0), element_b=0, toi=0.25, at_start=False)
        >>> float(impacts.toi.min())
        0.25
        """
        return Impacts(self._impacts(scene, options))

    def earliest(self, scene: Scene, **options: Unpack[Options]) -> Impact | None:
        """Finds the first contact of a step: the impact with the least time, of several the first row. It is the
        one that ``impacts(...).earliest()`` finds, but found faster.

        Parameters
        ----------
        scene, **options
            As for `impacts`.

        Returns
        -------
        Impact or None
            ``None`` where nothing touches. With ``start="verify"``, `start_intersects` then says whether elements intersect at
            the start, which need not touch.
        """
        first = self._earliest(scene, options)
        return None if first is None else Impact(*first)

    def is_free(self, scene: Scene, **options: Unpack[Options]) -> bool:
        """Whether nothing touches during a step; with ``start="skip"``, but for pairs that touch at its start.

        Elements that intersect all the way, an edge deep in a face, touch nothing new: a step is free only of what begins. If the
        start was free of intersections, so is each moment of a free step; ``start="verify"`` asks that, too. Tetrahedra take part with
        their surface: that the step turns one inside out is not noticed.

        Parameters
        ----------
        scene, **options
            As for `impacts`.

        Returns
        -------
        bool
        """
        return self._is_free(scene, options)

    def advance(self, scene: Scene, **options: Unpack[Options]) -> Advance:
        """How far a step can be taken: a fraction of it, backed off from the first contact hardly more than the
        precision of positions asks for, for which the straight way from the start to the *rounded* positions is free, if the start
        was.

        Rounding alone may make elements touch that did not. So for each fraction that is tried positions are
        rounded first, and the way to those is asked about. A chain of such steps is free from the first to the
        last, if its start was free of intersections, which ``start="verify"`` asks; after the first contact it goes on only if what
        met moves apart: a `clearance` keeps room. Pairs that touch at the start allow
        no step at all, or are not looked at with ``start="skip"``. The seams of a mesh that was not welded are refused by
        name: weld it (`weld`), or skip them.

        With a `clearance`, the fraction holds for positions that you compute, too: by ``x0 + a * (x1 - x0)`` or by ``x0 + a * dx`` with
        ``x1 = x0 + dx``, in the precision of the positions, for every ``a`` from 0 to the fraction, the straight way there is free and
        keeps the clearance, rounding included. Without one, only `Advance.positions` are proven.

        Parameters
        ----------
        scene, **options
            As for `impacts`. No `owned_by`.

        Returns
        -------
        Advance
            ``advance.apply(scene)`` takes the step.

        Raises
        ------
        Seam
            Vertices of one body at one position that are not shared.
        """
        return Advance(self._advance(scene, options))

    def truncate(self, scene: Scene, **options: Unpack[Options]) -> Truncation:
        """How far each vertex can go on its way to its end position, so that nothing touches: each vertex stops for itself,
        where `advance` stops all of them at one fraction of the step.

        The straight way from the start to the *rounded* positions is free, if the start was, and but for pairs that touch at the
        start: their vertices stay, or are not looked at with ``start="skip"``. Elements that are to keep a `separation` or a
        `clearance` do so at every moment. Elements that do not meet are not stopped. Where two do, the vertices that go
        towards the other element stop before planes between the two, and pairs of which a vertex was stopped are looked at again;
        so some stop that might have passed, and the next step takes them farther. A body whose end `Scene.set_end_transform` made
        stops as a whole: all of its vertices go the least share of their ways that one of them may go. Tetrahedra take part with
        their surface, as in `is_free`.

        Parameters
        ----------
        scene, **options
            As for `impacts`. No `owned_by`.

        Returns
        -------
        Truncation
            ``truncation.apply(scene)`` takes the step.

        Raises
        ------
        Seam
            Vertices of one body at one position that are not shared.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> points = scene.add_points([[1, 1, 1], [9, 9, 1]])
        >>> scene.set_end_positions(points, [[1, 1, -1], [9, 9, -1]])
        >>> truncation = impinge.Detector("cpu").truncate(scene)
        >>> truncation.n_cut, truncation.positions(points)[:, 2].round(2).tolist()
        (1, [0.0, -1.0])

        Notes
        -----
        Divide and Truncate (Chen et al., SIGGRAPH 2026) has the planes that divide the room between two elements.
        """
        return Truncation(self._truncate(scene, options))

    def candidates(
        self, scene: Scene, inflation: SupportsFloat = 0.0, **options: Unpack[Options]
    ) -> Candidates:
        """Finds the pairs of elements whose boxes over the whole step, each inflated on all sides,
        overlap: for those who bring a test of their own. Sorted and complete; decided exactly. Pairs of one
        body that share a vertex are left out. Vertices of no element take no part.

        Parameters
        ----------
        scene : Scene
        inflation : float
            By how much boxes are inflated, in the unit of the scene, 0 or more.
        **options
            As for `Query`, and ``query``, ``cancel`` and ``progress``, as for `Detector`. With `owned_by`, a program needs the elements
            whose boxes touch its cell when inflated by twice the inflation.

        Returns
        -------
        Candidates
        """
        return Candidates(self._candidates(scene, inflation, options))

    def candidates_in_runs(
        self,
        scene: Scene,
        each: Callable[[Candidates], object],
        inflation: SupportsFloat = 0.0,
        *,
        most: SupportsIndex = 1 << 22,
        **options: Unpack[Options],
    ) -> int:
        """All `candidates` in sorted runs, one after the other, so that memory need not hold all of them. Run after
        run they are the rows of `candidates`, each once and in the same order, whatever `most`, the memory budget
        and the number of threads.

        Candidates are counted first, and then each run is searched for alone, so short runs cost time. A run takes
        8 bytes per candidate, 12 without a memory budget. The budget makes runs as short as it needs.

        Parameters
        ----------
        scene, inflation, **options
            As for `candidates`.
        each : callable
            Called with each run, which is never empty. An exception ends the search and is raised.
        most : int
            Candidates per run at most.

        Returns
        -------
        int
            The number of all candidates.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> for _ in range(2):
        ...     _ = scene.add_points([[x, 0, 0] for x in range(5)])
        >>> detector = impinge.Detector("cpu")
        >>> detector.candidates_in_runs(scene, lambda run: print(run.rows.tolist()), which="between", most=3)
        [[0, 0, 1, 0], [0, 1, 1, 1], [0, 2, 1, 2]]
        [[0, 3, 1, 3], [0, 4, 1, 4]]
        5
        """
        if not callable(each):
            raise TypeError(f"each: a callable expected, {type(each).__name__} given")

        def hand_over(run: Any) -> None:
            each(Candidates(run))

        return self._candidates_in_runs(scene, hand_over, inflation, most, options)

    def near(
        self, scene: Scene, distance: SupportsFloat, **options: Unpack[Options]
    ) -> NearPairs:
        """Finds the pairs of elements whose distance is at most `distance` and the thickness of both bodies
        (`Scene.set_thickness`), at the positions that bodies have. Exact: decided without rounding. Pairs of one body that share a vertex
        are left out.

        An edge and a face (``"ef"``) are reported if they meet, whatever the distance: else pairs of their parts say that they are near.
        Vertices of no element, such as those of no face of a body of triangles, take no part.

        Parameters
        ----------
        scene : Scene
        distance : float
            The distance in the unit of the scene, 0 or more.
        **options
            As for `Query`, and ``query``, ``cancel`` and ``progress``, as for `Detector`.

        Returns
        -------
        NearPairs

        Raises
        ------
        ValueError
            A distance that is negative or not finite.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> point = scene.add_points([[1, 1, 0.5]])
        >>> near = impinge.Detector("cpu").near(scene, 0.5, closest_points=True)
        >>> near
        NearPairs(vf: 1)
        >>> impinge.TYPES[near.types[0]], near.distances.tolist(), near.points.tolist()
        ('P_T', [0.5], [[[1.0, 1.0, 0.5], [1.0, 1.0, 0.0]]])
        """
        return NearPairs(self._near(scene, distance, options))

    def safe_distances(
        self, scene: Scene, most: SupportsFloat, **options: Unpack[Options]
    ) -> SafeDistances:
        """How far each vertex may move, on any path, so that nothing touches.

        For each pair of elements that do not share a vertex, the largest number of the vertices of one and the largest of the other add
        up to less than their distance, minus the thickness of both bodies (`Scene.set_thickness`). Both get half of it; what is
        `fixed` gets 0 and leaves all of it to the other. Each number is rounded down: it is never above what the smallest distance
        of its vertex allows, and below that by at most 2**-10 of it. Vertices of pairs that touch get 0. Tetrahedra take part with their
        surface, as in `is_free`.

        So a solver may move every vertex by its number, in any direction and in any order, without a test in between. What counts is the
        motion to the new position as it was rounded. End positions are ignored.

        Parameters
        ----------
        scene : Scene
        most : float
            No number is above this length, in the unit of the scene. Pairs farther apart than twice of it play no part, and the cost grows
            with it: take no more than a vertex moves in a step.
        **options
            As for `Query`, and ``query``, ``cancel`` and ``progress``, as for `Detector`.

        Returns
        -------
        SafeDistances

        Raises
        ------
        ValueError
            A length that is negative or not finite.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> points = scene.add_points([[1, 1, 0.5], [1, 1, 9]])
        >>> safe = impinge.Detector("cpu").safe_distances(scene, most=1.0, fixed=[floor])
        >>> safe.of(points).round(6).tolist(), safe.of(floor).tolist(), len(safe.touching)
        ([0.5, 1.0], [0.0, 0.0, 0.0], 0)
        """
        return SafeDistances(self._safe_distances(scene, most, options))

    def neighbours(
        self,
        scene: Scene,
        distance: SupportsFloat,
        *,
        out: Neighbours | None = None,
        **options: Unpack[Options],
    ) -> Neighbours:
        """The pairs of `near` as lists by element, in both directions, with distances that are rounded down.

        Parameters
        ----------
        scene, distance, **options
            As for `near`.
        out : Neighbours, optional
            An earlier answer that is no longer needed: it takes the new one and is returned. Lists that were read from it are read into
            the same memory if they fit, so arrays of before change.

        Returns
        -------
        Neighbours

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> points = scene.add_points([[9, 9, 9], [1, 1, 0.5]])
        >>> near = impinge.Detector("cpu").neighbours(scene, 1.0)
        >>> near.vf.offsets.tolist(), near.vf.indices.tolist(), near.fv.indices.tolist()
        ([0, 0, 0, 0, 0, 1], [0], [4])
        >>> near.first(points, "vertices")
        3
        """
        if out is not None and not isinstance(out, Neighbours):
            raise TypeError(f"out: {type(out).__name__} given, Neighbours allowed")
        inner = self._neighbours(scene, distance, options)
        if out is None:
            return Neighbours(inner)
        out._again(inner)
        return out

    def distance(
        self, scene: Scene, a: _Body, b: _Body, **control: Unpack[Control]
    ) -> Nearest | None:
        """The smallest distance of two bodies at the positions that they have, and the pair of elements that has it. Tetrahedra
        are solid. Trees and the last pair are kept, so that later calls for bodies that move cost little.

        Parameters
        ----------
        scene : Scene
        a, b : Body or int
        **control
            ``cancel`` and ``progress``, as for `Detector`.

        Returns
        -------
        Nearest or None
            ``None`` where one of them has no element. Its distance is 0 if and only if they share a point, or are nearer than the
            smallest float. Of several pairs at one distance, rounded down, the lowest, by the element of `a`, then of `b`: not
            always the nearest of them.

        Raises
        ------
        ValueError, TypeError
            A body that the scene does not have, twice the same body.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> other = scene.add([[0, 0, 3], [4, 0, 3], [0, 4, 5]], [[0, 1, 2]])
        >>> nearest = impinge.Detector("cpu").distance(scene, floor, other)
        >>> nearest.distance, nearest.element_a, nearest.points.tolist()
        (3.0, 0, [[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]])
        """
        return _nearest(self._distance(scene, a, b, control))

    def nearest(
        self, scene: Scene, *, across: Iterable[_Body] | None = None, **options: Unpack[Options]
    ) -> Nearest | None:
        """The two bodies that are nearest to each other of all whose filters let them meet, and the pair of elements that has
        their distance. Pairs of bodies whose boxes are farther apart than the nearest two are never looked at.

        Parameters
        ----------
        scene : Scene
        across : sequence of Body, optional
            Only pairs of one of these and one that is not among them, whatever their filters say.
        **options
            As for `Query`, and ``query``, ``cancel`` and ``progress``, as for `Detector`. Here `which` is ``"between"`` if nothing is
            said.

        Returns
        -------
        Nearest or None
            ``None`` where there are no two bodies that have elements. Of several pairs at one distance, rounded down, the
            lowest, by bodies, then by elements: not always the nearest of them.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> points = [scene.add_points([[x, 0, 0]]) for x in (0, 5, 7)]
        >>> nearest = impinge.Detector("cpu").nearest(scene)
        >>> nearest.distance, nearest.body_a == points[1], nearest.body_b == points[2]
        (2.0, True, True)
        """
        asked: dict[str, Any] = {**options}
        if across is not None:
            asked["_across"] = across
        return _nearest(self._nearest(scene, asked))

    def closest(
        self,
        scene: Scene,
        points: _Array,
        most: SupportsFloat = inf,
        **options: Unpack[Options],
    ) -> Closest:
        """The element that is nearest to each point: its distance, the nearest point and the feature on which that lies. Elements are
        the faces of bodies of triangles and of tetrahedra (their surface), and the edges and points of other bodies.

        Parameters
        ----------
        scene : Scene
        points : array_like, shape (n, 3)
            Float32 or float64, taken as they are.
        most : float
            Elements farther away, in the unit of the scene, are not looked for.
        **options
            ``n_nearest=k`` finds the k nearest elements of each point. ``of=body`` looks at one body; else all are looked at. ``query``,
            ``cancel`` and ``progress`` as for `Detector`. Options about pairs are refused.

        Returns
        -------
        Closest

        Raises
        ------
        ValueError
            A distance that is negative or NaN, a point that is not finite, no element asked for.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> closest = impinge.Detector("cpu").closest(scene, [[1, 1, 2], [-3, 0, 4]])
        >>> closest.distances.tolist(), closest.points.tolist()
        ([2.0, 5.0], [[1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
        >>> [impinge.FEATURES[ix] for ix in closest.features]
        ['f', 'v0']
        """
        return Closest(self._closest(scene, points, most, options))

    def cast(
        self,
        scene: Scene,
        origins: _Array,
        directions: _Array,
        most: SupportsFloat = inf,
        **options: Unpack[Options],
    ) -> Hits:
        """What each ray hits: the points ``origin + t * direction``, for t from 0 to `most`. Elements are those of `closest`.

        Decided exactly: a ray that grazes an edge or a vertex hits all elements there, and one in the plane of a face hits it from an
        entry to an exit. The first hit is the one with the smallest t; of several it is the lowest by body and then by number. A
        direction of zero is the origin alone.

        Parameters
        ----------
        scene : Scene
        origins, directions : array_like, shape (n, 3)
            Float32 or float64, taken as they are. Directions need not have unit length.
        most : float
            The largest t: infinity for rays, 1 for segments from `origins` to ``origins + directions``.
        **options
            ``hits="first"``, ``"any"`` or ``"all"``. ``of=body`` looks at one body; else all are looked at. ``query``, ``cancel`` and
            ``progress`` as for `Detector`. Options about pairs are refused.

        Returns
        -------
        Hits

        Raises
        ------
        ValueError
            Another number of directions than of origins, a `most` that is negative or NaN, a ray that is not finite.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> hits = impinge.Detector("cpu").cast(scene, [[1, 1, 2], [9, 1, 2]], [[0, 0, -1], [0, 0, -1]])
        >>> hits.hit.tolist(), hits.t.tolist(), hits.elements[hits.hit].tolist()
        ([True, False], [2.0, inf], [0])
        """
        return Hits(self._cast(scene, origins, directions, most, options))

    def locate(
        self, scene: Scene, body: _Body, points: _Array, **control: Unpack[Control]
    ) -> npt.NDArray[np.int64]:
        """Which tetrahedron of a body contains each point. Decided exactly.

        Parameters
        ----------
        scene : Scene
        body : Body
            Tetrahedra. They are closed: points on their faces are in them, and a flat one contains the points of its faces.
        points : array_like, shape (n, 3)
            Float32 or float64, taken as they are.
        **control
            ``cancel`` and ``progress``, as for `Detector`.

        Returns
        -------
        numpy.ndarray of int64, shape (n,)
            The number of the tetrahedron: the lowest, where several share the face, edge or vertex on which a point is. -1 outside.

        Raises
        ------
        ValueError
            A body of another kind, a point that is not finite.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> corners = [[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4], [0, 0, -4]]
        >>> body = scene.add(corners, [[0, 1, 2, 3], [0, 2, 1, 4]])
        >>> impinge.Detector("cpu").locate(scene, body, [[1, 1, -1], [1, 1, 0], [3, 3, 3]]).tolist()
        [1, 0, -1]
        """
        return self._locate(scene, body, points, control)

    def contains(
        self, scene: Scene, body: _Body, points: _Array, **control: Unpack[Control]
    ) -> npt.NDArray[np.int8]:
        """Where points lie: inside a body, on its surface or outside. Decided exactly, also for points on faces, edges and vertices.

        Triangles must be a closed surface. A point is inside where the surface winds around it, whichever way, so an inner shell
        of the opposite orientation makes a hollow. Of tetrahedra the surface consists of `Scene.faces`; where they overlap, a point
        strictly inside one of them is inside, also on a face of another.

        Parameters
        ----------
        scene : Scene
        body : Body or int
            Triangles or tetrahedra.
        points : array_like, shape (n, 3)
            Float32 or float64, taken as they are.
        **control
            ``cancel`` and ``progress``, as for `Detector`.

        Returns
        -------
        numpy.ndarray of int8, shape (n,)
            1 inside, 0 on the surface, -1 outside.

        Raises
        ------
        ValueError, TypeError
            A surface that is not closed (the error names an edge): weld its vertices (`weld`), fill holes, orient faces. A body of
            edges or points, a point that is not finite.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> corners = [[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]]
        >>> body = scene.add(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
        >>> impinge.Detector("cpu").contains(scene, body, [[1, 1, 1], [0, 0, 2], [-1, 0, 0]])
        array([ 1,  0, -1], dtype=int8)
        """
        return self._contains(scene, body, points, control)

    def signed_distance(
        self, scene: Scene, body: _Body, points: _Array, **control: Unpack[Control]
    ) -> npt.NDArray[np.float64]:
        """How far points are from the surface of a body: positive inside, negative outside.

        Parameters
        ----------
        scene, body, points, **control
            As for `contains`.

        Returns
        -------
        numpy.ndarray of float64, shape (n,)
            0 on the surface. The sign is exact, and the magnitude is rounded down: never above the true distance, and 0 or -0 below
            the smallest float. Where tetrahedra overlap, 0 also on a face that is strictly inside another one, where `contains` says 1.

        Raises
        ------
        ValueError, TypeError
            As `contains`.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> corners = [[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]]
        >>> body = scene.add(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
        >>> impinge.Detector("cpu").signed_distance(scene, body, [[1, 1, 0.5], [0, 0, 2], [-1, 0, 0]]).tolist()
        [0.5, 0.0, -1.0]
        """
        return self._signed_distance(scene, body, points, control)

    def winding_numbers(
        self, scene: Scene, body: _Body, points: _Array, **control: Unpack[Control]
    ) -> npt.NDArray[np.int32]:
        """How often a closed surface winds around each point. Decided exactly.

        Parameters
        ----------
        scene : Scene
        body : Body or int
            Triangles.
        points : array_like, shape (n, 3)
            Float32 or float64, taken as they are.
        **control
            ``cancel`` and ``progress``, as for `Detector`.

        Returns
        -------
        numpy.ndarray of int32, shape (n,)
            0 outside, 1 inside where faces are counterclockwise seen from outside and -1 where they are clockwise, and sums of these
            where the surface overlaps itself. `ON_SURFACE`, the lowest int32, on the surface. `contains` says whether it is 0.

        Raises
        ------
        ValueError, TypeError
            As `contains`; and a body of tetrahedra.

        Examples
        --------
        >>> import impinge, numpy
        >>> scene = impinge.Scene()
        >>> faces = numpy.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
        >>> corners = numpy.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]])
        >>> body = scene.add([*corners, *(4 * corners - 1)], [*faces, *(faces + 4)])
        >>> detector = impinge.Detector("cpu")
        >>> detector.winding_numbers(scene, body, [[1, 1, 1], [3, 3, 3], [-2, 0, 0]]).tolist()
        [2, 1, 0]
        >>> detector.winding_numbers(scene, body, [[0, 1, 1]]).tolist() == [impinge.ON_SURFACE]
        True
        """
        return self._winding_numbers(scene, body, points, control)

    def contacts(self, scene: Scene, pairs: Pairs, **control: Unpack[Control]) -> Contacts:
        """Where the triangles of each pair meet: points, segments, polygons, and the curves in which surfaces cross.

        Parameters
        ----------
        scene : Scene
            As it was when the pairs were found.
        pairs : Pairs
            Of `detect`.
        **control
            ``cancel`` and ``progress``, as for `Detector`.

        Returns
        -------
        Contacts

        Raises
        ------
        ValueError, TypeError
            Pairs of another scene, or a body that is gone or has fewer elements.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> floor = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
        >>> blade = scene.add([[1, 1, -1], [2, 1, -1], [1, 1, 1]], [[0, 1, 2]])
        >>> detector = impinge.Detector("cpu")
        >>> contacts = detector.contacts(scene, detector.detect(scene))
        >>> contacts.shapes.tolist(), contacts.points.tolist()
        (['segment'], [[1.0, 1.0, 0.0], [1.5, 1.0, 0.0]])
        >>> [curve.tolist() for curve in contacts.curves()]
        [[0, 1]]
        """
        if not isinstance(pairs, Pairs):
            raise TypeError(f"pairs: Pairs expected, {type(pairs).__name__} given")
        return self._contacts(scene, pairs._inner, control)

    def penetration(
        self,
        scene: Scene,
        contacts: Contacts,
        a: _Body,
        b: _Body,
        **control: Unpack[Control],
    ) -> Penetration:
        """How deep two closed bodies of triangles are in each other: vertices inside, and connected regions with normal, depth and
        volume. The body with the lower number is the first, whichever argument it is.

        Parameters
        ----------
        scene : Scene
            As it was when the contacts were found.
        contacts : Contacts
            Among them all of these two bodies.
        a, b : Body or int
        **control
            ``cancel`` and ``progress``, as for `Detector`.

        Returns
        -------
        Penetration

        Raises
        ------
        ValueError, TypeError
            A body that the scene does not have or that is not made of triangles, twice the same body, a surface that is not
            closed, contacts of another scene, or without these two though they intersect; contacts of a query that left out pairs of
            the two: in a cell, by groups or lists of vertices, or because faces of both were pinned; contacts of pairs some of
            which `Pairs.retain` dropped. A body that has moved or was re-meshed since the pairs were found.
        """
        return self._penetration(scene, contacts, a, b, control)

    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]:
        return (), self._settings()

    def __repr__(self) -> str:
        shown = {name: value for name, value in self.settings.items() if value != _DEFAULTS[name]}
        shown = {"backend": self.settings["backend"], **shown}
        return f"Detector({', '.join(f'{name}={value!r}' for name, value in shown.items())})"


#: Settings that a detector's repr leaves out.
_DEFAULTS = {
    "backend": "auto",
    "method": "auto",
    "device": None,
    "threads": None,
    "memory_budget": None,
    "max_pairs": None,
    "recluster": "auto",
    "instruction_set": "avx512",
    "density": 1.0,
    "reuse_margin": 0.0,
    "affinity": "inherited",
}


def _nearest(found: Any) -> Nearest | None:
    return None if found is None else Nearest(*found)
