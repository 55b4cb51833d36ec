"""`impinge.ipc` beside ipc-toolkit itself, and against exact answers."""

import gc
import inspect
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
    assert 0.25 * (1 - 8 * np.finfo(dtype).eps) < step < 0.25
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
    first = impinge.Detector("naive", backend="cpu").earliest(scene, toi="f64").toi
    step = ipc.compute_collision_free_stepsize(mesh, start, end)
    assert 0 < step <= first and step > first * (1 - 1e-9)
    scene.set_end_positions(0, start + step * (end - start))
    assert impinge.Detector(backend="cpu").is_free(scene)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_distance_is_kept(dtype):
    mesh, start, end = falling(dtype)
    # The upper triangle starts at a height of 1 and falls by 4.
    assert ipc.is_step_collision_free(mesh, start, start + 0.125 * (end - start), 0.25)
    assert not ipc.is_step_collision_free(mesh, start, start + 0.1875 * (end - start), 0.25)
    step = ipc.compute_collision_free_stepsize(mesh, start, end, 0.25)
    assert 0.1875 * (1 - 8 * np.finfo(dtype).eps) < step < 0.1875
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
    assert 0.4999999 < ipc.compute_collision_free_stepsize(mesh, rest, moved) < 0.5
    moved[6] = [9, 9, 0.5]
    step = ipc.compute_collision_free_stepsize(mesh, rest, moved)
    assert 0.9999999 < step < 1
    moved = rest.copy()
    moved[3] = [1, 1, -1]  # The edge that hangs on the face swings through it.
    assert 0.4999999 < ipc.compute_collision_free_stepsize(mesh, rest, moved) < 0.5


def test_vertices_that_may_not_collide():
    mesh, start, end = falling()
    mesh.can_collide = lambda a, b: {a, b} == {0, 3}
    assert 0.2499999 < ipc.compute_collision_free_stepsize(mesh, start, end) < 0.25
    mesh.can_collide = lambda a, b: False
    assert ipc.compute_collision_free_stepsize(mesh, start, end) == 1.0
    assert ipc.is_step_collision_free(mesh, start, end)


def test_refusals():
    mesh, start, end = falling()
    for call in [ipc.is_step_collision_free, ipc.compute_collision_free_stepsize]:
        for distance in [-1e-3, np.nan, np.inf]:
            with pytest.raises(ValueError, match=f"^min_distance: {distance} given, a finite number"):
                call(mesh, start, end, distance)
        with pytest.raises(TypeError, match="^mesh: a CollisionMesh expected, dict given"):
            call({}, start, end)
        with pytest.raises(ValueError, match=r"^vertices_t1: shape \(6, 3\) expected, as the mesh"):
            call(mesh, start, end[:4])
        bad = start.copy()
        bad[4, 1] = np.nan
        with pytest.raises(ValueError, match=r"^vertices_t0\[4, 1\] = nan"):
            call(mesh, bad, end)
    with pytest.raises(ValueError, match=r"^rest_positions: shape \(n, 3\) expected, \(3, 2\) given"):
        ipc.CollisionMesh(FLOOR[:, :2], [], [[0, 1, 2]])
    with pytest.raises(ValueError, match=r"^faces\[0, 2\] = 3: there are 3 vertices"):
        ipc.CollisionMesh(FLOOR, [], [[0, 1, 3]])
    with pytest.raises(ValueError, match=r"^edges\[0, 0\] = -1: there are 3 vertices"):
        ipc.CollisionMesh(FLOOR, [[-1, 2]])
    with pytest.raises(TypeError, match="^faces: an array of integers expected"):
        ipc.CollisionMesh(FLOOR, [], [[0.0, 1.0, 2.0]])


def signature(function):
    return list(inspect.signature(function).parameters)


def test_names_are_those_of_ipc_toolkit():
    ipctk = pytest.importorskip("ipctk", reason="ipctk is not installed: no comparison with it")
    for name in ["is_step_collision_free", "compute_collision_free_stepsize"]:
        # pybind11 has its signature in the docstring alone.
        doc = getattr(ipctk, name).__doc__
        ours = signature(getattr(ipc, name))
        places = [doc.index(f"{parameter}: ") for parameter in ours]
        assert places == sorted(places) and len(ours) == 6
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
    naive = impinge.Detector("naive", backend="cpu")
    true = naive.earliest(scene, toi="f64", separation=distance).toi
    # Ours is never beyond the first contact; theirs is never beyond ours, and close to it.
    assert ours[0] <= true and theirs[0] <= ours[0]
    assert ours[0] - theirs[0] < 1e-3 + 0.25 * ours[0]
