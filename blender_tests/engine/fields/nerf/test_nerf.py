"""The vanilla NeRF computes what a plain reading of its paper and programs computes."""

import math

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from blender_tests.engine.reference.nerf import composited, fine_t, vanilla
from karf_engine.errors import DataError
from karf_engine.fields.files import SCHEMA, load_scene, save_scene
from karf_engine.fields.nerf.field import NerfField, NerfNetwork, NerfSampling, NerfShape
from karf_engine.fields.rendering.rays import Rays
from karf_engine.fields.rendering.space import Box, Similarity
from karf_engine.fields.scene import Scene
from karf_engine.io.checkpoints import load_tensors, save_tensors

SMALL = NerfShape(width=16, view_width=8, position_frequencies=4, direction_frequencies=2)


def network(shape=SMALL, seed=0):
    torch.manual_seed(seed)
    made = NerfNetwork(shape)
    for layer in made.modules():  # larger weights than a fresh network's make some of it solid
        if isinstance(layer, torch.nn.Linear):
            layer.weight.data *= 2
    return made.requires_grad_(False)


def field(space=None, sampling=None):
    sampling = sampling or NerfSampling(1.0, 4.0, coarse=8, fine=12)
    bounds = torch.tensor([[-1.0, -2.0, -1.0], [1.0, 2.0, 1.0]])
    return NerfField(network(seed=1), network(seed=2), sampling, space or Box(), bounds)


def in_float64(module):
    return {name: value.double().numpy() for name, value in module.state_dict().items()}


def some_rays(count=6):
    random = torch.Generator().manual_seed(0)
    viewdirs = torch.nn.functional.normalize(torch.randn(count, 3, generator=random), dim=1)
    return Rays(torch.randn(count, 3, generator=random) - 2 * viewdirs, viewdirs)


def reference_color(module, ray, ground):
    """Color of one ray, computed by the reference."""
    origin, direction = ray.origins[0].double().numpy(), ray.viewdirs[0].double().numpy()
    t = np.linspace(module.sampling.near, module.sampling.far, module.sampling.coarse)
    coarse = [vanilla(in_float64(module.coarse), origin + v * direction, direction, (4, 2)) for v in t]
    weights = composited([c[0] for c in coarse], [c[2] for c in coarse], t, 1.0, ground)[1]
    t = fine_t(t, weights, module.sampling.fine)
    fine = [vanilla(in_float64(module.fine), origin + v * direction, direction, (4, 2)) for v in t]
    return composited([f[0] for f in fine], [f[2] for f in fine], t, 1.0, ground)[0]


def test_network_has_the_papers_layers_and_parameters():
    made = NerfNetwork(NerfShape())
    assert sum(p.numel() for p in made.parameters()) == 595_844
    assert [layer.in_features for layer in made.pts_linears] == [63, 256, 256, 256, 256, 319, 256, 256]
    assert (made.feature_linear.out_features, made.views_linears[0].in_features) == (256, 283)
    assert (made.views_linears[0].out_features, made.rgb_linear.out_features) == (128, 3)


def test_density_features_and_color_match_the_reference():
    module, rays = field(), some_rays()
    features = module.features(rays.origins)
    colors = module.color(rays.origins, rays.viewdirs, features)
    for n in range(len(rays)):
        raw, expected, color = vanilla(in_float64(module.fine), rays.origins[n], rays.viewdirs[n], (4, 2))
        assert_allclose(module.density(rays.origins)[n], max(raw, 0), rtol=1e-4, atol=1e-5)
        assert_allclose(features[n], expected, rtol=1e-4, atol=1e-4)
        assert_allclose(colors[n], color, atol=1e-5)


@pytest.mark.parametrize(("kind", "ground"), [("alpha", 1.0), ("white", 1.0), ("black", 0.0), ("opaque", 0.0)])
def test_colors_of_rays_match_the_reference(kind, ground):
    module, rays = field(), some_rays()
    colors = Scene(module, None, kind, 1.0).colors(rays)
    expected = np.stack([reference_color(module, rays[n : n + 1], ground) for n in range(len(rays))])
    assert_allclose(colors, expected, atol=2e-3)
    assert expected.std() > 0.02  # they are not plain gray


