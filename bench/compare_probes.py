"""Points and rays beside peers, on surfaces whose positions change in each frame.

    python bench/compare_probes.py                     # a mesh that is generated, and scans where they are
    python bench/compare_probes.py --frames 7 --record

It installs nothing, names missing peers, and looks for meshes in $IMPINGE_DATA or ../shared/data.

Questions: whether points are inside, their nearest faces, and the first hits of rays, coherent (a camera's) and incoherent. Points are
uniform in the box of the mesh and a tenth of its size around it. All contestants get the same `float32` arrays, one after another, in
turns; positions are those of the mesh and of its mirror image in turns, so that all vertices move and yet answers stay comparable.

Times are medians over frames, of the processor time of all threads and of the wall clock, in nanoseconds per point or ray. "Moved"
is what new positions cost, also per point or ray: `set_positions` and the refit here, a new tree for peers, which have no refit in Python. Here the
refit happens in the question; a question about one point shows it. The first frame is a table of its own: there clusters are made. trimesh's nearest faces are asked of a few points only.

Answers are compared with those of impinge, which are exact: where a point lies; whether a ray hits; how far the nearest face is, to a
relative 1e-5. What differs is counted, not decided: `crates/tests/tests/probe` decides against rational arithmetic.
"""

import argparse
import datetime
import importlib.metadata
import os
import pathlib
import statistics
import sys
import time

import numpy as np

import impinge
from near import mirrored, read_scan
from records import ROOT, machine, write_record

N_POINTS, N_RAYS, SIDE = 200_000, 200_000, 448
#: Points of peers that take long.
FEW = 1_000
QUESTIONS = ["inside", "nearest", "incoherent rays", "coherent rays"]


def clock(work):
    """The result of some work, and its processor and wall time in nanoseconds."""
    processor, wall = time.process_time_ns(), time.perf_counter_ns()
    result = work()
    return result, time.process_time_ns() - processor, time.perf_counter_ns() - wall


def asked(vertices, seed=0):
    """The points, and the origins and directions of both kinds of rays, as float32."""
    random = np.random.default_rng(seed)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    size = (high - low).max()
    points, origins = (random.uniform(low - size / 10, high + size / 10, (n, 3)).astype(np.float32) for n in (N_POINTS, N_RAYS))
    directions = random.standard_normal((N_RAYS, 3)).astype(np.float32)
    eye = (low + high) / 2 + [0, 0, 2 * size]
    u = np.linspace(-size / 2, size / 2, SIDE)
    target = np.stack([*np.meshgrid(u, u, indexing="xy"), np.zeros((SIDE, SIDE))], axis=-1).reshape(-1, 3) + (low + high) / 2
    camera = np.broadcast_to(eye, target.shape).astype(np.float32).copy()
    return {
        "inside": (points,),
        "nearest": (points,),
        "incoherent rays": (origins, directions),
        "coherent rays": (camera, (target - eye).astype(np.float32)),
    }


class Contestant:
    #: Its name, and the package that it comes from.
    label, package = "", ""
    #: The most points of a question, where it takes long.
    most = {}

    def __init__(self, vertices, faces):
        self.faces = faces

    def move(self, vertices):
        """Takes new positions."""

    def ask(self, question, *arrays):
        """Inside: a mask. Nearest: distances. Rays: a mask of hits. None if it has no such question."""


class Ours(Contestant):
    label, package = "impinge", "impinge"

    def __init__(self, vertices, faces, **settings):
        self.label = "impinge" + "".join(f", {k}={v}" for k, v in settings.items())
        self.scene = impinge.Scene()
        self.body = self.scene.add(vertices, faces)
        self.detector = impinge.Detector("cpu", **settings)

    def move(self, vertices):
        self.scene.set_positions(self.body, vertices)

    def ask(self, question, *arrays):
        if question == "inside":
            try:
                return self.detector.contains(self.scene, self.body, *arrays) > 0
            except impinge.Error:
                # The surface is not closed.
                return None
        if question == "nearest":
            return self.detector.closest(self.scene, *arrays).distances
        return self.detector.cast(self.scene, *arrays).hit


