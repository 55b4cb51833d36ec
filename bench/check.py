"""`impinge check` beside trimesh, Open3D, MeshLab and libigl (CGAL) on a few thousand meshes, and whose answers are right.

    python bench/check.py                                  # looks for target/release/impinge
    python bench/check.py --files 500 --peers Trimesh,Libigl
    python bench/check.py --record --machine "My machine"

It installs nothing: it names missing peers and what to install. Real meshes come from $IMPINGE_DATA or ../shared/data; without
them all meshes are generated.

Timing: contestants read the same files, one after another, and answer the same questions as far as they have them:
self-intersections, degenerate and duplicate faces, edges of more than two faces and of one, connected pieces. Each runs on one
core, peers with one thread in one process, impinge with one worker. Times are processor time, user and system. A peer's time
is the sum over the files that it answered: reading, welding, asking; not its start and not its imports. The time of impinge is
the whole run with its child process, on the very files that the peer answered. A peer that crashes or takes too long loses that
file, not the run.

Checks: counts of impinge are compared with `check_truth.counts` on every file. Pairs (MeshLab: faces) of each peer are compared
with those of impinge as sets, and what only one of the two has is decided in rational arithmetic (`check_truth.judged`):

- another definition: a self-intersection that the peer's own definition leaves out (see `check_peers.py`);
- peer misses a true one: a self-intersection that its definition includes;
- peer reports a false one: the two triangles share nothing but their common vertices.

Besides, in every file all pairs of a few random faces are decided, whatever contestants say.

A count of a peer that is not the exact one is compared with the counts under other definitions (`Definitions`), and the first
that gives the same number is named. The run fails if impinge is wrong anywhere.
"""

import argparse
import collections
import concurrent.futures
import datetime
import json
import os
import pathlib
import platform
import re
import subprocess
import sys
import tempfile
import time

import numpy as np

import check_dataset
import check_truth
from check_peers import PEERS, Child

ROOT = pathlib.Path(__file__).resolve().parents[1]
#: What a row of `impinge check` and a peer both count.
QUESTIONS = ["degenerate", "duplicate_faces", "non_manifold_edges", "boundary_edges", "components"]
PEERS_BY_LABEL = {peer.label: peer for peer in PEERS.values()}
#: The class of self-intersections of faces that the peer has not read.
DROPPED = "another definition: the reader drops the face"
#: Pairs per file that are decided whatever contestants say: in hostile files, and in others.
SAMPLED = (100, 10)
#: Differences of one peer in one file that are decided at most, on either side.
MOST_DECIDED = 20_000


def machine():
    """The processor's name and its number of threads."""
    model = platform.processor() or platform.machine()
    try:
        model = re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())[1]
    except (OSError, TypeError):
        pass
    return f"{model}, {os.cpu_count()} threads, {platform.system()}"


class Ours:
    """The program, on one core."""

    def __init__(self, program, core, folder):
        self.program, self.core, self.folder = program, core, folder
        self.version = self.output("--version")[0].split()[-1]

    def output(self, *arguments):
        """What the program prints, and its processor and wall seconds with those of its children."""
        pin = (lambda: os.sched_setaffinity(0, {self.core})) if self.core is not None else None
        began = time.perf_counter()
        with tempfile.TemporaryFile("w+") as printed:
            process = subprocess.Popen([self.program, *arguments], stdout=printed, preexec_fn=pin)
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode:
                raise RuntimeError(f"{self.program} {' '.join(arguments)}: exit code {process.returncode}")
            printed.seek(0)
            return printed.read(), used.ru_utime + used.ru_stime, time.perf_counter() - began

    def check(self, files):
        """Rows, processor seconds, wall seconds."""
        listed = self.folder / "list.txt"
        listed.write_text("".join(f"{file.path}\n" for file in files))
        text, processor, wall = self.output(
            "check", "--list", str(listed), "--json", "--jobs", "1", "--no-progress", "--timeout", "60"
        )
        return [json.loads(line) for line in text.splitlines()], processor, wall

    def pairs(self, files):
        """The self-intersections of each file: a list of arrays (n, 2)."""
        rows = self.folder / "pairs.npy"
        paths = [str(file.path) for file in files]
        self.output("self", *paths, "--pairs", str(rows), "--no-progress", "--json")
        rows = np.load(rows)
        return [rows[rows[:, 0] == body][:, [1, 3]].astype(np.int64) for body in range(len(files))]


