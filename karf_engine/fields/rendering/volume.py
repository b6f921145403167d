"""Volume rendering of packed samples.

Naming: S samples of all rays lie in one row, sorted by ray and then by distance; `ray_indices` [S] says whose they are.
`optical_depths` = sigma * delta [S]; `alphas` = 1 - exp(-optical_depth); `transmittance` = light that reaches a sample;
`ray_weights` = transmittance * alpha; `final_transmittance` [R] = light that leaves the ray behind its last
sample, so that a ray's weights and its final transmittance sum to one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from .sampling import Samples

VISIBLE_WEIGHT = 1e-4  # a sample of less weight needs no color: it cannot change an 8-bit pixel


def transmittance_from_optical_depths(optical_depths: Tensor, ray_indices: Tensor) -> Tensor:
    """Light that reaches each sample: exp(-sum of the optical depths before it on its ray).

    Differentiable in the optical depths up to 100, behind which it is dark. The sum runs over all rays at once: float32
    would lose up to 1e-3 of transmittance there, float64 does not.

    Args:
        optical_depths: [S] >= 0, sigma times delta.
        ray_indices: [S], sorted.

    Returns:
        Transmittances [S] in (0, 1].

    Example:
        >>> transmittance_from_optical_depths(torch.tensor([0.6931, 1.0, 5.0]), torch.tensor([0, 0, 1]))
        tensor([1.0000, 0.5000, 1.0000])
    """
    # behind an optical depth of 100 it is dark in float32; one huge summand would take the digits of all rays after it
    limited = optical_depths.double().clamp_max(100)
    before = torch.cumsum(limited, 0) - limited
    return torch.exp(_of_ray_start(before, ray_indices) - before).to(optical_depths.dtype)


def ray_weights_from_sigmas(sigmas: Tensor, deltas: Tensor | float, ray_indices: Tensor) -> Tensor:
    """Ray weights T_i (1 - exp(-sigma_i delta_i)) of packed samples (paper, Eq. 8).

    Differentiable in `sigmas` and `deltas`.

    Args:
        sigmas: Densities [S] >= 0, per unit of length.
        deltas: Interval lengths [S], or one for all, in that unit.
        ray_indices: [S], sorted.

    Returns:
        Weights [S] in [0, 1]; a ray's sum and its final transmittance are one.

    Example:
        >>> ray_weights_from_sigmas(torch.tensor([0.0, 0.6931, 0.6931]), 1.0, torch.tensor([0, 0, 0]))
        tensor([0.0000, 0.5000, 0.2500])
    """
    optical_depths = sigmas * deltas
    # expm1 keeps thin samples exact: 1 - exp(-x) is 40 % off at x = 1e-7 in float32
    alphas = -torch.expm1(-optical_depths)
    return transmittance_from_optical_depths(optical_depths, ray_indices) * alphas


def distortion(ray_weights: Tensor, distances: Tensor, step: float, ray_indices: Tensor, n_rays: int) -> Tensor:
    """Each ray's Mip-NeRF 360's distortion (Eq. 15): how far apart a ray's weight lies.

    Differentiable in `ray_weights`.

    Args:
        ray_weights: [S] in [0, 1].
        distances: [S], of the samples along their rays.
        step: Length of the samples' intervals, in the unit of the distances.
        ray_indices: [S], sorted.
        n_rays: R.

    Returns:
        Sums [R] >= 0.

    Example:
        >>> halves, one_ray = torch.tensor([0.5, 0.5]), torch.tensor([0, 0])
        >>> distortion(halves, torch.tensor([1.0, 3.0]), 0.0, one_ray, 1)  # 2 * 0.5 * 0.5 * |1 - 3|
        tensor([1.])
    """
    weights, moments = ray_weights.double(), ray_weights.double() * distances.double()
    before = torch.cumsum(weights, 0) - weights
    before = before - _of_ray_start(before, ray_indices)
    moments_before = torch.cumsum(moments, 0) - moments
    moments_before = moments_before - _of_ray_start(moments_before, ray_indices)
    # the double sum over pairs of a ray, from the front: each sample meets all before it
    pairs = 2 * (moments * before - weights * moments_before) + step / 3 * weights**2
    sums = torch.zeros(n_rays, dtype=pairs.dtype, device=pairs.device)
    return sums.index_add(0, ray_indices, pairs).to(ray_weights.dtype)


def _of_ray_start(values: Tensor, ray_indices: Tensor) -> Tensor:
    """The value at the first sample of each sample's ray, [S]."""
    if len(ray_indices) == 0:
        return values
    is_first = torch.ones_like(ray_indices, dtype=torch.bool)
    is_first[1:] = ray_indices[1:] != ray_indices[:-1]
    segment = torch.cumsum(is_first, 0) - 1
    return values[torch.nonzero(is_first).squeeze(1)][segment]


