"""impinge and its peers behind one interface, each used in its fastest way.

A contender gets the topology once (`start`), is handed arrays in the type and layout that it takes
without a conversion (`arrays`, not timed), does what moved vertices demand (`build`), answers
(`query`), and hands out the pairs of its last answer for checking (`pairs`, not timed).
"""

import importlib.metadata

import numpy as np

import impinge

#: More contacts than any scene has, for peers that stop at a number.
ALL = 100_000_000


def as_keys(pairs):
    """Sorted 64-bit keys of (n, 2) pairs, each once."""
    pairs = np.asarray(pairs, np.uint64).reshape(-1, 2)
    return np.unique(pairs[:, 0] << np.uint64(32) | pairs[:, 1])


class Contender:
    """The interface of all contenders."""

    #: Its name in tables, and what to install.
    label, package = "", ""
    #: Whether it claims that its pairs are exact.
    exact = False
    #: Two meshes, one mesh with itself, tetrahedra, answers, when vertices move.
    abilities = ()
    settings = "defaults"
    #: The most pairs with boxes that overlap for which there is memory.
    most_boxes = float("inf")

    @property
    def name(self):
        return self.label

    @property
    def version(self):
        return importlib.metadata.version(self.package)

    def build_within_query_ms(self):
        """Time within `query` that belongs to the build, because the vertices had moved."""
        return 0.0

    def once_ms(self):
        """Time spent once per topology, or None if there is none."""
        return None


class Impinge(Contender):
    """This library, with float32 positions like the frames."""

    label, package, exact = "impinge", "impinge", True
    abilities = (
        "yes",
        "yes, neighbours by a named rule",
        "yes, and with triangles",
        "exact, float32 and float64, sorted",
        "refit; clustered once",
    )

    def __init__(self, words, **settings):
        self.words = words
        self.keywords = settings
        self.settings = ", ".join(f"{k}={v!r}" for k, v in settings.items()) or "defaults"

    @property
    def name(self):
        return f"**impinge**{self.words}"

    def start(self, faces_a, faces_b, vertices_a, vertices_b):
        self.scene = impinge.Scene()
        self.a = self.scene.add(vertices_a, faces_a)
        self.b = self.scene.add(vertices_b, faces_b)
        self.detector = impinge.Detector(**self.keywords)
        self.query()
        self.clustering = self.result.stats.stages.get("clustering")

    def arrays(self, vertices_a, vertices_b):
        return vertices_a, vertices_b

    def build(self, arrays):
        self.scene.set_positions(self.a, arrays[0])
        self.scene.set_positions(self.b, arrays[1])

    def query(self):
        self.result = self.detector.detect(self.scene, between=(self.a, self.b))

    def build_within_query_ms(self):
        stages = self.result.stats.stages
        return stages.get("bounds", 0.0) + stages.get("clustering", 0.0)

    def once_ms(self):
        return self.clustering

    def pairs(self):
        return self.result.between(self.a, self.b)


class Peer(Contender):
    """One that takes vertices as float64 and faces as int64."""

    def start(self, faces_a, faces_b, vertices_a, vertices_b):
        self.faces = (
            np.ascontiguousarray(faces_a, np.int64),
            np.ascontiguousarray(faces_b, np.int64),
        )

    def arrays(self, vertices_a, vertices_b):
        return vertices_a.astype(np.float64), vertices_b.astype(np.float64)


class Libigl(Peer):
    """CGAL's exact kernel through libigl: boxes are sorted again at every call."""

    label, package, exact = "libigl (CGAL, exact kernel)", "libigl", True
    settings = "intersect_other, detect_only"
    abilities = ("yes", "yes", "no", "exact, float64", "starts again")

    def __init__(self):
        from igl.copyleft import cgal

        self.intersect = cgal.intersect_other

    def build(self, arrays):
        self.vertices = arrays

    def query(self):
        (a, b), (faces_a, faces_b) = self.vertices, self.faces
        self.answer = self.intersect(a, faces_a, b, faces_b, detect_only=True)[0]

    def pairs(self):
        return self.answer


class Coal(Peer):
    """Trees of boxes; the tree is rebuilt in each frame."""

    label, package = "Coal", "coal"
    abilities = (
        "yes",
        "no (a mesh meets its own neighbours)",
        "no",
        "floating point, float64",
        "rebuild, or refit",
    )
    tree, words, settings = "BVHModelOBB", ", rebuilt", "BVHModelOBB, all contacts"

    def __init__(self):
        import coal

        self.coal = coal
        flag = coal.CollisionRequestFlag.CONTACT
        self.request = coal.CollisionRequest(flag, ALL)
        self.identity = coal.Transform3s()

    @property
    def name(self):
        return self.label + self.words

    def model(self, vertices, faces):
        model = getattr(self.coal, self.tree)()
        model.beginModel(len(faces), len(vertices))
        model.addVertices(vertices)
        model.addTriangles(faces)
        model.endModel()
        return model

    def build(self, arrays):
        self.models = [self.model(*mesh) for mesh in zip(arrays, self.faces)]

    def query(self):
        self.answer = self.coal.CollisionResult()
        a, b = self.models
        here = self.identity
        self.coal.collide(a, here, b, here, self.request, self.answer)

    def pairs(self):
        return [(contact.b1, contact.b2) for contact in self.answer.getContacts()]


