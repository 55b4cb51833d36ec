"""What happens across processes: Ctrl-C, forks, spawned workers."""

import os
import signal
import subprocess
import sys
import time

import pytest

import impinge
from shapes import ball, soup

# Large triangles that all overlap: minutes of work for every method.
LONG_RUN = """
import numpy as np, impinge, sys
random = np.random.default_rng(1)
n = 200_000
vertices = random.random((3 * n, 3))
faces = np.arange(3 * n).reshape(n, 3)
scene = impinge.Scene()
body = scene.add(vertices, faces)
detector = impinge.Detector(method=sys.argv[1], threads=int(sys.argv[2]))
print("ready", flush=True)
try:
    detector.detect(scene, self_of=body)
except KeyboardInterrupt:
    scene.remesh(body, vertices[:300], faces[:100])
    again = detector.detect(scene, self_of=body)
    oracle = impinge.self_pairs(vertices[:300], faces[:100], method="naive")
    assert len(oracle) and np.array_equal(again.self_of(body), oracle)
    print("interrupted and usable", flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind are POSIX")
@pytest.mark.parametrize("threads", ["1", "2"])
@pytest.mark.parametrize("method", ["clusters", "cells", "naive"])
def test_ctrl_c(method, threads):
    child = subprocess.Popen(
        [sys.executable, "-c", LONG_RUN, method, threads],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert child.stdout.readline() == "ready\n"
        time.sleep(0.7)
        assert child.poll() is None, "the run was over before it could be interrupted"
        start = time.monotonic()
        child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=60)
        took = time.monotonic() - start
    finally:
        child.kill()
        child.communicate()
    # What a graphics driver may have to say on stderr is its own affair.
    assert (child.returncode, out) == (0, "interrupted and usable\n"), err
    assert took < 20


HANDLER = """
import signal, numpy as np, impinge
class Enough(Exception): pass
def handler(*_): raise Enough
signal.signal(signal.SIGALRM, handler)
random = np.random.default_rng(1)
scene = impinge.Scene()
scene.add(random.random((90_000, 3)), np.arange(90_000).reshape(-1, 3))
signal.setitimer(signal.ITIMER_REAL, 0.2)
try:
    impinge.Detector(method="naive").detect(scene, self_of=0)
    print("ran to the end")
except Enough:
    print("enough")
"""


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="no SIGALRM here")
def test_handlers_of_the_user_run():
    out = subprocess.run(
        [sys.executable, "-c", HANDLER], capture_output=True, text=True, timeout=120
    )
    assert (out.stdout, out.stderr) == ("enough\n", "")


FORK = """
import os, sys, impinge
corners, face = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
if sys.argv[1] == "late":
    impinge.pairs(corners, face, corners, face)
child = os.fork()
if child == 0:
    try:
        print(len(impinge.pairs(corners, face, corners, face)), flush=True)
    except RuntimeError as error:
        print(error, flush=True)
    os._exit(0)
os.waitpid(child, 0)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.parametrize("when", ["early", "late"])
def test_forks(when):
    out = subprocess.run(
        [sys.executable, "-c", FORK, when], capture_output=True, text=True, timeout=60
    )
    assert out.stdout == "1\n", out


def count(shift):
    vertices, faces = ball()
    return len(impinge.pairs(vertices, faces, vertices + vertices.dtype.type(shift), faces))


def test_spawned_workers():
    code = (
        "import sys, multiprocessing; sys.path.insert(0, sys.argv[1])\n"
        "from test_processes import count\n"
        "if __name__ == '__main__':\n"
        "    with multiprocessing.get_context('spawn').Pool(2) as pool:\n"
        "        print(pool.map(count, [0.25, 0.5, 9]))\n"
    )
    here = os.path.dirname(__file__)
    out = subprocess.run(
        [sys.executable, "-c", code, here], capture_output=True, text=True, timeout=120
    )
    assert out.stdout == f"{[count(0.25), count(0.5), 0]}\n", out


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="affinities are set on Linux only")
def test_affinity_of_helper_threads():
    def helpers(before):
        """The threads started since, by their names: helpers, not those of the pool for clustering."""
        for thread in set(os.listdir("/proc/self/task")) - before:
            with open(f"/proc/self/task/{thread}/comm") as name:
                if name.read().strip() in ("impinge-1", "impinge-2"):
                    yield int(thread)

    scene = impinge.Scene()
    for seed in range(2):
        scene.add(*soup(20_000, 0.05, seed))
    everywhere = os.sched_getaffinity(0)
    answers = set()
    for affinity, n_left_out in [("auto", min(1, len(everywhere) - 1)), ("inherited", 0)]:
        before = set(os.listdir("/proc/self/task"))
        detector = impinge.Detector("cpu", method="clusters", threads=3, affinity=affinity)
        deadline = time.monotonic() + 60
        n_each = None
        while n_each != 2 * [n_left_out]:
            assert time.monotonic() < deadline, n_each
            answers.add(detector.detect(scene).hash)
            n_each = [len(everywhere - os.sched_getaffinity(thread)) for thread in helpers(before)]
        # Later frames change nothing.
        for _ in range(10):
            answers.add(detector.detect(scene).hash)
            for thread in helpers(before):
                assert len(everywhere - os.sched_getaffinity(thread)) == n_left_out
    assert len(answers) == 1


