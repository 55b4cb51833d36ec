"""What is taken as an array, in which dtypes and layouts, and how the rest is refused."""

import array
import tracemalloc
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

import impinge
from shapes import ACROSS, FACE, TRIANGLE, ball, soup

# Whole-numbered corners, so that every dtype can hold them.
CORNERS = np.array([[0, 0, 0], [8, 0, 0], [0, 8, 0], [2, 2, 4]])
OTHER = np.array([[1, 1, 2], [1, 2, 2], [3, 1, 2], [3, 3, 0]])
FACES = np.array([[0, 1, 2], [0, 1, 3], [1, 2, 3], [0, 2, 3]])
TRUTH = impinge.pairs(CORNERS, FACES, OTHER, FACES, method="naive")

FLOATS = ["f2", "f4", "f8", "g", ">f4", ">f8", "<f4"]
INTEGERS = ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", ">i4", ">u4", ">i8"]


def layouts(rows):
    """The same rows in every layout that NumPy has."""
    rows = np.ascontiguousarray(rows)
    yield "C", rows
    yield "F", np.asfortranarray(rows)
    wide = np.full((2 * len(rows), 2 * rows.shape[1]), 9, rows.dtype)
    wide[::2, ::2] = rows
    yield "strided", wide[::2, ::2]
    yield "reversed", np.ascontiguousarray(rows[::-1, ::-1])[::-1, ::-1]
    padded = np.zeros(rows.nbytes + 1, np.uint8)
    unaligned = padded[1:].view(rows.dtype).reshape(rows.shape)
    unaligned[...] = rows
    yield "unaligned", unaligned
    fixed = rows.copy()
    fixed.flags.writeable = False
    yield "read-only", fixed
    record = np.zeros(len(rows), [("pad", "i1"), ("xyz", rows.dtype, rows.shape[1])])
    record["xyz"] = rows
    yield "record", record["xyz"]
    yield "transposed twice", np.ascontiguousarray(rows.T).T


def test_the_case_has_pairs():
    assert 0 < len(TRUTH) < len(FACES) ** 2


@pytest.mark.parametrize("dtype", FLOATS + INTEGERS)
@pytest.mark.parametrize("faces_dtype", INTEGERS + ["f4", "f8", "f2"])
def test_dtypes(dtype, faces_dtype):
    answer = impinge.pairs(
        CORNERS.astype(dtype), FACES.astype(faces_dtype), OTHER.astype(dtype), FACES
    )
    assert answer.dtype == np.uint32
    assert answer.flags.c_contiguous
    assert np.array_equal(answer, TRUTH)


@pytest.mark.parametrize("dtype", ["f2", "f4", "f8", ">f8", "i4", "u8"])
@pytest.mark.parametrize("faces_dtype", ["u4", "i8", ">i2", "f8"])
def test_layouts(dtype, faces_dtype):
    vertices = dict(layouts(CORNERS.astype(dtype)))
    faces = dict(layouts(FACES.astype(faces_dtype)))
    assert len(vertices) == 8
    for layout in vertices:
        before = vertices[layout].copy()
        answer = impinge.pairs(vertices[layout], faces[layout], OTHER, FACES)
        assert np.array_equal(answer, TRUTH), layout
        assert np.array_equal(vertices[layout], before)


@pytest.mark.parametrize("dtype, stored", [("f4", "f4"), ("f8", "f8"), ("f2", "f4"), ("i8", "f8")])
def test_precision_is_kept(dtype, stored):
    scene = impinge.Scene()
    body = scene.add(CORNERS.astype(dtype), FACES)
    assert scene.positions(body).dtype == np.dtype(stored)
    assert np.array_equal(scene.positions(body), CORNERS)
    for dtype in ["f8", "f4"]:
        scene.set_positions(body, OTHER.astype(dtype))
        assert scene.positions(body).dtype == np.dtype(dtype)
        assert np.array_equal(scene.positions(body), OTHER)


