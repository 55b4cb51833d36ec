"""Runs impinge and its peers on the same deforming frames, and checks the answers.

    python bench/compare.py                         # every scene whose mesh exists
    python bench/compare.py bunny --frames 3
    python bench/compare.py --record --machine my-machine

It installs nothing: it names missing peers and what to install. It looks for meshes
in $IMPINGE_DATA or ../shared/data; the scenes "ball" and "bolt" are generated.

Timing: two overlapping copies of a mesh are twisted a little further in each frame. A
contender gets the positions of both as arrays that it takes without a conversion, and must
find which triangles of one copy meet which of the other. "Build" is the work that it does because
the vertices have moved; "query" finds the pairs. Each contender runs all frames on its own, in
several rounds, so that it has the caches to itself; the table shows medians over frames and rounds.

Checks: every contender's pairs in every frame are compared, as a set, with the exact pairs. These
come from CGAL's exact kernel (through libigl), and for the first frame also from published data, if
there is any. Without libigl they come from impinge's other method, and the table says so.
"""

import argparse
import datetime
import json
import os
import pathlib
import platform
import statistics
import sys
import time

import numpy as np

try:
    import contenders
except ModuleNotFoundError as missing:
    sys.exit(f"{missing}: pip install . (in the root of the checkout) installs impinge and NumPy")

from meshes import read_ply
from records import ROOT, machine, write_record

#: The twist of the last frame, in radians per unit length.
TWIST = 1.5


def ball(n_rings=124, n_segments=124):
    """A dented ball of some 30,000 triangles."""
    ring = np.pi * (np.arange(n_rings) + 0.5) / n_rings
    segment = 2 * np.pi * np.arange(n_segments) / n_segments
    ring, segment = np.meshgrid(ring, segment, indexing="ij")
    radius = 0.5 + 0.05 * np.sin(7 * ring) * np.cos(5 * segment)
    vertices = radius[..., None] * np.stack(
        [np.sin(ring) * np.cos(segment), np.sin(ring) * np.sin(segment), np.cos(ring)], axis=-1
    )
    u, v = np.meshgrid(np.arange(n_rings - 1), np.arange(n_segments), indexing="ij")
    here, right = u * n_segments + v, u * n_segments + (v + 1) % n_segments
    below, across = here + n_segments, right + n_segments
    faces = np.stack([here, below, across, here, across, right], axis=-1)
    return vertices.reshape(-1, 3).astype(np.float32), faces.reshape(-1, 3).astype(np.int64)


def bolt(n_segments=3750):
    """A part of a machine that lies aslant, of 30,000 triangles: a shaft and a head, whose sides are slivers
    as long as they are, and whose caps are fans."""
    turns = 2 * np.pi * np.arange(n_segments) / n_segments
    circle = np.stack([np.zeros(n_segments), np.cos(turns), np.sin(turns)], axis=-1)
    here, right = np.arange(n_segments), (np.arange(n_segments) + 1) % n_segments
    vertices, faces = [], []
    for left_end, right_end, radius in [(-1.0, 0.8, 0.2), (0.8, 1.0, 0.4)]:
        low, high = radius * circle + [left_end, 0, 0], radius * circle + [right_end, 0, 0]
        first = sum(map(len, vertices))
        centres = [[left_end, 0, 0], [right_end, 0, 0]]
        vertices += [low, high, np.float64(centres)]
        above, middle = here + n_segments, 2 * n_segments
        faces += [
            first + np.stack(corners, axis=-1)
            for corners in [
                (here, right, above),
                (right, right + n_segments, above),
                (right, here, np.full(n_segments, middle)),
                (above, right + n_segments, np.full(n_segments, middle + 1)),
            ]
        ]
    vertices = np.concatenate(vertices)
    third = np.sqrt(np.float64(1 / 3))
    axes = np.float64([[third, third, third], [-(0.5**0.5), 0.5**0.5, 0]])
    rotation = np.stack([*axes, np.cross(*axes)])
    return (vertices @ rotation).astype(np.float32), np.concatenate(faces).astype(np.int64)


