"""Gaussians of other programs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..capture.camera import Camera
from ..capture.capture import CapturedSplats
from .formats.registry import read_splats
from .gaussians import Gaussians
from .kernels.arrays import ANTIALIASED_FILTER, PLAIN_FILTER
from .start import near_plane

BLACK = (0.0, 0.0, 0.0)  # the usual background of other programs
ANY_DEPTH = 1e-6


def read_captured_gaussians(splats: CapturedSplats, cameras: Sequence[Camera]) -> Gaussians:
    """Read the Gaussians of a capture, over black.

    Args:
        splats: File of the Gaussians.
        cameras: Cameras of the capture.

    Raises:
        DataError: The file is missing or damaged.
        MissingDependency: The package that reads such files is missing.
    """
    return imported_gaussians(read_splats(splats.path).table, splats.is_antialiased, cameras)


def imported_gaussians(table: np.ndarray, is_antialiased: bool, cameras: Sequence[Camera]) -> Gaussians:
    """Return the table of another program as Gaussians over black.

    Args:
        table: [n, 11 + 3 K] (see gaussians.Gaussians).
        is_antialiased: See `CapturedSplats`.
        cameras: Determine the near plane; without cameras everything is shown.
    """
    near = near_plane(table[:, :3], np.stack([camera.position for camera in cameras])) if cameras else ANY_DEPTH
    return Gaussians(table, 0, BLACK, near, ANTIALIASED_FILTER if is_antialiased else PLAIN_FILTER)
