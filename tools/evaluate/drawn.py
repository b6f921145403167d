"""Scenes that a seed draws, learned from rough masks, and judged by their own truth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import karf_engine as karf

from ..metrics.scores import hue_shifted, mean_mask_scores, score_pictures, score_recolor
from ..metrics.truth import Truth
from .judged_edits import edit_to_judge, hue_shift_of_paints
from .rivals.measuring import RULES, measure
from .store import Store
from .table import Figures, Table
from .views import TestViews, learn_again, matted, render_test_views, with_model


def scene_name(seed: int) -> str:
    """Return the name of a drawn scene."""
    return f"seed_{seed:03d}"


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


def measure_rivals(store: Store, seed: int) -> dict[str, Figures]:
    """Return the figures of each rule on a scene, measured unless they are there."""

    def rival(folder: Path) -> dict[str, Figures]:
        judge_scene(store, seed)
        model = karf.load(store.path(f"{scene_name(seed)}/learned") / "project")
        return dict(measure(model, Truth(draw_scene(store, seed)), folder / "scratch", store.threads))

    return store.take(f"{scene_name(seed)}/rivals", rival)


def judged(capture: Path, folder: Path, threads: int) -> Figures:
    """Learn a capture into `folder` and return its figures, means over objects, edits and test views."""
    masks = capture / "coarse_masks" / "one"
    model = karf.learn(capture, masks, project=folder / "project", threads=threads)
    test, truth = render_test_views(model), Truth(capture)
    shipped, true_masks = matted(test), truth.masks("test")
    photos = [frame.base for frame in test.frames]
    ceiling = ceiling_of(test, truth, folder, threads)
    iou = {
        name: 100 * mean_mask_scores({each: views.masks(each) for each in model.objects}, true_masks).iou
        for name, views in {"iou": test, "iou_photo": shipped, "iou_ceiling": ceiling}.items()
    }
    return {
        "psnr": score_pictures([frame.color for frame in test.frames], photos)["psnr"],
        **iou,
        "ciede2000_per_paint": ciede2000_of(shipped, truth, per_paint=True),
        "ciede2000_per_object": ciede2000_of(shipped, truth, per_paint=False),
        **hue_shifts(photos, truth),
        "ciede2000_no_edit": mean_over_edits(truth, photos, dict.fromkeys(truth.edits, photos)),
        "mse_outside_photo": outside_of(shipped, truth),
    }


def ceiling_of(test: TestViews, truth: Truth, folder: Path, threads: int) -> TestViews:
    """Return the test views segmented from the true masks of all training views."""
    masks = truth.write_training_masks(folder / "true_masks")
    overrides = ["segmentation.labels=votes"]
    return with_model(
        test, learn_again(test.model, folder / "ceiling", overrides, ("segmentation",), masks, threads), "photo"
    )


def recolored(views: TestViews, truth: Truth, edit: str, per_paint: bool) -> list[np.ndarray]:
    """Return the views recolored by one who knows a color pair an object, or one for each of its paints."""
    known = edit_to_judge(views.model, truth, edit, per_paint)
    return [views.model.composite(frame, known) for frame in views.frames]


def ciede2000_of(views: TestViews, truth: Truth, per_paint: bool) -> float:
    """Return the mean CIEDE2000 of our recolors."""
    photos = [frame.base for frame in views.frames]
    return mean_over_edits(truth, photos, {edit: recolored(views, truth, edit, per_paint) for edit in truth.edits})


def outside_of(views: TestViews, truth: Truth) -> float:
    """Return the mean squared error to the photos outside the edited objects, of recolors by a pair for each paint."""
    photos = [frame.base for frame in views.frames]
    scores = [
        score_recolor(recolored(views, truth, edit, True), truth.recolored(edit), photos, truth.inside(edit))
        for edit in truth.edits
    ]
    return float(np.mean([score.mse_outside for score in scores]))


def hue_shifts(photos: list[np.ndarray], truth: Truth) -> Figures:
    """Return the figures of hue shifts in the true masks: by a pair for each paint, and by one for each object."""
    by_paint, by_object = {}, {}
    for edit, entry in truth.edits.items():
        masks = [{name: labels == truth.names[name] for name in entry["objects"]} for labels in truth.labels("test")]
        paints = {name: truth.paint_pairs(edit, name) for name in entry["objects"]}
        pairs = {name: truth.color_pair(edit, name) for name in entry["objects"]}
        by_paint[edit] = [hue_shift_of_paints(p, own, paints) for p, own in zip(photos, masks, strict=True)]
        by_object[edit] = [hue_shifted(photo, own, pairs) for photo, own in zip(photos, masks, strict=True)]
    return {
        "ciede2000_hue_per_paint": mean_over_edits(truth, photos, by_paint),
        "ciede2000_hue": mean_over_edits(truth, photos, by_object),
    }


def mean_over_edits(truth: Truth, photos: list[np.ndarray], pictures: dict[str, list[np.ndarray]]) -> float:
    """Return the mean CIEDE2000 of pictures of each edit, inside its objects."""
    scores = [
        score_recolor(views, truth.recolored(edit), photos, truth.inside(edit)).ciede2000
        for edit, views in pictures.items()
    ]
    return float(np.mean(scores))


def drawn_table(store: Store, seeds: Sequence[int]) -> Table:
    """Measure all scenes: a row each, then their mean and median."""
    rows = {scene_name(seed): judge_scene(store, seed) for seed in seeds}
    columns = {name: [row[name] for row in rows.values()] for name in next(iter(rows.values()))}
    means = {name: float(np.mean(column)) for name, column in columns.items()}
    medians = {name: float(np.median(column)) for name, column in columns.items()}
    return Table("scene", rows | {"**mean**": means, "**median**": medians})


def rivals_table(store: Store, seeds: Sequence[int]) -> Table:
    """Measure the rules of others on all scenes: means over the scenes."""
    scenes = [measure_rivals(store, seed) for seed in seeds]
    rows: dict[str, Figures] = {}
    for rule in RULES:
        columns = {name: [scene[rule][name] for scene in scenes] for name in scenes[0][rule]}
        means = {name: float(np.mean(column)) for name, column in columns.items()}
        rows[rule] = {"ciede2000": means.pop("ciede2000"), "ciede2000_median": float(np.median(columns["ciede2000"]))}
        rows[rule] = {**rows[rule], **means}
    return Table("rule", rows)
