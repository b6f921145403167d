"""A color in numbers, and its nearest names in the chosen color book: menus at a swatch and at a target color."""

import bpy
import numpy as np

from ..engine_api import lab_chroma, lab_hue, nearest_names, srgb_to_lab
from ..host.labels import draw_text
from ..host.words import translate
from ..pictures import chips
from ..preferences import color_book
from ..swatches import reference
from ..tasks import queries
from .seeing import how_visible

NEAREST = 3  # names that are offered


def draw_names(layout, color, object_name, index):
    """Lab and LCh of an sRGB color, and the names next to it; index: of the object's swatch, 0 for its target color."""
    scene = bpy.context.scene
    color = reference.as_named(scene, np.array(color))
    lab = srgb_to_lab(color)
    layout.label(text=_lab_text(lab))
    layout.label(text=_lch_text(lab))
    layout.separator()
    layout.operator_context = "INVOKE_DEFAULT"  # the search and the file browser are what invoking opens
    book, problem = color_book.known()
    if problem:
        draw_text(layout, problem, "ERROR")
    if book is not None:
        for near in nearest_names(book, color, NEAREST):
            text = translate(
                "{name}: {how} ({number})",
                name=near.name,
                how=how_visible(near.ciede2000),
                number=f"{near.ciede2000:.1f}",
            )
            button = layout.operator("karf.use_color_name", text=text, icon_value=chips.icon(near.color))
            button.object_name, button.index, button.color_name = object_name, index, near.name
        find = layout.operator("karf.find_color_name", icon="VIEWZOOM")
        find.object_name, find.index = object_name, index
    layout.operator("karf.choose_color_book", icon="FILE_FOLDER")


def draw_light(layout, scene):
    """What says under which light the photos were taken: in a panel, since a menu takes the eyedropper's key for its own."""
    layout.operator("karf.find_chart", icon="VIEWZOOM")
    layout.operator("karf.pick_chart", icon="EYEDROPPER")
    if queries.is_waiting("chart"):
        layout.label(text="The engine is working", icon="SORTTIME")
    if reference.has_chart(scene):
        text = translate("Color chart: CIEDE2000 {number} remaining", number=f"{scene.karf.chart_left:.1f}")
        layout.operator("karf.remove_chart", text=text, icon="X")
        return
    layout.prop(scene.karf, "card")
    if any(scene.karf.card) and reference.light(scene) is None:
        layout.label(text="The card is too dark or too bright at this point", icon="ERROR")


def _lab_text(lab):
    return "Lab (D65)   {:.1f}   {:.1f}   {:.1f}".format(*(lab.round(1) + 0.0))  # no -0.0


def _lch_text(lab):
    hue = np.degrees(lab_hue(lab)) % 360
    return f"LCh (D65)   {lab[0]:.1f}   {lab_chroma(lab):.1f}   {hue:.1f}\N{DEGREE SIGN}"


class KARF_MT_swatch_names(bpy.types.Menu):
    """The swatch's color in numbers, and the nearest names in the color book"""

    bl_label = "Numbers and Names"

    def draw(self, context):
        item, swatch = context.karf_object, context.karf_swatch
        index = next(index for index, each in enumerate(item.swatches) if each == swatch)
        draw_names(self.layout, swatch.color, item.name, index)


class KARF_MT_target_names(bpy.types.Menu):
    """The target color in numbers, and the nearest names in the color book"""

    bl_label = "Numbers and Names of the Target"

    def draw(self, context):
        draw_names(self.layout, context.karf_object.target, context.karf_object.name, 0)
