"""A frozen field looks the same through the compiled kernels as through torch, however its rays are split."""

import sys
from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("numba")

from torch.testing import assert_close

from blender_tests.engine.fields.voxels.test_kernels import SPACES, check_bounds, random_batch, random_field
from karf_engine.compute import cores
from karf_engine.fields import scene as scenes
from karf_engine.fields.rendering.rays import Rays
from karf_engine.fields.scene import Scene
from karf_engine.fields.voxels.field import VoxelField

ROOT = Path(__file__).resolve().parents[4]
DARK = 1e-4  # of the light left, kernels end a ray
GRAY = 1 / 255


def frozen_field(space: str, share: float = 0.6) -> VoxelField:
    """A random field, in which about half of all rays end."""
    field = random_field(space, share=share)
    field.raw_density.data.add_(4.0)
    return field.requires_grad_(False)


@pytest.fixture
def by_torch(monkeypatch):
    """Call a function where kernels are left out."""

    def call(function, *arguments):
        with monkeypatch.context() as patch:
            patch.setenv("KARF_KERNELS", "off")
            return function(*arguments)

    return call


@pytest.mark.parametrize("space", SPACES)
def test_rays_end_where_torch_lets_them_end(space, by_torch):
    field, rays = frozen_field(space), random_batch(space).rays
    trace, expected = field.trace(rays, 0.7), by_torch(field.trace, rays, 0.7)
    assert 0 < len(trace.samples) < len(expected.samples)  # torch goes on in the dark
    assert_close(trace.final_transmittance, expected.final_transmittance, rtol=1e-3, atol=DARK)
    assert trace.samples.ray_indices.dtype == torch.int64 and (trace.samples.ray_indices.diff() >= 0).all()
    assert trace.samples.step == pytest.approx(expected.samples.step)
    for number in range(len(rays)):
        own, theirs = (trace.samples.ray_indices == number), (expected.samples.ray_indices == number)
        until = int(own.sum())
        for name in ("distances", "positions"):
            some, others = getattr(trace.samples, name)[own], getattr(expected.samples, name)[theirs]
            assert_close(some, others[:until], rtol=1e-4, atol=1e-4)
        weights, all_weights = trace.ray_weights[own], expected.ray_weights[theirs]
        assert_close(weights, all_weights[:until], rtol=1e-3, atol=1e-4)
        assert all_weights[until:].sum() <= 1.1 * DARK


@pytest.mark.parametrize("share", [1.0, 0.6, 0.05])
def test_features_and_colors_are_those_of_torch_wherever_they_are_asked(share, by_torch):
    field, random = frozen_field("box", share), torch.Generator().manual_seed(3)
    low, high = field.bounds
    positions = low + (1.2 * torch.rand(3001, 3, generator=random) - 0.1) * (high - low)  # some outside
    viewdirs = torch.nn.functional.normalize(torch.randn(3001, 3, generator=random), dim=1)
    features, expected = field.features(positions), by_torch(field.features, positions)
    assert_close(features, expected, rtol=1e-4, atol=1e-4)
    color = field.color(positions, viewdirs, expected)
    assert_close(color, by_torch(field.color, positions, viewdirs, expected), rtol=1e-4, atol=1e-4)
    assert field.features(positions[:0]).shape == (0, 12) and field.color(None, viewdirs[:0], features[:0]).shape == (
        0,
        3,
    )


@pytest.mark.parametrize("space", SPACES)
def test_no_color_differs_by_a_gray_level(space, by_torch):
    scene, rays = Scene(frozen_field(space), None, "white", 0.7), random_batch(space, 3000).rays
    assert (scene.colors(rays) - by_torch(scene.colors, rays)).abs().max() < GRAY


def test_rays_that_meet_nothing_have_no_samples():
    field = frozen_field("box")
    for rays in (
        Rays(torch.full((5, 3), 9.0), torch.tensor([[1.0, 0.0, 0.0]]).expand(5, 3)),
        random_batch("box").rays[:0],
    ):
        trace = field.trace(rays, 0.7)
        assert len(trace.samples) == 0 and torch.equal(trace.final_transmittance, torch.ones(len(rays)))


@pytest.mark.parametrize("space", SPACES)
def test_a_picture_depends_neither_on_its_chunks_nor_on_threads(space, monkeypatch):
    scene, rays = Scene(frozen_field(space), None, "white", 0.7), random_batch(space, 1500).rays
    try:
        whole = scene.colors(rays)
        for chunk, threads in ((1, 1), (333, 1), (100, 2)):
            cores.set_core_count(threads)
            cores.limit_torch_threads()
            monkeypatch.setattr(scenes, "CPU_RAYS_PER_CHUNK", chunk)
            assert torch.equal(scene.colors(rays[:200]), whole[:200])
    finally:
        cores.set_core_count(1)


@pytest.mark.parametrize("wrong", [torch.nan, torch.inf])
def test_a_ray_that_is_not_finite_ends_and_says_so(wrong):
    field, rays = frozen_field("box"), random_batch("box").rays
    rays.origins[3] = wrong
    trace = field.trace(rays, 0.7)
    assert trace.final_transmittance[3].isnan() and trace.final_transmittance[:3].isfinite().all()
    assert not (trace.samples.ray_indices == 3).any()


def test_samples_that_need_more_room_get_it():
    field = frozen_field("box")
    field.raw_density.fill_(-20.0)  # clear: no ray ends before the grid does
    trace = field.trace(random_batch("box").rays, 0.01)
    assert len(trace.samples) > 64 * 200
    assert_close(trace.ray_weights.sum() + trace.final_transmittance.sum(), torch.tensor(200.0), rtol=1e-4, atol=0)


def test_a_field_that_is_released_and_learns_is_seen_anew_when_it_is_frozen_again():
    field, rays = frozen_field("box"), random_batch("box").rays
    before = field.trace(rays, 0.7).final_transmittance
    field.requires_grad_(True)
    assert field.trace(rays, 0.7).final_transmittance.requires_grad
    with torch.no_grad():
        field.raw_density -= 5
        learning = field.trace(rays, 0.7).final_transmittance
    after = field.requires_grad_(False).trace(rays, 0.7).final_transmittance
    assert (after > before + 0.1).any()
    assert_close(after, learning, rtol=1e-3, atol=DARK)


def test_no_kernel_reads_or_writes_outside_its_arrays(tmp_path):
    check_bounds(__file__, "rays_end or features_and_colors or more_room or nothing", tmp_path)


def test_without_kernels_torch_renders(monkeypatch):
    field, rays = frozen_field("box"), random_batch("box").rays
    expected = field.trace(rays, 0.7)
    monkeypatch.setitem(sys.modules, "numba", None)
    assert len(field.trace(rays, 0.7).samples) > len(expected.samples)
