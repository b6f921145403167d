"""The operators: a file for each step of the panel, for the engine itself, and for how a job ends."""

import bpy

from . import (
    adding,
    calibrating,
    cameras,
    cancel,
    capture,
    color_names,
    colorways,
    edit,
    failure,
    installing,
    learn,
    looks,
    manual,
    marking,
    masks,
    moving,
    opening,
    preview,
    probing,
    render,
    rendering,
    seeing,
    splats,
    split_view,
    surface,
    swatches,
    workspace,
)

FILES = (
    capture,
    moving,
    opening,
    manual,
    masks,
    marking,
    learn,
    installing,
    probing,
    edit,
    swatches,
    adding,
    color_names,
    calibrating,
    seeing,
    split_view,
    render,
    rendering,
    preview,
    surface,
    splats,
    colorways,
    looks,
    cameras,
    cancel,
    failure,
    workspace,
)
CLASSES = tuple(each for file in FILES for each in file.CLASSES)


def register():
    """Called when the extension is enabled."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister():
    """Called when the extension is disabled."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
