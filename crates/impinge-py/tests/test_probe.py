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
