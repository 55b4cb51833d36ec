"""Cloth that never intersects itself or what it meets: XPBD, with `near` for its contacts and `truncate` for its steps.

    python cloth.py                                        # three small scenes
    python cloth.py --scene twist --vertices 10000 --frames 1000 --out frames
    impinge view frames/twist.obj frames/twist.pc2

Each step: vertices go where their velocities take them; distance constraints along edges, across faces and across edges are solved
(XPBD, Macklin et al. 2016), together with one constraint per pair of elements that `near` finds; then `truncate` says how far each
vertex can go. Its positions are proven free, rounding included. The program ends with an error if the exact test `any` ever finds an
intersection in a stored state. There is no friction.

`crates/impinge/examples/cloth.rs` is the same program in Rust. Both print the same numbers: all arithmetic is adding, multiplying,
dividing and square roots of float64 in one order, and the answers are the same in both languages.
"""

import argparse
import pathlib
import struct
import sys
import time

import impinge
import numpy as np

DT = 0.01
GRAVITY = -9.81
#: What is left of a velocity after a step.
DAMPING = 0.99
ITERATIONS = 20
#: Compliance of edges, of diagonals and of bending, in metres per newton with vertices of one kilogram.
STRETCH, SHEAR, BEND = 0.0, 1e-6, 1e-4
#: Elements are pushed apart to this share of an edge, and looked for within that one, with this margin for later steps.
THICKNESS, REACH, MARGIN = 0.3, 0.5, 0.125
#: Of a contact. Beside pinned vertices the sum of squares of weights may be tiny, and what it divides
#: would move others by 10^11 metres.
LEAST_MASS = 0.01
#: Of a denominator that may be 0.
TINY = 1e-30
#: Tangent of half the angle by which an end of the twisted cloth turns per step, about 1.4 degrees.
TURN = 0.0125
#: How far the middle is pulled per step.
PULL = 0.004


def circle(n):
    """Points of the unit circle, n of them, a power of two: halves of halves of a quarter, so that they are the same everywhere."""
    points = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
    while len(points) < n:
        finer = []
        for (x, y), (u, v) in zip(points, points[1:] + points[:1]):
            a, b = x + u, y + v
            length = np.sqrt(a * a + b * b)
            finer += [(x, y), (a / length, b / length)]
        points = finer
    return points


def ball(radius, n):
    """A ball below the origin that touches it; circles of latitude between two poles."""
    round_, half = circle(n), n // 2
    points = [(0.0, 0.0, 0.0)]
    for up, out in round_[1:half]:
        points += [(radius * out * x, radius * out * y, radius * up - radius) for x, y in round_]
    points.append((0.0, 0.0, -radius - radius))
    last = len(points) - 1
    faces = []
    for k in range(n):
        following = (k + 1) % n
        faces.append((0, 1 + k, 1 + following))
        for ring in range(half - 2):
            a, b = 1 + ring * n + k, 1 + ring * n + following
            faces += [(a, a + n, b + n), (a, b + n, b)]
        faces.append((last, last - n + following, last - n + k))
    return points, faces


def torus(far, near, n, m):
    """A ring around the z axis: n circles of m points."""
    round_, small = circle(n), circle(m)
    points = [((far + near * c) * x, (far + near * c) * y, near * s) for x, y in round_ for c, s in small]
    faces = []
    for i in range(n):
        for j in range(m):
            a, b = i * m + j, i * m + (j + 1) % m
            c, d = (i + 1) % n * m + j, (i + 1) % n * m + (j + 1) % m
            faces += [(a, c, d), (a, d, b)]
    return points, faces


def side_of(n_vertices, n_layers):
    """The least side of a square of vertices that has as many as asked for, over all layers."""
    side = 3
    while side * side * n_layers < n_vertices:
        side += 1
    return side


