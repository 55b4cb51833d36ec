"""Exact, real-time collision detection for deforming meshes.

Two meshes, one line:

>>> import numpy as np, impinge
>>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
>>> impinge.pairs(corners, [[0, 1, 2]], corners[:, [0, 2, 1]] + [0, 0.25, -0.25], [[0, 1, 2]])
array([[0, 0]], dtype=uint32)

A pair is reported if and only if the two elements share a point when the given coordinates are
read as real numbers: touching counts, and there is no tolerance anywhere. The answer is sorted
and depends on the input alone, not on method, backend, threads or memory.

For deforming meshes keep a `Scene` and a `Detector`, move the vertices with
`Scene.set_positions`, and ask again with `Detector.detect`. Of a step, from positions to
`Scene.set_end_positions`, ask `Detector.impacts`, `earliest`, `is_free`, `advance` and `truncate`; `impinge.ipc` has
those under the names of ipc-toolkit.
"""

from . import ipc, ray, tiles, trimesh
from ._answers import (
    Advance,
    Candidates,
    Changes,
    Closest,
    Csr,
    Hits,
    Impact,
    Impacts,
    Nearest,
    NearPairs,
    Neighbours,
    Pairs,
    SafeDistances,
    Stats,
    Stencils,
    Truncation,
)
from ._check import check
from ._detector import Detector
from ._errors import (
    Budget,
    Cancelled,
    DeviceError,
    Error,
    InternalError,
    InvalidError,
    OutOfMemory,
    Seam,
    TooManyPairs,
)
from ._fix import Fixed, fix
from ._functions import (
    ON_SURFACE,
    DeviceInfo,
    cast,
    closest_points,
    contains,
    devices,
    hash_rows,
    locate,
    pairs,
    project_psd,
    self_pairs,
    signed_distance,
    weld,
    winding_numbers,
)
from ._impinge import (
    FEATURES,
    KINDS,
    TYPES,
    Body,
    CancelToken,
    Contacts,
    Exclusion,
    Mesh,
    Penetration,
    __version__,
    read,
    read_bodies,
)
from ._manager import CollisionManager, scene_to_collision
from ._query import Query, groups, rings
from ._scene import Scene

__all__ = [
    "FEATURES",
    "KINDS",
    "ON_SURFACE",
    "TYPES",
    "Advance",
    "Body",
    "Budget",
    "CancelToken",
    "Cancelled",
    "Candidates",
    "Changes",
    "Closest",
    "CollisionManager",
    "Contacts",
    "Csr",
    "Detector",
    "DeviceError",
    "DeviceInfo",
    "Error",
    "Exclusion",
    "Fixed",
    "Hits",
    "Impact",
    "Impacts",
    "InternalError",
    "InvalidError",
    "Mesh",
    "NearPairs",
    "Nearest",
    "Neighbours",
    "OutOfMemory",
    "Pairs",
    "Penetration",
    "Query",
    "SafeDistances",
    "Scene",
    "Seam",
    "Stats",
    "Stencils",
    "TooManyPairs",
    "Truncation",
    "__version__",
    "cast",
    "check",
    "closest_points",
    "contains",
    "devices",
    "fix",
    "groups",
    "hash_rows",
    "ipc",
    "locate",
    "pairs",
    "project_psd",
    "ray",
    "read",
    "read_bodies",
    "rings",
    "scene_to_collision",
    "self_pairs",
    "signed_distance",
    "tiles",
    "trimesh",
    "weld",
    "winding_numbers",
]

for _name in __all__:
    # Error messages, pickles and documentation name what users import.
    if getattr(globals()[_name], "__module__", "").startswith("impinge._"):
        globals()[_name].__module__ = "impinge"
del _name
