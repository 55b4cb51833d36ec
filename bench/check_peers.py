"""Peers of `impinge check`, each in a process of its own, and the child's side of that process.

    python bench/check_peers.py NAME        # reads questions from standard input; `check.py` starts this

A peer reads a file with its own reader, welds vertices at the same position, and answers what it has a function for. Each question is one line of JSON, each answer too. Importing a peer and handing answers over are not timed.
"""

import contextlib
import importlib.metadata
import json
import os
import pathlib
import select
import signal
import subprocess
import sys
import time

import numpy as np

from check_truth import FOLD, SAME, VERTEX_CROSS, VERTEX_PLANE, VERTEX_TOUCH, ZERO_AREA
from meshes import read_ply


class Peer:
    """The interface of all peers. `counts` has the keys of a row of `impinge check`."""

    #: Its name in tables, what to install, and a line on how it is used.
    label, package, how = "", "", ""
    #: Kinds of self-intersections that are none by the peer's own definition.
    leaves_out = ()
    #: That definition, with where it says so.
    definition = ""
    #: Why it has wrong answers, as far as its source or a small test says.
    why = ""
    #: Whether it finds self-intersections as pairs, as faces, as one yes or no per mesh, or not at all.
    finds = "pairs"
    #: The most triangles of a mesh that it is asked about, or None.
    most = None

    @classmethod
    def installed(cls):
        """The installed version."""
        return importlib.metadata.version(cls.package)

    def read(self, path):
        """Reads and welds."""

    def corners(self):
        """The corners of all faces as read, (n, 3, 3)."""

    def counts(self):
        """What is wrong with the mesh, except self-intersections."""

    def intersections(self):
        """Pairs of faces (n, 2), a mask of faces (n,), or one yes or no (1,)."""


class Trimesh(Peer):
    label, package, finds = "trimesh", "trimesh", None
    why = (
        "`merge_vertices` welds on a grid of 1e-8 in 64-bit integers, which coordinates beyond 9.2e10 do not fit: most vertices "
        "become one"
    )
    how = (
        "`load(process=False)`, `merge_vertices`, `nondegenerate_faces(height=0)`, `unique_faces`, `edges_unique_inverse`, "
        "`face_adjacency`"
    )

    def __init__(self):
        import trimesh

        self.trimesh = trimesh

    def read(self, path):
        self.mesh = self.trimesh.load(path, process=False, force="mesh")
        self.read_corners = self.mesh.vertices[self.mesh.faces]
        self.mesh.merge_vertices()

    def corners(self):
        return self.read_corners

    def counts(self):
        mesh = self.mesh
        n_faces = np.bincount(mesh.edges_unique_inverse)
        labels = self.trimesh.graph.connected_component_labels(mesh.face_adjacency, len(mesh.faces))
        return {
            "degenerate": int((~mesh.nondegenerate_faces(height=0)).sum()),
            "duplicate_faces": int((~mesh.unique_faces()).sum()),
            "non_manifold_edges": int((n_faces > 2).sum()),
            "boundary_edges": int((n_faces == 1).sum()),
            "components": int(labels.max()) + 1 if len(labels) else 0,
        }


class Open3d(Peer):
    label, package = "Open3D", "open3d"
    how = (
        "`read_triangle_mesh`, `remove_duplicated_vertices`, `get_non_manifold_edges`, `cluster_connected_triangles`, "
        "`remove_degenerate_triangles`, `remove_duplicated_triangles`, `get_self_intersecting_triangles`"
    )
    leaves_out = (VERTEX_CROSS, VERTEX_TOUCH, VERTEX_PLANE, FOLD, SAME)
    definition = "pairs that share a vertex are never tested"
    why = "the test of two triangles has tolerances; the reader of OBJ files rounds"
    # Every pair is tested.
    most = 1500

    def __init__(self):
        import open3d

        open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
        self.open3d = open3d

    def read(self, path):
        self.mesh = self.open3d.io.read_triangle_mesh(path)
        if not self.mesh.has_triangles():
            # An unreadable file is an empty mesh here, with a warning.
            raise ValueError("no triangles")
        self.read_corners = np.asarray(self.mesh.vertices)[np.asarray(self.mesh.triangles)]
        self.mesh.remove_duplicated_vertices()

    def corners(self):
        return self.read_corners

    def intersections(self):
        return np.asarray(self.mesh.get_self_intersecting_triangles()).reshape(-1, 2)

    def counts(self):
        mesh = self.mesh
        n_beyond = len(mesh.get_non_manifold_edges(allow_boundary_edges=True))
        n_not_two = len(mesh.get_non_manifold_edges(allow_boundary_edges=False))
        n_components = len(mesh.cluster_connected_triangles()[1])
        n = len(mesh.triangles)
        n_degenerate = n - len(mesh.remove_degenerate_triangles().triangles)
        n -= n_degenerate
        return {
            "degenerate": n_degenerate,
            "duplicate_faces": n - len(mesh.remove_duplicated_triangles().triangles),
            "non_manifold_edges": n_beyond,
            "boundary_edges": n_not_two - n_beyond,
            "components": n_components,
        }


