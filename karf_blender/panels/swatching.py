"""Step 4: an object's swatches, their menus, and names of colors."""

import bpy
import numpy as np

from ..engine_api import lab_chroma, lab_hue, nearest_names, srgb_to_lab
from ..host.words import draw_text, translate
from ..pictures import tints
from ..preferences import color_book
from ..properties.swatches import KARF_PG_swatch
from ..swatches import colors
from .display import draw_left, draw_moved, draw_solo, how_visible

NEAREST = 3  # names offered for a color


def draw_object(layout, item, is_advanced):
    """An object's swatches side by side, and what one of its colors is to become."""
    row = layout.row()
    row.context_pointer_set("karf_object", item)
    row.label(text=item.name, icon="OBJECT_DATA")
    if is_advanced:
        draw_solo(row, item.name, 0)
    row.operator("karf.reset_swatch", text="Reset", icon="LOOP_BACK").object_name = item.name
    if is_advanced:
        row.menu("KARF_MT_palette", text="", icon="DOWNARROW_HLT")
    if colors.has_paints(item):
        layout.row().prop(item, "scope", expand=True)
    row = layout.row(align=True)
    for index in colors.offered(item):
        _draw_swatch(row.column(align=True), item, index, item.swatches[index])
    if is_advanced:
        row.operator("karf.add_color", text="", icon="EYEDROPPER").object_name = item.name
    if colors.has_paints(item):
        draw_moved(layout, item)
    row = layout.row()
    draw_fold(row, item, "show_becomes")
    if is_advanced:
        row.prop(item, "is_metal", icon="SHADING_RENDERED", icon_only=True)
    if item.show_becomes:
        _draw_becomes(layout, item)
    if is_advanced:
        _draw_more(layout, item)


def _draw_more(layout, item):
    row = layout.row()
    draw_fold(row, item, "show_surface")
    draw_fold(row, item, "show_edge")
    if item.show_surface:
        _draw_surfaces(layout, item)
    if item.show_edge:
        row = layout.row(align=True)
        row.prop(item, "choke")
        row.prop(item, "feather")


def draw_fold(layout, item, name):
    left = layout.row()
    left.alignment = "LEFT"
    left.prop(item, name, icon="DOWNARROW_HLT" if getattr(item, name) else "RIGHTARROW", emboss=False)


def _draw_swatch(column, item, index, swatch):
    """One swatch: above as learned (a click gives it back), below as edited, its weights alone, and its menu."""
    column.context_pointer_set("karf_object", item)
    column.context_pointer_set("karf_swatch", swatch)
    row = column.row(align=True)
    for each in item.swatches:
        if each == swatch or (each.merged == index and not swatch.is_added):
            learned = row.operator("karf.reset_swatch", text="", icon_value=tints.icon(each.learned))
            learned.object_name, learned.index = item.name, index
    edited = column.row(align=True)
    edited.scale_y = 2.0
    edited.prop(swatch, "color", text="")
    row = column.row(align=True)
    draw_solo(row, item.name, index)
    icon = "LOCKED" if swatch.locked else "LINKED" if swatch.link else "NONE"
    row.menu("KARF_MT_swatch", text="", icon=icon)  # Blender adds an arrow


def _draw_surfaces(layout, item):
    table = layout.row(align=True)
    names = table.column(align=True)
    for text in ("", *(KARF_PG_swatch.bl_rna.properties[name].name for name in colors.SURFACE)):
        names.label(text=text)
    for index in colors.offered(item):
        _draw_surface(table.column(align=True), item, index, item.swatches[index])


def _draw_surface(column, item, index, swatch):
    column.label(text="", icon_value=tints.icon(swatch.color))
    fields = column.column(align=True)
    fields.enabled = not swatch.locked
    for name in colors.SURFACE:
        fields.prop(swatch, name, text="", slider=True)
    button = column.row(align=True)
    button.enabled = not colors.surface_of(swatch).is_neutral
    reset = button.operator("karf.reset_surface", text="", icon="LOOP_BACK")
    reset.object_name, reset.index = item.name, index


