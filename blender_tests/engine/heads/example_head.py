"""An example head of random Fourier features and one linear layer; importing this file registers it as `fourier`."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from karf_engine.heads.registry import HeadSizes, register_head
from karf_engine.kan import join_inputs
from karf_engine.project.settings import HeadSettings


class FourierHead(nn.Module):
    """Logits are linear in sines and cosines of `width` random projections of all inputs (Rahimi and Recht 2007)."""

    def __init__(self, n_in: int, n_out: int, width: int) -> None:
        super().__init__()
        self.register_buffer("projection", torch.randn(n_in, width) / n_in**0.5)
        self.output = nn.Linear(2 * width, n_out)

    def forward(self, position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None = None) -> Tensor:
        """Return logits [n, n_out] of encodings [n, P] and [n, D], and standardized prior features [n, F]."""
        angles = join_inputs(position_encoding, features, direction_encoding) @ self.projection
        return self.output(torch.cat([torch.sin(angles), torch.cos(angles)], dim=1))


def fourier_head(sizes: HeadSizes, settings: HeadSettings) -> FourierHead:
    """Return a new head of these sizes, as wide as the settings say."""
    n_in = sizes.n_position + sizes.n_direction + sizes.n_features
    return FourierHead(n_in, sizes.n_out, settings.width)


register_head("fourier", fourier_head)
