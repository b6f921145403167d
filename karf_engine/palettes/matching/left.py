"""What is left of the way from one color to another, on the whole object."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...io.color import ciede2000, srgb_to_lab
from .becomes import with_held, with_unasked
from .paints import reflection_target


def left_of_object(
    before: np.ndarray,
    after: np.ndarray,
    counts: np.ndarray,
    source: np.ndarray,
    target: np.ndarray,
    held: Sequence[np.ndarray] = (),
    is_metal: bool = False,
) -> float:
    """Mean CIEDE2000 of an object from what it is to become, where one color of it is to become another.

    A color alone tells little: it may be met while highlights turn green.

    Args:
        before: The object's colors when the source was picked, sRGB [n, 3] in [0, 1].
        after: The same as edited, [n, 3].
        counts: How often each occurs, [n].
        source: sRGB [3], one of `before`.
        target: What it is to become, sRGB [3].
        held: Colors of other paints that are to stay, sRGB [3] each.
        is_metal: Whether highlights take the paint's color, and not the light's.

    Raises:
        BadRequest: The source is black.

    Examples:
        A red is blue now, its shade has stayed:

        >>> red, blue = np.array([0.8, 0.1, 0.1]), np.array([0.1, 0.2, 0.7])
        >>> before, after = np.stack([red, red / 2]), np.stack([blue, red / 2])
        >>> round(left_of_object(before, after, np.array([3, 1]), red, blue))
        9
    """
    pairs = with_unasked(before, counts, *with_held(before, source, target, held), is_metal)
    left = ciede2000(srgb_to_lab(after), srgb_to_lab(reflection_target(before, *pairs, is_metal)))
    return float(np.average(left, weights=counts))
