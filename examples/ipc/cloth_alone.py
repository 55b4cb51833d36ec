"""An implicit cloth with a barrier and friction that falls on a ball: NumPy, SciPy and impinge, no other library.

    pip install scipy impinge
    python cloth_alone.py                             # 40 frames of 289 vertices
    python cloth_alone.py --size 40 --frames 200 --friction 0

Implicit Euler and Newton's method with a line search, as in Incremental Potential Contact (Li et al. 2020), with friction of the
contacts at the start of a frame. impinge has the contacts with their distances, gradients and Hessians, and says how far
a step can be taken. The barrier is the function of that name below, and friction the class.

After each step the program asks whether anything intersects. It must never be so.
"""

import argparse
import sys
import time

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

import impinge

#: Distance at which the barrier begins, in metres, and its stiffness.
DHAT = 4e-3
BARRIER = 1e6
#: Length of a frame in seconds.
FRAME = 1 / 100
#: Of springs along edges, and across two of them, which resist bending.
STRETCH, BEND = 60.0, 0.5
GRAVITY = np.array([0, 0, -9.81])
#: Slower contacts, in metres per second, stick: their friction is less.
STICK = 1e-2
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


def ball(radius, n):
    """Rings of vertices on a sphere, and a pole at either end."""
    down, around = np.meshgrid(np.pi * np.arange(1, n) / n, np.pi * np.arange(2 * n) / n, indexing="ij")
    points = np.stack([np.sin(down) * np.cos(around), np.sin(down) * np.sin(around), np.cos(down)], axis=-1)
    points = np.concatenate([points.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    ring = np.arange(2 * n)
    index = np.arange(2 * n * (n - 1)).reshape(n - 1, 2 * n)
    a, b, c, d = index[:-1], index[1:], np.roll(index, -1, 1)[1:], np.roll(index, -1, 1)[:-1]
    top, bottom = np.full_like(ring, len(points) - 2), np.full_like(ring, len(points) - 1)
    faces = [[a, b, c], [a, c, d], [top, index[0], np.roll(index[0], -1)], [bottom, np.roll(index[-1], -1), index[-1]]]
    return radius * points, np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in faces])


def barrier(s):
    """ipc-toolkit's barrier, of squared distances, with two derivatives."""
    t = DHAT**2
    log = np.log(s / t)
    value = -((s - t) ** 2) * log
    first = (t - s) * (2 * log - t / s + 1)
    second = (t / s + 2) * (t / s) - 2 * log - 3
    return BARRIER * value, BARRIER * first, BARRIER * second


def outer(a, b):
    return a[:, :, None] * b[:, None, :]


class Sum:
    """A potential that is a sum over groups of vertices: value, and gradient and Hessian as a vector and a sparse matrix."""

    def __init__(self, n_vertices):
        self.size = 3 * n_vertices
        self.gradient = np.zeros(self.size)
        self.parts = []

    def add(self, vertices, gradients, hessians):
        """Rows of vertices, and their share of the derivatives."""
        at = (3 * vertices[:, :, None].astype(np.int64) + np.arange(3)).reshape(len(vertices), 3 * vertices.shape[1])
        self.gradient += np.bincount(at.ravel(), gradients.ravel(), self.size)
        rows, columns = np.broadcast_arrays(at[:, :, None], at[:, None, :])
        self.parts.append((hessians.ravel(), rows.ravel(), columns.ravel()))

    def hessian(self):
        values, rows, columns = (np.concatenate(part) for part in zip(*self.parts))
        return sparse.csc_matrix((values, (rows, columns)), shape=(self.size, self.size))


