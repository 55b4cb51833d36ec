"""Questions, answers, settings, threads."""

import json
import pathlib
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import impinge
from shapes import ACROSS, FACE, TRIANGLE, ball, lattice_triangles, soup


@pytest.fixture(scope="module")
def scene():
    """Three balls in a row, each overlapping the next, the last one in double precision."""
    scene = impinge.Scene()
    vertices, faces = ball()
    for shift in [0, 1, 2]:
        moved = vertices + np.float32([shift, 0.25, 0.125 * shift])
        scene.add(moved.astype(np.float64) if shift == 2 else moved, faces)
    web = lattice_triangles(60, 3, 1, shared=True)
    scene.add(web[0] + np.float32(20), web[1])
    return scene


def truth(scene, **question):
    return impinge.Detector(method="naive").detect(scene, **question)


@pytest.mark.parametrize(
    "question",
    [
        {},
        {"which": "between"},
        {"between": (0, 1)},
        {"between": (2, 1)},
        {"self_of": 3},
        {"which": "self"},
        {"self_of": 3, "shared_vertex": "skip"},
        {"which": "all"},
        {"of": 1},
        {"exclude": [(1, 0), (3, 3)]},
        {"exclude": (3, 3)},
        {"between": None, "self_of": None, "exclude": iter([(2, 1)])},
    ],
    ids=str,
)
@pytest.mark.parametrize("method", ["clusters", "cells"])
def test_questions(scene, question, method):
    question = dict(question)
    if "exclude" in question:
        question["exclude"] = list(question["exclude"]) or [(2, 1)]
    expected = truth(scene, **question)
    result = impinge.Detector(method=method).detect(scene, **question)
    assert len(result) > 0 and bool(result)
    assert np.array_equal(result.rows, expected.rows)
    assert result.hash == expected.hash == impinge.hash_rows(result.rows)


def test_neighbours_are_resolved_unless_asked_otherwise():
    # The second triangle folds back onto the first one, across their common edge.
    vertices = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [1, 1.5, 0]], np.float32)
    faces = [[0, 1, 2], [0, 1, 3]]
    scene = impinge.Scene()
    body = scene.add(vertices, faces)
    detector = impinge.Detector()
    for rule, expected in [({}, [[0, 1]]), ({"shared_vertex": "resolve"}, [[0, 1]]), ({"shared_vertex": "skip"}, [])]:
        assert detector.detect(scene, self_of=body, **rule).rows[:, 1::2].tolist() == expected
        assert detector.detect(scene, **rule).self_of(body).tolist() == expected
        assert detector.count(scene, self_of=body, **rule) == len(expected)
        assert detector.any(scene, self_of=body, **rule) == bool(expected)
        assert impinge.self_pairs(vertices, faces, **rule).tolist() == expected


def test_results(scene):
    a, b, c, web = scene.bodies
    result = impinge.Detector().detect(scene)
    rows = result.rows
    assert rows.shape == (len(result), 4) and rows.dtype == np.uint32
    assert np.array_equal(rows, rows[np.lexsort((rows[:, 3], rows[:, 2], rows[:, 1], rows[:, 0]))])

    def between(x, y):
        return rows[(rows[:, 0] == x.index) & (rows[:, 2] == y.index)][:, [1, 3]]

    assert len(between(a, b)) > 10 and len(between(web, web)) > 10
    assert np.array_equal(result.between(a, b), between(a, b))
    swapped = between(a, b)[:, ::-1]
    swapped = swapped[np.lexsort((swapped[:, 1], swapped[:, 0]))]
    assert np.array_equal(result.between(b, a), swapped)
    assert np.array_equal(result.self_of(web), between(web, web))
    assert result.between(a, web).shape == (0, 2)
    colliding = np.union1d(rows[rows[:, 0] == 1][:, 1], rows[rows[:, 2] == 1][:, 3])
    assert np.array_equal(result.colliding(b), colliding) and result.colliding(1).dtype == np.uint32
    assert result.bodies == scene.bodies
    with pytest.raises(ValueError, match=r"^a and b are both body 1: take self_of\(1\)"):
        result.between(b, b)
    narrow = impinge.Detector().detect(scene, between=(b, a))
    assert np.array_equal(narrow.between(b, a), result.between(b, a))
    with pytest.raises(ValueError, match="^body: "):
        narrow.colliding(c)


def test_results_outlive_the_next_frame():
    scene = impinge.Scene()
    a, b = scene.add(TRIANGLE, FACE), scene.add(ACROSS, FACE)
    detector = impinge.Detector()
    first = detector.detect(scene, between=(a, b))
    scene.set_positions(a, TRIANGLE + np.float32(7))
    second = detector.detect(scene, between=(a, b))
    scene.remove(a)
    assert first.between(a, b).tolist() == [[0, 0]] and second.rows.tolist() == []
    assert first.colliding(a).tolist() == [0] and not second
    assert first.hash != second.hash == 0


