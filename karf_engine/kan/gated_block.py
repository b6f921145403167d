"""Residual adaptive gating block: the head of both fields, F_s and F_w (paper, Fig. 3 and Eq. 6).

Convention. z = [gamma(x), gamma(d), f_prior] enters; P, D, F are the widths of its parts (D = 0 without directions).

    f_h  = K2(K1(z))                                  backbone
    f_q  = Linear(z),  f_g = K(f_q)                   gate
    f'_h = sigmoid(alpha) f_q + SiLU(beta * f_g) * f_h
    logits = H([f'_h, gamma(x)])                      head

K1, K2, K and H are layers of one kind: `grbf`, `bspline` or `mlp`. `beta` [width] starts at 1, the scalar `alpha` at 0.
"""

from bisect import bisect_left
from dataclasses import replace

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ..errors import BadRequest
from ..settings import HeadSettings
from .bspline import BSplineLayer
from .encoding import join_inputs
from .grbf import GRBFLayer
from .mlp import MLPHead, MLPLayer

LAYERS = ("grbf", "bspline", "mlp")
VARIANTS = ("all", "no_residual", "gate", "none")
HEADS = ("kan", "mlp")
WIDEST = 16384


class GatedBlock(nn.Module):
    """Map encodings and prior features to logits; `variant` switches off parts of Eq. 6 (paper, Table 4).

    `all` is Eq. 6; `no_residual` is SiLU(beta * f_g) * f_h; `gate` is SiLU(f_g) * f_h; `none` is f_h alone. Parts
    switched off hold no parameters. `n_centers`, `bandwidth` and `learn_bandwidth` concern `grbf` only. With `grbf`, the
    full block for 7 outputs (P 63, D 27, F 256) has 2,089,147 parameters and 4 bandwidths, one a layer.
    Raises BadRequest for an unknown layer or variant.
    """

    def __init__(
        self,
        n_position: int,
        n_direction: int,
        n_features: int,
        n_out: int,
        width: int = 256,
        layer: str = "grbf",
        variant: str = "all",
        n_centers: int = 8,
        bandwidth: str | float = "eq5",
        learn_bandwidth: bool = True,
    ):
        super().__init__()
        _require("layer", layer, LAYERS)
        _require("variant", variant, VARIANTS)
        n_in = n_position + n_direction + n_features
        gaussians = (n_centers, bandwidth, learn_bandwidth)
        self.variant = variant
        self.backbone = nn.Sequential(
            _build_layer(layer, n_in, width, gaussians), _build_layer(layer, width, width, gaussians)
        )
        self.head = _build_layer(layer, width + n_position, n_out, gaussians, is_output=True)
        if variant != "none":
            self.gate_linear = nn.Linear(n_in, width)
            self.gate_layer = _build_layer(layer, width, width, gaussians)
        if variant in ("all", "no_residual"):
            self.beta = nn.Parameter(torch.ones(width))
        if variant == "all":
            self.alpha = nn.Parameter(torch.zeros(()))

    def forward(self, position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None = None) -> Tensor:
        """Return logits [n, n_out] for encodings [n, P], [n, D] (None if D = 0) and standardized features [n, F]."""
        z = join_inputs(position_encoding, features, direction_encoding)
        hidden = self._gated(z, self.backbone(z))
        return self.head(torch.cat([hidden, position_encoding], dim=-1))

    def _gated(self, z: Tensor, hidden: Tensor) -> Tensor:
        """Return f'_h [n, width] from f_h, as the variant says."""
        if self.variant == "none":
            return hidden
        shallow = self.gate_linear(z)
        gate = self.gate_layer(shallow)
        if self.variant == "gate":
            return F.silu(gate) * hidden
        adapted = F.silu(self.beta * gate) * hidden
        if self.variant == "no_residual":
            return adapted
        return torch.sigmoid(self.alpha) * shallow + adapted


def build_head(settings: HeadSettings, n_position: int, n_direction: int, n_features: int, n_out: int) -> nn.Module:
    """Return the head that the settings describe: a `GatedBlock`, or an `MLPHead`, which reads only their width.

    With match = parameters its width is the one whose parameters are nearest in number to those of the full block of
    Gaussian layers that is `settings.width` wide. All heads are called with (position_encoding, features,
    direction_encoding). Raises BadRequest for an unknown kind of head or layer, and for what a layer refuses.
    """
    sizes = (n_position, n_direction, n_features, n_out)
    if settings.match == "parameters":
        full = replace(settings, head="kan", layer="grbf", variant="all")
        settings = replace(settings, width=_matched_width(settings, sizes, _n_parameters(full, sizes)))
    return _build(settings, sizes)


def count_parameters(module: nn.Module) -> int:
    """Number of trainable numbers in a module."""
    return sum(parameter.numel() for parameter in module.parameters())


def _build(settings: HeadSettings, sizes: tuple[int, int, int, int]) -> nn.Module:
    _require("head", settings.head, HEADS)
    if settings.head == "mlp":
        return MLPHead(*sizes, settings.width)
    return GatedBlock(
        *sizes,
        settings.width,
        settings.layer,
        settings.variant,
        settings.centers,
        settings.bandwidth,
        settings.learn_bandwidth,
    )


def _n_parameters(settings: HeadSettings, sizes: tuple[int, int, int, int]) -> int:
    with torch.device("meta"):  # shapes without memory
        return count_parameters(_build(settings, sizes))


def _matched_width(settings: HeadSettings, sizes: tuple[int, int, int, int], wanted: int) -> int:
    """The width whose parameters are nearest in number to `wanted`; the number grows with the width."""

    def count(width: int) -> int:
        return _n_parameters(replace(settings, width=width), sizes)

    above = bisect_left(range(WIDEST), wanted, lo=2, key=count)
    return min(above - 1, above, key=lambda width: abs(count(width) - wanted))


def _build_layer(
    kind: str, n_in: int, n_out: int, gaussians: tuple[int, str | float, bool], is_output: bool = False
) -> nn.Module:
    if kind == "grbf":
        return GRBFLayer(n_in, n_out, *gaussians)
    if kind == "bspline":
        return BSplineLayer(n_in, n_out)
    return MLPLayer(n_in, n_out, is_output)


def _require(what: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise BadRequest(f"The {what} '{value}' is unknown.", f"Use one of {', '.join(choices)}.")
