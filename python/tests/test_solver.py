"""What penetration-free solvers ask: how far vertices may move, and neighbours by element."""

import copy
import pickle
import re

import numpy as np
import pytest

import impinge
from shapes import ball


@pytest.fixture
def scene():
    """Two balls, one in single and one in double precision, with a gap of about 0.1."""
    scene = impinge.Scene()
    vertices, faces = ball(12, 16)
    scene.add(vertices, faces)
    scene.add(vertices.astype(np.float64) + [2.1, 0, 0], faces)
    return scene


@pytest.fixture
def detector():
    return impinge.Detector("cpu", threads=2)


def test_moving_by_the_bounds_is_free(scene, detector):
    rng = np.random.default_rng(3)
    for _ in range(10):
        safe = detector.safe_distances(scene, 0.2)
        assert len(safe.touching) == 0 and repr(safe).endswith("0 touching pairs)")
        for body in scene.bodies:
            at = scene.positions(body)
            bounds = safe.of(body)
            assert bounds.dtype == at.dtype and bounds.shape == (len(at),)
            assert (bounds > 0).all() and (bounds <= 0.2).all()
            way = rng.normal(size=at.shape)
            way *= (0.999 * bounds / np.linalg.norm(way, axis=1))[:, None]
            scene.set_end_positions(body, (at + way).astype(at.dtype))
        assert detector.is_free(scene)
        detector.advance(scene).apply(scene)
    assert not detector.any(scene)


def test_each_vertex_goes_as_far_as_it_can(scene, detector):
    a, b = scene.bodies
    starts = [scene.positions(body).copy() for body in (a, b)]
    scene.set_end_positions(a, starts[0] + np.float32([0.3, 0, 0]))
    truncation = detector.truncate(scene)
    at = truncation.positions(a)
    assert truncation.bodies == [a] and truncation.positions(b) is None
    assert at.dtype == np.float32 and truncation.n_touching == 0 and truncation.start_intersects is None
    moved = at[:, 0] - starts[0][:, 0]
    assert 0 < truncation.n_cut < len(at) and truncation.rounds >= 1
    assert (moved >= 0).all() and moved.max() > 0.2999 and moved.min() < 0.2
    assert detector.advance(scene).fraction * 0.3 < moved.max()
    pairs = truncation.pairs
    impacts = detector.impacts(scene)
    met = {(kind, *row) for kind, row in zip(impacts.kinds.tolist(), impacts.rows.tolist(), strict=True)}
    assert met <= {(kind, *row) for kind, row in zip(pairs.kinds.tolist(), pairs.rows.tolist(), strict=True)}
    assert len(met) > 0 and len(pairs.of("vf")) + len(pairs.of("ee")) == len(pairs)
    assert f"n_cut={truncation.n_cut}" in repr(truncation)
    with pytest.raises(TypeError, match="pickle its arrays"):
        pickle.dumps(truncation)
    scene.set_end_positions(a, at)
    assert detector.is_free(scene, start="verify")
    truncation.apply(scene)
    assert np.array_equal(scene.positions(a), at)


def test_fixed_bodies_leave_all_of_a_distance(scene, detector):
    both = detector.safe_distances(scene, 0.2, which="between")
    one = detector.safe_distances(scene, 0.2, which="between", fixed=[0])
    query = impinge.Query(which="between", fixed=[scene.bodies[0], 0])
    assert detector.safe_distances(scene, 0.2, query=query).of(1).tolist() == one.of(1).tolist()
    assert query == pickle.loads(pickle.dumps(query))
    assert not one.of(0).any()
    near = both.of(1) < 0.2
    assert near.any()
    expected = np.minimum(2 * both.of(1)[near], 0.2)
    assert np.allclose(one.of(1)[near], expected, rtol=1e-9)