def ask_peer(name, files, folder, core, seconds):
    """The answers of one peer to all files; None if it is missing."""
    child, answers = Child(name, core), []
    spent = time.perf_counter()
    for ix, file in enumerate(files):
        question = {
            "path": str(file.path),
            "corners": str(folder / f"{name}-{ix}-corners.npy"),
            "found": str(folder / f"{name}-{ix}-found.npy"),
        }
        answer = child.ask(question, seconds)
        if "missing" in answer:
            return None
        if "seconds" in answer and file.is_good:
            answer["files"] = question
        else:
            answer.pop("found", None)
        answers.append(answer)
    child.end()
    print(f"{name}: {len(files)} files, {time.perf_counter() - spent:.0f} s", file=sys.stderr)
    return answers


def loaded(path):
    """An array that a child has left, or None; the file is removed."""
    path = pathlib.Path(path)
    if not path.is_file():
        return None
    array = np.load(path)
    path.unlink()
    return array


def numbering(corners, file):
    """For each face that a peer read, the number of the face in the file; and what is different. None if it cannot be said."""
    ours = file.vertices[file.faces].astype(np.float64)
    if corners is None or corners.shape[1:] != (3, 3):
        return None, "no faces to compare"
    if corners.shape == ours.shape and np.array_equal(corners, ours):
        return np.arange(len(ours)), None
    if corners.shape == ours.shape:
        return np.arange(len(ours)), "reads other coordinates"
    # A reader that drops faces keeps the order of the others.
    numbers, ix = [], 0
    keys = [face.tobytes() for face in np.sort(ours + 0.0, axis=1)]
    for face in np.sort(corners + 0.0, axis=1):
        key = face.tobytes()
        while ix < len(keys) and keys[ix] != key:
            ix += 1
        if ix == len(keys):
            return None, "reads other faces"
        numbers.append(ix)
        ix += 1
    return np.array(numbers, np.int64), "drops faces while reading"


def as_set(pairs):
    return set(map(tuple, np.sort(np.asarray(pairs).reshape(-1, 2), axis=1).tolist()))


def collect(peer, answer, file, ours):
    """What a peer says of one file, in the numbers of the file: its counts, and what only one of it and impinge has."""
    corners, found = loaded(answer["files"]["corners"]), loaded(answer["files"]["found"])
    numbers, reading = numbering(corners, file)
    said = {"label": peer.label, "reading": reading, "numbers": numbers, "counts": answer["counts"]}
    if peer.finds and found is not None and numbers is not None:
        if peer.finds == "faces":
            mine = set(ours.ravel().tolist())
            theirs = set(numbers[np.asarray(found, bool)].tolist())
        else:
            mine = as_set(ours)
            theirs = as_set(numbers[found] if len(found) else [])
        said |= {"only ours": sorted(mine - theirs), "only theirs": sorted(theirs - mine)}
    return said


