"""Distances of bodies, and elements within a distance, beside peers on the same positions.

    python bench/near.py                     # all scenes whose meshes exist
    python bench/near.py --rounds 5 --json near.json --markdown near.md
    python bench/near.py --only near         # elements alone, or distances alone

It installs nothing, names missing peers, and looks for meshes in $IMPINGE_DATA or ../shared/data.

Distances: two bodies at three separations. "Moved" rewrites all positions of both bodies before each question and counts the
time: `set_positions` here, refitted or rebuilt trees for peers. "Still" asks again about positions that have not changed, which
is the question of a rigid body. All distances must agree to single precision.

Elements within a distance: a mesh with itself, vertices and faces, edges and edges. ipc-toolkit's `NormalCollisions.build`
answers the same question in floating point, and reduces pairs whose nearest features are smaller to edge-vertex and
vertex-vertex collisions, with their number as weight. Edges that are nearly parallel stay edges with edges. So each pair here, reduced to
its nearest features in the same way, is held against the collision with these elements, and the number of such pairs against its
weight. Where they differ, the distance and the nearest features are decided again in fractions, and printed; a difference that
rounding does not explain ends the run.

Times are medians over rounds in which contestants take turns, wall clock and processor time of all threads.
"""

import argparse
import json
import os
import pathlib
import statistics
import sys
import time
from fractions import Fraction

import numpy as np

import contenders
import impinge
from compare import milliseconds
from meshes import read_frame, read_ply
from records import ROOT, machine


def clock(work):
    """The result of some work, and its wall and processor time in milliseconds."""
    wall, processor = time.perf_counter(), time.process_time()
    result = work()
    return result, 1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - processor)


class Ours(contenders.Contender):
    def __init__(self, **settings):
        self.label = "impinge" + "".join(f", {k}={v}" for k, v in settings.items())
        self.detector = impinge.Detector("cpu", **settings)

    def start(self, faces_a, faces_b, vertices_a, vertices_b):
        self.scene = impinge.Scene()
        self.ids = self.scene.add(vertices_a, faces_a), self.scene.add(vertices_b, faces_b)

    def arrays(self, *positions):
        return positions

    def build(self, positions):
        for body, vertices in zip(self.ids, positions):
            self.scene.set_positions(body, vertices)

    def ask(self):
        return self.detector.distance(self.scene, *self.ids).distance


class Coal(contenders.Coal):
    """Trees of oriented boxes and rectangle swept spheres, which Coal has for distances."""

    label, tree = "Coal, OBBRSS, rebuilt", "BVHModelOBBRSS"

    def ask(self):
        result, here = self.coal.DistanceResult(), self.identity
        a, b = self.models
        self.coal.distance(a, here, b, here, self.coal.DistanceRequest(), result)
        return max(result.min_distance, 0.0)


class CoalRefit(Coal, contenders.CoalRefit):
    label = "Coal, OBBRSS, refitted"


class Fcl(contenders.Fcl):
    def ask(self):
        result = self.fcl.DistanceResult()
        return max(self.fcl.distance(*self.objects, self.fcl.DistanceRequest(), result), 0.0)


class Trimesh(contenders.Peer):
    """The nearest point of one body's surface to each vertex of the other, both ways: an upper bound of the distance."""

    label = "trimesh.proximity, vertices alone"

    def __init__(self):
        import rtree  # noqa: F401, without it trimesh has no such query
        import trimesh

        self.trimesh = trimesh

    def build(self, positions):
        self.meshes = [
            self.trimesh.Trimesh(vertices, faces, process=False, validate=False)
            for vertices, faces in zip(positions, self.faces)
        ]

    def ask(self):
        a, b = self.meshes
        least = np.inf
        for mesh, other in [(a, b), (b, a)]:
            least = min(least, self.trimesh.proximity.closest_point(mesh, other.vertices)[1].min())
        return least


def mirrored(bodies, is_mirrored):
    """The positions, or their mirror image: exact, so that the distance is the same and yet every vertex moves."""
    sign = np.float32([-1 if is_mirrored else 1, 1, 1])
    return [np.ascontiguousarray(vertices * sign) for vertices, _ in bodies]


def beside(a, b, gap):
    """Two meshes with their boxes a gap apart along the first axis, in parts of the first one's length."""
    (of_a, faces_a), (of_b, faces_b) = a, b
    length = np.ptp(of_a[:, 0])
    shift = of_a[:, 0].max() - of_b[:, 0].min() + gap * length
    return [(of_a, faces_a), (of_b + np.float32([shift, 0, 0]), faces_b)]


