"""`impinge.ipc` beside ipc-toolkit itself, and against exact answers."""

import gc
import inspect
import multiprocessing
import sys
import threading
import weakref

import numpy as np
import pytest

import impinge
from impinge import ipc
from shapes import ball

FLOOR = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0]], np.float64)
TWO = np.array([[0, 1, 2], [3, 4, 5]])


def falling(dtype=np.float64):
    """Two triangles; the upper one falls through the lower at a quarter of the step."""
    start = np.vstack([FLOOR, FLOOR + [0, 0, 1]]).astype(dtype)
    end = start.copy()
    end[3:, 2] = -3
    return ipc.CollisionMesh(start, ipc.edges(TWO), TWO), start, end


def two_balls(seed):
    """Two balls that are pressed into each other with some noise."""
    vertices, faces = ball(8, 12, np.float64)
    random = np.random.default_rng(seed)
    start = np.vstack([vertices, vertices + [0, 0, 2.125]])
    end = start + 0.05 * random.standard_normal(start.shape)
    end[len(vertices) :, 2] -= 0.5
    return np.vstack([faces, faces + len(vertices)]).astype(np.int32), start, end


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_triangle_falls(dtype):
    mesh, start, end = falling(dtype)
    assert not ipc.is_step_collision_free(mesh, start, end)
    step = ipc.compute_collision_free_stepsize(mesh, start, end)
    # It starts at a height of 1, falls by 4 and stops at 1e-4.
    slack = 32 * np.finfo(dtype).eps + 2**-23
    assert (1 - 1e-4) / 4 - slack < step <= (1 - 1e-4) / 4
    reached = start + step * (end - start)
    assert reached.dtype == dtype
    assert ipc.is_step_collision_free(mesh, start, reached)
    up = start + np.array([0, 0, 1], dtype) * (np.arange(6) > 2)[:, None]
    assert ipc.is_step_collision_free(mesh, start, up)
    assert ipc.compute_collision_free_stepsize(mesh, start, up) == 1.0
    touching = start.copy()
    touching[3:, 2] = 0
    assert ipc.compute_collision_free_stepsize(mesh, touching, end) == 0.0
    assert not ipc.is_step_collision_free(mesh, touching, up)


@pytest.mark.parametrize("seed", range(4))
def test_the_step_is_the_earliest_impact(seed):
    faces, start, end = two_balls(seed)
    mesh = ipc.CollisionMesh(start, ipc.edges(faces), faces)
    scene = impinge.Scene()
    scene.add(start, faces)
    scene.set_end_positions(0, end)
    first = impinge.Detector(method="naive", backend="cpu").earliest(scene, precision="f64").toi
    step = ipc.compute_collision_free_stepsize(mesh, start, end)
    assert 0 < step < first and step > 0.99 * first
    detector = impinge.Detector(method="naive", backend="cpu")
    assert step == detector.advance(scene, clearance=1e-4, clearance_share=1 - 0.8).fraction
    assert step <= detector.earliest(scene, clearance=1e-4, precision="f64").toi
    # Every shorter step keeps the clearance, by the formula of a line search too.
    dx = end - start
    end = start + dx
    for part in [1.0, 0.5, 0.25, *np.random.default_rng(seed).random(8)]:
        for reached in [start + (part * step) * (end - start), start + (part * step) * dx]:
            scene.set_end_positions(0, reached)
            assert detector.is_free(scene, clearance=1e-4, clearance_share=1 - 0.8)


def test_conservative_rescaling_is_what_a_step_leaves():
    mesh, start, end = falling()

    class Ccd:
        conservative_rescaling = 0.5

    for height, ccd, left in [
        (1, None, 1e-4),
        (1, Ccd(), 1e-4),
        (2**-14, None, 0.2 * 2**-14),
        (2**-14, Ccd(), 0.5 * 2**-14),
        (2**-30, None, 0.2 * 2**-30),
        (2**-30, object(), 0.2 * 2**-30),
    ]:
        start[3:, 2] = height
        step = ipc.compute_collision_free_stepsize(mesh, start, end, 0.0, None, ccd)
        reached = (start + step * (end - start))[3, 2]
        # The step is rounded down to 24 bits, and positions of up to 4 are rounded.
        assert left <= reached < left + 2**-22 * height + 1e-14
    Ccd.conservative_rescaling = 0
    with pytest.raises(ValueError, match="^conservative_rescaling: 0.0 given, above 0"):
        ipc.compute_collision_free_stepsize(mesh, start, end, 0.0, None, Ccd())


