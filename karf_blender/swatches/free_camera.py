"""The picture of the free camera that is followed, with the same settings as a view's."""

import bpy

from ..host.words import translatable
from ..pictures import editors, images
from . import displayed, object_masks, views
from .object_masks import ObjectMasks
from .views import DisplayedView

IMAGE_NAME = f"{editors.PREFIX} camera"
NO_PHOTO = translatable("A free camera has no photo: Original shows the learned scene.")
NO_PALETTES = translatable(
    "There are no palettes yet, so the picture shows the learned scene. Press Extract Palette in step 5."
)
NO_MASKS = translatable("Nothing is segmented yet, so there are no masks to show. Press Segment in step 4.")


def image() -> bpy.types.Image | None:
    """Return the picture's image, if there is one."""
    return bpy.data.images.get(IMAGE_NAME)


def show(scene: bpy.types.Scene, view: DisplayedView, width: int, height: int) -> None:
    """Put the picture of a camera's planes into its image, at this size.

    Raises:
        KarfError: The planes belong to other palettes, or Blender renders.
    """
    known = displayed.of(scene)
    picture = views.picture(scene, view, known.files)
    before = image()
    target = before or images.new_image(IMAGE_NAME, width, height)
    images.fit(target, width, height)
    images.upload(target, images.enlarged(picture, width, height))
    images.note_change(target)
    if before is None:
        editors.reveal(target, is_wanted=True, is_whole=True)
    known.camera = view
    if bpy.context.window_manager.karf_seeing.show_masks and view.planes.objects and view.masks is None:
        view.masks = object_masks.of_planes(view.planes, scene)


def is_in(space: bpy.types.Space) -> bool:
    """Tell whether an Image Editor shows the picture of a camera that is followed."""
    return displayed.followed_camera() is not None and space.image is not None and space.image == image()


def masks() -> ObjectMasks | None:
    """Return the objects in the picture; None where they are not displayed."""
    view = displayed.followed_camera()
    return None if view is None else view.masks


def lacks() -> tuple[str, ...]:
    """Return what the settings ask for and this picture cannot show, a sentence each."""
    view, seeing = displayed.followed_camera(), bpy.context.window_manager.karf_seeing
    if view is None:
        return ()
    wants_palettes = seeing.mode in {"WEIGHTS", "DIFFERENCE"}
    found = {
        NO_PHOTO: seeing.mode == "ORIGINAL" or seeing.is_wiped,
        NO_PALETTES: wants_palettes and not view.planes.palette_weights.shape[1],
        NO_MASKS: seeing.show_masks and not view.planes.objects,
    }
    return tuple(sentence for sentence, is_lacking in found.items() if is_lacking)
