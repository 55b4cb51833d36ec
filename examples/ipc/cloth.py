"""An implicit cloth that falls on a ball: ipc-toolkit's barrier, impinge's collision stage.

    pip install ipctk scipy impinge
    python cloth.py                                   # 300 frames of 1,024 vertices
    python cloth.py --size 52 --frames 100 --beside   # ipc-toolkit's own collision stage is asked the same, and timed

Implicit Euler and Newton's method with a line search, as in Incremental Potential Contact (Li et al. 2020). Potential, gradient and
Hessian of the barrier are ipctk's. Two lines make impinge its collision stage: `broad_phase=` with an object of `impinge.ipc`, and
`compute_collision_free_stepsize` of `impinge.ipc` in place of ipctk's.

With ``--beside`` all questions also go to ipctk's default broad phase and its continuous detection. The program ends with an error
if any set of collisions differs, if a step differs that has the same continuous detection, or if the cloth ever intersects
itself or the ball.
"""

import argparse
import collections
import sys
import time

import ipctk
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from impinge import ipc

#: Distance at which the barrier begins, in metres, and its stiffness.
DHAT = 2e-3
BARRIER = 1e6
#: Length of a frame in seconds.
FRAME = 1 / 100
#: Of springs along edges, and across two of them, which resist bending.
STRETCH, BEND = 60.0, 0.5
GRAVITY = np.array([0, 0, -9.81])
#: Newton's method ends where no vertex would move by more, in metres per second.
TOLERANCE = 1e-2


def square(n, height):
    """A square of n x n vertices, turned a little, so that nothing is symmetric."""
    line = np.linspace(-0.5, 0.5, n)
    x, y = np.meshgrid(line, line, indexing="ij")
    points = np.stack([x + 0.13 * y, y - 0.11 * x, np.full_like(x, height)], axis=-1).reshape(-1, 3)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    low = np.stack([corner, corner + n, corner + n + 1], axis=1)
    high = np.stack([corner, corner + n + 1, corner + 1], axis=1)
    return points, np.concatenate([low, high])


def ball(radius, n_cuts):
    """An octahedron whose faces are cut into four some times, on a sphere."""
    points = np.concatenate([np.eye(3), -np.eye(3)])
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    faces = np.array(faces)
    for _ in range(n_cuts):
        sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        sides, middles = np.unique(sides, axis=0, return_inverse=True)
        a, b, c = faces.T
        ab, bc, ca = len(points) + middles.reshape(-1, 3).T
        points = np.concatenate([points, points[sides].mean(axis=1)])
        rows = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = np.concatenate([np.stack(row, axis=1) for row in rows])
    return radius * points / np.linalg.norm(points, axis=1)[:, None], faces


class Stage:
    """The collision stage: impinge's, and beside it ipctk's own if asked for."""

    def __init__(self, mesh, beside):
        self.mesh = mesh
        self.beside = beside
        self.broad_phase = ipc.BroadPhase()
        self.ms = collections.Counter()
        self.most = self.n_questions = 0

    def timed(self, name, ask, *arguments):
        start = time.perf_counter()
        answer = ask(*arguments)
        self.ms[name] += 1e3 * (time.perf_counter() - start)
        return answer

    def collisions(self, x):
        """What is nearer than DHAT."""

        def found_by(broad_phase):
            found = ipctk.NormalCollisions()
            found.build(self.mesh, x, DHAT, broad_phase=broad_phase)
            return found

        found = self.timed("impinge", lambda: found_by(self.broad_phase))
        self.most = max(self.most, len(found))
        self.n_questions += 1
        if self.beside:
            theirs = self.timed("ipctk", lambda: found_by(None))
            if keys(found) != keys(theirs):
                sys.exit(f"{len(found)} collisions with impinge, {len(theirs)} without, and not the same")
        return found

    def step_size(self, x, goal):
        """How much of the way from x to goal is free."""
        step = self.timed("impinge", ipc.compute_collision_free_stepsize, self.mesh, x, goal)
        if self.beside:
            # Theirs has tolerances, so steps differ a little; with the same continuous detection they are the same.
            ask = ipctk.compute_collision_free_stepsize
            theirs = self.timed("ipctk", ask, self.mesh, x, goal)
            same = ask(self.mesh, x, goal, 0.0, self.broad_phase)
            if same != theirs:
                sys.exit(f"a step of {same} with impinge's broad phase, {theirs} without")
        return step

    def check(self, x):
        """Asked apart from the simulation: it must never be needed."""
        if ipc.has_intersections(self.mesh, x):
            sys.exit("the cloth intersects")


def keys(collisions):
    """The active set, in no order: what is near what, and with which weight."""
    rows = []
    for kind, a, b in [
        ("vv", "vertex0_id", "vertex1_id"),
        ("ev", "edge_id", "vertex_id"),
        ("ee", "edge0_id", "edge1_id"),
        ("fv", "face_id", "vertex_id"),
    ]:
        for of in getattr(collisions, f"{kind}_collisions"):
            pair = getattr(of, a), getattr(of, b)
            rows.append((kind, *(sorted(pair) if kind in ("vv", "ee") else pair), of.weight))
    return sorted(rows)


