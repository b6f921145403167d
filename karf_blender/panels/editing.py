"""Step 6: swatches."""

from ..host.labels import draw_text
from ..host.words import say
from ..pictures import chips
from ..project import disk
from .seeing import draw_left, draw_seeing, draw_solo
from .views import draw_view


def draw_edit(layout, context):
    """Step 6."""
    karf = context.scene.karf
    if not karf.objects:
        layout.label(text="Swatches appear after step 5", icon="INFO")
        return
    row = layout.row(align=True)
    draw_view(row, karf)
    is_prepared = disk.contents_of(context.scene).is_prepared
    row.operator("karf.show_view", text="Show" if is_prepared else "Prepare", icon="IMAGE_DATA")
    if not is_prepared:
        draw_text(layout, say("{view} is not prepared: Prepare shows it recolored", view=karf.active_view), "INFO")
    if not any(area.type == "IMAGE_EDITOR" for area in context.screen.areas):
        layout.label(text="Open an Image Editor to see it", icon="INFO")
    draw_seeing(layout, context)
    for item in karf.objects:
        draw_object(layout.box(), item)
    layout.prop(karf, "compositing", text="Result")
    row = layout.row(align=True)
    row.operator("karf.load_edit", icon="FILE_FOLDER")
    row.operator("karf.save_edit", icon="FILE_TICK")
    layout.operator("karf.prepare_views", icon="RENDERLAYERS")


def draw_object(layout, item):
    """An object's swatches side by side, and what one of its colors shall become."""
    row = layout.row()
    row.label(text=item.name, icon="OBJECT_DATA")
    row.operator("karf.reset_swatch", text="Reset", icon="LOOP_BACK").object_name = item.name
    row = layout.row(align=True)
    for index, swatch in enumerate(item.swatches):
        if index:  # black is frozen
            draw_swatch(row.column(align=True), item, index, swatch)
    row = layout.row()
    row.alignment = "LEFT"
    row.prop(item, "show_becomes", icon="DOWNARROW_HLT" if item.show_becomes else "RIGHTARROW", emboss=False)
    if item.show_becomes:
        draw_becomes(layout, item)


def draw_swatch(column, item, index, swatch):
    """One swatch: above as learned (a click gives it back), below as it shall be, and its lock."""
    learned = column.operator("karf.reset_swatch", text="", icon_value=chips.icon(swatch.learned))
    learned.object_name, learned.index = item.name, index
    edited = column.row(align=True)
    edited.scale_y = 2.0
    edited.prop(swatch, "color", text="")
    draw_solo(column, item.name, index)
    if item.show_becomes:
        column.prop(swatch, "locked", text="", icon="LOCKED" if swatch.locked else "UNLOCKED")


def draw_becomes(layout, item):
    """The pair of colors, the rule and the button."""
    row = layout.row(align=True)
    row.prop(item, "source", text="")
    row.label(text="", icon="FORWARD")
    row.prop(item, "target", text="")
    draw_left(layout, item)
    row = layout.row(align=True)
    row.prop(item, "rule", text="")
    row.operator("karf.becomes", text="Apply").object_name = item.name
