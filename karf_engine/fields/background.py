"""What lies behind a field: the color of the sky, the walls, the studio's backdrop."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from .rendering.spherical_harmonics import spherical_harmonics


class Background(nn.Module):
    """What rays see behind the box, a function of direction alone: one hidden layer on an encoding of the direction."""

    def __init__(self, width: int = 32) -> None:
        """A fresh background; width: of the hidden layer."""
        super().__init__()
        self.network = nn.Sequential(nn.Linear(9 + 18, width), nn.ReLU(), nn.Linear(width, 3))

    def forward(self, viewdirs: Tensor) -> Tensor:
        """sRGB colors [n, 3] in (0, 1) seen along unit directions [n, 3]."""
        waves = [f(k * viewdirs) for k in (2.0, 4.0, 8.0) for f in (torch.sin, torch.cos)]
        return torch.sigmoid(self.network(torch.cat([spherical_harmonics(viewdirs), *waves], 1)))
