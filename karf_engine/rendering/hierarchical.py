"""Where a NeRF's rays are sampled: a coarse pass, then more where that pass saw something (NeRF, Sec. 5.2).

`t` [R, N] sorted: parameters of the samples along their rays. ray_weights [R, N]: transmittance times alpha. The forms
are those of the original implementation (bmild/nerf), so that its checkpoints look the same here.
"""

from __future__ import annotations

import torch
from torch import Tensor

LAST_INTERVAL = 1e10  # the last sample's: what reaches it and meets any density ends there
FLOOR = 1e-5  # added to the weights, so that no place is left out for good


def spread(near: float, far: float, count: int, in_disparity: bool, jitter: Tensor) -> Tensor:
    """`count` values of t from near to far, one in each of the stretches between the middles of an even spread.

    jitter: [R, count] in [0, 1), place within the stretch; or [R, 0], which gives the even spread itself. in_disparity:
    even in 1 / t, where 0 < near; else in t.
    """
    share = torch.linspace(0, 1, count, device=jitter.device)
    even = 1 / ((1 - share) / near + share / far) if in_disparity else near + (far - near) * share
    if not jitter.shape[1]:
        return even.expand(len(jitter), count)
    middles = (even[1:] + even[:-1]) / 2
    lower, upper = torch.cat([even[:1], middles]), torch.cat([middles, even[-1:]])
    return lower + (upper - lower) * jitter


def interval_lengths(t: Tensor) -> Tensor:
    """Distance from each sample to the next one, in units of t; the last one's has no end."""
    return torch.cat([t[:, 1:] - t[:, :-1], torch.full_like(t[:, :1], LAST_INTERVAL)], 1)


def dense_ray_weights(sigmas: Tensor, deltas: Tensor) -> Tensor:
    """T_i (1 - exp(-sigma_i delta_i)) of rays with as many samples each, [R, N]; differentiable."""
    optical_depths = sigmas * deltas
    # exclusive by leaving the last one out: it may be huge, and subtracting it again would take all digits
    before = torch.cumsum(optical_depths[:, :-1], 1)
    before = torch.cat([torch.zeros_like(before[:, :1]), before], 1)
    return torch.exp(-before) * -torch.expm1(-optical_depths)


def sample_pdf(edges: Tensor, weights: Tensor, u: Tensor) -> Tensor:
    """Samples of a piecewise constant density: its inverse distribution function at u, [R, N].

    edges: [R, M + 1] sorted; weights: [R, M] >= 0 of the stretches between them; u: [R, N] in [0, 1].
    """
    weights = weights + FLOOR
    cdf = torch.cumsum(weights / weights.sum(1, keepdim=True), 1)
    cdf = torch.cat([torch.zeros_like(cdf[:, :1]), cdf], 1)
    above = torch.searchsorted(cdf, u.contiguous(), right=True).clamp_max(cdf.shape[1] - 1)
    below = torch.searchsorted(cdf, u.contiguous(), right=True).sub(1).clamp_min(0)
    low, high = cdf.gather(1, below), cdf.gather(1, above)
    size = high - low
    share = (u - low) / torch.where(size < FLOOR, torch.ones_like(size), size)
    first = edges.gather(1, below)
    return first + share * (edges.gather(1, above) - first)


def refine(t: Tensor, ray_weights: Tensor, u: Tensor) -> Tensor:
    """The samples t [R, N] of the coarse pass and those that its weights [R, N] ask for at u [R, F], sorted."""
    middles = (t[:, 1:] + t[:, :-1]) / 2
    return torch.sort(torch.cat([t, sample_pdf(middles, ray_weights[:, 1:-1], u)], 1), 1).values
