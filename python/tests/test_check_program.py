"""The program impinge-check, the GitHub Action and the hook of pre-commit: by running their commands as written."""

import csv
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]

CLEAN = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
# A tetrahedron, one of its faces twice, and a triangle through it.
BAD = "v 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nv 1 1 -1\nv 1 1 3\nv 3 3 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\nf 2 3 4\nf 5 6 7\n"
TETRAHEDRA = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
5
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
5 0.2 0.2 0.2
$EndNodes
$Elements
2
1 4 2 0 1 1 2 3 4
2 4 2 0 1 1 2 3 5
$EndElements
"""
PIPE = "a|b,c:d%<i>.obj"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pathlib.Path("clean.obj").write_text(CLEAN)
    pathlib.Path("bad.obj").write_text(BAD)
    pathlib.Path("solid.msh").write_text(TETRAHEDRA)
    pathlib.Path("nan.obj").write_text(CLEAN.replace("v 1 0 0", "v nan 0 0"))
    pathlib.Path("open.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n")
    return tmp_path


def run(*arguments, **more):
    program = pathlib.Path(sys.executable).parent / "impinge-check"
    return subprocess.run([program, *arguments], capture_output=True, text=True, **more)


ALL = ["clean.obj", "bad.obj", "solid.msh", "nan.obj", "open.obj", "absent.obj"]


@pytest.mark.parametrize(
    "arguments",
    [
        ALL,
        [*ALL, "--fail-on", "any"],
        [*ALL, "--fail-on", "self-intersections,boundary"],
        ["clean.obj"],
        ["clean.obj", "clean.obj", "--fail-on", "any"],
        ["clean.obj", "absent.obj", "--fail-on", "self-intersections"],
        ["bad.obj", "--no-weld", "--fail-on", "nan"],
        [*ALL, "--json", "--fail-on", "duplicates"],
        ["clean.obj"] * 60 + ["bad.obj"] * 55,
        [*ALL, "--format", "github", "--fail-on", "boundary"],
        ["clean.obj", "open.obj", "--min-thickness", "0.5", "--fail-on", "thin"],
    ],
    ids=str,
)
def test_words_and_exit_codes_of_the_program(folder, arguments):
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    programs = [path for path in (target / "debug/impinge", target / "release/impinge") if path.exists()]
    if not programs:
        pytest.skip("the program impinge is not built")
    newest = max(programs, key=lambda path: path.stat().st_mtime)
    known = subprocess.run([newest, "check", *arguments], capture_output=True, text=True)
    mine = run(*arguments)
    assert mine.returncode == known.returncode
    if "--json" in arguments:
        # How many places are named is an option of the program.
        rows = [[{**json.loads(line), "places": None} for line in out.stdout.splitlines()] for out in (mine, known)]
        assert rows[0] == rows[1]
    else:
        # The program alone can mend and draw, and says so in its last line.
        told = re.sub(r"^next: .*\n", "", known.stdout, flags=re.M)
        assert mine.stdout == told
    assert mine.stderr == known.stderr.replace("impinge: ", "impinge-check: ", 1)


def test_exit_codes(folder):
    assert [run(*arguments).returncode for arguments in (["clean.obj"], ["bad.obj"], ["absent.obj"], [], ["bad.obj", "--fail-on", "x"])] == [0, 0, 1, 2, 2]
    out = run("bad.obj", "clean.obj", "--fail-on", "self-intersections,boundary")
    assert out.returncode == 3
    assert out.stderr == "impinge-check: 1 of 2 meshes failed: 1 with self-intersections, 1 with an open border\n"
    assert run("clean.obj", "--fail-on", "any").stdout.endswith("1 mesh: clean\n")


def test_a_list(folder):
    out = run("--list", "-", "--json", input="# a comment\n\nclean.obj\r\nbad.obj\n")
    assert [json.loads(line)["path"] for line in out.stdout.splitlines()] == ["clean.obj", "bad.obj"]
    assert run("--list", "absent.txt").returncode == 1
    out = run("--list", "-", input="# a comment\n")
    assert out.returncode == 2 and out.stderr.endswith("--list -: it names no mesh\n")


def test_annotations_and_a_summary(folder):
    if os.name != "nt":
        shutil.copy("bad.obj", PIPE)
    out = run(*ALL, PIPE, "--fail-on", "self-intersections", "--format", "github", "--summary", "summary.md")
    said = [line for line in out.stdout.splitlines() if line.startswith("::")]
    assert said[0].startswith("::error file=bad.obj,title=self-intersections::4 pairs of elements intersect, near (")
    files = [line.split(",")[0] for line in said]
    assert sorted(set(files), key=files.index) == [
        "::error file=bad.obj",
        "::warning file=bad.obj",
        "::error file=solid.msh",
        "::warning file=solid.msh",
        "::error file=nan.obj",
        "::warning file=open.obj",
        "::error file=absent.obj",
        "::error file=a|b%2Cc%3Ad%25<i>.obj",
        "::warning file=a|b%2Cc%3Ad%25<i>.obj",
    ]
    assert not any("clean.obj" in line for line in said)
    text = pathlib.Path("summary.md").read_text()
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    assert rows[0].startswith("| mesh | elements |") and len({len(re.findall(r"(?<!\\)\|", row)) for row in rows}) == 1
    assert "| bad.obj | 6 | 4 | 0 | 1 | 3 | 0 | 3 | 2 |" in rows and r"| a\|b,c:d%&lt;i>.obj | 6 |" in text
    # What fails comes before what is only told.
    assert rows[-1].startswith("| open.obj") and "- absent.obj" in text and "5 of 7 meshes failed" in text
    run("clean.obj", "--summary", "summary.md")
    assert pathlib.Path("summary.md").read_text().startswith(text) and "1 mesh: clean" in pathlib.Path("summary.md").read_text()


def git(*arguments):
    settings = ["-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "core.quotePath=false"]
    return subprocess.run(["git", *settings, *arguments], check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def runner(tmp_path_factory):
    """What GitHub gives to each job, with the module installed once."""
    temporary = tmp_path_factory.getbasetemp() / "runner"
    temporary.mkdir(exist_ok=True)
    return temporary


def act(runner, **inputs):
    """Runs the action in this folder: its command as written, with its variables as written."""
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    action = yaml.safe_load((ROOT / "action.yml").read_text())
    before = inputs.pop("before", "")
    given = {name: str(value["default"]) for name, value in action["inputs"].items()}
    assert set(inputs) <= set(given), inputs
    given.update(inputs)
    [step] = action["runs"]["steps"]
    values = {}
    for name, value in step["env"].items():
        value = re.sub(r"\$\{\{ inputs\.([\w-]+) \}\}", lambda match: given[match[1]], value)
        values[name] = re.sub(r"\$\{\{ github\.event\..* \}\}", before, value)
        assert "${{" not in values[name], name
    for name in ("output", "summary"):
        (runner / name).write_text("")
    machine = {
        "RUNNER_TEMP": str(runner),
        "GITHUB_ACTION_PATH": str(ROOT),
        "GITHUB_OUTPUT": str(runner / "output"),
        "GITHUB_STEP_SUMMARY": str(runner / "summary"),
    }
    # As a runner calls bash.
    command = ["bash", "--noprofile", "--norc", "-e", "-o", "pipefail", "-c", step["run"]]
    out = subprocess.run(command, env={**os.environ, **values, **machine}, capture_output=True, text=True)
    return out, (runner / "output").read_text(), (runner / "summary").read_text()


@pytest.mark.skipif("IMPINGE_WHEEL" not in os.environ, reason="scripts/test-python names the wheel")
@pytest.mark.skipif(shutil.which("git") is None or shutil.which("bash") is None, reason="needs git and bash")
def test_the_action_checks_what_a_change_touches(folder, runner):
    package = str(ROOT / os.environ["IMPINGE_WHEEL"])
    git("init", "-q", "-b", "main")
    pathlib.Path("notes.txt").write_text("no mesh")
    git("add", "notes.txt", "open.obj", "bad.obj")
    git("commit", "-qm", "before")
    before = git("rev-parse", "HEAD")
    out, output, summary = act(runner, package=package, before=before)
    assert (out.returncode, output) == (0, "checked=0\n"), out.stderr
    assert "no mesh" in out.stdout

    pathlib.Path("sub").mkdir()
    shutil.copy("clean.obj", "sub/Ä b.OBJ")
    git("add", ".")
    git("rm", "-q", "bad.obj")
    git("commit", "-qm", "after")
    out, output, summary = act(runner, package=package, before=before)
    # Added: clean.obj, nan.obj, solid.msh, and one in a folder; open.obj is unchanged, bad.obj is gone.
    assert (out.returncode, output) == (3, "checked=4\n"), out.stdout + out.stderr
    assert "::error file=nan.obj" in out.stdout and "open.obj" not in out.stdout and "sub/Ä b.OBJ" in out.stdout
    assert "of 4 meshes failed" in summary
    # A first push, and a commit that is not there: all meshes.
    for unknown in ("0" * 40, "1" * 40, ""):
        assert act(runner, package=package, before=unknown)[1] == "checked=5\n"
    # Named files.
    out, output, summary = act(runner, package=package, files="**/*.OBJ\n\nopen.obj\n", **{"fail-on": "boundary"})
    assert (out.returncode, output) == (3, "checked=2\n") and "::error file=open.obj" in out.stdout, out.stdout + out.stderr
    out, output, _ = act(runner, package=package, files="missing.obj")
    assert (out.returncode, output) == (3, "checked=1\n") or out.returncode == 1
    assert act(runner, package=package, files="*.nothing")[1] == "checked=0\n"


def test_the_action_fetches_the_commit_to_compare_with(folder, runner):
    if "IMPINGE_WHEEL" not in os.environ:
        pytest.skip("scripts/test-python names the wheel")
    git("init", "-q", "-b", "main", "origin")
    os.chdir("origin")
    shutil.copy("../open.obj", ".")
    git("add", ".")
    git("commit", "-qm", "before")
    before = git("rev-parse", "HEAD")
    shutil.copy("../bad.obj", ".")
    git("add", ".")
    git("commit", "-qm", "after")
    git("config", "uploadpack.allowAnySHA1InWant", "true")
    # As actions/checkout does by default.
    git("clone", "-q", "--depth=1", f"file://{os.getcwd()}", "../shallow")
    os.chdir("../shallow")
    out, output, _ = act(runner, package=str(ROOT / os.environ["IMPINGE_WHEEL"]), before=before)
    assert (out.returncode, output) == (3, "checked=1\n") and "::error file=bad.obj" in out.stdout, out.stdout + out.stderr


def test_the_hook_of_pre_commit(folder):
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    [hook] = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
    names = [*ALL, "a.OBJ", "b.stl", "c.txt", "obj", "d.objx", "sub/e.glb"]
    wanted = [name for name in names if re.search(hook["files"], name)]
    assert wanted == [*ALL, "a.OBJ", "b.stl", "sub/e.glb"]
    assert hook["language"] == "python" and hook["entry"] == "impinge-check"
    assert run(*hook["args"], "clean.obj", "open.obj").returncode == 0
    assert run(*hook["args"], "clean.obj", "bad.obj").returncode == 3


def test_the_action_and_the_hook_know_every_format_that_can_be_read(folder):
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    pathlib.Path("mesh.unknown").write_text("")
    known = re.search(r"\(known: (.*?)\)", run("mesh.unknown").stdout)[1].split(", ")
    [hook] = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
    action = re.search(r"^kinds='(.*)'$", (ROOT / "scripts/action").read_text(), re.M)[1]
    # A mesh of TetGen is several files, which are checked when one is named.
    wanted = [kind for kind in known if kind not in ("node", "ele", "face")]
    assert len(wanted) > 10 and hook["files"] == f"(?i){action}"
    assert [kind for kind in known if re.search(hook["files"], f"part.{kind}")] == wanted


def test_rows_are_a_table_with_a_row_per_mesh(folder):
    ran = run(*ALL, "--rows", "rows.csv", "--min-thickness", "0.5")
    assert ran.returncode == 1, ran.stderr
    with open("rows.csv", newline="") as file:
        header, *rows = csv.reader(file)
    assert header[:3] == ["path", "welded", "vertices"] and header[-1] == "error_kind"
    assert [row[0] for row in rows] == ALL
    assert rows[0][1:3] == ["1", "4"] and rows[5][2] == ""
    # As the program impinge writes it: the keys of --json without places.
    printed = [json.loads(line) for line in run(*ALL, "--json", "--min-thickness", "0.5", "--rows", "rows.jsonl").stdout.splitlines()]
    table = [json.loads(line) for line in pathlib.Path("rows.jsonl").read_text().splitlines()]
    for row, object in zip(table, printed):
        assert list(row) == header
        assert {key: value for key, value in object.items() if key != "places"}.items() <= row.items()
    assert run("clean.obj", "--rows", "rows.npy").returncode == 2
    assert run("clean.obj", "--rows", "absent/rows.csv").returncode == 1


def test_rows_in_parquet(folder):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    run(*ALL, "--rows", "rows.jsonl")
    assert run(*ALL, "--rows", "rows.parquet").returncode == 1
    assert not pathlib.Path("rows.parquet.part").exists()
    table = parquet.read_table("rows.parquet")
    assert table.to_pylist() == [json.loads(line) for line in pathlib.Path("rows.jsonl").read_text().splitlines()]
    assert str(table.schema.field("volume").type) == "double" and str(table.schema.field("euler").type) == "int64"