def test_pairs_nearer_than_the_smallest_float(detector):
    """They do not touch, and their distance is rounded down to 0: they stand still, too."""
    tiny = 5e-324
    scene = impinge.Scene()
    slope = scene.add([[0, 0, 0], [4, 4, 0], [0, 0, 4]], [[0, 1, 2]])
    beside = scene.add([[tiny, 0, 1], [tiny, 0, 2], [tiny, 0, 2]], [[0, 1, 2]])
    assert not detector.any(scene) and detector.distance(scene, slope, beside).distance == 0
    assert detector.closest(scene, [[tiny, 0, 1]], of=slope).distances.tolist() == [0]
    assert len(detector.near(scene, 0.0)) == 0
    safe = detector.safe_distances(scene, 1.0)
    assert safe.of(beside).tolist() == [0, 0, 0] and len(safe.touching) > 0


def test_touching_pairs_stand_still_and_are_named(detector):
    scene = impinge.Scene()
    scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    scene.add_points([[1, 1, 0], [1, 1, 0.5], [9, 9, 9]])
    safe = detector.safe_distances(scene, 1.0, closest_points=True)
    assert safe.touching.rows.tolist() == [[1, 0, 0, 0]] and safe.touching.points.shape == (1, 2, 3)
    assert safe.of(0).tolist() == [0, 0, 0]
    assert safe.of(1)[[0, 2]].tolist() == [0, 1] and 0.2499 < safe.of(1)[1] < 0.25
    scene.set_thickness(0, 0.25)
    safe = detector.safe_distances(scene, 1.0)
    assert 0.1249 < safe.of(1)[1] < 0.125
    scene.set_thickness(0, 0.5)
    safe = detector.safe_distances(scene, 1.0)
    assert safe.of(1).tolist() == [0, 0, 1] and len(safe.touching) == 2
    with pytest.raises(TypeError, match="^SafeDistances name bodies of a live scene"):
        pickle.dumps(safe)


def test_neighbours_are_near_pairs(scene, detector):
    near = detector.near(scene, 0.3, distances=True)
    lists = detector.neighbours(scene, 0.3)
    assert len(lists) == len(near) > 0 and repr(lists) == f"Neighbours({len(near)} pairs)"
    assert [lists.first(1, part) for part in ("vertices", "edges", "faces")] == [
        len(scene.positions(0)),
        len(scene.edges(0)),
        len(scene.faces(0)),
    ]
    for kind, parts, rows in [("vf", ("vertices", "faces"), lists.vf), ("ee", ("edges", "edges"), lists.ee)]:
        of = near.of(kind)
        first = np.array([[lists.first(body, part) for part in parts] for body in range(2)])
        a = first[of.rows[:, 0], 0] + of.rows[:, 1]
        b = first[of.rows[:, 2], 1] + of.rows[:, 3]
        distances = of.distances
        if kind == "ee":
            a, b, distances = np.r_[a, b], np.r_[b, a], np.r_[distances, distances]
        order = np.lexsort((b, a))
        row = np.repeat(np.arange(len(rows.offsets) - 1), np.diff(rows.offsets.astype(np.int64)))
        assert row.tolist() == a[order].tolist() and rows.indices.tolist() == b[order].tolist()
        assert (rows.distances <= distances[order]).all()
        assert np.allclose(rows.distances, distances[order], rtol=2**-20)
    turned = lists.fv
    assert turned is lists.of("vf", reverse=True) and not turned.indices.flags.writeable
    assert len(turned.indices) == len(lists.vf.indices) and int(turned.offsets[-1]) == len(turned.indices)
    assert np.isin(turned.indices, np.unique(np.flatnonzero(np.diff(lists.vf.offsets.astype(np.int64))))).all()


