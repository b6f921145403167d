"""Volume rendering and quantile samples agree with values by hand and with loops in float64."""

import math

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from blender_tests.engine.reference.rays import composite
from karf_engine.fields.rendering import volume
from karf_engine.fields.rendering.rays import Rays
from karf_engine.fields.rendering.sampling import Samples
from karf_engine.fields.rendering.surface_cache import MIN_OPACITY, concatenate_caches, quantile_samples

HALF = math.log(2.0)  # a density at which half of the light stops


def random_rays(n_rays, dtype=torch.float64, scale=2.0, device="cpu"):
    """sigmas, deltas and ray indices of rays with 0 to 60 samples each."""
    random = np.random.default_rng(0)
    ray_indices = np.repeat(np.arange(n_rays), random.integers(0, 61, n_rays))
    sigmas = random.exponential(scale, len(ray_indices)) * random.integers(0, 2, len(ray_indices))
    deltas = random.uniform(0.01, 0.2, len(ray_indices))
    values = [torch.tensor(values, dtype=dtype, device=device) for values in (sigmas, deltas)]
    return *values, torch.from_numpy(ray_indices).to(device)


@pytest.mark.parametrize(
    ("sigmas", "rays", "weights", "rest"),
    [
        ([HALF, HALF], [0, 0], [0.5, 0.25], [0.25, 1]),
        ([math.exp(50.0), 1, 1], [0, 1, 1], [1, 1 - math.exp(-1), math.exp(-1) - math.exp(-2)], [0, math.exp(-2)]),
        ([1e-7], [1], [1e-7], [1, 1]),
        ([], [], [], [1, 1]),
    ],
    ids=["halves", "opaque before another ray", "thin", "no samples"],
)
def test_few_samples_match_values_by_hand(sigmas, rays, weights, rest):
    sigmas, rays = torch.tensor(sigmas), torch.tensor(rays, dtype=torch.long)
    found = volume.ray_weights_from_sigmas(sigmas, 1.0, rays)
    assert_allclose(found, weights, rtol=1e-6, atol=1e-9)
    assert_allclose(volume.final_transmittance_from_sigmas(sigmas, 1.0, rays, 2), rest, rtol=1e-6, atol=1e-9)
    assert_allclose(volume.accumulate(found, None, rays, 2)[:, 0], 1 - np.array(rest), atol=2e-7)
    values = torch.tensor([1.0, 4.0, 9.0])[: len(sigmas), None] * torch.tensor([1.0, 0.5])
    expected = np.zeros((2, 2))
    np.add.at(expected, rays.numpy(), np.array(weights)[:, None] * values.numpy())
    assert_allclose(volume.accumulate(found, values, rays, 2), expected, rtol=1e-6)


@pytest.mark.on_device("sums along rays")
@pytest.mark.parametrize(
    ("n_rays", "dtype", "scale", "tolerance"),
    [(200, torch.float64, 2.0, 1e-12), (300, torch.float32, 2.0, 2e-6), (4000, torch.float32, 20.0, 2e-6)],
)
def test_packed_rays_match_a_loop_over_single_rays(n_rays, dtype, scale, tolerance, device):
    """A plain float32 running sum over 4000 rays would lose two digits."""
    sigmas, deltas, ray_indices = random_rays(n_rays, dtype, scale, device)
    weights = volume.ray_weights_from_sigmas(sigmas, deltas, ray_indices)
    rest = volume.final_transmittance_from_sigmas(sigmas, deltas, ray_indices, n_rays)
    found = (volume.transmittance_from_optical_depths(sigmas * deltas, ray_indices), weights, rest)
    expected = composite(*[values.cpu().numpy() for values in (sigmas, deltas, ray_indices)], n_rays)
    for ours, loop in zip(found, expected, strict=True):
        assert ours.dtype == dtype and ours.min() >= 0
        assert_allclose(ours.cpu(), loop, atol=tolerance)
    sums = volume.accumulate(weights, None, ray_indices, n_rays)[:, 0] + rest
    assert_allclose(sums.cpu(), np.ones(n_rays), atol=2 * tolerance)


def test_gradients_are_finite_for_every_density():
    logs = torch.linspace(-100, 50, 301, requires_grad=True)
    ray_indices = torch.arange(301) // 7
    for order in (logs, logs.flip(0)):
        weights = volume.ray_weights_from_sigmas(order.exp(), 0.3, ray_indices)
        rest = volume.final_transmittance_from_sigmas(order.exp(), 0.3, ray_indices, 43)
        (gradient,) = torch.autograd.grad((weights * torch.arange(301)).sum() + rest.sum(), logs)
        assert torch.isfinite(weights).all() and torch.isfinite(gradient).all()
        assert gradient.abs().max() > 0


def test_gradients_match_finite_differences():
    sigmas, deltas, ray_indices = random_rays(4)
    sigmas = (sigmas + 0.1).requires_grad_(True)
    assert torch.autograd.gradcheck(lambda s: volume.ray_weights_from_sigmas(s, deltas, ray_indices), sigmas)
    assert torch.autograd.gradcheck(lambda s: volume.final_transmittance_from_sigmas(s, deltas, ray_indices, 4), sigmas)


