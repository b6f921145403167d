"""Coarse masks painted over a photo in the Image Editor.

The artist paints on a copy of the photo, in any color that the object has not; what was painted over is the object.
"""

from pathlib import Path

import bpy
import numpy as np

from ..engine_api import BadRequest, View, is_file_name, same_but_for_case
from ..host import compat
from ..project import folders
from . import images, photos

BRUSH_COLOR = (1.0, 0.0, 1.0)  # magenta, which few objects have
THRESHOLD = 8 / 255  # a pixel that differs by more was painted on


def start(scene: bpy.types.Scene, name: str, view: View) -> bpy.types.Image:
    """Make the picture to paint on.

    Args:
        scene: Its mask image is replaced.
        name: The object's.
        view: Any view with a photo.

    Returns:
        The image: a copy of the view's photo.

    Raises:
        BadRequest: The name cannot be a folder's, or is another object's but for upper and lower case; or the view has
            no photo.
        DataError: The photo is unreadable.
    """
    _check_name(name, _folder(scene))
    if view.image is None:
        raise BadRequest(f"The view {view.name!r} has no photo.", "Choose another view.")
    photo = photos.read(view)
    height, width = photo.shape[:2]
    if scene.karf.mask_image is None:
        scene.karf.mask_image = images.new_image("KaRF mask", width, height)
    image = scene.karf.mask_image
    images.fit(image, width, height)
    buffer = images.blank(width, height)
    images.upright(buffer)[:] = photo
    images.upload(image, buffer)
    scene.karf.mask_object, scene.karf.mask_view = name, view.name
    compat.set_brush_color(scene.tool_settings, BRUSH_COLOR)
    return image


def save(scene: bpy.types.Scene, view: View) -> tuple[str, float]:
    """Write what was painted as a mask into the chosen folder (default: the project's own).

    Returns:
        The file's path, and the painted share of the picture.

    Raises:
        BadRequest: No mask was begun, or nothing is painted.
    """
    karf = scene.karf
    _check_name(karf.mask_object, _folder(scene))
    if karf.mask_image is None:
        raise BadRequest("No mask was begun.", "Press Paint Mask first.")
    painted = images.pixels(karf.mask_image)[..., :3]
    mask = np.abs(painted - photos.read(view)).max(axis=-1) > THRESHOLD
    if not mask.any():
        raise BadRequest(
            f"Nothing is painted on the photo of {view.name!r}.",
            "Paint over the object in the Image Editor's Paint mode.",
        )
    if not karf.masks:
        karf.masks = folders.stored(folders.project_of(scene).masks_folder)
    file = _folder(scene) / karf.mask_object / f"{view.name}.png"
    images.write_png(file, np.repeat(mask[..., None], 3, axis=-1).astype(np.float32))
    return str(file), float(mask.mean())


def _folder(scene: bpy.types.Scene) -> Path:
    """Where masks are kept, one folder an object; it may not exist yet."""
    chosen = scene.karf.masks
    return folders.absolute(chosen) if chosen else folders.project_of(scene).masks_folder


def _check_name(name: str, folder: Path) -> None:
    # it becomes a folder's name
    if not name or name != bpy.path.clean_name(name) or not is_file_name(name):
        raise BadRequest(f"{name!r} is no name for an object.", "Use letters, digits, - and _ only.")
    others = [path.name for path in folder.glob("*/")]
    if same := same_but_for_case([*others, name]):
        raise BadRequest(f"{same[1]!r} and the object {same[0]!r} would be one folder.", "Choose another name.")