def test_lists_are_read_into_the_memory_of_those_before(scene, detector):
    lists = detector.neighbours(scene, 0.3)
    before, indices = lists.vf, lists.vf.indices.copy()
    fewer = detector.neighbours(scene, 0.2, out=lists)
    expected = detector.neighbours(scene, 0.2)
    assert fewer is lists and 0 < len(lists) == len(expected) < len(indices)
    for of in ("vf", "fv", "ee"):
        for ours, theirs in zip(getattr(lists, of), getattr(expected, of)):
            assert np.array_equal(ours, theirs) and not ours.flags.writeable
    assert np.shares_memory(lists.vf.indices, before.indices) and np.shares_memory(lists.vf.distances, before.distances)
    # More do not fit; what was read before is left alone.
    kept = lists.vf.indices
    held = kept.copy()
    detector.neighbours(scene, 0.6, out=lists)
    assert len(lists.vf.indices) > len(indices) and not np.shares_memory(lists.vf.indices, kept)
    assert np.array_equal(kept, held)
    with pytest.raises(ValueError, match="^distance: "):
        detector.neighbours(scene, -1, out=lists)
    assert len(lists.vf.indices) > len(indices)
    with pytest.raises(TypeError, match="^out: Csr given, Neighbours allowed"):
        detector.neighbours(scene, 0.2, out=expected.vf)


def test_positions_that_are_not_copied_are_checked_when_they_are_read():
    scene = impinge.Scene()
    n = 40_000
    strip = np.stack([np.arange(n), np.arange(n) % 2, np.zeros(n)], 1).astype(np.float32)
    a, b = (scene.add(strip, np.stack([np.arange(n - 2) + k for k in range(3)], 1)) for _ in range(2))
    bad = strip.copy()
    bad[17, 1] = np.nan
    bad.flags.writeable = False
    scene.set_positions(b, bad, copy=False)
    detector = impinge.Detector("cpu")
    for ask in (lambda: detector.detect(scene), lambda: scene._convex_overlap(a, b), lambda: detector.near(scene, 0.1)):
        with pytest.raises(ValueError, match="vertex 17"):
            ask()
    with pytest.raises(ValueError, match=r"vertices\[17, 1\]"):
        scene.set_positions(a, bad)


def test_lists_are_read_into_arrays_of_the_caller(scene, detector):
    lists = detector.neighbours(scene, 0.3)
    csr = lists.vf
    n_rows, n = len(csr.offsets), len(csr.indices)
    for dtype in (np.float64, np.float32):
        room = impinge.Csr(np.zeros(n_rows + 3, np.uint64), np.zeros(n + 5, np.uint32), np.full(n + 5, -1, dtype))
        got = lists.of("vf", out=room)
        assert all(np.shares_memory(ours, array) for ours, array in zip(got, room))
        assert np.array_equal(got.offsets, csr.offsets) and np.array_equal(got.indices, csr.indices)
        assert got.distances.dtype == dtype and (room.distances[n:] == -1).all()
        assert (got.distances <= csr.distances).all()
        # The next single above is above.
        if dtype == np.float32:
            assert (np.nextafter(got.distances, np.float32(9)) > csr.distances).all()
            assert (got.distances.astype(np.float64) < csr.distances).any()
        else:
            assert np.array_equal(got.distances, csr.distances)
    good = [np.zeros(n_rows, np.uint64), np.zeros(n, np.uint32), np.zeros(n)]
    for at, bad, message in [
        (0, good[0][1:], f"out.offsets: room for {n_rows - 1} numbers given, {n_rows} needed"),
        (1, good[1].astype(np.int64), "out.indices: 1 dimensions of int64 given, an array of uint32 with 1 dimension allowed"),
        (1, good[1][None], "out.indices: 2 dimensions of uint32 given"),
        (1, np.zeros(2 * n, np.uint32)[::2], "out.indices: an array with gaps given"),
        (2, np.zeros(n - 1, np.float32), f"out.distances: room for {n - 1} numbers given, {n} needed"),
        (2, csr.distances, "out.distances: "),
        (2, None, "out.distances: <class 'NoneType'> given, an array of float64 or float32"),
    ]:
        room = [array.copy() for array in good]
        room[at] = bad
        with pytest.raises(ValueError, match="^" + re.escape(message)):
            lists.of("vf", out=room)
        assert not any(array.any() for array in room[:2])


