"""`impinge check` beside its peers on a few thousand meshes, and whose answers are right.

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

Checks: counts of impinge are compared with `check_truth.counts` on every file. Pairs of each peer (MeshLab: faces; trueform: yes
or no) are compared with those of impinge as sets, and what only one of the two has is decided in rational arithmetic
(`check_truth.judged`):

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
import subprocess
import sys
import tempfile
import time

import numpy as np

import check_dataset
import check_tables
import check_truth
from check_compare import check_ours, collect, compare
from check_peers import PEERS, Child
from records import ROOT, machine, write_record


class Ours:
    """The program, on one core."""

    def __init__(self, program, core, folder):
        self.program, self.core, self.folder = program, core, folder
        self.version = self.output("--version")[0].split()[-1]

    def output(self, *arguments, codes=(0,)):
        """What the program prints, and its processor and wall seconds with those of its children."""
        pin = (lambda: os.sched_setaffinity(0, {self.core})) if self.core is not None else None
        began = time.perf_counter()
        with tempfile.TemporaryFile("w+") as printed:
            process = subprocess.Popen([self.program, *arguments], stdout=printed, preexec_fn=pin)
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode not in codes:
                raise RuntimeError(f"{self.program} {' '.join(arguments)}: exit code {process.returncode}")
            printed.seek(0)
            return printed.read(), used.ru_utime + used.ru_stime, time.perf_counter() - began

    def check(self, files):
        """Rows, processor seconds, wall seconds."""
        listed = self.folder / "list.txt"
        listed.write_text("".join(f"{file.path}\n" for file in files))
        text, processor, wall = self.output(
            "check", "--list", str(listed), "--json", "--jobs", "1", "--no-progress", "--timeout", "60",
            codes=(0, 1),  # 1: some files could not be checked
        )
        return [json.loads(line) for line in text.splitlines()], processor, wall

    def pairs(self, files):
        """The self-intersections of each file: a list of arrays (n, 2)."""
        rows = self.folder / "pairs.npy"
        paths = [str(file.path) for file in files]
        self.output("self", *paths, "--rows", str(rows), "--no-progress", "--json")
        rows = np.load(rows)
        starts = np.searchsorted(rows[:, 0], np.arange(len(files) + 1))
        return [rows[start:end][:, [1, 3]].astype(np.int64) for start, end in zip(starts, starts[1:])]


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
        check_tables.speed_table(speed),
        "### Files that hold no mesh which could be checked",
        "*error*: says so. *counts*: answers with numbers all the same.",
        check_tables.broken_table(files, outcomes),
        "### Self-intersections that differ from those of impinge",
        "Each is decided in rational arithmetic. MeshLab is compared by faces, trueform by its yes or no, the others by pairs.",
        check_tables.summary_table(selves),
        check_tables.self_table(selves),
        "### Counts that differ from the exact ones",
        check_tables.counts_table(counted),
        "### How peers were asked",
        "\n".join(notes(present)),
    ]
    if wrong:
        parts[2:2] = ["### WRONG ANSWERS OF IMPINGE", "\n".join(f"- {line}" for line in wrong[:50])]
    else:
        parts[2:2] = [
            "impinge has the exact counts in every file. No pair of it is wrong or missing, neither where a peer differs, nor among "
            f"the {n_sampled:,} pairs of random faces."
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
            "broken": check_tables.broken_counts(files, outcomes),
            "versions": {"impinge": ours.version} | {peer.label: peer.installed() for peer in present},
            "wrong": wrong,
        }
        target = write_record(arguments.machine, today, "check", text, record)
        print(f"recorded in {target.relative_to(ROOT)}; now bench/check_page.py", file=sys.stderr)
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
