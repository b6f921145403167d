"""Gaussian, B-spline and plain layers equal their formulas and have correct derivatives and sizes."""

import math

import numpy as np
import pytest
import torch
from torch.nn.functional import linear, silu

from karf_engine.compute import cores
from karf_engine.errors import BadRequest
from karf_engine.kan import BSplineLayer, GRBFLayer, MLPLayer
from karf_engine.kan import grbf as grbf_module
from karf_engine.kan.grbf import grbf, grbf_reference, grid_spacing, resolve_bandwidth
from karf_engine.kan.layers import bspline_bases

SPACINGS = pytest.mark.parametrize("spacings", [0.35, 0.5, 1 / math.sqrt(2), 1.0, 2.0])  # bandwidths, in grid spacings
KERNELS = pytest.mark.parametrize("kernels", ["on", "off"])
NAMES = "y", "x", "u", "weight", "bias", "bandwidth"


@pytest.fixture(autouse=True)
def seed():
    torch.manual_seed(0)


def make_inputs(n_centers=8, spacings=1.0, dtype=torch.float32, n=40, n_in=5, n_out=3, device="cpu"):
    generator = torch.Generator().manual_seed(7)
    shapes = [(n, n_in), (n, n_in), (n_out, (n_centers + 1) * n_in), (n_out,)]
    tensors = [torch.randn(shape, generator=generator, dtype=torch.float64) for shape in shapes]
    bandwidth = torch.tensor(spacings * grid_spacing(n_centers), dtype=torch.float64)
    return [tensor.to(device, dtype).requires_grad_() for tensor in (*tensors, bandwidth)]


def value_and_gradients(function, inputs, n_centers=8):
    output = function(*inputs, n_centers)
    upstream = torch.rand(output.shape, generator=torch.Generator().manual_seed(9)).to(output)
    return dict(zip(NAMES, [output, *torch.autograd.grad(output, inputs, upstream)], strict=True))


def test_gaussian_layer_equals_its_formula():
    layer, x = GRBFLayer(3, 2, n_centers=4, bandwidth=1.1), torch.randn(5, 3)
    u = layer.norm(x)
    for row, out in np.ndindex(5, 2):
        total = layer.bias[out].item()
        for i in range(3):
            value = x[row, i].item()
            total += layer.weight[out, 4 * 3 + i].item() * value / (1 + math.exp(-value))
            for k in range(4):
                distance = u[row, i].item() - (-2 + 4 * k / 3)
                total += layer.weight[out, k * 3 + i].item() * math.exp(-(distance**2) / (2 * 1.1**2))
        assert layer(x)[row, out].item() == pytest.approx(total, abs=1e-5)


@pytest.mark.on_device("KAN layers")
@KERNELS
@pytest.mark.parametrize("n_centers", [2, 5, 8])
@SPACINGS
def test_float32_layer_matches_the_float64_reference(kernels, n_centers, spacings, device, monkeypatch):
    monkeypatch.setenv("KARF_KERNELS", kernels)
    inputs = make_inputs(n_centers, spacings, n=1200, device=device)
    exact = value_and_gradients(grbf_reference, [each.detach().double().requires_grad_() for each in inputs], n_centers)
    for name, ours in value_and_gradients(grbf, inputs, n_centers).items():
        error, size = (ours.double() - exact[name]).abs().max(), exact[name].abs().max()
        # the bandwidth's gradient is a sum over all entries, which may cancel
        assert error < (1e-5 * size + 1e-6 * inputs[1].numel() if name == "bandwidth" else 2e-5 * size), name


@pytest.mark.on_device("KAN layers")
@SPACINGS
@pytest.mark.parametrize("magnitude", [0.0, 2.0, 2.7, 4.0, 30.0, 1e4, 1e30])
def test_values_and_gradients_are_finite_for_any_input(spacings, magnitude, device):
    inputs = make_inputs(spacings=spacings, device=device)
    with torch.no_grad():
        inputs[1].copy_(magnitude * torch.sign(inputs[1]))
    assert all(torch.isfinite(each).all() for each in value_and_gradients(grbf, inputs).values())