def test_double_precision_is_answered_exactly():
    """A gap of one bit at 1.0 is a gap in float64, and none once it is rounded to float32."""
    above = TRIANGLE.astype(float) + [0, 0, 1]
    gap = above.copy()
    gap[:, 2] = np.nextafter(1.0, 2.0)
    assert len(impinge.pairs(above, FACE, above, FACE)) == 1
    assert len(impinge.pairs(above, FACE, gap, FACE)) == 0
    assert len(impinge.pairs(above, FACE, gap.astype(np.float32), FACE)) == 1


class OnlyDLPack:
    """A tensor of a library that NumPy does not know."""

    def __init__(self, rows):
        self.rows = rows
        self.asked = 0

    def __dlpack__(self, **keywords):
        self.asked += 1
        return self.rows.__dlpack__(**keywords)

    def __dlpack_device__(self):
        return self.rows.__dlpack_device__()


class OnlyArray:
    """Something that turns into an array on demand."""

    def __init__(self, rows):
        self.rows = rows

    def __array__(self, dtype=None, copy=None):
        return self.rows if dtype is None else self.rows.astype(dtype)


class RefusesDLPack(OnlyArray):
    """A tensor whose DLPack export fails, but which is an array all the same."""

    def __dlpack__(self, **keywords):
        raise BufferError("not today")

    def __dlpack_device__(self):
        return (1, 0)


def test_dlpack():
    vertices, faces = OnlyDLPack(CORNERS.astype("f4")), OnlyDLPack(FACES.astype("i8"))
    assert np.array_equal(impinge.pairs(vertices, faces, OTHER, FACES), TRUTH)
    assert vertices.asked == 1
    transposed = OnlyDLPack(np.asfortranarray(CORNERS.astype("f8")))
    assert np.array_equal(impinge.pairs(transposed, faces, OTHER, FACES), TRUTH)


def test_array_protocol_and_sequences():
    for wrap in [OnlyArray, RefusesDLPack, memoryview, lambda rows: rows.tolist()]:
        vertices, faces = wrap(CORNERS.astype("f8")), wrap(FACES.astype("i4"))
        assert np.array_equal(impinge.pairs(vertices, faces, OTHER, FACES), TRUTH)


def test_buffer_protocol():
    flat = array.array("d", CORNERS.ravel())
    vertices = memoryview(flat).cast("B").cast("d", CORNERS.shape)
    assert np.array_equal(impinge.pairs(vertices, FACES, OTHER, FACES), TRUTH)


def test_torch():
    torch = pytest.importorskip("torch", reason="torch is not installed")
    vertices, faces = torch.tensor(CORNERS, dtype=torch.float32), torch.tensor(FACES)
    assert np.array_equal(impinge.pairs(vertices, faces, OTHER, FACES), TRUTH)
    with pytest.raises(TypeError, match="vertices_a: .*requires grad"):
        impinge.pairs(vertices.requires_grad_(), faces, OTHER, FACES)


def test_trimesh_and_meshio():
    trimesh = pytest.importorskip("trimesh")
    meshio = pytest.importorskip("meshio")
    mesh = trimesh.Trimesh(CORNERS, FACES, process=False)
    assert np.array_equal(impinge.pairs(mesh.vertices, mesh.faces, OTHER, FACES), TRUTH)
    mesh = meshio.Mesh(CORNERS.astype(float), [("triangle", FACES), ("tetra", [[0, 1, 2, 3]])])
    tets = mesh.cells_dict["tetra"]
    assert impinge.pairs(mesh.points, tets, OTHER, FACES, kind_a="tetrahedra").shape == (4, 2)


def test_rows_in_place_are_read_without_a_copy():
    """NumPy reports its allocations to tracemalloc; converting would show."""
    vertices, faces = soup(100_000, 0.01, 1)
    scene = impinge.Scene()
    body = scene.add(vertices, faces)

    def peak(positions):
        tracemalloc.start()
        scene.set_positions(body, positions)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    assert peak(vertices) < vertices.nbytes // 100
    assert peak(OnlyDLPack(vertices)) < vertices.nbytes // 100
    assert peak(memoryview(vertices)) < vertices.nbytes // 100
    assert peak(np.asfortranarray(vertices)) >= vertices.nbytes


def test_masked_arrays():
    whole = np.ma.masked_array(CORNERS.astype("f4"))
    assert np.array_equal(impinge.pairs(whole, FACES, OTHER, FACES), TRUTH)
    whole[1, 1] = np.ma.masked
    with pytest.raises(ValueError, match="^vertices_a: a masked array with masked entries"):
        impinge.pairs(whole, FACES, OTHER, FACES)


