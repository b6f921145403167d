"""Learn, recolor and judge the benchmark captures: OUT/benchmark.json, and of each scene a summary and pictures.

    .venv/engine/bin/python -m tools.scenes.judge_scenes CAPTURES [SCENE ...] --out OUT [--marks] [--preset demo]
        [--threads N]

CAPTURES/<scene> is what `tools/scenes/make_captures.py` wrote. The engine sees the training photos and one rough mask
of each object. Only held-out test views count. Recolors are those of the photos with mattes (`photo`), as the render
stage makes them, of one who knows a color pair for each paint, read in the reference view; beside them those of one who
knows one pair an object (`one pair`), and then also with the field's masks instead of mattes (`field`). --marks also
draws one and two strokes an object in suggested views and in random ones. In the same OUT only what has changed is
learned again. OUT/worst.png shows the five scenes whose recolors are farthest from the truth, each in its worst view:
photo, learned render, what the masks have too much (red) and miss (blue), our recolor, the true one.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

import imageio.v3 as iio
import numpy as np

import karf_engine as karf
from karf_engine.compute.progress import TerminalEmit
from karf_engine.io.files import write_json
from karf_engine.io.images import write_png
from karf_engine.metrics.images import mse_outside
from karf_engine.project.settings import PRESETS, with_overrides
from karf_engine.recolor.field_rendering import photo_frame

from ..judging.causes import split_by_cause
from ..judging.recolors import contact_sheet, edit_to_judge, score_edits, score_scene, worst_row
from ..judging.scores import rounded, score_objects, stage_summary
from ..judging.sheets import write_sheet
from ..judging.truth import Truth
from ..judging.views import TestViews, learn_again, render_test_views, with_model
from ..marking.strokes import iou_after_marks

# figure -> (title, target, whether it shall be as high or as low)
FIGURES = {
    "psnr": ("PSNR", None, None),
    "iou": ("IoU", None, None),
    "iou_border_excluded": ("border left out", 0.97, "at least"),
    "iou_ceiling": ("ceiling", None, None),
    "iou_below_ceiling": ("below ceiling", 0.02, "at most"),
    "iou_photo": ("IoU, photo", None, None),
    "ciede2000": ("CIEDE2000", 4.0, "at most"),
    "ciede2000_one_pair": ("one pair", None, None),
    "ciede2000_field": ("field", None, None),
    "ciede2000_hue_shift_of_paints": ("hue shift", None, None),
    "ciede2000_hue_shift": ("one pair", None, None),
    "ciede2000_no_edit": ("no edit", None, None),
    "mse_outside": ("MSE outside", 5e-5, "at most"),
    "mse_outside_field": ("field", 5e-5, "at most"),
    "mse_outside_of_truth": ("of the truth", None, None),
}
CAUSES = ("bound", "mask", "rule", "palette", "weights", "light")  # see `judging.causes.Causes`
MARKS = {
    "iou_labels": "labels",
    "iou_suggested_1": "1 suggested",
    "iou_suggested_2": "2 suggested",
    "iou_random_1": "1 random",
    "iou_random_2": "2 random",
}
HIGHER_IS_BETTER = ("psnr", "iou", "iou_border_excluded", "iou_ceiling", "iou_photo", *MARKS)
SHEET_SCENES = 5  # in the picture of the worst
MEANS = {"mean": np.mean, "median": np.median}


def main() -> None:
    options = parse_arguments()
    table = {}
    found = sorted(path.parent.name for path in options.captures.glob("*/edits.json"))
    # print has a judge of its own, `judging.packaging`: its photos are larger than what presets learn from
    scenes = options.scenes or [name for name in found if not (options.captures / name / "print").exists()]
    for scene in scenes:
        check_size(options.captures / scene, options)
    for scene in scenes:
        summary = judge(options.captures / scene, options.out / scene, options)
        table[scene] = figures(summary)
        print(f"{scene}: {rounded(table[scene])}", flush=True)
    table |= means_of(table)
    targets = {key: {direction: target} for key, (_, target, direction) in FIGURES.items() if direction}
    write_json(options.out / "benchmark.json", rounded({"preset": options.preset, "targets": targets, "scenes": table}))
    report(table)
    worst = sorted(scenes, key=lambda scene: -table[scene]["ciede2000"])[:SHEET_SCENES]
    rows = [[iio.imread(options.out / scene / "worst_view.png") / 255] for scene in worst]
    write_sheet(options.out / "worst.png", rows)


def check_size(capture: Path, options: argparse.Namespace) -> None:
    """End before anything is learned where photos are larger than what is learned from: true masks have the photos' size."""
    learned = with_overrides(PRESETS[options.preset], options.overrides).geometry.long_side
    side = max(Truth(capture).labels("test")[0].shape)
    if side > learned:
        raise SystemExit(
            f"{capture}: photos of {side} pixels, and the preset {options.preset} learns from {learned}: they cannot be judged "
            f"here. Add --set geometry.long_side={side}, or learn by karf all and judge by tools.judging."
        )


