"""Compiled kernels give torch's sums, gradients and pictures with any number of threads."""

import os
import subprocess
import sys

import numpy as np
import pytest
import torch

pytest.importorskip("numba")

from torch.testing import assert_close

from blender_tests.engine.conftest import ROOT
from blender_tests.engine.fields.fitting import silent
from karf_engine.compute import cores
from karf_engine.compute.kernels import kernel
from karf_engine.compute.runtime import start_runtime
from karf_engine.errors import Diverged
from karf_engine.fields import scene as scenes
from karf_engine.fields.rendering.rays import Rays
from karf_engine.fields.rendering.space import Box, Contraction, Frustum
from karf_engine.fields.rendering.volume import accumulate, ray_weights_from_sigmas
from karf_engine.fields.scene import Scene
from karf_engine.fields.training import TrainingState, constant, train
from karf_engine.fields.voxels.field import VoxelField
from karf_engine.fields.voxels.fused import preparing
from karf_engine.fields.voxels.fused.marching import importance_of
from karf_engine.fields.voxels.fused.renderer import FusedRenderer
from karf_engine.fields.voxels.renderer import RayBatch
from karf_engine.fields.voxels.torch_renderer import TorchRenderer, new_renderer

UNIT, MARGIN, OFF_PATH = 0.3, 0.05, 0.4
SUMS = ("color", "final_transmittance", "distortion", "before", "up_to", "distance", "distance_squared", "alpha")
SPACES = ("box", "contraction", "frustum")
DARK = 1e-4  # kernels end a ray at this transmittance


def make_space(name, dtype=torch.float32):
    if name == "contraction":
        return Contraction(torch.zeros(3, dtype=dtype), 0.5, 1.0, 0.05)
    return Frustum(torch.eye(4, dtype=dtype), torch.ones(2, dtype=dtype), 0.5, 0.5) if name == "frustum" else Box()


def random_field(space: str, features: int = 12, share: float = 1.0) -> VoxelField:
    random = torch.Generator().manual_seed(0)
    occupied = torch.rand(14, 17, 12, generator=random) < share
    size = 4.0 if space == "contraction" else 2.0
    minimum = torch.tensor([-size / 2] * 2 + [-0.5 if space == "frustum" else -size / 2])
    field = VoxelField(minimum, size / 17, occupied, features, 64, -2.0, make_space(space))
    for parameter in field.parameters():
        parameter.data = torch.randn(parameter.shape, generator=random)
    return field


def random_batch(space: str, n_rays: int = 200, is_diffuse: bool = False) -> RayBatch:
    random = torch.Generator().manual_seed(1)
    towards = torch.randn(n_rays, 3, generator=random)
    origins = 3 * torch.nn.functional.normalize(towards, dim=1)
    if space == "frustum":  # from about one place, down -z
        origins, towards = 0.1 * towards, torch.tensor([0.0, 0.0, 2.0]).expand(n_rays, 3)
    aim = 0.5 * torch.randn(n_rays, 3, generator=random) - towards
    rays = Rays(origins, torch.nn.functional.normalize(aim, dim=1))
    observed = torch.rand(60, 3, generator=random) - 0.5
    return RayBatch(rays, 0.7, torch.rand(n_rays, generator=random), is_diffuse, observed)


def fused_renderer(field: VoxelField, russian_roulette: float = 0.0, threads: int = 1) -> FusedRenderer:
    return FusedRenderer(field, start_runtime(0, threads, "cpu"), UNIT, russian_roulette, MARGIN, OFF_PATH)


def torch_renderer(field: VoxelField) -> TorchRenderer:
    return TorchRenderer(field, start_runtime(0, 1, "cpu"), UNIT, 0.0, MARGIN, OFF_PATH)


def new_optimizer(renderer: FusedRenderer):
    tables = [renderer.field.raw_density, renderer.field.feature_table]
    network = list(renderer.field.color_network.parameters())
    return renderer.optimizer([{"params": tables, "lr": 0.05}, {"params": network, "lr": 0.01}], (0.9, 0.99))


@pytest.fixture
def restore_cores():
    yield
    cores.set_core_count(1)


