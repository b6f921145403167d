"""Remaining color difference of an object after a color match."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...io.color import ciede2000, srgb_to_lab
from .becomes import add_fixed_paints, add_preserved_paints
from .paints import reflection_target


def residual_delta_e(
    before: np.ndarray,
    after: np.ndarray,
    counts: np.ndarray,
    source: np.ndarray,
    target: np.ndarray,
    held: Sequence[np.ndarray] = (),
    is_metal: bool = False,
) -> float:
    """Return the mean CIEDE2000 between an edited object and its target, all paints and highlights included.

    Args:
        before: The object's colors when the source was picked, sRGB [n, 3] in [0, 1].
        after: The same colors after the edit, [n, 3].
        counts: Frequency of each color, [n].
        source: The picked color, sRGB [3].
        target: Its wanted color, sRGB [3].
        held: Colors of other paints that should stay, sRGB [3] each.
        is_metal: Whether highlights take the paint's color rather than the light's.

    Examples:
        The red became blue, its shade stayed red:

        >>> red, blue = np.array([0.8, 0.1, 0.1]), np.array([0.1, 0.2, 0.7])
        >>> before, after = np.stack([red, red / 2]), np.stack([blue, red / 2])
        >>> round(residual_delta_e(before, after, np.array([3, 1]), red, blue))
        9
    """
    paints = add_preserved_paints(before, counts, *add_fixed_paints(before, source, target, held), is_metal)
    difference = ciede2000(srgb_to_lab(after), srgb_to_lab(reflection_target(before, *paints, is_metal)))
    return float(np.average(difference, weights=counts))
