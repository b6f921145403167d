"""Quantile samples stand where a ray has lost equal shares of its light."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")

from karf_engine.fields.rendering.rays import Rays
from karf_engine.fields.rendering.sampling import Samples
from karf_engine.fields.rendering.surface_cache import MIN_OPACITY, concatenate_caches, quantile_samples


def packed(weights_of_rays, device="cpu"):
    """Rays along z from the origin, on a device; sample i of a ray lies at distance i + 1."""
    counts = [len(weights) for weights in weights_of_rays]
    ray_indices = torch.repeat_interleave(torch.arange(len(counts)), torch.tensor(counts))
    distances = torch.cat([torch.arange(1.0, n + 1) for n in counts])
    positions = torch.stack([torch.zeros_like(distances), ray_indices.float(), distances], 1)
    viewdirs = torch.tensor([[0.0, 0.0, 1.0]]).expand(len(counts), 3)
    rays = Rays(torch.zeros(len(counts), 3).to(device), viewdirs.to(device))
    weights = torch.tensor([w for weights in weights_of_rays for w in weights], dtype=torch.float32)
    samples = Samples(ray_indices.to(device), distances.to(device), positions.to(device), 1.0)
    return rays, samples, weights.to(device)


def brute_force(weights, n_samples):
    """Distances of the samples at which the running share first reaches the middles of equal shares."""
    share = np.cumsum(np.asarray(weights, np.float64)) / np.sum(weights)
    return [1 + next(i for i, s in enumerate(share) if s >= (k + 0.5) / n_samples - 1e-9) for k in range(n_samples)]


def test_three_samples_lie_at_one_sixth_a_half_and_five_sixths_by_hand():
    # shares up to each sample: 0.1, 0.2, 0.5, 0.6, 1.0
    cache = quantile_samples(*packed([[0.08, 0.08, 0.24, 0.08, 0.32]]), 3)
    assert_allclose(cache.distances, [[2, 3, 5]])
    assert_allclose(cache.opacity, [0.8], atol=1e-6)
    assert_allclose(cache.spread, [3])


@pytest.mark.parametrize("n_samples", [1, 2, 3, 7])
def test_samples_of_many_rays_agree_with_a_loop(n_samples, device):
    random = np.random.default_rng(n_samples)
    rows = [random.dirichlet(np.ones(random.integers(1, 30))) * random.uniform(0.05, 1) for _ in range(150)]
    cache = quantile_samples(*packed(rows, device), n_samples)
    assert cache.index.tolist() == list(range(150))
    assert_allclose(cache.opacity.cpu(), [row.sum() for row in rows], atol=1e-5)
    # where a share lies within rounding of a quantile, either neighbor is right
    agree = cache.distances.cpu().numpy() == [brute_force(row, n_samples) for row in rows]
    assert agree.mean() > 0.995
    assert_allclose(cache.positions[:, :, 1].cpu(), np.repeat(np.arange(150.0)[:, None], n_samples, 1))


def test_a_ray_with_one_sample_repeats_it_and_thin_and_empty_rays_are_left_out():
    cache = quantile_samples(*packed([[], [0.9], [0.5 * MIN_OPACITY], [], [0.3]]), 3, first=100)
    assert cache.index.tolist() == [101, 104]
    assert_allclose(cache.distances, [[1, 1, 1], [1, 1, 1]])
    assert_allclose(cache.spread, [0, 0])


@pytest.mark.parametrize("n_samples", [1, 3])
def test_thinning_many_samples_gives_what_few_would_have_been(n_samples):
    random = np.random.default_rng(4)
    rays = packed([random.dirichlet(np.ones(5)) for _ in range(40)])
    few, thinned = quantile_samples(*rays, n_samples), quantile_samples(*rays, 999).subsample(n_samples)
    assert_allclose(thinned.distances, few.distances)
    assert_allclose(thinned.positions, few.positions)
    assert few.subsample(5) is few


@pytest.mark.parametrize("n_rays", [0, 4])
def test_a_chunk_without_samples_is_empty_and_joins_with_others(n_rays):
    rays, samples, weights = packed([[]] * n_rays) if n_rays else packed([[0.5]])
    if not n_rays:
        rays, samples = rays[:0], Samples(samples.ray_indices[:0], samples.distances[:0], samples.positions[:0], 1.0)
        weights = weights[:0]
    empty = quantile_samples(rays, samples, weights, 3)
    assert len(empty) == 0 and empty.positions.shape == (0, 3, 3)
    joined = concatenate_caches([empty, quantile_samples(*packed([[0.5, 0.5]]), 3)])
    assert len(joined) == 1 and joined.positions.shape == (1, 3, 3)


def test_the_middle_sample_survives_a_faint_veil_in_front():
    cache = quantile_samples(*packed([[0.05, 0.0, 0.0, 0.9]]), 3)
    assert_allclose(cache.distances, [[4, 4, 4]])
