"""The photo to mark in Image Editors: its image, the gesture over it, and the engine's corrected masks of it."""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .. import session
from ..engine_api import BadRequest, DataError
from ..host import rendering, windows
from ..pictures import editors, images, photos, tints
from ..preferences import state
from ..progress import printing_errors
from ..project import captures, disk, folders
from ..tasks import photo_copies, queries
from . import history, mask_layers, objects, tools
from .mask_layers import Layer
from .raster import Place

NAME = f"{editors.PREFIX} photo"
VIEW = "karf_view"  # the property of the image with the name of its view
SAMPLED_SIDE, SAMPLES = 512, 10_000  # size of the photo that an object's color is read from, pixels; of these at most


def is_displayed(scene: bpy.types.Scene, space: bpy.types.SpaceImageEditor) -> bool:
    """Return whether an Image Editor displays the active view's photo to mark."""
    image = scene.karf.marking.photo
    return image is not None and space.image == image and image.get(VIEW) == scene.karf.active_view


def areas(scene: bpy.types.Scene) -> list[bpy.types.Area]:
    """Return the Image Editors that display the active view's photo to mark."""
    return [area for area in windows.areas("IMAGE_EDITOR") if is_displayed(scene, area.spaces.active)]


def show(scene: bpy.types.Scene) -> bpy.types.Image:
    """Show the active view's photo with its masks, also in free Image Editors. Raises KarfError."""
    rendering.refuse()
    view, marking = captures.view_of(scene), scene.karf.marking
    if view.image is None:
        raise BadRequest("The view {name!r} has no photo.", "Choose another view.", name=view.name)
    file = photos.taken(photo_copies.readable(scene, view), folders.project_of(scene).photos_folder)
    stored = folders.stored(file)
    if marking.photo is None:
        marking.photo = bpy.data.images.new(NAME, 1, 1)
        marking.photo.source = "FILE"
    image = marking.photo
    if image.filepath != stored:
        image.filepath = stored  # Blender reloads it
    if not image.size[0]:
        raise DataError("{path} cannot be read as an image.", "Check the file.", path=file)
    image[VIEW] = view.name
    editors.reveal(image, is_wanted=True)
    mask_layers.open_layers(scene)
    windows.redraw()
    return image


def choose_tint(scene: bpy.types.Scene, marked: np.ndarray) -> None:
    """Give the active object, if it has no mask yet, a tint that shows on the photo where it is marked [H, W]."""
    image, item = scene.karf.marking.photo, objects.active(scene)
    is_shown = image is not None and image.get(VIEW) == scene.karf.active_view
    if not is_shown or not marked.any() or (objects.masks_folder(scene) / item.folder).exists():
        return
    with printing_errors():  # the mark counts without the photo's colors too
        colors = images.read_picture(folders.absolute(image.filepath), SAMPLED_SIDE)
        places = np.flatnonzero(marked)
        rows, columns = np.unravel_index(places[:: len(places) // SAMPLES + 1], marked.shape)
        (height, width), (high, wide) = marked.shape, colors.shape[:2]
        color = np.median(colors[rows * high // height, columns * wide // width], axis=0)
        others = (other.number for other in scene.karf.marking.objects if other != item)
        item.number = tints.contrasting(color, others)


def follow(scene: bpy.types.Scene) -> None:
    """Update photo and corrected masks where they are displayed after a change; errors are printed."""
    image = scene.karf.marking.photo
    spaces = (area.spaces.active for area in windows.areas("IMAGE_EDITOR"))
    if image is not None and any(space.image == image for space in spaces):
        with printing_errors():
            show(scene)
            correct(scene)


def leave(scene: bpy.types.Scene) -> None:
    """Lay the tools down if no editor displays the photo any more: their next click would bring it back."""
    if not areas(scene):
        tools.lay_down()
        scene.karf.marking.correct = False


@session.handler("undo_post", "redo_post", phase=session.Phase.READ)
def _after_undo(*_):
    with printing_errors():
        history.follow()
    for scene in bpy.data.scenes:
        mask_layers.reread(scene)
        follow(scene)


@dataclass
class Gesture:
    places: list[tuple[int, int]] = field(default_factory=list)  # of a box or lasso, in pixels of the region


def photo_place(region: bpy.types.Region, size: tuple[int, int], place: tuple[int, int]) -> Place:
    """Return a place in an Image Editor's region in pixels of the photo, y down."""
    u, v = region.view2d.region_to_view(*place)
    return u * size[0], (1 - v) * size[1]


def photo_length(region: bpy.types.Region, size: tuple[int, int], length: float) -> float:
    """Return a length in the region in pixels of the photo."""
    (x0, _), (x1, _) = (photo_place(region, size, (x, 0)) for x in (0, 1000))
    return length * (x1 - x0) / 1000


def correct(scene: bpy.types.Scene) -> None:
    """Request the active view's masks with all corrections, if *Correct* is on. Raises KarfError."""
    can_answer = "segmentation" in disk.contents_of(scene).stages and not state.known().problem
    if scene.karf.marking.correct and can_answer:
        view = scene.karf.active_view
        options = {"view": view, "masks": str(objects.masks_folder(scene))}
        queries.send(scene, "correct", options, partial(_take_corrected, view))


def _take_corrected(view: str, scene: bpy.types.Scene, values: dict[str, Any]) -> None:
    files = {name: Path(file) for name, file in values["masks"].items()}
    layers = mask_layers.opened(scene)
    if layers is not None and layers.view.name == view:
        layers.solved = {name: Layer(images.read_mask(file).astype(np.int8)) for name, file in files.items()}
        windows.redraw()
    for file in files.values():
        file.unlink(missing_ok=True)


def begin_correcting(scene: bpy.types.Scene) -> None:
    """Display the photo and take up a tool when *Correct* is switched on; errors are printed."""
    with printing_errors():
        show(scene)
        for area in areas(scene):
            tools.take_up(bpy.context, area)
        correct(scene)
