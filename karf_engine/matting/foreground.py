"""The last step of mattes, at the photo's size: coverage of the pixels along borders, and the objects' own colors there."""

from __future__ import annotations

from itertools import product

import cv2
import numpy as np

from ..color import linear_to_srgb, srgb_to_linear, to_bytes
from .closed_form import closed_form_matting
from .matte import Matte

BORDER = 1.5  # pixels to either side of a border whose coverage is found by matting
CERTAIN = 0.99  # a label that high is no mixture, however near the border: a stem is all border
NEGLIGIBLE = 1 / 512  # coverage that cannot change an 8-bit pixel
WINDOWS = (1.5, 4.0, 12.0)  # standard deviations of the windows in which an object's color beside a pixel is looked for
LEAST_SEEN = 1e-3  # of a window that must be of the object
TILE, MARGIN = 1024, 32

LINEAR = srgb_to_linear(np.arange(256) / 255).astype(np.float32)


def object_mattes(photo: np.ndarray, classes: np.ndarray) -> list[Matte]:
    """Mattes from labels at the photo's size.

    Args:
        photo: uint8 [H, W, 3] sRGB.
        classes: [K+1, H, W] in [0, 1], class 0 being no object; the objects' become their coverage, in place.
    """
    n_objects = len(classes) - 1
    mixed: list[list[np.ndarray]] = [[] for _ in range(n_objects)]
    colors: list[list[np.ndarray]] = [[] for _ in range(n_objects)]
    height, width = photo.shape[:2]
    result = np.empty((n_objects, height, width), np.float16)
    for top, left in product(range(0, height, TILE), range(0, width, TILE)):
        outer = (slice(max(0, top - MARGIN), top + TILE + MARGIN), slice(max(0, left - MARGIN), left + TILE + MARGIN))
        inner = (
            slice(top - outer[0].start, top - outer[0].start + TILE),
            slice(left - outer[1].start, left - outer[1].start + TILE),
        )
        labels = classes[(slice(None), *outer)].astype(np.float32)
        if labels[0].min() == 1:
            result[:, top : top + TILE, left : left + TILE] = 0
            continue
        light = LINEAR[photo[outer]]
        covered = _coverage(light, labels)
        result[:, top : top + TILE, left : left + TILE] = covered[(slice(None), *inner)]
        for k, coverage in enumerate(covered):
            places, own = _own_colors(light, coverage, inner)
            mixed[k].append((places[:, 0] + top) * width + places[:, 1] + left)
            colors[k].append(own)
    parts = zip(result, mixed, colors, strict=True)
    return [_cropped(coverage, np.concatenate(places), np.concatenate(own)) for coverage, places, own in parts]


def _coverage(light: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Coverage [K, h, w] of the objects; light [h, w, 3] linear, labels [K+1, h, w]."""
    result = labels[1:].copy()
    for coverage in result:
        inside = coverage > 0.5
        if not inside.any() or inside.all():
            continue
        depth = cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        depth += cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        unknown = (depth <= BORDER) & (coverage < CERTAIN)
        guess = np.where(unknown, coverage, inside.astype(np.float32))
        coverage[:] = guess
        coverage[unknown] = closed_form_matting(light, guess, unknown)
    return result / np.maximum(result.sum(0), 1)


def _own_colors(light: np.ndarray, coverage: np.ndarray, inner: tuple[slice, slice]) -> tuple[np.ndarray, np.ndarray]:
    """Places [n, 2] (row, column, from the inner part's corner) of mixed pixels there, and their colors uint8 [n, 3].

    Where the object is seen pure nearby, that is its color, moved so that what stands behind keeps a color that exists.
    """
    mixed = (coverage > NEGLIGIBLE) & (coverage < 1 - NEGLIGIBLE)
    chosen = np.zeros_like(mixed)
    chosen[inner] = mixed[inner]
    places = np.argwhere(chosen)
    if not len(places):
        return places, np.zeros((0, 3), np.uint8)
    here, share = light[chosen], coverage[chosen][:, None]
    object_color, known = _color_nearby(light, coverage >= 1 - NEGLIGIBLE, chosen)
    behind, behind_known = _color_nearby(light, coverage <= NEGLIGIBLE, chosen)
    behind = np.where(behind_known[:, None], behind, here)
    # what the two colors leave unexplained is shared by how far each stands for the pixel (Germer et al. 2020, Eq. 9)
    rest = here - share * object_color - (1 - share) * behind
    own = object_color + share * rest / (share**2 + (1 - share) ** 2)
    own = np.where(known[:, None], own, here)
    return places - [inner[0].start, inner[1].start], to_bytes(linear_to_srgb(np.clip(own, 0, 1)))


def _color_nearby(light: np.ndarray, pure: np.ndarray, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean colors [n, 3] of the pure pixels about each chosen one, in the smallest window that has some; and which had."""
    result, known = np.zeros((int(chosen.sum()), 3), np.float32), np.zeros(int(chosen.sum()), bool)
    weighted = np.concatenate([light * pure[..., None], pure[..., None]], -1, dtype=np.float32)
    for deviation in WINDOWS:
        if known.all():
            break
        means = cv2.GaussianBlur(weighted, (0, 0), deviation)[chosen]
        found = ~known & (means[:, 3] > LEAST_SEEN)
        result[found] = means[found, :3] / means[found, 3:]
        known |= found
    return result, known


def _cropped(coverage: np.ndarray, mixed: np.ndarray, colors: np.ndarray) -> Matte:
    """The matte of a whole photo's coverage [H, W]; mixed: running numbers [n] of pixels of the photo."""
    seen = coverage > NEGLIGIBLE
    rows, columns = np.flatnonzero(seen.any(1)), np.flatnonzero(seen.any(0))
    if not len(rows):
        return Matte((0, 0), (0, 0), np.zeros((0, 0), np.float16), mixed[:0], colors[:0])
    top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
    row, column = np.divmod(mixed, coverage.shape[1])
    numbers = (row - top) * (right - left) + column - left
    order = np.argsort(numbers)
    return Matte((top, bottom), (left, right), coverage[top:bottom, left:right].copy(), numbers[order], colors[order])