def test_a_chain_of_steps_goes_on():
    """Steps toward contact never end there, with a distance to keep as well."""
    for distance in [0.0, 0.25]:
        mesh, start, end = falling()
        for _ in range(12):
            step = ipc.compute_collision_free_stepsize(mesh, start, end, distance)
            assert step > 0
            start = start + step * (end - start)
        assert distance < start[3, 2] < distance + 1e-6


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_distance_is_kept(dtype):
    mesh, start, end = falling(dtype)
    # The upper triangle starts at a height of 1 and falls by 4.
    assert ipc.is_step_collision_free(mesh, start, start + 0.125 * (end - start), 0.25)
    assert not ipc.is_step_collision_free(mesh, start, start + 0.1875 * (end - start), 0.25)
    step = ipc.compute_collision_free_stepsize(mesh, start, end, 0.25)
    slack = 32 * np.finfo(dtype).eps + 2**-23
    assert (0.75 - 1e-4) / 4 - slack < step <= (0.75 - 1e-4) / 4
    assert ipc.compute_collision_free_stepsize(mesh, start, end, min_distance=1) == 0.0


def test_loose_edges_and_points():
    # A triangle, an edge that hangs on it, an edge by itself, a point.
    rest = np.array([*FLOOR, [0, 0, 1], [9, 9, 0], [9, 9, 1], [1, 1, 2]])
    mesh = ipc.CollisionMesh(rest, [[0, 3], [4, 5], [0, 1]], [[0, 1, 2]])
    assert mesh.codim_edges.tolist() == [[0, 3], [4, 5]] and mesh.codim_vertices.tolist() == [6]
    assert (mesh.num_vertices, mesh.num_edges, mesh.num_faces) == (7, 3, 1)
    moved = rest.copy()
    assert ipc.is_step_collision_free(mesh, rest, moved)  # What hangs together does not count.
    moved[6, 2] = -2
    assert 0.49997 < ipc.compute_collision_free_stepsize(mesh, rest, moved) < 0.5
    moved[6] = [9, 9, 0.5]
    step = ipc.compute_collision_free_stepsize(mesh, rest, moved)
    assert 0.99998 < step < 1
    assert not ipc.has_intersections(mesh, rest) and ipc.has_intersections(mesh, moved)
    moved = rest.copy()
    moved[3] = [1, 1, -1]  # The edge that hangs on the face swings through it.
    assert 0.4999 < ipc.compute_collision_free_stepsize(mesh, rest, moved) < 0.5


def test_vertices_that_may_not_collide():
    mesh, start, end = falling()
    middle = start + 0.5 * (end - start)
    middle[:3, 2] = [1, -2, -2]  # The lower triangle is turned into the upper one.
    mesh.can_collide = lambda a, b: {a, b} == {0, 3}
    assert 0.24997 < ipc.compute_collision_free_stepsize(mesh, start, end) < 0.25
    assert ipc.has_intersections(mesh, middle)
    mesh.can_collide = lambda a, b: False
    assert ipc.compute_collision_free_stepsize(mesh, start, end) == 1.0
    assert ipc.is_step_collision_free(mesh, start, end)
    assert not ipc.has_intersections(mesh, middle)

    def fails(a, b):
        raise KeyError("of the callback")

    mesh.can_collide = fails
    for call in [ipc.is_step_collision_free, ipc.compute_collision_free_stepsize]:
        with pytest.raises(KeyError, match="of the callback"):
            call(mesh, start, end)
    # With labels nothing is called.
    for labels, is_free in [
        ([0] * 6, True),
        ([0, 0, 0, 1, 1, 1], False),
        ([0, 0, 0, 0, 0, 1], False),
    ]:
        assert ipc.is_step_collision_free(mesh, start, end, labels=labels) == is_free
        step = ipc.compute_collision_free_stepsize(mesh, start, end, labels=np.array(labels))
        assert (step == 1.0) == is_free
        assert ipc.has_intersections(mesh, middle, labels=labels) != is_free
    for bad in [[0, 1], np.zeros(6), np.zeros((6, 1), int)]:
        with pytest.raises(ValueError, match=r"^labels: integers of shape \(6,\) expected"):
            ipc.is_step_collision_free(mesh, start, end, labels=bad)


