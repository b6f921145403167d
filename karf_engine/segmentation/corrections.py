"""Corrections: strokes that mark some pixels of a photo as an object or not, and leave all others open.

CORRECTIONS/<object>/<view>.png, as large as the photo, 8-bit gray with alpha: opaque white is the object, opaque black is
not, and where it is transparent the pixel is left open. They may lie on any view. A mask is what a hasty hand drew, and colors
may overrule it; a correction is an answer to what was seen, and nothing does.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..capture.camera import Camera
from ..capture.capture import Capture
from ..errors import DataError
from ..io.images import full_value, read_pixels
from .coarse_masks import CoarseMask, at_working_size, marks_of, object_folders

IS, IS_NOT = 1, -1
LEAST_COVER = 0.25  # share of a pixel that a stroke must cover: thin strokes must survive reducing the photo


def find_corrections(folder: Path, capture: Capture) -> list[CoarseMask]:
    """The corrections below a folder, by object and view; none where there is no such folder.

    Raises:
        DataError: as `coarse_masks.find_masks`, but for folders that are empty.
    """
    return [each for path in object_folders(folder) for each in marks_of(path, capture)] if folder.is_dir() else []


def load_correction(correction: CoarseMask, camera: Camera) -> np.ndarray:
    """A correction as one value for each pixel of its view.

    Args:
        correction: as large as the photo, or as the camera's picture.
        camera: the view's pinhole at the working size.

    Returns:
        [H, W] int8: `IS`, `IS_NOT`, or 0 where it leaves the pixel open.

    Raises:
        DataError: it has no alpha, is of another size, or damaged.
    """
    pixels, _ = read_pixels(correction.path, True)
    if pixels.ndim != 3 or pixels.shape[2] not in (2, 4):
        raise DataError(f"{correction.path} has no alpha: it says something of every pixel.", "Save gray with alpha.")
    half = full_value(pixels) / 2
    said, white = pixels[..., -1] > half, pixels[..., 0] > half
    drawn = (at_working_size(said & is_it, correction, camera) for is_it in (white, ~white))
    positive, negative = drawn
    result = np.where(positive >= negative, IS, IS_NOT)
    return np.where(np.maximum(positive, negative) >= LEAST_COVER, result, 0).astype(np.int8)
