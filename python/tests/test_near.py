"""Elements within a distance, and contact geometry."""

import pickle

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
    near = detector.near(two, 3.0, which="between", closest_points=True)
    assert [impinge.KINDS[kind] for kind in near.kinds] == ["vf"] * 6 + ["ee"] * 9
    assert {near.kinds.dtype, near.types.dtype, near.features.dtype} == {np.dtype(np.uint8)}
    assert near.rows.dtype == np.uint32 and near.rows.shape == (15, 4)
    assert near.rows is near.rows and not near.rows.flags.writeable and near.kinds is near.kinds
    assert near.rows[:3, 1::2].tolist() == [[0, 0], [1, 0], [2, 0]]
    assert near.rows[:6, ::2].tolist() == [[0, 1]] * 3 + [[1, 0]] * 3
    # Each vertex is above a vertex of the face.
    assert sorted(impinge.TYPES[ix] for ix in near.types[:3]) == ["P_T0", "P_T1", "P_T2"]
    assert near.features.shape == (15, 2)
    assert [impinge.FEATURES[ix] for ix in near.features[0]] == ["v0", "v0"]
    assert near.distances.tolist() == [3.0] * 15
    assert near.points.shape == (15, 2, 3)
    gaps = np.linalg.norm(near.points[:, 0] - near.points[:, 1], axis=1)
    assert gaps.tolist() == [3.0] * 15
    assert near.parallel.dtype == bool and near.parallel.sum() == 3
    assert repr(near) == "NearPairs(vf: 6, ee: 9)"
    assert near.stats.method == detector.near(two, 3.0).stats.method
    below = detector.near(two, np.nextafter(3.0, 0), which="between")
    assert len(below) == 0 and below.kinds.shape == (0,) and below.features.shape == (0, 2)
    assert below.hash != near.hash
    # Distances alone.
    only = detector.near(two, 3.0, which="between", distances=True)
    assert only.hash == near.hash and only.distances.tolist() == near.distances.tolist()
    with pytest.raises(ValueError, match="^points were not asked for: pass closest_points=True"):
        only.points  # noqa: B018


def test_one_kind(detector, two):
    near = detector.near(two, 3.0, which="between", closest_points=True)
    parts = [near.of(kind) for kind in impinge.KINDS]
    assert [len(part) for part in parts] == [6, 9, 0, 0, 0, 0]
    for name in ["rows", "kinds", "types", "features", "parallel", "distances", "points"]:
        columns = [getattr(part, name) for part in parts]
        assert np.array_equal(np.concatenate(columns), getattr(near, name)), name
    assert sum(part.hash for part in parts) % 2**64 == near.hash
    assert repr(near.of("ee")) == "NearPairs(ee: 9)" == repr(near.of("ee").of("ee"))
    assert len(near.of("ee").of("vf")) == 0 and near.of("ee").of("vf").rows.shape == (0, 4)
    with pytest.raises(ValueError, match='^kind: "xy" given'):
        near.of("xy")


def test_types_have_names(detector):
    """Each name of a type that occurs on random elements is in the list."""
    random = np.random.default_rng(5)
    scene = impinge.Scene()
    for _ in range(2):
        scene.add(random.integers(0, 4, (90, 3)).astype(float), np.arange(90).reshape(-1, 3))
    near = detector.near(scene, 1.0, kinds=impinge.KINDS)
    seen = {impinge.TYPES[ix] for ix in near.types}
    assert {"P_P", "P_E", "P_T", "P_T0", "P_E2", "EA_EB", "EA1_EB", "EA0_EB1", "E_E"} <= seen
    assert set(impinge.FEATURES) == {impinge.FEATURES[ix] for ix in near.features.flat}


def test_kinds_and_thickness(detector, two):
    faces = detector.near(two, 3.0, kinds=["ff"])
    assert [impinge.KINDS[ix] for ix in faces.kinds] == ["ff"]
    assert [impinge.TYPES[ix] for ix in faces.types] == ["P_P"]
    a, b = two.bodies
    thick = dict(between=(a, b), kinds=["ff"])
    two.set_thickness(a, 1.0)
    two.set_thickness(b, 2.0)
    assert len(detector.near(two, 0.0, **thick)) == 1
    two.set_thickness(1, 1.5)
    assert len(detector.near(two, 0.5, **thick)) == 1
    assert len(detector.near(two, 0.4, **thick)) == 0
    assert len(detector.near(pickle.loads(pickle.dumps(two)), 0.5, between=(0, 1), kinds=["ff"])) == 1
    # Added without rounding: 0.1 + 0.2 is less than the float 0.1 + 0.2.
    scene = impinge.Scene()
    scene.add_points(np.array([[0.0, 0, 0]]))
    scene.add_points(np.array([[0.1 + 0.2, 0, 0]]))
    assert len(detector.near(scene, 0.1 + 0.2)) == 1
    scene.set_thickness(0, 0.1)
    scene.set_thickness(1, 0.2)
    assert len(detector.near(scene, 0)) == 0


