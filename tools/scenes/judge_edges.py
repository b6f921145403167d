"""Judge edges in the photos' own size, ours beside simpler ways to them: OUT/edges.json, and crops of each scene.

    .venv/engine/bin/python -m tools.scenes.judge_edges CAPTURES LEARNED [SCENE ...] --out OUT [--larger LEARNED]

CAPTURES/<scene> is a capture with truth: test views at a larger size and their coverage (`make_captures --full`), or one
as it is otherwise, whose labels then stand for the coverage. LEARNED/<scene> is its project, or has it in `project`; it
may have been learned from any capture of the same views. With --larger, projects that were learned from larger photos.

Rows: `field` (the field's probabilities, enlarged: edges=field), `bicubic`, `guided` filter, `matting` alone,
`photo` (ours: edges=photo), `larger` (the field as learned from larger photos), `truth` (the
true coverage). Edits are those of the capture, from one color pair an object.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.capture.capture import View
from karf_engine.edit.palette import Edit
from karf_engine.files import write_json
from karf_engine.finishing import PhotoView
from karf_engine.matting.matte import Matte, dense_coverage
from karf_engine.metrics.images import mse_outside
from karf_engine.model import Model
from karf_engine.photos import StoredPhoto, open_photo

from ..judging.edges import BAND, EdgeScore, border_band, mean_scores, score_edges
from ..judging.matting_ways import WAYS, Evidence, larger_field
from ..judging.recolors import edit_to_judge
from ..judging.scores import rounded
from ..judging.sheets import write_sheet
from ..judging.truth import Truth

CROP = 192  # pixels, at most
TITLES = {
    "iou": "IoU",
    "iou_thin": "thin parts",
    "band_error": f"band {BAND} px",
    "ciede2000": "CIEDE2000",
    "ciede2000_band": "in the band",
    "mse_outside": "MSE outside",
    "seconds": "s a view",
}


@dataclass(frozen=True)
class Judged:
    """What one way came to in one view: scores of each object, MSE outside each edit's objects, seconds of the mattes,
    the objects' coverage [K, H, W], and the recolored picture of each edit, float sRGB."""

    objects: dict[str, EdgeScore]
    mse_outside: float
    seconds: float
    coverage: np.ndarray
    recolored: dict[str, np.ndarray]


def main() -> None:
    options = parse_arguments()
    scenes = options.scenes or sorted(path.parent.name for path in options.captures.glob("*/edits.json"))
    table = {}
    for scene in scenes:
        larger = project_of(options.larger, scene) if options.larger else None
        table[scene] = judge(options.captures / scene, project_of(options.learned, scene), larger, options)
        report(scene, table[scene])
    write_json(options.out / "edges.json", rounded({"band": BAND, "scenes": table}))
    if {"field", "photo"} <= set(options.rows):
        compare(table)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path, help="folder of the captures")
    parser.add_argument("learned", type=Path, help="folder of their projects")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all that are there")
    parser.add_argument("--out", type=Path, required=True, help="folder for everything written")
    parser.add_argument("--larger", type=Path, help="folder of projects that were learned from larger photos")
    parser.add_argument("--rows", nargs="+", choices=tuple(WAYS), default=tuple(WAYS), help="default: all")
    return parser.parse_args()


def project_of(learned: Path, scene: str) -> Path:
    """A scene's project below a folder of them."""
    inner = learned / scene / "project"
    return inner if inner.is_dir() else learned / scene


def judge(capture: Path, project: Path, larger: Path | None, options: argparse.Namespace) -> dict:
    """Judge every row in every test view of a capture, write the crops, and return the means of each row."""
    model, truth = karf.load(project), Truth(capture)
    other = karf.load(larger) if larger else None
    ways = {name: WAYS[name] for name in options.rows} | ({"larger": larger_field} if other else {})
    edits = {name: edit_to_judge(model, truth, name) for name in truth.edits}
    judged: dict[str, list[Judged]] = {name: [] for name in ways}
    crops: dict[str, list[tuple[float, list[np.ndarray]]]] = {name: [] for name in model.objects}
    for number, view in enumerate(karf.open_capture(capture).split("test")):
        photo = open_photo(view.image)
        evidence = evidence_of(view, photo, model, other, truth, number)
        of_view = {name: judge_way(photo, evidence, ways[name], model, truth, edits, number) for name in ways}
        for name, result in of_view.items():
            judged[name].append(result)
        if {"field", "photo"} <= set(ways):
            for name, crop in crops_of(evidence, of_view, model, truth, number).items():
                crops[name].append(crop)
    rows = [row for name in model.objects for _, row in sorted(crops[name], key=lambda crop: -crop[0])[:1]]
    if rows:
        write_sheet(options.out / f"{capture.name}.png", rows)
    return {name: mean_of_views(views, model.objects) for name, views in judged.items()}