@SPACINGS
def test_far_outside_the_grid_only_the_base_branch_and_nan_remain(spacings):
    x, u, weight, bias, bandwidth = make_inputs(spacings=spacings)
    expected = linear(silu(x), weight[:, 8 * x.shape[1] :], bias)
    far = torch.where(u > 0, 1e4, -1e4)
    far[3] = torch.nan
    found = grbf(x, far, weight, bias, bandwidth, 8)
    assert torch.isnan(found[3]).all()
    torch.testing.assert_close(found[4:], expected[4:], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("n_centers", [2, 3, 8])
@pytest.mark.parametrize("spacings", [0.5, 1.0, 1.7])
def test_gradients_match_finite_differences(n_centers, spacings):
    inputs = make_inputs(n_centers, spacings, torch.float64, n=4, n_in=3, n_out=2)
    assert torch.autograd.gradcheck(lambda *tensors: grbf(*tensors, n_centers), inputs, atol=1e-6)


def derivatives_of_gradients(layer, function, x):
    """Derivatives of |dy/dx|^2 by x and the parameters, and those of their squares."""
    x = x.clone().requires_grad_()
    wanted = [x, *layer.parameters()]
    (slope,) = torch.autograd.grad(function(x).square().sum(), x, create_graph=True)
    second = torch.autograd.grad(slope.square().sum(), wanted, create_graph=True)
    third = torch.autograd.grad(sum(each.square().sum() for each in second), wanted)
    return [each.detach() for each in second + third]


@KERNELS
def test_higher_derivatives_and_jacobians_match_the_reference(kernels, monkeypatch):
    monkeypatch.setenv("KARF_KERNELS", kernels)
    layer, x = GRBFLayer(3, 2), torch.randn(5, 3)

    def reference(x):
        return grbf_reference(x, layer.norm(x), layer.weight, layer.bias, layer.bandwidth(), 8)

    expected = derivatives_of_gradients(layer, reference, x)
    for ours, exact in zip(derivatives_of_gradients(layer, layer, x), expected, strict=True):
        torch.testing.assert_close(ours, exact, rtol=1e-4, atol=1e-5 * float(exact.abs().max()))
    jacobian = torch.func.jacrev(layer)(x[0])
    torch.testing.assert_close(jacobian, torch.func.jacrev(reference)(x[:1])[0, :, 0], rtol=1e-4, atol=1e-5)


def test_no_bases_are_kept_for_the_backward_pass():
    n, n_in, kept = 600, 16, []
    layer, x = GRBFLayer(n_in, 8), torch.randn(n, n_in)
    with torch.autograd.graph.saved_tensors_hooks(lambda tensor: kept.append(tensor.numel()) or tensor, lambda t: t):
        layer(x)
    assert max(kept) <= max(n * n_in, layer.weight.numel())


@pytest.mark.parametrize("rows", [0, 1, 6, 7, 8, 29])
def test_result_does_not_depend_on_chunks_or_cores(rows, monkeypatch):
    inputs = make_inputs(n=rows)
    whole = value_and_gradients(grbf, inputs)
    monkeypatch.setattr(grbf_module, "_CPU_ROWS_PER_CHUNK", 7)
    by_cores = {}
    for n_cores in (2, 1):
        cores.set_core_count(n_cores)
        cores.limit_torch_threads()
        by_cores[n_cores] = value_and_gradients(grbf, inputs)
    for name in NAMES:
        torch.testing.assert_close(by_cores[1][name], whole[name], rtol=1e-5, atol=1e-5)
        assert torch.equal(by_cores[1][name], by_cores[2][name])


@pytest.mark.parametrize(
    ("name", "expected"), [("eq5", 0.571429), ("fastkan", 0.404061), ("xkanerf", 0.707107), (0.6, 0.6)]
)
def test_named_bandwidths_match_their_sources(name, expected):
    assert resolve_bandwidth(name, 8) == pytest.approx(expected, abs=1e-6)
    assert GRBFLayer(2, 2, bandwidth=name).bandwidth().item() == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("start", "limit"), [(-9.0, 0.2), (9.0, 8 / 7)])
