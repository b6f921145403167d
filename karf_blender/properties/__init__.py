"""Properties of the scene (saved, undone, keyframed) and of the window manager (neither)."""

import bpy
from bpy.props import BoolProperty, PointerProperty, StringProperty

from .. import session
from .scene import KARF_PG_scene
from .window_manager import KARF_PG_colorways, KARF_PG_folding, KARF_PG_preview, KARF_PG_progress, KARF_PG_seeing


@session.setup
def _pointers():
    added = (
        (bpy.types.Scene, "karf", PointerProperty(type=KARF_PG_scene)),
        (bpy.types.WindowManager, "karf_progress", PointerProperty(type=KARF_PG_progress)),
        (bpy.types.WindowManager, "karf_colorways", PointerProperty(type=KARF_PG_colorways)),
        (bpy.types.WindowManager, "karf_seeing", PointerProperty(type=KARF_PG_seeing)),
        (bpy.types.WindowManager, "karf_folding", PointerProperty(type=KARF_PG_folding)),
        (bpy.types.WindowManager, "karf_preview", PointerProperty(type=KARF_PG_preview)),
        (bpy.types.Object, "karf_hidden", BoolProperty(name="Hidden by KaRF")),
        (bpy.types.Object, "karf_photo_hidden", BoolProperty(name="Photo hidden by KaRF")),
        (bpy.types.Object, "karf_view", StringProperty(name="KaRF view", description="Captured view of this camera")),
    )
    for owner, name, declared in added:
        setattr(owner, name, declared)
    yield
    for owner, name, _ in reversed(added):
        delattr(owner, name)
