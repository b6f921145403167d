"""Measured times: compiled kernels beside torch, the stages of the demo, and a swatch in Blender."""

from __future__ import annotations

import json
import math
import os
import subprocess
from contextlib import suppress

from karf_engine.capture import open_capture
from karf_engine.capture.training_images import load_views
from karf_engine.compute.progress import Progress
from karf_engine.compute.runtime import start_runtime
from karf_engine.errors import Cancelled
from karf_engine.fields.registry import FitTask, make_fit_task
from karf_engine.project.settings import preset

from ..dev import python_of
from ..metrics.truth import DEMO
from .demo import Demo, processor_seconds
from .sources import ROOT
from .store import Store
from .table import Figures, Table

WAYS = {"torch": "off", "compiled kernels (numba)": "on"}  # values of KARF_KERNELS
FIRST = 3  # steps
STAGES = {
    "geometry": "learn the geometry (60 photos of 256 pixels)",
    "segmentation": "segment three objects",
    "palette": "extract palettes",
    "recoloring": "train F_w (250 iterations)",
    "splats": "learn splats",
}
SIZES = {"800 x 800": (800, 800), "1920 x 1080": (1920, 1080)}


class Steps(Progress):
    """Progress that cancels a fit after a number of steps."""

    def __init__(self, most: float) -> None:
        super().__init__(lambda *_, **__: None, lambda: self.count >= most, "geometry", 1)
        self.count = 0

    def step(self, count: int = 1, **metrics: float) -> None:
        self.count += count
        super().step(count, **metrics)


def kernels_table(store: Store) -> Table:
    """Measure learning the demo's geometry by torch and by the compiled kernels."""
    task = demo_fit(store.threads)
    for way in WAYS:
        learn(task, way, FIRST)  # compiles the kernels, and is traced, which the timed runs are not
    with store.trace.paused():
        seconds = {way: processor_seconds(lambda way=way: learn(task, way)) for way in WAYS}
    rows = {way: {"seconds": value, "times_faster": seconds["torch"] / value} for way, value in seconds.items()}
    return Table("geometry learned by", rows)


def demo_fit(threads: int) -> FitTask:
    """Return what learning the demo's geometry starts from."""
    capture, settings = open_capture(DEMO), preset("demo")
    runtime = start_runtime(settings.seed, threads, "cpu")
    views = capture.split("train")
    images = load_views(views, settings.geometry.long_side)
    return make_fit_task(views, images, "opaque", None, settings.geometry, settings.seed, runtime.device)


def learn(task: FitTask, way: str, most: float = math.inf) -> None:
    """Learn a geometry, or its first steps."""
    os.environ["KARF_KERNELS"] = WAYS[way]
    fit = task.start(start_runtime(task.seed, task.threads, task.device))
    with suppress(Cancelled):
        for _ in fit.scenes(Steps(most)):
            pass


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
