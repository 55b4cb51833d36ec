"""What Python users expect of objects: sequences, pickles, meshes of other libraries, forks."""

import copy
import multiprocessing
import os
import pickle
import subprocess
import sys
import types

import numpy as np
import pytest

import impinge
from shapes import ACROSS, FACE, TRIANGLE, ball, lattice_tetrahedra, soup

TETS = np.array([[0, 1, 2, 3], [1, 2, 3, 4]])
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], np.float32)
QUADS = np.array([[0, 1, 3, 2], [1, 4, 5, 3]])
GRID = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0]], np.float32)


@pytest.fixture(scope="module")
def result():
    scene = impinge.Scene()
    for shift in range(3):
        vertices, faces = soup(400, 0.3, shift)
        scene.add(vertices, faces)
    scene.add(TRIANGLE + np.float32(50), FACE)
    return impinge.Detector("cpu").detect(scene)


def test_a_result_is_a_sequence_of_rows(result):
    rows = result.rows
    assert len(rows) == len(result) > 100
    assert [tuple(row) for row in rows.tolist()] == list(result)
    assert result[0] == tuple(rows[0]) and result[-1] == tuple(rows[-1])
    assert result[np.int64(7)] == tuple(rows[7]) and isinstance(result[7], tuple)
    assert np.array_equal(result[5:90:7], rows[5:90:7]) and result[:0].shape == (0, 4)
    assert result[3] in result and (9, 9, 9, 9) not in result
    for index in [len(rows), -len(rows) - 1]:
        with pytest.raises(IndexError, match=f"^index {index} given, but there are {len(rows)} pairs"):
            result[index]
    with pytest.raises(TypeError, match="^index: a whole number, a slice or an array of whole numbers or booleans expected, str given"):
        result["a"]


def test_a_result_is_indexed_by_arrays(result):
    rows = result.rows
    for index in [np.array([0, 1]), [4, 0, 4], np.array([-1], np.int8), [], np.array([], np.int64)]:
        assert np.array_equal(result[index], rows[np.asarray(index, np.int64)])
    mask = rows[:, 0] == 0
    assert 0 < len(result[mask]) < len(result) and np.array_equal(result[mask], rows[mask])
    assert np.array_equal(result[mask.tolist()], rows[mask]) and np.array_equal(result[mask], result.retain(mask).rows)
    # As a number is, an array of no dimension.
    assert result[np.array(3)] == result[3]
    for index, given in [
        (np.array([0.5]), r"an array of float64 and shape \(1,\)"),
        (np.array(["a"]), r"an array of <U1 and shape \(1,\)"),
        (np.array([[0, 1]], np.int8), r"an array of int8 and shape \(1, 2\)"),
        ((0, 1), "tuple"),
        (1.0, "float"),
        (np.array(0.5), r"an array of float64 and shape \(\)"),
        (None, "NoneType"),
    ]:
        with pytest.raises(TypeError, match=f"^index: a whole number, a slice or an array .* expected, {given} given"):
            result[index]
    with pytest.raises(IndexError, match="boolean index"):
        result[mask[:-1]]
    with pytest.raises(IndexError, match="out of bounds"):
        result[[len(rows)]]


def test_a_result_is_an_array(result):
    array = np.asarray(result)
    assert array.dtype == np.uint32 and np.array_equal(array, result.rows)
    assert np.asarray(result, np.int64).dtype == np.int64
    assert np.array_equal(np.unique(result, axis=0), result.rows)
    if np.lib.NumpyVersion(np.__version__) >= "2.0.0":
        assert np.shares_memory(np.array(result, copy=False), result.rows)
        assert not np.shares_memory(np.array(result, copy=True), result.rows)
        with pytest.raises(ValueError, match="^copy=False: rows are uint32, int64 asked for"):
            np.array(result, np.int64, copy=False)


def test_all_colliding_elements_in_one_pass(result):
    everything = result.colliding()
    assert [int(body) for body in everything] == [0, 1, 2]
    for body, elements in everything.items():
        assert elements.dtype == np.uint32
        assert np.array_equal(elements, result.colliding(body))
    assert np.array_equal(everything[1], result.colliding(1)) and 3 not in everything
    assert result.colliding(3).shape == (0,)


