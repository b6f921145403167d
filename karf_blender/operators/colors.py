"""Step 4: colors picked in the picture or in a color book, and the color chart."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatVectorProperty, IntProperty, StringProperty

from .. import preferences, session, steps
from ..engine_api import BOOK_SUFFIXES, BadRequest, ColorBook, KarfError, read_color_book
from ..host import windows
from ..host.words import translatable, translate_report
from ..pictures import tints
from ..preferences import color_book
from ..properties.colors import pigment_reach, protected_neutrals, srgb
from ..swatches import displayed, overlays
from .base import PALETTES, PREPARED, PROJECT, OpenFileOperator, StepOperator, Undoable, file_filter, reports_errors

CORNERS = (
    translatable("Click the outer corner of the brown patch.  Esc: cancel"),
    translatable(
        "Click the outer corner of the bluish green patch, at the other end of the brown patch's row.  Esc: cancel"
    ),
    translatable("Click the outer corner of the black patch.  Esc: cancel"),
    translatable("Click the outer corner of the white patch.  Esc: cancel"),
)


class KARF_OT_add_color(Undoable, bpy.types.Operator):
    """Pick one of the object's colors in the picture as another swatch, which changes only this pigment"""

    bl_idname = "karf.add_color"
    bl_label = "Add Color"
    needs = (PROJECT, PALETTES, PREPARED)

    object_name: StringProperty(name="Object")
    picked: srgb("Picked", 0.5, description="A color of the object, as it appears in the photos", options={"SKIP_SAVE"})
    reach: pigment_reach(options={"SKIP_SAVE"})
    protect: protected_neutrals(options={"SKIP_SAVE"})

    @reports_errors
    def invoke(self, context, event):
        if not list(_pictures(context)):
            raise BadRequest("No Image Editor shows the recolored picture.", "Open one, and press Show in step 4.")
        context.window_manager.modal_handler_add(self)
        magnifier = session.get(_Loupe)
        magnifier.mouse, magnifier.object_name = None, self.object_name
        magnifier.handler = bpy.types.SpaceImageEditor.draw_handler_add(_draw_loupe, (), "WINDOW", "POST_PIXEL")
        context.window.cursor_modal_set("EYEDROPPER")
        hint = translatable("Click on {name} in the picture to add the color there.  Esc: cancel")
        context.workspace.status_text_set(translate_report(hint, name=self.object_name))
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "MOUSEMOVE":
            session.get(_Loupe).mouse = event.mouse_x, event.mouse_y
            windows.redraw()
            return {"RUNNING_MODAL"}
        if event.type in {"ESC", "RIGHTMOUSE"}:
            return self._finish(context, {"CANCELLED"})
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"} if event.type.startswith(("WHEEL", "MIDDLE", "TRACKPAD")) else {"RUNNING_MODAL"}
        return self._finish(context, self._pick(context, event))

    @reports_errors
    def _pick(self, context, event):
        place = _place_in_picture(context, (event.mouse_x, event.mouse_y))
        self.picked = steps.color_at(context.scene, self.object_name, place)
        return self.execute(context)

    def cancel(self, context):
        self._finish(context, {"CANCELLED"})

    def _finish(self, context, result):
        bpy.types.SpaceImageEditor.draw_handler_remove(session.get(_Loupe).handler, "WINDOW")
        windows.redraw()
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        return result

    def step(self, context):
        given = {name: getattr(self, name) for name in ("reach", "protect") if self.properties.is_property_set(name)}
        number = steps.add_color(context.scene, self.object_name, self.picked, **given)
        added = context.scene.karf.objects[self.object_name].swatches[number]
        self.reach, self.protect = added.reach, added.protect  # what was proposed is where changing it begins
        return translate_report("A swatch was added behind the others: change its color")


@dataclass
class _Loupe:
    """The magnifier beside the mouse while a color is picked."""

    mouse: tuple[int, int] | None = None  # in the window
    object_name: str = ""
    handler: object = None


