"""What is wrong with many meshes: `impinge.check`."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable
from typing import Any, Union

from . import _impinge
from ._errors import InvalidError

__all__ = ["check"]

_Path = Union[str, "os.PathLike[str]"]

#: A child process. It finds impinge and NumPy where this process does, also in folders that the program has added to its path.
_CHILD = "import json, sys; sys.path[:] = json.loads(sys.argv.pop(1)); from impinge._check_worker import main; main()"


def check(
    paths: Iterable[_Path] | _Path,
    *,
    weld: bool = True,
    min_thickness: float | None = None,
    jobs: int | None = None,
    timeout: float | None = None,
    memory: int | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> list[dict[str, Any]]:
    """Counts what is wrong with each of many mesh files: self-intersections, degenerate and duplicate faces,
    non-manifold places, open borders, pieces. Every count is exact.

    Each mesh is checked in a child process. One that cannot be read, takes too long or runs out of memory gets a
    row whose ``error`` says so, and the others go on.

    Parameters
    ----------
    paths : path, or iterable of paths
        Mesh files of any format that the program ``impinge`` reads.
    weld : bool
        Whether vertices at one position become one first. Self-intersections are counted among faces as they are
        then, neighbours included where they meet in more than what they share.
    min_thickness : float, optional
        Also counts the faces at walls that are at most this thick, in the unit of the files, as ``thin_faces``, and
        names the thickness of the thinnest as ``thinnest``. By default walls are not looked at.
    jobs : int, optional
        How many child processes there are at a time; by default one per core.
    timeout : float, optional
        Seconds that one mesh may take; by default as long as it takes.
    memory : int, optional
        Bytes of address space of each child process (Unix); by default no limit.
    progress : callable, optional
        Called as ``progress(done, total)`` after each mesh. An exception stops the run and is raised.

    Returns
    -------
    list of dict
        One per path, in their order, with the keys of ``impinge check --json``: at least ``path``, ``vertices``,
        ``triangles``, ``self_intersections``, ``degenerate``, ``duplicate_faces``, ``non_manifold_edges``,
        ``boundary_edges``, ``components`` and ``error`` (``None``, or what happened).

    Raises
    ------
    ValueError
        A number out of its range.
    RuntimeError
        A child process that cannot be started.

    Examples
    --------
    >>> import impinge
    >>> [row] = impinge.check("no such file.ply")
    >>> row["path"], row["error"] is None
    ('no such file.ply', False)
    """
    names = _names(paths)
    n_cores = os.cpu_count() or 1
    if jobs is None:
        jobs = n_cores
    if jobs < 1:
        raise InvalidError(f"jobs: {jobs} given, 1 or more allowed")
    if timeout is not None and not timeout > 0:
        raise InvalidError(f"timeout: {timeout} given, more than 0 allowed")
    _check_thickness(min_thickness)
    if memory is not None and memory < 1:
        raise InvalidError(f"memory: {memory} given, 1 or more allowed")
    if not sys.executable:
        raise RuntimeError("sys.executable names no Python that could run child processes")
    jobs = min(jobs, max(len(names), 1))
    options = [str(int(weld)), str(max(n_cores // jobs, 1)), str(memory or 0), repr(float(min_thickness or 0))]
    command = [sys.executable, "-c", _CHILD, json.dumps([path for path in sys.path if isinstance(path, str)]), *options]
    rows: list[Any] = [None] * len(names)
    n_done = 0

    def put(ix: int, row: str) -> None:
        nonlocal n_done
        rows[ix] = json.loads(row)
        n_done += 1
        if progress is not None:
            progress(n_done, len(names))

    _impinge._check(names, command, jobs, weld, timeout, put)
    return rows


def _names(paths: Iterable[_Path] | _Path) -> list[str]:
    """The names of one path, or of many."""
    if isinstance(paths, (str, os.PathLike)):
        paths = [paths]
    return [os.fspath(path) for path in paths]


def _check_thickness(min_thickness: float | None) -> None:
    if min_thickness is not None and not 0 < _impinge._length(min_thickness, "min_thickness") < float("inf"):
        raise InvalidError(f"min_thickness: {min_thickness} given, a length above 0 allowed")
