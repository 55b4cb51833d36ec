"""Answers in words. Knows nothing of Blender."""

from __future__ import annotations

__all__ = [
    "are", "besides", "counted", "disabled", "faceless", "gone", "hits", "lines_of_answer", "lines_of_place", "of_answer", "of_frames", "pairs",
    "unseen", "unseen_of_frames", "whom",
]


#: As the option is called.
ONLY = "selected faces only"


def counted(n, noun):
    return f"{n:,} {noun}" if n == 1 else f"{n:,} {noun}s"


def are(n):
    return "is" if n == 1 else "are"


def gone(names):
    return f"{', '.join(names)} {are(len(names))} no longer in the scene"


def pairs(n):
    return counted(n, "pair")


def whom(answer, question):
    """Which objects were asked about: `Cube with itself`."""
    if len(answer.names) == 1:
        return f"{answer.names[0]} with itself"
    return f"{counted(len(answer.names), 'object')} with each other{' and themselves' if question.itself else ''}"


def disabled(names):
    return f"{', '.join(names)} {are(len(names))} disabled in the viewport"


def faceless(names):
    return f"{', '.join(names)} {'has' if len(names) == 1 else 'have'} no faces"


def instances(names):
    return f"instances of {', '.join(names)} were not looked at"


def unseen(answer):
    """What was not looked at."""
    said = []
    if answer.instancers:
        said.append(instances(answer.instancers))
    if answer.disabled:
        said.append(f"{disabled(answer.disabled)}, and {'was' if len(answer.disabled) == 1 else 'were'} not looked at")
    if answer.faceless:
        said.append(faceless(answer.faceless))
    return said


def besides(answer, question):
    """What was not looked at, and what is left out."""
    said = unseen(answer)
    if question.distance is not None and question.itself and question.rings:
        said.append(f"within an object, what is at most {counted(question.rings, 'edge')} away along the surface is left out")
    return said


def of_answer(answer, question):
    """`83 pairs of 5,804 triangles in 3 places`, as the program says it."""
    near = "" if question.distance is None else " near"
    only = f", {ONLY}" if answer.is_selected else ""
    if not answer.n_pairs:
        return f"none of {counted(answer.n_triangles, 'triangle')}{' is near' if near else ' intersects'}{only}"
    where = f" in {counted(answer.n_places, 'place')}" if answer.is_placed else ", too many to find their places"
    elements = " of elements" if near else ""
    return f"{counted(answer.n_pairs, (near + ' pair').strip())}{elements} of {counted(answer.n_triangles, 'triangle')}{where}{only}"


def lines_of_answer(answer, question):
    """The same in lines that fit into the sidebar."""
    is_near = question.distance is not None
    if not answer.n_pairs:
        first = ["nothing is near" if is_near else "nothing intersects"]
    else:
        found = counted(answer.n_pairs, "near pair" if is_near else "pair")
        first = [f"{found} in {counted(answer.n_places, 'place')}"] if answer.is_placed else [found, "too many to find their places"]
    lines = [*first, f"of {counted(answer.n_triangles, 'triangle')}"]
    if answer.is_selected:
        lines.append(ONLY)
    if answer.instancers:
        lines.append("instances not looked at")
    if answer.disabled:
        lines.append(f"{counted(len(answer.disabled), 'object')} disabled")
    if answer.faceless:
        lines.append(f"{counted(len(answer.faceless), 'object')} without faces")
    return lines


def lines_of_place(place, length):
    """What a place is, in such lines; `length` writes a distance in the units of the scene."""
    a, b = place.names
    distance = "" if place.distance is None else f", {length(place.distance)} apart"
    return [*([a] if a == b else [f"{a} and", b]), f"{pairs(place.n_pairs)}{distance}"]


def of_frames(seen):
    """What a scan has found, and what it has not looked at."""
    return "; ".join([_of_frames(seen), *unseen_of_frames(seen)])


def unseen_of_frames(seen):
    """What a scan has not looked at."""
    said = []
    if seen.instancers:
        said.append(instances(seen.instancers))
    if seen.n_disabled:
        where = ", ".join(f"{name} in {counted(n, 'frame')}" for name, n in seen.n_disabled.items())
        said.append(f"left out where disabled in the viewport: {where}")
    if seen.faceless:
        said.append(faceless(seen.faceless))
    return said


def _of_frames(seen):
    only = f", {ONLY}" if seen.is_selected else ""
    if len(seen.counts) == 1:
        [frame] = seen.counts
        return f"frame {frame} {'intersects' if seen.n_hits else 'does not intersect'}{only}"
    if seen.first is None:
        return f"none of {counted(len(seen.counts), 'frame')} intersects{only}"
    return f"{hits(seen.n_hits, len(seen.counts))}, the first is {seen.first}{only}"


def hits(n_hits, n_frames):
    """`1 of 20 frames intersects`."""
    return f"{n_hits:,} of {counted(n_frames, 'frame')} {'intersects' if n_hits == 1 else 'intersect'}"