def contest(contestants, bodies, rounds):
    """Times of each contestant, in turns, and the distance that all agree on."""
    rows, expected = {}, None
    for round_ in range(rounds + 1):
        positions = mirrored(bodies, round_ % 2)
        for contestant in contestants:
            row = rows.setdefault(contestant.label, {key: [] for key in KEYS})
            arrays = contestant.arrays(*positions)
            _, move, move_cpu = clock(lambda: contestant.build(arrays))
            found, ask, ask_cpu = clock(contestant.ask)
            _, still, still_cpu = clock(contestant.ask)
            row["distance"] = found
            if isinstance(contestant, Trimesh):
                assert found >= expected * (1 - 1e-6), (contestant.label, found, expected)
            else:
                expected = found if expected is None else expected
                scale = max(np.abs(vertices).max() for vertices in positions)
                assert abs(found - expected) < 1e-5 * scale, (contestant.label, found, expected)
            # The first round warms up.
            if round_:
                for key, value in zip(KEYS, [move + ask, move_cpu + ask_cpu, still, still_cpu]):
                    row[key].append(value)
    return expected, rows


KEYS = ["moved", "moved_cpu", "still", "still_cpu"]


def made(kinds, bodies, missing):
    """The contestants that are installed."""
    present = []
    for kind in kinds:
        try:
            present.append(kind())
        except ImportError as error:
            missing.add(str(error))
            continue
        (vertices_a, faces_a), (vertices_b, faces_b) = bodies
        present[-1].start(faces_a, faces_b, vertices_a, vertices_b)
    return present


def read_scan(data, name):
    vertices, faces = read_ply(data / "meshes" / f"{name}.ply")
    # The same size for all scans.
    return vertices / np.float32(np.ptp(vertices, axis=0).max()), faces


def distances(data, rounds, missing):
    """The rows of all scenes of distances."""
    bunny, buddha, dragon = (read_scan(data, name) for name in ["bunny", "buddha", "dragon"])
    record = []
    for name, pair in [("dragon and dragon", (dragon, dragon)), ("bunny and buddha", (bunny, buddha))]:
        for gap in [0.3, 0.03, 0.0]:
            bodies = beside(*pair, gap)
            kinds = [Ours, lambda: Ours(threads=1), Coal, CoalRefit, Fcl]
            distance, rows = contest(made(kinds, bodies, missing), bodies, rounds)
            record.append({"scene": name, "gap": gap, "distance": distance, "rows": rows})
            print(f"{name}, {gap}: {distance:.6g}", file=sys.stderr)
    # A small mesh for a peer that takes seconds.
    bodies = beside(*[(v, f) for v, f in [read_off(data, "cow"), read_off(data, "cow")]], 0.03)
    distance, rows = contest(made([Ours, Trimesh], bodies, missing), bodies, min(rounds, 3))
    record.append({"scene": "cow and cow", "gap": 0.03, "distance": distance, "rows": rows})
    return record


def read_off(data, name):
    """Vertices and faces of a text OFF file."""
    words = (data / "meshes" / f"{name}.off").read_text().split()
    n, m = int(words[1]), int(words[2])
    vertices = np.array(words[4 : 4 + 3 * n], np.float32).reshape(-1, 3)
    faces = np.array(words[4 + 3 * n : 4 + 3 * n + 4 * m], np.int64).reshape(-1, 4)[:, 1:]
    return vertices / np.float32(np.ptp(vertices, axis=0).max()), faces


def near(name, vertices, faces, part, rounds, missing):
    """One mesh with itself, within a part of its size."""
    distance = float(part * np.linalg.norm(np.ptp(vertices, axis=0)))
    row = {"scene": name, "n_faces": len(faces), "distance": distance, "rows": {}}
    plain = None
    for threads in [0, 1]:
        scene = impinge.Scene()
        body = scene.add(vertices, faces)
        detector = impinge.Detector("cpu", threads=threads) if threads else impinge.Detector("cpu")
        times = []
        for round_ in range(rounds + 1):
            scene.set_positions(body, mirrored([(vertices, faces)], round_ % 2)[0])
            found, wall, cpu = clock(lambda: detector.near(scene, distance, self_of=body))
            times.append((wall, cpu))
        label = "impinge" + (", threads=1" if threads else "")
        row["pairs"] = len(found)
        _, arrays, _ = clock(lambda: (found.kinds, found.rows, found.types))
        # The set is that of the original, which is mirrored in every second round.
        scene.set_positions(body, np.ascontiguousarray(vertices))
        plain = detector.near(scene, distance, self_of=body)
        assert len(plain) == len(found), (len(plain), len(found))
        stats = found.stats
        row["rows"][label] = medians(times) | {
            "n_candidates": stats.n_candidates,
            "n_unsure": stats.n_unsure,
            "stages": dict(stats.stages),
            "arrays": arrays,
        }
    try:
        import ipctk
    except ImportError as error:
        missing.add(str(error))
        return row
    faces = np.asfortranarray(faces, np.int32)
    edges = ipctk.edges(faces)
    positions = np.asfortranarray(vertices, np.float64)
    mesh = ipctk.CollisionMesh(positions, edges, faces)
    for broad in ["HashGrid", "LBVH"]:
        times = []
        for _ in range(max(1, min(rounds, 3))):
            collisions = ipctk.NormalCollisions()
            method = getattr(ipctk, broad)()
            _, wall, cpu = clock(lambda: collisions.build(mesh, positions, distance, 0, method))
            times.append((wall, cpu))
        weights = sum(collisions[ix].weight for ix in range(len(collisions)))
        row["rows"][f"ipc-toolkit, {broad}"] = medians(times) | {"pairs": weights}
    row["differences"] = compared(plain, collisions, vertices, faces, edges, distance)
    n = len(row["differences"])
    print(f"{name}: {row['pairs']} pairs, ipc-toolkit {weights}, {n} differences", file=sys.stderr)
    for difference in row["differences"]:
        print(f"  {difference}", file=sys.stderr)
    return row


