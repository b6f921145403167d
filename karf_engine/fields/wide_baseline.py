"""Wide-baseline captures: few photos from distant cameras, and photo consistency of cells.

Such photos have no features in common, and a photo's background can be explained by fog that no other camera sees. A
point on a surface has the same color in most photos that see it (voxel coloring, Seitz and Dyer 1997; here for a share
of the photos, since occlusion is still unknown), fog has not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from ..capture.camera import Camera
from .rendering.rays import PixelDataset


@dataclass(frozen=True)
class WideBaselineParameters:
    """Constants for wide-baseline captures."""

    angle: float = 22.0  # degrees, median over cameras, to the second nearest neighbor as seen from their focus
    color_tolerance: float = 0.15  # per channel, sRGB
    agreeing_share: float = 0.6  # of the photos that see a cell
    min_share: float = 0.25  # of all photos
    mean_background: float = 0.3  # weight of the prior that the background only depends on the elevation


PARAMETERS = WideBaselineParameters()


def is_wide_baseline(cameras: list[Camera], center: Tensor) -> bool:
    """Return whether a capture is wide. center: the focus [3] of the cameras, world units."""
    if len(cameras) < 3:
        return False
    directions = np.stack([camera.position for camera in cameras]) - center.cpu().numpy()
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-12)
    angles = np.arccos(np.clip(directions @ directions.T, -1, 1))
    second_nearest = np.sort(angles, 1)[:, 2]  # the first is the camera itself
    return bool(np.degrees(np.median(second_nearest)) > PARAMETERS.angle)


def is_photo_consistent(dataset: PixelDataset, points: Tensor, voxel: float) -> Tensor:
    """Find the photo-consistent cells: most photos that see them agree on their color.

    Args:
        dataset: The photos.
        points: Cell centers [n, 3] float32, world units.
        voxel: Cell size, world units; colors are averaged over a square of this size.

    Returns:
        [n] bool.
    """
    n_views = len(dataset.cameras)
    samples = [_project(dataset, number, points, voxel) for number in range(n_views)]
    colors, is_seen = (torch.stack(each, 1) for each in zip(*samples, strict=True))
    n_agreeing = torch.zeros(len(points), device=points.device)
    for number in range(n_views):
        is_alike = (colors - colors[:, number : number + 1]).abs().amax(2) < PARAMETERS.color_tolerance
        n_agreeing = torch.maximum(n_agreeing, (is_alike & is_seen).sum(1) * is_seen[:, number])
    return n_agreeing >= (PARAMETERS.agreeing_share * is_seen.sum(1)).clamp_min(PARAMETERS.min_share * n_views)


def _project(dataset: PixelDataset, number: int, points: Tensor, voxel: float) -> tuple[Tensor, Tensor]:
    """Return a photo's colors at points, sRGB [n, 3], and whether the points are in its image, [n] bool."""
    camera = dataset.cameras[number]
    first, last = int(dataset.offsets[number]), int(dataset.offsets[number + 1])
    photo = dataset.color[first:last].float().view(1, camera.height, camera.width, 3).permute(0, 3, 1, 2) / 255
    world_to_camera = torch.from_numpy(camera.world_to_camera).to(points)
    local = points @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]
    depth = -local[:, 2]
    u = (camera.cx + camera.fx * local[:, 0] / depth.clamp_min(1e-6)).floor()
    v = (camera.cy - camera.fy * local[:, 1] / depth.clamp_min(1e-6)).floor()
    is_seen = (depth > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    if is_seen.any():
        radius = round(camera.fx * voxel / float(depth[is_seen].median()) / 2)
        padded = nn.functional.pad(photo, (radius,) * 4, mode="replicate")
        photo = nn.functional.avg_pool2d(padded, 2 * radius + 1, 1)
    rows, columns = v.long().clamp(0, camera.height - 1), u.long().clamp(0, camera.width - 1)
    return photo[0, :, rows, columns].T, is_seen


def rotate_about_vertical(viewdirs: Tensor, axes: Tensor, turns: Tensor) -> Tensor:
    """Rotate directions [n, 3] about the vertical axis by shares of a full turn [n] in [0, 1].

    The rows of `axes` [3, 3] are two horizontal directions and up.

    Examples:
        >>> rotate_about_vertical(torch.tensor([[1.0, 0.0, 0.5]]), torch.eye(3), torch.tensor([0.5]))
        tensor([[-1.0000e+00, -8.7423e-08,  5.0000e-01]])
    """
    x, y, z = (viewdirs @ axes.T).unbind(1)
    cos, sin = torch.cos(2 * math.pi * turns), torch.sin(2 * math.pi * turns)
    return torch.stack([x * cos - y * sin, x * sin + y * cos, z], 1) @ axes
