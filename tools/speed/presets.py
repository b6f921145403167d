"""How long a preset takes here: iterations of each of its trainings at their real sizes, and what all of them add up to.

    .venv/engine/bin/python -m tools.speed.presets quality [--threads N]

The geometry is that of the demo, with so few iterations that the last level is reached soon; the heads learn from random
surfaces, as many samples a ray as the preset keeps. Seconds are those of the processor, all threads together: on an
idle machine the wall clock shows a little more than their N-th part. Nothing here needs a learned project.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch

import karf_engine as karf
from karf_engine.compute.progress import Progress, peak_memory_bytes
from karf_engine.compute.runtime import start_runtime
from karf_engine.fields.nerf.field import NerfField, NerfNetwork, NerfSampling, NerfShape
from karf_engine.fields.protocol import Field
from karf_engine.fields.rendering.space import Box
from karf_engine.fields.rendering.surface_cache import SurfaceCache
from karf_engine.fields.voxels.field import VoxelField
from karf_engine.heads.fields import RecoloringField, SegmentationField
from karf_engine.heads.fit import ObjectRays, fit_on_points, fit_on_rays, fit_recoloring
from karf_engine.project.settings import PRESETS, Settings

from .machine import machine

DEMO = Path(__file__).resolve().parents[2] / "demo"
WARM, LAST = 60, 12  # iterations of each level of voxels but the last, in which something solid is found; of the last
FEW = 3  # iterations of the NeRF and of the heads
RAYS = 20_000  # that the heads learn from


def run(preset: str, threads: int = 1) -> dict[str, Any]:
    """Processor seconds an iteration of each training, minutes of all iterations, and the highest memory until then."""
    settings = PRESETS[preset]
    parts = geometry(settings, threads) | heads(settings, threads)
    minutes = sum(part["seconds"] * part["iterations"] for part in parts.values()) / 60
    memory = round(peak_memory_bytes() / 2**30, 2)
    return {"preset": preset, **parts, "processor_minutes": round(minutes, 1), "peak_gib": memory, **machine(threads)}


class _Enough(Exception):
    """The last iteration is done; what follows is not to be timed."""


def geometry(settings: Settings, threads: int) -> dict[str, dict[str, float]]:
    """Seconds an iteration of the NeRF, or of each level of voxels in a box."""
    own = settings.geometry
    if own.field == "nerf":
        overrides = [f"geometry.nerf.iterations={FEW}", "geometry.nerf.crop_iterations=0"]
        (seconds,) = _seconds(settings.preset, overrides, [FEW], threads)
        return {"nerf": {"seconds": round(seconds, 3), "iterations": own.nerf.iterations}}
    counts = [WARM] * (len(own.levels) - 1) + [LAST]
    levels = [asdict(level) | {"iterations": count} for level, count in zip(own.levels, counts, strict=True)]
    taken = _seconds(settings.preset, [f"geometry.levels={json.dumps(levels)}"], counts, threads)
    return {
        f"voxels {level.voxels}": {"seconds": round(seconds, 3), "iterations": level.iterations}
        for level, seconds in zip(own.levels, taken, strict=True)
    }


def _seconds(preset: str, overrides: list[str], counts: list[int], threads: int) -> list[float]:
    """Processor seconds an iteration in each stretch of so many, by the progress that is told of."""
    told: list[tuple[int, float]] = []

    def emit(kind: str, /, **values: Any) -> None:
        if kind == "progress" and values["stage"] == "geometry":
            told.append((values["step"], time.process_time()))
            if values["step"] == values["total"]:
                raise _Enough

    with tempfile.TemporaryDirectory() as folder, suppress(_Enough):
        given = {"preset": preset, "overrides": overrides, "threads": threads, "emit": emit}
        karf.learn_geometry(DEMO, project=Path(folder), **given)
    result, before = [], 0
    for count in counts:
        own = [(step, at) for step, at in told if before < step <= before + count]
        result.append((own[-1][1] - own[0][1]) / max(1, own[-1][0] - own[0][0]))
        before += count
    return result


def heads(settings: Settings, threads: int) -> dict[str, dict[str, float]]:
    """Seconds an iteration of F_s and of F_w."""
    runtime = start_runtime(0, threads, "cpu")
    field = _nerf() if settings.geometry.field == "nerf" else _voxels(settings.geometry.features)
    segmentation = replace(settings.segmentation, iterations=FEW)
    recoloring = replace(settings.recoloring, iterations=FEW)
    n_samples = settings.segmentation.samples_per_ray
    positions = torch.rand(RAYS, n_samples, 3) - 0.5
    viewdirs = torch.nn.functional.normalize(torch.randn(RAYS, 3), dim=1)
    number = torch.arange(RAYS)
    karf_s = SegmentationField(torch.tensor([[[-1.0] * 3, [1.0] * 3]]), field.n_features, segmentation)
    training = segmentation, runtime, Progress(lambda *_, **__: None, lambda: False, "F_s", FEW)
    start = time.process_time()
    if segmentation.labels == "masks":
        cache = SurfaceCache(positions, positions[..., 0], viewdirs, torch.ones(RAYS), number)
        fit_on_rays(karf_s, field, cache, torch.eye(2)[number % 2], *training)
    else:
        every = torch.ones(RAYS)
        fit_on_points(karf_s, field, positions[:, 0], number % 2, every, every.bool(), *training)
    middle = time.process_time()
    n_colors = settings.palette.colors or 6
    colors, weights = torch.rand(RAYS, 3), torch.rand(RAYS, n_colors)
    rays = ObjectRays(
        positions, viewdirs, colors, number, number * 0, weights, torch.ones(RAYS, dtype=torch.bool), torch.ones(RAYS)
    )
    karf_w = RecoloringField(karf_s.bounds, field.n_features, [n_colors], recoloring)
    progress = Progress(lambda *_, **__: None, lambda: False, "F_w", FEW)
    fit_recoloring(karf_w, field, rays, torch.rand(1, n_colors, 3), recoloring, runtime, progress)
    end = time.process_time()
    return {
        "F_s": {"seconds": round((middle - start) / FEW, 3), "iterations": settings.segmentation.iterations},
        "F_w": {"seconds": round((end - middle) / FEW, 3), "iterations": settings.recoloring.iterations},
    }


def _voxels(n_features: int) -> Field:
    occupied = torch.ones(64, 64, 64, dtype=torch.bool)
    return VoxelField(torch.tensor([-1.0] * 3), 2 / 64, occupied, n_features).requires_grad_(False)


def _nerf() -> Field:
    networks = [NerfNetwork(NerfShape()) for _ in range(2)]
    bounds = torch.tensor([[-1.0] * 3, [1.0] * 3])
    return NerfField(*networks, NerfSampling(2.0, 6.0), Box(), bounds).requires_grad_(False)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("preset", choices=tuple(PRESETS))
    parser.add_argument("--threads", type=int, default=1)
    given = parser.parse_args()
    print(json.dumps(run(given.preset, given.threads), indent=1))