def compared(found, collisions, vertices, faces, edges, distance):
    """Pairs reduced to their nearest features against ipc-toolkit's collisions, one by one. Explanations of all differences."""
    numbers = {tuple(sorted(edge)): ix for ix, edge in enumerate(edges.tolist())}
    # Edges here are numbered as unique pairs (low, high) in the order of (high, low).
    ours_edges = sorted(numbers, key=lambda edge: (edge[1], edge[0]))
    theirs = {
        ("fv", pair.vertex_id, pair.face_id): pair.weight for pair in collisions.fv_collisions
    }
    for pair in collisions.ev_collisions:
        theirs["ev", pair.edge_id, pair.vertex_id] = pair.weight
    for pair in collisions.vv_collisions:
        theirs["vv", *sorted((pair.vertex0_id, pair.vertex1_id))] = pair.weight
    for pair in collisions.ee_collisions:
        theirs["ee", *sorted((pair.edge0_id, pair.edge1_id))] = pair.weight
    corners_of = faces.tolist()
    ours, of_rows = {}, {}
    for kind, (a, b), type_ in zip(
        found.kinds.tolist(), found.rows[:, 1::2].tolist(), found.types.tolist(), strict=True
    ):
        kind, type_ = impinge.KINDS[kind], impinge.TYPES[type_]
        if kind == "vf":
            if type_ == "P_T":
                key = ("fv", a, b)
            else:
                ix = int(type_[3:])
                corner, following = corners_of[b][ix], corners_of[b][(ix + 1) % 3]
                if type_[2] == "E":
                    key = ("ev", numbers[tuple(sorted((corner, following)))], a)
                else:
                    key = ("vv", *sorted((a, corner)))
        else:
            pair = [ours_edges[a], ours_edges[b]]
            key = ("ee", *sorted(numbers[edge] for edge in pair))
            if key not in theirs:
                # Not nearly parallel, or not found there: the names say which ends are nearest.
                ends = [
                    part[2:] and pair[side][int(part[2:])]
                    for side, part in enumerate(type_.split("_"))
                ]
                if all(end != "" for end in ends):
                    key = ("vv", *sorted(ends))
                elif ends[0] != "":
                    key = ("ev", numbers[pair[1]], ends[0])
                elif ends[1] != "":
                    key = ("ev", numbers[pair[0]], ends[1])
        ours[key] = ours.get(key, 0) + 1
        of_rows.setdefault(key, []).append((kind, a, b))
    differences = []
    for key in ours.keys() | theirs.keys():
        counts = ours.get(key, 0), theirs.get(key, 0)
        if counts[0] != counts[1]:
            rows = of_rows.get(key, [])
            differences.append(explained(key, counts, rows, vertices, edges, faces, distance))
    return sorted(differences)


def explained(key, counts, rows, vertices, edges, faces, distance):
    """One difference in words: the distance of the features, in fractions, beside the one asked for."""
    kind, a, b = key
    corners = {
        "fv": lambda: ([a], faces[b]),
        "ev": lambda: (edges[a], [b]),
        "vv": lambda: ([a], [b]),
        "ee": lambda: (edges[a], edges[b]),
    }[kind]()
    points = [[[Fraction(float(x)) for x in vertices[v]] for v in side] for side in corners]
    ratio = float(square_of_distance(*points) / Fraction(distance) ** 2) ** 0.5
    text = f"{kind} {a} {b}: {counts[0]} pairs {rows}, weight {counts[1]}, distance {ratio!r} of the one asked for"
    # Rounding alone: the distance asked for itself, or nearest features that are a tie.
    assert abs(ratio - 1) < 1e-12 or sum(counts) > 0 and ratio <= 1, text
    return text


