"""Steps of moving surfaces: impinge beside ipc-toolkit, in one run, with the answers checked.

    python bench/compare_steps.py                    # every step whose data exists
    python bench/compare_steps.py cloth-ball --rounds 3 --threads 2

It needs `pip install ipctk` and the module (`pip install .`), and looks for data in $IMPINGE_DATA or
../shared/data.

Two questions. *How far can the step be taken?* ipc-toolkit answers with each of its narrow phases, and with the broad
phase that is fastest among those named by `--broad-phases` (LBVH alone by default); impinge with `advance`, whose step is exact
but for the rounding of positions. A step of ipc-toolkit that is longer than the exact one is an error. *Which elements have boxes that
overlap?* Both list pairs of vertices and faces, and of edges; the lists must be equal as sets. ipc-toolkit boxes are
in double precision and reach a little beyond the elements; so the sets are compared after dropping pairs whose boxes do not
overlap, which is not on the clock, and the number of dropped pairs is printed.

Times are the fastest of some rounds, in which contestants take turns. Both have what depends on the topology
alone before the clock starts; positions are handed over on the clock.
"""

import argparse
import json
import os
import pathlib
import sys
import time

import numpy as np
from meshes import read_frame, read_ply
from records import machine

try:
    import impinge
    from impinge import ipc
    import ipctk
except ModuleNotFoundError as missing:
    sys.exit(f"{missing}: pip install . ipctk")

ROOT = pathlib.Path(__file__).resolve().parents[1]
CLOTH = {"cloth-ball": ("cloth_ball92", "cloth_ball93"), "cloth-funnel": ("227", "228")}
#: Two neighbouring frames of a dancer.
RUMBA = (60, 61)
STEPS = [*CLOTH, "rumba"]
#: In the order of their names in ipc-toolkit; some take minutes on the larger step.
BROAD_PHASES = ["LBVH", "HashGrid", "SpatialHash", "SweepAndPrune"]


def read(name, data):
    """Start and end of a step, (v, 3), and the faces."""
    if name == "rumba":
        _, faces = read_ply(data / "sequences" / "rumba.ply")
        frames = (read_frame(data / "sequences" / "rumba.pc2", frame) for frame in RUMBA)
        return *frames, faces
    (start, faces), (end, _) = [
        read_ply(data / "ccd" / name / "frames" / f"{frame}.ply") for frame in CLOTH[name]
    ]
    return start, end, faces


def fastest(n_rounds, questions):
    """The fastest time of each question in milliseconds, and its last answer; questions take turns."""
    best, answers = dict.fromkeys(questions, np.inf), {}
    for _ in range(n_rounds):
        for name, ask in questions.items():
            start = time.perf_counter()
            answers[name] = ask()
            best[name] = min(best[name], 1e3 * (time.perf_counter() - start))
    return best, answers


def rows_of(candidates):
    """ipc-toolkit's candidates as arrays: (vertex, face) and (edge, edge)."""
    faces = [(pair.vertex_id, pair.face_id) for pair in candidates.fv_candidates]
    edges = [(pair.edge0_id, pair.edge1_id) for pair in candidates.ee_candidates]
    edges = np.sort(np.array(edges, np.int64).reshape(-1, 2), axis=1)
    return np.array(faces, np.int64).reshape(-1, 2), edges


def overlapping(rows, sides, ends):
    """The rows whose boxes over the step overlap, as sorted keys."""
    boxes = []
    for elements in sides:
        points = np.stack([end[elements] for end in ends])
        boxes.append((points.min(axis=(0, 2)), points.max(axis=(0, 2))))
    (low_a, high_a), (low_b, high_b) = boxes
    a, b = rows.T
    keep = (low_a[a] <= high_b[b]).all(axis=1) & (low_b[b] <= high_a[a]).all(axis=1)
    return np.unique(a[keep] << 32 | b[keep]), int((~keep).sum())


