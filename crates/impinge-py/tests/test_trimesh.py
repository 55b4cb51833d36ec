"""`impinge.trimesh`: the questions of trimesh, beside trimesh itself."""

import numpy as np
import pytest

from impinge.trimesh import ProximityQuery, closest_point, contains, signed_distance

trimesh = pytest.importorskip("trimesh")


def meshes():
    yield trimesh.creation.icosphere(subdivisions=2)
    yield trimesh.creation.box((1, 2, 3))
    yield trimesh.creation.torus(2.0, 0.5)
    # Seams: each face has vertices of its own.
    soup = trimesh.creation.icosphere(subdivisions=2)
    soup.unmerge_vertices()
    yield soup


@pytest.mark.parametrize("mesh", list(meshes()))
def test_beside_trimesh(mesh):
    rng = np.random.default_rng(7)
    low, high = mesh.bounds
    points = rng.uniform(low - 0.5, high + 0.5, (200, 3))
    query = ProximityQuery(mesh, threads=2)
    closest, distance, face = query.on_surface(points)
    theirs, their_distance, _ = trimesh.proximity.closest_point_naive(mesh, points)
    assert closest.shape == (200, 3) and face.dtype == np.int64
    assert np.allclose(distance, their_distance, rtol=1e-9, atol=1e-12)
    assert np.allclose(np.linalg.norm(points - closest, axis=1), distance, rtol=1e-9, atol=1e-12)
    # The point is on the face that is named.
    on = trimesh.triangles.closest_point(mesh.triangles[face], points)
    assert np.allclose(on, closest, atol=1e-9)
    assert np.allclose(closest, theirs, atol=1e-9) or len(mesh.faces) < 20
    distance, vertex = query.vertex(points)
    gaps = np.linalg.norm(points[:, None] - mesh.vertices[None], axis=2)
    assert np.allclose(distance, gaps.min(axis=1), rtol=1e-12)
    assert np.allclose(gaps[np.arange(200), vertex], distance, rtol=1e-12)
    signed = query.signed_distance(points)
    assert ((signed > 0) == query.contains(points)).all() and (signed > 0).any() and (signed < 0).any()
    for ours, other in [(closest_point(mesh, points)[0], closest), (signed_distance(mesh, points), signed)]:
        assert (ours == other).all()


def test_inside_is_decided():
    box = trimesh.creation.box((2, 2, 2))
    side = np.linspace(-1.5, 1.5, 7)
    grid = np.stack(np.meshgrid(side, side, side, indexing="ij"), -1).reshape(-1, 3)
    # Points behind edges, on faces and on vertices: where a ray is in doubt.
    assert (contains(box, grid) == (np.abs(grid) < 1).all(axis=1)).all()
    on = (np.abs(grid).max(axis=1) == 1) & (np.abs(grid) <= 1).all(axis=1)
    assert ((signed_distance(box, grid) == 0) == on).all()


def test_a_mesh_that_changes_is_read_again():
    mesh = trimesh.creation.icosphere(subdivisions=1)
    query = ProximityQuery(mesh)
    assert query.contains([[0, 0, 0], [3, 0, 0]]).tolist() == [True, False]
    mesh.apply_translation([3, 0, 0])
    assert query.contains([[0, 0, 0], [3, 0, 0]]).tolist() == [False, True]
    mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    with pytest.raises(ValueError, match="not closed"):
        query.contains([[3, 0, 0]])
    # Nearest points do not need a closed surface.
    assert query.on_surface([[9, 0, 0]])[1][0] > 4.9
