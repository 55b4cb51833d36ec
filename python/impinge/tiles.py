"""Scenes larger than memory, or than one machine: exact collision detection tile by tile.

Four steps work on one folder, and its files are all that they share: `plan`, `scatter`, `run`, `merge`. Any of them may run
on any machine that sees the folder, in any number of processes. A step that was stopped is run again and ends with the same
bytes. The answer is that of one `Detector` with all files in one scene, and has the same hash; but of a step,
vertices have the numbers of their files, of welded ones the first. `impinge.ray.tiles` runs the steps on a Ray cluster.
"""

from __future__ import annotations

import operator
import os
from collections.abc import Callable, Iterable
from typing import Any, Literal, SupportsIndex, Union

import numpy as np
import numpy.typing as npt

from . import _impinge
from ._check import _names
from ._errors import InvalidError

__all__ = ["describe", "merge", "plan", "rows", "run", "scatter"]

_Path = Union[str, "os.PathLike[str]"]
_Progress = Callable[[int, int], object]


def plan(
    folder: _Path,
    files: Iterable[_Path] | _Path,
    *,
    cap: int = 2_000_000,
    chunk: int = 500_000,
    weld: bool = True,
    step: bool = False,
    separation: float = 0.0,
    replace: bool = False,
    progress: _Progress | None = None,
) -> dict[str, Any]:
    """Looks at every element of the files once, cuts space into tiles and writes ``plan.json``.

    Parameters
    ----------
    folder : path
        Made if it is not there. One with the very same plan is left as it is.
    files : path, or iterable of paths
        Mesh files, a body each, numbered in this order. With `step`, two files per body: its start and its end.
    cap : int
        About how many elements a tile may hold; one tile is in memory at a time.
    chunk : int
        Elements per unit of scattering.
    weld : bool
        Whether vertices of one file at exactly the same position become one; with `step`, those at one position both at the start
        and at the end, and scattering such a body holds all its vertices in memory.
    step : bool
        Whether bodies move from a start to an end. Tiles then find the first contacts, as `Detector.impacts` does.
    separation : float
        In a step: the distance that elements must keep, as for `Detector.impacts`.
    replace : bool
        Whether another plan in the folder, and all that was made by it, is removed.
    progress : callable, optional
        Called as ``progress(done, total)`` with elements.

    Returns
    -------
    dict
        As `describe`.

    Raises
    ------
    OSError, ValueError
        Files that cannot be read, coordinates that are refused, another plan in the folder.
    """
    options = (_whole("cap", cap, 1), _whole("chunk", chunk, 1), weld, step, separation, replace, progress)
    return _impinge._tiles_plan(os.fspath(folder), _names(files), *options)


def describe(folder: _Path) -> dict[str, Any]:
    """What the plan of a folder says.

    Returns
    -------
    dict
        ``plan`` (its name), ``files``, ``step`` (whether bodies move), ``separation``, ``elements``, ``tiles``, ``units``.
    """
    return _impinge._tiles_describe(os.fspath(folder))


def scatter(
    folder: _Path,
    *,
    rank: int = 0,
    world_size: int = 1,
    threads: int = 0,
    progress: _Progress | None = None,
) -> dict[str, int]:
    """Writes the parts that are not there yet: elements by tile, one part per unit of work.

    Parameters
    ----------
    folder : path
        With a plan.
    rank, world_size : int
        The share of this process: units whose number leaves the remainder `rank`.
    threads : int
        Threads; 0 for one per core.
    progress : callable, optional
        Called as ``progress(done, total)`` with units.

    Returns
    -------
    dict
        ``written`` and ``kept`` (parts), ``elements`` and ``records`` of the parts that were written.

    Raises
    ------
    OSError, ValueError
        Files that have changed or cannot be read, a full disk, a rank out of its range.
    """
    share = (_whole("rank", rank, 0), _whole("world_size", world_size, 1))
    return _impinge._tiles_scatter(os.fspath(folder), *share, _whole("threads", threads, 0), progress)