def test_frames_follow_the_positions():
    """A deforming body against the oracle, frame after frame in one detector."""
    vertices, faces = ball(dtype=np.float64)
    scene = impinge.Scene()
    a = scene.add(vertices, faces)
    b = scene.add(vertices + [0.5, 0.25, 0.125], faces)
    detectors = [impinge.Detector(), impinge.Detector(method="cells"), impinge.Detector(method="naive")]
    counts = set()
    for frame in range(6):
        angle = 0.5 * frame * vertices[:, 2]
        x, y, z = vertices.T
        twisted = np.stack(
            [np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, 0.7 * z],
            1,
        )
        scene.set_positions(a, twisted if frame % 2 else twisted.astype(np.float32))
        results = [d.detect(scene) for d in detectors]
        assert len({result.hash for result in results}) == 1
        assert all(np.array_equal(result.rows, results[0].rows) for result in results)
        counts.add(len(results[0].between(b, a)))
    assert len(counts) > 2


@pytest.mark.parametrize(
    "question, error, message",
    [
        ({"between": (0, 0)}, ValueError, "^body 0 is named twice, where two different bodies are needed"),
        ({"between": (0, 9)}, ValueError, "^between: there is no body 9"),
        ({"between": (0, 1, 2)}, ValueError, "^between: two bodies expected, 3 given"),
        ({"between": 0}, TypeError, "^between: a pair of bodies expected"),
        ({"between": "ab"}, TypeError, "^between: a pair of bodies expected"),
        ({"between": (0, "b")}, TypeError, "^between: a Body or its number expected, str given"),
        ({"self_of": (0, 1)}, TypeError, "^self_of: a Body or its number expected, tuple given"),
        ({"self_of": 9}, ValueError, "^self_of: there is no body 9"),
        ({"between": (0, 1), "self_of": 0}, ValueError, "^between and self_of: two choices of pairs given"),
        ({"which": "between", "of": 0}, ValueError, "^which and of: two choices of pairs given"),
        ({"exclude": [(0, 1), (0, 9)]}, ValueError, r"^exclude\[1\]: there is no body 9"),
        ({"exclude": [0]}, TypeError, r"^exclude\[0\]: a pair of bodies expected"),
        ({"shared_vertex": "all"}, ValueError, '^shared_vertex: "all" given, "resolve", "skip"'),
        ({"shared_vertex": 0}, TypeError, "^shared_vertex: a string expected, int given"),
        ({"exclude": 0}, TypeError, "^exclude: a pair of bodies, an Exclusion, or a sequence of these, expected, int given"),
        ({"query": {}}, TypeError, "^query: a Query expected, dict given"),
        ({"betwen": (0, 1)}, TypeError, "^betwen: no such option, which, between, self_of, of, kinds, .*, progress are, each of questions with a use for it"),
        ({"distances": 1}, TypeError, "^distances: True or False expected, int given"),
        ({"kinds": "vf"}, ValueError, "^kinds: kinds of pairs .* given, in this question only pairs of the bodies' own elements allowed$"),
        ({"progress": 1}, TypeError, "^progress: a callable expected, int given"),
        ({"cancel": 1}, TypeError, "^cancel: a CancelToken expected, int given"),
    ],
)
def test_questions_refused(scene, question, error, message):
    with pytest.raises(error, match=message):
        impinge.Detector().detect(scene, **question)


@pytest.mark.parametrize(
    "settings, error, message",
    [
        ({"method": "magic"}, ValueError, '^method: "magic" given, "auto", "clusters", "cells", "naive"'),
        ({"backend": "tpu"}, ValueError, '^backend: "tpu" given, "auto", "cpu", "gpu" allowed'),
        ({"recluster": "yes"}, ValueError, "^recluster: "),
        ({"instruction_set": "mmx"}, ValueError, "^instruction_set: "),
        ({"affinity": "nowhere"}, ValueError, '^affinity: "nowhere" given, "auto", "inherited" allowed'),
        ({"threads": -1}, ValueError, "^threads: -1 given, 0 to 1024 allowed"),
        ({"threads": 1025}, ValueError, "^threads: 1025 given"),
        ({"threads": 2.5}, TypeError, "^threads: a whole number expected, float given"),
        ({"threads": True}, TypeError, "^threads: a whole number expected, bool given"),
        ({"memory_budget": -5}, ValueError, "^memory_budget: -5 given"),
        ({"max_pairs": -1}, ValueError, "^max_pairs: -1 given"),
        ({"memory_budget": 2**64}, ValueError, "^memory_budget: 18446744073709551616 given"),
        ({"density": 0}, ValueError, "^density: 0 given, a number above 0 allowed"),
        ({"density": float("nan")}, ValueError, "^density: NaN given"),
        ({"density": "1"}, TypeError, "^density: a number expected, str given"),
        ({"reuse_margin": -1}, ValueError, "^reuse_margin: -1 given, a number that is not below 0 allowed"),
        ({"_group_size": 0}, ValueError, "^group size: 0 given, 1 to 64 allowed"),
        ({"_group_size": 65}, ValueError, "^_group_size: 65 given"),
        ({"device": 3}, TypeError, "^device: a string expected, int given"),
        ({"method": b"cells"}, TypeError, "^method: a string expected, bytes given"),
        ({"colour": "red"}, TypeError, "colour"),
    ],
)
def test_settings_refused(settings, error, message):
    with pytest.raises(error, match=message):
        impinge.Detector(**settings)


