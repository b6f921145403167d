"""On an accelerator an iteration of learning waits for nothing; the pretend device catches what a real one would refuse."""

import contextlib

import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode

from blender_tests.engine.fields.fitting import learn_head
from blender_tests.engine.pretend_device import pretend_device
from blender_tests.engine.reference.still_life import camera_at
from karf_engine.compute.progress import Progress
from karf_engine.compute.runtime import start_runtime
from karf_engine.fields import training
from karf_engine.fields.nerf.field import NerfSampling
from karf_engine.fields.nerf.fit import NerfFit, tf32_matmul
from karf_engine.fields.rendering.rays import PixelDataset
from karf_engine.fields.rendering.space import Box
from karf_engine.fields.voxels.field import VoxelField
from karf_engine.project.settings import NerfSettings, RecoloringSettings, SegmentationSettings

ITERATIONS = 4
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
    """Notes the names of operations within it, forward and backward, that an accelerator would be waited for."""

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
    to, given = kwargs.get("device"), args[0] if args else None
    is_away = isinstance(given, torch.Tensor) and given.device.type != "cpu"
    return to is not None and torch.device(to).type == "cpu" and is_away


@pytest.fixture
def waits(monkeypatch):
    found, gradients, has_cuda = [], training._gradients, torch.cuda.is_available()

    def counted(*arguments):
        if has_cuda:
            torch.cuda.set_sync_debug_mode("error")  # CUDA itself raises where it is waited for
        try:
            with Waits() as waits:
                result = gradients(*arguments)
        finally:
            if has_cuda:
                torch.cuda.set_sync_debug_mode("default")
        found.append(waits.found)
        return result

    monkeypatch.setattr(training, "_gradients", counted)
    return found


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
    occupied = torch.ones(4, 4, 4, dtype=torch.bool, device=tools[0].device)
    return VoxelField(-torch.ones(3, device=tools[0].device), 0.5, occupied, 4).requires_grad_(False)


def test_the_counter_sees_operations_that_wait():
    numbers = torch.arange(4.0)
    with Waits() as waits:
        float(numbers.sum())
        numbers[numbers > 1]
        torch.nonzero(numbers)
        numbers[torch.tensor([0, 1])] * 2
    assert len(waits.found) == 3


@pytest.mark.parametrize("kind", ["points", "rays", "recoloring"])
def test_learning_a_head_waits_for_nothing(waits, tools, field, kind):
    settings = RecoloringSettings if kind == "recoloring" else SegmentationSettings
    learn_head(kind, field, settings(iterations=ITERATIONS, batch=32, width=8), *tools)
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
def test_tf32_matmul_is_on_for_cuda_alone(device, precision):
    with contextlib.suppress(ZeroDivisionError), tf32_matmul(torch.device(device)):
        assert torch.get_float32_matmul_precision() == precision
        raise ZeroDivisionError
    assert torch.get_float32_matmul_precision() == "highest"


# --------------------------------------------------------------------------------------------------- the pretend device
PRETEND = "blender_tests.engine.pretend_device"
pytest.importorskip(PRETEND, reason="this torch has no device made of Python alone", exc_type=ImportError)

from blender_tests.engine.pretend_device import NAME, WrongDevice


@pytest.fixture
def x():
    with pretend_device() as device:
        yield torch.ones(4, 3, device=device)


MIXTURES = {
    "a sum": lambda x: x + torch.ones(4, 3),
    "a product of matrices": lambda x: x @ torch.ones(3, 2),
    "an index": lambda x: x[torch.tensor([0, 1])],
    "a mask": lambda x: x[torch.ones(4, dtype=torch.bool)],
    "an index that is written to": lambda x: x.index_put_((torch.tensor([0]),), torch.zeros(1, 3, device=NAME)),
    "a join": lambda x: torch.cat([x, torch.zeros(1, 3)]),
    "a stack with one number": lambda x: torch.stack([x.sum(), torch.tensor(0.0)]),
    "a choice": lambda x: torch.where(x > 0, x, torch.zeros(4, 3)),
    "a search": lambda x: torch.searchsorted(x, torch.zeros(4, 1)),
    "a layer": lambda x: torch.nn.Linear(3, 2)(x),
    "an output": lambda x: torch.mul(x, x, out=torch.empty(4, 3)),
    "a scatter": lambda x: torch.zeros(4, 3).index_add(0, torch.arange(4, device=NAME), x),
    "a generator of the CPU": lambda x: torch.rand(3, generator=torch.Generator(), device=NAME),
    "a generator of its own for the CPU": lambda x: torch.randn(3, generator=torch.Generator(device=NAME)),
    "whole numbers": lambda x: torch.randint(3, (2,), generator=torch.Generator(), device=NAME),
}


@pytest.mark.parametrize("mixture", MIXTURES.values(), ids=MIXTURES)
def test_tensors_and_generators_of_both_devices_do_not_mix(x, mixture):
    with pytest.raises(WrongDevice, match=r"of the CPU and of another device|generator"):
        mixture(x)
    with pytest.raises((RuntimeError, TypeError)):
        x.numpy()


def test_values_can_be_copied_between_devices(x):
    x = torch.zeros_like(x[0])
    assert x.device.type == NAME and (x + torch.tensor(2.0)).sum() == 6  # one number of the CPU, as on a real device
    x.copy_(torch.ones(3))
    x[0:1] = torch.full((1,), 5.0)
    assert x.cpu().device.type == "cpu" and x.tolist() == x.cpu().numpy().tolist() == [5, 1, 1]
    assert torch.ones(2).to(x).device == torch.tensor([1, 2], device=NAME).device == x.device
    assert x[[0, 2]].tolist() == [5, 1]
    own, other = torch.Generator(device=NAME).manual_seed(3), torch.Generator().manual_seed(3)
    assert torch.rand(2, generator=own, device=NAME).tolist() == torch.rand(2, generator=other).tolist()


def test_learning_gives_what_it_gives_on_the_cpu(x):
    def learned(device):
        torch.manual_seed(0)
        network = torch.nn.Sequential(torch.nn.Linear(3, 8), torch.nn.ReLU(), torch.nn.Linear(8, 1)).to(device)
        optimizer = torch.optim.Adam(network.parameters(), fused=True)
        x = torch.randn(16, 3).to(device)
        for _ in range(3):
            optimizer.zero_grad()
            (network(x[x[:, 0] > 0]) ** 2).mean().backward()
            optimizer.step()
        return [parameter.cpu() for parameter in network.parameters()]

    assert all(torch.equal(a, b) for a, b in zip(learned(NAME), learned("cpu"), strict=True))
