"""Elements within a distance, and contact geometry."""

import numpy as np
import pytest

import impinge

FLOOR = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0]], np.float32)
FACE = [[0, 1, 2]]


@pytest.fixture(params=["clusters", "naive"])
def detector(request):
    return impinge.Detector(method=request.param, backend="cpu")


@pytest.fixture
def two():
    """A triangle, and another one 3 above it."""
    scene = impinge.Scene()
    scene.add(FLOOR, FACE)
    scene.add(FLOOR + np.float32([0, 0, 3]), FACE)
    return scene


def test_columns(detector, two):
    near = detector.within_distance(two, 3.0, between=True, closest_points=True)
    assert near.kinds.tolist() == ["vf"] * 6 + ["ee"] * 9
    assert near.bodies.dtype == np.uint32 and near.bodies.shape == (15, 2)
    assert near.elements[:3].tolist() == [[0, 0], [1, 0], [2, 0]]
    assert near.bodies[:6].tolist() == [[0, 1]] * 3 + [[1, 0]] * 3
    # Each vertex is above a vertex of the face.
    assert sorted(near.types[:3]) == ["P_T0", "P_T1", "P_T2"]
    assert near.features.shape == (15, 2) and near.features[0].tolist() == ["v0", "v0"]
    assert near.distances.tolist() == [3.0] * 15
    assert near.points.shape == (15, 2, 3)
    gaps = np.linalg.norm(near.points[:, 0] - near.points[:, 1], axis=1)
    assert gaps.tolist() == [3.0] * 15
    assert near.parallel.dtype == bool and near.parallel.sum() == 3
    assert repr(near) == "NearPairs(vf: 6, ee: 9)"
    assert near.stats.method == detector.within_distance(two, 3.0).stats.method
    below = detector.within_distance(two, np.nextafter(3.0, 0), between=True)
    assert len(below) == 0 and below.kinds.shape == (0,) and below.features.shape == (0, 2)
    assert below.hash != near.hash


def test_kinds_and_thickness(detector, two):
    faces = detector.within_distance(two, 3.0, kinds=["ff"])
    assert faces.kinds.tolist() == ["ff"] and faces.types.tolist() == ["P_P"]
    a, b = two.bodies
    thick = dict(between=(a, b), kinds=["ff"])
    assert len(detector.within_distance(two, thickness={a: 1.0, b: 2.0}, **thick)) == 1
    assert len(detector.within_distance(two, 0.5, thickness={a: 1.0, 1: 1.5}, **thick)) == 1
    assert len(detector.within_distance(two, 0.4, thickness={a: 1.0, 1: 1.5}, **thick)) == 0
    # Added without rounding: 0.1 + 0.2 is less than the float 0.1 + 0.2.
    scene = impinge.Scene()
    scene.add_points(np.array([[0.0, 0, 0]]))
    scene.add_points(np.array([[0.1 + 0.2, 0, 0]]))
    assert len(detector.within_distance(scene, thickness={0: 0.1, 1: 0.2})) == 0
    assert len(detector.within_distance(scene, 0.1 + 0.2)) == 1


def test_refusals(detector, two):
    near = detector.within_distance(two, 3.0)
    for name in ["distances", "points"]:
        with pytest.raises(ValueError, match="pass closest_points=True"):
            getattr(near, name)
    with pytest.raises(ValueError, match="distance"):
        detector.within_distance(two, -1.0)
    with pytest.raises(ValueError, match="thickness"):
        detector.within_distance(two, thickness={0: float("nan")})
    with pytest.raises(TypeError, match="^thickness: a dictionary of bodies and numbers expected, list given"):
        detector.within_distance(two, thickness=[1.0])
    with pytest.raises(ValueError, match='^kinds\\[0\\]: "xy" given'):
        detector.within_distance(two, kinds=["xy"])
    with pytest.raises(TypeError, match="^distance: a number expected, str given"):
        detector.within_distance(two, "3")


def test_contacts(detector):
    scene = impinge.Scene()
    scene.add(FLOOR, FACE)
    scene.add(np.array([[1, 1, -1], [2, 1, -1], [1, 1, 1]], np.float32), FACE)
    contacts = impinge.Contacts(scene, detector.detect(scene))
    assert len(contacts) == 1 and contacts.rows.tolist() == [[0, 0, 1, 0]]
    assert contacts.shapes.tolist() == ["segment"]
    assert contacts.points[contacts.corners].tolist() == [[1, 1, 0], [1.5, 1, 0]]
    assert contacts.starts.tolist() == [0, 2]
    assert contacts.bodies.tolist() == [[0, 1], [0, 1]]
    assert contacts.feature_kinds.tolist() == [["f", "e"], ["f", "e"]]
    assert contacts.features.tolist() == [[[0, 0], [0, 2]], [[0, 0], [1, 2]]]
    [curve] = contacts.curves()
    assert curve.tolist() == contacts.corners.tolist()
    assert contacts.lengths.tolist() == [0.5]
    [region] = contacts.regions()
    assert region["bodies"] == (0, 1) and region["contacts"].tolist() == [0]
    assert region["length"] == 0.5 and region["bounds"].tolist() == [[1, 1, 0], [1.5, 1, 0]]


def test_loops_end_where_they_start(detector):
    from shapes import ball

    vertices, faces = ball()
    scene = impinge.Scene()
    scene.add(vertices, faces)
    scene.add(vertices + np.array([0.7, 0.1, 0.05], vertices.dtype), faces)
    result = detector.detect(scene)
    contacts = impinge.Contacts(scene, result)
    assert len(contacts) == len(result) > 0
    curves = contacts.curves()
    assert curves and all(curve[0] == curve[-1] for curve in curves)
    for curve, length in zip(curves, contacts.lengths):
        steps = np.diff(contacts.points[curve], axis=0)
        assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(length)
    with pytest.raises(ValueError, match="^result: of another scene"):
        impinge.Contacts(impinge.Scene(), result)
    with pytest.raises(TypeError, match="^result: a Result expected"):
        impinge.Contacts(scene, 3)
