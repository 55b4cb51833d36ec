"""What is asked about bodies, and the answer. Asks impinge, and knows nothing of Blender: all of this may run in another thread."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import impinge
import numpy as np

from . import places
from .bodies import World

__all__ = ["MOST_PAIRS", "Answer", "Asker", "Question", "is_selected"]

#: The most pairs that are held: 16 bytes each. More is an error that says so.
MOST_PAIRS = 50_000_000
#: The most near pairs, whose places are found here: about a second and 500 bytes for 100,000.
MOST_NEAR = 2_000_000
#: The most pairs whose places are found. Their contacts take about 200 bytes each.
MOST_PLACED = 2_000_000


@dataclass(frozen=True)
class Question:
    """`itself`: pairs of one body; `between`: pairs of different ones. `distance`, in the world: pairs that are at most that near; None:
    pairs that intersect. `rings`: what is as near in the surface of one body is not near. `weld`: equal positions are one vertex.
    """

    itself: bool
    between: bool
    distance: float | None = None
    rings: int = 2
    weld: bool = True


@dataclass
class Answer:
    """`faces` has, by name of the object, faces of its own mesh. `n_made`: triangles without one, because a modifier made them.
    `is_placed` is false where there were too many pairs for finding places. Of `n_places`, the first are described. `is_selected`: only
    pairs with a selected face count. `names` are those of the objects that were asked about and have faces. Whoever asks adds, by name, the
    `topology` of their own meshes, the `instancers`: those whose instances were not looked at, the `disabled`: those that were not looked at,
    and the `faceless`: those without faces, as messages call them.
    """

    n_pairs: int = 0
    places: list = field(default_factory=list)
    faces: dict = field(default_factory=dict)
    names: list = field(default_factory=list)
    topology: dict = field(default_factory=dict)
    instancers: list = field(default_factory=list)
    disabled: list = field(default_factory=list)
    faceless: list = field(default_factory=list)
    n_made: int = 0
    n_triangles: int = 0
    is_placed: bool = True
    n_places: int = 0
    is_selected: bool = False
    seconds: float = 0.0

    @property
    def has_faces(self):
        return any(map(len, self.faces.values()))


class Asker:
    """Asks one question about frame after frame."""

    def __init__(self, question):
        self.question = question
        # The same answer as any other backend, and no driver of a GPU within Blender's process.
        self._detector = impinge.Detector("cpu", max_pairs=MOST_PAIRS)
        self._worlds = {}

    def count(self, bodies, cancel=None, progress=None):
        """How many pairs intersect."""
        n_pairs = 0
        for _, _, pairs, _ in self._pairs(bodies, cancel, progress):
            n_pairs += len(pairs)
        return n_pairs

    def find(self, bodies, cancel=None, progress=None):
        """The answer with places and faces.

        Raises ValueError for positions that cannot be used, `impinge.Cancelled` and the other errors of impinge.
        """
        began = time.perf_counter()
        answer = Answer(names=[body.name for body in bodies if body.has_faces])
        answer.n_triangles = sum(len(body.triangles) for body in bodies)
        answer.is_selected = is_selected(bodies)
        if self.question.distance is not None:
            self._near(answer, bodies, cancel, progress)
        else:
            for part, scene, pairs, is_local in self._pairs(bodies, cancel, progress):
                answer.n_pairs += len(pairs)
                self._faces(answer, part, pairs.rows)
                if len(pairs) > MOST_PLACED:
                    answer.is_placed = False
                elif len(pairs):
                    contacts = self._detector.contacts(scene, pairs, cancel=cancel, progress=progress)
                    found, n_places = places.of_contacts(part, pairs, contacts, is_local)
                    answer.places += found
                    answer.n_places += n_places
            answer.places.sort(key=lambda place: -place.n_pairs)
        answer.seconds = time.perf_counter() - began
        return answer

    def _world(self, name, bodies, local):
        world = self._worlds.setdefault(name, World())
        return world.update(bodies, self.question.weld, local)

    def _pairs(self, bodies, cancel, progress):
        """Bodies, their scene, the pairs that count, and whether the scene is in the space of the object.

        A body meets itself in its own space: a transform changes no intersection, but rounds. Different bodies meet in the world.
        """
        bodies = [body for body in bodies if body.has_faces]
        asked = [([body], True) for body in bodies] if self.question.itself else []
        if self.question.between and len(bodies) > 1:
            asked.append((bodies, False))
        for part, is_local in asked:
            scene = self._world(part[0].name if is_local else None, part, is_local)
            which = "self" if is_local else "between"
            pairs = self._detector.detect(scene, which=which, cancel=cancel, progress=progress)
            if is_selected(part):
                pairs = pairs.retain(_either_selected(part, pairs.rows))
            yield part, scene, pairs, is_local

    def _faces(self, answer, part, rows):
        for ix, body in enumerate(part):
            triangles = np.unique(np.concatenate([rows[rows[:, side] == ix, side + 1] for side in (0, 2)]))
            answer.n_made += int((body.polygons[triangles] < 0).sum())
            # Each body that was asked about has a list, if an empty one.
            answer.faces.setdefault(body.name, body.polygons[:0])
            places.add_faces(answer.faces, body, triangles)

    def _near(self, answer, bodies, cancel, progress):
        question = self.question
        bodies = [body for body in bodies if body.has_faces]
        if not bodies:
            return
        which = {(True, True): "all", (True, False): "self", (False, True): "between"}[question.itself, question.between]
        scene = self._world(None, bodies, False)
        exclude = [impinge.rings(question.rings)] if question.itself else []
        options = {"which": which, "exclude": exclude, "closest_points": True, "cancel": cancel, "progress": progress}
        try:
            near = impinge.Detector("cpu", max_pairs=MOST_NEAR).near(scene, question.distance, **options)
        except impinge.TooManyPairs:
            raise ValueError(f"more than {MOST_NEAR:,} pairs are near: choose a smaller distance, or more rings") from None
        if not len(near):
            return
        found = places.Near(bodies, scene, near)
        answer.n_pairs = found.n_pairs
        if found.n_pairs:
            answer.faces = found.faces()
            answer.places, answer.n_places = found.places()


def is_selected(bodies):
    """Whether only selected faces count."""
    return any(body.selected is not None for body in bodies)


def _is_selected(body, triangles):
    return np.ones(len(triangles), bool) if body.selected is None else body.selected[triangles]


def _either_selected(part, rows):
    keep = np.zeros(len(rows), bool)
    for ix, body in enumerate(part):
        for side in (0, 2):
            here = np.flatnonzero(rows[:, side] == ix)
            keep[here] |= _is_selected(body, rows[here, side + 1])
    return keep
