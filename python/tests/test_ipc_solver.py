"""An implicit solver with ipc-toolkit's barrier: `impinge.ipc` finds its collisions and decides how far its steps go.

Barrier potential, gradient and Hessian are ipctk's; the rest is here. The same solver also runs
with ipctk's step size.
"""

import os

import numpy as np
import pytest

from impinge import ipc

ipctk = pytest.importorskip("ipctk", reason="ipctk is not installed: no barrier")
sparse = pytest.importorskip("scipy.sparse", reason="SciPy is not installed: no solver")
from scipy.sparse.linalg import splu  # noqa: E402

from test_ipc_broad_phase import assert_same_collisions  # noqa: E402

#: Distance at which the barrier begins.
DHAT = 1e-2
#: Length of a frame in seconds.
FRAME = 1 / 100
STIFFNESS = 30.0
BARRIER = 1e5


def grid(n, size, height):
    """A square of n x n vertices: positions and faces."""
    line = np.linspace(-size / 2, size / 2, n)
    x, y = np.meshgrid(line, line, indexing="ij")
    # Turned a little, so that nothing is symmetric.
    points = np.stack([x + 0.13 * y, y - 0.11 * x, np.full_like(x, height)], axis=-1).reshape(-1, 3)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    low = np.stack([corner, corner + n, corner + n + 1], axis=1)
    high = np.stack([corner, corner + n + 1, corner + 1], axis=1)
    return points, np.concatenate([low, high])


def octahedron(radius):
    points = radius * np.concatenate([np.eye(3), -np.eye(3)])
    faces = [
        [0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2],
        [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5],
    ]  # fmt: skip
    return points, np.array(faces)


