"""Goes from place to place, and selects the faces that an answer names."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import BoolProperty, IntProperty
from mathutils import Vector

from .. import meshes, state, text

__all__ = ["CLASSES"]


class IMPINGE_OT_step(bpy.types.Operator):
    """Take the view to the next place, or to the one before"""

    bl_idname = "impinge.step"
    bl_label = "Next Place"

    by: IntProperty(default=1)

    @classmethod
    def poll(cls, context):
        found = state.found_in(context.scene)
        return found is not None and bool(found.answer.places)

    def execute(self, context):
        found = state.found
        n_places = len(found.answer.places)
        # From no place, forward leads to the first one and backward to the last one.
        found.place = (found.place + self.by) % n_places if found.place >= 0 else (0 if self.by > 0 else n_places - 1)
        if context.scene.frame_current != found.frame:
            context.scene.frame_set(found.frame)
        place = found.answer.places[found.place]
        for space in views(context):
            look_at(space, place.position, place.radius)
        return {"FINISHED"}


def views(context):
    """The view in which the button is; without one, the first of the window."""
    space = context.space_data
    if space is None or space.type != "VIEW_3D":
        areas = [area for area in context.screen.areas if area.type == "VIEW_3D"] if context.screen else []
        space = areas[0].spaces.active if areas else None
    return [space] if space is not None else []


def look_at(space, position, radius):
    """Turns nothing: the place comes into the middle, a few times its size around it."""
    view = space.region_3d
    if view.view_perspective == "CAMERA":
        view.view_perspective = "PERSP"
    view.view_location = Vector(position)
    # A place can be a point, and nothing nearer than `clip_start` is drawn.
    view.view_distance = max(4.0 * radius, 1e-3 * float(np.abs(position).max()), 3.0 * space.clip_start)


class IMPINGE_OT_select(bpy.types.Operator):
    """Select the faces that were found, in Edit Mode. A face that a modifier made selects the face that it was made of"""

    bl_idname = "impinge.select"
    bl_label = "Select Faces"
    bl_options = {"REGISTER", "UNDO"}

    place_only: BoolProperty(name="This Place Only", description="Only the faces of the place that the view was taken to")

    @classmethod
    def poll(cls, context):
        found = state.found_in(context.scene)
        return found is not None and found.answer.has_faces

    def execute(self, context):
        found = state.found
        faces = found.answer.faces
        if self.place_only:
            if not 0 <= found.place < len(found.answer.places):
                self.report({"ERROR"}, "Select: go to a place first")
                return {"CANCELLED"}
            faces = found.answer.places[found.place].faces
        objects, gone, left = {}, [], []
        # An object may have another name by now.
        by_uid = {object.session_uid: object for object in context.scene.objects}
        for name, polygons in faces.items():
            if not len(polygons):
                continue
            object = by_uid.get(found.answer.topology[name][0])
            if object is None:
                gone.append(name)
                continue
            if object.mode == "EDIT":
                object.update_from_editmode()
            if meshes.topology(object) != found.answer.topology[name]:
                self.report({"ERROR"}, f"Select: {object.name_full} has changed since the check")
                return {"CANCELLED"}
            if object.visible_get() and object.data.is_editable:
                objects[object] = polygons
            else:
                left.append(f"{object.name_full} ({'of another file' if object.visible_get() else 'hidden'})")
        missing = [f"not those of {', '.join(left)}"] if left else []
        if gone:
            missing.append(text.gone(gone))
        if not objects:
            self.report({"WARNING"}, f"Select: {', '.join(['no face selected', *missing])}")
            return {"CANCELLED"}
        if context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        for object in context.selected_objects:
            object.select_set(False)
        of_meshes = {}
        for object, polygons in objects.items():
            # Objects can share a mesh.
            of_meshes[object.data] = np.union1d(of_meshes.get(object.data, polygons[:0]), polygons)
            object.select_set(True)
        n_hidden = sum(set_selection(mesh, polygons) for mesh, polygons in of_meshes.items())
        if context.view_layer.objects.active not in objects:
            context.view_layer.objects.active = next(iter(objects))
        context.tool_settings.mesh_select_mode = (False, False, True)
        bpy.ops.object.mode_set(mode="EDIT")
        n_faces = sum(len(polygons) for polygons in of_meshes.values()) - n_hidden
        said = [f"{text.counted(n_faces, 'face')} selected"]
        if n_hidden:
            said.append(f"{n_hidden:,} more {text.are(n_hidden)} hidden")
        if found.answer.n_made and not self.place_only:
            made = text.counted(found.answer.n_made, "triangle")
            said.append(f"{made} {'belongs' if found.answer.n_made == 1 else 'belong'} to no face of a mesh")
        said += missing
        self.report({"WARNING"} if missing or n_hidden else {"INFO"}, ", ".join(said))
        return {"FINISHED"}


def set_selection(mesh, polygons):
    """Selects these faces, and nothing else, in Object Mode. Entering Edit Mode selects their edges and vertices. Returns how many are
    hidden, which cannot be selected.
    """
    selected, hidden = np.zeros((2, len(mesh.polygons)), bool)
    mesh.polygons.foreach_get("hide", hidden)
    selected[polygons] = True
    n_hidden = int((selected & hidden).sum())
    selected &= ~hidden
    mesh.polygons.foreach_set("select", selected)
    for name in (".select_vert", ".select_edge"):
        # Where there is no such attribute nothing is selected. `mesh.edges.foreach_set("select", ...)` crashes Blender 5.0.
        if name in mesh.attributes:
            mesh.attributes.remove(mesh.attributes[name])
    mesh.update_tag()
    return n_hidden


CLASSES = (IMPINGE_OT_step, IMPINGE_OT_select)
