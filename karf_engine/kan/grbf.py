"""Gaussian radial basis layer of a Kolmogorov-Arnold network (paper, Eq. 4 and 5), with a fast spline branch.

`x` [n, n_in] is the input, `u` the layer-normalized input. N centers c_k are evenly spaced on [-2, 2], and `bandwidth` is
h in

    B_k(u) = exp(-(u - c_k)^2 / (2 h^2)),    y_o = b_o + sum_i (sum_k W[o, k, i] B_k(u_i) + W[o, N, i] SiLU(x_i)).

`weight` is [n_out, (N + 1) * n_in]: N spline blocks, then the base block, so that one matrix product suffices.

The fast path measures u in spacings from the anchor, the center of index m = N // 2: w = (u - c_m) / spacing. With
kappa = (spacing / h)^2 and j = k - m, neighbors differ by a factor that is itself geometric in j:

    B_m = exp(-kappa w^2 / 2),    B_{j+1} / B_j = exp(kappa (w - 1/2)) exp(-kappa)^j.

So two exponentials, and multiplications outward from the anchor, give all N Gaussians. On processors with numba, kernels
(`fused.py`) compute them and the backward pass. Second derivatives, and `torch.func`, use the plain formula.
"""

import math
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from ..compute.cores import parallel_for
from ..compute.kernels import has_kernels
from ..compute.precision import to_float64
from ..errors import BadRequest
from ..io.arguments import check_arguments, check_number
from .inputs import check_same_rows, check_tensor

GRID_LIMIT = 2.0
BANDWIDTH_LIMITS = (0.35, 2.0)  # in spacings
MAX_CENTERS = 8

# u is clamped this many bandwidths outside the grid, where every basis is below 2e-8: keeps the recurrence finite.
_CLAMP_BANDWIDTHS = 6.0
# The anchor stays above exp(-80), since float32 loses digits below exp(-87).
_MAX_NEGATIVE_EXPONENT = 80.0
# Rows whose bases ((N + 1) * n_in floats each) fit a processor's cache; accelerators prefer fewer, larger launches.
_CPU_ROWS_PER_CHUNK = 256
_ACCELERATOR_ROWS_PER_CHUNK = 8192
# Partial sums of weight gradients; their number does not depend on the cores, so that the bits do not either.
_MAX_PARTIAL_SUMS = 4


@check_arguments
def grid_spacing(n_centers: int) -> float:
    """Return the distance between neighboring centers on [-2, 2]. Raises BadRequest for fewer than two centers."""
    check_number("n_centers", n_centers, 2)
    return 2 * GRID_LIMIT / (n_centers - 1)


@check_arguments
def resolve_bandwidth(bandwidth: str | float, n_centers: int) -> float:
    """Return h of Eq. 5 in units of the normalized input.

    `eq5` is the spacing, `fastkan` the spacing / sqrt(2), `xkanerf` 1 / sqrt(2); a number is h itself.
    Raises BadRequest if the name is unknown, h is outside 0.35 to 2 spacings, or n_centers is out of range.
    """
    spacing = grid_spacing(n_centers)
    named = {"eq5": spacing, "fastkan": spacing / math.sqrt(2), "xkanerf": 1 / math.sqrt(2)}
    if isinstance(bandwidth, str) and bandwidth not in named:
        raise BadRequest(f"The bandwidth '{bandwidth}' is unknown.", f"Use one of {', '.join(named)}, or a number.")
    h = named[bandwidth] if isinstance(bandwidth, str) else float(bandwidth)
    low, high = (limit * spacing for limit in BANDWIDTH_LIMITS)
    if not low <= h <= high:
        raise BadRequest(
            f"The bandwidth {h:g} is outside {low:.3g} to {high:.3g}.", "Choose 0.35 to 2 times the center spacing."
        )
    return h


