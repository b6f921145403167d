"""Volume rendering: two samples by hand, many by a loop in float64."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch")

from blender_tests.engine.reference.rays import composite
from karf_engine.fields.rendering.volume import (
    accumulate,
    distortion,
    final_transmittance_from_sigmas,
    ray_weights_from_sigmas,
    transmittance_from_optical_depths,
)


def random_rays(n_rays, dtype=torch.float64, scale=2.0, seed=0, device="cpu"):
    """sigmas, deltas and ray indices of rays with 0 to 60 samples each."""
    random = np.random.default_rng(seed)
    ray_indices = np.repeat(np.arange(n_rays), random.integers(0, 61, n_rays))
    sigmas = random.exponential(scale, len(ray_indices)) * random.integers(0, 2, len(ray_indices))
    deltas = random.uniform(0.01, 0.2, len(ray_indices))
    values = [torch.tensor(values, dtype=dtype, device=device) for values in (sigmas, deltas)]
    return *values, torch.from_numpy(ray_indices).to(device)


def test_two_samples_on_one_ray_by_hand():
    # half of the light stops at the first sample, half of the rest at the second, a quarter passes
    sigmas, ray = torch.full((2,), math.log(2.0)), torch.zeros(2, dtype=torch.long)
    assert_allclose(ray_weights_from_sigmas(sigmas, 1.0, ray), [0.5, 0.25], atol=1e-7)
    assert_allclose(transmittance_from_optical_depths(sigmas, ray), [1.0, 0.5], atol=1e-7)
    assert_allclose(final_transmittance_from_sigmas(sigmas, 1.0, ray, 1), [0.25], atol=1e-7)
    values = torch.tensor([[1.0, 0.0], [0.0, 4.0]])
    weights = ray_weights_from_sigmas(sigmas, 1.0, ray)
    assert_allclose(accumulate(weights, values, ray, 1), [[0.5, 1.0]], atol=1e-6)
    assert_allclose(accumulate(weights, None, ray, 2), [[0.75], [0.0]], atol=1e-7)


def test_packed_rays_agree_with_the_loop_over_single_rays(device):
    sigmas, deltas, ray_indices = random_rays(200, device=device)
    expected = composite(*[values.cpu().numpy() for values in (sigmas, deltas, ray_indices)], 200)
    found = (
        transmittance_from_optical_depths(sigmas * deltas, ray_indices),
        ray_weights_from_sigmas(sigmas, deltas, ray_indices),
        final_transmittance_from_sigmas(sigmas, deltas, ray_indices, 200),
    )
    for ours, loop in zip(found, expected, strict=True):
        assert_allclose(ours.cpu(), loop, atol=1e-12)


def test_weights_and_remainder_of_every_ray_sum_to_one(device):
    sigmas, deltas, ray_indices = random_rays(300, torch.float32, device=device)
    weights = ray_weights_from_sigmas(sigmas, deltas, ray_indices)
    rest = final_transmittance_from_sigmas(sigmas, deltas, ray_indices, 300)
    assert weights.min() >= 0 and rest.min() >= 0
    opacity = accumulate(weights, None, ray_indices, 300)[:, 0]
    assert_allclose((opacity + rest).cpu(), np.ones(300), atol=2e-6)


def test_a_single_precision_batch_of_many_rays_keeps_six_digits(device):
    sigmas, deltas, ray_indices = random_rays(4000, torch.float32, scale=20.0, device=device)
    transmittance, _, _ = composite(*[values.cpu().numpy() for values in (sigmas, deltas, ray_indices)], 4000)
    found = transmittance_from_optical_depths(sigmas * deltas, ray_indices)
    assert (sigmas * deltas).sum() > 1e5  # a plain float32 running sum would have lost two digits after the point
    assert_allclose(found.cpu(), transmittance, atol=1e-6)


def test_an_immensely_dense_ray_takes_nothing_from_the_rays_after_it():
    sigmas = torch.tensor([math.exp(50.0), 1.0, 1.0, 1.0])
    ray_indices = torch.tensor([0, 1, 1, 1])
    expected = [1.0] + [math.exp(-i) * (1 - math.exp(-1)) for i in range(3)]
    assert_allclose(ray_weights_from_sigmas(sigmas, 1.0, ray_indices), expected, atol=1e-6)


def test_gradients_are_finite_for_every_density():
    logs = torch.linspace(-100, 50, 301, requires_grad=True)
    ray_indices = torch.arange(301) // 7
    for order in (logs, logs.flip(0)):
        weights = ray_weights_from_sigmas(order.exp(), 0.3, ray_indices)
        rest = final_transmittance_from_sigmas(order.exp(), 0.3, ray_indices, 43)
        loss = (weights * torch.arange(301)).sum() + rest.sum()
        (gradient,) = torch.autograd.grad(loss, logs)
        assert torch.isfinite(weights).all() and torch.isfinite(gradient).all()
        assert gradient.abs().max() > 0


def test_thin_samples_keep_their_weight():
    weights = ray_weights_from_sigmas(torch.tensor([1e-7]), 1.0, torch.zeros(1, dtype=torch.long))
    assert_allclose(weights, [1e-7], rtol=1e-6)


def test_the_analytic_gradient_agrees_with_finite_differences():
    sigmas, deltas, ray_indices = random_rays(4)
    sigmas = (sigmas + 0.1).requires_grad_(True)
    assert torch.autograd.gradcheck(lambda s: ray_weights_from_sigmas(s, deltas, ray_indices), sigmas)
    assert torch.autograd.gradcheck(lambda s: final_transmittance_from_sigmas(s, deltas, ray_indices, 4), sigmas)


def test_no_samples_leave_all_light():
    empty, ray = torch.zeros(0), torch.zeros(0, dtype=torch.long)
    assert len(ray_weights_from_sigmas(empty, 0.1, ray)) == 0
    assert_allclose(final_transmittance_from_sigmas(empty, 0.1, ray, 3), [1, 1, 1])


def test_distortion_is_the_double_sum_over_each_ray():
    sigmas, deltas, ray_indices = random_rays(12)
    ray_weights = ray_weights_from_sigmas(sigmas, 0.1, ray_indices)
    distances = torch.cumsum(deltas, 0) + 5
    expected = []
    for ray in range(12):
        own = ray_indices == ray
        weights, places = ray_weights[own], distances[own]
        pairs = weights[:, None] * weights * (places[:, None] - places).abs()
        expected.append(pairs.sum() + 0.1 / 3 * (weights**2).sum())
    assert_allclose(
        distortion(ray_weights, distances, 0.1, ray_indices, 12), torch.stack(expected), rtol=1e-8, atol=1e-10
    )
    one_ray = torch.zeros(3, dtype=torch.long)
    together = distortion(torch.tensor([1.0, 0, 0]), torch.tensor([2.0, 3, 4]), 0.0, one_ray, 1)
    assert together == 0
