"""Scene representation as 3D Gaussians."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..capture.camera import Camera
from .kernels.arrays import ANTIALIASED_FILTER, COLOR, PIXEL_FILTER, PLAIN_FILTER, ScreenFilter

DEGREES = {1: 0, 4: 1, 9: 2, 16: 3}  # by number of harmonics
NEAREST = 0.02  # near plane in median distances between cameras and surface
BLACK = (0.0, 0.0, 0.0)  # the usual background of other programs
ANY_DEPTH = 1e-6


@dataclass(frozen=True)
class Gaussians:
    """n Gaussians in world coordinates; the last rows are the background.

    Columns of the table: center; log scales; rotation as quaternion w x y z of any length; opacity logit; red, green, blue
    for each of K = 1, 4, 9 or 16 spherical harmonics, with the order and signs of Kerbl et al. 2023. A color is
    max(0, 0.5 + sum of harmonics), display-referred sRGB.
    """

    table: np.ndarray  # [n, 11 + 3 K] float32, C-contiguous
    n_background: int  # rows at the table's end
    background: tuple[float, float, float]  # sRGB behind all Gaussians
    near: float  # depth of the near plane, world units
    screen_filter: ScreenFilter = PIXEL_FILTER  # of training and rendering
    # [n, 5] float32: unit vector to the mean direction of the photos that show the Gaussian; largest angle between it and
    # one of them, radians; their number. None if unknown.
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


def subset(gaussians: Gaussians, rows: np.ndarray) -> Gaussians:
    """Return some rows of Gaussians, in ascending order."""
    visibility = None if gaussians.visibility is None else gaussians.visibility[rows]
    n_background = int((rows >= gaussians.n_foreground).sum())
    return replace(gaussians, table=gaussians.table[rows], n_background=n_background, visibility=visibility)


def near_plane(centers: np.ndarray, eyes: np.ndarray) -> float:
    """Return the depth of the near plane for centers [n, 3] and camera positions [m, 3]."""
    return float(NEAREST * np.median(np.linalg.norm(np.median(centers, 0) - eyes, axis=1)))


def imported_gaussians(table: np.ndarray, is_antialiased: bool, cameras: Sequence[Camera]) -> Gaussians:
    """Return the table of another program as Gaussians over black.

    is_antialiased: see `CapturedSplats`. cameras: determine the near plane; without them everything is shown.
    """
    near = near_plane(table[:, :3], np.stack([camera.position for camera in cameras])) if cameras else ANY_DEPTH
    return Gaussians(table, 0, BLACK, near, ANTIALIASED_FILTER if is_antialiased else PLAIN_FILTER)