def test_distortion_matches_its_double_sum():
    sigmas, deltas, ray_indices = random_rays(12)
    ray_weights = volume.ray_weights_from_sigmas(sigmas, 0.1, ray_indices)
    distances = torch.cumsum(deltas, 0) + 5
    expected = []
    for ray in range(12):
        weights, places = ray_weights[ray_indices == ray], distances[ray_indices == ray]
        pairs = weights[:, None] * weights * (places[:, None] - places).abs()
        expected.append(pairs.sum() + 0.1 / 3 * (weights**2).sum())
    found = volume.distortion(ray_weights, distances, 0.1, ray_indices, 12)
    assert_allclose(found, torch.stack(expected), rtol=1e-8, atol=1e-10)


def packed(weights_of_rays, device="cpu"):
    """Rays along z from the origin, their samples at distances 1, 2, 3 ..., and the weights of these."""
    n_rays, counts = len(weights_of_rays), torch.tensor([len(weights) for weights in weights_of_rays])
    ray_indices = torch.repeat_interleave(torch.arange(n_rays), counts).to(device)
    distances = torch.cat([torch.arange(1.0, n + 1) for n in counts]).to(device)
    positions = torch.stack([torch.zeros_like(distances), ray_indices.float(), distances], 1)
    rays = Rays(torch.zeros(n_rays, 3).to(device), torch.tensor([[0.0, 0.0, 1.0]]).expand(n_rays, 3).to(device))
    weights = torch.tensor([w for weights in weights_of_rays for w in weights], dtype=torch.float32)
    return rays, Samples(ray_indices, distances, positions, 1.0), weights.to(device)


def quantile_distances(weights, n_samples):
    """Distances of the samples at which the running share first reaches the middles of equal shares."""
    share = np.cumsum(np.asarray(weights, np.float64)) / np.sum(weights)
    return [1 + next(i for i, s in enumerate(share) if s >= (k + 0.5) / n_samples - 1e-9) for k in range(n_samples)]


@pytest.mark.parametrize(
    ("weights", "distances", "spread"),
    [
        ([0.08, 0.08, 0.24, 0.08, 0.32], [2, 3, 5], 3),  # shares up to each sample: 0.1, 0.2, 0.5, 0.6, 1.0
        ([0.9], [1, 1, 1], 0),
        ([0.05, 0.0, 0.0, 0.9], [4, 4, 4], 0),
    ],
    ids=["sixths and a half", "one sample", "thin before opaque"],
)
def test_three_quantile_samples_match_values_by_hand(weights, distances, spread):
    cache = quantile_samples(*packed([weights]), 3)
    assert_allclose(cache.distances, [distances])
    assert_allclose(cache.opacity, [sum(weights)], atol=1e-6)
    assert_allclose(cache.spread, [spread])


@pytest.mark.on_device("sums along rays")
@pytest.mark.parametrize("n_samples", [1, 2, 3, 7])
def test_quantile_samples_of_many_rays_match_a_loop(n_samples, device):
    random = np.random.default_rng(n_samples)
    rows = [random.dirichlet(np.ones(random.integers(1, 30))) * random.uniform(0.05, 1) for _ in range(150)]
    cache = quantile_samples(*packed(rows, device), n_samples)
    assert cache.index.tolist() == list(range(150))
    assert_allclose(cache.opacity.cpu(), [row.sum() for row in rows], atol=1e-5)
    # where a share lies within rounding of a quantile, either neighbor is right
    agree = cache.distances.cpu().numpy() == [quantile_distances(row, n_samples) for row in rows]
    assert agree.mean() > 0.995
    assert_allclose(cache.positions[:, :, 1].cpu(), np.repeat(np.arange(150.0)[:, None], n_samples, 1))


def test_thin_and_empty_rays_are_left_out():
    cache = quantile_samples(*packed([[], [0.9], [0.5 * MIN_OPACITY], [], [0.3]]), 3, first=100)
    assert cache.index.tolist() == [101, 104]


@pytest.mark.parametrize("n_samples", [1, 3])
def test_subsampling_many_quantiles_gives_few_quantiles(n_samples):
    random = np.random.default_rng(4)
    rays = packed([random.dirichlet(np.ones(5)) for _ in range(40)])
    few, subsampled = quantile_samples(*rays, n_samples), quantile_samples(*rays, 999).subsample(n_samples)
    assert_allclose(subsampled.distances, few.distances)
    assert_allclose(subsampled.positions, few.positions)
    assert few.subsample(5) is few


@pytest.mark.parametrize("n_rays", [0, 4])
def test_chunk_without_samples_is_empty_and_joins_others(n_rays):
    rays, samples, weights = packed([[]] * 4)
    empty = quantile_samples(rays[:n_rays], samples, weights, 3)
    assert len(empty) == 0 and empty.positions.shape == (0, 3, 3)
    joined = concatenate_caches([empty, quantile_samples(*packed([[0.5, 0.5]]), 3)])
    assert len(joined) == 1 and joined.positions.shape == (1, 3, 3)
