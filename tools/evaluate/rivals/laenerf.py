"""LAENeRF's rule: Radl, Steiner, Kurz, Steinberger, "LAENeRF: Local Appearance Editing for Neural Radiance Fields",
CVPR 2024.

In a selected region, the one point at which a ray is expected to end gives weights of learned base colors, and with
the viewing direction an additive offset: `c(x, d) = sum_i w_i(x) P_i + o(x, d)`. Losses keep the weights sparse in each
point and even over the region, the palette in gamut and its colors distinct, the offsets small.

Other than in the paper: the region is our mask instead of one grown in a voxel grid; no style, depth or smoothness
losses, which serve stylization; the edited colors are added to the photo instead of distilled into the field.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from .decomposition import Layers
from .palettenerf import sparsity
from .points import ObjectPoints, PointHead


@dataclass(frozen=True)
class Lambdas:
    """Weights of the losses. The paper's are not known to us: these are round numbers, none of them searched for.

    Attributes:
        sparse: Few colors a point.
        even: Each color is used as much as the others.
        valid: The palette stays in [0, 1].
        distinct: Colors repel each other.
        offset: Small offsets.
    """

    sparse: float = 0.002
    even: float = 0.01
    valid: float = 1.0
    distinct: float = 0.001
    offset: float = 0.1


class LaeNerf(Layers):
    """The rule for one object. Its palette begins at random: of palette [M, 3] only the number of colors counts."""

    def __init__(self, points: ObjectPoints, palette: np.ndarray, lambdas: Lambdas = Lambdas()) -> None:
        super().__init__()
        self._points, self._lambdas = points, lambdas
        self.palette = nn.Parameter(torch.rand(len(palette), 3))
        self.shares = PointHead(points, len(palette))
        self.offset = PointHead(points, 3, sees=True)

    def weights(self, positions: Tensor, features: Tensor, viewdirs: Tensor) -> Tensor:
        """Barycentric weights over the palette."""
        return torch.softmax(self.shares(positions, features, viewdirs), 1)

    def loss(self, index: Tensor, done: float) -> Tensor:
        """Reconstruction and the weight, palette and offset losses on a batch."""
        points, lambdas = self._points[index], self._lambdas
        weights = self.weights(points.positions, points.features, points.viewdirs)
        offsets = torch.tanh(self.offset(points.positions, points.features, points.viewdirs))
        loss = ((weights @ self.palette + offsets - points.colors) ** 2).sum(1).mean()
        loss = loss + lambdas.offset * (offsets**2).sum(1).mean() + lambdas.sparse * sparsity(weights)
        loss = loss + lambdas.even * (weights.mean(0) - 1 / len(self.palette)).square().sum()
        beyond = self.palette - self.palette.clamp(0, 1)
        return loss + lambdas.valid * beyond.square().sum() + lambdas.distinct * self._crowding()

    def _crowding(self) -> Tensor:
        """exp(-squared distance / 0.1) between palette colors, mean over pairs."""
        apart = ((self.palette[:, None] - self.palette) ** 2).sum(2)
        pairs = torch.triu_indices(len(self.palette), len(self.palette), 1)
        return torch.exp(-apart[pairs[0], pairs[1]] / 0.1).mean()
