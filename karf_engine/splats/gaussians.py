"""Scene representation as 3D Gaussians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .kernels.arrays import COLOR, PIXEL_FILTER, ScreenFilter

DEGREES = {1: 0, 4: 1, 9: 2, 16: 3}  # by number of harmonics


@dataclass(frozen=True)
class Gaussians:
    """n Gaussians in world coordinates; the last rows are the background.

    Attributes:
        table: [n, 11 + 3 K] float32, C-contiguous. Columns: center; log scales; rotation as quaternion w x y z of any
            length; opacity logit; red, green, blue for each of K = 1, 4, 9 or 16 spherical harmonics, with the order
            and signs of Kerbl et al. 2023. A color is max(0, 0.5 + sum of harmonics), display-referred sRGB.
        n_behind: Number of background rows at the table's end.
        background: sRGB color behind all Gaussians.
        near: Depth of the near plane, world units.
        screen_filter: Filter used for training and rendering.
        looks: [n, 5] float32, visibility in photos: unit vector to the mean direction of the photos that show the
            Gaussian; largest angle between it and one of them, radians; their number. None if unknown.
    """

    table: np.ndarray
    n_background: int
    background: tuple[float, float, float]
    near: float
    screen_filter: ScreenFilter = PIXEL_FILTER
    visibility: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.table)

    @property
    def degree(self) -> int:
        """Degree of the spherical harmonics."""
        return DEGREES[(self.table.shape[1] - COLOR) // 3]

    @property
    def n_foreground(self) -> int:
        """Number of rows without the background, at the table's start."""
        return len(self.table) - self.n_background
