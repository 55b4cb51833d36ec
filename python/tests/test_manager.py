"""`CollisionManager`: beside trimesh's, whose collisions FCL decides, where both are installed."""

import copy
import multiprocessing
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

import impinge
from shapes import ball

SETTINGS = {"backend": "cpu", "threads": 1}


def shift(x, y=0.0, z=0.0):
    matrix = np.eye(4)
    matrix[:3, 3] = [x, y, z]
    return matrix


def manager(*shifts, radius=1.0):
    vertices, faces = ball(8, 12, np.float64)
    made = impinge.CollisionManager(**SETTINGS)
    for name, by in zip("abcdefgh", shifts):
        made.add_object(name, (radius * vertices, faces), shift(by))
    return made


def test_objects_come_move_and_go():
    balls = manager(0, 1.5, 9)
    assert balls.names == ["a", "b", "c"] and len(balls) == 3 and "b" in balls and "z" not in balls
    assert balls.in_collision_internal() is True
    assert balls.in_collision_internal(return_names=True) == (True, {("a", "b")})
    collides, names, data = balls.in_collision_internal(return_names=True, return_data=True)
    # Two convex objects have one contact, the deepest.
    [contact] = data
    assert collides and names == {("a", "b")} and contact.names == {"a", "b"}
    vertices, faces = ball(8, 12, np.float64)
    expected = impinge.pairs(vertices, faces, vertices + [1.5, 0, 0], faces).tolist()
    assert [contact.index("a"), contact.index("b")] in expected
    assert abs(contact.depth - 0.5) < 0.1 and contact.normal[0] > 0.9
    assert abs(contact.point[0] - 0.75) < 0.1
    balls.set_transform("b", shift(8))
    assert balls.in_collision_internal(return_names=True) == (True, {("b", "c")})
    balls.remove_object("c")
    assert balls.in_collision_internal() is False and balls.names == ["a", "b"]
    # A name that is used again replaces the object, and takes over no order of numbers.
    balls.add_object("a", (vertices, faces), shift(7))
    assert balls.names == ["b", "a"]
    assert balls.in_collision_internal(return_names=True) == (True, {("a", "b")})
    for call in [balls.remove_object, lambda name: balls.set_transform(name, np.eye(4))]:
        with pytest.raises(impinge.InvalidError, match="^name: there is no object 'c'"):
            call("c")
    with pytest.raises(ValueError, match="^matrix: shape"):
        balls.add_object("d", (vertices, faces), np.eye(3))
    assert balls.names == ["b", "a"] and not balls.in_collision_single((vertices, faces), shift(50))


def test_what_is_no_name_and_no_manager_is_refused():
    balls = manager(0, 9)
    vertices, faces = ball(8, 12, np.float64)
    with pytest.raises(TypeError, match="^name: something hashable expected, list given"):
        balls.add_object(["c"], (vertices, faces))
    for mesh, given in [(vertices.tolist(), "list of 86"), ((vertices,), "tuple of 1"), ([], "list of 0")]:
        with pytest.raises(TypeError, match=f"^mesh: a pair of vertices and faces expected, .* a {given} given"):
            balls.add_object("c", mesh)
    assert balls.in_collision_single([vertices, faces], shift(9.5), True) == (True, {"b"})
    # Nothing has been left behind that would collide.
    assert len(balls) == 2 and balls.in_collision_internal(return_names=True) == (False, set())
    for ask in [balls.in_collision_other, balls.min_distance_other]:
        for other in [None, object(), [balls]]:
            with pytest.raises(TypeError, match="^other_manager: an impinge.CollisionManager expected, .* given"):
                ask(other)
    with pytest.raises(TypeError, match="^CollisionManager: 'thread' is no setting of a Detector"):
        impinge.CollisionManager(thread=1)