def decide(file, pairs, truth, said):
    """Decides all differences of one file. For each peer: {class: (number, example)}, and {question: the definition or same}."""
    judge = check_truth.Judge(file.vertices, file.faces)
    partners, other, decided = None, {}, []
    for one in said:
        peer = PEERS_BY_LABEL[one["label"]]
        tally = collections.Counter()
        examples = {}
        read = set() if one["numbers"] is None else set(one["numbers"].tolist())
        for side in ["only ours", "only theirs"]:
            items = one.get(side, [])
            for item in items[:MOST_DECIDED]:
                if not read.issuperset([item] if peer.finds == "faces" else item):
                    tally[DROPPED] += 1
                    examples.setdefault(DROPPED, item)
                    continue
                if peer.finds == "pairs":
                    judged = [judge.pair(*item)]
                elif side == "only theirs":
                    judged = [judge.pair(item, beside) for beside in judge.near(item)]
                else:
                    partners = partners or partners_of(pairs)
                    judged = [judge.pair(item, beside) for beside in partners[item]]
                key = classified(peer, side, judged, one["reading"])
                tally[key] += 1
                examples.setdefault(key, item)
            if len(items) > MOST_DECIDED:
                tally[f"not decided (beyond {MOST_DECIDED:,} per file)"] += len(items) - MOST_DECIDED
        definitions = {}
        for question, theirs in one["counts"].items():
            if theirs == truth[question]:
                definitions[question] = ("same", None)
                continue
            drops = one["reading"] == "drops faces while reading"
            if drops not in other:
                faces = file.faces[one["numbers"]] if drops else file.faces
                other[drops] = Definitions(file.vertices, faces)
            name = other[drops].that_gives(question, theirs)
            words = [*(["the reader drops faces"] if drops else []), *([name] if name != "exact" else [])]
            example = f"{theirs}, exact {truth[question]}"
            definitions[question] = ("; ".join(words) if name else "unexplained", example)
        decided.append({"label": one["label"], "classes": dict(tally), "examples": examples, "definitions": definitions})
    return file.path.name, decided, sampled(file, pairs, judge)


def sampled(file, pairs, judge):
    """Decides all pairs of random faces. Returns how many pairs, and where impinge is wrong, as sentences."""
    budget = SAMPLED[file.kind not in check_dataset.HOSTILE_KINDS]
    held, wrong, n = as_set(pairs), [], 0
    for face in np.random.default_rng(len(file.faces)).permutation(len(file.faces)).tolist():
        for other in judge.near(face):
            pair = (min(face, other), max(face, other))
            n += 1
            is_true, kind = judge.pair(*pair)
            if is_true != (pair in held):
                wrong.append(f"{file.path.name}: {pair} is {kind}, and impinge {'lacks' if is_true else 'has'} it")
        if n >= budget:
            break
    return n, wrong


def partners_of(pairs):
    """The faces that each face meets."""
    partners = collections.defaultdict(list)
    for a, b in pairs.tolist():
        partners[a].append(b)
        partners[b].append(a)
    return partners


def classified(peer, side, judged, reading):
    """The class of a pair that only one of the two has, or of a face, whose pairs are all in `judged`."""
    kinds = [kind for is_true, kind in judged if is_true]
    # The plainest of the pairs that the peer's definition includes, else of all.
    counted = [kind for kind in kinds if kind not in peer.leaves_out]
    kind = min(counted or kinds, key=check_truth.KINDS.index) if kinds else None
    if side == "only theirs" and kinds:
        return f"IMPINGE misses a true one: {kind}"
    if side == "only ours" and not kinds:
        return f"IMPINGE reports a false one: {judged[0][1]}"
    rounds = "; its reader rounds" if reading == "reads other coordinates" else ""
    if not kinds:
        kind = judged[0][1] if peer.finds == "pairs" else "a face that meets none"
        if peer.finds == "faces" and any("zero area" in kind for _, kind in judged):
            kind += ", beside one of zero area"
        return f"peer reports a false one: {kind}{rounds}"
    if not counted:
        return f"another definition: {kind}"
    return f"peer misses a true one: {kind}{rounds}"


