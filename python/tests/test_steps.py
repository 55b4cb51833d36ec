"""Steps: what touches while bodies move, when first, how far a step can be taken."""

import threading

import numpy as np
import pytest

import impinge
from shapes import FACE, ball, lattice_triangles

FLOOR = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0]], np.float32)


def lifted(z, dtype=np.float32):
    return (FLOOR + np.float32([0, 0, z])).astype(dtype)


@pytest.fixture(params=["clusters", "naive"])
def detector(request):
    return impinge.Detector(method=request.param, backend="cpu", threads=1)


@pytest.fixture
def falling():
    scene = impinge.Scene()
    scene.add(FLOOR, FACE)
    other = scene.add(lifted(1), FACE)
    scene.set_end_positions(other, lifted(-3))
    return scene


def test_thick_bodies_keep_their_thickness(detector, falling):
    apart = detector.impacts(falling, separation=0.5)
    assert apart.earliest().toi == 0.125 and detector.earliest(falling).toi == 0.25
    falling.set_thickness(0, [0.125, 0.125, 0.125])
    assert detector.impacts(falling, separation=0.375).hash == apart.hash
    falling.set_thickness(1, 0.375)
    assert detector.earliest(falling, which="between") == apart.earliest()
    assert detector.advance(falling).fraction < 0.125
    near = detector.candidates(falling, which="between", kinds=["vf"])
    assert len(near) == len(detector.candidates(falling, 0.25, which="between", kinds=["vf"]))


def lattice_step(n=40, k=6, seed=3, dtype=np.float32):
    """Lattice triangles of three bodies whose vertices go to other places of the lattice."""
    scene = impinge.Scene()
    for body in range(3):
        vertices, faces = lattice_triangles(n, k, seed + body, shared=True)
        ends = np.random.default_rng(seed + 10 + body).integers(0, k + 1, vertices.shape)
        scene.add(vertices.astype(dtype), faces)
        scene.set_end_positions(body, ends.astype(dtype))
    return scene


def test_a_triangle_falls_through_another(detector, falling):
    impacts = detector.impacts(falling)
    assert len(impacts) == 15 and bool(impacts)
    assert impacts.kinds.shape == (15,) and {impinge.KINDS[kind] for kind in impacts.kinds} == {"vf", "ee"}
    assert impacts.rows.shape == (15, 4) and impacts.rows.dtype == np.uint32 and impacts.kinds.dtype == np.uint8
    of_edges = impacts.of("ee")
    assert 0 < len(of_edges) < 15 and {hit.kind for hit in of_edges} == {"ee"} and len(of_edges.of("vf")) == 0
    assert of_edges.hash + impacts.of("vf").hash & 2**64 - 1 == impacts.hash
    assert of_edges.earliest() == of_edges[0] and of_edges.toi.shape == (len(of_edges),)
    assert impacts.toi.dtype == np.float32 and (impacts.toi == 0.25).all()
    assert impacts.at_start.dtype == bool and not impacts.at_start.any()
    first = impacts[0]
    assert (first.kind, first.toi, first.at_start) == ("vf", 0.25, False)
    assert first == impacts.earliest() == detector.earliest(falling) != impacts[1]
    assert len({first, impacts[-15], impacts[-1]}) == 2
    assert [[int(number) for number in hit[1:5]] for hit in impacts] == impacts.rows.tolist()
    assert first.body_b in falling.bodies and first._fields[1:5] == ("body_a", "element_a", "body_b", "element_b")
    for index in [15, -16]:
        with pytest.raises(IndexError, match=f"^index {index} given, but there are 15 impacts"):
            impacts[index]
    assert not detector.is_free(falling)
    assert impacts.stats.method in ("clusters", "naive")
    falling.set_end_positions(1, None)
    assert falling.end_positions(1) is None
    assert detector.is_free(falling) and detector.earliest(falling) is None
    free = detector.impacts(falling)
    assert len(free) == 0 and free.earliest() is None and free.kinds.shape == (0,)
    assert free.kinds.dtype == impacts.kinds.dtype and free.rows.shape == (0, 4)
    assert repr(free) == "Impacts(0, nothing touches)"


