"""`impinge.ipc.BroadPhase`: what finds pairs, wherever ipctk takes a broad phase."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import ipctk  # type: ignore[import-not-found, import-untyped, unused-ignore]
import numpy as np

from ._candidates import Question, objects
from ._errors import InvalidError
from ._filters import labels_of

if TYPE_CHECKING:
    from ._candidates import _Mode
    from .ipc import CollisionMesh

#: A mesh with vertices of no edge and edges of no face is asked about in three parts.
_MESHES_KEPT = 4


class BroadPhase(ipctk.BroadPhase):  # type: ignore[misc, unused-ignore]
    """Finds the pairs of elements that ipc-toolkit asks for, wherever it takes a broad phase.

    Parameters
    ----------
    mode : {"exact", "boxes"}
        ``"exact"``: only pairs that come within twice the inflation radius; in a step all that Tight Inclusion may stop for, which
        reaches a little farther. Edges against faces, which ``ipctk.has_intersections`` asks for, come by boxes. ``"boxes"``: all
        pairs whose inflated boxes overlap, as ipctk's own broad phases find them.

    The topology of the meshes that were asked about last is kept. An object is for one thread at a time, as ipctk's are.
    Meshes in two dimensions go to ipctk's default broad phase.

    Examples
    --------
    >>> import ipctk, numpy as np
    >>> from impinge import ipc
    >>> rest = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, 0.01], [5, 1, 0.01], [1, 5, 0.01]])
    >>> faces = np.array([[0, 1, 2], [3, 4, 5]], np.int32)
    >>> mesh = ipctk.CollisionMesh(rest, ipctk.edges(faces), faces)
    >>> collisions = ipctk.NormalCollisions()
    >>> collisions.build(mesh, rest, 0.02, broad_phase=ipc.BroadPhase())
    >>> len(collisions)
    3
    """

    def __init__(self, mode: _Mode = "exact") -> None:
        if mode not in ("exact", "boxes"):
            raise InvalidError(f"mode: {mode!r} given, 'exact' or 'boxes' allowed")
        super().__init__()
        self._mode: _Mode = mode
        #: The last ones first, with their edges and faces as ipctk gave them.
        self._meshes: list[tuple[CollisionMesh, Any, Any]] = []
        self._question: Question | None = None
        self._flat: Any = None

    def name(self) -> str:
        """What ipc-toolkit's log calls it."""
        return "impinge" if self._mode == "exact" else "impinge (boxes)"

    def build(self, *args: Any, **named: Any) -> None:
        """Takes positions, or those at the start and at the end, edges, faces and the inflation radius."""
        # ipctk's own names of the arguments, in the order of its forms.
        names = ["vertices", "vertices_t0", "vertices_t1", "edges", "faces", "inflation_radius"]
        given = [*args, *(named[key] for key in names if key in named)]
        self.clear()
        n_arrays = sum(np.ndim(array) == 2 for array in given)
        *ends, edges, faces = given[:n_arrays]
        radius = given[n_arrays] if len(given) > n_arrays else 0.0
        dimension = ends[0].shape[1]
        # ipctk's part must know the dimension. It clears this object.
        edge, face = np.empty((0, 2), np.int32), np.empty((0, 3), np.int32)
        super().build(np.zeros((1, dimension)), edge, face, 0.0)
        if dimension == 2:
            self._flat = ipctk.LBVH()
            self._flat.can_vertices_collide = self.can_vertices_collide
            self._flat.build(*given)
            return
        from .ipc import _positions

        mesh = self._mesh_of(ends[0], edges, faces)
        of_step = ["vertices_t0", "vertices_t1"]
        ends = [
            _positions(mesh, np.asarray(end, np.float64), name)
            for end, name in zip(ends, of_step if len(ends) == 2 else ["vertices"])
        ]
        self._question = Question(mesh, ends, radius, self._mode)

    def clear(self) -> None:
        """Forgets positions and pairs."""
        super().clear()
        self._question = self._flat = None

    def detect_vertex_vertex_candidates(self) -> list[ipctk.VertexVertexCandidate]:
        """Pairs of vertices."""
        return self._detect("vv", "vertex_vertex")

    def detect_edge_vertex_candidates(self) -> list[ipctk.EdgeVertexCandidate]:
        """Pairs of an edge and a vertex."""
        return self._detect("ev", "edge_vertex")

    def detect_edge_edge_candidates(self) -> list[ipctk.EdgeEdgeCandidate]:
        """Pairs of edges."""
        return self._detect("ee", "edge_edge")

    def detect_face_vertex_candidates(self) -> list[ipctk.FaceVertexCandidate]:
        """Pairs of a face and a vertex."""
        return self._detect("vf", "face_vertex")

    def detect_edge_face_candidates(self) -> list[ipctk.EdgeFaceCandidate]:
        """Pairs of an edge and a face."""
        return self._detect("ef", "edge_face")

    def detect_face_face_candidates(self) -> list[ipctk.FaceFaceCandidate]:
        """Pairs of faces."""
        return self._detect("ff", "face_face")

    def _detect(self, kind: str, name: str) -> list[Any]:
        if self._flat is not None:
            found: list[Any] = getattr(self._flat, f"detect_{name}_candidates")()
            return found
        if self._question is None:
            # Without this, ipctk would take it that nothing is near.
            raise RuntimeError(
                "BroadPhase: nothing was built. (From a Python function that is called build, too, and whose first "
                "argument is the broad phase, ipctk takes its own build instead of this one.)"
            )
        rows = self._question.find(kind)
        allowed = labels_of(self.can_vertices_collide, self._question.n_vertices)
        rows = self._question.passing(kind, rows, *allowed)
        return objects(ipctk, kind, rows)

    def _mesh_of(self, vertices: Any, edges: Any, faces: Any) -> CollisionMesh:
        """The mesh with this topology, which is kept."""
        from .ipc import CollisionMesh

        for ix, (mesh, own_edges, own_faces) in enumerate(self._meshes):
            same = mesh.num_vertices == len(vertices)
            if same and np.array_equal(own_edges, edges) and np.array_equal(own_faces, faces):
                self._meshes.insert(0, self._meshes.pop(ix))
                return mesh
        mesh = CollisionMesh(vertices, edges.reshape(-1, 2), faces.reshape(-1, 3))
        # Copies that lie in memory as theirs do, which are compared at once.
        self._meshes.insert(0, (mesh, edges.copy("K"), faces.copy("K")))
        del self._meshes[_MESHES_KEPT:]
        return mesh
