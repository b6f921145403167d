"""Propose the mask of an object in one photo from a box, clicks or a lasso, without downloaded weights.

GrabCut segments the object in a box or lasso. Each click then adds or removes a region, and GrabCut refines the
region's border. The rest of the mask stays, so a correction spoils nothing elsewhere. Clicked pixels have the class of
the click.

A random walk from the click gives each pixel a value that falls where neighbors differ. Among the regions inside its
level lines, the one with the smallest ratio of cut links to a power of its area is selected (a sweep cut, as in
Andersen, Chung and Lang, "Local graph partitioning using PageRank vectors", 2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ...capture import open_capture
from ...capture.training_images import read_photo_of_view
from ...errors import BadRequest
from ...io.color import srgb_to_lab, to_bytes
from ...io.images import alpha_composite, resize, write_png
from ...io.names import is_file_name
from ..random_walk import Link, neighbor_links, random_walk
from .prompts import Prompts

if TYPE_CHECKING:
    from .segment_anything import SegmentAnything

# OpenCV's values of a trimap: certainly background, certainly object, probably background, probably object
NOT, SURE, PERHAPS_NOT, PERHAPS = cv2.GC_BGD, cv2.GC_FGD, cv2.GC_PR_BGD, cv2.GC_PR_FGD
FRAME_ITERATIONS, CLICK_ITERATIONS = 3, 1  # of GrabCut
REFINED_WIDTH = 15  # pixels: the border is refined in a square of this side around each changed pixel
LONG_SIDE = 256  # pixels; a click takes a fifth of a second
# tuned together on three captures
LIKENESS = 0.1  # per squared Lab unit
CLICK_RADIUS = 2  # pixels
LEAK, EDGE_LEAK = 1e-4, 0.02  # prior weights of the class that was not clicked, inside and at the picture's edge
FAR_LEAK = 0.002  # the same for corrections, times the squared distance in depths of the click, over the depth squared
REACH = 8.0  # of a correction, in depths of its click below the border that it moves
N_LEVELS = 120
POWER, CORRECTION_POWER = 0.5, 0.3  # of the area; 1/2 is invariant to scale, less favors small regions
MIN_AREA, MAX_AREA = 0.0008, 0.7  # of a region, relative to the picture
MAX_ADDED, MAX_REMOVED = 3.0, 0.5  # by one click, relative to the mask
ALWAYS_ADDED = 0.25  # relative to the picture: allowed however small the mask is


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
        """Return the object in the intersection of box and lasso; an empty mask without them."""
        if prompts.box is None and prompts.lasso is None:
            return np.zeros(self._photo.shape, bool)
        frame, scale = np.ones(self._photo.shape, np.uint8), np.array(self._photo.scale)
        if prompts.box is not None:
            corners = np.rint(np.reshape(prompts.box, (2, 2)) * scale).astype(int)
            low, high = np.clip(corners, 0, self._photo.shape[::-1])
            high = np.maximum(high, low + 1)
            in_box = np.zeros_like(frame)
            in_box[low[1] : high[1], low[0] : high[0]] = 1
            frame &= in_box
        if prompts.lasso is not None:
            in_lasso = np.zeros_like(frame)
            cv2.fillPoly(in_lasso, [np.rint(np.array(prompts.lasso) * scale - 0.5).astype(np.int32)], 1)
            frame &= in_lasso
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
        _, parts = cv2.connectedComponents(refined.astype(np.uint8), connectivity=8)
        result = refined & np.isin(parts, np.unique(parts[refined & (mask | (clicked == 1))]))
        for x, y, is_object in prompts.points:
            result[photo.pixel(x, y)[::-1]] = is_object
        return result


@dataclass(frozen=True)
class WorkingPhoto:
    """A photo of [h, w] pixels at the working size, with the links between its pixels."""

    colors: np.ndarray  # [h, w, 3] uint8 sRGB
    links: tuple[Link, ...]
    scale: tuple[float, float]  # (x, y), working pixels per pixel of the photo

    @property
    def shape(self) -> tuple[int, int]:
        height, width, _ = self.colors.shape
        return height, width

    def disk(self, x: float, y: float, radius: int) -> np.ndarray:
        """Return a disk around a point of the stored photo, bool [h, w]."""
        column, row = self.pixel(x, y)
        rows, columns = np.ogrid[: self.shape[0], : self.shape[1]]
        return (rows - row) ** 2 + (columns - column) ** 2 <= radius**2

    def pixel(self, x: float, y: float) -> tuple[int, int]:
        """Return column and row of the pixel at a point of the stored photo."""
        return int(x * self.scale[0]), int(y * self.scale[1])


def working_photo(photo: np.ndarray) -> WorkingPhoto:
    """Reduce a photo to the working size; small ones keep theirs. photo: float sRGB [H, W, 3 or 4], straight alpha."""
    height, width = photo.shape[:2]
    factor = min(1.0, LONG_SIDE / max(height, width))
    size = max(1, round(width * factor)), max(1, round(height * factor))
    alpha = resize(photo[..., 3], *size) if photo.shape[-1] == 4 else None
    colors = alpha_composite(resize(photo[..., :3], *size), alpha)
    links = tuple(neighbor_links(srgb_to_lab(colors).astype(np.float32), LIKENESS))
    return WorkingPhoto(to_bytes(colors), links, (size[0] / width, size[1] / height))


def region_of_click(
    photo: WorkingPhoto, mask: np.ndarray, clicked: np.ndarray, click: tuple[float, float, bool]
) -> np.ndarray:
    """Return the connected region that a click adds to a mask or removes from it, bool [h, w].

    mask: bool [h, w], the object so far; may be empty. clicked: int8 [h, w], 1 at clicks on the object, 0 at clicks on
    something else, -1 elsewhere. click: (x, y, is_object) in pixels of the photo as stored, contained in `clicked`.
    """
    x, y, is_object = click
    own, same = photo.disk(x, y, CLICK_RADIUS), mask == is_object
    leak, within = np.full(photo.shape, LEAK), np.ones(photo.shape, bool)
    if is_object:  # objects are mostly inside the picture
        leak[0] = leak[-1] = leak[:, 0] = leak[:, -1] = EDGE_LEAK
    if mask.any():
        column, row = photo.pixel(x, y)
        depth = max(float(_depths(mask, is_object)[row, column]), 2.0)
        rows, columns = np.ogrid[: photo.shape[0], : photo.shape[1]]
        away = np.hypot(rows - row, columns - column) / depth
        leak, within = leak + FAR_LEAK * (away / depth) ** 2, away <= REACH
    free = clicked < 0
    walk = (clicked == is_object).astype(np.float32)  # 1 at clicks of this kind, 0 at clicks of the other
    walk[free] = random_walk(photo.links, walk[None], free, leak[free])[0]
    candidates = (~same & (clicked != (not is_object)) & within) | own
    max_area = MAX_AREA * mask.size
    if mask.any():
        max_area = max(MAX_ADDED * mask.sum(), ALWAYS_ADDED * mask.size) if is_object else MAX_REMOVED * mask.sum()
    region = _sweep_cut(photo.links, walk, candidates, same & mask.any(), max_area)
    _, parts = cv2.connectedComponents((region | own).astype(np.uint8), connectivity=8)
    return np.isin(parts, np.unique(parts[own]))


def _depths(mask: np.ndarray, is_object: bool) -> np.ndarray:
    """Return the distance of each pixel from the border that a click moves; an object ends at the picture's edge."""
    if is_object:
        return cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    return cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]


