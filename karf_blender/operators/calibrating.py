"""Step 6: a color chart, clicked in a photo."""

import bpy
import numpy as np
from bpy.props import FloatVectorProperty, StringProperty

from .. import steps
from ..engine_api import BadRequest
from ..host import windows
from ..host.words import translatable, translate_report
from ..swatches import drawn_over
from .reporting import SwatchStep, reports_errors

CORNERS = (
    translatable("Click the outer corner of the brown patch.  Esc: cancel"),
    translatable(
        "Click the outer corner of the bluish green patch, at the other end of the brown patch's row.  Esc: cancel"
    ),
    translatable("Click the outer corner of the black patch.  Esc: cancel"),
    translatable("Click the outer corner of the white patch.  Esc: cancel"),
)


class KARF_OT_pick_chart(SwatchStep, bpy.types.Operator):
    """Click the corners of a 24-patch color chart, so that color names and numbers refer to daylight"""

    bl_idname = "karf.pick_chart"
    bl_label = "Pick Color Chart"
    bl_options = {"REGISTER", "UNDO"}

    image: StringProperty(name="Image", options={"SKIP_SAVE", "HIDDEN"})
    corners: FloatVectorProperty(name="Corners", size=8, options={"SKIP_SAVE", "HIDDEN"})

    def invoke(self, context, event):
        return self._wait(context)

    @reports_errors
    def _wait(self, context):
        _photo(context)
        self.clicked = []
        context.window_manager.modal_handler_add(self)
        context.window.cursor_modal_set("CROSSHAIR")
        self._say(context)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type in {"ESC", "RIGHTMOUSE"}:
            return self._ended(context, {"CANCELLED"})
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"}  # the picture can be moved and zoomed
        found = _clicked(context, (event.mouse_x, event.mouse_y))
        if found is None or (self.clicked and found[0] != self.image):
            return {"RUNNING_MODAL"}
        self.image = found[0]
        self.clicked.append(found[1])
        if len(self.clicked) < len(CORNERS):
            self._say(context)
            return {"RUNNING_MODAL"}
        self.corners = [value for place in self.clicked for value in place]
        return self._ended(context, self.execute(context))

    def cancel(self, context):
        self._ended(context, {"CANCELLED"})

    def _say(self, context):
        context.workspace.status_text_set(translate_report(CORNERS[len(self.clicked)]))

    def _ended(self, context, result):
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        return result

    @reports_errors
    def execute(self, context):
        image = bpy.data.images.get(self.image)
        if image is None:
            raise BadRequest("No Image Editor shows a photo.", "Open the photo of the chart in one.")
        fit = steps.pick_chart(context.scene, image, np.reshape(self.corners, (4, 2)))
        windows.redraw(*windows.PANEL_AREAS)
        self.report(
            {"INFO"},
            translate_report(
                "The chart's patches differ by CIEDE2000 {left} on average", left=f"{fit.mean_residual:.1f}"
            ),
        )
        return {"FINISHED"}


class KARF_OT_find_chart(SwatchStep, bpy.types.Operator):
    """Search the displayed photo for a 24-patch color chart, so that color names and numbers refer to daylight"""

    bl_idname = "karf.find_chart"
    bl_label = "Find Color Chart"

    @reports_errors
    def execute(self, context):
        steps.find_chart(context.scene, _photo(context))
        return {"FINISHED"}


class KARF_OT_remove_chart(SwatchStep, bpy.types.Operator):
    """Remove the color chart. Color names and numbers refer to the photos again, or to the gray card"""

    bl_idname = "karf.remove_chart"
    bl_label = "Remove Color Chart"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        steps.remove_chart(context.scene)
        windows.redraw(*windows.PANEL_AREAS)
        return {"FINISHED"}


def _editors(context):
    return [area for area in context.screen.areas if area.type == "IMAGE_EDITOR"]


def _photo(context):
    """The image of the first Image Editor that shows one."""
    shown = next((area.spaces.active.image for area in _editors(context) if area.spaces.active.image), None)
    if shown is None:
        raise BadRequest("No Image Editor shows a photo.", "Open the photo of the chart in one.")
    return shown


def _clicked(context, mouse):
    """The name of the image under the mouse, and where in it, from its lower left corner to its upper right one; or None."""
    for area in _editors(context):
        region, image = next(each for each in area.regions if each.type == "WINDOW"), area.spaces.active.image
        place = drawn_over.place_under(region, mouse)
        if image and place and 0 <= min(place) and max(place) <= 1:
            return image.name, place
    return None