def test_filters_of_the_users_own():
    scene = impinge.Scene()
    for seed in range(3):
        scene.add(*soup(300, 0.3, seed))
    detector = impinge.Detector("cpu")
    everything = detector.detect(scene).rows
    layer = [np.arange(300) % 2, np.arange(300) % 3, np.zeros(300, int)]
    pairs = detector.detect(scene)
    of = [[layer[body][face] for body, face in everything[:, pair]] for pair in ([0, 1], [2, 3])]
    kept = pairs.retain(np.equal(*map(np.array, of)))
    expected = everything[[layer[a][i] == layer[b][j] for a, i, b, j in everything]]
    assert 0 < len(expected) < len(everything) and np.array_equal(kept.rows, expected)
    assert kept.hash == impinge.hash_rows(expected) and np.array_equal(pairs.rows, everything)
    assert len(pairs.retain(np.zeros(len(pairs), bool))) == 0
    for answer in [everything, np.ones(len(pairs)), [True]]:
        with pytest.raises(ValueError, match=r"^keep: shape \(\d+,\) of bool expected"):
            pairs.retain(answer)


def a_scene():
    """With bodies of all kinds, a gap, a filter, a transform and a body that moves."""
    scene = impinge.Scene()
    scene.add(TRIANGLE, FACE)
    gone = scene.add(TRIANGLE, FACE)
    scene.add(ACROSS.astype(np.float64), FACE)
    scene.add(CORNERS, TETS)
    scene.add_edges(TRIANGLE, [[0, 1], [1, 2]])
    scene.add_points(TRIANGLE + np.float32([0, 0, 1]))
    scene.remove(gone)
    scene.set_filter(2, category=6, mask=2**64 - 1)
    scene.set_transform(3, [[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]])
    scene.set_end_positions(5, TRIANGLE - np.float32([0, 0, 1]))
    return scene


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_scenes_pickle(duplicate):
    scene = a_scene()
    other = duplicate(scene)
    assert list(map(int, other.bodies)) == [0, 2, 3, 4, 5] and repr(other) == repr(scene)
    for body in map(int, scene.bodies):
        assert other.kind(body) == scene.kind(body)
        for of in ["positions", "rest_positions", "elements", "end_positions", "transform"]:
            ours, theirs = getattr(other, of)(body), getattr(scene, of)(body)
            assert (ours is None) == (theirs is None)
            if ours is not None:
                assert ours.dtype == theirs.dtype and np.array_equal(ours, theirs), (body, of)
    detector = impinge.Detector("cpu")
    for question in [{}, {"which": "self"}]:
        assert detector.detect(other, **question).hash == detector.detect(scene, **question).hash
    assert detector.impacts(other).hash == detector.impacts(scene).hash
    # They are two scenes from now on, also where positions were lent.
    lent = TRIANGLE + np.float32(3)
    lent.flags.writeable = False
    scene.set_positions(0, lent, copy=False)
    again = duplicate(scene)
    scene.set_positions(0, TRIANGLE)
    lent.flags.writeable = True
    lent += 1
    assert np.array_equal(again.positions(0), TRIANGLE + np.float32(3))
    other.set_positions(0, TRIANGLE + np.float32(9))
    assert np.array_equal(scene.positions(0), TRIANGLE)
    assert int(other.add(TRIANGLE, FACE)) == 1
    assert len(duplicate(impinge.Scene())) == 0


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
@pytest.mark.parametrize("wide", [False, True])
def test_scenes_pickle_where_steps_led(duplicate, wide):
    scene, detector = a_scene(), impinge.Detector("cpu")
    turned = np.array([[np.cos(0.3), 0, np.sin(0.3), 0], [0, 1, 0, 0], [-np.sin(0.3), 0, np.cos(0.3), -1.5], [0, 0, 0, 1]])
    turning = scene.add(TRIANGLE + np.float32([0, 0, 5]), FACE)
    scene.set_end_transform(turning, turned)
    detector.advance(scene).apply(scene)
    assert scene.transform(turning) is None
    scene.set_end_transform(turning, turned @ turned)
    halfway = (scene.positions(turning) + scene.end_positions(turning)) / 2
    scene.add_points([[0.1, 0.8, 0.1] @ halfway])  # It stops one of the vertices most.
    if wide:  # The end of another body is as it was given, and so is the start of one more.
        scene.set_end_positions(3, scene.positions(3).astype(np.float64) - 1)
        scene.set_transform(0, np.eye(4))
        scene.set_end_positions(0, TRIANGLE.astype(np.float64))
        scene.set_end_positions(0, None)
        assert (scene.positions(0).dtype, scene.rest_positions(0).dtype) == (np.float64, np.float32)
    other = duplicate(scene)
    for body in map(int, scene.bodies):
        for of in ["positions", "rest_positions", "end_positions", "transform"]:
            ours, theirs = getattr(other, of)(body), getattr(scene, of)(body)
            assert (ours is None) == (theirs is None)
            if ours is not None:
                assert ours.dtype == theirs.dtype and np.array_equal(ours, theirs), (body, of)
    # What a transform moves is stopped as a whole, and the next one begins at rest.
    both = [detector.truncate(of) for of in (scene, other)]
    assert both[0].n_cut == both[1].n_cut == (6 if wide else 3)
    for of, step in zip([scene, other], both):
        step.apply(of)
        of.set_transform(int(turning), np.eye(4))
    assert np.array_equal(scene.positions(turning), TRIANGLE + np.float32([0, 0, 5]))
    assert np.array_equal(other.positions(int(turning)), scene.positions(turning))


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_scenes_pickle_what_was_said_of_vertices(duplicate):
    scene = a_scene()
    layer = np.repeat(np.arange(4, dtype=np.uint32), 4)
    cloth = scene.add(np.indices((4, 4, 1), np.float32).reshape(3, -1).T, [[i, i + 1, i + 4] for i in range(11)])
    scene.set_groups(cloth, layer)
    scene.set_pinned(cloth, layer < 2)
    scene.set_thickness(cloth, np.where(layer == 1, 0.75, 0.25))
    scene.set_edges(cloth, scene.edges(cloth)[::-1, ::-1])
    scene.set_thickness(0, 0.5)
    detector = impinge.Detector("cpu")

    def answers(of):
        asked = [detector.near(of, 2.5, exclude=exclude) for exclude in [[], impinge.groups(0, 2), impinge.groups(2, 2)]]
        return [len(near) for near in asked], [near.hash for near in asked], detector.safe_distances(of, 0.5).of(int(cloth)).tolist()

    expected = answers(scene)
    assert answers(duplicate(scene)) == expected and len(set(expected[0])) == 3
    # Each of them counts.
    for change in [
        lambda of: of.set_groups(int(cloth), layer[::-1]),
        lambda of: of.set_pinned(int(cloth), np.zeros(16, bool)),
        lambda of: of.set_thickness(int(cloth), 0),
        lambda of: of.set_edges(int(cloth), None),
    ]:
        other = duplicate(scene)
        change(other)
        assert answers(other) != expected


