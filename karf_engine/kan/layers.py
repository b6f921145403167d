"""Layers of Kolmogorov-Arnold networks, modules from [..., n_in] to [..., n_out], and their registry by name.

Add a layer with `register_layer`, or as an entry point `karf.layers` that is its builder.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ..errors import BadRequest
from ..io.arguments import check_arguments, check_choice, check_fields, check_number
from ..io.plugins import load_plugin, plugin_names
from ..project.settings import LAYER_KINDS
from .grbf import BANDWIDTH_LIMITS, GRID_LIMIT, MAX_CENTERS, grbf, grid_spacing, resolve_bandwidth
from .inputs import check_tensor, check_widths

INITIAL_SPLINE_STD = 0.02


class GRBFLayer(nn.Module):
    """Gaussians of the normalized input, plus a SiLU base branch (paper, Eq. 4 and 5).

    It has n_in * n_out * (n_centers + 1) + n_out + 2 * n_in parameters, plus 1 if the bandwidth is learned.

    Args:
        n_centers: N of Eq. 5, 2 to 8.
        bandwidth: initial h of Eq. 5, one for the whole layer; see `resolve_bandwidth`.
        learn_bandwidth: make its logarithm, `log_bandwidth`, a parameter, clamped to 0.35 to 2 spacings (with zero
            gradient beyond). Otherwise it is a buffer.
    """

    @check_arguments
    def __init__(
        self, n_in: int, n_out: int, n_centers: int = 8, bandwidth: str | float = "eq5", learn_bandwidth: bool = True
    ):
        super().__init__()
        check_widths(1, n_in=n_in, n_out=n_out)
        check_number("n_centers", n_centers, 2, MAX_CENTERS)
        self.n_centers = n_centers
        self._log_limits = [math.log(limit * grid_spacing(n_centers)) for limit in BANDWIDTH_LIMITS]
        self.norm = nn.LayerNorm(n_in)
        base = nn.Linear(n_in, n_out)
        # A wider start makes the first logits of a 256-wide block too confident.
        spline_weight = nn.init.trunc_normal_(torch.empty(n_out, n_centers * n_in), std=INITIAL_SPLINE_STD)
        self.weight = nn.Parameter(torch.cat([spline_weight, base.weight.detach()], dim=1))
        self.bias = base.bias
        log_bandwidth = torch.tensor(math.log(resolve_bandwidth(bandwidth, n_centers)))
        if learn_bandwidth:
            self.log_bandwidth = nn.Parameter(log_bandwidth)
        else:
            self.register_buffer("log_bandwidth", log_bandwidth)

    def bandwidth(self) -> Tensor:
        """Return h, a 0-d tensor within 0.35 to 2 spacings."""
        return self.log_bandwidth.clamp(*self._log_limits).exp()

    def forward(self, x: Tensor) -> Tensor:
        """Return [..., n_out] for x [..., n_in]."""
        check_tensor("x", x, self.norm.normalized_shape[0], self.weight)
        return grbf(x, self.norm(x), self.weight, self.bias, self.bandwidth(), self.n_centers)


class BSplineLayer(nn.Module):
    """A B-spline and a SiLU on every edge, without bias (Liu et al. 2024), for comparison (paper, Fig. 7).

    Every edge owns grid + order spline weights (see `bspline_bases`), one spline scale and one base weight. `layer_norm`
    normalizes the splines' inputs, with 2 * n_in parameters; without it, only the base branch acts far outside [-2, 2].
    """

    @check_arguments
    def __init__(self, n_in: int, n_out: int, grid: int = 5, order: int = 3, layer_norm: bool = True):
        super().__init__()
        check_widths(1, n_in=n_in, n_out=n_out, grid=grid)
        check_widths(0, order=order)
        self.grid = grid
        self.order = order
        self.norm = nn.LayerNorm(n_in) if layer_norm else nn.Identity()
        self.base = nn.Linear(n_in, n_out, bias=False)
        self.spline_weight = nn.Parameter(torch.empty(n_out, grid + order, n_in))
        self.spline_scale = nn.Parameter(torch.ones(n_out, 1, n_in))
        nn.init.trunc_normal_(self.spline_weight, std=INITIAL_SPLINE_STD)

    def forward(self, x: Tensor) -> Tensor:
        """Return [..., n_out] for x [..., n_in]."""
        check_tensor("x", x, self.base.in_features, self.base.weight)
        bases = _bspline_bases(self.norm(x), self.grid, self.order)
        weight = self.spline_weight * self.spline_scale
        return self.base(F.silu(x)) + F.linear(bases.flatten(-2), weight.flatten(1))


@check_arguments
def bspline_bases(u: Tensor, grid: int, order: int) -> Tensor:
    """Return the values [..., grid + order, n_in] of uniform B-splines on `grid` equal intervals of [-2, 2].

    They sum to 1 where u [..., n_in] is within [-2, 2), and are differentiable in u for an order p >= 1. With
    t = (u + 2) / interval, those with support (i, i + p + 1), i = -p .. grid - 1, follow the Cox-de Boor recursion

        B_i^0(t) = 1 on [i, i + 1),    B_i^p(t) = ((t - i) B_i^{p-1}(t) + (i + p + 1 - t) B_{i+1}^{p-1}(t)) / p.
    """
    check_tensor("u", u)
    check_widths(1, grid=grid)
    check_widths(0, order=order)
    return _bspline_bases(u, grid, order)


def _bspline_bases(u: Tensor, grid: int, order: int) -> Tensor:
    t = (u[..., None, :] + GRID_LIMIT) * (grid / (2 * GRID_LIMIT))
    starts = torch.arange(-order, grid + order, dtype=u.dtype, device=u.device)[:, None]
    bases = ((t >= starts) & (t < starts + 1)).to(u.dtype)  # [.., grid + 2 * order, n_in]
    for p in range(1, order + 1):
        left = starts[:-p]
        bases = ((t - left) * bases[..., :-1, :] + (left + p + 1 - t) * bases[..., 1:, :]) / p
    return bases


class MLPLayer(nn.Module):
    """A linear layer and, unless it is an output layer, a ReLU."""

    @check_arguments
    def __init__(self, n_in: int, n_out: int, is_output: bool = False):
        super().__init__()
        check_widths(1, n_in=n_in, n_out=n_out)
        self.linear = nn.Linear(n_in, n_out)
        self.activation = nn.Identity() if is_output else nn.ReLU()

    def forward(self, x: Tensor) -> Tensor:
        """Return [..., n_out] for x [..., n_in]."""
        check_tensor("x", x, self.linear.in_features, self.linear.weight)
        return self.activation(self.linear(x))


@dataclass(frozen=True)
class LayerOptions:
    """Options of a layer; each kind reads its own: `grbf` the first three (see `GRBFLayer`), `mlp` the last one."""

    n_centers: int = 8
    bandwidth: str | float = "eq5"
    learn_bandwidth: bool = True
    is_output: bool = False  # the last layer, without activation

    def __post_init__(self) -> None:
        check_fields(self)
        check_number("n_centers", self.n_centers, 2, MAX_CENTERS)
        resolve_bandwidth(self.bandwidth, self.n_centers)


LayerBuilder = Callable[[int, int, LayerOptions], nn.Module]  # of n_in, n_out and options

PLUGINS = "karf.layers"
LAYERS: dict[str, LayerBuilder] = {}


@check_arguments
def register_layer(name: str, build: LayerBuilder) -> None:
    """Add a kind of layer for `GatedBlock` and the settings `segmentation.layer` and `recoloring.layer`.

    `build` returns a layer for n_in, n_out and options. Raises BadRequest where another kind has this name.
    """
    if not name or LAYERS.setdefault(name, build) is not build:
        raise BadRequest(f"There is another kind of layer {name!r}.", "Choose another name.")
    if name not in LAYER_KINDS:
        LAYER_KINDS.append(name)


def build_layer(kind: str, n_in: int, n_out: int, options: LayerOptions) -> nn.Module:
    """Return a new layer of a registered kind. Raises BadRequest for an unknown kind."""
    if kind not in LAYERS and kind in plugin_names(PLUGINS):
        register_layer(kind, load_plugin(PLUGINS, kind))
    check_choice("layer", kind, tuple(LAYERS))
    return LAYERS[kind](n_in, n_out, options)


def _build_grbf(n_in: int, n_out: int, options: LayerOptions) -> nn.Module:
    return GRBFLayer(n_in, n_out, options.n_centers, options.bandwidth, options.learn_bandwidth)


register_layer("grbf", _build_grbf)
register_layer("bspline", lambda n_in, n_out, options: BSplineLayer(n_in, n_out))
register_layer("mlp", lambda n_in, n_out, options: MLPLayer(n_in, n_out, options.is_output))