@pytest.mark.parametrize("bad", [None, 3, "scene"])
def test_not_a_scene(bad):
    with pytest.raises(TypeError, match="^scene: a Scene expected, "):
        impinge.Detector().detect(bad)


def test_cells_share_the_pairs(scene):
    question = {"which": "all"}
    detector = impinge.Detector()
    whole = detector.detect(scene, **question)
    inf = np.inf
    cuts = [-inf, 0.5, 1.0, inf]
    parts = []
    for low, high in zip(cuts, cuts[1:]):
        cell = [[low, -inf, -inf], [high, inf, inf]]
        part = detector.detect(scene, owned_by=cell, **question)
        assert detector.count(scene, owned_by=np.array(cell), **question) == len(part) > 0
        assert detector.any(scene, owned_by=tuple(cell), **question)
        parts.append(part.rows)
    together = np.concatenate(parts)
    assert len(together) == len(whole)
    assert np.array_equal(np.unique(together, axis=0), whole.rows)
    with pytest.raises(ValueError, match=r"^owned_by: shape \(2, 3\) expected, \(3,\) given"):
        detector.detect(scene, owned_by=[0, 0, 0])
    with pytest.raises(ValueError, match="^owned_by: "):
        detector.detect(scene, owned_by=[[0, 0, 0], [1, 1, np.nan]])


def test_numpy_scalars_are_numbers():
    detector = impinge.Detector(
        threads=np.int64(2),
        memory_budget=np.uint64(1 << 30),
        density=np.float32(2),
        _group_size=np.uint8(9),
    )
    assert repr(detector) == (
        "Detector(backend='auto', threads=2, memory_budget=1073741824, density=2.0)"
    )


def test_too_small_a_budget_says_what_is_needed(scene):
    with pytest.raises(MemoryError, match="memory budget is 10 bytes, but [0-9]+ bytes are needed"):
        impinge.Detector(memory_budget=10).detect(scene)


def pile(n):
    """n triangles turned around an axis that passes through all of them: each meets each."""
    angle = np.arange(n) / n * 3.0
    x, y, one = np.cos(angle), np.sin(angle), np.ones(n)
    corners = [[-x, -y, -one], [x, y, -one], [0.1 * x, 0.1 * y, one]]
    vertices = np.array(corners).transpose(2, 0, 1).reshape(-1, 3).astype(np.float32)
    return vertices, np.arange(3 * n, dtype=np.uint32).reshape(-1, 3)


def test_more_pairs_than_allowed():
    vertices, faces = pile(60)
    assert len(impinge.self_pairs(vertices, faces, max_pairs=1770)) == 1770
    match = r"^1770 pairs and more were found, and at most 1769 are allowed$"
    with pytest.raises(impinge.TooManyPairs, match=match):
        impinge.self_pairs(vertices, faces, max_pairs=1769)
    detector = impinge.Detector(max_pairs=5, backend="cpu")
    assert "max_pairs=5" in repr(detector)
    scene = impinge.Scene()
    body = scene.add(vertices, faces)
    assert detector.any(scene, self_of=body) is True
    assert detector.any(scene, which="between") is False
    assert impinge.Detector("cpu").count(scene, self_of=body) == 1770
    with pytest.raises(impinge.TooManyPairs):
        detector.count(scene, which="self")
    with pytest.raises(TypeError, match="^progress: a callable expected"):
        detector.any(scene, progress=3)


@pytest.mark.skipif(sys.platform != "linux", reason="limits of address space")
def test_an_answer_without_memory_is_an_error():
    # 112 million pairs take 900 MB, of which none are there.
    script = """
import resource, impinge, numpy as np
from test_detector import pile
vertices, faces = pile(15_000)
scene = impinge.Scene()
scene.add(vertices, faces)
detector = impinge.Detector("cpu", threads=2)
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + (600 << 20),) * 2)
for _ in range(2):
    try:
        detector.detect(scene, which="self")
    except MemoryError as error:
        print(error)
small = impinge.Scene()
small.add(*pile(100))
print(len(detector.detect(small, which="self")))
"""
    folder = pathlib.Path(__file__).parent
    run = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    first, second, n = run.stdout.splitlines()
    assert first.startswith("out of memory: ") and second.startswith("out of memory: ")
    assert n == "4950"


