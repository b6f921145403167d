"""RecolorNeRF's layers: Gong, Wang, Han, Dou, "RecolorNeRF: Layer Decomposed Radiance Fields for Efficient Color
Editing of 3D Scenes", ACM Multimedia 2023.

A point's color is an alpha blending of ordered layers of pure color: `c = sum_i P_i a_i prod_{j>i} (1 - a_j)`, where the
lowest layer is opaque and the opacities a_i depend on point and direction. The palette is learned along, held to a
convex hull of the scene's colors; the opacities are made sparse.

Other than in the paper: layers of each object by itself, in the order of our hull's palette (black lowest, then the most
used first), on the surface samples of our field instead of jointly with a TensoRF.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from karf_engine.palettes.palette_weights import star_weights

from .decomposition import Layers
from .points import ObjectPoints, PointHead


@dataclass(frozen=True)
class Lambdas:
    """Weights of the losses, as the authors' configurations have them.

    Attributes:
        hull: The palette stays in the hull of the colors.
        inside: Within the hull, nearness to one of its corners.
        sparsity: Few opaque layers.
        sharpness: Of the sigmoid that counts opaque layers.
    """

    hull: float = 1.0
    inside: float = 0.001
    sparsity: float = 0.001
    sharpness: float = 24.0


class RecolorNerf(Layers):
    """The rule for one object; arguments as for `palettenerf.PaletteNerf`."""

    def __init__(self, points: ObjectPoints, palette: np.ndarray, lambdas: Lambdas = Lambdas()) -> None:
        super().__init__()
        self._points, self._lambdas, self._hull = points, lambdas, palette
        self.palette = nn.Parameter(torch.from_numpy(palette).clone())
        self.opacities = PointHead(points, len(palette) - 1, sees=True)

    def weights(self, positions: Tensor, features: Tensor, viewdirs: Tensor) -> Tensor:
        """Return the visibility of each layer through those above it."""
        return over_weights(torch.sigmoid(self.opacities(positions, features, viewdirs)))

    def loss(self, index: Tensor, done: float) -> Tensor:
        """Reconstruction, palette and sparsity losses on a batch."""
        points, lambdas = self._points[index], self._lambdas
        alphas = torch.sigmoid(self.opacities(points.positions, points.features, points.viewdirs))
        mixed = over_weights(alphas) @ self.palette
        counted = torch.sigmoid(lambdas.sharpness * alphas - lambdas.sharpness / 2).sum(1).mean()
        reconstruction = ((mixed - points.colors) ** 2).sum(1).mean()
        return reconstruction + self._palette_loss() + lambdas.sparsity * counted

    def _palette_loss(self) -> Tensor:
        """Squared distance of the entry farthest outside the hull, and of all to the hull's nearest corners."""
        corners = torch.from_numpy(self._hull)
        nearest = torch.from_numpy(star_weights(self.palette.detach().numpy(), self._hull)) @ corners
        outside = ((self.palette - nearest) ** 2).sum(1).max()
        to_corner = ((self.palette[:, None] - corners) ** 2).sum(2).amin(1).mean()
        return self._lambdas.hull * outside + self._lambdas.inside * to_corner


def over_weights(alphas: Tensor) -> Tensor:
    """Weights [n, M] of ordered layers of opacities [n, M - 1] above an opaque one: a_i prod_{j>i} (1 - a_j).

    Example:
        >>> over_weights(torch.tensor([[0.5, 0.25]]))
        tensor([[0.3750, 0.3750, 0.2500]])
    """
    opaque = torch.cat([torch.ones_like(alphas[:, :1]), alphas], 1)
    through = torch.flip(torch.cumprod(torch.flip(1 - alphas, [1]), 1), [1])
    return opaque * torch.cat([through, torch.ones_like(alphas[:, :1])], 1)
