"""The KaRF tab of the sidebar, in the 3D View and in the Image Editor. Drawing only reads."""

import bpy

from . import marking, seeing, sidebar, status, swatching

CLASSES = (*marking.CLASSES, *status.CLASSES, *seeing.CLASSES, *swatching.CLASSES, *sidebar.CLASSES)


def register():
    """Called when the extension is enabled."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    seeing.register_keys()


def unregister():
    """Called when the extension is disabled."""
    seeing.unregister_keys()
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
