"""How the picture is looked at: WindowManager.karf_seeing. It belongs to the session, so undo leaves it alone."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, StringProperty

from ..swatches import displayed, drawn_over

MODE_ITEMS = [
    ("EDITED", "Edited", "With the swatches as they stand", "BRUSH_DATA", 0),
    ("ORIGINAL", "Original", "The photo before any edit: pick colors from it", "IMAGE_DATA", 1),
    ("LEARNED", "Learned", "What the engine has learned, rendered from here", "OUTLINER_OB_VOLUME", 2),
    ("WEIGHTS", "Weights", "How much of each pixel is one swatch's, white: all", "IMAGE_ALPHA", 3),
    ("DIFFERENCE", "Difference", "What the edit changes, in CIEDE2000", "MOD_HUE_SATURATION", 4),
    ("UNSURE", "Unsure", "Where it is unsure what belongs to an object, in orange", "QUESTION", 5),
]


def _picture_changed(self, context):
    for scene in bpy.data.scenes:
        displayed.of(scene).refresh()
    drawn_over.redraw()


def _overlay_changed(self, context):
    drawn_over.redraw()


class KARF_PG_seeing(bpy.types.PropertyGroup):
    """What is shown of the active view, and what is drawn over it."""

    mode: EnumProperty(name="Show", items=MODE_ITEMS, update=_picture_changed)
    solo_object: StringProperty(name="Object", description="Whose swatch's weights are shown", update=_picture_changed)
    solo_swatch: IntProperty(
        name="Swatch",
        description="The swatch whose weights are shown, from 1; 0: the object with all else dimmed",
        default=1,
        min=0,
        update=_picture_changed,
    )
    is_wiped: BoolProperty(name="Wipe", description="The original on the left of a line", update=_picture_changed)
    wipe: FloatProperty(
        name="Wipe",
        description="Where the line is: 0 is the left border, 1 the right one",
        subtype="FACTOR",
        default=0.5,
        min=0.0,
        max=1.0,
        update=_picture_changed,
    )
    show_masks: BoolProperty(
        name="Masks", description="The objects, each in a color of its own, over the picture", update=_picture_changed
    )
    tint: FloatProperty(
        name="Tint",
        description="How strong the objects' colors are",
        subtype="FACTOR",
        default=0.4,
        min=0.0,
        max=1.0,
        update=_overlay_changed,
    )
    outlines: BoolProperty(
        name="Outlines", description="A line round every object", default=True, update=_overlay_changed
    )
