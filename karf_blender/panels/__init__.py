"""The KaRF tab of the sidebar, in the 3D View and in the Image Editor. Drawing only reads."""

import bpy

from . import sidebar, swatching

CLASSES = (*swatching.CLASSES, *sidebar.CLASSES)


def register():
    """Called when the extension is enabled."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister():
    """Called when the extension is disabled."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
