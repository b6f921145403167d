"""A recolorable view as the layers of one picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..capture.capture import UNIT_GAINS
from ..palettes.palette import Palette


@dataclass(frozen=True)
class Layers:
    """One view of K objects, whose palettes have up to M colors. Row 0 is on top.

    Attributes:
        palettes: Of the objects as learned.
        base: [H, W, 3] sRGB, the picture that an edit changes: uint8, uint16, or float in [0, 1].
        coverage: [K, H, W] in [0, 1], any float.
        palette_weights: [K, M, H, W], coverage times weights, any float; padding of small palettes is not read.
        depth: [H, W] along the optical axis, world units, 0 where empty; None if unknown.
        gains: Exposure of the base, see `View`: they multiply the changes of palettes.
    """

    palettes: tuple[Palette, ...]
    base: np.ndarray
    coverage: np.ndarray
    palette_weights: np.ndarray
    depth: np.ndarray | None = None
    gains: tuple[float, float, float] = UNIT_GAINS
