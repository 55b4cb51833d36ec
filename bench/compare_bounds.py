"""How far vertices may move: the bounds of impinge, ipc-toolkit and Newton beside the true half distances, on the same frames.

    python bench/compare_bounds.py                   # every frame whose data exists
    python bench/compare_bounds.py rumba --distance 1e-3

It needs `pip install ipctk newton warp-lang` and the module (`pip install .`), and looks for data in $IMPINGE_DATA or
../shared/data. Newton runs on the CPU.

The true half distance of a vertex is half of the smallest distance of the pairs of elements that it belongs to. It is held as
two numbers: `near` gives each distance as the double next to it, so it lies between the doubles below and above. A radius
*exceeds* it if it is above the half of the upper one, and *may exceed* it if it is above the half of the lower one.

    impinge     safe_distances, as it is
    ipctk       compute_per_vertex_safe_distances, halved: the bound of two elements that both move; and what TrustRegion makes
                of it, which takes a factor off
    Newton      half of the least distance that its collision detector writes for a vertex, its triangles and its edges; and
                the same with the factor 0.85 that its solver takes

Pairs that Newton drops are those that do not fit into its buffers: of 32 faces per vertex and 64 edges per edge, as its solver
makes them, and 16 and 32, as its detector does; of all pairs that share no vertex, and without those that its solver leaves
out because they are two rings apart or less.
"""

import argparse
import os
import pathlib

import numpy as np
from meshes import read_frame, read_ply

import impinge

try:
    import ipctk
    import newton
    import warp
    from newton._src.geometry.tri_mesh_collision import TriMeshCollisionDetector
except ModuleNotFoundError as missing:
    raise SystemExit(f"{missing}: pip install ipctk newton warp-lang") from missing

ROOT = pathlib.Path(__file__).resolve().parents[1]
SCENES = ["cloth-ball", "rumba", "rumba, 1024 times as large"]
#: Of its solver, and of its detector.
BUFFERS = {"solver": (32, 64), "detector": (16, 32)}
#: What its solver takes of a distance.
RELAXATION = 0.85


def read(name, data):
    """Positions (v, 3) float32 and faces (n, 3)."""
    if name.startswith("rumba"):
        _, faces = read_ply(data / "sequences" / "rumba.ply")
        # Newton takes edges shorter than an absolute number for points, so the unit matters to it.
        unit = np.float32(1.0 if name == "rumba" else 1024.0)
        return read_frame(data / "sequences" / "rumba.pc2", 60) * unit, faces
    vertices, faces = read_ply(data / "ccd" / "cloth-ball" / "frames" / "cloth_ball92.ply")
    return vertices.astype(np.float32), faces


def least_of(n_vertices, most, *sides):
    """The least value of each vertex, at most `most`: of sides, each with the elements' corners and a value for each."""
    least = np.full(n_vertices, most)
    for corners, values in sides:
        for corner in np.reshape(corners, (len(values), -1)).T:
            np.minimum.at(least, corner, values)
    return least


def true_halves(scene, body, most):
    """Half of the smallest distance of each vertex, rounded down and up, at most `most`; and the numbers of pairs, of edges
    from both."""
    near = impinge.Detector("cpu").near(scene, 2.0 * most, distances=True)
    edges, faces = scene.edges(body), scene.faces(body)
    sides = []
    for kind, (first, second) in {"vf": (None, faces), "ee": (edges, edges)}.items():
        own = near.of(kind)
        for column, corners in ((1, first), (3, second)):
            elements = own.rows[:, column]
            sides.append((elements if corners is None else corners[elements], own.distances))
    least = least_of(scene.n_vertices(body), 2.0 * most, *sides)
    down = np.where(least < 2.0 * most, np.nextafter(least, 0.0), least)
    n_pairs = [len(near.of("vf")), 2 * len(near.of("ee"))]
    return 0.5 * down, 0.5 * np.nextafter(least, np.inf), n_pairs


def of_ipctk(vertices, faces, most):
    """Halves of the safe distances, and the radii of a trust region."""
    at = np.asfortranarray(vertices, dtype=np.float64)
    mesh = ipctk.CollisionMesh(at, ipctk.edges(faces), faces.astype(np.int32))
    candidates = ipctk.Candidates()
    candidates.build(mesh, at, 2.0 * most)
    safe = candidates.compute_per_vertex_safe_distances(mesh, at, 2.0 * most)
    region = ipctk.ogc.TrustRegion(2.0 * most)
    region.trust_region_inflation_radius = 2.0 * most
    region.update(mesh, at, ipctk.NormalCollisions())
    return 0.5 * np.ravel(safe), np.ravel(region.trust_region_radii), region.relaxed_radius_scaling


