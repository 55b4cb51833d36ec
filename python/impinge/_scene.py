"""`impinge.Scene`: bodies, their topology and positions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, SupportsFloat, SupportsIndex

import numpy as np
import numpy.typing as npt

from ._detector import Detector
from ._impinge import SceneBase, _rest_pairs

if TYPE_CHECKING:
    from typing_extensions import TypeAlias

    from ._impinge import Body, Exclusion
    from ._query import _Array, _Body

    _RowKind: TypeAlias = Literal["points", "edges", "triangles", "tetrahedra", "quads"]
    _Positions: TypeAlias = npt.NDArray[np.floating[Any]]

__all__ = ["Scene"]


class Scene(SceneBase):
    """Bodies with fixed topology, and where their vertices are now.

    ``len(scene)`` is the number of bodies, ``body in scene`` says whether a handle is one of it. Scenes pickle, with all bodies under
    their numbers. ``copy.copy`` and ``copy.deepcopy`` make a clone, which changes on its own: its bodies have the same handles, and
    answers about the one can be compared (``changes``) with those about the other.

    Examples
    --------
    >>> import numpy as np, impinge
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    >>> scene = impinge.Scene()
    >>> a = scene.add(corners, [[0, 1, 2]])
    >>> b = scene.add(corners[:, [0, 2, 1]] + [0, 0.25, -0.25], [[0, 1, 2]])
    >>> impinge.Detector("cpu").detect(scene).between(a, b)
    array([[0, 0]], dtype=uint32)
    """

    __slots__ = ("__weakref__",)

    def add(self, vertices: _Array, faces: _Array | None = None, kind: _RowKind | None = None) -> Body:
        """Adds a body of triangles or tetrahedra. The arrays are copied.

        Parameters
        ----------
        vertices : array_like, shape (v, 3), or a mesh
            Positions. float32 and float64 are taken as they are and answered exactly; other
            dtypes are converted where that loses nothing. Or, without `faces`, an object with ``vertices`` and
            ``faces`` (trimesh and many others) or ``triangles`` (Open3D), or with ``points`` and ``cells_dict``
            (meshio).
        faces : array_like of int, shape (n, 3) or (n, 4), optional
            Vertex indices: three per triangle, four per tetrahedron. Orientation does not matter.
        kind : {"points", "edges", "triangles", "tetrahedra", "quads"}, optional
            What the rows of `faces` are. ``"quads"`` cuts row ``i`` into the triangles ``2 * i`` and ``2 * i + 1``,
            along the diagonal from its first corner. By default three columns are triangles, and four are
            tetrahedra if two rows share exactly three vertices, as neighbours in a mesh of tetrahedra do and quads do
            not; else four columns are refused.

        Returns
        -------
        Body
            The handle by which the body is named from now on.

        Raises
        ------
        ValueError
            A wrong shape, an index out of range, a position that is not finite or outside the
            range in which answers are exact, a number that a conversion would change, rows of four that may be quads,
            a mesh with cells of several kinds.
        TypeError
            An array that holds no real numbers, an object that is no mesh.
        """
        return self._add(vertices, faces, kind)

    def add_many(
        self,
        vertices: _Array,
        faces: _Array,
        vertex_offsets: _Array,
        face_offsets: _Array,
        kind: _RowKind | None = None,
    ) -> list[Body]:
        """Adds many bodies in one call: all of them, or none. The arrays are copied.

        Parameters
        ----------
        vertices : array_like, shape (v, 3)
            The positions of all bodies, one after the other.
        faces : array_like of int, shape (n, 3) or (n, 4)
            The elements of all bodies, one after the other. Each names the vertices of its own body, from 0.
        vertex_offsets, face_offsets : array_like of int, shape (m + 1,)
            Body ``i`` of ``m`` has the rows ``offsets[i]`` to ``offsets[i + 1]``: they begin with 0, never fall, and end
            with the number of rows.
        kind : str, optional
            As for `add`, but for ``"quads"``, which is refused.

        Returns
        -------
        list of Body

        Raises
        ------
        ValueError, TypeError
            As `add`; the scene is unchanged then. Bodies are named by the number that they would have had.

        Examples
        --------
        >>> import numpy as np, impinge
        >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
        >>> scene = impinge.Scene()
        >>> parts = scene.add_many(np.tile(corners, (1000, 1)), [[0, 1, 2]] * 1000,
        ...                        np.arange(1001) * 3, np.arange(1001))
        >>> len(parts), parts[999]
        (1000, Body(999))
        """
        return self._add_many(vertices, faces, vertex_offsets, face_offsets, kind)

    def add_edges(self, vertices: _Array, edges: _Array) -> Body:
        """Adds a body of edges, such as strands of hair. The arrays are copied.

        Parameters
        ----------
        vertices : array_like, shape (v, 3)
            As for `add`.
        edges : array_like of int, shape (n, 2)
            Vertex indices.

        Returns
        -------
        Body

        Raises
        ------
        ValueError, TypeError
            As `add`.
        """
        return self._add_edges(vertices, edges)

    def add_points(self, vertices: _Array) -> Body:
        """Adds a body of points, one per row. The array is copied.

        Parameters
        ----------
        vertices : array_like, shape (v, 3)
            As for `add`.

        Returns
        -------
        Body

        Raises
        ------
        ValueError, TypeError
            As `add`.
        """
        return self._add_points(vertices)

    def remove(self, body: _Body) -> None:
        """Removes a body. Its handle is refused from now on; its number may be used again.

        Parameters
        ----------
        body : Body or int
        """
        self._remove(body)

    def remesh(
        self, body: _Body, vertices: _Array, faces: _Array, kind: _RowKind | None = None
    ) -> None:
        """Gives a body new topology and positions under its old handle. Its filter stays, and its thickness if it is one number. The
        end of its step, its transform, the thickness, groups and pins of its parts and your numbers of edges are forgotten.

        Parameters
        ----------
        body : Body or int
        vertices, faces, kind
            As in `add`.

        Raises
        ------
        ValueError, TypeError
            As `add`; the body is unchanged then.
        """
        self._remesh(body, vertices, faces, kind)

    def set_positions(self, body: _Body, vertices: _Array, *, copy: bool = True) -> None:
        """Moves the vertices of a body; the precision may change. A new step starts: the
        body has no end positions until they are set.

        Parameters
        ----------
        body : Body or int
        vertices : array_like, shape (v, 3)
            As many positions as the body has vertices. With ``copy=False``, a `numpy.ndarray` of float32 or float64 in C order,
            with ``vertices.flags.writeable`` False, and so for the array that it is a view of.
        copy : bool
            Without a copy, the scene reads the array where it lies, until the body gets other positions or is removed, or the scene is
            gone; it keeps the array alive. Up to 32,768 positions are checked now, more of them by the next question, which then
            says which is not finite. The array must not change before that. Arrays that can be written,
            and views of such, are refused. That is all that can be checked: whoever writes to the memory in another way, through a view
            made before or by making the array writeable again, gets answers about no one pose, and may read torn numbers.

        Raises
        ------
        ValueError, TypeError
            As `add`; without a copy an array that can be written or would have to be copied. The body keeps its old positions then.

        Examples
        --------
        >>> import numpy as np, impinge
        >>> scene = impinge.Scene()
        >>> corners = np.eye(3, dtype=np.float32)
        >>> body = scene.add(corners, [[0, 1, 2]])
        >>> frame = corners + np.float32(1)
        >>> frame.flags.writeable = False
        >>> scene.set_positions(body, frame, copy=False)
        >>> scene.positions(body)[0].tolist()
        [2.0, 1.0, 1.0]
        """
        self._set_positions(body, vertices, copy)

    def set_end_positions(
        self, body: _Body, vertices: _Array | None, *, copy: bool = True
    ) -> None:
        """Says where the vertices of a body are at the end of a step: between its positions and these, each moves
        on a straight line at constant speed. They hold until the next `set_positions`, `set_transform` or `remesh`. A body without
        end positions stands still.

        Where start and end come in different precisions, the single one is widened, which is exact. The body's positions stay wide
        until others are given.

        Parameters
        ----------
        body : Body or int
        vertices : array_like, shape (v, 3), or None
            As many positions as the body has vertices. ``None``: the body stands still.
        copy : bool
            As for `set_positions`, but all are checked now. Where start and end come in different precisions, the single one is copied.

        Raises
        ------
        ValueError, TypeError
            As `set_positions`; the body keeps its old end positions then.
        """
        self._set_end_positions(body, vertices, copy)

    def set_transform(self, body: _Body, matrix: _Array) -> None:
        """Moves a body by an affine matrix, such as a rigid motion, without its vertices being given again.

        The body moves from its `rest_positions`, such as those that were given last (`add`, `set_positions`, `remesh`);
        a second transform replaces the first. Answers are exact as if the moved vertices had been given, and these are
        rounded in one way: row ``a, b, c, d`` of the matrix takes ``(x, y, z)`` to ``((a*x + b*y) + c*z) + d``, each
        product and each sum rounded to float64 in this order, the last sum rounded once more to the dtype of the
        rest positions. End positions are forgotten.

        Parameters
        ----------
        body : Body or int
        matrix : array_like, shape (4, 4)
            In float64. The last row is ``0, 0, 0, 1``.

        Raises
        ------
        ValueError, TypeError
            A matrix of another shape, not finite, or not affine; a moved position that is refused. The body is
            unchanged then.

        Examples
        --------
        >>> import numpy as np, impinge
        >>> scene = impinge.Scene()
        >>> body = scene.add(np.eye(3, dtype=np.float32), [[0, 1, 2]])
        >>> up = np.eye(4)
        >>> up[2, 3] = 0.5
        >>> scene.set_transform(body, up)
        >>> scene.positions(body)[2].tolist(), scene.rest_positions(body)[2].tolist()
        ([0.0, 0.0, 1.5], [0.0, 0.0, 1.0])
        """
        self._set_transform(body, matrix)

    def set_end_transform(self, body: _Body, matrix: _Array) -> None:
        """Sets where a step takes a body, by an affine matrix: its end positions are its rest positions moved by the matrix.

        Both matrices of a step start from the rest positions, neither from the other. The end positions are rounded as by
        `set_transform`, and hold as those of `set_end_positions` do. **Each vertex goes straight, at constant speed, from its
        rounded position to its rounded end position**, not along the arc of a turn, and each point of an element goes straight with
        its vertices. What is proven of a step is proven of this motion.

        At each moment, a point at distance r from the axis of a screw motion by the angle w (radians) is at most ``r * w**2 / 8`` away
        from where that motion would have it, plus the rounding of the two ends. So a large turn is cut into
        ``n = ceil(w * sqrt(r / (8 * d)))`` equal steps, where r is that of the farthest vertex and d the deviation that is allowed.
        With ``separation=2 * d`` (d of each of two bodies), a step that is free is free for the screw motion as well.

        After a step, call `set_transform` with the matrix of its end: the positions are then the end positions, bit by bit. Or take
        it by `Advance.apply`, which gives the body the positions reached. The rest positions stay the same: the next matrix begins
        with them, too.

        Parameters
        ----------
        body : Body or int
        matrix : array_like, shape (4, 4)
            In float64. The last row is ``0, 0, 0, 1``.

        Raises
        ------
        ValueError, TypeError
            As `set_transform`; the body keeps its old end positions then.

        Examples
        --------
        A half turn in steps of which none leaves the arc by more than 0.01:

        >>> import numpy as np, impinge
        >>> scene = impinge.Scene()
        >>> blade = scene.add([[0, 0, 0], [2, 0, 0], [0, 0, 0.1]], [[0, 1, 2]])
        >>> def turned(angle):
        ...     matrix = np.eye(4)
        ...     matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        ...     return matrix
        >>> n = int(np.ceil(np.pi * np.sqrt(2 / (8 * 0.01))))
        >>> for step in range(n):
        ...     scene.set_transform(blade, turned(np.pi * step / n))
        ...     scene.set_end_transform(blade, turned(np.pi * (step + 1) / n))
        >>> n, scene.end_positions(blade)[1].round(6).tolist()
        (16, [-2.0, 0.0, 0.0])
        """
        self._set_end_transform(body, matrix)

    def set_filter(
        self,
        body: _Body,
        category: SupportsIndex | None = None,
        mask: SupportsIndex | None = None,
    ) -> None:
        """Sets which other bodies a body meets when a question is about all bodies, which is the default, or about pairs of different ones.

        Two bodies meet when each one's `category` shares a bit with the other one's `mask`. Self-collision does not depend on it, and
        questions that name bodies ignore it.

        Parameters
        ----------
        body : Body or int
        category : int, 64 bits
            The groups to which the body belongs; 1 by default.
        mask : int, 64 bits
            The groups that it meets; all of them by default.

        Raises
        ------
        ValueError, TypeError
            A number that does not fit.
        """
        self._set_filter(body, category, mask)

    def set_edges(self, body: _Body, edges: _Array | None) -> None:
        """Numbers the edges of a body as its caller does: edge i of answers, of `edges` and of `set_thickness` is row i.

        Set them before the first question: afterwards answers from before name other edges, and are refused by `exclude` and
        `stencils`. `remesh` forgets them. Hashes of answers are of these numbers, too.

        Parameters
        ----------
        body : Body or int
            Of triangles or tetrahedra.
        edges : array_like of int, shape (n, 2), or None
            Vertex indices, in either direction: every edge once, in any order; of tetrahedra the edges of their surface. None, or no
            rows: the library's own numbers again, which are those of ``igl.edges``.

        Raises
        ------
        ValueError, TypeError
            A row that is no edge, or the same as another; an edge that no row has; a body of edges, which have the numbers of their
            rows, or of points. The body keeps its numbers then.

        Examples
        --------
        >>> import numpy as np, impinge
        >>> scene = impinge.Scene()
        >>> face = scene.add(np.eye(3), [[0, 1, 2]])
        >>> scene.edges(face).tolist()
        [[0, 1], [0, 2], [1, 2]]
        >>> scene.set_edges(face, [[2, 1], [2, 0], [0, 1]])
        >>> rod = scene.add_edges([[0.5, 0.5, 0.1], [1, 1, 1]], [[0, 1]])
        >>> impinge.Detector("cpu").near(scene, 0.1, between=(face, rod), kinds=("ee",)).rows.tolist()
        [[0, 2, 1, 0]]
        """
        self._set_edges(body, edges)

    def set_groups(self, body: _Body, groups: _Array) -> None:
        """Puts each vertex of a body into a group, for ``exclude=groups(g, h)``. A body whose groups were never set is in no group.

        Parameters
        ----------
        body : Body or int
        groups : array_like of int, shape (v,)
            One per vertex, 0 or more, 32 bits.

        Raises
        ------
        ValueError, TypeError
            More or fewer than there are vertices, a number that does not fit.
        """
        self._set_groups(body, groups)

    def set_pinned(self, body: _Body, pinned: _Array) -> None:
        """Says which vertices of a body never move. Pairs of elements all of whose vertices are pinned are left out of every
        question, whatever it asks: do not pin vertices that you move by a script, as two such bodies would pass through each other.
        `Detector.distance` and `Detector.nearest` look at all elements, whatever is pinned. `remesh` forgets it.

        Parameters
        ----------
        body : Body or int
        pinned : array_like of bool, shape (v,)

        Raises
        ------
        ValueError, TypeError
            More or fewer than there are vertices.
        """
        self._set_pinned(body, pinned)

    def rest_pairs(self, distance: SupportsFloat) -> Exclusion:
        """The pairs of elements that are within a distance of each other now, to be left out of later questions with ``exclude=``: in
        a pose at rest, what is near is meant to be. They are of the kinds that `Detector.near` has if none are named; those of other
        kinds stay. `Detector.detect`, `count` and `any` leave out the elements that they are about, such as faces, of which some corners,
        edges or faces are such a pair. Positions and thickness alone count: neither pinned vertices nor filters nor groups. All cores are used.

        Nothing is proven of pairs that are left out: they may pass through each other.

        Parameters
        ----------
        distance : float
            In the unit of the scene, 0 or more.

        Returns
        -------
        Exclusion

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> strip = [[i // 2, i % 2, 0] for i in range(12)]
        >>> cloth = scene.add(strip, [[i, i + 1, i + 2] for i in range(10)])
        >>> detector = impinge.Detector("cpu")
        >>> len(detector.near(scene, 1.0)) > 0, len(detector.near(scene, 1.0, exclude=scene.rest_pairs(1.0)))
        (True, 0)
        """
        return _rest_pairs(Detector("cpu")._near(self._at_rest(), distance, {}), self)

    def vertex_pairs(self, body: _Body, offsets: _Array, vertices: _Array, other: _Body | None = None) -> Exclusion:
        """Pairs of vertices, to be left out of questions with ``exclude=``: what is left out are the pairs of an element of one body and
        one of another, or of two elements of one body, of which some vertices are listed together. For what only the caller knows:
        vertices that are sewn together, or that a solver handles in another way.

        Parameters
        ----------
        body : Body or int
            Whose vertices have lists.
        offsets : array_like of int, shape (v + 1,)
            The list of vertex ``i`` is ``vertices[offsets[i]:offsets[i + 1]]``.
        vertices : array_like of int, shape (n,)
            Vertices of `other`, in any order.
        other : Body or int, optional
            By default `body`: pairs of that body, in either order.

        Returns
        -------
        Exclusion
            Whether it fits both bodies is checked when something is asked.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> points = scene.add_points([[0, 0, 0], [1, 0, 0], [2, 0, 0]])
        >>> detector = impinge.Detector("cpu")
        >>> detector.near(scene, 1.0, exclude=scene.vertex_pairs(points, [0, 1, 1, 1], [1])).rows
        array([[0, 1, 0, 2]], dtype=uint32)
        """
        return self._vertex_pairs(body, offsets, vertices, other)

    def set_thickness(
        self, body: _Body, thickness: SupportsFloat | _Array, part: Literal["vertices", "edges", "faces"] | None = None
    ) -> None:
        """Sets how thick a body is. A new body is not thick. Of two elements, each adds its own: to the distance of `Detector.near`,
        without rounding; to the `separation` that elements keep in a step (`Detector.impacts` to `Detector.truncate`) and to the gap that
        boxes of `Detector.candidates` may have, where ``a + b`` and ``separation + (a + b)`` are rounded up. From the distances of
        `Detector.neighbours` and `Detector.safe_distances` it is taken.

        What intersects, what is nearest to a point, and how far apart bodies are, is asked of the elements themselves.

        Parameters
        ----------
        body : Body or int
        thickness : float, or array_like of float, shape (n,)
            In the unit of the scene, 0 or more: one number for all elements, which `remesh` keeps; or one per vertex, edge or face,
            which it forgets.
        part : {"vertices", "edges", "faces"}, optional
            Of which elements an array is; of vertices by default. One number has none. An edge or a face is then as thick as the thickest of its vertices.
            If it is of edges or of faces, other elements are as thick as the thickest one of these that they have or are part of.

        Raises
        ------
        ValueError, TypeError
            A thickness that is negative or not finite; more or fewer than the body has vertices, edges or faces; one
            number with a `part`.

        Examples
        --------
        >>> import impinge
        >>> scene = impinge.Scene()
        >>> points = scene.add_points([[0, 0, 0], [1, 0, 0], [2, 0, 0]])
        >>> scene.set_thickness(points, [0.75, 0.25, 0.5])
        >>> impinge.Detector("cpu").near(scene, 0.0).rows
        array([[0, 0, 0, 1]], dtype=uint32)
        """
        self._set_thickness(body, thickness, part)

    def positions(self, body: _Body) -> _Positions:
        """The current positions of a body.

        Returns
        -------
        numpy.ndarray, shape (v, 3), float32 or float64
            A copy, in the precision in which they were given.
        """
        return self._positions(body)

    def end_positions(self, body: _Body) -> _Positions | None:
        """The end positions of a body.

        Returns
        -------
        numpy.ndarray, shape (v, 3), float32 or float64, or None
            A copy; ``None`` for a body that stands still.
        """
        return self._end_positions(body)

    def rest_positions(self, body: _Body) -> _Positions:
        """The positions from which transforms start: those that were given last, or reached by the last step that was taken. A step
        whose end `set_end_transform` set leaves them as they are.

        Returns
        -------
        numpy.ndarray, shape (v, 3), float32 or float64
            A copy.
        """
        return self._rest_positions(body)

    def transform(self, body: _Body) -> npt.NDArray[np.float64] | None:
        """How a body was moved by `set_transform`.

        Returns
        -------
        numpy.ndarray of float64, shape (4, 4), or None
            ``None`` for a body that was not, or whose positions were given since, or after a step was taken.
        """
        return self._transform(body)

    def elements(self, body: _Body) -> npt.NDArray[np.uint32]:
        """The elements that a body was given as, by vertex indices.

        Returns
        -------
        numpy.ndarray of uint32, shape (n, 1), (n, 2), (n, 3) or (n, 4)
            A copy. Points, edges, triangles or tetrahedra, as `kind` says.
        """
        return self._elements(body)

    def edges(self, body: _Body) -> npt.NDArray[np.uint32]:
        """The edges of a body, in the order in which answers number them.

        Returns
        -------
        numpy.ndarray of uint32, shape (n, 2)
            The unique pairs (low, high) of vertices in the order of (high, low), as ``igl.edges`` has them; of tetrahedra the surface
            counts. A copy.
        """
        return self._edges(body)

    def faces(self, body: _Body) -> npt.NDArray[np.uint32]:
        """The faces of a body, in the order in which answers number them.

        Returns
        -------
        numpy.ndarray of uint32, shape (n, 3)
            Triangles as they were given; of tetrahedra the surface. A copy.
        """
        return self._faces(body)

    def kind(self, body: _Body) -> Literal["points", "edges", "triangles", "tetrahedra"]:
        """What a body is made of: ``"points"``, ``"edges"``, ``"triangles"`` or ``"tetrahedra"``."""
        return self._kind(body)

    def n_elements(self, body: _Body) -> int:
        """How many elements a body has."""
        return self._n_elements(body)

    def n_vertices(self, body: _Body) -> int:
        """How many vertices a body has."""
        return self._n_vertices(body)

    @property
    def bodies(self) -> list[Body]:
        """list of Body : the bodies in the order of their numbers."""
        return self._bodies()

    @property
    def nbytes(self) -> int:
        """int : bytes held for topology and positions."""
        return self._nbytes()
