"""An iteration of learning queues its work and waits for nothing; how far it has come is read now and then."""

import contextlib

import pytest

torch = pytest.importorskip("torch")

from torch.utils._python_dispatch import TorchDispatchMode

from blender_tests.engine.pretend_device import pretend_device
from blender_tests.engine.reference.still_life import camera_at
from karf_engine.compute.progress import Progress
from karf_engine.compute.runtime import start_runtime
from karf_engine.fields import training
from karf_engine.fields.nerf.field import NerfSampling
from karf_engine.fields.nerf.fit import NerfFit, tf32_matmul
from karf_engine.fields.rendering.rays import PixelDataset
from karf_engine.fields.rendering.space import Box
from karf_engine.fields.rendering.surface_cache import SurfaceCache
from karf_engine.fields.voxels.field import VoxelField
from karf_engine.heads.fields import RecoloringField, SegmentationField
from karf_engine.heads.fit import ObjectRays, fit_on_points, fit_on_rays, fit_recoloring
from karf_engine.project.settings import NerfSettings, RecoloringSettings, SegmentationSettings

CORNERS = [[-1.0] * 3, [1.0] * 3]
ITERATIONS, RAYS = 4, 64
aten = torch.ops.aten
WAITING = {  # operations whose result, or its shape, must be read before the next one can be queued
    aten._local_scalar_dense.default,
    aten.nonzero.default,
    aten.masked_select.default,
    aten.unique_dim.default,
    aten._unique2.default,
    aten.unique_consecutive.default,
    aten.repeat_interleave.Tensor,
    aten.bincount.default,
    aten.equal.default,
}
INDEXING = {aten.index.Tensor, aten.index_put.default, aten.index_put_.default}


class Waits(TorchDispatchMode):
    """Notes every operation within it, forward and backward, that an accelerator would be waited for.

    Attributes:
        found: Their names.
    """

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        if function in WAITING or (function in INDEXING and _by_mask(args[1])) or _comes_back(args, kwargs or {}):
            self.found.append(str(function))
        return function(*args, **kwargs or {})


def _by_mask(indices) -> bool:
    return any(index is not None and index.dtype == torch.bool for index in indices)


def _comes_back(args, kwargs) -> bool:
    """Whether a tensor is copied from an accelerator to the processor."""
    to = kwargs.get("device")
    return (
        to is not None
        and torch.device(to).type == "cpu"
        and isinstance(args[0], torch.Tensor)
        and args[0].device.type != "cpu"
    )


@pytest.fixture
def waits(monkeypatch):
    """What is waited for in the forward and backward passes of each iteration."""
    found, gradients = [], training._gradients

    def counted(*arguments):
        with Waits() as waits, _refused_by_cuda():
            result = gradients(*arguments)
        found.append(waits.found)
        return result

    monkeypatch.setattr(training, "_gradients", counted)
    return found


@contextlib.contextmanager
def _refused_by_cuda():
    """CUDA itself raises where it is waited for."""
    if not torch.cuda.is_available():
        yield
        return
    torch.cuda.set_sync_debug_mode("error")
    try:
        yield
    finally:
        torch.cuda.set_sync_debug_mode("default")


@pytest.fixture(params=["asked for", "pretend"])
def tools(request):
    """Runtime on the device that is tested, or on one that is never the CPU, and a progress that tells nobody."""
    name = request.config.getoption("device")
    progress = Progress(lambda *_, **__: None, lambda: False, "a training", ITERATIONS)
    if request.param == "asked for" and name != "pretend":
        yield start_runtime(0, 1, name), progress
        return
    with pretend_device():
        yield start_runtime(0, 1, "pretend"), progress


@pytest.fixture
def field(tools):
    device = tools[0].device
    occupied = torch.ones(4, 4, 4, dtype=torch.bool, device=device)
    return VoxelField(torch.tensor(CORNERS[0], device=device), 0.5, occupied, 4).requires_grad_(False)


@pytest.fixture
def cache(tools):
    device = tools[0].device
    positions = torch.rand(RAYS, 3, 3, device=device) - 0.5
    viewdirs = torch.nn.functional.normalize(positions[:, 0], dim=1)
    distances, index = torch.rand(RAYS, 3, device=device).sort(1).values, torch.arange(RAYS, device=device)
    return SurfaceCache(positions, distances, viewdirs, torch.ones(RAYS, device=device), index)


def test_the_count_sees_what_waits():
    numbers = torch.arange(4.0)
    with Waits() as waits:
        float(numbers.sum())
        numbers[numbers > 1]
        torch.nonzero(numbers)
        numbers[torch.tensor([0, 1])] * 2
    assert len(waits.found) == 3


@pytest.mark.parametrize("learn_from", ["points", "rays"])
def test_learning_the_objects_waits_for_nothing(waits, tools, field, cache, learn_from):
    device = tools[0].device
    settings = SegmentationSettings(iterations=ITERATIONS, batch=32, width=8)
    karf = SegmentationField(torch.tensor([CORNERS], device=device), 4, settings).to(device)
    if learn_from == "points":
        classes = torch.arange(RAYS, device=device) % 2
        every, certain = torch.ones(RAYS, dtype=torch.bool, device=device), torch.ones(RAYS, device=device)
        fit_on_points(karf, field, cache.positions[:, 0], classes, certain, every, every, settings, *tools)
    else:
        targets = torch.eye(2, device=device)[torch.arange(RAYS, device=device) % 2]
        fit_on_rays(karf, field, cache, targets, settings, *tools)
    assert waits == [[]] * ITERATIONS


def test_learning_the_weights_waits_for_nothing(waits, tools, field, cache):
    device = tools[0].device
    settings = RecoloringSettings(iterations=ITERATIONS, batch=32, width=8)
    karf = RecoloringField(torch.tensor(CORNERS, device=device), 4, [3, 3], settings).to(device)
    number = torch.arange(RAYS, device=device)
    colors, weights = torch.rand(RAYS, 3, device=device), torch.rand(RAYS, 3, device=device)
    rays = ObjectRays(
        cache.positions,
        cache.viewdirs,
        colors,
        number,
        number % 2,
        weights,
        number % 3 > 0,
        torch.ones(RAYS, device=device),
    )
    fit_recoloring(karf, field, rays, torch.rand(2, 3, 3, device=device), settings, *tools)
    assert waits == [[]] * ITERATIONS


def test_learning_a_nerf_waits_for_nothing(waits, tools):
    runtime, progress = tools
    sampling = NerfSampling(1.0, 4.0, coarse=6, fine=6)
    cameras = [camera_at(angle, 0.5, 8) for angle in (0.0, 1.0)]
    colors = [torch.rand(8, 8, 3).numpy() for _ in cameras]
    dataset = PixelDataset(cameras, colors, [color[..., 0] for color in colors], device=runtime.device)
    settings = NerfSettings(iterations=ITERATIONS, depth=2, width=8, rays=32, crop_iterations=2, look_every=ITERATIONS)
    for _ in NerfFit(dataset, "alpha", Box(), sampling, settings, runtime).scenes(progress):
        pass
    assert waits == [[]] * ITERATIONS


@pytest.mark.parametrize(("device", "precision"), [("cuda", "high"), ("cpu", "highest")])
def test_a_nerf_is_learned_with_tf32_matmul_where_a_card_has_them_and_with_no_others(device, precision):
    with contextlib.suppress(ZeroDivisionError), tf32_matmul(torch.device(device)):
        assert torch.get_float32_matmul_precision() == precision
        raise ZeroDivisionError
    assert torch.get_float32_matmul_precision() == "highest"
