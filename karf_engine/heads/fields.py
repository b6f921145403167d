"""The two KaRF fields on top of a frozen radiance field: F_s gives the object, F_w the palette colors.

Both read positions scaled to the objects' surroundings ([-1, 1]), standardized prior features and, F_w only, the
viewing direction (paper, Eq. 7 and 10).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from ..fields.rendering.space import Space
from ..kan.encoding import positional_encoding
from ..kan.standardize import Standardizer
from ..project.settings import RecoloringSettings, SegmentationSettings
from .registry import build_head
from .volumes import Volumes


def scale_positions(positions: Tensor, bounds: Tensor) -> Tensor:
    """Move and scale positions so that a box becomes [-1, 1] along its longest side.

    Args:
        positions: [n, 3] grid coordinates.
        bounds: [2, 3] least and greatest corner of the box.

    Returns:
        [n, 3].
    """
    center = bounds.mean(0)
    half = (bounds[1] - bounds[0]).max() / 2
    return (positions - center) / half


class SegmentationField(nn.Module):
    """F_s of Eq. 7: probabilities of K + 1 classes at positions; class 0 is the background.

    Args:
        boxes: [K, 2, 3] round the objects, least and greatest corners, grid coordinates; outside its box an object has
            probability 0.
        n_features: F, prior features of the scene's field.
        settings: octaves of the encoding, and the head.
        volumes: that objects must be inside or outside of; else they have probability 0 too.
        space: of the scene's field; needed where F_s with volumes is asked.
    """

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
        """Class logits [n, K+1] at positions [n, 3] with raw prior features [n, F]."""
        encoded = positional_encoding(scale_positions(positions, self.bounds), self.frequencies)
        return self.head(encoded, self.standardizer(prior_features))

    def inside(self, positions: Tensor) -> Tensor:
        """True where an object can be at a position: in its box, and where its volumes allow it, [n, K]."""
        point = positions[:, None]
        boxed = ((point >= self.boxes[:, 0]) & (point <= self.boxes[:, 1])).all(-1)
        if self.volumes is None:
            return boxed
        return boxed & self.volumes(self.space.to_world(positions), len(self.boxes))

    def forward(self, positions: Tensor, prior_features: Tensor) -> Tensor:
        """Class probabilities, differentiable to the parameters; boxes and volumes cut off without a gradient.

        Args:
            positions: [n, 3] grid coordinates.
            prior_features: [n, F] as the field gives them.

        Returns:
            [n, K+1]; rows sum to 1.
        """
        logits = self.logits(positions, prior_features)
        barred = torch.zeros_like(logits)
        barred[:, 1:] = torch.where(self.inside(positions), 0.0, -torch.inf)
        return torch.softmax(logits + barred, 1)


class RecoloringField(nn.Module):
    """F_w of Eq. 10: palette weights at positions seen from directions, one block of M entries for each palette.

    Args:
        bounds: [2, 3] of F_s, grid coordinates.
        n_features: F, prior features of the scene's field.
        sizes: number of colors of each palette, black included; M is the largest, and entries beyond a palette's size
            get weight 0. A shared palette is one block that serves every object.
        settings: octaves of the encodings, and the head.
    """

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
        """Palette weights, differentiable to the parameters.

        Args:
            positions: [n, 3] grid coordinates.
            viewdirs: [n, 3], unit length.
            prior_features: [n, F] as the field gives them.

        Returns:
            [n, blocks, M] >= 0; each block's sum to 1.
        """
        logits = self.head(
            positional_encoding(scale_positions(positions, self.bounds), self.frequencies),
            self.standardizer(prior_features),
            positional_encoding(viewdirs, self.direction_frequencies),
        ).view(-1, self.n_blocks, self.n_colors)
        return torch.softmax(logits.masked_fill(self.missing, -torch.inf), 2)
