"""Recolors by plain drags: one swatch of each object is dragged, and nothing else is touched.

    .venv/engine/bin/python -m tools.judging.drags CAPTURES PROJECTS [SCENE ...]

CAPTURES/<scene> is laid out like the demo, and PROJECTS/<scene>/project is what was learned of it. The simulated hand drags
the swatch that has most of the picked color (of those of its hue) until this color has become the wanted one, which it reads
in one training view, as `becomes` does. Mean CIEDE2000 of the recolored test photos inside the edited objects' true masks.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import karf_engine as karf
from karf_engine.errors import BadRequest
from karf_engine.io.color import srgb_to_lab
from karf_engine.metrics.images import mean_ciede2000
from karf_engine.palettes.color_histogram import ColorHistogram, read_object_colors
from karf_engine.palettes.matching.becomes import match_becomes, match_dragged, mean_weights
from karf_engine.palettes.matching.paints import pigment_gate, repainted
from karf_engine.palettes.palette import MAX_SRGB, Edit
from karf_engine.recolor.model import Model
from tools.metrics.scores import MIN_PIXELS

from .truth import Truth

# of what is seen of an object, its palette, the number of the swatch and its color: the palette then
Drag = Callable[[ColorHistogram, np.ndarray, int, np.ndarray], np.ndarray]


def alone(seen: ColorHistogram, palette: np.ndarray, index: int, color: np.ndarray) -> np.ndarray:
    """The palette [M, 3] in which a swatch has a color and all others stay."""
    result = palette.copy()
    result[index] = color
    return result


def with_material(seen: ColorHistogram, palette: np.ndarray, index: int, color: np.ndarray) -> np.ndarray:
    """The palette [M, 3] in which a swatch has a color and its paint follows."""
    return match_dragged(*seen, palette, index, color)


def swatch_of(seen: ColorHistogram, palette: np.ndarray, color: np.ndarray) -> int:
    """The number of the swatch that has most of a color, of those of its hue."""
    share = mean_weights(*seen, color) * pigment_gate(palette, color)
    share[0] = 0  # black cannot be dragged
    return int(share.argmax())


def dragged(seen: ColorHistogram, palette: np.ndarray, pair: tuple[np.ndarray, np.ndarray], drag: Drag) -> np.ndarray:
    """The palette [M, 3] after a drag that makes the first color of a pair the second."""
    source, target = pair
    own, index = mean_weights(*seen, source), swatch_of(seen, palette, source)

    def at(color: np.ndarray) -> np.ndarray:
        return drag(seen, palette, index, np.clip(color, 0, MAX_SRGB).astype(np.float32))

    def distance(color: np.ndarray) -> float:
        reached = np.clip(source + own @ (at(color) - palette), 0, 1)
        return float(np.linalg.norm(srgb_to_lab(reached) - srgb_to_lab(target)))

    start = repainted(palette[index][None], source, target)[0]
    return at(minimize(distance, start, method="Nelder-Mead", options={"maxfev": 300}).x)


def becomes(seen: ColorHistogram, palette: np.ndarray, pair: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The palette [M, 3] by one color pair."""
    return match_becomes(*seen, palette, *pair)


def with_dragged_material(seen: ColorHistogram, palette: np.ndarray, pair: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The palette [M, 3] after such a drag of one swatch, whose paint follows."""
    return dragged(seen, palette, pair, with_material)


WAYS = {
    "one swatch alone": lambda *given: dragged(*given, alone),
    "one swatch, its paint follows": with_dragged_material,
    "becomes": becomes,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path)
    parser.add_argument("projects", type=Path)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all that are learned")
    options = parser.parse_args()
    scenes = options.scenes or sorted(path.parent.name for path in options.projects.glob("*/project/"))
    rows = {
        scene: judge(karf.load(options.projects / scene / "project"), Truth(options.captures / scene))
        for scene in scenes
    }
    print(" ".join(f"{title:>30}" for title in ["", *WAYS]))
    for scene, row in (rows | {"mean": np.mean(list(rows.values()), 0)}).items():
        print(" ".join([f"{scene:>30}", *(f"{value:>30.2f}" for value in row)]))


def judge(model: Model, truth: Truth) -> list[float]:
    """Mean CIEDE2000 over the edits of a capture, in each way."""
    return [
        float(np.mean([distance(model, truth, name, palette_of) for name in truth.edits]))
        for palette_of in WAYS.values()
    ]


def distance(model: Model, truth: Truth, name: str, palette_of: Callable) -> float:
    """Mean CIEDE2000 of one edit of the test photos, over those that show its objects."""
    edit, found = edit_by(model, truth, name, palette_of), []
    for view, true, inside in zip(model.capture.split("test"), truth.recolored(name), truth.inside(name), strict=True):
        if inside.sum() >= MIN_PIXELS:
            found.append(mean_ciede2000(model.recolor(view, edit, size="learned"), true, inside))
    return float(np.mean(found))


def edit_by(model: Model, truth: Truth, name: str, palette_of: Callable) -> Edit:
    """An edit of the capture, told in one of these ways by one color pair an object."""
    colors = {palette.name: palette.colors for palette in model.palettes}
    for key in truth.edits[name]["objects"]:
        seen = read_object_colors(model.project.verified(model.project.object_colors_file), key)
        try:
            colors[key] = palette_of(seen, colors[key], truth.color_pair(name, key))
        except BadRequest:  # paint that the reading shows black cannot be told: it stays
            continue
    return Edit(colors, "delta")


if __name__ == "__main__":
    main()
