"""Where the meshes of this frame intersect, and where they are near."""

from __future__ import annotations

import bpy

from .. import meshes, state, text
from ..job import Job
from ..question import Asker, Question
from .waiting import Waiting

__all__ = ["CLASSES", "question"]


def question(settings, distance=None):
    """The question that the panel's options ask."""
    return Question(
        itself=settings.which != "BETWEEN",
        between=settings.which != "ACTIVE",
        distance=distance,
        rings=settings.rings,
        weld=settings.weld,
    )


def wanted(context):
    """Names of the objects. Raises ValueError where there are too few."""
    which = context.scene.impinge.which
    names = meshes.chosen(context, which)
    if which == "ACTIVE" and meshes.disabled(context, names):
        raise ValueError(f"{text.disabled(names)}, so that its modifiers are not evaluated")
    expect_enough(which, names)
    return names


def expect_enough(which, names, faceless=()):
    """Raises ValueError where these objects are too few. The error names those without faces."""
    least = 2 if which == "BETWEEN" else 1
    if len(names) >= least:
        return
    if which == "ACTIVE":
        said = "there is no active object with faces"
    else:
        selected = f"{text.counted(len(names), 'object')} with faces {text.are(len(names))} selected"
        said = f"select {least} or more objects that have faces; {selected}"
    raise ValueError("; ".join([said, text.faceless(faceless)] if faceless else [said]))


class Asking(Waiting):
    """Asks about this frame, and shows the answer in the panel."""

    def steps(self, context):
        settings = context.scene.impinge
        names = wanted(context)
        asked = question(settings, self.distance(settings))
        scene_uid, frame = context.scene.session_uid, context.scene.frame_current
        bodies = meshes.read(context, names, settings.selected_only)
        there = {body.name for body in bodies}
        disabled = [name for name in names if name not in there]
        names = [body.name for body in bodies if body.has_faces]
        faceless = meshes.faceless(context.scene, [body.name for body in bodies if not body.has_faces])
        expect_enough(settings.which, names, faceless)
        topology = {name: meshes.topology(object) for name, object in zip(names, meshes.named(context.scene, names))}
        instancers = meshes.instancers(context, meshes.meant(context, settings.which))
        answer = yield Job(lambda cancel, progress: Asker(asked).find(bodies, cancel, progress))
        answer.topology, answer.instancers, answer.disabled, answer.faceless = topology, instancers, disabled, faceless
        state.show(answer, asked, scene_uid, frame)
        said = "; ".join([f"{text.whom(answer, asked)}: {text.of_answer(answer, asked)}", *text.besides(answer, asked)])
        self.report({"WARNING"} if text.unseen(answer) else {"INFO"}, said)


class IMPINGE_OT_check(Asking, bpy.types.Operator):
    """Find the faces that intersect in this frame, modifiers included. Touching counts"""

    bl_idname = "impinge.check"
    bl_label = "Check"
    label = "Check"

    def distance(self, settings):
        return None


class IMPINGE_OT_clearance(Asking, bpy.types.Operator):
    """Find what is at most the distance apart, in this frame, modifiers included"""

    bl_idname = "impinge.clearance"
    bl_label = "Find Clearance"
    label = "Clearance"

    def distance(self, settings):
        return settings.distance


CLASSES = (IMPINGE_OT_check, IMPINGE_OT_clearance)