def faces_with(value, dtype):
    faces = np.zeros((40, 3), dtype)
    faces[17, 2] = value
    return faces


def vertices_with(value, dtype=np.float64):
    vertices = np.zeros((35, 3), dtype)
    vertices[21, 1] = value
    return vertices


GOOD = np.zeros((35, 3))


@pytest.mark.parametrize(
    "faces, message",
    [
        (faces_with(-1, "i8"), r"faces\[17, 2\] = -1: an index lies between 0 and 4294967295"),
        (faces_with(-1, "i1"), r"faces\[17, 2\] = -1: "),
        (faces_with(2**32, "i8"), r"faces\[17, 2\] = 4294967296: "),
        (faces_with(2**64 - 1, "u8"), r"faces\[17, 2\] = 18446744073709551615: "),
        (faces_with(35, "u4"), r"faces\[17, 2\] = 35: there are 35 vertices"),
        (faces_with(36, ">i2"), r"faces\[17, 2\] = 36: there are 35 vertices"),
        (faces_with(2.5, "f8"), r"faces\[17, 2\] = 2.5: not a whole number"),
        (faces_with(np.nan, "f4"), r"faces\[17, 2\] = nan: not a whole number"),
        (faces_with(np.inf, "f4"), r"faces\[17, 2\] = inf: "),
        (faces_with(-3, "f2"), r"faces\[17, 2\] = -3.0: an index lies between"),
        (np.asfortranarray(faces_with(-1, "i4")), r"faces\[17, 2\] = -1: "),
        (np.zeros((4, 5), int), r"faces: shape \(n, 3\) or \(n, 4\) expected, \(4, 5\) given"),
        (np.zeros(12, int), r"faces: shape .* expected, \(12,\) given"),
        (np.zeros((1, 2, 3), int), r"faces: shape .* expected, \(1, 2, 3\) given"),
    ],
)
def test_faces_refused(faces, message):
    scene = impinge.Scene()
    with pytest.raises(ValueError, match="^" + message):
        scene.add(GOOD, faces)
    assert len(scene) == 0


@pytest.mark.parametrize(
    "vertices, message",
    [
        (vertices_with(np.nan), r"vertices\[21, 1\] = nan: a position must be finite"),
        (vertices_with(-np.inf, "f4"), r"vertices\[21, 1\] = -inf: a position must be finite"),
        (vertices_with(np.inf, "g"), r"vertices\[21, 1\] = inf: a position must be finite"),
        (vertices_with(2**53 + 1, "i8"), r"vertices\[21, 1\] = 9007199254740993: not repr"),
        (vertices_with(-(2**60) - 1, "i8"), r"vertices\[21, 1\] = -1152921504606846977: "),
        (vertices_with(2**64 - 1, "u8"), r"vertices\[21, 1\] = 18446744073709551615: "),
        (np.zeros((35, 2)), r"vertices: shape \(n, 3\) expected, \(35, 2\) given"),
        (np.zeros(3), r"vertices: shape \(n, 3\) expected, \(3,\) given"),
        (1.5, r"vertices: shape \(n, 3\) expected, \(\) given"),
    ],
)
def test_vertices_refused(vertices, message):
    scene = impinge.Scene()
    with pytest.raises(ValueError, match="^" + message):
        scene.add(vertices, FACE)
    body = scene.add(GOOD, FACE)
    with pytest.raises(ValueError, match="^body 0: " + message):
        scene.set_positions(body, vertices)
    assert np.array_equal(scene.positions(body), GOOD)
    with pytest.raises(ValueError, match="^" + message):
        scene.remesh(body, vertices, FACE)
    assert np.array_equal(scene.positions(body), GOOD)


@pytest.mark.skipif(np.finfo("g").nmant <= 52, reason="longdouble is float64 here")
def test_extended_precision_is_refused_only_where_it_counts():
    exact = vertices_with(0.1, "f8").astype("g")
    assert len(impinge.self_pairs(exact, FACE)) == 0
    inexact = vertices_with(1, "g") / 3
    with pytest.raises(ValueError, match=r"^vertices\[21, 1\] = 0.3333.*without loss"):
        impinge.self_pairs(inexact, FACE)