#: Scenes that need no file: the mesh, and where its second copy is.
GENERATED = {
    "ball": (ball, np.float32([0.7, 0.05, 0.02])),
    "bolt": (bolt, np.float32([0.4, -0.1, 0.05])),
}
#: In these, the boxes of so many pairs of triangles overlap in the first frame.
BOXES = {"bolt": 95_828_482}


class Scene:
    """Two copies of a mesh, their frames, and the published pairs if there are any."""

    def __init__(self, name, data, n_frames):
        self.name = name
        self.published = None
        if name in GENERATED:
            build, offset = GENERATED[name]
            self.vertices, self.faces = build()
        else:
            entry = json.loads((data / "expected" / "two_body.json").read_text())[name]
            self.vertices, self.faces = read_ply(data / entry["mesh"])
            offset = np.array(entry["offset_f32"], np.float32)
            self.published = contenders.as_keys(np.load(data / entry["file"]))
        twists = np.linspace(0, TWIST, n_frames)
        self.frames = [(self.twisted(twist, 0), self.twisted(-twist, offset)) for twist in twists]

    def twisted(self, twist, offset):
        """The mesh turned about the x axis by an angle proportional to x; float32."""
        vertices = self.vertices + np.float32(offset)
        x, y, z = vertices.T.astype(np.float64)
        angle = twist * (x - x.mean())
        cos, sin = np.cos(angle), np.sin(angle)
        return np.stack([x, cos * y - sin * z, sin * y + cos * z], axis=1).astype(np.float32)

    def truth(self, reference):
        """The exact pairs of every frame, as sorted keys."""
        reference.start(self.faces, self.faces, *self.frames[0])
        truth = []
        for frame in self.frames:
            arrays = reference.arrays(*frame)
            reference.build(arrays)
            reference.query()
            truth.append(contenders.as_keys(reference.pairs()))
        if self.published is not None and not np.array_equal(self.published, truth[0]):
            raise AssertionError(
                f"{self.name}: {reference.name} disagrees with the published pairs"
            )
        return truth


def run(contender, scene, truth, seconds):
    """Medians in milliseconds and wrong pairs, over all frames and rounds.

    Every frame is run at least once, then further rounds until `seconds` have passed.
    """
    contender.start(scene.faces, scene.faces, *scene.frames[0])
    frames = [contender.arrays(*frame) for frame in scene.frames]
    builds, queries, n_pairs, n_extra, n_missing = [], [], 0, 0, 0
    rounds, began = 0, time.perf_counter()
    while rounds == 0 or time.perf_counter() - began < seconds:
        for frame, exact in zip(frames, truth):
            t0 = time.perf_counter()
            contender.build(frame)
            t1 = time.perf_counter()
            contender.query()
            t2 = time.perf_counter()
            moved = contender.build_within_query_ms()
            builds.append(1e3 * (t1 - t0) + moved)
            queries.append(1e3 * (t2 - t1) - moved)
            if rounds == 0:
                keys = contenders.as_keys(contender.pairs())
                n_pairs += len(keys)
                n_extra += len(np.setdiff1d(keys, exact, assume_unique=True))
                n_missing += len(np.setdiff1d(exact, keys, assume_unique=True))
        rounds += 1
    return {
        "contender": contender.name,
        "version": contender.version,
        "settings": contender.settings,
        "exact": contender.exact,
        "once_ms": contender.once_ms(),
        "build_ms": statistics.median(builds),
        "query_ms": statistics.median(queries),
        "frame_ms": statistics.median(map(sum, zip(builds, queries))),
        "fastest_frame_ms": min(map(sum, zip(builds, queries))),
        "rounds": rounds,
        "pairs": n_pairs,
        "extra": n_extra,
        "missing": n_missing,
    }


def milliseconds(time):
    """A time with about three significant digits; empty for None."""
    if time is None:
        return ""
    return f"{time:,.0f}" if time >= 100 else f"{time:.{1 if time >= 10 else 3}f}"


