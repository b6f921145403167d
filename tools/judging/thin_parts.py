"""Thin parts of marked things: what of them masks and recolored photos hold, in the marked photo and in others.

    .venv/engine/bin/python -m tools.judging.thin_parts CAPTURES LEARNED [SCENE ...] --out OUT [--every 4]

CAPTURES/<scene> tells the thin parts (`make_captures --thin-seeds`); in one that does not, they are what of the true
masks is at most a thirty-second of the photo's width wide. LEARNED/<scene> is its project, or has it in `project`.
`field` are masks of the field's probabilities, enlarged to the photo; `photo` the mattes that recolored photos are
written with. A pixel is a thin part's where that covers half of it, and is held where the object is the likeliest in the
mask. Writes OUT/thin_parts.json and of each scene crops at 100 %: photo, ours, the true recolor.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.capture.capture import View
from karf_engine.io.files import write_json
from karf_engine.recolor.full_resolution import PhotoView, make_photo_view
from karf_engine.recolor.matting.photo_mattes import make_mattes
from karf_engine.recolor.matting.thin_parts import read_marks
from karf_engine.recolor.model import Model

from .edges import beside_thin_parts
from .packaging import differences
from .recolors import edit_to_judge
from .scores import rounded
from .sheets import square_of_most, write_sheet
from .thin_truth import ThinPart, thin_part
from .truth import THIN_RAYS, Truth
from .views import project_of

WAYS = ("field", "photo")
CROP = 128  # pixels, at most
MIN_PIXELS = 20  # of a thin part in all views of a kind, to be judged there
FIGURES = {
    "marked": "marked",
    "train": "train >=2",
    "train_narrow": "train 1-2",
    "test": "test >=2",
    "test_narrow": "test 1-2",
    "precision": "precision",
    "ciede2000": "CIEDE2000",
    "no_edit": "no edit",
}


@dataclass(frozen=True)
class Counts:
    """How many pixels of thin parts there are, how many of them are held, and what is painted near them."""

    wide: int = 0
    wide_held: int = 0
    narrow: int = 0
    narrow_held: int = 0
    painted: int = 0
    painted_right: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))


def count(held: np.ndarray, inside: np.ndarray, part: ThinPart) -> Counts:
    """Count what a mask [H, W] holds of a thin part; `inside` is the object's true mask [H, W]."""
    painted = held & part.around
    return Counts(
        wide=int(part.wide.sum()),
        wide_held=int((held & part.wide).sum()),
        narrow=int(part.narrow.sum()),
        narrow_held=int((held & part.narrow).sum()),
        painted=int(painted.sum()),
        painted_right=int((painted & inside).sum()),
    )


def share(part: int, whole: int) -> float:
    """Return a share; NaN of fewer than `MIN_PIXELS`."""
    return part / whole if whole >= MIN_PIXELS else float("nan")


@dataclass(frozen=True)
class Crop:
    """A square round the most of a thin part, and how many pixels of it our photo misses there."""

    missed: int
    pictures: list[np.ndarray]


