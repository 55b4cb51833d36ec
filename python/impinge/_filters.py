"""What a filter of ipctk is, so that it is answered without a call of Python per two vertices.

An ``ipctk.CollisionFilter`` is a C++ function that says nothing of itself. But filters of one kind run the same code, and a filter
holds the addresses of its code and what it captured: the number of dynamic vertices, or one label per vertex. So a filter is compared
with one of ipctk that was made here, and for which the captured data are known to be read rightly. Memory is read through
``/proc/self/mem``, which refuses addresses that are not there. Wherever anything is unknown (another system, another layout, a combination
of filters, a function of Python), there is no answer, and the filter is called.
"""

from __future__ import annotations

import os
import platform
import struct
import sys
from typing import Any, Optional

import numpy as np
import numpy.typing as npt

_Labels = npt.NDArray[np.int64]

#: What reading raises where there is no such memory, or an address is none.
_UNREADABLE = (OSError, OverflowError, ValueError)

#: Of the kinds that are known, by the addresses of their code; `None` before it was looked for.
_known: dict[tuple[int, int], str] | None = None


def labels_of(may: Any, n_vertices: int) -> tuple[Optional[_Labels], Any]:
    """A filter as labels of vertices: elements whose vertices all have one do not collide. And what is left to be called.

    Labels are ``None`` for a filter that lets all collide, and for one that is not known.
    """
    if type(may).__module__ != "ipctk" or not _kinds():
        return None, may
    try:
        function = _Function(may)
        kind = _kinds().get(function.code)
        if kind == "all":
            return None, None
        if kind == "static":
            n_dynamic = min(function.captured, n_vertices)
            return np.minimum(np.arange(n_vertices), n_dynamic), None
        if kind == "patches":
            labels = function.labels()
            # ipctk itself would read beyond the end.
            if len(labels) >= n_vertices:
                return labels[:n_vertices].astype(np.int64), None
    except _UNREADABLE:
        pass
    return None, may


class _Function:
    """The words of a ``std::function``, as GCC's library has it: two of what is captured, then two addresses of code."""

    def __init__(self, may: Any) -> None:
        # After its header, an object of pybind11 begins with the address of what it holds.
        [address] = struct.unpack("P", _read(id(may) + object.__basicsize__, 8))
        self.captured, _, *code = struct.unpack("4P", _read(address, 32))
        self.code: tuple[int, int] = (code[0], code[1])

    def labels(self) -> npt.NDArray[np.int32]:
        """Captured labels: their address, and their number."""
        address, n_labels = struct.unpack("2P", _read(self.captured, 16))
        if n_labels > 1 << 31:
            raise ValueError("no number of labels")
        return np.frombuffer(_read(address, 4 * n_labels), np.int32)


def _read(address: int, n_bytes: int) -> bytes:
    # Opened each time: after a fork, an open file would show the parent's memory.
    file = os.open("/proc/self/mem", os.O_RDONLY)
    try:
        parts = []
        while n_bytes > 0:
            part = os.pread(file, min(n_bytes, 1 << 24), address)
            if not part:
                raise ValueError("no memory there")
            parts.append(part)
            address, n_bytes = address + len(part), n_bytes - len(part)
        return b"".join(parts)
    finally:
        os.close(file)


def _kinds() -> dict[tuple[int, int], str]:
    """The kinds of filters that are read rightly here; none on systems that are not known."""
    global _known
    if _known is None:
        is_known = sys.platform == "linux" and platform.python_implementation() == "CPython"
        try:
            _known = _found_kinds() if is_known and struct.calcsize("P") == 8 else {}
        except (*_UNREADABLE, AttributeError):
            # Before version 1.6, ipctk has no such filters.
            _known = {}
    return _known


def _found_kinds() -> dict[tuple[int, int], str]:
    import ipctk  # type: ignore[import-not-found, import-untyped, unused-ignore]

    everything = [_Function(ipctk.CollisionFilter()) for _ in range(2)]
    numbers = [5, 123_456_789]
    static = [_Function(ipctk.make_static_obstacle_filter(number)) for number in numbers]
    lists = [[3, 1, 4, 1, 5, 9, 2, 6], list(range(1000, 0, -1))]
    # They must outlive their words, which point into them.
    filters = [ipctk.make_vertex_patches_filter(np.array(labels, np.int32)) for labels in lists]
    patches = [_Function(may) for may in filters]
    kinds = {"all": everything, "static": static, "patches": patches}
    codes = {kind: {function.code for function in of} for kind, of in kinds.items()}
    is_right = (
        all(len(of) == 1 for of in codes.values())
        and len(set().union(*codes.values())) == len(kinds)
        and not any(0 in code for of in codes.values() for code in of)
        and [function.captured for function in static] == numbers
        and [function.labels().tolist() for function in patches] == lists
    )
    return {code: kind for kind, of in codes.items() for code in of} if is_right else {}
