"""What strokes of correction are worth: the masks of held-out views before, after one stroke an object, and after two.

    python -m tools.marking.strokes PROJECT --truth DIR [--choose worst suggested random] [--hand line along] [--look 8]
        [--json FILE]

PROJECT is learned; DIR has `labels/` as the demo has them, or true masks as <object>[/<split>]/<photo stem>.png. A stroke
is drawn as a hand would where the masks are worst among training views, in the largest error that is wide enough to be
hit with a brush, "this is it" or "this is not": a short line (`--hand line`), or along all of the error (`along`). An
object without such an error gets none. With `--choose suggested` it is drawn in the view that the engine suggests, with
`random` in any, with as many seeds as wanted. One who sees nothing to correct there looks at the next view; `--look` says
at how many in all.

The ceiling is what the surface can show: every training view is corrected in all of its pixels. Where the ceiling
contradicts a view's truth, the truth of the other views does, and no stroke is drawn, but with `--any-error`. `agreeing`
are strokes that say what the masks show, which shows what solving again does by itself; `slip` are wrong ones, a short
line in the middle of each object that says it is not there. With `--learn` F_s is learned from the uncorrected labels.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.capture.capture import View
from karf_engine.compute.runtime import start_runtime
from karf_engine.io.files import write_json
from karf_engine.metrics.masks import iou
from karf_engine.project import Project

from ..judging.views import learn_again, render_test_views
from .hand import HANDS, can_be_hit, largest_error, short_line
from .scene import Masks, Scene, Truth, add_to, scene_of, scores, scores_after, scores_of, solve

STROKES = 2
RANDOM_SEEDS = 3


@dataclass(frozen=True)
class Way:
    """How strokes are drawn.

    Attributes:
        choose: the views: `worst`, `suggested` or `random`.
        hand: one of `HANDS`.
        seed: of random views.
        look: at how many suggested or random views, one after the other, until one has an error to correct.
        shown: the masks that must agree with the truth where a stroke is drawn.
    """

    choose: str
    hand: str
    seed: int
    look: int
    shown: Truth

    def __str__(self) -> str:
        chosen = f"{self.choose} {self.seed}" if self.choose == "random" else self.choose
        return f"{chosen} {self.hand}" + (f", {self.look} views" if self.look > 1 else "")


@dataclass(frozen=True)
class ErrorToHit:
    """An error of an object's mask. view: its name. iou: of the mask. pixels: [H, W] bool. is_it: the object lacks there."""

    view: str
    iou: float
    pixels: np.ndarray
    is_it: bool


def main() -> None:
    options = parse_arguments()
    start_runtime(0, options.threads, "cpu")
    scene = scene_of(Project(options.project), options.truth, options.every)
    top, shown = ceiling(scene)
    rows = {"before": scores(scene), "agreeing": agreeing(scene), "slip": slip(scene), "ceiling": top}
    if options.learn:
        rows["learned"] = learned(options, scene)
    for name, row in rows.items():
        print(f"{name:10} {json.dumps(row)}", flush=True)
    for way in ways(options, scene.truth if options.any_error else shown):
        rows |= play(scene, way)
    if options.json:
        write_json(options.json, rows)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("project", type=Path)
    parser.add_argument("--truth", type=Path, required=True)
    views = ("worst", "suggested", "random")
    parser.add_argument("--choose", nargs="+", choices=views, default=["worst"], help="the view to stroke")
    parser.add_argument("--hand", nargs="+", choices=HANDS, default=["line"], help="how strokes are drawn")
    parser.add_argument("--seeds", type=int, default=1, help="how many times random views are drawn")
    parser.add_argument("--look", type=int, default=1, help="suggested or random views to look at for an error")
    parser.add_argument("--every", type=int, default=1, help="look for errors in every so many-th training view")
    parser.add_argument("--any-error", action="store_true", help="correct what the truth of other views denies, too")
    parser.add_argument("--learn", action="store_true", help="also learn F_s, in a scratch project")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--json", type=Path, help="write the figures there")
    return parser.parse_args()


def ways(options: argparse.Namespace, shown: Truth) -> Iterator[Way]:
    """All ways of drawing strokes that are asked for."""
    for choose, hand in product(options.choose, options.hand):
        for seed in range(options.seeds if choose == "random" else 1):
            yield Way(choose, hand, seed, options.look, shown)


def iou_after_marks(project: Path, truth: Path, choices: Sequence[str]) -> tuple[float, dict[str, list[float]]]:
    """Mean IoU of the labels in the held-out views of a learned scene.

    Args:
        project: learned from rough masks.
        truth: folder of the true masks.
        choices: of the views, see `Way`; the mean of `RANDOM_SEEDS` draws where they are random.

    Returns:
        As learned; and of each choice after one stroke an object, and after two.
    """
    scene = scene_of(Project(project), truth, 1)
    _, shown = ceiling(scene)
    before, after = scores(scene)["mean"], {}
    for choose in choices:
        seeds = range(RANDOM_SEEDS if choose == "random" else 1)
        played = [play(scene, Way(choose, "line", seed, 1, shown)) for seed in seeds]
        after[choose] = np.mean([[row["mean"] for row in rows.values()] for rows in played], 0).round(4).tolist()
    return before, after


