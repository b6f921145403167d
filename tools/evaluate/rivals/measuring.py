"""All rules on one scene: what they reach, and how long they take."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.io.images import alpha_composite
from karf_engine.palettes.compositing import hard_masks
from karf_engine.recolor.field_rendering import frame_of
from karf_engine.recolor.model import Model

from ...metrics.scores import score_masks, score_recolor
from ...metrics.truth import Truth
from ..drawn import draw_scene, judge_scene, scene_name
from ..store import Store
from ..table import Figures, Table
from ..views import TestViews
from .laenerf import LaeNerf
from .palettenerf import PaletteNerf
from .recoloring import Recolor, Recoloring
from .recolornerf import RecolorNerf
from .segmenting import Masks, Segmenting

OURS, OURS_IN_FIELD = "**ours**: delta on the photo, mattes", "ours, the field's masks instead of mattes"
RULES = (
    OURS,
    OURS_IN_FIELD,
    "PaletteNeRF's rule",
    "RecolorNeRF's layers",
    "LAENeRF's rule",
    "hue rotation in the true masks",
    "gains of channels in the true masks",
    "a photo's true recolor, carried over by depth",
    "no edit",
    "SA3D's inverse rendering, further views prompted by GrabCut",
    "plain cross-entropy on the rough masks (Eq. 12)",
)
SAMPLES = 8  # a ray, as F_w has in new views
Way = Callable[[], tuple[Recolor, Masks | None]]  # learns; the masks are those that it recolors in, None for true ones


def measure(model: Model, truth: Truth, scratch: Path, threads: int | None) -> Iterator[tuple[str, Figures]]:
    """Yield each rule's name and figures: means over edits, objects and test views, processor seconds.

    Args:
        model: learned of the capture with the rough masks of coarse_masks/one.
        truth: of the capture.
        scratch: a folder for projects that are learned in other ways.
        threads: processor threads.
    """
    # mattes kept from before would cost no seconds
    shutil.rmtree(model.project.render_cache_folder, ignore_errors=True)
    recoloring = Recoloring(rendered(model), truth)
    ways = recolor_ways(recoloring) | segmentation_ways(recoloring, scratch, threads)
    extracting = model.project.state()["stages"]["palette"]["seconds"]
    for name in RULES:
        yield name, figures(recoloring, ways[name], extracting if name in RULES[:2] else 0.0)


def rendered(model: Model) -> TestViews:
    """The test views by the field, with our palette weights of the photos' colors."""
    images = [model.training_image(view) for view in model.capture.split("test")]
    frames = []
    for image in images:
        picture = model.scene.render(image.camera, SAMPLES)
        frames.append(frame_of(model, picture, alpha_composite(image.color, image.alpha), False))
    return TestViews(model, images, frames)


def recolor_ways(recoloring: Recoloring) -> dict[str, Way]:
    """Return rules that recolor: in our field's masks, but ours with mattes and the rules of true masks."""
    field = [frame.probabilities for frame in recoloring.test.frames]
    return {
        OURS: recoloring.mattes,
        OURS_IN_FIELD: lambda: (recoloring.ours(recoloring.test.frames), field),
        "PaletteNeRF's rule": lambda: (recoloring.layers(PaletteNerf), field),
        "RecolorNeRF's layers": lambda: (recoloring.layers(RecolorNerf), field),
        "LAENeRF's rule": lambda: (recoloring.layers(LaeNerf), field),
        "hue rotation in the true masks": lambda: (recoloring.hue(), None),
        "gains of channels in the true masks": lambda: (recoloring.gains(), None),
        "a photo's true recolor, carried over by depth": lambda: (recoloring.warped(), field),
        "no edit": lambda: (recoloring.unedited(), None),
    }


def segmentation_ways(recoloring: Recoloring, scratch: Path, threads: int | None) -> dict[str, Way]:
    """Rules that segment from the rough masks, and our recoloring in what they find."""
    test, truth = recoloring.test, recoloring.truth
    rough = truth.folder / "coarse_masks" / "one"

    def by(find: Callable[[Segmenting], Masks]) -> Way:
        def way() -> tuple[Recolor, Masks]:
            masks = find(Segmenting(test, rough))
            return recoloring.in_masks(masks), masks

        return way

    return {
        "SA3D's inverse rendering, further views prompted by GrabCut": by(lambda segmenting: segmenting.sa3d()),
        "plain cross-entropy on the rough masks (Eq. 12)": by(lambda segmenting: segmenting.plain(scratch, threads)),
    }


def figures(recoloring: Recoloring, way: Way, noted: float) -> Figures:
    """What a way reaches; noted: seconds that it has taken before."""
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
        return dict(measure(model, Truth(draw_scene(store, seed)), folder / "scratch", store.threads))

    return store.take(f"{scene_name(seed)}/rivals", measured)


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