@check_arguments
def grbf_reference(x: Tensor, u: Tensor, weight: Tensor, bias: Tensor, bandwidth: Tensor, n_centers: int) -> Tensor:
    """Compute the Gaussian layer by the plain formula, with all bases in memory and gradients of any order by autograd.

    Args:
        x: [..., n_in] inputs.
        u: [..., n_in] normalized inputs.
        weight: [n_out, (n_centers + 1) * n_in], spline blocks, then the base block.
        bias: [n_out].
        bandwidth: h, 0-d, within 0.35 to 2 spacings.
        n_centers: N, 2 to 8.
    """
    check_number("n_centers", n_centers, 2)
    check_tensor("x", x)
    check_tensor("weight", weight, (n_centers + 1) * x.shape[-1], x)
    check_tensor("u", u, x.shape[-1], x)
    check_same_rows("u", u, "x", x)
    check_tensor("bias", bias, len(weight), x)
    check_tensor("bandwidth", bandwidth.reshape(1, -1), 1, x)
    return _plain(x, u, weight, bias, bandwidth, n_centers)


def _plain(x: Tensor, u: Tensor, weight: Tensor, bias: Tensor, bandwidth: Tensor, n_centers: int) -> Tensor:
    centers = torch.linspace(-GRID_LIMIT, GRID_LIMIT, n_centers, dtype=u.dtype, device=u.device)
    distances = u[..., None, :] - centers[:, None]  # [.., N, n_in]
    bases = torch.exp(-(distances**2) / (2 * bandwidth**2))
    blocks = torch.cat([bases, F.silu(x)[..., None, :]], dim=-2)  # [.., N + 1, n_in]
    return F.linear(blocks.flatten(-2), weight, bias)


def grbf(x: Tensor, u: Tensor, weight: Tensor, bias: Tensor, bandwidth: Tensor, n_centers: int) -> Tensor:
    """Return the layer's output [..., n_out], keeping only x and u for the backward pass.

    Differentiable any number of times in its five tensors; second derivatives, and `torch.func`, need the memory of
    `grbf_reference`, which documents the arguments. The Gaussians equal Eq. 5 to 2e-8 for any u. Does not synchronize
    with an accelerator.
    """
    if torch._C._are_functorch_transforms_active():  # such tensors have no memory for kernels
        return _plain(x, u, weight, bias, bandwidth, n_centers)
    rows = _GRBF.apply(x.reshape(-1, x.shape[-1]), u.reshape(-1, x.shape[-1]), weight, bias, bandwidth, n_centers)
    return rows.reshape(*x.shape[:-1], len(weight))


