"""Where a page's viewer may look from: around the objects, within the directions and distances of the photos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...capture.camera import Camera
from ...capture.camera_paths import NO_POINTS, looking_at
from ...capture.placement import measure_placement

OUTLIERS = (2, 98)  # percentiles of the objects' centers between which they lie
ALL_ROUND = 60.0  # degrees of the widest gap between cameras that an orbit all round has
SLACK, OF_RANGE = 5.0, 0.1  # degrees beyond the photos, and at most this share of the range that they cover
NEARER, FARTHER = 0.9, 1.1  # factors of the photos' distances
STEEPEST = 1.0  # degrees from the up axis


@dataclass(frozen=True)
class Orbit:
    """Viewpoints around a center, in world units and radians."""

    center: np.ndarray  # [3]
    up: np.ndarray  # [3], unit vector
    position: np.ndarray  # [3], at the start
    field_of_view: float  # vertical, degrees
    azimuth: tuple[float, float] | None  # around `up` by the right-hand rule, from that of `position`; None: all round
    polar: tuple[float, float]  # from `up`
    distance: tuple[float, float]  # from `center`

    def camera(self, width: int, height: int) -> Camera:
        """Return the camera at the start."""
        focal = height / 2 / np.tan(np.radians(self.field_of_view) / 2)
        pose = looking_at(self.position, self.center, self.up)
        return Camera(width, height, focal, focal, width / 2, height / 2, pose)


def orbit_of(cameras: Sequence[Camera], objects: np.ndarray, seen: np.ndarray) -> Orbit:
    """Return the orbit of a capture's cameras.

    It starts where a photo shows most of the objects, or, of photos of one side, in their middle.

    objects: centers of their Gaussians, [m, 3]; without any it is around what the cameras look at. seen: [cameras], the
    share of each photo that the objects fill.
    """
    placement = measure_placement(cameras, NO_POINTS)
    center = np.percentile(objects, OUTLIERS, axis=0).mean(0) if len(objects) else placement.center
    offsets = np.stack([camera.position for camera in cameras]) - center
    distances = np.maximum(np.linalg.norm(offsets, axis=1), 1e-9)
    directions = offsets / distances[:, None]
    azimuth, elevation = placement.angles(directions).T
    is_upright = np.abs(elevation) < 90 - STEEPEST
    start = int(np.argmax(np.where(is_upright, seen * distances**2, -1)))
    if _azimuths(azimuth - azimuth[start], 0) is not None:
        start = int(np.argmax(np.where(is_upright, directions @ directions.mean(0), -1)))
    sides = _azimuths(azimuth - azimuth[start], 0) or (0.0, 360.0)
    slack = min(SLACK, OF_RANGE * max(sides[1] - sides[0], float(np.ptp(elevation))))
    polar = np.clip((90 - elevation.max() - slack, 90 - elevation.min() + slack), STEEPEST, 180 - STEEPEST)
    return Orbit(
        center=center,
        up=placement.up,
        position=center + float(np.median(distances)) * directions[start],
        field_of_view=float(np.median([np.degrees(2 * np.arctan(c.height / 2 / c.fy)) for c in cameras])),
        azimuth=_radians(_azimuths(azimuth - azimuth[start], slack)),
        polar=_radians((polar[0], polar[1])),
        distance=(float(NEARER * distances.min()), float(FARTHER * distances.max())),
    )


def _azimuths(angles: np.ndarray, slack: float) -> tuple[float, float] | None:
    """Return the range in degrees around 0 of angles, 0 among them, with this slack; None for all round."""
    order = np.append(np.sort(angles % 360), 360.0)
    gaps = np.diff(order)
    widest = int(gaps.argmax())
    if gaps[widest] <= ALL_ROUND:
        return None
    return order[widest + 1] - 360 - slack, order[widest] + slack


def _radians(degrees: Any) -> Any:
    return None if degrees is None else tuple(np.radians(degrees).tolist())
