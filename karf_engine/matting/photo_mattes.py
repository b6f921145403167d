"""Mattes of a photo at its own size: the field says roughly where the objects are, the photo exactly where.

First, at the field's picture size, each pixel near an object is asked twice: how probable the field finds each class
there, and how well the pixel's color fits the class about that place. Then the answer is carried up to the photo's size
in steps of two: labels far from any border are enlarged as they are, those near one are decided again at every step.
"""

from __future__ import annotations

from functools import partial
from itertools import product

import cv2
import numpy as np

from .color_models import ColorModels, fit_color_models
from .foreground import object_mattes
from .matte import Matte
from .random_walk import random_walk

BAND = 6  # how far from an object's border of the field its border in the photo may lie, pixels of the field's picture
RING = 25  # how far around objects their surroundings' colors are looked at, pixels of the field's picture
CORE = 1.0  # deeper than so many pixels inside an object, the field is right where it is SURE
SURE, NONE = 0.8, 0.02  # probability of what is surely an object; and at most, of surely none
LEAST_PROBABILITY = 0.005  # the field never outvotes a color altogether
LEAST_CORE = 20  # pixels from which colors can be told
TRUST = 0.05  # of a pixel's own opinion, see random_walk
STEP_BAND = 3  # pixels about a border that are decided again after each enlargement
DECIDED = 0.98
LEAST_CARRIED = 0.05  # of a class near the border, when an enlarged label is asked again
TILE, MARGIN = 512, 16


def refine_mattes(photo: np.ndarray, probabilities: np.ndarray, depth: np.ndarray | None = None) -> list[Matte]:
    """Mattes of K objects from the field's soft answer and the photo.

    Args:
        photo: uint8 [H, W, 3] sRGB.
        probabilities: [K, h, w] float32 of the objects, of the field, on the photo's own grid, h <= H and w <= W.

    Returns:
        One matte for each object.
    """
    height, width = probabilities.shape[1:]
    lab = lab_of(_resized(photo, height, width))
    classes, models = decide(lab, probabilities)
    for step in steps(probabilities.shape[1:], photo.shape[:2])[1:]:
        classes = sharpen(_resized(photo, *step), classes, models)
    return object_mattes(photo, classes)


def steps(start: tuple[int, int], end: tuple[int, int]) -> list[tuple[int, int]]:
    """Sizes (rows, columns) from one to the other, each at most twice the one before."""
    count = int(np.ceil(np.log2(max(end[0] / start[0], end[1] / start[1], 1)) - 1e-9))
    ratio = np.array(end) / start
    between = [tuple(np.rint(start * ratio ** (n / count)).astype(int).tolist()) for n in range(1, count)]
    return [tuple(start), *between, *([tuple(end)] if tuple(end) != tuple(start) else [])]


def decide(lab: np.ndarray, probabilities: np.ndarray) -> tuple[np.ndarray, ColorModels]:
    """Classes [K+1, h, w] at the field's picture size, class 0 being no object, and the colors that they have."""
    classes = np.concatenate([np.clip(1 - probabilities.sum(0), 0, 1)[None], probabilities])
    hard = classes.argmax(0)
    masks = [hard == k for k in range(1, len(classes))]
    cores = [_core(mask, own) for mask, own in zip(masks, probabilities, strict=True)]
    away = np.stack([_distance(~mask) for mask in masks])
    nearest = away.min(0)
    surroundings = (probabilities.sum(0) < NONE) & (nearest < RING)
    models = fit_color_models(lab, np.stack([surroundings, *cores]), np.random.default_rng(0))
    free = (nearest <= BAND) & ~np.any(cores, 0)
    priors = np.maximum(classes, LEAST_PROBABILITY)
    priors[1:][away > BAND] = 0
    opinions = np.stack([~np.any(cores, 0), *cores]).astype(np.float32)
    opinions[:, free] = _posterior(models, lab[free], _places(free), priors[:, free])
    opinions[:, free] = random_walk(lab, opinions, free, TRUST)
    return opinions, models