class _Recurrence:
    """The constants and bases of one layer's recurrence; on an accelerator the constants stay there, without a sync."""

    def __init__(self, bandwidth: Tensor, n_centers: int):
        self.n_centers = n_centers
        self.anchor = n_centers // 2
        self.spacing = 2 * GRID_LIMIT / (n_centers - 1)
        h = to_float64(bandwidth.detach())
        kappa = (self.spacing / h) ** 2
        margin = _CLAMP_BANDWIDTHS * h / self.spacing
        lowest, highest = -self.anchor - margin, n_centers - 1 - self.anchor + margin
        # Narrow Gaussians would underflow at the anchor, so all bases are times exp(shift), undone by `scale`.
        shift = (kappa * torch.maximum(-lowest, highest) ** 2 / 2 - _MAX_NEGATIVE_EXPONENT).clamp_min(0)
        constants = torch.stack([kappa, lowest, highest, shift, shift.exp(), (-shift).exp(), (-kappa).exp()])
        values = constants.tolist() if h.device.type == "cpu" else constants.to(bandwidth.dtype).unbind()
        self.kappa, self.lowest, self.highest, self.shift, self.exp_shift, self.scale, self.decay = values
        self.origin = self.anchor * self.spacing - GRID_LIMIT
        self.kernels: Any = None
        if bandwidth.device.type == "cpu" and bandwidth.dtype == torch.float32 and has_kernels():
            from . import fused  # needs numba

            self.kernels = fused
            grid = self.origin, 1 / self.spacing, self.lowest, self.highest
            self.constants = tuple(map(np.float32, (*grid, self.kappa, self.shift, self.decay, self.exp_shift)))

    def fill(self, blocks: Tensor, x: Tensor, u: Tensor) -> None:
        """Write the Gaussians of u and SiLU(x), all times exp(shift), into `blocks` [rows, N + 1, n_in]."""
        if self.kernels:
            self.kernels.fill_blocks(*_arrays(x, u), self.anchor, self.constants, *_arrays(blocks))
            return
        m, last, w = self.anchor, self.n_centers - 1, self._offsets(u)
        torch.mul(w, w, out=blocks[:, m])
        blocks[:, m].mul_(self.kappa * -0.5).add_(self.shift).exp_()
        upward = (w * self.kappa).sub_(self.kappa / 2).exp_()
        downward = torch.reciprocal(upward).mul_(self.decay)
        for k in range(m + 1, last + 1):
            torch.mul(blocks[:, k - 1], upward, out=blocks[:, k])
            upward.mul_(self.decay)
        for k in range(m - 1, -1, -1):
            torch.mul(blocks[:, k + 1], downward, out=blocks[:, k])
            downward.mul_(self.decay)
        torch.sigmoid(x, out=blocks[:, -1]).mul_(x).mul_(self.exp_shift)

    def fill_gradients(
        self, blocks: Tensor, products: Tensor, x: Tensor, u: Tensor, grad_x: Tensor, grad_u: Tensor
    ) -> Tensor | float:
        """Write gradients of x and u (up to a factor); return the bandwidth's summand. May overwrite `products`."""
        if self.kernels:
            arrays = _arrays(blocks, products, grad_x, grad_u)
            return self.kernels.fill_gradients(*_arrays(x, u), self.anchor, self.constants, *arrays)
        w, gate = self._offsets(u), torch.sigmoid(x)
        torch.mul(products[:, -1], torch.rsub(gate, 1).mul_(x).add_(1).mul_(gate), out=grad_x)
        # With E_j = B_j dL/dB_j, dL/dw = kappa (sum_j j E_j - w sum_j E_j).
        shares = products[:, :-1].mul_(blocks[:, :-1])
        total = shares[:, 0].clone()
        moment = total * -self.anchor
        for k in range(1, self.n_centers):
            total.add_(shares[:, k])
            moment.add_(shares[:, k], alpha=k - self.anchor)
        weighted_total = total.mul_(w)
        torch.sub(moment, weighted_total, out=grad_u)
        return torch.sum(w * (weighted_total - 2 * moment))

    def _offsets(self, u: Tensor) -> Tensor:
        """Return w: u in spacings from the anchor, clamped to a few bandwidths beyond the grid."""
        return (u - self.origin).mul_(1 / self.spacing).clamp_(self.lowest, self.highest)


def _arrays(*tensors: Tensor) -> list[np.ndarray]:
    return [tensor.detach().numpy() for tensor in tensors]


def _chunks(u: Tensor) -> list[slice]:
    """Return slices of rows, at least one."""
    step = _CPU_ROWS_PER_CHUNK if u.device.type == "cpu" else _ACCELERATOR_ROWS_PER_CHUNK
    return [slice(start, start + step) for start in range(0, max(1, len(u)), step)]


class _GRBF(torch.autograd.Function):
    """The layer in chunks of rows, whose bases the backward pass computes again."""

    @staticmethod
    def forward(ctx, x, u, weight, bias, bandwidth, n_centers):
        recurrence = _Recurrence(bandwidth, n_centers)
        x, u = x.contiguous(), u.contiguous()
        ctx.save_for_backward(x, u, weight, bandwidth)
        ctx.recurrence = recurrence
        output, scaled = x.new_empty(x.shape[0], weight.shape[0]), weight.T * recurrence.scale
        parallel_for(_fill_outputs, len(_chunks(u)), x, u, scaled, bias, recurrence, output)
        return output

    @staticmethod
    def backward(ctx, grad_output):
        *others, grad_bandwidth = _Gradients.apply(grad_output, *ctx.saved_tensors, ctx.recurrence)
        return *others, grad_output.sum(0), grad_bandwidth, None


