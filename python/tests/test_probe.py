"""Points and rays."""

import numpy as np
import pytest

import impinge

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
#: A cube, oriented outward.
CUBE = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def grid(dtype=np.float64):
    line = np.linspace(-0.5, 1.5, 9)
    return np.stack(np.meshgrid(line, line, line), -1).reshape(-1, 3).astype(dtype)


def expected(points):
    inner = ((points > 0) & (points < 1)).all(1)
    held = ((points >= 0) & (points <= 1)).all(1)
    return np.where(inner, 1, np.where(held, 0, -1)).astype(np.int8)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_contains(dtype):
    points = grid(dtype)
    found = impinge.contains(CORNERS.astype(dtype), CUBE, points)
    assert found.dtype == np.int8 and found.shape == (len(points),)
    assert (found == expected(points)).all()
    assert (impinge.contains(CORNERS, CUBE[:, ::-1], points) == found).all()


def test_contains_reads_any_layout():
    points = grid()
    wide = np.zeros((len(points), 7))
    wide[:, 1:7:2] = points
    scene = impinge.Scene()
    body = scene.add(CORNERS, CUBE)
    detector = impinge.Detector("cpu", threads=2)
    for given in (wide[:, 1:7:2], np.asfortranarray(points), points[::-1][::-1], points.tolist()):
        assert (detector.contains(scene, body, given) == expected(points)).all()
    swapped = points.astype(">f8")
    assert (detector.contains(scene, body, swapped) == expected(points)).all()
    assert detector.contains(scene, body, np.empty((0, 3))).shape == (0,)
    scene.set_positions(body, CORNERS + 10)
    assert (detector.contains(scene, body, points) == -1).all()
    assert detector.stats.n_threads == 2


def test_contains_welds_and_refuses():
    soup, faces = CORNERS[CUBE].reshape(-1, 3), np.arange(36).reshape(-1, 3)
    with pytest.raises(impinge.InvalidError, match="not closed: the edge of vertices"):
        impinge.contains(soup, faces, grid())
    assert (impinge.contains(soup, faces, grid(), weld=True) == expected(grid())).all()
    with pytest.raises(ValueError, match=r"points\[1, 2\] = nan: must be finite"):
        impinge.contains(CORNERS, CUBE, [[0, 0, 0], [0, 0, np.nan]])
    with pytest.raises(ValueError, match=r"points: shape \(n, 3\) expected"):
        impinge.contains(CORNERS, CUBE, [0, 0, 0])
    scene = impinge.Scene()
    dots = scene.add_points(CORNERS)
    with pytest.raises(ValueError, match="triangles or tetrahedra"):
        impinge.Detector("cpu").contains(scene, dots, grid())


def test_contains_is_stopped():
    scene = impinge.Scene()
    body = scene.add(CORNERS, CUBE)
    token = impinge.CancelToken()
    token.cancel()
    detector = impinge.Detector("cpu")
    with pytest.raises(impinge.Cancelled):
        detector.contains(scene, body, grid(), cancel=token)
    assert (detector.contains(scene, body, grid()) == expected(grid())).all()


def test_closest():
    points = grid()
    closest = impinge.closest_points(CORNERS, CUBE, points)
    assert len(closest) == len(points) and repr(closest) == "Closest(729 points)"
    inner = np.clip(points, 0, 1)
    outside = np.linalg.norm(points - inner, axis=1)
    inside = np.minimum(inner, 1 - inner).min(1)
    distances = np.where(expected(points) < 0, outside, inside)
    assert np.allclose(closest.distances, distances, rtol=1e-15)
    assert np.allclose(np.linalg.norm(closest.points - points, axis=1), distances)
    assert closest.rows.dtype == np.uint32 and closest.rows.shape == (729, 2)
    assert closest.rows is closest.rows and not closest.rows.flags.writeable
    assert (closest.elements == closest.rows[:, 1]).all() and closest.elements.max() < 12
    assert closest.features.dtype == np.uint8 and closest.features.max() < 7
    assert isinstance(closest.hash, int) and closest.stats.n_threads >= 1
    signed = impinge.signed_distance(CORNERS, CUBE, points)
    assert (signed == closest.distances * expected(points)).all()
    scene = impinge.Scene()
    body = scene.add(CORNERS, CUBE)
    assert (impinge.Detector("cpu").signed_distance(scene, body, points) == signed).all()
    assert signed[expected(points) == 1].min() > 0 > signed[expected(points) == -1].max()


