"""The comparison with peers: it runs with whatever is installed, and a wrong answer cannot win."""

import json
import subprocess
import sys

import numpy as np
import pytest


@pytest.fixture
def modules(root, monkeypatch):
    monkeypatch.syspath_prepend(str(root / "bench"))
    import compare

    import contenders

    return compare, contenders


def test_it_runs_and_records(root, tmp_path, modules, monkeypatch, capsys):
    compare, _ = modules
    monkeypatch.setattr(compare, "ROOT", tmp_path)
    monkeypatch.setattr("records.ROOT", tmp_path)
    monkeypatch.setenv("IMPINGE_DATA", str(tmp_path / "none"))
    arguments = [
        "compare",
        "ball",
        "--frames",
        "2",
        "--seconds",
        "0",
        "--record",
        "--machine",
        "A B",
    ]
    monkeypatch.setattr(sys, "argv", arguments)
    assert compare.main() == 0
    out, err = capsys.readouterr()
    (folder,) = (tmp_path / "bench" / "record").iterdir()
    assert folder.name.startswith("a-b-20")
    assert (folder / "compare.md").read_text(encoding="utf-8") == out
    record = json.loads((folder / "compare.json").read_text())
    rows = record["scenes"]["ball"]["rows"]
    assert rows[0]["exact"] and rows[0]["extra"] == rows[0]["missing"] == 0
    assert rows[0]["pairs"] > 500 and 0 < rows[0]["fastest_frame_ms"] <= rows[0]["frame_ms"]
    assert out.count("| **impinge** |") == 1
    # Every peer either took part or is named with what to install.
    for package in ["libigl", "coal", "python-fcl", "ipctk"]:
        assert package in err or any(row["version"] for row in rows[1:])


def test_a_wrong_answer_is_counted_and_fails(modules, monkeypatch, capsys):
    compare, contenders = modules

    class Liar(contenders.Impinge):
        def pairs(self):
            pairs = super().pairs()
            return np.vstack([pairs[2:], [[0, 30_000]]])

    liar = Liar(", lying")
    monkeypatch.setattr(contenders, "available", lambda: ([liar], []))
    monkeypatch.setattr(sys, "argv", ["compare", "ball", "--frames", "1", "--seconds", "0"])
    assert compare.main() == 1
    out, err = capsys.readouterr()
    assert "+1 −2" in out and "claims to be exact and is not" in err


def test_who_has_no_memory_for_all_boxes_is_left_out_by_name(modules, monkeypatch, capsys):
    compare, contenders = modules

    class KeepsBoxes(contenders.Impinge):
        most_boxes = 10**6

        def start(self, *arrays):
            raise MemoryError

    ours, peer = contenders.Impinge(""), KeepsBoxes(", which keeps boxes")
    monkeypatch.setattr(contenders, "available", lambda: ([ours, peer], []))
    monkeypatch.setattr(sys, "argv", ["compare", "bolt", "--frames", "1", "--seconds", "0"])
    assert compare.main() == 0
    out, _ = capsys.readouterr()
    assert "which keeps boxes is left out: it keeps all pairs whose boxes overlap" in out
    assert out.count("| **impinge**") == 1
    # The number in the table of scenes.
    scene = compare.Scene("bolt", None, 1)
    (low, high), (other_low, other_high) = [
        (frame[scene.faces].min(axis=1), frame[scene.faces].max(axis=1))
        for frame in scene.frames[0]
    ]
    order = np.argsort(other_low[:, 0])
    other_low, other_high = other_low[order], other_high[order]
    n = 0
    for at in range(0, len(low), 500):
        some = slice(at, at + 500)
        last = np.searchsorted(other_low[:, 0], high[some, 0].max(), side="right")
        overlap = np.ones((len(low[some]), last), bool)
        for axis in range(3):
            overlap &= low[some, axis, None] <= other_high[None, :last, axis]
            overlap &= other_low[None, :last, axis] <= high[some, axis, None]
        n += np.count_nonzero(overlap)
    # Sines differ in the last bit from one machine to another.
    assert abs(n / compare.BOXES["bolt"] - 1) < 1e-3


def test_bad_arguments_are_named(root):
    def run(*arguments):
        script = str(root / "bench" / "compare.py")
        return subprocess.run([sys.executable, script, *arguments], capture_output=True, text=True)

    assert "no scene teapot" in run("teapot").stderr
    assert "--frames: at least 1, 0 given" in run("--frames", "0").stderr