def newton_model(vertices, faces):
    """Its model of a cloth. It numbers edges itself."""
    builder = newton.ModelBuilder()
    builder.add_cloth_mesh(
        pos=warp.vec3(0.0, 0.0, 0.0),
        rot=warp.quat_identity(),
        scale=1.0,
        vel=warp.vec3(0.0, 0.0, 0.0),
        vertices=[warp.vec3(*vertex) for vertex in vertices.tolist()],
        indices=faces.ravel().tolist(),
        density=0.1,
    )
    return builder.finalize(device="cpu")


def of_newton(model, most, buffers, rings):
    """The least distance of each vertex, how many pairs were found, and how many of them have no place in a buffer."""
    of_vertex, of_edge = buffers
    detector = TriMeshCollisionDetector(
        model,
        # Without this, no triangle says how near a vertex is.
        record_triangle_contacting_vertices=True,
        vertex_collision_buffer_pre_alloc=of_vertex,
        edge_collision_buffer_pre_alloc=of_edge,
        topological_contact_filter_threshold=rings,
        init_collision_info=True,
    )
    detector.vertex_triangle_collision_detection(2.0 * most)
    detector.edge_edge_collision_detection(2.0 * most)
    info = detector.collision_info
    least = least_of(
        model.particle_count,
        2.0 * most,
        (np.arange(model.particle_count), info.vertex_colliding_triangles_min_dist.numpy()),
        (model.tri_indices.numpy(), info.triangle_colliding_vertices_min_dist.numpy()),
        (model.edge_indices.numpy()[:, 2:4], info.edge_colliding_edges_min_dist.numpy()),
    )
    counts = [
        info.vertex_colliding_triangles_count.numpy(),
        info.edge_colliding_edges_count.numpy(),
    ]
    dropped = [
        int(np.maximum(count - room, 0).sum()) for count, room in zip(counts, buffers, strict=True)
    ]
    return least, [int(count.sum()) for count in counts], dropped


def row(name, radii, down, up):
    """How many radii exceed the true halves, and by how much at most."""
    # What nothing is near, and what is bounded by `most` alone, is not compared.
    bounded = down < down.max()
    exceed, may = (radii > up)[bounded], (radii > down)[bounded]
    excess = (radii / np.maximum(up, np.finfo(float).tiny))[bounded].max(initial=0.0) - 1.0
    print(f"| {name} | {exceed.sum():,} | {(may & ~exceed).sum():,} | {excess:.1e} |")


def compare(name, vertices, faces, part):
    """Prints the tables of one frame."""
    scene = impinge.Scene()
    body = scene.add(vertices, faces)
    most = part * float(np.linalg.norm(np.ptp(vertices.astype(np.float64), axis=0)))
    down, up, n_pairs = true_halves(scene, body, most)
    n_bounded = int((down < down.max()).sum())
    print(
        f"### {name}: {n_bounded:,} of {len(vertices):,} vertices are within {2.0 * most:.6g} of an element\n"
    )
    print(
        f"{n_pairs[0]:,} pairs of a vertex and a face, {n_pairs[1]:,} of edges, counted from both.\n"
    )
    print("| radii | exceed the true half | may exceed it | largest excess |\n|---|---:|---:|---:|")
    row(
        "impinge, `safe_distances`",
        impinge.Detector("cpu").safe_distances(scene, most).of(body).astype(np.float64),
        down,
        up,
    )
    safe, region, scaling = of_ipctk(vertices, faces, most)
    row("ipctk, `compute_per_vertex_safe_distances`, halved", safe, down, up)
    row(f"ipctk, `TrustRegion` with its factor {scaling:g}", region, down, up)
    model = newton_model(vertices, faces)
    least, _, _ = of_newton(model, most, BUFFERS["solver"], 0)
    row("Newton, half of the least distance", 0.5 * least, down, up)
    row(f"Newton, with the factor {RELAXATION}", 0.5 * RELAXATION * least, down, up)
    print(
        "\n| Newton's buffers | rings left out | vertex-face pairs | dropped | edge-edge pairs, from both | dropped |\n|---|---:|---:|---:|---:|---:|"
    )
    for whose, buffers in BUFFERS.items():
        for rings in (0, 2):
            _, found, dropped = of_newton(model, most, buffers, rings)
            print(
                f"| {whose}: {buffers[0]}, {buffers[1]} | {rings} | {found[0]:,} | {dropped[0]:,} | {found[1]:,} | {dropped[1]:,} |"
            )
    print()


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenes", nargs="*", help=", ".join(SCENES))
    parser.add_argument(
        "--distance",
        type=float,
        nargs="*",
        default=[5e-4, 1e-3],
        help="parts of the diagonal that bounds may be at most",
    )
    args = parser.parse_args()
    data = pathlib.Path(os.environ.get("IMPINGE_DATA", ROOT.parent / "shared" / "data"))
    warp.config.quiet = True
    for name in args.scenes or SCENES:
        try:
            vertices, faces = read(name, data)
        except FileNotFoundError as missing:
            print(f"{name}: {missing}, left out")
            continue
        for part in args.distance:
            compare(name, vertices, faces, part)


if __name__ == "__main__":
    main()