@pytest.mark.parametrize("features", [12, 7])
@pytest.mark.parametrize("space", SPACES)
def test_sums_and_gradients_match_torch_in_double_precision(space, features):
    field, batch = random_field(space, features), random_batch(space)
    sums = fused_renderer(field).render(batch)
    reference = random_field(space, features).double()
    reference.space = make_space(space, torch.float64)
    rays = Rays(batch.rays.origins.double(), batch.rays.viewdirs.double())
    batch = RayBatch(rays, batch.step, batch.jitter.double(), batch.is_diffuse, batch.observed.double())
    expected = torch_renderer(reference).render(batch)
    assert sums.n_samples == pytest.approx(expected.n_samples, abs=3)  # rounding may move the ends of rays
    assert torch.equal(sums.observes, expected.observes) and sums.observes.any()
    random, loss, expected_loss = torch.Generator().manual_seed(2), 0.0, 0.0
    for name in SUMS:
        value, truth = getattr(sums, name), getattr(expected, name)
        assert_close(value, truth.float(), rtol=1e-4, atol=2e-4, msg=lambda text, name=name: f"{name}: {text}")
        upstream = torch.randn(value.shape, generator=random)
        loss, expected_loss = loss + (upstream * value).sum(), expected_loss + (upstream.double() * truth).sum()
    loss.backward()
    expected_loss.backward()
    for (name, parameter), other in zip(field.named_parameters(), reference.parameters(), strict=True):
        truth = other.grad.float()
        error = torch.linalg.norm(parameter.grad - truth) / torch.linalg.norm(truth)
        assert error < 2e-3, f"{name}: {error}"


def test_diffuse_colors_train_only_three_features():
    field, reference = random_field("box"), random_field("box")
    for renderer in (fused_renderer(field), torch_renderer(reference)):
        (renderer.render(random_batch("box", is_diffuse=True)).color ** 2).sum().backward()
    assert_close(field.feature_table.grad, reference.feature_table.grad, rtol=1e-3, atol=1e-4)
    assert field.feature_table.grad[:, 3:].abs().max() == 0
    assert field.color_network[0].weight.grad is None


def test_row_differences_and_gradients_match_torch():
    rows, found = torch.tensor([[0, 3, 5, -1, 7, 7], [1, -1, 9, 2, 8, 8]]), []
    for make in (fused_renderer, torch_renderer):
        field = random_field("box")
        density, features = make(field).differences(*rows)
        (2 * density + 3 * features).backward()
        found.append((density.detach(), features.detach(), field.raw_density.grad, field.feature_table.grad))
    for value, expected in zip(*found, strict=True):
        assert_close(value, expected, rtol=1e-5, atol=1e-5)


def test_cell_visibility_and_free_rays_match_torch():
    field, rays = random_field("contraction", share=0.5), random_batch("contraction").rays
    seen, expected = fused_renderer(field).visibility([rays]), torch_renderer(field).visibility([rays])
    assert (expected > 0).sum() > 100
    assert_close(seen, expected, rtol=1e-3, atol=1e-4)
    field, rays = random_field("box", share=0.02), random_batch("box").rays
    free = fused_renderer(field).is_free(rays, 0.7)
    assert torch.equal(free, torch_renderer(field).is_free(rays, 0.7))
    assert 0.1 < free.float().mean() < 0.9


@pytest.mark.parametrize("make", [fused_renderer, torch_renderer])
def test_rays_end_where_no_light_is_left(make):
    field, batch = random_field("box"), random_batch("box")
    field.raw_density.data.fill_(12.0)
    samples = field.march(batch.rays, batch.step, batch.jitter)
    weights = ray_weights_from_sigmas(field.density(samples.positions), samples.step, samples.ray_indices)
    features = field.features(samples.positions)
    colors = field.color(samples.positions, batch.rays.viewdirs[samples.ray_indices], features)
    expected = accumulate(weights, colors, samples.ray_indices, len(batch.rays))
    sums = make(field).render(batch)
    assert sums.n_samples < len(samples) / 3
    assert_close(sums.color, expected, rtol=0, atol=5e-4)


@kernel
def _draw(weight, limits, shares):
    for ray in range(shares.shape[0]):
        for number in range(shares.shape[1]):
            shares[ray, number] = importance_of(weight, limits, ray, number)


@pytest.mark.parametrize("weight", [0.0005, 0.004, 0.011, 0.019, 0.5])
def test_russian_roulette_is_unbiased_and_independent(weight):
    limits = fused_renderer(random_field("box"), 0.02)._settings
    shares, others = np.empty((2, 2000, 100), np.float32)
    _draw(np.float32(weight), limits, shares)
    _draw(np.float32(weight), limits._replace(seed=limits.seed + 7), others)
    chance = min(1.0, weight / 0.02)
    spread = np.sqrt((1 - chance) / chance / shares.size)
    assert abs(shares.mean() - 1) <= 5 * spread + 1e-6
    assert (shares > 0).mean() == pytest.approx(chance, abs=5 * np.sqrt(chance / shares.size))
    neighbors = [(shares[1:], shares[:-1]), (shares[:, 1:], shares[:, :-1]), (shares[1:, 1:], shares[:-1, :-1])]
    for one, other in [*neighbors, (shares, others)] if chance < 1 else []:
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.02


