"""Options of questions: `Query`, the keywords of every question, errors with codes."""

import copy
import pickle

import numpy as np
import pytest

import impinge
from shapes import ACROSS, FACE, TRIANGLE, ball

#: The questions about a choice of pairs, each with what else it is asked.
QUESTIONS = {
    "detect": (),
    "count": (),
    "any": (),
    "impacts": (),
    "earliest": (),
    "is_free": (),
    "advance": (),
    "truncate": (),
    "candidates": (0.1,),
    "near": (0.1,),
    "safe_distances": (0.1,),
    "neighbours": (0.1,),
    "nearest": (),
}
STATIC = ("detect", "count", "any")
STEPS = ("impacts", "earliest", "is_free", "advance", "truncate")
INF = float("inf")
CELL = ([-INF, -INF, -INF], [0.5, INF, INF])


@pytest.fixture(scope="module")
def scene():
    """A ball that another one moves into, and a folded strip."""
    scene = impinge.Scene()
    vertices, faces = ball(8, 12)
    scene.add(vertices, faces)
    scene.add(vertices + np.float32([2.5, 0.1, 0.05]), faces)
    strip = np.array([[5, 0, 0], [7, 0, 0], [5, 2, 0], [6, 1.5, 0]], np.float32)
    scene.add(strip, [[0, 1, 2], [0, 1, 3]])
    scene.set_end_positions(1, vertices + np.float32([1, 0.1, 0.05]))
    return scene


@pytest.fixture(scope="module")
def detector():
    return impinge.Detector("cpu", threads=1)


def value(answer):
    """What can be compared of an answer."""
    if isinstance(answer, impinge.Advance):
        return answer.fraction
    if isinstance(answer, impinge.Truncation):
        return [answer.positions(body).tolist() for body in answer.bodies]
    if isinstance(answer, impinge.Nearest):
        return answer[:5]
    if isinstance(answer, impinge.SafeDistances):
        return [answer.of(body).tolist() for body in range(3)]
    if isinstance(answer, impinge.Neighbours):
        return [column.tolist() for lists in (answer.vf, answer.fv, answer.ee) for column in lists]
    return getattr(answer, "hash", answer) if not isinstance(answer, tuple) else answer


def test_queries_are_values():
    query = impinge.Query(which="self", clearance=1e-4, kinds=("ee", "vf"))
    assert query == impinge.Query(kinds=["vf", "ee"], clearance=np.float64(1e-4), which="self")
    assert hash(query) == hash(impinge.Query(kinds=iter(["vf", "ee"]), clearance=1e-4, which="self"))
    assert query != impinge.Query() and query != "Query" and impinge.Query() == impinge.Query(which="all", start="report")
    assert repr(query) == "Query(which='self', kinds=('vf', 'ee'), clearance=0.0001)"
    assert (query.which, query.clearance, query.clearance_share, query.exclude) == ("self", 1e-4, 0.2, ())
    assert impinge.Query(between=(1, 0)).which is None
    assert "owned_by" in dir(query)
    other = query.replace(kinds=None, of=3, precision="f64")
    assert (other.of, other.which, other.kinds, other.clearance) == (3, None, None, 1e-4)
    assert impinge.Query(exclude=(0, 1)) == impinge.Query(exclude=[(1, 0)]) != impinge.Query(exclude=[(0, 1), (2, 2)])
    assert impinge.Query(owned_by=np.array([[0, 0, 0], [1, 1, 1]])) == impinge.Query(owned_by=((0, 0, 0), (1, 1, 1)))
    for change in [lambda: setattr(query, "start", "skip"), lambda: delattr(query, "start")]:
        with pytest.raises(AttributeError, match="^start: a Query cannot be changed"):
            change()
    with pytest.raises(AttributeError, match="no option 'colour'"):
        query.colour  # noqa: B018


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_queries_pickle(scene, duplicate):
    a, b = scene.bodies[:2]
    query = impinge.Query(between=(a, b), exclude=[(a, a)], owned_by=CELL, distances=True)
    other = duplicate(query)
    assert other == query and repr(other) == repr(query).replace("Body(0)", "0").replace("Body(1)", "1")


