"""A mesh mended: `impinge.fix`."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _impinge
from ._errors import InvalidError

__all__ = ["Fixed", "fix"]

#: All repairs, in the order in which they run.
_REPAIRS = ("weld", "duplicates", "degenerate", "orient", "split-edges", "split-vertices", "close-holes", "outward", "unused")


@dataclass(frozen=True)
class Fixed:
    """A mended mesh, and what was done.

    Attributes
    ----------
    vertices : numpy.ndarray, shape (v, 3)
        In the precision that they had. Each is one of the given vertices, bit by bit.
    faces : numpy.ndarray of uint32, shape (n, 3)
    repairs : dict of dict
        Per repair that was asked for what it did, with the names of ``impinge fix --json``.
    before, after : dict
        The rows of a check, as `check` gives them, without a path.
    seams : bool
        Whether vertices were split: some are then at one position, and whoever welds joins them again.
    """

    vertices: npt.NDArray[Any]
    faces: npt.NDArray[np.uint32]
    repairs: dict[str, dict[str, int]]
    before: dict[str, Any]
    after: dict[str, Any]
    seams: bool

    def __repr__(self) -> str:
        return f"Fixed({len(self.vertices)} vertices, {len(self.faces)} faces)"


def fix(
    vertices: npt.ArrayLike,
    faces: npt.ArrayLike,
    *,
    only: Iterable[str] | str | None = None,
    skip: Iterable[str] | str = (),
    close_holes: int = 0,
    threads: int = 0,
) -> Fixed:
    """Mends a mesh of triangles without moving a vertex, as the program ``impinge fix`` does.

    Parameters
    ----------
    vertices : array_like, shape (v, 3)
        Positions, float32 or float64.
    faces : array_like of int, shape (n, 3)
        Triangles as vertex indices.
    only, skip : str, or iterable of str, optional
        The repairs that run, or those that do not, of ``weld``, ``duplicates``, ``degenerate``, ``orient``,
        ``split-edges``, ``split-vertices``, ``close-holes``, ``outward`` and ``unused``; by default all run.
    close_holes : int
        Holes of up to so many edges are closed, 3 to 256; by default none is.
    threads : int
        CPU threads; 0 means one per core. The result does not depend on it.

    Returns
    -------
    Fixed
        The mesh, what each repair did, and what is left: self-intersections stay, for example. Where all faces have
        zero area, it has none.

    Raises
    ------
    ValueError, TypeError
        A repair of another name, a number out of its range; else as `Scene.add`.

    Examples
    --------
    A tetrahedron, one of whose faces is turned, and another one twice:

    >>> import impinge
    >>> vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    >>> fixed = impinge.fix(vertices, [[0, 2, 1], [0, 1, 3], [1, 3, 2], [2, 0, 3], [0, 1, 3]])
    >>> fixed
    Fixed(4 vertices, 4 faces)
    >>> fixed.after["watertight"], fixed.repairs["duplicates"]["faces_removed"]
    (True, 1)
    """
    chosen = _set(_REPAIRS if only is None else only)
    left_out = _set(skip)
    for argument, names in (("only", chosen), ("skip", left_out)):
        for name in names - set(_REPAIRS):
            raise InvalidError(f"{argument}: {name!r} is no repair: {', '.join(_REPAIRS)} are")
    if only is not None and left_out:
        raise InvalidError("only and skip: one of them can be given")
    if close_holes != 0 and not 3 <= close_holes <= 256:
        raise InvalidError(f"close_holes: {close_holes} given, 0 or 3 to 256 allowed")
    if only is not None and "close-holes" in chosen and not close_holes:
        raise InvalidError("only: close-holes is asked for, and close_holes does not say of how many edges")
    if threads < 0:
        raise InvalidError(f"threads: {threads} given, 0 or more allowed")
    wanted = [name for name in _REPAIRS if name in chosen - left_out and (name != "close-holes" or close_holes)]
    positions, triangles, said = _impinge._fix(vertices, faces, wanted, close_holes, threads)
    done = json.loads(said)
    return Fixed(positions, triangles, done["repairs"], done["before"], done["after"], done["seams"])


def _set(names: Iterable[str] | str) -> set[str]:
    """One name, or many, as a set."""
    return {names} if isinstance(names, str) else set(names)
