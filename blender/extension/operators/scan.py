"""Which frames of an animation intersect."""

from __future__ import annotations

import bpy

from .. import meshes, state, text
from ..frames import Frames
from ..job import Job
from ..question import Asker, is_selected
from .check import question, wanted
from .waiting import Waiting

__all__ = ["CLASSES"]

#: Markers that end with this are ours, and the next scan replaces them. The timeline cuts names off at the next marker.
MARK = " (impinge)"


class IMPINGE_OT_scan(Waiting, bpy.types.Operator):
    """Look for intersections in each frame, from the first to the last one of the scene, or of its preview range"""

    bl_idname = "impinge.scan"
    bl_label = "Scan Frames"
    bl_options = {"REGISTER", "UNDO"}
    label = "Scan"

    def steps(self, context):
        settings = context.scene.impinge
        names, meant = wanted(context), meshes.meant(context, settings.which)
        selected = {object.name_full for object in context.selected_objects}
        asker = Asker(question(settings))
        selected_only = settings.selected_only
        scene_uid, before, subframe = context.scene.session_uid, context.scene.frame_current, context.scene.frame_subframe
        with_faces, labels = set(), dict(zip(names, meshes.faceless(context.scene, names)))
        seen = Frames(*span(context.scene), settings.step)
        try:
            for frame in visited(context.scene, seen.wanted):
                scene = scene_of(scene_uid)
                if scene is None:
                    raise ValueError("the scene is no longer there")
                scene.frame_set(frame)
                if frame not in seen.wanted:
                    continue
                seen.instancers += meshes.instancers(context, [name for name in meant if name not in seen.instancers])
                bodies = meshes.read(context, names, selected_only)
                there = {body.name for body in bodies}
                seen.n_disabled.update(name for name in names if name not in there)
                with_faces.update(body.name for body in bodies if body.has_faces)
                seen.is_selected |= is_selected(bodies)
                seen.add(frame, (yield Job(lambda cancel, progress, bodies=bodies: asker.count(bodies, cancel, progress))))
                state.running.frames = (len(seen.counts), len(seen.wanted))
        finally:
            scene = scene_of(scene_uid)
            if scene is not None:
                scene.frame_set(before, subframe=subframe)
                # Blender deselects what is disabled in a frame.
                select(context, scene, selected & set(seen.n_disabled))
                # A scan that was stopped shows how far it has come.
                show(scene, seen)
        # Those that were disabled in all frames may have faces.
        seen.faceless = [labels[name] for name in names if name not in with_faces and seen.n_disabled[name] < len(seen.counts)]
        self.report({"WARNING"} if text.unseen_of_frames(seen) else {"INFO"}, text.of_frames(seen))


def select(context, scene, names):
    """Selects the objects of these full names that can be."""
    for object in meshes.named(scene, names - set(meshes.disabled(context, names))):
        if object is not None:
            object.select_set(True)


def scene_of(uid):
    """The scene of this `session_uid`, which outlives an undo and a new name; None if it is no longer there."""
    return next((scene for scene in bpy.data.scenes if scene.session_uid == uid), None)


#: Modifiers whose state in a frame follows from the frames before.
SIMULATIONS = {"CLOTH", "SOFT_BODY", "PARTICLE_SYSTEM", "DYNAMIC_PAINT", "FLUID"}


def visited(scene, wanted):
    """The frames to be gone through: all of them, from the first of the scene on, where something is simulated."""
    if not simulates(scene) or not len(wanted):
        return wanted
    return range(min(scene.frame_start, wanted[0]), wanted[-1] + 1)


def simulates(scene):
    if scene.rigidbody_world is not None:
        return True
    for object in scene.objects:
        for modifier in object.modifiers:
            if modifier.type in SIMULATIONS:
                return True
            if modifier.type == "NODES" and any(node.bl_idname == "GeometryNodeSimulationOutput" for node in nodes(modifier.node_group)):
                return True
    return False


def nodes(group):
    """The nodes of a group, or of None, with those of the groups in it, each group once."""
    seen, rest = set(), [group]
    while rest:
        group = rest.pop()
        if group is not None and group not in seen:
            seen.add(group)
            yield from group.nodes
            rest += [node.node_tree for node in group.nodes if node.bl_idname == "GeometryNodeGroup"]


def span(scene):
    """First and last frame."""
    if scene.use_preview_range:
        return scene.frame_preview_start, scene.frame_preview_end
    return scene.frame_start, scene.frame_end


def show(scene, seen):
    """Writes what was found into the scene: numbers, and markers."""
    settings = scene.impinge
    settings.n_frames, settings.n_hits = len(seen.counts), seen.n_hits
    settings.is_hit = seen.first is not None
    settings.first_frame = seen.first if seen.first is not None else 0
    for marker in [marker for marker in scene.timeline_markers if marker.name.endswith(MARK)]:
        scene.timeline_markers.remove(marker)
    if settings.mark:
        for run in seen.runs():
            scene.timeline_markers.new(f"{text.pairs(run.most)} at most{MARK}", frame=run.first)
            if run.free is not None:
                scene.timeline_markers.new(f"free{MARK}", frame=run.free)


class IMPINGE_OT_first_frame(bpy.types.Operator):
    """Go to the first frame that intersects"""

    bl_idname = "impinge.first_frame"
    bl_label = "Go to First Frame"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return context.scene.impinge.is_hit

    def execute(self, context):
        context.scene.frame_set(context.scene.impinge.first_frame)
        return {"FINISHED"}


CLASSES = (IMPINGE_OT_scan, IMPINGE_OT_first_frame)