def _sweep_cut(
    links: Sequence[Link], walk: np.ndarray, candidates: np.ndarray, joined: np.ndarray, max_area: float
) -> np.ndarray:
    """Return the candidates inside the cheapest level line; links to the pixels that they join cost nothing."""
    values = np.sort(walk[candidates])
    min_area = min(max(4, MIN_AREA * walk.size), len(values))
    sizes = np.geomspace(min_area, max(min_area, min(max_area, len(values))), N_LEVELS).astype(int)
    levels = np.unique(values[len(values) - sizes])
    levels = levels[(levels > 0) & (levels < values[-1])]
    if not len(levels):
        return candidates & (walk > 0)
    height = np.where(joined, 2, np.where(candidates, walk, 0))
    cut = np.zeros(len(levels) + 1)
    for here, there, link in links:
        low, high = np.minimum(height[here], height[there]), np.maximum(height[here], height[there])
        differs = low < high
        cut += np.bincount(np.searchsorted(levels, low[differs]), link[differs], len(cut))
        cut -= np.bincount(np.searchsorted(levels, high[differs]), link[differs], len(cut))
    areas = len(values) - np.searchsorted(values, levels, side="right")
    power = CORRECTION_POWER if joined.any() else POWER
    best = np.argmin(np.cumsum(cut)[:-1] / areas**power)
    return candidates & (walk > levels[best])


def make_marker(capture: Path | str, name: str, weights: Path | str | None = None) -> Marker | SegmentAnything:
    """Load a view for marking; `weights` is the folder of a Segment Anything model, to use instead of GrabCut.

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