@pytest.mark.parametrize("seed", range(3))
def test_filters_leave_out_pairs_as_a_list_would(seed):
    faces, start, end = two_balls(seed)
    mesh = ipc.CollisionMesh(start, ipc.edges(faces), faces)
    labels = np.random.default_rng(seed).integers(0, 2, len(start))
    scene = impinge.Scene()
    scene.add(start, faces)
    scene.set_end_positions(0, end)
    detector = impinge.Detector("cpu")
    edges = scene.edges(0)
    counts = []
    for hit in detector.impacts(scene, clearance=1e-4, precision="f64"):
        a, b = hit.element_a, hit.element_b
        corners = [a, *faces[b]] if hit.kind == "vf" else [*edges[a], *edges[b]]
        if len(set(labels[corners])) > 1:
            counts.append(hit.toi)
    step = ipc.compute_collision_free_stepsize(mesh, start, end, labels=labels)
    # But for rounding, which is less than the last of 24 bits.
    assert abs(step / min(counts) - 1) < 2**-22
    mesh.can_collide = lambda a, b: labels[a] != labels[b]
    # A pair of elements passes if any two vertices do: the same pairs.
    assert ipc.compute_collision_free_stepsize(mesh, start, end) == step


@pytest.mark.parametrize("seed", range(2))
def test_a_callback_is_hardly_asked_twice_about_two_vertices(seed):
    faces, start, end = two_balls(seed)
    mesh = ipc.CollisionMesh(start, ipc.edges(faces), faces)
    half = len(start) // 2
    asked = []
    mesh.can_collide = lambda a, b: asked.append((a, b)) or (a < half) == (b < half)
    ipc.compute_collision_free_stepsize(mesh, start, end)
    # Two threads may come to a pair at the same time.
    assert 100 < len(asked) < 1.1 * len(set(asked))
    assert all(a < b for a, b in asked)


def test_a_start_that_intersects_is_not_free():
    # An edge of one triangle pierces the other: no vertex touches a face, and no edge an edge.
    start = np.vstack([FLOOR, [[1, 1, -1], [1, 1, 1], [9, 9, 9]]])
    mesh = ipc.CollisionMesh(start, ipc.edges(TWO), TWO)
    up = start + [0, 0, 0.25] * np.repeat([[0], [1]], 3, axis=0)
    assert ipc.has_intersections(mesh, start)
    assert not ipc.is_step_collision_free(mesh, start, up)
    assert ipc.compute_collision_free_stepsize(mesh, start, up) == 1.0
    # What may not collide does not intersect either.
    assert ipc.is_step_collision_free(mesh, start, up, labels=[0] * 6)
    assert not ipc.is_step_collision_free(mesh, start, up, labels=[0, 0, 0, 1, 1, 1])
    mesh.can_collide = lambda a, b: False
    assert ipc.is_step_collision_free(mesh, start, up)
    ipctk = pytest.importorskip("ipctk")
    theirs = ipctk.CollisionMesh(start, ipc.edges(TWO), TWO.astype(np.int32))
    # It does not ask.
    assert ipctk.is_step_collision_free(theirs, start, up)
    assert not ipc.is_step_collision_free(theirs, start, up)


def folded():
    """A face that is folded through its neighbour along their common edge's corner."""
    points = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, -1], [1, 1.5, 1.0]])
    return points, np.array([[0, 1, 2], [0, 3, 4]])


def test_a_face_folded_through_its_neighbour_intersects():
    points, faces = folded()
    mesh = ipc.CollisionMesh(points, ipc.edges(faces), faces)
    assert ipc.has_intersections(mesh, points)
    points[4, 2] = -1.5
    assert not ipc.has_intersections(mesh, points)
    with pytest.raises(ValueError, match=r"^vertices: shape \(5, 3\) expected"):
        ipc.has_intersections(mesh, points[:4])


def steps_of(mesh, start, end, results, ix):
    results[ix] = [ipc.compute_collision_free_stepsize(mesh, start, end) for _ in range(20)]


def in_child(mesh, start, end, queue):
    queue.put(ipc.compute_collision_free_stepsize(mesh, start, end))