def test_settings_pickle():
    settings = dict(method="cells", backend="cpu", threads=2, memory_budget=1 << 30, max_pairs=1000, density=2.0)
    detector = impinge.Detector(**settings, _group_size=32, recluster="never", instruction_set="avx2", affinity="auto")
    other = pickle.loads(pickle.dumps(detector))
    assert repr(other) == repr(detector) == (
        "Detector(backend='cpu', method='cells', threads=2, memory_budget=1073741824, max_pairs=1000, "
        "recluster='never', instruction_set='avx2', density=2.0, affinity='auto')"
    )
    arguments, keywords = other.__getnewargs_ex__()
    assert arguments == () and {**settings, "_group_size": 32, "recluster": "never"}.items() <= keywords.items()
    assert keywords["instruction_set"] == "avx2" and keywords["affinity"] == "auto"
    assert other.settings == {name: value for name, value in keywords.items() if name != "_group_size"}
    scene = a_scene()
    assert copy.deepcopy(detector).detect(scene).hash == detector.detect(scene).hash


def a_penetration():
    scene, detector = impinge.Scene(), impinge.Detector("cpu")
    a, b = (scene.add(CORNERS[:4] + np.float32(shift), [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]) for shift in (0, 0.1))
    return detector.penetration(scene, detector.contacts(scene, detector.detect(scene, between=(a, b))), a, b)


