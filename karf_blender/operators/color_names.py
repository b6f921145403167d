"""Step 6: colors by their names in a color book."""

from functools import lru_cache
from pathlib import Path

import bpy
from bpy.props import EnumProperty, IntProperty, StringProperty

from .. import preferences, steps
from ..engine_api import BOOK_SUFFIXES, BadRequest, ColorBook, read_color_book
from ..host.words import translate_report
from ..pictures import chips
from ..preferences import color_book
from .reporting import SwatchStep, reports_errors


class OneColor(SwatchStep):
    """Mix-in of operators that give a swatch, or an object's target color, the color of a name."""

    bl_options = {"REGISTER", "UNDO"}

    object_name: StringProperty(name="Object")
    index: IntProperty(name="Swatch", min=0, description="Counted from 1. 0: the target color", options={"SKIP_SAVE"})

    def use(self, context, name):
        """Set the color."""
        left = steps.use_color_name(context.scene, self.object_name, self.index, _book(), name)
        if left:
            self.report(
                {"WARNING"},
                translate_report(
                    "{name} is outside sRGB: the nearest color differs from it by CIEDE2000 {left}",
                    name=name,
                    left=f"{left:.1f}",
                ),
            )
        return {"FINISHED"}


class KARF_OT_use_color_name(OneColor, bpy.types.Operator):
    """Use the color with this name"""

    bl_idname = "karf.use_color_name"
    bl_label = "Use Color Name"

    color_name: StringProperty(name="Name")

    @reports_errors
    def execute(self, context):
        return self.use(context, self.color_name)


class KARF_OT_find_color_name(OneColor, bpy.types.Operator):
    """Search the color book for a name and use its color"""

    bl_idname = "karf.find_color_name"
    bl_label = "Find Color Name"
    bl_property = "entry"

    entry: EnumProperty(name="Name", items=lambda self, context: _items(color_book.known().book), options={"SKIP_SAVE"})

    def invoke(self, context, event):
        context.window_manager.invoke_search_popup(self)
        return {"RUNNING_MODAL"}

    @reports_errors
    def execute(self, context):
        return self.use(context, _book().names[int(self.entry)])


class KARF_OT_choose_color_book(bpy.types.Operator):
    """Choose a book of named colors: Adobe's .acb or .ase, GIMP's .gpl, or a .csv table. The preferences keep it"""

    bl_idname = "karf.choose_color_book"
    bl_label = "Color Book"

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default=";".join(f"*{suffix}" for suffix in BOOK_SUFFIXES), options={"HIDDEN"})

    def invoke(self, context, event):
        self.filepath = preferences.current().color_book
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reports_errors
    def execute(self, context):
        path = Path(bpy.path.abspath(self.filepath))
        book = read_color_book(path)
        preferences.current().color_book = str(path)
        context.preferences.is_dirty = True  # so that Blender keeps it, as where it is set there
        self.report({"INFO"}, translate_report("{book}: {count} names", book=book.name, count=len(book)))
        return {"FINISHED"}


def _book() -> ColorBook:
    """The chosen book. Raises BadRequest where there is none."""
    book, problem = color_book.known()
    if problem:
        raise BadRequest(problem)
    if book is None:
        raise BadRequest("No color book is chosen.", "Choose one in a swatch's menu, or in the preferences.")
    return book


@lru_cache(maxsize=1)  # Blender needs the texts as long as it shows them
def _items(book: ColorBook | None) -> list[tuple[str, str, str, int, int]]:
    """The names as Blender searches them."""
    if book is None:
        return []
    return [(str(number), name, "", chips.icon(book[name]), number) for number, name in enumerate(book.names)]
