"""Properties of marking, which the .blend keeps: the objects to mark, the brush, and where undo stands."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, IntProperty, PointerProperty, StringProperty

from ..engine_api import KarfError
from ..host import windows
from ..marking import mask_layers, objects, photo


def _renamed(self, context):
    try:
        objects.rename(self.id_data, self)
    except (KarfError, OSError) as error:
        self["name"] = self.folder
        print(f"KaRF: the object {self.folder!r} keeps its name: {error}")
    mask_layers.reread(self.id_data)


def _switched(self, context):
    begin_or_follow = photo.begin_correcting if self.correct else photo.follow
    begin_or_follow(self.id_data)
    windows.redraw()


class KARF_PG_marked_object(bpy.types.PropertyGroup):
    """An object to mark."""

    name: StringProperty(
        name="Name", description="Name of the object, its swatches and its folder of masks", update=_renamed
    )
    folder: StringProperty(description="Name of its folder, which stays when the object is renamed")
    number: IntProperty(
        default=-1, description="Index of its color, which stays when the object is renamed. -1: none yet"
    )


class KARF_PG_marking(bpy.types.PropertyGroup):
    """The objects to mark, and the tools that mark them."""

    objects: CollectionProperty(type=KARF_PG_marked_object)
    active: IntProperty(name="Object", description="Object to mark", update=lambda self, context: windows.redraw())
    photo: PointerProperty(name="Photo", type=bpy.types.Image, description="Photo to mark")
    brush: IntProperty(
        name="Brush",
        subtype="PIXEL",
        default=25,
        min=1,
        soft_max=200,
        max=2000,
        description="Brush radius on the screen",
    )
    correct: BoolProperty(
        name="Correct",
        description="Correct the segmentation with strokes in any view, on the object or beside it",
        update=_switched,
    )
    step: IntProperty(description="Number of the last stroke, for undo")
