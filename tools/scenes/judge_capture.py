"""Judge geometry, splats and masks of a real capture: OUT/summary.json and OUT/contact_sheet.png.

    .venv/engine/bin/python -m tools.scenes.judge_capture CAPTURE [--truth MASKS] --out OUT [--seed N]

Every 8th photo is held out where the capture declares none, and judged. MASKS/<object>/<split>/<photo stem>.png (or
without the split) are the true masks. One of each object is drawn over as a hasty hand would, and is all that the engine
sees; the ceiling is the same field trained on the true masks of all training views. Another seed draws other masks: in
the same OUT only what depends on them is learned again. Without MASKS there are no objects. Splats are also judged as
exposed as the photos before and after each held-out one, and voxels and splats color-corrected, with each photo's own
exposure and white balance, by which photos of a real capture differ.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import binary_opening, distance_transform_edt, gaussian_filter

import karf_engine as karf
from karf_engine.capture.capture import Capture, View
from karf_engine.capture.training_images import TrainingImage, undistort
from karf_engine.compute.progress import TerminalEmit
from karf_engine.io.files import write_json
from karf_engine.io.images import read_mask, resize, write_png
from karf_engine.metrics.images import cc_psnr
from karf_engine.metrics.masks import iou
from karf_engine.project.settings import PRESETS
from karf_engine.recolor.model import Model
from karf_engine.segmentation.report import SegmentationReport
from karf_engine.segmentation.views import farthest_point_views
from karf_engine.splats.files import load_gaussians

from ..judging import HOLDOUT
from ..judging.scores import print_common, rounded, score_objects, score_renders, stage_summary
from ..judging.sheets import difference, sheet_numbers, tinted, write_sheet
from ..judging.views import TestViews, learn_again, mask_file, render_test_views, with_model

KINDS = ("blob", "chunk", "spill")
DISK = 0.38  # radius of a missing chunk or a spill, in radii of a disk as large as the object


def main() -> None:
    options = parse_arguments()
    report(options.out, judge(options))


def judge(options: argparse.Namespace) -> dict[str, Any]:
    """Learn a capture, judge it in its held-out views, and write summary and sheet; returns the summary.

    options: those of `parse_arguments`.
    """
    drawn = {}
    if options.truth is not None:
        capture = karf.open_capture(options.capture, holdout=HOLDOUT)
        drawn = draw_masks(capture, options.truth, options.out / "coarse_masks", options.seed, options.masks_each)
    test = render_test_views(learn(options, bool(drawn)))
    truth = {
        name: [true_mask(options.truth, name, training_image) for training_image in test.training_images]
        for name in test.model.objects
    }
    summary = {"capture": str(options.capture)} | stage_summary(test.model.project)
    summary |= score_renders(test) | {"splats": score_splats(test)}
    if drawn:
        summary |= {"seed": options.seed, "coarse_masks": drawn} | score_masks(options, test, truth)
    write_json(options.out / "summary.json", rounded(summary))
    contact_sheet(options.out / "contact_sheet.png", test, truth)
    return rounded(summary)


def learn(options: argparse.Namespace, is_marked: bool) -> Model:
    """The capture's geometry and splats, and where masks were drawn its segmentation."""
    project, run = options.out / "project", {"threads": options.threads, "emit": TerminalEmit()}
    settings = {"preset": options.preset, "overrides": options.overrides, "holdout": HOLDOUT}
    karf.learn_geometry(options.capture, project=project, **settings, **run)
    karf.learn_splats(project, **run)
    if is_marked:
        karf.segment(project, options.out / "coarse_masks", **run)
    return karf.load(project)


def score_splats(test: TestViews) -> dict[str, float]:
    """PSNR of held-out photos as splats show them, mean and worst, as exposed as the photos beside them, and color-corrected."""
    names, project = ("psnr", "psnr_worst", "psnr_exposed", "psnr_exposed_worst"), test.model.project
    done = project.finished("splats")
    if done is None:
        return {}
    _, learned = done.get("held_out", ((), ()))
    return dict(zip(names, learned, strict=False)) | corrected_splats(test)


