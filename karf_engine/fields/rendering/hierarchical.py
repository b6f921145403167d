"""Hierarchical sampling of rays: a coarse pass, then importance sampling of its weights (NeRF, Sec. 5.2).

`t` [R, N], sorted, are ray parameters; `ray_weights` [R, N] are transmittance times alpha. The formulas follow the
original implementation (bmild/nerf), so that its checkpoints render alike.
"""

from __future__ import annotations

import torch
from torch import Tensor

LAST_INTERVAL = 1e10  # length of the last interval: any density there absorbs the rest of the light
FLOOR = 1e-5  # added to the weights, so that every interval can be sampled


def stratified_samples(near: float, far: float, count: int, in_disparity: bool, jitter: Tensor) -> Tensor:
    """Draw stratified samples along rays, one in each of `count` intervals (NeRF, Eq. 2).

    The interval borders are the midpoints of evenly spaced values.

    Args:
        near: First t; positive where `in_disparity`.
        far: Last t.
        count: N.
        in_disparity: Space evenly in 1 / t instead of t.
        jitter: [R, N] in [0, 1), position within each interval; or [R, 0] for the evenly spaced values.

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
    """Return the distance from each sample to the next, [R, N]; LAST_INTERVAL for the last one.

    Example:
        >>> interval_lengths(torch.tensor([[2.0, 3.0, 5.0]]))
        tensor([[1.0000e+00, 2.0000e+00, 1.0000e+10]])
    """
    return torch.cat([t[:, 1:] - t[:, :-1], torch.full_like(t[:, :1], LAST_INTERVAL)], 1)


def dense_ray_weights(sigmas: Tensor, deltas: Tensor) -> Tensor:
    """Compute ray weights T_i (1 - exp(-sigma_i delta_i)), [R, N] in [0, 1], of N samples per ray (NeRF, Eq. 3).

    Differentiable in densities [R, N] >= 0 and interval lengths [R, N]. See `volume` for packed samples.

    Example:
        >>> dense_ray_weights(torch.tensor([[0.0, 0.6931, 0.6931]]), torch.ones(1, 3))
        tensor([[0.0000, 0.5000, 0.2500]])
    """
    optical_depths = sigmas * deltas
    # an exclusive sum: adding and subtracting the last depth, which may be huge, would cost all digits
    before = torch.cumsum(optical_depths[:, :-1], 1)
    before = torch.cat([torch.zeros_like(before[:, :1]), before], 1)
    return torch.exp(-before) * -torch.expm1(-optical_depths)


def sample_pdf(edges: Tensor, weights: Tensor, u: Tensor) -> Tensor:
    """Invert the distribution function of a piecewise constant density at u.

    The choice of the interval is not differentiable in `weights`.

    Args:
        edges: [R, M + 1], sorted along each ray.
        weights: [R, M] >= 0, unnormalized; FLOOR is added to each.
        u: [R, N] in [0, 1].

    Returns:
        Samples [R, N], in the order of u.

    Example:
        >>> sample_pdf(torch.tensor([[0.0, 1.0, 2.0]]), torch.tensor([[1.0, 1.0]]), torch.tensor([[0.25, 0.75]]))
        tensor([[0.5000, 1.5000]])
    """
    weights = weights + FLOOR
    cdf = torch.cumsum(weights / weights.sum(1, keepdim=True), 1)
    cdf = torch.cat([torch.zeros_like(cdf[:, :1]), cdf], 1)
    upper = torch.searchsorted(cdf, u.contiguous(), right=True)
    below, above = (upper - 1).clamp_min(0), upper.clamp_max(cdf.shape[1] - 1)
    low, high = cdf.gather(1, below), cdf.gather(1, above)
    size = high - low
    share = (u - low) / torch.where(size < FLOOR, torch.ones_like(size), size)
    first = edges.gather(1, below)
    return first + share * (edges.gather(1, above) - first)


def refine(t: Tensor, ray_weights: Tensor, u: Tensor) -> Tensor:
    """Add importance samples of the coarse weights to the coarse samples: t [R, N] to [R, N + F] (NeRF, Sec. 5.2).

    `u` [R, F] in [0, 1] are the arguments of the inverse distribution function.

    Example:
        >>> t, weights = torch.tensor([[0.0, 1.0, 2.0, 3.0]]), torch.tensor([[0.0, 0.0, 1.0, 0.0]])
        >>> refine(t, weights, torch.tensor([[0.5]]))  # between 1.5 and 2.5, around the third sample
        tensor([[0.0000, 1.0000, 2.0000, 2.0000, 3.0000]])
    """
    middles = (t[:, 1:] + t[:, :-1]) / 2
    return torch.sort(torch.cat([t, sample_pdf(middles, ray_weights[:, 1:-1], u)], 1), 1).values