def run(
    folder: _Path,
    tiles: Iterable[int] | None = None,
    *,
    which: Literal["all", "between", "self"] = "all",
    shared_vertex: Literal["resolve", "skip"] = "resolve",
    start: Literal["report", "skip"] = "report",
    precision: Literal["f32", "f64"] = "f32",
    threads: int = 0,
    memory_budget: int | None = None,
    again: bool = False,
    progress: _Progress | None = None,
) -> list[dict[str, Any]]:
    """Finds the pairs of tiles, one tile in memory at a time. Tiles that have a result for the same question are kept.

    Parameters
    ----------
    folder : path
        With all parts.
    tiles : iterable of int, optional
        Which; by default all of them.
    which : {"all", "between", "self"}
        All pairs, those of different files, or those within each file. All tiles must be asked the same.
    shared_vertex : {"resolve", "skip"}
        As for `Detector.detect`. In a step neighbours never count.
    start, precision
        In a step, as for `Detector.impacts`.
    threads : int
        Threads; 0 for one per core.
    memory_budget : int, optional
        As for `Detector`.
    again : bool
        Whether tiles that have a result are run again.
    progress : callable, optional
        Called as ``progress(done, total)`` after each tile.

    Returns
    -------
    list of dict
        One per tile: ``tile``, ``elements``, ``pairs``, ``hash``, ``elsewhere``, ``pieces``, ``kept``.

    Raises
    ------
    OSError, ValueError, Error
        No such tile; parts that are missing, stale or damaged; a detection that fails, such as `Budget`.
    """
    n_tiles = describe(folder)["tiles"]
    try:
        chosen = iter(range(n_tiles) if tiles is None else tiles)
    except TypeError:
        given = type(tiles).__name__
        raise TypeError(f"tiles: an iterable of whole numbers expected, {given} given") from None
    numbers = [_whole("tiles", tile, 0, n_tiles - 1) for tile in chosen]
    budget = None if memory_budget is None else _whole("memory_budget", memory_budget, 0)
    n_done = 0

    def done() -> None:
        nonlocal n_done
        n_done += 1
        if progress is not None:
            progress(n_done, len(numbers))

    arguments = (which, shared_vertex, start, precision, _whole("threads", threads, 0), budget, again, done)
    return _impinge._tiles_run(os.fspath(folder), numbers, *arguments)


def merge(folder: _Path) -> dict[str, Any]:
    """Merges the results of all tiles into ``rows.npy`` and ``answer.json``.

    Returns
    -------
    dict
        ``pairs``, ``hash`` (as `Pairs.hash` in 16 hexadecimal digits), ``asked``, ``tiles``, ``records``, ``uncut_tiles``,
        ``rows`` (the path of the rows). In a step also ``kinds`` (how many of each), ``touching_at_start`` and ``earliest``:
        ``(kind, (body_a, element_a, body_b, element_b), toi)`` or None.

    Raises
    ------
    OSError, ValueError
        A tile whose result is missing, stale, damaged, or for another question.
    """
    return _impinge._tiles_merge(os.fspath(folder))


def rows(folder: _Path) -> npt.NDArray[Any]:
    """The merged answer, mapped from its file: it may be larger than memory.

    Returns
    -------
    numpy.ndarray of uint32, shape (n, 4)
        As `Pairs.rows`, with bodies numbered by the order of files. In a step a structured array of shape (n,) with the fields
        ``kind``, ``body_a``, ``element_a``, ``body_b``, ``element_b`` and ``toi``.
    """
    mapped: npt.NDArray[Any] = np.load(os.path.join(folder, "rows.npy"), mmap_mode="r")
    return mapped


def _whole(name: str, given: SupportsIndex, least: int, most: int = 2**64 - 1) -> int:
    """An argument that is a whole number in a range."""
    try:
        number = operator.index(given)
    except TypeError:
        raise TypeError(f"{name}: a whole number expected, {type(given).__name__} given") from None
    if least <= number <= most:
        return number
    if most < 2**64 - 1:
        allowed = f"{least} to {most}"
    else:
        allowed = f"{least} or more" if number < least else f"{most} or less"
    raise InvalidError(f"{name}: {number} given, {allowed} allowed")
