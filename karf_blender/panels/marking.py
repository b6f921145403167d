"""Step 3: where the objects are in a few photos."""

import bpy

from ..host.labels import draw_text
from ..host.words import translate
from ..marking import objects
from ..pictures import chips
from ..preferences import state
from ..project import disk
from ..tasks import queries
from .views import draw_view


class KARF_UL_objects(bpy.types.UIList):
    """The objects to mark: their colors, names and numbers of masks."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        row = layout.row(align=True)
        row.label(text="", icon_value=chips.icon(objects.tint(item)))
        row.prop(item, "name", text="", emboss=False)
        count = disk.contents_of(context.scene).masks.get(item.folder, 0)
        row.label(text=translate("{count} marked", count=count) if count else "not marked")


def draw_masks(layout, context):
    """Step 3."""
    scene, marking = context.scene, context.scene.karf.marking
    row = layout.row()
    row.template_list("KARF_UL_objects", "", marking, "objects", marking, "active", rows=3)
    column = row.column(align=True)
    column.operator("karf.add_object", text="", icon="ADD")
    column.operator("karf.remove_object", text="", icon="REMOVE")
    draw_steps(layout, scene)
    layout.operator("karf.mark", icon="RESTRICT_SELECT_OFF")
    layout.label(text="Ctrl: exclude from the object" if marking.correct else "Ctrl: take away", icon="MOUSE_LMB")
    layout.prop(marking, "brush")
    layout.operator_menu_enum("karf.set_volume", "kind", icon="CUBE")
    if "segmentation" in disk.contents_of(scene).stages:
        layout.prop(marking, "correct", toggle=True, icon="BRUSH_DATA")
        layout.operator("karf.go_to_suggested", text=next_to_mark(scene), icon="LIGHT")
        if disk.contents_of(scene).any_view_helps:
            layout.label(text="All views would help about equally", icon="BLANK1")
    layout.operator("karf.erase_mask", icon="X", text="Erase Correction" if marking.correct else "Erase Mask")
    if state.known().problem:
        draw_text(layout, "Without the engine, a box marks a rectangle and clicks do nothing.", "INFO")
    if queries.is_waiting("propose") or queries.is_waiting("correct"):
        layout.label(text="The engine is working", icon="SORTTIME")
    layout.prop(scene.karf, "masks")


def next_to_mark(scene) -> str:
    """What the button to the view says whose mark would decide most."""
    suggested = disk.contents_of(scene).suggested
    return translate("Mark next: {view}", view=suggested[0]) if suggested else translate("Suggested View")


def draw_steps(layout, scene):
    """The active view, and the way to others."""
    row = layout.row(align=True)
    draw_view(row, scene.karf)
    for icon, by, marked in (("TRIA_LEFT", -1, False), ("TRIA_RIGHT", 1, False), ("FF", 1, True)):
        button = row.operator("karf.go_to_view", text="", icon=icon)
        button.by, button.marked = by, marked