def test_closest_of_some():
    scene = impinge.Scene()
    a = scene.add(CORNERS, CUBE)
    b = scene.add_points(CORNERS.astype(np.float32) + 3)
    detector = impinge.Detector("cpu")
    points = [[0.5, 0.375, 0.75], [2.5, 3.0, 3.0], [9.0, 9.0, 9.0]]
    closest = detector.closest(scene, points, 1.0)
    assert closest.rows.tolist() == [[0, closest.elements[0]], [1, 0], [2**32 - 1] * 2]
    assert closest.distances.tolist() == [0.25, 0.5, np.inf]
    assert closest.features.tolist() == [6, 0, 255]
    assert np.isnan(closest.points[2]).all() and closest.points[1].tolist() == [3, 3, 3]
    assert (detector.closest(scene, points, of=b).rows[:, 0] == 1).all()
    assert (detector.closest(scene, points, of=a).rows[:, 0] == 0).all()
    with pytest.raises(ValueError, match="most: -1 given"):
        detector.closest(scene, points, -1)
    with pytest.raises(ValueError, match="named by `of`"):
        detector.closest(scene, points, between=(a, b))
    with pytest.raises(TypeError):
        detector.closest(scene, points, nearest=1)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_several_closest(dtype):
    # Distances of points on a lattice have exact squares, and most are shared by several.
    line = np.arange(4)
    dots = np.stack(np.meshgrid(line, line, line), -1).reshape(-1, 3).astype(dtype)
    points = grid(dtype) * 2
    scene = impinge.Scene()
    scene.add_points(dots[:40])
    scene.add_points(dots[40:])
    squares = ((points[:, None].astype(np.float64) - dots) ** 2).sum(2)
    order = np.argsort(squares, axis=1, kind="stable")[:, :9]
    rows = np.stack([order >= 40, np.where(order >= 40, order - 40, order)], -1)
    least = np.take_along_axis(squares, order, 1)
    detector = impinge.Detector("cpu", threads=2)
    for n in (2, 9):
        closest = detector.closest(scene, points, n_nearest=n)
        assert len(closest) == len(points)
        assert closest.rows.shape == (729, n, 2) and (closest.rows == rows[:, :n]).all()
        assert (closest.elements == closest.rows[..., 1]).all()
        assert closest.distances.shape == (729, n)
        assert np.allclose(closest.distances, np.sqrt(least[:, :n]), rtol=1e-15)
        assert closest.points.shape == (729, n, 3) and (closest.points == dots[order[:, :n]]).all()
        assert closest.features.shape == (729, n) and (closest.features == 0).all()
    near = detector.closest(scene, points, 0.75, n_nearest=9)
    is_near = least <= 0.75**2
    assert (near.rows == np.where(is_near[..., None], rows, 2**32 - 1)).all()
    assert (np.isinf(near.distances) == ~is_near).all()
    assert (np.isnan(near.points[..., 0]) == ~is_near).all() and 0 < is_near.sum() < is_near.size
    one = detector.closest(scene, points, query=impinge.Query(n_nearest=2), n_nearest=1)
    assert one.rows.shape == (729, 2) and (one.rows == rows[:, 0]).all()
    assert detector.closest(scene, points, query=impinge.Query(n_nearest=2)).rows.shape == (729, 2, 2)
    faces = impinge.closest_points(CORNERS, CUBE, [[0.5, 0.25, 2.0]], n_nearest=20)
    assert faces.elements.shape == (1, 20) and (faces.elements[0, 12:] == 2**32 - 1).all()
    assert sorted(faces.elements[0, :12]) == list(range(12))
    assert (np.diff(faces.distances[0, :12]) >= 0).all() and np.isinf(faces.distances[0, 12:]).all()
    for wrong in (0, -1, 2**32):
        with pytest.raises(ValueError, match=f"n_nearest: {wrong} given, 1 to 4294967295 allowed"):
            detector.closest(scene, points, n_nearest=wrong)
    with pytest.raises(TypeError, match="n_nearest: a whole number"):
        detector.closest(scene, points, n_nearest=1.5)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_locate(dtype):
    # Six tetrahedra around the diagonal of a cube, by the order of the coordinates.
    orders = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    steps = np.eye(3)
    corners = CORNERS.astype(dtype)
    ways = [np.cumsum([np.zeros(3), *(steps[axis] for axis in order)], 0) for order in orders]
    number = {tuple(corner): ix for ix, corner in enumerate(corners.tolist())}
    tetrahedra = [[number[tuple(corner)] for corner in way.tolist()] for way in ways]
    points = grid(dtype)
    inside = ((points >= 0) & (points <= 1)).all(1)
    held = [inside & (points[:, i] >= points[:, j]) & (points[:, j] >= points[:, k]) for i, j, k in orders]
    expected = np.where(inside, np.argmax(held, 0), -1)
    scene = impinge.Scene()
    body = scene.add(corners, tetrahedra)
    detector = impinge.Detector("cpu", threads=2)
    found = detector.locate(scene, body, points)
    assert found.dtype == np.int64 and found.shape == (729,) and (found == expected).all()
    assert set(found.tolist()) == {-1, 0, 1, 2, 3, 4, 5}
    alone = impinge.locate(corners, tetrahedra, points, threads=2)
    assert alone.dtype == np.int64 and (alone == expected).all()
    assert impinge.locate(corners, tetrahedra, np.empty((0, 3))).shape == (0,)
    with pytest.raises(ValueError, match="tetrahedra"):
        impinge.locate(corners, CUBE, points)
    with pytest.raises(ValueError, match="points"):
        impinge.locate(corners, tetrahedra, points[:, :2])
    with pytest.raises(ValueError, match=r"points\[0, 0\] = nan"):
        impinge.locate(corners, tetrahedra, [[np.nan, 0, 0]])
    assert detector.locate(scene, body, np.empty((0, 3))).shape == (0,)
    surface = scene.add(CORNERS, CUBE)
    with pytest.raises(ValueError, match="tetrahedra"):
        detector.locate(scene, surface, points)
    with pytest.raises(TypeError):
        detector.locate(scene, body, points, most=1)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_surfaces_wind_around_points(dtype):
    # A cube, and one of half its size in the same corner, as one surface: twice around, and not at all where that is reversed.
    faces, corners = np.array(CUBE), np.array(CORNERS, dtype)
    points = grid(dtype)
    inside, on = (np.abs(2 * points - 1).max(1) < 1), np.abs(2 * points - 1).max(1) == 1
    small, on_small = (np.abs(4 * points - 1).max(1) < 1), np.abs(4 * points - 1).max(1) == 1
    scene, detector = impinge.Scene(), impinge.Detector("cpu", threads=2)
    for sign, inner in [(1, faces), (-1, faces[:, ::-1])]:
        both, vertices = np.concatenate([faces, inner + 8]), np.concatenate([corners, corners / 2])
        body = scene.add(vertices, both)
        expected = np.where(on | on_small, impinge.ON_SURFACE, inside.astype(int) + sign * small)
        found = detector.winding_numbers(scene, body, points)
        assert found.dtype == np.int32 and (found == expected).all() and (small & ~on).any()
        assert (impinge.winding_numbers(vertices, both, points, threads=2) == expected).all()
        places = np.where(found == impinge.ON_SURFACE, 0, np.where(found == 0, -1, 1))
        assert (detector.contains(scene, body, points) == places).all()
    assert impinge.winding_numbers(corners, faces, np.empty((0, 3))).shape == (0,)
    with pytest.raises(ValueError, match="closed"):
        impinge.winding_numbers(corners, faces[1:], points)
    solid = scene.add([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]], [[0, 1, 2, 3]], kind="tetrahedra")
    with pytest.raises(ValueError, match="triangles"):
        detector.winding_numbers(scene, solid, points)


