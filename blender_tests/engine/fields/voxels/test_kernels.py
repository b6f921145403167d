"""The compiled kernels do what torch does: same sums, same gradients, at any number of threads."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("numba")

from torch.testing import assert_close

from karf_engine.compute import cores
from karf_engine.compute.kernels import kernel
from karf_engine.compute.progress import Progress
from karf_engine.compute.runtime import start_runtime
from karf_engine.errors import Diverged
from karf_engine.fields.rendering.rays import Rays
from karf_engine.fields.rendering.space import Box, Contraction, Frustum
from karf_engine.fields.rendering.volume import accumulate, ray_weights_from_sigmas
from karf_engine.fields.training import TrainingState, constant, train
from karf_engine.fields.voxels.field import VoxelField
from karf_engine.fields.voxels.fused import preparing
from karf_engine.fields.voxels.fused.marching import importance_of, uniform
from karf_engine.fields.voxels.fused.ray_paths import paths_of
from karf_engine.fields.voxels.fused.renderer import FusedRenderer
from karf_engine.fields.voxels.renderer import PointSupervision, RayBatch
from karf_engine.fields.voxels.renderers import new_renderer
from karf_engine.fields.voxels.torch_renderer import TorchRenderer

ROOT = Path(__file__).resolve().parents[4]
SUPERVISION = PointSupervision(margin=0.05, off_path=0.4)
UNIT = 0.3
SUMS = ("color", "final_transmittance", "distortion", "before", "up_to", "distance", "distance_squared", "alpha")
SPACES = {
    "box": Box(),
    "contraction": Contraction(torch.zeros(3), 0.5, 1.0, 0.05),
    "frustum": Frustum(torch.eye(4), torch.tensor([1.0, 1.0]), 0.5, 0.5),
}


def random_field(space: str, features: int = 12, share: float = 1.0) -> VoxelField:
    """A field of random values in a grid of unequal sides."""
    random = torch.Generator().manual_seed(0)
    occupied = torch.rand(14, 17, 12, generator=random) < share
    size = {"box": 2.0, "contraction": 4.0, "frustum": 2.0}[space]
    minimum = torch.tensor([-size / 2] * 2 + [-0.5 if space == "frustum" else -size / 2])
    field = VoxelField(minimum, size / 17, occupied, features, 64, -2.0, SPACES[space])
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


def doubled(batch: RayBatch) -> RayBatch:
    rays = Rays(batch.rays.origins.double(), batch.rays.viewdirs.double())
    return RayBatch(rays, batch.step, batch.jitter.double(), batch.is_diffuse, batch.observed.double())


def fused(field: VoxelField, russian_roulette: float = 0.0) -> FusedRenderer:
    return FusedRenderer(field, start_runtime(0, 1, "cpu"), UNIT, russian_roulette, SUPERVISION)


def exact(field: VoxelField) -> TorchRenderer:
    return TorchRenderer(field, start_runtime(0, 1, "cpu"), UNIT, 0.0, SUPERVISION)


def gradients_of(field: VoxelField) -> dict:
    return {name: parameter.grad.float().clone() for name, parameter in field.named_parameters()}


@pytest.mark.parametrize("features", [12, 7])
@pytest.mark.parametrize("space", SPACES)
def test_sums_and_gradients_are_those_of_torch_in_double_precision(space, features):
    field, batch = random_field(space, features), random_batch(space)
    sums = fused(field).render(batch)
    reference = random_field(space, features).double()
    space_in_double = reference.space
    if space == "contraction":
        space_in_double = Contraction(torch.zeros(3).double(), 0.5, 1.0, 0.05)
    if space == "frustum":
        space_in_double = Frustum(torch.eye(4).double(), torch.tensor([1.0, 1.0]).double(), 0.5, 0.5)
    reference.space = space_in_double
    expected = exact(reference).render(doubled(batch))
    assert sums.n_samples == pytest.approx(expected.n_samples, abs=3)  # ends of rays may fall on either side
    assert torch.equal(sums.observes, expected.observes) and sums.observes.any()
    random = torch.Generator().manual_seed(2)
    loss, expected_loss = 0.0, 0.0
    for name in SUMS:
        value, truth = getattr(sums, name), getattr(expected, name)
        assert_close(value, truth.float(), rtol=1e-4, atol=2e-4, msg=lambda text, name=name: f"{name}: {text}")
        upstream = torch.randn(value.shape, generator=random)
        loss, expected_loss = loss + (upstream * value).sum(), expected_loss + (upstream.double() * truth).sum()
    loss.backward()
    expected_loss.backward()
    for name, gradient in gradients_of(field).items():
        truth = dict(reference.named_parameters())[name].grad.float()
        error = torch.linalg.norm(gradient - truth) / torch.linalg.norm(truth)
        assert error < 2e-3, f"{name}: {error}"


def test_the_diffuse_colors_of_the_first_level_teach_their_three_features_alone():
    field, batch = random_field("box"), random_batch("box", is_diffuse=True)
    (fused(field).render(batch).color ** 2).sum().backward()
    reference = random_field("box")
    (exact(reference).render(batch).color ** 2).sum().backward()
    assert_close(field.feature_table.grad, reference.feature_table.grad, rtol=1e-3, atol=1e-4)
    assert field.feature_table.grad[:, 3:].abs().max() == 0
    assert field.color_network[0].weight.grad is None


def test_differences_between_rows_and_their_gradients_are_those_of_torch():
    rows, others = torch.tensor([0, 3, 5, -1, 7, 7]), torch.tensor([1, -1, 9, 2, 8, 8])
    found = []
    for make in (fused, exact):
        field = random_field("box")
        density, features = make(field).differences(rows, others)
        (2 * density + 3 * features).backward()
        found.append((density.detach(), features.detach(), field.raw_density.grad, field.feature_table.grad))
    for value, expected in zip(*found, strict=True):
        assert_close(value, expected, rtol=1e-5, atol=1e-5)


def test_cells_are_seen_as_torch_sees_them():
    field, rays = random_field("contraction", share=0.5), random_batch("contraction").rays
    seen, expected = fused(field).visibility([rays]), exact(field).visibility([rays])
    assert (expected > 0).sum() > 100
    assert_close(seen, expected, rtol=1e-3, atol=1e-4)


def test_rays_meet_occupied_cells_where_torch_says_so():
    field, rays = random_field("box", share=0.02), random_batch("box").rays
    free = fused(field).is_free(rays, 0.7)
    assert torch.equal(free, exact(field).is_free(rays, 0.7))
    assert 0.1 < free.float().mean() < 0.9


@pytest.mark.parametrize("space", SPACES)
def test_rays_bend_as_their_space_says(space):
    field, rays = random_field(space), random_batch(space).rays
    expected = field.space.paths(rays, *field.bounds)
    assert_close(torch.from_numpy(paths_of(field.space, field.bounds, rays)), expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("make", [fused, exact])
def test_a_ray_ends_where_its_light_is_used_up(make):
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
def _shares(weight, limits, n_rays, n_numbers, out):
    for ray in range(n_rays):
        for number in range(n_numbers):
            out[ray, number] = importance_of(weight, limits, ray, number)


@kernel
def _numbers(seed, n_rays, n_numbers, out):
    for ray in range(n_rays):
        for number in range(n_numbers):
            out[ray, number] = uniform(seed, ray, number)


def test_russian_roulette_is_uniform_and_its_draws_do_not_depend_on_each_other():
    drawn = np.empty((1000, 100), np.float32)
    for seed in (0, 1, 2**31 - 2):
        _numbers(seed, 1000, 100, drawn)
        counts = np.histogram(drawn, 50, (0, 1))[0]
        assert ((counts - 2000) ** 2 / 2000).sum() < 100  # chi squared of 49 degrees of freedom: 100 is beyond 1e-5
        for one, other in ((drawn[:-1], drawn[1:]), (drawn[:, :-1], drawn[:, 1:]), (drawn[:-1, :-1], drawn[1:, 1:])):
            assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.02
    other = np.empty_like(drawn)
    _numbers(7, 1000, 100, other)
    assert abs(np.corrcoef(drawn.ravel(), other.ravel())[0, 1]) < 0.02


@pytest.mark.parametrize("weight", [0.0005, 0.004, 0.019, 0.5])
def test_colors_count_as_much_as_without_russian_roulette_on_average(weight):
    limits = fused(random_field("box"), russian_roulette=0.02)._settings
    shares = np.empty((2000, 100), np.float32)
    _shares(np.float32(weight), limits, 2000, 100, shares)
    chance = min(1.0, weight / 0.02)
    spread = np.sqrt((1 - chance) / chance / shares.size)
    assert abs(shares.mean() - 1) <= 5 * spread + 1e-6
    assert (shares > 0).mean() == pytest.approx(chance, abs=5 * np.sqrt(chance / shares.size))


def _learn(threads: int, iterations: int = 12) -> VoxelField:
    runtime = start_runtime(0, threads, "cpu")
    field, batch = random_field("box", share=0.7), random_batch("box", 1000)
    renderer = FusedRenderer(field, runtime, UNIT, 0.02, SUPERVISION)
    groups = [
        {"params": [field.raw_density, field.feature_table], "lr": 0.05},
        {"params": list(field.color_network.parameters()), "lr": 0.01},
    ]
    optimizer = renderer.optimizer(groups, (0.9, 0.99))
    random = torch.Generator().manual_seed(2)
    pairs = torch.randint(-1, len(field.raw_density), (2, 5000), generator=random)
    for _ in range(iterations):
        optimizer.zero_grad()
        sums = renderer.render(batch)
        density, features = renderer.differences(*pairs)
        loss = ((sums.color - 0.3) ** 2).mean() + 1e-3 * sums.distortion.mean()
        (loss + 1e-5 * (density + features)).backward()
        optimizer.step()
    return field


def test_one_and_two_threads_learn_the_same_bits():
    try:
        one, two = _learn(1), _learn(2)
    finally:
        cores.set_core_count(1)
    for (name, value), other in zip(one.state_dict().items(), two.state_dict().values(), strict=True):
        assert torch.equal(value, other), name


def test_rows_that_no_ray_touches_rest():
    field, batch = random_field("box"), random_batch("box", 3)
    before = field.raw_density.detach().clone()
    renderer = fused(field)
    optimizer = renderer.optimizer([{"params": [field.raw_density, field.feature_table], "lr": 0.1}], (0.9, 0.99))
    for _ in range(2):
        renderer.render(batch).color.sum().backward()
        touched = renderer.tables.touched > 0
        optimizer.step()
    moved = (field.raw_density.detach() != before)[:, 0].numpy()
    assert 0 < moved.sum() < len(moved) / 2
    assert not (moved & ~touched).any()


def test_what_is_not_a_number_stops_training():
    field, batch = random_field("box"), random_batch("box")
    field.feature_table.data[:, 0] = torch.nan
    renderer = fused(field)
    optimizer = renderer.optimizer([{"params": [field.raw_density, field.feature_table], "lr": 0.1}], (0.9, 0.99))
    training_state = TrainingState(3, optimizer, dict, start_runtime(0, 1, "cpu"))
    with pytest.raises(Diverged):
        train(
            training_state,
            3,
            lambda *_: (renderer.render(batch).color.mean(), {}),
            constant,
            Progress(lambda *_, **__: None, lambda: False, "geometry", 3),
        )


def test_without_numba_or_where_it_is_left_out_torch_learns(monkeypatch):
    field, runtime = random_field("box"), start_runtime(0, 1, "cpu")
    assert isinstance(new_renderer(field, runtime, UNIT, 0.0, SUPERVISION), FusedRenderer)
    monkeypatch.setenv("KARF_KERNELS", "off")
    assert isinstance(new_renderer(field, runtime, UNIT, 0.0, SUPERVISION), TorchRenderer)
    monkeypatch.delenv("KARF_KERNELS")
    monkeypatch.setitem(sys.modules, "numba", None)
    assert isinstance(new_renderer(field, runtime, UNIT, 0.0, SUPERVISION), TorchRenderer)


def check_bounds(file, names, cache):
    """Run some tests of a file again with kernels that check every index, compiled into a cache of their own."""
    environment = os.environ | {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(cache), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", file, "-k", names]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:]


def test_no_kernel_reads_or_writes_outside_its_arrays(tmp_path):
    names = "sums_and_gradients and box-12 or contraction-12 or differences or cells_are or threads or rest or bend"
    check_bounds(__file__, names, tmp_path)


def test_kernels_are_compiled_beside_also_where_the_engine_runs_as_a_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")  # of the child: it calls them all, in plain Python
    monkeypatch.chdir(tmp_path)
    assert preparing.begin(12).wait(120) == 0
    assert preparing.stamp_of(12).exists()
    assert preparing.begin(12) is None


def test_kernels_are_compiled_beside_where_it_cannot_be_told_whether_they_are_there(monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/" + "x" * 5000)  # the system refuses to look it up
    compiling = preparing.begin(12)
    compiling.kill()
    compiling.wait()
