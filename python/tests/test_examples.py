"""Every example runs as its user would run it."""

import importlib.util
import subprocess
import sys

import numpy as np
import pytest

import impinge
from shapes import ball

trimesh = pytest.importorskip("trimesh")


@pytest.fixture
def run(root, tmp_path):
    def run(name, *arguments):
        script = root / "examples" / "python" / name
        return subprocess.run(
            [sys.executable, str(script), *map(str, arguments)],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            timeout=120,
        )

    return run


def test_every_example_is_run_here(root):
    names = {path.name for path in (root / "examples" / "python").glob("*.py")}
    assert names == {"check_mesh.py", "sequence.py", "color_trimesh.py"}


def test_the_same_program_in_every_language(root):
    folder = root / "examples" / "cloth-on-ball"
    out = subprocess.run([sys.executable, str(folder / "cloth_on_ball.py")], capture_output=True, text=True, timeout=120)
    assert out.stdout == (folder / "expected.txt").read_text(), out.stderr


def test_a_solver_prints_what_it_prints_in_rust(root, tmp_path):
    folder = root / "examples" / "cloth"
    command = [sys.executable, str(folder / "cloth.py"), "--out", str(tmp_path)]
    out = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert out.stdout == (folder / "expected.txt").read_text(), out.stderr
    # Vertices were stopped, so what is proven mattered; and another reader sees the frames that the program asserted about.
    assert any(int(line.split()[4]) > 1000 for line in out.stdout.splitlines() if "cut" in line)
    mesh = impinge.read(tmp_path / "twist.obj")
    frames = np.fromfile(tmp_path / "twist.pc2", "<f4", offset=32).reshape(-1, len(mesh.vertices), 3)
    assert len(frames) == 101 and np.array_equal(frames[0], mesh.vertices.astype(np.float32))
    scene = impinge.Scene()
    body = scene.add(mesh)
    detector = impinge.Detector("cpu")
    for start, end in zip(frames, frames[1:]):
        scene.set_positions(body, start)
        scene.set_end_positions(body, end)
        assert detector.is_free(scene, start="verify")


def test_an_implicit_cloth_with_ipc_toolkit(root):
    """Frames until it lies on the ball. Every question also goes to ipctk alone, and the program ends where answers differ."""
    pytest.importorskip("ipctk", reason="ipctk is not installed: no barrier")
    pytest.importorskip("scipy", reason="SciPy is not installed: no solver")
    script = root / "examples" / "ipc" / "cloth.py"
    command = [sys.executable, str(script), "--size", "9", "--frames", "30", "--beside"]
    out = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert out.returncode == 0, out.stdout + out.stderr
    first, *_, last = out.stdout.splitlines()
    most = int(first.partition("at most ")[2].split()[0])
    assert "no intersection" in first and most > 20
    assert last.endswith("sets of collisions are the same") and int(last.split()[0]) > 60


def cloth_alone(root):
    pytest.importorskip("scipy", reason="SciPy is not installed: no solver")
    return root / "examples" / "ipc" / "cloth_alone.py"


def test_an_implicit_cloth_alone(root):
    """Contacts slide more slowly the more friction there is. The program ends with an error if anything ever intersects."""
    speeds = []
    for friction in [0, 0.1, 0.5]:
        command = [sys.executable, str(cloth_alone(root)), "--size", "9", "--frames", "24", "--friction", str(friction)]
        out = subprocess.run(command, capture_output=True, text=True, timeout=300)
        assert out.returncode == 0 and "no intersection" in out.stdout, out.stdout + out.stderr
        assert int(out.stdout.partition("at most ")[2].split()[0]) > 20
        speeds.append(float(out.stdout.partition("slid at ")[2].split()[0]))
    assert speeds[0] > 1.2 * speeds[1] > 1.2**2 * speeds[2] > 0


def test_forces_of_the_cloth_alone_are_the_slope_of_its_energy(root):
    spec = importlib.util.spec_from_file_location("cloth_alone", cloth_alone(root))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    cloth = module.Cloth(9, 0.5)
    for _ in range(20):
        cloth.frame()
    start = cloth.x
    friction = module.Friction(cloth.contacts(start), start, 0.5)
    random = np.random.default_rng(1)
    x = start.copy()
    x[: cloth.n] += 1e-5 * random.standard_normal((cloth.n, 3))
    goal = start[: cloth.n] + module.FRAME * cloth.v
    gradient, _ = cloth.derivatives(x, goal, friction)
    assert len(friction.force) > 20 and friction.value(x) > friction.value(start)
    total = module.Sum(len(x))
    friction.add_to(total, x)
    potentials = [(lambda x: cloth.energy(x, goal, friction), gradient), (friction.value, total.gradient[: 3 * cloth.n])]
    for potential, gradient in potentials:
        for _ in range(3):
            way = np.zeros_like(x)
            way[: cloth.n] = random.standard_normal((cloth.n, 3))
            slope = (potential(x + 1e-8 * way) - potential(x - 1e-8 * way)) / 2e-8
            expected = gradient @ way[: cloth.n].ravel()
            assert abs(slope - expected) < 1e-4 * np.abs(gradient).max(), (slope, expected)


def test_check_mesh(run, tmp_path):
    out = run("check_mesh.py", "--report", "pairs.csv")
    assert out.returncode == 1 and "pairs of faces intersect" in out.stdout, out.stderr
    pairs = np.loadtxt(tmp_path / "pairs.csv", delimiter=",", skiprows=1, dtype=int)
    assert f"{len(pairs)} pairs" in out.stdout and len(pairs) > 100
    trimesh.Trimesh(*ball(), process=False).export(tmp_path / "ball.stl")
    out = run("check_mesh.py", "ball.stl")
    assert out.returncode == 0, out.stdout + out.stderr
    assert ": 0 pairs of faces intersect" in out.stdout


def test_sequence(run, tmp_path):
    pytest.importorskip("tqdm")
    pytest.importorskip("matplotlib")
    out = run("sequence.py", "--frames", 12, "--faces", 2000, "--plot", "plot.png")
    assert out.returncode == 0, out.stderr
    words = out.stdout.split()
    assert int(words[2]) > 50 and int(words[6]) > 50, out.stdout
    assert "12/12" in out.stderr
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")


def test_color_trimesh(run, tmp_path):
    vertices, faces = ball()
    for name, shift in [("a.ply", 0), ("b.ply", 1)]:
        trimesh.Trimesh(vertices + [shift, 0.25, 0], faces, process=False).export(tmp_path / name)
    for arguments in [[], ["a.ply", "b.ply"]]:
        out = run("color_trimesh.py", *arguments)
        assert out.returncode == 0, out.stderr
        n_red = sum(int(line.split()[0]) for line in out.stdout.splitlines()[:2])
        coloured = trimesh.load(tmp_path / "coloured.ply", process=False)
        red = (coloured.visual.face_colors == [214, 39, 40, 255]).all(axis=1).sum()
        assert red == n_red > 20
    out = run("color_trimesh.py", "a.ply")
    assert out.returncode == 2 and "two meshes expected, 1 given" in out.stderr