# Every question, on enough that each would use threads.
QUESTIONS = """
import os, signal, sys, numpy as np, impinge
random = np.random.default_rng(2)
turn = np.linspace(0, 2 * np.pi, 120, endpoint=False)
high = np.linspace(0, np.pi, 60)[1:-1]
ring = np.stack([np.cos(turn), np.sin(turn)], 1)
ball = np.concatenate([[[0, 0, 1.0]]] + [np.c_[np.sin(h) * ring, np.full(120, np.cos(h))] for h in high]
                      + [[[0, 0, -1.0]]])
n = len(high)
faces = []
for j in range(120):
    k = (j + 1) % 120
    faces.append([0, 1 + j, 1 + k])
    faces.append([len(ball) - 1, 1 + (n - 1) * 120 + k, 1 + (n - 1) * 120 + j])
    for i in range(n - 1):
        a, b = 1 + i * 120, 1 + (i + 1) * 120
        faces += [[a + j, b + j, b + k], [a + j, b + k, a + k]]
scene = impinge.Scene()
a, b, c = (scene.add(ball + [x, 0.03, 0], faces) for x in (0, 0.5, 5))
for body, x in [(a, 0), (c, 5)]:
    scene.set_end_positions(body, ball + [x + 0.02, 0.03, 0.01])

def questions(detector):
    pairs = detector.detect(scene)
    contacts = detector.contacts(scene, pairs)
    yield "detect", lambda **control: pairs.hash and detector.detect(scene, **control).hash
    yield "count", lambda **control: detector.count(scene, **control)
    yield "any", lambda **control: detector.any(scene, **control)
    yield "impacts", lambda **control: detector.impacts(scene, between=(a, b), **control).hash
    yield "earliest", lambda **control: detector.earliest(scene, **control).toi
    yield "is_free", lambda **control: detector.is_free(scene, **control)
    yield "advance", lambda **control: detector.advance(scene, between=(a, c), **control).fraction
    yield "candidates", lambda **control: detector.candidates(scene, between=(a, b), **control).hash
    yield "near", lambda **control: detector.near(
        scene, 0.001, which="between", distances=True, **control).hash
    yield "distance", lambda **control: detector.distance(scene, a, c, **control).distance
    yield "nearest", lambda **control: detector.nearest(scene, across=[c], **control).distance
    yield "contacts", lambda **control: detector.contacts(scene, pairs, **control).points.tobytes()
    yield "penetration", lambda **control: detector.penetration(
        scene, contacts, a, b, **control).volume

def answers(threads):
    return [ask() for _, ask in questions(impinge.Detector("cpu", threads=threads))]
"""


def run(code):
    out = subprocess.run(
        [sys.executable, "-c", QUESTIONS + code], capture_output=True, text=True, timeout=120
    )
    assert (out.returncode, out.stdout) == (0, "good\n"), out


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="threads are counted on Linux only")
def test_one_thread_is_one_thread():
    run(
        "before = len(os.listdir('/proc/self/task'))\n"
        "answers(1)\n"
        "assert len(os.listdir('/proc/self/task')) == before\n"
        "print('good')\n"
    )


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_every_question_in_a_fork():
    run(
        "expected = answers(None)\n"
        "assert answers(2) == expected\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    signal.alarm(60)\n"
        "    os._exit(0 if answers(None) == expected == answers(2) else 1)\n"
        "assert os.waitpid(child, 0)[1] == 0\n"
        "print('good')\n"
    )


def test_every_question_is_cancelled():
    run(
        "for name, ask in questions(impinge.Detector(backend='cpu', threads=2)):\n"
        "    token = impinge.CancelToken()\n"
        "    token.cancel()\n"
        "    expected = ask()\n"
        "    try:\n"
        "        ask(cancel=token)\n"
        "        assert False, name\n"
        "    except impinge.Cancelled:\n"
        "        assert ask() == expected, name\n"
        "    def stop(done, total):\n"
        "        raise KeyError(name)\n"
        "    try:\n"
        "        ask(progress=stop)\n"
        "    except KeyError as error:\n"
        "        assert error.args == (name,)\n"
        "    assert ask() == expected, name\n"
        "print('good')\n"
    )
