"""How long it takes to say how far vertices may move, and who is near whom: beside ipc-toolkit.

    python bench/time_bounds.py                  # a waved cloth, and the frames whose data exists
    python bench/time_bounds.py --rounds 9 cloth

It needs `pip install ipctk` and the module (`pip install .`), and looks for data in $IMPINGE_DATA or
../shared/data. One radius is asked for, and pairs that share a vertex are left out, by both. Every
vertex moves by up to a tenth of the radius between rounds, in which all take turns, each after a
pause, for threads of the one before may still spin; times are medians of wall milliseconds, ipctk's
with the fastest of its broad phases.

    lists and bounds    `neighbours` and `safe_distances`; `Candidates.build` and
                        `compute_per_vertex_safe_distances`
    without rings       the same without elements that are at most two edges apart in the surface:
                        ipctk by a filter made with `make_sparse_filter`, which leaves out a pair
                        if all of its vertices are so near, impinge if some are
    bounds              `safe_distances`; `TrustRegion.update`
    from a list         `safe_distances` of a detector with a `reuse_margin` of half of the radius

The first table asks for vertices near faces and edges near edges, as ipctk does; the second also whether
an edge meets a face, which impinge asks unless it is told not to, and ipctk does not.
"""

import argparse
import os
import pathlib
import statistics
import time

import ipctk
import numpy as np
import scipy.sparse
from meshes import read_frame, read_ply

import impinge

ROOT = pathlib.Path(__file__).resolve().parents[1]
BROAD_PHASES = ["LBVH", "BVH", "HashGrid", "SweepAndPrune"]
#: How many edges apart vertices are at most whose elements are left out.
RINGS = 2
#: Seconds before each question.
PAUSE = 0.1
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


def vertices_within_edges(n, edges, most):
    """Pairs `(i, j)` of vertices at most some number of edges apart, `i < j`."""
    ends = np.vstack([edges, edges[:, ::-1]])
    near = scipy.sparse.csr_matrix((np.ones(len(ends), dtype=bool), ends.T), shape=(n, n))
    reached = near
    for _ in range(most - 1):
        reached = reached + reached @ near
    return np.array(scipy.sparse.triu(reached, 1).nonzero()).T.tolist()


def measure(name, vertices, faces, radius, kinds, rounds):
    """A line of the table. All elements within `radius` are asked for; no vertex may move farther than half of it."""
    random = np.random.default_rng(1)
    scene = impinge.Scene()
    body = scene.add(vertices, faces)
    detector = impinge.Detector("cpu")
    listing = impinge.Detector("cpu", reuse_margin=radius / 2)
    edges = ipctk.edges(faces)
    mesh, without_rings = (
        ipctk.CollisionMesh(vertices.astype(np.float64), edges, faces) for _ in range(2)
    )
    left_out = {(i, j): False for i, j in vertices_within_edges(len(vertices), edges, RINGS)}
    without_rings.can_collide = ipctk.make_sparse_filter(left_out, True)

    def candidates(phase, mesh, at):
        found = ipctk.Candidates()
        found.build(mesh, at, radius / 2, phase)
        return found.compute_per_vertex_safe_distances(mesh, at, radius)

    def region(phase, at):
        region = ipctk.ogc.TrustRegion(radius)
        region.trust_region_inflation_radius = radius / 2
        region.update(mesh, at, ipctk.NormalCollisions(), broad_phase=phase)

    def lists_and_bounds(**options):
        detector.neighbours(scene, radius, kinds=kinds, **options)
        detector.safe_distances(scene, radius / 2, kinds=kinds, **options)

    phases = {phase: getattr(ipctk, phase)() for phase in BROAD_PHASES if hasattr(ipctk, phase)}
    contestants = {
        "lists and bounds": lambda _: lists_and_bounds(),
        "without rings": lambda _: lists_and_bounds(exclude=impinge.rings(RINGS)),
        "bounds": lambda _: detector.safe_distances(scene, radius / 2, kinds=kinds),
        "from a list": lambda _: listing.safe_distances(scene, radius / 2, kinds=kinds),
    }
    for phase, broad in phases.items():
        contestants |= {
            f"lists and bounds, {phase}": lambda at, broad=broad: candidates(broad, mesh, at),
            f"without rings, {phase}": lambda at, broad=broad: candidates(broad, without_rings, at),
            f"bounds, {phase}": lambda at, broad=broad: region(broad, at),
        }
    times = {of: [] for of in contestants}
    for _ in range(rounds + 1):
        moved = vertices + random.uniform(-0.05, 0.05, vertices.shape).astype(
            np.float32
        ) * np.float32(radius)
        scene.set_positions(body, moved)
        at = np.asfortranarray(moved, dtype=np.float64)
        for of, ask in contestants.items():
            time.sleep(PAUSE)
            times[of].append(clock(lambda ask=ask, at=at: ask(at)))
    # The first round makes clusters and the list.
    ms = {of: statistics.median(own[1:]) for of, own in times.items()}
    cells = [name, f"{radius:.4g}"]
    for of in ["lists and bounds", "without rings", "bounds"]:
        peer, phase = min((ms[f"{of}, {phase}"], phase) for phase in phases)
        cells += [f"{ms[of]:.1f}", f"{peer:.1f} ({phase})", f"{peer / ms[of]:.1f}"]
    cells.append(f"{ms['from a list']:.1f}")
    print(f"| {' | '.join(cells)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenes", nargs="*", help=", ".join(RADII))
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    data = pathlib.Path(os.environ.get("IMPINGE_DATA", ROOT.parent / "shared" / "data"))
    print(f"impinge {impinge.__version__}, ipctk {ipctk.__version__}")
    for kinds in [("vf", "ee"), None]:
        print("\nedges that meet faces too\n" if kinds is None else f"\n{' and '.join(kinds)}\n")
        print(
            "| scene | radius | lists and bounds, ms | ipctk, candidates and safe distances | times "
            "| without rings | ipctk | times | bounds | ipctk, `TrustRegion.update` | times "
            "| bounds from a list |\n|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|"
        )
        for name in options.scenes or RADII:
            if name != "cloth" and not data.is_dir():
                print(f"\n{name}: no data in {data}")
                continue
            vertices, faces, radii = read(name, data)
            for radius in radii:
                measure(name, vertices, faces, radius, kinds, options.rounds)


if __name__ == "__main__":
    main()
