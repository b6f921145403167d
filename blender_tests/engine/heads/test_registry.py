"""Heads and layers are built by name, also those of other files, and unknown names are rejected."""

import pytest
import torch

from karf_engine.errors import BadRequest
from karf_engine.heads import registry
from karf_engine.heads.fields import SegmentationField
from karf_engine.heads.files import load_segmentation, save_segmentation
from karf_engine.heads.registry import HEADS, build_head, register_head
from karf_engine.kan import GRBFLayer, count_parameters, layers, register_layer
from karf_engine.kan.layers import LAYERS
from karf_engine.project.settings import (
    HEAD_KINDS,
    LAYER_KINDS,
    HeadSettings,
    SegmentationSettings,
    Settings,
    with_overrides,
)

P, FEATURES = 63, 256


def small_inputs(n=6):
    generator = torch.Generator().manual_seed(5)
    return [torch.randn(n, width, generator=generator) for width in (9, 7, 3)]  # position, features, direction


@pytest.mark.parametrize("kind", HEADS)
@pytest.mark.parametrize("n_direction", [0, 3])
def test_heads_give_unrectified_logits(kind, n_direction):
    torch.manual_seed(0)
    head = build_head(HeadSettings(head=kind, width=8), 9, n_direction, 7, n_out=4)
    position, features, direction = small_inputs()
    logits = head(position, features, direction if n_direction else None)
    assert logits.shape == (6, 4) and logits.min() < 0


def test_mlp_head_has_two_hidden_layers():
    head = build_head(HeadSettings(head="mlp", width=64), P, 0, FEATURES, n_out=2)
    assert count_parameters(head) == (319 * 64 + 64) + (64 * 64 + 64) + (64 * 2 + 2)


def n_parameters(**settings):
    return count_parameters(build_head(HeadSettings(**settings), 33, 15, 12, n_out=10))


@pytest.mark.parametrize(
    "choice",
    [
        {"head": "mlp"},
        {"layer": "mlp"},
        {"layer": "bspline"},
        {"layer": "mlp", "variant": "none"},
        {"variant": "none"},
        {"variant": "none", "centers": 5},
    ],
)
def test_matched_heads_have_as_many_parameters_as_the_full_block(choice):
    full = n_parameters(width=64, centers=choice.get("centers", 8))
    matched = n_parameters(width=64, match="parameters", **choice)
    assert abs(matched - full) < 0.01 * full < abs(n_parameters(width=64, **choice) - full)
    assert n_parameters(width=64, match="parameters") == n_parameters(width=64)


@pytest.mark.parametrize("bandwidth, expected", [("eq5", 1.0), ("fastkan", 0.5**0.5), ("xkanerf", 0.5**0.5)])
@pytest.mark.parametrize("learn", [True, False])
def test_settings_reach_every_gaussian_layer_of_a_head(bandwidth, expected, learn):
    settings = HeadSettings(width=8, centers=5, bandwidth=bandwidth, learn_bandwidth=learn)
    head = build_head(settings, 9, 3, 7, n_out=4)
    gaussian_layers = [module for module in head.modules() if isinstance(module, GRBFLayer)]
    assert len(gaussian_layers) == 4
    for layer in gaussian_layers:
        assert layer.n_centers == 5
        assert layer.bandwidth().item() == pytest.approx(expected, rel=1e-4)  # five centers are one apart
        assert isinstance(layer.log_bandwidth, torch.nn.Parameter) == learn


def test_settings_list_the_built_in_kinds():
    assert {"kan", "mlp"} <= set(HEADS) == set(HEAD_KINDS)
    assert {"grbf", "bspline", "mlp"} <= set(LAYERS) == set(LAYER_KINDS)


@pytest.mark.parametrize("stage", ["segmentation", "recoloring"])
@pytest.mark.parametrize(("key", "known"), [("head", "kan, mlp"), ("layer", "grbf, bspline, mlp")])
def test_settings_reject_unknown_kinds_and_list_known_ones(stage, key, known):
    with pytest.raises(BadRequest) as caught:
        with_overrides(Settings(), [f"{stage}.{key}=cnn"])
    assert caught.value.sentence == f"{stage}.{key} = 'cnn' is not allowed."
    assert caught.value.hint.startswith(f"Use one of: {known}")


def test_unknown_heads_and_taken_names_are_rejected():
    with pytest.raises(BadRequest, match="cnn"):
        build_head(HeadSettings(head="cnn"), 9, 3, 7, n_out=4)
    with pytest.raises(BadRequest, match="kan"):
        register_head("kan", lambda sizes, settings: torch.nn.Identity())
    with pytest.raises(BadRequest, match="grbf"):
        register_layer("grbf", lambda n_in, n_out, options: torch.nn.Linear(n_in, n_out))


@pytest.fixture
def restored(monkeypatch):
    """Registries are restored after the test."""
    monkeypatch.setattr(registry, "HEADS", dict(HEADS))
    monkeypatch.setattr(layers, "LAYERS", dict(LAYERS))
    heads, kinds = HEAD_KINDS[:], LAYER_KINDS[:]
    yield
    HEAD_KINDS[:], LAYER_KINDS[:] = heads, kinds


@pytest.fixture
def fourier(restored):
    from blender_tests.engine.heads import example_head

    register_head("fourier", example_head.fourier_head)  # again, in case that another test has imported it
    return example_head


def test_external_head_is_built_and_matched_in_parameters(fourier):
    settings = with_overrides(Settings(), ["recoloring.head=fourier", "recoloring.width=8"]).recoloring
    head = build_head(settings, 9, 3, 7, n_out=4)
    assert isinstance(head, fourier.FourierHead) and head(*small_inputs()).shape == (6, 4)
    full = n_parameters(width=16)
    assert n_parameters(head="fourier", width=16, match="parameters") == pytest.approx(full, rel=0.01)


def test_external_head_learns_and_survives_saving(fourier, tmp_path):
    torch.manual_seed(0)
    settings = SegmentationSettings(head="fourier", width=32)
    karf = SegmentationField(torch.tensor([[[-1.0] * 3, [1.0] * 3]]), 4, settings)
    positions, features = torch.rand(400, 3) * 2 - 1, torch.zeros(400, 4)
    classes = (positions[:, 0] > 0).long()
    optimizer = torch.optim.Adam(karf.parameters(), lr=0.02)
    for _ in range(100):
        loss = torch.nn.functional.cross_entropy(karf.logits(positions, features), classes)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert (karf(positions, features).argmax(1) == classes).float().mean() > 0.95
    save_segmentation(tmp_path / "f_s.safetensors", karf, ["pot"], settings)
    loaded, _ = load_segmentation(tmp_path / "f_s.safetensors", 4)
    assert torch.equal(loaded(positions, features), karf(positions, features))


def test_external_layer_makes_a_gated_block(restored):
    layers.register_layer("linear", lambda n_in, n_out, options: torch.nn.Linear(n_in, n_out))
    settings = with_overrides(Settings(), ["segmentation.layer=linear"]).segmentation
    head = build_head(settings, 9, 0, 7, n_out=4)
    assert isinstance(head.head, torch.nn.Linear) and isinstance(head.backbone[0], torch.nn.Linear)
