"""The Gaussian layer: its recurrence against direct exponentials, its gradients against autograd, its size."""

import math

import pytest
import torch

from karf_engine.compute import cores
from karf_engine.errors import BadRequest
from karf_engine.kan import BSplineLayer, GRBFLayer, MLPLayer
from karf_engine.kan import grbf as grbf_module
from karf_engine.kan.grbf import grbf, grbf_reference, grid_spacing, resolve_bandwidth

BANDWIDTHS_IN_SPACINGS = [0.35, 0.5, 1 / math.sqrt(2), 1.0, 2.0]


def make_inputs(n_centers, spacings, dtype, n=40, n_in=5, n_out=3, device="cpu"):
    generator = torch.Generator().manual_seed(7)
    shapes = [(n, n_in), (n, n_in), (n_out, (n_centers + 1) * n_in), (n_out,)]
    tensors = [torch.randn(shape, generator=generator, dtype=torch.float64) for shape in shapes]
    bandwidth = torch.tensor(spacings * grid_spacing(n_centers), dtype=torch.float64)
    return [tensor.to(device, dtype).requires_grad_() for tensor in (*tensors, bandwidth)]


def value_and_gradients(function, inputs, n_centers):
    output = function(*inputs, n_centers)
    upstream = torch.rand(output.shape, generator=torch.Generator().manual_seed(9)).to(output)
    return [output, *torch.autograd.grad(output, inputs, upstream)]


@pytest.mark.parametrize("n_centers", [2, 3, 8])
@pytest.mark.parametrize("spacings", [0.5, 1.0, 1.7])
def test_gradients_match_finite_differences(n_centers, spacings):
    inputs = make_inputs(n_centers, spacings, torch.float64, n=4, n_in=3, n_out=2)
    assert torch.autograd.gradcheck(lambda *tensors: grbf(*tensors, n_centers), inputs, atol=1e-6)


@pytest.mark.parametrize("kernels", ["on", "off"])
@pytest.mark.parametrize("n_centers", [2, 5, 8])
@pytest.mark.parametrize("spacings", BANDWIDTHS_IN_SPACINGS)
def test_float32_equals_the_plain_float64_form(kernels, n_centers, spacings, device, monkeypatch):
    monkeypatch.setenv("KARF_KERNELS", kernels)
    inputs = make_inputs(n_centers, spacings, torch.float32, n=1200, device=device)
    exact_inputs = [tensor.detach().double().requires_grad_() for tensor in inputs]
    fast = value_and_gradients(grbf, inputs, n_centers)
    exact = value_and_gradients(grbf_reference, exact_inputs, n_centers)
    for name, ours, truth in zip(("y", "x", "u", "weight", "bias"), fast[:-1], exact[:-1], strict=True):
        error = (ours.double() - truth).abs().max() / truth.abs().max()
        assert error < 2e-5, name
    # The bandwidth's gradient is a sum over all entries, with cancellation: measure it against the sum's typical size.
    entries = inputs[1].numel()
    assert abs(fast[-1].double() - exact[-1]) < 1e-5 * abs(exact[-1]) + 1e-6 * entries


def test_bandwidth_gradient_has_full_precision_in_float64(device):
    inputs = make_inputs(8, 1.0, torch.float64, n=1200, device=device)
    fast = value_and_gradients(grbf, inputs, 8)[-1]
    exact = value_and_gradients(grbf_reference, inputs, 8)[-1]
    assert abs(fast - exact) < 1e-5 * abs(exact)


def test_a_center_gives_one_and_its_neighbors_fall_by_equation_five():
    # h is the spacing 4/7, so one, two and three centers away the Gaussian is exp(-1/2), exp(-2), exp(-9/2).
    u = torch.tensor([[-2.0 + 5 * 4 / 7]])
    weight = torch.eye(8, 9)
    bases = grbf(torch.zeros(1, 1), u, weight, torch.zeros(8), torch.tensor(4 / 7), 8)[0]
    expected = [math.exp(-((k - 5) ** 2) / 2) for k in range(8)]
    torch.testing.assert_close(bases, torch.tensor(expected), rtol=2e-6, atol=1e-9)


