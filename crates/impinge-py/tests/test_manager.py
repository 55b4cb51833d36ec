"""`CollisionManager` and `Distances`: beside trimesh's, whose collisions FCL decides, where both are installed."""

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
    assert collides and names == {("a", "b")} and len(data) > 5
    assert all(contact.names == {"a", "b"} for contact in data)
    vertices, faces = ball(8, 12, np.float64)
    expected = impinge.pairs(vertices, faces, vertices + [1.5, 0, 0], faces)
    assert [[contact.index("a"), contact.index("b")] for contact in data] == expected.tolist()
    balls.set_transform("b", shift(8))
    assert balls.in_collision_internal(return_names=True) == (True, {("b", "c")})
    balls.remove_object("c")
    assert balls.in_collision_internal() is False and balls.names == ["a", "b"]
    # A name that is used again replaces the object, and takes over no order of numbers.
    balls.add_object("a", (vertices, faces), shift(7))
    assert balls.names == ["b", "a"]
    assert balls.in_collision_internal(return_names=True) == (True, {("b", "a")})
    for call in [balls.remove_object, lambda name: balls.set_transform(name, np.eye(4))]:
        with pytest.raises(ValueError, match="^name: there is no object 'c'"):
            call("c")
    with pytest.raises(ValueError, match="^matrix: shape"):
        balls.add_object("d", (vertices, faces), np.eye(3))
    assert balls.names == ["b", "a"] and not balls.in_collision_single((vertices, faces), shift(50))


def test_a_mesh_that_is_not_in_the_manager():
    balls = manager(0, 0.5, 5)
    vertices, faces = ball(8, 12, np.float64)
    assert balls.in_collision_single((vertices, faces), shift(1.2), return_names=True) == (True, {"a", "b"})
    collides, data = balls.in_collision_single((vertices, faces), shift(6.5), return_data=True)
    assert collides and {frozenset(contact.names) for contact in data} == {frozenset(["c", "__external"])}
    assert balls.in_collision_single((vertices, faces), shift(-20), return_names=True) == (False, set())
    assert len(balls) == 3 and balls.in_collision_internal(return_names=True)[1] == {("a", "b")}
    distance, name = balls.min_distance_single((vertices, faces), shift(8), return_name=True)
    assert name == "c" and abs(distance - 1) < 0.1
    assert balls.min_distance_single((vertices, faces), shift(5.5)) == 0


def test_two_managers():
    ours, theirs = manager(0, 4, 8), manager(2, 8.5, radius=0.75)
    collides, names, data = ours.in_collision_other(theirs, return_names=True, return_data=True)
    assert collides and names == {("c", "b")} and all(contact.names == {"c", "b"} for contact in data)
    assert theirs.in_collision_other(ours, return_names=True) == (True, {("b", "c")})
    assert ours.min_distance_other(theirs) == 0
    theirs.remove_object("b")
    assert ours.in_collision_other(theirs) is False
    distance, names, data = ours.min_distance_other(theirs, return_names=True, return_data=True)
    assert 0 < distance == data.distance and names in {("a", "a"), ("b", "a")} and data.names == set(names)
    assert len(ours) == 3 and ours.in_collision_internal() is False


def test_distances():
    balls = manager(0, 4, 9)
    distance, names, data = balls.min_distance_internal(return_names=True, return_data=True)
    assert names == ("a", "b") and distance == data.distance and abs(distance - 2) < 0.1
    gap = data.point("a") - data.point("b")
    assert abs(np.sqrt(gap @ gap) - distance) < 1e-12 and data.index("a") < 200
    balls.set_transform("b", shift(8.5))
    distance, names, data = balls.min_distance_internal(return_names=True, return_data=True)
    assert (distance, names) == (0, ("b", "c")) and data.point("b") is None
    balls.remove_object("a"), balls.remove_object("b")
    assert balls.min_distance_internal() == np.inf
    scene = impinge.Scene()
    vertices, faces = ball(6, 8, np.float64)
    a, b = scene.add(vertices, faces), scene.add(vertices + [3, 0, 0], faces)
    nearest = impinge.Distances().between(scene, a, b)
    assert abs(nearest.distance - 1) < 0.2 and nearest.points.shape == (2, 3) and len(nearest.primitives) == 2
    with pytest.raises(ValueError, match="itself"):
        impinge.Distances().between(scene, a, a)
    with pytest.raises(TypeError, match="^scene: a Scene expected"):
        impinge.Distances().between(3, a, b)


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
