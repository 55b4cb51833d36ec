"""How long it takes to say how far vertices may move, and who is near whom: beside ipc-toolkit.

    python bench/time_bounds.py                  # a waved cloth, and the frames whose data exists
    python bench/time_bounds.py --rounds 9 cloth

It needs `pip install ipctk` and the module (`pip install .`), and looks for data in $IMPINGE_DATA or
../shared/data. One radius is asked for, and pairs that share a vertex are left out, by both. Every
vertex moves by up to a tenth of the radius between rounds, in which all take turns; times are medians
of wall milliseconds, ipctk's with the fastest of its broad phases.

    lists and bounds    `neighbours` and `safe_distances`; `Candidates.build` and
                        `compute_per_vertex_safe_distances`
    bounds              `safe_distances`; `TrustRegion.update`
    from a list         `safe_distances` of a detector with a `reuse_margin` of half of the radius
"""

import argparse
import os
import pathlib
import statistics
import time

import ipctk
import numpy as np
from meshes import read_frame, read_ply

import impinge

ROOT = pathlib.Path(__file__).resolve().parents[1]
BROAD_PHASES = ["LBVH", "BVH", "HashGrid", "SweepAndPrune"]
#: Radii: parts of the middle edge of the cloth, and of the diagonals of frames.
RADII = {"cloth": [0.57, 0.85, 1.4], "cloth-ball": [1e-3], "rumba": [1e-3]}


def read(name, data):
    """Positions (v, 3) float32, faces (n, 3), and the radii to ask for."""
    if name == "cloth":
        side = 150
        x, y = (of.ravel() for of in np.mgrid[0:side, 0:side])
        vertices = np.column_stack([x, y, 2 * np.sin(x / 9) * np.cos(y / 7)]).astype(np.float32)
        a = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
        faces = np.vstack(
            [
                np.column_stack([a, a + side, a + side + 1]),
                np.column_stack([a, a + side + 1, a + 1]),
            ]
        )
        edges = ipctk.edges(faces.astype(np.int32))
        unit = np.median(np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1))
    elif name == "rumba":
        vertices, faces = (
            read_frame(data / "sequences" / "rumba.pc2", 60),
            read_ply(data / "sequences" / "rumba.ply")[1],
        )
        unit = np.linalg.norm(np.ptp(vertices, axis=0))
    else:
        vertices, faces = read_ply(data / "ccd" / "cloth-ball" / "frames" / "cloth_ball92.ply")
        unit = np.linalg.norm(np.ptp(vertices, axis=0))
    return (
        vertices.astype(np.float32),
        faces.astype(np.int32),
        [float(part * unit) for part in RADII[name]],
    )


def clock(work):
    start = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - start)


def measure(name, vertices, faces, radius, rounds):
    """A line of the table. All elements within `radius` are asked for; no vertex may move farther than half of it."""
    random = np.random.default_rng(1)
    scene = impinge.Scene()
    body = scene.add(vertices, faces)
    detector = impinge.Detector("cpu")
    listing = impinge.Detector("cpu", reuse_margin=radius / 2)
    mesh = ipctk.CollisionMesh(vertices.astype(np.float64), ipctk.edges(faces), faces)

    def candidates(phase, at):
        found = ipctk.Candidates()
        found.build(mesh, at, radius / 2, phase)
        return found.compute_per_vertex_safe_distances(mesh, at, radius)

    def region(phase, at):
        region = ipctk.ogc.TrustRegion(radius)
        region.trust_region_inflation_radius = radius / 2
        region.update(mesh, at, ipctk.NormalCollisions(), broad_phase=phase)

    phases = {phase: getattr(ipctk, phase)() for phase in BROAD_PHASES if hasattr(ipctk, phase)}
    contestants = {
        "lists and bounds": lambda _: (
            detector.neighbours(scene, radius),
            detector.safe_distances(scene, radius / 2),
        ),
        "bounds": lambda _: detector.safe_distances(scene, radius / 2),
        "from a list": lambda _: listing.safe_distances(scene, radius / 2),
    }
    for phase, broad in phases.items():
        contestants[f"candidates, {phase}"] = lambda at, broad=broad: candidates(broad, at)
        contestants[f"region, {phase}"] = lambda at, broad=broad: region(broad, at)
    times = {of: [] for of in contestants}
    for _ in range(rounds + 1):
        moved = vertices + random.uniform(-0.05, 0.05, vertices.shape).astype(
            np.float32
        ) * np.float32(radius)
        scene.set_positions(body, moved)
        at = np.asfortranarray(moved, dtype=np.float64)
        for of, ask in contestants.items():
            times[of].append(clock(lambda ask=ask, at=at: ask(at)))
    # The first round makes clusters and the list.
    ms = {of: statistics.median(own[1:]) for of, own in times.items()}
    own, bounds, listed = (ms[of] for of in ("lists and bounds", "bounds", "from a list"))
    lists, update = (
        min((ms[f"{of}, {phase}"], phase) for phase in phases) for of in ("candidates", "region")
    )
    print(
        f"| {name} | {radius:.4g} | {own:.1f} | {lists[0]:.1f} ({lists[1]}) | {lists[0] / own:.1f} "
        f"| {bounds:.1f} | {update[0]:.1f} ({update[1]}) | {update[0] / bounds:.1f} | {listed:.1f} |",
        flush=True,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenes", nargs="*", help=", ".join(RADII))
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    data = pathlib.Path(os.environ.get("IMPINGE_DATA", ROOT.parent / "shared" / "data"))
    print(f"impinge {impinge.__version__}, ipctk {ipctk.__version__}\n")
    print(
        "| scene | radius | lists and bounds, ms | ipctk, candidates and safe distances | times | bounds | ipctk, `TrustRegion.update` "
        "| times | bounds from a list |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|"
    )
    for name in options.scenes or RADII:
        if name != "cloth" and not data.is_dir():
            print(f"\n{name}: no data in {data}")
            continue
        vertices, faces, radii = read(name, data)
        for radius in radii:
            measure(name, vertices, faces, radius, options.rounds)


if __name__ == "__main__":
    main()