def _draw_loupe() -> None:
    context, mouse = bpy.context, session.get(_Loupe).mouse
    region, place = context.region, mouse and _place_in_picture(context, mouse)
    if not place or not overlays.is_result(context.scene, context.space_data):
        return
    x, y = mouse[0] - region.x, mouse[1] - region.y
    if not (0 <= x < region.width and 0 <= y < region.height and 0 <= min(place) and max(place) < 1):
        return
    try:
        picked = steps.color_at(context.scene, session.get(_Loupe).object_name, place)
    except KarfError:  # the object is not there: a click would say so
        picked = None
    pixels = overlays.pixels_at(displayed.of(context.scene).prepared_view().planes.base, place)
    overlays.draw_loupe(pixels, picked, (x, y), region)


def _place_in_picture(context: bpy.types.Context, mouse: tuple[int, int]) -> tuple[float, float]:
    """Return the mouse's place in the picture, 0 to 1 from the lower left corner; negative beside all pictures."""
    for region in _pictures(context):
        place = overlays.place_under(region, mouse)
        if place is not None:
            return place
    return -1.0, -1.0


def _pictures(context: bpy.types.Context) -> Iterator[bpy.types.Region]:
    """The main regions of the Image Editors that show the result image."""
    for area in context.screen.areas:
        if overlays.is_result(context.scene, area.spaces.active):
            yield next(region for region in area.regions if region.type == "WINDOW")


class KARF_OT_pick_chart(Undoable, bpy.types.Operator):
    """Click the corners of a 24-patch color chart, so that color names and numbers refer to daylight"""

    bl_idname = "karf.pick_chart"
    bl_label = "Pick Color Chart"
    needs = (PALETTES,)

    image: StringProperty(name="Image", options={"SKIP_SAVE", "HIDDEN"})
    corners: FloatVectorProperty(name="Corners", size=8, options={"SKIP_SAVE", "HIDDEN"})

    @reports_errors
    def invoke(self, context, event):
        _photo(context)
        self.clicked = []
        context.window_manager.modal_handler_add(self)
        context.window.cursor_modal_set("CROSSHAIR")
        self._show_hint(context)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type in {"ESC", "RIGHTMOUSE"}:
            return self._finish(context, {"CANCELLED"})
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"}  # the picture can be moved and zoomed
        found = _clicked(context, (event.mouse_x, event.mouse_y))
        if found is None or (self.clicked and found[0] != self.image):
            return {"RUNNING_MODAL"}
        self.image = found[0]
        self.clicked.append(found[1])
        if len(self.clicked) < len(CORNERS):
            self._show_hint(context)
            return {"RUNNING_MODAL"}
        self.corners = [value for place in self.clicked for value in place]
        return self._finish(context, self.execute(context))

    def cancel(self, context):
        self._finish(context, {"CANCELLED"})

    def _show_hint(self, context):
        context.workspace.status_text_set(translate_report(CORNERS[len(self.clicked)]))

    def _finish(self, context, result):
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        return result

    def step(self, context):
        image = bpy.data.images.get(self.image)
        if image is None:
            raise BadRequest("No Image Editor shows a photo.", "Open the photo of the chart in one.")
        fit = steps.pick_chart(context.scene, image, np.reshape(self.corners, (4, 2)))
        left = f"{fit.mean_residual:.1f}"
        return translate_report("The chart's patches differ by CIEDE2000 {left} on average", left=left)


class KARF_OT_find_chart(StepOperator, bpy.types.Operator):
    """Search the displayed photo for a 24-patch color chart, so that color names and numbers refer to daylight"""

    bl_idname = "karf.find_chart"
    bl_label = "Find Color Chart"
    needs = (PALETTES,)

    def step(self, context):
        steps.find_chart(context.scene, _photo(context))