class MeshLab(Peer):
    label, package, finds = "MeshLab (pymeshlab)", "pymeshlab", "faces"
    how = (
        "`load_new_mesh`, `meshing_remove_duplicate_vertices`, `get_topological_measures`, "
        "`compute_selection_by_self_intersections_per_face`, `meshing_remove_duplicate_faces`, `meshing_remove_null_faces`"
    )
    leaves_out = (FOLD, VERTEX_TOUCH, VERTEX_PLANE)
    definition = (
        "pairs that share an edge are never tested; of pairs that share a vertex, the opposite edge of each, moved halfway "
        "to the vertex, is tested against the other, so what only touches or lies in one plane is left out (vcglib, clean.h)"
    )
    why = (
        "nothing is found between faces in one plane that is parallel to a coordinate plane, not even duplicates; touching faces are "
        "often missed; the reader drops faces that name a vertex twice"
    )

    def __init__(self):
        import pymeshlab

        self.pymeshlab = pymeshlab

    def read(self, path):
        self.set = self.pymeshlab.MeshSet(verbose=False)
        self.set.load_new_mesh(path)
        self.set.meshing_remove_duplicate_vertices()

    def corners(self):
        mesh = self.set.current_mesh()
        return mesh.vertex_matrix()[mesh.face_matrix()]

    def intersections(self):
        self.set.compute_selection_by_self_intersections_per_face()
        return self.set.current_mesh().face_selection_array()

    def counts(self):
        measures = self.set.get_topological_measures()
        mesh = self.set.current_mesh()
        n = mesh.face_number()
        self.set.meshing_remove_duplicate_faces()
        n_unique = mesh.face_number()
        self.set.meshing_remove_null_faces()
        return {
            "degenerate": n_unique - mesh.face_number(),
            "duplicate_faces": n - n_unique,
            "non_manifold_edges": measures["non_two_manifold_edges"],
            "boundary_edges": measures["boundary_edges"],
            "components": measures["connected_components_number"],
        }


class Libigl(Peer):
    label, package = "libigl (CGAL)", "libigl"
    how = (
        "`read_triangle_mesh`, `remove_duplicate_vertices(0)`, `doublearea`, `unique_simplices`, `unique_edge_map`, `facet_components`, "
        "`copyleft.cgal.remesh_self_intersections(detect_only=True)`"
    )
    leaves_out = (SAME, ZERO_AREA)
    why = "`detect_only` takes a kernel with inexact constructions, so the plane of a folded neighbour is rounded"
    definition = "faces of zero area are ignored, and so are pairs with the same three vertices (SelfIntersectMesh.h)"

    def __init__(self):
        import igl
        from igl.copyleft import cgal

        self.igl, self.cgal = igl, cgal

    def read(self, path):
        vertices, faces = self.igl.read_triangle_mesh(path)
        if faces.shape[1:] != (3,) or not len(faces):
            raise ValueError("no triangles")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise IndexError("a face names an absent vertex")
        self.read_corners = vertices[faces]
        self.vertices, _, _, self.faces = self.igl.remove_duplicate_vertices(vertices, faces, 0)

    def corners(self):
        return self.read_corners

    def intersections(self):
        return self.cgal.remesh_self_intersections(self.vertices, self.faces, detect_only=True)[2]

    def counts(self):
        n_faces = np.bincount(self.igl.unique_edge_map(self.faces)[2])
        return {
            "degenerate": int((self.igl.doublearea(self.vertices, self.faces) == 0).sum()),
            "duplicate_faces": len(self.faces) - len(self.igl.unique_simplices(self.faces)[0]),
            "non_manifold_edges": int((n_faces > 2).sum()),
            "boundary_edges": int((n_faces == 1).sum()),
            "components": int(self.igl.facet_components(self.faces)[0]),
        }