def pickled(thing):
    return pickle.loads(pickle.dumps(thing))


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickled])
def test_managers_pickle_and_copy(duplicate):
    balls = manager(0, 1.5, 9)
    vertices, faces = ball(6, 8, np.float32)
    # Replaced, so it comes last; tetrahedra; without a transform.
    balls.add_object("a", (vertices, faces), shift(0.25))
    balls.add_object(("tip", 1), (5 * np.eye(4, 3), [[0, 1, 2, 3]], "tetrahedra"))
    far = manager(0.5, radius=0.5)
    assert balls.in_collision_other(far)
    other = duplicate(balls)
    assert other.names == balls.names == ["b", "c", "a", ("tip", 1)]

    def answers(made):
        hit, names, data = made.in_collision_internal(True, True)
        told = sorted((sorted(map(repr, each.names)), each.depth, each.point.tolist(), each.normal.tolist()) for each in data)
        return hit, names, told, made.in_collision_other(far, True), made.min_distance_internal("c", True)

    assert answers(other) == answers(balls)
    # Neither knows what becomes of the other.
    before = answers(balls)
    other.set_transform("c", shift(0.5))
    other.remove_object("b")
    other.add_object("d", (vertices, faces))
    assert answers(balls) == before and len(balls) == len(other) == 4
    assert ("a", "c") in other.in_collision_internal(True)[1]
    balls.set_transform("a", shift(30))
    balls.remove_object("c")
    assert ("a", "c") in other.in_collision_internal(True)[1]
    assert duplicate(impinge.CollisionManager(**SETTINGS)).min_distance_internal() == np.inf


class Planner(impinge.CollisionManager):
    """A manager with something of its own."""

    margin = 0.0


def test_subclasses_pickle_what_they_have():
    made = Planner(**SETTINGS)
    made.margin = 0.25
    made.add_object("cube", cube())
    for other in (pickled(made), copy.copy(made)):
        assert type(other) is Planner and other.margin == 0.25 and other.names == ["cube"]


def in_process(balls):
    return balls.in_collision_internal(True), balls.min_distance_internal("c")


def test_each_process_has_its_copy():
    balls = manager(0, 1.5, 9)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(in_process, (balls,)) == in_process(balls)


