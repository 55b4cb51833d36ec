"""Bodies: handles, changes, filters."""

import gc
import pickle
import sys

import numpy as np
import pytest

import impinge
from shapes import ACROSS, FACE, TRIANGLE, ball, lattice_tetrahedra


@pytest.fixture
def scene():
    scene = impinge.Scene()
    scene.add(TRIANGLE, FACE)
    scene.add(ACROSS, FACE)
    return scene


def test_handles_are_numbers(scene):
    a, b = scene.bodies
    assert (int(a), a.index, b.index, repr(b)) == (0, 0, 1, "Body(1)")
    assert "xyz"[b] == "y"
    assert a == 0 and 1 == b and a != b and a < b and b >= 1 and not a == "a"
    assert len({a, b, scene.bodies[0], 0, 1}) == 2
    assert a in scene and 1 in scene and 2 not in scene and "a" not in scene
    with pytest.raises(TypeError):
        sorted([a, "b"])
    rows = impinge.Detector().detect(scene).rows
    assert (rows[:, 0] == a.index).all() and (rows[:, 2] == int(b)).all()


def test_kinds(scene):
    vertices, tets = lattice_tetrahedra(5, 3, 1)
    body = scene.add(vertices, tets, "tetrahedra")
    assert scene.kind(body) == "tetrahedra" and scene.kind(0) == "triangles"
    assert np.array_equal(scene.elements(body), tets) and scene.elements(body).dtype == np.uint32
    assert (scene.n_elements(body), scene.n_vertices(body)) == (5, 20)
    scene.add(vertices, tets, kind="tetrahedra")
    with pytest.raises(ValueError, match=r"^faces: shape \(n, 3\) expected, \(5, 4\) given"):
        scene.add(vertices, tets, kind="triangles")
    with pytest.raises(ValueError, match='^kind: "hexahedra" given'):
        scene.add(vertices, tets, "hexahedra")
    assert len(scene) == 4


def test_bodies_come_go_and_change(scene):
    detector = impinge.Detector()
    a, b = scene.bodies
    assert len(detector.detect(scene)) == 1
    scene.set_positions(b, ACROSS + np.float32(5))
    assert len(detector.detect(scene)) == 0
    vertices, faces = ball()
    scene.remesh(b, vertices * np.float32(0.5), faces)
    assert scene.n_elements(b) == len(faces)
    assert len(detector.detect(scene)) > 1
    scene.remove(a)
    assert len(scene) == 1 and a not in scene and b in scene
    with pytest.raises(ValueError, match="there is no such body 0"):
        scene.set_positions(a, TRIANGLE)
    again = scene.add(TRIANGLE, FACE)
    assert again.index == a.index and again != a
    # The old handle does not name the new body.
    with pytest.raises(ValueError, match="there is no such body 0"):
        scene.positions(a)
    with pytest.raises(ValueError, match="there is no such body 0"):
        detector.detect(scene, self_of=a)
    assert len(detector.detect(scene)) > 1


def test_handles_know_their_scene(scene):
    other = impinge.Scene()
    stranger = other.add(TRIANGLE, FACE)
    assert stranger == 0 and stranger != scene.bodies[0] and stranger not in scene
    for call in [
        lambda: scene.set_positions(stranger, TRIANGLE),
        lambda: scene.remove(stranger),
        lambda: impinge.Detector().detect(scene, self_of=stranger),
        lambda: impinge.Detector().detect(scene).colliding(stranger),
    ]:
        with pytest.raises(ValueError, match="body 0 belongs to another scene"):
            call()


@pytest.mark.parametrize("bad, error", [(7, ValueError), (-1, ValueError), (2**70, TypeError)])
def test_numbers_of_no_body(scene, bad, error):
    with pytest.raises(error, match="^body: "):
        scene.positions(bad)


@pytest.mark.parametrize("bad", [True, "a", 1.0, None, (0, 1)])
def test_not_a_body(scene, bad):
    with pytest.raises(TypeError, match="^body: a Body or its number expected"):
        scene.positions(bad)


def test_wrong_number_of_positions(scene):
    message = r"^vertices: 4 positions given, but body 1 has 3 vertices"
    with pytest.raises(ValueError, match=message):
        scene.set_positions(1, np.zeros((4, 3)))
    assert np.array_equal(scene.positions(1), ACROSS)


def test_positions_are_copies(scene):
    vertices = TRIANGLE.copy()
    scene.set_positions(0, vertices)
    vertices[:] = 9
    scene.positions(0)[:] = 9
    assert np.array_equal(scene.positions(0), TRIANGLE)


