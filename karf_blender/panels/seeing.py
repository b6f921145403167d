"""How the picture is looked at: what of it, as a split view or not, with masks or not; and a pie of the same."""

import bpy

from ..host.words import translate
from ..pictures import chips
from ..project import disk
from ..swatches import shown

# the key that shows before and after, with Alt the pie; free in the Image Editor of Blender's own key map
KEY = "C"


def draw_seeing(layout, context):
    """What is shown of the active view, and the split view."""
    seeing = context.window_manager.karf_seeing
    column = layout.column(align=True)
    names = seeing.bl_rna.properties["mode"].enum_items.keys()
    for some in (names[:3], names[3:]):  # six do not fit side by side
        row = column.row(align=True)
        for name in some:
            row.prop_enum(seeing, "mode", name)
    row = column.row(align=True)
    row.prop(seeing, "is_wiped", text="", icon="ARROW_LEFTRIGHT")
    row.prop(seeing, "wipe", slider=True)
    row.operator("karf.drag_wipe", text="", icon="VIEW_PAN")
    draw_lacking(layout, context)
    draw_masks(layout, context)


def draw_lacking(layout, context):
    """The button that renders what is to be shown, where that was not done yet."""
    known, mode = disk.contents_of(context.scene), context.window_manager.karf_seeing.mode
    if (mode == "LEARNED" and not known.is_rendered) or (mode == "UNSURE" and not known.is_doubted):
        layout.operator("karf.see_view", icon="OUTLINER_OB_VOLUME")


def draw_masks(layout, context):
    """The objects' masks over the picture, and which color is whose."""
    seeing = context.window_manager.karf_seeing
    column = layout.column(align=True)
    row = column.row(align=True)
    row.operator("karf.show_masks", icon="MOD_MASK", depress=seeing.show_masks)
    row.prop(seeing, "outlines", text="", icon="MESH_CIRCLE")
    if not seeing.show_masks:
        return
    column.prop(seeing, "tint", slider=True)
    masks = shown.of(context.scene).known_masks()
    if masks is None:
        layout.label(text="Press Show Masks for this view", icon="INFO")
        return
    row = layout.row()
    for name, tint in masks.tints.items():
        row.label(text=name, icon_value=chips.icon(tint))


def draw_solo(layout, name, index):
    """The eye icon next to a swatch."""
    seeing = bpy.context.window_manager.karf_seeing
    is_solo = seeing.mode == "WEIGHTS" and (seeing.solo_object, seeing.solo_swatch) == (name, index)
    solo = layout.operator("karf.solo_swatch", text="", icon="HIDE_OFF", depress=is_solo)
    solo.object_name, solo.index = name, index


def draw_left(layout, item):
    """How far an object's source color still is from its target."""
    left = shown.of(item.id_data).difference(item)
    if left is not None:
        layout.label(
            text=translate("{number} CIEDE2000 left", number=f"{left:.1f}"), icon="CHECKMARK" if left < 1 else "BLANK1"
        )


class KARF_MT_seeing_pie(bpy.types.Menu):
    """What is shown of the active view"""

    bl_idname = "KARF_MT_seeing_pie"
    bl_label = "KaRF: Show"

    def draw(self, context):
        self.layout.menu_pie().prop(context.window_manager.karf_seeing, "mode", expand=True)


class _Memory:
    """The keys in the add-ons' key map."""

    keys: list = []


def register_keys():
    """Put the keys into the key map of add-ons; in background mode there is none."""
    keymaps = bpy.context.window_manager.keyconfigs.addon
    if keymaps is None:
        return
    keymap = keymaps.keymaps.new("Image", space_type="IMAGE_EDITOR")
    pie = keymap.keymap_items.new("karf.seeing_pie", KEY, "PRESS", alt=True)
    _Memory.keys = [(keymap, keymap.keymap_items.new("karf.before_after", KEY, "PRESS")), (keymap, pie)]


def unregister_keys():
    """Take the keys out again."""
    for keymap, item in _Memory.keys:
        keymap.keymap_items.remove(item)
    _Memory.keys = []


CLASSES = (KARF_MT_seeing_pie,)
