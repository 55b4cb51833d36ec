"""Colour the colliding faces of two trimesh meshes and write them to one file.

    python color_trimesh.py a.ply b.ply --out coloured.ply

Needs trimesh. Without files it takes a ball and a box.
"""

import argparse

import numpy as np
import trimesh

import impinge

COLLIDING = np.array([214, 39, 40, 255], np.uint8)
FREE = [np.array([174, 199, 232, 255], np.uint8), np.array([199, 199, 199, 255], np.uint8)]


def main():
    parser = argparse.ArgumentParser(description="Colour the colliding faces of two meshes.")
    parser.add_argument("meshes", nargs="*", help="two files that trimesh reads")
    parser.add_argument("--out", default="coloured.ply")
    arguments = parser.parse_args()
    if len(arguments.meshes) not in (0, 2):
        parser.error(f"two meshes expected, {len(arguments.meshes)} given")

    if arguments.meshes:
        meshes = [trimesh.load(path, process=False, force="mesh") for path in arguments.meshes]
    else:
        ball = trimesh.creation.icosphere(subdivisions=5)
        box = trimesh.creation.box(extents=(1.5, 1.0, 1.0)).subdivide_loop(4)
        box.apply_translation([0.9, 0.2, 0.1])
        meshes = [ball, box]

    scene = impinge.Scene()
    # The arrays of trimesh are read where they lie.
    bodies = [scene.add(mesh.vertices, mesh.faces) for mesh in meshes]
    result = impinge.Detector().detect(scene, between=tuple(bodies))

    for mesh, body, colour in zip(meshes, bodies, FREE):
        colours = np.tile(colour, (len(mesh.faces), 1))
        colours[result.colliding(body)] = COLLIDING
        mesh.visual.face_colors = colours
        print(f"{len(result.colliding(body))} of {len(mesh.faces)} faces collide")
    trimesh.util.concatenate(meshes).export(arguments.out)
    print(f"{len(result)} pairs: {arguments.out}")


if __name__ == "__main__":
    main()