def test_edges_are_numbered_as_the_scene_lists_them(detector, falling):
    impacts = detector.impacts(falling)
    edges = falling.edges(0)
    assert edges.tolist() == [[0, 1], [0, 2], [1, 2]]
    of_edges = impacts.of("ee").rows[:, 1::2]
    assert of_edges.max() < len(edges)
    assert falling.faces(0).tolist() == [[0, 1, 2]]


def test_times_are_rounded_down(detector):
    scene = impinge.Scene()
    scene.add(FLOOR, FACE)
    point = scene.add_points([[1, 1, 1]])
    scene.set_end_positions(point, [[1, 1, -2]])
    single, double = (detector.impacts(scene, precision=precision).toi for precision in ["f32", "f64"])
    assert (single.dtype, double.dtype) == (np.float32, np.float64)
    third = float.fromhex("0x1.5555555555555p-2")
    assert double.tolist() == [third] and single.tolist() == [float(np.nextafter(np.float32(third), np.float32(0)))]
    assert detector.earliest(scene, precision="f64").toi == third
    assert detector.earliest(scene).toi == single[0]


def test_what_touches_at_the_start(detector, falling):
    falling.set_positions(1, lifted(0))
    falling.set_end_positions(1, lifted(1))
    impacts = detector.impacts(falling)
    assert len(impacts) == 15
    assert (impacts.toi == 0).all() and impacts.at_start.all()
    assert len(detector.impacts(falling, start="skip")) == 0
    assert detector.is_free(falling, start="skip") and not detector.is_free(falling)
    assert detector.advance(falling).fraction == 0.0
    assert detector.advance(falling, start="skip").fraction == 1.0


def test_points_and_edges(detector):
    scene = impinge.Scene()
    point = scene.add_points(np.array([[0, 0, 1.0]]))
    scene.set_end_positions(point, [[0, 0, -1.0]])
    edge = scene.add_edges([[-1, 0, 0], [1, 0, 0]], [[0, 1]])
    resting = scene.add_points([[0, 0, -0.5]])
    assert [scene.kind(body) for body in scene.bodies] == ["points", "edges", "points"]
    impacts = detector.impacts(scene)
    assert [impinge.KINDS[kind] for kind in impacts.kinds] == ["ev", "vv"]
    assert impacts.rows[:, ::2].tolist() == [[int(edge), int(point)], [int(point), int(resting)]]
    assert impacts.toi.tolist() == [0.5, 0.75]
    with pytest.raises(ValueError, match=r"^edges: shape \(n, 2\) expected, \(1, 3\) given"):
        scene.add_edges(FLOOR, FACE)
    with pytest.raises(ValueError, match=r"^edges\[0, 1\] = 3: there are 3 vertices"):
        scene.add_edges(FLOOR, [[0, 3]])
    with pytest.raises(ValueError, match=r"^vertices\[0, 1\] = nan: a position must be finite"):
        scene.add_points([[0, np.nan, 0]])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    "question",
    [
        {},
        {"which": "between"},
        {"between": (2, 0)},
        {"self_of": 1},
        {"which": "self"},
        {"exclude": [(0, 1), (2, 2)]},
        {"start": "skip"},
        {"precision": "f64"},
    ],
    ids=str,
)
def test_every_question_has_the_answer_of_the_naive_method(question, dtype):
    scene = lattice_step(dtype=dtype)
    fast, naive = (impinge.Detector(method=method, backend="cpu") for method in ["clusters", "naive"])
    ours, truth = fast.impacts(scene, **question), naive.impacts(scene, **question)
    assert len(ours) > 0 and ours.hash == truth.hash
    for name in ["kinds", "rows", "toi", "at_start"]:
        assert getattr(ours, name).tobytes() == getattr(truth, name).tobytes(), name
    assert fast.earliest(scene, **question) == ours.earliest() == naive.earliest(scene, **question)
    bodies = {tuple(row) for row in ours.rows[:, ::2].tolist()}
    scope = {key: value for key, value in question.items() if key not in ("start", "precision")}
    if scope.get("between") == (2, 0):
        assert bodies == {(0, 2), (2, 0)}
    elif scope.get("within") is True:
        assert bodies == {(0, 0), (1, 1), (2, 2)}
    elif scope.get("within") == 1:
        assert bodies == {(1, 1)}
    elif scope.get("which") == "between":
        assert all(a != b for a, b in bodies)
    elif not scope:
        assert {(0, 0), (0, 1), (2, 2)} <= bodies
    candidates = fast.candidates(scene, **scope)
    assert candidates.hash == naive.candidates(scene, **scope).hash and len(candidates) > 0


