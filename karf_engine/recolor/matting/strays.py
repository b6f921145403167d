"""Small patches that the field takes for an object, far from where it is."""

from __future__ import annotations

import cv2
import numpy as np

from .distances import distance_to

SMALL = 0.02  # of the area of the object's largest part
FAR = 0.25  # of the square root of that area, from the larger parts


def without_strays(probabilities: np.ndarray) -> np.ndarray:
    """Probabilities of K objects without those of stray patches.

    A patch is small beside the object's largest part and far from all parts that are not small. An object that
    something stands before may come in several parts; so small parts near it stay, and two of like size.

    Args:
        probabilities: [K, h, w] in [0, 1].

    Examples:
        >>> seen = np.zeros((1, 40, 40), np.float32)
        >>> seen[0, 5:25, 5:25] = seen[0, 36, 36] = seen[0, 26, 10] = 1
        >>> int(without_strays(seen).sum()) - 400  # the patch near by has stayed
        1
    """
    return np.stack([own * ~_strays(own > 0.5) for own in probabilities])


def _strays(mask: np.ndarray) -> np.ndarray:
    """Stray patches of a mask, and what is nearer to them than to the rest."""
    count, parts, figures, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if count <= 2:
        return np.zeros_like(mask)
    areas = figures[1:, cv2.CC_STAT_AREA]
    large = np.isin(parts, 1 + np.flatnonzero(areas >= SMALL * areas.max()))
    away = distance_to(large)
    far = [n for n in range(1, count) if away[parts == n].min() > FAR * areas.max() ** 0.5]
    strays = np.isin(parts, far)
    return distance_to(strays) < away if far else strays
