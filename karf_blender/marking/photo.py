"""The photo that is marked, in Image Editors."""

import bpy

from ..engine_api import BadRequest, DataError
from ..host import rendering, windows
from ..pictures import editors, photos
from ..project import captures, folders
from . import mask_layers

NAME = f"{editors.PREFIX} photo"
VIEW = "karf_view"  # the property of the picture that says whose it is


def is_shown(scene: bpy.types.Scene, space: bpy.types.SpaceImageEditor) -> bool:
    """Whether an Image Editor shows the active view's photo to mark."""
    image = scene.karf.marking.photo
    return image is not None and space.image == image and image.get(VIEW) == scene.karf.active_view


def areas(scene: bpy.types.Scene) -> list[bpy.types.Area]:
    """The Image Editors that show the active view's photo to mark."""
    return [area for area in windows.areas("IMAGE_EDITOR") if is_shown(scene, area.spaces.active)]


def show(scene: bpy.types.Scene) -> bpy.types.Image:
    """The active view's photo as its camera has taken it, with its masks; also in the Image Editors that are free.

    Raises:
        KarfError: The view has no photo, that or a mask cannot be read, or Blender renders.
    """
    image = _load(scene)
    editors.reveal(image, is_wanted=True)
    mask_layers.open_layers(scene)
    mask_layers.follow(scene)
    return image


def follow(scene: bpy.types.Scene) -> bool:
    """Show the active view's photo in the Image Editors that show one to mark; False if there are none.

    Raises:
        KarfError: As `show`.
    """
    image = scene.karf.marking.photo
    spaces = (area.spaces.active for area in windows.areas("IMAGE_EDITOR"))
    if image is None or not any(space.image == image for space in spaces):
        return False
    show(scene)
    return True


def _load(scene: bpy.types.Scene) -> bpy.types.Image:
    rendering.refuse()
    view, marking = captures.view_of(scene), scene.karf.marking
    if view.image is None:
        raise BadRequest("The view {name!r} has no photo.", "Choose another view.", name=view.name)
    file = photos.taken(view, folders.project_of(scene).photos_folder)
    if marking.photo is None:
        marking.photo = bpy.data.images.new(NAME, 1, 1)
        marking.photo.source = "FILE"
    image = marking.photo
    if image.filepath != str(file):
        image.filepath = str(file)  # Blender reads it anew
    if not image.size[0]:
        raise DataError("{path} cannot be read as an image.", "Check the file.", path=file)
    image[VIEW] = view.name
    return image
