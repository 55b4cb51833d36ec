"""The panel in the sidebar of the 3D view, tab impinge."""

from __future__ import annotations

import bpy

from . import state, text

__all__ = ["CLASSES"]


def length(context, distance):
    """A distance in the units of the scene."""
    units = context.scene.unit_settings
    if units.system == "NONE":
        return f"{distance:.6g}"
    return bpy.utils.units.to_string(units.system, "LENGTH", distance * units.scale_length, precision=6)


class Part:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "impinge"


class IMPINGE_PT_check(Part, bpy.types.Panel):
    bl_label = "Intersections"

    def draw(self, context):
        layout = self.layout
        settings = context.scene.impinge
        layout.row().prop(settings, "which", expand=True)
        layout.prop(settings, "weld")
        if context.mode == "EDIT_MESH":
            layout.prop(settings, "selected_only")
        draw_work(layout, "impinge.check", "Check")


def draw_work(layout, operator, label):
    """The button, or the work that it has begun."""
    if state.running is None or state.running.label != label:
        row = layout.row()
        row.enabled = state.running is None
        row.operator(operator)
        return
    done, total = state.running.frames or state.running.driver.progress
    row = layout.row(align=True)
    frames = f" {done:,} of {total:,}" if state.running.frames else ""
    row.progress(factor=done / total if total else 0.0, text=f"{label}{frames}")
    row.operator("impinge.cancel", text="", icon="X")


class IMPINGE_PT_clearance(Part, bpy.types.Panel):
    bl_label = "Clearance"

    def draw(self, context):
        settings = context.scene.impinge
        self.layout.prop(settings, "distance")
        if settings.which != "BETWEEN":
            self.layout.prop(settings, "rings")
        draw_work(self.layout, "impinge.clearance", "Clearance")


class IMPINGE_PT_found(Part, bpy.types.Panel):
    bl_label = "Found"

    @classmethod
    def poll(cls, context):
        return state.found_in(context.scene) is not None

    def draw(self, context):
        found = state.found
        lines = text.lines_of_answer(found.answer, found.question)
        if found.frame != context.scene.frame_current:
            lines.append(f"in frame {found.frame}")
        draw_lines(self.layout, lines)
        if found.answer.places:
            draw_places(self.layout, context, found)
        if found.answer.has_faces:
            self.layout.operator("impinge.select", text="Select All Faces").place_only = False


def draw_lines(layout, lines):
    column = layout.column(align=True)
    column.scale_y = 0.8
    for line in lines:
        column.label(text=line)


def draw_places(layout, context, found):
    n_places = len(found.answer.places)
    is_at_place = 0 <= found.place < n_places
    row = layout.row(align=True)
    row.operator("impinge.step", text="", icon="TRIA_LEFT").by = -1
    row.label(text=f"Place {found.place + 1:,} of {n_places:,}" if is_at_place else "Go to a place")
    row.operator("impinge.step", text="", icon="TRIA_RIGHT").by = 1
    if is_at_place:
        draw_lines(layout, text.lines_of_place(found.answer.places[found.place], lambda distance: length(context, distance)))
        layout.operator("impinge.select", text="Select Faces of This Place").place_only = True


class IMPINGE_PT_scan(Part, bpy.types.Panel):
    bl_label = "Animation"

    def draw(self, context):
        layout = self.layout
        settings = context.scene.impinge
        row = layout.row()
        row.prop(settings, "step")
        row.prop(settings, "mark")
        draw_work(layout, "impinge.scan", "Scan")
        if not settings.n_frames:
            return
        layout.label(text=text.hits(settings.n_hits, settings.n_frames))
        if settings.is_hit:
            row = layout.row(align=True)
            row.prop(settings, "first_frame")
            row.operator("impinge.first_frame", text="", icon="PLAY")


CLASSES = (IMPINGE_PT_check, IMPINGE_PT_clearance, IMPINGE_PT_found, IMPINGE_PT_scan)
