"""Which steps are open in the sidebar; what looking through a captured camera changes for a while."""

import bpy
from bpy.props import BoolProperty, FloatVectorProperty, PointerProperty

from ..rig import cameras
from ..workspace.states import STEPS


def _hiding_switched(self, context):
    cameras.hide_others(self.id_data)


class KARF_PG_folding(bpy.types.PropertyGroup):
    """The steps that are open, of both editors."""

    __annotations__ = {f"show_{step}": BoolProperty(name="Open", default=step == STEPS[0]) for step in STEPS}


class KARF_PG_looking(bpy.types.PropertyGroup):
    """What the scene had before a captured camera was looked through, and what it has meanwhile."""

    is_on: BoolProperty(name="Looking Through")
    camera: PointerProperty(name="Camera", type=bpy.types.Object)
    before: FloatVectorProperty(name="Picture Before", size=len(cameras.PICTURE))
    during: FloatVectorProperty(name="Picture", size=len(cameras.PICTURE))
    hides_others: BoolProperty(
        name="Hide Others",
        description="Hide the other cameras and the sparse points while one camera is looked through",
        update=_hiding_switched,
    )
