"""Pictures in the Image Editors: which one they show, and whether it is painted on."""

from pathlib import Path

import bpy

from ..host import windows
from ..project import folders

PREFIX = "KaRF"  # prefix of the names of all images
PREVIEW_NAME = f"{PREFIX} preview"
MARGIN = 0.95  # share of the editor that a picture fills


def reveal(image: bpy.types.Image, is_wanted: bool = False, is_whole: bool = False) -> None:
    """Show an image in the Image Editors that show none, or one of KaRF's own.

    The engine's preview never replaces another picture. Unless the user has requested the image (`is_wanted`), one in
    paint mode stays. With `is_whole`, editors that did not show it before zoom to all of it.
    """
    replaced = PREVIEW_NAME if image.name.startswith(PREVIEW_NAME) else PREFIX
    for area in windows.areas("IMAGE_EDITOR"):
        editor = area.spaces.active
        is_free = editor.image is None or editor.image.name.startswith(replaced)
        if editor.image != image and is_free and (is_wanted or editor.mode != "PAINT"):
            show(area, image)
            if is_whole:
                fit(area)


def is_shown(image: bpy.types.Image) -> bool:
    """Return whether an Image Editor of an open window shows this image."""
    return any(area.spaces.active.image == image for area in windows.areas("IMAGE_EDITOR"))


def is_empty(area: bpy.types.Area) -> bool:
    """Return whether an Image Editor shows no picture, or a lost one of KaRF."""
    image = area.spaces.active.image
    return image is None or (image.name.startswith(PREFIX) and not image.size[0])


def show(area: bpy.types.Area, image: bpy.types.Image | None) -> None:
    """Show an image, or none, in an Image Editor, at the place and width of the last one."""
    play(area)
    space = area.spaces.active
    if space.image == image:
        return
    zoom, corners = space.zoom_percentage, _corners(area)
    space.image = image
    # Blender 5.2 resets the zoom
    if image is not None and corners and space.zoom_percentage != zoom and image.size[0] and not bpy.app.background:
        place(area, *corners)


def play(area: bpy.types.Area) -> None:
    """Update an Image Editor during playback; by default only the editor under the mouse plays."""
    area.id_data.use_play_image_editors = True


def fit(area: bpy.types.Area) -> None:
    """Zoom an Image Editor to its whole picture, beside its overlapping sidebar and toolbar."""
    width, height = area.spaces.active.image.size
    region, (x0, y0, x1, y1) = _main_region(area), _uncovered(area)
    if not width or min(x1 - x0, y1 - y0) <= 1:  # it cannot be read, or the editor was not drawn yet
        return
    zoom = MARGIN * min((x1 - x0) / width, (y1 - y0) / height)
    x, y = (x0 + x1) / 2 - region.x, (y0 + y1) / 2 - region.y
    half = zoom * width / 2, zoom * height / 2
    place(area, (x - half[0], y - half[1]), (x + half[0], y + half[1]))


def place(area: bpy.types.Area, low: tuple[float, float], high: tuple[float, float]) -> None:
    """Fit the picture of an Image Editor between two corners of its main region, in pixels; the width counts."""
    space, region = area.spaces.active, _main_region(area)
    zoom = (high[0] - low[0]) / space.image.size[0]
    aside = low[0] + high[0] - region.width, low[1] + high[1] - region.height
    with bpy.context.temp_override(window=windows.window_of(area), area=area, region=region):
        bpy.ops.image.view_all()  # to its middle
        space.zoom_percentage = 100 * zoom
        bpy.ops.image.view_pan(offset=tuple(-value / 2 / zoom for value in aside))


def _corners(area: bpy.types.Area) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Return the lower left and the upper right corner of the displayed picture, if any."""
    view = _main_region(area).view2d
    if area.spaces.active.image is None:
        return None
    return view.view_to_region(0, 0, clip=False), view.view_to_region(1, 1, clip=False)


def _uncovered(area: bpy.types.Area) -> tuple[int, int, int, int]:
    """Return the uncovered part of an editor's main region: left, bottom, right, top in the window."""
    main = _main_region(area)
    x0, y0, x1, y1 = main.x, main.y, main.x + main.width, main.y + main.height
    for region in area.regions:
        if min(region.width, region.height) <= 1:  # hidden
            continue
        if region.alignment == "LEFT":
            x0 = max(x0, region.x + region.width)
        elif region.alignment == "RIGHT":
            x1 = min(x1, region.x)
        elif region.alignment == "TOP":
            y1 = min(y1, region.y)
    return x0, y0, x1, y1


def _main_region(area: bpy.types.Area) -> bpy.types.Region:
    return next(region for region in area.regions if region.type == "WINDOW")


def set_mode(image: bpy.types.Image, mode: str) -> None:
    """Switch the Image Editors that show this image to `PAINT` or `VIEW`."""
    for area in windows.areas("IMAGE_EDITOR"):
        if area.spaces.active.image == image:
            area.spaces.active.mode = mode


def show_preview(path: Path) -> None:
    """Show the engine's latest preview; a missing or incomplete file is ignored."""
    image = bpy.data.images.get(PREVIEW_NAME)
    try:
        if image is None:
            image = bpy.data.images.load(folders.stored(path))
            image.name = PREVIEW_NAME
    except RuntimeError:
        return
    image.filepath = folders.stored(path)
    image.reload()
    reveal(image, is_whole=True)
