"""How fast this computer learns: some iterations of the geometry on the tiny scene, as many samples each as in a preset."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

SAMPLES = 80_000  # an iteration, those of the preset demo
WARM_UP, ITERATIONS = 10, 40  # the first ones allocate, and choose kernels
# of a capture, learned in the time of one of the tiny scene, whose grid is small and whose only level, the first, takes
# half as many: the demo and a flower of LLFF, on two threads
CAPTURED = 0.2
SETTINGS = (
    "geometry.long_side=32",
    f'geometry.levels=[{{"voxels": 96, "iterations": {ITERATIONS}, "step": 0.75}}]',
    f"geometry.samples={SAMPLES}",
    "geometry.max_rays=8192",
)


class _Clock:
    """Notes when which iteration of the geometry was done."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, float]] = []

    def __call__(self, kind: str, /, **values: Any) -> None:
        if kind == "progress" and values["stage"] == "geometry":
            self.seen.append((values["step"], time.perf_counter()))


def samples_per_second(device: str | None = None, threads: int | None = None) -> float:
    """Samples of a capture that a fit of the geometry learns from in a second; device and threads as for the stages."""
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
    return CAPTURED * SAMPLES * (last - first) / max(end - start, 1e-6)