FORKED_MANAGERS = """
import os, sys
sys.path.insert(0, sys.argv[1])
import numpy as np, impinge
from shapes import ball
vertices, faces = ball(30, 40, np.float64)
for threads in (1, 2, None):
    made, other = (impinge.CollisionManager(backend="cpu", threads=threads) for _ in range(2))
    for name, x in [("a", 0), ("b", 1.5), ("c", 9)]:
        made.add_object(name, (vertices + [x, 0, 0], faces))
    other.add_object("d", (vertices + [10, 0, 0], faces))

    def answers():
        return (made.in_collision_internal(True), made.min_distance_internal("c", True), made.min_distance_internal(),
                made.in_collision_other(other, True), made.in_collision_single((vertices, faces), None, True))

    expected = answers()
    if os.fork() == 0:
        assert answers() == answers() == expected
        made.set_transform("c", np.eye(4) - 8 * np.eye(4, k=3))
        moved = answers()
        assert moved != expected
        # And in a child of the child.
        if os.fork() == 0:
            assert answers() == moved
            sys.exit(0)
        sys.exit(os.waitstatus_to_exitcode(os.wait()[1]))
    assert os.wait()[1] == 0
    assert answers() == expected
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_process_goes_on_with_a_manager():
    here = os.path.dirname(__file__)
    command = [sys.executable, "-W", "ignore", "-c", FORKED_MANAGERS, here]
    out = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (out.returncode, out.stdout) == (0, ""), out.stderr


def test_guests_are_kept_and_followed():
    vertices, faces = ball(6, 8, np.float64)
    random = np.random.default_rng(3)

    def fresh(objects):
        manager = impinge.CollisionManager(**SETTINGS)
        for name, (mesh, matrix) in objects.items():
            manager.add_object(name, mesh, matrix)
        return manager

    def matrix():
        return shift(*(9 * random.random(3)))

    held = [{f"{side}{ix}": ((vertices, faces), matrix()) for ix in range(8)} for side in "ab"]
    a, b = map(fresh, held)
    n_hits = 0
    for _ in range(12):
        for manager, objects, side in zip([a, b], held, "ab"):
            # One moves, one goes, one comes, one gets another mesh under its name.
            moved, gone, changed = random.choice(sorted(objects), 3, replace=False)
            objects[moved] = (objects[moved][0], matrix())
            manager.set_transform(moved, objects[moved][1])
            del objects[gone]
            manager.remove_object(gone)
            for name, size in [(f"{side}{random.integers(1000, 9999)}", 1), (str(changed), 1.5)]:
                objects[name] = ((vertices * size, faces), matrix())
                manager.add_object(name, *objects[name])
        others = fresh(held[0]), fresh(held[1])
        collide, names = a.in_collision_other(b, return_names=True)
        assert (collide, names) == others[0].in_collision_other(others[1], return_names=True)
        assert b.in_collision_other(a, return_names=True)[1] == {(y, x) for x, y in names}
        distance, nearest = a.min_distance_other(b, return_names=True)
        expected = others[0].min_distance_other(others[1], return_names=True)
        if collide:
            assert distance == pytest.approx(expected[0]) and distance <= 0 and nearest in names
        else:
            assert (distance, nearest) == expected and b.min_distance_other(a) == distance
        n_hits += len(a.in_collision_other(b, return_names=True)[1])
        assert a.in_collision_internal(return_names=True) == others[0].in_collision_internal(return_names=True)
    assert n_hits > 12 and len(a) == len(b) == 8
    assert a.in_collision_other(a)  # Each object meets its copy.


def test_a_mesh_that_is_not_in_the_manager():
    balls = manager(0, 0.5, 5)
    vertices, faces = ball(8, 12, np.float64)
    assert balls.in_collision_single((vertices, faces), shift(1.2), return_names=True) == (
        True,
        {"a", "b"},
    )
    collides, data = balls.in_collision_single((vertices, faces), shift(6.5), return_data=True)
    assert collides and {frozenset(contact.names) for contact in data} == {
        frozenset(["c", "__external"])
    }
    assert balls.in_collision_single((vertices, faces), shift(-20), return_names=True) == (
        False,
        set(),
    )
    assert len(balls) == 3 and balls.in_collision_internal(return_names=True)[1] == {("a", "b")}
    distance, name = balls.min_distance_single((vertices, faces), shift(8), return_name=True)
    assert name == "c" and abs(distance - 1) < 0.1
    assert abs(balls.min_distance_single((vertices, faces), shift(5.5)) + 1.5) < 0.1


def test_two_managers():
    ours, theirs = manager(0, 4, 8), manager(2, 8.5, radius=0.75)
    collides, names, data = ours.in_collision_other(theirs, return_names=True, return_data=True)
    assert (
        collides and names == {("c", "b")} and all(contact.names == {"c", "b"} for contact in data)
    )
    assert theirs.in_collision_other(ours, return_names=True) == (True, {("b", "c")})
    assert abs(ours.min_distance_other(theirs) + 1.25) < 0.1
    theirs.remove_object("b")
    assert ours.in_collision_other(theirs) is False
    distance, names, data = ours.min_distance_other(theirs, return_names=True, return_data=True)
    assert (
        0 < distance == data.distance
        and names in {("a", "a"), ("b", "a")}
        and data.names == set(names)
    )
    assert len(ours) == 3 and ours.in_collision_internal() is False


def test_two_objects_of_one_name():
    """trimesh's data have one of the two faces, and do not say whose."""
    ours, theirs = impinge.CollisionManager(**SETTINGS), impinge.CollisionManager(**SETTINGS)
    ours.add_object("base", cube())
    theirs.add_object("base", cube(), shift(0.75))
    distance, names, data = ours.min_distance_other(theirs, True, True)
    assert names == data.pair == ("base", "base") and data.names == {"base"}
    assert distance == pytest.approx(-0.25) and data.points[1] - data.points[0] == pytest.approx([-0.25, 0, 0])
    [contact] = ours.in_collision_other(theirs, return_data=True)[1]
    assert contact.pair == ("base", "base") and contact.normal.tolist() == [1, 0, 0]
    assert contact.indices == data.indices
    with pytest.raises(ValueError, match=r"^name: both objects are called 'base': take indices\[0\] and indices\[1\]"):
        contact.index("base")
    with pytest.raises(ValueError, match=r"^name: both objects are called 'base': take points\[0\] and points\[1\]"):
        data.point("base")
    for ask in (contact.index, data.point):
        with pytest.raises(KeyError):
            ask("foot")
    # The mesh that is not in the manager comes second.
    ours.add_object("__external", cube(), shift(5))
    [contact] = ours.in_collision_single(cube(), shift(5.75), return_data=True)[1]
    assert contact.pair == ("__external", "__external") and contact.normal.tolist() == [1, 0, 0]
    assert repr(contact).startswith("ContactData({'__external': ")
    distance, name, data = ours.min_distance_single(cube(), shift(7), True, True)
    assert (distance, name, data.pair) == (1, "__external", ("__external", "__external"))
    assert [point[0] for point in data.points] == [5.5, 6.5] and repr(data).count("__external") == 2
    # Those of two names come in their order, too.
    [contact] = ours.in_collision_single(cube(), shift(0.75), return_data=True)[1]
    assert contact.pair == ("base", "__external") and contact.indices == tuple(map(contact.index, contact.pair))
    assert {*map(repr, pickled([contact, data]))} == {repr(contact), repr(data)}


