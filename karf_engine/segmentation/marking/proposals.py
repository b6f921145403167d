"""Propose the mask of an object in one photo from a box, clicks or a lasso, without downloaded weights.

GrabCut segments the object in a box or lasso. Each click then adds or removes a region (`regions`), and GrabCut refines
the region's border. The rest of the mask stays, so a correction spoils nothing elsewhere. Clicked pixels have the class
of the click.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ...capture import open_capture
from ...capture.training_images import read_photo_of_view
from ...errors import BadRequest
from ...io.images import write_png
from ...io.names import is_file_name
from .prompts import Prompts
from .regions import CLICK_RADIUS, WorkingPhoto, region_of_click, working_photo

if TYPE_CHECKING:
    from .segment_anything import SegmentAnything

# OpenCV's values of a trimap: certainly background, certainly object, probably background, probably object
NOT, SURE, PERHAPS_NOT, PERHAPS = cv2.GC_BGD, cv2.GC_FGD, cv2.GC_PR_BGD, cv2.GC_PR_FGD
FRAME_ITERATIONS, CLICK_ITERATIONS = 3, 1  # of GrabCut
REFINED_WIDTH = 15  # pixels: the border is refined in a square of this side around each changed pixel


def fit_colors(colors: np.ndarray, trimap: np.ndarray, iterations: int) -> np.ndarray:
    """Return the object's mask, bool [h, w], by OpenCV's GrabCut. A trimap of one side only is returned as it is.

    colors: [h, w, 3] uint8. trimap: [h, w] uint8 of the four values above.
    """
    is_inside = (trimap & 1).astype(bool)
    if is_inside.all() or not is_inside.any():
        return is_inside
    cv2.setRNGSeed(0)  # photos are marked before there are settings with a seed
    mask, background, foreground = trimap.copy(), np.zeros((1, 65)), np.zeros((1, 65))
    no_frame = (0, 0, 0, 0)  # ignored with GC_INIT_WITH_MASK
    cv2.grabCut(colors, mask, no_frame, background, foreground, iterations, cv2.GC_INIT_WITH_MASK)
    return (mask & 1).astype(bool)


def propose(photo: np.ndarray, prompts: Prompts) -> np.ndarray:
    """Return the object's mask, bool [H, W]; see `Marker`."""
    return Marker(photo).propose(prompts)


class Marker:
    """Mark one photo, float sRGB [H, W, 3 or 4] in [0, 1]. Earlier clicks are cached: one more takes one step."""

    def __init__(self, photo: np.ndarray) -> None:
        self._height, self._width = photo.shape[:2]
        self._photo = working_photo(photo)
        self._steps: list[tuple[Prompts, np.ndarray]] = []  # of one object, each with one more click

    def propose(self, prompts: Prompts) -> np.ndarray:
        """Return the object's mask, bool [H, W]. Raises BadRequest where the prompts are empty or outside the photo."""
        prompts.check(self._width, self._height)
        mask = cv2.resize(self._mask(prompts).astype(np.float32), (self._width, self._height)) > 0.5
        for x, y, is_object in prompts.points:
            mask[int(y), int(x)] = is_object
        return mask

    def _mask(self, prompts: Prompts) -> np.ndarray:
        """Return the mask at the working size, reusing the steps that these prompts begin with."""
        steps = [
            Prompts(prompts.box, prompts.points[:count], prompts.lasso) for count in range(len(prompts.points) + 1)
        ]
        n_reused = 0
        while n_reused < min(len(steps), len(self._steps)) and self._steps[n_reused][0] == steps[n_reused]:
            n_reused += 1
        del self._steps[n_reused:]
        for step in steps[n_reused:]:
            mask = self._with_click(self._steps[-1][1], step) if self._steps else self._in_frame(step)
            self._steps.append((step, mask))
        return self._steps[-1][1]

    def _in_frame(self, prompts: Prompts) -> np.ndarray:
        """Return the object in the box and lasso; an empty mask without them."""
        frame = _frame(self._photo, prompts)
        if frame is None:
            return np.zeros(self._photo.shape, bool)
        return fit_colors(self._photo.colors, np.where(frame, PERHAPS, NOT).astype(np.uint8), FRAME_ITERATIONS)

    def _with_click(self, mask: np.ndarray, prompts: Prompts) -> np.ndarray:
        """Return the mask changed by the last click."""
        photo, click = self._photo, prompts.points[-1]
        clicked = np.full(photo.shape, -1, np.int8)
        for x, y, is_object in prompts.points:
            clicked[photo.disk(x, y, CLICK_RADIUS)] = is_object
        if not mask.any() and not click[2]:
            return mask
        region = region_of_click(photo, mask, clicked, click)
        changed = np.where(region, click[2], mask)
        trimap = np.where(clicked >= 0, clicked, np.where(changed, PERHAPS, PERHAPS_NOT)).astype(np.uint8)
        near = cv2.dilate(region.astype(np.uint8), np.ones((REFINED_WIDTH, REFINED_WIDTH))) > 0
        refined = np.where(near, fit_colors(photo.colors, trimap, CLICK_ITERATIONS), changed)
        result = _touching(refined, mask | (clicked == 1))
        for x, y, is_object in prompts.points:
            result[photo.pixel(x, y)[::-1]] = is_object
        return result


def _frame(photo: WorkingPhoto, prompts: Prompts) -> np.ndarray | None:
    """Return the intersection of box and lasso, bool [h, w]; None without them."""
    if prompts.box is None and prompts.lasso is None:
        return None
    frame, scale = np.ones(photo.shape, np.uint8), np.array(photo.scale)
    if prompts.box is not None:
        corners = np.rint(np.reshape(prompts.box, (2, 2)) * scale).astype(int)
        low, high = np.clip(corners, 0, photo.shape[::-1])
        high = np.maximum(high, low + 1)
        in_box = np.zeros_like(frame)
        in_box[low[1] : high[1], low[0] : high[0]] = 1
        frame &= in_box
    if prompts.lasso is not None:
        in_lasso = np.zeros_like(frame)
        cv2.fillPoly(in_lasso, [np.rint(np.array(prompts.lasso) * scale - 0.5).astype(np.int32)], 1)
        frame &= in_lasso
    return frame > 0


def _touching(mask: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the connected parts of a mask that touch the known pixels."""
    _, parts = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    return mask & np.isin(parts, np.unique(parts[mask & known]))


def make_marker(capture: Path | str, name: str, weights: Path | str | None = None) -> Marker | SegmentAnything:
    """Load a view for marking.

    weights: folder of a Segment Anything model, to use instead of GrabCut.

    Raises KarfError where the capture has no such view, its photo cannot be read, or the weights cannot be used.
    """
    photo = read_photo_of_view(open_capture(capture).view(name))
    if weights is None:
        return Marker(photo)
    from .segment_anything import SegmentAnything  # needs torch

    return SegmentAnything(photo, weights)


def write_mask(marker: Marker | SegmentAnything, prompts: Prompts, masks: Path, object_name: str, view: str) -> Path:
    """Write the proposed mask to MASKS/<object>/<view>.png and return the path.

    Raises BadRequest where the object's name cannot be a folder's, or the prompts are empty.
    """
    if not is_file_name(object_name):
        raise BadRequest(f"{object_name!r:.200} cannot be the name of a folder.", "Call the object by a plain name.")
    path = masks / object_name / f"{view}.png"
    write_png(path, marker.propose(prompts))
    return path