@pytest.mark.parametrize(
    "options, error, message",
    [
        ({"which": "none"}, ValueError, '^which: "none" given, "all", "between", "self" allowed'),
        ({"start": 1}, TypeError, "^start: a string expected, int given"),
        ({"colour": "red"}, TypeError, "^colour: no such option, which, between, .* are, each of questions with a use for it"),
        ({"which": "all", "self_of": 0}, ValueError, "^which and self_of: two choices of pairs given"),
        ({"between": (0,)}, ValueError, "^between: two bodies expected, 1 given"),
        ({"separation": "far"}, TypeError, "^separation: a number expected, str given"),
        ({"cancel": impinge.CancelToken()}, TypeError, "^cancel: no part of a Query"),
    ],
)
def test_queries_refused(options, error, message):
    with pytest.raises(error, match=message):
        impinge.Query(**options)


@pytest.mark.parametrize("name", QUESTIONS)
def test_every_question_takes_a_query(scene, detector, name):
    ask = getattr(detector, name)
    more = QUESTIONS[name]
    query = impinge.Query(between=(0, 1), start="skip", clearance=0.25)
    expected = value(ask(scene, *more, between=(0, 1), start="skip", clearance=0.25))
    assert value(ask(scene, *more, query=query)) == expected
    # A keyword overrides the query; one choice of pairs takes the place of all.
    other = impinge.Query(which="self", clearance=7.0)
    asked = {"query": other, "between": (0, 1), "start": "skip", "clearance": 0.25}
    assert value(ask(scene, *more, **asked)) == expected
    assert value(ask(scene, *more, query=None, cancel=None, **{"between": (0, 1), "start": "skip", "clearance": 0.25})) == expected
    with pytest.raises(TypeError, match="^betwen: no such option, which, between, self_of, of, kinds, "):
        ask(scene, *more, betwen=(0, 1))
    with pytest.raises(TypeError, match="^query: a Query expected, dict given"):
        ask(scene, *more, query={"between": (0, 1)})


#: Options about which pairs, and the questions that refuse them, with what they say.
WHICH = {
    "which": ("self", {"nearest": "query: self-collision"}),
    "between": ((0, 1), {}),
    "self_of": (2, {"nearest": "query: self-collision"}),
    "of": (1, {"nearest": "query: self-collision"}),
    "kinds": (("ee",), dict.fromkeys((*STATIC, "nearest"), "kinds: ")),
    "exclude": ([(0, 1), (2, 2)], {}),
    "owned_by": (CELL, dict.fromkeys(("advance", "truncate", "nearest"), "owned_by: ")),
}
HOW = {
    "shared_vertex": "skip",
    "start": "skip",
    "separation": 0.1,
    "clearance": 0.1,
    "clearance_share": 0.5,
    "precision": "f64",
    "distances": True,
    "closest_points": True,
}


@pytest.mark.parametrize("name", QUESTIONS)
@pytest.mark.parametrize("option", WHICH)
def test_what_a_question_cannot_honour_is_refused_by_name(scene, detector, name, option):
    given, refused = WHICH[option]
    ask = getattr(detector, name)
    if name in refused:
        with pytest.raises(impinge.InvalidError, match=f"^{refused[name]}"):
            ask(scene, *QUESTIONS[name], **{option: given})
        return
    answer = ask(scene, *QUESTIONS[name], **{option: given})
    naive = getattr(impinge.Detector("cpu", method="naive"), name)
    assert value(answer) == value(naive(scene, *QUESTIONS[name], **{option: given}))


@pytest.mark.parametrize("name", QUESTIONS)
@pytest.mark.parametrize("option", HOW)
def test_what_a_question_has_no_use_for_is_ignored(scene, detector, name, option):
    ask = getattr(detector, name)
    asked = {"which": "between"} if name in ("detect", "nearest") else {}
    plain = value(ask(scene, *QUESTIONS[name], **asked))
    given = value(ask(scene, *QUESTIONS[name], **asked, **{option: HOW[option]}))
    if name not in STEPS and not (name in STATIC and option == "shared_vertex"):
        assert given == plain