def test_lists_with_a_margin_give_the_same(scene, detector):
    listing = impinge.Detector("cpu", threads=2, reuse_margin=0.05)
    assert listing.settings["reuse_margin"] == 0.05
    rng = np.random.default_rng(4)
    for _ in range(20):
        for body in scene.bodies:
            at = scene.positions(body)
            scene.set_positions(body, (at + rng.uniform(-0.01, 0.01, at.shape)).astype(at.dtype))
        near, listed = (by.near(scene, 0.2, closest_points=True) for by in (detector, listing))
        assert listed.hash == near.hash and len(near) > 100
        assert np.array_equal(listed.rows, near.rows) and np.array_equal(listed.points, near.points)
        safe, listed = (by.safe_distances(scene, 0.1) for by in (detector, listing))
        assert all(np.array_equal(listed.of(body), safe.of(body)) for body in range(2))
        lists, listed = (by.neighbours(scene, 0.2) for by in (detector, listing))
        assert np.array_equal(listed.vf.indices, lists.vf.indices)


@pytest.mark.parametrize("most", [-1, float("nan"), float("inf")])
def test_bad_lengths_are_refused(scene, detector, most):
    with pytest.raises(ValueError, match="^most: "):
        detector.safe_distances(scene, most)


def test_bad_bodies_are_refused(scene, detector):
    with pytest.raises(ValueError, match="^fixed\\[1\\]: "):
        detector.safe_distances(scene, 1, fixed=[0, 7])
    with pytest.raises(TypeError, match="^fixed: a sequence of bodies expected, int given"):
        detector.safe_distances(scene, 1, fixed=3)
    safe = detector.safe_distances(scene, 1)
    with pytest.raises(ValueError, match="^body: "):
        safe.of(7)
    with pytest.raises(ValueError, match='^part: "corners" given'):
        detector.neighbours(scene, 1).first(0, "corners")


