"""How near learned projects come to the truth of their test views."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from karf_engine.project import Project

from ..metrics.scores import PaletteScore, score_masks, score_palettes, score_pictures
from .views import TestViews


def stage_summary(project: Project) -> dict:
    """What each stage measured of itself: seconds and peak memory, bytes."""
    stages = project.state()["stages"]
    return {
        "stage_seconds": {name: entry["seconds"] for name, entry in stages.items()},
        "peak_memory": max(entry["peak_memory"] for entry in stages.values()),
    }


def score_renders(test: TestViews) -> dict[str, float]:
    """How near the learned scene is to the photos, plainly and color-corrected."""
    scores = score_pictures([frame.color for frame in test.frames], [f.base for f in test.frames])
    names = {"psnr": "psnr_full", "worst": "psnr_full_worst", "ssim": "ssim_full"}
    names |= {"corrected": "cc_psnr_full", "corrected_worst": "cc_psnr_full_worst"}
    return {names[key]: value for key, value in scores.items()}


def score_objects(test: TestViews, truth: dict[str, list[np.ndarray]], suffix: str = "") -> dict[str, dict[str, float]]:
    """All of `MaskScore` for each object, and its means; suffix ends the keys."""
    scores = {name: asdict(score_masks(test.masks(name), truth[name])) for name in test.model.objects}
    table = {}
    for key, title in (
        ("iou", "iou"),
        ("iou_border_excluded", "iou_border_excluded"),
        ("worst", "iou_worst_view"),
        ("pooled", "iou_pooled"),
        ("accuracy", "accuracy"),
    ):
        column = {name: score[key] for name, score in scores.items()}
        table[title + suffix] = column | {"mean": float(np.mean(list(column.values())))}
    return table


def score_palettes_of(test: TestViews, truth: dict[str, list[np.ndarray]]) -> PaletteScore:
    """How well the learned palettes with the frames' weights show the objects; truth: masks, object by object."""
    masks = [np.stack(views) for views in zip(*(truth[name] for name in test.model.objects), strict=True)]
    weights = [frame.palette_weights for frame in test.frames]
    probabilities = [frame.probabilities for frame in test.frames]
    return score_palettes(weights, probabilities, test.model.learned_colors, [f.base for f in test.frames], masks)


def rounded(value):
    """Five significant digits: more would pretend to precision."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    return float(f"{value:.5g}") if isinstance(value, float) else value


def print_common(summary: dict) -> None:
    """Print what both judges know: the render and the masks."""
    print(f"render             {summary['psnr_full']} dB (worst view {summary['psnr_full_worst']})")
    print(f"color-corrected    {summary['cc_psnr_full']} dB (worst view {summary['cc_psnr_full_worst']})")
    for key in [key for key in summary if key.startswith("iou")]:
        print(f"{key:36} " + "  ".join(f"{name} {value:.3f}" for name, value in summary[key].items()))
