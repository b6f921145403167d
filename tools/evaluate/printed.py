"""The paper's formulas where the engine differs, to measure what the difference is worth.

Importing this registers the layer `printed`, Eq. 4 and 5 alone, and the head `sigmoid`, which does without the softmax that
Eq. 10 does not print.
"""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor, nn

from karf_engine.heads.registry import HeadSizes, build_head, register_head
from karf_engine.kan.grbf import grbf, resolve_bandwidth
from karf_engine.kan.layers import INITIAL_SPLINE_STD, LayerOptions, register_layer
from karf_engine.project.settings import HeadSettings


class PrintedLayer(nn.Module):
    """sum_i w_b silu(x_i) + w_s sum_k w_k exp(-(x_i - c_k)^2 / 2h^2): no bias, no LayerNorm, w_s apart from w_k; h is learned.

    Args:
        n_in: width of the inputs.
        n_out: width of the outputs.
        options: number of centers, and h at the start.
    """

    def __init__(self, n_in: int, n_out: int, options: LayerOptions) -> None:
        super().__init__()
        self.n_centers = options.n_centers
        self.base = nn.Linear(n_in, n_out, bias=False)  # w_b
        self.spline_scale = nn.Parameter(torch.ones(n_out, 1, n_in))  # w_s
        self.spline = nn.Parameter(
            nn.init.trunc_normal_(torch.empty(n_out, self.n_centers, n_in), std=INITIAL_SPLINE_STD)
        )
        self.bandwidth = nn.Parameter(torch.tensor(resolve_bandwidth(options.bandwidth, options.n_centers)))
        self.register_buffer("no_bias", torch.zeros(n_out))

    def forward(self, x: Tensor) -> Tensor:
        """[..., n_out] of x [..., n_in]."""
        weight = torch.cat([(self.spline_scale * self.spline).flatten(1), self.base.weight], 1)
        return grbf(x, x, weight, self.no_bias, self.bandwidth, self.n_centers)


class SigmoidHead(nn.Module):
    """The full block whose outputs become weights by sigmoids, divided by their sum: softmax(log sigmoid) is just that.

    Args:
        sizes: of its inputs and outputs.
        settings: of the block.
    """

    def __init__(self, sizes: HeadSizes, settings: HeadSettings) -> None:
        super().__init__()
        widths = sizes.n_position, sizes.n_direction, sizes.n_features, sizes.n_out
        self.block = build_head(replace(settings, head="kan"), *widths)

    def forward(self, position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None = None) -> Tensor:
        """As for `Head`."""
        return nn.functional.logsigmoid(self.block(position_encoding, features, direction_encoding))


register_layer("printed", PrintedLayer)
register_head("sigmoid", SigmoidHead)
