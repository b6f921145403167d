"""A scene as Gaussians: the table that is learned, shown and written."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .kernels.arrays import COLOR, PIXEL_FILTER, ScreenFilter

DEGREES = {1: 0, 4: 1, 9: 2, 16: 3}  # by the number of harmonics


@dataclass(frozen=True)
class Gaussians:
    """n Gaussians in the capture's world, of which the last show what is behind the scene.

    Attributes:
        table: [n, 11 + 3 K] float32, C-contiguous: center; logarithm of the scales; rotation as quaternion w x y z, of
            any length; logit of the opacity; and for each of K = 1, 4, 9 or 16 spherical harmonics red, green and blue,
            in the order and signs of Kerbl et al. 2023. A color is 0.5 and the sum of the harmonics, display-referred
            sRGB, and at least 0.
        n_behind: How many rows, at the table's end, show what is behind all that is solid.
        background: sRGB of what is behind them all.
        near: What is nearer to a camera, along its axis, is not seen; world units.
        screen_filter: With which they were learned, and are shown.
        looks: [n, 5] float32, how photos look at them: the unit vector to the middle of the photos that show each; the angle
            between it and the farthest of these, radians; and how many they are. None where it is not known.
    """

    table: np.ndarray
    n_behind: int
    background: tuple[float, float, float]
    near: float
    screen_filter: ScreenFilter = PIXEL_FILTER
    looks: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.table)

    @property
    def degree(self) -> int:
        """Degree of the spherical harmonics."""
        return DEGREES[(self.table.shape[1] - COLOR) // 3]

    @property
    def n_solid(self) -> int:
        """How many rows, at the table's start, are of the scene itself."""
        return len(self.table) - self.n_behind
