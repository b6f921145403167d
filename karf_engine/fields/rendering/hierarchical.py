"""Where a NeRF's rays are sampled: a coarse pass, then more where that pass saw something (NeRF, Sec. 5.2).

`t` [R, N], sorted: parameters of the samples along their rays. `ray_weights` [R, N]: transmittance times alpha. The
forms are those of the original implementation (bmild/nerf), so that its checkpoints look the same here.
"""

from __future__ import annotations

import torch
from torch import Tensor

LAST_INTERVAL = 1e10  # the last sample's: what reaches it and meets any density ends there
FLOOR = 1e-5  # added to the weights, so that no place is left out for good


def stratified_samples(near: float, far: float, count: int, in_disparity: bool, jitter: Tensor) -> Tensor:
    """Stratified samples along rays: one in each of `count` intervals from near to far (NeRF, Eq. 2).

    The intervals meet in the middles between evenly spaced values.

    Args:
        near: Where rays begin, in units of t; positive where `in_disparity`.
        far: Where rays end, in units of t.
        count: Samples a ray, N.
        in_disparity: Space evenly in 1 / t; else in t.
        jitter: [R, N] in [0, 1), the place within each interval; or [R, 0], which gives the evenly spaced values.

    Returns:
        t [R, N], sorted along each ray.

    Example:
        >>> stratified_samples(2, 6, 5, False, torch.zeros(1, 0))
        tensor([[2., 3., 4., 5., 6.]])
        >>> stratified_samples(2, 6, 5, False, torch.full((1, 5), 0.5))
        tensor([[2.2500, 3.0000, 4.0000, 5.0000, 5.7500]])
    """
    share = torch.linspace(0, 1, count, device=jitter.device)
    even = 1 / ((1 - share) / near + share / far) if in_disparity else near + (far - near) * share
    if not jitter.shape[1]:
        return even.expand(len(jitter), count)
    middles = (even[1:] + even[:-1]) / 2
    lower, upper = torch.cat([even[:1], middles]), torch.cat([middles, even[-1:]])
    return lower + (upper - lower) * jitter


def interval_lengths(t: Tensor) -> Tensor:
    """Distance from each sample to the next one; the last one's interval has no end.

    Args:
        t: [R, N], sorted along each ray.

    Returns:
        Lengths [R, N], in units of t; LAST_INTERVAL in the last column.

    Example:
        >>> interval_lengths(torch.tensor([[2.0, 3.0, 5.0]]))
        tensor([[1.0000e+00, 2.0000e+00, 1.0000e+10]])
    """
    return torch.cat([t[:, 1:] - t[:, :-1], torch.full_like(t[:, :1], LAST_INTERVAL)], 1)


def dense_ray_weights(sigmas: Tensor, deltas: Tensor) -> Tensor:
    """Ray weights T_i (1 - exp(-sigma_i delta_i)) of rays with as many samples each (NeRF, Eq. 3).

    Differentiable in both arguments. `fields.rendering.volume.ray_weights_from_sigmas` does the same for packed samples.

    Args:
        sigmas: Densities [R, N] >= 0, per unit of length.
        deltas: Interval lengths [R, N], in that unit.

    Returns:
        Weights [R, N] in [0, 1]; each ray's sum is its opacity.

    Example:
        >>> dense_ray_weights(torch.tensor([[0.0, 0.6931, 0.6931]]), torch.ones(1, 3))
        tensor([[0.0000, 0.5000, 0.2500]])
    """
    optical_depths = sigmas * deltas
    # exclusive by leaving the last one out: it may be huge, and subtracting it again would take all digits
    before = torch.cumsum(optical_depths[:, :-1], 1)
    before = torch.cat([torch.zeros_like(before[:, :1]), before], 1)
    return torch.exp(-before) * -torch.expm1(-optical_depths)


def sample_pdf(edges: Tensor, weights: Tensor, u: Tensor) -> Tensor:
    """Samples of a piecewise constant density: its inverse distribution function at u.

    Not differentiable in `weights` where it chooses an interval; fits detach them.

    Args:
        edges: [R, M + 1], sorted along each ray.
        weights: [R, M] >= 0, of the intervals between the edges; FLOOR is added to each.
        u: [R, N] in [0, 1].

    Returns:
        Samples [R, N], within the edges and in the order of u.

    Example:
        >>> sample_pdf(torch.tensor([[0.0, 1.0, 2.0]]), torch.tensor([[1.0, 1.0]]), torch.tensor([[0.25, 0.75]]))
        tensor([[0.5000, 1.5000]])
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
    """Coarse samples joined with those that their weights ask for (NeRF, Sec. 5.2).

    Args:
        t: Coarse samples [R, N], sorted along each ray.
        ray_weights: [R, N] >= 0, of the coarse pass.
        u: [R, F] in [0, 1], where the inverse distribution function is read.

    Returns:
        All samples [R, N + F], sorted along each ray.

    Example:
        >>> t, weights = torch.tensor([[0.0, 1.0, 2.0, 3.0]]), torch.tensor([[0.0, 0.0, 1.0, 0.0]])
        >>> refine(t, weights, torch.tensor([[0.5]]))  # between 1.5 and 2.5, where the third sample is
        tensor([[0.0000, 1.0000, 2.0000, 2.0000, 3.0000]])
    """
    middles = (t[:, 1:] + t[:, :-1]) / 2
    return torch.sort(torch.cat([t, sample_pdf(middles, ray_weights[:, 1:-1], u)], 1), 1).values
