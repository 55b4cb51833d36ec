from collections.abc import Callable, Iterable, Iterator
from os import PathLike
from typing import (
    Any,
    Literal,
    NoReturn,
    SupportsFloat,
    SupportsIndex,
    TypedDict,
    final,
    overload,
)

import numpy as np
import numpy.typing as npt
from typing_extensions import TypeAlias, Unpack

__all__ = [
    "FEATURES",
    "KINDS",
    "TYPES",
    "Advance",
    "Body",
    "CancelToken",
    "Cancelled",
    "Candidates",
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
    "_VertexFilter",
    "__version__",
    "_check",
    "_serve_check",
    "_tiles_describe",
    "_tiles_merge",
    "_tiles_plan",
    "_tiles_run",
    "_tiles_scatter",
    "devices",
    "hash_rows",
    "pairs",
    "read",
    "read_bodies",
    "self_pairs",
    "weld",
]

__version__: str
FEATURES: tuple[str, ...]
KINDS: tuple[str, ...]
TYPES: tuple[str, ...]

_Array: TypeAlias = Any  # An array-like, or anything that speaks DLPack or the buffer protocol.
_Body: TypeAlias = Body | SupportsIndex
_Pair: TypeAlias = tuple[_Body, _Body]
_Method: TypeAlias = Literal["auto", "clusters", "cells", "naive"]
_Backend: TypeAlias = Literal["auto", "cpu", "gpu"]
_Recluster: TypeAlias = Literal["auto", "never"]
_Placement: TypeAlias = Literal["auto", "inherited"]
_InstructionSet: TypeAlias = Literal["portable", "avx2", "avx512"]
_Kind: TypeAlias = Literal["points", "edges", "triangles", "tetrahedra"]
_RowKind: TypeAlias = Literal["points", "edges", "triangles", "tetrahedra", "quads"]
_SharedVertex: TypeAlias = Literal["skip", "resolve"]
_Part: TypeAlias = Literal["given", "vertices", "edges", "faces"]
_PairKind: TypeAlias = Literal["vf", "ee", "ev", "vv", "ef", "ff"]
_Start: TypeAlias = Literal["report", "skip", "verify"]
_Toi: TypeAlias = Literal["f32", "f64"]
_Progress: TypeAlias = Callable[[int, int], object]
_Path: TypeAlias = str | PathLike[str]

class _Settings(TypedDict, total=False):
    method: _Method
    backend: _Backend
    device: str | None
    threads: SupportsIndex | None
    memory_budget: SupportsIndex | None
    max_pairs: SupportsIndex | None
    lambda_: SupportsFloat
    group_size: SupportsIndex
    recluster: _Recluster
    instruction_set: _InstructionSet
    placement: _Placement

class Cancelled(Exception): ...
class Seam(ValueError): ...
class TooManyPairs(Exception): ...

@final
class CancelToken:
    def __new__(cls) -> CancelToken: ...
    def cancel(self) -> None: ...
    @property
    def cancelled(self) -> bool: ...

@final
class _VertexFilter:
    def __new__(
        cls,
        rows: list[npt.NDArray[np.uint32] | None],
        labels: npt.NDArray[np.int64] | None,
        may: Callable[[int, int], object] | None,
    ) -> _VertexFilter: ...

@final
class Body:
    @property
    def index(self) -> int: ...
    def __index__(self) -> int: ...
    def __int__(self) -> int: ...
    def __hash__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __lt__(self, other: Body | int, /) -> bool: ...
    def __le__(self, other: Body | int, /) -> bool: ...
    def __gt__(self, other: Body | int, /) -> bool: ...
    def __ge__(self, other: Body | int, /) -> bool: ...
    def __reduce__(self) -> NoReturn: ...

@final
class Device:
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    @property
    def name(self) -> str: ...
    @property
    def interface(self) -> str: ...
    @property
    def driver(self) -> str: ...
    @property
    def is_software(self) -> bool: ...
    @property
    def max_binding(self) -> int: ...

def devices() -> list[Device]: ...

