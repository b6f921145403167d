"""Rough masks as hints for mattes: where an object's thin parts are in their photo, and which objects have some."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from ...capture.camera import Camera
from ...capture.capture import View, mask_files, masks_of_view
from ...capture.training_images import undistort
from ...errors import DataError
from ...io.images import read_mask
from .distances import distance_to

THIN_WIDTH = 0.02  # of the photo's width: a wire and the brush stroke along it
THIN_LENGTH = 2.5  # of that width: longer than the corner of a hasty mask


@dataclass(frozen=True)
class Marks:
    """Rough masks of K objects, as hints for the mattes of one photo.

    Attributes:
        drawn: bool [K, H, W], the masks of this photo in its grid, at any size; None without any.
        thin: Whether a mask of each object, in this photo or another, has a thin part.
    """

    drawn: np.ndarray | None
    thin: tuple[bool, ...]


def read_marks(folder: Path, objects: Sequence[str], view: View) -> Marks:
    """Read a project's rough masks for a view, with its lens distortion.

    Args:
        folder: <object>/<view>.png, as segmentation reads them.
        objects: Names of the K objects.
        view: Of the capture.
    """
    thin = tuple(any(_is_thin(path) for path in mask_files(folder / name)) for name in objects)
    drawn = {k: paths[0] for k, name in enumerate(objects) if (paths := masks_of_view(folder / name, view))}
    if not drawn:
        return Marks(None, thin)
    size = view.camera.height, view.camera.width
    marks = np.zeros((len(objects), *size), bool)
    for k, path in drawn.items():
        marks[k] = _of_size(_read(path), size, view.camera.is_pinhole)
    return Marks(marks, thin)


def undistort_marks(marks: Marks, camera: Camera) -> Marks:
    """Undistort the marks of a camera's photo."""
    if marks.drawn is None or camera.is_pinhole:
        return marks
    planes = (undistort(mark[..., None].astype(np.float32), camera)[0][..., 0] for mark in marks.drawn)
    return Marks(np.stack([plane >= 0.5 for plane in planes]), marks.thin)


def has_thin_part(mask: np.ndarray) -> bool:
    """Return whether a mask, bool [H, W], has a part that is thin and long.

    Examples:
        >>> mask = np.zeros((100, 200), bool)
        >>> mask[20:60, 20:60] = True
        >>> has_thin_part(mask)
        False
        >>> mask[40, 60:90] = True
        >>> has_thin_part(mask)
        True
    """
    width = THIN_WIDTH * mask.shape[1]
    padded = np.pad(mask, 1)
    core = distance_to(~padded) > width / 2
    thin = padded & (distance_to(core) > width / 2)
    _, _, figures, _ = cv2.connectedComponentsWithStats(thin.astype(np.uint8))
    longest = figures[1:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(initial=0)
    return bool(longest >= THIN_LENGTH * width)


def _is_thin(path: Path) -> bool:
    try:
        file = path.stat()
    except OSError:  # deleted meanwhile
        return False
    return _is_thin_as_of(path, file.st_mtime_ns, file.st_size)


@lru_cache(maxsize=256)
def _is_thin_as_of(path: Path, changed: int, size: int) -> bool:
    return has_thin_part(_read(path))


def _read(path: Path) -> np.ndarray:
    try:
        return read_mask(path)
    except DataError:  # learning refuses it; recoloring works without it
        return np.zeros((1, 1), bool)


def _of_size(mask: np.ndarray, size: tuple[int, int], is_pinhole: bool) -> np.ndarray:
    """Resize a mask to its photo's size (rows, columns). Of a distorted camera, other sizes are undistorted: ignored."""
    if mask.shape == size:
        return mask
    if not is_pinhole:
        return np.zeros(size, bool)
    return cv2.resize(mask.astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST) > 0