def test_what_does_not_pickle_says_why(result):
    scene = a_scene()
    detector = impinge.Detector("cpu")
    for thing, words in [
        (result, r"pickle pairs\.rows"),
        (scene.bodies[0], r"int\(body\)"),
        (detector.impacts(scene), "pickle their arrays"),
        (detector.candidates(scene), "pickle their arrays"),
        (detector.advance(scene), "pickle its arrays"),
        (detector.contacts(scene, detector.detect(scene)), "^Contacts name bodies of a live scene: pickle their arrays"),
        (a_penetration(), r"^a Penetration names bodies of a live scene: pickle its arrays and regions\(\)"),
        (detector.earliest(scene), r"^an Impact names bodies of a live scene: .* int\(impact\.body_a\)"),
        (detector.nearest(scene), r"^a Nearest names bodies of a live scene: .* int\(nearest\.body_a\)"),
        (scene.rest_pairs(1.0), "^an Exclusion of pairs names bodies of a live scene: pickle the scene, and make it there"),
        (impinge.Query(exclude=scene.rest_pairs(1.0)), "pickle the scene, and make it there again"),
        (impinge.CancelToken(), "^a CancelToken stops questions of its own process alone: .* make one there"),
        (detector.closest(scene, [[0, 0, 0]]), "^a Closest names bodies of a live scene: pickle its arrays"),
        (detector.cast(scene, [[0, 0, 0]], [[0, 0, 1]]), "^Hits name bodies of a live scene: pickle their arrays"),
    ]:
        with pytest.raises(TypeError, match=words):
            pickle.dumps(thing)
    nearest = detector.nearest(scene)
    assert copy.copy(nearest) is nearest


def test_repr_is_short():
    n = 100_000
    scene = impinge.Scene()
    scene.add_many(np.tile(TRIANGLE, (n, 1)), np.tile(FACE, (n, 1)), np.arange(n + 1) * 3, np.arange(n + 1))
    scene.add(CORNERS, TETS)
    assert repr(scene) == "Scene(100001 bodies: 100000 triangles, 2 tetrahedra)"
    small = impinge.Scene()
    small.add(TRIANGLE, FACE)
    assert repr(small) == "Scene(0: 1 triangles)"


def test_many_bodies_at_once():
    n = 5000
    random = np.random.default_rng(1)
    sizes = random.integers(0, 5, n)
    of_faces = np.concatenate([[0], np.cumsum(sizes)])
    vertices = random.random((3 * sizes.sum(), 3)).astype(np.float32)
    faces = np.concatenate([np.arange(3 * size).reshape(-1, 3) for size in sizes])
    scene, one_by_one = impinge.Scene(), impinge.Scene()
    bodies = scene.add_many(vertices, faces, 3 * of_faces, of_faces)
    assert list(map(int, bodies)) == list(range(n)) and bodies == scene.bodies
    for body in range(n):
        rows = slice(of_faces[body], of_faces[body + 1])
        one_by_one.add(vertices[3 * rows.start : 3 * rows.stop], faces[rows], kind="triangles")
    assert [scene.n_elements(body) for body in bodies[:50]] == sizes[:50].tolist()
    assert all(np.array_equal(scene.positions(b), one_by_one.positions(int(b))) for b in bodies[::97])
    small = impinge.Scene()
    for words, change in [
        (r"^vertex_offsets: 2 as the last of 3 given", {"vertex_offsets": [0, 2]}),
        (r"^face_offsets: 1 as the first given, 0 as the first allowed", {"face_offsets": [1, 1]}),
        (r"^face_offsets\[1\]: -1 given, 0 or more allowed", {"face_offsets": [0, -1]}),
        (r"^vertex_offsets: a row of whole numbers expected, \(1, 2\)", {"vertex_offsets": [[0, 3]]}),
        (r"^vertex_offsets: a row of whole numbers expected", {"vertex_offsets": [0.0, 3.0]}),
        (r"^faces\[0, 2\] = 3: there are 3 vertices", {"faces": [[0, 1, 3]]}),
        (r'^kind: "quads" given', {"kind": "quads"}),
        (r"^body 0: vertex 2 has a non-finite", {"vertices": [[0, 0, 0], [0, 0, 1], [0, 0, np.inf]]}),
    ]:
        arguments = dict(vertices=TRIANGLE, faces=FACE, vertex_offsets=[0, 3], face_offsets=[0, 1])
        with pytest.raises(ValueError, match=words):
            small.add_many(**{**arguments, **change})
    assert len(small) == 0