def play(scene: Scene, way: Way) -> dict[str, dict]:
    """Figures after each stroke an object."""
    rows, random = {}, np.random.default_rng(way.seed)
    with tempfile.TemporaryDirectory() as folder:
        for number in range(1, STROKES + 1):
            shown = {view.name: scene.correcting.masks(view) for view in candidates(scene, way, random)}
            for name in scene.correcting.objects:
                draw_stroke(scene, shown, name, way, Path(folder))
            seconds = solve(scene, Path(folder))
            row = rows[f"{way}, stroke {number}"] = scores(scene) | {"seconds": seconds}
            print(f"{way}, stroke {number}: {json.dumps(row)}", flush=True)
    scene.correcting.correct(())
    return rows


def candidates(scene: Scene, way: Way, random: np.random.Generator) -> list[View]:
    """The views that the next strokes may be drawn in, in order; all of them where the worst is looked for."""
    if way.choose == "worst":
        return scene.learned
    if way.choose == "random":
        return [scene.learned[random.integers(len(scene.learned))] for _ in range(way.look)]
    known = {view.name: view for view in scene.learned}
    suggested = [known[name] for name in scene.correcting.suggestions().scores if name in known]
    return suggested[: way.look]


def draw_stroke(scene: Scene, shown: dict[str, Masks], name: str, way: Way, folder: Path) -> None:
    """Add a stroke to an object's corrections: in the first view that shows an error that a brush would hit, or the worst.

    shown: the objects' masks in the views that may be chosen, in the order in which they are looked at.
    """
    errors = errors_to_hit(scene, shown, name, way)
    found = min(errors, key=lambda error: error.iou, default=None) if way.choose == "worst" else next(errors, None)
    if found is None:
        print(f"  {name}: no error that a brush would hit")
        return
    drawn = HANDS[way.hand](found.pixels)
    said = "is" if found.is_it else "is not"
    print(f"  {name}: {found.view}, IoU {found.iou:.3f}, {said}, {drawn.sum()} of {found.pixels.sum()} pixels")
    add_to(folder / name / f"{found.view}.png", drawn, found.is_it)


def errors_to_hit(scene: Scene, shown: dict[str, Masks], name: str, way: Way) -> Iterator[ErrorToHit]:
    """An object's largest error in each view that shows one that a brush would hit. Arguments as of `draw_stroke`."""
    known = {view.name: view for view in scene.learned}
    for view, masks in shown.items():
        true = scene.truth(known[view], name)
        if true is None or not true.any():
            continue
        pixels, is_it = largest_error(masks[name], true, true == way.shown(known[view], name))
        if can_be_hit(pixels):
            yield ErrorToHit(view, iou(masks[name], true), pixels, is_it)


def agreeing(scene: Scene) -> dict[str, float]:
    """Figures after a stroke in each object that says what the masks show already."""
    with tempfile.TemporaryDirectory() as folder:
        for name in scene.correcting.objects:
            draw_in_middle(scene, name, True, Path(folder))
        return scores_after(scene, Path(folder))


def slip(scene: Scene) -> dict[str, float]:
    """Figures of each object after a stroke in its middle that wrongly says it is not there, and the means of these."""
    rows = {}
    for name in scene.correcting.objects:
        with tempfile.TemporaryDirectory() as folder:
            draw_in_middle(scene, name, False, Path(folder))
            rows[name] = scores_after(scene, Path(folder))
    means = {key: round(float(np.mean([row[key] for row in rows.values()])), 4) for key in ("mean", "border left out")}
    return {name: row[name] for name, row in rows.items()} | means


def draw_in_middle(scene: Scene, name: str, is_it: bool, folder: Path) -> None:
    """Draw a short line in the middle of an object, in the view that shows most of it rightly."""
    right = {
        view.name: scene.correcting.masks(view)[name] & true
        for view in scene.learned
        if (true := scene.truth(view, name)) is not None
    }
    view = max(right, key=lambda view: right[view].sum())
    add_to(folder / name / f"{view}.png", short_line(right[view]), is_it)


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


def learned(options: argparse.Namespace, scene: Scene) -> dict[str, float]:
    """Figures of F_s, learned anew from the uncorrected labels."""
    with tempfile.TemporaryDirectory() as folder:
        model = karf.load(options.project)
        model = learn_again(
            model, Path(folder), (), ("segmentation",), model.project.masks_folder, threads=options.threads
        )
        test = render_test_views(model)
    shown = [training_image.view.name for training_image in test.training_images]
    masks = {name: dict(zip(shown, test.masks(name), strict=True)) for name in model.objects}
    return scores_of(scene, lambda view: {name: own[view.name] for name, own in masks.items()})


if __name__ == "__main__":
    main()
