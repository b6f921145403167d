"""Properties of the session, which a .blend does not store: the sheet of colorways, the running job, the panels."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, FloatProperty, IntProperty, StringProperty

from ..workspace.states import STEPS
from .colors import srgb


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
