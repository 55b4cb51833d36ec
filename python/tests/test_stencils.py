"""Stencils of near pairs: against ipc-toolkit, and where it is not installed against finite differences."""

import pickle

import numpy as np
import pytest

import impinge
from shapes import ball

FLOOR = [[0, 0, 0], [4, 0, 0], [0, 4, 0]]


def grid(n, height):
    """A square of n x n vertices, turned a little, so that nothing is symmetric."""
    line = np.linspace(-0.5, 0.5, n)
    x, y = np.meshgrid(line, line, indexing="ij")
    points = np.stack([x + 0.13 * y, y - 0.11 * x, np.full_like(x, height)], axis=-1).reshape(-1, 3)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    low = np.stack([corner, corner + n, corner + n + 1], axis=1)
    high = np.stack([corner, corner + n + 1, corner + 1], axis=1)
    return points, np.concatenate([low, high])


def joined(*parts):
    """Meshes as one."""
    points, faces, n = [], [], 0
    for of_part, indices in parts:
        points.append(np.asarray(of_part, float))
        faces.append(np.asarray(indices) + n)
        n += len(of_part)
    return np.concatenate(points), np.concatenate(faces).astype(np.int32)


def sheets(seed):
    """Two sheets, one above the other, whose vertices were shaken: many edges are nearly parallel."""
    random = np.random.default_rng(seed)
    points, faces = joined(grid(9, 0.0), grid(9, 0.02))
    rest = points.copy()
    return rest, points + 0.004 * random.standard_normal(points.shape), faces, 0.04


def cloth_on_ball(seed):
    random = np.random.default_rng(seed)
    sphere, faces_of_sphere = ball(12, 16, np.float64)
    cloth, faces = grid(13, 1.02)
    points, faces = joined((cloth, faces), (sphere, faces_of_sphere))
    return points, points + 0.003 * random.standard_normal(points.shape), faces, 0.09


def noise(seed):
    """Triangles at random, which are near each other in every way."""
    points = np.random.default_rng(seed).random((180, 3))
    return points, points, np.arange(180, dtype=np.int32).reshape(-1, 3), 0.05


def cubes(data):
    mesh = impinge.read(data / "ipc" / "two-cubes-close.ply")
    # Without vertices of no face, which are loose points for ipc-toolkit.
    used, faces = np.unique(mesh.faces, return_inverse=True)
    points = np.asarray(mesh.vertices, float)[used]
    return points, points, faces.reshape(-1, 3).astype(np.int32), 0.15


def rumba(data):
    mesh = impinge.read(data / "sequences" / "rumba.ply")
    frames = np.fromfile(data / "sequences" / "rumba.pc2", "<f4", offset=32).reshape(-1, len(mesh.vertices), 3)
    size = np.ptp(frames[0], axis=0).max()
    return frames[0].astype(float), frames[20].astype(float), np.asarray(mesh.faces, np.int32), 1e-3 * size


GENERATED = [(sheets, 1), (sheets, 2), (cloth_on_ball, 3), (noise, 4), (noise, 5)]


def scenery(*makers):
    return pytest.mark.parametrize("make, seed", [*GENERATED, *((make, None) for make in makers)], ids=lambda of: getattr(of, "__name__", of))


@pytest.fixture
def scene_of(request):
    return lambda make, seed: make(request.getfixturevalue("data") if seed is None else seed)


def stencils(rest, points, faces, dhat, **keywords):
    scene = impinge.Scene()
    scene.add(points, faces)
    near = impinge.Detector("cpu").near(scene, dhat, kinds=["vf", "ee"], **keywords)
    return near, near.stencils(scene, rest)


def sides(kind, ids):
    """The two elements of a stencil, in an order that does not depend on how they were named."""
    n = {"vf": (1, 3), "ee": (2, 2), "ev": (1, 2), "vv": (1, 1)}[kind]
    ids = [int(ix) for ix in ids]
    parts = [tuple(sorted(ids[: n[0]])), tuple(sorted(ids[n[0] : sum(n)]))]
    return (kind, *(sorted(parts) if n[0] == n[1] else parts))


