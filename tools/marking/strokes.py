"""What strokes of correction are worth: the masks of held-out views before, after one stroke an object, and after two.

    python -m tools.marking.strokes PROJECT --truth DIR [--choose worst] [--threads 1] [--json FILE]

PROJECT is learned; DIR has `labels/` as the demo has them, or true masks as <object>[/<split>]/<photo stem>.png. A stroke
is drawn as a hand would where the masks are worst among training views: a short line in the largest error that is wide
enough to be hit with a brush, "this is it" or "this is not". An object without such an error gets none. With
`--choose suggested` it is drawn in the view that the engine suggests, with `random` in any. The ceiling is
what the surface can show: every training view is corrected in all of its pixels. Where the ceiling contradicts a view's
truth, the truth of the other views does, and no stroke is drawn, but with `--any-error`. A stroke that agrees with the
masks, in each object, shows what solving again does by itself.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import imageio.v3 as iio
import numpy as np
from scipy.ndimage import distance_transform_edt, label

from karf_engine.capture.capture import Capture, View
from karf_engine.fields.files import load_scene
from karf_engine.files import write_json
from karf_engine.images import read_mask, resize
from karf_engine.metrics.masks import iou, iou_border_excluded
from karf_engine.progress import Progress
from karf_engine.project import Project
from karf_engine.project.contents import capture_of, settings_for
from karf_engine.runtime import start_runtime
from karf_engine.segmentation.coarse_masks import find_masks
from karf_engine.segmentation.correcting import Correcting
from karf_engine.segmentation.corrections import find_corrections

BRUSH, LENGTH = 0.02, 0.15  # of the picture's long side: the brush's radius, the stroke's length
NARROW = 2.0  # pixels from the middle of an error to its border: less is no error that a hand would correct
STROKES = 2
Truth = Callable[[View, str], np.ndarray | None]


@dataclass(frozen=True)
class Scene:
    """A learned scene with its truth.

    Attributes:
        truth: the mask of a view and an object at the working size, None if unknown.
    """

    capture: Capture
    correcting: Correcting
    learned: list[View]
    judged: list[View]
    truth: Truth


def main() -> None:
    options = parse_arguments()
    start_runtime(0, options.threads, "cpu")
    project = Project(options.project)
    capture, settings = capture_of(project), settings_for(project, "segmentation")
    field = load_scene(project.geometry_file).field
    start = time.perf_counter()
    masks, progress = find_masks(project.masks_folder, capture), Progress(lambda *_, **__: None, lambda: False, "", 1)
    correcting = Correcting(field, capture, masks, (), settings, progress)
    print(f"looked at and labelled in {time.perf_counter() - start:.1f} s", flush=True)
    truth = truth_in(options.truth, settings.geometry.long_side)
    known = [view for view in capture.views if any(truth(view, name) is not None for name in correcting.objects)]
    learned = [view for view in known if view.split == "train"][:: options.every]
    scene = Scene(capture, correcting, learned, [view for view in known if view.split == "test"], truth)
    random = np.random.default_rng(options.seed)
    top, shown = ceiling(scene)
    if options.any_error:
        shown = truth
    rows = {"before": scores(scene), "agreeing": agreeing(scene)}
    rows |= play(scene, lambda: candidates(scene, options.choose, random), shown) | {"ceiling": top}
    for name, row in rows.items():
        print(f"{name:10} {json.dumps(row)}")
    if options.json:
        write_json(options.json, rows)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("project", type=Path)
    parser.add_argument("--truth", type=Path, required=True)
    parser.add_argument(
        "--choose", choices=("worst", "suggested", "random"), default="worst", help="the view to stroke"
    )
    parser.add_argument("--seed", type=int, default=0, help="of random views")
    parser.add_argument("--every", type=int, default=1, help="look for errors in every so many-th training view")
    parser.add_argument("--any-error", action="store_true", help="correct what the truth of other views denies, too")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--json", type=Path, help="write the figures there")
    return parser.parse_args()


def truth_in(folder: Path, long_side: int) -> Truth:
    """The true masks below a folder, by view and object."""
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


def candidates(scene: Scene, choose: str, random: np.random.Generator) -> list[View]:
    """The views that the next strokes may be drawn in; all of them where the worst is looked for."""
    if choose == "worst":
        return scene.learned
    known = {view.name: view for view in scene.learned}
    suggested = [known[name] for name in scene.correcting.suggestions() if name in known]
    return suggested[:1] if choose == "suggested" else [scene.learned[random.integers(len(scene.learned))]]


def play(scene: Scene, choose: Callable[[], list[View]], shown: Truth) -> dict[str, dict]:
    """Figures after each stroke an object. choose: the views that a stroke may be drawn in. shown: as in `draw_stroke`."""
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        for number in range(1, STROKES + 1):
            views = choose()
            for name in scene.correcting.objects:
                draw_stroke(scene, views, name, shown, Path(folder))
            seconds = solve(scene, Path(folder))
            rows[f"stroke {number}"] = scores(scene) | {"seconds": seconds}
            print(f"stroke {number}: {json.dumps(rows[f'stroke {number}'])}", flush=True)
    return rows


def solve(scene: Scene, folder: Path) -> float:
    """Heed the corrections in a folder; seconds of the processor, the masks of one view included."""
    start = time.process_time()
    scene.correcting.correct(find_corrections(folder, scene.capture))
    scene.correcting.masks(scene.judged[0])
    return round(time.process_time() - start, 2)


def agreeing(scene: Scene) -> dict[str, float]:
    """Figures after a stroke in each object that says what the masks show already."""
    with tempfile.TemporaryDirectory() as folder:
        for name in scene.correcting.objects:
            right = {
                view.name: largest(scene.correcting.masks(view)[name] & true)
                for view in scene.learned
                if (true := scene.truth(view, name)) is not None
            }
            view = max(right, key=lambda view: right[view].sum())
            add_to(Path(folder) / name / f"{view}.png", stroke_in(right[view]), True)
        solve(scene, Path(folder))
    found = scores(scene)
    scene.correcting.correct(())
    return found


def ceiling(scene: Scene) -> tuple[dict[str, float], Truth]:
    """Figures once all pixels of the training views are corrected, and the masks that these then show."""
    with tempfile.TemporaryDirectory() as folder:
        for view in scene.learned:
            for name in scene.correcting.objects:
                mask = scene.truth(view, name)
                if mask is not None:
                    add_to(Path(folder) / name / f"{view.name}.png", mask, True)
                    add_to(Path(folder) / name / f"{view.name}.png", ~mask, False)
        solve(scene, Path(folder))
    found, masks = scores(scene), {view.name: scene.correcting.masks(view) for view in scene.learned}
    scene.correcting.correct(())
    return found, lambda view, name: masks[view.name][name]


def scores(scene: Scene) -> dict[str, float]:
    """Mean IoU of each object over the held-out views that show it, the mean of these, and that without borders."""
    values: dict[str, list[tuple[float, float]]] = {name: [] for name in scene.correcting.objects}
    for view in scene.judged:
        found = scene.correcting.masks(view)
        for name, own in values.items():
            true = scene.truth(view, name)
            if true is not None and true.any():
                own.append((iou(found[name], true), iou_border_excluded(found[name], true)))
    means = {name: np.mean(own, 0) for name, own in values.items()}
    mean, inside = np.mean(list(means.values()), 0)
    all_means = {name: own[0] for name, own in means.items()} | {"mean": mean, "border left out": inside}
    return {name: round(float(value), 4) for name, value in all_means.items()}


def draw_stroke(scene: Scene, views: list[View], name: str, shown: Truth, folder: Path) -> None:
    """Add a stroke to an object's corrections, in the view of these where its mask is worst and a stroke can be drawn.

    shown: the masks that must agree with the truth where a stroke is drawn.
    """
    worst = None
    for view in views:
        true, found = scene.truth(view, name), scene.correcting.masks(view)[name]
        if true is None or not true.any():
            continue
        certain = true == shown(view, name)
        missing, too_much = largest(certain & true & ~found), largest(certain & found & ~true)
        is_it = missing.sum() >= too_much.sum()
        error = missing if is_it else too_much
        if depth(error).max() >= NARROW and (worst is None or iou(found, true) < worst[0]):
            worst = iou(found, true), view, error, is_it
    if worst is None:
        print(f"  {name}: no error that a brush would hit")
        return
    value, view, error, is_it = worst
    drawn = stroke_in(error)
    print(
        f"  {name}: {view.name}, IoU {value:.3f}, {'is' if is_it else 'is not'}, {drawn.sum()} of {error.sum()} pixels"
    )
    add_to(folder / name / f"{view.name}.png", drawn, is_it)


def largest(error: np.ndarray) -> np.ndarray:
    """The largest connected part of a mask."""
    parts, count = label(error)
    return parts == 1 + np.bincount(parts.ravel())[1:].argmax() if count else error


def depth(mask: np.ndarray) -> np.ndarray:
    """Pixels from each place in a mask to its border, which the picture's is too."""
    return distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]