def means_of(table: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
    """The rows below the scenes: mean, median and the worst of each figure."""
    columns = {key: [row[key] for row in table.values()] for key in next(iter(table.values()))}
    worst = {key: (min if key in HIGHER_IS_BETTER else max)(column) for key, column in columns.items()}
    means = {name: {key: float(take(column)) for key, column in columns.items()} for name, take in MEANS.items()}
    return means | {"worst": worst}


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path, help="folder of the captures")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all that are there")
    parser.add_argument("--out", type=Path, required=True, help="folder for everything written")
    parser.add_argument("--preset", default="demo", choices=tuple(PRESETS))
    parser.add_argument("--set", dest="overrides", action="append", default=[], metavar="STAGE.FIELD=VALUE")
    parser.add_argument("--marks", action="store_true", help="also draw strokes in suggested and in random views")
    parser.add_argument("--threads", type=int)
    return parser.parse_args()


def judge(capture: Path, out: Path, options: argparse.Namespace) -> dict:
    """Learn one scene, recolor its test views and write what they are worth; returns the summary."""
    model = karf.learn(
        capture,
        capture / "coarse_masks" / "one",
        project=out / "project",
        preset=options.preset,
        overrides=options.overrides,
        threads=options.threads,
        emit=TerminalEmit(),
    )
    test, truth = render_test_views(model), Truth(capture)
    long_side = model.settings.geometry.long_side
    photos = TestViews(
        model,
        test.training_images,
        [model.preview(training_image.view, long_side) for training_image in test.training_images],
    )
    true_masks = truth.masks("test")
    summary = stage_summary(model.project) | score_scene(test, truth) | score_objects(test, true_masks)
    summary |= score_objects(photos, true_masks, "_photo")
    summary |= score_objects(ceiling(test, truth, out / "scratch", options.threads), true_masks, "_ceiling")
    field = TestViews(
        model,
        test.training_images,
        [photo_frame(model, training_image) for training_image in test.training_images],
    )
    ways = {"": (photos, True), "_one_pair": (photos, False), "_field": (field, False)}
    for suffix, (views, per_paint) in ways.items():
        recolor(views, truth, per_paint, out / f"frames{suffix}")
        scores = score_edits(truth, views, out / f"frames{suffix}")
        summary |= {f"{key}{suffix}": value for key, value in scores.items()}
    summary |= {"mse_outside_of_truth": true_change_outside(truth, test), "causes": causes(photos, truth)}
    if options.marks:
        summary["marks"] = marks(model.project.folder, capture)
    write_json(out / "summary.json", rounded(summary))
    contact_sheet(out / "frames", out / "contact_sheet.png", test, truth)
    write_sheet(out / "worst_view.png", [worst_row(out / "frames", photos, truth)])
    return summary


def recolor(views: TestViews, truth: Truth, per_paint: bool, out: Path) -> None:
    """Write each edit's frames of the test views: OUT/<edit>/recolor/<view>.png."""
    for name in truth.edits:
        edit = edit_to_judge(views.model, truth, name, per_paint)
        for training_image, frame in zip(views.training_images, views.frames, strict=True):
            write_png(out / name / "recolor" / f"{training_image.view.name}.png", views.model.composite(frame, edit))