def _draw_becomes(layout, item):
    row = layout.row(align=True)
    row.prop(item, "source", text="")
    row.label(text="", icon="FORWARD")
    row.prop(item, "target", text="")
    names = row.row(align=True)
    names.context_pointer_set("karf_object", item)
    names.menu("KARF_MT_target_names", text="", icon="COLOR")
    draw_left(layout, item)
    row = layout.row(align=True)
    row.prop(item, "live", toggle=True)
    row.operator("karf.becomes", text="Apply").object_name = item.name


def _index_of(item, swatch):
    return next(index for index, each in enumerate(item.swatches) if each == swatch)


def _swatch_operator(layout, name, context, **options):
    """Draw the button of an operator on the menu's swatch."""
    button = layout.operator(name, **options)
    button.object_name = context.karf_object.name
    button.index = _index_of(context.karf_object, context.karf_swatch)
    return button


class KARF_MT_swatch(bpy.types.Menu):
    """Actions for this swatch"""

    bl_label = "Swatch"

    def draw(self, context):
        layout, item, swatch = self.layout, context.karf_object, context.karf_swatch
        layout.label(text=f"{item.name} {_index_of(item, swatch)}", icon_value=tints.icon(swatch.color))
        layout.prop(swatch, "locked")
        layout.menu("KARF_MT_swatch_names", icon="COLOR")
        layout.separator()
        _swatch_operator(layout, "karf.copy_swatch", context, icon="COPYDOWN")
        _swatch_operator(layout, "karf.paste_swatch", context, icon="PASTEDOWN")
        _swatch_operator(layout, "karf.reset_swatch", context, text="Reset", icon="LOOP_BACK")
        layout.separator()
        layout.menu("KARF_MT_swap")
        layout.menu("KARF_MT_link", icon="LINKED")
        if swatch.link:
            _swatch_operator(layout, "karf.unlink_swatch", context, icon="UNLINKED")
        layout.separator()
        if swatch.is_added:
            layout.prop(swatch, "reach")
            layout.prop(swatch, "protect")
            if not swatch.is_paint:  # an object's paints come with its palette
                _swatch_operator(layout, "karf.remove_color", context, icon="X")
            return
        layout.menu("KARF_MT_merge")
        _swatch_operator(layout, "karf.merge_swatch", context, text="Remove", icon="X")
        if any(each.merged == _index_of(item, swatch) for each in item.swatches):
            _swatch_operator(layout, "karf.split_swatch", context)


class KARF_MT_swap(bpy.types.Menu):
    """Swatches to exchange colors with"""

    bl_label = "Swap With"

    def draw(self, context):
        _draw_others(self.layout, context, "karf.swap_swatches")


class KARF_MT_link(bpy.types.Menu):
    """Swatches to link colors with"""

    bl_label = "Link With"

    def draw(self, context):
        _draw_others(self.layout, context, "karf.link_swatches")


def _draw_others(layout, context, operator):
    """Draw a button for each swatch except the menu's own."""
    for item in context.scene.karf.objects:
        for index, other in enumerate(item.swatches):
            if index and other != context.karf_swatch and not other.merged:
                text, icon = f"{item.name} {index}", tints.icon(other.color)
                button = _swatch_operator(layout, operator, context, text=text, icon_value=icon)
                button.other_name, button.other_index = item.name, index


class KARF_MT_merge(bpy.types.Menu):
    """Swatches of the object to merge this one into"""

    bl_label = "Merge Into"

    def draw(self, context):
        item = context.karf_object
        for index, other in enumerate(item.swatches):
            if index and other != context.karf_swatch and not (other.merged or other.is_added):
                text, icon = f"{item.name} {index}", tints.icon(other.learned)
                button = _swatch_operator(self.layout, "karf.merge_swatch", context, text=text, icon_value=icon)
                button.into = index