class Cloth:
    """A cloth of springs that falls on an octahedron, by implicit Euler and Newton's method."""

    def __init__(self, n, step_size, broad_phase=None):
        cloth, faces = grid(n, 1.0, 0.36)
        ball, faces_of_ball = octahedron(0.3)
        self.n = len(cloth)
        self.x = np.concatenate([cloth, ball])
        self.v = np.zeros((self.n, 3))
        faces = np.concatenate([faces, faces_of_ball + self.n]).astype(np.int32)
        self.edges = ipctk.edges(faces)
        self.mesh = ipctk.CollisionMesh(self.x, self.edges, faces)
        self.barrier = ipctk.BarrierPotential(DHAT, BARRIER)
        self.step_size = step_size
        self.broad_phase = broad_phase
        springs = self.edges[(self.edges < self.n).all(axis=1)]
        # Every second vertex of a line as well: against bending.
        index = np.arange(self.n).reshape(n, n)
        bends = (
            [index[2:].ravel(), index[:-2].ravel()],
            [index[:, 2:].ravel(), index[:, :-2].ravel()],
        )
        bends = np.concatenate([np.stack(bend, axis=1) for bend in bends])
        self.springs = np.concatenate([springs, bends])
        weights = np.concatenate([np.full(len(springs), 1.0), np.full(len(bends), 0.02)])
        self.weights = STIFFNESS * weights
        self.lengths = np.linalg.norm(np.subtract(*self.x[self.springs.T]), axis=1)
        self.mass = 1.0 / self.n
        self.n_iterations = self.n_states = 0

    def collisions(self, x):
        theirs = ipctk.NormalCollisions()
        theirs.build(self.mesh, x, DHAT)
        if self.broad_phase is None:
            return theirs
        ours = ipctk.NormalCollisions()
        ours.build(self.mesh, x, DHAT, broad_phase=self.broad_phase)
        assert_same_collisions(ours, theirs)
        return ours

    def energy(self, x, goal):
        d = x[self.springs[:, 0]] - x[self.springs[:, 1]]
        stretch = np.linalg.norm(d, axis=1) - self.lengths
        inertia = 0.5 * self.mass / FRAME**2 * ((x[: self.n] - goal) ** 2).sum()
        springs = 0.5 * (self.weights * stretch**2).sum()
        return inertia + springs + self.barrier(self.collisions(x), self.mesh, x)

    def derivatives(self, x, goal):
        i, j = self.springs.T
        d = x[i] - x[j]
        length = np.linalg.norm(d, axis=1)
        along = d / length[:, None]
        pull = (self.weights * (length - self.lengths))[:, None] * along
        gradient = np.zeros_like(x)
        np.add.at(gradient, i, pull)
        np.add.at(gradient, j, -pull)
        gradient[: self.n] += self.mass / FRAME**2 * (x[: self.n] - goal)
        outer = along[:, :, None] * along[:, None, :]
        # Without the part of compressed springs that is not convex.
        across = np.maximum(1 - self.lengths / length, 0)[:, None, None]
        block = self.weights[:, None, None] * (outer + across * (np.eye(3) - outer))
        rows, columns, values = [], [], []
        for a, b, sign in [(i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)]:
            rows.append(np.broadcast_to(3 * a[:, None, None] + np.arange(3)[:, None], block.shape))
            columns.append(np.broadcast_to(3 * b[:, None, None] + np.arange(3), block.shape))
            values.append(sign * block)
        triple = [
            np.concatenate([part.ravel() for part in parts]) for parts in (values, rows, columns)
        ]
        hessian = sparse.csc_matrix((triple[0], (triple[1], triple[2])), shape=(x.size, x.size))
        collisions = self.collisions(x)
        gradient = gradient.ravel() + self.barrier.gradient(collisions, self.mesh, x)
        hessian = hessian + self.barrier.hessian(
            collisions, self.mesh, x, ipctk.PSDProjectionMethod.CLAMP
        )
        moving = 3 * self.n
        inertia = self.mass / FRAME**2 * sparse.identity(moving, format="csc")
        return gradient[:moving], (hessian[:moving, :moving] + inertia).tocsc()

    def check(self, x):
        self.n_states += 1
        assert not ipc.has_intersections(self.mesh, x)

    def frame(self):
        start = self.x[: self.n].copy()
        goal = start + FRAME * self.v + FRAME**2 * np.array([0, 0, -9.81])
        for _ in range(200):
            gradient, hessian = self.derivatives(self.x, goal)
            dx = np.zeros_like(self.x)
            dx[: self.n] = splu(hessian).solve(-gradient).reshape(-1, 3)
            if np.abs(dx).max() < 1e-2 * FRAME:
                break
            self.n_iterations += 1
            step = self.step_size(self.mesh, self.x, self.x + dx)
            assert step > 0
            # A line search may try any half of it.
            for half in [0.5, 0.25, 2.0**-7]:
                self.check(self.x + half * step * dx)
                self.check(self.x + half * step * ((self.x + dx) - self.x))
            before = self.energy(self.x, goal)
            slope = gradient @ dx[: self.n].ravel()
            while True:
                # As line searches write it: not the formula with the end positions.
                x = self.x + step * dx
                self.check(x)
                if self.energy(x, goal) <= before + 1e-4 * step * slope or step < 1e-12:
                    break
                step /= 2
            self.x = x
        else:
            pytest.fail("no convergence")
        self.v = (self.x[: self.n] - start) / FRAME


def run(n, n_frames, *stage):
    cloth = Cloth(n, *stage)
    for _ in range(n_frames):
        cloth.frame()
    return cloth


def test_a_solver_needs_no_more_iterations_than_with_ipc_toolkit():
    """300 frames, each with the same collisions; a larger cloth with IMPINGE_LONG=1."""
    ipctk.set_logger_level(ipctk.LoggerLevel.off)
    n = 14 if os.environ.get("IMPINGE_LONG") else 7
    ours = run(n, 300, ipc.compute_collision_free_stepsize, ipc.BroadPhase())
    theirs = run(n, 300, ipctk.compute_collision_free_stepsize)
    counts = [(cloth.n_iterations, cloth.n_states) for cloth in (ours, theirs)]
    print("iterations and states, ours and theirs:", counts)
    # It fell, and lies on the octahedron.
    assert ours.x[: ours.n, 2].min() < 0 and len(ours.collisions(ours.x)) > 5
    assert ours.n_iterations <= 1.1 * theirs.n_iterations