def test_transforms():
    scene = impinge.Scene()
    body = scene.add(*ball(8, 12))
    rest = scene.positions(body)
    angle = 0.7
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    matrix[:3, 3] = [0.5, -1, 2]
    scene.set_transform(body, matrix)
    x, y, z = rest.T.astype(np.float64)
    by_hand = np.stack([((a * x + b * y) + c * z) + d for a, b, c, d in matrix[:3]], 1)
    assert np.array_equal(scene.positions(body), by_hand.astype(np.float32))
    assert np.array_equal(scene.transform(body), matrix) and np.array_equal(scene.rest_positions(body), rest)
    scene.set_positions(body, rest)
    assert scene.transform(body) is None
    for words, bad in [
        (r"^matrix: shape \(4, 4\) expected, \(3, 4\) given", matrix[:3]),
        (r"^matrix: NaN in row 0, column 3 given, finite numbers allowed", matrix + np.diag([np.nan] * 4, 0)[:, [3, 1, 2, 0]]),
        (r"^matrix: a last row of .* given, \[0, 0, 0, 1\] allowed", np.ones((4, 4))),
    ]:
        with pytest.raises(ValueError, match=words):
            scene.set_transform(body, bad)
    with pytest.raises(TypeError, match="^matrix: an array of real numbers expected"):
        scene.set_transform(body, [["a"] * 4] * 4)
    with pytest.raises(ValueError, match="vertex 0 has"):
        scene.set_transform(body, np.diag([1e300, 1, 1, 1]))
    assert np.array_equal(scene.positions(body), rest)


def test_end_transforms():
    scene, given = impinge.Scene(), impinge.Scene()
    body, same = scene.add(*ball(8, 12)), given.add(*ball(8, 12))
    rest = scene.positions(body)
    start, end = np.eye(4), np.eye(4)
    end[:2, :2] = [[0.6, -0.8], [0.8, 0.6]]
    end[:3, 3] = [0.5, -1, 2]
    start[0, 3] = 3.0
    scene.set_transform(body, start)
    scene.set_end_transform(body, end)
    x, y, z = rest.T.astype(np.float64)
    by_hand = np.stack([((a * x + b * y) + c * z) + d for a, b, c, d in end[:3]], 1).astype(np.float32)
    assert np.array_equal(scene.end_positions(body), by_hand) and scene.end_positions(body).dtype == np.float32
    assert np.array_equal(scene.transform(body), start) and np.array_equal(scene.rest_positions(body), rest)
    given.set_transform(same, start)
    given.set_end_positions(same, by_hand)
    wall = np.array([[1.5, -9, -9], [1.5, 9, -9], [1.5, 0, 9]], np.float32)
    for each in scene, given:
        each.add(wall, FACE)
    ours, theirs = (impinge.Detector("cpu").impacts(each) for each in (scene, given))
    assert len(ours) > 0 and ours.hash == theirs.hash
    for words, bad in [
        (r"^matrix: shape \(4, 4\) expected, \(3, 4\) given", end[:3]),
        (r"^matrix: a last row of .* given, \[0, 0, 0, 1\] allowed", np.ones((4, 4))),
        ("vertex 0 has", np.diag([1e300, 1, 1, 1])),
    ]:
        with pytest.raises(ValueError, match=words):
            scene.set_end_transform(body, bad)
        assert np.array_equal(scene.end_positions(body), by_hand)
    scene.set_transform(body, end)
    assert scene.end_positions(body) is None and np.array_equal(scene.positions(body), by_hand)