def test_one_and_two_threads_learn_identical_fields(restore_cores):
    def learn(threads):
        field, batch = random_field("box", share=0.7), random_batch("box", 1000)
        renderer = fused_renderer(field, 0.02, threads)
        optimizer, random = new_optimizer(renderer), torch.Generator().manual_seed(2)
        pairs = torch.randint(-1, len(field.raw_density), (2, 5000), generator=random)
        for _ in range(12):
            optimizer.zero_grad()
            sums = renderer.render(batch)
            density, features = renderer.differences(*pairs)
            loss = ((sums.color - 0.3) ** 2).mean() + 1e-3 * sums.distortion.mean()
            (loss + 1e-5 * (density + features)).backward()
            optimizer.step()
        return field.state_dict()

    one, two = learn(1), learn(2)
    for name, value in one.items():
        assert torch.equal(value, two[name]), name


def test_optimizer_leaves_untouched_rows_unchanged():
    renderer, batch = fused_renderer(random_field("box")), random_batch("box", 3)
    optimizer, before = new_optimizer(renderer), renderer.field.raw_density.detach().clone()
    for _ in range(2):
        renderer.render(batch).color.sum().backward()
        touched = renderer.touched > 0
        optimizer.step()
    moved = (renderer.field.raw_density.detach() != before)[:, 0].numpy()
    assert 0 < moved.sum() < len(moved) / 2
    assert not (moved & ~touched).any()


def test_optimizer_moves_runs_of_rows_as_adam_does():
    renderer = fused_renderer(random_field("box"))
    table, random = renderer.field.feature_table, np.random.default_rng(0)
    has_gradient = torch.from_numpy(random.random(len(table)) < 0.9)
    expected = torch.nn.Parameter(table.detach().clone())
    adam, optimizer = torch.optim.Adam([expected], 0.05, (0.9, 0.99), 1e-12), new_optimizer(renderer)
    for _ in range(3):
        expected.grad = torch.from_numpy(random.standard_normal(table.shape, np.float32)) * has_gradient[:, None]
        renderer.gradients.features[:] = expected.grad.flatten()
        renderer.touched[:] = 3  # also where there is no gradient
        adam.step()
        optimizer.step()
    assert_close(table.detach(), expected.detach(), rtol=0, atol=1e-5)
    assert not renderer.gradients.features.any() and not renderer.touched.any()


def test_nan_stops_training():
    renderer, batch = fused_renderer(random_field("box")), random_batch("box")
    renderer.field.feature_table.data[:, 0] = torch.nan
    training_state = TrainingState(3, new_optimizer(renderer), dict, start_runtime(0, 1, "cpu"))
    with pytest.raises(Diverged):
        train(training_state, 3, lambda *_: (renderer.render(batch).color.mean(), {}), constant, silent())


def frozen_field(space: str, share: float = 0.6) -> VoxelField:
    """A random field, in which about half of all rays end."""
    field = random_field(space, share=share)
    field.raw_density.data.add_(4.0)
    return field.requires_grad_(False)


def by_torch(function, *arguments):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KARF_KERNELS", "off")
        return function(*arguments)


@pytest.mark.parametrize("space", SPACES)
def test_frozen_traces_match_torch_until_rays_are_dark(space):
    field, rays = frozen_field(space), random_batch(space).rays
    trace, expected = field.trace(rays, 0.7), by_torch(field.trace, rays, 0.7)
    samples, reference = trace.samples, expected.samples
    assert 0 < len(samples) < len(reference)  # torch does not stop in the dark
    assert_close(trace.final_transmittance, expected.final_transmittance, rtol=1e-3, atol=DARK)
    assert samples.ray_indices.dtype == torch.int64 and (samples.ray_indices.diff() >= 0).all()
    assert samples.step == pytest.approx(reference.step)
    for number in range(len(rays)):
        own, whole = samples.ray_indices == number, torch.nonzero(reference.ray_indices == number)[:, 0]
        bright, dark = whole[: own.sum()], whole[own.sum() :]
        assert_close(samples.distances[own], reference.distances[bright], rtol=1e-4, atol=1e-4)
        assert_close(samples.positions[own], reference.positions[bright], rtol=1e-4, atol=1e-4)
        assert_close(trace.ray_weights[own], expected.ray_weights[bright], rtol=1e-3, atol=1e-4)
        assert expected.ray_weights[dark].sum() <= 1.1 * DARK


@pytest.mark.parametrize("share", [1.0, 0.6, 0.05])
def test_frozen_features_and_colors_match_torch(share):
    field, random = frozen_field("box", share), torch.Generator().manual_seed(3)
    low, high = field.bounds
    positions = low + (1.2 * torch.rand(3001, 3, generator=random) - 0.1) * (high - low)  # some outside
    viewdirs = torch.nn.functional.normalize(torch.randn(3001, 3, generator=random), dim=1)
    features, expected = field.features(positions), by_torch(field.features, positions)
    assert_close(features, expected, rtol=1e-4, atol=1e-4)
    color = field.color(positions, viewdirs, expected)
    assert_close(color, by_torch(field.color, positions, viewdirs, expected), rtol=1e-4, atol=1e-4)
    assert field.features(positions[:0]).shape == (0, 12)
    assert field.color(None, viewdirs[:0], features[:0]).shape == (0, 3)