LENGTHS = [
    (np.longdouble(1) + np.longdouble(2) ** -54, "1.0000"),
    (1 + Fraction(1, 2**54), "18014398509481985/18014398509481984"),
    (Decimal("0.1"), "0.1"),
    (2**53 + 1, "9007199254740993"),
    (np.int64(2**53 + 1), "9007199254740993"),
    (np.array(2**53 + 1), "9007199254740993"),
]


@pytest.mark.parametrize("bad, shown", LENGTHS, ids=[type(bad).__name__ for bad, _ in LENGTHS])
def test_lengths_that_are_no_floats(bad, shown):
    if float(bad) == bad and isinstance(bad, np.longdouble):
        pytest.skip("longdouble is float64 here")
    scene = impinge.Scene()
    body, _ = scene.add(TRIANGLE, FACE), scene.add_points([[0, 0, 1]])
    detector = impinge.Detector("cpu")
    for name, ask in [
        ("distance", lambda: detector.near(scene, bad)),
        ("distance", lambda: detector.neighbours(scene, bad)),
        ("most", lambda: detector.safe_distances(scene, bad)),
        ("most", lambda: detector.closest(scene, TRIANGLE, most=bad)),
        ("inflation", lambda: detector.candidates(scene, bad)),
        ("separation", lambda: detector.impacts(scene, separation=bad)),
        ("thickness", lambda: scene.set_thickness(body, bad)),
    ]:
        with pytest.raises(impinge.InvalidError, match=f"^{name}: {shown}.* given, which float64 cannot hold without loss$"):
            ask()


@pytest.mark.parametrize("bad", [10**400, 10**5000, Fraction(10**400)], ids=["long", "longer", "Fraction"])
def test_lengths_beyond_all_floats(bad):
    scene = impinge.Scene()
    scene.add(TRIANGLE, FACE)
    with pytest.raises(impinge.InvalidError, match="^distance: a number of very many digits given, which float64 cannot hold$"):
        impinge.Detector("cpu").near(scene, bad)


class Length:
    """What is a number, but knows no order."""

    def __float__(self):
        return 0.5


def test_lengths_that_are_floats():
    scene = impinge.Scene()
    scene.add_points([[0, 0, 0]]), scene.add_points([[0, 0, 0.5]])
    near = impinge.Detector("cpu").near
    half = [0.5, np.float64(0.5), np.float32(0.5), np.float16(0.5), np.longdouble(0.5), np.array(0.5), Fraction(1, 2), Decimal("0.5"), Length()]
    for distance in [*half, 1, True, np.int8(1), np.uint64(2**63), 2**1000]:
        assert len(near(scene, distance)) == 1
    for bad in [float("nan"), np.float32("nan"), np.longdouble("nan"), float("inf"), np.float32("inf"), -1, np.int8(-1)]:
        with pytest.raises(ValueError, match="^distance: "):
            near(scene, bad)


@pytest.mark.skipif(np.finfo("g").nmant <= 52, reason="longdouble is float64 here")
def test_thickness_of_rows_that_is_no_float():
    scene = impinge.Scene()
    body = scene.add(TRIANGLE, FACE)
    for row in [np.array([1, 2, 2**53 + 1]), np.array([1, 2, 1], "g") / 3]:
        with pytest.raises(ValueError, match=r"^thickness\[[02], 0\] = .*: not representable in float64 without loss"):
            scene.set_thickness(body, row)


def test_flags_are_refused_by_name(tmp_path):
    scene = impinge.Scene()
    body = scene.add(TRIANGLE, FACE)
    near = impinge.Detector("cpu").near(scene, 1)
    for name, ask in [
        ("weld", lambda: impinge.self_pairs(TRIANGLE, FACE, weld=1)),
        ("weld", lambda: impinge.read("a.obj", weld="yes")),
        ("weld", lambda: impinge.read_bodies("a.obj", weld=None)),
        ("weld", lambda: impinge.tiles.plan(tmp_path, ["a.obj"], weld=1)),
        ("copy", lambda: scene.set_positions(body, TRIANGLE, copy=0)),
        ("copy", lambda: scene.set_end_positions(body, TRIANGLE, copy=0)),
        ("by_area", lambda: near.stencils(scene, by_area=1)),
    ]:
        with pytest.raises(TypeError, match=f"^{name}: True or False expected, "):
            ask()
    assert len(impinge.self_pairs(TRIANGLE, FACE, weld=np.True_)) == 0


