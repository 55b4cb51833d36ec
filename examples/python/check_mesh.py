"""Check a mesh for self-intersections.

    python check_mesh.py part.stl
    python check_mesh.py part.stl --shared-vertex resolve --report pairs.csv

Needs trimesh. Without a file it checks a torus knot that was made to cut through itself.
The exit status is 1 when the mesh intersects itself.
"""

import argparse
import sys

import numpy as np
import trimesh

import impinge


def knotted_tube(n_along=400, n_around=24, radius=0.75):
    """A tube along a trefoil, so thick that it meets itself: (vertices, faces)."""
    t = 2 * np.pi * np.arange(n_along) / n_along
    middle = np.stack(
        [np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], axis=1
    )
    along = np.roll(middle, -1, axis=0) - np.roll(middle, 1, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, along)
    angle = 2 * np.pi * np.arange(n_around) / n_around
    around = np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * up[:, None]
    vertices = (middle[:, None] + radius * around).reshape(-1, 3)
    ring, spoke = np.divmod(np.arange(n_along * n_around), n_around)
    here, right = ring * n_around + spoke, ring * n_around + (spoke + 1) % n_around
    ahead, both = (here + n_around) % len(vertices), (right + n_around) % len(vertices)
    faces = np.concatenate([np.stack([here, ahead, both], 1), np.stack([here, both, right], 1)])
    return vertices, faces


def main():
    parser = argparse.ArgumentParser(description="Check a mesh for self-intersections.")
    parser.add_argument("mesh", nargs="?", help="any file that trimesh reads")
    parser.add_argument("--shared-vertex", choices=["skip", "resolve"], default="resolve")
    parser.add_argument("--report", help="write the pairs of faces to this CSV file")
    arguments = parser.parse_args()

    if arguments.mesh:
        mesh = trimesh.load(arguments.mesh, process=False, force="mesh")
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    else:
        vertices, faces = knotted_tube()
    # Files such as STL repeat a vertex for every face; faces are neighbours by position.
    vertices, faces, _ = impinge.weld(vertices, faces)

    pairs = impinge.self_pairs(vertices, faces, shared_vertex=arguments.shared_vertex)
    print(f"{len(vertices)} vertices, {len(faces)} faces: {len(pairs)} pairs of faces intersect")
    for a, b in pairs[:5]:
        print(f"  face {a} meets face {b} near {vertices[faces[a]].mean(axis=0).round(4)}")
    if len(pairs) > 5:
        print(f"  and {len(pairs) - 5} more")
    if arguments.report:
        np.savetxt(
            arguments.report, pairs, fmt="%d", delimiter=",", header="face,face", comments=""
        )
    return 1 if len(pairs) else 0


if __name__ == "__main__":
    sys.exit(main())