class Cloth:
    """A cloth of springs above a ball that stands still."""

    def __init__(self, n, beside=False):
        cloth, faces = square(n, 0.31)
        obstacle, faces_of_ball = ball(0.3, 3)
        self.n = len(cloth)
        self.x = np.asfortranarray(np.concatenate([cloth, obstacle]))
        self.v = np.zeros((self.n, 3))
        faces = np.concatenate([faces, faces_of_ball + self.n]).astype(np.int32)
        edges = ipctk.edges(faces)
        self.mesh = ipctk.CollisionMesh(self.x, edges, faces)
        self.mesh.can_collide = ipctk.make_static_obstacle_filter(self.n)
        self.barrier = ipctk.BarrierPotential(DHAT, BARRIER)
        self.stage = Stage(self.mesh, beside)
        stretch = edges[(edges < self.n).all(axis=1)]
        index = np.arange(self.n).reshape(n, n)
        bends = [(index[2:], index[:-2]), (index[:, 2:], index[:, :-2])]
        bends = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in bends])
        self.springs = np.concatenate([stretch, bends])
        self.stiffness = np.repeat([STRETCH, BEND], [len(stretch), len(bends)])
        self.lengths = np.linalg.norm(np.subtract(*self.x[self.springs.T]), axis=1)
        self.mass = 0.2 / self.n
        self.n_iterations = 0

    def energy(self, x, goal):
        d = np.subtract(*x[self.springs.T])
        stretch = np.linalg.norm(d, axis=1) - self.lengths
        inertia = 0.5 * self.mass / FRAME**2 * ((x[: self.n] - goal) ** 2).sum()
        springs = 0.5 * (self.stiffness * stretch**2).sum()
        return inertia + springs + self.barrier(self.stage.collisions(x), self.mesh, x)

    def derivatives(self, x, goal):
        """Gradient and Hessian for the vertices that move."""
        i, j = self.springs.T
        d = x[i] - x[j]
        length = np.linalg.norm(d, axis=1)
        along = d / length[:, None]
        pull = (self.stiffness * (length - self.lengths))[:, None] * along
        gradient = np.zeros_like(x)
        np.add.at(gradient, i, pull)
        np.add.at(gradient, j, -pull)
        gradient[: self.n] += self.mass / FRAME**2 * (x[: self.n] - goal)
        outer = along[:, :, None] * along[:, None, :]
        # Without the part of compressed springs that is not convex.
        across = np.maximum(1 - self.lengths / length, 0)[:, None, None]
        block = self.stiffness[:, None, None] * (outer + across * (np.eye(3) - outer))
        rows, columns, values = [], [], []
        for a, b, sign in [(i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)]:
            rows.append(np.broadcast_to(3 * a[:, None, None] + np.arange(3)[:, None], block.shape))
            columns.append(np.broadcast_to(3 * b[:, None, None] + np.arange(3), block.shape))
            values.append(sign * block)
        values, rows, columns = (
            np.concatenate([part.ravel() for part in parts]) for parts in (values, rows, columns)
        )
        hessian = sparse.csc_matrix((values, (rows, columns)), shape=(x.size, x.size))
        collisions = self.stage.collisions(x)
        gradient = gradient.ravel() + self.barrier.gradient(collisions, self.mesh, x)
        hessian = hessian + self.barrier.hessian(
            collisions, self.mesh, x, ipctk.PSDProjectionMethod.CLAMP
        )
        moving = 3 * self.n
        inertia = self.mass / FRAME**2 * sparse.identity(moving, format="csc")
        return gradient[:moving], (hessian[:moving, :moving] + inertia).tocsc()

    def frame(self):
        start = self.x[: self.n].copy()
        goal = start + FRAME * self.v + FRAME**2 * GRAVITY
        for _ in range(300):
            gradient, hessian = self.derivatives(self.x, goal)
            dx = np.zeros_like(self.x)
            dx[: self.n] = splu(hessian).solve(-gradient).reshape(-1, 3)
            if np.abs(dx).max() < TOLERANCE * FRAME:
                break
            self.n_iterations += 1
            step = self.stage.step_size(self.x, self.x + dx)
            before = self.energy(self.x, goal)
            slope = gradient @ dx[: self.n].ravel()
            while self.energy(self.x + step * dx, goal) > before + 1e-4 * step * slope and step > 1e-12:
                step /= 2
            self.x = self.x + step * dx
            self.stage.check(self.x)
        else:
            sys.exit("Newton's method does not converge")
        self.v = (self.x[: self.n] - start) / FRAME


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=32, help="vertices along an edge of the cloth")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--beside", action="store_true", help="ask ipctk's own collision stage, too")
    arguments = parser.parse_args()
    ipctk.set_logger_level(ipctk.LoggerLevel.off)
    cloth = Cloth(arguments.size, arguments.beside)
    stage = cloth.stage
    start = time.perf_counter()
    for _ in range(arguments.frames):
        cloth.frame()
    seconds = time.perf_counter() - start
    print(
        f"{arguments.frames} frames, {cloth.mesh.num_vertices} vertices, {cloth.n_iterations} iterations, "
        f"at most {stage.most} collisions, no intersection, {seconds:.1f} s"
    )
    for name, ms in stage.ms.items():
        print(f"collision stage of {name}: {ms / arguments.frames:.2f} ms per frame")
    if arguments.beside:
        print(f"{stage.n_questions} sets of collisions are the same")


if __name__ == "__main__":
    main()
