"""How fast a voxel field is learned by torch and by the compiled kernels, and what held-out photos say of it by then.

    python -m tools.speed.geometry CAPTURE [--preset demo] [--threads 1] [--override geometry.long_side=400 ...]

Each way learns the scene for its curve, in seconds that exclude the judging. Then both take the same state late in the
last level, and do its next iterations in turns, in one process: milliseconds of processor time, medians.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from karf_engine.capture import open_capture
from karf_engine.capture.training_images import TrainingImage, load_views
from karf_engine.capture.triangulation import triangulate
from karf_engine.compute.progress import Progress, peak_memory_bytes
from karf_engine.compute.runtime import start_runtime
from karf_engine.errors import Cancelled
from karf_engine.fields.fit import Fit
from karf_engine.fields.registry import FitTask, background_kind_of, build_pixel_dataset, make_fit_task
from karf_engine.fields.rendering.rays import PixelDataset
from karf_engine.fields.scene import Scene
from karf_engine.io.images import alpha_composite
from karf_engine.metrics.images import psnr
from karf_engine.project import settings as settings_module
from tools.judging import HOLDOUT
from tools.speed.rows import Row, print_rows

PIXELS = 6000  # of each held-out photo
WAYS = {"torch": "off", "kernels": "on"}
LATE = 0.85  # of all iterations: where iterations are timed
TURNS, PER_TURN = 4, 6  # of each way; the first iteration of a turn warms up


@dataclass
class Clock(Progress):
    """Progress that notes processor and wall seconds, without those of the judging between, and stops after so many.

    Attributes:
        stop_after: Steps after which the fit is cancelled; 0 for never.
        steps: Processor seconds at the end of each step.
    """

    stop_after: int = 0
    steps: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__(lambda *_, **__: None, self._is_over, "geometry", 1)
        self._pause_cpu = self._pause_wall = 0.0
        self._start_cpu, self._start_wall = time.process_time(), time.perf_counter()

    def step(self, count: int = 1, **metrics: float) -> None:
        self.steps.append(time.process_time())
        super().step(count, **metrics)

    def _is_over(self) -> bool:
        return bool(self.stop_after) and len(self.steps) >= self.stop_after

    @property
    def seconds(self) -> tuple[float, float]:
        """Processor and wall seconds so far."""
        cpu, wall = time.process_time() - self._start_cpu, time.perf_counter() - self._start_wall
        return cpu - self._pause_cpu, wall - self._pause_wall

    @contextmanager
    def paused(self) -> Iterator[None]:
        cpu, wall = time.process_time(), time.perf_counter()
        yield
        self._pause_cpu += time.process_time() - cpu
        self._pause_wall += time.perf_counter() - wall


def run(capture: Path, settings: settings_module.Settings, threads: int, ways: list[str]) -> list[list[Row]]:
    """Two tables: held-out PSNR after each level of each way, and milliseconds of an iteration."""
    task, tests = prepare(capture, settings, threads)
    curves: list[Row] = []
    for way in ways:
        state, rows = curve(task, tests, way, capture.name)
        curves += rows
    return [curves, iterations(task, state, ways, capture.name)]


def prepare(capture: Path, settings: settings_module.Settings, threads: int) -> tuple[FitTask, list[TrainingImage]]:
    """What a fit of the training photos starts from, and the held-out photos, over white where they have a matte."""
    content, seed, long_side = open_capture(capture, holdout=HOLDOUT), settings.seed, settings.geometry.long_side
    runtime = start_runtime(seed, threads, "cpu")
    views = content.split("train")
    training_images, tests = load_views(views, long_side), load_views(content.split("test"), long_side)
    tests = [
        p if p.alpha is None else replace(p, color=alpha_composite(p.color, p.alpha, 1.0), alpha=None) for p in tests
    ]
    kind, points = background_kind_of(training_images), None
    if kind == "opaque" and content.points is not None:
        points = content.points.seen_by([n for n, view in enumerate(content.views) if view.split == "train"])
    elif kind == "opaque" and find_spec("pycolmap"):
        points = triangulate(training_images, threads, Clock())
    return make_fit_task(views, training_images, kind, points, settings.geometry, seed, runtime.device), tests


def start(task: FitTask, way: str) -> Fit:
    """A fresh fit, learned this way."""
    os.environ["KARF_KERNELS"] = WAYS[way]
    return task.start(start_runtime(task.seed, task.threads, task.device))


def curve(task: FitTask, tests: list[TrainingImage], way: str, name: str) -> tuple[dict[str, Tensor], list[Row]]:
    """The state after LATE of all iterations, and a row for each level."""
    fit = start(task, way)
    clock = Clock(stop_after=int(LATE * fit.iterations))
    dataset = build_pixel_dataset(tests, "opaque", torch.device("cpu"))
    rows: list[Row] = []
    state: dict[str, Tensor] = {}
    while fit.done < fit.iterations:
        try:
            for scene in fit.scenes(clock):
                with clock.paused():
                    values, exposed = psnr_of_plates(scene, dataset)
                    cpu, wall = clock.seconds
                    rows.append(
                        {
                            "scene": name, "threads": task.threads, "way": way, "iterations": fit.done,
                            "cpu_s": round(cpu, 1), "wall_s": round(wall, 1), "psnr": round(statistics.mean(values), 2),
                            "worst": round(min(values), 2), "exposed": round(statistics.mean(exposed), 2),
                            "peak_gib": round(peak_memory_bytes() / 2**30, 2),
                        }
                    )  # fmt: skip
        except Cancelled:
            with clock.paused():
                state = {key: value.detach().clone() for key, value in fit.state().items()}
            clock.stop_after = 0
    return state, rows


def psnr_of_plates(scene: Scene, dataset: PixelDataset) -> tuple[list[float], list[float]]:
    """PSNR of each image as it is, and with a gain and an offset of each channel that suit it best: what is lost by
    photos that were exposed otherwise than those that were learned from."""
    plain, exposed = [], []
    random = torch.Generator().manual_seed(0)
    for first, last in pairwise(dataset.offsets.tolist()):
        index = torch.randint(first, last, (PIXELS,), generator=random)
        shown, photo = scene.colors(dataset.rays(index)), dataset.color[index].float() / 255
        fits = [np.polyfit(a, b, 1) for a, b in zip(shown.T.numpy(), photo.T.numpy(), strict=True)]
        fitted = np.stack([np.polyval(fit, a) for fit, a in zip(fits, shown.T.numpy(), strict=True)], 1)
        plain.append(psnr(shown.numpy(), photo.numpy()))
        exposed.append(psnr(fitted, photo.numpy()))
    return plain, exposed


def iterations(task: FitTask, state: dict[str, Tensor], ways: list[str], name: str) -> list[Row]:
    """Median milliseconds of an iteration from this state, of each way, taken in turns."""
    seconds: dict[str, list[float]] = {way: [] for way in ways}
    for turn in range(TURNS * len(ways)):
        way = ways[turn % len(ways)]
        fit = start(task, way)
        fit.resume(state)
        clock = Clock(stop_after=PER_TURN)
        with suppress(Cancelled):
            for _ in fit.scenes(clock):
                pass
        seconds[way] += [b - a for a, b in pairwise(clock.steps)]
    medians = {way: 1000 * statistics.median(values) for way, values in seconds.items()}
    return [
        {
            "scene": name, "threads": task.threads, "way": way, "ms_an_iteration": round(milliseconds, 1),
            "times_faster": round(medians[ways[0]] / milliseconds, 2),
        }
        for way, milliseconds in medians.items()
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", nargs="+", type=Path, metavar="CAPTURE")
    parser.add_argument("--preset", default="demo")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--override", action="append", default=[], metavar="STAGE.FIELD=VALUE")
    parser.add_argument("--ways", nargs="+", choices=list(WAYS), default=list(WAYS))
    options = parser.parse_args()
    settings = settings_module.with_overrides(settings_module.preset(options.preset), options.override)
    for capture in options.captures:
        for table in run(capture, settings, options.threads, options.ways):
            print_rows(table)


if __name__ == "__main__":
    main()
