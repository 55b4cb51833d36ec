"""What a step knows of its start, and seams."""

import numpy as np
import pytest

import impinge

PLATE = np.array([[-100, -100, 0], [100, -100, 0], [100, 100, 0], [-100, 100, 0]], np.float32)
RING = [[20, -20], [22, -20], [22, -22], [20, -22]]
ROD = np.array([[x, y, z] for z in (-50, 50) for x, y in RING], np.float32)
SIDES = [face for i in range(4) for j in [(i + 1) % 4] for face in ([i, j, j + 4], [i, j + 4, i + 4])]


@pytest.fixture
def scene():
    scene = impinge.Scene()
    scene.add(PLATE, [[0, 1, 2], [0, 2, 3]])
    rod = scene.add(ROD, SIDES)
    scene.set_end_positions(rod, ROD + np.float32([0, 0, 1]))
    return scene


def test_a_rod_through_a_plate_is_near_it(scene):
    near = impinge.Detector("cpu").near(scene, 2.0, which="between", distances=True, closest_points=True)
    assert len(near.of("ef")) == len(near) == 8
    assert not near.distances.any()
    assert {impinge.TYPES[number] for number in near.types} == {"E_T"}
    assert np.array_equal(near.points[:, 0], near.points[:, 1])


def test_a_start_that_intersects_is_not_free_if_asked(scene):
    detector = impinge.Detector("cpu")
    assert detector.is_free(scene)
    assert not detector.is_free(scene, start="verify")
    assert detector.earliest(scene, start="verify") is None and detector.start_intersects is True
    assert detector.earliest(scene) is None and detector.start_intersects is None
    impacts = detector.impacts(scene)
    assert impacts.start_intersects is None and repr(impacts) == "Impacts(0, nothing touches)"
    impacts = detector.impacts(scene, start="verify")
    assert impacts.start_intersects is True and repr(impacts) == "Impacts(0, the start intersects)"
    advance = detector.advance(scene)
    assert advance.fraction == 1.0 and advance.start_intersects is None
    advance = detector.advance(scene, start="verify")
    assert advance.fraction == 0.0 and advance.start_intersects is True and advance.first is None
    advance.apply(scene)
    assert np.array_equal(scene.positions(1), ROD)
    assert detector.advance(scene, start="verify", exclude=[(0, 1)]).start_intersects is False


def test_seams_are_refused_by_name():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    faces = [[0, 1, 2], [3, 4, 5]]
    detector = impinge.Detector("cpu")
    scene = impinge.Scene()
    scene.set_end_positions(scene.add(vertices, faces), vertices + [0, 0, 1])
    with pytest.raises(impinge.Seam, match="vertices 1 and 3 are at one position but not shared.*weld"):
        detector.advance(scene)
    assert detector.advance(scene, start="skip").fraction == 1.0
    mesh = impinge.ipc.CollisionMesh(vertices, impinge.ipc.edges(np.array(faces)), np.array(faces))
    with pytest.raises(impinge.Seam):
        impinge.ipc.compute_collision_free_stepsize(mesh, vertices, vertices + [0, 0, 1])
    vertices, faces, _ = impinge.weld(vertices, faces)
    scene = impinge.Scene()
    scene.set_end_positions(scene.add(vertices, faces), vertices + [0, 0, 1])
    assert detector.advance(scene, start="verify").fraction == 1.0
