"""Display of the active view: prepared views, masks, weights, before and after, the split view."""

import bpy
from bpy.props import IntProperty, StringProperty

from .. import steps
from ..pictures import editors
from ..swatches import displayed, edits, overlays
from .base import GEOMETRY, IDLE, PALETTES, PREPARED, PROJECT, RECOLORING, SEGMENTATION, StepOperator, Undoable

REACH = 8  # pixels from the line of the split view within which the mouse takes it


class KARF_OT_show_view(Undoable, bpy.types.Operator):
    """Show a captured view with the current swatches. The engine prepares it the first time"""

    bl_idname = "karf.show_view"
    bl_label = "Show View"
    needs = (PROJECT, PALETTES)

    view: StringProperty(name="View", description="Empty: the active view", options={"SKIP_SAVE"})

    def step(self, context):
        task = steps.show_view(context.scene, self.view)
        result = context.scene.karf.result
        if context.area and context.area.type == "IMAGE_EDITOR" and result is not None:
            editors.show(context.area, result)
        return task


class KARF_OT_prepare_views(StepOperator, bpy.types.Operator):
    """Prepare all captured views, so that each is shown immediately"""

    bl_idname = "karf.prepare_views"
    bl_label = "Prepare All Views"
    needs = (IDLE, PROJECT, RECOLORING)

    views: StringProperty(name="Views", default="all", description="all, train, test, or names separated by commas")

    def step(self, context):
        return steps.prepare_views(context.scene, self.views)


class KARF_OT_show_masks(StepOperator, bpy.types.Operator):
    """Show or hide the objects' masks over the active view, in their colors. The engine computes them once"""

    bl_idname = "karf.show_masks"
    bl_label = "Show Masks"
    needs = (PROJECT, lambda context: PREPARED(context) and SEGMENTATION(context))

    def step(self, context):
        seeing = context.window_manager.karf_seeing
        if seeing.show_masks and displayed.of(context.scene).known_masks() is not None:
            seeing.show_masks = False
        else:
            steps.show_masks(context.scene)


class KARF_OT_see_view(StepOperator, bpy.types.Operator):
    """Render the learned scene from the active view's camera"""

    bl_idname = "karf.see_view"
    bl_label = "Render Learned"
    needs = (IDLE, PROJECT, GEOMETRY)
    scene_step = steps.see_view


class KARF_OT_solo_swatch(StepOperator, bpy.types.Operator):
    """Show where this swatch is used (white: the whole pixel), or only the object. Press again for the picture"""

    bl_idname = "karf.solo_swatch"
    bl_label = "Show Weights"
    needs = (PALETTES,)

    object_name: StringProperty(name="Object")
    index: IntProperty(
        name="Swatch", default=1, min=0, description="Counted from 1. 0: the object, with everything else dimmed"
    )

    def step(self, context):
        if self.index:
            edits.swatch_at(context.scene, self.object_name, self.index)
        else:
            edits.object_named(context.scene, self.object_name)
        seeing = context.window_manager.karf_seeing
        solo = self.object_name, self.index
        is_shown = seeing.mode == "WEIGHTS" and (seeing.solo_object, seeing.solo_swatch) == solo
        if not is_shown:
            seeing.solo_object, seeing.solo_swatch = solo
        seeing.mode = "EDITED" if is_shown else "WEIGHTS"


class PictureOperator:
    """Mix-in of operators whose keys work on the picture alone, and keep their other meanings elsewhere."""

    @classmethod
    def poll(cls, context):
        return overlays.shows_picture(context)


class KARF_OT_before_after(PictureOperator, bpy.types.Operator):
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


class KARF_OT_seeing_pie(PictureOperator, bpy.types.Operator):
    """Choose what the Image Editor shows of the active view"""

    bl_idname = "karf.seeing_pie"
    bl_label = "Show"

    def execute(self, context):
        bpy.ops.wm.call_menu_pie(name="KARF_MT_seeing_pie")
        return {"FINISHED"}


class KARF_OT_drag_wipe(PictureOperator, bpy.types.Operator):
    """Move the line between original and recolored picture with the mouse. Click: keep it there; Esc: remove it"""

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
    """Return the mouse's place across the picture: 0 at the left border, 1 at the right."""
    region = next(region for region in context.area.regions if region.type == "WINDOW")
    left, _, right, _ = overlays.picture_in(region)
    return min(1.0, max(0.0, (event.mouse_x - region.x - left) / max(1, right - left)))


class KARF_GT_wipe(bpy.types.Gizmo):
    """The line itself; it is drawn with the rest that lies over the picture."""

    def setup(self):
        self.use_draw_modal = True

    def draw(self, context):
        if self.is_highlight:
            overlays.draw_split(context, is_bold=True)

    def test_select(self, context, location):
        left, bottom, right, top = overlays.picture_in(context.region)
        line = left + context.window_manager.karf_seeing.wipe * (right - left)
        reach = REACH * context.preferences.system.ui_scale
        return 0 if abs(location[0] - line) < reach and bottom < location[1] < top else -1

    def invoke(self, context, event):
        self._before = context.window_manager.karf_seeing.wipe
        return {"RUNNING_MODAL"}

    def modal(self, context, event, tweak):
        context.window_manager.karf_seeing.wipe = _share_of_picture(context, event)
        return {"RUNNING_MODAL"}

    def exit(self, context, cancel):
        if cancel:
            context.window_manager.karf_seeing.wipe = self._before


class KARF_GGT_wipe(bpy.types.GizmoGroup):
    """Split line between the original and the recolored picture"""

    bl_label = "KaRF Wipe"
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT"}

    @classmethod
    def poll(cls, context):
        return context.window_manager.karf_seeing.is_wiped and overlays.shows_picture(context)

    def setup(self, context):
        self.gizmos.new(KARF_GT_wipe.__name__)