@final
class Scene:
    def __new__(cls) -> Scene: ...
    def add(
        self, vertices: _Array, faces: _Array | None = None, kind: _RowKind | None = None
    ) -> Body: ...
    def add_many(
        self,
        vertices: _Array,
        faces: _Array,
        vertex_offsets: _Array,
        face_offsets: _Array,
        kind: _RowKind | None = None,
    ) -> list[Body]: ...
    def add_edges(self, vertices: _Array, edges: _Array) -> Body: ...
    def add_points(self, vertices: _Array) -> Body: ...
    def set_positions(self, body: _Body, vertices: _Array) -> None: ...
    def set_end_positions(self, body: _Body, vertices: _Array) -> None: ...
    def lend_positions(self, body: _Body, vertices: npt.NDArray[Any]) -> None: ...
    def lend_end_positions(self, body: _Body, vertices: npt.NDArray[Any]) -> None: ...
    def clear_end_positions(self, body: _Body) -> None: ...
    def remesh(
        self, body: _Body, vertices: _Array, faces: _Array, kind: _RowKind | None = None
    ) -> None: ...
    def set_transform(self, body: _Body, matrix: _Array) -> None: ...
    def transform(self, body: _Body) -> npt.NDArray[np.float64] | None: ...
    def rest_positions(self, body: _Body) -> npt.NDArray[np.floating[Any]]: ...
    def remove(self, body: _Body) -> None: ...
    def set_filter(
        self,
        body: _Body,
        category: SupportsIndex | None = None,
        mask: SupportsIndex | None = None,
    ) -> None: ...
    def positions(self, body: _Body) -> npt.NDArray[np.floating[Any]]: ...
    def end_positions(self, body: _Body) -> npt.NDArray[np.floating[Any]] | None: ...
    def elements(self, body: _Body, part: _Part = "given") -> npt.NDArray[np.uint32]: ...
    def kind(self, body: _Body) -> _Kind: ...
    def n_primitives(self, body: _Body) -> int: ...
    def n_vertices(self, body: _Body) -> int: ...
    def _convex_overlap(
        self, a: _Body, b: _Body
    ) -> tuple[float, list[float], list[float]] | None: ...
    @property
    def bodies(self) -> list[Body]: ...
    @property
    def nbytes(self) -> int: ...
    def __len__(self) -> int: ...
    def __contains__(self, body: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def __setstate__(self, bodies: Any, /) -> None: ...

@final
class Detector:
    def __new__(
        cls,
        method: _Method = "auto",
        backend: _Backend = "auto",
        device: str | None = None,
        threads: SupportsIndex | None = None,
        memory_budget: SupportsIndex | None = None,
        *,
        max_pairs: SupportsIndex | None = None,
        lambda_: SupportsFloat = 1.0,
        group_size: SupportsIndex = 64,
        recluster: _Recluster = "auto",
        instruction_set: _InstructionSet = "avx512",
        placement: _Placement = "auto",
    ) -> Detector: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...
    def detect(
        self,
        scene: Scene,
        *,
        between: _Pair | bool | None = None,
        within: _Body | None = None,
        ignore: Iterable[_Pair] | None = None,
        shared_vertex: _SharedVertex = "resolve",
        owned_by: _Array | None = None,
        progress: Callable[[int, int], object] | None = None,
        cancel: CancelToken | None = None,
        filter: Callable[[npt.NDArray[np.uint32]], _Array] | None = None,
    ) -> Result: ...
    def count(
        self,
        scene: Scene,
        *,
        between: _Pair | bool | None = None,
        within: _Body | None = None,
        ignore: Iterable[_Pair] | None = None,
        shared_vertex: _SharedVertex = "resolve",
        owned_by: _Array | None = None,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> int: ...
    def any(
        self,
        scene: Scene,
        *,
        between: _Pair | bool | None = None,
        within: _Body | None = None,
        ignore: Iterable[_Pair] | None = None,
        shared_vertex: _SharedVertex = "resolve",
        owned_by: _Array | None = None,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> bool: ...
    def impacts(
        self,
        scene: Scene,
        *,
        between: _Pair | bool | None = None,
        within: _Body | None = None,
        ignore: Iterable[_Pair] | None = None,
        start: _Start = "report",
        toi: _Toi = "f32",
        separation: SupportsFloat = 0.0,
        clearance: SupportsFloat = 0.0,
        clearance_share: SupportsFloat = 0.2,
        owned_by: _Array | None = None,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> Impacts: ...
    def earliest(
        self,
        scene: Scene,
        *,
        between: _Pair | bool | None = None,
        within: _Body | None = None,
        ignore: Iterable[_Pair] | None = None,
        start: _Start = "report",
        toi: _Toi = "f32",
        separation: SupportsFloat = 0.0,
        clearance: SupportsFloat = 0.0,
        clearance_share: SupportsFloat = 0.2,
        owned_by: _Array | None = None,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> Impact | None: ...
    @property
    def start_intersects(self) -> bool | None: ...
    def is_free(
        self,
        scene: Scene,
        *,
        between: _Pair | bool | None = None,
        within: _Body | None = None,
        ignore: Iterable[_Pair] | None = None,
        start: _Start = "report",
        separation: SupportsFloat = 0.0,
        clearance: SupportsFloat = 0.0,
        clearance_share: SupportsFloat = 0.2,
        owned_by: _Array | None = None,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> bool: ...
    def advance(
        self,
        scene: Scene,
        *,
        between: _Pair | bool | None = None,
        within: _Body | None = None,
        ignore: Iterable[_Pair] | None = None,
        start: _Start = "report",
        separation: SupportsFloat = 0.0,
        clearance: SupportsFloat = 0.0,
        clearance_share: SupportsFloat = 0.2,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> Advance: ...
    def candidates(
        self,
        scene: Scene,
        *,
        between: _Pair | bool | None = None,
        within: _Body | None = None,
        ignore: Iterable[_Pair] | None = None,
        kinds: Iterable[_PairKind] = ("vf", "ee"),
        distance: SupportsFloat = 0.0,
        owned_by: _Array | None = None,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> Candidates: ...
    def candidates_in_runs(
        self,
        scene: Scene,
        each: Callable[[Candidates], object],
        *,
        between: _Pair | bool | None = None,
        within: _Body | None = None,
        ignore: Iterable[_Pair] | None = None,
        kinds: Iterable[_PairKind] = ("vf", "ee"),
        distance: SupportsFloat = 0.0,
        most: SupportsIndex = 4194304,
        owned_by: _Array | None = None,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> int: ...
    def within_distance(
        self,
        scene: Scene,
        distance: SupportsFloat = 0.0,
        *,
        between: _Pair | bool | None = None,
        within: _Body | None = None,
        ignore: Iterable[_Pair] | None = None,
        kinds: Iterable[_PairKind] | None = None,
        thickness: dict[Body, float] | None = None,
        distances: bool = False,
        closest_points: bool = False,
        owned_by: _Array | None = None,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> NearPairs: ...
    def distance(
        self,
        scene: Scene,
        a: _Body,
        b: _Body,
        *,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> Nearest | None: ...
    def nearest(
        self,
        scene: Scene,
        *,
        across: Iterable[_Body] | None = None,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> Nearest | None: ...
    def contacts(
        self,
        scene: Scene,
        pairs: Result,
        *,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> Contacts: ...
    def penetration(
        self,
        scene: Scene,
        contacts: Contacts,
        a: _Body,
        b: _Body,
        *,
        progress: _Progress | None = None,
        cancel: CancelToken | None = None,
    ) -> Penetration: ...
    def _any(self, scene: Scene, across: Iterable[_Body] | None = None) -> bool: ...
    def _detect(self, scene: Scene, across: Iterable[_Body] | None = None) -> Result: ...

@final
class NearPairs:
    @property
    def rows(self) -> npt.NDArray[np.uint32]: ...
    @property
    def kinds(self) -> npt.NDArray[np.uint8]: ...
    @property
    def bodies(self) -> npt.NDArray[np.uint32]: ...
    @property
    def elements(self) -> npt.NDArray[np.uint32]: ...
    @property
    def types(self) -> npt.NDArray[np.uint8]: ...
    @property
    def features(self) -> npt.NDArray[np.uint8]: ...
    @property
    def parallel(self) -> npt.NDArray[np.bool_]: ...
    @property
    def distances(self) -> npt.NDArray[np.float64]: ...
    @property
    def points(self) -> npt.NDArray[np.float64]: ...
    @property
    def hash(self) -> int: ...
    @property
    def stats(self) -> Statistics: ...
    def of(self, kind: _PairKind) -> NearPairs: ...
    def __len__(self) -> int: ...

@final
class Contacts:
    @property
    def rows(self) -> npt.NDArray[np.uint32]: ...
    @property
    def shapes(self) -> npt.NDArray[np.str_]: ...
    @property
    def points(self) -> npt.NDArray[np.float64]: ...
    @property
    def corners(self) -> npt.NDArray[np.uint32]: ...
    @property
    def starts(self) -> npt.NDArray[np.uint64]: ...
    @property
    def bodies(self) -> npt.NDArray[np.uint32]: ...
    @property
    def feature_kinds(self) -> npt.NDArray[np.str_]: ...
    @property
    def features(self) -> npt.NDArray[np.uint32]: ...
    @property
    def lengths(self) -> npt.NDArray[np.float64]: ...
    def curves(self) -> list[npt.NDArray[np.uint32]]: ...
    def regions(self) -> list[dict[str, Any]]: ...
    def __len__(self) -> int: ...

@final
class Nearest:
    @property
    def distance(self) -> float: ...
    @property
    def bodies(self) -> tuple[Body, Body]: ...
    @property
    def primitives(self) -> tuple[int, int]: ...
    @property
    def points(self) -> npt.NDArray[np.float64]: ...

@final
class Penetration:
    @property
    def inside(self) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32]]: ...
    @property
    def volume(self) -> float | None: ...
    def regions(self) -> list[dict[str, Any]]: ...

@final
class Impact:
    def __hash__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...
    @property
    def kind(self) -> _PairKind: ...
    @property
    def bodies(self) -> tuple[Body, Body]: ...
    @property
    def elements(self) -> tuple[int, int]: ...
    @property
    def toi(self) -> float: ...
    @property
    def at_start(self) -> bool: ...

@final
class Impacts:
    @property
    def rows(self) -> npt.NDArray[np.uint32]: ...
    @property
    def kinds(self) -> npt.NDArray[np.uint8]: ...
    @property
    def bodies(self) -> npt.NDArray[np.uint32]: ...
    @property
    def elements(self) -> npt.NDArray[np.uint32]: ...
    @property
    def toi(self) -> npt.NDArray[np.floating[Any]]: ...
    @property
    def at_start(self) -> npt.NDArray[np.bool_]: ...
    @property
    def start_intersects(self) -> bool | None: ...
    def of(self, kind: _PairKind) -> Impacts: ...
    def earliest(self) -> Impact | None: ...
    @property
    def hash(self) -> int: ...
    @property
    def stats(self) -> Statistics: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: SupportsIndex, /) -> Impact: ...
    def __iter__(self) -> Iterator[Impact]: ...
    def __reduce__(self) -> NoReturn: ...

@final
class Advance:
    @property
    def fraction(self) -> float: ...
    @property
    def first(self) -> Impact | None: ...
    @property
    def start_intersects(self) -> bool | None: ...
    @property
    def n_tried(self) -> int: ...
    @property
    def positions(self) -> list[tuple[Body, npt.NDArray[np.floating[Any]]]]: ...
    def apply(self, scene: Scene) -> None: ...
    def __reduce__(self) -> NoReturn: ...

@final
class Candidates:
    def rows(self, kind: _PairKind) -> npt.NDArray[np.uint32]: ...
    @property
    def kinds(self) -> npt.NDArray[np.uint8]: ...
    @property
    def bodies(self) -> npt.NDArray[np.uint32]: ...
    @property
    def elements(self) -> npt.NDArray[np.uint32]: ...
    @property
    def hash(self) -> int: ...
    @property
    def stats(self) -> Statistics: ...
    def __len__(self) -> int: ...
    def __reduce__(self) -> NoReturn: ...

@final
class Result:
    def pairs(self) -> npt.NDArray[np.uint32]: ...
    def between(self, a: _Body, b: _Body) -> npt.NDArray[np.uint32]: ...
    def within(self, body: _Body) -> npt.NDArray[np.uint32]: ...
    @property
    def rows(self) -> npt.NDArray[np.uint32]: ...
    @overload
    def colliding(self, body: None = None) -> dict[Body, npt.NDArray[np.uint32]]: ...
    @overload
    def colliding(self, body: _Body) -> npt.NDArray[np.uint32]: ...
    @property
    def bodies(self) -> list[Body]: ...
    @property
    def hash(self) -> int: ...
    @property
    def stats(self) -> Statistics: ...
    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: SupportsIndex, /) -> tuple[int, int, int, int]: ...
    @overload
    def __getitem__(self, index: slice, /) -> npt.NDArray[np.uint32]: ...
    def __iter__(self) -> Iterator[tuple[int, int, int, int]]: ...
    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[Any]: ...
    def __reduce__(self) -> NoReturn: ...

@final
class Statistics:
    @property
    def backend(self) -> str: ...
    @property
    def method(self) -> _Method: ...
    @property
    def n_threads(self) -> int: ...
    @property
    def stages(self) -> dict[str, float]: ...
    @property
    def total_ms(self) -> float: ...
    @property
    def grid(self) -> tuple[int, int, int] | None: ...
    @property
    def n_subdivided(self) -> int: ...
    @property
    def n_entries(self) -> int: ...
    @property
    def n_clusters(self) -> int: ...
    @property
    def n_culled(self) -> int: ...
    @property
    def n_work_items(self) -> int: ...
    @property
    def n_candidates(self) -> int: ...
    @property
    def n_unsure(self) -> int: ...
    @property
    def unsure_share(self) -> float: ...
    @property
    def n_clustered(self) -> int: ...
    @property
    def n_reclustered(self) -> int: ...
    @property
    def n_batches(self) -> int: ...
    @property
    def n_pieces(self) -> int: ...
    @property
    def n_reruns(self) -> int: ...
    @property
    def bytes_held(self) -> int: ...
    def as_dict(self) -> dict[str, Any]: ...

def pairs(
    vertices_a: _Array,
    faces_a: _Array,
    vertices_b: _Array,
    faces_b: _Array,
    *,
    weld: bool = False,
    kind_a: _RowKind | None = None,
    kind_b: _RowKind | None = None,
    **settings: Unpack[_Settings],
) -> npt.NDArray[np.uint32]: ...
@final
class Mesh:
    @property
    def vertices(self) -> npt.NDArray[np.floating[Any]]: ...
    @property
    def faces(self) -> npt.NDArray[np.uint32]: ...
    @property
    def kind(self) -> Literal["triangles", "tetrahedra"]: ...
    @property
    def name(self) -> str: ...
    @property
    def n_welded(self) -> int: ...

def read(path: _Path, *, weld: bool = True) -> Mesh: ...
def read_bodies(path: _Path, *, weld: bool = True) -> list[Mesh]: ...
def self_pairs(
    vertices: _Array,
    faces: _Array,
    shared_vertex: _SharedVertex = "resolve",
    *,
    weld: bool = False,
    kind: _RowKind | None = None,
    **settings: Unpack[_Settings],
) -> npt.NDArray[np.uint32]: ...
def weld(
    vertices: _Array, faces: _Array
) -> tuple[npt.NDArray[Any], npt.NDArray[np.uint32], npt.NDArray[np.uint32]]: ...
def hash_rows(rows: _Array) -> int: ...
def _check(
    paths: list[str],
    command: list[str],
    jobs: int,
    weld: bool,
    timeout: float | None,
    row: Callable[[int, str], object],
) -> None: ...
def _serve_check(weld: bool, threads: int, memory: int | None) -> None: ...
def _tiles_plan(
    folder: str,
    files: list[str],
    cap: int,
    chunk: int,
    weld: bool,
    step: bool,
    separation: float,
    replace: bool,
    progress: _Progress | None,
) -> dict[str, Any]: ...
def _tiles_describe(folder: str) -> dict[str, Any]: ...
def _tiles_scatter(
    folder: str, rank: int, world_size: int, threads: int, progress: _Progress | None
) -> dict[str, int]: ...
def _tiles_run(
    folder: str,
    tiles: list[int],
    between: bool,
    within: bool,
    shared_vertex: str,
    start: str,
    toi: str,
    threads: int,
    memory_budget: int | None,
    again: bool,
    done: Callable[[], object] | None,
) -> list[dict[str, Any]]: ...
def _tiles_merge(folder: str) -> dict[str, Any]: ...