def causes(photos: TestViews, truth: Truth) -> dict[str, float]:
    """What lies between our recolors and the true ones by cause, means over the edits."""
    model = photos.model
    edits = {name: edit_to_judge(model, truth, name, per_paint=True) for name in truth.edits}
    found = [asdict(split_by_cause(model, truth, photos.frames, edit, name)["all"]) for name, edit in edits.items()]
    return {key: float(np.mean([each[key] for each in found])) for key in CAUSES}


def marks(project: Path, capture: Path) -> dict[str, float]:
    """Mean IoU of the labels as learned, and after strokes in views that are suggested or drawn at random."""
    before, after = iou_after_marks(project, capture, ("suggested", "random"))
    return dict(zip(MARKS, (before, *after["suggested"], *after["random"]), strict=True))


def ceiling(test: TestViews, truth: Truth, scratch: Path, threads: int | None) -> TestViews:
    """The same field trained on the true masks of all training views."""
    masks = truth.write_training_masks(scratch / "true_masks")
    overrides = ["segmentation.labels=votes"]
    return with_model(test, learn_again(test.model, scratch / "ceiling", overrides, ("segmentation",), masks, threads))


def true_change_outside(truth: Truth, test: TestViews) -> float:
    """What the true recolors change outside the edited objects: reflected light, and pixels that a border cuts."""
    changes = []
    for name in truth.edits:
        for frame, inside, recolored in zip(test.frames, truth.inside(name), truth.recolored(name), strict=True):
            changes.append(mse_outside(recolored, frame.base, inside))
    return float(np.mean(changes))


def figures(summary: dict) -> dict[str, float]:
    """The row of one scene, means over its objects, edits and test views."""
    mean = summary["ciede2000"]["mean"]
    iou, highest = summary["iou"]["mean"], summary["iou_ceiling"]["mean"]
    row = {
        "psnr": summary["psnr_full"],
        "iou": iou,
        "iou_border_excluded": summary["iou_border_excluded"]["mean"],
        "iou_ceiling": highest,
        "iou_below_ceiling": highest - iou,
        "iou_photo": summary["iou_photo"]["mean"],
        "ciede2000": mean["ours"],
        "ciede2000_one_pair": summary["ciede2000_one_pair"]["mean"]["ours"],
        "ciede2000_field": summary["ciede2000_field"]["mean"]["ours"],
        "ciede2000_hue_shift_of_paints": mean["hue_shift_of_paints_in_true_mask"],
        "ciede2000_hue_shift": mean["hue_shift_in_true_mask"],
        "ciede2000_no_edit": mean["no_edit"],
        "mse_outside": mean["mse_outside"],
        "mse_outside_field": summary["mse_outside_field"],
        "mse_outside_of_truth": summary["mse_outside_of_truth"],
    }
    return row | summary["causes"] | summary.get("marks", {})


def report(table: dict[str, dict[str, float]]) -> None:
    """Print the figures with their targets, what CIEDE2000 consists of, and what marks are worth."""
    wanted = {key: f"{direction} {target:g}" for key, (_, target, direction) in FIGURES.items() if direction}
    print_table({key: title for key, (title, _, _) in FIGURES.items()}, table)
    print(" ".join(f"{cell:>15}" for cell in ["target", *(wanted.get(key, "") for key in FIGURES)]))
    print_table({cause: cause for cause in CAUSES}, table)
    if set(MARKS) <= set(next(iter(table.values()))):
        print_table(MARKS, table)


def print_table(titles: dict[str, str], table: dict[str, dict[str, float]]) -> None:
    """Print these figures of all rows."""
    print("\n" + " ".join(f"{title:>15}" for title in ["", *titles.values()]))
    for scene, row in table.items():
        print(" ".join(f"{cell:>15}" for cell in [scene, *(f"{row[key]:.4g}" for key in titles)]))


if __name__ == "__main__":
    main()
