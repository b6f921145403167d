"""Named looks."""

import bpy
from bpy.props import StringProperty


class KARF_PG_look(bpy.types.PropertyGroup):
    """All swatches as they once stood, under a name."""

    edit: StringProperty(description="Contents of edit.json")
