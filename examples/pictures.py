"""Runs an example and writes what it has made as files that the program draws: what `scripts/picture examples` runs.

python pictures.py NAME FOLDER
"""

import importlib.util
import re
import sys
from pathlib import Path

import impinge
import numpy as np

EXAMPLES = Path(__file__).resolve().parent
OUT = Path(sys.argv[2])


def load(name):
    path = EXAMPLES / name
    found = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def write(name, vertices, faces):
    with open(OUT / f"{name}.obj", "w") as file:
        file.writelines("v %.9g %.9g %.9g\n" % tuple(vertex) for vertex in vertices)
        file.writelines("f %d %d %d\n" % tuple(int(v) + 1 for v in face) for face in faces)


def cloth_on_ball():
    """The cloth and the ball at the start of each frame."""
    example = load("cloth-on-ball/cloth_on_ball.py")
    scenes, new, fall = [], impinge.Scene, example.fall

    def recorded(positions):
        for name, body in (("cloth", 0), ("ball", 1)):
            write(f"{name}_{recorded.frame}", scenes[0].positions(body), scenes[0].elements(body))
        recorded.frame += 1
        return fall(positions)

    recorded.frame = 0
    impinge.Scene = lambda: scenes.append(new()) or scenes[0]
    example.fall = recorded
    example.main()


def two_meshes():
    text = (EXAMPLES / "c/two_meshes.c").read_text()
    rows = {name: re.findall(r"\{([^{}]*)\}", body) for name, body in re.findall(r"(faces|a|b)\[4\]\[3\] = \{(.*)\};", text)}
    values = {name: [[float(x.rstrip("f")) for x in row.split(",")] for row in rows[name]] for name in ("faces", "a", "b")}
    for name in "ab":
        write(name, values[name], values["faces"])


def check_mesh():
    write("tube", *load("python/check_mesh.py").knotted_tube())


def color_trimesh():
    import trimesh

    example = load("python/color_trimesh.py")
    join = trimesh.util.concatenate

    def recorded(meshes):
        for name, mesh in zip("ab", meshes):
            write(name, mesh.vertices, mesh.faces)
        return join(meshes)

    trimesh.util.concatenate = recorded
    sys.argv = ["color_trimesh.py", "--out", str(OUT / "coloured.ply")]
    example.main()


def sequence():
    sys.argv = ["sequence.py", "--plot", str(OUT / "pairs.png")]
    load("python/sequence.py").main()


def ipc():
    example = load("ipc/cloth.py")
    cloth = example.Cloth(32)
    for _ in range(60):
        cloth.frame()
    faces = np.asarray(cloth.mesh.faces)
    is_cloth = (faces < cloth.n).all(axis=1)
    write("cloth", cloth.x[: cloth.n], faces[is_cloth])
    write("ball", cloth.x[cloth.n :], faces[~is_cloth] - cloth.n)
    # The same with friction and without ipctk.
    alone = load("ipc/cloth_alone.py").Cloth(25, 0.5)
    for _ in range(60):
        alone.frame()
    write("cloth_alone", alone.x[: alone.n], alone.scene.elements(alone.cloth))
    write("ball_alone", alone.x[alone.n :], alone.scene.elements(1))


if __name__ == "__main__":
    {make.__name__: make for make in (cloth_on_ball, two_meshes, check_mesh, color_trimesh, sequence, ipc)}[sys.argv[1]]()
