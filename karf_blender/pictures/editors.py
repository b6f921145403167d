"""Pictures in the Image Editors: which one they show, and whether it is painted on."""

from pathlib import Path

import bpy

from ..host import windows

PREFIX = "KaRF"  # of the names of all pictures that are shown
PREVIEW_NAME = f"{PREFIX} preview"


def reveal(image: bpy.types.Image, is_wanted: bool = False) -> None:
    """Show an image in the Image Editors that show none, or one of KaRF's own.

    The engine's preview never takes the place of another picture.

    Args:
        image: The picture to show.
        is_wanted: The user asked for this very picture; else one that is being painted on is left alone.
    """
    replaced = PREVIEW_NAME if image.name.startswith(PREVIEW_NAME) else PREFIX
    for area in windows.areas("IMAGE_EDITOR"):
        editor = area.spaces.active
        is_free = editor.image is None or editor.image.name.startswith(replaced)
        if is_free and (is_wanted or editor.mode != "PAINT"):
            editor.image = image


def is_shown(image: bpy.types.Image) -> bool:
    """Whether an Image Editor of an open window shows this image."""
    return any(area.spaces.active.image == image for area in windows.areas("IMAGE_EDITOR"))


def set_mode(image: bpy.types.Image, mode: str) -> None:
    """Switch the Image Editors that show this image to `PAINT` or `VIEW`."""
    for area in windows.areas("IMAGE_EDITOR"):
        if area.spaces.active.image == image:
            area.spaces.active.mode = mode


def show_preview(path: Path) -> None:
    """Show the engine's latest preview in the one preview image; a file that is gone or half written is ignored."""
    image = bpy.data.images.get(PREVIEW_NAME)
    try:
        if image is None:
            image = bpy.data.images.load(str(path))
            image.name = PREVIEW_NAME
    except RuntimeError:
        return
    image.filepath = str(path)
    image.reload()
    reveal(image)
