"""Step 3: where the objects are in a few photos."""

from ..host.labels import draw_text
from ..project import disk
from .views import draw_view


def draw_masks(layout, context):
    """Step 3."""
    karf = context.scene.karf
    layout.prop(karf, "mask_object")
    draw_view(layout, karf)
    row = layout.row(align=True)
    row.operator("karf.paint_mask", icon="BRUSH_DATA")
    row.operator("karf.save_mask", icon="CHECKMARK")
    if karf.mask_image:
        layout.label(text=f"Painting {karf.mask_object} on {karf.mask_view}", icon="IMAGE_DATA")
    layout.prop(karf, "masks")
    counts = disk.contents_of(context.scene).masks
    if counts:
        # a space that does not break keeps a name and its number of masks together
        draw_text(layout, ", ".join(f"{name}\u00a0({count})" for name, count in counts.items()), "CHECKMARK")