def axis_rays(dtype=np.float64):
    """Rays down onto the cube, and where they first meet it."""
    line = np.linspace(-0.5, 1.5, 9)
    places = np.stack(np.meshgrid(line, line), -1).reshape(-1, 2)
    origins = np.column_stack([places, np.full(len(places), 3.0)]).astype(dtype)
    directions = np.tile(np.array([0, 0, -0.5], dtype), (len(places), 1))
    return origins, directions, ((places >= 0) & (places <= 1)).all(1)


@pytest.mark.parametrize("dtypes", [(np.float32,) * 2, (np.float64,) * 2, (np.float32, np.float64)])
def test_cast(dtypes):
    origins, directions, hit = axis_rays()
    origins, directions = origins.astype(dtypes[0]), directions.astype(dtypes[1])
    hits = impinge.cast(CORNERS, CUBE, origins, directions)
    assert len(hits) == len(hit) and repr(hits) == "Hits(81 rays)"
    assert (hits.hit == hit).all() and hits.hit.dtype == np.bool_
    inner = ((origins[:, :2] > 0) & (origins[:, :2] < 1)).all(1)
    assert (hits.t == np.where(hit, 4.0, np.inf)).all() and (hits.t_end[inner] == 4.0).all()
    assert hits.rows.shape == (81, 2) and hits.rows.dtype == np.uint32
    assert hits.rows is hits.rows and not hits.rows.flags.writeable
    assert (hits.rows[~hit] == 2**32 - 1).all() and (hits.rows[hit, 0] == 0).all()
    assert (hits.elements == hits.rows[:, 1]).all()
    assert (np.diff(hits.offsets.astype(int)) == hit).all()
    corners = CORNERS[CUBE[hits.elements[hit]]]
    points = np.einsum("nk,nkj->nj", hits.barycentrics[hit], corners)
    assert np.abs(points - (origins[hit] + hits.t[hit, None] * directions[hit])).max() < 1e-15
    assert np.isnan(hits.barycentrics[~hit]).all() and (hits.features[~hit] == 255).all()
    corner = hits.features < 3
    assert corner.sum() == 4 and np.isin(origins[corner][:, :2], (0, 1)).all()
    assert isinstance(hits.hash, int) and hits.stats.n_threads >= 1


