"""The gated block against Equation 6 written out, its switches, its size; encoding and standardizer."""

import math

import pytest
import torch
import torch.nn.functional as F

from karf_engine.errors import BadRequest, DataError
from karf_engine.kan.gated_block import VARIANTS, GatedBlock
from karf_engine.kan.inputs import Standardizer, positional_encoding
from karf_engine.kan.layers import LAYERS

P, D, FEATURES = 63, 27, 256


def count_without_bandwidths(module):
    return sum(parameter.numel() for name, parameter in module.named_parameters() if "log_bandwidth" not in name)


def small_inputs(n=6):
    generator = torch.Generator().manual_seed(5)
    return [torch.randn(n, width, generator=generator) for width in (9, 7, 3)]  # position, features, direction


def small_block(**options):
    torch.manual_seed(11)
    return GatedBlock(9, 3, 7, n_out=4, width=8, **options)


@pytest.mark.parametrize("n_direction, n_out, expected", [(D, 7, 2_089_147), (0, 2, 2_005_613)])
def test_full_block_has_the_published_number_of_parameters(n_direction, n_out, expected):
    block = GatedBlock(P, n_direction, FEATURES, n_out)
    assert count_without_bandwidths(block) == expected
    assert sum(parameter.numel() for parameter in block.parameters()) == expected + 4


# Sums of the layers' formulas. Segmentation without gate: K1 735,870 + K2 590,592 + H 6,382. The gate adds Linear
# 81,920 and K 590,592; beta adds 256, alpha 1.
@pytest.mark.parametrize(
    "variant, expected", [("none", 1_332_844), ("gate", 2_005_356), ("no_residual", 2_005_612), ("all", 2_005_613)]
)
def test_each_variant_holds_only_what_it_uses(variant, expected):
    assert count_without_bandwidths(GatedBlock(P, 0, FEATURES, 2, variant=variant)) == expected


@pytest.mark.parametrize("layer", LAYERS)
@pytest.mark.parametrize("variant", VARIANTS)
def test_every_parameter_is_used(layer, variant):
    block = small_block(layer=layer, variant=variant)
    block(*small_inputs()).square().sum().backward()
    for name, parameter in block.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name


def test_mlp_block_counts_linear_layers_only():
    block = GatedBlock(P, D, FEATURES, 7, layer="mlp")
    expected = 2 * (346 * 256 + 256) + 2 * (256 * 256 + 256) + 319 * 7 + 7 + 256 + 1
    assert count_without_bandwidths(block) == expected


@pytest.mark.parametrize("layer", LAYERS)
def test_full_block_equals_equation_six(layer):
    block = small_block(layer=layer)
    with torch.no_grad():
        block.alpha.fill_(0.7)
        block.beta.uniform_(-1, 2)
    position, features, direction = small_inputs()
    z = torch.cat([position, direction, features], dim=1)
    f_h = block.backbone[1](block.backbone[0](z))
    f_q = z @ block.gate_linear.weight.T + block.gate_linear.bias
    f_g = block.gate_layer(f_q)
    blend = f_q / (1 + math.exp(-0.7)) + F.silu(block.beta * f_g) * f_h
    expected = block.head(torch.cat([blend, position], dim=1))
    torch.testing.assert_close(block(position, features, direction), expected)


def test_variants_differ_only_by_their_switch():
    position, features, direction = small_inputs()
    full = small_block(variant="all")
    outputs = {}
    for variant in VARIANTS:
        block = small_block(variant=variant)
        block.load_state_dict({k: v for k, v in full.state_dict().items() if k in block.state_dict()})
        outputs[variant] = block(position, features, direction)
    # beta starts at 1, so only the residual and the gate itself make a difference before training.
    torch.testing.assert_close(outputs["gate"], outputs["no_residual"])
    assert not torch.allclose(outputs["no_residual"], outputs["all"])
    assert not torch.allclose(outputs["none"], outputs["gate"])


def test_residual_starts_at_one_half():
    block = small_block()
    assert torch.sigmoid(block.alpha).item() == 0.5
    assert torch.equal(block.beta, torch.ones(8))


def test_fresh_full_width_block_starts_near_uniform():
    torch.manual_seed(0)
    logits = GatedBlock(P, D, FEATURES, 7)(torch.randn(200, P), torch.randn(200, FEATURES), torch.randn(200, D))
    assert F.softmax(logits, dim=1).max(dim=1).values.mean() < 0.4


def test_unknown_names_are_refused():
    with pytest.raises(BadRequest, match="spline"):
        small_block(layer="spline")
    with pytest.raises(BadRequest, match="half"):
        small_block(variant="half")


def test_encoding_keeps_the_input_and_orders_sines_before_cosines():
    x = torch.tensor([[0.1, -0.2, 0.3]])
    encoded = positional_encoding(x, 2)[0]
    expected = [0.1, -0.2, 0.3]
    for scale in (1, 2):
        expected += [math.sin(scale * value) for value in (0.1, -0.2, 0.3)]
        expected += [math.cos(scale * value) for value in (0.1, -0.2, 0.3)]
    torch.testing.assert_close(encoded, torch.tensor(expected))


@pytest.mark.parametrize("n_frequencies, width", [(0, 3), (4, 27), (10, 63)])
def test_encoding_has_three_and_six_a_frequency_numbers(n_frequencies, width):
    assert positional_encoding(torch.zeros(2, 3), n_frequencies).shape == (2, width)


def test_standardizer_gives_zero_mean_and_unit_deviation_at_any_scale():
    standardizer = Standardizer(3)
    features = torch.randn(5000, 3) * torch.tensor([1e-3, 1.0, 300.0]) + torch.tensor([0.0, -4.0, 900.0])
    standardizer.fit(features)
    result = standardizer(features)
    torch.testing.assert_close(result.mean(dim=0), torch.zeros(3), atol=1e-4, rtol=0)
    torch.testing.assert_close(result.std(dim=0, correction=0), torch.ones(3), atol=1e-4, rtol=0)


def test_standardizer_does_not_amplify_rounding_noise_of_a_constant_channel():
    standardizer = Standardizer(2)
    features = torch.tensor([[0.0, 900.0], [0.0, 900.0], [0.0, 900.0001]])  # the last differs by float32 rounding
    standardizer.fit(features)
    assert torch.equal(standardizer(features)[:, 0], torch.zeros(3))
    assert standardizer(features)[:, 1].abs().max() < 1e-3


def test_standardizer_is_saved_and_never_trained():
    fitted, restored = Standardizer(2), Standardizer(2)
    fitted.fit(torch.tensor([[1.0, 2.0], [3.0, 6.0]]))
    restored.load_state_dict(fitted.state_dict())
    assert torch.equal(restored.mean, torch.tensor([2.0, 4.0]))
    assert torch.equal(restored.std, torch.tensor([1.0, 2.0]))
    assert not list(fitted.parameters())


def test_standardizer_refuses_values_that_are_not_finite():
    with pytest.raises(DataError):
        Standardizer(1).fit(torch.tensor([[1.0], [float("nan")]]))
