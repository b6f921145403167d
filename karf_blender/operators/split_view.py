"""The split view: the line between the original and the picture, dragged where it is, or moved by a button."""

import bpy

from ..swatches import drawn_over

REACH = 8  # pixels from the line within which the mouse takes it


class KARF_OT_drag_wipe(bpy.types.Operator):
    """Move the line between original and recolored picture with the mouse. Click: keep it there; Esc: remove it"""

    bl_idname = "karf.drag_wipe"
    bl_label = "Drag Wipe"

    @classmethod
    def poll(cls, context):
        return drawn_over.shows_picture(context)

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


class KARF_GT_wipe(bpy.types.Gizmo):
    """The line itself; it is drawn with the rest that lies over the picture."""

    bl_idname = "KARF_GT_wipe"

    def setup(self):
        self.use_draw_modal = True

    def draw(self, context):
        if self.is_highlight:
            drawn_over.draw_split(context, is_bold=True)

    def test_select(self, context, location):
        left, bottom, right, top = drawn_over.picture_in(context.region)
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

    bl_idname = "KARF_GGT_wipe"
    bl_label = "KaRF Wipe"
    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT"}

    @classmethod
    def poll(cls, context):
        return context.window_manager.karf_seeing.is_wiped and drawn_over.shows_picture(context)

    def setup(self, context):
        self.gizmos.new(KARF_GT_wipe.bl_idname)