def test_threads_share_a_mesh():
    faces, start, end = two_balls(1)
    mesh = ipc.CollisionMesh(start, ipc.edges(faces), faces)
    other = start + 0.5 * (end - start)
    expected = [ipc.compute_collision_free_stepsize(mesh, start, x) for x in [end, other] * 2]
    assert expected[0] != expected[1]
    results = [None] * 4
    threads = [
        threading.Thread(target=steps_of, args=(mesh, start, x, results, ix))
        for ix, x in enumerate([end, other] * 2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert results == [[step] * 20 for step in expected]


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_goes_on_with_a_mesh():
    faces, start, end = two_balls(1)
    mesh = ipc.CollisionMesh(start, ipc.edges(faces), faces)
    expected = ipc.compute_collision_free_stepsize(mesh, start, end)
    fork = multiprocessing.get_context("fork")
    queue = fork.Queue()
    child = fork.Process(target=in_child, args=(mesh, start, end, queue))
    child.start()
    try:
        assert queue.get(timeout=60) == expected
        child.join(60)
        assert child.exitcode == 0
    finally:
        child.kill()
    assert ipc.compute_collision_free_stepsize(mesh, start, end) == expected


def test_refusals():
    mesh, start, end = falling()
    for call in [ipc.is_step_collision_free, ipc.compute_collision_free_stepsize]:
        for distance in [-1e-3, np.nan, np.inf]:
            with pytest.raises(
                ValueError, match=f"^min_distance: {distance} given, a finite number"
            ):
                call(mesh, start, end, distance)
        with pytest.raises(TypeError, match="^mesh: a CollisionMesh expected, dict given"):
            call({}, start, end)
        with pytest.raises(ValueError, match=r"^vertices_t1: shape \(6, 3\) expected, as the mesh"):
            call(mesh, start, end[:4])
        bad = start.copy()
        bad[4, 1] = np.nan
        with pytest.raises(ValueError, match=r"^vertices_t0\[4, 1\] = nan"):
            call(mesh, bad, end)
    with pytest.raises(
        ValueError, match=r"^rest_positions: shape \(n, 3\) expected, \(3, 2\) given"
    ):
        ipc.CollisionMesh(FLOOR[:, :2], [], [[0, 1, 2]])
    with pytest.raises(ValueError, match="two dimensions are not served$"):
        ipc.CollisionMesh(FLOOR[:, :2], [], [[0, 1, 2]])
    with pytest.raises(ValueError, match=r"^faces\[0, 2\] = 3: there are 3 vertices"):
        ipc.CollisionMesh(FLOOR, [], [[0, 1, 3]])
    with pytest.raises(ValueError, match=r"^edges\[0, 0\] = -1: there are 3 vertices"):
        ipc.CollisionMesh(FLOOR, [[-1, 2]])
    with pytest.raises(TypeError, match="^faces: an array of integers expected"):
        ipc.CollisionMesh(FLOOR, [], [[0.0, 1.0, 2.0]])


def test_seams_are_named_by_the_vertices_of_the_mesh():
    # Two loose vertices at one position, with those of a face before them.
    at = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5], [7, 7, 7], [5, 5, 5]], float)
    faces = np.array([[0, 1, 2]])
    mesh = ipc.CollisionMesh(at, ipc.edges(faces), faces)
    text = r"^vertices 3 and 5 are at one position but not shared, so .*: weld the mesh \(1 of its vertices"
    with pytest.raises(impinge.Seam, match=text):
        ipc.compute_collision_free_stepsize(mesh, at, at)
    assert ipc.compute_collision_free_stepsize(mesh, at, at, labels=[0, 0, 0, 1, 2, 1]) == 1


def signature(function):
    return list(inspect.signature(function).parameters)


def test_names_are_those_of_ipc_toolkit():
    ipctk = pytest.importorskip("ipctk", reason="ipctk is not installed: no comparison with it")
    for name in ["is_step_collision_free", "compute_collision_free_stepsize"]:
        # pybind11 has its signature in the docstring alone.
        doc = getattr(ipctk, name).__doc__
        ours = signature(getattr(ipc, name))
        assert ours.pop() == "labels"
        places = [doc.index(f"{parameter}: ") for parameter in ours]
        assert places == sorted(places) and len(ours) == 6
    assert signature(ipc.has_intersections) == ["mesh", "vertices", "broad_phase", "labels"]
    assert signature(ipc.CollisionMesh) == ["rest_positions", "edges", "faces"]
    for name in ["rest_positions", "edges", "faces", "num_vertices", "num_edges", "num_faces"]:
        assert hasattr(ipctk.CollisionMesh, name) and hasattr(ipc.CollisionMesh, name)
    _, faces = ball(6, 8)
    mine, theirs = ipc.edges(faces), ipctk.edges(faces.astype(np.int32))
    assert {tuple(sorted(edge)) for edge in theirs.tolist()} == set(map(tuple, mine.tolist()))
    assert len(mine) == len(theirs)