def table(scene, reference, truth, rows, left_out):
    """The results of one scene as Markdown."""
    n = len(scene.faces)
    lines = [
        f"### {scene.name}: {n:,} triangles against {n:,}, {len(truth)} frames",
        "",
        f"{sum(map(len, truth)):,} true pairs in all frames (by {reference}); times in "
        "milliseconds per frame.",
        "",
        "| | once | build | query | frame | pairs | wrong | times impinge |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    ours = rows[0]["frame_ms"]
    for row in rows:
        times = [row["once_ms"], row["build_ms"], row["query_ms"], row["frame_ms"]]
        wrong = f"+{row['extra']:,} −{row['missing']:,}" if row["extra"] + row["missing"] else "0"
        cells = [row["contender"], *map(milliseconds, times), f"{row['pairs']:,}", wrong]
        lines.append(f"| {' | '.join(cells)} | {row['frame_ms'] / ours:,.1f} |")
    for contender in left_out:
        lines += [
            "",
            f"{contender.name} is left out: it keeps all pairs whose boxes overlap, here {BOXES[scene.name]:,}, "
            "which takes more than 8 GB.",
        ]
    return "\n".join(lines)


def abilities(classes):
    """The abilities of each contender, as Markdown."""
    lines = [
        "### What each contender can do",
        "",
        "| | two meshes | one mesh with itself | tetrahedra | answers | when vertices move |",
        "|---|---|---|---|---|---|",
    ]
    for contender in classes:
        words = [contender.label, *contender.abilities]
        lines.append("| " + " | ".join(words) + " |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument(
        "scenes", nargs="*", help="ball, bolt, bunny, buddha, dragon; all by default"
    )
    parser.add_argument("--frames", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=2.0, help="for each contender, at least")
    parser.add_argument("--record", action="store_true", help="write to bench/record as well")
    parser.add_argument("--machine", default=machine(), help="the machine's name in the record")
    arguments = parser.parse_args()
    if arguments.frames < 1:
        parser.error(f"--frames: at least 1, {arguments.frames} given")

    data = pathlib.Path(os.environ.get("IMPINGE_DATA", ROOT.parent / "shared" / "data"))
    known = [*GENERATED]
    if (data / "expected" / "two_body.json").is_file():
        known += ["bunny", "buddha", "dragon"]
    else:
        print("no meshes: set IMPINGE_DATA; only generated scenes are run", file=sys.stderr)
    unknown = set(arguments.scenes) - set(known)
    if unknown:
        parser.error(f"no scene {', '.join(sorted(unknown))}; there is {', '.join(known)}")

    present, missing = contenders.available()
    for contender in missing:
        print(f"{contender.label} is missing: pip install {contender.package}", file=sys.stderr)
    reference = contenders.reference(present)

    parts, record, failed = [], {}, False
    for name in arguments.scenes or known:
        scene = Scene(name, data, arguments.frames)
        truth = scene.truth(reference)
        rows, left_out = [], []
        for contender in present:
            if BOXES.get(name, 0) > contender.most_boxes:
                left_out.append(contender)
                continue
            row = run(contender, scene, truth, arguments.seconds)
            print(f"{name}: {row['contender']} {row['frame_ms']:.3g} ms per frame", file=sys.stderr)
            rows.append(row)
            if contender.exact and row["extra"] + row["missing"]:
                print(f"{name}: {row['contender']} claims to be exact and is not", file=sys.stderr)
                failed = True
        parts.append(table(scene, reference.name, truth, rows, left_out))
        record[name] = {"n_triangles": len(scene.faces), "frames": len(truth), "rows": rows}

    today = datetime.date.today().isoformat()
    classes = list({contender.label: type(contender) for contender in present}.values())
    versions = dict.fromkeys(f"{type(c).label} {c.version} ({c.settings})" for c in present)
    text = "\n\n".join(
        [
            f"# impinge and its peers, {today}",
            f"{arguments.machine}. Python {platform.python_version()}, NumPy {np.__version__}. "
            "Made by `bench/compare.py`, which says what is timed and checked.",
            *parts,
            abilities(classes),
            "Versions and settings: " + "; ".join(versions) + ".",
        ]
    )
    print(text)
    if arguments.record:
        head = {"machine": arguments.machine, "date": today, "python": platform.python_version()}
        folder = write_record(arguments.machine, today, "compare", text, {**head, "scenes": record})
        print(f"recorded in {folder.relative_to(ROOT)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