def test_thickness_of_each_element(detector):
    scene = impinge.Scene()
    points = scene.add_points([[0, 0, 0], [1, 0, 0], [2, 0, 0]])
    for part in (None, "vertices"):
        scene.set_thickness(points, [0.75, 0.25, 0.5], part)
        for same in (scene, pickle.loads(pickle.dumps(scene))):
            assert detector.near(same, 0.0).rows.tolist() == [[0, 0, 0, 1]]
    near = detector.neighbours(scene, 0.25)
    assert near.of("vv").distances.tolist() == pytest.approx([0.0, 0.0, 0.25, 0.25])
    scene.set_thickness(points, 0)
    assert len(detector.near(scene, 0.5)) == 0
    cloth = scene.add([[0, 0, 3], [1, 0, 3], [0, 1, 3], [1, 1, 3]], [[0, 1, 2], [1, 3, 2]])
    other = scene.add_points([[0.9, 0.9, 3.5]])
    for part, thick in (("vertices", [0, 0, 0, 0.5]), ("edges", [0, 0, 0, 0.5, 0]), ("faces", np.float32([0, 0.5]))):
        scene.set_thickness(cloth, thick, part=part)
        near = detector.near(scene, 0, between=(cloth, other), kinds=["vf"])
        assert near.rows.tolist() == [[int(other), 0, int(cloth), 1]]


def test_refusals(detector, two):
    near = detector.near(two, 3.0)
    for name, keyword in [("distances", "distances"), ("points", "closest_points")]:
        with pytest.raises(ValueError, match=f"^{name} were not asked for: pass {keyword}=True"):
            getattr(near, name)
    with pytest.raises(ValueError, match="distance"):
        detector.near(two, -1.0)
    with pytest.raises(ValueError, match="thickness"):
        two.set_thickness(0, float("nan"))
    n_edges = len(two.edges(0))
    with pytest.raises(ValueError, match="^body 0: 1 thicknesses given, but there are 3 vertices"):
        two.set_thickness(0, [1.0])
    with pytest.raises(ValueError, match=f"^body 0: 7 thicknesses given, but there are {n_edges} edges"):
        two.set_thickness(0, np.ones(7), part="edges")
    with pytest.raises(ValueError, match="^body 0: a thickness of -0.5 is given as number 2 of its vertices"):
        two.set_thickness(0, [1, 2, -0.5])
    with pytest.raises(ValueError, match='^part: "corners" given'):
        two.set_thickness(0, [1, 2, 3], part="corners")
    for number in (1.0, 1, np.float32(1), np.array(1.0)):
        with pytest.raises(ValueError, match="^thickness: one number given with part=\"faces\": one number is of the whole body"):
            two.set_thickness(0, number, "faces")
    with pytest.raises(ValueError, match="a row of numbers expected"):
        two.set_thickness(0, np.ones((3, 1)))
    with pytest.raises(ValueError, match='^kinds\\[0\\]: "xy" given'):
        detector.near(two, 1.0, kinds=["xy"])
    with pytest.raises(TypeError, match="^distance: a number expected, str given"):
        detector.near(two, "3")


def test_contacts(detector):
    scene = impinge.Scene()
    scene.add(FLOOR, FACE)
    scene.add(np.array([[1, 1, -1], [2, 1, -1], [1, 1, 1]], np.float32), FACE)
    contacts = detector.contacts(scene, detector.detect(scene))
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
    contacts = detector.contacts(scene, result)
    assert len(contacts) == len(result) > 0
    curves = contacts.curves()
    assert curves and all(curve[0] == curve[-1] for curve in curves)
    for curve, length in zip(curves, contacts.lengths):
        steps = np.diff(contacts.points[curve], axis=0)
        assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(length)
    with pytest.raises(ValueError, match="^pairs: of another scene"):
        detector.contacts(impinge.Scene(), result)
    with pytest.raises(TypeError, match="^pairs: Pairs expected, int given"):
        detector.contacts(scene, 3)
    found = detector.penetration(scene, contacts, 1, 0)
    [region] = found.regions()
    assert region["depth"] > 0 and region["normal"][0] < -0.8
    assert found.volume == pytest.approx(region["volume"]) and region["volume"] > 0
    assert [len(inside) > 0 for inside in found.inside] == [True, True]
    assert region["inside"][0].tolist() == found.inside[0].tolist()
    assert repr(found).startswith("Penetration(1 regions, ")
    with pytest.raises(ValueError, match="body 1 is named twice"):
        detector.penetration(scene, contacts, 1, 1)
    with pytest.raises(TypeError, match="^contacts: Contacts expected"):
        detector.penetration(scene, result, 0, 1)
    with pytest.raises(ValueError, match="^contacts: of another scene"):
        detector.penetration(impinge.Scene(), contacts, 0, 1)
