"""Compilation of all kernels in another process: about half a minute, once per machine and version.

Without it, kernels are compiled at their first call, which takes as long without a message.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import llvmlite.binding
import numba
import torch

from ....compute.kernels import cache_folder
from ....compute.runtime import start_runtime
from ...rendering.rays import Rays
from ...rendering.space import Contraction
from ...scene import Scene
from ..field import VoxelField
from ..renderer import PointSupervision, RayBatch
from .ray_paths import paths_of
from .renderer import FusedRenderer


def stamp_of(n_features: int) -> Path:
    """Return the empty file that marks these kernels as compiled for this processor, Python and numba."""
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
    code = f"import sys; sys.path.insert(0, {root!r}); from {__name__} import prepare; prepare({n_features})"
    # errors are ignored here; they appear again where the kernels are called
    command = [sys.executable, "-I", "-B", "-c", code]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def prepare(n_features: int) -> None:
    """Call every kernel once, for training and for rendering."""
    runtime = start_runtime(0, 1, "cpu")
    rays = Rays(torch.tensor([[0.5, 0.5, -1.0]]), torch.tensor([[0.0, 0.0, 1.0]]))
    field = VoxelField(torch.zeros(3), 0.5, torch.ones(2, 2, 2, dtype=torch.bool), n_features)
    renderer = FusedRenderer(field, runtime, 1.0, 0.02, PointSupervision(0.1, 0.1))
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
