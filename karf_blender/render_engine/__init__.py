"""Blender's render engine KaRF: the recolored scene in rendered 3D Views, and from any camera as stills and animations.

Pixels are made by the engine's process; here they are asked for, and handed to Blender.
"""

import bpy

from . import compatible, engine, passes

CLASSES = (passes.KARF_PG_layer, engine.KarfRenderEngine)


def register():
    """Called when the extension is enabled."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.ViewLayer.karf = bpy.props.PointerProperty(type=passes.KARF_PG_layer)
    compatible.register()


def unregister():
    """Called when the extension is disabled."""
    compatible.unregister()
    del bpy.types.ViewLayer.karf
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
