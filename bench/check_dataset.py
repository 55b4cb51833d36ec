"""The meshes of `check.py`: generated surfaces, hostile files, scans and pieces of them.

Everything follows from the seed: the same seed gives the same bytes. Positions are float32 in every format (OBJ prints
them in full), so that all readers can get the same numbers.
"""

import dataclasses
import pathlib

import numpy as np

from meshes import read_ply

#: Kinds of files that hold no mesh which could be checked.
BROKEN = ["nan", "infinite", "no bytes", "no faces", "truncated", "absent vertex"]


@dataclasses.dataclass
class File:
    """A file of the dataset. The arrays are what the file says, or None if it holds no mesh that could be checked."""

    path: pathlib.Path
    kind: str
    vertices: np.ndarray = None
    faces: np.ndarray = None

    @property
    def is_good(self):
        return self.vertices is not None


def grid_faces(n_u, n_v, closes_u=False, closes_v=False):
    """Two triangles per square of a grid of vertices, numbered u * n_v + v."""
    u, v = np.meshgrid(np.arange(n_u if closes_u else n_u - 1), np.arange(n_v if closes_v else n_v - 1), indexing="ij")
    here, right = u * n_v + v, u * n_v + (v + 1) % n_v
    below, across = (u + 1) % n_u * n_v + v, (u + 1) % n_u * n_v + (v + 1) % n_v
    return np.stack([here, below, across, here, across, right], axis=-1).reshape(-1, 3)


