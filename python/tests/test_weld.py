"""Welding by position: `impinge.weld`."""

import numpy as np
import pytest
from shapes import ball

import impinge

SEAM = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, -0.0]])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_vertices_at_one_position_become_the_first_of_them(dtype):
    vertices, faces, index = impinge.weld(SEAM.astype(dtype), [[0, 1, 2], [3, 4, 5]])
    assert vertices.dtype == dtype
    assert vertices.tolist() == SEAM[[0, 1, 2, 4]].tolist()
    assert faces.tolist() == [[0, 1, 2], [1, 3, 2]]
    assert index.tolist() == [0, 1, 2, 1, 3, 2]
    assert faces.dtype == index.dtype == np.uint32


def test_a_soup_becomes_the_mesh_that_it_was():
    vertices, faces = ball()
    soup = vertices[faces].reshape(-1, 3)
    welded, triangles, index = impinge.weld(soup, np.arange(len(soup)).reshape(-1, 3))
    assert len(welded) == len(np.unique(faces))
    assert np.array_equal(welded[triangles], vertices[faces])
    firsts = np.unique(index, return_index=True)[1]
    assert np.array_equal(soup[firsts], welded)
    assert np.array_equal(welded[index], soup)


@pytest.mark.parametrize("width", [1, 2, 3, 4])
def test_elements_of_any_width(width):
    faces = np.arange(width)[None] + 2
    _, welded, _ = impinge.weld(SEAM, faces)
    assert welded.tolist() == [[2, 1, 3, 2][:width]]


def test_no_tolerance_and_no_nan():
    vertices, _, index = impinge.weld([[1.0, 0, 0], [np.nextafter(1.0, 2), 0, 0], [np.nan] * 3, [np.nan] * 3], [[0, 1, 2]])
    assert len(vertices) == 4
    assert index.tolist() == [0, 1, 2, 3]


def test_what_is_refused():
    with pytest.raises(ValueError, match=r"faces\[0, 2\] = 6: there are 6 vertices"):
        impinge.weld(SEAM, [[0, 1, 6]])
    with pytest.raises(ValueError, match=r"vertices: shape \(n, 3\) expected"):
        impinge.weld(SEAM[:, :2], [[0, 1, 2]])
    assert impinge.weld(np.zeros((0, 3)), np.zeros((0, 3), int))[1].shape == (0, 3)
