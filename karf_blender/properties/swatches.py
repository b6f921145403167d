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
from ..swatches import displayed, edits, gestures
from .colors import pigment_reach, protected_neutrals, srgb

SCOPE_ITEMS = [
    ("PAINT", "This Paint", "Change one paint; the object's other paints and its neutrals stay"),
    ("OBJECT", "Whole Object", "Change the swatches of the whole object; the changes of its paints are put aside"),
]
FACTOR = {"default": 1.0, "min": 0.0, "max": MAX_FACTOR, "soft_max": 2.0, "step": 5}
PIXELS = {"subtype": "PIXEL", "step": 10, "precision": 1}
STOPS = {"min": -MAX_BRIGHTNESS, "max": MAX_BRIGHTNESS, "soft_min": -1.0, "soft_max": 1.0, "step": 5}


def edit_changed(self, context):
    """The update of a property that changes the picture."""
    displayed.of(self.id_data).refresh()


def _surface_changed(self, context):
    gestures.surface_changed(self)


def _reach_changed(self, context):
    if self.is_added:
        gestures.color_changed(self)


def _source_picked(self, context):
    edits.source_picked(self)
    displayed.of(self.id_data).update_left()


def _target_changed(self, context):
    if self.live:
        try:
            edits.become_target(self)
        except (KarfError, OSError) as error:
            progress.warn(str(error))
    displayed.of(self.id_data).update_left()


def _metal_changed(self, context):
    gestures.drag_again(self)
    _target_changed(self, context)


def _picture_chosen(self, context):
    self.view = ""  # of another picture nobody knows which view it shows


class KARF_PG_swatch(bpy.types.PropertyGroup):
    """One palette color of an object: as learned, and as the artist wants it."""

    learned: srgb("Learned", description="Color found in the photos")
    color: srgb(
        "Color",
        highest=MAX_SRGB,
        description="New color, which may be brighter than white. With Material, the other colors of its paint "
        "follow, and highlights keep the light's color",
        update=lambda self, context: gestures.color_changed(self),
    )
    saturation: FloatProperty(
        name="Saturation",
        description="Saturation of its paint. 1: unchanged; 0: gray",
        update=_surface_changed,
        **FACTOR,
    )
    brightness: FloatProperty(
        name="Brightness",
        description="Brightness of its paint's mid-tones. Black and white stay",
        update=_surface_changed,
        **STOPS,
    )
    gloss: FloatProperty(
        name="Gloss",
        description="Strength of the highlights on its paint. 1: unchanged; 0: matte",
        update=_surface_changed,
        **FACTOR,
    )
    shift: FloatVectorProperty(size=3, description="Change of the color by the surface settings")
    locked: BoolProperty(name="Lock", description="Protect this swatch from changes", update=edit_changed)
    link: IntProperty(description="Swatches with the same number share one color. 0: none")
    merged: IntProperty(description="Number of the object's swatch that this one follows. 0: none")
    is_paint: BoolProperty(description="This color is one of the object's paints")
    is_added: BoolProperty(description="This color was added by hand. Its pigment has a separate set of swatches")
    reach: pigment_reach(options=set(), update=_reach_changed)
    protect: protected_neutrals(options=set(), update=_reach_changed)
    began: srgb("Began", highest=MAX_SRGB, description="Color at the start of the object's last drag, for keyframes")
    before: srgb("Before", highest=MAX_SRGB, description="Color when the source was picked")
    after: srgb("After", highest=MAX_SRGB, description="Color last set by Becomes")


class KARF_PG_object(bpy.types.PropertyGroup):
    """One object of the masks. Its first swatch is black and stays black."""

    swatches: CollectionProperty(type=KARF_PG_swatch)
    source: srgb(
        "Source",
        0.5,
        description="Color of the object in the displayed picture, edited or not. Pick it there (E)",
        update=_source_picked,
    )
    gains: FloatVectorProperty(
        size=3, default=UNIT_GAINS, description="Exposure of the photo in which the source was picked"
    )
    target: srgb("Target", 0.5, description="New color for the source", update=_target_changed)
    dragged: IntProperty(description="Number of the last dragged swatch, for keyframes. 0: none")
    held: StringProperty(name="Held", description="Colors set earlier on its paints, kept by Becomes")
    scope: EnumProperty(name="Scope", description="What a swatch changes", items=SCOPE_ITEMS, update=edit_changed)
    is_metal: BoolProperty(
        name="Metal",
        description="Tint highlights with the paint's color, as on gold or copper. Off: they keep the light's color",
        update=_metal_changed,
    )
    live: BoolProperty(name="Live", description="Follow the target color while it is dragged", update=_target_changed)
    show_becomes: BoolProperty(
        name="One color becomes another", description="Pick a color of the object and its new color"
    )
    choke: FloatProperty(
        name="Choke",
        min=-MAX_CHOKE,
        max=MAX_CHOKE,
        description="Shrink the object's paint by this many pixels of the photo. Negative values expand it",
        update=edit_changed,
        **PIXELS,
    )
    feather: FloatProperty(
        name="Feather",
        min=0.0,
        max=MAX_FEATHER,
        description="Fade the paint over this many pixels of the photo, half of them on either side of its edge",
        update=edit_changed,
        **PIXELS,
    )
    show_edge: BoolProperty(name="Edge", description="Position and softness of the paint's edge")
    show_surface: BoolProperty(name="Surface", description="Saturation, brightness and gloss of each swatch's paint")
    palette: StringProperty(
        name="Palette",
        description="Colors of its swatches, as written by Copy Palette",
        get=lambda self: edits.copied(self.id_data, self.name, None),
        set=lambda self, text: edits.paste(self.id_data, self.name, None, text),
    )


class KARF_PG_left(bpy.types.PropertyGroup):
    """The remaining difference of one object after a match."""

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
        description="Painted or graded picture of the active view, of any size",
        update=_picture_chosen,
    )
    view: StringProperty(name="View", description="View that was painted over")
    left: CollectionProperty(type=KARF_PG_left)


class KARF_PG_look(bpy.types.PropertyGroup):
    """All swatches as they once stood, under a name."""

    edit: StringProperty(description="Contents of edit.json")
