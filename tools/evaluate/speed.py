"""Measured times: compiled kernels beside torch, the stages of the demo, and a swatch in Blender."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import time
from contextlib import suppress
from itertools import pairwise

from karf_engine.capture import open_capture
from karf_engine.capture.training_images import load_views
from karf_engine.compute.progress import Progress
from karf_engine.compute.runtime import start_runtime
from karf_engine.errors import Cancelled
from karf_engine.fields.registry import FitTask, make_fit_task
from karf_engine.project.settings import preset

from ..dev import python_of
from ..metrics.truth import DEMO
from .demo import Demo
from .sources import ROOT
from .store import Store
from .table import Figures, Table

WAYS = {"torch": "off", "compiled kernels (numba)": "on"}  # values of KARF_KERNELS
LATE, TURNS, PER_TURN = 0.85, 4, 6  # share of the iterations after which they are timed, turns, iterations of each
STAGES = {
    "geometry": "learn the geometry (60 photos of 256 pixels)",
    "segmentation": "segment three objects",
    "palette": "extract palettes",
    "recoloring": "train F_w (250 iterations)",
    "splats": "learn splats",
}
SIZES = {"800 x 800": (800, 800), "1920 x 1080": (1920, 1080)}


class Clock(Progress):
    """Progress that notes the processor time of each step and stops after so many."""

    def __init__(self, stop_after: int) -> None:
        super().__init__(lambda *_, **__: None, lambda: len(self.steps) >= stop_after, "geometry", 1)
        self.steps: list[float] = []

    def step(self, count: int = 1, **metrics: float) -> None:
        self.steps.append(time.process_time())
        super().step(count, **metrics)


def kernels_table(store: Store) -> Table:
    """Measure an iteration of geometry late in its training, by torch and by the compiled kernels, in turns."""
    with store.trace.paused():
        milliseconds = iterations(demo_fit(store.threads))
    slowest = milliseconds["torch"]
    rows = {way: {"milliseconds": value, "times_faster": slowest / value} for way, value in milliseconds.items()}
    return Table("an iteration of geometry by", rows)


def demo_fit(threads: int) -> FitTask:
    """Return what learning the demo's geometry starts from."""
    capture, settings = open_capture(DEMO), preset("demo")
    runtime = start_runtime(settings.seed, threads, "cpu")
    views = capture.split("train")
    images = load_views(views, settings.geometry.long_side)
    return make_fit_task(views, images, "opaque", None, settings.geometry, settings.seed, runtime.device)


def iterations(task: FitTask) -> dict[str, float]:
    """Return the median processor milliseconds of an iteration, of each way."""
    os.environ["KARF_KERNELS"] = "on"
    fit = task.start(start_runtime(task.seed, task.threads, task.device))
    late = Clock(int(LATE * fit.iterations))
    with suppress(Cancelled):
        for _ in fit.scenes(late):
            pass
    state = {key: value.detach().clone() for key, value in fit.state().items()}
    seconds: dict[str, list[float]] = {way: [] for way in WAYS}
    for way in [*WAYS] * TURNS:
        os.environ["KARF_KERNELS"] = WAYS[way]
        fit = task.start(start_runtime(task.seed, task.threads, task.device))
        fit.resume(state)
        clock = Clock(PER_TURN)
        with suppress(Cancelled):
            for _ in fit.scenes(clock):
                pass
        seconds[way] += [b - a for a, b in pairwise(clock.steps)]  # the first iteration warms up
    return {way: 1000 * statistics.median(values) for way, values in seconds.items()}


def stages_table(store: Store) -> Table:
    """Return the processor seconds of each stage of the demo."""
    seconds = Demo(store).seconds
    return Table("stage", {title: {"seconds": seconds[name]} for name, title in STAGES.items()})


def swatch_table(store: Store) -> Table:
    """Measure a swatch's drag in Blender, from setting its color to the pixels in the image."""
    rows: dict[str, Figures] = {}
    for title, (width, height) in SIZES.items():
        command = [str(python_of("blender")), "-m", "tools.evaluate.swatch_in_blender", str(width), str(height)]
        done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
        rows[title] = {
            "milliseconds": json.loads(done.stdout.splitlines()[-1])
        }  # Blender prints lines of its own before
    return Table("frame", rows)
