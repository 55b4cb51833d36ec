"""`mesh.impinge`, beside pyvista. It is large, so scripts/test-python installs it only if IMPINGE_PYTHON_BESIDE names it."""

import doctest

import numpy as np
import pytest

import impinge

pv = pytest.importorskip("pyvista", minversion="0.48")


def test_found_without_an_import():
    assert type(pv.Cube().impinge).__module__ == "impinge.pyvista"
    assert pv.Cube().impinge is not pv.Cube().impinge
    with pytest.raises(AttributeError):
        pv.ImageData().impinge  # noqa: B018


def test_examples_run():
    from impinge import pyvista

    assert doctest.testmod(pyvista) == doctest.TestResults(0, 5)


def test_answers_are_those_of_the_arrays():
    # Split along its edges: the cube is closed only by the positions of its vertices.
    mesh = pv.Cube(x_length=2, y_length=2, z_length=2).triangulate()
    vertices, faces = np.asarray(mesh.points), mesh.regular_faces
    side = np.linspace(-1.5, 1.5, 7)
    points = np.stack(np.meshgrid(side, side, side, indexing="ij"), -1).reshape(-1, 3)
    inside, on = (np.abs(points) < 1).all(axis=1), (np.abs(points) <= 1).all(axis=1)
    asked = mesh.impinge
    assert (asked.contains(points) == np.where(inside, 1, np.where(on, 0, -1))).all()
    assert (np.sign(asked.signed_distance(points)) == asked.contains(points)).all()
    closest, same = asked.closest(points), impinge.closest_points(vertices, faces, points)
    assert (closest.elements == same.elements).all() and (closest.points == same.points).all()
    assert asked.closest(points, n_nearest=2).distances.size == 2 * len(points)
    rays = points, np.broadcast_to([0.3, -1, 0.2], points.shape)
    hits, same = asked.cast(*rays), impinge.cast(vertices, faces, *rays)
    assert hits.hit.any() and (hits.hit == same.hit).all() and (hits.t == same.t).all()
    assert len(asked.cast(*rays, hits="all").t) >= hits.hit.sum()
    assert not asked.cast([[0, 0, 5]], [[0, 0, -1]], most=1).hit.any()
    # What pyvista says by floats, away from the surface.
    far = ~on | inside
    theirs = pv.PolyData(points).compute_implicit_distance(mesh)["implicit_distance"]
    assert np.allclose(asked.signed_distance(points)[far], -theirs[far], atol=1e-6)


def test_pairs_of_faces_and_a_mesh_that_changes():
    mesh = pv.merge([pv.Sphere(), pv.Sphere(center=(0.9, 0, 0))], merge_points=False)
    mesh = mesh.extract_surface(algorithm=None).triangulate()
    found = mesh.impinge.self_pairs()
    assert len(found) > 0 and (found == impinge.self_pairs(mesh.points, mesh.regular_faces, weld=True)).all()
    half = mesh.n_points // 2
    mesh.points[half:] += [1, 0, 0]
    assert len(mesh.impinge.self_pairs()) == 0


def test_what_is_refused():
    with pytest.raises(ValueError, match="triangulate"):
        pv.Cube().impinge.contains([[0, 0, 0]])
    with pytest.raises(ValueError, match="edge"):
        pv.Plane().triangulate().impinge.contains([[0, 0, 0]])
