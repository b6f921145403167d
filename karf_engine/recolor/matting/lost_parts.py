"""Thin parts of objects that the field has lost: a leaf's tip, a wire.

A pixel belongs to such a part where the photo has the object's color, the field shows nothing like it thereabouts, and
the way to the object leads through its color. A neighbor of the same color is not a lost part, for the field shows it.

A part may also be there in the field, and be called something else: a cable before a wall. Then a rough mask of this very
photo tells. What it covers is the object's where that is thin and leads to the object: a hand that spills over spills over
thick things, too. The color need be less sure there, as a line one pixel wide is everywhere mixed with what is behind it.
In other photos nothing tells a cable from a thin neighbor of its color, but that the object has a cable: there thin parts are
looked for of objects whose masks show one.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np

from .color_models import ColorModels, posterior
from .distances import distance_to
from .marks import Marks


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
        open: Probability that a pixel of a lost part has, before its neighbors are asked.
        thin: Half of the width up to which a part is thin, pixels of the field's picture. This and all below were chosen on
            thin scenes 0 and 1, and so that drawn seeds 0 to 3 and 5 to 7 lose nothing.
        marked_thin: As `thin`, under a mask.
        marked_likely: As `likely`, of a thin part under a mask.
        thin_open: As `open`, of a thin part.
    """

    reach: float = 32
    nearby: int = 2
    unlike: float = 10.0
    hardly_like: float = 4.0
    likely: float = 0.6
    most: float = 0.5
    open: float = 0.5
    thin: float = 1.5
    marked_thin: float = 2.0
    marked_likely: float = 0.25
    thin_open: float = 0.8


PARAMETERS = LostPartParameters()


def lost_parts(
    lab: np.ndarray, rendered: np.ndarray, labels: np.ndarray, models: ColorModels, marks: Marks
) -> np.ndarray:
    """Parts of objects that the field has lost.

    Args:
        lab: The photo, [h, w, 3] CIE Lab.
        rendered: The scene as the field shows it, [h', w', 3] CIE Lab, on the same grid, smaller.
        labels: [K+1, h, w] of the photo's pixels as they are so far, class 0 being the background.
        models: Colors of the classes.
        marks: What rough masks say to this photo, `drawn` of any size.

    Returns:
        float32 [K, h, w], the probability that a pixel is of a lost part's; 0 in all others.
    """
    scale = lab.shape[0] / rendered.shape[0]
    hard = labels.argmax(0)
    result = np.zeros((len(labels) - 1, *hard.shape), np.float32)
    for k, (found, mark, has_thin) in enumerate(zip(result, _drawn(marks, hard), marks.thin, strict=True), start=1):
        own = hard == k
        if not own.any():
            continue
        in_reach, widest = distance_to(own) <= PARAMETERS.reach * scale, PARAMETERS.marked_thin * scale
        asked = (hard == 0) & (in_reach | (distance_to(mark) <= 2 * widest))  # beyond a mask, too: is it thin there?
        likeness = np.zeros(own.shape, np.float32)
        likeness[asked] = _likeness(k, lab, asked, models)
        like = in_reach & (likeness > PARAMETERS.likely)
        lost = _not_shown(own, like, lab, rendered)
        thin = mark & _thin(own, likeness > PARAMETERS.marked_likely, widest)
        if has_thin:
            thin |= _thin(own, like, PARAMETERS.thin * scale)
        for part, probability in ((lost, PARAMETERS.open), (_joined(own, thin), PARAMETERS.thin_open)):
            if part.sum() <= PARAMETERS.most * own.sum():
                found[part] = probability
    return result


def _drawn(marks: Marks, labels: np.ndarray) -> np.ndarray:
    """What is drawn on the photo, bool [K, h, w] at the size of its labels [h, w]."""
    if marks.drawn is None:
        return np.zeros((len(marks.thin), *labels.shape), bool)
    size = labels.shape[::-1]
    return np.stack(
        [cv2.resize(own.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0 for own in marks.drawn]
    )


def _likeness(k: int, lab: np.ndarray, asked: np.ndarray, models: ColorModels) -> np.ndarray:
    """Probability of class k from the colors [n, 3] of the pixels asked for alone, [n]."""
    places = (np.argwhere(asked) + 0.5) / asked.shape
    even = np.ones((models.shares.shape[2], len(places)), np.float32)
    return posterior(models, lab[asked], places, even)[k]


def _not_shown(own: np.ndarray, like: np.ndarray, lab: np.ndarray, rendered: np.ndarray) -> np.ndarray:
    """Pixels that look like an object, bool [h, w], hang together with it, and are unlike all that the field shows."""
    like = _joined(own, like)
    difference = np.zeros(own.shape, np.float32)
    difference[like] = difference_nearby(lab, rendered, like, PARAMETERS.nearby)
    _, parts = cv2.connectedComponents((difference > PARAMETERS.hardly_like).astype(np.uint8))
    return like & np.isin(parts, np.unique(parts[difference > PARAMETERS.unlike]))


def _thin(own: np.ndarray, like: np.ndarray, widest: float) -> np.ndarray:
    """Pixels that look like an object, bool [h, w], and with it make nothing wider than twice `widest`."""
    core = distance_to(~(own | like)) > widest
    return like & (distance_to(core) > widest)


def _joined(own: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Pixels that look like an object, bool [h, w], and hang together with it."""
    _, parts = cv2.connectedComponents((like | own).astype(np.uint8))
    return like & np.isin(parts, np.unique(parts[own]))


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