def test_statistics(scene):
    stats = impinge.Detector(threads=1, backend="cpu").detect(scene).stats
    assert stats.backend == "cpu" and stats.method == "clusters" and stats.n_threads == 1
    assert stats.n_candidates > 0 and stats.n_clusters > 0 and stats.n_clustered == 4
    assert 0 <= stats.unsure_share <= 1 and stats.bytes_held > 0
    assert 0 < sum(stats.stages.values()) <= 1.1 * stats.total_ms
    as_dict = stats.as_dict()
    assert json.loads(json.dumps(as_dict))["stages"] == stats.stages
    names = {name for name in dir(stats) if name[0] != "_"} - {"as_dict"}
    assert set(as_dict) == names
    assert all(as_dict[name] == getattr(stats, name) for name in names)
    assert repr(stats).startswith("Stats(")
    stats = impinge.Detector("cpu", method="cells").detect(scene).stats
    assert len(stats.grid) == 3 and stats.n_entries > 0


@pytest.fixture(scope="module")
def long():
    """A scene on which the oracle works for a while."""
    scene = impinge.Scene()
    scene.add(*soup(15_000, 0.001, 3))
    return scene


def test_the_interpreter_is_released(long):
    """While a thread detects, this one keeps running Python."""
    took = []

    def work():
        start = time.perf_counter()
        impinge.Detector(method="naive", threads=1).detect(long, self_of=0)
        took.append(time.perf_counter() - start)

    thread = threading.Thread(target=work)
    thread.start()
    turns, last, gap = 0, time.perf_counter(), 0.0
    while thread.is_alive():
        time.sleep(0.001)
        now = time.perf_counter()
        turns, gap, last = turns + 1, max(gap, now - last), now
    thread.join()
    assert took[0] > 0.05, "too short a run to tell"
    assert turns > 10 and gap < 0.7 * took[0]


def test_threads_share_a_scene(scene):
    expected = truth(scene).hash
    hashes = []

    def work():
        detector = impinge.Detector(threads=2)
        hashes.extend(detector.detect(scene).hash for _ in range(20))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert hashes == [expected] * 80


def test_what_is_in_use_is_not_changed(long):
    """From within a running detection neither its scene nor itself can be touched."""
    detector = impinge.Detector(method="naive")
    seen = []

    def progress(done, total):
        for change in [
            lambda: long.set_positions(0, long.positions(0)),
            lambda: long.remove(0),
            lambda: detector.detect(long, self_of=0),
        ]:
            with pytest.raises(
                RuntimeError, match="being read by a detection|detector is busy"
            ) as raised:
                change()
            seen.append(str(raised.value)[:12])

    detector.detect(long, self_of=0, progress=progress)
    assert set(seen) == {"the scene is", "the detector"}


@pytest.mark.parametrize("method", ["clusters", "cells", "naive"])
def test_progress(scene, method):
    seen = []
    thread = threading.get_ident()

    def progress(done, total):
        assert threading.get_ident() == thread
        seen.append((done, total))

    result = impinge.Detector(method=method).detect(scene, progress=progress)
    assert result.hash == truth(scene).hash
    assert all(isinstance(done, int) and 0 <= done <= total for done, total in seen)
    if method != "naive":
        assert seen[-1][0] == seen[-1][1]


def test_an_exception_of_progress_stops_the_run(long):
    detector = impinge.Detector(method="naive")

    def progress(done, total):
        raise LookupError(f"{done} of {total}")

    with pytest.raises(LookupError, match="of 15000"):
        detector.detect(long, self_of=0, progress=progress)
    small = impinge.Scene()
    small.add(TRIANGLE, FACE), small.add(ACROSS, FACE)
    assert len(detector.detect(small)) == 1


@pytest.mark.parametrize("method", ["clusters", "cells", "naive"])
def test_cancel(scene, method):
    token = impinge.CancelToken()
    detector = impinge.Detector(method=method)
    assert len(detector.detect(scene, cancel=token)) > 0
    token.cancel()
    assert token.is_cancelled
    with pytest.raises(impinge.Cancelled, match="cancelled"):
        detector.detect(scene, cancel=token)
    assert detector.detect(scene).hash == truth(scene).hash


def test_cancel_from_another_thread(long):
    token = impinge.CancelToken()
    timer = threading.Timer(0.02, token.cancel)
    timer.start()
    with pytest.raises(impinge.Cancelled):
        while True:
            impinge.Detector(method="naive").detect(long, self_of=0, cancel=token)
    timer.join()
