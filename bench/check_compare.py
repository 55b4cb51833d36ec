"""Who is right where contestants differ: sets of pairs, and counts under other definitions."""

import collections
import concurrent.futures
import itertools
import pathlib
import sys
import time

import numpy as np

import check_dataset
import check_truth
from check_peers import PEERS

#: What a row of `impinge check` and a peer both count.
QUESTIONS = ["degenerate", "duplicate_faces", "non_manifold_edges", "boundary_edges", "components"]
PEERS_BY_LABEL = {peer.label: peer for peer in PEERS.values()}
#: The class of self-intersections of faces that the peer has not read.
DROPPED = "another definition: the reader drops the face"
#: Pairs per file that are decided whatever contestants say: in hostile files, and in others.
SAMPLED = (50, 5)
#: Differences of one peer in one file that are decided at most, on either side.
MOST_DECIDED = 20_000


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
    if peer.finds == "mesh" and found is not None:
        said["says"] = bool(found[0])
    elif peer.finds and found is not None and numbers is not None:
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
        if "says" in one:
            tally, examples = verdict(peer, one["says"], file, pairs, judge)
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
        is_compared = "only ours" in one or "says" in one
        decided.append({"label": one["label"], "compared": is_compared, "classes": dict(tally), "examples": examples, "definitions": definitions})
    return file.path.name, decided, sampled(file, pairs, judge)


def verdict(peer, says, file, pairs, judge):
    """The class of a yes or no about a whole mesh, if it is wrong, as a tally and examples."""
    kinds = ((judge.pair(*pair)[1], tuple(pair)) for pair in pairs.tolist())
    kind, pair = next((one for one in kinds if one[0] not in peer.leaves_out), (None, None))
    # A yes because of a pair that the peer's definition leaves out is right all the same.
    if says == (kind is not None) or (says and len(pairs)):
        return collections.Counter(), {}
    if kind:
        key = f"peer says no of a mesh with: {kind}"
        return collections.Counter([key]), {key: pair}
    # Does impinge miss one? Pairs of all faces are decided, as far as the limit goes.
    every = ((face, other) for face in range(len(file.faces)) for other in judge.near(face) if face < other)
    for pair in itertools.islice(every, MOST_DECIDED):
        is_true, kind = judge.pair(*pair)
        if is_true:
            return collections.Counter([f"IMPINGE misses a true one: {kind}"]), {}
    key = "peer says yes of a mesh without any"
    return collections.Counter([key]), {}


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
    # The simplest kind among pairs that the peer's definition includes; if it includes none, among all pairs.
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
                empty = {"files": 0, "same": 0, "wrong": 0, "reader": collections.Counter()}
                agree, _ = selves.setdefault(label, (empty, {}))
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
                if one["compared"]:
                    agree, _ = selves[one["label"]]
                    agree["files"] += 1
                    agree["same"] += not one["classes"]
                    agree["wrong"] += any(key.startswith("peer") for key in one["classes"])
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
        held = [row["triangles"], row["self_intersections"], row["intersecting_elements"]]
        if held != [len(file.faces), len(found), len(np.unique(found))]:
            wrong.append(f"{file.path.name}: `check` and `self` differ: {held}, {len(found)} pairs")
    return wrong