def test_rows_of_four():
    scene = impinge.Scene()
    assert scene.kind(scene.add(CORNERS, TETS)) == "tetrahedra"
    for rows in [QUADS, QUADS[:1], TETS[:1], np.array([[0, 1, 3, 2], [0, 1, 3, 2]])]:
        with pytest.raises(ValueError, match='^faces: rows of four are tetrahedra or quads.*kind="quads"'):
            scene.add(GRID, rows)
        with pytest.raises(ValueError, match='^faces_b: rows of four.*kind_b="tetrahedra", or kind_b="quads"'):
            impinge.pairs(CORNERS, TETS, GRID, rows)
        with pytest.raises(ValueError, match='^kind_b: "quad" given'):
            impinge.pairs(CORNERS, TETS, GRID, rows, kind_b="quad")
        assert scene.kind(scene.add(GRID, rows, "tetrahedra")) == "tetrahedra"
    quads = scene.add(GRID, QUADS, kind="quads")
    assert scene.elements(quads).tolist() == [[0, 1, 3], [0, 3, 2], [1, 4, 5], [1, 5, 3]]
    with pytest.raises(ValueError, match="rows of four"):
        impinge.pairs(GRID, QUADS, TRIANGLE, FACE)
    across = ACROSS + np.float32([0, 0.25, 0])
    pairs = impinge.pairs(GRID, QUADS, across, FACE, kind_a="quads", kind_b="triangles")
    assert pairs.tolist() == [[0, 0], [1, 0]]
    assert len(impinge.self_pairs(GRID, QUADS, kind="quads")) == 0
    empty = scene.add(GRID, np.empty((0, 4), np.uint32))
    assert scene.n_elements(empty) == 0
    # A mesh of tetrahedra of any size tells by its first rows.
    vertices, tets = lattice_tetrahedra(40, 3, 2, shared=True)
    assert scene.kind(scene.add(vertices, tets, kind="tetrahedra")) == "tetrahedra"


def test_meshes_of_trimesh():
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")
    box = trimesh.creation.box()
    scene = impinge.Scene()
    body = scene.add(box)
    assert scene.n_elements(body) == 12 and np.array_equal(scene.elements(body), box.faces)
    with pytest.raises(ValueError, match=r"^mesh\.faces: shape \(n, 4\) expected, \(12, 3\) given"):
        scene.add(box, kind="tetrahedra")


def test_meshes_of_meshio():
    meshio = pytest.importorskip("meshio", reason="meshio is not installed")
    scene = impinge.Scene()

    def mesh(*cells):
        return meshio.Mesh(CORNERS if "tetra" in dict(cells) else GRID, list(cells))

    tets, triangles = ("tetra", TETS), ("triangle", [[0, 1, 2]])
    assert scene.kind(scene.add(mesh(tets))) == "tetrahedra"
    assert scene.kind(scene.add(mesh(triangles, ("line", [[0, 1]]), ("vertex", [[0]])))) == "triangles"
    assert scene.kind(scene.add(mesh(("line", [[0, 1]])))) == "edges"
    assert scene.kind(scene.add(mesh(("vertex", [[0], [1]])))) == "points"
    both = mesh(tets, triangles)
    with pytest.raises(ValueError, match="^mesh.cells: tetra, triangle given, one of triangle and tetra"):
        scene.add(both)
    assert scene.kind(scene.add(both, kind="triangles")) == "triangles"
    assert scene.kind(scene.add(both, kind="tetrahedra")) == "tetrahedra"
    quads = mesh(("quad", QUADS))
    with pytest.raises(ValueError, match="^mesh.cells: quads, which are no triangles"):
        scene.add(quads)
    assert scene.n_elements(scene.add(quads, kind="quads")) == 4
    with pytest.raises(ValueError, match="^mesh.cells: tetra expected, quad given"):
        scene.add(quads, kind="tetrahedra")
    with pytest.raises(ValueError, match="^mesh.cells: hexahedron given"):
        scene.add(meshio.Mesh(np.zeros((8, 3)), [("hexahedron", [list(range(8))])]))
    with pytest.raises(ValueError, match="^mesh.cells: none given"):
        scene.add(meshio.Mesh(GRID, []))


def test_anything_with_vertices_and_faces():
    scene = impinge.Scene()
    mesh = types.SimpleNamespace(vertices=TRIANGLE.tolist(), faces=[[0, 1, 2]])
    assert scene.n_elements(scene.add(mesh)) == 1
    mesh = types.SimpleNamespace(vertices=TRIANGLE, triangles=FACE)
    assert scene.n_elements(scene.add(mesh)) == 1
    with pytest.raises(ValueError, match=r"^mesh\.vertices\[0, 0\] = nan"):
        scene.add(types.SimpleNamespace(vertices=[[np.nan, 0, 0]] * 3, faces=FACE))
    with pytest.raises(TypeError, match="^faces: none given with a ndarray, which is no mesh"):
        scene.add(TRIANGLE)