def test_large_integers_that_fit_are_taken():
    scene = impinge.Scene()
    for value, dtype in [(2**53, "i8"), (-(2**63), "i8"), (2**63, "u8"), (3 << 50, "u8")]:
        body = scene.add(vertices_with(value, dtype), FACE)
        assert scene.positions(body)[21, 1] == float(value)


@pytest.mark.parametrize("bad", [np.zeros((3, 3), bool), np.zeros((3, 3), complex), "abc", None])
def test_not_numbers(bad):
    with pytest.raises(TypeError, match="^vertices: an array of real numbers expected, dtype"):
        impinge.Scene().add(bad, FACE)
    with pytest.raises(TypeError, match="^faces: (an array of real numbers expected, dtype|none given)"):
        impinge.Scene().add(TRIANGLE, bad)


def test_ragged_rows():
    # What NumPy says of them, and how, depends on its version.
    with pytest.raises((TypeError, ValueError), match="^faces: "):
        impinge.Scene().add(TRIANGLE, [[0, 1, 2], [0, 1]])


def test_an_exception_of_the_argument_is_the_cause():
    class Stubborn:
        def __array__(self, dtype=None, copy=None):
            raise RuntimeError("call cpu() first")

    with pytest.raises(TypeError, match="^vertices: .*call cpu.. first") as raised:
        impinge.self_pairs(Stubborn(), FACE)
    assert isinstance(raised.value.__cause__, RuntimeError)


def test_one_liners_name_their_own_arguments():
    bad = np.full((3, 3), np.nan)
    with pytest.raises(ValueError, match=r"^vertices_a\[0, 0\]"):
        impinge.pairs(bad, FACE, TRIANGLE, FACE)
    with pytest.raises(ValueError, match=r"^faces_a\[0, 0\] = -1"):
        impinge.pairs(TRIANGLE, [[-1, 0, 0]], TRIANGLE, FACE)
    with pytest.raises(ValueError, match=r"^vertices_b: shape"):
        impinge.pairs(TRIANGLE, FACE, bad[0], FACE)
    with pytest.raises(ValueError, match=r"^faces_b\[0, 2\] = 7: there are 3 vertices"):
        impinge.pairs(TRIANGLE, FACE, ACROSS, [[0, 1, 7]])
    with pytest.raises(TypeError, match="colour"):
        impinge.pairs(TRIANGLE, FACE, ACROSS, FACE, colour=1)


def test_empty_bodies():
    nothing = np.zeros((0, 3))
    no_faces = np.zeros((0, 3), int)
    assert impinge.pairs(nothing, no_faces, TRIANGLE, FACE).shape == (0, 2)
    assert impinge.self_pairs(*ball()[:1], no_faces).shape == (0, 2)
    with pytest.raises(ValueError, match=r"^faces\[0, 0\] = 0: there are 0 vertices"):
        impinge.self_pairs(nothing, [[0, 0, 0]])


def test_nothing_is_no_rows():
    assert impinge.pairs([], [], TRIANGLE, FACE).shape == (0, 2)
    scene = impinge.Scene()
    assert scene.n_elements(scene.add(TRIANGLE, [])) == 0
    assert scene.n_elements(scene.add_points([])) == 0
    body = scene.add(TRIANGLE, FACE)
    assert len(impinge.Detector("cpu").cast(scene, [], [])) == 0
    with pytest.raises(ValueError, match="^vertices: 0 positions given, but body 2 has 3 vertices"):
        scene.set_positions(body, [])
    with pytest.raises(ValueError, match=r"^vertices: shape \(n, 3\) expected, \(2,\) given"):
        scene.add([1.0, 2.0], FACE)
    with pytest.raises(TypeError, match=r"add_points takes all vertices as points\)$"):
        scene.add(TRIANGLE, kind="points")
