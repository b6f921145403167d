"""The test views of a learned project, and of the same geometry learned further in other ways."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.capture.training_images import TrainingImage
from karf_engine.compute.progress import Progress, TerminalEmit
from karf_engine.io.files import write_json
from karf_engine.project import Project
from karf_engine.project import settings as settings_module
from karf_engine.project.state import without_stage
from karf_engine.recolor.field_rendering import frame_of, photo_frame
from karf_engine.recolor.frames import Frame
from karf_engine.recolor.model import Model

from ..metrics.scores import PaletteScore, score_palettes

STAGE_FILES = {  # what is read of each
    "geometry": ("geometry_file", "capture_file"),
    "segmentation": ("segmentation_file", "surface_file", "segmentation_report", "masks_folder"),
    "palette": ("palette_file", "object_colors_file"),
    "recoloring": ("recoloring_file",),
    "splats": ("splats_file",),
}


@dataclass(frozen=True)
class TestViews:
    """The test views of a project, and what it shows there. frames: one for each training image."""

    model: Model
    training_images: list[TrainingImage]
    frames: list[Frame]

    def masks(self, object_name: str) -> list[np.ndarray]:
        """The masks of one object, view by view."""
        number = self.model.objects.index(object_name)
        return [frame.masks[number] for frame in self.frames]


def terminal_progress(name: str, total: int) -> Progress:
    """Progress of `total` steps under this name, shown in the terminal."""
    return Progress(TerminalEmit(), lambda: False, name, total)


def render_test_views(model: Model) -> TestViews:
    """Render every test view as learned; a frame's base is its photo, of a matte capture over white."""
    training_images = [model.training_image(view) for view in model.capture.split("test")]
    progress = terminal_progress("judge", len(training_images))
    frames = []
    for training_image in training_images:
        frames.append(photo_frame(model, training_image, "field"))
        progress.step()
    return TestViews(model, training_images, frames)


def matted(test: TestViews) -> TestViews:
    """Return the same views as the render stage recolors photos: in mattes, with weights from the photo's colors."""
    model, long_side = test.model, test.model.settings.geometry.long_side
    frames = [model.preview(image.view, long_side) for image in test.training_images]
    return TestViews(model, test.training_images, frames)


def learn_again(
    model: Model,
    folder: Path,
    overrides: Sequence[str],
    stages: Sequence[str],
    masks: Path | None = None,
    threads: int | None = None,
) -> Model:
    """Learn these stages in another way, in a scratch project that keeps all that does not build on them.

    Args:
        model: what is learned already.
        folder: the scratch project, emptied before.
        overrides: settings as `stage.field=value`.
        stages: names, in their order.
        masks: for segmentation; by default the project's own. With `segmentation.labels=votes` and the true masks of
            all training views, segmentation is the ceiling.
        threads: processor threads.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    scratch = Project(folder)
    state = model.project.state()
    kept = tuple(name for name in without_stage(state, stages[0])["stages"] if name != stages[0])
    for name in (name for stage in kept for name in STAGE_FILES[stage]):
        source, target = getattr(model.project, name), getattr(scratch, name)
        if source.exists():  # F_w is trained in some projects only
            (shutil.copytree if source.is_dir() else shutil.copy)(source, target)
    changed = settings_module.with_overrides(model.settings, list(overrides))
    own = "files", "folder"  # of the other project; a kept palette may be as recoloring has learned it
    done = {name: {key: value for key, value in state["stages"][name].items() if key not in own} for name in kept}
    write_json(scratch.state_file, state | {"stages": done, "settings": settings_module.to_dict(changed)})
    run = {"threads": threads, "emit": TerminalEmit()}
    learn = {
        "segmentation": lambda: karf.segment(folder, masks, **run),
        "palette": lambda: karf.extract_palettes(folder, **run),
        "recoloring": lambda: karf.learn_recoloring(folder, **run),
        "splats": lambda: karf.learn_splats(folder, **run),
    }
    for stage in stages:
        learn[stage]()
    return karf.load(folder)


def with_model(test: TestViews, model: Model, weights_from: str = "field") -> TestViews:
    """The same pictures of the same geometry, with another model's masks and palette weights.

    weights_from: F_w, where it is trained (`field`), or the colors of each frame's base (`photo`).
    """
    from_field = weights_from == "field"
    frames = [frame_of(model, each.picture, each.base, from_field, gains=each.gains) for each in test.frames]
    return TestViews(model, test.training_images, frames)


def score_palettes_of(test: TestViews, truth: dict[str, list[np.ndarray]]) -> PaletteScore:
    """Return how well the learned palettes with the frames' weights show the objects; truth: masks by object."""
    masks = [np.stack(views) for views in zip(*(truth[name] for name in test.model.objects), strict=True)]
    weights = [frame.palette_weights for frame in test.frames]
    probabilities = [frame.probabilities for frame in test.frames]
    return score_palettes(weights, probabilities, test.model.learned_colors, [f.base for f in test.frames], masks)