def test_a_separation_is_kept(detector, falling):
    impacts = detector.impacts(falling, separation=0.5)
    assert len(impacts) >= 15 and impacts.toi.min() == 0.125
    assert detector.earliest(falling, separation=0.5).toi == 0.125
    assert detector.earliest(falling, separation=1).at_start
    assert 0.1249 < detector.advance(falling, separation=0.5).fraction < 0.125
    falling.set_end_positions(1, lifted(0.75))
    assert detector.is_free(falling, separation=0.5)
    assert not detector.is_free(falling, separation=0.75)
    for ask in (detector.impacts, detector.earliest, detector.is_free, detector.advance):
        for bad in (-1, float("nan"), float("inf")):
            with pytest.raises(ValueError, match="separation"):
                ask(falling, separation=bad)
        with pytest.raises(TypeError, match="^separation: a number expected, str given"):
            ask(falling, separation="near")


def test_a_step_that_is_advanced_is_free(detector, falling):
    advance = detector.advance(falling)
    assert 0.249999 < advance.fraction < 0.25 and advance.first.toi == 0.25
    assert advance.bodies == [falling.bodies[1]] and advance.positions(0) is None
    positions = advance.positions(1)
    assert np.array_equal(positions, advance.positions(falling.bodies[1]))
    with pytest.raises(ValueError, match="^body: of another scene"):
        advance.positions(impinge.Scene().add_points([[0, 0, 0]]))
    assert positions.dtype == np.float32 and positions.shape == (3, 3)
    assert "fraction=0.24999" in repr(advance) and advance.n_tried >= 2
    advance.apply(falling)
    assert np.array_equal(falling.positions(1), positions) and falling.end_positions(1) is None
    assert len(detector.detect(falling)) == 0
    with pytest.raises(TypeError, match="^scene: a Scene expected, int given"):
        advance.apply(3)
    falling.remove(1)
    with pytest.raises(ValueError, match="no such body"):
        advance.apply(falling)


def test_a_chain_of_steps_never_passes_through(detector):
    scene = impinge.Scene()
    vertices, faces = ball(8, 12)
    scene.add(vertices, faces)
    other = scene.add(vertices * np.float32(0.5) + np.float32([0, 0.1, 2]), faces)
    for _ in range(6):
        scene.set_end_positions(other, scene.positions(other) - np.float32([0, 0, 0.4]))
        detector.advance(scene).apply(scene)
        assert len(detector.detect(scene)) == 0
    assert scene.positions(other)[:, 2].min() > 0.9


def test_end_positions(detector, falling):
    assert np.array_equal(falling.end_positions(1), lifted(-3)) and falling.end_positions(0) is None
    with pytest.raises(ValueError, match="^vertices: 2 positions given, but body 1 has 3 vertices"):
        falling.set_end_positions(1, FLOOR[:2])
    with pytest.raises(ValueError, match=r"^body 1: vertices\[2, 0\] = inf: a position must be finite"):
        falling.set_end_positions(1, np.where([[0], [0], [1]], np.inf, FLOOR))
    with pytest.raises(ValueError, match="no body 7"):
        falling.set_end_positions(7, None)
    assert np.array_equal(falling.end_positions(1), lifted(-3))
    # Mixed precision becomes double, exactly.
    falling.set_end_positions(1, lifted(-3, np.float64))
    assert falling.positions(1).dtype == falling.end_positions(1).dtype == np.float64
    assert detector.earliest(falling).toi == 0.25


