"""What lives as long as Blender runs, and is not saved: the last answer, and the work in progress."""

from __future__ import annotations

from dataclasses import dataclass

from bpy.app.handlers import persistent

__all__ = ["Found", "Running", "forget", "found", "run", "running", "show"]


@dataclass
class Found:
    """An answer, and the frame that it is about."""

    answer: object
    question: object
    frame: int
    #: Which place the view was taken to.
    place: int = -1


@dataclass
class Running:
    """Work in progress: what it is, and what drives it."""

    label: str
    driver: object
    #: Frames done, and of how many; None if it is no scan.
    frames: tuple | None = None


found: Found | None = None
running: Running | None = None


def show(answer, question, frame):
    """Makes this the answer that the panel shows."""
    global found
    found = Found(answer, question, frame)


@persistent
def forget(*_):
    """Another file has been opened."""
    global found
    found = None


def run(work):
    """Makes this the work in progress, or says that there is none."""
    global running
    running = work
