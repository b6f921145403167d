"""What rough masks say of the photo that they were drawn on, for its mattes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from ..capture.camera import Camera
from ..capture.capture import View
from ..capture.mask_names import masks_of_view
from ..capture.training_images import undistort
from ..errors import DataError
from ..io.images import read_mask


def marks_of(folder: Path, objects: Sequence[str], view: View) -> np.ndarray | None:
    """The rough masks of a view's photo.

    Args:
        folder: <object>/<view>.png, as segmentation reads them.
        objects: Names of the K objects.
        view: Of the capture.

    Returns:
        bool [K, H, W] of the size of the view's camera, with its lens; None where nothing is drawn on this photo.
    """
    size = view.camera.height, view.camera.width
    drawn = {k: masks_of_view(folder / name, view) for k, name in enumerate(objects)}
    if not any(drawn.values()):
        return None
    marks = np.zeros((len(objects), *size), bool)
    for k, paths in drawn.items():
        for path in paths[:1]:
            marks[k] = _of_size(_read(path), size, view.camera.is_pinhole)
    return marks


def straightened(marks: np.ndarray | None, camera: Camera) -> np.ndarray | None:
    """Marks [K, H, W] as the camera's pinhole shows them."""
    if marks is None or camera.is_pinhole:
        return marks
    planes = (undistort(mark[..., None].astype(np.float32), camera)[0][..., 0] for mark in marks)
    return np.stack([plane >= 0.5 for plane in planes])


def _read(path: Path) -> np.ndarray:
    try:
        return read_mask(path)
    except DataError:  # it is refused where something is learned from it; photos are recolored without it
        return np.zeros((1, 1), bool)


def _of_size(mask: np.ndarray, size: tuple[int, int], is_pinhole: bool) -> np.ndarray:
    """A mask at the size (rows, columns) of its photo. A smaller one is a pinhole's: it says nothing of a lens's picture."""
    if mask.shape == size:
        return mask
    if not is_pinhole:
        return np.zeros(size, bool)
    return cv2.resize(mask.astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST) > 0
