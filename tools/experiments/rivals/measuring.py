"""All rules on one scene: what they reach, and how long they take."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypedDict

import numpy as np

from karf_engine.io.images import alpha_composite
from karf_engine.palettes.compositing import hard_masks
from karf_engine.recolor.field_rendering import frame_of
from karf_engine.recolor.model import Model
from tools.metrics.scores import score_masks, score_recolor

from ...judging.truth import Truth
from ...judging.views import TestViews
from .laenerf import LaeNerf
from .palettenerf import PaletteNerf
from .recoloring import Recolor, Recoloring
from .recolornerf import RecolorNerf
from .segmenting import Masks, Segmenting

N_RULES = 13  # rows of the table
SAMPLES = 8  # a ray, as F_w has in new views
Way = Callable[[], tuple[Recolor, Masks | None]]  # learns; the masks are those that it recolors in, None for true ones


class Figures(TypedDict):
    """Of one rule on one scene: means over edits, objects and test views; IoU in [0, 1] or None, processor seconds."""

    ciede2000: float
    iou: float | None
    mse_outside: float
    seconds: float


def measure(
    model: Model, truth: Truth, scratch: Path, threads: int | None, known: set[str]
) -> Iterator[tuple[str, Figures]]:
    """The figures of each rule that is not known yet, with its name in the table.

    Args:
        model: Learned of the capture with the rough masks of coarse_masks/one.
        truth: Of the capture.
        scratch: A folder for projects that are learned in other ways.
        threads: Processor threads.
        known: Names of rules that have been measured.
    """
    shutil.rmtree(
        model.project.render_cache_folder, ignore_errors=True
    )  # mattes kept from before would cost no seconds
    recoloring = Recoloring(rendered(model), truth)
    ways = {**recolor_ways(recoloring), **segmentation_ways(recoloring, scratch, threads)}
    stages = model.project.state()["stages"]
    noted = dict.fromkeys(list(ways)[:2], stages["palette"]["seconds"] + stages["recoloring"]["seconds"])
    for name, way in ways.items():
        if name not in known:
            yield name, figures(recoloring, way, noted.get(name, 0.0))


def rendered(model: Model) -> TestViews:
    """The test views by the field, with our palette weights of the photos' colors."""
    images = [model.training_image(view) for view in model.capture.split("test")]
    frames = []
    for image in images:
        picture = model.scene.render(image.camera, SAMPLES)
        frames.append(frame_of(model, picture, alpha_composite(image.color, image.alpha), False))
    return TestViews(model, images, frames)


def recolor_ways(recoloring: Recoloring) -> dict[str, Way]:
    """Rules that recolor; those that need masks have our field's, but ours with mattes and the rules of true masks."""
    field = [frame.probabilities for frame in recoloring.test.frames]
    return {
        "**ours**: delta on the photo, mattes": recoloring.mattes,
        "ours, the field's masks instead of mattes": lambda: (recoloring.ours(recoloring.test.frames), field),
        "PaletteNeRF's rule": lambda: (recoloring.layers(PaletteNerf), field),
        "RecolorNeRF's layers": lambda: (recoloring.layers(RecolorNerf), field),
        "LAENeRF's rule": lambda: (recoloring.layers(LaeNerf), field),
        "hue rotation in the true masks": lambda: (recoloring.hue(), None),
        "gains of channels in the true masks": lambda: (recoloring.gains(), None),
        "interpolation: a photo's true recolor, carried over by depth": lambda: (recoloring.warped(), field),
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
        "SA3D's inverse rendering, the given mask alone": by(lambda segmenting: segmenting.sa3d(False)),
        "SA3D, further views prompted by GrabCut": by(lambda segmenting: segmenting.sa3d(True)),
        "LUDVIG's graph diffusion": by(lambda segmenting: segmenting.ludvig()),
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
    return Figures(
        ciede2000=float(np.mean([score.ciede2000 for score in scores])),
        iou=None if masks is None else mean_iou(masks, recoloring.test.model.objects, truth),
        mse_outside=float(np.mean([score.mse_outside for score in scores])),
        seconds=seconds,
    )


def mean_iou(masks: Masks, objects: list[str], truth: Truth) -> float:
    """Mean over objects of probabilities [K, H, W] of each test view."""
    hard, true = [hard_masks(each) for each in masks], truth.masks("test")
    scores = [score_masks([each[k] for each in hard], true[name]) for k, name in enumerate(objects)]
    return float(np.mean([score.iou for score in scores]))