def test_meshes_of_ipc_toolkit_are_served():
    ipctk = pytest.importorskip("ipctk", reason="ipctk is not installed: no comparison with it")
    ipctk.set_logger_level(ipctk.LoggerLevel.off)
    mine, start, end = falling()
    theirs = ipctk.CollisionMesh(start, ipctk.edges(TWO.astype(np.int32)), TWO.astype(np.int32))
    for _ in range(2):
        step = ipc.compute_collision_free_stepsize(theirs, start, end)
        assert step == ipc.compute_collision_free_stepsize(mine, start, end)
        assert not ipc.is_step_collision_free(theirs, start, end)
    theirs.can_collide = ipctk.CollisionFilter(lambda a, b: False)
    assert ipc.compute_collision_free_stepsize(theirs, start, end) == 1.0
    assert ipc.is_step_collision_free(theirs, start, end)
    theirs.can_collide = ipctk.make_vertex_patches_filter([0, 0, 0, 1, 1, 1])
    assert ipc.compute_collision_free_stepsize(theirs, start, end) == step
    theirs.can_collide = ipctk.make_vertex_patches_filter([0] * 6)
    assert ipc.is_step_collision_free(theirs, start, end)
    assert ipc.is_step_collision_free(mine, start, end, labels=[0] * 6)
    theirs.planes = [ipctk.Hyperplane(np.array([0.0, 0, 1]), np.zeros(3))]
    with pytest.raises(ValueError, match="^mesh: planes are not served"):
        ipc.is_step_collision_free(theirs, start, end)
    # Nothing keeps a mesh alive that is no longer used.
    gone = weakref.ref(theirs)
    del theirs
    gc.collect()
    assert gone() is None


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("distance", [0.0, 1e-2])
def test_side_by_side_with_ipc_toolkit(seed, distance):
    ipctk = pytest.importorskip("ipctk", reason="ipctk is not installed: no comparison with it")
    ipctk.set_logger_level(ipctk.LoggerLevel.off)
    faces, start, end = two_balls(seed)
    edges = ipctk.edges(faces)

    def ask(toolkit):
        mesh = toolkit.CollisionMesh(start, edges, faces)
        step = toolkit.compute_collision_free_stepsize(mesh, start, end, distance)
        near = start + 0.9 * step * (end - start)
        is_free = [toolkit.is_step_collision_free(mesh, start, x, distance) for x in [end, near]]
        return step, *is_free

    ours, theirs = ask(ipc), ask(ipctk)
    assert ours[1:] == theirs[1:] == (False, True)
    scene = impinge.Scene()
    scene.add(start, faces)
    scene.set_end_positions(0, end)
    naive = impinge.Detector(method="naive", backend="cpu")
    true = naive.earliest(scene, precision="f64", separation=distance).toi
    # Ours is never beyond the first contact, and close to theirs, which has tolerances besides.
    assert ours[0] <= true and theirs[0] <= ours[0] + 1e-6
    assert ours[0] - theirs[0] < 1e-3 + 0.25 * ours[0]


def test_neighbours_count_at_the_start_with_labels_and_loose_edges():
    # The second face pierces the first one, whose corner it shares.
    at = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [1, 1, -1], [1, 0.5, 1], [9, 9, 9], [9, 8, 9]], float)
    faces = np.array([[0, 1, 2], [0, 3, 4]])
    for loose in ([], [(5, 6)], [(3, 5)]):
        mesh = ipc.CollisionMesh(at, [*ipc.edges(faces).tolist(), *loose], faces)
        for labels in (None, np.arange(len(at)), [0, 0, 0, 0, 1, 2, 3]):
            assert ipc.has_intersections(mesh, at, labels=labels)
            assert not ipc.is_step_collision_free(mesh, at, at + 1, labels=labels)
        assert ipc.is_step_collision_free(mesh, at, at + 1, labels=[0, 0, 0, 0, 0, 1, 1])


@pytest.mark.parametrize("tip, meets", [((1, 1, 0), True), ((2, 0, 0), True), ((1, 1, 1), False), ((-1, -1, 0), False)])
def test_loose_edges_meet_what_they_share_a_vertex_with(tip, meets):
    at = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], tip], float)
    faces = np.array([[0, 1, 2]])
    mesh = ipc.CollisionMesh(at, [*ipc.edges(faces).tolist(), (0, 3)], faces)
    assert ipc.has_intersections(mesh, at) is meets
    assert ipc.is_step_collision_free(mesh, at, at + [0, 0, 1]) is not meets
    # Two loose edges meet in more than their vertex where they lie along each other.
    strands = ipc.CollisionMesh(at[[0, 1, 3]], [(0, 1), (0, 2)])
    assert ipc.has_intersections(strands, at[[0, 1, 3]]) is (tip == (2, 0, 0))
