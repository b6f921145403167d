"""The learned scene in the 3D View."""

import bpy
from bpy.props import IntProperty, PointerProperty

from ..engine_api import PointsOptions, bounds_of


class KARF_PG_surface(bpy.types.PropertyGroup):
    """The object that shows the learned scene."""

    count: IntProperty(
        name="Points",
        default=bounds_of(PointsOptions, "count")["default"],
        min=1000,
        max=600_000,
        step=10_000,
        description="About how many; ten times as many show finer things, and follow swatches more slowly",
    )
    item: PointerProperty(name="Object", type=bpy.types.Object, description="What shows the learned scene")


CLASSES = (KARF_PG_surface,)
