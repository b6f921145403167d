"""Judge edges in the photos' own size, ours beside the field's: OUT/edges.json, and crops of each scene.

    .venv/engine/bin/python -m tools.scenes.judge_edges CAPTURES LEARNED [SCENE ...] --out OUT [--larger LEARNED]

CAPTURES/<scene> is a capture with truth: test views at a larger size and their coverage (`make_captures --full`), or
one as it is otherwise, whose labels then stand for the coverage. LEARNED/<scene> is its project, or has it in
`project`; it may have been learned from any capture of the same views. With --larger, projects that were learned from
larger photos.

Rows: `field` (the field's probabilities, enlarged: edges=field), `photo` (ours: edges=photo), `larger` (the field as
learned from larger photos), `truth` (the true coverage). Edits are those of the capture, from one color pair an object.
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
from karf_engine.io.color import to_bytes
from karf_engine.io.files import write_json
from karf_engine.metrics.images import mse_outside
from karf_engine.palettes.palette import Edit
from karf_engine.recolor.full_resolution import PhotoView
from karf_engine.recolor.matting.matte import Matte, dense_coverage
from karf_engine.recolor.model import Model
from karf_engine.recolor.photos import StoredPhoto, open_photo

from ..judging.edges import BAND, EdgeScore, border_band, mean_scores, score_edges
from ..judging.matting_ways import WAYS, Evidence, larger_field
from ..judging.recolors import edit_to_judge
from ..judging.scores import rounded
from ..judging.sheets import square_of_most, write_sheet
from ..judging.truth import Truth
from ..judging.views import project_of

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
class Scene:
    """A capture with truth, what was learned of it, maybe also from larger photos, and the edits by name."""

    truth: Truth
    model: Model
    larger: Model | None
    edits: dict[str, Edit]

    def changed(self, edit: str) -> list[int]:
        """Numbers of the objects that an edit changes."""
        return [k for k, name in enumerate(self.model.objects) if name in self.truth.edits[edit]["objects"]]


@dataclass(frozen=True)
class JudgedView:
    """A test view: the photo, what ways to mattes know of it, and the true recolor of each edit."""

    photo: StoredPhoto
    evidence: Evidence
    recolored: dict[str, np.ndarray]


@dataclass(frozen=True)
class Result:
    """What one way came to in one view: coverage [K, H, W], the recolor of each edit, seconds that the mattes took."""

    coverage: np.ndarray
    recolored: dict[str, np.ndarray]
    seconds: float


@dataclass(frozen=True)
class Score:
    """What a result is worth: each object's edges, and MSE outside the objects of an edit, mean over edits."""

    objects: dict[str, EdgeScore]
    mse_outside: float
    seconds: float


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


def judge(capture: Path, project: Path, larger: Path | None, options: argparse.Namespace) -> dict:
    """Judge every row in every test view of a capture, write the crops, and return the means of each row."""
    model, truth = karf.load(project), Truth(capture)
    edits = {name: edit_to_judge(model, truth, name) for name in truth.edits}
    scene = Scene(truth, model, karf.load(larger) if larger else None, edits)
    ways = {name: WAYS[name] for name in options.rows} | ({"larger": larger_field} if larger else {})
    scores: dict[str, list[Score]] = {name: [] for name in ways}
    crops: list[dict[str, Crop]] = []
    for number, view in enumerate(karf.open_capture(capture).split("test")):
        judged = look_at(scene, view, number)
        results = {name: result_of(scene, judged, way) for name, way in ways.items()}
        for name, result in results.items():
            scores[name].append(score(scene, judged, result))
        if {"field", "photo"} <= set(ways):
            crops.append(crops_of(scene, judged, results))
    if crops:
        worst = [max((crop[name] for crop in crops), key=lambda crop: crop.wrong) for name in model.objects]
        write_sheet(options.out / f"{capture.name}.png", [crop.pictures for crop in worst])
    return {name: mean_of_views(views, model.objects) for name, views in scores.items()}


def look_at(scene: Scene, view: View, number: int) -> JudgedView:
    """A test view and its truth; number: its place among the test views."""
    photo, model, larger = open_photo(view.image), scene.model, scene.larger
    seen = model.render_field(model.working_camera(view))
    evidence = Evidence(
        photo=photo.over_white(),
        probabilities=seen.probabilities,
        rendered=to_bytes(seen.color),
        larger=larger.render_field(larger.working_camera(view)).probabilities if larger else None,
        coverage=np.stack([scene.truth.coverage(name)[number] for name in model.objects]),
    )
    return JudgedView(photo, evidence, {name: scene.truth.recolored(name)[number] for name in scene.edits})


def result_of(scene: Scene, view: JudgedView, way: Callable[[Evidence], list[Matte]]) -> Result:
    """Make the mattes of a view in one way, and recolor it by them."""
    start = time.process_time()
    mattes = way(view.evidence)
    seconds = time.process_time() - start
    ready = PhotoView(view.photo, 1, scene.model.objects, mattes, scene.model.palettes)
    recolored = {name: ready.over_white(ready.recolor(edit)) for name, edit in scene.edits.items()}
    return Result(dense_coverage(mattes, view.evidence.photo.shape[:2]), recolored, seconds)


def score(scene: Scene, view: JudgedView, result: Result) -> Score:
    """Compare a result with the truth; outside an edit's objects with the photo."""
    true, photo, objects, outside = view.evidence.coverage, view.evidence.photo / np.float32(255), {}, []
    for k, name in enumerate(scene.model.objects):
        edits = [edit for edit in scene.edits if k in scene.changed(edit)]
        pictures = [result.recolored[edit] for edit in edits], [view.recolored[edit] for edit in edits]
        objects[name] = score_edges(result.coverage[k], true[k], *pictures)
    for edit, picture in result.recolored.items():
        outside.append(mse_outside(picture, photo, (true[scene.changed(edit)] > 0).any(0)))
    return Score(objects, float(np.mean(outside)), result.seconds)


def mean_of_views(views: list[Score], objects: list[str]) -> dict:
    """Means over the views, of each object, and over objects."""
    table = {name: mean_scores([view.objects[name] for view in views]) for name in objects}
    known = {key: [row[key] for row in table.values() if key in row] for key in EdgeScore.__dataclass_fields__}
    table["mean"] = {key: float(np.mean(values)) for key, values in known.items() if values}
    table["mean"] |= {"mse_outside": float(np.mean([view.mse_outside for view in views]))}
    table["mean"] |= {"seconds": float(np.mean([view.seconds for view in views]))}
    return table


# --------------------------------------------------------------------------------------------------------------- results
@dataclass(frozen=True)
class Crop:
    """Photo, field, ours and truth in a square, and how wrong the field is near the border there."""

    wrong: float
    pictures: list[np.ndarray]


def crops_of(scene: Scene, view: JudgedView, results: dict[str, Result]) -> dict[str, Crop]:
    """Of each object the square in which the field is most wrong near the border."""
    crops = {}
    for k, name in enumerate(scene.model.objects):
        edit = next(edit for edit in scene.edits if k in scene.changed(edit))
        true = view.evidence.coverage[k]
        wrong = np.abs(results["field"].coverage[k] - true) * border_band(true > 0.5)
        here, most = square_of_most(wrong, CROP)
        recolors = results["field"].recolored[edit], results["photo"].recolored[edit], view.recolored[edit]
        crops[name] = Crop(most, [picture[here] for picture in (view.evidence.photo / 255, *recolors)])
    return crops


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
