"""Recolored print on packaging: how near letters come to the truth, whether metal and paper stay, what flips between views.

    .venv/engine/bin/python -m tools.judging.packaging CAPTURE PROJECT [--edits EDIT ...] [--sheet FILE.png] [--causes]

CAPTURE tells which pixels of its test views are colored print, and PROJECT was learned of it. Each edit is told in four
ways by one color pair an object, read in one training photo (`Truth.color_pair`): `becomes`; a plain drag of the swatch,
whose paint follows it; *Protect Neutrals* of that swatch; and a color that is added where the first one is picked. The recolored test photos, at their own size, are
compared with the true recolors. The sheet shows of each edit the worst view of `becomes`: photo, ours, the truth.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import astuple, dataclass, fields
from functools import partial
from pathlib import Path

import numpy as np
from scipy.ndimage import distance_transform_edt
from skimage.color import deltaE_ciede2000

import karf_engine as karf
from karf_engine.capture.training_images import read_photo_of_view
from karf_engine.io.color import srgb_to_lab
from karf_engine.palettes.added import pigment_of_swatch, propose_added_color
from karf_engine.palettes.color_histogram import read_object_colors
from karf_engine.palettes.matching.paints import repainted
from karf_engine.palettes.palette import PROTECT, Edit
from karf_engine.recolor.model import Model
from tools.metrics.consistency import DepthView, match_by_depth
from tools.metrics.scores import MIN_PIXELS

from .causes import split_in
from .drags import edit_by, swatch_of, with_dragged_material
from .sheets import write_sheet
from .truth import Truth

WHOLE = 254 / 255  # share of a pixel from which on it is wholly of one kind
RIM = 2.0  # pixels on either side of a letter's border
TELLS = 10.0  # CIEDE2000 between photo and true recolor from which on it can be told which of them a letter shows


@dataclass(frozen=True)
class Regions:
    """Pixels of the edited objects in one view, bool [H, W] each.

    Attributes:
        letters: Wholly colored print.
        rims: Within 2 pixels of a letter's border, and all small print whose strokes fill no pixel.
        neutrals: Wholly something else: metal, foil, paper, dark print.
        printed: Mostly colored print: letters, the inner half of their rims, and most of the small print.
    """

    letters: np.ndarray
    rims: np.ndarray
    neutrals: np.ndarray
    printed: np.ndarray


@dataclass(frozen=True)
class PrintScore:
    """How one edit comes out.

    Attributes:
        letters: Mean CIEDE2000 to the true recolor, mean over views; so also rims and neutrals.
        rims: See `Regions`.
        neutrals: See `Regions`.
        left: Share of the print's pixels that are nearer to the photo than to the true recolor.
        flips: Share of the print's points that two neighboring test views show, one of them recolored and one left.
    """

    letters: float
    rims: float
    neutrals: float
    left: float
    flips: float


def regions_of(letters: np.ndarray, neutrals: np.ndarray, inside: np.ndarray) -> Regions:
    """What is judged of a view, from shares [H, W] of colored print and of all else, in the objects' mask [H, W].

    Examples:
        A stroke 9 pixels wide, of which the outer ones are mixed, on silver:

        >>> letters = np.zeros((1, 21))
        >>> letters[0, 6:15], letters[0, [6, 14]] = 1, 0.6
        >>> found = regions_of(letters, 1 - letters, np.ones((1, 21), bool))
        >>> [np.flatnonzero(each).tolist() for each in (found.letters, found.rims)]
        [[7, 8, 9, 10, 11, 12, 13], [4, 5, 6, 7, 13, 14, 15, 16]]
    """
    shown = inside & (letters + neutrals >= WHOLE)
    mostly = letters > 0.5
    near = np.zeros(mostly.shape, bool)
    if mostly.any():
        # to the middle of the nearest pixel of the other kind; the border is half a pixel nearer
        near = np.where(mostly, distance_transform_edt(mostly), distance_transform_edt(~mostly)) <= RIM + 0.5
    mixed = (letters > 1 - WHOLE) & (letters < WHOLE)
    return Regions(shown & (letters >= WHOLE), shown & (near | mixed), shown & (neutrals >= WHOLE), shown & mostly)


def is_recolored(ours: np.ndarray, photo: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which pixels of `ours` [H, W, 3] are nearer to the true recolor than to the photo, and where that can be told."""
    tells = differences(photo, true) >= TELLS
    return differences(ours, true) < differences(ours, photo), tells


