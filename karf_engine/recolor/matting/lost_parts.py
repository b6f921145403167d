"""Thin parts of objects that the field has lost: a leaf's tip, a wire.

A pixel belongs to such a part where the photo has the object's color, the field shows nothing like it thereabouts, and
the way to the object leads through its color. A neighbor of the same color is not a lost part, for the field shows it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np

from .color_models import ColorModels, posterior
from .distances import distance_to


@dataclass(frozen=True)
class LostPartParameters:
    """What tells that a pixel is a part of an object that the field has lost. Set together, when lost parts were first
    looked for; not varied one by one on record.

    Attributes:
        reach: From the object, pixels of the field's picture.
        nearby: Pixels of the field's picture round a pixel in which the field may show its color all the same: it is
            blurred, and poses are not exact.
        unlike: Lab units between a pixel and all that the field shows nearby.
        hardly_like: The same in pixels that are connected with such ones.
        likely: Probability of the object from the color alone.
        most: Share of the object's area; an object that lost more has another one before it.
    """

    reach: float = 32
    nearby: int = 2
    unlike: float = 10.0
    hardly_like: float = 4.0
    likely: float = 0.6
    most: float = 0.5


PARAMETERS = LostPartParameters()


def lost_parts(lab: np.ndarray, rendered: np.ndarray, labels: np.ndarray, models: ColorModels) -> np.ndarray:
    """Parts of objects that the field has lost.

    Args:
        lab: The photo, [h, w, 3] CIE Lab.
        rendered: The scene as the field shows it, [h', w', 3] CIE Lab, on the same grid, smaller.
        labels: [K+1, h, w] of the photo's pixels as they are so far, class 0 being the background.
        models: Colors of the classes.

    Returns:
        bool [K, h, w].
    """
    scale = lab.shape[0] / rendered.shape[0]
    hard = labels.argmax(0)
    result = np.zeros((len(labels) - 1, *hard.shape), bool)
    for k, lost in enumerate(result, start=1):
        own = hard == k
        if not own.any():
            continue
        away = distance_to(own)
        asked = (hard == 0) & (away <= PARAMETERS.reach * scale)
        like = np.zeros_like(own)
        like[asked] = _looks_like(k, lab, asked, models)
        _, parts = cv2.connectedComponents((like | own).astype(np.uint8))
        like &= np.isin(parts, np.unique(parts[own]))
        difference = np.zeros(own.shape, np.float32)
        difference[like] = difference_nearby(lab, rendered, like, PARAMETERS.nearby)
        _, parts = cv2.connectedComponents((difference > PARAMETERS.hardly_like).astype(np.uint8))
        like &= np.isin(parts, np.unique(parts[difference > PARAMETERS.unlike]))
        if like.sum() <= PARAMETERS.most * own.sum():
            lost[:] = like
    return result


def _looks_like(k: int, lab: np.ndarray, asked: np.ndarray, models: ColorModels) -> np.ndarray:
    """Whether the colors [n, 3] of the pixels asked for are those of class k, bool [n]."""
    places = (np.argwhere(asked) + 0.5) / asked.shape
    even = np.ones((models.shares.shape[2], len(places)), np.float32)
    return posterior(models, lab[asked], places, even)[k] > PARAMETERS.likely


def difference_nearby(lab: np.ndarray, rendered: np.ndarray, asked: np.ndarray, nearby: int) -> np.ndarray:
    """Lab units [n] between the n pixels asked for and the most similar color that the field shows about each.

    Args:
        lab: The photo, [h, w, 3].
        rendered: The field's picture on the same grid, [h', w', 3], as large or smaller.
        asked: bool [h, w].
        nearby: Pixels of the field's picture, to all sides.
    """
    size = np.array(rendered.shape[:2])
    rows, columns = (np.argwhere(asked) * size / asked.shape).astype(np.intp).T
    least = np.full(len(rows), np.inf, np.float32)
    for down, right in product(range(-nearby, nearby + 1), repeat=2):
        there = rendered[np.clip(rows + down, 0, size[0] - 1), np.clip(columns + right, 0, size[1] - 1)]
        least = np.minimum(least, np.linalg.norm(lab[asked] - there, axis=-1))
    return least