def joined(*meshes):
    """Several meshes as one."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    faces = [faces + start for (_, faces), start in zip(meshes, starts)]
    return np.vstack([vertices for vertices, _ in meshes]), np.vstack(faces)


def sphere(random, n, noise=0.0):
    """A closed ball of about n triangles with a bumpy radius; the poles are single vertices."""
    n_v = max(3, round((n / 2) ** 0.5))
    n_u = max(2, n // (2 * n_v))
    polar, around = np.meshgrid(np.pi * np.arange(1, n_u + 1) / (n_u + 1), 2 * np.pi * np.arange(n_v) / n_v, indexing="ij")
    bumps = 1 + 0.1 * np.sin(random.integers(1, 6) * polar) * np.cos(random.integers(1, 6) * around)
    bumps = bumps + noise * random.standard_normal(bumps.shape)
    unit = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
    vertices = np.vstack([(bumps[..., None] * unit).reshape(-1, 3), [[0, 0, 1.05], [0, 0, -1.05]]])
    ring, north = np.arange(n_v), n_u * n_v
    caps = [np.stack([np.full(n_v, north), ring, (ring + 1) % n_v], axis=1)]
    last = ring + (n_u - 1) * n_v
    caps.append(np.stack([np.full(n_v, north + 1), (ring + 1) % n_v + (n_u - 1) * n_v, last], axis=1))
    return vertices, np.vstack([grid_faces(n_u, n_v, closes_v=True), *caps])


def torus(random, n):
    """A closed ring; a thick tube runs through itself."""
    n_v = max(3, round((n / 2) ** 0.5))
    n_u = max(3, n // (2 * n_v))
    u, v = np.meshgrid(2 * np.pi * np.arange(n_u) / n_u, 2 * np.pi * np.arange(n_v) / n_v, indexing="ij")
    tube = random.uniform(0.1, 1.3) * (1 + 0.05 * np.sin(5 * u))
    around = 1 + tube * np.cos(v)
    vertices = np.stack([around * np.cos(u), around * np.sin(u), tube * np.sin(v)], axis=-1)
    return vertices.reshape(-1, 3), grid_faces(n_u, n_v, True, True)


def height_field(random, n):
    """An open, noisy sheet."""
    side = max(3, round((n / 2) ** 0.5) + 1)
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    z = random.standard_normal((side, side)) * random.uniform(0, 1.5)
    jitter = random.uniform(0, 0.8) * random.uniform(-1, 1, (side, side, 2))
    vertices = np.stack([x + jitter[..., 0], y + jitter[..., 1], z], axis=-1)
    return vertices.reshape(-1, 3), grid_faces(side, side)


def soup(random, n):
    """Triangles without common vertices, anywhere in a box."""
    n = min(n, 4000)
    size = random.uniform(0.3, 1.2) / n ** (1 / 3)
    centres = random.uniform(-1, 1, (n, 1, 3))
    vertices = centres + size * random.standard_normal((n, 3, 3))
    return vertices.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


def two_balls(random, n):
    a, b = sphere(random, n // 2), sphere(random, n // 2)
    return joined(a, (b[0] + random.uniform(0.2, 1.2, 3), b[1]))


def folded_sheet(random, n):
    """A sheet in loops that cross themselves."""
    side = max(4, round((n / 2) ** 0.5) + 1)
    s, y = np.meshgrid(np.linspace(0, 4, side), np.linspace(-1, 1, side), indexing="ij")
    angle = 2 * np.pi * s
    x = 0.3 * s + random.uniform(0.1, 0.5) * np.sin(angle) * (1 + 0.1 * y)
    z = random.uniform(0.1, 0.4) * np.cos(angle) + 0.05 * y * s
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), grid_faces(side, side)


def box(low, size):
    """A closed box of 12 triangles."""
    corners = np.array([[ix >> 2 & 1, ix >> 1 & 1, ix & 1] for ix in range(8)], float)
    faces = "0 1 3 0 3 2 4 6 7 4 7 5 0 4 5 0 5 1 2 3 7 2 7 6 0 2 6 0 6 4 1 5 7 1 7 3"
    return np.asarray(low) + corners * size, np.array(faces.split(), int).reshape(-1, 3)


def zero_area(random, n):
    """Faces whose third vertex is exactly on an edge, or all of whose vertices are on a line."""
    vertices, faces = height_field(random, n)
    vertices = np.round(vertices * 64) / 64
    chosen = random.choice(len(faces), 1 + len(faces) // 50, replace=False)
    middles = (vertices[faces[chosen, 0]] + vertices[faces[chosen, 1]]) / 2
    new = len(vertices) + np.arange(len(chosen))
    slivers = np.stack([faces[chosen, 0], faces[chosen, 1], new], axis=1)
    return np.vstack([vertices, middles]), np.vstack([faces, slivers])


def repeated_vertex(random, n):
    vertices, faces = sphere(random, n)
    chosen = random.choice(len(faces), 1 + len(faces) // 50, replace=False)
    faces[chosen, 2] = faces[chosen, random.integers(0, 2)]
    return vertices, faces


def duplicate_faces(random, n):
    """Faces twice, some of them turned over."""
    vertices, faces = sphere(random, n)
    chosen = random.choice(len(faces), 2 + len(faces) // 50, replace=False)
    half = len(chosen) // 2
    return vertices, np.vstack([faces, faces[chosen[:half]], faces[chosen[half:]][:, ::-1]])


def coplanar_overlap(random, n):
    """Two flat grids in one plane, shifted against each other."""
    side = max(3, round((n / 4) ** 0.5) + 1)
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    flat = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3).astype(float)
    shift = random.choice([0.25, 0.5, 1.0, side / 2], 2)
    other = flat + [*shift, 0]
    turn = random.integers(0, 3)
    return joined(
        (np.roll(flat, turn, axis=1), grid_faces(side, side)), (np.roll(other, turn, axis=1), grid_faces(side, side))
    )


def flat_fold(random, n):
    """A sheet folded onto itself along a line: neighbours across the fold lie in one plane, on one side."""
    side = max(4, round((n / 2) ** 0.5) + 1)
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    fold = side // 2
    x = np.where(x > fold, 2 * fold - x, x)
    return np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3).astype(float), grid_faces(side, side)


def touching(random, n):
    """Boxes that touch their neighbours at a point, along an edge, or in a face, and nowhere else."""
    boxes = []
    for ix in range(max(2, n // 24)):
        low = np.array([4.0 * ix, 0, 0])
        step = random.choice([0.5, 1.0], 3) * (random.integers(0, 3) != np.arange(3))
        # A corner or an edge of one on the middle of a face of the other, or corner on corner.
        boxes += [box(low, 1.0), box(low + np.where(step == 0, 1.0, step), 0.5)]
    return joined(*boxes)


def apexes(random, n):
    """Tetrahedra whose apex is exactly in a face below, or one float32 beside."""
    solids = []
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    for ix in range(max(2, n // 16)):
        base = np.array([8.0 * ix, 0, 0])
        floor = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, -1]], float)
        gap = random.choice([0, 0, 2**-20, -(2**-20)])
        cone = np.array([[0, 0, 2], [2, 0, 2], [0, 2, 2], [1, 1, gap]], float)
        solids += [(floor + base, faces), (cone + base, faces)]
    return joined(*solids)


def fan(random, n):
    """Sheets that share one edge line: edges of many faces."""
    side = max(3, round((n / 8) ** 0.5))
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    sheets = []
    for angle in np.linspace(0, 2 * np.pi, 4, endpoint=False):
        vertices = np.stack([x * np.cos(angle), x * np.sin(angle), y], axis=-1).reshape(-1, 3)
        sheets.append((vertices, grid_faces(side, side)))
    return joined(*sheets)


def one_spot(random, n):
    """Many triangles through one point: every pair meets."""
    n = min(n // 4, 150) + 10
    vertices = random.standard_normal((n, 3, 3))
    vertices -= vertices.mean(axis=1, keepdims=True)
    return vertices.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


def same_triangle(random, n):
    """One triangle many times, its vertices named anew each time."""
    n = min(n // 4, 60) + 3
    corners = random.standard_normal((3, 3))
    faces = np.array([random.permutation(3) + 3 * ix for ix in range(n)])
    return np.tile(corners, (n, 1)), faces


def lattice(random, n):
    """Random triangles with vertices on a tiny lattice: coincident, collinear and coplanar all at once."""
    n = min(n, 250)
    return random.integers(0, 7, (n + 10, 3)).astype(float), random.integers(0, n + 10, (n, 3))


def slivers(random, n):
    """Long triangles of almost no area."""
    vertices, faces = soup(random, min(n, 1000))
    vertices[2::3] = vertices[::3] + 1e-7 * random.standard_normal(vertices[::3].shape)
    return vertices, faces


def huge_and_tiny(random, n):
    """A surface scaled to the ends of float32's range."""
    vertices, faces = two_balls(random, n)
    return vertices * random.choice([1e-30, 1e-18, 1e-9, 1e9, 1e18, 1e30]), faces