class LibiglPredicates(Libigl):
    label = "libigl (predicates)"
    how = "the same with `predicates.find_self_intersections`"
    leaves_out = ()
    definition = "no pair is left out"
    why = (
        "two faces that pass their common edge in the same direction count as neighbours at one vertex, and meet at the other; "
        "neighbours are tested with tolerances of 1e-8 and 1e-14 (find_intersections.cpp)"
    )

    def __init__(self):
        super().__init__()
        import igl.predicates

        self.predicates = igl.predicates

    def intersections(self):
        return self.predicates.find_self_intersections(self.vertices, self.faces)[1]


class MeshLib(Peer):
    label, package = "MeshLib", "meshlib"
    how = (
        "`loadMesh`, `uniteCloseVertices(0)`, `findDegenerateFaces`, `getAllComponents`, `findSelfCollidingTriangles(touchIsIntersection=True)`"
    )
    definition = "no pair is left out (MRMeshCollide.cpp)"
    why = (
        "its meshes are manifold: where more than two faces meet at an edge, vertices are doubled, and neighbours then touch; "
        "triangles are tested in doubles, those that share an edge with a tolerance of 1e-5"
    )

    def __init__(self):
        from meshlib import mrmeshnumpy, mrmeshpy

        self.meshlib, self.arrays = mrmeshpy, mrmeshnumpy

    def read(self, path):
        self.mesh = self.meshlib.loadMesh(path)
        if not self.mesh.topology.numValidFaces():
            raise ValueError("no triangles")
        self.meshlib.uniteCloseVertices(self.mesh, 0.0, False)

    def valid(self):
        """Which faces of its numbering are there."""
        return self.arrays.getNumpyBitSet(self.mesh.topology.getValidFaces())

    def corners(self):
        # Up to the last one that is there.
        faces = self.arrays.getNumpyFaces(self.mesh.topology)
        return self.arrays.getNumpyVerts(self.mesh)[faces[self.valid()[: len(faces)]]]

    def intersections(self):
        found = self.meshlib.findSelfCollidingTriangles(self.meshlib.MeshPart(self.mesh), touchIsIntersection=True)
        pairs = np.array([(pair.aFace.get(), pair.bFace.get()) for pair in found], np.int64).reshape(-1, 2)
        return (np.cumsum(self.valid()) - 1)[pairs]

    def counts(self):
        part = self.meshlib.MeshPart(self.mesh)
        return {
            "degenerate": self.meshlib.findDegenerateFaces(part).count(),
            "components": len(self.meshlib.getAllComponents(part)),
        }


class Trueform(Peer):
    label, package, finds = "trueform", "trueform", "mesh"
    how = (
        "`read_obj`, `read_stl` (PLY by this bench), `cleaned(remove_duplicate_primitives=False)`, `non_manifold_edges`, `boundary_edges`, "
        "`manifold_edge_link` with `label_connected_components`, `has_self_intersections`, which answers yes or no"
    )
    leaves_out = (VERTEX_CROSS, VERTEX_TOUCH, VERTEX_PLANE, FOLD, SAME)
    definition = "faces that share a vertex are never tested (its documentation)"
    why = (
        "vertices are moved to a lattice (its documentation); wrong are meshes with parts that are tiny beside the whole, and meshes "
        "with faces of zero area"
    )

    def __init__(self):
        import trueform

        self.trueform = trueform

    def read(self, path):
        reader = {".obj": lambda path: self.trueform.read_obj(path, ngon=3), ".stl": self.trueform.read_stl}
        faces, vertices = reader[path[-4:]](path) if path[-4:] in reader else read_ply(pathlib.Path(path))[::-1]
        if not len(faces):
            raise ValueError("no triangles")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise IndexError("a face names an absent vertex")
        self.read_corners = vertices[faces]
        faces, vertices = self.trueform.cleaned(
            (np.ascontiguousarray(faces, np.int32), vertices), remove_duplicate_primitives=False
        )
        self.mesh = self.trueform.Mesh(faces, vertices)

    def corners(self):
        return self.read_corners

    def intersections(self):
        return np.array([self.trueform.has_self_intersections(self.mesh)])

    def counts(self):
        links = self.trueform.manifold_edge_link(self.mesh.faces, self.mesh.face_membership)
        return {
            "non_manifold_edges": len(self.trueform.non_manifold_edges(self.mesh)),
            "boundary_edges": len(self.trueform.boundary_edges(self.mesh)),
            "components": self.trueform.label_connected_components(links)[0],
        }


