"""Sparse points and the pixels that observe them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ...capture.capture import SparsePoints
from ..extent import is_reliable
from ..rendering.rays import PixelDataset
from ..rendering.space import Space


@dataclass(frozen=True)
class Observations:
    """Pixels that observe a sparse point."""

    index: Tensor  # [m], running pixel index of a PixelDataset
    positions: Tensor  # [m, 3], observed points, grid coordinates

    def __len__(self) -> int:
        return len(self.index)


def find_observations(dataset: PixelDataset, space: Space, points: SparsePoints | None) -> Observations:
    """Return all observations of reliable sparse points by the dataset's pixels."""
    index, positions = [torch.zeros(0, dtype=torch.long)], [torch.zeros(0, 3)]
    if points is not None and len(points):
        reliable = is_reliable(points)
        for number, camera in enumerate(dataset.cameras):
            seen = points.point[points.view == number]
            world = points.positions[seen[reliable[seen]]]
            pixels, depth = camera.project(world)
            cells = np.floor(pixels).astype(int)
            inside = (depth > 0) & ((cells >= 0) & (cells < (camera.width, camera.height))).all(1)
            index.append(int(dataset.offsets[number]) + torch.from_numpy(cells[inside] @ (1, camera.width)))
            positions.append(torch.from_numpy(world[inside]).float())
    device = dataset.color.device
    return Observations(torch.cat(index).to(device), space.to_grid(torch.cat(positions).to(device)))