def theirs(rest, points, faces, dhat, by_area=False):
    """The collisions of ipc-toolkit by what they are."""
    ipctk = pytest.importorskip("ipctk", reason="ipctk is not installed: nothing to compare with")
    edges = ipctk.edges(faces)
    mesh = ipctk.CollisionMesh(np.asfortranarray(rest), edges, faces)
    collisions = ipctk.NormalCollisions()
    collisions.use_area_weighting = by_area
    collisions.build(mesh, np.asfortranarray(points), dhat)
    named = {}
    for kind, name in [("vf", "fv"), ("ee", "ee"), ("ev", "ev"), ("vv", "vv")]:
        for of in getattr(collisions, f"{name}_collisions"):
            ids = of.vertex_ids(mesh.edges, mesh.faces)
            key = sides(kind, ids)
            assert key not in named
            named[key] = (of, [ix for ix in ids if ix >= 0])
    return ipctk, mesh, collisions, named


def assert_close(given, expected, tolerance=1e-9, size=0.0):
    """Equal within rounding, as numbers of the size of the largest."""
    size = max(np.abs(expected).max(), size, 1e-300)
    np.testing.assert_allclose(given, expected, rtol=0, atol=tolerance * size)


@scenery(cubes, rumba)
def test_everything_is_as_in_ipc_toolkit(make, seed, scene_of):
    rest, points, faces, dhat = scene_of(make, seed)
    _, mesh, _, named = theirs(rest, points, faces, dhat)
    near, pairs = stencils(rest, points, faces, dhat)
    contacts = pairs.merged()
    kinds = [impinge.KINDS[ix] for ix in contacts.kinds]
    vertices = contacts.vertices
    ours = {sides(kind, ids): row for row, (kind, ids) in enumerate(zip(kinds, vertices))}
    assert len(ours) == len(contacts) > 20
    assert contacts.weights.sum() == len(pairs) == len(near)
    # At a distance of exactly dhat ours counts and theirs does not.
    assert {key: of.weight for key, (of, _) in named.items()} == {key: contacts.weights[row] for key, row in ours.items()}

    is_mollified = contacts.mollified
    columns = [
        contacts.squared_distances,
        contacts.gradients,
        contacts.hessians,
        contacts.mollifiers,
        contacts.mollifier_gradients,
        contacts.mollifier_hessians,
        contacts.coefficients,
        is_mollified,
        contacts.types,
    ]
    random = np.random.default_rng(0)
    # Theirs come in another order in each run.
    keys = sorted(named)
    keys = [keys[ix] for ix in random.permutation(len(keys))[:400]]
    keys += [key for key, row in ours.items() if is_mollified[row]][:200]
    n_mollified = 0
    for key in keys:
        (of, ids), row = named[key], ours[key]
        d, gradient, hessian, m, by_m, by_by_m, coefficients, mollified, kind = (column[row] for column in columns)
        # Where their vertices are among ours.
        own = vertices[row].tolist()
        slots = np.array([own.index(ix) for ix in ids])
        at = (3 * slots[:, None] + np.arange(3)).ravel()
        x = points[ids].ravel()
        # What neither knows better: parallel edges lose as many digits as the sine has zeros.
        sine, is_tie = 1.0, False
        if key[0] == "ee":
            u, v = points[own[1]] - points[own[0]], points[own[3]] - points[own[2]]
            between = np.linalg.norm(np.cross(u, v)) / np.linalg.norm(u) / np.linalg.norm(v)
            if impinge.TYPES[kind] == "EA_EB":
                sine = between
            is_tie = between < 1e-12
        tolerance = 1e-9 / sine
        assert_close(d, of.compute_distance(x), tolerance)
        if is_tie:
            # Two ends of parallel edges are equally near: each may take the other, and the derivatives are of that one.
            continue
        assert_close(gradient[at], of.compute_distance_gradient(x), tolerance)
        assert_close(hessian[np.ix_(at, at)], of.compute_distance_hessian(x), tolerance / sine)
        assert_close(m, of.mollifier(x), tolerance)
        assert mollified == (of.mollifier(x) < 1)
        if mollified:
            n_mollified += 1
            assert_close(by_m[at], of.mollifier_gradient(x), 1e-8)
            assert_close(by_by_m[np.ix_(at, at)], of.mollifier_hessian(x), 1e-8)
        else:
            assert not by_m.any() and not by_by_m.any()
        # Of the other element with minus, so all signs may be the other way.
        given, expected = coefficients[slots], of.compute_coefficients(x)
        assert_close(given * np.sign(given @ expected), expected, tolerance)
    assert n_mollified > 0 or len(points) != len(sheets(1)[0])