def corrected_splats(test: TestViews) -> dict[str, float]:
    """PSNR of color-corrected splats in the test views, mean and worst, at the size of the training images."""
    from karf_engine.splats.rasterizer import rasterize  # needs numba

    gaussians = load_gaussians(test.model.project.splats_file)
    values = [
        cc_psnr(rasterize(gaussians, image.camera).image[..., :3].clip(0, 1), frame.base)
        for image, frame in zip(test.training_images, test.frames, strict=True)
    ]
    return {"cc_psnr": float(np.mean(values)), "cc_psnr_worst": float(np.min(values))}


def score_masks(options: argparse.Namespace, test: TestViews, truth: dict[str, list[np.ndarray]]) -> dict[str, Any]:
    """The masks of one drawn mask an object, and those of the ceiling."""
    model = test.model
    scores = {"precision": SegmentationReport.read(model.project.segmentation_report).precision}
    scores |= score_objects(test, truth) | {"views": iou_of_views(test, truth)}
    true_masks = gather_training_masks(model.capture, options.truth, options.out / "scratch" / "true_masks")
    overrides = ["segmentation.labels=votes"]
    folder, stages = options.out / "scratch" / "ceiling", ("segmentation",)
    ceiling = learn_again(model, folder, overrides, stages, true_masks, options.threads)
    return scores | score_objects(with_model(test, ceiling), truth, "_ceiling")


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path, help="folder or file with photos and camera poses")
    parser.add_argument("--truth", type=Path, help="true masks: <object>[/<split>]/<photo stem>.png")
    parser.add_argument("--out", type=Path, required=True, help="folder for everything written")
    parser.add_argument("--preset", default="demo", choices=tuple(PRESETS))
    parser.add_argument("--set", dest="overrides", action="append", default=[], metavar="STAGE.FIELD=VALUE")
    parser.add_argument("--seed", type=int, default=0, help="of the drawn masks: views, kinds and borders")
    parser.add_argument("--masks-each", type=int, default=1, help="training views with a mask for each object")
    parser.add_argument("--threads", type=int)
    return parser.parse_args()


# ---------------------------------------------------------------------------------------------------------- coarse masks
def draw_masks(capture: Capture, truth: Path, folder: Path, seed: int, masks_each: int) -> dict[str, list[dict]]:
    """Write coarse masks of every object in `truth`, and tell of each: view, kind of flaw, IoU with the truth."""
    shutil.rmtree(folder, ignore_errors=True)
    drawn: dict[str, list[dict]] = {}
    for number, path in enumerate(sorted(p for p in truth.iterdir() if p.is_dir())):
        random = np.random.default_rng((seed, number))
        drawn[path.name] = []
        for place, view in enumerate(choose_views(capture, path, random, masks_each)):
            kind = KINDS[(seed + number + place) % len(KINDS)]
            exact = read_mask(mask_file(path, view))
            mask = coarse_mask(exact, kind, random)
            write_png(folder / path.name / f"{view.stem}.png", mask)
            drawn[path.name].append({"view": view.name, "kind": kind, "iou": round(iou(mask, exact), 3)})
            print(f"mask of {path.name}: {view.name}, {kind}, IoU {drawn[path.name][-1]['iou']}", flush=True)
    return drawn


def choose_views(capture: Capture, masks: Path, random: np.random.Generator, count: int) -> list[View]:
    """Training views that show more of the object than the median: one drawn at random, others far from it."""
    views = [view for view in capture.split("train") if mask_file(masks, view).exists()]
    areas = np.array([read_mask(mask_file(masks, view)).sum() for view in views])
    large = [view for view, area in zip(views, areas, strict=True) if area > np.median(areas)]
    first = large[random.integers(len(large))]
    return farthest_point_views(large, [first.name], count)