def evidence_of(
    view: View, photo: StoredPhoto, model: Model, larger: Model | None, truth: Truth, number: int
) -> Evidence:
    """What all ways know of a test view."""
    seen = model.look(model.working_camera(view))
    return Evidence(
        photo=photo.shown(),
        probabilities=seen.probabilities,
        depth=seen.depth,
        larger=larger.look(larger.working_camera(view)).probabilities if larger else None,
        coverage=np.stack([truth.coverage(name)[number] for name in model.objects]),
    )


def judge_way(
    photo: StoredPhoto,
    evidence: Evidence,
    way: Callable[[Evidence], list[Matte]],
    model: Model,
    truth: Truth,
    edits: dict[str, Edit],
    number: int,
) -> Judged:
    """Make the mattes of a view in one way, recolor by them and compare with the truth."""
    start = time.process_time()
    mattes = way(evidence)
    seconds = time.process_time() - start
    coverage = dense_coverage(mattes, evidence.photo.shape[:2])
    ready = PhotoView(photo, 1, model.objects, mattes, model.palettes)
    recolored = {name: ready.shown(ready.recolored(edit)) for name, edit in edits.items()}
    scores, outside = {}, []
    for k, name in enumerate(model.objects):
        chosen = [edit for edit in edits if name in truth.edits[edit]["objects"]]
        pictures = [recolored[edit] for edit in chosen], [truth.recolored(edit)[number] for edit in chosen]
        scores[name] = score_edges(coverage[k], evidence.coverage[k], *pictures)
    for edit, picture in recolored.items():
        inside = [
            evidence.coverage[k] > 0 for k, name in enumerate(model.objects) if name in truth.edits[edit]["objects"]
        ]
        outside.append(mse_outside(picture, ready.shown(photo), np.any(inside, 0)))
    return Judged(scores, float(np.mean(outside)), seconds, coverage, recolored)


def mean_of_views(views: list[Judged], objects: list[str]) -> dict:
    """Means over the views, of each object, and over objects."""
    table = {name: mean_scores([view.objects[name] for view in views]) for name in objects}
    known = {key: [row[key] for row in table.values() if key in row] for key in EdgeScore.__dataclass_fields__}
    table["mean"] = {key: float(np.mean(values)) for key, values in known.items() if values}
    table["mean"] |= {"mse_outside": float(np.mean([view.mse_outside for view in views]))}
    table["mean"] |= {"seconds": float(np.mean([view.seconds for view in views]))}
    return table


# --------------------------------------------------------------------------------------------------------------- results
def crops_of(
    evidence: Evidence, ways: dict[str, Judged], model: Model, truth: Truth, number: int
) -> dict[str, tuple[float, list[np.ndarray]]]:
    """Of each object, where the field is most wrong near the border: how wrong, and photo, field, ours and truth there."""
    result = {}
    for k, name in enumerate(model.objects):
        edit = next(edit for edit, facts in truth.edits.items() if name in facts["objects"])
        true = evidence.coverage[k]
        wrong = np.abs(ways["field"].coverage[k] - true) * border_band(true > 0.5)
        side = min(CROP, *wrong.shape)
        sums = np.pad(wrong.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
        in_crop = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
        top, left = np.unravel_index(in_crop.argmax(), in_crop.shape)
        here = slice(top, top + side), slice(left, left + side)
        pictures = [evidence.photo / 255, *(ways[way].recolored[edit] for way in ("field", "photo"))]
        result[name] = (float(in_crop.max()), [picture[here] for picture in (*pictures, truth.recolored(edit)[number])])
    return result


def report(scene: str, rows: dict) -> None:
    """Print a scene's table: a block a row of it, a line an object."""
    print(f"\n{scene:20}" + " ".join(f"{title:>11}" for title in TITLES.values()))
    for way, objects in rows.items():
        for name, figures in objects.items():
            cells = [f"{figures[key]:.4g}" if key in figures else "" for key in TITLES]
            print(f"{way + ' ' + name:20}" + " ".join(f"{cell:>11}" for cell in cells), flush=True)


def compare(table: dict) -> None:
    """Print what edges=photo gains over edges=field."""
    gains = {
        f"{scene} {name}": rows["photo"][name]["iou"] - rows["field"][name]["iou"]
        for scene, rows in table.items()
        for name in rows["photo"]
        if name != "mean"
    }
    worst = min(gains, key=gains.__getitem__)
    mean = np.mean(list(gains.values()))
    print(
        f"\nIoU, photo over field: mean {mean:+.4f} (wanted +0.02), least {gains[worst]:+.4f} of {worst} (wanted -0.003)"
    )


if __name__ == "__main__":
    main()