def test_choices_of_pairs(scene, detector):
    def rows(**options):
        return {tuple(row) for row in detector.near(scene, 2.0, **options).rows.tolist()}

    everything = rows()
    assert everything == rows(which="all") and len(everything) > 1000
    by_bodies = {
        "between": {row for row in everything if row[0] != row[2]},
        "self": {row for row in everything if row[0] == row[2]},
    }
    for which, expected in by_bodies.items():
        assert rows(which=which) == expected and expected
    assert rows(between=(1, 0)) == {row for row in everything if {row[0], row[2]} == {0, 1}}
    assert rows(self_of=1) == {row for row in everything if row[0] == row[2] == 1}
    assert rows(of=1) == {row for row in everything if 1 in (row[0], row[2])}
    assert rows(exclude=(0, 0)) == {row for row in everything if row[0] or row[2]}
    # The folded strip meets itself: by default, that counts.
    assert detector.any(scene) and not detector.any(scene, which="between")


@pytest.mark.parametrize("name", ["distance", "contacts", "penetration"])
def test_other_questions_take_control_alone(scene, detector, name):
    pairs = detector.detect(scene)
    contacts = detector.contacts(scene, pairs)
    more = {"distance": (0, 1), "contacts": (pairs,), "penetration": (contacts, 0, 1)}[name]
    ask = getattr(detector, name)
    ask(scene, *more, cancel=impinge.CancelToken(), progress=print)
    for options in [{"which": "all"}, {"query": impinge.Query()}]:
        [option] = options
        with pytest.raises(TypeError, match=f"^{option}: no such option, cancel, progress allowed"):
            ask(scene, *more, **options)
    with pytest.raises(TypeError, match="^cancel: a CancelToken expected, int given"):
        ask(scene, *more, cancel=1)


def test_a_control_holds_for_one_question(scene, detector):
    token = impinge.CancelToken()
    token.cancel()
    assert token.is_cancelled
    for name, more in QUESTIONS.items():
        with pytest.raises(impinge.Cancelled):
            getattr(detector, name)(scene, *more, cancel=token)
        getattr(detector, name)(scene, *more)


def test_errors_have_codes(scene):
    assert issubclass(impinge.Error, Exception)
    body = impinge.Scene().add(TRIANGLE, FACE)
    token = impinge.CancelToken()
    token.cancel()
    for code, kind, ask in [
        ("invalid", ValueError, lambda: impinge.Detector("cpu", threads=-1)),
        ("invalid", ValueError, lambda: scene.positions(body)),
        ("invalid", ValueError, lambda: scene.set_positions(0, [[0, 0, np.nan]])),
        ("invalid", ValueError, lambda: impinge.read("a.unknown")),
        ("budget", MemoryError, lambda: impinge.Detector("cpu", memory_budget=10).detect(scene)),
        ("too_many_pairs", Exception, lambda: impinge.Detector("cpu", max_pairs=0).detect(scene)),
        ("cancelled", Exception, lambda: impinge.Detector("cpu").count(scene, cancel=token)),
        ("device", RuntimeError, lambda: impinge.Detector("gpu", device="no such adapter")),
    ]:
        with pytest.raises(impinge.Error) as raised:
            ask()
        assert raised.value.code == code and isinstance(raised.value, kind), raised.value
        assert type(raised.value).__module__ == "impinge"


def test_answers_are_made_once_and_cannot_be_written(detector):
    scene = impinge.Scene()
    scene.add(TRIANGLE, FACE), scene.add(ACROSS, FACE)
    pairs = detector.detect(scene)
    assert pairs.rows is pairs.rows is np.asarray(pairs) and not pairs.rows.flags.writeable
    assert pairs.rows.tolist() == [[0, 0, 1, 0]] == [list(row) for row in pairs]
    candidates = detector.candidates(scene)
    assert candidates.rows is candidates.rows and not candidates.rows.flags.writeable
    before = pairs.rows.copy()
    scene.set_positions(1, ACROSS + np.float32(9))
    assert len(detector.detect(scene)) == 0
    assert np.array_equal(pairs.rows, before)
    assert detector.stats.n_candidates == 0 and isinstance(detector.stats, impinge.Stats)


def test_end_positions_are_forgotten_by_none(scene):
    end = scene.end_positions(1)
    other = copy.copy(scene)
    other.set_end_positions(1, None)
    assert other.end_positions(1) is None and np.array_equal(scene.end_positions(1), end)