def coarse_mask(truth: np.ndarray, kind: str, random: np.random.Generator) -> np.ndarray:
    """A mask as a hasty hand draws it, bool [H, W]: a wavy border, and a chunk missing or a spill across the border.

    Errors are in proportion to the picture's height: 3 pixels of 200.
    """
    pixel = len(truth) / 200
    distance = np.where(truth, distance_transform_edt(truth) - 0.5, 0.5 - distance_transform_edt(~truth))
    noise = gaussian_filter(random.standard_normal(truth.shape), 8 * pixel)
    moved = distance + pixel * (3 * noise / noise.std() + random.uniform(-1.5, 3.5))
    mask = binary_opening(moved > 0, iterations=max(1, round(pixel)))
    border = np.argwhere(truth & (distance < 1))
    row, column = border[random.integers(len(border))]
    rows, columns = np.indices(truth.shape)
    disk = np.hypot(rows - row, columns - column) < DISK * np.sqrt(truth.sum() / np.pi)
    return {"blob": mask, "chunk": mask & ~disk, "spill": mask | disk}[kind]


# ----------------------------------------------------------------------------------------------------------------- truth
def true_mask(truth: Path, object_name: str, training_image: TrainingImage) -> np.ndarray:
    """The true mask at the training image's working size; empty where there is no file."""
    path, camera = mask_file(truth / object_name, training_image.view), training_image.camera
    if not path.exists():
        return np.zeros((camera.height, camera.width), bool)
    values, _, _ = undistort(read_mask(path).astype(np.float32)[..., None], training_image.view.camera)
    return resize(values, camera.width, camera.height)[..., 0] >= 0.5


def gather_training_masks(capture: Capture, truth: Path, folder: Path) -> Path:
    """Copy the true masks of all training views to FOLDER/<object>/<photo stem>.png; returns the folder."""
    shutil.rmtree(folder, ignore_errors=True)
    for masks in (path for path in truth.iterdir() if path.is_dir()):
        (folder / masks.name).mkdir(parents=True)
        for view in capture.split("train"):
            source = mask_file(masks, view)
            if source.exists() and read_mask(source).any():
                shutil.copyfile(source, folder / masks.name / source.name)
    return folder


# --------------------------------------------------------------------------------------------------------------- results
def iou_of_views(test: TestViews, truth: dict[str, list[np.ndarray]]) -> dict[str, dict[str, float]]:
    """IoU of each object in each test view that shows it: true masks of real photos may be wrong themselves."""
    views = [training_image.view.stem for training_image in test.training_images]
    return {
        name: {
            view: iou(own, true)
            for view, own, true in zip(views, test.masks(name), truth[name], strict=True)
            if true.any()
        }
        for name in test.model.objects
    }


def contact_sheet(path: Path, test: TestViews, truth: dict[str, list[np.ndarray]]) -> None:
    """Columns: photo, learned render, and of objects the masks over the photo, and where they differ from the truth."""
    write_sheet(path, [sheet_row(test, truth, number) for number in sheet_numbers(len(test.frames))])


def sheet_row(test: TestViews, truth: dict[str, list[np.ndarray]], number: int) -> list[np.ndarray]:
    """The pictures of one test view in the contact sheet."""
    frame = test.frames[number]
    if not test.model.objects:
        return [frame.base, frame.color]
    exact = np.stack([truth[name][number] for name in test.model.objects])
    return [frame.base, frame.color, tinted(frame.base, frame.masks), difference(frame.base, frame.masks, exact)]


def report(out: Path, summary: dict) -> None:
    """Print the figures, and where they are."""
    seconds = "  ".join(f"{name} {value}" for name, value in summary["stage_seconds"].items())
    print(f"\nseconds            {seconds}; peak memory {summary['peak_memory'] / 2**30:.2f} GiB")
    print_common(summary)
    print("splats             " + "  ".join(f"{name} {value}" for name, value in summary["splats"].items()))
    precision = summary.get("precision", {})
    print("precision          " + "  ".join(f"{name} {value}" for name, value in precision.items()))
    print(f"\nsheet      {out / 'contact_sheet.png'}\nfigures    {out / 'summary.json'}")


if __name__ == "__main__":
    main()