def test_tensors_of_pytorch():
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    vertices, faces = ball(6, 8)
    positions, indices = torch.from_numpy(vertices), torch.from_numpy(faces.astype(np.int64))
    scene = impinge.Scene()
    body = scene.add(positions, indices)
    assert np.array_equal(scene.positions(body), vertices) and np.array_equal(scene.elements(body), faces)
    scene.set_positions(body, positions.double() * 2)
    assert scene.positions(body).dtype == np.float64
    scene.set_positions(body, positions.t().contiguous().t())
    expected = impinge.pairs(vertices, faces, vertices + np.float32(0.25), faces)
    assert np.array_equal(impinge.pairs(positions, indices, positions + 0.25, indices), expected)
    with pytest.raises(TypeError, match="^vertices: "):
        scene.set_positions(body, positions.clone().requires_grad_())
    assert torch.from_numpy(expected.astype(np.int64)).shape == (len(expected), 2)


def answers(shift):
    """What a forked worker is asked: large enough for a pool, with one thread and with two."""
    vertices, faces = ball(60, 80)
    moved = vertices + np.float32([shift, 0, 0])
    pairs = [impinge.pairs(vertices, faces, moved, faces, threads=threads) for threads in [1, 2]]
    default = impinge.pairs(vertices, faces, moved, faces)
    own = impinge.self_pairs(np.vstack([vertices, moved]), np.vstack([faces, faces + len(vertices)]))
    assert np.array_equal(pairs[0], pairs[1]) and np.array_equal(pairs[0], default)
    scene = impinge.Scene()
    scene.add(vertices, faces)
    auto = len(impinge.Detector().detect(scene, which="self"))
    return len(default), len(own), auto


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_forked_workers_after_use_in_the_parent():
    shifts = [0.5, 1.0, 1.5, 9.0]
    expected = [answers(shift) for shift in shifts]
    assert expected[0][0] > 50 and expected[3][0] == 0
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(answers, shifts).get(timeout=120) == expected


