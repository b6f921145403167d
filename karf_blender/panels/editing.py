"""Step 4: the swatches of all objects, looks, matching a picture, the color chart."""

import bpy

from .. import preferences
from ..host.words import draw_text, translate
from ..project import disk
from ..swatches import colors, looks, object_masks
from ..tasks import queries
from .display import ADVANCED_MODES, MODES, draw_advanced, draw_modes, draw_view, draw_view_options, how_visible
from .swatching import draw_fold, draw_object


def draw_edit(layout, context):
    karf = context.scene.karf
    if not karf.objects:
        layout.label(text="Swatches appear after step 3", icon="INFO")
        return
    row = layout.row(align=True)
    draw_view(row, karf)
    is_prepared = disk.contents_of(context.scene).is_prepared
    row.operator("karf.show_view", text="Show" if is_prepared else "Prepare", icon="IMAGE_DATA")
    draw_modes(layout, context, MODES)
    is_advanced = preferences.current().advanced.show_edit
    for name in object_masks.in_order(context.scene, karf.objects.keys()):
        draw_object(layout.box(), karf.objects[name], is_advanced)
    _draw_looks(layout.box(), context)
    if not is_prepared:
        draw_text(layout, translate("Press Prepare to show {view} recolored", view=karf.active_view), "INFO")
    if not any(area.type == "IMAGE_EDITOR" for area in context.screen.areas):
        layout.label(text="Open an Image Editor to see the picture", icon="INFO")
    body = draw_advanced(layout, "edit")
    if body is None:
        return
    draw_view_options(body, context)
    _draw_match(body.box(), karf)
    row = body.row(align=True)
    row.operator("karf.load_edit", icon="FILE_FOLDER")
    row.operator("karf.save_edit", icon="FILE_TICK")
    body.operator("karf.prepare_views", icon="RENDERLAYERS")
    draw_modes(body, context, ADVANCED_MODES)
    body.prop(karf, "material")
    body.prop(karf, "compositing", text="Result")
    draw_light(body, context.scene)


def _draw_match(layout, karf):
    match = karf.match
    draw_fold(layout, match, "show")
    if not match.show:
        return
    layout.template_ID(match, "picture", open="image.open")
    row = layout.row(align=True)
    row.operator("karf.paint_over", icon="BRUSH_DATA")
    row.operator("karf.match_picture", icon="EYEDROPPER")
    for left in match.left:
        values = {"name": left.name, "how": how_visible(left.left)}
        values |= {"left": f"{left.left:.1f}", "before": f"{left.before:.1f}"}
        layout.label(text=translate("{name}: the remaining difference is {how} ({left}, was {before})", **values))


def _draw_looks(layout, context):
    karf = context.scene.karf
    row = layout.row(align=True)
    row.operator("karf.keep_look", icon="ADD")
    if len(karf.looks) > 1:
        row.operator("karf.flip_looks", text="", icon="ARROW_LEFTRIGHT")
    column = layout.column(align=True)
    for look in karf.looks:
        _draw_look(column.row(align=True), look)


def _draw_look(row, look):
    karf = look.id_data.karf
    is_used = look.name == karf.look
    is_changed = is_used and looks.is_changed(look.id_data)
    text = f"{look.name} *" if is_changed else look.name
    icon = "RADIOBUT_ON" if is_used else "RADIOBUT_OFF"
    row.operator("karf.choose_look", text=text, icon=icon, depress=is_used, translate=False).name = look.name
    if is_changed:
        row.operator("karf.keep_look", text="", icon="FILE_TICK").name = look.name
    row.context_pointer_set("karf_look", look)
    row.menu("KARF_MT_look", text="", icon="DOWNARROW_HLT")


class KARF_MT_look(bpy.types.Menu):
    """Actions for this look"""

    bl_label = "Look"

    def draw(self, context):
        layout, name = self.layout, context.karf_look.name
        layout.operator_context = "INVOKE_DEFAULT"
        layout.operator("karf.keep_look", text="Keep Swatches Here", icon="FILE_TICK").name = name
        layout.operator("karf.rename_look", text="Rename").name = name
        layout.separator()
        for text, icon, by in (("Move Up", "TRIA_UP", -1), ("Move Down", "TRIA_DOWN", 1)):
            move = layout.operator("karf.move_look", text=text, icon=icon)
            move.name, move.by = name, by
        layout.separator()
        layout.operator("karf.remove_look", text="Remove", icon="X").name = name


def draw_light(layout, scene):
    # not in a menu: there the eyedropper's key would choose an entry
    layout.operator("karf.find_chart", icon="VIEWZOOM")
    layout.operator("karf.pick_chart", icon="EYEDROPPER")
    if queries.is_waiting("chart"):
        layout.label(text="The engine is working", icon="SORTTIME")
    if colors.has_chart(scene):
        text = translate("Color chart: CIEDE2000 {number} remaining", number=f"{scene.karf.chart_left:.1f}")
        layout.operator("karf.remove_chart", text=text, icon="X")
        return
    layout.prop(scene.karf, "card")
    if any(scene.karf.card) and colors.reference_light(scene) is None:
        layout.label(text="The card is too dark or too bright at this point", icon="ERROR")