class KARF_OT_remove_chart(Undoable, bpy.types.Operator):
    """Remove the color chart. Color names and numbers refer to the photos again, or to the gray card"""

    bl_idname = "karf.remove_chart"
    bl_label = "Remove Color Chart"
    needs = (PALETTES,)
    scene_step = steps.remove_chart


def _editors(context):
    return [area for area in context.screen.areas if area.type == "IMAGE_EDITOR"]


def _photo(context):
    """The image of the first Image Editor that shows one."""
    shown = next((area.spaces.active.image for area in _editors(context) if area.spaces.active.image), None)
    if shown is None:
        raise BadRequest("No Image Editor shows a photo.", "Open the photo of the chart in one.")
    return shown


def _clicked(context, mouse):
    """Return the name of the image under the mouse and the place in it, 0 to 1 from the lower left corner; or None."""
    for area in _editors(context):
        region, image = next(each for each in area.regions if each.type == "WINDOW"), area.spaces.active.image
        place = overlays.place_under(region, mouse)
        if image and place and 0 <= min(place) and max(place) <= 1:
            return image.name, place
    return None


class NamedColorOperator(Undoable):
    """Mix-in of operators that give a swatch, or an object's target color, the color of a name."""

    needs = (PALETTES,)

    object_name: StringProperty(name="Object")
    index: IntProperty(name="Swatch", min=0, description="Counted from 1. 0: the target color", options={"SKIP_SAVE"})

    def use(self, context, name):
        left = steps.use_color_name(context.scene, self.object_name, self.index, _book(), name)
        if left:
            sentence = translatable("{name} is outside sRGB: the nearest color differs from it by CIEDE2000 {left}")
            self.report({"WARNING"}, translate_report(sentence, name=name, left=f"{left:.1f}"))


class KARF_OT_use_color_name(NamedColorOperator, bpy.types.Operator):
    """Use the color with this name"""

    bl_idname = "karf.use_color_name"
    bl_label = "Use Color Name"

    color_name: StringProperty(name="Name")

    def step(self, context):
        self.use(context, self.color_name)


class KARF_OT_find_color_name(NamedColorOperator, bpy.types.Operator):
    """Search the color book for a name and use its color"""

    bl_idname = "karf.find_color_name"
    bl_label = "Find Color Name"
    bl_property = "entry"

    entry: EnumProperty(name="Name", items=lambda self, context: _items(color_book.known().book), options={"SKIP_SAVE"})

    def invoke(self, context, event):
        context.window_manager.invoke_search_popup(self)
        return {"RUNNING_MODAL"}

    def step(self, context):
        self.use(context, _book().names[int(self.entry)])


class KARF_OT_choose_color_book(OpenFileOperator, bpy.types.Operator):
    """Choose a book of named colors: Adobe's .acb or .ase, GIMP's .gpl, or a .csv table. The preferences keep it"""

    bl_idname = "karf.choose_color_book"
    bl_label = "Color Book"

    filter_glob: file_filter(";".join(f"*{suffix}" for suffix in BOOK_SUFFIXES))

    def invoke(self, context, event):
        self.filepath = preferences.current().color_book
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def step(self, context):
        book = read_color_book(self.path)
        preferences.current().color_book = str(self.path)
        context.preferences.is_dirty = True  # so that Blender keeps it, as where it is set there
        return translate_report("{book}: {count} names", book=book.name, count=len(book))


def _book() -> ColorBook:
    book, problem = color_book.known()
    if problem:
        raise BadRequest(problem)
    if book is None:
        raise BadRequest("No color book is chosen.", "Choose one in a swatch's menu, or in the preferences.")
    return book


@lru_cache(maxsize=1)  # Blender needs the texts as long as it shows them
def _items(book: ColorBook | None) -> list[tuple[str, str, str, int, int]]:
    if book is None:
        return []
    return [(str(number), name, "", tints.icon(book[name]), number) for number, name in enumerate(book.names)]