FORKED_DETECTOR = """
import os, sys, impinge
corners, face = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
scene = impinge.Scene()
scene.add(corners, face)
detector = impinge.Detector("cpu", threads=2)
detector.detect(scene, which="self")
alone = impinge.Detector("cpu", threads=1)
expected = alone.detect(scene, which="self").hash
if os.fork() == 0:
    assert alone.detect(scene, which="self").hash == expected == alone.detect(scene, which="self").hash
    try:
        detector.detect(scene, which="self")
    except RuntimeError as error:
        print(error, flush=True)
    del detector
    print(len(impinge.Detector("cpu").detect(scene, which="self")), flush=True)
    sys.exit(0)
sys.exit(os.waitstatus_to_exitcode(os.wait()[1]))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_detector_of_the_parent_is_refused_in_a_fork():
    command = [sys.executable, "-W", "ignore", "-c", FORKED_DETECTOR]
    out = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert out.returncode == 0, out.stderr
    first, last = out.stdout.splitlines()
    assert first.startswith("this detector was made before this process was forked, and threads and a GPU do not survive")
    assert last == "0"


def test_changes_between_frames():
    random = np.random.default_rng(5)
    center = np.repeat(random.uniform(-1, 1, (300, 3)), 3, 0)
    at = (center + random.uniform(-0.2, 0.2, center.shape)).astype(np.float32)
    scene = impinge.Scene()
    body = scene.add(at, np.arange(900).reshape(-1, 3))
    detector = impinge.Detector("cpu")

    def ask():
        scene.set_end_positions(body, at + random.uniform(-0.05, 0.05, at.shape).astype(np.float32))
        return detector.detect(scene), detector.impacts(scene), detector.near(scene, 0.1)

    def keys(answer):
        kinds = getattr(answer, "kinds", np.zeros(len(answer), np.uint8))
        return [(kind, *row) for kind, row in zip(kinds.tolist(), answer.rows.tolist())]

    before = ask()
    for _ in range(3):
        at = at + random.uniform(-0.05, 0.05, at.shape).astype(np.float32)
        scene.set_positions(body, at)
        after = ask()
        parts = [(now.of("ee"), then.of("ee")) for now, then in zip(after[1:], before[1:])]
        # A part beside all: pairs of other kinds are new or gone.
        parts += [(now.of("ee"), then) for now, then in zip(after[1:], before[1:])]
        parts += [(now, then.of("ee")) for now, then in zip(after[1:], before[1:])]
        for now, then in [*zip(after, before), *parts]:
            changes = now.changes(then)
            old, new = keys(then), keys(now)
            assert [(old[i], new[j]) for i, j in changes.kept] == [(key, key) for key in new if key in set(old)]
            assert [new[i] for i in changes.new] == [key for key in new if key not in set(old)]
            assert [old[i] for i in changes.gone] == [key for key in old if key not in set(new)]
            assert min(map(len, changes)) > 0 and all(of.dtype == np.int64 for of in changes) and changes.kept.shape[1] == 2
        before = after
    with pytest.raises(TypeError, match="^old: Impacts given, Pairs needed$"):
        before[0].changes(before[1])
    with pytest.raises(TypeError, match="^old: Impacts given, NearPairs needed$"):
        before[2].changes(before[1])
    with pytest.raises(TypeError, match="^old: NoneType given, Impacts needed$"):
        before[1].changes(None)
    # A copy is a clone, with the same handles.
    answers = ask()
    for copied in (copy.copy(scene), copy.deepcopy(scene)):
        again = detector.detect(copied), detector.impacts(copied), detector.near(copied, 0.1)
        for answer, other in zip(again, answers):
            kept, new, gone = answer.changes(other)
            assert len(kept) == len(other) > 0 and len(new) == len(gone) == 0
        copied.remove(body)
        assert body in scene and body not in copied
    pickled = pickle.loads(pickle.dumps(scene))
    others = detector.detect(pickled), detector.impacts(pickled), detector.near(pickled, 0.1)
    for answer, other in zip(ask(), others):
        with pytest.raises(ValueError, match="^old: an answer about another scene given"):
            answer.changes(other)
    scene.remesh(body, at, np.arange(900).reshape(-1, 3))
    for answer, old in zip(ask(), before):
        with pytest.raises(ValueError, match="^body 0: the pairs were found before it was re-meshed or its edges were set"):
            answer.changes(old)


def test_changes_of_edges_that_were_set_are_refused():
    scene = impinge.Scene()
    triangle = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    scene.add_edges([[1, -0.1, -1], [1, -0.1, 1]], [[0, 1]])
    scene.add_points([[1, 1, 0.1]])
    detector = impinge.Detector("cpu")
    before = detector.near(scene, 0.2, kinds=("ee", "vf"))
    assert [len(before.of(kind)) for kind in ("vf", "ee")] == [1, 1]
    scene.set_edges(triangle, [[0, 2], [0, 1], [1, 2]])
    after = detector.near(scene, 0.2, kinds=("ee", "vf"))
    for now, then in [(after, before), (after.of("ee"), before.of("ee")), (after.of("ee"), before)]:
        with pytest.raises(ValueError, match="^body 0: "):
            now.changes(then)
    # Faces and vertices have the numbers that they had.
    assert after.of("vf").changes(before.of("vf")).kept.tolist() == [[0, 0]]


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_meshes_pickle(duplicate, tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 1 0\nf 1 2 3\nl 1 2\n")
    mesh = impinge.read(path)
    assert mesh.notes == ["lines skipped, which are edges or faces of two corners: 1"]
    assert [body.notes for body in impinge.read_bodies(path)] == [mesh.notes]
    same = duplicate(mesh)
    assert same.notes == mesh.notes
    assert np.array_equal(same.vertices, mesh.vertices) and same.vertices.dtype == mesh.vertices.dtype
    assert np.array_equal(same.faces, mesh.faces) and same.faces.dtype == np.uint32
    assert (same.kind, same.name, same.n_welded) == ("triangles", str(path), mesh.n_welded)
    scene = impinge.Scene()
    assert scene.add(same) in scene