class Judge:
    """A learned project and the truth of its capture; what is found adds up view by view."""

    def __init__(self, model: Model, truth: Truth, every: int) -> None:
        self.model, self.truth, self.capture, self.every = model, truth, karf.open_capture(truth.folder), every
        self.edit_name = max(truth.edits, key=lambda name: len(truth.edits[name]["objects"]))
        self.edit = edit_to_judge(model, truth, self.edit_name)
        self.counts: dict[tuple[str, str, str], Counts] = defaultdict(Counts)  # way, object, kind of view
        self.off: dict[tuple[str, str], list[np.ndarray]] = defaultdict(list)  # way or no_edit, object
        self.crops: dict[str, list[Crop]] = defaultdict(list)  # object

    def judge(self) -> dict[str, dict[str, dict[str, float]]]:
        """Return the figures of each way, object by object and their mean."""
        for kind, number, view in self._views():
            self._judge_view(kind, number, view)
        rows = {way: {name: self._row(way, name) for name in self.model.objects} for way in WAYS}
        return {way: found | {"mean": mean_of(found.values())} for way, found in rows.items()}

    def worst(self) -> list[list[np.ndarray]]:
        """Return each edited object's crops of the test view in which our photo misses most of its thin part."""
        return [max(found, key=lambda crop: crop.missed).pictures for found in self.crops.values()]

    def _judge_view(self, kind: str, number: int, view: View) -> None:
        parts = {
            name: self._part(view, name, number)
            for name in self.model.objects
            if kind != "marked" or self._is_marked(view, name)
        }
        ready = {way: self._ready(view, way) for way in WAYS}
        held = {way: dict(zip(self.model.objects, each.masks(), strict=True)) for way, each in ready.items()}
        for name, part in parts.items():
            inside = self.truth.coverage(name, view.split)[number] > 0.5
            for way in WAYS:
                self.counts[way, name, kind] += count(held[way][name], inside, part)
        if kind == "test":
            self._compare(number, ready, {name: part.pixels for name, part in parts.items()}, held["photo"])

    def _compare(
        self, number: int, ready: dict[str, PhotoView], thin: dict[str, np.ndarray], held: dict[str, np.ndarray]
    ) -> None:
        """Compare a recolored test view with the true recolor, in the thin parts of the edited objects."""
        true, plain = self.truth.recolored(self.edit_name)[number], next(iter(ready.values()))
        pictures = {way: each.over_white(each.recolor(self.edit)) for way, each in ready.items()}
        pictures["no_edit"] = plain.over_white(plain.photo)
        apart = {key: differences(picture, true) for key, picture in pictures.items()}
        for name in self.truth.edits[self.edit_name]["objects"]:
            for key, difference in apart.items():
                self.off[key, name].append(difference[thin[name]])
            shown = [pictures["no_edit"], pictures["photo"], true]
            self.crops[name].append(crop_of(thin[name], thin[name] & ~held[name], shown))

    def _views(self) -> Iterator[tuple[str, int, View]]:
        """The judged views: kind, place in their split, view."""
        for number, view in enumerate(self.capture.split("train")):
            is_marked = any(self._is_marked(view, name) for name in self.model.objects)
            if is_marked or number % self.every == 0:
                yield "marked" if is_marked else "train", number, view
        for number, view in enumerate(self.capture.split("test")):
            yield "test", number, view

    def _is_marked(self, view: View, name: str) -> bool:
        return self.truth.rough_mask(name, view.stem) is not None

    def _part(self, view: View, name: str, number: int) -> ThinPart:
        """The thin parts of an object in a view; in a marked one those that the rough mask covers."""
        rays = self.truth.thin_rays(name, view.split, number)
        if rays is None:
            mask = self.truth.coverage(name, view.split)[number] > 0.5
            rays = np.repeat(np.repeat(mask & beside_thin_parts(mask), THIN_RAYS, 0), THIN_RAYS, 1)
        rough = self.truth.rough_mask(name, view.stem) if view.split == "train" else None
        part = thin_part(rays)
        return part if rough is None else ThinPart(part.wide & rough, part.narrow & rough, part.around)

    def _ready(self, view: View, way: str) -> PhotoView:
        model, seen = self.model, self.model.render_field(self.model.working_camera(view))
        marks = read_marks(model.project.masks_folder, model.objects, view)
        return make_photo_view(view, "photo", seen, marks, partial(make_mattes, way), model.objects, model.palettes)

    def _row(self, way: str, name: str) -> dict[str, float]:
        """Return the figures of one object in one way."""
        marked, train, test = (self.counts[way, name, kind] for kind in ("marked", "train", "test"))
        seen = train + test
        return {
            "marked": share(marked.wide_held + marked.narrow_held, marked.wide + marked.narrow),
            "train": share(train.wide_held, train.wide),
            "train_narrow": share(train.narrow_held, train.narrow),
            "test": share(test.wide_held, test.wide),
            "test_narrow": share(test.narrow_held, test.narrow),
            "precision": share(seen.painted_right, seen.painted),
            "ciede2000": mean_difference(self.off[way, name]),
            "no_edit": mean_difference(self.off["no_edit", name]),
        }


def mean_difference(views: list[np.ndarray]) -> float:
    """Return the mean over the pixels of all views; NaN of fewer than `MIN_PIXELS`."""
    pixels = np.concatenate([np.zeros(0), *views])
    return float(pixels.mean()) if len(pixels) >= MIN_PIXELS else float("nan")


def crop_of(pixels: np.ndarray, missed: np.ndarray, pictures: list[np.ndarray]) -> Crop:
    """Return the square of pictures with the most of these pixels [H, W]."""
    here, _ = square_of_most(pixels.astype(int), CROP)
    return Crop(int(missed[here].sum()), [picture[here] for picture in pictures])


def mean_of(rows) -> dict[str, float]:
    """Return the means of figures over the rows in which there was something to judge."""
    columns = {key: np.array([row[key] for row in rows]) for key in FIGURES}
    return {key: float(np.nanmean(each)) if np.isfinite(each).any() else float("nan") for key, each in columns.items()}


def main() -> None:
    options = parse_arguments()
    scenes = options.scenes or sorted(path.name for path in options.captures.iterdir() if (path / "thin").is_dir())
    table = {}
    print_row("", FIGURES.values())
    for scene in scenes:
        model, truth = karf.load(project_of(options.learned, scene)), Truth(options.captures / scene)
        judge = Judge(model, truth, options.every)
        table[scene] = judge.judge()
        write_sheet(options.out / f"{scene}.png", judge.worst())
        for way, rows in table[scene].items():
            for name, row in rows.items():
                print_figures(f"{scene} {way} {name}", row)
    mean = {way: mean_of([rows[way]["mean"] for rows in table.values()]) for way in WAYS}
    for way, row in mean.items():
        print_figures(f"mean {way}", row)
    write_json(options.out / "thin_parts.json", rounded(without_nan({"scenes": table, "mean": mean})))


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path, help="folder of the captures")
    parser.add_argument("learned", type=Path, help="folder of their projects")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all that tell their thin parts")
    parser.add_argument("--out", type=Path, required=True, help="folder for everything written")
    parser.add_argument("--every", type=int, default=4, help="of the other training views, each such one counts")
    return parser.parse_args()


def without_nan(value):
    """Return figures without those that nothing was there to judge by."""
    if isinstance(value, dict):
        kept = {key: without_nan(item) for key, item in value.items()}
        return {key: item for key, item in kept.items() if item == item}
    return value


def print_figures(title: str, row: dict[str, float]) -> None:
    """Print the figures of one row; nothing where there was nothing to judge."""
    print_row(title, [f"{row[key]:.3g}" if np.isfinite(row[key]) else "" for key in FIGURES])


def print_row(title: str, cells) -> None:
    """Print one line of the table."""
    print(f"{title:>28} " + " ".join(f"{cell:>9}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
