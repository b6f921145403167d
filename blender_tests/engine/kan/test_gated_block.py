"""The gated block equals Equation 6 and has the published size; encoding and standardizer are exact."""

import math
import subprocess
import sys

import numpy as np
import pytest
import torch
import torch.nn.functional as F

from blender_tests.engine.conftest import ROOT
from karf_engine.errors import BadRequest, DataError
from karf_engine.kan.gated_block import VARIANTS, GatedBlock
from karf_engine.kan.inputs import Standardizer, positional_encoding
from karf_engine.kan.layers import LAYERS

P, D, FEATURES = 63, 27, 256


# Segmentation without gate: K1 735,870 + K2 590,592 + H 6,382. The gate adds Linear 81,920 and K 590,592; beta adds
# 256, alpha 1.
@pytest.mark.parametrize(
    ("n_direction", "n_out", "options", "n_bandwidths", "expected"),
    [
        (D, 7, {}, 4, 2_089_147),
        (0, 2, {}, 4, 2_005_613),
        (0, 2, {"variant": "none"}, 3, 1_332_844),
        (0, 2, {"variant": "gate"}, 4, 2_005_356),
        (0, 2, {"variant": "no_residual"}, 4, 2_005_612),
        (D, 7, {"layer": "mlp"}, 0, 2 * (346 * 256 + 256) + 2 * (256 * 256 + 256) + 319 * 7 + 7 + 256 + 1),
    ],
)
def test_block_has_the_published_size(n_direction, n_out, options, n_bandwidths, expected):
    block = GatedBlock(P, n_direction, FEATURES, n_out, **options)
    assert sum("log_bandwidth" in name for name, _ in block.named_parameters()) == n_bandwidths
    assert sum(parameter.numel() for parameter in block.parameters()) == expected + n_bandwidths


@pytest.mark.parametrize("layer", LAYERS)
@pytest.mark.parametrize("variant", VARIANTS)
def test_block_equals_equation_six_for_each_variant(layer, variant):
    torch.manual_seed(11)
    block = GatedBlock(9, 3, 7, n_out=4, width=8, layer=layer, variant=variant)
    for name, parameter in block.named_parameters():
        if name in ("alpha", "beta"):
            assert (parameter == (0 if name == "alpha" else 1)).all()  # the residual starts at one half
            torch.nn.init.uniform_(parameter, -1, 2)
    position, features, direction = torch.randn(6, 9), torch.randn(6, 7), torch.randn(6, 3)
    z = torch.cat([position, direction, features], dim=1)
    blend = block.backbone[1](block.backbone[0](z))
    if variant != "none":
        f_q = z @ block.gate_linear.weight.T + block.gate_linear.bias
        f_g = block.gate_layer(f_q)
        blend = F.silu(f_g if variant == "gate" else block.beta * f_g) * blend
    if variant == "all":
        blend = torch.sigmoid(block.alpha) * f_q + blend
    logits = block(position, features, direction)
    torch.testing.assert_close(logits, block.head(torch.cat([blend, position], dim=1)))
    logits.square().sum().backward()
    for name, parameter in block.named_parameters():
        assert parameter.grad is not None and torch.isfinite(parameter.grad).all(), name


def test_fresh_full_width_block_starts_near_uniform():
    torch.manual_seed(0)
    logits = GatedBlock(P, D, FEATURES, 7)(torch.randn(200, P), torch.randn(200, FEATURES), torch.randn(200, D))
    assert F.softmax(logits, dim=1).max(dim=1).values.mean() < 0.4


@pytest.mark.parametrize("options", [{"layer": "spline"}, {"variant": "half"}])
def test_unknown_layers_and_variants_are_rejected(options):
    with pytest.raises(BadRequest, match=next(iter(options.values()))):
        GatedBlock(9, 3, 7, n_out=4, width=8, **options)


@pytest.mark.parametrize("n_frequencies", [0, 2, 10])
def test_encoding_orders_input_sines_and_cosines(n_frequencies):
    expected = values = [0.1, -0.2, 0.3]
    for scale in 2 ** np.arange(n_frequencies):
        expected = [*expected, *(math.sin(scale * value) for value in values)]
        expected = [*expected, *(math.cos(scale * value) for value in values)]
    encoded = positional_encoding(torch.tensor([values, values]), n_frequencies)
    torch.testing.assert_close(encoded, torch.tensor([expected, expected]), rtol=0, atol=1e-4)


def test_standardizer_gives_zero_mean_and_unit_deviation_at_any_scale():
    standardizer = Standardizer(3)
    features = torch.randn(5000, 3) * torch.tensor([1e-3, 1.0, 300.0]) + torch.tensor([0.0, -4.0, 900.0])
    standardizer.fit(features)
    result = standardizer(features)
    torch.testing.assert_close(result.mean(dim=0), torch.zeros(3), atol=1e-4, rtol=0)
    torch.testing.assert_close(result.std(dim=0, correction=0), torch.ones(3), atol=1e-4, rtol=0)


def test_standardizer_does_not_amplify_rounding_noise():
    standardizer = Standardizer(2)
    features = torch.tensor([[0.0, 900.0], [0.0, 900.0], [0.0, 900.0001]])  # the last differs by float32 rounding
    standardizer.fit(features)
    assert torch.equal(standardizer(features)[:, 0], torch.zeros(3))
    assert standardizer(features)[:, 1].abs().max() < 1e-3


def test_standardizer_is_saved_not_trained_and_rejects_nan():
    fitted, restored = Standardizer(2), Standardizer(2)
    fitted.fit(torch.tensor([[1.0, 2.0], [3.0, 6.0]]))
    restored.load_state_dict(fitted.state_dict())
    assert (restored.mean.tolist(), restored.std.tolist()) == ([2.0, 4.0], [1.0, 2.0])
    assert not list(fitted.parameters())
    with pytest.raises(DataError):
        Standardizer(1).fit(torch.tensor([[1.0], [float("nan")]]))


def test_kan_layers_import_no_scene_packages():
    code = "import sys; from karf_engine.kan import GRBFLayer, GatedBlock; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    packages = {name.split(".")[1] for name in loaded.split() if name.startswith("karf_engine.")}
    assert "kan" in packages and packages <= {"kan", "compute", "errors", "io", "project", "version"}