@scenery(cubes, rumba)
def test_weights_by_area_are_those_of_ipc_toolkit(make, seed, scene_of):
    rest, points, faces, dhat = scene_of(make, seed)
    named = theirs(rest, points, faces, dhat, by_area=True)[3]
    scene = impinge.Scene()
    scene.add(points, faces)
    near = impinge.Detector("cpu").near(scene, dhat, kinds=["vf", "ee"])
    contacts = near.stencils(scene, rest, by_area=True).merged()
    ours = {sides(impinge.KINDS[kind], ids): weight for kind, ids, weight in zip(contacts.kinds, contacts.vertices, contacts.weights)}
    assert len(ours) == len(contacts) > 20 and ours.keys() == named.keys()
    size = max(ours.values())
    for key, (of, _) in named.items():
        assert_close(ours[key], of.weight, 1e-12, size)
    # They are areas, not counts, and those at rest.
    assert not np.array_equal(contacts.weights, near.stencils(scene, rest).merged().weights)
    once, twice = (near.stencils(scene, scale * rest, by_area=True).weights for scale in (1, 2))
    np.testing.assert_allclose(twice, 4 * once, rtol=1e-12)
    with pytest.raises(ValueError, match="by_area: .* rest is None"):
        near.stencils(scene, by_area=True)


def test_weights_by_area_of_edges_and_points():
    """Of a body for each kind: ipc-toolkit has them in one mesh."""
    ipctk = pytest.importorskip("ipctk", reason="ipctk is not installed: nothing to compare with")
    random = np.random.default_rng(8)
    points = random.random((24, 3))
    faces = np.array([[0, 1, 2], [2, 1, 3], [4, 5, 6]], np.int32)
    loose = np.array([[7, 8], [8, 9], [9, 10], [11, 12], [8, 13]], np.int32)
    mesh = ipctk.CollisionMesh(np.asfortranarray(points), np.concatenate([ipctk.edges(faces), loose]), faces)
    collisions = ipctk.NormalCollisions()
    collisions.use_area_weighting = True
    collisions.build(mesh, np.asfortranarray(points), 0.4)
    scene = impinge.Scene()
    scene.add(points[:7], faces)
    scene.add_edges(points[7:14], loose - 7)
    scene.add_points(points[14:])
    near = impinge.Detector("cpu").near(scene, 0.4, kinds=["vf", "ee", "ev", "vv"])
    found = {}
    for kind, weight, ids in zip(near.kinds, near.stencils(scene, points, by_area=True).weights, near.stencils(scene).vertices):
        found[sides(impinge.KINDS[kind], ids)] = weight
    n = 0
    for kind, name in [("vf", "fv"), ("ee", "ee"), ("ev", "ev"), ("vv", "vv")]:
        for of in getattr(collisions, f"{name}_collisions"):
            key = sides(kind, [ix for ix in of.vertex_ids(mesh.edges, mesh.faces) if ix >= 0])
            # What was found as it is, and not reduced from something larger.
            if kind in ("vf", "ee") or kind == "vv" and min(key[1] + key[2]) >= 14:
                assert_close(found[key], of.weight, 1e-13)
                n += 1
    assert n > 20 and {kind for kind, *_ in found} == {"vf", "ee", "ev", "vv"}


def barrier(s, dhat, stiffness):
    """ipc-toolkit's barrier of squared distances, and two derivatives."""
    t = dhat**2
    log = np.log(s / t)
    value = -((s - t) ** 2) * log
    first = (t - s) * (2 * log - t / s + 1)
    second = (t / s + 2) * (t / s) - 2 * log - 3
    return stiffness * value, stiffness * first, stiffness * second


def potential(contacts, n_vertices, dhat, stiffness, project=False):
    """A barrier's value, gradient and Hessian, dense."""
    b, by, by_by = barrier(contacts.squared_distances, dhat, stiffness)
    w, m, g = contacts.weights, contacts.mollifiers, contacts.gradients
    mg = contacts.mollifier_gradients
    rows = w[:, None] * (by[:, None] * m[:, None] * g + b[:, None] * mg)
    outer = lambda a, b: a[:, :, None] * b[:, None, :]  # noqa: E731
    blocks = (by_by * m)[:, None, None] * outer(g, g) + (by * m)[:, None, None] * contacts.hessians
    blocks += by[:, None, None] * (outer(g, mg) + outer(mg, g)) + b[:, None, None] * contacts.mollifier_hessians
    blocks *= w[:, None, None]
    if project:
        blocks = impinge.project_psd(blocks)
    at = (3 * contacts.vertices[:, :, None].astype(int) + np.arange(3)).reshape(-1, 12)
    gradient = np.zeros(3 * n_vertices)
    np.add.at(gradient, at, rows)
    hessian = np.zeros((3 * n_vertices, 3 * n_vertices))
    np.add.at(hessian, (at[:, :, None], at[:, None, :]), blocks)
    return (w * m * b).sum(), gradient, hessian


