"""B-spline layer of a Kolmogorov-Arnold network, for comparison with the Gaussian layer (paper, Fig. 7).

The range [-2, 2] is divided into `grid` equal intervals, and t = (u + 2) / interval. The uniform B-splines of `order` p
with support (i, i + p + 1), i = -p .. grid - 1, follow the Cox-de Boor recursion

    B_i^0(t) = 1 on [i, i + 1),    B_i^p(t) = ((t - i) B_i^{p-1}(t) + (i + p + 1 - t) B_{i+1}^{p-1}(t)) / p.

They sum to 1 inside the range and vanish outside their support, so only the base branch acts far outside the range.
"""

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ..io.arguments import check_arguments, check_number
from .checks import check_rows, check_vectors

GRID_LIMIT = 2.0
INITIAL_SPLINE_STD = 0.02


@check_arguments
def bspline_bases(u: Tensor, grid: int, order: int) -> Tensor:
    """Return the values of the B-splines, differentiable in u for `order` >= 1.

    Args:
        u: [..., n_in].
        grid: number of intervals on [-2, 2].
        order: p.

    Returns:
        [..., grid + order, n_in] in [0, 1]; they sum to 1 over the splines where u is within [-2, 2).

    Example:
        >>> bspline_bases(torch.tensor([[-2.0], [0.0]]), grid=2, order=1)[..., 0]
        tensor([[1., 0., 0.],
                [0., 1., 0.]])
    """
    check_vectors("u", u)
    _check_sizes(grid, order)
    return _bases(u, grid, order)


def _bases(u: Tensor, grid: int, order: int) -> Tensor:
    t = (u[..., None, :] + GRID_LIMIT) * (grid / (2 * GRID_LIMIT))
    starts = torch.arange(-order, grid + order, dtype=u.dtype, device=u.device)[:, None]
    bases = ((t >= starts) & (t < starts + 1)).to(u.dtype)  # [.., grid + 2 * order, n_in]
    for p in range(1, order + 1):
        left = starts[:-p]
        bases = ((t - left) * bases[..., :-1, :] + (left + p + 1 - t) * bases[..., 1:, :]) / p
    return bases


def _check_sizes(grid: int, order: int) -> None:
    check_number("grid", grid, 1)
    check_number("order", order, 0)


class BSplineLayer(nn.Module):
    """Map [..., n_in] to [..., n_out]: a B-spline and a SiLU on every edge, without bias (Liu et al. 2024).

    Every edge owns grid + order spline weights, one spline scale and one base weight.

    Args:
        n_in: width of the inputs.
        n_out: width of the outputs.
        grid: number of intervals on [-2, 2].
        order: of the splines.
        layer_norm: normalize the splines' inputs first, with 2 * n_in parameters. Without it, only the base branch
            sees inputs far outside [-2, 2].

    Example:
        >>> BSplineLayer(3, 2)(torch.zeros(5, 3)).shape
        torch.Size([5, 2])
    """

    @check_arguments
    def __init__(self, n_in: int, n_out: int, grid: int = 5, order: int = 3, layer_norm: bool = True):
        super().__init__()
        check_number("n_in", n_in, 1)
        check_number("n_out", n_out, 1)
        _check_sizes(grid, order)
        self.grid = grid
        self.order = order
        self.norm = nn.LayerNorm(n_in) if layer_norm else nn.Identity()
        self.base = nn.Linear(n_in, n_out, bias=False)
        self.spline_weight = nn.Parameter(torch.empty(n_out, grid + order, n_in))
        self.spline_scale = nn.Parameter(torch.ones(n_out, 1, n_in))
        nn.init.trunc_normal_(self.spline_weight, std=INITIAL_SPLINE_STD)

    def forward(self, x: Tensor) -> Tensor:
        """Return [..., n_out] for x [..., n_in]."""
        check_rows("x", x, self.base.in_features, self.base.weight)
        bases = _bases(self.norm(x), self.grid, self.order)
        weight = self.spline_weight * self.spline_scale
        return self.base(F.silu(x)) + F.linear(bases.flatten(-2), weight.flatten(1))
