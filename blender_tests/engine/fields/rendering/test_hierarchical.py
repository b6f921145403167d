"""Coarse and fine samples: even where asked, as many as the weights say, sorted."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")

from karf_engine.fields.rendering.sampling import (
    dense_ray_weights,
    interval_lengths,
    refine,
    sample_pdf,
    stratified_samples,
)
from karf_engine.fields.rendering.volume import ray_weights_from_sigmas

EVEN = torch.zeros(1, 0)


def random(*shape, seed=0):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed))


def test_without_jitter_samples_are_even_in_t_or_in_disparity():
    assert_allclose(stratified_samples(2, 6, 5, False, EVEN), [[2, 3, 4, 5, 6]], rtol=1e-6)
    assert_allclose(1 / stratified_samples(0.5, 4, 8, True, EVEN), [np.linspace(2, 0.25, 8)], rtol=1e-6)


@pytest.mark.parametrize("in_disparity", [False, True])
def test_jitter_fills_the_range_with_one_sample_a_stretch(in_disparity):
    t = stratified_samples(2, 6, 16, in_disparity, random(4000, 16))
    assert t.shape == (4000, 16) and t.min() >= 2 and t.max() <= 6
    assert (t.diff(dim=1) >= 0).all()
    even = stratified_samples(2, 6, 16, in_disparity, EVEN)[0]
    middles = (even[1:] + even[:-1]) / 2
    assert (t[:, :-1] <= middles).all() and (t[:, 1:] >= middles).all()
    assert_allclose(t[:, 1:-1].mean(0), (middles[1:] + middles[:-1]) / 2, atol=0.02)


def test_fine_samples_are_distributed_as_the_weights_are():
    edges = torch.tensor([[0.0, 1.0, 3.0, 4.0, 6.0]])
    weights = torch.tensor([[0.1, 0.0, 0.6, 0.3]])
    drawn = sample_pdf(edges, weights, random(1, 100_000))
    share, _ = np.histogram(drawn, edges[0])
    assert_allclose(share / 100_000, weights[0], atol=0.005)
    inside = drawn[(drawn > 4) & (drawn < 6)]
    assert_allclose([inside.mean(), inside.std()], [5, 2 / np.sqrt(12)], atol=0.02)


def test_the_inverse_distribution_function_is_that_of_numpy():
    edges, weights = random(7, 20).sort(1).values, random(7, 19, seed=1)
    u = random(7, 33, seed=2)
    for row in range(7):
        density = weights[row].double().numpy() + 1e-5
        cdf = np.concatenate([[0], np.cumsum(density / density.sum())])
        expected = np.interp(u[row].numpy(), cdf, edges[row].numpy())
        assert_allclose(sample_pdf(edges, weights, u)[row], expected, atol=1e-4)


def test_rays_that_meet_nothing_are_sampled_evenly():
    ends = sample_pdf(torch.tensor([[2.0, 4.0, 6.0]]), torch.zeros(1, 2), torch.tensor([[0.0, 0.25, 1.0]]))
    assert_allclose(ends, [[2, 3, 6]], rtol=1e-5)


def test_the_union_is_sorted_holds_the_coarse_samples_and_gathers_where_the_weight_is():
    t = stratified_samples(2, 6, 32, False, torch.zeros(3, 0))
    weights = torch.zeros(3, 32)
    weights[:, 20] = 1
    union = refine(t, weights, torch.linspace(0, 1, 64).expand(3, -1))
    assert union.shape == (3, 96) and (union.diff(dim=1) >= 0).all()
    assert all(torch.isin(t[row], union[row]).all() for row in range(3))
    assert (((union - t[:, 20:21]).abs() < 0.13).sum(1) > 60).all()


def test_dense_weights_are_those_of_packed_samples_and_the_last_interval_has_no_end():
    sigmas, t = 3 * random(5, 12), random(5, 12, seed=1).sort(1).values
    deltas = interval_lengths(t)
    assert (deltas[:, -1] == 1e10).all()
    weights = dense_ray_weights(sigmas, deltas)
    rays = torch.arange(5).repeat_interleave(12)
    assert_allclose(weights.view(-1), ray_weights_from_sigmas(sigmas.view(-1), deltas.view(-1), rays), atol=1e-6)
    assert_allclose(weights.sum(1), np.ones(5), atol=1e-6)


def test_gradients_stay_finite_behind_what_is_opaque():
    sigmas = torch.tensor([[0.0, 50.0, 1e6, 2.0]], requires_grad=True)
    dense_ray_weights(sigmas, interval_lengths(torch.tensor([[1.0, 2.0, 3.0, 4.0]])))[0, 1].backward()
    assert torch.isfinite(sigmas.grad).all()
