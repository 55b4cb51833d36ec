"""`impinge.ipc.BroadPhase` and `candidates` in the place of ipc-toolkit's own, beside its brute force."""

import doctest
import os
import subprocess
import sys

import numpy as np
import pytest

from impinge import _filters, ipc
from shapes import ball

ipctk = pytest.importorskip("ipctk", reason="ipctk is not installed: no comparison with it")
ipctk.set_logger_level(ipctk.LoggerLevel.off)

FIELDS = {
    "vv": ("vertex0_id", "vertex1_id"),
    "ev": ("edge_id", "vertex_id"),
    "ee": ("edge0_id", "edge1_id"),
    "fv": ("face_id", "vertex_id"),
}


def rows_of(objects, names):
    """Objects of ipctk as a set of pairs, which is as large as the list."""
    pairs = [tuple(getattr(pair, name) for name in names) for pair in objects]
    if names[0][:-4] == names[1][:-4]:
        pairs = [tuple(sorted(pair)) for pair in pairs]
    assert len(set(pairs)) == len(pairs)
    return set(pairs)


def sets_of(candidates):
    return {kind: rows_of(getattr(candidates, f"{kind}_candidates"), names) for kind, names in FIELDS.items()}


def built(mesh, *ends, radius, by):
    candidates = ipctk.Candidates()
    candidates.build(mesh, *ends, radius, by)
    return candidates


def scene(seed, with_faces=True):
    """Faces (two with the same vertices), edges of no face (one hangs on a face), vertices of neither, anywhere in a cube; a step."""
    random = np.random.default_rng(seed)
    start = random.random((28, 3))
    faces = np.array([random.choice(9, 3, replace=False) for _ in range(7)], np.int32)
    faces[6] = faces[5, [1, 0, 2]]
    faces = faces if with_faces else faces[:0]
    edges = ipctk.edges(faces) if with_faces else np.arange(8).reshape(-1, 2)
    edges = np.vstack([edges, [[9, 10], [12, 11], [3, 13], [12, 14]]]).astype(np.int32)
    # The rows of a program that numbers its edges in its own way.
    edges = random.permutation(edges)
    flip = random.random(len(edges)) < 0.5
    edges[flip] = edges[flip, ::-1]
    mesh = ipctk.CollisionMesh(start, edges, faces)
    return mesh, start, start + 0.1 * random.standard_normal(start.shape)


def distances(mesh, at, candidates):
    """The pairs of candidates, each with its squared distance."""
    stencils = [*candidates.vv_candidates, *candidates.ev_candidates]
    stencils += [*candidates.ee_candidates, *candidates.fv_candidates]
    found = []
    for stencil in stencils:
        dof = stencil.dof(at, mesh.edges, mesh.faces)
        found.append((stencil, stencil.compute_distance(dof)))
    return found


def key(stencil):
    for kind, names in FIELDS.items():
        if all(hasattr(stencil, name) for name in names):
            pair = tuple(getattr(stencil, name) for name in names)
            return kind, tuple(sorted(pair)) if kind in ("vv", "ee") else pair
    raise AssertionError(stencil)


