"""A cloth falls on a ball that breathes: in each frame which elements intersect and how near the two are, then the step to the next
frame as far as it is free.
"""

import pathlib

import impinge
import numpy as np

FOLDER = pathlib.Path(__file__).parent
SIZES = np.array([1.0, 1.015625, 1.03125, 1.015625])


def fall(positions):
    return positions - np.array([0.0, 0.0, 0.03125])


def breathe(rest, frame):
    return rest * SIZES[frame % 4]


def main():
    scene = impinge.Scene()
    cloth = scene.add(impinge.read(FOLDER / "cloth.obj"))
    ball = scene.add(impinge.read(FOLDER / "ball.obj"))
    rest = scene.positions(ball)
    detector = impinge.Detector("cpu")
    for frame in range(10):
        pairs = detector.detect(scene)
        nearest = detector.distance(scene, cloth, ball)
        in_cloth = len(pairs.self_of(cloth))
        print(f"{frame}: {len(pairs.between(cloth, ball))} pairs, {in_cloth} in the cloth, {nearest.distance:.9f} apart")
        scene.set_end_positions(cloth, fall(scene.positions(cloth)))
        scene.set_end_positions(ball, breathe(rest, frame))
        detector.advance(scene, clearance=1e-4).apply(scene)


if __name__ == "__main__":
    main()