class Friction:
    """Of the contacts at the start of a frame, with their forces and normals of then (Li et al. 2020, section 5)."""

    def __init__(self, contacts, start, coefficient):
        self.vertices, self.c = contacts.vertices, contacts.coefficients
        self.start = start
        s = contacts.squared_distances
        force = -2 * np.sqrt(s) * barrier(s)[1]
        self.force = coefficient * contacts.weights * contacts.mollifiers * force
        normal = np.einsum("nv,nvk->nk", self.c, start[self.vertices])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        self.plane = np.eye(3) - outer(normal, normal)

    def slip(self, x):
        """How far contacts have slid, and how far at least, so that nothing is divided by 0."""
        way = np.einsum("nv,nvk->nk", self.c, (x - self.start)[self.vertices])
        slip = np.einsum("nij,nj->ni", self.plane, way)
        return slip, np.maximum(np.linalg.norm(slip, axis=1), 1e-12)

    def value(self, x):
        y = self.slip(x)[1] / (STICK * FRAME)
        y = np.where(y < 1, y**2 - y**3 / 3 + 1 / 3, y)
        return STICK * FRAME * (self.force * y).sum()

    def add_to(self, total, x):
        slip, length = self.slip(x)
        along = slip / length[:, None]
        y = length / (STICK * FRAME)
        first = np.where(y < 1, 2 * y - y**2, 1)
        second = np.where(y < 1, 2 - 2 * y, 0) / (STICK * FRAME)
        across = (self.force * first / length)[:, None, None] * (self.plane - outer(along, along))
        block = across + (self.force * second)[:, None, None] * outer(along, along)
        gradients = self.c[:, :, None] * (self.force * first)[:, None, None] * along[:, None, :]
        hessians = np.einsum("nv,nw,nij->nviwj", self.c, self.c, block)
        total.add(self.vertices, gradients, hessians)


