"""Every method and setting against the oracle, and against answers from elsewhere."""

import json

import numpy as np
import pytest

import impinge
from shapes import ball, lattice_tetrahedra, lattice_triangles, soup

SETTINGS = [
    {"method": "clusters", "threads": 1},
    {"method": "clusters", "threads": 2, "recluster": "never"},
    {"method": "clusters", "instruction_set": "portable"},
    {"method": "clusters", "instruction_set": "avx2", "backend": "cpu"},
    {"method": "cells", "threads": 1},
    {"method": "cells", "threads": 2, "density": 20.0},
    {"method": "cells", "density": 0.01, "_group_size": 5, "instruction_set": "portable"},
    {"memory_budget": 1 << 22},
    {"method": "cells", "memory_budget": 1 << 22},
]


def kind(mesh):
    return {3: "triangles", 4: "tetrahedra"}[mesh[1].shape[1]]


def pairs(a, b, **settings):
    return impinge.pairs(*a, *b, kind_a=kind(a), kind_b=kind(b), **settings)


def self_pairs(mesh, **settings):
    return impinge.self_pairs(*mesh, kind=kind(mesh), **settings)


def two_body_cases():
    for n, k in [(1, 1), (7, 1), (65, 2), (130, 3), (400, 6)]:
        a, b = lattice_triangles(n, k, 1), lattice_triangles(n + 3, k, 2)
        t, u = lattice_tetrahedra(n, k, 3), lattice_tetrahedra(n + 3, k, 4)
        yield f"triangles {n} in {k}", a, b
        yield f"tetrahedra {n} in {k}", t, u
        yield f"mixed {n} in {k}", a, u
        yield f"mixed swapped {n} in {k}", t, b
    for n in [1, 64, 65, 700]:
        yield f"soup {n}", soup(n, 0.2, 5), soup(n, 0.2, 6)
        yield f"soup f64 {n}", soup(n, 0.2, 5, np.float64), soup(n, 0.2, 6, np.float64)
    vertices, faces = ball()
    yield "balls", (vertices, faces), (vertices + np.float32(0.3), faces)
    yield "coincident balls", (vertices, faces), (vertices, faces)
    yield "disjoint balls", (vertices, faces), (vertices + np.float32(9), faces)
    yield "two precisions", (vertices, faces), (vertices.astype(float) + 0.3, faces)


def one_body_cases():
    for n, k in [(1, 1), (20, 1), (100, 2), (300, 4)]:
        yield f"triangle web {n} in {k}", lattice_triangles(n, k, 9, shared=True)
        yield f"tetrahedron web {n} in {k}", lattice_tetrahedra(n, k, 10, shared=True)
    yield "soup", soup(900, 0.15, 7)
    yield "ball", ball()


def named(cases):
    return [pytest.param(*case[1:], id=case[0]) for case in cases]


@pytest.mark.parametrize("a, b", named(two_body_cases()))
def test_between_agrees_with_the_oracle(a, b):
    truth = pairs(a, b, method="naive")
    swapped = truth[np.lexsort((truth[:, 0], truth[:, 1]))][:, ::-1]
    for settings in SETTINGS:
        assert np.array_equal(pairs(a, b, **settings), truth), settings
    assert np.array_equal(pairs(b, a), swapped)


@pytest.mark.parametrize("mesh", named(one_body_cases()))
@pytest.mark.parametrize("rule", ["skip", "resolve"])
def test_within_agrees_with_the_oracle(mesh, rule):
    truth = self_pairs(mesh, shared_vertex=rule, method="naive")
    assert (truth[:, 0] < truth[:, 1]).all()
    for settings in SETTINGS:
        answer = self_pairs(mesh, shared_vertex=rule, **settings)
        assert np.array_equal(answer, truth), settings


def test_cases_are_worth_their_time():
    """The cases hold both answers in number, or the tests above would prove nothing."""
    shares = []
    for _, a, b in two_body_cases():
        shares.append(len(pairs(a, b)) / (len(a[1]) * len(b[1])))
    assert sum(share == 0 for share in shares) >= 1
    assert sum(0 < share < 1 for share in shares) > 20


def test_boxes_agree_with_arithmetic():
    """Axis-parallel right triangles that span a box's diagonal plane meet as intervals do."""
    random = np.random.default_rng(11)
    at = random.integers(0, 30, (200, 1))
    low = random.integers(0, 30, (200, 1))
    high = low + random.integers(0, 9, (200, 1))
    zero = np.zeros_like(at)

    # Segments along x at y = `at`, as triangles that fold back onto themselves.
    def segments(along, across):
        flat = np.zeros((200, 3, 3))
        flat[:, 0, along], flat[:, 1, along], flat[:, 2, along] = low.T, high.T, low.T
        flat[:, :, across] = at
        return flat.reshape(-1, 3), np.arange(600).reshape(-1, 3)

    truth = (low <= at.T) & (at.T <= high) & (low.T <= at) & (at <= high.T) & (zero == 0)
    expected = np.argwhere(truth)
    assert 100 < len(expected) < 20_000
    answer = impinge.pairs(*segments(0, 1), *segments(1, 0))
    assert np.array_equal(answer, expected)


@pytest.mark.parametrize("name", ["bunny", "buddha", "dragon"])
def test_meshes_agree_with_cgal(data, name):
    trimesh = pytest.importorskip("trimesh")
    scene = json.loads((data / "expected" / "two_body.json").read_text())[name]
    mesh = trimesh.load(data / scene["mesh"], process=False)
    vertices = np.asarray(mesh.vertices, np.float32)
    moved = vertices + np.array(scene["offset_f32"], np.float32)
    answer = impinge.pairs(vertices, mesh.faces, moved, mesh.faces)
    expected = np.load(data / scene["file"])
    assert len(expected) == scene["pairs"]
    assert np.array_equal(answer, expected[np.lexsort(expected.T[::-1])])


@pytest.mark.parametrize("name", ["cow", "camelhead"])
def test_self_intersections_agree_with_published_ones(data, name):
    trimesh = pytest.importorskip("trimesh")
    path = f"meshes/{name}.off"
    expected = json.loads((data / "expected" / "self_intersections.json").read_text())[path]
    mesh = trimesh.load(data / path, process=False)
    vertices, inverse = np.unique(np.asarray(mesh.vertices), axis=0, return_inverse=True)
    faces = inverse.reshape(-1)[mesh.faces]
    skip = impinge.self_pairs(vertices, faces, shared_vertex="skip")
    assert skip.tolist() == expected["pairs_noshared"]
    resolve = impinge.self_pairs(vertices, faces)
    hits = expected["hits_noshared"] + expected["hits_shared1"] + expected["hits_shared2"]
    assert len(resolve) == hits


def test_liars_are_caught():
    """The comparison that these tests lean on tells a wrong answer from a right one."""
    a, b = lattice_triangles(130, 3, 1), lattice_triangles(130, 3, 2)
    scene = impinge.Scene()
    scene.add(*a), scene.add(*b)
    result = impinge.Detector().detect(scene)
    rows = result.rows
    assert impinge.hash_rows(rows) == result.hash
    assert impinge.hash_rows(rows[::-1]) == result.hash
    for lie in [rows[1:], np.vstack([rows, rows[:1]]), rows[:, [0, 3, 2, 1]]]:
        assert impinge.hash_rows(lie) != result.hash
        assert not np.array_equal(lie, rows)
