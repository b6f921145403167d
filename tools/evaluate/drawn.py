"""Scenes that a seed draws, learned from rough masks, and judged by their own truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import karf_engine as karf

from ..metrics.scores import mean_mask_scores, score_pictures
from ..metrics.truth import Truth
from .jobs import scene_name
from .judging import baselines, ciede2000_of, outside_of, recolored
from .store import Store
from .table import Figures, Table
from .views import TestViews, learn_again, matted, render_test_views, with_model


def draw_scene(store: Store, seed: int) -> Path:
    """Return the capture of a seed, drawn unless it is there."""

    def draw(folder: Path) -> None:
        given = ("--seed", str(seed), "--out", str(folder / "capture"), "--threads", str(store.threads))
        store.run_in_blender("tools.scenes", *given)

    name = f"{scene_name(seed)}/drawn"
    store.take(name, draw)
    return store.path(name) / "capture"


def judge_scene(store: Store, seed: int) -> Figures:
    """Return a scene's figures, learned and judged unless they are there."""

    def judge(folder: Path) -> Figures:
        return judged(draw_scene(store, seed), folder, store.threads)

    return store.take(f"{scene_name(seed)}/learned", judge)


def judged(capture: Path, folder: Path, threads: int) -> Figures:
    """Learn a capture into `folder` and return its figures, means over objects, edits and test views."""
    masks = capture / "coarse_masks" / "one"
    model = karf.learn(capture, masks, project=folder / "project", overrides=["splats.iterations=0"], threads=threads)
    test, truth = render_test_views(model), Truth(capture)
    shipped, true_masks = matted(test), truth.masks("test")
    photos = [frame.base for frame in test.frames]
    ceiling = ceiling_of(test, truth, folder, threads)
    per_paint = recolored(shipped, truth, per_paint=True)
    iou = {
        name: 100 * mean_mask_scores({each: views.masks(each) for each in model.objects}, true_masks).iou
        for name, views in {"iou": test, "iou_photo": shipped, "iou_ceiling": ceiling}.items()
    }
    return {
        "psnr": score_pictures([frame.color for frame in test.frames], photos)[0],
        **iou,
        "ciede2000_per_paint": ciede2000_of(per_paint, truth),
        "ciede2000_per_object": ciede2000_of(recolored(shipped, truth, per_paint=False), truth),
        **baselines(photos, truth),
        "mse_outside_photo": outside_of(per_paint, photos, truth),
    }


def ceiling_of(test: TestViews, truth: Truth, folder: Path, threads: int) -> TestViews:
    """Return the test views segmented from the true masks of all training views."""
    masks = truth.write_training_masks(folder / "true_masks")
    overrides = ["segmentation.labels=votes"]
    return with_model(
        test, learn_again(test.model, folder / "ceiling", overrides, ("segmentation",), masks, threads), "photo"
    )


def drawn_table(store: Store, seeds: Sequence[int]) -> Table:
    """Measure all scenes: a row each, then their mean and median."""
    rows = {scene_name(seed): judge_scene(store, seed) for seed in seeds}
    columns = {name: [row[name] for row in rows.values()] for name in next(iter(rows.values()))}
    means = {name: float(np.mean(column)) for name, column in columns.items()}
    medians = {name: float(np.median(column)) for name, column in columns.items()}
    return Table("scene", rows | {"**mean**": means, "**median**": medians})
