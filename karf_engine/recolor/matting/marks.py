"""What rough masks say to a photo's mattes: where thin parts are in their own photo, and which objects have some."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from ...capture.camera import Camera
from ...capture.capture import View
from ...capture.mask_names import mask_files, masks_of_view
from ...capture.training_images import undistort
from ...errors import DataError
from ...io.images import read_mask
from .distances import distance_to


@dataclass(frozen=True)
class ThinMaskParameters:
    """What a thin part of a rough mask is. Chosen on masks of the demo, thin scenes 0 and 1 and drawn seeds 0 to 7 and 20 to 22.

    Attributes:
        width: Of the photo's width, up to which a part is thin: a wire and the brush that followed it.
        length: Of that width, from which it is more than a corner of a hasty mask.
    """

    width: float = 0.02
    length: float = 2.5


PARAMETERS = ThinMaskParameters()


@dataclass(frozen=True)
class Marks:
    """What rough masks of K objects say to the mattes of one photo.

    Attributes:
        drawn: bool [K, H, W], on this photo and in its grid, of any size; None where nothing is.
        thin: Of each object, whether a mask shows a thin part of it, on this photo or another.
    """

    drawn: np.ndarray | None
    thin: tuple[bool, ...]


def marks_of(folder: Path, objects: Sequence[str], view: View) -> Marks:
    """What the rough masks of a project say to a view's photo, with its lens.

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


def straightened(marks: Marks, camera: Camera) -> Marks:
    """Marks of a camera's photo as its pinhole shows them."""
    if marks.drawn is None or camera.is_pinhole:
        return marks
    planes = (undistort(mark[..., None].astype(np.float32), camera)[0][..., 0] for mark in marks.drawn)
    return Marks(np.stack([plane >= 0.5 for plane in planes]), marks.thin)


def has_thin_part(mask: np.ndarray) -> bool:
    """Whether a mask, bool [H, W], has a part that is thin and long.

    Examples:
        A blob alone, and with a line from it:

        >>> mask = np.zeros((100, 200), bool)
        >>> mask[20:60, 20:60] = True
        >>> has_thin_part(mask)
        False
        >>> mask[40, 60:90] = True
        >>> has_thin_part(mask)
        True
    """
    width = PARAMETERS.width * mask.shape[1]
    padded = np.pad(mask, 1)
    core = distance_to(~padded) > width / 2
    thin = padded & (distance_to(core) > width / 2)
    _, _, figures, _ = cv2.connectedComponentsWithStats(thin.astype(np.uint8))
    longest = figures[1:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(initial=0)
    return bool(longest >= PARAMETERS.length * width)


def _is_thin(path: Path) -> bool:
    try:
        file = path.stat()
    except OSError:  # erased in this moment
        return False
    return _is_thin_as_of(path, file.st_mtime_ns, file.st_size)


@lru_cache(maxsize=256)
def _is_thin_as_of(path: Path, changed: int, size: int) -> bool:
    return has_thin_part(_read(path))


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
