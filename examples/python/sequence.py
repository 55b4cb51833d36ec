"""Two bodies that deform into each other: a progress bar, and a plot of pairs per frame.

    python sequence.py --frames 120 --plot pairs.png

Needs tqdm and matplotlib.
"""

import argparse

import matplotlib
import numpy as np
from tqdm import tqdm

import impinge

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402  (the choice above must come first)


def torus(n_along, n_around, radius=1.0, thickness=0.35):
    """A torus around the z axis: (vertices, faces)."""
    u, v = np.meshgrid(np.arange(n_along), np.arange(n_around), indexing="ij")
    a, b = 2 * np.pi * u / n_along, 2 * np.pi * v / n_around
    reach = radius + thickness * np.cos(b)
    vertices = np.stack([reach * np.cos(a), reach * np.sin(a), thickness * np.sin(b)], axis=-1)

    def at(i, j):
        return (i % n_along) * n_around + j % n_around

    corners = [at(u, v), at(u + 1, v), at(u + 1, v + 1), at(u, v + 1)]
    faces = np.stack([corners[0], corners[1], corners[2], corners[0], corners[2], corners[3]], -1)
    return vertices.reshape(-1, 3).astype(np.float32), faces.reshape(-1, 3)


def twisted(vertices, turns):
    """The vertices turned about the x axis, the more the further along it."""
    x, y, z = vertices.T
    angle = turns * x
    return np.stack(
        [x, np.cos(angle) * y - np.sin(angle) * z, np.sin(angle) * y + np.cos(angle) * z], axis=1
    ).astype(np.float32)


def main():
    parser = argparse.ArgumentParser(description="Pairs a frame of two deforming bodies.")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--faces", type=int, default=20_000, help="faces of each body, about")
    parser.add_argument("--plot", default="pairs.png", help="the picture to write")
    arguments = parser.parse_args()

    n_around = max(3, round((arguments.faces / 8) ** 0.5))
    n_along = 4 * n_around
    vertices, faces = torus(n_along, n_around)
    scene = impinge.Scene()
    a = scene.add(vertices, faces)
    b = scene.add(vertices, faces)
    detector = impinge.Detector()

    times, between, within = np.linspace(0, 1, arguments.frames), [], []
    for time in tqdm(times, unit="frame"):
        # One body twists while it comes nearer, the other swells until it fills its own hole.
        nearer = np.float32([2.5 - 2 * time, 0, 0.1])
        scene.set_positions(a, twisted(vertices, 3 * time) + nearer)
        scene.set_positions(b, torus(n_along, n_around, thickness=0.35 + 0.8 * time)[0])
        result = detector.detect(scene)
        between.append(len(result.between(a, b)))
        within.append(len(result.self_of(a)) + len(result.self_of(b)))

    figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
    axes.plot(times, between, label="between the bodies")
    axes.plot(times, within, label="within a body")
    axes.set(xlabel="time", ylabel="intersecting pairs", title=f"{len(faces)} faces a body")
    axes.legend()
    figure.savefig(arguments.plot, dpi=120)
    print(f"at most {max(between)} pairs between and {max(within)} within: {arguments.plot}")


if __name__ == "__main__":
    main()
