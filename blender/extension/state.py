"""What lives as long as Blender runs, and is not saved: the last answer, and the work in progress."""

from __future__ import annotations

from dataclasses import dataclass

from bpy.app.handlers import persistent

__all__ = ["Found", "Running", "forget", "found", "found_in", "run", "running", "show"]


@dataclass
class Found:
    """An answer, and the scene and the frame that it is about. The scene is named by its `session_uid`, which outlives an undo."""

    answer: object
    question: object
    scene_uid: int
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


def show(answer, question, scene_uid, frame):
    """Makes this the answer that the panel shows."""
    global found
    found = Found(answer, question, scene_uid, frame)


def found_in(scene):
    """The last answer, if it is about this scene, or None."""
    return found if found is not None and found.scene_uid == scene.session_uid else None


@persistent
def forget(*_):
    """Another file has been opened."""
    global found
    found = None


def run(work):
    """Makes this the work in progress, or says that there is none."""
    global running
    running = work
