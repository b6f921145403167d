"""Differentiable volume rendering of packed samples.

The S samples of R rays are packed into one dimension, sorted by ray and then by distance; `ray_indices` [S] maps a
sample to its ray. With density sigma_i and interval length delta_i:

    optical_depths       sigma_i delta_i
    alphas               1 - exp(-sigma_i delta_i)
    transmittance        T_i = exp(-sum over j < i of sigma_j delta_j)
    ray_weights          T_i alpha_i
    final_transmittance  exp(-sum of all sigma_j delta_j), per ray; a ray's weights and it sum to 1
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from ...compute.precision import to_float64
from .sampling import Samples

VISIBLE_WEIGHT = 1e-4  # samples below this weight get no color: they cannot change an 8-bit pixel


def transmittance_from_optical_depths(optical_depths: Tensor, ray_indices: Tensor) -> Tensor:
    """Compute the transmittance [S] in (0, 1] in front of each sample from optical depths [S] >= 0.

    Differentiable in optical depths up to 100. One float64 cumulative sum covers all rays: float32 would lose up to
    1e-3 of transmittance.
    """
    # exp(-100) is negligible, and a huge summand would cost later rays their digits
    limited = to_float64(optical_depths).clamp_max(100)
    before = torch.cumsum(limited, 0) - limited
    return torch.exp(_of_ray_start(before, ray_indices) - before).to(optical_depths)


def ray_weights_from_sigmas(sigmas: Tensor, deltas: Tensor | float, ray_indices: Tensor) -> Tensor:
    """Compute the ray weights T_i (1 - exp(-sigma_i delta_i)), [S] in [0, 1] (paper, Eq. 8).

    Differentiable in densities [S] >= 0, per unit of length, and in interval lengths [S], or one for all.

    Example:
        >>> ray_weights_from_sigmas(torch.tensor([0.0, 0.6931, 0.6931]), 1.0, torch.tensor([0, 0, 0]))
        tensor([0.0000, 0.5000, 0.2500])
    """
    optical_depths = sigmas * deltas
    # expm1: 1 - exp(-x) is 40 % off at x = 1e-7 in float32
    alphas = -torch.expm1(-optical_depths)
    return transmittance_from_optical_depths(optical_depths, ray_indices) * alphas


def distortion(
    ray_weights: Tensor, distances: Tensor, step: float | Tensor, ray_indices: Tensor, n_rays: int
) -> Tensor:
    """Compute the distortion loss [R] of each ray (Mip-NeRF 360, Eq. 15). Differentiable in the weights [S].

    `step` is the interval length, one for all samples or [S], in the unit of `distances` [S].
    """
    weights = to_float64(ray_weights)
    moments, ray_indices = weights * to_float64(distances), ray_indices.to(weights.device)
    before = torch.cumsum(weights, 0) - weights
    before = before - _of_ray_start(before, ray_indices)
    moments_before = torch.cumsum(moments, 0) - moments
    moments_before = moments_before - _of_ray_start(moments_before, ray_indices)
    # the sum over all pairs of a ray, in one pass: pair each sample with all before it
    pairs = 2 * (moments * before - weights * moments_before) + step / 3 * weights**2
    sums = torch.zeros(n_rays, dtype=pairs.dtype, device=pairs.device)
    return sums.index_add(0, ray_indices, pairs).to(ray_weights)


def _of_ray_start(values: Tensor, ray_indices: Tensor) -> Tensor:
    """Return the value [S] at the first sample of each sample's ray."""
    return values[torch.searchsorted(ray_indices, ray_indices).to(values.device)]


def accumulate(ray_weights: Tensor, values: Tensor | None, ray_indices: Tensor, n_rays: int) -> Tensor:
    """Sum ray_weights [S] * values [S, C] over each ray, [R, C]; 0 for rays without samples. Differentiable in both.

    Without values, sum the weights to the opacity [R, 1].
    """
    weighted = ray_weights[:, None] if values is None else ray_weights[:, None] * values
    result = torch.zeros(n_rays, weighted.shape[1], dtype=weighted.dtype, device=weighted.device)
    return result.index_add(0, ray_indices, weighted)


def final_transmittance_from_sigmas(sigmas: Tensor, deltas: Tensor | float, ray_indices: Tensor, n_rays: int) -> Tensor:
    """Compute the transmittance [R] in [0, 1] behind the last sample of each ray; 1 for rays without samples.

    Never negative, unlike 1 - sum(ray_weights).
    """
    optical_depths = sigmas * deltas
    total = torch.zeros(n_rays, dtype=optical_depths.dtype, device=optical_depths.device)
    return torch.exp(-total.index_add(0, ray_indices, optical_depths))


@dataclass(frozen=True)
class Trace:
    """Samples of R rays through a frozen field, with their ray weights."""

    samples: Samples
    ray_weights: Tensor  # [S] in [0, 1]
    final_transmittance: Tensor  # [R] in [0, 1]


def make_trace(samples: Samples, sigmas: Tensor, n_rays: int) -> Trace:
    """Build a trace of `n_rays` rays from samples and their densities [S] >= 0, per grid unit."""
    return Trace(
        samples,
        ray_weights_from_sigmas(sigmas, samples.step, samples.ray_indices),
        final_transmittance_from_sigmas(sigmas, samples.step, samples.ray_indices, n_rays),
    )


def outward_normals(density: Callable[[Tensor], Tensor], positions: Tensor, reach: float) -> Tensor:
    """Compute unit normals [n, 3] as the negative density gradient, by central differences over 2 * `reach` grid units.

    Not differentiable in the positions [n, 3]; 0 where the density is constant.
    """
    gradient = torch.zeros_like(positions)
    for axis in range(3):
        offset = torch.zeros(3, device=positions.device)
        offset[axis] = reach
        gradient[:, axis] = density(positions + offset) - density(positions - offset)
    return -nn.functional.normalize(gradient, dim=1)
