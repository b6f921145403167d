"""From a box, clicks or a lasso to the mask of an object in one photo, without downloaded weights: the way in.

A box or a lasso is filled by GrabCut. Each click then means a region (`regions`), that the mask gains or loses, and the
colors along its border are fitted once more. What lies elsewhere stays, so that a correction makes nothing worse that
was right, and each pixel that was clicked is what the click marked.
"""

from __future__ import annotations

import cv2
import numpy as np

from .grabcut import NOT, PERHAPS, PERHAPS_NOT, fit_colors
from .prompts import Prompts
from .regions import PARAMETERS, meant_region
from .working import WorkingPhoto, working_photo

FITS_OF_FRAME, FITS_OF_CLICK = 3, 1  # iterations of GrabCut for a frame and for a click
NEAR = 15  # pixels: colors are fitted once more in this square about what a click has changed


def propose(photo: np.ndarray, prompts: Prompts) -> np.ndarray:
    """The mask of the object that prompts mean, bool [H, W], see `Marker`."""
    return Marker(photo).propose(prompts)


class Marker:
    """One photo that is being marked. What was found for earlier clicks is kept: one more takes one step.

    Args:
        photo: Float sRGB [H, W, 3 or 4] in [0, 1], straight alpha.
    """

    def __init__(self, photo: np.ndarray) -> None:
        self._height, self._width = photo.shape[:2]
        self._photo = working_photo(photo)
        self._steps: list[tuple[Prompts, np.ndarray]] = []  # of one object: each with one more click than the last

    def propose(self, prompts: Prompts) -> np.ndarray:
        """The mask of the object that the prompts mean.

        Args:
            prompts: In pixels of the photo.

        Returns:
            bool [H, W].

        Raises:
            BadRequest: The prompts lie outside the photo, or are empty.
        """
        prompts.check(self._width, self._height)
        mask = cv2.resize(self._found(prompts).astype(np.float32), (self._width, self._height)) > 0.5
        for x, y, is_object in prompts.points:
            mask[int(y), int(x)] = is_object
        return mask

    def _found(self, prompts: Prompts) -> np.ndarray:
        """The mask at the working size, from the last step on that these prompts begin with."""
        begun = [
            Prompts(prompts.box, prompts.points[:count], prompts.lasso) for count in range(len(prompts.points) + 1)
        ]
        known = 0
        while known < min(len(begun), len(self._steps)) and self._steps[known][0] == begun[known]:
            known += 1
        del self._steps[known:]
        for step in begun[known:]:
            found = self._with_click(self._steps[-1][1], step) if self._steps else self._filled(step)
            self._steps.append((step, found))
        return self._steps[-1][1]

    def _filled(self, prompts: Prompts) -> np.ndarray:
        """The object in a box and lasso; nothing without them."""
        frame = _frame(self._photo, prompts)
        if frame is None:
            return np.zeros(self._photo.shape, bool)
        return fit_colors(self._photo.colors, np.where(frame, PERHAPS, NOT).astype(np.uint8), FITS_OF_FRAME)

    def _with_click(self, mask: np.ndarray, prompts: Prompts) -> np.ndarray:
        """A mask corrected by the last click."""
        photo, click = self._photo, prompts.points[-1]
        said = np.full(photo.shape, -1, np.int8)
        for x, y, is_object in prompts.points:
            said[photo.disk(x, y, PARAMETERS.radius)] = is_object
        if not mask.any() and not click[2]:
            return mask
        region = meant_region(photo, mask, said, click)
        changed = np.where(region, click[2], mask)
        trimap = np.where(said >= 0, said, np.where(changed, PERHAPS, PERHAPS_NOT)).astype(np.uint8)
        near = cv2.dilate(region.astype(np.uint8), np.ones((NEAR, NEAR))) > 0
        fitted = np.where(near, fit_colors(photo.colors, trimap, FITS_OF_CLICK), changed)
        kept = _touching(fitted, mask | (said == 1))
        for x, y, is_object in prompts.points:
            kept[photo.place(x, y)[::-1]] = is_object
        return kept


def _frame(photo: WorkingPhoto, prompts: Prompts) -> np.ndarray | None:
    """Inside of box and lasso, bool [h, w]; None without them."""
    frame = np.ones(photo.shape, np.uint8)
    scale = np.array(photo.scale)
    if prompts.box is not None:
        corners = np.rint(np.reshape(prompts.box, (2, 2)) * scale).astype(int)
        low, high = np.clip(corners, 0, photo.shape[::-1])
        high = np.maximum(high, low + 1)
        outside = np.ones_like(frame)
        outside[low[1] : high[1], low[0] : high[0]] = 0
        frame[outside > 0] = 0
    if prompts.lasso is not None:
        drawn = np.zeros_like(frame)
        cv2.fillPoly(drawn, [np.rint(np.array(prompts.lasso) * scale - 0.5).astype(np.int32)], 1)
        frame &= drawn
    return None if prompts.box is None and prompts.lasso is None else frame > 0


def _touching(mask: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The parts of a mask that meet what was known before."""
    _, parts = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    return mask & np.isin(parts, np.unique(parts[mask & known]))
