"""Compilation of all kernels in another process: about half a minute, once per machine and version.

Without it, kernels are compiled at their first call, which takes as long without a message.
"""

import hashlib
import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import torch

from ....compute.kernels import cache_folder, has_kernels
from ....compute.progress import Emit
from ....compute.runtime import start_runtime
from ....project.settings import GeometrySettings
from ...rendering.rays import Rays
from ...rendering.space import Contraction
from ...scene import Scene
from ..field import VoxelField
from ..renderer import RayBatch
from ..torch_renderer import new_renderer


def prepare_kernels(settings: GeometrySettings, device: torch.device) -> Callable[[Emit, Callable[[], bool]], None]:
    """Start compiling the kernels of a fit in another process; return a function that waits for its end."""
    process = begin(settings.features) if device.type == "cpu" and has_kernels() else None

    def wait(emit: Emit, should_stop: Callable[[], bool]) -> None:
        if process is None:
            return
        if process.poll() is None:
            emit("stage", name="geometry", text="compiling for this processor, once: up to a minute")
        while process.poll() is None and not should_stop():
            time.sleep(0.1)
        if process.poll() is None:
            process.kill()

    return wait


def stamp_of(n_features: int) -> Path:
    """Return the empty file that marks these kernels as compiled for this processor, Python and numba."""
    import llvmlite.binding
    import numba

    sources = b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
    names = f"{n_features} {numba.__version__} {sys.version} {llvmlite.binding.get_host_cpu_name()} {Path(__file__)}"
    return cache_folder() / f"compiled-{hashlib.sha256(sources + os.fsencode(names)).hexdigest()[:20]}"


def begin(n_features: int) -> subprocess.Popen | None:
    """Start the compilation; None if everything is compiled already."""
    with suppress(OSError):  # the folder may be inaccessible
        if stamp_of(n_features).exists():
            return None
    # the engine may run from a folder outside the child's path
    root = str(Path(__file__).parents[4])
    code = f"import sys; sys.path.insert(0, {root!r}); from {__name__} import call_kernels; call_kernels({n_features})"
    # errors are ignored here; they appear again where the kernels are called
    command = [sys.executable, "-I", "-B", "-c", code]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def call_kernels(n_features: int) -> None:
    """Call every kernel once, for training and for rendering."""
    from .marching import paths_of  # needs numba

    runtime = start_runtime(0, 1, "cpu")
    rays = Rays(torch.tensor([[0.5, 0.5, -1.0]]), torch.tensor([[0.0, 0.0, 1.0]]))
    field = VoxelField(torch.zeros(3), 0.5, torch.ones(2, 2, 2, dtype=torch.bool), n_features)
    renderer = new_renderer(field, runtime, unit=1.0, russian_roulette=0.02, margin=0.1, off_path=0.1)
    groups = [{"params": [field.raw_density, field.feature_table]}, {"params": list(field.color_network.parameters())}]
    optimizer = renderer.optimizer(groups, (0.9, 0.99))
    renderer.visibility([rays])
    paths_of(Contraction(torch.zeros(3), 1.0, 1.0, 0.1), field.bounds, rays)
    color = renderer.render(RayBatch(rays, 1.0, torch.full((1,), 0.5))).color
    density, features = renderer.differences(torch.tensor([0]), torch.tensor([1]))
    (color.sum() + density + features).backward()
    optimizer.step()
    Scene(field.requires_grad_(False), None, "black", 1.0).colors(rays)
    stamp_of(n_features).parent.mkdir(parents=True, exist_ok=True)
    stamp_of(n_features).touch()
