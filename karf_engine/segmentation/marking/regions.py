"""Find the region of a photo that a click selects.

A random walk from the click gives each pixel a value that falls where neighbors differ. Among the regions inside its
level lines, the one with the smallest ratio of cut links to a power of its area is selected (a sweep cut, as in
Andersen, Chung and Lang, "Local graph partitioning using PageRank vectors", 2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ...io.color import srgb_to_lab, to_bytes
from ...io.images import alpha_composite, resize
from ..random_walk import Link, neighbor_links, random_walk

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
    walk = _walk(photo.links, clicked, is_object, leak)
    candidates = (~same & (clicked != (not is_object)) & within) | own
    region = _sweep_cut(photo.links, walk, candidates, same & mask.any(), _max_area(mask, is_object))
    _, parts = cv2.connectedComponents((region | own).astype(np.uint8), connectivity=8)
    return np.isin(parts, np.unique(parts[own]))


def _depths(mask: np.ndarray, is_object: bool) -> np.ndarray:
    """Return the distance of each pixel from the border that a click moves; an object ends at the picture's edge."""
    if is_object:
        return cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    return cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]


def _walk(links: Sequence[Link], clicked: np.ndarray, is_object: bool, leak: np.ndarray) -> np.ndarray:
    """Return the walk's values, [h, w] in [0, 1]: 1 at clicks of this kind, 0 at clicks of the other."""
    free = clicked < 0
    walk = (clicked == is_object).astype(np.float32)
    walk[free] = random_walk(links, walk[None], free, leak[free])[0]
    return walk


def _max_area(mask: np.ndarray, is_object: bool) -> float:
    if not mask.any():
        return MAX_AREA * mask.size
    return max(MAX_ADDED * mask.sum(), ALWAYS_ADDED * mask.size) if is_object else MAX_REMOVED * mask.sum()


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
