"""A scene tile by tile under a limit of memory, beside the same scene in one process: same hash, core seconds, peak memory.

The scene is one PLY of many dragons that cut into each other (a generated surface where the dragon is absent), for several
numbers of dragons. All steps run on one thread, so that core seconds are what the work costs.
"""

import argparse
import datetime
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

import numpy as np
from meshes import read_ply
from records import ROOT, machine, write_record


def generated():
    """A closed wavy surface of 436,178 triangles: vertices (v, 3) float32, faces (n, 3)."""
    n = 467
    u, v = (axis.ravel() for axis in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    a, b = 2 * np.pi * u / n, 2 * np.pi * v / n
    tube = 0.3 + 0.05 * np.sin(9 * a) * np.cos(7 * b)
    ring = 1 + tube * np.cos(b)
    vertices = np.stack([ring * np.cos(a), ring * np.sin(a), tube * np.sin(b)], axis=1).astype(np.float32)
    right, up = (u + 1) % n * n + v, u * n + (v + 1) % n
    corner = (u + 1) % n * n + (v + 1) % n
    here = u * n + v
    faces = np.concatenate([np.stack([here, right, corner], 1), np.stack([here, corner, up], 1)])
    return vertices, faces


def write_copies(path, vertices, faces, n):
    """Writes `n` copies on a lattice so narrow that each cuts into its neighbours, as one binary PLY."""
    size = (vertices.max(axis=0) - vertices.min(axis=0)) * np.float32(0.75)
    side = int(np.ceil(n ** (1 / 3)))
    row = np.dtype([("n", "u1"), ("face", "<i4", 3)])
    with open(path, "wb") as file:
        header = [
            "ply",
            "format binary_little_endian 1.0",
            f"element vertex {n * len(vertices)}",
            *(f"property float {axis}" for axis in "xyz"),
            f"element face {n * len(faces)}",
            "property list uchar int vertex_indices",
            "end_header\n",
        ]
        file.write("\n".join(header).encode())
        for ix in range(n):
            place = np.array([ix % side, ix // side % side, ix // side**2], np.float32)
            # A little further for each copy, so that no two faces of neighbours coincide.
            file.write((vertices + place * size + np.float32(1e-3 * ix) * size).astype("<f4").tobytes())
        for ix in range(n):
            rows = np.empty(len(faces), row)
            rows["n"], rows["face"] = 3, faces + ix * len(vertices)
            file.write(rows.tobytes())


def run(command, limit=None):
    """What a command prints as JSON; its seconds on a clock and on cores, and its peak memory in bytes."""

    def limited():
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    start = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.PIPE, preexec_fn=limited if limit else None)
    printed = child.stdout.read()
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        raise SystemExit(f"{command}: exit code {child.returncode}")
    cost = {
        "s": time.perf_counter() - start,
        "core_s": used.ru_utime + used.ru_stime,
        "peak_bytes": used.ru_maxrss * 1024,
    }
    return json.loads(printed.splitlines()[-1]), cost


def measure(program, mesh, folder, arguments):
    """One scene: all steps of tiles, then one process."""
    limit = arguments.limit << 20
    costs, tiles = {}, folder / "tiles"
    steps = [
        ("plan", [mesh, "--cap", str(arguments.cap), "--chunk", "100k", "--no-weld"]),
        ("scatter", ["--threads", "1"]),
        ("run", ["--self", "--shared-vertex", "skip", "--threads", "1"]),
        ("merge", []),
    ]
    for step, options in steps:
        quiet = [] if step == "merge" else ["--no-progress"]
        command = [program, "tiles", step, tiles, *options, *quiet, "--json"]
        printed, costs[step] = run(command, limit)
        print(f"  {step}: {costs[step]}", file=sys.stderr)
        if step == "scatter":
            records = printed["records"]
    disk = sum(file.stat().st_size for file in (tiles / "parts").iterdir())
    n_tiles = sum(1 for _ in (tiles / "results").glob("tile-*.json"))
    scene = {
        "records": records,
        "tiles": n_tiles,
        "bytes_on_disk": disk,
        "pairs": printed["pairs"],
        "hash": printed["hash"],
        "steps": costs,
    }
    options = ["--no-weld", "--shared-vertex", "skip", "--backend", "cpu", "--threads", "1", "--no-progress", "--json"]
    whole, cost = run([program, "self", mesh, *options])
    print(f"  whole: {cost}", file=sys.stderr)
    if (whole["pairs"], whole["hash"]) != (printed["pairs"], printed["hash"]):
        raise SystemExit(f"the answers differ: {whole['pairs']} {whole['hash']}, in tiles {printed}")
    return {**scene, "whole": cost}


def disk_seconds(folder, n_bytes):
    """Seconds to write so many bytes to disk and to read them again, from what 1 GiB takes."""
    path, block = folder / "disk", os.urandom(1 << 24)
    start = time.perf_counter()
    with open(path, "wb") as file:
        for _ in range(64):
            file.write(block)
        file.flush()
        os.fsync(file.fileno())
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    written = time.perf_counter() - start
    start = time.perf_counter()
    with open(path, "rb") as file:
        while file.read(1 << 24):
            pass
    read = time.perf_counter() - start
    path.unlink()
    return {"write_s": written * n_bytes / (1 << 30), "read_s": read * n_bytes / (1 << 30)}


def table(scenes, limit):
    """The record as Markdown."""
    lines = [
        "| triangles | tiles | copies | plan | scatter | run | merge | in tiles, per triangle | one process, per triangle | peak, tiles | peak, one process |",
        "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for scene in scenes:
        n, steps = scene["triangles"], scene["steps"]
        core = [steps[step]["core_s"] for step in ("plan", "scatter", "run", "merge")]
        peak = max(step["peak_bytes"] for step in steps.values())
        cells = [
            f"{n:,}",
            str(scene["tiles"]),
            f"{100 * (scene['records'] / n - 1):.1f} %",
            *(f"{seconds:.1f} s" for seconds in core),
            f"{1e6 * sum(core) / n:.2f} µs",
            f"{1e6 * scene['whole']['core_s'] / n:.2f} µs",
            f"{peak / 2**30:.2f} GiB",
            f"{scene['whole']['peak_bytes'] / 2**30:.2f} GiB",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    disk = scenes[-1]["disk"]
    lines += [
        "",
        f"Seconds are of one core. Every step of the tiles ran under a limit of {limit} MiB of address space. Pairs and hashes are the"
        f" same. The parts of the largest scene are {scenes[-1]['bytes_on_disk'] / 1e9:.1f} GB on disk, which this disk writes in"
        f" {disk['write_s']:.1f} s and reads in {disk['read_s']:.1f} s.",
    ]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--copies", type=int, nargs="+", default=[63, 125, 250])
    parser.add_argument("--cap", type=int, default=2_000_000, help="triangles per tile")
    parser.add_argument("--limit", type=int, default=2048, help="MiB of address space for each step of the tiles")
    parser.add_argument("--program", default="impinge", help="the impinge program")
    parser.add_argument("--record", action="store_true", help="write table and numbers to bench/record")
    parser.add_argument("--machine", default=machine(), help="the machine's name in the record")
    arguments = parser.parse_args()
    data = pathlib.Path(os.environ.get("IMPINGE_DATA", ROOT.parent / "shared" / "data"))
    dragon = data / "meshes" / "dragon.ply"
    vertices, faces = read_ply(dragon) if dragon.is_file() else generated()
    scenes = []
    for n in arguments.copies:
        with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR")) as folder:
            folder = pathlib.Path(folder)
            mesh = folder / "copies.ply"
            write_copies(mesh, vertices.astype(np.float32), faces, n)
            print(f"{n * len(faces):,} triangles, {mesh.stat().st_size / 1e9:.1f} GB", file=sys.stderr)
            scene = measure(arguments.program, mesh, folder, arguments)
            scene["disk"] = disk_seconds(folder, scene["bytes_on_disk"])
            scenes.append({"triangles": n * len(faces), **scene})
    today = datetime.date.today().isoformat()
    mesh = "a scan of a dragon" if dragon.is_file() else "a generated surface"
    text = "\n\n".join(
        [
            f"# Tile by tile under a limit of memory, {today}",
            f"{arguments.machine}. Self-collision of copies of {mesh} that cut into each other, {arguments.cap:,} triangles per tile."
            " Made by `bench/tiles.py`.",
            table(scenes, arguments.limit),
        ]
    )
    print(text)
    if arguments.record:
        head = {"machine": arguments.machine, "date": today, "of": mesh, "cap": arguments.cap}
        write_record(arguments.machine, today, "tiles", text, {**head, "scenes": scenes})


if __name__ == "__main__":
    main()