class _Gradients(torch.autograd.Function):
    """The gradients of x, u, weight and bandwidth; second derivatives use the plain formula."""

    @staticmethod
    def forward(ctx, grad_output, x, u, weight, bandwidth, recurrence):
        ctx.save_for_backward(grad_output, x, u, weight, bandwidth)
        ctx.n_centers = recurrence.n_centers
        n, kappa, scale = recurrence.n_centers, recurrence.kappa, recurrence.scale
        grad_x, grad_u = torch.empty_like(x), torch.empty_like(u)
        n_sums = min(_MAX_PARTIAL_SUMS, len(_chunks(u))) if u.device.type == "cpu" else 1
        grad_weights, quadratics = weight.new_zeros(n_sums, *weight.shape), u.new_zeros(n_sums)
        parallel_for(
            _fill_gradients, n_sums, x, u, weight, grad_output, recurrence, grad_x, grad_u, grad_weights, quadratics
        )
        grad_u.mul_(scale * kappa / recurrence.spacing)
        grad_weight, quadratic = grad_weights.sum(0).mul_(scale), to_float64(quadratics).sum()
        # dL/dkappa = -1/2 sum (w - j)^2 E_j. The part in j^2 needs no bases: summed over rows, E_j is W dL/dW. Both parts
        # nearly cancel, hence float64.
        per_center = (to_float64(grad_weight) * to_float64(weight)).unflatten(1, (n + 1, -1))[:, :n].sum(dim=(0, 2))
        steps = torch.arange(n, dtype=torch.float64, device=per_center.device) - recurrence.anchor
        grad_kappa = (-0.5 * (scale * quadratic + steps.square() @ per_center)).to(u)
        return grad_x, grad_u, grad_weight, grad_kappa * (-2 * kappa / bandwidth)

    @staticmethod
    def backward(ctx, *weights):
        with torch.enable_grad():
            own = [each.view_as(each) for each in ctx.saved_tensors]  # separate u from x
            grad_output, x, u, weight, bandwidth = own
            output = _plain(x, u, weight, weight.new_zeros(len(weight)), bandwidth, ctx.n_centers)
            pairs = [pair for pair in zip(own[1:], weights, strict=True) if pair[0].requires_grad]
            firsts = torch.autograd.grad(output, [each for each, _ in pairs], grad_output, create_graph=True)
            total = sum((first * weight).sum() for first, (_, weight) in zip(firsts, pairs, strict=True))
            assert isinstance(total, Tensor)
            inputs = [each for each in own if each.requires_grad]
            seconds = iter(torch.autograd.grad(total, inputs, create_graph=True, allow_unused=True))
        return *(next(seconds) if each.requires_grad else None for each in own), None


def _fill_outputs(first, last, x, u, scaled, bias, recurrence, output):
    """Write the outputs of the chunks first to last."""
    chunks = _chunks(u)
    buffer = u.new_empty(len(u[chunks[0]]), recurrence.n_centers + 1, u.shape[1])
    for rows in chunks[first:last]:
        blocks = buffer[: len(u[rows])]
        recurrence.fill(blocks, x[rows], u[rows])
        torch.addmm(bias, blocks.flatten(1), scaled, out=output[rows])


def _fill_gradients(first, last, x, u, weight, grad_output, recurrence, grad_x, grad_u, grad_weights, quadratics):
    """Write gradients of x and u (up to a factor) and the partial sums first to last of the other gradients."""
    chunks, n_sums = _chunks(u), len(quadratics)
    buffers = u.new_empty(2, len(u[chunks[0]]), recurrence.n_centers + 1, u.shape[1])
    for number in range(first, last):
        for rows in chunks[len(chunks) * number // n_sums : len(chunks) * (number + 1) // n_sums]:
            own, gradient = (x[rows], u[rows]), grad_output[rows]
            blocks, products = buffers[:, : len(gradient)]
            recurrence.fill(blocks, *own)
            grad_weights[number].addmm_(gradient.T, blocks.flatten(1))
            torch.mm(gradient, weight, out=products.flatten(1))  # dL/dB_k, then dL/dSiLU
            quadratics[number] += recurrence.fill_gradients(blocks, products, *own, grad_x[rows], grad_u[rows])