def test_distances():
    balls = manager(0, 4, 9)
    distance, names, data = balls.min_distance_internal(return_names=True, return_data=True)
    assert names == ("a", "b") and distance == data.distance and abs(distance - 2) < 0.1
    gap = data.point("a") - data.point("b")
    assert abs(np.sqrt(gap @ gap) - distance) < 1e-12 and data.index("a") < 200
    balls.set_transform("b", shift(8.5))
    distance, names, data = balls.min_distance_internal(return_names=True, return_data=True)
    # They overlap by 1.5: the deepest points are that far apart.
    assert abs(distance + 1.5) < 0.1 and names == ("b", "c") and data.distance == distance
    assert np.linalg.norm(data.point("b") - data.point("c")) == pytest.approx(-distance)
    assert balls.min_distance_internal(name="a") == pytest.approx(6.5, abs=0.1)
    assert balls.min_distance_internal(name="a", return_names=True)[1] == ("a", "b")
    with pytest.raises(ValueError, match="^name: there is no object 'z'"):
        balls.min_distance_internal(name="z")
    balls.remove_object("a"), balls.remove_object("b")
    assert balls.min_distance_internal() == np.inf
    scene = impinge.Scene()
    vertices, faces = ball(6, 8, np.float64)
    a, b = scene.add(vertices, faces), scene.add(vertices + [3, 0, 0], faces)
    detector = impinge.Detector(**SETTINGS)
    nearest = detector.distance(scene, a, b)
    assert abs(nearest.distance - 1) < 0.2 and nearest.points.shape == (2, 3)
    assert nearest[1::2][:2] == (a, b) and nearest._fields == (
        "distance", "body_a", "element_a", "body_b", "element_b", "points"
    )
    assert detector.nearest(scene).distance == nearest.distance
    scene.set_positions(b, vertices + [1, 0, 0])
    touching = detector.distance(scene, a, b)
    assert touching.distance == 0 and np.array_equal(*touching.points)
    assert abs(np.linalg.norm(touching.points[0]) - 1) < 0.2
    scene.set_positions(b, vertices + [3, 0, 0])
    found = detector.nearest(scene, across=[a])
    assert (found.body_a, found.body_b) == (a, b)
    assert detector.nearest(scene, across=[a, b]) is None
    with pytest.raises(ValueError, match="is named twice"):
        detector.distance(scene, a, a)
    with pytest.raises(TypeError, match="^scene: a Scene expected"):
        detector.distance(3, a, b)
    with pytest.raises(TypeError, match="^across: a sequence of bodies"):
        detector.nearest(scene, across=3)


