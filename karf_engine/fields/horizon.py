"""Where the sky begins: above all that cameras see far away, what a photo shows depends on the direction alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ..capture.camera import Camera
from ..capture.capture import SparsePoints
from .extent import is_reliable, upright_axes

SECTORS = 36  # sectors of the compass
MARGIN = math.radians(0.5)  # angle above the highest point of a sector, radians


@dataclass(frozen=True)
class Horizon:
    """The elevation above which nothing stands far away, for each sector of the compass.

    Attributes:
        axes: [3, 3], rows: two horizontal directions and up.
        elevations: [SECTORS], radians.
    """

    axes: Tensor
    elevations: Tensor

    def to(self, device: torch.device) -> Horizon:
        """The same on a device."""
        return Horizon(self.axes.to(device), self.elevations.to(device))

    def is_sky(self, viewdirs: Tensor) -> Tensor:
        """Whether unit directions [n, 3] lead above it, [n] bool."""
        x, y, z = (viewdirs @ self.axes.T).unbind(1)
        return z.clamp(-1, 1).asin() > self.elevations[sector_of(x, y)]


def sector_of(x: Tensor, y: Tensor) -> Tensor:
    """Sector of horizontal directions."""
    return ((torch.atan2(y, x) / (2 * math.pi) + 0.5) * SECTORS).long().clamp_max(SECTORS - 1)


def horizon_of(cameras: list[Camera], points: SparsePoints | None, center: Tensor, radius: float) -> Horizon:
    """The horizon: as high as cameras see points outside a ball, in a sector or its neighbors, and at least level.

    Args:
        cameras: Held upright, more or less: their horizontal axes define what is up.
        points: As these cameras observe them, or None.
        center: [3], of the ball round what the cameras look at.
        radius: Its radius, world units.
    """
    axes = upright_axes(cameras)
    elevations = torch.zeros(SECTORS)
    if points is not None and len(points.view):
        far = np.linalg.norm(points.positions - center.cpu().numpy(), axis=1) > radius
        seen = (far & is_reliable(points))[points.point]
        eyes = np.stack([camera.position for camera in cameras])[points.view[seen]]
        x, y, z = torch.from_numpy((points.positions[points.point[seen]] - eyes) @ axes.T).float().unbind(1)
        elevations = elevations.scatter_reduce(0, sector_of(x, y), torch.atan2(z, torch.hypot(x, y)) + MARGIN, "amax")
        elevations = torch.stack([elevations.roll(1), elevations, elevations.roll(-1)]).amax(0)
    return Horizon(torch.from_numpy(axes).float(), elevations)
