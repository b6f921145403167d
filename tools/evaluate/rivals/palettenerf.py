"""PaletteNeRF's rule: Kuang, Luan, Bi, Shu, Wetzstein, Sunkavalli, "PaletteNeRF: Palette-based Appearance Editing of
Neural Radiance Fields", CVPR 2023.

A point's color is `c(x, d) = I(x) sum_i w_i(x) (P_i + delta_i(x)) + s(x, d)`: an intensity I, weights w that sum to 1,
offsets delta of the palette colors, and the view-dependent rest s. The palette begins as the hull of the colors, the
weights as those that the hull gives the photos' colors. An edit moves P.

Left out or other than in the paper: the weights of the beginning are of color alone, as ours, not of color and place;
one network an object on the surface samples of our field, not volume rendering of a field of its own; no features of
LSeg: the object comes from our masks. Neighbors are other surface points, not random shifts of a sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from karf_engine.compute.neighbors import build_kd_tree
from karf_engine.palettes.palette_weights import star_weights

from .decomposition import Layers
from .points import ObjectPoints, PointHead

NEIGHBORS = 8


@dataclass(frozen=True)
class Lambdas:
    """Weights of the losses, which are means over points and sums over channels.

    All but the palette's are defaults of the authors' program; its palette is frozen at first and then held.

    Attributes:
        sparsity: Few colors a point.
        offset: Small offsets.
        view: A small view-dependent rest.
        smooth: Alike weights at near points of like features.
        weight: The hull's weights, for the first share `guided` of the training.
        palette: The hull's palette.
        guided: Share of the training.
    """

    sparsity: float = 0.002
    offset: float = 0.1
    view: float = 0.02
    smooth: float = 0.002
    weight: float = 0.2
    palette: float = 0.001
    guided: float = 0.5


@dataclass(frozen=True)
class Shown:
    """How n points are made up: intensity [n, 1], weights [n, M], offsets [n, M, 3], rest [n, 3]."""

    intensity: Tensor
    weights: Tensor
    offsets: Tensor
    rest: Tensor


class PaletteNerf(Layers):
    """The rule for one object.

    Args:
        points: What it is learned from.
        palette: [M, 3] sRGB, the hull of the object's colors.
        lambdas: Weights of the losses.
    """

    def __init__(self, points: ObjectPoints, palette: np.ndarray, lambdas: Lambdas = Lambdas()) -> None:
        super().__init__()
        self._points, self._lambdas, self.n_colors = points, lambdas, len(palette)
        self.palette = nn.Parameter(torch.from_numpy(palette).clone())
        self._extracted = self.palette.detach().clone()
        self._guide = torch.from_numpy(star_weights(points.colors.numpy(), palette))
        self.base = PointHead(points, 1 + 4 * self.n_colors)
        self.shine = PointHead(points, 3, sees=True)
        tree = build_kd_tree(points.positions.double().numpy(), balanced_tree=False, compact_nodes=False)
        near = min(NEIGHBORS + 1, len(points))
        self._neighbors = torch.from_numpy(tree.query(points.positions.double().numpy(), k=range(1, near + 1))[1])

    def shown(self, positions: Tensor, features: Tensor, viewdirs: Tensor) -> Shown:
        """Return intensity, weights, offsets and rest of points."""
        out = self.base(positions, features, viewdirs)
        intensity, logits, offsets = out.split([1, self.n_colors, 3 * self.n_colors], 1)
        rest = torch.tanh(self.shine(positions, features, viewdirs))
        # an intensity of 1 and no offsets where the network is silent
        intensity, offsets = nn.functional.softplus(intensity + 0.5413), torch.tanh(offsets)
        return Shown(intensity, torch.softmax(logits, 1), offsets.view(-1, self.n_colors, 3), rest)

    def weights(self, positions: Tensor, features: Tensor, viewdirs: Tensor) -> Tensor:
        """I w: what a palette color contributes to each point."""
        shown = self.shown(positions, features, viewdirs)
        return shown.intensity * shown.weights

    def loss(self, index: Tensor, done: float) -> Tensor:
        """The sum of the paper's losses on a batch."""
        points, lambdas = self._points[index], self._lambdas
        shown = self.shown(points.positions, points.features, points.viewdirs)
        palette = self.palette if done >= lambdas.guided else self._extracted
        diffuse = shown.intensity * torch.einsum("nm,nmc->nc", shown.weights, palette + shown.offsets)
        loss = _squares(diffuse + shown.rest - points.colors) + lambdas.view * _squares(shown.rest)
        loss = loss + lambdas.offset * _squares(shown.offsets.flatten(1)) + lambdas.sparsity * sparsity(shown.weights)
        loss = loss + lambdas.palette * _squares(self.palette - self._extracted)
        if done < lambdas.guided:
            return loss + lambdas.weight * _squares(shown.weights - self._guide[index])
        return loss + lambdas.smooth * self._roughness(index, shown.weights)

    def _roughness(self, index: Tensor, weights: Tensor) -> Tensor:
        """Squared differences between weights of neighbors, as far as their features are alike."""
        drawn = self._neighbors[index, torch.randint(self._neighbors.shape[1], (len(index),))]
        points, near = self._points[index], self._points[drawn]
        beside = self.shown(near.positions, near.features, near.viewdirs).weights
        scale = self.base.standardizer
        apart = ((scale(points.features) - scale(near.features)) ** 2).mean(1)
        return (torch.exp(-apart) * ((weights - beside) ** 2).sum(1)).mean()


def sparsity(weights: Tensor) -> Tensor:
    """`sum w / sum w^2 - 1`: 0 where one color has all the weight, M - 1 where all have as much. Mean over points."""
    return (weights.sum(1) / (weights**2).sum(1) - 1).mean()


def _squares(differences: Tensor) -> Tensor:
    return (differences**2).sum(1).mean()
