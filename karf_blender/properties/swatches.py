"""Swatches of the objects: as learned, as wanted."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty

from ..engine_api import BRIGHTEST
from ..swatches import recolor, wishes
from .colors import srgb

RULE_ITEMS = [
    ("becomes", "Material", "Paint the whole object anew, light and highlights kept"),
    ("fewest", "Fewest swatches", "Reach the color with as few changed swatches as possible"),
]


def edit_changed(self, context):
    """The update of a property that changes the picture."""
    recolor.refresh(self.id_data)


def wish_changed(self, context):
    """The update of a color that another shall become, or of that one."""
    wishes.update(self.id_data)


class KARF_PG_swatch(bpy.types.PropertyGroup):
    """One palette color of an object: as learned, and as the artist wants it."""

    learned: srgb("Learned", description="The color that was found in the photos")
    color: srgb(
        "Color",
        highest=BRIGHTEST,
        description="The color it shall have; it may be brighter than white, which bright paint can need",
        update=edit_changed,
    )
    locked: BoolProperty(name="Lock", description="'Becomes' leaves this swatch alone")


class KARF_PG_object(bpy.types.PropertyGroup):
    """One object of the masks. Its first swatch is black and stays black."""

    swatches: CollectionProperty(type=KARF_PG_swatch)
    source: srgb(
        "Source",
        0.5,
        description="A color of the object as it is in the photo, before any edit; pick it from the picture",
        update=wish_changed,
    )
    target: srgb("Target", 0.5, description="The color that the source shall become", update=wish_changed)
    rule: EnumProperty(name="Rule", items=RULE_ITEMS)
    show_becomes: BoolProperty(
        name="One color becomes another", description="Pick a color of the object and what it shall become"
    )


CLASSES = (KARF_PG_swatch, KARF_PG_object)
