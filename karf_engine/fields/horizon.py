"""The horizon: above it a photo shows the sky, which depends on the direction alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ..capture.camera import Camera
from ..capture.capture import SparsePoints
from .extent import is_reliable, upright_axes

SECTORS = 36  # of the azimuth
MARGIN = math.radians(0.5)  # above the highest point of a sector, radians


@dataclass(frozen=True)
class Horizon:
    """Elevation of the sky in each azimuth sector."""

    axes: Tensor  # [3, 3], rows: two horizontal directions and up
    elevations: Tensor  # [SECTORS], radians

    def to(self, device: torch.device) -> Horizon:
        """Copy the horizon to a device."""
        return Horizon(self.axes.to(device), self.elevations.to(device))

    def is_sky(self, viewdirs: Tensor) -> Tensor:
        """Return whether unit directions [n, 3] point above the horizon, [n] bool."""
        x, y, z = (viewdirs @ self.axes.T).unbind(1)
        return z.clamp(-1, 1).asin() > self.elevations[_sectors(x, y)]


def _sectors(x: Tensor, y: Tensor) -> Tensor:
    """Return the azimuth sector of horizontal directions."""
    return ((torch.atan2(y, x) / (2 * math.pi) + 0.5) * SECTORS).long().clamp_max(SECTORS - 1)


def estimate_horizon(cameras: list[Camera], points: SparsePoints | None, center: Tensor, radius: float) -> Horizon:
    """Compute the largest elevation of points outside a ball in each sector and its neighbors, at least 0.

    Args:
        cameras: Roughly upright; their horizontal axes define up.
        points: As these cameras observe them, or None.
        center: [3], of the ball.
        radius: Of the ball, world units.
    """
    axes = upright_axes(cameras)
    elevations = torch.zeros(SECTORS)
    if points is not None and len(points.view):
        far = np.linalg.norm(points.positions - center.cpu().numpy(), axis=1) > radius
        seen = (far & is_reliable(points))[points.point]
        positions = np.stack([camera.position for camera in cameras])[points.view[seen]]
        x, y, z = torch.from_numpy((points.positions[points.point[seen]] - positions) @ axes.T).float().unbind(1)
        elevations = elevations.scatter_reduce(0, _sectors(x, y), torch.atan2(z, torch.hypot(x, y)) + MARGIN, "amax")
        elevations = torch.stack([elevations.roll(1), elevations, elevations.roll(-1)]).amax(0)
    return Horizon(torch.from_numpy(axes).float(), elevations)
