"""A training iteration never waits for the accelerator; a pretend device rejects what a real one would."""

import contextlib
from dataclasses import replace
from unittest.mock import patch

import pytest
import torch
from torch.utils._python_dispatch import TorchDispatchMode

from blender_tests.engine.fields.fitting import learn_head, pixel_dataset, points_on_the_still_life, silent, views_of
from blender_tests.engine.pretend_device import NAME, WrongDevice, pretend_device
from blender_tests.engine.reference.still_life import camera_at, cameras, take_photo
from karf_engine.compute.runtime import start_runtime
from karf_engine.fields import training
from karf_engine.fields.fit import FitInputs
from karf_engine.fields.nerf.field import NerfSampling
from karf_engine.fields.nerf.fit import NerfFit, tf32_matmul
from karf_engine.fields.rendering.rays import PixelDataset
from karf_engine.fields.rendering.space import Box
from karf_engine.fields.voxels.field import VoxelField
from karf_engine.fields.voxels.fit_open import start_voxel_fit
from karf_engine.project.settings import (
    GeometrySettings,
    Level,
    NerfSettings,
    OpenSettings,
    RecoloringSettings,
    SegmentationSettings,
)

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
    """Records, forward and backward, the operations that wait for an accelerator."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        kwargs = kwargs or {}
        by_mask = function in INDEXING and any(i is not None and i.dtype == torch.bool for i in args[1])
        at, to = args[0].device.type if args and isinstance(args[0], torch.Tensor) else None, kwargs.get("device")
        is_carried = function is aten._to_copy.default and to is not None and torch.device(to).type != at
        if function in WAITING or by_mask or is_carried:
            self.found.append(str(function))
        return function(*args, **kwargs)


@pytest.fixture
def waits(monkeypatch, request):
    """The operations of each iteration that wait."""
    found, gradients, has_cuda = [], training._gradients, torch.cuda.is_available()

    def recorded(*arguments):
        if has_cuda:
            # CUDA itself raises where something waits
            torch.cuda.set_sync_debug_mode("default" if "voxels" in request.node.name else "error")
        try:
            with Waits() as waits:
                result = gradients(*arguments)
        finally:
            if has_cuda:
                torch.cuda.set_sync_debug_mode("default")
        found.append(waits.found)
        return result

    monkeypatch.setattr(training, "_gradients", recorded)
    return found


@pytest.fixture(params=["chosen", "pretend"])
def runtime(request):
    """Runtime on the tested device and on the pretend one, which is never the CPU."""
    name = request.config.getoption("device")
    if request.param == "chosen" and name != "pretend":
        yield start_runtime(0, 1, name)
        return
    with pretend_device():
        yield start_runtime(0, 1, "pretend")


def test_recorder_finds_operations_that_wait():
    numbers = torch.arange(4.0)
    with Waits() as waits:
        float(numbers.sum())
        numbers[numbers > 1]
        torch.nonzero(numbers)
        numbers[torch.tensor([0, 1])] * 2
    assert len(waits.found) == 3


@pytest.mark.on_device("waits in an iteration")
@pytest.mark.parametrize("kind", ["points", "rays", "recoloring"])
def test_training_a_head_never_waits(waits, runtime, kind):
    occupied = torch.ones(4, 4, 4, dtype=torch.bool, device=runtime.device)
    field = VoxelField(-torch.ones(3, device=runtime.device), 0.5, occupied, 4).requires_grad_(False)
    settings = RecoloringSettings if kind == "recoloring" else SegmentationSettings
    learn_head(kind, field, settings(iterations=ITERATIONS, batch=32, width=8), runtime, silent())
    assert waits == [[]] * ITERATIONS


@pytest.mark.on_device("waits in an iteration")
def test_training_a_nerf_never_waits(waits, runtime):
    sampling = NerfSampling(1.0, 4.0, coarse=6, fine=6)
    cameras = [camera_at(angle, 0.5, 8) for angle in (0.0, 1.0)]
    colors = [torch.rand(8, 8, 3).numpy() for _ in cameras]
    dataset = PixelDataset(cameras, colors, [color[..., 0] for color in colors], device=runtime.device)
    settings = NerfSettings(iterations=ITERATIONS, depth=2, width=8, rays=32, crop_iterations=2, look_every=ITERATIONS)
    list(NerfFit(dataset, "alpha", Box(), sampling, settings, runtime).scenes(silent()))
    assert waits == [[]] * ITERATIONS


# numbers of samples: in coarse blocks, in cells, in front of what is opaque, with a color; and the longest curved path
SAMPLES, LENGTH = ["aten.nonzero.default"] * 4, ["aten._local_scalar_dense.default"]


@pytest.mark.on_device("waits in an iteration")
@pytest.mark.parametrize(("space", "expected"), [("box", SAMPLES), ("contraction", LENGTH + SAMPLES)])
def test_training_voxels_waits_only_for_numbers_of_samples(waits, runtime, space, expected):
    levels = (Level(16, ITERATIONS, 1.0), Level(20, 4 * ITERATIONS, 1.0))
    few = {"levels": levels, "samples": 3000, "max_rays": 256, "prune_alpha": -1.0, "prune_visibility": -1.0}
    settings = replace(GeometrySettings(), features=6, open=replace(OpenSettings(), **few), **few)
    ring = cameras(6)
    photos = [take_photo(camera, sky=True) for camera in ring]
    points = points_on_the_still_life(ring, photos)
    dataset = pixel_dataset(photos, "opaque", runtime.device)
    with patch.dict("os.environ", KARF_KERNELS="off"):
        fit = start_voxel_fit(FitInputs(dataset, "opaque", space, views_of(ring), points, settings, runtime))
        list(fit.scenes(silent()))
    assert waits == [expected] * 5 * ITERATIONS


@pytest.mark.parametrize(("device", "precision"), [("cuda", "high"), ("cpu", "highest")])
def test_tf32_matmul_is_used_only_on_cuda(device, precision):
    with contextlib.suppress(ZeroDivisionError), tf32_matmul(torch.device(device)):
        assert torch.get_float32_matmul_precision() == precision
        raise ZeroDivisionError
    assert torch.get_float32_matmul_precision() == "highest"


@pytest.fixture
def x():
    with pretend_device() as device:
        yield torch.ones(4, 3, device=device)


MIXTURES = {
    "sum": lambda x: x + torch.ones(4, 3),
    "matrix product": lambda x: x @ torch.ones(3, 2),
    "index": lambda x: x[torch.tensor([0, 1])],
    "mask": lambda x: x[torch.ones(4, dtype=torch.bool)],
    "indexed write": lambda x: x.index_put_((torch.tensor([0]),), torch.zeros(1, 3, device=NAME)),
    "cat": lambda x: torch.cat([x, torch.zeros(1, 3)]),
    "stack with a scalar": lambda x: torch.stack([x.sum(), torch.tensor(0.0)]),
    "where": lambda x: torch.where(x > 0, x, torch.zeros(4, 3)),
    "search": lambda x: torch.searchsorted(x, torch.zeros(4, 1)),
    "layer": lambda x: torch.nn.Linear(3, 2)(x),
    "output": lambda x: torch.mul(x, x, out=torch.empty(4, 3)),
    "scatter": lambda x: torch.zeros(4, 3).index_add(0, torch.arange(4, device=NAME), x),
    "generator of the CPU": lambda x: torch.rand(3, generator=torch.Generator(), device=NAME),
    "generator of the device for the CPU": lambda x: torch.randn(3, generator=torch.Generator(device=NAME)),
    "integers by a generator of the CPU": lambda x: torch.randint(3, (2,), generator=torch.Generator(), device=NAME),
}


@pytest.mark.parametrize("mix", MIXTURES.values(), ids=MIXTURES)
def test_tensors_and_generators_of_two_devices_do_not_mix(x, mix):
    with pytest.raises(WrongDevice, match=r"of the CPU and of another device|generator"):
        mix(x)
    with pytest.raises((RuntimeError, TypeError)):
        x.numpy()


def test_values_can_be_copied_between_devices(x):
    x = torch.zeros_like(x[0])
    assert x.device.type == NAME and (x + torch.tensor(2.0)).sum() == 6  # a CPU scalar is fine, as on a real device
    x.copy_(torch.ones(3))
    x[0:1] = torch.full((1,), 5.0)
    assert x.cpu().device.type == "cpu" and x.tolist() == x.cpu().numpy().tolist() == [5, 1, 1]
    assert torch.ones(2).to(x).device == torch.tensor([1, 2], device=NAME).device == x.device
    assert x[[0, 2]].tolist() == [5, 1]
    own, other = torch.Generator(device=NAME).manual_seed(3), torch.Generator().manual_seed(3)
    assert torch.rand(2, generator=own, device=NAME).tolist() == torch.rand(2, generator=other).tolist()


def test_training_on_the_pretend_device_matches_the_cpu(x):
    def train(device):
        torch.manual_seed(0)
        network = torch.nn.Sequential(torch.nn.Linear(3, 8), torch.nn.ReLU(), torch.nn.Linear(8, 1)).to(device)
        optimizer = torch.optim.Adam(network.parameters(), fused=True)
        x = torch.randn(16, 3).to(device)
        for _ in range(3):
            optimizer.zero_grad()
            (network(x[x[:, 0] > 0]) ** 2).mean().backward()
            optimizer.step()
        return [parameter.cpu() for parameter in network.parameters()]

    assert all(torch.equal(a, b) for a, b in zip(train(NAME), train("cpu"), strict=True))
