"""Which region of a photo a click means.

A random walk from the click gives each pixel a number that falls where neighbors differ. Of the regions inside its
level lines the one is taken whose border costs least for its size (a sweep cut, as in Andersen, Chung and Lang, "Local
graph partitioning using PageRank vectors", 2006): the links that it cuts, over a power of its area. The root would not
depend on the scale, and serves the first click; corrections are rather small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..random_walk import Link, random_walk
from .working import WorkingPhoto


@dataclass(frozen=True)
class RegionParameters:
    """What decides which region a click means. Chosen together on the first three captures of docs/benchmark.md's masks
    from clicks: the demo, `thin` and flower.

    Attributes:
        radius: Of a click, pixels.
        leak: Weight of every pixel's prior for the opposite of a click: the walk ends somewhere.
        edge: The same at the picture's edge: objects are mostly inside.
        leak_far: The same of a correction; grows with the distance.
        reach: A correction goes no farther, in depths of its click in what it corrects.
        least_depth: Of a click, pixels.
        levels: Lines that are compared.
        power: Of the area that a border's cost is divided by: the root does not depend on the scale.
        power_of_correction: The same for a correction, which is rather small.
        least_area: Of a region, in pictures.
        most_area: The same.
        most_added: By one click, in areas of the mask so far.
        most_removed: The same.
        always_added: In pictures, however small the mask is.
    """

    radius: int = 2
    leak: float = 1e-4
    edge: float = 0.02
    leak_far: float = 0.002
    reach: float = 8.0
    least_depth: float = 2.0
    levels: int = 120
    power: float = 0.5
    power_of_correction: float = 0.3
    least_area: float = 0.0008
    most_area: float = 0.7
    most_added: float = 3.0
    most_removed: float = 0.5
    always_added: float = 0.25


PARAMETERS = RegionParameters()


def meant_region(
    photo: WorkingPhoto, mask: np.ndarray, said: np.ndarray, click: tuple[float, float, bool]
) -> np.ndarray:
    """The region that a click adds to a mask, or takes from it.

    Args:
        photo: The photo.
        mask: bool [h, w], the object so far; may be empty.
        said: int8 [h, w], 1 where a click marked the object, 0 where it marked something else, else -1.
        click: (x, y, is_object) in pixels of the photo as stored, already in `said`.

    Returns:
        bool [h, w], the connected pixels that become the object, or not the object.
    """
    x, y, is_object = click
    own, same = photo.disk(x, y, PARAMETERS.radius), mask == is_object
    leak, within = np.full(photo.shape, PARAMETERS.leak), np.ones(photo.shape, bool)
    if is_object:
        leak[0], leak[-1], leak[:, 0], leak[:, -1] = PARAMETERS.edge, PARAMETERS.edge, PARAMETERS.edge, PARAMETERS.edge
    if mask.any():
        column, row = photo.place(x, y)
        depth = max(float(_depths(mask, is_object)[row, column]), PARAMETERS.least_depth)
        rows, columns = np.ogrid[: photo.shape[0], : photo.shape[1]]
        away = np.hypot(rows - row, columns - column) / depth
        leak, within = leak + PARAMETERS.leak_far * (away / depth) ** 2, away <= PARAMETERS.reach
    walk = _walk(photo.links, said, is_object, leak)
    candidates = (~same & (said != (not is_object)) & within) | own
    region = _cheapest(photo.links, walk, candidates, same & mask.any(), _most(mask, is_object))
    _, parts = cv2.connectedComponents((region | own).astype(np.uint8), connectivity=8)
    return np.isin(parts, np.unique(parts[own]))


def _depths(mask: np.ndarray, is_object: bool) -> np.ndarray:
    """How deep each pixel lies in what a click corrects; nothing of the object is beyond the picture."""
    if is_object:
        return cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    return cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]


def _walk(links: Sequence[Link], said: np.ndarray, is_object: bool, leak: np.ndarray) -> np.ndarray:
    """[h, w] in [0, 1]: 1 at clicks of this kind, 0 at those of the other."""
    free = said < 0
    walk = (said == is_object).astype(np.float32)
    walk[free] = random_walk(links, walk[None], free, leak[free])[0]
    return walk


def _most(mask: np.ndarray, is_object: bool) -> float:
    """Largest area of a region, pixels."""
    if not mask.any():
        return PARAMETERS.most_area * mask.size
    return (
        max(PARAMETERS.most_added * mask.sum(), PARAMETERS.always_added * mask.size)
        if is_object
        else PARAMETERS.most_removed * mask.sum()
    )


def _cheapest(
    links: Sequence[Link], walk: np.ndarray, candidates: np.ndarray, joined: np.ndarray, most: float
) -> np.ndarray:
    """The candidates inside the cheapest level line; a border with what it is joined to costs nothing."""
    values = np.sort(walk[candidates])
    least = min(max(4, PARAMETERS.least_area * walk.size), len(values))
    sizes = np.geomspace(least, max(least, min(most, len(values))), PARAMETERS.levels).astype(int)
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
    best = np.argmin(
        np.cumsum(cut)[:-1] / areas ** (PARAMETERS.power_of_correction if joined.any() else PARAMETERS.power)
    )
    return candidates & (walk > levels[best])
