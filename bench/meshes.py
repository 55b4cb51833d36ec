"""Readers of the meshes that the benches in Python use."""

import numpy as np

#: Of a PLY header.
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
REALS = {"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"}


def read_ply(path):
    """Vertices (v, 3), in the precision of the file, and faces (n, 3) int64 of a binary PLY that holds nothing else."""
    header, _, body = path.read_bytes().partition(b"end_header\n")
    words = [line.split() for line in header.decode().splitlines() if line.strip()]
    [order] = [ORDERS[line[1]] for line in words if line[0] == "format"]
    counts = {line[1]: int(line[2]) for line in words if line[0] == "element"}
    properties = [line for line in words if line[0] == "property"]
    *axes, corners = [line[1:] for line in properties]
    is_plain = [axis[-1] for axis in axes] == ["x", "y", "z"] and len({axis[0] for axis in axes}) == 1
    if not is_plain or corners[:3] not in [["list", "uchar", "int"], ["list", "uint8", "int32"]]:
        raise ValueError(f"{path}: positions and triangles alone are read")
    real = np.dtype(order + REALS[axes[0][0]])
    vertices = np.frombuffer(body, real, 3 * counts["vertex"]).reshape(-1, 3)
    face = [("n", "u1"), ("face", order + "i4", 3)]
    rows = np.frombuffer(body, face, counts["face"], vertices.nbytes)
    if (rows["n"] != 3).any():
        raise ValueError(f"{path}: a face that is not a triangle")
    return vertices.astype(real.newbyteorder("=")), rows["face"].astype(np.int64)


def read_frame(path, frame):
    """Vertices (v, 3) float32 of one frame of a PC2 file."""
    raw = path.read_bytes()
    n = int(np.frombuffer(raw, "<i4", 1, 16)[0])
    return np.frombuffer(raw, "<f4", 3 * n, 32 + 12 * n * frame).reshape(-1, 3).copy()
