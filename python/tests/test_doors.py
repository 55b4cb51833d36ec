"""One question has one answer at every door: files read here, in arrays, checked, and in tiles."""

import json
import pathlib

import numpy as np
import pytest

import impinge

FOLDER = pathlib.Path(__file__).parents[2] / "crates" / "impinge-cli" / "tests" / "doors"
ANSWERS = json.loads((FOLDER / "answers.json").read_text())


def hexadecimal(result):
    return {"pairs": len(result), "hash": f"{result.hash:016x}"}


@pytest.mark.parametrize("name", sorted(ANSWERS))
def test_every_door_answers_alike(name, tmp_path):
    path, answer = FOLDER / name, ANSWERS[name]
    expected = {"pairs": answer["pairs"], "hash": answer["hash"]}
    mesh = impinge.read(path)
    scene = impinge.Scene()
    body = scene.add(mesh)
    assert scene.kind(body) == mesh.kind and scene.n_elements(body) == len(mesh.faces)
    result = impinge.Detector(method="naive").detect(scene, self_of=body)
    assert hexadecimal(result) == expected
    pairs = result.self_of(body).tolist()
    assert impinge.self_pairs(mesh.vertices, mesh.faces, kind=mesh.kind).tolist() == pairs

    # Arrays that are not welded are asked about as they are, unless it is said.
    given = impinge.read(path, weld=False)
    assert given.n_welded == 0 and len(given.vertices) == len(mesh.vertices) + mesh.n_welded
    assert impinge.self_pairs(given.vertices, given.faces, kind=given.kind, weld=True).tolist() == pairs
    welded, faces, _ = impinge.weld(given.vertices, given.faces)
    assert np.array_equal(welded, mesh.vertices) and np.array_equal(faces, mesh.faces)

    [row] = impinge.check([path])
    assert {"pairs": row["self_intersections"], "hash": row["hash"]} == expected
    impinge.tiles.plan(tmp_path / "tiles", [path], cap=10)
    impinge.tiles.scatter(tmp_path / "tiles")
    impinge.tiles.run(tmp_path / "tiles", which="self")
    merged = impinge.tiles.merge(tmp_path / "tiles")
    assert {"pairs": merged["pairs"], "hash": merged["hash"]} == expected

    bodies = impinge.read_bodies(path)
    assert sum(len(one.faces) for one in bodies) == len(mesh.faces)
    if "bodies" not in answer:
        # The only node of a file has the name that the file gives it.
        own = {"box.glb": "box"}.get(path.name, str(path))
        assert [one.name for one in bodies] == [own] and mesh.name == str(path)
        return
    assert [one.name for one in bodies] == answer["bodies"]
    scene = impinge.Scene()
    for one in bodies:
        scene.add(one)
    assert hexadecimal(impinge.Detector().detect(scene, which="between")) == answer["between"]
    assert impinge.Detector().count(scene) == answer["pairs"]


def test_a_box_of_a_renderer_is_clean_once_it_is_welded():
    given = impinge.read(FOLDER / "box.glb", weld=False)
    assert len(given.vertices) == 24
    assert len(impinge.self_pairs(given.vertices, given.faces)) == 42
    assert len(impinge.self_pairs(given.vertices, given.faces, weld=True)) == 0
    moved = given.vertices + np.float32(0.5)
    for weld in [False, True]:
        pairs = impinge.pairs(given.vertices, given.faces, moved, given.faces, weld=weld)
        assert len(pairs) > 10 and np.array_equal(pairs, impinge.pairs(given.vertices, given.faces, moved, given.faces))
    box = impinge.read(str(FOLDER / "box.glb"))
    assert repr(box).endswith("box.glb\", 8 vertices, 12 triangles, 16 welded)")
    assert box.vertices.dtype == np.float32 and box.faces.dtype == np.uint32


def test_what_cannot_be_read_is_refused_by_name(tmp_path):
    for read in [impinge.read, impinge.read_bodies]:
        for path in [tmp_path / "missing.ply", str(tmp_path / "missing.ply")]:
            with pytest.raises(FileNotFoundError, match=r"directory: '.*missing.ply'$"):
                read(path)
    (tmp_path / "odd.obj").write_text("v 0 0 0\nf 1 2 3\n")
    for read in [impinge.read, impinge.read_bodies]:
        with pytest.raises(ValueError, match="odd.obj"):
            read(tmp_path / "odd.obj")
    with pytest.raises(ValueError, match="extension"):
        impinge.read("a.txt")


def test_real_meshes_have_the_answers_of_the_program(data):
    for name, n in [("cow.off", 83), ("camelhead.off", 5), ("dragon.ply", 463)]:
        path = data / "meshes" / name
        given = impinge.read(path, weld=False)
        assert len(impinge.self_pairs(given.vertices, given.faces, weld=True)) == n
        [row] = impinge.check([path])
        assert row["self_intersections"] == n