@pytest.mark.parametrize("spacings", BANDWIDTHS_IN_SPACINGS)
@pytest.mark.parametrize("magnitude", [0.0, 2.0, 2.7, 4.0, 30.0, 1e4, 1e30])
def test_values_and_gradients_are_finite_for_any_input(spacings, magnitude, device):
    inputs = make_inputs(8, spacings, torch.float32, device=device)
    with torch.no_grad():
        inputs[1].copy_(magnitude * torch.sign(inputs[1]))
    assert all(torch.isfinite(tensor).all() for tensor in value_and_gradients(grbf, inputs, 8))


@pytest.mark.parametrize("spacings", BANDWIDTHS_IN_SPACINGS)
def test_far_outside_the_grid_only_the_base_branch_is_left(spacings):
    x, u, weight, bias, bandwidth = make_inputs(8, spacings, torch.float32)
    base_block = weight[:, 8 * x.shape[1] :]
    expected = torch.nn.functional.linear(torch.nn.functional.silu(x), base_block, bias)
    far = torch.where(u > 0, 1e4, -1e4)
    torch.testing.assert_close(grbf(x, far, weight, bias, bandwidth, 8), expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("rows", [0, 1, 6, 7, 8, 29])
def test_result_does_not_depend_on_the_chunk_size(rows, monkeypatch):
    inputs = make_inputs(8, 1.0, torch.float64, n=rows)
    whole = value_and_gradients(grbf, inputs, 8)
    monkeypatch.setattr(grbf_module, "_CPU_ROWS_PER_CHUNK", 7)
    for chunked, expected in zip(value_and_gradients(grbf, inputs, 8), whole, strict=True):
        torch.testing.assert_close(chunked, expected)


def derivatives_of_gradients(layer, function, x):
    """Derivatives of |dy/dx|^2 by x and the layer's parameters, and those of their squares: of second and third order."""
    x = x.clone().requires_grad_()
    wanted = [x, *layer.parameters()]
    (slope,) = torch.autograd.grad(function(x).square().sum(), x, create_graph=True)
    second = torch.autograd.grad(slope.square().sum(), wanted, create_graph=True)
    third = torch.autograd.grad(sum(each.square().sum() for each in second), wanted)
    return second + third


@pytest.mark.parametrize("kernels", ["on", "off"])
def test_derivatives_of_gradients_are_those_of_the_plain_formula(kernels, monkeypatch):
    monkeypatch.setenv("KARF_KERNELS", kernels)
    torch.manual_seed(0)
    layer, x = GRBFLayer(3, 2), torch.randn(5, 3)

    def plain(x):
        return grbf_reference(x, layer.norm(x), layer.weight, layer.bias, layer.bandwidth(), 8)

    for ours, expected in zip(
        derivatives_of_gradients(layer, layer, x), derivatives_of_gradients(layer, plain, x), strict=True
    ):
        torch.testing.assert_close(ours, expected, rtol=1e-4, atol=1e-5 * float(expected.abs().max()))


def test_a_jacobian_is_that_of_single_gradients():
    layer, x = GRBFLayer(3, 2), torch.randn(3)
    jacobian = torch.func.jacrev(layer)(x)
    single = [torch.autograd.functional.jacobian(lambda x, k=k: layer(x)[k], x) for k in range(2)]
    torch.testing.assert_close(jacobian, torch.stack(single), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("make", [GRBFLayer, BSplineLayer, MLPLayer])
def test_a_layer_takes_any_axes_before_its_inputs(make):
    layer, x = make(3, 2), torch.randn(4, 5, 3)
    torch.testing.assert_close(layer(x), layer(x.flatten(0, 1)).unflatten(0, (4, 5)))
    torch.testing.assert_close(layer(x[0, 0]), layer(x[0])[0])
    assert layer(x[:0]).shape == (0, 5, 2)


def test_what_is_not_a_number_stays_so_in_kernels():
    pytest.importorskip("numba")
    inputs = make_inputs(8, 1.0, torch.float32)
    with torch.no_grad():
        inputs[0][3] = inputs[1][3] = torch.nan
    output = grbf(*inputs, 8)
    assert torch.isnan(output[3]).all() and torch.isfinite(output[4:]).all()


def test_one_and_two_cores_give_the_same_bits(monkeypatch):
    monkeypatch.setattr(grbf_module, "_CPU_ROWS_PER_CHUNK", 7)
    inputs = make_inputs(8, 1.0, torch.float32, n=60)
    results = []
    for n_cores in (1, 2):
        cores.set_core_count(n_cores)
        cores.limit_torch_threads()
        results.append(value_and_gradients(grbf, inputs, 8))
    cores.set_core_count(1)
    for one, two in zip(*results, strict=True):
        assert torch.equal(one, two)


def test_layer_equals_its_formula_written_with_loops():
    layer = GRBFLayer(3, 2, n_centers=4, bandwidth=1.1)
    x = torch.randn(5, 3, generator=torch.Generator().manual_seed(3))
    u = layer.norm(x)
    for row in range(5):
        for out in range(2):
            total = layer.bias[out].item()
            for i in range(3):
                value = x[row, i].item()
                total += layer.weight[out, 4 * 3 + i].item() * value / (1 + math.exp(-value))
                for k in range(4):
                    distance = u[row, i].item() - (-2 + 4 * k / 3)
                    total += layer.weight[out, k * 3 + i].item() * math.exp(-(distance**2) / (2 * 1.1**2))
            assert layer(x)[row, out].item() == pytest.approx(total, abs=1e-5)


@pytest.mark.parametrize(("learn_bandwidth", "expected"), [(False, 735_870), (True, 735_871)])
def test_layer_has_the_published_number_of_parameters(learn_bandwidth, expected):
    layer = GRBFLayer(319, 256, learn_bandwidth=learn_bandwidth)
    assert sum(parameter.numel() for parameter in layer.parameters()) == expected


def test_backward_keeps_no_bases():
    n, n_in = 600, 16
    layer, x = GRBFLayer(n_in, 8), torch.randn(n, n_in)
    kept = []
    with torch.autograd.graph.saved_tensors_hooks(lambda tensor: kept.append(tensor.numel()) or tensor, lambda t: t):
        layer(x)
    assert max(kept) <= max(n * n_in, layer.weight.numel())


@pytest.mark.parametrize(
    ("name", "expected"), [("eq5", 0.571429), ("fastkan", 0.404061), ("xkanerf", 0.707107), (0.6, 0.6)]
)
def test_named_bandwidths_are_those_of_the_three_sources(name, expected):
    assert resolve_bandwidth(name, 8) == pytest.approx(expected, abs=1e-6)
    assert GRBFLayer(2, 2, bandwidth=name).bandwidth().item() == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("start, limit", [(-9.0, 0.2), (9.0, 8 / 7)])
def test_learned_bandwidth_stays_between_its_limits(start, limit):
    layer = GRBFLayer(2, 2)
    with torch.no_grad():
        layer.log_bandwidth.fill_(start)
    assert layer.bandwidth().item() == pytest.approx(limit, rel=1e-6)
    assert torch.isfinite(layer(torch.randn(4, 2))).all()


@pytest.mark.parametrize("arguments", [{"n_centers": 1}, {"n_centers": 9}, {"bandwidth": "wide"}, {"bandwidth": 9.0}])
def test_impossible_settings_are_refused(arguments):
    with pytest.raises(BadRequest):
        GRBFLayer(2, 2, **arguments)
