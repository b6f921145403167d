"""The rules of others on the same work: OUT/rivals.json.

    python -m tools.experiments.rivals CAPTURES JUDGED [SCENE ...] --out OUT [--threads N] [--known] [--page]

CAPTURES/<scene> is laid out like the demo, with true recolors, and JUDGED/<scene>/project is what
`tools/scenes/judge_scenes.py` learned of it. All rules have that geometry, the rough masks of coarse_masks/one, and one
color pair an object, read in the reference view. Only held-out test views count. A rule that OUT/<scene>.json has
already is not measured again. --page also writes docs/results/rivals.json and the page that is made of it.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.compute.runtime import start_runtime
from karf_engine.io.files import write_json

from ...judging.scores import rounded
from ...judging.truth import Truth
from .. import page
from ..stamp import stamp
from ..table import Table, show
from .measuring import N_RULES, Figures, measure

ABOUT = (
    "Rules that others recolor and segment by, rebuilt from their papers on our own field (`tools/experiments/rivals/`): "
    "re-implementations of a rule, not the authors' programs, on surface samples of a frozen field. Scenes: {scenes}, "
    "which chance has drawn; no setting of these rules was chosen on them, but on 000 and 005. "
    "All rules have the same geometry, one rough mask of each object, as many palette colors, and one color pair an "
    "object, read in one training view and solved by the same solver; the interpolation alone knows that view's whole "
    "true recolor. Rules of layers recolor in our field's masks; rows below *no edit* are our recoloring in the masks "
    "of others. Over the scenes, of means over edits or objects and test views: CIEDE2000 inside the true masks, IoU of "
    "the masks that are used, in percent, MSE to the photo outside the true masks, and processor seconds to learn the "
    "rule and recolor all test views; of ours, what its stages of palette and recoloring noted."
)
COLUMNS = (
    ("rule", ""),
    ("mean CIEDE2000", ".2f"),
    ("median CIEDE2000", ".2f"),
    ("mean IoU", ".1f"),
    ("MSE outside", ".1e"),
    ("seconds", ".0f"),
)


def main() -> None:
    options = parse_arguments()
    start_runtime(0, options.threads)
    scenes = {}
    for scene in options.scenes or sorted(path.parent.parent.name for path in options.judged.glob("*/project/")):
        scenes[scene] = of_scene(scene, options)
    table = as_table(scenes)
    write_json(options.out / "rivals.json", rounded({"scenes": scenes, "rows": over_scenes(scenes)}))
    show("rivals", table)
    if options.page:
        command = "python -m tools.experiments.rivals CAPTURES JUDGED --out OUT --page"
        seconds = sum(figures["seconds"] for scene in scenes.values() for figures in scene.values())
        page.write_table("rivals", table.as_json(stamp(command, "demo", (), options.threads, seconds)))


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path)
    parser.add_argument("judged", type=Path)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all that are learned")
    parser.add_argument("--out", type=Path, required=True, help="folder for everything written")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--known", action="store_true", help="measure nothing; show what OUT has")
    parser.add_argument("--page", action="store_true", help="also write docs/results/rivals.json")
    return parser.parse_args()


def of_scene(scene: str, options: argparse.Namespace) -> dict[str, Figures]:
    """The figures of each rule, as measured now or before."""
    path = options.out / f"{scene}.json"
    figures = json.loads(path.read_text()) if path.exists() else {}
    if len(figures) < N_RULES and not options.known:
        model, truth = karf.load(options.judged / scene / "project"), Truth(options.captures / scene)
        for rule, measured in measure(model, truth, options.out / "scratch", options.threads, set(figures)):
            figures[rule] = rounded(measured)
            write_json(path, figures)
            print(f"{scene}: {rule}: {figures[rule]}", flush=True)
    return figures


def over_scenes(scenes: dict[str, dict[str, Figures]]) -> dict[str, dict[str, float | None]]:
    """Of each rule that all scenes have been measured by, the figures of its row."""
    rows = {}
    for rule in [rule for rule in next(iter(scenes.values())) if all(rule in figures for figures in scenes.values())]:
        columns = {key: [figures[rule][key] for figures in scenes.values()] for key in Figures.__annotations__}
        rows[rule] = {key: float(np.mean(column)) if None not in column else None for key, column in columns.items()}
        rows[rule]["median"] = float(np.median(columns["ciede2000"]))
    return rows


def as_table(scenes: dict[str, dict[str, Figures]]) -> Table:
    """A row a rule."""
    rows = []
    for rule, mean in over_scenes(scenes).items():
        percent = None if mean["iou"] is None else 100 * mean["iou"]
        rows.append([rule, mean["ciede2000"], mean["median"], percent, mean["mse_outside"], mean["seconds"]])
    about = ABOUT.format(scenes=", ".join(scenes))
    return Table("The rules of others on the same work", about, COLUMNS, rows)


if __name__ == "__main__":
    main()
