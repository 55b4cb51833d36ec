"""Shows the extension in a window of Blender, step by step, and takes a picture of each step: what `scripts/picture blender` runs.

Run by Blender, with the extension installed, as `--python window.py -- OUT`: a folder for the pictures.
"""

import os
import subprocess
import sys
import traceback
from pathlib import Path

import bpy
from bl_ext.user_default.impinge import state

OUT = Path(sys.argv[-1])


def area(kind):
    return next(area for area in bpy.context.window_manager.windows[0].screen.areas if area.type == kind)


def within(kind, region="WINDOW"):
    window, inside = bpy.context.window_manager.windows[0], area(kind)
    [region] = [one for one in inside.regions if one.type == region]
    return bpy.context.temp_override(window=window, screen=window.screen, area=inside, region=region)


def press(operator, **options):
    """What the button does: the operator returns at once, and its work goes on beside the window."""
    with within("VIEW_3D", "UI"):
        operator("INVOKE_DEFAULT", **options)
    yield 1
    while state.running is not None:
        yield 0.2
    # Panels move to their new places.
    yield 1


def picture(name):
    # Blender's own screenshot is black where software draws.
    subprocess.run(["import", "-window", "root", str(OUT / f"{name}.png")], check=True)


def window():
    """A view and a timeline below it, the sidebar open."""
    for kind in ("OUTLINER", "PROPERTIES", "DOPESHEET_EDITOR"):
        with within(kind):
            bpy.ops.screen.area_close()
        yield 0.5
    with within("VIEW_3D"):
        bpy.ops.screen.area_split(direction="HORIZONTAL", factor=0.15)
    yield 0.5
    lower = min((one for one in bpy.context.window_manager.windows[0].screen.areas if one.type == "VIEW_3D"), key=lambda one: one.y)
    lower.ui_type = "TIMELINE"
    yield 0.5
    for region in ("CHANNELS", "UI"):
        with within("DOPESHEET_EDITOR"):
            bpy.ops.screen.region_toggle(region_type=region)
    yield 0.5
    space = area("VIEW_3D").spaces.active
    space.show_region_toolbar = space.show_gizmo = False
    yield 0.5
    area("VIEW_3D").spaces.active.show_region_ui = True
    yield 1


def objects():
    """A head whose eyes cut into it, and a ring that falls over it."""
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    bpy.ops.mesh.primitive_torus_add(major_radius=1.3, minor_radius=0.2, location=(0, 0, 2.2))
    ring = bpy.context.object
    ring.name = "Ring"
    for frame, height, turn in ((1, 2.2, 0.5), (60, -2.0, -0.3)):
        ring.location.z, ring.rotation_euler.x = height, turn
        ring.keyframe_insert("location", frame=frame)
        ring.keyframe_insert("rotation_euler", frame=frame)
    bpy.ops.mesh.primitive_monkey_add(size=2)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 60
    bpy.context.scene.frame_set(1)


def look():
    view = area("VIEW_3D").spaces.active.region_3d
    view.view_location, view.view_distance = (0.5, 0.5, 0.8), 8


def steps():
    yield from window()
    objects()
    look()
    with within("DOPESHEET_EDITOR"):
        bpy.ops.action.view_all()
    yield 0.5
    next(region for region in area("VIEW_3D").regions if region.type == "UI").active_panel_category = "impinge"
    area("VIEW_3D").tag_redraw()
    bpy.context.window_manager.windows[0].cursor_warp(300, 500)
    yield 1
    settings, press_it = bpy.context.scene.impinge, bpy.ops.impinge
    yield 0.5
    picture("before")
    yield from press(press_it.check)
    picture("checked")
    yield from press(press_it.step, by=1)
    picture("place")
    yield from press(press_it.select, place_only=True)
    picture("selected")
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.data.objects["Ring"].select_set(True)
    settings.which = "BETWEEN"
    look()
    yield from press(press_it.scan)
    yield from press(press_it.first_frame)
    picture("scanned")
    yield from press(press_it.check)
    yield from press(press_it.step, by=1)
    yield from press(press_it.select, place_only=False)
    picture("between")


def go(script=steps()):
    try:
        return next(script)
    except StopIteration:
        pass
    except Exception:
        traceback.print_exc()
    # Without a question whether to save.
    sys.stdout.flush()
    os._exit(0 if (OUT / "between.png").exists() else 1)


bpy.context.preferences.view.show_splash = False
bpy.app.timers.register(go, first_interval=3)