def far_away(random, n):
    """A surface so far from the origin that float32 rounds it: many coincident vertices and flat faces."""
    vertices, faces = two_balls(random, n)
    return vertices + 1e5, faces


def seams(random, n):
    """A ball whose vertices are repeated per face, minus zeros among them, and some vertices that nothing uses."""
    vertices, faces = sphere(random, n)
    vertices = np.round(vertices * 16) / 16
    vertices = vertices[faces.ravel()]
    vertices[vertices == 0] = -0.0
    vertices[::2] += 0.0
    return np.vstack([vertices, random.standard_normal((5, 3))]), np.arange(len(faces) * 3).reshape(-1, 3)


PLAIN = [sphere, torus, height_field, soup, two_balls, folded_sheet]
HOSTILE = [
    zero_area, repeated_vertex, duplicate_faces, coplanar_overlap, flat_fold, touching, apexes, fan, one_spot,
    same_triangle, lattice, slivers, huge_and_tiny, far_away, seams,
]  # fmt: skip


HOSTILE_KINDS = {make.__name__.replace("_", " ") for make in HOSTILE}


def ply_bytes(vertices, faces):
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.zeros(len(faces), [("n", "u1"), ("corners", "<i4", 3)])
    rows["n"], rows["corners"] = 3, faces
    return header.encode() + vertices.astype("<f4").tobytes() + rows.tobytes()


def obj_bytes(vertices, faces):
    # The shortest text of the double that a float32 is: readers of either precision get the same number.
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.astype(np.float64).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    return ("\n".join(lines) + "\n").encode()