def differences(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """CIEDE2000 [H, W] of two sRGB pictures [H, W, 3]."""
    return deltaE_ciede2000(srgb_to_lab(first), srgb_to_lab(second))


def flips(recolored: list[np.ndarray], views: list[DepthView]) -> float:
    """Share of surface points that two neighboring views show in different states; NaN where they share none.

    Args:
        recolored: The state of each pixel of each view, bool [H, W].
        views: In the order in which they are neighbors; their masks say which pixels count.
    """
    different = []
    for number in range(len(views) - 1):
        shared = match_by_depth(views[number], views[number + 1])
        columns, rows = np.floor(shared.positions).astype(int).T
        different.append(recolored[number].ravel()[shared.pixels] != recolored[number + 1][rows, columns])
    points = np.concatenate(different) if different else np.zeros(0)
    return float(points.mean()) if len(points) else float("nan")


class Judge:
    """The test views of a capture, as they are compared with."""

    def __init__(self, model: Model, truth: Truth) -> None:
        self.model, self.truth = model, truth
        self.views = model.capture.split("test")
        self.photos = [read_photo_of_view(view) for view in self.views]

    def recolored(self, edit: Edit) -> list[np.ndarray]:
        """The test photos with an edit, [H, W, 3] each."""
        return [self.model.recolor(view, edit) for view in self.views]

    def regions(self, name: str) -> list[Regions]:
        """What is judged of each test view."""
        shares = (self.truth.printed(kind) for kind in ("letters", "neutrals"))
        return [regions_of(*each) for each in zip(*shares, self.truth.inside(name), strict=True)]

    def score(self, name: str, pictures: list[np.ndarray]) -> PrintScore:
        """How the pictures [H, W, 3] of all test views come out as this edit."""
        regions, true = self.regions(name), self.truth.recolored(name)
        off = [differences(*pair) for pair in zip(pictures, true, strict=True)]
        states = [is_recolored(*each) for each in zip(pictures, self.photos, true, strict=True)]
        told = [region.printed & tells for region, (_, tells) in zip(regions, states, strict=True)]
        depths = self.truth.depths()
        views = [DepthView(view.camera, *each) for view, *each in zip(self.views, depths, told, strict=True)]
        done = [state for state, _ in states]
        return PrintScore(
            *(mean_over(off, [getattr(each, kind) for each in regions]) for kind in ("letters", "rims", "neutrals")),
            left=mean_over([~state for state in done], told),
            flips=flips(done, views),
        )


def mean_over(values: list[np.ndarray], masks: list[np.ndarray]) -> float:
    """Mean over views of the mean in each view's mask; views with too few pixels do not count."""
    found = [value[mask].mean() for value, mask in zip(values, masks, strict=True) if mask.sum() >= MIN_PIXELS]
    return float(np.mean(found)) if found else float("nan")


def becomes(model: Model, truth: Truth, name: str) -> Edit:
    """The edit by *becomes*."""
    edit = model.edit()
    for key in truth.edits[name]["objects"]:
        edit = edit.becomes(key, *truth.color_pair(name, key))
    return edit


def drag(model: Model, truth: Truth, name: str) -> Edit:
    """The edit by a drag of one swatch of each object."""
    return edit_by(model, truth, name, with_dragged_material)


def added(model: Model, truth: Truth, name: str, of_swatch: bool = False) -> Edit:
    """The edit by a color of its own for each object's print, with the reach that the object's colors propose.

    of_swatch: the color that the swatch paints most, in the place of the pair's first one.
    """
    edit = model.edit()
    for key in truth.edits[name]["objects"]:
        source, target = truth.color_pair(name, key)
        seen = read_object_colors(model.project.object_colors_file, key)
        picked = source
        if of_swatch:
            palette = next(palette.colors for palette in model.palettes if palette.name == key)
            picked = pigment_of_swatch(seen, swatch_of(seen, palette, source))
        color = propose_added_color(seen, picked)
        protect = PROTECT if of_swatch else color.protect
        wanted = repainted(picked[None], source, target)[0]
        edit = edit.add_color(key, picked, wanted, color.reach, protect)
    return edit


WAYS: dict[str, Callable[[Model, Truth, str], Edit]] = {
    "becomes": becomes,
    "drag": drag,
    "protected swatch": partial(added, of_swatch=True),
    "added color": added,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path, help="with the truth of its print, laid out like `packaging`")
    parser.add_argument("project", type=Path, help="learned of it")
    parser.add_argument("--edits", nargs="+", metavar="EDIT", help="default: all of the capture")
    parser.add_argument(
        "--causes", action="store_true", help="what the letters lack, split by cause (tools.judging.causes)"
    )
    parser.add_argument("--sheet", type=Path, metavar="FILE.png", help="write each edit's worst view there")
    options = parser.parse_args()
    if not (options.capture / "print").is_dir():
        parser.error(f"{options.capture} does not tell its print; packaging and packaging_b of make_captures do")
    judge = Judge(karf.load(options.project), Truth(options.capture))
    rows = []
    print_row("", "", [field.name for field in fields(PrintScore)])
    for name in options.edits or judge.truth.edits:
        print_row(name, "no edit", judge.score(name, judge.photos))
        for way, edit_of in WAYS.items():
            edit = edit_of(judge.model, judge.truth, name)
            pictures = judge.recolored(edit)
            print_row(name, way, judge.score(name, pictures))
            if options.causes:
                print_causes(judge, name, edit, pictures)
            if way == "becomes":
                rows.append(worst_row(judge, name, pictures))
    if options.sheet:
        write_sheet(options.sheet, rows)


def print_causes(judge: Judge, name: str, edit: Edit, pictures: list[np.ndarray]) -> None:
    """Print what lies between each object's letters and their true recolor."""
    letters = [region.letters for region in judge.regions(name)]
    split = split_in(judge.model, judge.truth, judge.photos, pictures, edit, name, letters)
    for key, causes in split.items():
        print(
            f"{key:>18} {'causes':>16} ", *(f"{cause} {value:.2f}" for cause, value in vars(causes).items()), flush=True
        )


def worst_row(judge: Judge, name: str, pictures: list[np.ndarray]) -> list[np.ndarray]:
    """Photo, ours and the truth of the view whose letters are farthest from the truth."""
    true = judge.truth.recolored(name)
    off = [
        differences(ours, wanted)[region.letters].mean() if region.letters.any() else 0.0
        for ours, wanted, region in zip(pictures, true, judge.regions(name), strict=True)
    ]
    worst = int(np.argmax(off))
    return [judge.photos[worst], pictures[worst], true[worst]]


def print_row(edit: str, way: str, cells) -> None:
    """Print one line of the table."""
    if isinstance(cells, PrintScore):
        cells = [f"{value:.2f}" for value in astuple(cells)[:3]] + [f"{value:.1%}" for value in astuple(cells)[3:]]
    print(f"{edit:>18} {way:>16} " + " ".join(f"{cell:>9}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
