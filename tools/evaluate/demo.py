"""The demo capture, learned once, and learned in other ways on its geometry: what the paper's tables are measured on."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.heads.rendering import ObjectSamples, object_samples
from karf_engine.palettes.compositing import stack_palettes
from karf_engine.palettes.project_edit import solve
from karf_engine.recolor.field_rendering import weights_of_field
from karf_engine.recolor.model import Model

from ..metrics.truth import DEMO, Truth
from .store import Store
from .views import TestViews, learn_again, matted, render_test_views, with_model

ONE, THREE = DEMO / "coarse_masks" / "one", DEMO / "coarse_masks" / "three"
PLAIN = "segmentation.labels=masks"  # Eq. 12 on the masks as they are
MLP_HEADS = ("segmentation.head=mlp", "recoloring.head=mlp")
LEARNED = ("segmentation", "palette", "recoloring")
F_W = "recoloring.iterations=250"  # the preset leaves F_w out


class Demo:
    """The demo as learned in the default way and in others; each is made when it is first asked for."""

    def __init__(self, store: Store) -> None:
        self.truth = Truth()
        self.threads = store.threads
        store.folder.mkdir(parents=True, exist_ok=True)
        self._temporary = tempfile.TemporaryDirectory(prefix="scratch_", dir=store.folder)
        self.scratch = Path(self._temporary.name)

        def learn(folder: Path) -> dict[str, float]:
            project, run = folder / "project", {"threads": store.threads}
            stages: dict[str, Callable[[], object]] = {
                "geometry": lambda: karf.learn_geometry(DEMO, project=project, overrides=[F_W], **run),
                "segmentation": lambda: karf.segment(project, ONE, **run),
                "palette": lambda: karf.extract_palettes(project, **run),
                "recoloring": lambda: karf.learn_recoloring(project, **run),
                "splats": lambda: karf.learn_splats(project, **run),
            }
            return {name: processor_seconds(stage) for name, stage in stages.items()}

        self.seconds: dict[str, float] = store.take("demo", learn)
        self.model = karf.load(store.path("demo") / "project")

    @cache  # noqa: B019 (one instance a process)
    def ours(self) -> TestViews:
        """Return the test views as learned in the default way, in the field's masks."""
        return render_test_views(self.model)

    @cache  # noqa: B019
    def shipped(self) -> TestViews:
        """Return the test photos as the render stage recolors them: in mattes, with weights from the photo's colors."""
        # in a copy without kept mattes: their modules have to run to be sources of what is measured
        copy = self.scratch / "shipped"
        shutil.copytree(self.model.project.folder, copy, ignore=shutil.ignore_patterns("looks"))
        test = self.ours()
        return matted(TestViews(karf.load(copy), test.training_images, test.frames))

    @cache  # noqa: B019
    def learned(self, overrides: tuple[str, ...], masks: Path = ONE, weights_from: str = "photo") -> TestViews:
        """Return the test views with everything after geometry learned in another way."""
        folder = self.scratch / f"{len(list(self.scratch.glob('*'))):03d}"
        model = learn_again(self.model, folder, overrides, LEARNED, masks, self.threads)
        return with_model(self.ours(), model, weights_from)

    @cache  # noqa: B019
    def ceiling(self) -> TestViews:
        """Return the test views segmented from the true masks of all training views."""
        masks = self.truth.write_training_masks(self.scratch / "true_masks")
        return self.learned(("segmentation.labels=votes",), masks)

    @cache  # noqa: B019
    def samples(self) -> list[ObjectSamples]:
        """Return where F_w is evaluated in each test view."""
        return samples_of(self.ours())

    def ablation(self, overrides: tuple[str, ...], seed: int = 0) -> TestViews:
        """Return the test views with palette and F_w learned in another way on the same segmentation."""
        return ablation(self.ours(), self.samples(), self.scratch / "ablation", overrides, seed, self.threads)

    def photos(self) -> list[np.ndarray]:
        """Return the test photos."""
        return [frame.base for frame in self.ours().frames]

    def pairs(self, edit: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return the color pair of each object of an edit, as an eyedropper reads it in the reference view."""
        return {name: self.truth.color_pair(edit, name) for name in self.truth.edits[edit]["objects"]}

    def edited(self, model: Model, edit: str) -> np.ndarray:
        """Return the palettes [K, M, 3] of a model with which the edit's color pairs come true."""
        colors = {palette.name: palette.colors for palette in model.palettes}
        for palette in model.palettes:
            if palette.name in self.truth.edits[edit]["objects"]:
                pair = self.truth.color_pair(edit, palette.name)
                colors[palette.name] = solve(model.project, palette, *pair, "becomes")
        return stack_palettes(model.objects, colors)


def processor_seconds(work: Callable[[], object]) -> float:
    """Return the processor seconds that some work takes."""
    start = time.process_time()
    work()
    return time.process_time() - start


def samples_of(test: TestViews) -> list[ObjectSamples]:
    """Return where F_w is evaluated in each test view: the same for all that share a geometry and a segmentation."""
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
    """Return the test views with palette and weights that are learned in another way on the same segmentation.

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
