"""What is kept with each scene: the options of the panel, and what a scan has found."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty

__all__ = ["Settings", "register", "unregister"]


class Settings(bpy.types.PropertyGroup):
    """`scene.impinge`."""

    which: EnumProperty(
        name="Which",
        description="Which pairs of faces are looked for",
        items=[
            ("ACTIVE", "Active", "Where the active object cuts through itself"),
            ("BETWEEN", "Between", "Where the selected objects cut through each other"),
            ("ALL", "Both", "Where the selected objects cut through each other and each through itself"),
        ],
        default="ACTIVE",
    )
    weld: BoolProperty(
        name="Weld",
        description="Take vertices at the same position for one. Faces beside a seam are neighbours then, and do not count as touching",
        default=True,
    )
    selected_only: BoolProperty(
        name="Selected Faces Only",
        description="In Edit Mode: only pairs with a selected face count. If no face is selected, all count",
        default=True,
    )
    distance: FloatProperty(
        name="Distance",
        description="Find all that is at most this near",
        subtype="DISTANCE",
        unit="LENGTH",
        min=0.0,
        default=0.01,
        precision=4,
    )
    rings: IntProperty(
        name="Rings",
        description="Within one object, leave out what is at most this many edges away along the surface",
        min=0,
        max=16,
        default=2,
    )
    step: IntProperty(name="Step", description="Look at each frame, each second frame, … Where something is simulated, frames between are gone through, too", min=1, default=1)
    mark: BoolProperty(
        name="Markers",
        description="Put a marker on the timeline where frames that intersect begin, and where they end",
        default=True,
    )
    # Not hidden, and animatable: drivers and keyframes can use it.
    first_frame: IntProperty(
        name="First Frame",
        description="The first frame that intersects, of the last scan",
        min=-1048574,
        max=1048574,
    )
    is_hit: BoolProperty(name="Intersects", description="Whether the last scan has found a frame that intersects")
    n_frames: IntProperty(name="Frames", description="How many frames the last scan has looked at")
    n_hits: IntProperty(name="Frames that Intersect", description="How many frames intersect, of the last scan")


def register():
    bpy.utils.register_class(Settings)
    bpy.types.Scene.impinge = PointerProperty(type=Settings)


def unregister():
    del bpy.types.Scene.impinge
    bpy.utils.unregister_class(Settings)
