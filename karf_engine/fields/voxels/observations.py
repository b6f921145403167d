"""Sparse points as the pixels of photos observe them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ...capture.capture import SparsePoints
from ..extent import is_reliable
from ..rendering.rays import PixelBank
from ..rendering.space import Space


@dataclass(frozen=True)
class Observations:
    """Which pixel observes which sparse point.

    Attributes:
        index: [m], running pixel index of a PixelBank.
        positions: [m, 3], of the points, grid coordinates.
    """

    index: Tensor
    positions: Tensor

    def __len__(self) -> int:
        return len(self.index)


def observations_of(bank: PixelBank, space: Space, points: SparsePoints | None) -> Observations:
    """The pixels of the bank that see a reliable sparse point."""
    index, positions = [torch.zeros(0, dtype=torch.long)], [torch.zeros(0, 3)]
    if points is not None and len(points):
        reliable = is_reliable(points)
        for number, camera in enumerate(bank.cameras):
            seen = points.point[points.view == number]
            world = points.positions[seen[reliable[seen]]]
            pixels, depth = camera.project(world)
            cells = np.floor(pixels).astype(int)
            inside = (depth > 0) & ((cells >= 0) & (cells < (camera.width, camera.height))).all(1)
            index.append(int(bank.first[number]) + torch.from_numpy(cells[inside] @ (1, camera.width)))
            positions.append(torch.from_numpy(world[inside]).float())
    device = bank.color.device
    return Observations(torch.cat(index).to(device), space.to_grid(torch.cat(positions).to(device)))
