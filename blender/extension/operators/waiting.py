"""Operators whose work is done in another thread, and the one that stops them."""

from __future__ import annotations

import bpy
import impinge

from .. import state
from ..job import Driver

__all__ = ["CLASSES", "Waiting"]

#: Seconds between two looks at the work.
TICK = 0.05


class Waiting:
    """Called from a button (invoked), the operator returns at once and looks at its work from a timer. Called from a script (executed), it
    waits. `steps(context)` is a generator that yields jobs and is sent their results; it names data-blocks rather than hold them from one
    step to the next, because an undo may replace them meanwhile.
    """

    label = "Work"

    def execute(self, context):
        if self._is_busy():
            return {"CANCELLED"}
        driver = Driver(self.steps(context))
        state.run(state.Running(self.label, driver))
        try:
            return self._poll(driver.run)
        finally:
            state.run(None)

    def invoke(self, context, event):
        if bpy.app.background:
            return self.execute(context)
        if self._is_busy():
            return {"CANCELLED"}
        self._driver = Driver(self.steps(context))
        state.run(state.Running(self.label, self._driver))
        self._timer = context.window_manager.event_timer_add(TICK, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self._driver.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        result = {"CANCELLED"}
        try:
            # Half of the time is the interface's.
            result = self._poll(lambda: self._driver.poll(TICK / 2))
        finally:
            # Whatever goes wrong, other work can begin.
            if result is not None:
                self._end(context)
        redraw(context)
        return result or {"PASS_THROUGH"}

    def cancel(self, context):
        """Blender ends the operator: another file is opened, or the window is closed."""
        self._driver.cancel()
        self._end(context)

    def _end(self, context):
        context.window_manager.event_timer_remove(self._timer)
        state.run(None)
        redraw(context)

    def _is_busy(self):
        if state.running is not None:
            self.report({"WARNING"}, f"{state.running.label} is still running")
        return state.running is not None

    def _poll(self, call):
        """What the operator returns: None while its work goes on."""
        try:
            done = call()
        except impinge.Cancelled:
            self.report({"INFO"}, f"{self.label} was cancelled")
            return {"CANCELLED"}
        except (impinge.Error, ValueError, KeyError, MemoryError) as error:
            self.report({"ERROR"}, f"{self.label}: {error}")
            return {"CANCELLED"}
        return None if done is False else {"FINISHED"}


def redraw(context):
    """Draws the panel again, in all windows."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


class IMPINGE_OT_cancel(bpy.types.Operator):
    """Stop the work in progress"""

    bl_idname = "impinge.cancel"
    bl_label = "Cancel"

    @classmethod
    def poll(cls, context):
        return state.running is not None

    def execute(self, context):
        state.running.driver.cancel()
        return {"FINISHED"}


CLASSES = (IMPINGE_OT_cancel,)
