"""Thin parts of objects that the field misses, such as a leaf's tip or a wire, and rough masks as hints for them.

A pixel belongs to a lost part if the photo has the object's color there, the field renders no similar color nearby, and
it is connected with the object through its color. A neighbor of the same color is not lost: the field renders it.

The field may also render a part, but label it otherwise, such as a cable in front of a wall. There a rough mask of the
same photo decides: pixels under it belong to the object if they are thin and connected with it, at a lower color
probability since thin lines are mixed pixels; masks that spill over cover thick things too. In other photos, thin parts
are searched for objects with a thin part in any mask.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path

import cv2
import numpy as np

from ...capture.camera import Camera
from ...capture.capture import View, mask_files, masks_of_view
from ...capture.training_images import undistort
from ...errors import DataError
from ...io.images import read_mask
from .color_models import ColorModels, posterior
from .tiles import distance_to

THIN_WIDTH = 0.02  # of the photo's width: a wire and the brush stroke along it
THIN_LENGTH = 2.5  # of that width: longer than the corner of a hasty mask
REACH = 32  # from the object, pixels of the field's picture
NEARBY = 2  # pixels of the field's picture: tolerance for its blur and inexact poses
UNLIKE = 10.0  # Lab units: difference to all that the field renders nearby
HARDLY_LIKE = 4.0  # Lab units: the same, of pixels connected with such ones
LIKELY = 0.6  # probability of the object by color alone
MAX_AREA = 0.5  # of the object's area: larger losses are occluders
PROBABILITY = 0.5  # of lost pixels, before the random walk
THIN = 1.5  # pixels of the field's picture: largest half width of a thin part
MARKED_THIN = 2.0  # as THIN, under a mask
MARKED_LIKELY = 0.25  # as LIKELY, under a mask
THIN_PROBABILITY = 0.8  # as PROBABILITY, of thin parts


@dataclass(frozen=True)
class Marks:
    """Rough masks of K objects, as hints for the mattes of one photo."""

    drawn: np.ndarray | None  # bool [K, H, W], the masks of this photo in its grid, at any size
    thin: tuple[bool, ...]  # of each object, whether a mask in this photo or another has a thin part


def read_marks(folder: Path, objects: Sequence[str], view: View) -> Marks:
    """Read the rough masks `<object>/<view>.png` in a folder for a view, with its lens distortion."""
    thin = tuple(any(_has_thin_part(path) for path in mask_files(folder / name)) for name in objects)
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


def _has_thin_part(path: Path) -> bool:
    """Return whether a file's mask has a part that is thin and long."""
    try:
        file = path.stat()
    except OSError:  # deleted meanwhile
        return False
    return _has_thin_part_as_of(path, file.st_mtime_ns, file.st_size)


@lru_cache(maxsize=256)
def _has_thin_part_as_of(path: Path, changed: int, size: int) -> bool:
    mask = _read(path)
    width = THIN_WIDTH * mask.shape[1]
    padded = np.pad(mask, 1)
    core = distance_to(~padded) > width / 2
    thin = padded & (distance_to(core) > width / 2)
    _, _, figures, _ = cv2.connectedComponentsWithStats(thin.astype(np.uint8))
    longest = figures[1:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(initial=0)
    return bool(longest >= THIN_LENGTH * width)


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


def lost_parts(
    lab: np.ndarray,  # the photo, [h, w, 3] CIE Lab
    rendered: np.ndarray,  # the field's rendering, [h', w', 3] CIE Lab, of the same view at a smaller size
    labels: np.ndarray,  # [K+1, h, w], current labels of the photo; class 0 is the background
    models: ColorModels,
    marks: Marks,
) -> np.ndarray:
    """Find parts of objects that the field misses: their probabilities float32 [K, h, w], 0 in all other pixels."""
    scale = lab.shape[0] / rendered.shape[0]
    hard = labels.argmax(0)
    result = np.zeros((len(labels) - 1, *hard.shape), np.float32)
    for k, (mark, has_thin) in enumerate(zip(_drawn(marks, hard), marks.thin, strict=True), start=1):
        own = hard == k
        if not own.any():
            continue
        in_reach, widest = distance_to(own) <= REACH * scale, MARKED_THIN * scale
        # around a mask, too: thickness must be known there
        candidates = (hard == 0) & (in_reach | (distance_to(mark) <= 2 * widest))
        likelihood = np.zeros(own.shape, np.float32)
        places = (np.argwhere(candidates) + 0.5) / candidates.shape
        uniform = np.ones((models.shares.shape[2], len(places)), np.float32)
        likelihood[candidates] = posterior(models, lab[candidates], places, uniform)[k]
        like = in_reach & (likelihood > LIKELY)
        lost = _not_rendered(own, like, lab, rendered)
        thin = mark & _thin(own, likelihood > MARKED_LIKELY, widest)
        if has_thin:
            thin |= _thin(own, like, THIN * scale)
        for part, probability in ((lost, PROBABILITY), (_connected(own, thin), THIN_PROBABILITY)):
            if part.sum() <= MAX_AREA * own.sum():
                result[k - 1, part] = probability
    return result


def _drawn(marks: Marks, labels: np.ndarray) -> np.ndarray:
    if marks.drawn is None:
        return np.zeros((len(marks.thin), *labels.shape), bool)
    size = labels.shape[::-1]
    return np.stack(
        [cv2.resize(own.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0 for own in marks.drawn]
    )


def _not_rendered(own: np.ndarray, like: np.ndarray, lab: np.ndarray, rendered: np.ndarray) -> np.ndarray:
    """Return pixels of an object's color, connected with it, and unlike all that the field renders nearby."""
    like = _connected(own, like)
    difference = np.zeros_like(own, np.float32)
    difference[like] = difference_nearby(lab, rendered, like, NEARBY)
    _, parts = cv2.connectedComponents((difference > HARDLY_LIKE).astype(np.uint8))
    return like & np.isin(parts, np.unique(parts[difference > UNLIKE]))


def _thin(own: np.ndarray, like: np.ndarray, widest: float) -> np.ndarray:
    """Return pixels of an object's color where it and they together are at most twice `widest` wide."""
    core = distance_to(~(own | like)) > widest
    return like & (distance_to(core) > widest)


def _connected(own: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Return pixels of an object's color that are connected with it."""
    _, parts = cv2.connectedComponents((like | own).astype(np.uint8))
    return like & np.isin(parts, np.unique(parts[own]))


def difference_nearby(lab: np.ndarray, rendered: np.ndarray, chosen: np.ndarray, nearby: int) -> np.ndarray:
    """Return Lab differences [n] between n chosen pixels of a photo and the most similar rendered color around each.

    nearby: half size of the searched window, pixels of the rendering, which may be smaller than the photo.
    """
    size = np.array(rendered.shape[:2])
    rows, columns = (np.argwhere(chosen) * size / chosen.shape).astype(np.intp).T
    least = np.full(len(rows), np.inf, np.float32)
    for down, right in product(range(-nearby, nearby + 1), repeat=2):
        there = rendered[np.clip(rows + down, 0, size[0] - 1), np.clip(columns + right, 0, size[1] - 1)]
        least = np.minimum(least, np.linalg.norm(lab[chosen] - there, axis=-1))
    return least