class Cloth:
    """Square sheets one above the other, as one body."""

    def __init__(self, side, n_layers, height):
        self.side = side
        self.edge = 1.0 / (side - 1)
        points, faces = [], []
        springs = {}
        for layer in range(n_layers):
            first = layer * side * side
            skew = 0.13 if layer % 2 == 0 else -0.11
            for i in range(side):
                for j in range(side):
                    x, y = i * self.edge - 0.5, j * self.edge - 0.5
                    # A little askew, so that nothing is symmetric.
                    points.append((x + skew * y, y - skew * x, height + 0.02 * layer))
            for i in range(side - 1):
                for j in range(side - 1):
                    a = first + i * side + j
                    faces += [(a, a + side, a + side + 1), (a, a + side + 1, a + 1)]
            # No two springs of a group share a vertex, so that their order does not matter.
            for i in range(side):
                for j in range(side):
                    a = first + i * side + j
                    for name, di, dj, parity, compliance in [
                        ("rows", 1, 0, i % 2, STRETCH),
                        ("columns", 0, 1, j % 2, STRETCH),
                        ("diagonals", 1, 1, i % 2, SHEAR),
                        ("others", 1, -1, i % 2, SHEAR),
                        ("along", 2, 0, i // 2 % 2, BEND),
                        ("across", 0, 2, j // 2 % 2, BEND),
                    ]:
                        if i + di < side and 0 <= j + dj < side:
                            springs.setdefault((name, parity, compliance), []).append((a, a + di * side + dj))
        self.faces = np.array(faces, np.uint32)
        # The last row stands for what is not of the cloth.
        self.rest = np.array([*points, (0.0, 0.0, 0.0)])
        names = ["rows", "columns", "diagonals", "others", "along", "across"]
        order = sorted(springs, key=lambda group: (names.index(group[0]), group[1]))
        self.springs = [(np.array(springs[group]), group[2] / (DT * DT)) for group in order]
        self.moves = np.ones(len(points) + 1)
        self.moves[-1] = 0.0

    def pin(self, pinned):
        self.moves[pinned] = 0.0
        held = []
        for ends, compliance in self.springs:
            held.append((ends[self.moves[ends].sum(axis=1) > 0], compliance))
        self.springs = held
        self.lengths = [length(self.rest[ends[:, 1]] - self.rest[ends[:, 0]]) for ends, _ in held]


def dot(a, b):
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def length(a):
    return np.sqrt(dot(a, a))


def turned(n_steps):
    """Cosine and sine after so many turns."""
    square = TURN * TURN
    cos, sin = (1.0 - square) / (1.0 + square), 2.0 * TURN / (1.0 + square)
    c, s = 1.0, 0.0
    for _ in range(n_steps):
        c, s = c * cos - s * sin, c * sin + s * cos
    return c, s


class World:
    def __init__(self, name, n_vertices):
        self.name = name
        self.scene = impinge.Scene()
        fixed = []
        if name == "drop":
            self.cloth = Cloth(side_of(n_vertices, 2), 2, 0.03)
            self.pinned = np.zeros(0, int)
            floor = [(-2.0, -2.0, -0.7), (2.0, -2.0, -0.7), (2.0, 2.0, -0.7), (-2.0, 2.0, -0.7)]
            fixed = [ball(0.3, 32), (floor, [(0, 1, 2), (0, 2, 3)])]
        else:
            self.cloth = Cloth(side_of(n_vertices, 1), 1, 0.06 if name == "ring" else 0.0)
            side = self.cloth.side
            if name == "twist":
                self.pinned = np.concatenate([np.arange(side), np.arange(side * side - side, side * side)])
            else:
                middle = side // 2
                around = range(middle - side // 16, middle + side // 16 + 1)
                self.pinned = np.array([i * side + j for i in around for j in around])
                fixed = [torus(0.3, 0.04, 32, 16)]
        self.cloth.pin(self.pinned)
        start = self.cloth.rest[:-1].astype(np.float32)
        self.body = self.scene.add(start, self.cloth.faces)
        self.fixed = [(np.array(points, np.float32), np.array(faces, np.uint32)) for points, faces in fixed]
        for points, faces in self.fixed:
            self.scene.add(points, faces)
        self.others = [points.astype(np.float64) for points, _ in self.fixed]
        self.detector = impinge.Detector("cpu", reuse_margin=MARGIN * self.cloth.edge)
        self.velocities = np.zeros_like(self.cloth.rest)
        self.n_steps = self.n_near = self.n_cut = 0
        self.seconds = {"near": 0.0, "solve": 0.0, "truncate": 0.0, "any": 0.0}

    def timed(self, name, ask):
        start = time.perf_counter()
        answer = ask()
        self.seconds[name] += time.perf_counter() - start
        return answer

    def targets(self):
        """Where the pinned vertices are to be after this step."""
        at = self.cloth.rest[self.pinned].copy()
        if self.name == "twist":
            c, s = turned(self.n_steps + 1)
            s = np.where(at[:, 0] < 0.0, s, -s)
            y, z = at[:, 1].copy(), at[:, 2].copy()
            at[:, 1], at[:, 2] = y * c - z * s, y * s + z * c
        if self.name == "ring":
            at[:, 2] = at[:, 2] - PULL * (self.n_steps + 1)
        return at

    def contacts(self, at):
        """For each near pair: four vertices with signed weights, the normal, and what is not of the cloth of the distance along it."""
        reach = REACH * self.cloth.edge
        stencils = self.timed(
            "near", lambda: self.detector.near(self.scene, reach, of=self.body, kinds=("vf", "ee")).stencils(self.scene)
        )
        self.n_near = len(stencils)
        start = time.perf_counter()
        vertices, weights = stencils.vertices.astype(int), stencils.coefficients
        points = np.concatenate([at[:-1], *self.others])[vertices]
        across = np.zeros((len(stencils), 3))
        for k in range(4):
            across = across + weights[:, k, None] * points[:, k]
        normal = across / np.maximum(length(across), TINY)[:, None]
        # The cloth is the first body of the scene, so its vertices are the first.
        nobody = len(at) - 1
        ours = vertices < nobody
        offset = np.zeros(len(stencils))
        for k in range(4):
            offset = offset + np.where(ours[:, k], 0.0, weights[:, k] * dot(normal, points[:, k]))
        self.seconds["solve"] += time.perf_counter() - start
        return np.where(ours, vertices, nobody), np.where(ours, weights, 0.0), normal, offset

    def push(self, to, contacts, masses):
        """Moves vertices of pairs that are too near apart, each by the mean over its pairs."""
        vertices, weights, normal, offset = contacts
        if len(vertices) == 0:
            return
        gap = offset - THICKNESS * self.cloth.edge
        for k in range(4):
            gap = gap + weights[:, k] * dot(normal, to[vertices[:, k]])
        push = np.where(gap < 0.0, -gap, 0.0) / masses
        which = vertices.ravel()
        part = (weights * self.cloth.moves[vertices] * push[:, None]).ravel()
        n_pairs = np.bincount(which, (part != 0.0).astype(float), len(to))
        n_pairs = np.maximum(n_pairs, 1.0)
        for axis in range(3):
            moved = np.bincount(which, part * np.repeat(normal[:, axis], 4), len(to))
            to[:, axis] = to[:, axis] + moved / n_pairs

    def step(self):
        cloth = self.cloth
        at = np.zeros_like(cloth.rest)
        at[:-1] = self.scene.positions(self.body)
        contacts = self.contacts(at)
        start = time.perf_counter()
        moves = cloth.moves[:, None]
        if self.name != "twist":
            self.velocities[:, 2] = self.velocities[:, 2] + GRAVITY * DT
        to = at + moves * (self.velocities * DT)
        to[self.pinned] = self.targets()
        masses = np.zeros(len(contacts[0]))
        for k in range(4):
            masses = masses + contacts[1][:, k] * contacts[1][:, k] * cloth.moves[contacts[0][:, k]]
        masses = np.maximum(masses, LEAST_MASS)
        forces = [np.zeros(len(ends)) for ends, _ in cloth.springs]
        for _ in range(ITERATIONS):
            for (ends, compliance), rest, force in zip(cloth.springs, cloth.lengths, forces):
                a, b = ends[:, 0], ends[:, 1]
                way = to[b] - to[a]
                now = np.maximum(length(way), TINY)
                more = (rest - now - compliance * force) / (cloth.moves[a] + cloth.moves[b] + compliance)
                force += more
                pull = way * (more / now)[:, None]
                to[a] = to[a] - moves[a] * pull
                to[b] = to[b] + moves[b] * pull
            self.push(to, contacts, masses)
        self.seconds["solve"] += time.perf_counter() - start
        self.scene.set_end_positions(self.body, to[:-1].astype(np.float32))
        truncation = self.timed("truncate", lambda: self.detector.truncate(self.scene))
        truncation.apply(self.scene)
        self.n_cut += truncation.n_cut
        after = self.scene.positions(self.body).astype(np.float64)
        self.velocities[:-1] = (after - at[:-1]) * (DAMPING / DT)
        self.n_steps += 1
        if self.timed("any", lambda: self.detector.any(self.scene)):
            sys.exit(f"{self.name}: the state after step {self.n_steps} intersects")

    def line(self):
        z = self.scene.positions(self.body)[:, 2].astype(np.float64)
        return f"{self.name} {self.n_steps}: {self.n_near} near, {self.n_cut} cut so far, from {z.min():.6f} to {z.max():.6f} high"

    def times(self):
        """Milliseconds per step so far."""
        spent = self.seconds
        ms = ", ".join(f"{part} {1e3 * seconds / self.n_steps:.1f}" for part, seconds in spent.items())
        share = (spent["near"] + spent["truncate"]) / (spent["near"] + spent["truncate"] + spent["solve"])
        return f"{self.name} {self.n_steps}: ms per step: {ms}; near and truncate are {100 * share:.0f} % without any"


class Frames:
    """A mesh and its frames, as `impinge view` and `impinge sequence` read them; and what does not move."""

    def __init__(self, folder, world, n_frames):
        folder.mkdir(parents=True, exist_ok=True)
        positions = world.scene.positions(world.body)
        obj(folder / f"{world.name}.obj", positions, world.cloth.faces)
        for number, (points, faces) in enumerate(world.fixed):
            obj(folder / f"{world.name}_fixed_{number}.obj", points, faces)
        self.file = open(folder / f"{world.name}.pc2", "wb")
        self.file.write(struct.pack("<12siiffi", b"POINTCACHE2", 1, len(positions), 0.0, 1.0, n_frames + 1))

    def add(self, world):
        self.file.write(world.scene.positions(world.body).astype("<f4").tobytes())


def obj(path, points, faces):
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n")


def run(name, n_vertices, n_frames, out):
    world = World(name, n_vertices)
    frames = Frames(out, world, n_frames) if out else None
    if frames:
        frames.add(world)
    print(f"{name}: {world.scene.n_vertices(world.body)} vertices, {len(world.cloth.faces)} faces, {n_frames} steps")
    for step in range(1, n_frames + 1):
        world.step()
        if frames:
            frames.add(world)
        if step * 4 % n_frames < 4:
            print(world.line(), flush=True)
            print(world.times(), file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", choices=["drop", "twist", "ring", "all"], default="all")
    parser.add_argument("--vertices", type=int, default=300, help="at least so many")
    parser.add_argument("--frames", type=int, default=100, help="steps of a hundredth of a second")
    parser.add_argument("--out", type=pathlib.Path, help="a folder for meshes and frames")
    given = parser.parse_args()
    for name in ["drop", "twist", "ring"] if given.scene == "all" else [given.scene]:
        run(name, given.vertices, given.frames, given.out)


if __name__ == "__main__":
    main()