def cube():
    """Its corners in trimesh's order."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corners, [[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)]


def test_how_deep_convex_objects_overlap():
    """The promises of trimesh's own tests, on its cube."""
    made = impinge.CollisionManager(**SETTINGS)
    made.add_object("cube1", cube(), shift(5))
    assert made.min_distance_single(cube()) == pytest.approx(4)
    assert made.min_distance_single(cube(), shift(5.75)) == pytest.approx(-0.25)
    # At the same place: pushed any way by 1 they are apart.
    hit, names, data = made.in_collision_single(cube(), shift(5), True, True)
    assert hit and names == {"cube1"} and len(data) == 1
    [contact] = data
    assert contact.depth == pytest.approx(1) and contact.normal.tolist() == [-1, 0, 0]
    assert contact.point == pytest.approx([5, -0.5, -0.5])
    # Touching is no depth.
    assert made.min_distance_single(cube(), shift(6)) == 0
    [touching] = made.in_collision_single(cube(), shift(6), return_data=True)[1]
    assert touching.depth == 0 and touching.normal.tolist() == [1, 0, 0]


@pytest.mark.parametrize("names", ["abc", "acb", "bac", "bca", "cab", "cba"])
def test_the_smallest_distance_is_that_of_the_deepest_overlap(names):
    places = {"a": shift(0), "b": shift(0.9), "c": shift(0.9, 0.3)}
    made, other = impinge.CollisionManager(**SETTINGS), impinge.CollisionManager(**SETTINGS)
    for name in names:
        made.add_object(name, cube(), places[name])
    # Nothing is known of how deep sheets overlap, wherever they come.
    sheet = np.array([[8.0, 0, 0], [9, 0, 0], [8, 1, 0]]), [[0, 1, 2]]
    for name in "st":
        made.add_object(name, sheet)
    distance, pair, data = made.min_distance_internal(None, True, True)
    assert distance == pytest.approx(-0.7) and pair == ("b", "c") and data.names == {"b", "c"}
    gap = data.point("c") - data.point("b")
    assert np.linalg.norm(gap) == pytest.approx(0.7) and gap[1] == pytest.approx(-0.7)
    contacts = made.in_collision_internal(return_data=True)[1]
    assert max(contact.depth for contact in contacts) == -distance == -data.distance
    found = [contact for contact in contacts if contact.names == {"b", "c"}]
    assert [found[0].index(name) for name in "bc"] == [data.index(name) for name in "bc"]
    assert made.min_distance_internal("a") == pytest.approx(-0.1)
    assert made.min_distance_internal("c", True)[1] == ("b", "c")
    assert made.min_distance_internal("s") == 0
    # A guest, and a manager of two.
    distance, name = made.min_distance_single(cube(), shift(0.5, -0.3), True)
    assert distance == pytest.approx(-0.6) and name == "b"
    other.add_object("far", cube(), shift(-0.95))
    other.add_object("near", cube(), shift(0.5, -0.3))
    distance, pair, data = made.min_distance_other(other, True, True)
    assert distance == pytest.approx(-0.6) and pair == ("b", "near") and data.names == set(pair)
    distance, pair = other.min_distance_other(made, True)
    assert distance == pytest.approx(-0.6) and pair == ("near", "b")


def turned():
    """A cube with more vertices than it needs, turned, in float32: flat but for rounding, which grows with coordinates."""
    side = np.linspace(-0.5, 0.5, 3)
    corners, faces = [], []
    for axis in range(3):
        for sign in (-1, 1):
            u, v = np.meshgrid(side, side, indexing="ij")
            at = np.stack([np.full(9, 0.5 * sign), u.ravel(), v.ravel()], 1)[:, np.roll(np.arange(3), axis)]
            for i in range(2):
                for j in range(2):
                    a, b, c, d = (9 * len(corners) + 3 * i + j + k for k in (0, 1, 3, 4))
                    faces += [[a, c, d], [a, d, b]] if sign > 0 else [[a, d, c], [a, b, d]]
            corners.append(at)
    axis = np.array([1.0, 2, 3]) / np.sqrt(14)
    cross = np.cross(np.eye(3), axis)
    turn = np.eye(3) + np.sin(0.3) * cross + (1 - np.cos(0.3)) * cross @ cross
    vertices, faces, _ = impinge.weld(np.concatenate(corners), faces)
    return (vertices @ turn.T).astype(np.float32), faces