def locked(array):
    array.flags.writeable = False
    return array


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_lent_positions_are_read_where_they_lie(scene, dtype):
    frame = locked(TRIANGLE.astype(dtype) + dtype(0.5))
    n_references = sys.getrefcount(frame)
    scene.set_positions(1, frame, copy=False)
    assert sys.getrefcount(frame) == n_references + 1
    assert np.array_equal(scene.positions(1), frame) and scene.positions(1).dtype == dtype
    # What the contract forbids shows that nothing was copied.
    frame.flags.writeable = True
    frame[0, 0] = 7
    assert scene.positions(1)[0, 0] == 7
    scene.set_positions(1, ACROSS)
    assert sys.getrefcount(frame) == n_references
    # The scene keeps a frame that nobody else knows any more.
    across = np.ascontiguousarray(ACROSS, dtype)
    scene.set_positions(1, locked(across.copy()), copy=False)
    scene.set_end_positions(1, locked(across + dtype(1)), copy=False)
    gc.collect()
    other = impinge.Scene()
    for vertices in (TRIANGLE, ACROSS):
        other.add(vertices, FACE)
    other.set_end_positions(1, ACROSS + 1)
    detector = impinge.Detector("cpu")
    assert len(detector.detect(scene)) == 1 and detector.detect(scene).hash == detector.detect(other).hash
    assert detector.impacts(scene).hash == detector.impacts(other).hash
    assert np.array_equal(scene.end_positions(1), ACROSS + 1)
    kept = pickle.loads(pickle.dumps(scene))
    del scene
    assert detector.detect(kept).hash == detector.detect(other).hash


def test_views_of_read_only_arrays_are_lent(scene):
    frames = locked(np.stack([TRIANGLE, ACROSS]).astype(np.float32))
    scene.set_positions(1, frames[1], copy=False)
    of_bytes = np.frombuffer(TRIANGLE.astype(np.float32).tobytes(), np.float32).reshape(-1, 3)
    scene.set_positions(0, of_bytes, copy=False)
    assert np.array_equal(scene.positions(0), TRIANGLE) and np.array_equal(scene.positions(1), ACROSS)
    scene.remove(1)


def test_arrays_that_can_be_written_are_not_lent(scene):
    writable = np.ascontiguousarray(ACROSS, np.float32)
    as_is = "^body 1: vertices: not an array that can be read as it is"
    for array, words in [
        (writable, "^body 1: vertices: the array can be written.* set array.flags.writeable = False"),
        (locked(writable[:]), "^body 1: vertices: the array is a view of one that can be written: set array.base.flags"),
        (locked(np.frombuffer(bytearray(36), np.float32)).reshape(-1, 3), "belongs to a (bytearray|memoryview), which may change"),
        (locked(np.asfortranarray(ACROSS)), as_is),
        (locked(ACROSS.astype(np.int32)), as_is),
        (locked(ACROSS.astype(">f4")), as_is),
        (ACROSS.tolist(), as_is),
        (locked(writable[:2].copy()), "^vertices: 2 positions given, but body 1 has 3 vertices"),
        (locked(np.full((3, 3), np.nan)), r"^body 1: vertices\[0, 0\] = nan: a position must be finite"),
        (locked(np.zeros((3, 2))), r"^body 1: vertices: shape \(n, 3\) expected"),
    ]:
        for lend in (scene.set_positions, scene.set_end_positions):
            with pytest.raises(ValueError, match=words):
                lend(1, array, copy=False)
    assert np.array_equal(scene.positions(1), ACROSS) and scene.end_positions(1) is None


def test_filters(scene):
    detector = impinge.Detector()

    def n_pairs(**question):
        return len(detector.detect(scene, **question))

    scene.set_filter(0, category=1, mask=2)
    scene.set_filter(1, category=2, mask=1)
    assert n_pairs() == 1
    scene.set_filter(1, category=4, mask=1)
    assert n_pairs() == 0
    # Named explicitly they meet all the same.
    assert n_pairs(between=(0, 1)) == 1
    scene.set_filter(1, category=2**64 - 1)
    assert n_pairs() == 1
    scene.set_filter(0)
    scene.set_filter(1)
    assert n_pairs() == 1
    for bad, error in [(-1, ValueError), (2**64, ValueError), ("1", TypeError), (True, TypeError)]:
        with pytest.raises(error, match="^mask: "):
            scene.set_filter(0, mask=bad)


def test_a_scene_tells_what_it_holds(scene):
    assert repr(scene) == "Scene(0: 1 triangles, 1: 1 triangles)"
    assert scene.nbytes >= 2 * (TRIANGLE.nbytes + FACE.nbytes)