def test_cast_all_and_any():
    origins, directions, hit = axis_rays()
    scene = impinge.Scene()
    body = scene.add(CORNERS, CUBE)
    dots = scene.add_points(CORNERS.astype(np.float32) + [0, 0, 1])
    detector = impinge.Detector("cpu", threads=2)
    every = detector.cast(scene, origins, directions, hits="all")
    ray = np.repeat(np.arange(len(every)), np.diff(every.offsets.astype(int)))
    assert len(every.t) == len(every.rows) == len(every.features) == len(ray) > 2 * hit.sum()
    assert (every.hit == hit).all() and every.barycentrics.shape == (len(ray), 3)
    grows = np.diff(every.t) >= 0
    assert grows[ray[1:] == ray[:-1]].all()
    # A ray down a wall of the cube lies in the planes of two faces.
    assert (every.t_end - every.t == 2).any() and (every.t_end > every.t).sum() > 20
    of_dots = detector.cast(scene, origins, directions, of=dots)
    assert of_dots.hit.sum() == 4 and (of_dots.t[of_dots.hit] == 2).all()
    assert (every.rows[:, 0] == 1).sum() == 8
    inner = detector.cast(scene, origins, directions, of=body, hits="all")
    assert (inner.rows == every.rows[every.rows[:, 0] == 0]).all()
    query = impinge.Query(hits="any")
    yes = detector.cast(scene, origins, directions, query=query)
    assert (yes.hit == hit).all() and not yes.offsets.any()
    with pytest.raises(ValueError, match='hits: "any" given'):
        print(yes.t)
    segments = detector.cast(scene, origins, directions, 3.999, of=body)
    assert not segments.hit.any() and (segments.t == np.inf).all()
    assert (detector.cast(scene, origins, directions, 4, of=body).hit == hit).all()
    scene.set_positions(body, CORNERS - [0, 0, 1])
    assert (detector.cast(scene, origins, directions, of=body).t[hit] == 6).all()
    assert len(detector.cast(scene, np.empty((0, 3)), np.empty((0, 3)))) == 0


def test_cast_refuses():
    scene = impinge.Scene()
    scene.add(CORNERS, CUBE)
    detector = impinge.Detector("cpu")
    row = [[0.0, 0.0, 1.0]]
    with pytest.raises(ValueError, match="^directions: 1 origins and 2 directions given, as many directions as origins allowed$"):
        detector.cast(scene, row, row * 2)
    with pytest.raises(ValueError, match="most: -1 given"):
        detector.cast(scene, row, row, -1)
    with pytest.raises(ValueError, match=r"directions\[0, 1\] = nan: must be finite"):
        detector.cast(scene, row, [[0.0, np.nan, 0.0]])
    with pytest.raises(ValueError, match=r"origins: shape \(n, 3\) expected"):
        detector.cast(scene, [0, 0, 0], row)
    with pytest.raises(ValueError, match="hits: 'last' given, first, any or all|hits: "):
        detector.cast(scene, row, row, hits="last")
    with pytest.raises(ValueError, match="which|query"):
        detector.cast(scene, row, row, which="self")
    token = impinge.CancelToken()
    token.cancel()
    with pytest.raises(impinge.Cancelled):
        detector.cast(scene, row, row, cancel=token)
    assert detector.cast(scene, row, row).hit.tolist() == [True]
