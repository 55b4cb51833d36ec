"""`impinge.trimesh`: the questions of trimesh, beside trimesh itself."""

import importlib
import inspect

import numpy as np
import pytest

from impinge.trimesh import ProximityQuery, RayMeshIntersector, closest_point, contains, signed_distance

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


@pytest.mark.parametrize("mesh", list(meshes()))
def test_rays_beside_trimesh(mesh):
    rng = np.random.default_rng(8)
    low, high = mesh.bounds
    origins, directions = rng.uniform(low - 0.5, high + 0.5, (300, 3)), rng.normal(size=(300, 3))
    rays = RayMeshIntersector(mesh, threads=2)
    face, ray, places = rays.intersects_id(origins, directions, return_locations=True)
    assert face.dtype == ray.dtype == np.int64 and places.shape == (len(ray), 3)
    # Ordinary rays hit what floats find when every face is tried.
    a, b, c = (mesh.triangles[:, k] for k in range(3))
    weights = [
        np.einsum("fk,nfk->nf", np.cross(p, q), np.broadcast_to(directions[:, None], (300, len(a), 3)))
        + np.einsum("fk,nk->nf", q - p, np.cross(origins, directions))
        for p, q in [(b, c), (c, a), (a, b)]
    ]
    same = np.logical_and.reduce([w > 0 for w in weights]) | np.logical_and.reduce([w < 0 for w in weights])
    normals = np.cross(b - a, c - a)
    with np.errstate(divide="ignore"):
        t = np.einsum("nfk,fk->nf", a[None] - origins[:, None], normals) / (directions @ normals.T)
    found = np.zeros((300, len(a)), bool)
    found[ray, face] = True
    assert (found == (same & (t >= 0))).all() and found.sum() == len(ray) > 100
    expected = origins[ray] + t[ray, face][:, None] * directions[ray]
    assert np.abs(places - expected).max() < 1e-9
    first = np.where(same & (t >= 0), t, np.inf)
    any_hit = np.isfinite(first).any(axis=1)
    assert (rays.intersects_any(origins, directions) == any_hit).all()
    assert (rays.intersects_first(origins, directions) == np.where(any_hit, first.argmin(axis=1), -1)).all()
    one, its_ray = rays.intersects_id(origins, directions, multiple_hits=False)
    assert (its_ray == np.flatnonzero(any_hit)).all() and (one == first.argmin(axis=1)[any_hit]).all()
    where, ray_of, face_of = rays.intersects_location(origins, directions)
    assert (where == places).all() and (ray_of == ray).all() and (face_of == face).all()
    some = rays.intersects_id(origins, directions, max_hits=1)
    assert (some[0] == one).all() and (some[1] == its_ray).all()
    assert (rays.contains_points(origins) == contains(mesh, origins)).all()


def test_rays_through_edges_and_vertices():
    box = trimesh.creation.box((2, 2, 2))
    rays = RayMeshIntersector(box)
    # The diagonal of a face, a corner, an edge of the box, and beside it.
    origins = [[0.5, 0.5, 3], [1, 1, 3], [1, 0.25, 3], [1 + 2**-40, 0.25, 3]]
    down = [[0, 0, -1]] * 4
    places, ray, _ = rays.intersects_location(origins, down)
    assert np.bincount(ray).tolist()[0] == 2 and (np.abs(places).max(axis=1) == 1).all()
    assert rays.intersects_any(origins, down).tolist() == [True, True, True, False]
    face, ray = rays.intersects_id(origins, down)
    assert np.bincount(ray)[0] in (2, 3, 4) and np.bincount(ray)[1] >= 4
    face, ray = rays.intersects_id(origins, down, max_hits=2)
    assert np.bincount(ray).tolist() == [2, 2, 2]
    nothing = rays.intersects_id(np.empty((0, 3)), np.empty((0, 3)), return_locations=True)
    assert [column.shape for column in nothing] == [(0,), (0,), (0, 3)]


class Nothing:
    """A mesh without faces."""

    vertices, faces = np.empty((0, 3)), np.empty((0, 3), int)


def test_an_empty_mesh_has_no_nearest_face():
    points = [[0, 0, 0], [1, 2, 3]]
    query = ProximityQuery(Nothing)
    _, distance, face = query.on_surface(points)
    assert face.tolist() == [-1, -1] and (distance == np.inf).all() and face.dtype == np.int64
    distance, vertex = query.vertex(points)
    assert vertex.tolist() == [-1, -1] and (distance == np.inf).all()
    assert closest_point(Nothing, points)[2].tolist() == [-1, -1]
    assert RayMeshIntersector(Nothing).intersects_first(points, points).tolist() == [-1, -1]


def test_options_of_rays_are_named():
    """Third comes return_locations in ray_triangle, and multiple_hits in ray_pyembree: neither is taken for the other."""
    rays = RayMeshIntersector(trimesh.creation.box((2, 2, 2)))
    down = [[0.5, 0.25, 3]], [[0, 0, -1]]
    with pytest.raises(TypeError, match="positional"):
        rays.intersects_id(*down, True)
    ours = set(inspect.signature(rays.intersects_id).parameters)
    for name in ["ray_triangle", "ray_pyembree"]:
        try:
            theirs = importlib.import_module(f"trimesh.ray.{name}").RayMeshIntersector
        except ImportError:
            continue
        named = inspect.signature(theirs.intersects_id).parameters
        assert {key for key, given in named.items() if given.kind == given.POSITIONAL_OR_KEYWORD} - {"self"} <= ours
    face, ray, places = rays.intersects_id(*down, return_locations=True, multiple_hits=False)
    assert ray.tolist() == [0] and places.tolist() == [[0.5, 0.25, 1]] and rays.intersects_first(*down) == face
