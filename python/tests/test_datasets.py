"""Many meshes, tiles, and both on Ray."""

import os
import pathlib
import signal
import subprocess
import sys
import time
import types

import numpy as np
import pytest

import impinge
from shapes import ball, soup


def write_obj(path, vertices, faces):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.astype(float).tolist()]
    lines += ["f " + " ".join(str(ix + 1) for ix in face) for face in faces.tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    """A ball, a soup that meets itself, a file that is none, one that is not there."""
    folder = tmp_path_factory.mktemp("meshes")
    write_obj(folder / "ball.obj", *ball(8, 12))
    write_obj(folder / "soup.obj", *soup(60, 0.4, 1))
    (folder / "text.ply").write_text("not a mesh")
    return [folder / name for name in ["ball.obj", "soup.obj", "text.ply", "missing.stl"]]


def test_check(meshes):
    calls = []
    rows = impinge.check(meshes, jobs=2, progress=lambda *at: calls.append(at))
    assert [row["path"] for row in rows] == list(map(str, meshes))
    clean, crossing, text, missing = rows
    assert clean["self_intersections"] == clean["boundary_edges"] == 0 and clean["components"] == 1
    vertices, faces = soup(60, 0.4, 1)
    expected = impinge.self_pairs(vertices, faces)
    assert crossing["self_intersections"] == len(expected) > 0 and crossing["error"] is None
    assert text["error"] is not None and missing["error"] is not None
    assert {"vertices", "triangles", "degenerate", "duplicate_faces", "non_manifold_edges"} <= clean.keys()
    assert calls == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert impinge.check(str(meshes[0])) == [clean] and impinge.check([]) == []


def test_check_refuses_by_name(meshes):
    for words, options in [
        ("^jobs: 0 given, 1 or more", {"jobs": 0}),
        ("^timeout: -1 given, more than 0", {"timeout": -1}),
        ("^memory: 0 given, 1 or more", {"memory": 0}),
        ("^timeout: a number of very many digits given, which float64 cannot hold", {"timeout": 10**400}),
        ("^min_thickness: .*, which float64 cannot hold", {"min_thickness": 10**5000}),
    ]:
        with pytest.raises(impinge.InvalidError, match=words):
            impinge.check(meshes, **options)
    with pytest.raises(ZeroDivisionError):
        impinge.check(meshes, jobs=1, progress=lambda *_: 1 // 0)
    [row] = impinge.check(meshes[:1], timeout=1e-9)
    assert row["error"] is not None and "self_intersections" in row


VENDORED = """
import sys
sys.path[:0] = sys.argv[1:3]
import impinge
print(impinge.__file__)
print(impinge.check(sys.argv[3])[0]["error"])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="links to folders need a privilege there")
def test_check_where_the_program_has_found_impinge(meshes, tmp_path):
    """By a folder that the program has added to its path, as add-ons do."""
    package, numpy = (pathlib.Path(module.__file__).parents[1] for module in (impinge, np))
    moved = tmp_path / "add-on"
    moved.mkdir()
    (moved / "impinge").symlink_to(package / "impinge")
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    # The Python of the virtual environment would find the one that is installed.
    python = getattr(sys, "_base_executable", sys.executable)
    command = [python, "-c", VENDORED, str(moved), str(numpy), str(meshes[0])]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.stdout.splitlines() == [str(moved / "impinge" / "__init__.py"), "None"], done


INTERRUPTED = """
import sys, impinge
def report(done, total):
    print(done, flush=True)
try:
    impinge.check([sys.argv[1]] * 100_000, jobs=1, progress=report)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind are POSIX")
def test_ctrl_c_ends_a_check(meshes):
    command = [sys.executable, "-c", INTERRUPTED, str(meshes[0])]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert child.stdout.readline() == "1\n"
        child.send_signal(signal.SIGINT)
        start = time.monotonic()
        out, err = child.communicate(timeout=60)
    finally:
        child.kill()
        child.communicate()
    assert out.endswith("interrupted\n") and err == "" and child.returncode == 0
    assert time.monotonic() - start < 20


@pytest.fixture(scope="module")
def bodies(tmp_path_factory):
    """Three mesh files, and the answer of one detector for all of them."""
    folder = tmp_path_factory.mktemp("bodies")
    scene = impinge.Scene()
    paths = []
    for ix in range(3):
        vertices, faces = soup(700, 0.1, ix)
        scene.add(vertices, faces)
        paths.append(write_obj(folder / f"{ix}.obj", vertices, faces))
    truth = impinge.Detector("cpu").detect(scene)
    assert len(truth) > 300
    return paths, truth


def test_tiles_have_the_answer_of_the_whole(bodies, tmp_path):
    paths, truth = bodies
    folder = tmp_path / "tiles"
    seen = []
    plan = impinge.tiles.plan(folder, paths, cap=400, chunk=256, progress=lambda *at: seen.append(at))
    assert plan["elements"] == 2100 and plan["tiles"] > 3 and plan == impinge.tiles.describe(folder)
    assert plan["files"] == list(map(str, paths)) or [str(path) for path in plan["files"]] == list(map(str, paths))
    assert seen and seen[-1] == (2100, 2100)
    halves = [impinge.tiles.scatter(folder, rank=rank, world_size=2, threads=1) for rank in range(2)]
    assert sum(half["written"] for half in halves) == plan["units"]
    assert impinge.tiles.scatter(folder)["kept"] == plan["units"]
    done = []
    rows = impinge.tiles.run(folder, threads=1, progress=lambda *at: done.append(at))
    assert sum(row["pairs"] for row in rows) == len(truth) and done[-1] == (plan["tiles"],) * 2
    assert all(row["kept"] for row in impinge.tiles.run(folder, [0, 1]))
    merged = impinge.tiles.merge(folder)
    assert merged["pairs"] == len(truth) and merged["hash"] == f"{truth.hash:016x}"
    assert np.array_equal(impinge.tiles.rows(folder), truth.rows)


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_tiles_of_a_step_have_the_impacts_of_the_whole(tmp_path, precision):
    scene = impinge.Scene()
    paths = []
    for ix in range(2):
        start, faces = soup(500, 0.1, ix)
        start, end = [at.astype(np.float32) for at in (start, start + soup(500, 0.1, ix + 7)[0] * 0.1)]
        body = scene.add(start, faces)
        scene.set_end_positions(body, end)
        paths += [write_obj(tmp_path / f"{ix}-{pose}.obj", at, faces) for pose, at in enumerate((start, end))]
    truth = impinge.Detector("cpu").impacts(scene, precision=precision, start="skip")
    folder = tmp_path / "tiles"
    plan = impinge.tiles.plan(folder, paths, cap=300, chunk=128, step=True)
    assert plan["step"] and plan["tiles"] > 2 and plan["elements"] == 1000
    impinge.tiles.scatter(folder)
    impinge.tiles.run(folder, threads=1, start="skip", precision=precision)
    # Neighbours never count in a step, so the rule for them is the same question.
    again = impinge.tiles.run(folder, threads=1, start="skip", precision=precision, shared_vertex="skip")
    assert all(row["kept"] for row in again)
    merged = impinge.tiles.merge(folder)
    assert merged["pairs"] == len(truth) > 300 and merged["hash"] == f"{truth.hash:016x}"
    first = truth.earliest()
    kind, (_, a, _, b), toi = merged["earliest"]
    assert (kind, (a, b), toi) == (first.kind, (first.element_a, first.element_b), first.toi)
    rows = impinge.tiles.rows(folder)
    assert rows.dtype["toi"] == truth.toi.dtype and np.array_equal(rows["toi"], truth.toi)
    bodies = np.stack([rows["body_a"], rows["body_b"]], axis=1)
    elements = np.stack([rows["element_a"], rows["element_b"]], axis=1)
    assert np.array_equal(bodies, truth.rows[:, ::2]) and np.array_equal(elements, truth.rows[:, 1::2])
    assert np.array_equal(rows["kind"], np.array(impinge.KINDS)[truth.kinds])
    assert merged["touching_at_start"] == 0 and sum(merged["kinds"].values()) == len(truth)


def test_tiles_of_a_step_keep_a_separation_and_weld(tmp_path):
    corners, _ = soup(200, 0.1, 3)
    # Each triangle twice, with corners of its own: without welding it touches itself.
    both = np.concatenate([corners, corners]).astype(np.float32)
    n = len(both)
    ends = both + np.float32(0.05)
    faces = np.arange(n).reshape(-1, 3)
    paths = [write_obj(tmp_path / f"{pose}.obj", at, faces) for pose, at in enumerate((both, ends))]
    scene = impinge.Scene()
    welded = faces % (n // 2)
    body = scene.add(both[: n // 2], welded)
    scene.set_end_positions(body, ends[: n // 2])
    truth = impinge.Detector("cpu").impacts(scene, separation=0.01)
    folder = tmp_path / "tiles"
    plan = impinge.tiles.plan(folder, paths, cap=100, step=True, weld=True, separation=0.01)
    assert plan["separation"] == 0.01 and plan["tiles"] > 2
    impinge.tiles.scatter(folder)
    impinge.tiles.run(folder, threads=1)
    merged = impinge.tiles.merge(folder)
    assert merged["pairs"] == len(truth) > 20 and merged["hash"] == f"{truth.hash:016x}"
    with pytest.raises(ValueError, match="^separation: 0.01 given, only 0 without a step"):
        impinge.tiles.plan(tmp_path / "still", paths, separation=0.01)


def test_tiles_that_do_not_fit_a_budget_say_so(bodies, tmp_path):
    paths, _ = bodies
    folder = tmp_path / "tiles"
    impinge.tiles.plan(folder, paths, cap=500)
    impinge.tiles.scatter(folder)
    with pytest.raises(impinge.Budget, match="^tile 0: ") as refused:
        impinge.tiles.run(folder, [0], memory_budget=1000)
    assert refused.value.code


def test_tiles_refuse_by_name(bodies, tmp_path):
    paths, _ = bodies
    with pytest.raises((OSError, ValueError), match="missing"):
        impinge.tiles.plan(tmp_path / "a", [tmp_path / "missing.ply"])
    with pytest.raises(ValueError, match="cap"):
        impinge.tiles.plan(tmp_path / "a", paths, cap=0)
    impinge.tiles.plan(tmp_path / "b", paths, cap=500)
    with pytest.raises((OSError, ValueError)):
        impinge.tiles.run(tmp_path / "b")
    with pytest.raises(ValueError, match='^which: "none" given, "all", "between", "self" allowed'):
        impinge.tiles.run(tmp_path / "b", which="none")
    with pytest.raises(ValueError, match="^shared_vertex: \"leave\" given"):
        impinge.tiles.run(tmp_path / "b", shared_vertex="leave")
    with pytest.raises((OSError, ValueError)):
        impinge.tiles.merge(tmp_path / "b")
    with pytest.raises((OSError, ValueError)):
        impinge.tiles.describe(tmp_path / "nowhere")


def test_tiles_refuse_numbers_by_name(bodies, tmp_path):
    paths, _ = bodies
    tiles, folder = impinge.tiles, tmp_path / "tiles"
    n = tiles.plan(folder, paths, cap=700)["tiles"]
    for words, call in [
        ("cap: -1 given, 1 or more allowed", lambda: tiles.plan(folder, paths, cap=-1)),
        ("chunk: 0 given, 1 or more allowed", lambda: tiles.plan(folder, paths, chunk=0)),
        (f"cap: {2**70} given, 18446744073709551615 or less allowed", lambda: tiles.plan(folder, paths, cap=2**70)),
        ("threads: -1 given, 0 or more allowed", lambda: tiles.scatter(folder, threads=-1)),
        ("rank: -1 given, 0 or more allowed", lambda: tiles.scatter(folder, rank=-1)),
        ("world_size: 0 given, 1 or more allowed", lambda: tiles.scatter(folder, world_size=0)),
        ("threads: -2 given, 0 or more allowed", lambda: tiles.run(folder, threads=-2)),
        ("memory_budget: -1 given, 0 or more allowed", lambda: tiles.run(folder, memory_budget=-1)),
        (f"tiles: -1 given, 0 to {n - 1} allowed", lambda: tiles.run(folder, [0, -1])),
        (f"tiles: {n} given, 0 to {n - 1} allowed", lambda: tiles.run(folder, [n])),
        (f"tiles: {2**40} given, 0 to {n - 1} allowed", lambda: tiles.run(folder, [2**40])),
    ]:
        with pytest.raises(impinge.InvalidError, match=f"^{words}$"):
            call()
    for words, call in [
        ("cap: a whole number expected, float given", lambda: tiles.plan(folder, paths, cap=2e6)),
        ("tiles: a whole number expected, str given", lambda: tiles.run(folder, ["0"])),
        ("tiles: an iterable of whole numbers expected, int given", lambda: tiles.run(folder, 0)),
        ("threads: a whole number expected, NoneType given", lambda: tiles.scatter(folder, threads=None)),
    ]:
        with pytest.raises(TypeError, match=f"^{words}$"):
            call()
    tiles.scatter(folder)
    assert [row["tile"] for row in tiles.run(folder, np.array([0]), threads=1)] == [0]


def test_one_path_is_one_file(bodies, tmp_path):
    paths, _ = bodies
    one = impinge.tiles.plan(tmp_path / "one", [paths[0]])
    for ix, path in enumerate([paths[0], str(paths[0])]):
        assert impinge.tiles.plan(tmp_path / str(ix), path)["plan"] == one["plan"]


class Ray:
    """As much of Ray as `impinge.ray.check` asks for, in this process."""

    def is_initialized(self):
        return True

    def cluster_resources(self):
        return {"CPU": 2.0}

    def remote(self, **_):
        return lambda work: types.SimpleNamespace(remote=lambda names: (work, tuple(names)))

    def wait(self, flying, num_returns):
        return flying[:num_returns], flying[num_returns:]

    def get(self, task):
        work, names = task
        return work(list(names))

    def cancel(self, task):
        raise AssertionError(f"{task} is left")


def test_ray_checks_one_path_and_thin_walls(monkeypatch, meshes):
    monkeypatch.setitem(sys.modules, "ray", Ray())
    ball = meshes[0]
    assert impinge.ray.check(str(ball)) == impinge.ray.check([ball]) == impinge.check(ball)
    thin = impinge.ray.check(meshes, min_thickness=3.0)
    assert thin == impinge.check(meshes, min_thickness=3.0) and thin[0]["thin_faces"] > 0
    with pytest.raises(ValueError, match="^min_thickness: -1 given, a length above 0 allowed"):
        impinge.ray.check([], min_thickness=-1)


@pytest.fixture(scope="module")
def cluster():
    ray = pytest.importorskip("ray", reason="Ray is not installed")
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")
    yield ray
    ray.shutdown()


@pytest.mark.filterwarnings("ignore")
def test_ray_checks_the_same_rows(cluster, meshes):
    paths = meshes * 5
    calls = []
    rows = impinge.ray.check(paths, max_in_flight=3, progress=lambda *at: calls.append(at))
    assert rows == impinge.check(paths)
    assert calls[-1] == (20, 20) and calls == sorted(calls)
    with pytest.raises(ValueError, match="^max_in_flight: 0 given"):
        impinge.ray.check(paths, max_in_flight=0)


@pytest.mark.filterwarnings("ignore")
def test_ray_runs_tiles(cluster, bodies, tmp_path):
    paths, truth = bodies
    plan = impinge.tiles.plan(tmp_path / "tiles", paths, cap=400, chunk=256)
    calls = []
    merged = impinge.ray.tiles(tmp_path / "tiles", progress=lambda *at: calls.append(at))
    assert merged["hash"] == f"{truth.hash:016x}" and merged["pairs"] == len(truth)
    n = plan["units"] + plan["tiles"]
    assert calls == [(done, n) for done in range(1, n + 1)]


@pytest.mark.filterwarnings("ignore")
def test_ray_survives_a_worker_that_dies(cluster, meshes, tmp_path, monkeypatch):
    """A mesh path whose first reader kills its own worker: the batch is tried again."""
    from impinge import ray as on_ray

    mark = tmp_path / "died"
    real = on_ray._check

    def deadly(names, **options):
        if not os.path.exists(mark):
            open(mark, "w").close()
            os.kill(os.getpid(), signal.SIGKILL)
        return real(names, **options)

    monkeypatch.setattr(on_ray, "_check", deadly)
    rows = impinge.ray.check(meshes, max_in_flight=1)
    assert mark.exists() and rows == impinge.check(meshes)


def test_ray_is_asked_for_by_name(monkeypatch, meshes):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'impinge\[ray\]'"):
        impinge.ray.check(meshes)
