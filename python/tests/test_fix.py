"""`impinge.fix`: arrays in, a mended mesh and what was done out."""

import numpy as np
import pytest

import impinge

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float32)
#: A tetrahedron, one of whose faces is turned, and another one twice.
FACES = [[0, 2, 1], [0, 1, 3], [1, 3, 2], [2, 0, 3], [0, 1, 3]]


def test_a_mesh_is_mended():
    fixed = impinge.fix(VERTICES, FACES)
    assert fixed.vertices.dtype == np.float32 and np.array_equal(fixed.vertices, VERTICES)
    assert fixed.faces.tolist() == [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    assert fixed.repairs["duplicates"] == {"faces_removed": 1, "opposite_faces": 0}
    assert fixed.repairs["orient"]["faces_turned"] == 1
    assert (fixed.before["duplicate_faces"], fixed.after["duplicate_faces"]) == (1, 0)
    assert fixed.after["watertight"] is True and not fixed.seams
    assert impinge.contains(fixed.vertices, fixed.faces, [[0.1, 0.1, 0.1]]).tolist() == [1]


def test_repairs_are_chosen_by_name():
    only = impinge.fix(VERTICES, FACES, only=["duplicates"])
    assert list(only.repairs) == ["duplicates"] and only.after["inconsistent_edges"] > 0
    assert "duplicates" not in impinge.fix(VERTICES, FACES, skip=["duplicates"]).repairs
    # One name alone is no iterable of letters.
    assert list(impinge.fix(VERTICES, FACES, only="duplicates").repairs) == ["duplicates"]
    assert "duplicates" not in impinge.fix(VERTICES, FACES, skip="duplicates").repairs
    closed = impinge.fix(VERTICES, FACES[:3], close_holes=3)
    assert closed.after["watertight"] is True and closed.repairs["close-holes"]["holes_closed"] == 1


@pytest.mark.parametrize(
    "options",
    [{"only": ["mend"]}, {"only": ["weld"], "skip": ["weld"]}, {"only": ["close-holes"]}, {"close_holes": 2}, {"close_holes": 257}, {"threads": -1}],
)
def test_what_cannot_be_asked_is_refused(options):
    with pytest.raises(impinge.InvalidError, match=f"^{next(iter(options))}"):
        impinge.fix(VERTICES, FACES, **options)


def test_bad_faces_are_named():
    with pytest.raises(ValueError, match="9"):
        impinge.fix(VERTICES, [[0, 1, 9]])
