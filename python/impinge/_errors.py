"""What can go wrong: `impinge.Error` and its kinds."""

from __future__ import annotations

from typing import ClassVar

__all__ = [
    "Budget",
    "Cancelled",
    "DeviceError",
    "Error",
    "InternalError",
    "InvalidError",
    "OutOfMemory",
    "Seam",
    "TooManyPairs",
]


class Error(Exception):
    """All errors of this library but those that are Python's own: `TypeError` for arguments of a wrong type, `IndexError` for a row that
    is not there, `OSError` for files, `RuntimeError` for what threads and forks must not share and for child processes. After every
    error but `InternalError` a detector stays usable.
    """

    code: ClassVar[str] = "internal"
    """str : ``"invalid"``, ``"out_of_memory"``, ``"budget"``, ``"too_many_pairs"``, ``"cancelled"``, ``"device"`` or ``"internal"``."""


class InvalidError(Error, ValueError):
    """An argument out of its range, a body that is gone, a position that is not finite, a question that makes no sense."""

    code = "invalid"


class Seam(InvalidError):
    """Elements of one body touch at the start of a step at vertices that are at one position but not shared. Weld the mesh
    (`weld`), or skip pairs that touch at the start.
    """


class OutOfMemory(Error, MemoryError):
    """There is no memory for the answer."""

    code = "out_of_memory"


class Budget(Error, MemoryError):
    """The `memory_budget` of the detector is too small for the answer."""

    code = "budget"


class TooManyPairs(Error):
    """More pairs were found than `max_pairs` allows."""

    code = "too_many_pairs"


class Cancelled(Error):
    """A question was stopped by its `CancelToken`."""

    code = "cancelled"


class DeviceError(Error, RuntimeError):
    """There is no such GPU, or the GPU failed."""

    code = "device"


class InternalError(Error, RuntimeError):
    """Threads could not be started, or the library is at fault."""
