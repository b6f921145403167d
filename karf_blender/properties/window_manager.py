"""Properties of the window manager, which belong to the session: neither stored in the .blend nor undone."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..host import windows
from ..swatches import displayed
from ..workspace.states import STEPS
from .colors import srgb

MODE_ITEMS = [
    ("EDITED", "Edited", "Show the picture with the current swatches", "BRUSH_DATA", 0),
    ("ORIGINAL", "Original", "Show the unedited photo, to pick colors from it", "IMAGE_DATA", 1),
    ("LEARNED", "Learned", "Show the learned scene, rendered from this view", "OUTLINER_OB_VOLUME", 2),
    ("WEIGHTS", "Weights", "Show one swatch's share in each pixel. White: the whole pixel", "IMAGE_ALPHA", 3),
    ("DIFFERENCE", "Difference", "Show the change by the edit, in CIEDE2000", "MOD_HUE_SATURATION", 4),
    ("UNSURE", "Unsure", "Show in orange where object borders are uncertain", "QUESTION", 5),
]
SHARE = {"subtype": "FACTOR", "min": 0.0, "max": 1.0}


class KARF_PG_color(bpy.types.PropertyGroup):
    """One color of a sheet of colorways, and what it will be."""

    colorway: StringProperty()
    object: StringProperty()
    wanted: srgb("Wanted")
    reached: srgb("Reached")
    difference: FloatProperty(description="CIEDE2000 between the wanted and the reached color")
    reason: StringProperty(description="Reason why the wanted color cannot be reached")


class KARF_PG_colorways(bpy.types.PropertyGroup):
    """The sheet of colorways in the dialog."""

    colors: CollectionProperty(type=KARF_PG_color)
    active: IntProperty()


class KARF_PG_progress(bpy.types.PropertyGroup):
    """The running job, and why the last one failed."""

    running: BoolProperty()
    stage: StringProperty()
    fraction: FloatProperty(min=0.0, max=1.0)
    text: StringProperty()
    figures: StringProperty()
    warnings: StringProperty(description="Warnings of the last task, one per line")
    error: StringProperty()
    job: StringProperty(description="Folder of the failed job with its log")
    hint: StringProperty()
    folder: StringProperty(description="Folder of the last written files")


class KARF_PG_folding(bpy.types.PropertyGroup):
    """The open steps of the sidebars."""

    __annotations__ = {f"show_{step}": BoolProperty(name="Open", default=step == STEPS[0]) for step in STEPS}


class KARF_PG_preview(bpy.types.PropertyGroup):
    """The picture of Live Camera."""

    long_side: IntProperty(
        name="Long Side",
        subtype="PIXEL",
        default=512,
        min=96,
        max=2048,
        description="Resolution of the live camera picture",
    )


def _picture_changed(self, context):
    for scene in bpy.data.scenes:
        displayed.of(scene).refresh()
    windows.redraw()


class KARF_PG_seeing(bpy.types.PropertyGroup):
    """The display of the active view, and the overlays of its picture."""

    mode: EnumProperty(name="Show", items=MODE_ITEMS, update=_picture_changed)
    solo_object: StringProperty(
        name="Object", description="Object whose swatch weights are shown", update=_picture_changed
    )
    solo_swatch: IntProperty(
        name="Swatch",
        description="Swatch whose weights are shown, counted from 1. 0: the object, with everything else dimmed",
        default=1,
        min=0,
        update=_picture_changed,
    )
    is_wiped: BoolProperty(name="Wipe", description="Show the original on the left of a line", update=_picture_changed)
    wipe: FloatProperty(
        name="Wipe",
        description="Position of the line, from 0 (left edge) to 1 (right edge)",
        default=0.5,
        update=_picture_changed,
        **SHARE,
    )
    show_masks: BoolProperty(
        name="Masks", description="Show each object in a separate color over the picture", update=_picture_changed
    )
    tint: FloatProperty(
        name="Tint",
        description="Opacity of the objects' colors",
        default=0.4,
        update=lambda self, context: windows.redraw(),
        **SHARE,
    )
    outlines: BoolProperty(
        name="Outlines",
        description="Draw a line around every object",
        default=True,
        update=lambda self, context: windows.redraw(),
    )
