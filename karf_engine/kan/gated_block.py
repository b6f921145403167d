"""Networks of both fields, F_s and F_w: the residual adaptive gating block (paper, Fig. 3 and Eq. 6), and a plain MLP.

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
from .inputs import check_tensor, check_widths, join_inputs
from .layers import LayerOptions, MLPLayer, build_layer

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
        n_centers, bandwidth, learn_bandwidth: see `GRBFLayer`; for `grbf` only.
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
        check_widths(1, n_position=n_position, n_out=n_out, width=width)
        check_widths(0, n_direction=n_direction, n_features=n_features)
        self._widths = n_position, n_direction, n_features
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
        z = _join(self, position_encoding, features, direction_encoding)
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


class MLPHead(nn.Module):
    """Map encodings and prior features to logits by two hidden ReLU layers; for the arguments see `GatedBlock`."""

    @check_arguments
    def __init__(self, n_position: int, n_direction: int, n_features: int, n_out: int, width: int = 64):
        super().__init__()
        check_widths(1, n_position=n_position, n_out=n_out, width=width)
        check_widths(0, n_direction=n_direction, n_features=n_features)
        self._widths = n_position, n_direction, n_features
        self.layers = nn.Sequential(
            MLPLayer(n_position + n_direction + n_features, width),
            MLPLayer(width, width),
            MLPLayer(width, n_out, is_output=True),
        )

    def forward(self, position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None = None) -> Tensor:
        """Return logits [..., n_out]; see `GatedBlock.forward`."""
        return self.layers(_join(self, position_encoding, features, direction_encoding))


def _join(
    head: GatedBlock | MLPHead, position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None
) -> Tensor:
    """Check the inputs of a head, and join them."""
    (n_position, n_direction, n_features), like = head._widths, next(head.parameters())
    check_tensor("position_encoding", position_encoding, n_position, like)
    check_tensor("features", features, n_features, like)
    if n_direction or direction_encoding is not None:
        check_tensor("direction_encoding", direction_encoding, n_direction, like)
    return join_inputs(position_encoding, features, direction_encoding)


@check_arguments
def count_parameters(module: nn.Module) -> int:
    """Return the number of parameters of a module. Raises TypeError for anything else."""
    return sum(parameter.numel() for parameter in module.parameters())