class Definitions:
    """Counts of one mesh under other definitions than those of impinge."""

    def __init__(self, vertices, faces):
        self.vertices, self.corners = check_truth.weld(vertices, faces)
        self.is_thin = check_truth.has_zero_area(self.vertices, self.corners)
        # Vertices on a grid, as trimesh welds them: 64-bit integers, which coordinates beyond 9.2e10 do not fit.
        grid = np.round(vertices.astype(np.float64) * 1e8)
        self.grid = "on a grid of 1e-8" if np.abs(grid).max() < 2**63 else "on a grid of 1e-8 that overflows"
        with np.errstate(invalid="ignore"):
            self.near = check_truth.weld(grid.astype(np.int64), faces)[1]
        first, second, third = np.moveaxis(vertices[faces].astype(np.float64), 1, 0)
        lengths = [np.linalg.norm(end - first, axis=1) for end in (second, third)]
        self.is_short = np.minimum(*lengths) <= 1e-8

    def surfaces(self):
        """The same mesh as others see it."""
        corners, near, thin = self.corners, self.near, self.is_thin
        simple = corners[~check_truth.names_one_twice(corners)]
        yield "exact", simple
        yield "faces that name a vertex twice count", corners
        yield "faces of zero area left out", corners[~thin]
        yield "duplicate faces left out", check_truth.first_of_each(simple)
        yield "duplicate and zero-area faces left out", check_truth.first_of_each(corners[~thin])
        yield f"vertices welded {self.grid}", near[~check_truth.names_one_twice(near)]
        yield f"vertices welded {self.grid}; faces that name a vertex twice count", near

    def counts(self, question):
        """Names of definitions and the counts under them."""
        if question == "degenerate":
            first, twice = check_truth.first_of_each, check_truth.names_one_twice
            yield "exact", int(self.is_thin.sum())
            yield "only a vertex named twice", int(twice(self.corners).sum())
            is_near = self.is_thin | twice(self.near)
            yield f"vertices welded {self.grid}", int(is_near.sum())
            yield f"edges of at most 1e-8, vertices welded {self.grid}", int((is_near | self.is_short).sum())
            yield "once duplicates are removed", len(first(self.corners)) - len(first(self.corners[~self.is_thin]))
            return
        for name, faces in self.surfaces():
            if question == "duplicate_faces":
                yield name, len(faces) - len(check_truth.first_of_each(faces))
                yield f"turned over is no duplicate; {name}", len(faces) - len(check_truth.first_of_each(faces, True))
            elif question == "components":
                yield name, check_truth.components(faces)
                yield f"pieces end at edges of more than two faces; {name}", check_truth.components(faces, "edges of two")
                yield f"pieces share vertices; {name}", check_truth.components(faces, "vertices")
            else:
                n_faces = check_truth.edges_of(faces)[0] if len(faces) else np.zeros(0, int)
                if question == "boundary_edges":
                    yield name, int((n_faces == 1).sum())
                else:
                    yield name, int((n_faces > 2).sum())
                    yield f"counted once per face; {name}", int(n_faces[n_faces > 2].sum())

    def that_gives(self, question, count):
        """The first definition with this count, or None."""
        names = (name for name, n in self.counts(question) if n == count)
        name = next(names, None)
        return name and name.removesuffix("; exact")


def outcome(answer):
    """What a contestant says about a file that cannot be checked."""
    if answer is None:
        return "not asked"
    if "failed" in answer:
        return answer["failed"]
    if "seconds" not in answer:
        return "error"
    return "error" if answer["errors"] else "counts"


def number(x):
    return f"{x:,.0f}" if x >= 100 else f"{x:.2g}" if x < 10 else f"{x:.0f}"


def speed_table(rows):
    lines = [
        "| | files | triangles | read, s | counts, s | self-intersections, s | all, s | meshes/s | triangles/s | impinge on the same files, s | times impinge | lost |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---|",
    ]
    for row in rows:
        steps = [f"{row['steps'][step]:.2f}" if step in row["steps"] else "" for step in ["read", "counts", "self"]]
        seconds = row["seconds"]
        cells = [row["contender"], f"{row['files']:,}", f"{row['triangles']:,}", *steps, f"{seconds:.2f}"]
        cells += [f"{row['files'] / seconds:,.0f}", f"{row['triangles'] / seconds:,.0f}"]
        cells += [f"{row['ours']:.2f}", f"{seconds / row['ours']:.1f}", row["lost"]]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def broken_table(files, columns):
    """What contestants say about files that hold no mesh which could be checked."""
    lines = ["| files with | " + " | ".join(columns) + " |", "|---|" + "---|" * len(columns)]
    for kind in check_dataset.BROKEN:
        cells = [kind]
        for answers in columns.values():
            said = collections.Counter(outcome(answers.get(file.path)) for file in files if file.kind == kind)
            cells.append(", ".join(f"{word} {n}" for word, n in said.most_common()))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def self_table(compared):
    lines = [
        "| | files compared | the same | difference | pairs or faces | files | for example |",
        "|---|---:|---:|---|---:|---:|---|",
    ]
    for label, (agree, classes) in compared.items():
        head = [label, f"{agree['files']:,}", f"{agree['same']:,}"]
        for name, entry in classes.items() or [("none", {"n": 0, "files": 0, "example": ""})]:
            cells = [*head, name, f"{entry['n']:,}", f"{entry['files']:,}", entry["example"]]
            lines.append("| " + " | ".join(cells) + " |")
            head = ["", "", ""]
        for name, n in agree["reader"].items():
            lines.append(f"| | | | (reader: {name}) | | {n:,} | |")
    return "\n".join(lines)