def test_a_depth_does_not_depend_on_where_objects_are():
    """Far from the origin the moved vertices are rounded so that they are convex no longer: the object still is."""
    near, far = impinge.CollisionManager(**SETTINGS), impinge.CollisionManager(**SETTINGS)
    mesh = turned()
    for made, at in [(near, np.zeros(3)), (far, np.array([20, 6.7, 2.9]))]:
        made.add_object("a", mesh, shift(*at))
        made.add_object("b", mesh, shift(*at + [0.5, 0.1, 0]))
    expected = near.min_distance_internal()
    assert expected == pytest.approx(-0.4964, abs=1e-3)
    assert far.min_distance_internal() == pytest.approx(expected, abs=1e-4)
    assert len(far.in_collision_internal(return_data=True)[1]) == 1


def bowl():
    """Not convex: a ball with a dent."""
    vertices, faces = ball(16, 24, np.float64)
    top = vertices[:, 2] > 0.3
    vertices[top, 2] = 0.6 - vertices[top, 2]
    return vertices, faces


def test_objects_that_are_not_convex():
    made = impinge.CollisionManager(**SETTINGS)
    made.add_object("bowl", bowl())
    vertices, faces = ball(8, 12, np.float64)
    made.add_object("ball", (0.5 * vertices, faces), shift(0, 0, -1.3))
    distance, data = made.min_distance_internal(return_data=True)
    assert distance == pytest.approx(-0.2, abs=0.1)
    gap = data.point("ball") - data.point("bowl")
    assert np.linalg.norm(gap) == pytest.approx(-distance) and gap[2] > 0
    hit, data = made.in_collision_internal(return_data=True)
    assert hit and len(data) > 3
    for contact in data:
        # From the bowl, which came first, to the ball below.
        assert contact.normal[2] < -0.9 and contact.depth == pytest.approx(-distance)
        assert np.linalg.norm(contact.point - [0, 0, -1]) < 0.5
    # In the dent they do not touch, though a hull would.
    made.set_transform("ball", shift(0, 0, 0.25))
    assert 0 < made.min_distance_internal() < 0.2 and not made.in_collision_internal()
    # A sheet has no inside.
    made.add_object("sheet", (np.array([[-2.0, -2, 0], [2, -2, 0], [0, 2, 0]]), [[0, 1, 2]]))
    assert made.min_distance_internal(name="sheet") == 0
    data = made.in_collision_internal(return_data=True)[1]
    sheets = [contact for contact in data if "sheet" in contact.names]
    assert sheets and all(contact.depth == 0 for contact in sheets)
    assert all(np.linalg.norm(contact.normal) == pytest.approx(1) for contact in sheets)


def dented():
    """A box of which the top is pushed in, down to a point."""
    corners = np.array([[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))] + [[0, 0, -0.5]])
    faces = [[0, 2, 1], [0, 3, 2]]
    for i in range(4):
        j = (i + 1) % 4
        faces += [[i, j, 4 + j], [i, 4 + j, 4 + i], [4 + i, 4 + j, 8]]
    return corners, np.array(faces)


