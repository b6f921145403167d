"""Looking at the picture: masks over it, before and after, one swatch alone."""

import bpy
from bpy.props import IntProperty, StringProperty

from .. import steps
from ..project import disk
from ..swatches import displayed, drawn_over, edits
from ..tasks import runner
from .reporting import EngineStep, SwatchStep, has_project, has_stage, reports_errors


class KARF_OT_show_masks(bpy.types.Operator):
    """Show or hide the objects' masks over the active view, in their colors. The engine computes them once"""

    bl_idname = "karf.show_masks"
    bl_label = "Show Masks"

    @classmethod
    def poll(cls, context):
        is_prepared = disk.contents_of(context.scene).is_prepared
        return has_project(cls, context) and (is_prepared or has_stage(cls, context, "segmentation"))

    @reports_errors
    def execute(self, context):
        seeing = context.window_manager.karf_seeing
        if seeing.show_masks and displayed.of(context.scene).known_masks() is not None:
            seeing.show_masks = False
            return {"FINISHED"}
        steps.show_masks(context.scene)
        return {"FINISHED"}


class KARF_OT_see_view(EngineStep, bpy.types.Operator):
    """Render the learned scene from the active view's camera"""

    bl_idname = "karf.see_view"
    bl_label = "Render Learned"
    after = "geometry"

    @reports_errors
    def execute(self, context):
        runner.launch(steps.see_view(context.scene))
        return {"FINISHED"}


class KARF_OT_solo_swatch(SwatchStep, bpy.types.Operator):
    """Show where this swatch is used (white: the whole pixel), or only the object. Press again for the picture"""

    bl_idname = "karf.solo_swatch"
    bl_label = "Show Weights"

    object_name: StringProperty(name="Object")
    index: IntProperty(
        name="Swatch", default=1, min=0, description="Counted from 1. 0: the object, with everything else dimmed"
    )

    @reports_errors
    def execute(self, context):
        if self.index:
            edits.swatch_at(context.scene, self.object_name, self.index)
        else:
            edits.object_named(context.scene, self.object_name)
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
        return drawn_over.shows_picture(context)


class KARF_OT_before_after(LookingStep, bpy.types.Operator):
    """Switch between the edited and the original picture. Hold the key to show the original until you release it"""

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
        self._key, self._is_held = event.type, False
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == self._key and event.value == "PRESS":  # keys repeat while they are held
            self._is_held = True
        if event.type != self._key or event.value != "RELEASE":
            return {"RUNNING_MODAL"}
        if self._is_held:
            self.execute(context)
        return {"FINISHED"}


class KARF_OT_seeing_pie(LookingStep, bpy.types.Operator):
    """Choose what the Image Editor shows of the active view"""

    bl_idname = "karf.seeing_pie"
    bl_label = "Show"

    def execute(self, context):
        bpy.ops.wm.call_menu_pie(name="KARF_MT_seeing_pie")
        return {"FINISHED"}