def stl_bytes(vertices, faces):
    rows = np.zeros(len(faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["corners"] = vertices[faces]
    return bytes(80) + np.uint32(len(faces)).tobytes() + rows.tobytes()


WRITERS = {"ply": ply_bytes, "obj": obj_bytes, "stl": stl_bytes}


def write(folder, number, kind, form, vertices, faces):
    """Writes a mesh and returns its file with the arrays that a reader should get."""
    vertices, faces = np.asarray(vertices, np.float32), np.asarray(faces, np.int64)
    path = folder / f"{number:05}-{kind.replace(' ', '-')}.{form}"
    path.write_bytes(WRITERS[form](vertices, faces))
    if form == "stl":
        vertices, faces = vertices[faces.ravel()], np.arange(faces.size).reshape(-1, 3)
    return File(path, kind, vertices, faces)


def broken(folder, number, kind, random):
    """A file that holds no mesh which could be checked."""
    vertices, faces = sphere(random, int(random.integers(100, 1000)))
    vertices = vertices.astype(np.float32)
    form = ["ply", "obj", "stl"][number % 3]
    if kind in ["nan", "infinite"]:
        vertices[faces[len(faces) // 2, 0]] = [np.nan if kind == "nan" else np.inf, 0, 0]
    if kind == "absent vertex":
        form = "ply" if form == "stl" else form
        faces[len(faces) // 3, 1] = len(vertices) + 7
    if kind == "no faces":
        faces = faces[:0]
    raw = WRITERS[form](vertices, faces)
    if kind == "no bytes":
        raw = b""
    if kind == "truncated":
        form = "ply" if form == "obj" else form
        raw = WRITERS[form](vertices, faces)
        raw = raw[: len(raw) * 2 // 3]
    path = folder / f"{number:05}-{kind.replace(' ', '-')}.{form}"
    path.write_bytes(raw)
    return File(path, kind)


def scans(data):
    """Names, vertices and faces of the real meshes that are there."""
    folder = data / "meshes"
    for name in ["bunny", "buddha", "dragon"]:
        if (folder / f"{name}.ply").is_file():
            yield name, *read_ply(folder / f"{name}.ply")
    for name in ["cow", "camelhead"]:
        if (folder / f"{name}.off").is_file():
            words = (folder / f"{name}.off").read_text().split()
            n, m = int(words[1]), int(words[2])
            vertices = np.array(words[4 : 4 + 3 * n], np.float64).reshape(-1, 3)
            faces = np.array(words[4 + 3 * n : 4 + 3 * n + 4 * m], np.int64).reshape(-1, 4)[:, 1:]
            yield name, vertices, faces


def piece(vertices, faces, random):
    """The faces in a random box, with their own vertices."""
    centres = vertices[faces].mean(axis=1)
    middle = centres[random.integers(len(centres))]
    wanted = int(random.integers(200, 4000))
    nearest = np.sort(np.argsort(np.abs(centres - middle).max(axis=1), kind="stable")[:wanted])
    used, corners = np.unique(faces[nearest], return_inverse=True)
    return vertices[used], corners.reshape(-1, 3)


def generate(folder, n_files, seed, data):
    """Writes the dataset to a folder and returns its files."""
    files = []
    n_broken, n_hostile, n_pieces = n_files // 50, n_files // 5, n_files // 25
    real = list(scans(data))
    for ix in range(n_files):
        random = np.random.default_rng([seed, ix])
        form = ["ply", "obj", "stl"][int(random.integers(3))]
        most = 20_000 if random.random() < 0.06 else 4_000
        n = int(np.exp(random.uniform(np.log(100), np.log(most))))
        number = len(files)
        if ix < n_broken:
            files.append(broken(folder, number, BROKEN[ix // 3 % len(BROKEN)], random))
        elif ix < n_broken + n_hostile:
            make = HOSTILE[ix % len(HOSTILE)]
            files.append(write(folder, number, make.__name__.replace("_", " "), form, *make(random, n)))
        elif ix < n_broken + n_hostile + n_pieces and real:
            name, *mesh = real[ix % len(real)]
            files.append(write(folder, number, f"piece of {name}", form, *piece(*mesh, random)))
        else:
            make = PLAIN[ix % len(PLAIN)]
            mesh = sphere(random, n, 0.02) if make is sphere and ix % 2 else make(random, n)
            files.append(write(folder, number, make.__name__.replace("_", " "), form, *mesh))
    for name, vertices, faces in real:
        files.append(write(folder, len(files), name, "ply", vertices, faces))
    return files
