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
        draw_work(layout, "impinge.check")
        found = state.found
        if found is None:
            return
        layout.label(text=text.of_answer(found.answer, found.question))
        if found.frame != context.scene.frame_current:
            layout.label(text=f"in frame {found.frame}")
        if found.answer.places:
            draw_places(layout, context, found)
        if found.answer.faces:
            layout.operator("impinge.select").place_only = False


def draw_work(layout, operator):
    """The button, or the work in progress."""
    if state.running is None:
        layout.operator(operator)
        return
    done, total = state.running.frames or state.running.driver.progress
    row = layout.row(align=True)
    row.progress(factor=done / total if total else 0.0, text=f"{state.running.label} {done:,} of {total:,}" if total else state.running.label)
    row.operator("impinge.cancel", text="", icon="X")


def draw_places(layout, context, found):
    row = layout.row(align=True)
    row.operator("impinge.step", text="", icon="TRIA_LEFT").by = -1
    row.label(text=f"Place {found.place + 1:,} of {len(found.answer.places):,}")
    row.operator("impinge.step", text="", icon="TRIA_RIGHT").by = 1
    if 0 <= found.place < len(found.answer.places):
        place = found.answer.places[found.place]
        layout.label(text=text.of_place(place, lambda distance: length(context, distance)))
        layout.operator("impinge.select", text="Select Faces of This Place").place_only = True


class IMPINGE_PT_clearance(Part, bpy.types.Panel):
    bl_label = "Clearance"

    def draw(self, context):
        settings = context.scene.impinge
        self.layout.prop(settings, "distance")
        if settings.which != "BETWEEN":
            self.layout.prop(settings, "rings")
        draw_work(self.layout, "impinge.clearance")


class IMPINGE_PT_scan(Part, bpy.types.Panel):
    bl_label = "Animation"

    def draw(self, context):
        layout = self.layout
        settings = context.scene.impinge
        row = layout.row()
        row.prop(settings, "step")
        row.prop(settings, "mark")
        draw_work(layout, "impinge.scan")
        if not settings.n_frames:
            return
        layout.label(text=f"{settings.n_hits:,} of {text.counted(settings.n_frames, 'frame')} intersect")
        if settings.is_hit:
            row = layout.row(align=True)
            row.prop(settings, "first_frame")
            row.operator("impinge.first_frame", text="", icon="PLAY")


CLASSES = (IMPINGE_PT_check, IMPINGE_PT_clearance, IMPINGE_PT_scan)