def run(name, data, n_rounds, n_threads, broad_phases):
    """One step: prints its table, returns its figures."""
    start, end, faces = read(name, data)
    faces = faces.astype(np.int32)
    doubles = [np.asfortranarray(end, np.float64) for end in (start, end)]
    edges = ipc.edges(faces)
    mesh = ipctk.CollisionMesh(doubles[0], edges, faces)
    scene = impinge.Scene()
    body = scene.add(start, faces)
    detector = impinge.Detector("cpu", threads=n_threads)

    def hand_over():
        scene.set_positions(body, start)
        scene.set_end_positions(body, end)

    def listed(broad_phase):
        candidates = ipctk.Candidates()
        candidates.build(mesh, *doubles, 0.0, getattr(ipctk, broad_phase)())
        return candidates

    def ours():
        hand_over()
        return detector.candidates(scene)

    def stepped(narrow_phase, broad_phase):
        return ipctk.compute_collision_free_stepsize(
            mesh, *doubles, 0.0, getattr(ipctk, broad_phase)(), getattr(ipctk, narrow_phase)()
        )

    def advanced():
        hand_over()
        return detector.advance(scene).fraction

    def first():
        hand_over()
        found = detector.earliest(scene, precision="f64")
        return found.toi if found else 1.0

    trial, _ = fastest(1, {phase: (lambda phase=phase: listed(phase)) for phase in broad_phases})
    broad = min(trial, key=trial.get)
    lists, answers = fastest(n_rounds, {"impinge": ours, broad: lambda: listed(broad)})
    found = answers["impinge"]
    theirs = rows_of(answers[broad])
    vertices = np.arange(len(start))[:, None]
    ends = [np.asarray(start, np.float64), np.asarray(end, np.float64)]
    n_more = 0
    sides = {"vf": (vertices, faces), "ee": (edges, edges)}
    for kind, rows in zip(("vf", "ee"), theirs):
        keys, n_dropped = overlapping(rows, sides[kind], ends)
        n_more += n_dropped
        mine = np.asarray(found.of(kind).rows, np.int64)[:, [1, 3]]
        mine = np.unique(mine[:, 0] << 32 | mine[:, 1])
        if not np.array_equal(keys, mine):
            raise AssertionError(f"{name}: {len(mine)} pairs {kind} here, {len(keys)} there")
    steps, sizes = fastest(
        n_rounds,
        {
            "impinge": advanced,
            "impinge, earliest": first,
            "AdditiveCCD": lambda: stepped("AdditiveCCD", broad),
            "TightInclusionCCD": lambda: stepped("TightInclusionCCD", broad),
        },
    )
    exact = sizes["impinge, earliest"]
    print(f"### {name}: {len(start):,} vertices, {len(edges):,} edges, {len(faces):,} faces\n")
    print("| | ms | times impinge | answer |\n|---|---:|---:|---|")
    for who, ms in lists.items():
        more = "" if who == "impinge" else f", {n_more:,} more whose boxes do not overlap"
        print(f"| pairs of boxes, {who} | {ms:,.1f} | {ms / lists['impinge']:.1f} "
              f"| {len(found):,}{more} |")
    for who, ms in steps.items():
        print(f"| step size, {who} | {ms:,.1f} | {ms / steps['impinge']:.1f} | {sizes[who]:.8e} |")
        if sizes[who] > exact:
            raise AssertionError(f"{name}: {who} goes through: {sizes[who]!r} > {exact!r}")
    print()
    return {"broad_phase": broad, "candidates": len(found), "more": n_more, "lists_ms": lists,
            "steps_ms": steps, "sizes": sizes}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("steps", nargs="*", help=f"{', '.join(STEPS)}; all by default")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--threads", type=int, default=0, help="of both; 0: one per core")
    parser.add_argument("--broad-phases", nargs="+", choices=BROAD_PHASES, default=["LBVH"])
    parser.add_argument("--json", help="a file for the figures")
    arguments = parser.parse_args()
    data = pathlib.Path(os.environ.get("IMPINGE_DATA", ROOT.parent / "shared" / "data"))
    if arguments.threads:
        ipctk.set_num_threads(arguments.threads)
    print(f"{machine()}; impinge {impinge.__version__}, ipctk {ipctk.__version__}\n")
    figures = {}
    for name in arguments.steps or STEPS:
        if name not in STEPS:
            parser.error(f"no step {name}; there is {', '.join(STEPS)}")
        figures[name] = run(name, data, arguments.rounds, arguments.threads, arguments.broad_phases)
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps(figures, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