class Cloth:
    """A cloth of springs above a ball that stands still, to one side of its middle."""

    def __init__(self, n, friction):
        cloth, faces = square(n, 0.31)
        obstacle, faces_of_ball = ball(0.3, 12)
        obstacle += [0.05, 0.02, 0]
        self.n, self.coefficient = len(cloth), friction
        self.x = self.rest = np.concatenate([cloth, obstacle])
        self.v = np.zeros((self.n, 3))
        self.scene = impinge.Scene()
        self.cloth = self.scene.add(cloth, faces)
        solid = self.scene.add(obstacle, faces_of_ball)
        self.detector = impinge.Detector("cpu")
        self.query = impinge.Query(exclude=(solid, solid))
        edges = self.scene.edges(self.cloth).astype(np.int64)
        index = np.arange(self.n).reshape(n, n)
        bends = [(index[2:], index[:-2]), (index[:, 2:], index[:, :-2])]
        bends = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in bends])
        self.springs = np.concatenate([edges, bends])
        self.stiffness = np.repeat([STRETCH, BEND], [len(edges), len(bends)])
        self.lengths = np.linalg.norm(np.subtract(*self.x[self.springs.T]), axis=1)
        self.mass = 0.2 / self.n
        self.n_iterations = self.most = 0
        self.slips = []

    def contacts(self, x):
        """What is nearer than DHAT."""
        self.scene.set_positions(self.cloth, x[: self.n])
        near = self.detector.near(self.scene, DHAT, query=self.query)
        contacts = near.stencils(self.scene, rest=self.rest).merged()
        self.most = max(self.most, len(contacts))
        return contacts

    def step_size(self, x, dx):
        """How much of a step leaves every pair a fifth of its distance, or 1e-4."""
        self.scene.set_positions(self.cloth, x[: self.n])
        self.scene.set_end_positions(self.cloth, (x + dx)[: self.n])
        return self.detector.advance(self.scene, query=self.query, clearance=1e-4, precision="f64").fraction

    def check(self, x):
        """Asked apart from the simulation."""
        self.scene.set_positions(self.cloth, x[: self.n])
        if self.detector.any(self.scene, query=self.query):
            sys.exit("the cloth intersects")

    def energy(self, x, goal, friction):
        stretch = np.linalg.norm(np.subtract(*x[self.springs.T]), axis=1) - self.lengths
        inertia = 0.5 * self.mass / FRAME**2 * ((x[: self.n] - goal) ** 2).sum()
        contacts = self.contacts(x)
        b = barrier(contacts.squared_distances)[0]
        walls = (contacts.weights * contacts.mollifiers * b).sum()
        return inertia + 0.5 * (self.stiffness * stretch**2).sum() + walls + friction.value(x)

    def derivatives(self, x, goal, friction):
        """Gradient and Hessian for the vertices that move."""
        total = Sum(len(x))
        d = np.subtract(*x[self.springs.T])
        length = np.linalg.norm(d, axis=1)
        along = d / length[:, None]
        pull = (self.stiffness * (length - self.lengths))[:, None] * along
        # Without the part of compressed springs that is not convex.
        across = np.maximum(1 - self.lengths / length, 0)[:, None, None]
        square = outer(along, along)
        block = self.stiffness[:, None, None] * (square + across * (np.eye(3) - square))
        signs = np.array([1, -1])
        total.add(self.springs, signs[:, None] * pull[:, None, :], np.einsum("v,w,nij->nviwj", signs, signs, block))

        contacts = self.contacts(x)
        b, by, by_by = (of[:, None, None] for of in barrier(contacts.squared_distances))
        m, g, mg = contacts.mollifiers[:, None, None], contacts.gradients, contacts.mollifier_gradients
        gradients = by[:, 0] * m[:, 0] * g + b[:, 0] * mg
        hessians = m * (by_by * outer(g, g) + by * contacts.hessians)
        hessians += by * (outer(g, mg) + outer(mg, g)) + b * contacts.mollifier_hessians
        weights = contacts.weights[:, None]
        total.add(contacts.vertices, weights * gradients, weights[:, :, None] * impinge.project_psd(hessians))
        friction.add_to(total, x)

        moving = 3 * self.n
        gradient = total.gradient[:moving] + self.mass / FRAME**2 * (x[: self.n] - goal).ravel()
        inertia = self.mass / FRAME**2 * sparse.identity(moving, format="csc")
        return gradient, (total.hessian()[:moving, :moving] + inertia).tocsc()

    def frame(self):
        start = self.x
        goal = start[: self.n] + FRAME * self.v + FRAME**2 * GRAVITY
        friction = Friction(self.contacts(start), start, self.coefficient)
        for _ in range(300):
            gradient, hessian = self.derivatives(self.x, goal, friction)
            dx = np.zeros_like(self.x)
            dx[: self.n] = splu(hessian).solve(-gradient).reshape(-1, 3)
            if np.abs(dx).max() < TOLERANCE * FRAME:
                break
            self.n_iterations += 1
            step = self.step_size(self.x, dx)
            before = self.energy(self.x, goal, friction)
            slope = gradient @ dx[: self.n].ravel()
            while self.energy(self.x + step * dx, goal, friction) > before + 1e-4 * step * slope and step > 1e-12:
                step /= 2
            self.x = self.x + step * dx
            self.check(self.x)
        else:
            sys.exit("Newton's method does not converge")
        self.v = (self.x - start)[: self.n] / FRAME
        self.slips.extend(friction.slip(self.x)[1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=17, help="vertices along an edge of the cloth")
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--friction", type=float, default=0.5, help="its coefficient")
    arguments = parser.parse_args()
    cloth = Cloth(arguments.size, arguments.friction)
    start = time.perf_counter()
    for _ in range(arguments.frames):
        cloth.frame()
    seconds = time.perf_counter() - start
    slid = np.mean(cloth.slips) / FRAME if cloth.slips else 0.0
    print(
        f"{arguments.frames} frames, {cloth.n} vertices, {cloth.n_iterations} iterations, at most {cloth.most} contacts, "
        f"which slid at {1e3 * slid:.1f} mm/s, no intersection, {seconds:.1f} s"
    )


if __name__ == "__main__":
    main()
