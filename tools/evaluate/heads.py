"""KAN heads beside plain ones over captures and seeds: on voxel features at width 64, and on a NeRF's at width 256."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import karf_engine as karf

from ..metrics.truth import DEMO
from .ablations import ABLATIONS, FULL
from .demo import F_W, THREE, Demo, ablation, samples_of
from .drawn import judge_scene
from .jobs import scene_name
from .store import Store
from .table import Figures, Table
from .views import TestViews, render_test_views, score_palettes_of

WAYS = (FULL, "w/o Res", "w/ Gate", "w/o All", "MLP layers, equal parameters")
TRAININGS = 3  # seeds of each way
WIDE = "recoloring.width=256"
NERF = (  # 256 features; what one processor core learns in a quarter of an hour of 128-pixel photos
    "geometry.field=nerf",
    "geometry.long_side=128",
    "geometry.nerf.coarse_samples=32",
    "geometry.nerf.fine_samples=32",
    "geometry.nerf.rays=128",
    "geometry.nerf.iterations=1200",
    "geometry.nerf.rate=5e-4",
    "segmentation.labels=masks",
    "splats.iterations=0",
)


def heads_table(store: Store, seeds: Sequence[int]) -> Table:
    """Measure F_w 64 wide on 12 voxel features, on the demo and on drawn scenes."""
    projects = {"demo": Demo(store).model.project.folder}
    for seed in seeds:
        judge_scene(store, seed)
        projects[scene_name(seed)] = store.path(f"{scene_name(seed)}/learned") / "project"
    found = {name: psnr_of_ways(project, store, ()) for name, project in projects.items()}
    rows = {
        way: {name: spread(scores[way]) for name, scores in found.items()} | beside_full(found, way) for way in WAYS
    }
    return Table("F_w, PSNR object", rows)


def heads_on_nerf_table(store: Store) -> Table:
    """Measure F_w 256 wide on the 256 features of a NeRF of the demo."""

    def learn(folder: Path) -> None:
        karf.learn(DEMO, THREE, project=folder / "project", overrides=[*NERF, F_W], threads=store.threads)

    store.take("nerf", learn)
    scores = psnr_of_ways(store.path("nerf") / "project", store, (WIDE,))
    found = {"demo": scores}
    return Table("F_w, PSNR object", {way: {"demo": spread(scores[way])} | beside_full(found, way) for way in WAYS})


def psnr_of_ways(project: Path, store: Store, overrides: tuple[str, ...]) -> dict[str, list[float]]:
    """Return the PSNR inside the objects' own masks, dB, of every way and seed, on one segmentation."""
    test = with_objects(render_test_views(karf.load(project)))
    samples, masks = samples_of(test), {name: test.masks(name) for name in test.model.objects}
    scratch, scores = store.path(f"scratch_heads_{project.parent.name}"), {}
    for way in WAYS:
        chosen = (F_W, *overrides, *ABLATIONS[way])
        learned = (ablation(test, samples, scratch, chosen, seed, store.threads) for seed in range(TRAININGS))
        scores[way] = [score_palettes_of(each, masks).psnr_object for each in learned]
        print(way, scores[way], flush=True)
    shutil.rmtree(scratch)
    return scores


def with_objects(test: TestViews) -> TestViews:
    """Return the test views that show an object."""
    shown = [number for number, frame in enumerate(test.frames) if frame.masks.any()]
    return TestViews(test.model, [test.training_images[n] for n in shown], [test.frames[n] for n in shown])


def spread(scores: list[float]) -> str:
    """Return mean and standard deviation over seeds."""
    return f"{np.mean(scores):.2f} ± {np.std(scores, ddof=1):.2f}"


def beside_full(found: dict[str, dict[str, list[float]]], way: str) -> Figures:
    """Return the mean difference of a way to the full block over captures, and on how many it is ahead."""
    if way == FULL:
        return {}
    means = np.array([np.mean(scores[way]) - np.mean(scores[FULL]) for scores in found.values()])
    deviation = f" ± {means.std(ddof=1):.2f}" if len(means) > 1 else ""
    return {"difference": f"{means.mean():+.2f}{deviation}", "better_on": f"{(means > 0).sum()} of {len(means)}"}
