"""Goes from place to place, and selects the faces that an answer names."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import BoolProperty, IntProperty
from mathutils import Vector

from .. import state

__all__ = ["CLASSES"]


def has_places():
    return state.found is not None and bool(state.found.answer.places)


class IMPINGE_OT_step(bpy.types.Operator):
    """Take the view to the next place, or to the one before"""

    bl_idname = "impinge.step"
    bl_label = "Next Place"

    by: IntProperty(default=1)

    @classmethod
    def poll(cls, context):
        return has_places()

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
        return state.found is not None and state.found.answer.has_faces

    def execute(self, context):
        found = state.found
        faces = found.answer.faces
        if self.place_only:
            if not 0 <= found.place < len(found.answer.places):
                self.report({"ERROR"}, "Select: go to a place first")
                return {"CANCELLED"}
            faces = found.answer.places[found.place].faces
        if context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        objects = {}
        for name, polygons in faces.items():
            object = context.scene.objects.get(name)
            if object is None or object.type != "MESH" or not len(polygons):
                continue
            if len(object.data.polygons) != found.answer.n_polygons[name]:
                self.report({"ERROR"}, f"Select: {name} has changed since the check")
                return {"CANCELLED"}
            if object.visible_get() and object.data.is_editable:
                objects[object] = polygons
        if not objects:
            self.report({"WARNING"}, "Select: no face that was found belongs to a visible mesh of this file")
            return {"CANCELLED"}
        for object in context.selected_objects:
            object.select_set(False)
        of_meshes = {}
        for object, polygons in objects.items():
            # Objects can share a mesh.
            of_meshes[object.data] = np.union1d(of_meshes.get(object.data, polygons[:0]), polygons)
            object.select_set(True)
        for mesh, polygons in of_meshes.items():
            set_selection(mesh, polygons)
        if context.view_layer.objects.active not in objects:
            context.view_layer.objects.active = next(iter(objects))
        context.tool_settings.mesh_select_mode = (False, False, True)
        bpy.ops.object.mode_set(mode="EDIT")
        n_faces = sum(len(polygons) for polygons in of_meshes.values())
        unknown = f", {found.answer.n_made} triangles belong to no face of a mesh" if found.answer.n_made and not self.place_only else ""
        self.report({"INFO"}, f"{n_faces} faces selected{unknown}")
        return {"FINISHED"}


def set_selection(mesh, polygons):
    """Selects these faces, and nothing else, in Object Mode. Entering Edit Mode selects their edges and vertices."""
    selected = np.zeros(len(mesh.polygons), bool)
    selected[polygons] = True
    mesh.polygons.foreach_set("select", selected)
    for name in (".select_vert", ".select_edge"):
        # Where there is no such attribute nothing is selected. `mesh.edges.foreach_set("select", ...)` crashes Blender 5.0.
        if name in mesh.attributes:
            mesh.attributes.remove(mesh.attributes[name])
    mesh.update_tag()


CLASSES = (IMPINGE_OT_step, IMPINGE_OT_select)
