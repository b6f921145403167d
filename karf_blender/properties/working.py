"""Which steps are open in the sidebar."""

import bpy
from bpy.props import BoolProperty

from ..workspace.states import STEPS


class KARF_PG_folding(bpy.types.PropertyGroup):
    """The steps that are open, of both editors."""

    __annotations__ = {f"show_{step}": BoolProperty(name="Open", default=step == STEPS[0]) for step in STEPS}


CLASSES = (KARF_PG_folding,)