class CoalRefit(Coal):
    """The same trees, refitted; copying NumPy rows into Coal's own vectors is not counted."""

    words = ", refitted"

    def start(self, faces_a, faces_b, vertices_a, vertices_b):
        super().start(faces_a, faces_b, vertices_a, vertices_b)
        super().build(super().arrays(vertices_a, vertices_b))

    def arrays(self, vertices_a, vertices_b):
        vectors = []
        for vertices in super().arrays(vertices_a, vertices_b):
            vectors.append(self.coal.StdVec_Vec3s())
            vectors[-1].extend(list(vertices))
        return vectors

    def build(self, arrays):
        for model, vertices in zip(self.models, arrays):
            model.beginReplaceModel()
            model.replaceSubModel(vertices)
            model.endReplaceModel(True, True)


class Fcl(Peer):
    """Trees of boxes; its Python module has no refit."""

    label, package = "FCL, rebuilt", "python-fcl"
    settings = "BVHModel, all contacts"
    abilities = (
        "yes",
        "no (a mesh meets its own neighbours)",
        "no",
        "floating point, float64",
        "rebuild (no refit in Python)",
    )

    def __init__(self):
        import fcl

        self.fcl = fcl
        self.request = fcl.CollisionRequest(num_max_contacts=ALL, enable_contact=True)

    def build(self, arrays):
        self.objects = []
        for vertices, faces in zip(arrays, self.faces):
            model = self.fcl.BVHModel()
            model.beginModel(len(vertices), len(faces))
            model.addSubModel(vertices, faces)
            model.endModel()
            self.objects.append(self.fcl.CollisionObject(model))

    def query(self):
        self.answer = self.fcl.CollisionResult()
        self.fcl.collide(*self.objects, self.request, self.answer)

    def pairs(self):
        return [(contact.b1, contact.b2) for contact in self.answer.contacts]


class IpcToolkit(Contender):
    """Pairs of faces whose boxes overlap: the broad phase, without a test of the triangles."""

    label, package = "ipc-toolkit, LBVH candidates", "ipctk"
    settings = "LBVH without edges, two patches, all threads"
    most_boxes = 20_000_000
    abilities = (
        "boxes only",
        "boxes only (edge-face: yes or no)",
        "no",
        "candidates, not pairs",
        "rebuild",
    )

    def __init__(self):
        import ipctk

        self.toolkit = ipctk

    def start(self, faces_a, faces_b, vertices_a, vertices_b):
        self.n_faces_a = len(faces_a)
        faces = np.vstack([faces_a, faces_b + len(vertices_a)])
        self.faces = np.asfortranarray(faces, np.int32)
        # Vertices and faces are all that a pair of faces needs.
        self.edges = np.zeros((0, 2), np.int32, order="F")
        patches = np.repeat([0, 1], [len(vertices_a), len(vertices_b)]).astype(np.int32)
        self.tree = self.toolkit.LBVH()
        self.tree.can_vertices_collide = self.toolkit.make_vertex_patches_filter(patches)

    def arrays(self, vertices_a, vertices_b):
        return np.asfortranarray(np.vstack([vertices_a, vertices_b]), np.float64)

    def build(self, arrays):
        self.tree.build(arrays, self.edges, self.faces)

    def query(self):
        self.answer = self.tree.detect_face_face_candidates()

    def pairs(self):
        pairs = np.array([(c.face0_id, c.face1_id) for c in self.answer]).reshape(-1, 2)
        return np.sort(pairs, axis=1) - [0, self.n_faces_a]


def available():
    """The contenders that can be run here, impinge first, and the peers that are missing."""
    present = [Impinge("", backend="cpu"), Impinge(", one thread", backend="cpu", threads=1)]
    missing = []
    # By default a detector uses a GPU only if it is real hardware.
    gpu = Impinge("", backend="auto")
    gpu.start(*[np.array([[0, 1, 2]])] * 2, *[np.eye(3, dtype=np.float32)] * 2)
    if gpu.result.stats.backend != "cpu":
        gpu.words = f", {gpu.result.stats.backend}"
        present.append(gpu)
    for peer in [Libigl, Coal, CoalRefit, Fcl, IpcToolkit]:
        try:
            present.append(peer())
        except ImportError:
            if peer is not CoalRefit:
                missing.append(peer)
    return present, missing


def reference(present):
    """The contender for the exact pairs: CGAL if it is installed, else impinge's other method."""
    exact = [contender for contender in present if isinstance(contender, Libigl)]
    return exact[0] if exact else Impinge("'s other method", method="cells")