class Open3d(Contestant):
    label, package = "Open3D, one thread", "open3d"

    def __init__(self, vertices, faces):
        import open3d

        self.core, self.scenes = open3d.core, open3d.t.geometry.RaycastingScene
        self.faces = self.core.Tensor(faces.astype(np.uint32))

    def move(self, vertices):
        self.scene = self.scenes(nthreads=1)
        self.scene.add_triangles(self.core.Tensor(vertices), self.faces)
        # The tree is built by the first question.
        self.scene.cast_rays(self.core.Tensor(np.ones((1, 6), np.float32)))

    def ask(self, question, *arrays):
        arrays = [self.core.Tensor(array) for array in arrays]
        if question == "inside":
            return self.scene.compute_occupancy(*arrays, nthreads=1).numpy() > 0
        if question == "nearest":
            nearest = self.scene.compute_closest_points(*arrays, nthreads=1)["points"].numpy()
            return np.linalg.norm(nearest - arrays[0].numpy(), axis=1)
        rays = arrays[0].append(arrays[1], axis=1)
        return np.isfinite(self.scene.cast_rays(rays, nthreads=1)["t_hit"].numpy())


class Embreex(Contestant):
    label, package = "embreex", "embreex"

    def __init__(self, vertices, faces):
        super().__init__(vertices, faces)
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self.scenes, self.meshes = EmbreeScene, TriangleMesh

    def move(self, vertices):
        self.scene = self.scenes()
        self.meshes(self.scene, vertices, self.faces)
        # The tree is built by the first question.
        self.scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))

    def ask(self, question, *arrays):
        return self.scene.run(*arrays) >= 0 if "rays" in question else None