def test_rays_beside_the_grid_have_no_samples():
    field, beside = frozen_field("box"), Rays(torch.full((5, 3), 9.0), torch.tensor([[1.0, 0.0, 0.0]]).expand(5, 3))
    for rays in (beside, beside[:0]):
        trace = field.trace(rays, 0.7)
        assert len(trace.samples) == 0 and torch.equal(trace.final_transmittance, torch.ones(len(rays)))


@pytest.mark.parametrize("space", SPACES)
def test_pictures_match_torch_for_any_chunks_and_threads(space, restore_cores, monkeypatch):
    scene, rays = Scene(frozen_field(space), None, "white", 0.7), random_batch(space, 1500).rays
    whole = scene.colors(rays)
    assert (whole - by_torch(scene.colors, rays)).abs().max() < 1 / 255
    for chunk, threads in ((1, 1), (333, 1), (100, 2)):
        cores.set_core_count(threads)
        cores.limit_torch_threads()
        monkeypatch.setattr(scenes, "CPU_RAYS_PER_CHUNK", chunk)
        assert torch.equal(scene.colors(rays[:200]), whole[:200])


@pytest.mark.parametrize("value", [torch.nan, torch.inf])
def test_non_finite_ray_gets_nan_transmittance(value):
    field, rays = frozen_field("box"), random_batch("box").rays
    rays.origins[3] = value
    trace = field.trace(rays, 0.7)
    assert trace.final_transmittance[3].isnan() and trace.final_transmittance[:3].isfinite().all()
    assert not (trace.samples.ray_indices == 3).any()


def test_sample_buffer_grows_for_many_samples():
    field = frozen_field("box")
    field.raw_density.fill_(-20.0)  # so clear that rays cross the whole grid
    trace = field.trace(random_batch("box").rays, 0.01)
    assert len(trace.samples) > 64 * 200
    assert_close(trace.ray_weights.sum() + trace.final_transmittance.sum(), torch.tensor(200.0), rtol=1e-4, atol=0)


def test_refrozen_field_renders_its_new_values():
    field, rays = frozen_field("box"), random_batch("box").rays
    before = field.trace(rays, 0.7).final_transmittance
    field.requires_grad_(True)
    assert field.trace(rays, 0.7).final_transmittance.requires_grad
    with torch.no_grad():
        field.raw_density -= 5
        unfrozen = field.trace(rays, 0.7).final_transmittance
    after = field.requires_grad_(False).trace(rays, 0.7).final_transmittance
    assert (after > before + 0.1).any()
    assert_close(after, unfrozen, rtol=1e-3, atol=DARK)


def test_torch_learns_and_renders_without_numba(monkeypatch):
    field, frozen, rays = random_field("box"), frozen_field("box"), random_batch("box").rays

    def renderer_and_samples():
        renderer = new_renderer(field, start_runtime(0, 1, "cpu"), UNIT, 0.0, MARGIN, OFF_PATH)
        return type(renderer), len(frozen.trace(rays, 0.7).samples)

    kind, fewer = renderer_and_samples()
    assert kind is FusedRenderer
    monkeypatch.setenv("KARF_KERNELS", "off")
    by_switch = renderer_and_samples()
    monkeypatch.delenv("KARF_KERNELS")
    monkeypatch.setitem(sys.modules, "numba", None)
    assert all(kind is TorchRenderer and samples > fewer for kind, samples in (by_switch, renderer_and_samples()))


def test_kernels_stay_inside_their_arrays(tmp_path):
    """Run some of these tests again with kernels that check every index, compiled into a cache of their own."""
    names = "sums_and_gradients and (box-12 or contraction-12) or row_differences or cell_visibility or untouched_rows"
    names += " or identical_fields or frozen_traces or frozen_features or sample_buffer or beside_the_grid"
    environment = os.environ | {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", __file__, "-k", names]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "14 passed" in done.stdout, done.stdout[-3000:]


def test_child_process_compiles_the_kernels_once(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")  # the child calls every kernel in plain Python
    monkeypatch.chdir(tmp_path)
    assert preparing.begin(12).wait(120) == 0 and preparing.stamp_of(12).exists()
    assert preparing.begin(12) is None


def test_unreadable_cache_does_not_prevent_compiling(monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/" + "x" * 5000)  # the system refuses so long a path
    compiling = preparing.begin(12)
    compiling.kill()
    compiling.wait()
