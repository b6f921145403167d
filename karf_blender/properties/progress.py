"""What belongs to the session: the sheet that is looked at, the running job."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, FloatProperty, IntProperty, StringProperty

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
    """The sheet of colorways that is looked at."""

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
