"""Step 6: a color of an object is picked in the picture and becomes one more swatch."""

from collections.abc import Iterator

import bpy
from bpy.props import StringProperty

from .. import steps
from ..engine_api import BadRequest, KarfError
from ..host import windows
from ..host.words import translate_report
from ..properties.colors import pigment_reach, protected_neutrals, srgb
from ..swatches import displayed, drawn_over, loupe
from .reporting import PreparedStep, reports_errors
from .swatches import OneSwatch


class KARF_OT_add_color(PreparedStep, bpy.types.Operator):
    """Pick one of the object's colors in the picture as another swatch, which changes only this pigment"""

    bl_idname = "karf.add_color"
    bl_label = "Add Color"
    bl_options = {"REGISTER", "UNDO"}

    object_name: StringProperty(name="Object")
    picked: srgb("Picked", 0.5, description="A color of the object, as it appears in the photos", options={"SKIP_SAVE"})
    reach: pigment_reach(options={"SKIP_SAVE"})
    protect: protected_neutrals(options={"SKIP_SAVE"})

    def invoke(self, context, event):
        return self._wait(context)

    @reports_errors
    def _wait(self, context):
        if not list(_pictures(context)):
            raise BadRequest("No Image Editor shows the recolored picture.", "Open one, and press Show in step 6.")
        context.window_manager.modal_handler_add(self)
        _Loupe.mouse, _Loupe.object_name = None, self.object_name
        _Loupe.handler = bpy.types.SpaceImageEditor.draw_handler_add(_draw_loupe, (), "WINDOW", "POST_PIXEL")
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set(
            translate_report(
                "Click on {name} in the picture to add the color there.  Esc: cancel", name=self.object_name
            )
        )
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "MOUSEMOVE":
            _Loupe.mouse = event.mouse_x, event.mouse_y
            drawn_over.redraw()
            return {"RUNNING_MODAL"}
        if event.type in {"ESC", "RIGHTMOUSE"}:
            return self._ended(context, {"CANCELLED"})
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"} if event.type.startswith(("WHEEL", "MIDDLE", "TRACKPAD")) else {"RUNNING_MODAL"}
        return self._ended(context, self._pick(context, event))

    @reports_errors
    def _pick(self, context, event):
        place = _place_in_picture(context, (event.mouse_x, event.mouse_y))
        self.picked = steps.color_at(context.scene, self.object_name, place)
        return self.execute(context)

    def cancel(self, context):
        self._ended(context, {"CANCELLED"})

    def _ended(self, context, result):
        bpy.types.SpaceImageEditor.draw_handler_remove(_Loupe.handler, "WINDOW")
        drawn_over.redraw()
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        return result

    @reports_errors
    def execute(self, context):
        given = {name: getattr(self, name) for name in ("reach", "protect") if self.properties.is_property_set(name)}
        number = steps.add_color(context.scene, self.object_name, self.picked, **given)
        added = context.scene.karf.objects[self.object_name].swatches[number]
        self.reach, self.protect = added.reach, added.protect  # what was proposed is where changing it begins
        windows.redraw(*windows.PANEL_AREAS)
        self.report({"INFO"}, translate_report("Swatch {number} was added: change its color", number=number))
        return {"FINISHED"}


class KARF_OT_protect_neutrals(OneSwatch, bpy.types.Operator):
    """Change only this swatch's pigment: lettering, bands, a print. Silver, foil, paper and gloss stay as they are"""

    bl_idname = "karf.protect_neutrals"
    bl_label = "Protect Neutrals"

    @reports_errors
    def execute(self, context):
        number = steps.protect_neutrals(context.scene, self.object_name, self.index)
        windows.redraw(*windows.PANEL_AREAS)
        if number != self.index:
            self.report({"INFO"}, translate_report("Swatch {number} now changes only this pigment", number=number))
        return {"FINISHED"}


class KARF_OT_remove_color(OneSwatch, bpy.types.Operator):
    """Remove this added color. Its pigment follows the other swatches again"""

    bl_idname = "karf.remove_color"
    bl_label = "Remove"

    @reports_errors
    def execute(self, context):
        steps.remove_color(context.scene, self.object_name, self.index)
        return {"FINISHED"}


class _Loupe:
    """Where the mouse is in the window while a color is picked, of which object, and what draws there."""

    mouse: tuple[int, int] | None = None
    object_name: str = ""
    handler: object = None


def _draw_loupe() -> None:
    context = bpy.context
    region, place = context.region, _Loupe.mouse and _place_in_picture(context, _Loupe.mouse)
    if not place or not drawn_over.is_result(context.scene, context.space_data):
        return
    x, y = _Loupe.mouse[0] - region.x, _Loupe.mouse[1] - region.y
    if not (0 <= x < region.width and 0 <= y < region.height and 0 <= min(place) and max(place) < 1):
        return
    try:
        picked = steps.color_at(context.scene, _Loupe.object_name, place)
    except KarfError:  # the object is not there: a click would say so
        picked = None
    pixels = loupe.pixels_at(displayed.of(context.scene).prepared_view().planes.base, place)
    loupe.draw(pixels, picked, (x, y), (region.width, region.height))


def _place_in_picture(context: bpy.types.Context, mouse: tuple[int, int]) -> tuple[float, float]:
    """Where the mouse is in the picture, from its lower left corner to its upper right one; beside it, out of 0 to 1."""
    for region in _pictures(context):
        place = drawn_over.place_under(region, mouse)
        if place is not None:
            return place
    return -1.0, -1.0


def _pictures(context: bpy.types.Context) -> Iterator[bpy.types.Region]:
    """The main regions of the Image Editors that show the result image."""
    for area in context.screen.areas:
        if drawn_over.is_result(context.scene, area.spaces.active):
            yield next(region for region in area.regions if region.type == "WINDOW")