def square_of_distance(a, b):
    """The square of the distance of the lines, planes or points of two features: exact, in fractions."""

    def minus(p, q):
        return [x - y for x, y in zip(p, q, strict=True)]

    def dot(p, q):
        return sum(x * y for x, y in zip(p, q, strict=True))

    # Take away the part along each direction, made orthogonal to those before.
    way, directions = minus(b[0], a[0]), []
    for side in (a, b):
        directions += [minus(corner, side[0]) for corner in side[1:]]
    orthogonal = []
    for direction in directions:
        for other in orthogonal:
            share = dot(direction, other) / dot(other, other)
            direction = [x - share * y for x, y in zip(direction, other, strict=True)]
        if any(direction):
            orthogonal.append(direction)
    for direction in orthogonal:
        share = dot(way, direction) / dot(direction, direction)
        way = [x - share * y for x, y in zip(way, direction, strict=True)]
    return dot(way, way)


def medians(times):
    times = times[1:] or times
    return {key: statistics.median(t[ix] for t in times) for ix, key in enumerate(["wall", "cpu"])}


def tables(record):
    """The record as Markdown."""
    lines = ["### Smallest distance of two bodies, milliseconds", ""]
    lines += ["| scene | gap | distance | | moved | still | moved, processor | still, processor | moved / ours | still / ours |"]
    lines += ["|---|---:|---:|---|---:|---:|---:|---:|---:|---:|"]
    for scene in record["distances"]:
        ours = None
        for label, row in scene["rows"].items():
            times = [statistics.median(row[key]) for key in KEYS]
            ours = ours or times
            cells = [scene["scene"], f"{scene['gap']}", f"{row['distance']:.6g}", label]
            cells += [milliseconds(time) for time in [times[0], times[2], times[1], times[3]]]
            cells += [f"{times[1] / ours[1]:,.1f}", f"{times[3] / ours[3]:,.1f}"]
            lines.append("| " + " | ".join(cells) + " |")
    lines += ["", "Ratios are of processor time.", ""]
    lines = lines if record["distances"] else []
    if not record["near"]:
        return "\n".join(lines)
    lines += ["### Elements within a distance, milliseconds", ""]
    lines += ["| scene | faces | distance | | pairs | wall | processor | wall / ours | processor / ours |"]
    lines += ["|---|---:|---:|---|---:|---:|---:|---:|---:|"]
    for scene in record["near"]:
        ours = scene["rows"]["impinge"]
        for label, row in scene["rows"].items():
            cells = [scene["scene"], f"{scene['n_faces']:,}", f"{scene['distance']:.4g}", label]
            cells += [f"{row.get('pairs', scene['pairs']):,.0f}", milliseconds(row["wall"])]
            cells += [milliseconds(row["cpu"])]
            cells += [f"{row[key] / ours[key]:,.1f}" for key in ["wall", "cpu"]]
            lines.append("| " + " | ".join(cells) + " |")
    lines += ["", "Pairs whose collisions in ipc-toolkit differ:", ""]
    for scene in record["near"]:
        differences = scene.get("differences", ["not compared"])
        lines += [f"* {scene['scene']}, {scene['distance']:.4g}: {len(differences)}"]
        lines += [f"  * {difference}" for difference in differences]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", choices=["near", "distances"], help="one of the two questions")
    parser.add_argument("--json", type=pathlib.Path, help="write all figures to this file")
    parser.add_argument("--markdown", type=pathlib.Path, help="write the tables to this file")
    arguments = parser.parse_args()
    data = pathlib.Path(os.environ.get("IMPINGE_DATA", ROOT.parent / "shared" / "data"))
    if not (data / "meshes" / "dragon.ply").is_file():
        sys.exit(f"no meshes in {data}: set IMPINGE_DATA")
    missing = set()
    cloth = sorted((data / "ccd" / "cloth-ball" / "frames").glob("*.ply"))
    cloth_vertices, cloth_faces = read_ply(cloth[0])
    cloth_vertices = cloth_vertices.astype(np.float32)
    _, rumba_faces = read_ply(data / "sequences" / "rumba.ply")
    rumba = read_frame(data / "sequences" / "rumba.pc2", 60)
    rounds = arguments.rounds
    record = {"machine": machine(), "near": [], "distances": []}
    if arguments.only != "distances":
        meshes = [("cloth-ball", cloth_vertices, cloth_faces), ("rumba", rumba, rumba_faces)]
        record["near"] = [near(*mesh, part, rounds, missing) for mesh in meshes for part in [1e-3, 2e-3]]
    if arguments.only != "near":
        record["distances"] = distances(data, rounds, missing)
    for error in sorted(missing):
        print(f"missing: {error}", file=sys.stderr)
    text = tables(record)
    print(text)
    if arguments.json:
        arguments.json.write_text(json.dumps(record, indent=1) + "\n")
    if arguments.markdown:
        arguments.markdown.write_text(text + "\n")


if __name__ == "__main__":
    main()
