"""Whether splats know what no photo shows: scenes learned from photos of one side, and looked at from all.

    .venv/engine/bin/python -m tools.judging.unseen CAPTURES [SCENE ...] --out OUT [--cone 70] [--threads N]

Of each capture geometry and splats are learned by the preset `demo` from the training photos whose cameras stand within so
many degrees of the first one, as seen from what they look at. All other photos then are views from beyond, whose truth is
known. A pixel is *unseen* where `Frame.seen` is under a half, and *wrong* where it is more than 20 CIEDE2000 from the photo.
Prints a table, and writes OUT/<scene>.png: photos of four views, as learned, and as faded.

Of views within the cone and beyond it:
    views       how many
    unseen      share of the pixels that is unseen
    told        share of the wrong pixels that is unseen
    in vain     share of the pixels that are nearer than 10 to the photo and unseen all the same
    seen, not   median CIEDE2000 to the photo of what is seen, and of what is unseen
    seconds     that a picture of 1280 pixels takes, with and without fading
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import Capture, View
from karf_engine.capture.training_images import load_views
from karf_engine.compute.progress import TerminalEmit
from karf_engine.fields.extent import focus_point
from karf_engine.io.color import ciede2000, srgb_to_lab, to_bytes
from karf_engine.io.images import alpha_composite, write_png
from karf_engine.project import Project

WRONG, RIGHT = 20.0, 10.0
SHEET = 4
COLUMNS = ("views", "unseen", "told", "in vain", "seen", "not")


def main() -> None:
    options = parse_arguments()
    print(f"| capture | | {' | '.join(COLUMNS)} | seconds |")
    print("|---|---|" + "---|" * (len(COLUMNS) + 1))
    for scene in options.scenes or sorted(path.name for path in options.captures.iterdir() if path.is_dir()):
        judge(options, scene)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", type=Path, help="folder of the captures' folders")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--cone", type=float, default=70, help="degrees about the first camera (default: %(default)s)")
    parser.add_argument("--preset", default="demo", help="default: %(default)s")
    parser.add_argument("--holdout", type=int, default=0, help="hold out every Nth photo where none is declared")
    parser.add_argument("--threads", type=int, default=1)
    return parser.parse_intermixed_args()


def judge(options: argparse.Namespace, scene: str) -> None:
    """Learn a scene from one side and print its rows."""
    capture = karf.open_capture(options.captures / scene, holdout=options.holdout)
    is_near = within(capture, np.radians(options.cone))
    known = [view for view, near in zip(capture.views, is_near, strict=True) if near and view.split == "train"]
    project = options.out / scene
    given = {"project": project, "threads": options.threads, "emit": TerminalEmit()}
    if not Project(project).splats_file.exists():
        karf.learn_geometry(replace(capture, views=tuple(known)), preset=options.preset, **given)
        karf.learn_splats(project, threads=options.threads)
    names = {view.name for view in known}
    others = {
        "within": [view for view, near in zip(capture.views, is_near, strict=True) if near and view.name not in names],
        "beyond": [view for view, near in zip(capture.views, is_near, strict=True) if not near],
    }
    if not all(others.values()):
        print(
            f"| {scene} | not judged: {' or '.join(place for place, views in others.items() if not views)} is no view |"
        )
        return
    model, rows = karf.load(project), []
    for place, views in others.items():
        pixels = [looked_at(model, view) for view in views]
        figures = [
            f"{len(views)}",
            *(f"{value:.3f}" for value in figures_of(*map(np.concatenate, zip(*pixels, strict=True)))),
        ]
        print(f"| {scene} | {place} | {' | '.join(figures)} | {seconds(model, views[0])} |", flush=True)
        rows += [sheet_row(model, view) for view in views[:: -(-len(views) // (SHEET // 2))]]
    write_png(options.out / f"{scene}.png", to_bytes(np.concatenate(rows)))


def within(capture: Capture, angle: float) -> np.ndarray:
    """Which views [n] stand within an angle, radians, of the first training view, about what the cameras look at."""
    focus = focus_point([view.camera for view in capture.views]).numpy()
    directions = np.stack([view.camera.position - focus for view in capture.views])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    first = next(number for number, view in enumerate(capture.views) if view.split == "train")
    return directions @ directions[first] >= np.cos(angle)


def looked_at(model: karf.Model, view: View) -> tuple[np.ndarray, np.ndarray]:
    """Of each pixel of a view, CIEDE2000 of what was learned to its photo, and how well it is seen."""
    photo, camera = photo_of(model, view)
    model.splatted.fade_unseen = False
    frame = model.render(camera)
    return ciede2000(srgb_to_lab(frame.base), srgb_to_lab(photo)).ravel(), frame.visibility.ravel()


def photo_of(model: karf.Model, view: View) -> tuple[np.ndarray, Camera]:
    """A view's photo at the working size, [H, W, 3], and its camera."""
    image = load_views([view], model.settings.geometry.long_side)[0]
    return alpha_composite(image.color, image.alpha), image.camera


def figures_of(errors: np.ndarray, seen: np.ndarray) -> list[float]:
    """All columns but the first and the last one, of pixels."""
    wrong, right, unseen = errors > WRONG, errors < RIGHT, seen < 0.5
    told, in_vain = ((some & unseen).sum() / max(some.sum(), 1) for some in (wrong, right))
    medians = [float(np.median(errors[some])) if some.any() else np.nan for some in (~unseen, unseen)]
    return [unseen.mean(), told, in_vain, *medians]


def seconds(model: karf.Model, view: View) -> str:
    """What a picture takes at 1280 pixels, as faded and as learned, the median of nine each."""
    camera, taken = (
        view.camera.scaled(1280, round(1280 * view.camera.height / view.camera.width)),
        {True: [], False: []},
    )
    for turn in range(18):
        model.splatted.fade_unseen = turn % 2 == 0
        start = time.perf_counter()
        model.render(camera)
        taken[model.splatted.fade_unseen].append(time.perf_counter() - start)
    return ", ".join(f"{np.median(taken[fades]):.3f}" for fades in (True, False))


def sheet_row(model: karf.Model, view: View) -> np.ndarray:
    """A view's photo, as it was learned, and as it fades, side by side."""
    photo, camera = photo_of(model, view)
    pictures = [photo]
    for fades in (False, True):
        model.splatted.fade_unseen = fades
        pictures.append(model.render(camera).base)
    return np.concatenate(pictures, 1)


if __name__ == "__main__":
    main()
