"""The learned background: sky, walls, or the backdrop of a studio."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from .rendering.spherical_harmonics import spherical_harmonics


class Background(nn.Module):
    """Color of rays that leave the field, by direction: an MLP with one hidden layer."""

    def __init__(self, width: int = 32) -> None:
        super().__init__()
        self.network = nn.Sequential(nn.Linear(9 + 18, width), nn.ReLU(), nn.Linear(width, 3))

    def forward(self, viewdirs: Tensor) -> Tensor:
        """Return sRGB colors [n, 3] in (0, 1) of unit directions [n, 3]."""
        waves = [f(k * viewdirs) for k in (2.0, 4.0, 8.0) for f in (torch.sin, torch.cos)]
        return torch.sigmoid(self.network(torch.cat([spherical_harmonics(viewdirs), *waves], 1)))
