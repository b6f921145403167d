"""Step 6: swatches."""

from ..host.labels import draw_text
from ..host.words import translate
from ..project import disk
from ..swatches import object_masks
from .color_names import draw_light
from .looks import draw_looks
from .seeing import ADVANCED_MODES, draw_modes, draw_seeing, how_visible
from .swatching import draw_object
from .views import draw_advanced, draw_view


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
        draw_text(layout, translate("Press Prepare to show {view} recolored", view=karf.active_view), "INFO")
    if not any(area.type == "IMAGE_EDITOR" for area in context.screen.areas):
        layout.label(text="Open an Image Editor to see the picture", icon="INFO")
    draw_seeing(layout, context)
    layout.prop(karf, "material", icon="MATERIAL")
    for name in object_masks.in_order(context.scene, karf.objects.keys()):
        draw_object(layout.box(), karf.objects[name])
    draw_looks(layout.box(), context)
    draw_match(layout.box(), karf)
    row = layout.row(align=True)
    row.operator("karf.load_edit", icon="FILE_FOLDER")
    row.operator("karf.save_edit", icon="FILE_TICK")
    layout.operator("karf.prepare_views", icon="RENDERLAYERS")
    body = draw_advanced(layout, "edit")
    if body is not None:
        draw_modes(body, context, ADVANCED_MODES)
        body.prop(karf, "compositing", text="Result")
        draw_light(body, context.scene)


def draw_match(layout, karf):
    """The picture that the swatches are matched to, and what was left of the difference."""
    match = karf.match
    row = layout.row()
    row.alignment = "LEFT"
    row.prop(match, "show", icon="DOWNARROW_HLT" if match.show else "RIGHTARROW", emboss=False)
    if not match.show:
        return
    layout.template_ID(match, "picture", open="image.open")
    row = layout.row(align=True)
    row.operator("karf.paint_over", icon="BRUSH_DATA")
    row.operator("karf.match_picture", icon="EYEDROPPER")
    for left in match.left:
        layout.label(
            text=translate(
                "{name}: the remaining difference is {how} ({left}, was {before})",
                name=left.name,
                how=how_visible(left.left),
                before=f"{left.before:.1f}",
                left=f"{left.left:.1f}",
            )
        )
