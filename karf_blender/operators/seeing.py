"""Looking at the picture: masks over it, before and after, a line to wipe with, one swatch alone."""

import time

import bpy
from bpy.props import IntProperty, StringProperty

from .. import steps
from ..project import disk
from ..swatches import drawn_over, edits, object_masks
from ..tasks import runner
from .reporting import EngineStep, SwatchStep, has_project, has_stage, reports_errors

HOLD_SECONDS = 0.25  # a key held longer shows the original only until it is let go


class KARF_OT_show_masks(bpy.types.Operator):
    """Show or hide the objects' masks over the active view, each in its color; the engine makes them the first time"""

    bl_idname = "karf.show_masks"
    bl_label = "Show Masks"

    @classmethod
    def poll(cls, context):
        is_prepared = disk.contents_of(context.scene).is_prepared
        return has_project(cls, context) and (is_prepared or has_stage(cls, context, "segmentation"))

    @reports_errors
    def execute(self, context):
        seeing = context.window_manager.karf_seeing
        if seeing.show_masks and object_masks.of(context.scene) is not None:
            seeing.show_masks = False
            return {"FINISHED"}
        task = steps.show_masks(context.scene)
        if task is not None:
            runner.launch(task)
        return {"FINISHED"}


class KARF_OT_see_view(EngineStep, bpy.types.Operator):
    """Render what the engine has learned, from the active view's camera"""

    bl_idname = "karf.see_view"
    bl_label = "Render Learned"
    after = "geometry"

    @reports_errors
    def execute(self, context):
        runner.launch(steps.see_view(context.scene))
        return {"FINISHED"}


class KARF_OT_solo_swatch(SwatchStep, bpy.types.Operator):
    """Show where this swatch is used: its weights alone, white where all of a pixel is its; again: back to the picture"""

    bl_idname = "karf.solo_swatch"
    bl_label = "Show Weights"

    object_name: StringProperty(name="Object")
    index: IntProperty(name="Swatch", default=1, min=1)

    @reports_errors
    def execute(self, context):
        edits.swatch_at(context.scene, self.object_name, self.index)
        seeing = context.window_manager.karf_seeing
        is_shown = seeing.mode == "WEIGHTS" and (seeing.solo_object, seeing.solo_swatch) == (
            self.object_name,
            self.index,
        )
        if not is_shown:
            seeing.solo_object, seeing.solo_swatch = self.object_name, self.index
        seeing.mode = "EDITED" if is_shown else "WEIGHTS"
        return {"FINISHED"}


class LookingStep:
    """Mix-in of operators for the picture in the Image Editor: elsewhere their keys keep their own meaning."""

    @classmethod
    def poll(cls, context):
        return drawn_over.shows_result(context)


class KARF_OT_before_after(LookingStep, bpy.types.Operator):
    """Switch between the edited picture and the original; a key that is held down shows the original until it is let go"""

    bl_idname = "karf.before_after"
    bl_label = "Before / After"

    def execute(self, context):
        seeing = context.window_manager.karf_seeing
        seeing.mode = "ORIGINAL" if seeing.mode != "ORIGINAL" else "EDITED"
        return {"FINISHED"}

    def invoke(self, context, event):
        self.execute(context)
        if event.type in {"LEFTMOUSE", "RET"} or event.value != "PRESS":
            return {"FINISHED"}
        self._key, self._pressed_at = event.type, time.monotonic()
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type != self._key or event.value != "RELEASE":
            return {"RUNNING_MODAL"}
        if time.monotonic() - self._pressed_at > HOLD_SECONDS:
            self.execute(context)
        return {"FINISHED"}


class KARF_OT_seeing_pie(LookingStep, bpy.types.Operator):
    """Choose what is shown of the active view"""

    bl_idname = "karf.seeing_pie"
    bl_label = "Show"

    def execute(self, context):
        bpy.ops.wm.call_menu_pie(name="KARF_MT_seeing_pie")
        return {"FINISHED"}


class KARF_OT_drag_wipe(LookingStep, bpy.types.Operator):
    """Move the line between the original and the picture with the mouse; a click leaves it there, Esc takes it away"""

    bl_idname = "karf.drag_wipe"
    bl_label = "Drag Wipe"

    def invoke(self, context, event):
        context.window_manager.karf_seeing.is_wiped = True
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set("Move the line with the mouse.  Click: leave it there.  Esc: no line")
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        seeing = context.window_manager.karf_seeing
        if event.type == "MOUSEMOVE":
            seeing.wipe = _share_of_picture(context, event)
            return {"RUNNING_MODAL"}
        is_left = event.type in {"ESC", "RIGHTMOUSE"}
        if not is_left and event.type not in {"LEFTMOUSE", "RET"}:
            return {"PASS_THROUGH"}
        context.workspace.status_text_set(None)
        seeing.is_wiped = not is_left
        return {"FINISHED"}


def _share_of_picture(context: bpy.types.Context, event: bpy.types.Event) -> float:
    """How far to the right in the picture the mouse is: 0 is its left border, 1 its right one."""
    region = next(region for region in context.area.regions if region.type == "WINDOW")
    left, _, right, _ = drawn_over.picture_in(region)
    return min(1.0, max(0.0, (event.mouse_x - region.x - left) / max(1, right - left)))


CLASSES = (
    KARF_OT_show_masks,
    KARF_OT_see_view,
    KARF_OT_solo_swatch,
    KARF_OT_before_after,
    KARF_OT_seeing_pie,
    KARF_OT_drag_wipe,
)
