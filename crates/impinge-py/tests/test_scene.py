"""Bodies: handles, changes, filters."""

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
    assert (scene.n_primitives(body), scene.n_vertices(body)) == (5, 20)
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
    assert scene.n_primitives(b) == len(faces)
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
        detector.detect(scene, within=a)
    assert len(detector.detect(scene)) > 1


def test_handles_know_their_scene(scene):
    other = impinge.Scene()
    stranger = other.add(TRIANGLE, FACE)
    assert stranger == 0 and stranger != scene.bodies[0] and stranger not in scene
    for call in [
        lambda: scene.set_positions(stranger, TRIANGLE),
        lambda: scene.remove(stranger),
        lambda: impinge.Detector().detect(scene, within=stranger),
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
