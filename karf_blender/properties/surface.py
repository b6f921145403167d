"""The learned scene in the 3D View, by an object of ours and by one of other programs."""

import bpy
from bpy.props import IntProperty, PointerProperty

from ..engine_api import PointsOptions, bounds_of


class KARF_PG_surface(bpy.types.PropertyGroup):
    """The objects that show the learned scene."""

    count: IntProperty(
        name="Points",
        default=bounds_of(PointsOptions, "count")["default"],
        min=1000,
        max=600_000,
        step=10_000,
        description="Approximate number. Ten times as many show finer detail, but follow swatches more slowly",
    )
    item: PointerProperty(name="Object", type=bpy.types.Object, description="Object that shows the learned scene")
    splat: PointerProperty(name="Splat", type=bpy.types.Object, description="Splat object colored by the swatches")