def test_faces_that_turn_different_ways_make_nothing_convex():
    corners, faces = dented()
    turned_round = [row for row, face in enumerate(faces.tolist()) if 8 in face][:3]
    mixed = faces.copy()
    mixed[turned_round] = mixed[turned_round, ::-1]
    box, size = cube(), np.array([0.2, 0.2, 0.6])
    for surface, expected in [(faces, -0.15), (mixed, 0.0)]:
        made = impinge.CollisionManager(**SETTINGS)
        made.add_object("dented", (corners, surface))
        made.add_object("rod", (box[0] * size, box[1]), shift(0, 0, -0.2))
        # In the hull it would be 1.1.
        assert made.min_distance_internal() == pytest.approx(expected)
        assert made.in_collision_internal()


def notched(apart):
    """A prism over an L. The edge of its notch is cut in two on one side: a face without area closes the gap, unless it is `apart`."""
    outline = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]
    corners = [[x, y, z] for z in (0.0, 2.0) for x, y in outline] + [[1 + apart, 1 + apart, 1]]
    faces = []
    for a, b, c in [(0, 1, 3), (1, 2, 3), (0, 3, 5), (3, 4, 5)]:
        faces += [[a, c, b], [6 + a, 6 + b, 6 + c]]
    for i in range(6):
        j = (i + 1) % 6
        faces += [[i, j, 6 + j], [i, 6 + j, 6 + i]] if i != 2 else [[2, 3, 12], [2, 12, 9], [2, 9, 8], [3, 9, 12]]
    return np.array(corners), np.array(faces)


def test_what_is_convex():
    convex = impinge._manager._is_convex
    for vertices, faces in [cube(), turned(), ball(8, 12, np.float64)]:
        vertices, faces = np.asarray(vertices), np.asarray(faces, np.uint32)
        assert convex(vertices, faces) and convex(vertices, faces[:, ::-1])
        for row in range(len(faces)):
            one_turned = faces.copy()
            one_turned[row] = faces[row, ::-1]
            assert not convex(vertices, one_turned)
        # A vertex of no face would be one of the hull.
        assert not convex(np.concatenate([vertices, [[9, 9, 9]]]), faces)
        assert not convex(vertices, faces[1:])
    for made in [dented(), bowl(), notched(0.0), notched(0.1)]:
        assert not convex(*made)
    # Turned, the face without area has one, of rounding.
    vertices, faces = notched(0.0)
    for angle in np.linspace(0.1, 6, 40):
        c, s = np.cos(angle), np.sin(angle)
        at = vertices @ [[c, s, 0], [-s, c, 0], [0, 0, 1]] @ [[1, 0, 0], [0, c, s], [0, -s, c]]
        assert not convex(at, faces)
    # A cube with an edge that is closed by a face without area.
    corners, faces = map(np.array, cube())
    edge, n = faces[0, :2], len(corners)
    sliver = [[edge[0], n, faces[0, 2]], [n, edge[1], faces[0, 2]], [*edge, n]]
    cut = np.concatenate([faces[1:], sliver])
    assert convex(np.concatenate([corners, [corners[edge].mean(0)]]), cut)


def test_names_are_sorted_and_need_no_order():
    made = impinge.CollisionManager(**SETTINGS)
    vertices, faces = ball(8, 12, np.float64)
    for name in ["z", "b", ("t", 1), 7]:
        made.add_object(name, (vertices, faces), shift(0.01 * len(made)))
    _, names = made.in_collision_internal(return_names=True)
    assert ("b", "z") in names and ("z", "b") not in names and len(names) == 6
    assert (7, "z") in names or ("z", 7) in names


def test_many_objects():
    """Moved, taken away and come back: always the nearest of all pairs."""
    random = np.random.default_rng(3)
    vertices, faces = ball(6, 8, np.float64)
    made = impinge.CollisionManager(**SETTINGS)
    places = {}

    def put(name):
        places[name] = 30 * random.random(3)
        made.add_object(name, (vertices, faces), shift(*places[name]))

    for name in range(60):
        put(name)
    for _ in range(6):
        at = np.array([places[name] for name in sorted(places)])
        gaps = np.linalg.norm(at[:, None] - at, axis=2) + 100 * np.eye(len(at))
        distance, names = made.min_distance_internal(return_names=True)
        assert abs(distance - (gaps.min() - 2)) < 0.2
        assert made.in_collision_internal() == (distance <= 0)
        some = impinge.CollisionManager(**SETTINGS)
        some.add_object("q", (vertices, faces), shift(15, 15, 15))
        nearest, name = made.min_distance_single((vertices, faces), shift(15, 15, 15), True)
        assert made.min_distance_other(some, return_names=True) == (nearest, (name, "q"))
        put(int(random.integers(60)))
        made.set_transform(names[0], shift(*places[names[0]] + 0.5))
        places[names[0]] = places[names[0]] + 0.5


