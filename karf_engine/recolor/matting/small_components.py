"""Removal of small connected components far from their object."""

from __future__ import annotations

import cv2
import numpy as np

from .distances import distance_to

SMALL = 0.02  # area, relative to the object's largest component
FAR = 0.25  # distance to the larger components, relative to the square root of that area


def remove_small_components(probabilities: np.ndarray) -> np.ndarray:
    """Zero the probabilities [K, h, w] of components that are both small and far from the larger ones.

    Near ones stay: an occluded object may have several components.

    Examples:
        >>> seen = np.zeros((1, 40, 40), np.float32)
        >>> seen[0, 5:25, 5:25] = seen[0, 36, 36] = seen[0, 26, 10] = 1
        >>> int(remove_small_components(seen).sum()) - 400  # the near component stays
        1
    """
    return np.stack([own * ~_strays(own > 0.5) for own in probabilities])


def _strays(mask: np.ndarray) -> np.ndarray:
    """Return a mask's stray components, with all pixels that are nearer to them than to the others."""
    count, parts, figures, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if count <= 2:
        return np.zeros_like(mask)
    areas = figures[1:, cv2.CC_STAT_AREA]
    large = np.isin(parts, 1 + np.flatnonzero(areas >= SMALL * areas.max()))
    away = distance_to(large)
    far = [n for n in range(1, count) if away[parts == n].min() > FAR * areas.max() ** 0.5]
    strays = np.isin(parts, far)
    return distance_to(strays) < away if far else strays
