"""Training images: photos resized to the working size and undistorted. Conventions: see `io.images`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from scipy.ndimage import maximum_filter

from ..errors import BadRequest, DataError
from ..io.icc import Space
from ..io.images import alpha_composite, convert_to_srgb, embedded_space, read_photo, resize, unpremultiply
from .camera import Camera, wrong_size_error
from .capture import View
from .distortion import distort

BORDER_TOLERANCE = 0.04  # distance from black or white of a background pixel: JPEG noise, dark gray paper
BORDER_SHARE = 0.8  # share of border pixels that must be background: an object may touch the border
SOLID_DIFFERENCE = 0.06  # distance from the background of an object's pixel
VIEW_SHARE = 0.9  # share of the views that must agree: a few may be close-ups
ASPECT_TOLERANCE = 0.02  # relative difference of aspect ratios explained by rounding
LENS_ROWS = 256  # rows of a lens map computed at a time, to bound float64 temporaries
LENS_DETAIL = 3  # undistort at this multiple of the working size, to keep detail


@dataclass(frozen=True)
class TrainingImage:
    """A view at the working size, without distortion."""

    view: View
    camera: Camera  # a pinhole at the working size
    color: np.ndarray  # sRGB float32 [H, W, 3] in [0, 1], straight
    alpha: np.ndarray | None  # float32 [H, W] in [0, 1]; None if the photo is opaque
    valid: np.ndarray | None  # bool [H, W], False outside the photo; None if all pixels are inside


def load_views(views: Sequence[View], long_side: int) -> list[TrainingImage]:
    """Read photos, undistort them and scale them down to at most `long_side` pixels a side, one at a time.

    Raises DataError if a photo is missing, damaged or of another size than its camera.
    """
    return [_load_view(view, long_side) for view in views]


def load_readable_views(views: Sequence[View], long_side: int) -> tuple[list[TrainingImage], dict[str, DataError]]:
    """Load as `load_views`, but return the errors of photos that cannot be read, by view name.

    Raises the first error if no photo can be read.
    """
    images: list[TrainingImage] = []
    errors: dict[str, DataError] = {}
    for view in views:
        try:
            images.append(_load_view(view, long_side))
        except DataError as error:
            errors[view.name] = error
    if errors and not images:
        raise next(iter(errors.values()))
    return images, errors


def _load_view(view: View, long_side: int) -> TrainingImage:
    photo = read_photo_of_view(view, by_profile=False)
    space = None if view.space or view.image is None else embedded_space(view.image)
    camera = view.camera
    small = camera.reduced(long_side)
    width, height = small.width, small.height
    opaque = photo.shape[-1] == 3 or bool((photo[..., 3] == 1).all())
    if opaque:
        photo = photo[..., :3]
    if camera.is_pinhole and (width, height) == (camera.width, camera.height):
        return TrainingImage(view, camera, _to_srgb(photo[..., :3], space), None if opaque else photo[..., 3], None)

    if not opaque:  # premultiply, so that colors of transparent pixels are not averaged in
        photo[..., :3] *= photo[..., 3:]
    if not camera.is_pinhole:  # shrink first: a lens map at full size costs more than all else
        camera = camera.scaled(min(camera.width, LENS_DETAIL * width), min(camera.height, LENS_DETAIL * height))
        photo = resize(photo, camera.width, camera.height)
    photo, pinhole, valid = undistort(photo, camera)
    photo = resize(photo, width, height)
    valid = resize(valid.astype(np.float32), width, height) > 0.999
    return TrainingImage(
        view,
        pinhole.scaled(width, height),
        _to_srgb(photo if opaque else unpremultiply(photo), space),
        None if opaque else photo[..., 3],
        None if valid.all() else valid,
    )


def _to_srgb(colors: np.ndarray, space: Space | None) -> np.ndarray:
    return colors if space is None else convert_to_srgb(colors, space)


def load_target_image(view: View, picture: Path, long_side: int) -> np.ndarray:
    """Read a painted or graded image of a view at the size of its training image, undistorted and over white.

    The image has distortion if it has the photo's size; of any other size it has none. Returns sRGB float32 [H, W, 3] in
    [0, 1]. Raises DataError if the image is missing or damaged, BadRequest if it has another aspect ratio than the view.
    """
    pixels, camera = read_photo(picture, space=view.space), view.camera.reduced(long_side)
    height, width = pixels.shape[:2]
    if (width, height) == (view.camera.width, view.camera.height):
        training_image = _load_view(replace(view, image=picture), long_side)
        return alpha_composite(training_image.color, training_image.alpha)
    if abs(width * camera.height / (height * camera.width) - 1) > ASPECT_TOLERANCE:
        raise BadRequest(
            f"{picture} has {width}x{height} pixels, the view {view.name!r} {view.camera.width}x{view.camera.height}.",
            "Give a picture of the whole view, of any size.",
        )
    alpha = pixels[..., 3] if pixels.shape[-1] == 4 else None
    return resize(alpha_composite(pixels[..., :3], alpha), camera.width, camera.height)


def read_photo_of_view(view: View, by_profile: bool = True) -> np.ndarray:
    """Read a view's photo in its camera's orientation, sRGB float32 [H, W, 3 or 4] in [0, 1] with straight alpha.

    See `read_photo` for `by_profile`. Raises DataError if the photo is missing, damaged or of another size than its camera.
    """
    path = photo_path(view)
    size, shape = (view.camera.height, view.camera.width), ()
    for upright in (True, False):
        photo = read_photo(path, upright, view.space, by_profile)
        if photo.shape[:2] == size:
            return photo
        shape = photo.shape
        del photo  # before the next one is read, to save memory
    raise wrong_size_error(path, shape[1], shape[0], view.camera)


def photo_path(view: View) -> Path:
    """Return the path of a view's photo. Raises DataError for a bare camera."""
    if view.image is None:
        raise DataError(f"View {view.name!r} is a bare camera without a photo.", "Give a capture with photos.")
    return view.image


