"""A learned scene whose true masks are known: labelled, corrected, and judged in its held-out views."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import imageio.v3 as iio
import numpy as np

from karf_engine.capture.capture import Capture, View
from karf_engine.compute.progress import Progress
from karf_engine.fields.files import load_scene
from karf_engine.io.images import read_mask, resize
from karf_engine.metrics.masks import iou, iou_border_excluded
from karf_engine.project import Project
from karf_engine.project.contents import read_capture, settings_for
from karf_engine.segmentation.coarse_masks import find_masks
from karf_engine.segmentation.corrections import find_corrections
from karf_engine.segmentation.labels import CorrectionSession

Masks = dict[str, np.ndarray]
Truth = Callable[[View, str], np.ndarray | None]


@dataclass(frozen=True)
class Scene:
    """A learned scene with its truth.

    Attributes:
        truth: the mask of a view and an object at the working size, None if unknown.
    """

    capture: Capture
    correcting: CorrectionSession
    learned: list[View]
    judged: list[View]
    truth: Truth


def scene_of(project: Project, truth_folder: Path, every: int) -> Scene:
    """Label the surface of a project as its masks have it.

    Args:
        project: learned.
        truth_folder: see `truth_in`.
        every: look at every so many-th training view.
    """
    capture, settings = read_capture(project), settings_for(project, "segmentation")
    field = load_scene(project.geometry_file).field
    start = time.perf_counter()
    masks, progress = find_masks(project.masks_folder, capture), Progress(lambda *_, **__: None, lambda: False, "", 1)
    correcting = CorrectionSession(field, capture, masks, (), settings, progress)
    print(f"looked at and labelled in {time.perf_counter() - start:.1f} s", flush=True)
    truth = truth_in(truth_folder, settings.geometry.long_side)
    known = [view for view in capture.views if any(truth(view, name) is not None for name in correcting.objects)]
    learned_from = [view for view in known if view.split == "train"][::every]
    return Scene(capture, correcting, learned_from, [view for view in known if view.split == "test"], truth)


def truth_in(folder: Path, long_side: int) -> Truth:
    """The true masks below a folder, by view and object: `labels/` as the demo has them, or <object>[/<split>]/<photo stem>.png."""
    names = folder / "labels" / "names.json"
    numbers = json.loads(names.read_text()) if names.is_file() else None

    def mask(view: View, name: str) -> np.ndarray | None:
        if numbers:
            path = folder / "labels" / view.split / f"{view.stem}.png"
            found = iio.imread(path, mode="P") == numbers[name] if path.is_file() else None
        else:
            places = (folder / name / view.split / f"{view.stem}.png", folder / name / f"{view.stem}.png")
            found = next((read_mask(path) for path in places if path.is_file()), None)
        working = view.camera.reduced(long_side)
        return None if found is None else resize(found.astype(np.float32), working.width, working.height) >= 0.5

    return mask


def solve(scene: Scene, folder: Path) -> float:
    """Heed the corrections in a folder; seconds of the processor, the masks of one view included."""
    start = time.process_time()
    scene.correcting.correct(find_corrections(folder, scene.capture))
    scene.correcting.masks(scene.judged[0])
    return round(time.process_time() - start, 2)


def scores_after(scene: Scene, folder: Path) -> dict[str, float]:
    """Figures with the corrections in a folder, which are forgotten again."""
    solve(scene, folder)
    found = scores(scene)
    scene.correcting.correct(())
    return found


def scores(scene: Scene) -> dict[str, float]:
    """Figures of the labels as they are."""
    return scores_of(scene, scene.correcting.masks)


def scores_of(scene: Scene, masks_of: Callable[[View], Masks]) -> dict[str, float]:
    """Mean IoU of each object over the held-out views that show it, the mean of these, and that without borders."""
    values: dict[str, list[tuple[float, float]]] = {name: [] for name in scene.correcting.objects}
    for view in scene.judged:
        found = masks_of(view)
        for name, own in values.items():
            true = scene.truth(view, name)
            if true is not None and true.any():
                own.append((iou(found[name], true), iou_border_excluded(found[name], true)))
    means = {name: np.mean(own, 0) for name, own in values.items() if own}
    mean, inside = np.mean(list(means.values()), 0)
    all_means = {name: own[0] for name, own in means.items()} | {"mean": mean, "border left out": inside}
    return {name: round(float(value), 4) for name, value in all_means.items()}


def add_to(path: Path, drawn: np.ndarray, is_it: bool) -> None:
    """Draw into a correction's file, which is made if needed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    picture = iio.imread(path)[..., [0, -1]] if path.exists() else np.zeros((*drawn.shape, 2), np.uint8)
    picture[drawn] = 255 * is_it, 255
    iio.imwrite(path, picture)