def test_candidates(detector):
    scene = impinge.Scene()
    scene.add_points([[0, 0, 0]])
    far = scene.add_points([[3, 0, 0]])

    def count(distance):
        return len(detector.candidates(scene, distance, kinds=["vv"]))

    assert [count(d) for d in [0, 1.0, np.nextafter(1.5, 0), 1.5]] == [0, 0, 0, 1]
    scene.set_end_positions(far, [[1, 0, 0]])
    assert [count(d) for d in [0.49, 0.5]] == [0, 1]
    candidates = detector.candidates(scene, 0.5, kinds="vv")
    assert candidates.of("vv").rows.tolist() == [[0, 0, 1, 0]] and impinge.KINDS[candidates.kinds[0]] == "vv"
    assert candidates.rows.tolist() == [[0, 0, 1, 0]] and candidates.of("vv").hash == candidates.hash
    assert len(candidates.of("ee")) == 0 == candidates.of("ee").hash
    assert candidates.of("ef").rows.shape == (0, 4) and repr(candidates) == "Candidates(vv: 1)"
    with pytest.raises(ValueError, match='^kind: "fv" given, "vf", "ee", "ev", "vv", "ef", "ff" allowed'):
        candidates.of("fv")
    for bad in [-1, np.nan, np.inf]:
        with pytest.raises(ValueError, match="^inflation: "):
            detector.candidates(scene, bad)
    with pytest.raises(TypeError, match="^inflation: a number expected, str given"):
        detector.candidates(scene, "far")
    with pytest.raises(ValueError, match=r'^kinds\[1\]: "xx" given'):
        detector.candidates(scene, kinds=["vv", "xx"])
    with pytest.raises(TypeError, match="^kinds: a sequence of names"):
        detector.candidates(scene, kinds=3)


@pytest.mark.parametrize("memory_budget", [None, 1 << 26])
def test_memory_of_candidates_is_used_again_only_once_they_are_gone(memory_budget):
    def listed(candidates):
        return candidates.rows.copy()

    detector = impinge.Detector("cpu", memory_budget=memory_budget)
    scenes = [lattice_step(seed=seed) for seed in range(4)]
    expected = [listed(impinge.Detector("cpu").candidates(scene)) for scene in scenes]
    kept = detector.candidates(scenes[0])
    assert len({len(rows) for rows in expected}) > 1
    for scene, rows in zip(scenes[1:], expected[1:]):
        # Each is dropped when the next one has been found.
        found = detector.candidates(scene)
        assert np.array_equal(listed(found), rows)
        assert len(found) == len(rows)
    assert np.array_equal(listed(kept), expected[0])


def test_candidates_in_runs(detector):
    scene = lattice_step(14, 3)
    question = {"kinds": ["vf", "ee", "ff"], "inflation": 0.25}
    whole = detector.candidates(scene, **question)
    for most in [1000, 2**64 - 1, len(whole), 37]:
        runs = []
        assert detector.candidates_in_runs(scene, runs.append, most=most, **question) == len(whole)
        assert (len(runs) == 1) == (most >= len(whole)) and all(0 < len(run) <= most for run in runs)
        for name in ["kinds", "rows"]:
            assert np.array_equal(np.concatenate([getattr(run, name) for run in runs]), getattr(whole, name))
    with pytest.raises(RuntimeError, match="^the detector is busy"):
        detector.candidates_in_runs(scene, lambda _: detector.candidates(scene))
    with pytest.raises(ZeroDivisionError):
        detector.candidates_in_runs(scene, lambda run: len(run) / 0, most=50, **question)
    with pytest.raises(TypeError, match="^each: a callable expected, int given"):
        detector.candidates_in_runs(scene, 3)
    with pytest.raises(ValueError, match="^most: 0 given, at least 1 candidate per run"):
        detector.candidates_in_runs(scene, print, most=0)
    runs.clear()
    assert detector.candidates_in_runs(scene, runs.append, kinds=()) == 0 and not runs