@scenery(cubes)
@pytest.mark.parametrize("project", [False, True])
def test_a_barrier_is_that_of_ipc_toolkit(make, seed, project, scene_of):
    """Also where vertices are exactly above edges, which each library may count to another type."""
    rest, points, faces, dhat = scene_of(make, seed)
    ipctk, mesh, collisions, _ = theirs(rest, points, faces, dhat)
    expected = ipctk.BarrierPotential(dhat, 3.0)
    x = np.asfortranarray(points)
    contacts = stencils(rest, points, faces, dhat)[1].merged()
    value, gradient, hessian = potential(contacts, len(points), dhat, 3.0, project)
    assert_close(value, expected(collisions, mesh, x))
    assert_close(gradient, expected.gradient(collisions, mesh, x))
    method = ipctk.PSDProjectionMethod.CLAMP if project else ipctk.PSDProjectionMethod.NONE
    given = expected.hessian(collisions, mesh, x, method).toarray()
    assert_close(hessian, given)
    if project:
        assert np.linalg.eigvalsh(hessian).min() > -1e-9 * np.abs(hessian).max()
        assert np.abs(hessian - potential(contacts, len(points), dhat, 3.0)[2]).max() > 0


def test_derivatives_are_finite_differences():
    """Of the whole barrier, through the detector: what is near, and its type, change on the way."""
    rest, points, faces, dhat = sheets(7)
    random = np.random.default_rng(7)

    def at(points):
        return potential(stencils(rest, points, faces, dhat)[1].merged(), len(points), dhat, 1.0)

    _, gradient, hessian = at(points)
    for _ in range(4):
        way = random.standard_normal(points.shape)
        step = 1e-7 * way
        # The same, in one number and one vector.
        (low, gradient_low, _), (high, gradient_high, _) = at(points - step), at(points + step)
        assert_close((high - low) / 2e-7, gradient @ way.ravel(), 1e-5)
        assert_close((gradient_high - gradient_low) / 2e-7, hessian @ way.ravel(), 1e-3)
        # A spoiled sign would be seen.
        assert abs((high - low) / 2e-7 + gradient @ way.ravel()) > 1e-3 * abs(gradient @ way.ravel())


def test_projections_are_those_of_eigenvalues():
    random = np.random.default_rng(2)
    for k in [3, 6, 9, 12]:
        given = random.standard_normal((200, k, k)) * 10.0 ** random.integers(-8, 9, (200, 1, 1))
        given = given + given.transpose(0, 2, 1)
        values, vectors = np.linalg.eigh(given)
        expected = (vectors * np.maximum(values, 0)[:, None, :]) @ vectors.transpose(0, 2, 1)
        found = impinge.project_psd(given)
        for matrix, ours, theirs in zip(given, found, expected):
            assert_close(ours, theirs, 1e-13, np.abs(matrix).max())
        assert (found == found.transpose(0, 2, 1)).all()
        assert impinge.project_psd(found[7]).shape == (k, k)
        # However they are stored, and together or apart.
        strided = np.asfortranarray(given)
        assert impinge.project_psd(strided).tobytes() == found.tobytes()
        assert impinge.project_psd(given[::2]).tobytes() == found[::2].tobytes()
        assert impinge.project_psd(given.reshape(2, 100, k, k)).shape == (2, 100, k, k)
    assert impinge.project_psd(np.zeros((0, 12, 12))).shape == (0, 12, 12)
    assert impinge.project_psd(np.eye(3, dtype=int)).tolist() == np.eye(3).tolist()
    ipctk = pytest.importorskip("ipctk", reason="ipctk is not installed: nothing to compare with")
    for matrix in given[:50]:
        assert_close(impinge.project_psd(matrix), ipctk.project_to_psd(matrix), 1e-12)


@scenery(cubes)
def test_threads_change_no_byte(make, seed, scene_of):
    rest, points, faces, dhat = scene_of(make, seed)
    scene = impinge.Scene()
    scene.add(points, faces)
    numbers = set()
    for threads in (1, 2, 5, None):
        settings = {} if threads is None else {"threads": threads}
        near = impinge.Detector("cpu", **settings).near(scene, dhat, kinds=["vf", "ee"])
        found = near.stencils(scene, rest)
        columns = [found.coefficients, found.squared_distances, found.gradients, found.hessians, found.mollifier_hessians]
        columns += [impinge.project_psd(-found.hessians, threads=threads or 0)]
        numbers.add(b"".join(column.tobytes() for column in columns))
    assert len(numbers) == 1 and len(found) > 20
    with pytest.raises(impinge.InvalidError, match="^threads: -1 given, 0 or more allowed"):
        impinge.project_psd(np.eye(3), threads=-1)


