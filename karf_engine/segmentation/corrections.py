"""Read corrections: strokes that mark some pixels of a photo as an object or not, and leave the others open.

CORRECTIONS/<object>/<view>.png, as large as the photo, 8-bit gray with alpha: opaque white is the object, opaque black is
not, transparent pixels are open. Any view may have them. Colors may overrule a mask, but never a correction.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..capture.camera import Camera
from ..capture.capture import Capture
from ..errors import DataError
from ..io.images import read_pixels, white_level
from .coarse_masks import CoarseMask, masks_of_object, object_folders, to_working_size

OBJECT, NOT_OBJECT = 1, -1
MIN_COVERAGE = 0.25  # of a pixel by a stroke: thin strokes must survive the reduction of the photo


def find_corrections(folder: Path, capture: Capture) -> list[CoarseMask]:
    """Return the corrections below a folder, by object and view; none where the folder is missing.

    Raises:
        DataError: as for `coarse_masks.find_masks`, except that folders may be empty.
    """
    return (
        [each for path in object_folders(folder) for each in masks_of_object(path, capture)] if folder.is_dir() else []
    )


def load_correction(correction: CoarseMask, camera: Camera) -> np.ndarray:
    """Return `OBJECT`, `NOT_OBJECT` or 0 (open) for each pixel of a view, [H, W] int8.

    Args:
        correction: as large as the photo, or as the camera's picture.
        camera: the view's pinhole at the working size.

    Raises:
        DataError: the file has no alpha, is of another size, or damaged.
    """
    pixels, _ = read_pixels(correction.path, True)
    if pixels.ndim != 3 or pixels.shape[2] not in (2, 4):
        raise DataError(f"{correction.path} has no alpha: it says something of every pixel.", "Save gray with alpha.")
    half = white_level(pixels) / 2
    opaque, white = pixels[..., -1] > half, pixels[..., 0] > half
    positive, negative = (to_working_size(opaque & kind, correction, camera) for kind in (white, ~white))
    strokes = np.where(positive >= negative, OBJECT, NOT_OBJECT)
    return np.where(np.maximum(positive, negative) >= MIN_COVERAGE, strokes, 0).astype(np.int8)
