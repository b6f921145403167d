"""The operators, one file per step of the panel."""

import bpy

from . import cameras, cancel, edit, failure, import_capture, masks, render, stages

FILES = (import_capture, masks, stages, edit, render, cameras, cancel, failure)
CLASSES = tuple(each for file in FILES for each in file.CLASSES)


def register():
    """Called when the extension is enabled."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister():
    """Called when the extension is disabled."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