def test_columns():
    scene = impinge.Scene()
    scene.add(np.array(FLOOR, np.float32), [[0, 1, 2]])
    gone = scene.add_points([[9, 9, 9]])
    scene.add_points([[1, 1, 0.5], [3, -1, 0], [9, 0, 0]])
    scene.remove(gone)
    near = impinge.Detector("cpu").near(scene, 1.5, distances=True)
    found = near.stencils(scene)
    assert len(found) == len(near) == 2 and repr(found) == "Stencils(vf: 2)"
    assert found.offsets.tolist() == [0, 3, 3, 6]
    assert found.vertices.dtype == np.uint32 and found.vertices.tolist() == [[3, 0, 1, 2], [4, 0, 1, 2]]
    assert [impinge.TYPES[ix] for ix in found.types] == ["P_T", "P_E0"]
    assert found.coefficients.tolist() == [[1, -0.5, -0.25, -0.25], [1, -0.25, -0.75, 0]]
    assert found.squared_distances.tolist() == [0.25, 1.0] == (near.distances**2).tolist()
    assert found.gradients[0].tolist() == [0, 0, 1, 0, 0, -0.5, 0, 0, -0.25, 0, 0, -0.25]
    assert found.hessians.shape == (2, 12, 12) == found.mollifier_hessians.shape
    assert found.mollifiers.tolist() == [1, 1] and not found.mollified.any() and not found.mollifier_gradients.any()
    assert found.weights.tolist() == [1, 1]
    merged = found.merged()
    assert repr(merged) == "Stencils(vf: 1, ev: 1)" and merged.vertices.tolist() == [[3, 0, 1, 2], [4, 0, 1, 4]]
    assert merged.gradients[1].tolist() == [0, -2, 0, 0, 0.5, 0, 0, 1.5, 0, 0, 0, 0]
    # A part, and what has moved since: features stay.
    part = near.of("vf").stencils(scene)
    assert part.hessians.tobytes() == found.hessians.tobytes()
    assert len(near.of("ee").stencils(scene)) == 0 and near.of("ee").stencils(scene).merged().hessians.shape == (0, 12, 12)
    scene.set_positions(2, [[1, 1, 0.75], [3, -1, 0], [9, 0, 0]])
    assert near.stencils(scene).squared_distances.tolist() == [0.5625, 1.0]
    with pytest.raises(TypeError, match="pickle their arrays"):
        pickle.dumps(found)


def test_refusals():
    scene = impinge.Scene()
    for z in (0, 1):
        scene.add(np.array(FLOOR, float) + [0, 0, z], [[0, 1, 2]])
    detector = impinge.Detector("cpu")
    near = detector.near(scene, 1.0)
    for rest, message in [
        (np.zeros((5, 3)), "^rest: 5 positions for 6 vertices given, as many as all bodies have"),
        (np.zeros((7, 3)), "^rest: 7 positions for 6 vertices given, as many as all bodies have"),
        (np.zeros((6, 2)), "^rest: "),
        (np.full((6, 3), np.nan), "^rest\\[0, 0\\] = nan"),
    ]:
        with pytest.raises(ValueError, match=message):
            near.stencils(scene, rest)
    with pytest.raises(ValueError, match="^kinds: ff .element 0 of body 0 and 0 of body 1; .*the kinds vf and ee. given, vf, ee, ev or vv allowed"):
        detector.near(scene, 1.0, kinds=["ff"]).stencils(scene)
    with pytest.raises(ValueError, match="no such body"):
        near.stencils(impinge.Scene())
    with pytest.raises(TypeError, match="^scene: a Scene expected, int given"):
        near.stencils(3)
    for matrices, message in [
        (np.zeros((2, 4, 4)), "k of 3, 6, 9 or 12 expected, \\(2, 4, 4\\) given"),
        (np.zeros((3, 6)), "^matrices: shape"),
        (np.zeros(9), "^matrices: shape"),
        (np.full((2, 3, 3), np.nan), "^matrices: NaN in row 0, column 0 of matrix 0 given, finite numbers allowed"),
    ]:
        with pytest.raises(impinge.Error, match=message) as caught:
            impinge.project_psd(matrices)
        assert caught.value.code == "invalid"
    with pytest.raises(TypeError, match="^matrices: numbers expected"):
        impinge.project_psd([["a", "b"]])
