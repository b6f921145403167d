"""How large the picture of the followed camera is; it belongs to the session."""

import bpy
from bpy.props import IntProperty


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