class Trimesh(Contestant):
    label, package = "trimesh, with embreex", "trimesh"
    most = {"nearest": FEW, "inside": N_POINTS // 10}

    def __init__(self, vertices, faces):
        super().__init__(vertices, faces)
        import embreex  # noqa: F401, without it trimesh asks in Python
        import rtree  # noqa: F401
        import trimesh

        self.trimesh = trimesh

    def move(self, vertices):
        self.mesh = self.trimesh.Trimesh(vertices, self.faces, process=False, validate=False)
        # Trees are made by the first question.
        self.mesh.ray.intersects_first(np.zeros((1, 3)), np.ones((1, 3)))

    def ask(self, question, *arrays):
        if question == "inside":
            return self.mesh.contains(*arrays)
        if question == "nearest":
            return self.trimesh.proximity.closest_point(self.mesh, *arrays)[1]
        return self.mesh.ray.intersects_first(*arrays) >= 0


def measured(vertices, faces, kinds, frames, missing):
    """Rows of one mesh."""
    contestants = []
    for kind in kinds:
        try:
            contestants.append(kind(vertices, faces))
        except ImportError as error:
            missing.add(str(error))
    questions, times, differ, first = asked(vertices), {}, {}, {}
    for frame in range(frames + 1):
        [positions] = mirrored([(vertices, None)], frame % 2)
        exact = {}
        for contestant in contestants:
            # Threads of the one before, which may wait for work by spinning, go to sleep.
            time.sleep(0.5)
            _, *moved = clock(lambda: contestant.move(positions))
            if isinstance(contestant, Ours):
                # Boxes are refitted by the first question.
                _, *refit = clock(lambda: contestant.ask("nearest", positions[:1]))
                moved = [a + b for a, b in zip(moved, refit)]
            first.setdefault(contestant.label, moved)
            for question in QUESTIONS:
                if exact.get(question, True) is None:
                    continue
                arrays = [array[: contestant.most.get(question)] for array in questions[question]]
                arrays = mirrored([(array, None) for array in arrays], frame % 2)
                found, *spent = clock(lambda: contestant.ask(question, *arrays))
                if found is None:
                    exact.setdefault(question, None)
                    continue
                key = question, contestant.label
                n = len(arrays[0])
                truth = exact.setdefault(question, found)[:n]
                near = np.isclose(found, truth, rtol=1e-5, atol=1e-7) if question == "nearest" else found == truth
                differ[key] = int((~near).sum()), n
                # The first frame warms up, and makes what is kept.
                if frame:
                    times.setdefault(key, []).append([x / n for x in (*spent, *moved)])
    rows = []
    for question in QUESTIONS:
        for contestant in contestants:
            key = question, contestant.label
            if key in times:
                ask, wall, moved, moved_wall = (statistics.median(column) for column in zip(*times[key]))
                row = {"question": question, "contestant": contestant.label, "n": differ[key][1], "differ": differ[key][0]}
                rows.append(row | {"ask": ask, "wall": wall, "moved": moved, "moved_wall": moved_wall})
    return {"rows": rows, "first": first}


def table(record):
    lines = [
        "| mesh | question | contestant | ask | moved | both | both / impinge | wall, both | answers that differ |",
        "|---|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    for scene in record["scenes"]:
        for row in scene["rows"]:
            [ours] = [one for one in scene["rows"] if one["question"] == row["question"] and one["contestant"] == "impinge, threads=1"]
            # As if each frame asked this many: the peers that are asked few would pay their trees with them.
            full = row["n"] / ours["n"]
            both, base = row["ask"] + row["moved"] * full, ours["ask"] + ours["moved"]
            wall = row["wall"] + row["moved_wall"] * full
            cells = [f"{scene['name']}, {scene['n_faces']:,}", row["question"], row["contestant"]]
            cells += [f"{row['ask']:,.0f}", f"{row['moved'] * full:,.0f}", f"{both:,.0f}", f"{both / base:.2f}", f"{wall:,.0f}"]
            lines.append("| " + " | ".join([*cells, f"{row['differ']:,} of {row['n']:,}"]) + " |")
    lines += ["", "The first answer, with all that is made for it, such as trees: milliseconds of the processor, and by the wall clock.", ""]
    names = list(record["scenes"][0]["first"])
    lines += ["| mesh | " + " | ".join(names) + " |", "|---|" + "---:|" * len(names)]
    for scene in record["scenes"]:
        cells = [f"{scene['first'][name][0] / 1e6:,.1f}, {scene['first'][name][1] / 1e6:,.1f}" for name in names]
        lines.append("| " + " | ".join([f"{scene['name']}, {scene['n_faces']:,}", *cells]) + " |")
    return "\n".join(lines)


def torus(n=160, m=80):
    """A closed surface that is there on every machine."""
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    around = 1 + 0.4 * np.cos(v)
    vertices = np.stack([around * np.cos(u), around * np.sin(u), 0.4 * np.sin(v) + 0.1 * np.sin(5 * u)], axis=-1).reshape(-1, 3)
    a, b = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    here, right = a * m + b, a * m + (b + 1) % m
    below, across = (a + 1) % n * m + b, (a + 1) % n * m + (b + 1) % m
    faces = np.stack([here, below, across, here, across, right], axis=-1).reshape(-1, 3)
    return vertices.astype(np.float32), faces.astype(np.int64)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--frames", type=int, default=5)
    parser.add_argument("--record", action="store_true", help="write to bench/record as well")
    parser.add_argument("--machine", default=machine(), help="the machine's name in the record")
    arguments = parser.parse_args()
    data = pathlib.Path(os.environ.get("IMPINGE_DATA", ROOT.parent / "shared" / "data"))
    meshes, missing = {"torus": torus()}, set()
    for name in ["bunny", "buddha", "dragon"]:
        if (data / "meshes" / f"{name}.ply").is_file():
            meshes[name] = read_scan(data, name)
    kinds = [lambda *mesh: Ours(*mesh, threads=1), Ours, Open3d, Embreex, Trimesh]
    scenes = []
    for name, (vertices, faces) in meshes.items():
        print(f"{name}: {len(faces):,} faces", file=sys.stderr)
        vertices = np.ascontiguousarray(vertices, np.float32)
        scenes.append({"name": name, "n_faces": len(faces)} | measured(vertices, faces, kinds, arguments.frames, missing))
    today = datetime.date.today().isoformat()
    versions = {kind.package: importlib.metadata.version(kind.package) for kind in [Ours, Open3d, Embreex, Trimesh] if not missing}
    record = {"machine": arguments.machine, "date": today, "versions": versions, "frames": arguments.frames, "scenes": scenes}
    text = (
        f"# Points and rays beside peers, {today}\n\n{arguments.machine}. {', '.join(f'{k} {v}' for k, v in versions.items())}. Made by "
        f"`bench/compare_probes.py`, which says what is measured. Nanoseconds per point or ray, median of {arguments.frames} frames; processor "
        f"time of all threads but for the wall clock.\n\n{table(record)}"
    )
    print(text)
    for error in sorted(missing):
        print(f"missing: {error}", file=sys.stderr)
    if arguments.record:
        write_record(arguments.machine, today, "probes", text, record)


if __name__ == "__main__":
    main()