def accumulate(ray_weights: Tensor, values: Tensor | None, ray_indices: Tensor, n_rays: int) -> Tensor:
    """Sum of ray_weights * values over each ray. Differentiable in both.

    Args:
        ray_weights: [S].
        values: [S, C]; None for ones, whose sum is the ray's opacity.
        ray_indices: [S].
        n_rays: R.

    Returns:
        Sums [R, C], or [R, 1] without values; 0 for rays without samples.

    Example:
        >>> accumulate(torch.tensor([0.5, 0.25]), torch.tensor([[1.0], [2.0]]), torch.tensor([0, 0]), 2)
        tensor([[1.],
                [0.]])
    """
    weighted = ray_weights[:, None] if values is None else ray_weights[:, None] * values
    result = torch.zeros(n_rays, weighted.shape[1], dtype=weighted.dtype, device=weighted.device)
    return result.index_add(0, ray_indices, weighted)


def final_transmittance_from_sigmas(sigmas: Tensor, deltas: Tensor | float, ray_indices: Tensor, n_rays: int) -> Tensor:
    """Light that leaves each ray behind its last sample: exp(-its total optical depth).

    Differentiable in `sigmas` and `deltas`. Never negative, as 1 - sum(ray_weights) can be.

    Args:
        sigmas: Densities [S] >= 0, per unit of length.
        deltas: Interval lengths [S], or one for all, in that unit.
        ray_indices: [S].
        n_rays: R.

    Returns:
        Remainders [R] in [0, 1]; 1 for rays without samples.

    Example:
        >>> final_transmittance_from_sigmas(torch.tensor([0.6931, 0.6931]), 1.0, torch.tensor([0, 0]), 2)
        tensor([0.2500, 1.0000])
    """
    optical_depths = sigmas * deltas
    total = torch.zeros(n_rays, dtype=optical_depths.dtype, device=optical_depths.device)
    return torch.exp(-total.index_add(0, ray_indices, optical_depths))


@dataclass(frozen=True)
class Trace:
    """Where rays end in a frozen field.

    Attributes:
        samples: Packed, of all rays.
        ray_weights: [S] in [0, 1], of the samples.
        final_transmittance: [R] in [0, 1], what the rays do not end on.
    """

    samples: Samples
    ray_weights: Tensor
    final_transmittance: Tensor


def trace_of(samples: Samples, sigmas: Tensor, n_rays: int) -> Trace:
    """The trace of samples whose densities are known.

    Args:
        samples: Packed, of R rays.
        sigmas: Densities [S] >= 0, per grid unit.
        n_rays: R.

    Returns:
        Samples, their weights, and the final transmittances of the rays.

    Example:
        >>> samples = Samples(torch.tensor([0]), torch.tensor([2.0]), torch.tensor([[0.0, 0.0, 2.0]]), 0.5)
        >>> trace_of(samples, torch.tensor([1.3863]), 1).final_transmittance
        tensor([0.5000])
    """
    return Trace(
        samples,
        ray_weights_from_sigmas(sigmas, samples.step, samples.ray_indices),
        final_transmittance_from_sigmas(sigmas, samples.step, samples.ray_indices, n_rays),
    )


def outward_normals(density: Callable[[Tensor], Tensor], positions: Tensor, reach: float) -> Tensor:
    """Surface normals: minus the density's gradient, by central differences. Not differentiable in the positions.

    Args:
        density: Gives densities [n] at positions [n, 3].
        positions: [n, 3], grid coordinates.
        reach: Half the distance over which densities are compared, grid coordinates.

    Returns:
        Normals [n, 3] of unit length; 0 where the density is the same all round.

    Example:
        >>> outward_normals(lambda x: -x[:, 2], torch.zeros(1, 3), 0.1).abs()  # denser below
        tensor([[0., 0., 1.]])
    """
    gradient = torch.zeros_like(positions)
    for axis in range(3):
        offset = torch.zeros(3, device=positions.device)
        offset[axis] = reach
        gradient[:, axis] = density(positions + offset) - density(positions - offset)
    return -nn.functional.normalize(gradient, dim=1)
