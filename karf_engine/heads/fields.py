"""The two KaRF fields on a frozen radiance field (paper, Eq. 7 and 10): F_s segments objects, F_w mixes palette colors.

Both read positions scaled to [-1, 1] and standardized prior features; F_w also reads the viewing direction.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ..fields.rendering.space import Space
from ..kan.inputs import Standardizer, positional_encoding
from ..project.settings import RecoloringSettings, SegmentationSettings
from .registry import build_head
from .volumes import Volumes


def scale_positions(positions: Tensor, bounds: Tensor) -> Tensor:
    """Map positions [n, 3] so that the box `bounds` [2, 3] (least, greatest corner) is [-1, 1] along its longest side."""
    center = bounds.mean(0)
    half = (bounds[1] - bounds[0]).max() / 2
    return (positions - center) / half


class SegmentationField(nn.Module):
    """F_s of Eq. 7: probabilities of K + 1 classes at positions; class 0 is the background.

    Args:
        boxes: [K, 2, 3] least and greatest corners, grid coordinates; an object has probability 0 outside its box.
        n_features: F, number of prior features.
        settings: octaves of the encoding, and the head.
        volumes: that objects must be inside or outside of; elsewhere they have probability 0.
        space: of the scene's field; needed to evaluate F_s with volumes.
    """

    boxes: Tensor
    bounds: Tensor

    def __init__(
        self,
        boxes: Tensor,
        n_features: int,
        settings: SegmentationSettings,
        volumes: Volumes | None = None,
        space: Space | None = None,
    ) -> None:
        super().__init__()
        self.volumes, self.space = volumes, space
        self.frequencies = settings.frequencies
        self.register_buffer("boxes", boxes.float())
        self.register_buffer("bounds", torch.stack([boxes[:, 0].amin(0), boxes[:, 1].amax(0)]).float())
        self.standardizer = Standardizer(n_features)
        self.head = build_head(settings, 3 + 6 * settings.frequencies, 0, n_features, len(boxes) + 1)

    def logits(self, positions: Tensor, prior_features: Tensor) -> Tensor:
        """Return class logits [n, K+1] for positions [n, 3] and prior features [n, F]."""
        encoded = positional_encoding(scale_positions(positions, self.bounds), self.frequencies)
        return self.head(encoded, self.standardizer(prior_features))

    def inside(self, positions: Tensor) -> Tensor:
        """Return True where the boxes and volumes allow an object, [n, K] for positions [n, 3]."""
        point = positions[:, None]
        boxed = ((point >= self.boxes[:, 0]) & (point <= self.boxes[:, 1])).all(-1)
        if self.volumes is None:
            return boxed
        assert self.space is not None, "volumes need the space of the scene's field"
        return boxed & self.volumes(self.space.to_world(positions), len(self.boxes))

    def forward(self, positions: Tensor, prior_features: Tensor) -> Tensor:
        """Return class probabilities, differentiable with respect to the parameters.

        Args:
            positions: [n, 3] grid coordinates.
            prior_features: [n, F], not standardized.

        Returns:
            [n, K+1]; rows sum to 1.
        """
        logits = self.logits(positions, prior_features)
        excluded = torch.zeros_like(logits)
        excluded[:, 1:] = torch.where(self.inside(positions), 0.0, -torch.inf)
        return torch.softmax(logits + excluded, 1)


class RecoloringField(nn.Module):
    """F_w of Eq. 10: palette weights at positions and viewing directions, a block of M weights for each palette.

    Args:
        bounds: [2, 3] of F_s, grid coordinates.
        n_features: F, number of prior features.
        sizes: number of colors of each palette, black included. M is the largest; entries beyond a palette's size get
            weight 0. A shared palette is a single block.
        settings: octaves of the encodings, and the head.
    """

    bounds: Tensor
    missing: Tensor

    def __init__(self, bounds: Tensor, n_features: int, sizes: list[int], settings: RecoloringSettings) -> None:
        super().__init__()
        self.frequencies = settings.frequencies
        self.direction_frequencies = settings.direction_frequencies
        self.n_blocks, self.n_colors = len(sizes), max(sizes)
        self.register_buffer("bounds", bounds.float())
        missing = torch.arange(self.n_colors) >= torch.tensor(sizes)[:, None]
        self.register_buffer("missing", missing, persistent=False)
        self.standardizer = Standardizer(n_features)
        self.head = build_head(
            settings,
            3 + 6 * settings.frequencies,
            3 + 6 * settings.direction_frequencies,
            n_features,
            self.n_blocks * self.n_colors,
        )

    def forward(self, positions: Tensor, viewdirs: Tensor, prior_features: Tensor) -> Tensor:
        """Return palette weights, differentiable with respect to the parameters.

        Args:
            positions: [n, 3] grid coordinates.
            viewdirs: [n, 3], unit length.
            prior_features: [n, F], not standardized.

        Returns:
            [n, blocks, M] >= 0; each block sums to 1.
        """
        logits = self.head(
            positional_encoding(scale_positions(positions, self.bounds), self.frequencies),
            self.standardizer(prior_features),
            positional_encoding(viewdirs, self.direction_frequencies),
        ).view(-1, self.n_blocks, self.n_colors)
        return torch.softmax(logits.masked_fill(self.missing, -torch.inf), 2)
