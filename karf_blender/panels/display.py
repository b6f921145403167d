"""Display of the active view: modes, masks and split view, with their keys and pie menu."""

from math import isinf

import bpy

from .. import preferences, session
from ..host.words import translate
from ..pictures import tints
from ..project import disk
from ..swatches import colors, displayed


def draw_view(layout, karf):
    layout.prop_search(karf, "active_view", karf, "views", text="", icon="CAMERA_DATA")


def draw_space(layout, karf, name):
    column = layout.column(align=True)
    for each in (name, "ocio"):
        column.label(text=karf.bl_rna.properties[each].name)  # above: beside the field a sidebar cuts it off
        column.prop(karf, each, text="")


def draw_advanced(layout, step):
    """Return the layout of a step's advanced controls, None while they are folded; the preferences remember it."""
    header, body = layout.panel_prop(preferences.current().advanced, f"show_{step}")
    header.label(text="Advanced")
    return body


# keys that Blender's own key map of the Image Editor leaves free; with Alt the first opens the pie
BEFORE_AFTER_KEY, FLIP_KEY = "C", "V"
MODES, ADVANCED_MODES = ("EDITED", "ORIGINAL"), ("DIFFERENCE", "LEARNED", "WEIGHTS", "UNSURE")
INVISIBLE, CLOSE = 1.0, 3.0  # CIEDE2000 below which a difference is invisible, or slight: visible only side by side


def draw_view_options(layout, context):
    """Draw the split view, and what is shown over the picture."""
    seeing = context.window_manager.karf_seeing
    row = layout.row(align=True)
    row.prop(seeing, "is_wiped", text="", icon="ARROW_LEFTRIGHT")
    row.prop(seeing, "wipe", slider=True)
    row.operator("karf.drag_wipe", text="", icon="VIEW_PAN")
    draw_render_learned(layout, context)
    draw_masks(layout, context)


def draw_modes(layout, context, names):
    grid = layout.grid_flow(row_major=True, columns=2, even_columns=True, align=True)
    for name in names:
        grid.prop_enum(context.window_manager.karf_seeing, "mode", name)


def draw_render_learned(layout, context):
    """Draw the button that renders what is to be shown, if it is missing."""
    known, mode = disk.contents_of(context.scene), context.window_manager.karf_seeing.mode
    if (mode == "LEARNED" and not known.is_rendered) or (mode == "UNSURE" and not known.is_doubted):
        layout.operator("karf.see_view", icon="OUTLINER_OB_VOLUME")


def draw_masks(layout, context):
    seeing = context.window_manager.karf_seeing
    column = layout.column(align=True)
    row = column.row(align=True)
    row.operator("karf.show_masks", icon="MOD_MASK", depress=seeing.show_masks)
    row.prop(seeing, "outlines", text="", icon="MESH_CIRCLE")
    if not seeing.show_masks:
        return
    column.prop(seeing, "tint", slider=True)
    masks = displayed.of(context.scene).known_masks()
    if masks is None:
        layout.label(text="Press Show Masks for this view", icon="INFO")
        return
    row = layout.row()
    for name, tint in masks.tints.items():
        row.label(text=name, icon_value=tints.icon(tint))


def draw_solo(layout, name, index):
    """Draw the eye icon of a swatch, or with index 0 of an object."""
    seeing = bpy.context.window_manager.karf_seeing
    is_solo = seeing.mode == "WEIGHTS" and (seeing.solo_object, seeing.solo_swatch) == (name, index)
    solo = layout.operator("karf.solo_swatch", text="", icon="HIDE_OFF", depress=is_solo)
    solo.object_name, solo.index = name, index


def draw_left(layout, item):
    """Draw how far an object is from its target color, always in one row, so that no button moves."""
    source, target = colors.color_pair(item)
    left = displayed.of(item.id_data).left_to_target(item)
    if source == target:
        layout.label(text="Right: target for the left color", icon="BLANK1")
    elif left is None:
        layout.label(text="", icon="BLANK1")
    elif isinf(left):
        layout.label(text=translate("{name} has no such color: pick one on it", name=item.name), icon="ERROR")
    else:
        text = translate("Remaining difference: {how}", how=how_visible(left))
        layout.label(text=text, icon="CHECKMARK" if left < INVISIBLE else "BLANK1")


def draw_moved(layout, item):
    """Draw how much an edit of a paint, or of the whole object, moves beside the changed paints."""
    _, moved = displayed.of(item.id_data).moved.get(item.name, ((), 0.0))
    text = translate("Change elsewhere: {how}", how=how_visible(moved))
    layout.label(text=text, icon="CHECKMARK" if moved < INVISIBLE else "INFO")


def how_visible(difference):
    """Return a CIEDE2000 difference in words."""
    if difference < INVISIBLE:
        return translate("invisible")
    return translate("slight") if difference < CLOSE else translate("visible")


class KARF_MT_seeing_pie(bpy.types.Menu):
    """Contents of the Image Editor"""

    bl_label = "KaRF: Show"

    def draw(self, context):
        self.layout.menu_pie().prop(context.window_manager.karf_seeing, "mode", expand=True)


@session.setup
def _keys():
    """Put the keys into the key map of add-ons; in background mode there is none."""
    keymaps = bpy.context.window_manager.keyconfigs.addon
    if keymaps is None:
        yield
        return
    items = keymaps.keymaps.new("Image", space_type="IMAGE_EDITOR").keymap_items
    pie = items.new("karf.seeing_pie", BEFORE_AFTER_KEY, "PRESS", alt=True)
    flip = items.new("karf.flip_looks", FLIP_KEY, "PRESS")
    before_after = items.new("karf.before_after", BEFORE_AFTER_KEY, "PRESS")
    yield
    for item in (before_after, pie, flip):
        items.remove(item)
