"""Masks of things that their color tells from all around them: hue thresholds, and a watershed where hue is unsure.

Pictures are sRGB, float [H, W, 3] in [0, 1]; hues are degrees of HSV in [0, 360), saturation and value lie in [0, 1].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import binary_opening, label
from skimage.filters import sobel
from skimage.segmentation import watershed

SMOOTHING = 5  # pixels, odd: side of the median before colors are looked at, so that noise has no hue
SLACK = 0.1  # of saturation and value below a rule's least: there it is unsure
HUE_SLACK = 10.0  # degrees on either side of a rule's hues: there it is unsure
SMALLEST_PART = 0.01  # of the largest part: what is smaller is another thing of that color
LARGEST_HOLE = 0.005  # of the mask: a smaller one is a glint or a speck, a larger one shows what is behind
OPENING = 2  # pixels: what is narrower than twice that is no seed


@dataclass(frozen=True)
class ColorRule:
    """Pixels that are surely an object's: hues from the first to the second, upwards over 0; least saturation, value."""

    hues: tuple[float, float]
    saturation: float
    value: float

    def fits(self, hsv: np.ndarray, hue_slack: float = 0.0, slack: float = 0.0) -> np.ndarray:
        """Where hsv [H, W, 3] is of the rule, widened by the slacks, bool [H, W]."""
        start, width = self.hues[0] - hue_slack, (self.hues[1] - self.hues[0]) % 360 + 2 * hue_slack
        of_hue = (hsv[..., 0] - start) % 360 <= width
        return of_hue & (hsv[..., 1] >= self.saturation - slack) & (hsv[..., 2] >= self.value - slack)


def masks_by_color(picture: np.ndarray, rules: Mapping[str, ColorRule]) -> dict[str, np.ndarray]:
    """The mask of each object, bool [H, W], whose color is that of its rule; all false where there is none.

    Pixels of a rule are seeds of its object, pixels that are far from all rules seeds of the background; the rest goes
    to the seed that a watershed of the picture's edges reaches it from.
    """
    smooth = cv2.medianBlur(np.rint(picture * 255).astype(np.uint8), SMOOTHING)
    hsv = cv2.cvtColor(smooth.astype(np.float32) / 255, cv2.COLOR_RGB2HSV)
    unsure = np.any([rule.fits(hsv, HUE_SLACK, SLACK) for rule in rules.values()], axis=0)
    seeds = np.where(unsure, 0, 1)
    for number, rule in enumerate(rules.values(), start=2):
        seeds[large_parts(binary_opening(rule.fits(hsv), iterations=OPENING))] = number
    labels = watershed(sobel(smooth / 255, axis=(0, 1)).max(-1), seeds)
    return {name: without_small_holes(labels == number) for number, name in enumerate(rules, start=2)}


def large_parts(mask: np.ndarray) -> np.ndarray:
    """The connected parts of a mask that are not small beside its largest one, bool [H, W]."""
    parts, count = label(mask)
    if not count:
        return mask
    sizes = np.bincount(parts.ravel())[1:]
    return np.isin(parts, 1 + np.flatnonzero(sizes >= SMALLEST_PART * sizes.max()))


def without_small_holes(mask: np.ndarray) -> np.ndarray:
    """A mask whose holes are filled where they are small beside it, bool [H, W]."""
    parts, _ = label(~mask)
    is_small = np.bincount(parts.ravel()) < LARGEST_HOLE * mask.sum()
    return mask | is_small[parts]
