"""A capture as Blender cameras and points under one Empty.

The Empty is the capture's world: move, turn or scale it as a whole and all cameras stay right, since poses are always
taken relative to it.
"""

import contextlib
from dataclasses import dataclass
from pathlib import Path

import bpy
from mathutils import Matrix

from ..engine_api import BadRequest, Camera, Capture, DataError, View
from ..pictures import photos
from . import lens, placement, points

POINT_SIZE = 0.002  # radius of a sparse point, in units of the rig's extent
CLIP_START, CLIP_END = 0.001, 1000.0


@dataclass(frozen=True)
class Options:
    """How a capture is shown; nothing here changes what is learned.

    Attributes:
        orientation: `auto`, `file` or `upright`, see `placement.matrix_of`.
        size: Extent of the cameras in Blender units; 0: as in the file.
        points: Whether the sparse points are made.
        photos: Whether photos are put behind the cameras.
        camera_size: Drawn size of a camera, in units of the rig's extent.
    """

    orientation: str = "auto"
    size: float = 0.0
    points: bool = True
    photos: bool = True
    camera_size: float = 0.025


def build(capture: Capture, name: str, scene: bpy.types.Scene, options: Options | None = None) -> bpy.types.Object:
    """Make an Empty with a camera for each view, and the sparse points, in a collection of their own.

    The scene stays as it was where a camera cannot be made.

    Returns:
        The Empty.
    """
    options = options or Options()
    extent = placement.extent(capture)
    matrix = Matrix(placement.matrix_of(capture, options.orientation, options.size).tolist())
    size = extent * matrix.to_scale().x  # cameras are drawn and clipped in the units of Blender's world
    collection = bpy.data.collections.new(name)
    made = []
    try:
        empty = bpy.data.objects.new(name, None)
        made.append(empty)
        empty.matrix_basis = matrix
        empty.empty_display_size = 0.1 * extent
        for view in capture.views:
            made.append(_camera(view, empty, size, options))
        if options.points and capture.points is not None:
            made.append(points.build(capture.points, empty, POINT_SIZE * extent))
    except Exception:
        for item in made:
            bpy.data.objects.remove(item)
        bpy.data.collections.remove(collection)
        raise
    for item in made:
        collection.objects.link(item)
    scene.collection.children.link(collection)
    return empty


def _camera(view: View, parent: bpy.types.Object, size: float, options: Options) -> bpy.types.Object:
    data = bpy.data.cameras.new(view.name)
    set_lens(data, view.camera)
    data.display_size = options.camera_size * size
    data.clip_start, data.clip_end = CLIP_START * size, CLIP_END * size
    data.show_background_images = options.photos
    if options.photos and view.image is not None and view.image.exists():
        with contextlib.suppress(DataError):  # looking through the camera says why it shows no photo
            if photos.is_shown_as_stored(view):
                _set_background(data, view.image)
    camera = bpy.data.objects.new(view.name, data)
    camera.karf_view = view.name
    camera.parent = parent
    camera.matrix_local = Matrix(view.camera.camera_to_world.tolist())
    return camera


def set_lens(data: bpy.types.Camera, camera: Camera) -> None:
    """Let a Blender camera project as this pinhole does, in a scene with its size and pixel aspect."""
    numbers = lens.lens_of(camera)
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = lens.SENSOR_WIDTH
    data.lens = numbers.focal_length
    data.shift_x, data.shift_y = numbers.shift_x, numbers.shift_y


def _set_background(data: bpy.types.Camera, photo: Path) -> None:
    try:
        image = bpy.data.images.load(str(photo), check_existing=True)
    except RuntimeError as error:
        raise DataError("{path} cannot be read as an image.", "Check the file.", path=photo) from error
    background = data.background_images.new()
    background.image = image
    background.frame_method = "STRETCH"
    background.display_depth = "BACK"
    background.alpha = 1.0


def camera_of(scene: bpy.types.Scene, view: str) -> bpy.types.Object:
    """The rig's camera of a captured view.

    Raises:
        BadRequest: It was deleted.
    """
    rig = scene.karf.rig
    for camera in rig.children if rig else ():
        if camera.karf_view == view:
            return camera
    raise BadRequest(
        "The scene {name!r} has no camera of the view {view!r}.",
        "Import the capture again.",
        name=scene.name,
        view=view,
    )


def set_picture(scene: bpy.types.Scene, camera: Camera) -> None:
    """Give the scene a pinhole's picture size and pixel aspect."""
    render = scene.render
    render.resolution_x, render.resolution_y = camera.width, camera.height
    render.resolution_percentage = 100
    render.pixel_aspect_x, render.pixel_aspect_y = lens.lens_of(camera).pixel_aspect


def straighten_background(scene: bpy.types.Scene, view: View, folder: Path) -> None:
    """Put the photo, as the view's pinhole shows it, behind its camera where photos are wanted and it has none yet.

    Args:
        scene: Its rig has the camera.
        view: The captured view.
        folder: Where the picture is kept.

    Raises:
        DataError: The photo cannot be read.
    """
    data = camera_of(scene, view.name).data
    is_wanted = data.show_background_images and not data.background_images
    if is_wanted and view.image is not None and view.image.exists():
        _set_background(data, photos.straightened(view, folder))
