"""Finds where meshes intersect, exactly, in every frame: an extension for Blender."""

import bpy

from . import operators, panel, settings, state

CLASSES = (*operators.CLASSES, *panel.CLASSES)


def register():
    settings.register()
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    bpy.app.handlers.load_post.append(state.forget)


def unregister():
    if state.running is not None:
        state.running.driver.cancel()
    bpy.app.handlers.load_post.remove(state.forget)
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
    settings.unregister()
