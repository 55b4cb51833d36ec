"""The package itself: stubs, docstrings, documentation, and a wheel in an empty environment."""

import doctest
import inspect
import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

import impinge


def test_docstring_examples_run():
    failures, tests = 0, 0
    for name in ["impinge", *impinge.__all__]:
        holder = impinge if name == "impinge" else getattr(impinge, name)
        if not getattr(holder, "__doc__", None) or isinstance(holder, str):
            continue
        documented = {name: holder.__doc__}
        if inspect.isclass(holder):
            documented.update({f"{name}.{member}": held.__doc__ for member, held in vars(holder).items()})
        for of, text in documented.items():
            test = doctest.DocTestParser().get_doctest(text or "", {}, of, None, 0)
            results = doctest.DocTestRunner().run(test)
            failures, tests = failures + results.failed, tests + results.attempted
    assert failures == 0 and tests > 60


def test_everything_public_is_documented():
    for name in impinge.__all__:
        held = getattr(impinge, name)
        if isinstance(held, str):
            continue
        assert held.__doc__, name
        if inspect.isclass(held):
            for member in vars(held):
                if not member.startswith("_"):
                    assert getattr(held, member).__doc__, f"{name}.{member}"


def test_stubs_tell_the_truth(tmp_path):
    pytest.importorskip("mypy.stubtest", reason="mypy is not installed")
    # A subclass of one of ipctk, which has no stubs and may be absent, as may pyvista.
    (tmp_path / "allowed").write_text("impinge\\._broad_phase(\\.BroadPhase)?\nimpinge\\.pyvista\n")
    allowed = ["--allowlist", str(tmp_path / "allowed"), "--ignore-unused-allowlist"]
    out = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "impinge", "--concise", "--ignore-disjoint-bases", *allowed],
        capture_output=True,
        text=True,
    )
    assert out.returncode == 0, out.stdout + out.stderr


TYPED = """
import numpy as np
import impinge

vertices = np.zeros((3, 3), np.float32)
scene = impinge.Scene()
body = scene.add(vertices, [[0, 1, 2]])
query = impinge.Query(self_of=body, exclude=[(body, 0)]).replace(shared_vertex="skip")
detector = impinge.Detector("cpu", method="cells", threads=2)
result = detector.detect(scene, query=query, cancel=impinge.CancelToken())
share: float = query.clearance_share
n: int = len(result.self_of(body)) + result.hash + body.index + int(detector.advance(scene, clearance=1e-4).n_tried)
pairs = impinge.pairs(vertices, [[0, 1, 2]], vertices, [[0, 1, 2]], method="naive")
total: np.uint32 = pairs.max()
"""


def test_users_can_check_their_types(tmp_path):
    pytest.importorskip("mypy", reason="mypy is not installed")

    def check(text):
        (tmp_path / "user.py").write_text(text)
        return subprocess.run(
            [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path), "user.py"],
            capture_output=True,
            text=True,
            cwd=tmp_path,
        )

    assert check(TYPED).returncode == 0, check(TYPED).stdout
    assert 'expected "int | None"' not in check(TYPED.replace("threads=2", "threads='2'")).stdout
    assert check(TYPED.replace("threads=2", "threads='2'")).returncode == 1
    assert check(TYPED.replace('"naive"', '"magic"')).returncode == 1


def test_the_documentation_runs(root, tmp_path):
    """Every block of Python in docs/python.md, one after the other in one namespace."""
    text = (root / "docs" / "python.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) >= 4
    script = tmp_path / "documentation.py"
    script.write_text("\n".join(blocks))
    out = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, cwd=tmp_path, timeout=120
    )
    assert out.returncode == 0, out.stderr


def pythons():
    """This Python, and the oldest supported one where it is installed."""
    yield sys.executable
    oldest = shutil.which("python3.9")
    if oldest and sys.version_info[:2] != (3, 9):
        version = subprocess.run([oldest, "-c", "import venv"], capture_output=True)
        if version.returncode == 0:
            yield oldest


@pytest.mark.parametrize("python", list(pythons()), ids=lambda path: pathlib.Path(path).name)
def test_a_wheel_in_an_empty_environment(python, tmp_path):
    wheel = os.environ.get("IMPINGE_WHEEL")
    if not wheel:
        pytest.skip("IMPINGE_WHEEL names no wheel: run scripts/test-python")
    assert re.search(r"-cp39-abi3-", wheel)
    home = tmp_path / "venv"
    subprocess.run([python, "-m", "venv", str(home)], check=True)
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    environment = {**os.environ, "PATH": str(python.parent), "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    environment.pop("PYTHONPATH", None)
    # Only what the wheel itself asks for, and no compiler in sight.
    subprocess.run(
        [str(python), "-m", "pip", "install", "-q", "--only-binary=:all:", wheel],
        check=True,
        env=environment,
    )
    code = (
        "import impinge\n"
        "corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]\n"
        "pairs = impinge.pairs(corners, [[0, 1, 2]], corners, [[0, 1, 2]])\n"
        "print(impinge.__version__, pairs.tolist())\n"
    )
    out = subprocess.run(
        [str(python), "-c", code], capture_output=True, text=True, env=environment, cwd=tmp_path
    )
    assert out.stdout == f"{impinge.__version__} [[0, 0]]\n", out.stderr
    files = set((home / "lib").rglob("impinge/*")) | set((home / "Lib").rglob("impinge/*"))
    assert {"py.typed", "_impinge.pyi", "__init__.py"} <= {file.name for file in files}


def test_without_the_c_library_that_is_said(tmp_path):
    # scripts/test-c tries wheels that have it.
    holder = pathlib.Path(impinge.__file__).parent
    if (holder / "_c").exists():
        pytest.skip("this build has the C library")
    out = subprocess.run([sys.executable, "-m", "impinge.cmake"], capture_output=True, text=True, cwd=tmp_path)
    assert out.returncode == 1 and out.stdout == "" and f"{holder / '_c'}: this build of the module has no C library" in out.stderr

    from impinge import cmake

    with pytest.raises(FileNotFoundError):
        cmake.prefix()
