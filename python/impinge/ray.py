"""Many meshes, or a scene in tiles, on a Ray cluster: ``pip install impinge[ray]``.

Everything is a task of Ray Core: the rows are those of `impinge.check`, the files those of `impinge.tiles`. The cluster is the one
that ``ray.init`` has joined; without one, Ray starts on this machine. Tasks are tried again when a worker dies, and they may be:
a check reads, and a step of tiles writes each file whole or not at all. Paths must be seen by all machines.

Ray has wheels for Python 3.10 and later.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Literal, Union

from . import tiles as _tiles
from ._check import _check_thickness, _names
from ._check import check as _check
from ._errors import InvalidError

__all__ = ["check", "tiles"]

_Path = Union[str, "os.PathLike[str]"]
_Progress = Callable[[int, int], object]

#: About how many seconds a batch of meshes should take: Ray's own share of a task is about a millisecond.
_BATCH_SECONDS = 1.0


def check(
    paths: Iterable[_Path] | _Path,
    *,
    weld: bool = True,
    min_thickness: float | None = None,
    timeout: float | None = None,
    memory: int | None = None,
    max_in_flight: int | None = None,
    max_retries: int = 3,
    progress: _Progress | None = None,
) -> list[dict[str, Any]]:
    """`impinge.check` on a Ray cluster: the same rows.

    Meshes go out in batches that take about a second each.

    Parameters
    ----------
    paths, weld, min_thickness, timeout, memory
        As for `impinge.check`. Each mesh is checked in a child process of its worker.
    max_in_flight : int, optional
        The most tasks that are submitted and not done; by default twice as many as the cluster has CPUs.
    max_retries : int
        How often a batch is tried again whose worker died.
    progress : callable, optional
        Called as ``progress(done, total)`` after each batch.

    Returns
    -------
    list of dict
        One row per path, in their order.

    Raises
    ------
    ModuleNotFoundError
        Ray is not installed.
    ValueError
        A number out of its range.
    ray.exceptions.RayError
        A batch that failed more often than it may.
    """
    ray = _ray()
    names = _names(paths)
    _check_thickness(min_thickness)
    most = _most(ray, max_in_flight)

    def batch(chosen: list[str]) -> tuple[list[dict[str, Any]], float]:
        start = time.perf_counter()
        rows = _check(chosen, weld=weld, min_thickness=min_thickness, jobs=1, timeout=timeout, memory=memory)
        return rows, time.perf_counter() - start

    task = ray.remote(num_cpus=1, max_retries=max_retries)(batch)
    rows: list[Any] = [None] * len(names)
    n_done, first, size = 0, 0, 1
    flying: dict[Any, tuple[int, int]] = {}
    try:
        while first < len(names) or flying:
            while first < len(names) and len(flying) < most:
                end = min(first + size, len(names))
                flying[task.remote(names[first:end])] = (first, end)
                first = end
            ready, _ = ray.wait(list(flying), num_returns=1)
            for reference in ready:
                found, seconds = ray.get(reference)
                start, end = flying.pop(reference)
                rows[start:end] = found
                n_done += end - start
                # At most twice as many at once, and a fair share of what is left.
                wanted = int((end - start) * _BATCH_SECONDS / max(seconds, 1e-3))
                fair = (len(names) - first) // most
                size = max(1, min(wanted, 2 * (end - start), fair))
                if progress is not None:
                    progress(n_done, len(names))
    finally:
        _cancel(ray, flying)
    return rows


def tiles(
    folder: _Path,
    *,
    which: Literal["all", "between", "self"] = "all",
    shared_vertex: Literal["resolve", "skip"] = "resolve",
    start: Literal["report", "skip"] = "report",
    precision: Literal["f32", "f64"] = "f32",
    memory_budget: int | None = None,
    max_in_flight: int | None = None,
    max_retries: int = 3,
    progress: _Progress | None = None,
) -> dict[str, Any]:
    """Scatters, runs and merges a folder that `impinge.tiles.plan` has made, on a Ray cluster that sees it.

    What is in the folder already is kept, so a run that was stopped goes on.

    Parameters
    ----------
    folder : path
        Seen by all machines under this path.
    which, shared_vertex, start, precision, memory_budget
        As for `impinge.tiles.run`.
    max_in_flight, max_retries
        As for `check`.
    progress : callable, optional
        Called as ``progress(done, total)`` after each task: units of scattering, then tiles.

    Returns
    -------
    dict
        As `impinge.tiles.merge`.

    Raises
    ------
    ModuleNotFoundError
        Ray is not installed.
    OSError, ValueError, RuntimeError
        As `impinge.tiles`.
    ray.exceptions.RayError
        A task that failed more often than it may.
    """
    ray = _ray()
    most = _most(ray, max_in_flight)
    path = os.path.abspath(folder)
    plan = _tiles.describe(path)
    n_units, n_tiles = plan["units"], plan["tiles"]

    def scatter(unit: int) -> None:
        _tiles.scatter(path, rank=unit, world_size=n_units, threads=1)

    def run(tile: int) -> None:
        _tiles.run(
            path,
            [tile],
            which=which,
            shared_vertex=shared_vertex,
            start=start,
            precision=precision,
            threads=1,
            memory_budget=memory_budget,
        )

    def report(done: int) -> None:
        if progress is not None:
            progress(done, n_units + n_tiles)

    n_done = 0
    for work, numbers in [(scatter, range(n_units)), (run, range(n_tiles))]:
        task = ray.remote(num_cpus=1, max_retries=max_retries)(work)
        for _ in _each(ray, task, numbers, most):
            n_done += 1
            report(n_done)
    return _tiles.merge(path)


def _each(ray: Any, task: Any, numbers: Iterable[int], most: int) -> Iterator[None]:
    """Runs a task for each number, so many at a time, and yields when one is done."""
    flying: set[Any] = set()
    try:
        for number in numbers:
            if len(flying) >= most:
                yield from _land(ray, flying)
            flying.add(task.remote(number))
        while flying:
            yield from _land(ray, flying)
    finally:
        _cancel(ray, flying)


def _land(ray: Any, flying: set[Any]) -> Iterator[None]:
    ready, _ = ray.wait(list(flying), num_returns=1)
    for reference in ready:
        ray.get(reference)
        flying.discard(reference)
        yield


def _cancel(ray: Any, flying: Iterable[Any]) -> None:
    for reference in list(flying):
        ray.cancel(reference)


def _ray() -> Any:
    try:
        import ray  # type: ignore[import-not-found, unused-ignore]
    except ModuleNotFoundError as error:
        message = "impinge.ray needs Ray: pip install 'impinge[ray]' (Python 3.10 or later)"
        raise ModuleNotFoundError(message, name="ray") from error
    if not ray.is_initialized():
        ray.init()
    return ray


def _most(ray: Any, max_in_flight: int | None) -> int:
    if max_in_flight is None:
        return 2 * max(int(ray.cluster_resources().get("CPU", 1)), 1)
    if max_in_flight < 1:
        raise InvalidError(f"max_in_flight: {max_in_flight} given, 1 or more allowed")
    return max_in_flight
