"""Few photos from far apart: where all of them could show one thing.

Between cameras that stand this far apart no features are found, and a photo's surroundings can be hung up as fog where
no other camera looks. A place on a surface has one color in most photos that look at it (voxel coloring, Seitz and Dyer
1997; here as a share of the photos, since what hides it is not known yet); fog has another one in each.
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
    """Chosen on drawn seeds 338 and 372, a garden and a table in 14 photos from a dome; what to vary was found on seed 102.

    Attributes:
        angle: Degrees, seen from what the cameras look at, between a typical one and its second nearest neighbor, from
            which they stand far apart. 14 cameras on a dome have 26, 36 have 19, the demo's 60 have 15.
        likeness: Largest difference of a channel, sRGB, of colors that count as one. 0.13 and 0.2 were tried.
        agreeing: Share of the photos that look at a place, which must show one color there. 0.55 and 0.65 were tried.
        looking: Share of all photos that must do so: what few see could hang anywhere.
        mean_background: Weight with which a direction's background is what others of its elevation show, where no
            photo tells. 1 was tried.
    """

    angle: float = 22.0
    likeness: float = 0.15
    agreeing: float = 0.6
    looking: float = 0.25
    mean_background: float = 0.3


PARAMETERS = WideBaselineParameters()


def is_wide(cameras: list[Camera], center: Tensor) -> bool:
    """Whether cameras that look at a place, [3] world units, stand far apart; False of fewer than three."""
    if len(cameras) < 3:
        return False
    directions = np.stack([camera.position for camera in cameras]) - center.cpu().numpy()
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-12)
    angles = np.arccos(np.clip(directions @ directions.T, -1, 1))
    second_nearest = np.sort(angles, 1)[:, 2]  # the first is the camera itself
    return bool(np.degrees(np.median(second_nearest)) > PARAMETERS.angle)


def could_be_solid(dataset: PixelDataset, points: Tensor, voxel: float) -> Tensor:
    """True for cells that show one color in most photos that look at them, and that enough photos look at.

    Args:
        dataset: The photos.
        points: [n, 3] float32, the cells' centers, world units.
        voxel: Their size, world units: a cell's color is a photo's mean over as large a square.

    Returns:
        [n] bool.
    """
    shown = [_shown(dataset, number, points, voxel) for number in range(len(dataset.cameras))]
    colors, is_seen = torch.stack([color for color, _ in shown], 1), torch.stack([seen for _, seen in shown], 1)
    most_alike = torch.zeros(len(points), device=points.device)
    for number in range(len(dataset.cameras)):
        is_alike = (colors - colors[:, number : number + 1]).abs().amax(2) < PARAMETERS.likeness
        most_alike = torch.maximum(most_alike, (is_alike & is_seen).sum(1) * is_seen[:, number])
    fewest = PARAMETERS.looking * len(dataset.cameras)
    return most_alike >= (PARAMETERS.agreeing * is_seen.sum(1)).clamp_min(fewest)


def _shown(dataset: PixelDataset, number: int, points: Tensor, voxel: float) -> tuple[Tensor, Tensor]:
    """What a photo shows at places, sRGB [n, 3], and whether it looks at them, [n] bool."""
    camera = dataset.cameras[number]
    first, last = int(dataset.first[number]), int(dataset.first[number + 1])
    photo = dataset.color[first:last].float().view(1, camera.height, camera.width, 3).permute(0, 3, 1, 2) / 255
    inverse = torch.from_numpy(camera.world_to_camera).to(points)
    local = points @ inverse[:3, :3].T + inverse[:3, 3]
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


def turned(viewdirs: Tensor, axes: Tensor, turns: Tensor) -> Tensor:
    """Directions [n, 3] of the same elevations, turned about what is up.

    Args:
        viewdirs: [n, 3].
        axes: [3, 3], rows: two horizontal directions and up.
        turns: [n] in [0, 1], shares of a whole turn.

    Examples:
        >>> turned(torch.tensor([[1.0, 0.0, 0.5]]), torch.eye(3), torch.tensor([0.5]))
        tensor([[-1.0000e+00, -8.7423e-08,  5.0000e-01]])
    """
    x, y, z = (viewdirs @ axes.T).unbind(1)
    cos, sin = torch.cos(2 * math.pi * turns), torch.sin(2 * math.pi * turns)
    return torch.stack([x * cos - y * sin, x * sin + y * cos, z], 1) @ axes