def undistort(image: np.ndarray, camera: Camera) -> tuple[np.ndarray, Camera, np.ndarray]:
    """Undistort an image, float [H, W, 1, 3 or 4]; focal lengths, principal point and size stay.

    Returns the image (float32), its pinhole camera, and a mask of the pixels inside the photo, bool [H, W].
    """
    if camera.is_pinhole:
        return image, camera.without_distortion(), np.ones(image.shape[:2], bool)
    map_u, map_v, valid = lens_map(replace(camera, camera_to_world=np.eye(4)))
    image = image.astype(np.float32, copy=False)
    straight = cv2.remap(image, map_u, map_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return straight.reshape(image.shape), camera.without_distortion(), valid.copy()


@lru_cache(maxsize=2)  # most captures have one lens; the maps of a large photo take 100 MB
def lens_map(lens: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the remap tables that undistort photos of a lens at any one pose, and a mask of positions inside, all [H, W].

    The tables are columns and rows, float32, with pixel centers at integers.
    """
    width, height = lens.width, lens.height
    maps, valid = np.empty((2, height, width), np.float32), np.empty((height, width), bool)
    for top in range(0, height, LENS_ROWS):
        rows = slice(top, min(top + LENS_ROWS, height))
        v, u = np.mgrid[rows, 0:width] + 0.5
        distorted = distort(lens, np.stack([u, v], -1))
        valid[rows] = ((distorted >= 0) & (distorted <= (width, height))).all(-1)  # False for nan
        maps[:, rows] = np.moveaxis(np.nan_to_num(distorted, nan=-1.0), -1, 0) - 0.5
    return maps[0], maps[1], valid


def background_kind(photos: Sequence[np.ndarray]) -> str:
    """Classify the background of photos, float [H, W, 3 or 4] in [0, 1].

    Returns `alpha` (a matte, less than 1 somewhere), `black`, `white`, or `opaque` (a real background). Raises DataError
    if all photos are transparent everywhere.
    """
    if photos and all(photo.shape[-1] == 4 and not photo[..., 3].any() for photo in photos):
        raise DataError("All photos are transparent everywhere.", "Export them with their colors, or without alpha.")
    kinds = [_background_of(photo) for photo in photos]
    for kind in ("alpha", "black", "white"):
        if kinds and kinds.count(kind) >= VIEW_SHARE * len(kinds):
            return kind
    return "opaque"


def _background_of(photo: np.ndarray) -> str:
    if photo.shape[-1] == 4 and (photo[..., 3] < 1).any():
        return "alpha"
    border = np.concatenate([photo[0], photo[-1], photo[1:-1, 0], photo[1:-1, -1]])[:, :3]
    if (border.max(-1) <= BORDER_TOLERANCE).mean() >= BORDER_SHARE:
        return "black"
    if (border.min(-1) >= 1 - BORDER_TOLERANCE).mean() >= BORDER_SHARE:
        return "white"
    return "opaque"


def solid_pixels(color: np.ndarray, kind: str) -> np.ndarray:
    """Return the pixels of colors [H, W, 3] in [0, 1] that are certainly opaque, bool [H, W].

    Unlike mixed pixels at edges, they differ from the background `kind` nearly as much as their neighbors.
    """
    difference = color.max(-1) if kind == "black" else 1 - color.min(-1)
    return (difference > SOLID_DIFFERENCE) & (difference > 0.8 * maximum_filter(difference, 3))