def test_learned_bandwidth_stays_between_its_limits(start, limit):
    layer = GRBFLayer(2, 2)
    layer.log_bandwidth.data.fill_(start)
    assert layer.bandwidth().item() == pytest.approx(limit, rel=1e-6)
    assert torch.isfinite(layer(torch.randn(4, 2))).all()


@pytest.mark.parametrize("arguments", [{"n_centers": 1}, {"n_centers": 9}, {"bandwidth": "wide"}, {"bandwidth": 9.0}])
def test_impossible_settings_are_rejected(arguments):
    with pytest.raises(BadRequest):
        GRBFLayer(2, 2, **arguments)


GRID, ORDER = 5, 3
INTERVAL = 4 / GRID


def bases_at(points, order=ORDER):
    return bspline_bases(torch.as_tensor(points, dtype=torch.float64)[:, None], GRID, order)[:, :, 0]


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_bases_sum_to_one_inside_the_range(order):
    sums = bases_at(torch.linspace(-2, 1.999, 101), order).sum(dim=1)
    torch.testing.assert_close(sums, torch.ones_like(sums))


def test_each_basis_is_positive_only_in_its_four_intervals():
    points = torch.linspace(-6, 6, 601, dtype=torch.float64)
    bases = bases_at(points)
    assert bases.min() >= 0 and (bases > 0).sum(dim=1).max() == ORDER + 1
    for index in range(GRID + ORDER):
        start = -2 + (index - ORDER) * INTERVAL
        outside = (points < start - 1e-9) | (points > start + (ORDER + 1) * INTERVAL + 1e-9)
        assert bases[outside, index].max() == 0 and bases[~outside, index].max() > 0.6


@pytest.mark.parametrize(
    ("place", "expected"), [(1, [0, 1 / 6, 4 / 6, 1 / 6, 0]), (1.5, [0, 1 / 48, 23 / 48, 23 / 48, 1 / 48])]
)
def test_cubic_bases_have_the_tabulated_values(place, expected):
    bases = bases_at([-2 + place * INTERVAL])[0]
    torch.testing.assert_close(bases[:5], torch.tensor(expected, dtype=torch.float64))
    assert not bases[5:].any()


def test_spline_layer_equals_base_plus_scaled_splines():
    layer, x = BSplineLayer(3, 2), torch.randn(4, 3)
    torch.nn.init.uniform_(layer.spline_scale)
    bases = bspline_bases(layer.norm(x), GRID, ORDER)
    splines = torch.einsum("nki,oki,oi->no", bases, layer.spline_weight, layer.spline_scale[:, 0])
    torch.testing.assert_close(layer(x), layer.base(silu(x)) + splines)
    plain, far = BSplineLayer(3, 2, layer_norm=False), torch.full((1, 3), 5.0)
    torch.testing.assert_close(plain(far), plain.base(silu(far)))


@pytest.mark.parametrize("make", [GRBFLayer, BSplineLayer, MLPLayer])
def test_layers_take_leading_axes_and_have_correct_gradients(make):
    layer, x = make(3, 2), torch.randn(4, 5, 3)
    torch.testing.assert_close(layer(x), layer(x.flatten(0, 1)).unflatten(0, (4, 5)))
    torch.testing.assert_close(layer(x[0, 0]), layer(x[0])[0])
    assert layer(x[:0]).shape == (0, 5, 2)
    assert torch.autograd.gradcheck(make(3, 2).double(), torch.randn(4, 3, dtype=torch.float64, requires_grad=True))


@pytest.mark.parametrize(
    ("make", "options", "expected"),
    [
        (GRBFLayer, {"learn_bandwidth": False}, 735_870),
        (GRBFLayer, {}, 735_871),
        (BSplineLayer, {"layer_norm": False}, 816_640),
        (BSplineLayer, {}, 816_640 + 2 * 319),
        (MLPLayer, {}, 320 * 256),
    ],
)
def test_layers_have_the_published_number_of_parameters(make, options, expected):
    assert sum(parameter.numel() for parameter in make(319, 256, **options).parameters()) == expected