class KARF_MT_palette(bpy.types.Menu):
    """Actions for this object's palette"""

    bl_label = "Palette"

    def draw(self, context):
        name = context.karf_object.name
        self.layout.operator("karf.copy_swatch", text="Copy Palette", icon="COPYDOWN").object_name = name
        self.layout.operator("karf.paste_swatch", text="Paste Palette", icon="PASTEDOWN").object_name = name
        self.layout.separator()
        self.layout.menu("KARF_MT_palette_presets", icon="PRESET")


class KARF_MT_palette_presets(bpy.types.Menu):
    """Palette presets for any object"""

    bl_label = "Palette Presets"
    preset_subdir = "karf/palettes"
    preset_operator = "karf.apply_palette_preset"
    preset_add_operator = "karf.palette_preset"
    draw = bpy.types.Menu.draw_preset


def draw_context_menu(menu, context):
    """Add the swatch's menu to the context menu of its field or chip."""
    swatch, chip = getattr(context, "button_pointer", None), getattr(context, "button_operator", None)
    objects = context.scene.karf.objects
    if isinstance(swatch, KARF_PG_swatch):
        item = next(each for each in objects if swatch in each.swatches.values())
    elif chip is not None and chip.bl_rna.identifier == "KARF_OT_reset_swatch" and chip.index:
        item = objects[chip.object_name]
        swatch = item.swatches[chip.index]
    else:
        return
    menu.layout.separator()
    menu.layout.context_pointer_set("karf_object", item)
    menu.layout.context_pointer_set("karf_swatch", swatch)
    menu.layout.menu("KARF_MT_swatch", text="KaRF Swatch")


def _draw_names(layout, color, object_name, index):
    """Lab and LCh of an sRGB color, and the names next to it; index: of the object's swatch, 0 for its target color."""
    scene = bpy.context.scene
    color = colors.as_named(scene, np.array(color))
    lab = srgb_to_lab(color)
    layout.label(text="Lab (D65)   {:.1f}   {:.1f}   {:.1f}".format(*(lab.round(1) + 0.0)))  # no -0.0
    lch = lab[0], lab_chroma(lab), np.degrees(lab_hue(lab)) % 360
    layout.label(text="LCh (D65)   {:.1f}   {:.1f}   {:.1f}\N{DEGREE SIGN}".format(*lch))
    layout.separator()
    layout.operator_context = "INVOKE_DEFAULT"  # the search and the file browser are what invoking opens
    book, problem = color_book.known()
    if problem:
        draw_text(layout, problem, "ERROR")
    if book is not None:
        for near in nearest_names(book, color, NEAREST):
            how, number = how_visible(near.ciede2000), f"{near.ciede2000:.1f}"
            text = translate("{name}: {how} ({number})", name=near.name, how=how, number=number)
            button = layout.operator("karf.use_color_name", text=text, icon_value=tints.icon(near.color))
            button.object_name, button.index, button.color_name = object_name, index, near.name
        find = layout.operator("karf.find_color_name", icon="VIEWZOOM")
        find.object_name, find.index = object_name, index
    layout.operator("karf.choose_color_book", icon="FILE_FOLDER")


class KARF_MT_swatch_names(bpy.types.Menu):
    """The swatch's color in numbers, and the nearest names in the color book"""

    bl_label = "Numbers and Names"

    def draw(self, context):
        item, swatch = context.karf_object, context.karf_swatch
        _draw_names(self.layout, swatch.color, item.name, _index_of(item, swatch))


class KARF_MT_target_names(bpy.types.Menu):
    """The target color in numbers, and the nearest names in the color book"""

    bl_label = "Numbers and Names of the Target"

    def draw(self, context):
        _draw_names(self.layout, context.karf_object.target, context.karf_object.name, 0)