def sharpen(photo: np.ndarray, classes: np.ndarray, models: ColorModels) -> np.ndarray:
    """Classes [K+1, H, W] float16 at the size of a photo, uint8 [H, W, 3], from those [K+1, h, w] of a smaller size."""
    height, width = photo.shape[:2]
    result = np.empty((len(classes), height, width), np.float16)
    for top, left in product(range(0, height, TILE), range(0, width, TILE)):
        rows = slice(max(0, top - MARGIN), min(height, top + TILE + MARGIN))
        columns = slice(max(0, left - MARGIN), min(width, left + TILE + MARGIN))
        tile = _enlarged(classes, (height, width), rows, columns)
        free = _near_border(tile)
        if free.any():
            lab = lab_of(photo[rows, columns])
            places = (np.argwhere(free) + [rows.start + 0.5, columns.start + 0.5]) / [height, width]
            tile[:, free] = _posterior(models, lab[free], places, np.maximum(tile[:, free], LEAST_CARRIED))
            tile[:, free] = random_walk(lab, tile, free, TRUST)
        inner = (
            slice(None),
            slice(top - rows.start, top - rows.start + TILE),
            slice(left - columns.start, left - columns.start + TILE),
        )
        result[:, top : top + TILE, left : left + TILE] = tile[inner]
    return result


def _enlarged(classes: np.ndarray, size: tuple[int, int], rows: slice, columns: slice) -> np.ndarray:
    """A part [C, h, w] float32 of classes [C, .., ..] at a larger size, interpolated linearly."""
    down, across = classes.shape[1] / size[0], classes.shape[2] / size[1]
    # pixel centers lie at halves: of the part's first pixel at (rows.start + 0.5) * down - 0.5 in the smaller picture
    to_source = np.array(
        [[across, 0, (columns.start + 0.5) * across - 0.5], [0, down, (rows.start + 0.5) * down - 0.5]]
    )
    shape = (columns.stop - columns.start, rows.stop - rows.start)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    warp = partial(cv2.warpAffine, M=to_source, dsize=shape, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return np.stack([warp(plane.astype(np.float32)) for plane in classes])


def _near_border(classes: np.ndarray) -> np.ndarray:
    top = classes.max(0)
    unsure = top < DECIDED
    kernel = np.ones((2 * STEP_BAND + 1,) * 2, np.uint8)
    hard = classes.argmax(0).astype(np.uint8)
    border = cv2.dilate(hard, kernel) != cv2.erode(hard, kernel)
    return unsure | border


def _posterior(models: ColorModels, lab: np.ndarray, places: np.ndarray, priors: np.ndarray) -> np.ndarray:
    """Probabilities [C, n] of classes from colors [n, 3] at places [n, 2] and prior probabilities [C, n]."""
    with np.errstate(divide="ignore"):
        logs = models.log_densities(lab, places).T + np.log(priors)
    odds = np.exp(logs - logs.max(0))
    return (odds / odds.sum(0)).astype(np.float32)


def _places(chosen: np.ndarray) -> np.ndarray:
    return (np.argwhere(chosen) + 0.5) / chosen.shape


def _core(mask: np.ndarray, probability: np.ndarray) -> np.ndarray:
    core = mask & (probability > SURE) & (_distance(mask) > CORE)
    if core.sum() >= LEAST_CORE or not mask.any():
        return core
    return mask & (probability >= np.median(probability[mask]))  # a thin or small object has no deeper pixels


def _distance(inside: np.ndarray) -> np.ndarray:
    """Pixels to the nearest one outside."""
    if inside.all():
        return np.full(inside.shape, np.inf, np.float32)
    return cv2.distanceTransform(inside.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def lab_of(photo: np.ndarray) -> np.ndarray:
    """CIE Lab float32 [h, w, 3] of uint8 sRGB."""
    return cv2.cvtColor(photo.astype(np.float32) / 255, cv2.COLOR_RGB2LAB)


def _resized(photo: np.ndarray, height: int, width: int) -> np.ndarray:
    if photo.shape[:2] == (height, width):
        return photo
    return cv2.resize(photo, (width, height), interpolation=cv2.INTER_AREA)
