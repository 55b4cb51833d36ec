"""Whole frames of an implicit cloth: ipc-toolkit's collision stage beside impinge's, in one run.

    python bench/ipc_frames.py                           # 300 frames of 1,282 and of 2,962 vertices, 12 of 22,162
    python bench/ipc_frames.py --scenes 32:20 --record

It needs `pip install ipctk scipy` and the module (`pip install .`). The solver is that of `examples/ipc/cloth.py`: implicit Euler,
Newton's method, ipctk's barrier. Three of them take turns, frame by frame:

- *ipctk*: its broad phase (LBVH) and its whole step size (Tight Inclusion);
- *impinge.ipc.BroadPhase*: in the place of theirs, in both calls; nothing else is changed;
- *and its steps*: `compute_collision_free_stepsize` of `impinge.ipc`, too, which is exact, so steps are longer.

On the clock are frames, and within them the two calls of the collision stage: `NormalCollisions.build` and the step size. Off the
clock, the run ends with an error if at the end of any frame of any solver the sets of collisions with their weights differ between
both broad phases; if a cloth intersects itself or the ball in any Newton iteration; or if the first two solvers, whose steps are
equal, take another number of iterations, or come to positions more than 1e-10 apart. These two begin each frame at the same positions
and velocities: forces are summed in another order, so rounding differs, and the difference grows from frame to frame.
"""

import argparse
import datetime
import importlib.metadata
import sys
import time

import numpy as np
from records import ROOT, machine, write_record

sys.path.insert(0, str(ROOT / "examples" / "ipc"))

import ipctk  # noqa: E402
from cloth import DHAT, Cloth, keys  # noqa: E402

from impinge import ipc  # noqa: E402


class Stage:
    """A collision stage: what it takes, and what is checked off the clock."""

    def __init__(self, mesh, broad_phase, steps):
        self.mesh = mesh
        self.broad_phase = broad_phase
        self.steps = steps
        self.ms = self.off = 0.0

    def timed(self, ask):
        start = time.perf_counter()
        answer = ask()
        self.ms += 1e3 * (time.perf_counter() - start)
        return answer

    def collisions(self, x):
        return self.timed(lambda: build(self.mesh, x, self.broad_phase))

    def step_size(self, x, goal):
        if self.steps is not None:
            return self.timed(lambda: self.steps(self.mesh, x, goal))
        return self.timed(
            lambda: ipctk.compute_collision_free_stepsize(self.mesh, x, goal, 0.0, self.broad_phase)
        )

    def check(self, x):
        start = time.perf_counter()
        if ipc.has_intersections(self.mesh, x):
            sys.exit("the cloth intersects")
        self.off += 1e3 * (time.perf_counter() - start)


def build(mesh, x, broad_phase):
    found = ipctk.NormalCollisions()
    found.build(mesh, x, DHAT, broad_phase=broad_phase)
    return found


def solver(size, stage):
    cloth = Cloth(size)
    cloth.stage = Stage(cloth.mesh, *stage())
    return cloth


CONTESTANTS = {
    "ipctk": lambda: (None, None),
    "impinge.ipc.BroadPhase": lambda: (ipc.BroadPhase(), None),
    "and its steps": lambda: (ipc.BroadPhase(), ipc.compute_collision_free_stepsize),
}


def raced(size, n_frames):
    """The rows of one cloth."""
    solvers = {name: solver(size, stage) for name, stage in CONTESTANTS.items()}
    asked = ipc.BroadPhase()
    frames = {name: [] for name in solvers}
    most, apart = 0, 0.0
    plain, replaced, _ = solvers.values()
    for frame in range(n_frames):
        replaced.x, replaced.v = plain.x.copy("K"), plain.v.copy()
        for name, cloth in solvers.items():
            stage = cloth.stage
            stage.ms = stage.off = 0.0
            start = time.perf_counter()
            cloth.frame()
            frames[name].append([1e3 * (time.perf_counter() - start) - stage.off, stage.ms])
            ours, theirs = (build(cloth.mesh, cloth.x, by) for by in (asked, None))
            if keys(ours) != keys(theirs):
                sys.exit(f"frame {frame} of {name}: {len(ours)} collisions, {len(theirs)} by ipctk, and not the same")
            most = max(most, len(ours))
        apart = max(apart, np.abs(plain.x - replaced.x).max())
        if plain.n_iterations != replaced.n_iterations or apart > 1e-10:
            sys.exit(f"frame {frame}: {plain.n_iterations} and {replaced.n_iterations} iterations, {apart} apart")
        print(f"{plain.mesh.num_vertices} vertices, frame {frame}", end="\r", file=sys.stderr)
    rows = []
    for name, cloth in solvers.items():
        times = np.array(frames[name])
        row = {"contestant": name, "frame": times[:, 0].mean(), "collision": times[:, 1].mean()}
        rows.append(row | {"share": times[:, 1].sum() / times[:, 0].sum(), "iterations": cloth.n_iterations})
    return {"n_vertices": plain.mesh.num_vertices, "frames": n_frames, "most": most, "apart": apart, "rows": rows}


def table(record):
    lines = [
        "| vertices | frames | collision stage | frame, ms | of it collision, ms | share | Newton iterations |",
        "|---:|---:|---|---:|---:|---:|---:|",
    ]
    for scene in record["scenes"]:
        for row in scene["rows"]:
            numbers = f"{row['frame']:,.1f} | {row['collision']:,.1f} | {100 * row['share']:.1f} % | {row['iterations']:,}"
            lines.append(f"| {scene['n_vertices']:,} | {scene['frames']} | {row['contestant']} | {numbers} |")
    return "\n".join(lines)


def worded(record, note):
    asked = sum(len(scene["rows"]) * scene["frames"] for scene in record["scenes"])
    note = note and f" {note}"
    return (
        f"# Frames of an implicit cloth beside ipc-toolkit, {record['date']}\n\n{record['machine']}. "
        f"{', '.join(f'{name} {version}' for name, version in record['versions'].items())}. Made by `bench/ipc_frames.py`, which says what is on the "
        f"clock. Means over frames; solvers take turns, frame by frame.{note}\n\n{table(record)}\n\nAt the ends of all {asked:,} frames both broad phases "
        f"find the same collisions with the same weights, at most {max(scene['most'] for scene in record['scenes']):,}. No iteration intersects. The first "
        f"two solvers of each cloth, which begin a frame at the same positions, are at most {max(scene['apart'] for scene in record['scenes']):.1e} "
        "apart at the end of any frame."
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--scenes", nargs="+", default=["32:300", "52:300", "148:12"], help="vertices along an edge : frames")
    parser.add_argument("--record", action="store_true", help="write to bench/record as well")
    parser.add_argument("--machine", default=machine(), help="the machine's name in the record")
    parser.add_argument("--note", default="", help="what else the record is to say")
    arguments = parser.parse_args()
    ipctk.set_logger_level(ipctk.LoggerLevel.off)
    scenes = []
    for scene in arguments.scenes:
        scenes.append(raced(*map(int, scene.split(":"))))
        # A long run says what it has.
        print(table({"scenes": scenes[-1:]}), file=sys.stderr)
    today = datetime.date.today().isoformat()
    versions = {name: importlib.metadata.version(name) for name in ["impinge", "ipctk", "numpy", "scipy"]}
    record = {"machine": arguments.machine, "date": today, "versions": versions, "scenes": scenes}
    text = worded(record, arguments.note)
    print(text)
    if arguments.record:
        write_record(arguments.machine, today, "ipc_frames", text, record)


if __name__ == "__main__":
    main()
