"""What the tables are measured on: the demo, learned once, and learned in other ways on its geometry."""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.compute.progress import TerminalEmit
from karf_engine.heads.rendering import ObjectSamples, object_samples
from karf_engine.palettes.compositing import stack_palettes
from karf_engine.palettes.project_edit import solve
from karf_engine.recolor.field_rendering import weights_of_field
from karf_engine.recolor.model import Model

from ..judging.truth import DEMO, Truth
from ..judging.views import TestViews, learn_again, render_test_views, with_model

ONE, THREE = DEMO / "coarse_masks" / "one", DEMO / "coarse_masks" / "three"
PLAIN = "segmentation.labels=masks"  # Eq. 12 on the masks as they are
MLP_HEADS = ("segmentation.head=mlp", "recoloring.head=mlp")
LEARNED = ("segmentation", "palette", "recoloring")
ITERATIONS = {  # of F_w, by preset: those that leave it out
    preset: f"recoloring.iterations={count}" for preset, count in {"demo": 250, "fast": 1000, "fine": 1000}.items()
}


class Bench:
    """The demo, learned, and learned in other ways; everything is made when it is first asked for."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.truth = Truth()
        self.seeds = options.seeds
        self.threads = options.threads
        self._out = options.out.absolute()
        shutil.rmtree(self._out / "scratch", ignore_errors=True)
        self.model = karf.learn(
            DEMO,
            ONE,
            project=self._out / "project",
            preset=options.preset,
            overrides=[*filter(None, [ITERATIONS.get(options.preset)]), *options.overrides],
            threads=options.threads,
            emit=TerminalEmit(),
        )

    def folder(self, name: str) -> Path:
        """A folder for what is made on the way."""
        return self._out / name

    @cache  # noqa: B019 (one instance a run)
    def ours(self) -> TestViews:
        """The test views as learned in the default way."""
        return render_test_views(self.model)

    @cache  # noqa: B019
    def learned(self, overrides: tuple[str, ...], masks: Path = ONE, weights_from: str = "photo") -> TestViews:
        """Everything after geometry, learned in another way."""
        folder = self._out / "scratch" / f"{len(list((self._out / 'scratch').glob('*'))):03d}"
        model = learn_again(self.model, folder, overrides, LEARNED, masks, self.threads)
        return with_model(self.ours(), model, weights_from)

    @cache  # noqa: B019
    def ceiling(self) -> TestViews:
        """Segmentation from the true masks of all training views."""
        masks = self.truth.write_training_masks(self.folder("true_masks"))
        return self.learned(("segmentation.labels=votes",), masks)

    @cache  # noqa: B019
    def samples(self) -> list[ObjectSamples]:
        """Where F_w is asked in each test view."""
        return samples_of(self.ours())

    def ablation(self, overrides: tuple[str, ...], seed: int) -> TestViews:
        """Palette and weights, learned in another way on the same segmentation."""
        return ablation(self.ours(), self.samples(), self._out / "ablation", overrides, seed, self.threads)

    def photos(self) -> list[np.ndarray]:
        """The test photos."""
        return [frame.base for frame in self.ours().frames]

    def pairs(self, edit: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """The color pair of each object of an edit, as an eyedropper reads it in the reference view."""
        return {name: self.truth.color_pair(edit, name) for name in self.truth.edits[edit]["objects"]}

    def edited(self, model: Model, edit: str) -> np.ndarray:
        """The palettes [K, M, 3] of a model with which the edit's color pairs come true."""
        colors = {palette.name: palette.colors for palette in model.palettes}
        for palette in model.palettes:
            if palette.name in self.truth.edits[edit]["objects"]:
                pair = self.truth.color_pair(edit, palette.name)
                colors[palette.name] = solve(model.project, palette, *pair, "becomes")
        return stack_palettes(model.objects, colors)


def samples_of(test: TestViews) -> list[ObjectSamples]:
    """Where F_w is asked in each test view: the same for all that share a geometry and a segmentation."""
    model = test.model
    return [object_samples(model.segmentation, model.scene.field, frame.picture.cache) for frame in test.frames]


def ablation(
    test: TestViews,
    samples: Sequence[ObjectSamples],
    folder: Path,
    overrides: tuple[str, ...],
    seed: int,
    threads: int | None,
) -> TestViews:
    """The test views with palette and weights that are learned in another way on the same segmentation.

    Args:
        test: as learned in the default way.
        samples: see `samples_of`.
        folder: of the scratch project, emptied before.
        overrides: settings as `stage.field=value`.
        seed: of this learning.
        threads: processor threads.
    """
    stages = LEARNED[1:] if any(text.startswith("palette.") for text in overrides) else LEARNED[2:]
    model = learn_again(test.model, folder, (*overrides, f"seed={seed}"), stages, threads=threads)
    frames = [
        replace(frame, palette_weights=weights_of_field(model, frame.picture, own))
        for frame, own in zip(test.frames, samples, strict=True)
    ]
    return TestViews(model, test.training_images, frames)
