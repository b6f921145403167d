"""Swatches of the objects: as learned, as wanted; and the picture that they are matched to."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from .. import progress
from ..engine_api import MAX_BRIGHTNESS, MAX_CHOKE, MAX_FACTOR, MAX_FEATHER, MAX_SRGB, UNIT_GAINS, KarfError
from ..swatches import becomes, displayed, edits, gestures
from .colors import pigment_reach, protected_neutrals, srgb

RULE_ITEMS = [
    ("becomes", "Material", "Paint the whole object anew, light and highlights kept"),
    ("fewest", "Fewest swatches", "Reach the color with as few changed swatches as possible"),
]
FACTOR = {"default": 1.0, "min": 0.0, "max": MAX_FACTOR, "soft_max": 2.0, "step": 5}
STOPS = {"min": -MAX_BRIGHTNESS, "max": MAX_BRIGHTNESS, "soft_min": -1.0, "soft_max": 1.0, "step": 5}


def edit_changed(self, context):
    """The update of a property that changes the picture."""
    displayed.of(self.id_data).refresh()


def _color_changed(self, context):
    gestures.color_changed(self)


def _surface_changed(self, context):
    gestures.surface_changed(self)


def _reach_changed(self, context):
    if self.is_added:
        gestures.color_changed(self)


def _source_picked(self, context):
    becomes.source_picked(self)
    displayed.of(self.id_data).update_left()


def _target_changed(self, context):
    if self.live:
        try:
            becomes.apply_picked(self)
        except (KarfError, OSError) as error:
            progress.warn(str(error))
    displayed.of(self.id_data).update_left()


def _metal_changed(self, context):
    gestures.drag_again(self)
    _target_changed(self, context)


def _picture_chosen(self, context):
    self.view = ""  # of another picture nobody knows which view it shows


def _palette(self):
    return edits.copied(self.id_data, self.name, None)


def _set_palette(self, text):
    edits.paste(self.id_data, self.name, None, text)


class KARF_PG_swatch(bpy.types.PropertyGroup):
    """One palette color of an object: as learned, and as the artist wants it."""

    learned: srgb("Learned", description="The color that was found in the photos")
    color: srgb(
        "Color",
        highest=MAX_SRGB,
        description="The color it shall have; it may be brighter than white, which bright paint can need. With Material "
        "the other colors of its paint follow, and highlights keep the light's color",
        update=_color_changed,
    )
    saturation: FloatProperty(
        name="Saturation",
        description="How vivid its paint is: 1 as it is, 0 gray",
        update=_surface_changed,
        **FACTOR,
    )
    brightness: FloatProperty(
        name="Brightness",
        description="Lighter or darker mid-tones of its paint; black and white stay",
        update=_surface_changed,
        **STOPS,
    )
    gloss: FloatProperty(
        name="Gloss",
        description="How strong the highlights on its paint are: 1 as they are, 0 matte",
        update=_surface_changed,
        **FACTOR,
    )
    shift: FloatVectorProperty(size=3, description="What surfaces add to the color")
    locked: BoolProperty(name="Lock", description="No tool changes this swatch", update=edit_changed)
    link: IntProperty(description="Swatches with the same number have one color; 0: none")
    merged: IntProperty(description="The number of the object's swatch that moves this one; 0: none")
    is_added: BoolProperty(description="The artist has added this color; its pigment has a set of swatches behind it")
    reach: pigment_reach(options=set(), update=_reach_changed)
    protect: protected_neutrals(options=set(), update=_reach_changed)
    began: srgb("Began", highest=MAX_SRGB, description="The color when the object's last drag began, for keyframes")
    before: srgb("Before", highest=MAX_SRGB, description="The color when the source was picked")
    after: srgb("After", highest=MAX_SRGB, description="The color that Becomes gave it last")


class KARF_PG_object(bpy.types.PropertyGroup):
    """One object of the masks. Its first swatch is black and stays black."""

    swatches: CollectionProperty(type=KARF_PG_swatch)
    source: srgb(
        "Source",
        0.5,
        description="A color of the object in the picture as it is, edited or not; pick it there (E)",
        update=_source_picked,
    )
    gains: FloatVectorProperty(
        size=3, default=UNIT_GAINS, description="How the photo is exposed in which the source was picked"
    )
    target: srgb("Target", 0.5, description="The color that the source shall become", update=_target_changed)
    dragged: IntProperty(description="The number of the swatch that was dragged last, for keyframes; 0: none")
    held: StringProperty(name="Held", description="Colors that its paints were given before, which Becomes keeps")
    rule: EnumProperty(name="Rule", items=RULE_ITEMS, update=_target_changed)
    is_metal: BoolProperty(
        name="Metal",
        description="Highlights take the paint's color, as those of gold or copper do. Of everything else they keep the "
        "light's color",
        update=_metal_changed,
    )
    live: BoolProperty(name="Live", description="Follow the target color while it is dragged", update=_target_changed)
    show_becomes: BoolProperty(
        name="One color becomes another", description="Pick a color of the object and what it shall become"
    )
    choke: FloatProperty(
        name="Choke",
        subtype="PIXEL",
        min=-MAX_CHOKE,
        max=MAX_CHOKE,
        step=10,
        precision=1,
        description="How far inside its edge the object's paint ends, in pixels of the photo; below 0 it goes beyond",
        update=edit_changed,
    )
    feather: FloatProperty(
        name="Feather",
        subtype="PIXEL",
        min=0.0,
        max=MAX_FEATHER,
        step=10,
        precision=1,
        description="Over how many pixels of the photo the paint fades, half of them on either side of its edge",
        update=edit_changed,
    )
    show_edge: BoolProperty(name="Edge", description="Where the object's paint ends, and how softly")
    show_surface: BoolProperty(name="Surface", description="Saturation, brightness and gloss of each swatch's paint")
    palette: StringProperty(
        name="Palette",
        description="The colors of its swatches, as Copy Palette writes them",
        get=_palette,
        set=_set_palette,
    )


class KARF_PG_left(bpy.types.PropertyGroup):
    """What a match has left of the difference of one object."""

    before: FloatProperty(description="Mean CIEDE2000 to the picture before the match")
    left: FloatProperty(description="Mean CIEDE2000 to the picture after the match")


class KARF_PG_match(bpy.types.PropertyGroup):
    """The picture that swatches are matched to."""

    show: BoolProperty(
        name="Match a picture", description="Fit the swatches to a painted or graded picture of the view"
    )
    picture: PointerProperty(
        name="Picture",
        type=bpy.types.Image,
        description="The active view painted over or graded, of any size",
        update=_picture_chosen,
    )
    view: StringProperty(name="View", description="The view that was painted over")
    left: CollectionProperty(type=KARF_PG_left)