def stroke_in(error: np.ndarray) -> np.ndarray:
    """A short straight line from the middle of an error, as far as a brush stays inside it."""
    inside, long_side = depth(error), max(error.shape)
    middle = np.array(np.unravel_index(inside.argmax(), error.shape))
    radius = min(BRUSH * long_side, 0.8 * inside[tuple(middle)])
    ends = np.argwhere(inside >= 0.9 * radius)
    ends = ends[np.linalg.norm(ends - middle, axis=1) <= LENGTH / 2 * long_side]
    best = max(
        (path for path in (_line(middle, end) for end in ends) if (inside[path] >= 0.9 * radius).all()), key=_length
    )
    away = np.ones(error.shape, bool)
    away[best] = False
    return error & (distance_transform_edt(away) <= radius - 0.5)


def _line(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    steps = np.linspace(0, 1, int(abs(end - start).max()) + 1)[:, None]
    return tuple(np.round(start + steps * (end - start)).astype(int).T)


def _length(path: tuple[np.ndarray, np.ndarray]) -> float:
    return float(np.hypot(path[0][-1] - path[0][0], path[1][-1] - path[1][0]))


def add_to(path: Path, drawn: np.ndarray, is_it: bool) -> None:
    """Draw into a correction's file, which is made if needed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    picture = iio.imread(path)[..., [0, -1]] if path.exists() else np.zeros((*drawn.shape, 2), np.uint8)
    picture[drawn] = 255 * is_it, 255
    iio.imwrite(path, picture)


if __name__ == "__main__":
    main()