def scene_of(trimesh):
    """Two boxes and a ball, each in its place."""
    scene = trimesh.Scene()
    box = trimesh.creation.box()
    scene.add_geometry(box, node_name="left", geom_name="box")
    scene.add_geometry(box, node_name="right", transform=shift(0.75))
    scene.add_geometry(trimesh.creation.icosphere(), node_name="ball", geom_name="ball", transform=shift(5))
    return scene


def test_scenes_of_trimesh():
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")
    scene = scene_of(trimesh)
    made, objects = impinge.scene_to_collision(scene, **SETTINGS)
    assert set(made.names) == set(objects) == {"left", "right", "ball"}
    assert objects["left"] == "box" and len(scene.geometry[objects["ball"]].faces) == 1280
    assert made.in_collision_internal(return_names=True) == (True, {("left", "right")})
    assert made.min_distance_internal("ball", True)[1] == ("ball", "right")
    assert made.min_distance_internal("ball") == pytest.approx(2.75, abs=0.01)
    assert impinge.trimesh.scene_to_collision is impinge.scene_to_collision
    assert impinge.trimesh.CollisionManager is impinge.CollisionManager
    with pytest.raises(TypeError, match="^scene: a trimesh.Scene expected, list given"):
        impinge.scene_to_collision([])


def test_the_same_as_trimesh():
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")
    pytest.importorskip("fcl", reason="python-fcl is not installed: no comparison with trimesh")
    random = np.random.default_rng(1)
    box = trimesh.creation.icosphere(subdivisions=2)
    ours, theirs = impinge.CollisionManager(**SETTINGS), trimesh.collision.CollisionManager()
    for name in range(12):
        matrix = trimesh.transformations.random_rotation_matrix(random.random(3))
        matrix[:3, 3] = 5 * random.random(3)
        ours.add_object(str(name), box, matrix), theirs.add_object(str(name), box, matrix)
    ours_hit, our_names = ours.in_collision_internal(return_names=True)
    their_hit, their_names = theirs.in_collision_internal(return_names=True)
    assert ours_hit == their_hit is True
    assert {frozenset(pair) for pair in our_names} == {frozenset(pair) for pair in their_names}
    matrix = np.eye(4)
    matrix[0, 3] = 12
    ours_far, theirs_far = (m.min_distance_single(box, matrix) for m in (ours, theirs))
    assert abs(ours_far - theirs_far) < 1e-6


def test_a_star_that_goes_around_twice_is_not_convex():
    """Each of its edges bends outwards, and each face turns the same way."""
    from impinge._manager import _is_convex

    around = np.arange(5) * 2 * np.pi / 5
    rim = np.stack([np.cos(around), np.sin(around), 0 * around], 1)
    points = np.concatenate([rim, [[0, 0, 1], [0, 0, -1]]])
    for step, is_convex in [(1, True), (2, False)]:
        sides = [(i, (i + step) % 5) for i in range(5)]
        faces = np.array([[i, j, 5] for i, j in sides] + [[j, i, 6] for i, j in sides], np.uint32)
        for size in (1, 1e-200, 1e200):
            assert _is_convex(size * points, faces) is is_convex, (step, size)


def test_convexity_does_not_depend_on_the_size():
    from impinge._manager import _is_convex

    vertices, faces = dented()
    for size in (1, 1e-160, 1e160):
        assert _is_convex(size * np.asarray(vertices, np.float64), np.asarray(faces, np.uint32)) is False, size