PEERS = {kind.__name__: kind for kind in [Trimesh, Open3d, MeshLab, MeshLib, Libigl, LibiglPredicates, Trueform]}


def answered(peer, question):
    """The answer to one question: seconds per step, counts, and what went wrong."""
    answer = {"seconds": {}, "wall": 0.0, "errors": {}, "counts": {}}

    def timed(step, work):
        wall, processor = time.perf_counter(), time.process_time()
        try:
            return work()
        except Exception as error:
            answer["errors"][step] = f"{type(error).__name__}: {error}".split("\n")[0][:200]
        finally:
            answer["seconds"][step] = time.process_time() - processor
            answer["wall"] += time.perf_counter() - wall

    timed("read", lambda: peer.read(question["path"]))
    if answer["errors"]:
        return answer
    found = None
    with contextlib.suppress(Exception):
        np.save(question["corners"], peer.corners())
    if peer.finds:
        found = timed("self", peer.intersections)
    answer["counts"] = timed("counts", peer.counts) or {}
    if found is not None:
        np.save(question["found"], found)
    return answer


class Child:
    """A peer in a process of its own, on one core, which may crash or hang."""

    def __init__(self, name, core):
        self.name, self.core, self.process = name, core, None

    def start(self):
        # One thread, also where a core cannot be chosen.
        names = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "TBB_NUM_THREADS", "IGL_NUM_THREADS"]
        environment = os.environ | dict.fromkeys(names, "1")
        command = [sys.executable, __file__, self.name, str(-1 if self.core is None else self.core)]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )
        return self.hear(120)

    def hear(self, seconds):
        """The next line of JSON, or the way in which the process failed."""
        heard = b""
        until = time.monotonic() + seconds
        while not heard.endswith(b"\n"):
            ready, _, _ = select.select([self.process.stdout], [], [], max(0, until - time.monotonic()))
            part = os.read(self.process.stdout.fileno(), 1 << 16) if ready else None
            if not part:
                self.process.kill()
                code = self.process.wait()
                self.process = None
                if part is None:
                    return {"failed": "timeout"}
                died = signal.Signals(-code).name if code < 0 else f"exit code {code}"
                return {"failed": f"crash ({died})"}
            heard += part
        return json.loads(heard)

    def ask(self, question, seconds):
        """The peer's answer, or `failed`; the process is started if there is none."""
        if self.process is None:
            began = self.start()
            if began.get("failed") or began.get("missing"):
                return began
        try:
            self.process.stdin.write(json.dumps(question).encode() + b"\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            # It has died after its last answer, which says nothing of this file.
            self.process.wait()
            self.process = None
            return self.ask(question, seconds)
        return self.hear(seconds)

    def end(self):
        if self.process:
            self.process.stdin.close()
            self.process.wait()
            self.process = None


def serve(name, core):
    """The child's side: answers each line of standard input with one line."""
    answers = os.fdopen(os.dup(1), "w")
    # Peers print to standard output.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    if core >= 0:
        os.sched_setaffinity(0, {core})

    def say(words):
        answers.write(json.dumps(words) + "\n")
        answers.flush()

    try:
        peer = PEERS[name]()
    except ImportError as error:
        say({"missing": str(error)})
        return
    say({"version": peer.installed()})
    for line in sys.stdin:
        say(answered(peer, json.loads(line)))


if __name__ == "__main__":
    serve(sys.argv[1], int(sys.argv[2]))
