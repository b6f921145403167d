"""Residual adaptive gating block: the head of both fields, F_s and F_w (paper, Fig. 3 and Eq. 6).

The input is z = [gamma(x), gamma(d), f_prior]; P, D, F are the widths of its parts (D = 0 without directions).

    f_h  = K2(K1(z))                                  backbone
    f_q  = Linear(z),  f_g = K(f_q)                   gate
    f'_h = sigmoid(alpha) f_q + SiLU(beta * f_g) * f_h
    logits = H([f'_h, gamma(x)])                      head

K1, K2, K and H are layers of one registered kind (layers.py): `grbf`, `bspline`, `mlp`. `beta` [width] starts at 1, the
scalar `alpha` at 0.
"""

from dataclasses import replace

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ..io.arguments import check_arguments, check_choice
from .checks import check_encodings, head_widths
from .encoding import join_inputs
from .layers import LayerOptions, build_layer

VARIANTS = ("all", "no_residual", "gate", "none")


class GatedBlock(nn.Module):
    """Map encodings and prior features to logits.

    The full block of `grbf` layers for 7 outputs (P 63, D 27, F 256) has 2,089,147 parameters and 4 bandwidths, one per
    layer. Parts that `variant` switches off have no parameters.

    Args:
        n_position: P, width of the encoded positions.
        n_direction: D, width of the encoded viewing directions; 0 without.
        n_features: F, number of prior features.
        n_out: number of logits.
        width: of the hidden layers.
        layer: a registered kind: `grbf`, `bspline`, `mlp`, or your own.
        variant: parts of Eq. 6 (paper, Table 4): `all`; `no_residual` is SiLU(beta * f_g) * f_h; `gate` is
            SiLU(f_g) * f_h; `none` is f_h alone.
        n_centers: N of Eq. 5, 2 to 8; for `grbf` only.
        bandwidth: initial h of Eq. 5, see `resolve_bandwidth`; for `grbf` only.
        learn_bandwidth: whether h is trained, one per layer; for `grbf` only.

    Example:
        >>> block = GatedBlock(n_position=9, n_direction=3, n_features=4, n_out=2, width=8)
        >>> block(torch.zeros(5, 9), torch.zeros(5, 4), torch.zeros(5, 3)).shape
        torch.Size([5, 2])
    """

    @check_arguments
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
        check_choice("variant", variant, VARIANTS)
        self._widths = head_widths(n_position, n_direction, n_features, n_out, width)
        n_in = n_position + n_direction + n_features
        options = LayerOptions(n_centers, bandwidth, learn_bandwidth)
        self.variant = variant
        self.backbone = nn.Sequential(
            build_layer(layer, n_in, width, options), build_layer(layer, width, width, options)
        )
        self.head = build_layer(layer, width + n_position, n_out, replace(options, is_output=True))
        if variant != "none":
            self.gate_linear = nn.Linear(n_in, width)
            self.gate_layer = build_layer(layer, width, width, options)
        if variant in ("all", "no_residual"):
            self.beta = nn.Parameter(torch.ones(width))
        if variant == "all":
            self.alpha = nn.Parameter(torch.zeros(()))

    def forward(self, position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None = None) -> Tensor:
        """Return logits [..., n_out].

        Args:
            position_encoding: gamma(x), [..., P].
            features: [..., F], standardized (see `Standardizer`).
            direction_encoding: gamma(d), [..., D]; None if D = 0.
        """
        check_encodings(position_encoding, features, direction_encoding, self._widths, next(self.parameters()))
        z = join_inputs(position_encoding, features, direction_encoding)
        hidden = self._gated(z, self.backbone(z))
        return self.head(torch.cat([hidden, position_encoding], dim=-1))

    def _gated(self, z: Tensor, hidden: Tensor) -> Tensor:
        """Return f'_h [..., width] from f_h, according to the variant."""
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


@check_arguments
def count_parameters(module: nn.Module) -> int:
    """Return the number of parameters of a module. Raises TypeError for anything else.

    Example:
        >>> count_parameters(nn.Linear(3, 2))
        8
    """
    return sum(parameter.numel() for parameter in module.parameters())