def test_what_is_left_out(detector):
    scene = impinge.Scene()
    grid = np.stack(np.meshgrid(np.arange(8), np.arange(6), [0.0], indexing="ij"), -1).reshape(-1, 3)
    faces = [[6 * i + j, 6 * i + j + 1, 6 * i + 6 + j] for i in range(7) for j in range(5)]
    faces += [[6 * i + j + 1, 6 * i + j + 7, 6 * i + 6 + j] for i in range(7) for j in range(5)]
    cloth = scene.add(grid, faces)
    points = scene.add_points(grid + [0, 0, 0.25])
    near = detector.near(scene, 1.0, of=cloth)
    counts = [len(detector.near(scene, 1.0, of=cloth, exclude=impinge.rings(n))) for n in range(3)]
    assert len(near) == counts[0] > counts[1] >= counts[2] == len(detector.near(scene, 1.0, between=(cloth, points)))
    rest = scene.rest_pairs(1.0)
    assert repr(rest) == f"Exclusion({len(detector.near(scene, 1.0))} pairs)" and rest == rest != impinge.rings(1)
    for ask in (detector.near, detector.candidates, detector.neighbours):
        assert len(ask(scene, 1.0)) > 0
    assert len(detector.near(scene, 1.0, exclude=rest)) == 0 == len(detector.neighbours(scene, 1.0, exclude=[rest]))
    free = detector.safe_distances(scene, 0.5, exclude=rest).of(cloth)
    assert (free == 0.5).all() and (detector.safe_distances(scene, 0.5).of(cloth) < 0.13).all()
    # Groups: the points meet the left half of the cloth only.
    scene.set_groups(cloth, (grid[:, 0] >= 4).astype(int))
    scene.set_groups(points, np.full(len(grid), 7))
    kept = detector.near(scene, 0.3, between=(cloth, points), exclude=impinge.groups(1, 7))
    assert 0 < len(kept) < len(detector.near(scene, 0.3, between=(cloth, points)))
    assert (grid[np.asarray(scene.faces(cloth))[kept.of("vf").rows[:, 3]]][:, :, 0].min(axis=1) < 4).all()
    scene.set_pinned(cloth, np.ones(len(grid), bool))
    assert len(detector.near(scene, 0.3)) > 0
    scene.set_pinned(points, np.ones(len(grid), bool))
    assert len(detector.near(scene, 0.3)) == 0
    scene.set_pinned(points, np.zeros(len(grid), bool))
    # What is near at rest is so whatever is pinned or filtered.
    hidden = copy.copy(scene)
    for body in (cloth, points):
        hidden.set_pinned(body, np.ones(len(grid), bool))
        hidden.set_filter(body, mask=0)
    assert len(detector.near(hidden, 1.0)) == 0 and repr(hidden.rest_pairs(1.0)) == repr(rest)
    assert len(detector.near(scene, 1.0, exclude=hidden.rest_pairs(1.0))) == 0
    # A point and what is below it, as compressed sparse rows.
    offsets, listed = np.arange(len(grid) + 1), np.arange(len(grid))
    sewn = scene.vertex_pairs(points, offsets, listed, cloth)
    kept = detector.near(scene, 0.3, between=(cloth, points), kinds=["vv"], exclude=sewn)
    assert len(kept) == 0 < len(detector.near(scene, 0.3, between=(cloth, points), kinds=["vv"]))
    assert repr(sewn) == "Exclusion(48 pairs of vertices)" and sewn == scene.vertex_pairs(points, offsets, listed, cloth)
    with pytest.raises(ValueError, match="lists for the vertices of body 1, of vertices of body 0: 48 offsets, but body 1 has 48 vertices"):
        detector.near(scene, 0.3, exclude=scene.vertex_pairs(points, offsets[1:], listed, cloth))
    with pytest.raises(ValueError, match="vertex 48 at 0, but body 1 has 48 vertices"):
        detector.near(scene, 0.3, exclude=scene.vertex_pairs(points, offsets, listed + 48))
    none = scene.vertex_pairs(points, np.zeros(49, int), [])
    assert len(detector.near(scene, 0.3, exclude=none)) == len(detector.near(scene, 0.3))
    # Faces that were within the distance, of sheets that lie in one another now.
    sheets = impinge.Scene()
    bodies = [sheets.add(grid + [0, 0, z], faces) for z in (0, 0.25, 5)]
    apart = sheets.rest_pairs(1.0)
    for body in bodies[1:]:
        sheets.set_positions(body, grid)
    left = detector.detect(sheets, exclude=apart)
    assert {(a, b) for a, _, b, _ in left.rows.tolist()} == {(0, 2), (1, 2)}
    assert len(left) == detector.count(sheets) - detector.count(sheets, between=(bodies[0], bodies[1])) > 0
    assert detector.any(sheets, exclude=apart) and not detector.any(sheets, exclude=sheets.rest_pairs(0.0))
    # Its pairs would be none in another scene.
    for foreign in [rest, sewn]:
        with pytest.raises(ValueError, match=r"^exclude\[1\]: of another scene"):
            detector.near(pickle.loads(pickle.dumps(scene)), 0.3, exclude=[impinge.rings(1), foreign])
    assert detector.near(copy.copy(scene), 0.3, exclude=sewn).hash == detector.near(scene, 0.3, exclude=sewn).hash
    with pytest.raises(ValueError, match=r"^body 0: groups\[2\]: -1 given, 0 or more allowed"):
        scene.set_groups(cloth, [0, 0, -1] + 45 * [0])
    with pytest.raises(ValueError, match=r"^body 0: pinned: shape \(48,\) of bool expected, \(48,\) of int64 given"):
        scene.set_pinned(cloth, np.zeros(48, int))
    query = impinge.Query(exclude=[impinge.rings(2), (1, 0), impinge.groups(7, 1)])
    assert query == pickle.loads(pickle.dumps(query)) and len({query, query.replace()}) == 1
    assert repr(query) == "Query(exclude=((0, 1), groups(1, 7), rings(2)))"
    with pytest.raises(TypeError, match="^an Exclusion of pairs names bodies"):
        pickle.dumps(rest)
    with pytest.raises(ValueError, match="^n: 17 given"):
        impinge.rings(17)
    with pytest.raises(TypeError, match="^exclude: a pair of bodies, an Exclusion, or a sequence of these, expected"):
        detector.detect(scene, exclude=3)
    with pytest.raises(ValueError, match="3 groups given, but there are 48 vertices"):
        scene.set_groups(cloth, [1, 2, 3])
