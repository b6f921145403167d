"""Where thin parts are, and how wide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .edges import distance
from .truth import THIN_RAYS

NARROW, WIDE = 1.0, 2.0  # pixels: thin parts are judged from one, those from two apart
NEAR = 3.0  # pixels from a thin part within which wrong paint counts against it


@dataclass(frozen=True)
class ThinPart:
    """The thin parts of one object in one photo, bool [H, W] each.

    Attributes:
        wide: Their pixels where they are two pixels wide or more.
        narrow: Where they are one to two pixels wide.
        around: All that is within `NEAR` pixels of them.
    """

    wide: np.ndarray
    narrow: np.ndarray
    around: np.ndarray

    @property
    def pixels(self) -> np.ndarray:
        """All of their pixels that are judged."""
        return self.wide | self.narrow


def thin_part(rays: np.ndarray) -> ThinPart:
    """Return where a thin part is, and how wide.

    Args:
        rays: Which of `THIN_RAYS` x `THIN_RAYS` rays a pixel meet it, bool.

    Examples:
        A rod three pixels wide that goes on as one of a pixel and a third:

        >>> rays = np.zeros((40 * THIN_RAYS, 9 * THIN_RAYS), bool)
        >>> rays[:60, 9:18], rays[60:, 12:16] = True, True
        >>> found = thin_part(rays)
        >>> [np.flatnonzero(each[row]).tolist() for each, row in ((found.wide, 9), (found.narrow, 30), (found.wide, 30))]
        [[3, 4, 5], [4], []]
    """
    height, width = (length // THIN_RAYS for length in rays.shape)
    cells = height, THIN_RAYS, width, THIN_RAYS
    mostly = rays.reshape(cells).mean((1, 3)) >= 0.5
    at_least = [opened(rays, 0.5 * pixels * THIN_RAYS).reshape(cells).any((1, 3)) for pixels in (NARROW, WIDE)]
    wide = mostly & at_least[1]
    pixels = mostly & at_least[0]
    around = distance(~pixels) <= NEAR if pixels.any() else pixels
    return ThinPart(wide, pixels & ~wide, around)


def opened(mask: np.ndarray, radius: float) -> np.ndarray:
    """Return the parts of a mask [H, W] that a disk of this radius fits into; up to a pixel narrower ones count."""
    core = distance(np.pad(mask, 1))[1:-1, 1:-1] >= radius
    return mask & (distance(~core) < radius) if core.any() else core