def test_trace_samples_are_sorted_with_weights_that_sum_to_one():
    rays = some_rays()
    trace = field().trace(rays)
    assert len(trace.samples) == 6 * 20
    assert (trace.samples.distances.view(6, 20).diff(dim=1) >= 0).all()
    assert_allclose(trace.ray_weights.view(6, 20).sum(1) + trace.final_transmittance, np.ones(6), atol=1e-5)
    along = rays.origins[0] + trace.samples.distances[:20, None] * rays.viewdirs[0]
    assert_allclose(trace.samples.positions[:20], along, atol=1e-5)


def test_moved_rotated_and_scaled_field_renders_the_same():
    scale, shift, cos, sin, rays = 2.5, torch.tensor([0.3, -1.0, 2.0]), math.cos(0.7), math.sin(0.7), some_rays()
    rotation = torch.tensor([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])
    world_to_grid = torch.eye(4)
    world_to_grid[:3, :3], world_to_grid[:3, 3] = scale * rotation, -scale * rotation @ shift
    moved_rays = Rays(rays.origins @ rotation / scale + shift, rays.viewdirs @ rotation)
    sampling = NerfSampling(1.0 / scale, 4.0 / scale, coarse=8, fine=12)
    moved = Scene(field(Similarity(world_to_grid), sampling), None, "black", 1.0).colors(moved_rays)
    assert_allclose(moved, Scene(field(), None, "black", 1.0).colors(rays), atol=1e-3)


@pytest.mark.parametrize("shape", [SMALL, NerfShape(3, 8, (), 4, 3, 1, True, True)], ids=["vanilla", "flexible"])
def test_saved_scene_loads_bit_by_bit(tmp_path, shape):
    matrix = torch.eye(4)
    matrix[0, 3] = 0.5
    sampling = NerfSampling(0.5, 9.0, True, 8, 12)
    made = NerfField(network(shape, 1), network(SMALL, 2), sampling, Similarity(matrix), torch.randn(2, 3))
    scene = Scene(made, None, "opaque", 1.0)
    save_scene(scene, tmp_path / "scene.safetensors")
    loaded = load_scene(tmp_path / "scene.safetensors")
    assert loaded.field.coarse.shape == shape and loaded.field.sampling == sampling
    assert loaded.background is None and loaded.background_kind == "opaque"
    assert torch.equal(loaded.field.bounds, made.bounds)
    assert torch.equal(loaded.colors(some_rays()), scene.colors(some_rays()))


CONTRADICTIONS = [
    *({"fine": {"depth": 10**9}}, {"fine": {"width": 10**6}}, {"sampling": {"coarse": 10**9}}, {"coarse": None}),
    *({"space": {"world_to_grid": [1.0]}}, {"step": 100.0}, {"background_kind": "fog"}),
    *({"kind": kind} for kind in ("gaussians", ["voxels"], {}, None)),
]


@pytest.mark.parametrize("change", CONTRADICTIONS, ids=str)
def test_scene_contradicting_its_networks_is_rejected(tmp_path, change):
    path = tmp_path / "scene.safetensors"
    save_scene(Scene(field(Similarity(torch.eye(4))), None, "opaque", 1.0), path)
    tensors, facts = load_tensors(path, SCHEMA)
    for name, value in change.items():
        facts[name] = facts[name] | value if isinstance(value, dict) and value else value
    save_tensors(path, tensors, SCHEMA, facts)
    with pytest.raises(DataError, match="unknown kind" if "kind" in change else "is damaged"):
        load_scene(path)


def test_voxel_size_follows_the_bounds():
    assert field().voxel == pytest.approx(4 / 128)
    assert field().n_features == 16