@pytest.mark.parametrize("with_faces", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_boxes_are_those_of_brute_force(seed, with_faces):
    mesh, start, end = scene(seed, with_faces)
    for ends in [(start,), (start, end)]:
        for radius in [0.0, 0.05]:
            theirs = sets_of(built(mesh, *ends, radius=radius, by=ipctk.BruteForce()))
            ours = sets_of(built(mesh, *ends, radius=radius, by=ipc.BroadPhase("boxes")))
            assert ours == theirs
            arrays = ipc.candidates(mesh, *ends, inflation_radius=radius, mode="boxes")
            assert sets_of(arrays.to_ipctk()) == theirs
            assert len(arrays) == sum(map(len, theirs.values()))


@pytest.mark.parametrize("with_faces", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_exact_pairs_are_all_that_come_near(seed, with_faces):
    mesh, start, end = scene(seed, with_faces)
    radius = 0.03 if with_faces else 0.1
    for ends in [(start,), (start, end)]:
        every = built(mesh, *ends, radius=100.0, by=ipctk.BruteForce())
        # Rounded as boxes of single precision are.
        boxes = sets_of(built(mesh, *ends, radius=radius + 1e-5, by=ipctk.BruteForce()))
        found = built(mesh, *ends, radius=radius, by=ipc.BroadPhase())
        ours = sets_of(found)
        assert ours == sets_of(ipc.candidates(mesh, *ends, inflation_radius=radius).to_ipctk())
        assert all(ours[kind] <= boxes[kind] for kind in FIELDS)
        assert 0 < len(found) < sum(map(len, boxes.values()))
        nearest = {}
        for moment in np.linspace(0, 1, 33) if len(ends) == 2 else [0]:
            at = np.asfortranarray(start + moment * (end - start))
            for stencil, squared in distances(mesh, at, every):
                pair = key(stencil)
                nearest[pair] = min(squared, nearest.get(pair, np.inf))
        near = {pair for pair, squared in nearest.items() if squared <= (2 * radius) ** 2}
        mine = {(kind, pair) for kind in FIELDS for pair in ours[kind]}
        assert near <= mine
        if len(ends) == 1:
            assert near == mine
        # Steps reach farther, by the square root of 3, and moments are samples.
        assert all(nearest[pair] <= (4 * radius) ** 2 for pair in mine)


def collisions_of(mesh, at, dhat, **how):
    collisions = ipctk.NormalCollisions()
    collisions.build(mesh, at, dhat, 0.0, **how)
    return collisions


def assert_same_collisions(ours, theirs):
    """The same collisions with the same weights, in whatever order."""
    for kind, names in FIELDS.items():
        lists = []
        for collisions in (ours, theirs):
            rows = [
                (*key(collision)[1], collision.weight, collision.dmin)
                for collision in getattr(collisions, f"{kind}_collisions")
            ]
            lists.append(sorted(rows))
        assert lists[0] == lists[1], kind
    assert len(ours) == len(theirs)


@pytest.mark.parametrize("seed", range(6))
def test_collisions_and_steps_are_the_same(seed):
    mesh, start, end = scene(seed)
    start = np.asfortranarray(start)
    theirs = collisions_of(mesh, start, 0.1)
    assert len(theirs) > 3
    assert_same_collisions(collisions_of(mesh, start, 0.1, broad_phase=ipc.BroadPhase()), theirs)
    from_arrays = ipctk.NormalCollisions()
    pairs = ipc.candidates(mesh, start, inflation_radius=0.05)
    from_arrays.build(pairs.to_ipctk(), mesh, start, 0.1)
    assert_same_collisions(from_arrays, theirs)
    barrier = ipctk.BarrierPotential(0.1, 1.0)
    gradients = [barrier.gradient(found, mesh, start) for found in (from_arrays, theirs)]
    np.testing.assert_allclose(*gradients, rtol=1e-12, atol=1e-12 * np.abs(gradients[1]).max())
    for part in [1.0, 0.25]:
        ends = start, start + part * (end - start)
        for question in ["compute_collision_free_stepsize", "is_step_collision_free"]:
            ask = getattr(ipctk, question)
            assert ask(mesh, *ends, 0.0, ipc.BroadPhase()) == ask(mesh, *ends, 0.0)
        for at in ends:
            assert ipctk.has_intersections(mesh, at, ipc.BroadPhase()) == ipctk.has_intersections(mesh, at)


@pytest.mark.parametrize("seed", range(3))
def test_balls_that_approach(seed):
    """Steps that are neither none nor whole, with a distance to keep, and what Offset Geometric Contact asks for."""
    vertices, faces = ball(8, 12, np.float64)
    faces = np.vstack([faces, faces + len(vertices)]).astype(np.int32)
    random = np.random.default_rng(seed)
    start = np.vstack([vertices, vertices + [0, 0, 2.05]])
    start += 1e-3 * random.standard_normal(start.shape)
    end = start + 0.05 * random.standard_normal(start.shape)
    end[len(vertices) :, 2] -= 0.5
    mesh = ipctk.CollisionMesh(start, ipctk.edges(faces), faces)
    ours = ipc.BroadPhase()
    step = ipctk.compute_collision_free_stepsize
    for distance in [0.0, 1e-3, 1e-2]:
        theirs = step(mesh, start, end, distance)
        assert 0 < theirs < 0.2 and step(mesh, start, end, distance, ours) == theirs
    # This one leaves each pair a share of its distance, however large.
    additive = ipctk.AdditiveCCD()
    longer = step(mesh, start, end, 0.0, ours, additive)
    assert longer >= step(mesh, start, end, 0.0, None, additive)
    assert ipc.is_step_collision_free(mesh, start, start + longer * (end - start))
    regions = []
    for broad_phase in [ours, ipctk.LBVH()]:
        region = ipctk.ogc.TrustRegion(0.05)
        collisions = ipctk.NormalCollisions()
        x = np.asfortranarray(start)
        predicted = np.asfortranarray(end)
        region.warm_start_time_step(mesh, x, predicted, collisions, 0.05, 0.0, broad_phase)
        regions.append((x, region.trust_region_radii, len(collisions)))
    # But for the order of two edges, and with it the last bit of their distance.
    np.testing.assert_allclose(regions[0][0], regions[1][0], rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(regions[0][1], regions[1][1], rtol=1e-12)
    assert regions[0][2] == regions[1][2] > 50


def test_one_object_serves_many_meshes_in_turn():
    broad_phase = ipc.BroadPhase()
    for seed in [0, 1, 0, 2, 3, 4, 1]:
        mesh, start, end = scene(seed)
        for ends in [(start, end), (start,), (end, start)]:
            found = built(mesh, *ends, radius=0.03, by=broad_phase)
            assert sets_of(found) == sets_of(built(mesh, *ends, radius=0.03, by=ipc.BroadPhase()))
    assert len(broad_phase._meshes) <= 4
    # Positions are forgotten until it is built again.
    broad_phase.clear()
    with pytest.raises(RuntimeError, match="^BroadPhase: nothing was built"):
        broad_phase.detect_edge_edge_candidates()
    assert broad_phase.name() == "impinge" and ipc.BroadPhase("boxes").name() == "impinge (boxes)"


def test_near_pairs_come_from_a_list_while_little_moves():
    mesh, at, _ = scene(5)
    random = np.random.default_rng(5)
    broad_phase = ipc.BroadPhase()
    margins = []
    for radius in [0.05, 0.05, 0.05, 0.08, 0.0, 0.08, 1.0, 1.0, 0.004, 0.05, 0.05]:
        at = at + 0.0005 * random.standard_normal(at.shape)
        found = built(mesh, at, radius=radius, by=broad_phase)
        # A new object has no list yet.
        assert sets_of(found) == sets_of(built(mesh, at, radius=radius, by=ipc.BroadPhase()))
        margins.append(broad_phase._meshes[0][0]._held().detector.settings["reuse_margin"])
    # A quarter of the distance, twice the radius; the same for others of about that size.
    np.testing.assert_allclose(margins, [0.025] * 6 + [0.5, 0.5, 0.002] + [0.025] * 2, rtol=1e-6)
    with pytest.raises(ValueError, match="^distance: inf given"):
        ipc.candidates(mesh, at, inflation_radius=1e308)


def test_a_seldom_question():
    """Kinds of pairs that ipctk asks no mesh in three dimensions for."""
    mesh, start, end = scene(3)
    ours, theirs = ipc.BroadPhase(), ipctk.BruteForce()
    for ends in [(start,), (start, end)]:
        for broad_phase in (ours, theirs):
            broad_phase.build(*ends, mesh.edges, mesh.faces, 0.2)
        for name in ["vertex_vertex", "edge_vertex", "edge_face", "face_face"]:
            lists = [getattr(by, f"detect_{name}_candidates")() for by in (ours, theirs)]
            assert len(lists[0]) > 0
            names = [name for name in dir(lists[0][0]) if name.endswith("_id")]
            assert rows_of(lists[0], names) == rows_of(lists[1], names), name
    # The same by names, and without a radius.
    ours.build(vertices=start, edges=mesh.edges, faces=mesh.faces)
    theirs.build(vertices=start, edges=mesh.edges, faces=mesh.faces)
    names = FIELDS["ee"]
    near = rows_of(ours.detect_edge_edge_candidates(), names)
    assert near <= rows_of(theirs.detect_edge_edge_candidates(), names)


def test_a_function_that_hides_it_is_told():
    """pybind11 takes a call from a function with the name of a method and with its object first for one of that method."""
    mesh, start, _ = scene(0)

    def build(broad_phase):
        return built_by(broad_phase)

    def built_by(broad_phase):
        return built(mesh, start, radius=0.1, by=broad_phase)

    assert len(build(ipc.BroadPhase())) > 0
    candidates = ipctk.Candidates()

    def build(broad_phase):  # noqa: F811
        candidates.build(mesh, start, 0.1, broad_phase)

    with pytest.raises(RuntimeError, match="nothing was built"):
        build(ipc.BroadPhase())


def test_examples_of_docstrings_run():
    for module in [ipc, sys.modules[ipc.BroadPhase.__module__]]:
        results = doctest.testmod(module)
        assert results.failed == 0 and results.attempted > 5


def test_two_dimensions_go_to_ipc_toolkit():
    random = np.random.default_rng(1)
    points = random.random((30, 2))
    edges = np.arange(30, dtype=np.int32).reshape(-1, 2)
    mesh = ipctk.CollisionMesh(points, edges)
    theirs = built(mesh, points, radius=0.02, by=ipctk.LBVH())
    ours = built(mesh, points, radius=0.02, by=ipc.BroadPhase())
    assert sets_of(ours) == sets_of(theirs) and len(ours) > 5


def filters(mesh, labels):
    """Filters of ipctk's own, a combination, and one that calls Python."""
    return {
        "patches": ipctk.make_vertex_patches_filter(labels),
        "static": ipctk.make_static_obstacle_filter(12),
        "components": ipctk.make_connected_components_filter(mesh.faces),
        "sparse": ipctk.make_sparse_filter({(0, 5): True, (2, 9): True, (1, 14): True}, False),
        "both": ipctk.make_vertex_patches_filter(labels) & ~ipctk.make_static_obstacle_filter(12),
        "none": ipctk.CollisionFilter(lambda a, b: False),
        "odd": ipctk.CollisionFilter(lambda a, b: (a + b) % 2 == 1),
    }


@pytest.fixture
def one_thread():
    """ipctk's own broad phases wait for ever for filters that call Python from several threads."""
    n_threads = ipctk.get_num_threads()
    ipctk.set_num_threads(1)
    yield
    ipctk.set_num_threads(n_threads)


@pytest.fixture(params=["filters looked into", "filters called"])
def look(request, monkeypatch):
    """Whether what filters of ipctk are is known."""
    if request.param == "filters called":
        monkeypatch.setattr(_filters, "_known", {})


@pytest.mark.parametrize("seed", range(2))
def test_filters_are_respected(seed, one_thread, look):
    mesh, start, end = scene(seed)
    # The edges of no face are left out here: their vertices have no component.
    mesh = ipctk.CollisionMesh(start[:9], ipctk.edges(mesh.faces), mesh.faces)
    start, end = start[:9], end[:9]
    apart = ipctk.make_vertex_patches_filter(np.arange(9) // 5)
    labels = np.arange(9) // 5
    for name, may in {**filters(mesh, labels), "apart": apart}.items():
        mesh.can_collide = may
        for ends in [(start,), (start, end)]:
            counts = []
            for mode, by in [("boxes", ipctk.BruteForce()), ("exact", ipc.BroadPhase())]:
                theirs = sets_of(built(mesh, *ends, radius=0.1, by=by))
                arrays = ipc.candidates(mesh, *ends, inflation_radius=0.1, mode=mode)
                assert sets_of(arrays.to_ipctk()) == theirs, name
                counts.append(len(arrays))
                if mode == "boxes":
                    found = built(mesh, *ends, radius=0.1, by=ipc.BroadPhase("boxes"))
                    assert sets_of(found) == theirs, name
            assert counts[1] <= counts[0]
    mesh.can_collide = apart
    by_labels = ipc.candidates(mesh, start, inflation_radius=0.1, labels=labels)
    assert sets_of(by_labels.to_ipctk()) == sets_of(built(mesh, start, radius=0.1, by=ipc.BroadPhase()))

    def fails(a, b):
        raise KeyError("of the callback")

    mesh.can_collide = ipctk.CollisionFilter(fails)
    with pytest.raises(KeyError, match="of the callback"):
        built(mesh, start, radius=0.1, by=ipc.BroadPhase())


@pytest.mark.skipif(sys.platform != "linux", reason="filters are looked into on Linux")
def test_filters_that_are_not_called():
    n = 9
    faces = np.array([[0, 1, 2], [1, 2, 3], [5, 6, 8]], np.int32)
    patches = ipctk.make_vertex_patches_filter(np.array([4, 4, -1, 7, 7, 0, 0, 0, 1 << 30]))
    known = {
        "all": ipctk.CollisionFilter(),
        "static": ipctk.make_static_obstacle_filter(4),
        "no obstacle": ipctk.make_static_obstacle_filter(1 << 40),
        "patches": patches,
        "components": ipctk.make_connected_components_filter(faces),
    }
    for name, may in known.items():
        labels, left = _filters.labels_of(may, n)
        assert left is None, name
        labels = np.arange(n) if labels is None else labels
        for a in range(n):
            # A filter may let a vertex collide with itself; elements that share one never do.
            said = [may(a, b) for b in range(n) if b != a]
            assert said == [labels[a] != labels[b] for b in range(n) if b != a], name
    # Through a mesh, which has a copy, as through a broad phase.
    mesh = ipctk.CollisionMesh(np.eye(3), ipctk.edges(faces[:1]), faces[:1])
    assert _filters.labels_of(mesh.can_collide, 3) == (None, None)
    mesh.can_collide = patches
    assert _filters.labels_of(mesh.can_collide, 3)[0].tolist() == [4, 4, -1]
    called = {
        "sparse": ipctk.make_sparse_filter({(0, 1): False}, True),
        "both": patches & known["static"],
        "either": patches | known["static"],
        "not": ~patches,
        "of Python": ipctk.CollisionFilter(lambda a, b: True),
        "a function": lambda a, b: True,
        # ipctk itself would read beyond the end.
        "too few labels": ipctk.make_vertex_patches_filter(np.zeros(n - 1, np.int32)),
    }
    for name, may in called.items():
        assert _filters.labels_of(may, n) == (None, may), name


@pytest.mark.parametrize("shift", [1, 8])
def test_filters_are_called_where_memory_reads_otherwise(monkeypatch, shift):
    may = ipctk.make_static_obstacle_filter(4)
    read = _filters._read
    # Another layout, and a system that shows no memory.
    for wrong in [lambda at, n: read(at + shift, n), lambda at, n: os.pread(0, -1, 0)]:
        monkeypatch.setattr(_filters, "_known", None)
        monkeypatch.setattr(_filters, "_read", wrong)
        assert _filters.labels_of(may, 9) == (None, may)
        assert _filters._known == {}


def test_filters_are_called_where_ipctk_makes_none(monkeypatch):
    may = ipctk.make_static_obstacle_filter(4)
    monkeypatch.setattr(_filters, "_known", None)
    monkeypatch.delattr(ipctk, "make_vertex_patches_filter")
    assert _filters.labels_of(may, 9) == (None, may)


def test_loose_edges_beside_sides_and_alone():
    at = np.array(
        [
            [0, 0, 0],
            [1, 0, 0],
            [0, 1, 0],
            [0, 0, 0.05],
            [1, 0, 0.05],
            [0, 1, 0.05],
            [-1, 0.2, 0.02],
            [2, 0.2, 0.02],
        ]
    )
    faces = np.array([[0, 1, 2], [3, 4, 5]], np.int32)
    both = np.array([[6, 7], [0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3]], np.int32)
    for mode in ["exact", "boxes"]:
        # The sides of faces need not be edges of a program that asks by itself.
        for edges in [both, both[:1]]:
            for ends in [(at,), (at, at)]:
                found = []
                for broad_phase in [ipc.BroadPhase(mode), ipctk.BruteForce()]:
                    broad_phase.build(*ends, edges, faces, 0.3)
                    pairs = broad_phase.detect_edge_edge_candidates()
                    found.append(sorted((pair.edge0_id, pair.edge1_id) for pair in pairs))
                assert found[0] == found[1]
        # Two edges that approach: of steps, too, all kinds of pairs are found.
        start = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0.3], [1, 0, 0.3]])
        end = start - [[0, 0, 0], [0, 0, 0], [0, 0, 0.2], [0, 0, 0.2]]
        broad_phase = ipc.BroadPhase(mode)
        broad_phase.build(start, end, np.array([[0, 1], [2, 3]], np.int32), faces[:0], 0.1)
        assert len(broad_phase.detect_vertex_vertex_candidates()) == 2
        assert len(broad_phase.detect_edge_vertex_candidates()) == 4
        assert len(broad_phase.detect_edge_edge_candidates()) == 1


def test_candidates_as_arrays():
    mesh, start, end = scene(0)
    found = ipc.candidates(mesh, start, end, 0.05)
    arrays = [found.vv_candidates, found.ev_candidates, found.ee_candidates, found.fv_candidates]
    for rows in arrays:
        assert rows.dtype == np.int32 and rows.shape[1] == 2 and not rows.flags.writeable
    assert len(found) == sum(map(len, arrays)) and len(found.fv_candidates) > 0
    counts = [len(rows) for rows in arrays]
    assert repr(found) == "Candidates(vv: {}, ev: {}, ee: {}, fv: {})".format(*counts)
    vertices, faces = ball(6, 8, np.float64)
    # A mesh of this module has edges of faces by its rows, too.
    own = ipc.CollisionMesh(vertices, ipc.edges(faces), faces)
    theirs = ipctk.CollisionMesh(vertices, own.edges.astype(np.int32), faces.astype(np.int32))
    mine = ipc.candidates(own, vertices, inflation_radius=0.3)
    assert sets_of(mine.to_ipctk()) == sets_of(ipc.candidates(theirs, vertices, inflation_radius=0.3).to_ipctk())
    assert len(mine) > 100


def test_refusals():
    with pytest.raises(ValueError, match="^mode: 'lbvh' given, 'exact' or 'boxes' allowed"):
        ipc.BroadPhase("lbvh")
    mesh, start, end = scene(0)
    with pytest.raises(ValueError, match="^mode: 'all' given"):
        ipc.candidates(mesh, start, mode="all")
    for radius in [-1.0, np.nan, np.inf]:
        with pytest.raises(ValueError, match=f"^inflation_radius: {radius} given, a finite number"):
            ipc.candidates(mesh, start, inflation_radius=radius)
    with pytest.raises(ValueError, match=r"^vertices: shape \(28, 3\) expected"):
        ipc.candidates(mesh, start[:4])
    with pytest.raises(ValueError, match=r"^vertices_t1: shape \(28, 3\) expected"):
        ipc.candidates(mesh, start, end[:4])
    faces = [[0, 1, 2]]
    lacks = ipc.CollisionMesh(start[:3], [[0, 1], [2, 1]], faces)
    with pytest.raises(ValueError, match=r"^edges: a face has the edge \(0, 2\), which is not among"):
        ipc.candidates(lacks, start[:3])
    twice = ipc.CollisionMesh(start[:3], [[0, 1], [2, 1], [0, 2], [1, 0]], faces)
    with pytest.raises(ValueError, match=r"^edges\[0\] and edges\[3\]: both are the edge \(0, 1\)"):
        ipc.candidates(twice, start[:3])
    broad_phase = ipc.BroadPhase()
    for radius in [-0.01, np.nan, np.inf]:
        with pytest.raises(
            ValueError, match=f"^inflation_radius: {radius} given, a finite number of 0 or more"
        ):
            broad_phase.build(start, mesh.edges, mesh.faces, radius)
    with pytest.raises(
        ValueError, match=r"^vertices_t1: shape \(28, 3\) expected, as the mesh has, \(4, 3\) given"
    ):
        broad_phase.build(start, start[:4], mesh.edges, mesh.faces, 0.1)
    bad = start.copy()
    # A vertex of no edge.
    bad[27, 1] = np.nan
    with pytest.raises(ValueError, match=r"^vertices\[27, 1\] = nan: a position must be finite"):
        broad_phase.build(bad, mesh.edges, mesh.faces, 0.1)
    with pytest.raises(ValueError, match="finite"):
        built(mesh, bad, radius=0.1, by=broad_phase)
    # It goes on.
    assert len(built(mesh, start, radius=0.1, by=broad_phase)) > 0


def test_ipctk_need_not_be_installed():
    script = """
import sys
sys.modules["ipctk"] = None
import numpy as np
from impinge import _filters, ipc
from impinge.ipc import *
mesh = ipc.CollisionMesh(np.eye(3), [[0, 1], [1, 2], [0, 2]], [[0, 1, 2]])
found = candidates(mesh, np.eye(3), inflation_radius=1.0)
assert len(found) == 0
for ask in [lambda: ipc.BroadPhase, found.to_ipctk]:
    try:
        ask()
    except ModuleNotFoundError as error:
        assert "ipctk" in str(error)
    else:
        raise AssertionError("ipctk was not needed")
assert not hasattr(ipc, "NoSuchName")
"""
    out = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert out.returncode == 0, out.stderr


# Scenes that people know.

CLOTH = {"cloth-ball": ("cloth_ball92", "cloth_ball93"), "cloth-funnel": ("227", "228")}


@pytest.fixture(params=["cloth-ball", "cloth-funnel", "rumba"])
def known(request, data, root, monkeypatch):
    """Name, mesh, start and end of a step."""
    monkeypatch.syspath_prepend(str(root / "bench"))
    from meshes import read_frame, read_ply

    name = request.param
    if name == "rumba":
        _, faces = read_ply(data / "sequences" / "rumba.ply")
        start, end = (read_frame(data / "sequences" / "rumba.pc2", frame) for frame in (60, 61))
    else:
        frames = [data / "ccd" / name / "frames" / f"{frame}.ply" for frame in CLOTH[name]]
        (start, faces), (end, _) = map(read_ply, frames)
    start, end = (np.asfortranarray(x, np.float64) for x in (start, end))
    # Rows in the order of (high, low), by which the answers number edges.
    return name, ipctk.CollisionMesh(start, ipc.edges(faces), faces.astype(np.int32)), start, end


def test_known_scenes(known, data):
    name, mesh, start, end = known
    broad_phase = ipc.BroadPhase()
    # At rest: the collisions of a barrier.
    dhat = 1e-3 * float(np.ptp(start, axis=0).max())
    theirs = collisions_of(mesh, start, dhat)
    assert_same_collisions(collisions_of(mesh, start, dhat, broad_phase=broad_phase), theirs)
    # The step, inflated: every pair that is within twice the radius at some moment, as ipctk finds them.
    radius = dhat / 16
    inflated = built(mesh, start, end, radius=radius, by=broad_phase)
    exact = sets_of(inflated)
    n_near = 0
    for moment in [0.0, 0.3, 1.0]:
        near = collisions_of(mesh, np.asfortranarray(start + moment * (end - start)), 2 * radius)
        for kind in ["ee", "fv"]:
            pairs = {key(pair)[1] for pair in getattr(near, f"{kind}_collisions")}
            assert pairs <= exact[kind]
            n_near += len(pairs)
    n_inflated = len(built(mesh, start, end, radius=radius, by=ipctk.LBVH()))
    print(f"{name}: {n_near} within {2 * radius:.3g}, {len(inflated)} candidates, LBVH {n_inflated}")
    assert n_near > 10 and len(inflated) * (10 if name == "cloth-ball" else 1) <= n_inflated
    # The step: every pair that is known to touch, and few others.
    found = built(mesh, start, end, radius=0.0, by=broad_phase)
    n_boxes = len(built(mesh, start, end, radius=0.0, by=ipctk.LBVH()))
    print(f"{name}: {len(theirs)} collisions, {len(found)} candidates of the step, LBVH {n_boxes}")
    assert len(found) <= n_boxes
    if name == "rumba":
        return
    ours = sets_of(found)
    for kind, field in [("vf", "fv"), ("ee", "ee")]:
        rows = np.load(data / "ccd" / name / f"{kind}_contacts.npy").astype(int)
        rows = rows[:, ::-1] if kind == "vf" else np.sort(rows, axis=1)
        assert set(map(tuple, rows.tolist())) <= ours[field]
    if name == "cloth-ball":
        assert 10 * len(found) <= n_boxes
    else:
        step = ipctk.compute_collision_free_stepsize(mesh, start, end, 0.0, broad_phase)
        assert step == ipctk.compute_collision_free_stepsize(mesh, start, end, 0.0)
