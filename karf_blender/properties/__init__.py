"""What the .blend keeps (Scene.karf: saved, undone, keyframed) and what it does not (WindowManager.karf_progress)."""

import bpy
from bpy.props import BoolProperty, PointerProperty, StringProperty

from . import looks, marking, preview, scene, seeing, session, surface, swatches, working
from .preview import KARF_PG_preview
from .scene import KARF_PG_scene
from .seeing import KARF_PG_seeing
from .session import KARF_PG_colorways, KARF_PG_progress
from .working import KARF_PG_folding

CLASSES = (
    *swatches.CLASSES,
    *looks.CLASSES,
    *marking.CLASSES,
    *working.CLASSES,
    *preview.CLASSES,
    *surface.CLASSES,
    *scene.CLASSES,
    *session.CLASSES,
    *seeing.CLASSES,
)


def register():
    """Called when the extension is enabled."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.karf = PointerProperty(type=KARF_PG_scene)
    bpy.types.WindowManager.karf_progress = PointerProperty(type=KARF_PG_progress)
    bpy.types.WindowManager.karf_colorways = PointerProperty(type=KARF_PG_colorways)
    bpy.types.WindowManager.karf_seeing = PointerProperty(type=KARF_PG_seeing)
    bpy.types.WindowManager.karf_folding = PointerProperty(type=KARF_PG_folding)
    bpy.types.WindowManager.karf_preview = PointerProperty(type=KARF_PG_preview)
    bpy.types.Object.karf_hidden = BoolProperty(name="Hidden by KaRF")
    bpy.types.Object.karf_view = StringProperty(name="KaRF view", description="The captured view of this camera")


def unregister():
    """Called when the extension is disabled."""
    del bpy.types.Object.karf_view
    del bpy.types.Object.karf_hidden
    del bpy.types.WindowManager.karf_preview
    del bpy.types.WindowManager.karf_folding
    del bpy.types.WindowManager.karf_seeing
    del bpy.types.WindowManager.karf_colorways
    del bpy.types.WindowManager.karf_progress
    del bpy.types.Scene.karf
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