def test_cells_share_the_pairs_of_a_step(detector):
    scene = lattice_step()
    inf = np.inf
    # Cut at lattice points, where boxes end.
    cells = [[[low, -inf, -inf], [high, inf, inf]] for low, high in [(-inf, 2), (2, 4), (4, inf)]]
    parts = [detector.impacts(scene, owned_by=cell) for cell in cells]
    whole = detector.impacts(scene)
    assert sum(map(len, parts)) == len(whole) and all(map(len, parts))
    assert sum(part.hash for part in parts) % 2**64 == whole.hash
    firsts = [detector.earliest(scene, owned_by=cell) for cell in cells]
    assert min(first.toi for first in firsts) == detector.earliest(scene).toi
    assert not any(detector.is_free(scene, owned_by=cell) for cell in cells)
    rows = [detector.candidates(scene, 0.5, owned_by=np.array(cell)) for cell in cells]
    assert sum(map(len, rows)) == len(detector.candidates(scene, 0.5))
    near = [detector.near(scene, 0.5, owned_by=cell) for cell in cells]
    assert sum(map(len, near)) == len(detector.near(scene, 0.5)) > 0
    for ask in [detector.impacts, detector.earliest, detector.is_free, detector.candidates]:
        with pytest.raises(ValueError, match="^owned_by: "):
            ask(scene, owned_by=[[0, 0, 0], [1, 1, np.nan]])


def test_all_six_kinds(detector):
    scene = lattice_step(12, 3)
    kinds = ["vf", "ee", "ev", "vv", "ef", "ff"]
    everything = detector.candidates(scene, 0.25, kinds=kinds)
    parts = [everything.of(kind) for kind in kinds]
    assert all(map(len, parts)) and np.array_equal(np.concatenate([part.rows for part in parts]), everything.rows)
    assert sum(part.hash for part in parts) % 2**64 == everything.hash
    assert sorted(everything.kinds.tolist()) == everything.kinds.tolist()


@pytest.mark.parametrize("name", ["impacts", "earliest", "is_free", "advance", "candidates"])
def test_bad_questions_are_refused_by_name(detector, falling, name):
    ask = getattr(detector, name)
    for error, words, question in [
        (ValueError, "^between and self_of: two choices", {"between": (0, 1), "self_of": 0}),
        (ValueError, "^self_of: there is no body 5", {"self_of": 5}),
        (ValueError, r"^exclude\[0\]: there is no body 9", {"exclude": [(0, 9)]}),
        (TypeError, "^progress: a callable expected, int given", {"progress": 3}),
        (TypeError, "^cancel: a CancelToken expected, bool given", {"cancel": True}),
    ]:
        with pytest.raises(error, match=words):
            ask(falling, **question)
    with pytest.raises(TypeError, match="^scene: a Scene expected, NoneType given"):
        ask(None)
    with pytest.raises(ValueError, match='^start: "leave" given, "report", "skip", "verify" allowed'):
        ask(falling, start="leave")
    with pytest.raises(ValueError, match='^precision: "f16" given, "f32", "f64" allowed'):
        ask(falling, precision="f16")


@pytest.mark.parametrize("name", ["impacts", "earliest", "is_free", "advance", "candidates"])
def test_questions_are_cancelled_and_other_threads_run_on(name):
    random = np.random.default_rng(1)
    n = 20_000
    scene = impinge.Scene()
    scene.add(random.random((3 * n, 3)), np.arange(3 * n).reshape(n, 3))
    scene.set_end_positions(0, random.random((3 * n, 3)))
    # Free but for the last pair is what takes long: touching at the start is left out here.
    question = {} if name == "candidates" else {"start": "skip"}
    method = "naive" if name in ("earliest", "is_free", "advance") else "clusters"
    detector = impinge.Detector(method=method, backend="cpu", threads=1)
    token, ticks = impinge.CancelToken(), []
    stop = threading.Event()

    def watch():
        while not stop.wait(0.05):
            ticks.append(None)
            if len(ticks) == 4:
                token.cancel()

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        with pytest.raises(impinge.Cancelled):
            getattr(detector, name)(scene, cancel=token, **question)
    finally:
        stop.set()
        thread.join()
    assert len(ticks) >= 4
    scene.remesh(0, FLOOR, FACE)
    assert detector.is_free(scene)
