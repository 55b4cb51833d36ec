"""What a scan has found, frame by frame. Knows nothing of Blender."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

__all__ = ["Frames", "Run"]


class Run(NamedTuple):
    """Frames in a row that intersect: the first, the last, the largest number of pairs, and the next frame, if that was looked at: it is
    free.
    """

    first: int
    last: int
    most: int
    free: int | None


class Frames:
    """Each `step`th frame from `first` to `last`; `counts` has the pairs of those that were looked at."""

    def __init__(self, first, last, step=1):
        self.wanted = range(first, last + 1, step)
        self.counts = {}
        #: In how many frames objects, by name, were disabled, and so left out.
        self.n_disabled = Counter()
        #: The objects, by name, whose instances were not looked at.
        self.instancers = []
        #: The objects without faces in all of these frames, as messages call them.
        self.faceless = []
        #: Whether only selected faces count.
        self.is_selected = False

    def add(self, frame, n_pairs):
        self.counts[frame] = n_pairs

    @property
    def n_hits(self):
        return sum(n_pairs > 0 for n_pairs in self.counts.values())

    @property
    def first(self):
        """The first frame that intersects, or None."""
        return min((frame for frame, n_pairs in self.counts.items() if n_pairs), default=None)

    def runs(self):
        """The runs of frames that intersect, in order."""
        runs, run = [], None
        for frame, n_pairs in sorted(self.counts.items()):
            if n_pairs:
                run = Run(frame, frame, n_pairs, None) if run is None else run._replace(last=frame, most=max(run.most, n_pairs))
            elif run is not None:
                runs.append(run._replace(free=frame))
                run = None
        return runs if run is None else [*runs, run]
