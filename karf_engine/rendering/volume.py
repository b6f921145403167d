"""Volume rendering of packed samples.

Naming: S samples of all rays lie in one row, sorted by ray and then by distance; `ray_indices` [S] says whose they are.
`optical_depths` = sigma * delta [S]; `alphas` = 1 - exp(-optical_depth); `transmittance` = light that reaches a sample;
`ray_weights` = transmittance * alpha; `remainder` [R] = light that leaves the ray behind its last sample, so that a
ray's weights and its remainder sum to one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from .sampling import Samples

VISIBLE_WEIGHT = 1e-4  # a sample of less weight needs no color: it cannot change an 8-bit pixel


def transmittance_from_optical_depths(optical_depths: Tensor, ray_indices: Tensor) -> Tensor:
    """exp(-sum of the optical depths before each sample of its ray), [S] in (0, 1].

    The sum runs over all rays at once: float32 would lose up to 1e-3 of transmittance there, float64 does not.
    """
    # behind an optical depth of 100 it is dark in float32; one huge summand would take the digits of all rays after it
    limited = optical_depths.double().clamp_max(100)
    before = torch.cumsum(limited, 0) - limited
    return torch.exp(_of_ray_start(before, ray_indices) - before).to(optical_depths.dtype)


def ray_weights_from_sigmas(sigmas: Tensor, deltas: Tensor | float, ray_indices: Tensor) -> Tensor:
    """T_i (1 - exp(-sigma_i delta_i)) of each sample (paper Eq. 8), [S] in [0, 1].

    sigmas: [S] >= 0, per world unit. deltas: [S] or one number, world units. ray_indices: [S], sorted.
    """
    optical_depths = sigmas * deltas
    # expm1 keeps thin samples exact: 1 - exp(-x) is 40 % off at x = 1e-7 in float32
    alphas = -torch.expm1(-optical_depths)
    return transmittance_from_optical_depths(optical_depths, ray_indices) * alphas


def distortion(ray_weights: Tensor, distances: Tensor, step: float, ray_indices: Tensor) -> Tensor:
    """Sum over all rays of Mip-NeRF 360's distortion (Eq. 15): how far a ray's weight is spread, [] >= 0.

    distances: [S] of the samples along their rays. step: length of each sample's interval, in the same units.
    """
    weights, moments = ray_weights.double(), ray_weights.double() * distances.double()
    before = torch.cumsum(weights, 0) - weights
    before = before - _of_ray_start(before, ray_indices)
    moments_before = torch.cumsum(moments, 0) - moments
    moments_before = moments_before - _of_ray_start(moments_before, ray_indices)
    # the double sum over pairs of a ray, from the front: each sample meets all before it
    pairs = 2 * (moments * before - weights * moments_before).sum()
    return (pairs + step / 3 * (weights**2).sum()).to(ray_weights.dtype)


def _of_ray_start(values: Tensor, ray_indices: Tensor) -> Tensor:
    """The value at the first sample of each sample's ray, [S]."""
    if len(ray_indices) == 0:
        return values
    is_first = torch.ones_like(ray_indices, dtype=torch.bool)
    is_first[1:] = ray_indices[1:] != ray_indices[:-1]
    segment = torch.cumsum(is_first, 0) - 1
    return values[torch.nonzero(is_first).squeeze(1)][segment]


def accumulate(ray_weights: Tensor, values: Tensor | None, ray_indices: Tensor, n_rays: int) -> Tensor:
    """Sum of ray_weights * values over each ray; [R, C] for values [S, C], or [R, 1] (opacity) for None."""
    weighted = ray_weights[:, None] if values is None else ray_weights[:, None] * values
    result = torch.zeros(n_rays, weighted.shape[1], dtype=weighted.dtype, device=weighted.device)
    return result.index_add(0, ray_indices, weighted)


def remainder_from_sigmas(sigmas: Tensor, deltas: Tensor | float, ray_indices: Tensor, n_rays: int) -> Tensor:
    """exp(-total optical depth) of each ray, [R] in [0, 1]; never negative, as 1 - sum(ray_weights) can be."""
    optical_depths = sigmas * deltas
    total = torch.zeros(n_rays, dtype=optical_depths.dtype, device=optical_depths.device)
    return torch.exp(-total.index_add(0, ray_indices, optical_depths))


@dataclass(frozen=True)
class Trace:
    """Where rays end in a frozen field. samples: packed; ray_weights: [S] of them; remainder: [R]."""

    samples: Samples
    ray_weights: Tensor
    remainder: Tensor


def trace_of(samples: Samples, sigmas: Tensor, n_rays: int) -> Trace:
    """The trace of samples whose densities [S], per grid unit, are known."""
    return Trace(
        samples,
        ray_weights_from_sigmas(sigmas, samples.step, samples.ray_indices),
        remainder_from_sigmas(sigmas, samples.step, samples.ray_indices, n_rays),
    )


def outward_normals(density: Callable[[Tensor], Tensor], positions: Tensor, reach: float) -> Tensor:
    """Minus the density's gradient at positions [n, 3] by central differences over `reach`, [n, 3] of length 1 or 0."""
    gradient = torch.zeros_like(positions)
    for axis in range(3):
        offset = torch.zeros(3, device=positions.device)
        offset[axis] = reach
        gradient[:, axis] = density(positions + offset) - density(positions - offset)
    return -nn.functional.normalize(gradient, dim=1)