def summary_table(compared):
    """The classes of differences, added up by who is right."""
    ends = {
        "another definition": "another definition",
        "peer misses": "misses true ones",
        "peer reports": "reports false ones",
    }
    ends |= {"not decided": "not decided", "IMPINGE": "impinge is wrong"}
    lines = ["| | files | the same | " + " | ".join(ends.values()) + " |", "|---|---:|---:" + "|---:" * len(ends) + "|"]
    for label, (agree, classes) in compared.items():
        cells = [label, f"{agree['files']:,}", f"{agree['same']:,}"]
        for end in ends:
            cells.append(f"{sum(entry['n'] for name, entry in classes.items() if name.startswith(end)):,}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def counts_table(compared):
    lines = [
        "| | question | files | the same | another definition, and which | unexplained | for example |",
        "|---|---|---:|---:|---|---:|---|",
    ]
    for label, (tallies, examples) in compared.items():
        for question, tally in tallies.items():
            n = sum(tally.values())
            if not n:
                continue
            names = [name for name, _ in tally.most_common() if name not in ["same", "unexplained"]]
            others = "; ".join(f"{tally[name]:,} {name}" for name in names)
            shown = [examples[question, name] for name in ["unexplained", *names] if (question, name) in examples]
            cells = [label, question, f"{n:,}", f"{tally['same']:,}", others, f"{tally['unexplained']:,}"]
            lines.append("| " + " | ".join([*cells, shown[0] if shown else ""]) + " |")
    return "\n".join(lines)


def compare(files, pairs, truths, said):
    """Decides all differences, on all cores. Returns for each peer: how many files agree and the classes of differences; how many
    files agree in each question, or under which definition; how many pairs were sampled, and errors of impinge among them."""
    began = time.perf_counter()
    selves, counted, n_sampled, wrong = {}, {}, 0, []
    for file in files:
        for one in said[file.path]:
            label = one["label"]
            counted.setdefault(label, ({question: collections.Counter() for question in QUESTIONS}, {}))
            if PEERS_BY_LABEL[label].finds:
                empty = {"files": 0, "same": 0, "reader": collections.Counter()}
                agree, _ = selves.setdefault(label, (empty, {}))
                agree["files"] += "only ours" in one
                agree["same"] += one.get("only ours") == one.get("only theirs") == []
                if one["reading"]:
                    agree["reader"][one["reading"]] += 1
    with concurrent.futures.ProcessPoolExecutor() as pool:
        tasks = [
            pool.submit(decide, file, pairs[file.path], truths[file.path], said[file.path])
            for file in sorted(files, key=lambda file: -len(file.faces))
        ]
        for task in tasks:
            name, decided, (n, errors) = task.result()
            n_sampled += n
            wrong += errors
            for one in decided:
                for key, n in one["classes"].items():
                    classes = selves[one["label"]][1]
                    entry = classes.setdefault(
                        key, {"n": 0, "files": 0, "example": f"{name}: {one['examples'].get(key, '')}"}
                    )
                    entry["n"] += n
                    entry["files"] += 1
                tallies, examples = counted[one["label"]]
                for question, (definition, example) in one["definitions"].items():
                    tallies[question][definition] += 1
                    if example:
                        examples.setdefault((question, definition), f"{name}: {example}")
    print(f"compared in {time.perf_counter() - began:.0f} s", file=sys.stderr)
    return (
        {label: (agree, dict(sorted(classes.items()))) for label, (agree, classes) in selves.items()},
        counted,
        n_sampled,
        wrong,
    )


def check_ours(rows, files, truths, pairs):
    """Where the rows of impinge differ from the truth, as sentences."""
    wrong = []
    for row, file in zip(rows, files):
        if not file.is_good:
            if not row["error"] and file.kind != "no faces":
                wrong.append(f"{file.path.name}: counts of a file with {file.kind}")
            continue
        if row["error"]:
            wrong.append(f"{file.path.name}: {row['error']}")
            continue
        for key, value in truths[file.path].items():
            if row[key] != value:
                wrong.append(f"{file.path.name}: {key} is {row[key]}, not {value}")
        found = pairs[file.path]
        held = [row["triangles"], row["self_intersections"], row["intersecting_primitives"]]
        if held != [len(file.faces), len(found), len(np.unique(found))]:
            wrong.append(f"{file.path.name}: `check` and `self` differ: {held}, {len(found)} pairs")
    return wrong


def row_of(label, files, seconds, wall, ours, steps=(), lost=()):
    """A row of the first table, and of the record."""
    return {
        "contender": label,
        "files": len(files),
        "triangles": sum(len(file.faces) for file in files if file.is_good),
        "seconds": seconds,
        "wall": wall,
        "ours": ours,
        "steps": dict(steps),
        "lost": ", ".join(f"{n} {word}" for word, n in dict(lost).items()),
    }


def contest(name, files, ours, arguments, core, scratch):
    """One peer on all files that it is asked about: files, answers, and its row; None if it is missing."""
    peer = PEERS[name]
    chosen = [file for file in files if not peer.most or not file.is_good or len(file.faces) <= peer.most]
    answers = ask_peer(name, chosen, scratch, core, arguments.seconds)
    if answers is None:
        return None
    steps, lost, done, wall = collections.Counter(), collections.Counter(), [], 0.0
    for file, answer in zip(chosen, answers):
        if not file.is_good:
            continue
        if answer.get("errors") == {}:
            steps.update(answer["seconds"])
            wall += answer["wall"]
            done.append(file)
        else:
            lost[answer.get("failed") or next(iter(answer["errors"].values()))] += 1
    _, same, _ = ours.check(done)
    return chosen, answers, row_of(peer.label, done, sum(steps.values()), wall, same, steps, lost)


def notes(present):
    """How each peer was asked."""
    for peer in present:
        some = f"; asked about meshes of at most {peer.most:,} triangles, because it tests all pairs" if peer.most else ""
        defined = f". Definition: {peer.definition}" if peer.definition else ""
        why = f". Wrong answers: {peer.why}" if peer.why else ""
        yield f"- {peer.label}, {peer.package} {peer.installed()}: {peer.how}{some}{defined}{why}."


def run(arguments, data, folder, scratch):
    core = arguments.core if hasattr(os, "sched_setaffinity") else None
    files = check_dataset.generate(folder, arguments.files, arguments.seed, data)
    good = [file for file in files if file.is_good]
    print(f"{len(files)} files, {sum(len(file.faces) for file in good):,} triangles", file=sys.stderr)
    ours = Ours(arguments.program, core, scratch)
    # The first run brings files and program into memory.
    ours.check(files)
    rows, seconds, wall = ours.check(files)
    speed = [row_of("**impinge check**", files, seconds, wall, seconds)]
    said, present = collections.defaultdict(list), []
    outcomes = {"impinge": {file.path: {"seconds": {}, "errors": row["error"]} for file, row in zip(files, rows)}}
    answered = [file for file, row in zip(files, rows) if file.is_good and not row["error"]]
    pairs = dict(zip((file.path for file in answered), ours.pairs(answered)))
    for name in arguments.peers.split(","):
        contested = contest(name, files, ours, arguments, core, scratch)
        if contested is None:
            print(f"{PEERS[name].label} is missing: pip install {PEERS[name].package}", file=sys.stderr)
            continue
        chosen, answers, row = contested
        present.append(PEERS[name])
        speed.append(row)
        outcomes[PEERS[name].label] = {file.path: answer for file, answer in zip(chosen, answers)}
        for file, answer in zip(chosen, answers):
            if "files" in answer and file.path in pairs:
                said[file.path].append(collect(PEERS[name], answer, file, pairs[file.path]))

    with concurrent.futures.ProcessPoolExecutor() as pool:
        tasks = [pool.submit(check_truth.counts, file.vertices, file.faces) for file in good]
        truths = {file.path: task.result() for file, task in zip(good, tasks)}
    wrong = check_ours(rows, files, truths, pairs)
    selves, counted, n_sampled, errors = compare(answered, pairs, truths, said)
    wrong += errors
    for label, (_, classes) in selves.items():
        wrong += [f"{label}: {name}, {entry['example']}" for name, entry in classes.items() if "IMPINGE" in name]

    today = datetime.date.today().isoformat()
    n_triangles = sum(len(file.faces) for file in good)
    n_pairs = sum(map(len, pairs.values()))
    parts = [
        f"# impinge check and its peers, {today}",
        f"{arguments.machine}. Python {platform.python_version()}, NumPy {np.__version__}, impinge {ours.version}. Made by "
        f"`bench/check.py`, which says what is timed and checked. {len(files):,} files (seed {arguments.seed}), {len(good):,} of "
        f"them meshes of {n_triangles:,} triangles with {n_pairs:,} self-intersecting pairs.",
        "### Seconds of one core",
        speed_table(speed),
        "### Files that hold no mesh which could be checked",
        "*error*: says so. *counts*: answers with numbers all the same.",
        broken_table(files, outcomes),
        "### Self-intersections that differ from those of impinge",
        "Each is decided in rational arithmetic. MeshLab is compared by faces, the others by pairs.",
        summary_table(selves),
        self_table(selves),
        "### Counts that differ from the exact ones",
        counts_table(counted),
        "### How peers were asked",
        "\n".join(notes(present)),
    ]
    if wrong:
        parts[2:2] = ["### WRONG ANSWERS OF IMPINGE", "\n".join(f"- {line}" for line in wrong[:50])]
    else:
        parts[2:2] = [
            f"impinge has the exact counts in every file. No pair of it is wrong or missing: neither among those in which a peer "
            f"differs, nor among {n_sampled:,} others."
        ]
    text = "\n\n".join(parts)
    print(text)
    if arguments.record:
        record = {
            "machine": arguments.machine,
            "date": today,
            "python": platform.python_version(),
            "seed": arguments.seed,
            "files": len(files),
            "triangles": n_triangles,
            "pairs": n_pairs,
            "sampled": n_sampled,
            "speed": speed,
            "self_intersections": {label: {**agree, "differences": classes} for label, (agree, classes) in selves.items()},
            "counts": {label: tallies for label, (tallies, _) in counted.items()},
            "wrong": wrong,
        }
        slug = re.sub(r"[^a-z0-9]+", "-", arguments.machine.lower()).strip("-")
        target = ROOT / "bench" / "record" / f"{slug}-{today}"
        target.mkdir(parents=True, exist_ok=True)
        (target / "check.md").write_text(text + "\n", encoding="utf-8")
        (target / "check.json").write_text(json.dumps(record, indent=1) + "\n")
        print(f"recorded in {target.relative_to(ROOT)}", file=sys.stderr)
    return 1 if wrong else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--files", type=int, default=2500, help="generated files")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--peers", default=",".join(PEERS), help=f"of {', '.join(PEERS)}; all by default")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "target" / "release" / "impinge")
    parser.add_argument("--seconds", type=float, default=30.0, help="that a peer may take for one file")
    parser.add_argument("--core", type=int, default=0, help="that contestants run on, where one can be chosen")
    parser.add_argument("--keep", type=pathlib.Path, help="a folder for the dataset, which stays")
    parser.add_argument("--record", action="store_true", help="write to bench/record as well")
    parser.add_argument("--machine", default=machine(), help="the machine's name in the record")
    arguments = parser.parse_args()
    if not arguments.program.is_file():
        parser.error(f"no {arguments.program}: cargo build --release, or --program FILE")
    data = pathlib.Path(os.environ.get("IMPINGE_DATA", ROOT.parent / "shared" / "data"))
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.keep or pathlib.Path(scratch) / "meshes"
        folder.mkdir(parents=True, exist_ok=True)
        return run(arguments, data, folder, pathlib.Path(scratch))


if __name__ == "__main__":
    sys.exit(main())
