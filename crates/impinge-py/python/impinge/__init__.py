"""Exact, real-time collision detection for deforming meshes.

Two meshes, one line:

>>> import numpy as np, impinge
>>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
>>> impinge.pairs(corners, [[0, 1, 2]], corners[:, [0, 2, 1]] + [0, 0.25, -0.25], [[0, 1, 2]])
array([[0, 0]], dtype=uint32)

A pair is reported if and only if the two primitives share a point when the given coordinates are
read as real numbers: touching counts, and there is no tolerance anywhere. The answer is sorted
and depends on the input alone, not on method, backend, threads or memory.

For deforming meshes keep a `Scene` and a `Detector`, move the vertices with
`Scene.set_positions`, and ask again with `Detector.detect`. Of a step, from positions to
`Scene.set_end_positions`, ask `Detector.impacts`, `earliest`, `is_free` and `advance`; `impinge.ipc` has
those under the names of ipc-toolkit.
"""

from . import ipc, ray, tiles
from ._check import check
from ._impinge import (
    FEATURES,
    KINDS,
    TYPES,
    Advance,
    Body,
    Cancelled,
    CancelToken,
    Candidates,
    Contacts,
    Detector,
    Device,
    Impact,
    Impacts,
    Mesh,
    Nearest,
    NearPairs,
    Penetration,
    Result,
    Scene,
    Seam,
    Statistics,
    TooManyPairs,
    __version__,
    devices,
    hash_rows,
    pairs,
    read,
    read_bodies,
    self_pairs,
    weld,
)
from ._manager import CollisionManager

__all__ = [
    "FEATURES",
    "KINDS",
    "TYPES",
    "Advance",
    "Body",
    "CancelToken",
    "Cancelled",
    "Candidates",
    "CollisionManager",
    "Contacts",
    "Detector",
    "Device",
    "Impact",
    "Impacts",
    "Mesh",
    "Nearest",
    "NearPairs",
    "Penetration",
    "Result",
    "Scene",
    "Seam",
    "Statistics",
    "TooManyPairs",
    "__version__",
    "check",
    "devices",
    "hash_rows",
    "ipc",
    "pairs",
    "ray",
    "read",
    "read_bodies",
    "self_pairs",
    "tiles",
    "weld",
]
