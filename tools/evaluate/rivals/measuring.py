"""All rules on one scene: what they reach, and how long they take."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.io.images import alpha_composite
from karf_engine.palettes.compositing import hard_masks
from karf_engine.recolor.field_rendering import frame_of
from karf_engine.recolor.model import Model

from ...metrics.scores import score_masks, score_recolor
from ...metrics.truth import Truth
from ..drawn import draw_scene, judge_scene
from ..jobs import scene_name
from ..store import Store
from ..table import Figures, Table
from ..views import TestViews, learn_again, with_model
from .laenerf import LaeNerf
from .palettenerf import PaletteNerf
from .recoloring import Recolor, Recoloring
from .recolornerf import RecolorNerf

OURS, OURS_IN_FIELD = "**ours**: delta on the photo, mattes", "ours, the field's masks instead of mattes"
SAMPLES = 8  # a ray, as F_w has in new views
Masks = list[np.ndarray]  # of each view, probabilities [K, H, W]
Way = Callable[[], tuple[Recolor, Masks | None]]  # learns; the masks are those that it recolors in, None for true ones


def measure(model: Model, truth: Truth, scratch: Path, threads: int | None) -> dict[str, Figures]:
    """Return the figures of each rule: means over edits, objects and test views, processor seconds.

    Args:
        model: learned of the capture with the rough masks of coarse_masks/one.
        truth: of the capture.
        scratch: a folder for a project that is learned in another way.
        threads: processor threads.
    """
    # mattes kept from before would cost no seconds
    shutil.rmtree(model.project.render_cache_folder, ignore_errors=True)
    recoloring = Recoloring(rendered(model), truth)
    extracting = dict.fromkeys((OURS, OURS_IN_FIELD), model.project.state()["stages"]["palette"]["seconds"])
    ways = ways_of(recoloring, scratch, threads)
    return {name: figures(recoloring, way, extracting.get(name, 0.0)) for name, way in ways.items()}


def rendered(model: Model) -> TestViews:
    """The test views by the field, with our palette weights of the photos' colors."""
    images = [model.training_image(view) for view in model.capture.split("test")]
    frames = []
    for image in images:
        picture = model.scene.render(image.camera, SAMPLES)
        frames.append(frame_of(model, picture, alpha_composite(image.color, image.alpha), False))
    return TestViews(model, images, frames)


def ways_of(recoloring: Recoloring, scratch: Path, threads: int | None) -> dict[str, Way]:
    """Return the rules by their names; those of others recolor in our field's masks or in the true ones."""
    field = [frame.probabilities for frame in recoloring.test.frames]

    def plain() -> tuple[Recolor, Masks]:
        rough = recoloring.truth.folder / "coarse_masks" / "one"
        test = recoloring.test
        model = learn_again(test.model, scratch, ["segmentation.labels=masks"], ("segmentation",), rough, threads)
        masks = [frame.probabilities for frame in with_model(test, model, "photo").frames]
        return recoloring.in_masks(masks), masks

    return {
        OURS: recoloring.mattes,
        OURS_IN_FIELD: lambda: (recoloring.ours(recoloring.test.frames), field),
        "PaletteNeRF's rule": lambda: (recoloring.layers(PaletteNerf), field),
        "RecolorNeRF's layers": lambda: (recoloring.layers(RecolorNerf), field),
        "LAENeRF's rule": lambda: (recoloring.layers(LaeNerf), field),
        "hue rotation in the true masks": lambda: (recoloring.hue(), None),
        "gains of channels in the true masks": lambda: (recoloring.gains(), None),
        "a photo's true recolor, carried over by depth": lambda: (recoloring.warped(), field),
        "ours in masks of plain cross-entropy (Eq. 12)": plain,
        "no edit": lambda: (recoloring.unedited(), None),
    }


def figures(recoloring: Recoloring, way: Way, noted: float) -> Figures:
    """Return the figures of a way; noted: seconds that it has taken before."""
    truth, frames = recoloring.truth, recoloring.test.frames
    start = time.process_time()
    recolor, masks = way()
    pictures = {edit: recolor(edit) for edit in truth.edits}
    seconds = time.process_time() - start + noted
    photos = [frame.base for frame in frames]
    scores = [
        score_recolor(views, truth.recolored(edit), photos, truth.inside(edit)) for edit, views in pictures.items()
    ]
    iou = None if masks is None else 100 * mean_iou(masks, recoloring.test.model.objects, truth)
    return {
        "ciede2000": float(np.mean([score.ciede2000 for score in scores])),
        **({} if iou is None else {"iou": iou}),
        "mse_outside": float(np.mean([score.mse_outside for score in scores])),
        "seconds": seconds,
    }


def mean_iou(masks: Masks, objects: list[str], truth: Truth) -> float:
    """Mean over objects of probabilities [K, H, W] of each test view."""
    hard, true = [hard_masks(each) for each in masks], truth.masks("test")
    scores = [score_masks([each[k] for each in hard], true[name]) for k, name in enumerate(objects)]
    return float(np.mean([score.iou for score in scores]))


def measure_rivals(store: Store, seed: int) -> dict[str, Figures]:
    """Return the figures of each rule on a scene, measured unless they are there."""

    def measured(folder: Path) -> dict[str, Figures]:
        judge_scene(store, seed)
        model = karf.load(store.path(f"{scene_name(seed)}/learned") / "project")
        return measure(model, Truth(draw_scene(store, seed)), folder / "scratch", store.threads)

    return store.take(f"{scene_name(seed)}/rivals", measured)


def rivals_table(store: Store, seeds: Sequence[int]) -> Table:
    """Measure the rules of others on all scenes: means over the scenes."""
    scenes = [measure_rivals(store, seed) for seed in seeds]
    rows: dict[str, Figures] = {}
    for rule in scenes[0]:
        columns = {name: [scene[rule][name] for scene in scenes] for name in scenes[0][rule]}
        means = {name: float(np.mean(column)) for name, column in columns.items()}
        rows[rule] = {"ciede2000": means.pop("ciede2000"), "ciede2000_median": float(np.median(columns["ciede2000"]))}
        rows[rule] = {**rows[rule], **means}
    return Table("rule", rows)
