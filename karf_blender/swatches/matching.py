"""Match Picture: swatches fitted to a picture of the active view, painted over in the Image Editor or graded elsewhere."""

from pathlib import Path

import bpy
import numpy as np

from ..engine_api import BadRequest, Edit, ObjectMatch, find_header, linear_to_srgb, match_picture, to_mean_exposure
from ..pictures import images
from . import colors, displayed, edits

PAINTING_NAME = "KaRF painting"
ASPECT_TOLERANCE = 0.02  # relative difference of aspect ratio between a picture and its view: rounding of small sizes


def paint_over(scene: bpy.types.Scene) -> bpy.types.Image:
    """Copy the active view, recolored, to an image to paint on. Raises KarfError where it cannot be recolored."""
    buffer = displayed.of(scene).edited()
    height, width = buffer.shape[:2]
    image = bpy.data.images.get(PAINTING_NAME) or images.new_image(PAINTING_NAME, width, height)
    images.fit(image, width, height)
    images.upload(image, buffer)
    scene.karf.match.picture, scene.karf.match.view = image, scene.karf.active_view
    return image


def chosen(scene: bpy.types.Scene) -> bpy.types.Image:
    """Return the painted or chosen picture. Raises BadRequest without one of this view."""
    match, view = scene.karf.match, scene.karf.active_view
    if match.picture is None:
        raise BadRequest("No picture was chosen.", "Press Paint Over, or choose a picture of this view.")
    if match.view not in ("", view):
        raise BadRequest(
            "{name!r} was painted over the view {view!r}, but {shown!r} is displayed.",
            "Show {view!r} in step 4, or paint over this view.",
            name=match.picture.name,
            view=match.view,
            shown=view,
        )
    return match.picture


def pixels_of(picture: bpy.types.Image) -> np.ndarray:
    """Return the sRGB colors [H, W, 3] of an image, painted or not. Raises BadRequest where it has none."""
    if not picture.size[0]:
        raise BadRequest("{name!r} has no pixels.", "Choose another picture.", name=picture.name)
    pixels = images.colors_of(picture)
    return _display(pixels) if picture.is_float else pixels  # floats are linear light in Blender


def read(path: Path) -> np.ndarray:
    """Return the sRGB colors [H, W, 3] of a picture file. Raises DataError where it is unreadable."""
    pixels, header = images.read_picture(path), find_header(path)
    return _display(pixels) if header is not None and header.kind == "exr" else pixels


def _display(light: np.ndarray) -> np.ndarray:
    return linear_to_srgb(np.clip(light, 0, 1))


def match(scene: bpy.types.Scene, name: str, picture: np.ndarray) -> tuple[ObjectMatch, ...]:
    """Set the swatches so that the active view comes closest to a picture of it; locked ones stay.

    The picture [h, w, 3] sRGB shows the whole view, at any size, without lens distortion. Return what was found for
    each object that has other colors there. Raises BadRequest if the picture does not fit or has no other colors, or
    the scene shows palettes only; KarfError if the view is not prepared.
    """
    karf = scene.karf
    if karf.compositing != "delta":
        raise BadRequest("Match Picture only works on edited photos.", "Set Result to Photo plus change.")
    view, states = displayed.of(scene).prepared_view().spread(scene).planes, colors.states(scene)
    ordered = [states[name] for name in view.objects]
    pictures = view.base.astype(np.float32) / 255, _fitted(name, picture, *view.base.shape[1::-1])
    found = match_picture(
        [state.gathered(weights) for state, weights in zip(ordered, view.palette_weights, strict=True)],
        view.probabilities,
        *(to_mean_exposure(each, view.gains) for each in pictures),
        [state.whole for state in ordered],
        {state.name: state.edited for state in ordered},
        {state.name: state.held for state in ordered},
    )
    if not found:
        raise BadRequest(
            "{name!r} shows the objects unchanged from {view!r}.",
            "Paint on them, or choose another picture.",
            name=name,
            view=karf.active_view,
        )
    wanted = {each.name: each.colors[states[each.name].kept] for each in found}
    edits.apply_edit(scene, Edit(wanted, karf.compositing, colors.added_by_object(scene), colors.edges(scene)))
    return found


def _fitted(name: str, picture: np.ndarray, width: int, height: int) -> np.ndarray:
    """Resize a picture to the view. Raises BadRequest where its shape is another."""
    own_height, own_width = picture.shape[:2]
    if abs(own_width * height / (own_height * width) - 1) > ASPECT_TOLERANCE:
        raise BadRequest(
            "{name!r} has {own_width} x {own_height} pixels, but the view has {width} x {height}.",
            "Choose a picture of the whole view, of any size.",
            name=name,
            own_width=own_width,
            own_height=own_height,
            width=width,
            height=height,
        )
    return images.resized(picture, width, height)
