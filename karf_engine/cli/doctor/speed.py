"""Measure how fast this computer learns: some iterations of the geometry on the tiny scene."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

SAMPLES = 80_000  # per iteration, as in the preset demo
WARM_UP, ITERATIONS = 10, 40  # the first iterations allocate, and choose kernels
# speed on a real capture relative to the tiny scene, with its small grid and single level; measured on two threads
REAL_SPEED = 0.2
SETTINGS = (
    "geometry.long_side=32",
    f'geometry.levels=[{{"voxels": 96, "iterations": {ITERATIONS}, "step": 0.75}}]',
    f"geometry.samples={SAMPLES}",
    "geometry.max_rays=8192",
)


class _Clock:
    """Records the time of each progress event of the geometry."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, float]] = []

    def __call__(self, kind: str, /, **values: Any) -> None:
        if kind == "progress" and values["stage"] == "geometry":
            self.seen.append((values["step"], time.perf_counter()))


def samples_per_second(device: str | None = None, threads: int | None = None) -> float:
    """Return how many samples of a capture the geometry learns from per second; arguments as of the stages' options."""
    from ... import api
    from .scene import write_scene

    clock = _Clock()
    with tempfile.TemporaryDirectory(prefix="karf-speed-", ignore_cleanup_errors=True) as folder:
        capture = Path(folder) / "capture"
        write_scene(capture, Path(folder) / "masks")
        api.learn_geometry(
            capture,
            project=Path(folder) / "project",
            overrides=SETTINGS,
            device=device,
            threads=threads,
            emit=clock,
        )
    (first, start), (last, end) = next(pair for pair in clock.seen if pair[0] >= WARM_UP), clock.seen[-1]
    return REAL_SPEED * SAMPLES * (last - first) / max(end - start, 1e-6)
